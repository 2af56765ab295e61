//! The experiment files that come with the project can be used as they are.

use evodrive::ego::network::Mlp;
use evodrive::ego::{Policy, Setting, Weights};
use evodrive::evaluation::EvaluationOptions;
use evodrive::experiment::{Experiment, SceneSource, composed};
use evodrive::families::sources;
use evodrive::kernel::{Digest, Threads};
use evodrive::objects::{FamilyName, LineageId};
use evodrive::sim;
use evodrive::stage::Asks;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

fn files(folder: &str) -> Vec<PathBuf> {
    let dir = crate::harness::home().join(folder);
    let mut found: Vec<PathBuf> = std::fs::read_dir(dir)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|e| e == "toml"))
        .collect();
    found.sort();
    found
}

fn asks(family: &FamilyName) -> Asks {
    sources().get(family).map(|source| source.asks).unwrap_or_default()
}

fn read(path: &Path) -> Experiment {
    Experiment::read(path).unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn a_note_on_a_seed_goes_with_its_own_file_and_seeds_alone_and_moves_no_digest() {
    let dir = tempfile::tempdir().unwrap();
    let (own, above) = (dir.path().join("own.toml"), dir.path().join("above.toml"));
    let quickstart = crate::harness::text("experiments/quickstart.toml");
    let note = |path: &Path, set: &[&str]| {
        let set: Vec<String> = set.iter().map(|of| of.to_string()).collect();
        Experiment::read_under(path, &set).unwrap_or_else(|error| panic!("{error}"))
    };
    std::fs::write(&own, &quickstart).unwrap();
    std::fs::write(&above, "base = \"own.toml\"\nname = \"above\"\n").unwrap();
    let plain = note(&own, &[]);
    assert!(plain.seed_note.as_ref().is_some_and(|note| note.contains("chosen of twenty")));
    assert_eq!(note(&own, &["budget.slots=2"]).seed_note, plain.seed_note);
    for other in ["seed=2", "seeds=5", "models.scripted.sampling.seed=3", "scenes.seed=8"] {
        assert_eq!(note(&own, &[other]).seed_note, None, "{other}");
    }
    assert_eq!(note(&above, &[]).seed_note, None, "another experiment");
    let said = note(&own, &["seed_note=another word"]);
    assert_eq!((said.seed_note.as_deref(), said.digest().unwrap()), (Some("another word"), plain.digest().unwrap()));
}

#[test]
fn what_describes_a_base_does_not_describe_what_stands_above_it() {
    let dir = tempfile::tempdir().unwrap();
    let (own, above) = (dir.path().join("own.toml"), dir.path().join("above.toml"));
    std::fs::write(&own, crate::harness::text("experiments/quickstart.toml")).unwrap();
    let described = |text: &str, set: &[&str]| {
        std::fs::write(&above, text).unwrap();
        let set: Vec<String> = set.iter().map(|of| of.to_string()).collect();
        Experiment::read_under(&above, &set).unwrap_or_else(|error| panic!("{error}")).describes
    };
    let silent = "base = \"own.toml\"\nname = \"above\"\n";
    assert_eq!(described(silent, &[]), "based on own.toml");
    assert_eq!(described(silent, &["budget.slots=2"]), "based on own.toml");
    let telling = format!("{silent}describes = \"another\"\n");
    assert_eq!(described(&telling, &["budget.slots=2"]), "another");
    assert_eq!(described(&telling, &["describes=typed"]), "typed");
}

#[test]
fn every_experiment_file_is_read_and_names_families_and_parameters_that_exist() {
    let folders = ["", "/ablations", "/llm", "/metadrive", "/readings", "/safebench", "/world"]
        .map(|of| format!("experiments{of}"));
    let paths = folders.iter().map(|of| files(of)).collect::<Vec<_>>().concat();
    assert!(paths.len() >= 17, "{paths:?}");
    let (families, mut names) = (sources(), BTreeSet::new());
    for path in &paths {
        let experiment = read(path);
        assert!(names.insert(experiment.name.clone()), "{}: another file has this name", path.display());
        if let SceneSource::Synth { options, .. } = &experiment.scenes {
            options.check().unwrap();
        }
        for lineage in &experiment.lineages {
            let family = families.get(&lineage.family).unwrap_or_else(|| {
                panic!("{}: lineage {}: no family is called {}", path.display(), lineage.id, lineage.family)
            });
            for parameter in lineage.parent.keys() {
                assert!(family.parent.parameters.contains_key(parameter), "{}: {parameter}", path.display());
            }
            let ego = lineage.driver();
            assert!(ego.is_ok(), "{}: {}", path.display(), lineage.ego);
        }
    }
}

#[test]
fn the_metadrive_experiments_follow_the_papers_protocol_on_one_split() {
    let mut all: Vec<LineageId> = Vec::new();
    let mut shared = BTreeSet::new();
    for path in files("experiments/metadrive") {
        let experiment = read(&path);
        let stem = path.file_stem().unwrap().to_str().unwrap();
        assert_eq!(experiment.name, format!("metadrive-{stem}"));
        let SceneSource::Synth { count: 500, .. } = &experiment.scenes else { panic!("{stem}: no pool of 500") };
        let (split, budget) = (&experiment.split, &experiment.budget);
        assert_eq!((split.window, split.held_out, budget.epochs, budget.slots), (20, 100, 10, 20), "{stem}");
        assert_eq!((experiment.selector.realism_min, experiment.selector.tolerance), (0.95, 0.05), "{stem}");
        let ids = experiment.lineages.iter().map(|lineage| lineage.id.clone());
        if stem.ends_with("-idm") {
            all.extend(ids)
        }
        // Whatever decides what is measured is the same in all files, so that their rows can be compared.
        let mut table = composed(&path).unwrap().table;
        assert_eq!(table["split"]["evolution"]["count"].as_integer(), Some(240), "{stem}");
        // One search is no result: experiments/readings repeats each.
        assert_eq!(experiment.seeds, 1, "{stem}");
        for own in ["name", "describes", "cassette", "lineage"] {
            table.remove(own).unwrap();
        }
        // Who attacks is asked where LLM-Attacker takes part.
        let counselled = experiment.lineages.iter().any(|lineage| asks(&lineage.family).counsel.is_some());
        assert_eq!(table.remove("counsel").is_some(), counselled, "{stem}");
        table["roles"].as_table_mut().unwrap().remove("attacker_agent");
        shared.insert(toml::to_string(&table).unwrap());
    }
    assert_eq!(shared.len(), 1);
    all.sort();
    let sets = files("experiments/readings");
    let together = read(sets.iter().find(|path| path.ends_with("published-idm.toml")).unwrap());
    let ids: Vec<LineageId> = together.lineages.iter().map(|lineage| lineage.id.clone()).collect();
    assert_eq!((all.len(), &all), (10, &ids));
}

#[test]
fn both_readings_and_the_null_searches_share_scenes_seeds_and_lineages_and_differ_in_what_they_are_about() {
    let mut lineages: BTreeSet<Vec<LineageId>> = BTreeSet::new();
    let mut shared = BTreeSet::new();
    for path in files("experiments/readings") {
        let experiment = read(&path);
        let stem = path.file_stem().unwrap().to_str().unwrap();
        assert_eq!(experiment.name, format!("metadrive-{stem}"));
        assert_eq!((experiment.seeds, experiment.split.held_out), (10, 400), "{stem}");
        assert_eq!(experiment.archive.race, Some(0.95), "{stem}");
        assert_eq!(experiment.selector.floors(), [0.9, 0.95, 0.98], "{stem}");
        let method = experiment.search.as_ref().map(|search| search.method.name());
        let EvaluationOptions::Metadrive(evaluation) = &experiment.evaluation else { panic!("{stem}") };
        let published = evaluation.attack.counts.len() == 8;
        match stem {
            "published-idm" | "published-sac" => assert!(published && method.is_none(), "{stem}"),
            "preventable-idm" => assert!(!published && method.is_none() && experiment.fixed_bodies, "{stem}"),
            "null-random-idm" => assert!(published && method == Some("random_proposals"), "{stem}"),
            "null-shuffled-idm" => assert!(published && method == Some("shuffled_labels"), "{stem}"),
            other => panic!("{other}: unknown here"),
        }
        let ids: Vec<LineageId> = experiment.lineages.iter().map(|lineage| as_idm(lineage.id.clone())).collect();
        assert!(ids.is_sorted(), "{stem}: the order of lineages is that of the evaluator's labels");
        lineages.insert(ids);
        let mut table = composed(&path).unwrap().table;
        for own in ["name", "describes", "cassette", "lineage", "search", "fixed_bodies", "simulator", "evaluation"] {
            table.remove(own);
        }
        shared.insert(toml::to_string(&table).unwrap());
    }
    assert_eq!((lineages.len(), shared.len()), (1, 1));
}

/// The id of the same lineage against IDM.
fn as_idm(id: LineageId) -> LineageId {
    LineageId::new(id.as_str().replace("-sac", "-idm"))
}

#[test]
fn the_safebench_experiments_share_everything_but_their_sources() {
    let (mut alone, mut together): (Vec<LineageId>, Vec<Vec<LineageId>>) = Default::default();
    let mut shared = BTreeSet::new();
    for path in files("experiments/safebench") {
        let experiment = read(&path);
        let stem = path.file_stem().unwrap().to_str().unwrap();
        assert_eq!(experiment.name, format!("safebench-{stem}"));
        let SceneSource::Safebench { options, .. } = &experiment.scenes else { panic!("{stem}: other scenes") };
        options.check().unwrap();
        let (split, budget) = (&experiment.split, &experiment.budget);
        let kept = experiment.evaluation.safebench().expect("SafeBench's protocol").selected_per_group;
        assert_eq!((options.families.len(), options.routes.len(), budget.epochs), (8, 10, 4), "{stem}");
        assert_eq!(
            (kept, split.window),
            (options.draws as usize, 64 * options.draws as usize),
            "{stem}: every group whole"
        );
        assert_eq!(split.held_out, 16 * options.draws as usize, "{stem}");
        let ids = experiment.lineages.iter().map(|lineage| lineage.id.clone());
        let mut ids: Vec<LineageId> = ids.map(as_idm).collect();
        ids.sort();
        let mut table = composed(&path).unwrap().table;
        for own in ["name", "describes", "cassette", "lineage"] {
            table.remove(own).unwrap();
        }
        if stem.starts_with("preventable-") {
            assert!(experiment.fixed_bodies && experiment.simulator.of_kind, "{stem}");
            table.remove("fixed_bodies");
            table["simulator"].as_table_mut().unwrap().remove("of_kind");
            let reading = table["evaluation"]["safebench"].as_table_mut().unwrap().remove("preventable");
            assert!(reading.is_some(), "{stem}: no other reading than the published one");
        }
        // ChatScene's parent is composed; nobody else's is.
        let composes = experiment.lineages.iter().any(|lineage| asks(&lineage.family).templates.is_some());
        assert_eq!(table.remove("composition").is_some(), composes, "{stem}");
        let roles = table["roles"].as_table_mut().unwrap();
        assert_eq!(roles.remove("template_agent").is_some(), composes, "{stem}");
        shared.insert(toml::to_string(&table).unwrap());
        match experiment.lineages.len() {
            1 => alone.extend(ids),
            _ => together.push(ids),
        }
    }
    assert_eq!(shared.len(), 1);
    alone.sort();
    assert_eq!(alone.len(), 4);
    // Both egos under both readings.
    assert_eq!(together, vec![alone; 4]);
}

/// The message with which a changed copy of a file is refused.
fn refused(file: &str, change: impl Fn(String) -> String) -> String {
    let text = composed(&Path::new(env!("CARGO_MANIFEST_DIR")).join(file)).unwrap().whole_text().unwrap();
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("changed.toml");
    std::fs::write(&path, change(text)).unwrap();
    Experiment::read(&path).expect_err("a file that must be refused").to_string()
}

#[test]
fn labels_that_a_protocol_does_not_read_are_refused_and_those_that_it_reads_are_required() {
    let attack = "\n[evaluation.attack]\ncounts = [\"ego_strikes\"]\ncounts_if_avoidable = []\n";
    let unread = refused("experiments/safebench/human-idm.toml", |text| text + attack);
    assert!(unread.contains("evaluation.attack.counts") && unread.contains("remove one of the two"), "{unread}");
    let missing =
        refused("experiments/metadrive/cat-idm.toml", |text| text.replace("\ncounts_if_avoidable = ", "\n# "));
    assert!(missing.contains("evaluation.attack.counts_if_avoidable is missing"), "{missing}");
    let unasked = refused("experiments/safebench/preventable-idm.toml", |text| text.replace("of_kind = true", ""));
    assert!(unasked.contains("simulator.of_kind") && unasked.contains("evaluation.safebench.preventable"), "{unasked}");
    let unasked = refused("experiments/preventable.toml", |text| text.replace("of_place = true", ""));
    assert!(unasked.contains("simulator.of_place is missing") && unasked.contains("place_of_kind"), "{unasked}");
    let unweighed = |text: String| text.replace("place_of_kind = 0.1", "").replace("rolling = 0.1", "rolling = 0.2");
    let unweighed = refused("experiments/preventable.toml", unweighed);
    assert!(unweighed.contains("weights.place_of_kind is missing") && unweighed.contains("of_place"), "{unweighed}");
    let unknown = refused("experiments/safebench/human-idm.toml", |text| text + "\n[evaluation.nothing]\n");
    assert!(unknown.contains("evaluation.nothing is unknown"), "{unknown}");
    let without = refused("experiments/safebench/human-idm.toml", |text| text.replace("draws = 4\n", ""));
    assert!(without.contains("scenes.options.draws is missing, expected a whole number from 1 to 100"), "{without}");
}

#[test]
fn a_lineage_starts_from_published_numbers_where_its_family_has_some_and_no_other_question_hears_of_them() {
    let published = |text: String| text.replace("ego = \"idm\"", "ego = \"idm\"\npublished = true");
    let none = refused("experiments/safebench/human-idm.toml", published);
    assert!(none.contains("lineage[0].published") && none.contains("adv_traj, advsim, chatscene"), "{none}");
    let study = |file: &str, change: &dyn Fn(String) -> String| {
        let text = composed(&crate::harness::home().join(file)).unwrap().whole_text().unwrap();
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("changed.toml");
        let few = |text: String| text.replace("draws = 4", "draws = 1").replace("count = 256", "count = 64");
        let few =
            |text: String| few(text).replace("held_out = 64", "held_out = 16").replace("window = 256", "window = 64");
        std::fs::write(&path, change(few(text))).unwrap();
        let (experiment, threads) = (read(&path), Threads::new(1).unwrap());
        let pool = experiment.scenes(&[], &threads).unwrap();
        experiment.study(pool, &threads).unwrap()
    };
    let family = FamilyName::new("advsim");
    let (kept, theirs) = ("experiments/safebench/advsim-idm.toml", |text: String| published(text));
    let (own, shipped) = (study(kept, &|text| text), study(kept, &theirs));
    let kind = "shipped_speeds";
    assert!(!own.contract_texts[&family].contains(kind) && shipped.contract_texts[&family].contains(kind));
    let parents = [&own, &shipped].map(|study| study.parent(&study.lineages[0]).unwrap());
    let searches = parents.map(|parent| parent.operator_graph["search"].kind.clone());
    assert_eq!(searches, ["speed_queries", kind]);
}

#[test]
fn every_shipped_experiment_keeps_its_digest() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("experiments");
    let mut paths =
        ["experiments", "experiments/llm", "experiments/metadrive", "experiments/safebench"].map(files).concat();
    paths.sort();
    let line = |path: &PathBuf| {
        let name = path.strip_prefix(&root).unwrap().display().to_string();
        format!("{name} {}", read(path).digest().unwrap().to_hex())
    };
    insta::assert_snapshot!(paths.iter().map(line).collect::<Vec<_>>().join("\n"));
}

