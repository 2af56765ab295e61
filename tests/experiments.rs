//! The experiment files that come with the project can be used as they are.

use evodrive::cli::experiment::{Experiment, SceneSource};
use evodrive::families::sources;
use evodrive::objects::{FamilyName, LineageId};
use evodrive::stage::Asks;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

fn files(folder: &str) -> Vec<PathBuf> {
    let dir = Path::new(env!("CARGO_MANIFEST_DIR")).join(folder);
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
    Experiment::read(path).unwrap_or_else(|failure| panic!("{}", failure.message))
}

#[test]
fn every_experiment_file_is_read_and_names_families_and_parameters_that_exist() {
    let paths = ["experiments", "experiments/metadrive", "experiments/safebench"].map(files).concat();
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
            let ego: Result<evodrive::ego::Policy, _> = lineage.ego.parse();
            assert!(ego.is_ok(), "{}: {}", path.display(), lineage.ego);
        }
    }
}

#[test]
fn the_metadrive_experiments_follow_the_papers_protocol_on_one_split() {
    let mut all: Vec<LineageId> = Vec::new();
    let mut together: Vec<LineageId> = Vec::new();
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
        if stem == "all-idm" {
            together.extend(ids)
        } else {
            all.extend(ids)
        }
        // Whatever decides what is measured is the same in all files, so that their rows can be compared.
        let mut table: toml::Table = std::fs::read_to_string(&path).unwrap().parse().unwrap();
        assert_eq!(table["split"]["evolution"]["count"].as_integer(), Some(240), "{stem}");
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
    together.sort();
    assert_eq!((all.len(), &all), (10, &together));
}

#[test]
fn the_safebench_experiments_share_everything_but_their_sources() {
    let (mut alone, mut together, mut shared): (Vec<LineageId>, Vec<LineageId>, BTreeSet<String>) = Default::default();
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
        if stem == "all-idm" {
            together.extend(ids)
        } else {
            alone.extend(ids)
        }
        let mut table: toml::Table = std::fs::read_to_string(&path).unwrap().parse().unwrap();
        for own in ["name", "describes", "cassette", "lineage"] {
            table.remove(own).unwrap();
        }
        // ChatScene's parent is composed; nobody else's is.
        let composes = experiment.lineages.iter().any(|lineage| asks(&lineage.family).templates.is_some());
        assert_eq!(table.remove("composition").is_some(), composes, "{stem}");
        let roles = table["roles"].as_table_mut().unwrap();
        assert_eq!(roles.remove("template_agent").is_some(), composes, "{stem}");
        shared.insert(toml::to_string(&table).unwrap());
    }
    assert_eq!(shared.len(), 1);
    alone.sort();
    together.sort();
    assert_eq!((alone.len(), &alone), (4, &together));
}

/// The message with which a changed copy of a file is refused.
fn refused(file: &str, change: impl Fn(String) -> String) -> String {
    let text = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(file)).unwrap();
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("changed.toml");
    std::fs::write(&path, change(text)).unwrap();
    Experiment::read(&path).expect_err("a file that must be refused").message
}

#[test]
fn labels_that_a_protocol_does_not_read_are_refused_and_those_that_it_reads_are_required() {
    let attack = "\n[evaluation.attack]\ntarget = \"any_contact\"\n";
    let unread = refused("experiments/safebench/human-idm.toml", |text| text + attack);
    assert!(unread.contains("[evaluation.attack]") && unread.contains("remove one of the two"), "{unread}");
    let missing = refused("experiments/metadrive/cat-idm.toml", |text| text.replace(attack, "\n"));
    assert!(missing.contains("[evaluation.attack] is missing"), "{missing}");
    let unknown = refused("experiments/safebench/human-idm.toml", |text| text + "\n[evaluation.nothing]\n");
    assert!(unknown.contains("nothing"), "{unknown}");
    let without = refused("experiments/safebench/human-idm.toml", |text| text.replace("draws = 4\n", ""));
    assert!(without.contains("draws"), "{without}");
}