#[test]
fn an_experiment_of_a_set_is_short_and_its_merged_text_means_the_same() {
    for path in ["experiments/metadrive", "experiments/safebench"].map(files).concat() {
        let lines = std::fs::read_to_string(&path).unwrap().lines().count();
        assert!(lines <= 25, "{}: {lines} lines", path.display());
        let experiment = read(&path);
        let dir = tempfile::tempdir().unwrap();
        let copy = dir.path().join("experiment.toml");
        std::fs::write(&copy, &experiment.whole_text).unwrap();
        assert!(!experiment.whole_text.contains("\nbase = "), "{}", path.display());
        assert_eq!(read(&copy).digest().unwrap(), experiment.digest().unwrap(), "{}", path.display());
    }
}

/// A folder with these files, and what reading the first gives.
fn based(texts: &[(&str, &str)]) -> (tempfile::TempDir, Result<Experiment, String>) {
    let dir = tempfile::tempdir().unwrap();
    for (name, text) in texts {
        let path = dir.path().join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, text).unwrap();
    }
    let read = Experiment::read(&dir.path().join(texts[0].0)).map_err(|error| error.to_string());
    (dir, read)
}

#[test]
fn scenes_in_which_an_ego_meets_somebody_by_itself_are_left_out_where_the_experiment_says_so() {
    let quickstart = crate::harness::home().join("experiments/quickstart.toml");
    let under = |set: &[&str]| {
        let set: Vec<String> = set.iter().map(|of| of.to_string()).collect();
        Experiment::read_under(&quickstart, &set).unwrap()
    };
    let (kept, dropping) = (under(&[]), under(&["split.plain_contacts=drop"]));
    assert_eq!(kept.digest().unwrap(), under(&["split.plain_contacts=keep"]).digest().unwrap());
    assert_ne!(kept.digest().unwrap(), dropping.digest().unwrap());
    let threads = Threads::new(2).unwrap();
    let pool = kept.scenes(&[], &threads).unwrap();
    // Whom the whole rollout meets, of every scene.
    let meets = threads.map(&pool.scenes, |_, scene| {
        let plant = sim::Plant::new(scene).unwrap();
        let outcome = sim::rollout(&plant, &sim::Intervention::default(), Policy::Idm.driver().as_mut()).unwrap();
        outcome.contact.is_some().then(|| scene.id.clone())
    });
    let meets: BTreeSet<String> = meets.into_iter().flatten().collect();
    assert!(meets.len() > 2 && meets.len() < pool.scenes.len() / 2, "{meets:?}");
    assert_eq!(dropping.with_plain_contacts(&pool, &threads).unwrap(), meets);
    let ids = |experiment: &Experiment| {
        let split = experiment.split_of(&pool, &threads).unwrap();
        split.evolution.iter().chain(&split.held_out).map(|of| of.id.clone()).collect::<BTreeSet<_>>()
    };
    let (all, quiet) = (ids(&kept), ids(&dropping));
    assert!(!all.is_disjoint(&meets) && quiet.is_disjoint(&meets));
    assert_eq!(all.len(), quiet.len(), "as many as the experiment asks for");
    let most = format!("split.held_out={}", pool.scenes.len() - 60);
    let too_many = under(&["split.plain_contacts=drop", &most]).split_of(&pool, &threads).unwrap_err().to_string();
    assert!(too_many.contains(&format!("{} scenes left out", meets.len())), "{too_many}");
    let elsewhere = Experiment::read_under(
        &crate::harness::home().join("experiments/agreement/metadrive.toml"),
        &["split.plain_contacts=drop".into()],
    );
    let refused = elsewhere.unwrap().with_plain_contacts(&pool, &threads).unwrap_err().to_string();
    assert!(refused.contains("another simulator") && refused.contains("scenes filter"), "{refused}");
}

const OWN: &str = "name = \"own\"\ndescribes = \"d\"\ncassette = \"own.jsonl\"\n\
                   lineage = [{ id = \"cat-idm\", family = \"cat\", ego = \"idm\" }]\n";

#[test]
fn a_file_stands_above_its_base_and_that_above_its_own() {
    let own = format!("base = \"mid/middle.toml\"\nbudget.slots = 3\n{OWN}");
    let middle =
        "base = \"low.toml\"\nbudget = { slots = 5, epochs = 7 }\n[scenes]\nsource = \"files\"\npaths = [\"here\"]\n";
    let low = "base = \"evodrive:metadrive\"\n[split]\nevolution = { share = 0.5 }\n";
    let (dir, read) = based(&[("own.toml", &own), ("mid/middle.toml", middle), ("mid/low.toml", low)]);
    let experiment = read.unwrap();
    let budget = experiment.budget;
    assert_eq!((budget.slots, budget.epochs, budget.max_repair_rounds), (3, 7, 2));
    assert!(matches!(experiment.split.evolution, evodrive::scene::EvolutionSize::Share(share) if share == 0.5));
    // Another source replaces the base's table, and a base's paths lie beside the base.
    let SceneSource::Files { paths } = &experiment.scenes else { panic!("{:?}", experiment.scenes) };
    assert_eq!(experiment.beside(&paths[0]), dir.path().join("mid/here"));
    assert_eq!(experiment.beside(&experiment.cassette), dir.path().join("own.jsonl"));
}

/// An experiment whose lineage has this ego, beside a file of weights.
fn with_weights(bytes: &[u8], ego: &str, digest: &str) -> Result<Experiment, String> {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("mine.safetensors"), bytes).unwrap();
    let policy = format!("{{ file = \"mine.safetensors\", digest = \"{digest}\" }}");
    let text = format!(
        "base = \"evodrive:metadrive\"\nname = \"own\"\ndescribes = \"d\"\ncassette = \"own.jsonl\"\n\
         lineage = [{{ id = \"cat\", family = \"cat\", ego = \"{ego}\", policy = {policy} }}]\n"
    );
    std::fs::write(dir.path().join("own.toml"), text).unwrap();
    Experiment::read(&dir.path().join("own.toml")).map_err(|error| error.to_string())
}

#[test]
fn a_learned_ego_is_named_by_file_and_digest_and_travels_inside_the_experiment() {
    let setting = Setting::Metadrive1;
    let weights = Weights::to_bytes(setting, &Mlp::zeros(&[setting.length(), 4, 4, 4])).unwrap();
    let digest = Digest::of_bytes(&weights).to_hex();
    let experiment = with_weights(&weights, "learned", &digest).unwrap();
    let Ok(Policy::Learned(found)) = experiment.lineages[0].driver() else { panic!("a learned ego") };
    assert_eq!(found.digest.to_hex(), digest);
    // The file is gone by now: what a run folder keeps needs it no more.
    let dir = tempfile::tempdir().unwrap();
    let copy = dir.path().join("experiment.toml");
    std::fs::write(&copy, &experiment.whole_text).unwrap();
    assert_eq!(read(&copy).digest().unwrap(), experiment.digest().unwrap());

    let other = with_weights(&weights, "learned", &"0".repeat(64)).unwrap_err();
    let command = "evodrive train experiments/train/mine.toml";
    assert!(
        other.contains("lineage[0].policy.digest") && other.contains(&digest) && other.contains(command),
        "{other}"
    );
    let cut = &weights[..weights.len() - 4];
    let short = with_weights(cut, "learned", &Digest::of_bytes(cut).to_hex()).unwrap_err();
    assert!(short.contains("lineage[0].policy.file") && short.contains("header") && short.contains(command), "{short}");
    let odd = with_weights(&weights, "idm", &digest).unwrap_err();
    assert!(odd.contains("lineage[0].ego") && odd.contains("takes no policy"), "{odd}");
    let missing =
        based(&[("own.toml", &format!("base = \"evodrive:metadrive\"\n{OWN}").replace("\"idm\" }", "\"learned\" }"))]);
    assert!(missing.1.unwrap_err().contains("needs its weights"));
}

#[test]
fn circles_and_unknown_bases_are_refused_by_name() {
    let circle = based(&[("a.toml", "base = \"x/../b.toml\""), ("b.toml", "base = \"a.toml\"")]).1.unwrap_err();
    assert!(circle.contains("circle") && circle.contains("a.toml -> ") && circle.contains("b.toml -> "), "{circle}");
    let shipped = based(&[("a.toml", "base = \"evodrive:metadriv\"")]).1.unwrap_err();
    assert!(
        shipped.contains("base is \"evodrive:metadriv\"") && shipped.contains("`evodrive:metadrive`?"),
        "{shipped}"
    );
    let absent = based(&[("a.toml", "base = \"nowhere.toml\"")]).1.unwrap_err();
    assert!(absent.contains("nowhere.toml"), "{absent}");
    let number = based(&[("a.toml", "base = 3")]).1.unwrap_err();
    assert!(number.contains("base is 3, expected the name of a file"), "{number}");
}

#[test]
fn a_wrong_value_is_shown_with_the_file_that_holds_it() {
    let own = format!("base = \"base.toml\"\n{OWN}");
    let base = "base = \"evodrive:metadrive\"\n[selector]\ntolerance = 2.0\n";
    let refused = based(&[("own.toml", &own), ("base.toml", base)]).1.unwrap_err();
    assert!(refused.contains("base.toml: selector.tolerance is 2.0, expected a number from 0 to 1"), "{refused}");
}

/// The output of a command in a folder, and its exit code.
fn evodrive(dir: &Path, args: &[&str]) -> (i32, String) {
    let output =
        std::process::Command::new(env!("CARGO_BIN_EXE_evodrive")).current_dir(dir).args(args).output().unwrap();
    let text = [output.stdout, output.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned()).concat();
    (output.status.code().unwrap_or(-1), text)
}

#[test]
fn a_refused_experiment_leaves_no_file() {
    let cassette = Path::new(env!("CARGO_MANIFEST_DIR")).join("cassettes/quickstart.jsonl");
    for (table, reason) in [
        ("[selector]\ntolerance = -1.0", "selector.tolerance is -1.0, expected a number from 0 to 1"),
        ("[curation]\ndigits = 99", "curation.digits is 99, expected a whole number from 0 to 9"),
        ("[world]\nbeta_attack = 7.0", "world.beta_attack is 7.0, expected a number from 0 to 1"),
        ("[world]\nexcluded_columns = [\"nonsense\"]", "nonsense"),
        ("[scenes]\ncount = 3", "[split]"),
    ] {
        let dir = tempfile::tempdir().unwrap();
        std::fs::write(dir.path().join("own.toml"), format!("base = \"evodrive:metadrive\"\n{OWN}{table}\n")).unwrap();
        for command in ["run", "record"] {
            let (code, text) = evodrive(dir.path(), &[command, "own.toml", "--cassette", cassette.to_str().unwrap()]);
            assert_eq!(code, 2, "{table}: {text}");
            assert!(text.contains(reason), "{table}: {text}");
            let left: Vec<_> = std::fs::read_dir(dir.path()).unwrap().map(|e| e.unwrap().file_name()).collect();
            assert_eq!(left, ["own.toml"], "{table}");
        }
    }
}

#[test]
fn init_writes_a_short_file_for_every_family_that_is_read_outside_the_repository() {
    for family in sources().iter().map(|family| family.contract.family.to_string()) {
        let dir = tempfile::tempdir().unwrap();
        let (code, text) = evodrive(dir.path(), &["init", "mine", "--family", &family]);
        assert_eq!(code, 0, "{text}");
        let path = dir.path().join("mine.toml");
        assert!(std::fs::read_to_string(&path).unwrap().lines().count() <= 36, "{text}");
        assert_eq!(read(&path).lineages[0].family.as_str(), family);
        assert_eq!(evodrive(dir.path(), &["init", "mine"]).0, 2, "a file that exists is not written over");
    }
    let dir = tempfile::tempdir().unwrap();
    let (code, text) = evodrive(dir.path(), &["init", "--family", "catt"]);
    assert!(code == 2 && text.contains("did you mean `cat`?"), "{text}");
}

/// Enough of the scenes that a protocol generates can be used for its own split.
#[test]
fn a_protocol_has_scenes_enough_for_its_split() {
    let threads = Threads::new(2).unwrap();
    for name in ["metadrive/cat-idm", "worlds/scripted"] {
        let experiment = read(&crate::harness::home().join(format!("experiments/{name}.toml")));
        let pool = experiment.scenes(&[], &threads).unwrap();
        let split = experiment.split_of(&pool, &threads).unwrap_or_else(|error| panic!("{name}: {error}"));
        let asked = experiment.split.held_out + experiment.split.selection.unwrap_or(0);
        assert_eq!(split.held_out.len() + split.selection.len(), asked, "{name}");
    }
}

/// A study of several families needs no editing: each has its lineage, and what one of them asks for is there.
#[test]
fn init_takes_several_families_or_all_with_what_they_need_and_the_size_of_the_study() {
    let dir = tempfile::tempdir().unwrap();
    let made = |name: &str, args: &[&str]| {
        let (code, text) = evodrive(dir.path(), &[&["init", name], args].concat());
        assert_eq!(code, 0, "{args:?}: {text}");
        read(&dir.path().join(format!("{name}.toml")))
    };
    let families = |experiment: &Experiment| {
        experiment.lineages.iter().map(|of| of.family.to_string()).collect::<Vec<_>>().join(" ")
    };
    let some = made("some", &["--family", "king,llm_attacker", "--family", "cat", "--epochs", "2", "--slots", "3"]);
    assert_eq!(families(&some), "king llm_attacker cat");
    assert_eq!((some.budget.epochs, some.budget.slots), (2, 3));
    assert!(some.counsel.is_some(), "LLM-Attacker asks who attacks");
    let (_, enough) = evodrive(dir.path(), &["init", "enough"]);
    assert!(
        enough.contains("\na rate over 20 scenes is known to within 22 percentage points") && !enough.contains("few"),
        "{enough}"
    );
    assert!(some.split.held_out >= 20 && made("few", &["--held-out", "7"]).split.held_out == 7);
    let text = std::fs::read_to_string(dir.path().join("few.toml")).unwrap();
    assert!(text.contains("# few: a rate over 7 scenes is known to within 38 percentage points"), "{text}");
    let moving = sources()
        .iter()
        .filter(|of| of.contract.backend != "safebench")
        .map(|of| of.contract.family.to_string())
        .collect::<Vec<_>>();
    assert_eq!(families(&made("all", &["--all"])), moving.join(" "));
    let staged = made("staged", &["--family", "human", "--all"]);
    assert_eq!(families(&staged), "adv_traj advsim chatscene human");
    let pool = staged.scenes(&[], &Threads::new(1).unwrap()).unwrap();
    let split = staged.split_of(&pool, &Threads::new(1).unwrap()).unwrap();
    assert_eq!((split.held_out.len(), split.evolution.len()), (24, 40));
    for (args, said) in [
        (["--family", "cat,human"], "human beside cat, expected families of one protocol"),
        (["--family", "cat,cat"], "\"cat\" twice"),
        (["--family", "cat,kng"], "did you mean `king`?"),
        (["--held-out", "60"], "1 to 59: 60 scenes can be used"),
        (["--epochs", "0"], "--epochs is 0, expected a whole number from 1 to 1000"),
    ] {
        let (code, text) = evodrive(dir.path(), &[&["init", "bad"], args.as_slice()].concat());
        assert!(code == 2 && text.contains(said), "{args:?}: {text}");
    }
}

#[test]
fn init_names_a_planner_with_its_helper_as_the_driver() {
    let dir = tempfile::tempdir().unwrap();
    for name in ["planner.py", "evodrive_driver.py", "drives"] {
        std::fs::write(dir.path().join(name), "").unwrap();
    }
    for (driver, command, files) in [
        ("planner.py", ["python3", "planner.py"].as_slice(), ["planner.py", "evodrive_driver.py"].as_slice()),
        ("drives", &["./drives"], &["drives"]),
    ] {
        let name = format!("of-{}", driver.replace('.', "-"));
        let (code, text) = evodrive(dir.path(), &["init", &name, "--driver", driver]);
        assert_eq!(code, 0, "{text}");
        let experiment = read(&dir.path().join(format!("{name}.toml")));
        let named = experiment.driver.unwrap();
        assert_eq!(named.command, command);
        assert_eq!(named.files, files.iter().map(PathBuf::from).collect::<Vec<_>>());
        assert_eq!((experiment.lineages[0].id.as_str(), experiment.lineages[0].ego.as_str()), ("cat-mine", "command"));
    }
    let (code, text) = evodrive(dir.path(), &["init", "gone", "--driver", "planer.py"]);
    assert!(code == 2 && text.contains("--driver planer.py: no such file"), "{text}");
    let (code, text) = evodrive(dir.path(), &["init", "staged", "--driver", "planner.py", "--family", "human"]);
    assert!(code == 2 && text.contains("does not take planners"), "{text}");
}

#[test]
fn init_fits_the_split_to_ones_own_scenes_and_the_experiment_runs() {
    let dir = tempfile::tempdir().unwrap();
    let done = |args: &[&str]| {
        let (code, text) = evodrive(dir.path(), args);
        assert_eq!(code, 0, "{args:?}: {text}");
        text
    };
    std::fs::write(dir.path().join("worlds.toml"), format!("base = \"evodrive:metadrive\"\nscenes.count = 6\n{OWN}"))
        .unwrap();
    done(&["scenes", "generate", "worlds.toml", "--out", "mine.pool"]);
    let told = done(&["init", "mine", "--scenes", "mine.pool"]);
    // On the terminal, behind the file's own text.
    let (_, behind) = told.rsplit_once("# command = ").unwrap();
    assert!(behind.contains("few: a rate over 3 scenes says nearly nothing"), "{told}");
    assert!(
        behind.contains("3 held-out scenes can show that everything works") && behind.contains("cannot show"),
        "{told}"
    );
    let experiment = read(&dir.path().join("mine.toml"));
    assert_eq!((experiment.split.held_out, experiment.split.window), (3, 3));
    let path = dir.path().join("mine.toml");
    let text =
        std::fs::read_to_string(&path).unwrap().replace("epochs = 4", "epochs = 1").replace("slots = 6", "slots = 1");
    std::fs::write(&path, text).unwrap();
    let recorded = done(&["record", "mine.toml", "--no-report"]);
    let replayed = done(&["run", "mine.toml", "--no-report", "--jobs", "1"]);
    let root = |text: &str| text.lines().find(|line| line.starts_with("root: ")).map(str::to_string);
    assert!(root(&recorded).is_some());
    assert_eq!(root(&recorded), root(&replayed));
    assert_eq!(root(&done(&["check"])), root(&recorded));
    assert_eq!(root(&done(&["replay", "--jobs", "1"])), root(&recorded), "the old name still works");
}

/// A clone stays small: all cassettes together have at most 60 MB. What is over it is recorded anew by a check's full form, or packed tighter.
#[test]
fn the_cassettes_of_the_repository_stay_small() {
    fn bytes(dir: &Path) -> u64 {
        let entries = std::fs::read_dir(dir).unwrap().map(|entry| entry.unwrap());
        let of = |entry: std::fs::DirEntry| {
            if entry.file_type().unwrap().is_dir() { bytes(&entry.path()) } else { entry.metadata().unwrap().len() }
        };
        entries.map(of).sum()
    }
    let found = bytes(&crate::harness::home().join("cassettes"));
    assert!(found <= 62_000_000, "cassettes/ holds {found} bytes; expected at most 62 MB");
}
