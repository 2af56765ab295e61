//! A program leaves its run as a file and is played elsewhere: the same labels on the same scenes, on any number of threads;
//! a lineage goes on from it; what does not fit is refused.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use evodrive::adapters::ADAPTER_VERSION;
use evodrive::evaluation::EVAL_VERSION;
use evodrive::evidence::RecordedRun;
use evodrive::experiment::{
    CarriedCounsel, Conditions, ContractMark, Experiment, PROGRAM_FORMAT, ProgramFile, read_pool,
};
use evodrive::families::sources;
use evodrive::kernel::{Digest, Seed};
use evodrive::objects::event::Versions;
use evodrive::objects::{Counsel, FamilyName, LineageId, MechanismModule, Program, SceneScore, Setting, ValueType};
use evodrive::objects::{MechanismRef, Score};
use evodrive::scene::{Pool, pool};
use evodrive::sim::SIM_VERSION;
use evodrive::store::read_events;
use evodrive::synth::{FamilyOptions, family_member};
use serde_json::Value;

use crate::harness::{Ran, evodrive, files, folder_below, home, run};
use crate::quickstart::finished;

fn read_run(folder: &Path) -> RecordedRun {
    RecordedRun::read(&read_events(&folder.join("transcript.jsonl")).unwrap()).unwrap()
}

fn path(of: &Path) -> &str {
    of.to_str().unwrap()
}

fn json(ran: &Ran) -> Value {
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    serde_json::from_str(&ran.stdout).unwrap()
}

/// The evaluated attempt of a lineage that acts in most scenes of those that attack most often.
fn attacker(recorded_run: &RecordedRun, lineage: &str) -> (String, Score) {
    let labelled = recorded_run.attempts.iter().filter(|attempt| attempt.lineage.as_str() == lineage);
    let mut found: Vec<(String, Score)> =
        labelled.filter_map(|attempt| Some((attempt.id.to_string(), attempt.exit.score()?.clone()))).collect();
    found.sort_by(|(_, a), (_, b)| b.objectives.attack.total_cmp(&a.objectives.attack));
    found.into_iter().next().expect("an evaluated attempt")
}

fn export(run_folder: &Path, attempt: &str, to: &Path) -> Vec<u8> {
    let ran = run(&["program", "export", path(run_folder), attempt, "--overwrite", "--out", path(to)]);
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    std::fs::read(to).unwrap()
}

/// Applies a file to the quickstart's scenes, or to those that are named.
fn apply(file: &Path, scenes: &[SceneScore]) -> Value {
    let (_, folder) = finished();
    let mut command = evodrive();
    command.args(["--json", "apply", path(file), "--scenes", path(&folder.join("scenes.pool")), "--ego", "idm"]);
    command.args(scenes.iter().flat_map(|scene| ["--scene", &scene.scene]));
    json(&Ran::of(&mut command))
}

/// Labels by scene, as they were printed.
fn labels(score: &Value) -> BTreeMap<String, Value> {
    let scenes = score["scenes"].as_array().unwrap();
    scenes.iter().map(|scene| (scene["scene"].as_str().unwrap().to_string(), scene.clone())).collect()
}

fn recorded(score: &Score) -> BTreeMap<String, Value> {
    labels(&serde_json::to_value(score).unwrap())
}

/// The exported attacker of the quickstart's CAT lineage, with its labels in the run.
fn exported() -> &'static (tempfile::TempDir, PathBuf, String, Score) {
    static FILE: OnceLock<(tempfile::TempDir, PathBuf, String, Score)> = OnceLock::new();
    FILE.get_or_init(|| {
        let (_, folder) = finished();
        let (attempt, score) = attacker(&read_run(folder), "cat-idm");
        let dir = tempfile::tempdir().unwrap();
        let file = dir.path().join("cat.json");
        export(folder, &attempt, &file);
        (dir, file, attempt, score)
    })
}

#[test]
fn an_exported_program_has_the_labels_of_its_run_bit_for_bit_and_exports_are_equal() {
    let (_, folder) = finished();
    let recorded_run = read_run(folder);
    let dir = tempfile::tempdir().unwrap();
    for lineage in ["cat-idm", "at-idm"] {
        let (attempt, score) = attacker(&recorded_run, lineage);
        let (one, two) = (dir.path().join("one.json"), dir.path().join("two.json"));
        assert_eq!(export(folder, &attempt, &one), export(folder, &attempt, &two));
        let printed = run(&["program", "export", path(folder), &attempt]);
        assert_eq!(printed.stdout.as_bytes(), std::fs::read(&one).unwrap());
        let applied = apply(&one, &score.scenes);
        // Requests and records are digests of all that went in and came out: the intervention's outcome included.
        assert_eq!(labels(&applied["program"]["score"]), recorded(&score), "{attempt}");
        let first = recorded_run.frozen.iter().find(|f| f.lineage.as_str() == lineage && f.epoch == 0).unwrap();
        let parent = dir.path().join("parent.json");
        export(folder, &format!("{lineage}/parent"), &parent);
        let applied = apply(&parent, &first.parent_score.scenes);
        assert_eq!(labels(&applied["program"]["score"]), recorded(&first.parent_score), "{lineage}/parent");
        assert_eq!(applied["program"]["score"], applied["parent"]["score"]);
    }
}

#[test]
fn what_apply_prints_and_writes_does_not_depend_on_threads_or_repetition() {
    let (_, folder) = finished();
    let (dir, file, _, score) = exported();
    let pool = folder.join("scenes.pool");
    let printed = |jobs: &str, out: &str| {
        let out = dir.path().join(out);
        let mut command = evodrive();
        command.args(["apply", path(file), "--scenes", path(&pool), "--jobs", jobs, "--format", "openscenario"]);
        command.arg("--out").arg(&out);
        command.args(score.scenes.iter().take(6).flat_map(|scene| ["--scene", &scene.scene]));
        let ran = Ran::of(&mut command);
        assert_eq!(ran.code, 0, "{}", ran.stderr);
        (ran.stdout.replace(path(&out), "OUT"), files(&out, ""))
    };
    let (once, again, two) = (printed("1", "a"), printed("1", "b"), printed("2", "c"));
    assert!(once == again && once == two, "{}\n{}\n{}", once.0, again.0, two.0);
    let names: Vec<&str> = once.1.iter().map(|(name, _)| name.as_str()).collect();
    let ending = |ending: &str| names.iter().filter(|name| name.ends_with(ending)).count();
    assert_eq!((ending(".xosc"), ending(".xodr"), ending("player.html")), (6, 6, 1), "{names:?}");
    for word in ["Replay (no program)", "cat-idm/parent", "program - parent", "Any crash", "Coverage", "[0."] {
        assert!(once.0.contains(word), "{word:?} is not in {}", once.0);
    }
    // In a pipe its table is columns under each other, one line a program whatever the width, and no Markdown.
    let table: Vec<&str> = once.0.lines().take_while(|line| !line.starts_with("- ")).skip(4).collect();
    assert!(table.iter().all(|line| !line.contains('|')), "{table:#?}");
    for program in ["cat-idm/parent ", "program - parent "] {
        let lines: Vec<&&str> = table.iter().filter(|line| line.starts_with(program)).collect();
        assert!(lines.len() == 1 && lines[0].chars().count() > 80, "{program}: {table:#?}");
    }
}

/// The program that leaves every scene alone.
fn idle(program: &Program) -> Program {
    let mut idle = program.clone();
    let gate = MechanismModule {
        slot: "scene_gate".into(),
        inputs: vec!["vehicle_count".into()],
        output: ValueType::Boolean,
        expression: "vehicle_count > 1000".into(),
        tags: vec![],
    };
    idle.mechanism_modules.insert("never".into(), gate);
    let select = idle.operator_graph.get_mut("select").unwrap();
    select.kind = "gated_scenes".into();
    select.settings = [("gate".to_string(), Setting::Mechanism(MechanismRef { mechanism: "never".into() }))].into();
    idle
}

fn sealed(file: ProgramFile, to: &Path) {
    let hash = file.program.hash().unwrap();
    let file = ProgramFile { program_hash: hash, ..file }.sealed().unwrap();
    std::fs::write(to, file.to_bytes().unwrap()).unwrap();
}

#[test]
fn a_program_that_does_nothing_is_shown_as_that() {
    let (dir, file, _, score) = exported();
    let read = ProgramFile::read(file).unwrap();
    let toy = dir.path().join("idle.json");
    sealed(ProgramFile { program: idle(&read.program), ..read }, &toy);
    let (own, nothing) = (apply(file, &score.scenes), apply(&toy, &score.scenes));
    let value = |applied: &Value, row: usize, key: &str| {
        applied["tables"][0]["rows"][row]["values"][key]["ours"]["value"].as_f64()
    };
    assert!(value(&own, 2, "coverage") > Some(0.0) && value(&own, 2, "attack") > Some(0.0), "{own}");
    assert_eq!((value(&nothing, 2, "coverage"), value(&nothing, 2, "attack")), (Some(0.0), Some(0.0)));
    // It has no realism, and its crashes are those of the replay.
    assert_eq!(value(&nothing, 2, "realism"), None);
    assert_eq!(value(&nothing, 2, "any_contact"), value(&nothing, 0, "any_contact"));
    assert_ne!(value(&own, 2, "any_contact"), value(&own, 0, "any_contact"));
    // Replay and parent are the same beside both.
    for row in [0, 1] {
        assert_eq!(own["tables"][0]["rows"][row], nothing["tables"][0]["rows"][row]);
    }
    let paired = |applied: &Value| applied["tables"][0]["rows"][3]["values"]["attack"]["ours"].clone();
    let difference = value(&own, 2, "attack").unwrap() - value(&own, 1, "attack").unwrap();
    assert!((paired(&own)["value"].as_f64().unwrap() - difference).abs() < 1e-12, "{}", paired(&own));
}

/// Rules that ask nothing of a contact but its class credit a program that does nothing with what the ego runs into anyway.
#[test]
fn where_any_contact_counts_the_row_without_a_program_has_the_attack_of_one_that_does_nothing() {
    let (dir, file, ..) = exported();
    let read = ProgramFile::read(file).unwrap();
    let toy = dir.path().join("idle-by-the-papers-rules.json");
    sealed(ProgramFile { program: idle(&read.program), ..read }, &toy);
    let pool = finished().1.join("scenes.pool");
    let rules = home().join("experiments/published.toml");
    let mut command = evodrive();
    command.args(["--json", "apply", path(&toy), "--scenes", path(&pool), "--ego", "idm", "--rules", path(&rules)]);
    let applied = json(&Ran::of(&mut command));
    let rows = &applied["tables"][0]["rows"];
    let value = |row: usize, key: &str| rows[row]["values"][key]["ours"]["value"].as_f64().unwrap();
    assert!(value(2, "attack") > 0.0 && value(2, "coverage") == 0.0, "{rows}");
    for row in [0, 2] {
        assert_eq!(
            (value(row, "attack"), value(row, "any_contact")),
            (value(2, "any_contact"), value(2, "any_contact"))
        );
    }
}

#[test]
fn a_lineage_starts_from_an_exported_program_and_carries_it_in_its_run() {
    let (_, _, attempt, score) = exported();
    let dir = tempfile::tempdir().unwrap();
    std::fs::copy(&exported().1, dir.path().join("cat.json")).unwrap();
    let base = home().join("experiments/quickstart.toml");
    let text = format!(
        "base = {base:?}\nname = \"further\"\ndescribes = \"from a program\"\ncassette = \"further.jsonl\"\n\
         [budget]\nepochs = 1\nslots = 2\nfinalists = 1\n\
         [[lineage]]\nid = \"cat-idm\"\nfamily = \"cat\"\nego = \"idm\"\nparent_program = \"cat.json\"\n"
    );
    let experiment = dir.path().join("further.toml");
    std::fs::write(&experiment, &text).unwrap();
    let out = dir.path().join("runs");
    let recorded_run = run(&["record", path(&experiment), "--out", path(&out)]);
    let root = recorded_run.root();
    assert!(
        recorded_run.stdout.contains(&format!("cat-idm starts from {attempt} of run quickstart")),
        "{}",
        recorded_run.stdout
    );
    let folder = folder_below(&out);
    let further = read_run(&folder);
    assert_eq!(further.parents[0].origins[0].texts()[1], attempt);
    let first = &further.frozen[0].parent_score;
    let ours: BTreeMap<String, Value> = labels(&apply(&exported().1, &first.scenes)["program"]["score"]);
    assert_eq!(recorded(first), ours);
    // Scenes that both runs labelled have the very rollouts.
    let both: Vec<(&SceneScore, &SceneScore)> =
        first.scenes.iter().filter_map(|a| Some((a, score.scenes.iter().find(|b| a.scene == b.scene)?))).collect();
    assert!(both.iter().all(|(a, b)| a == b), "{both:?}");
    // The run folder needs the file no longer.
    std::fs::remove_file(dir.path().join("cat.json")).unwrap();
    let again = run(&["check", path(&folder)]);
    assert_eq!(again.root(), root);
    for shown in [
        run(&["show", "cat-idm/parent", "--run", path(&folder)]),
        run(&["lineage", "--run", path(&folder)]),
        run(&["table", "metadrive-main", "--run", path(&folder)]),
    ] {
        assert!(shown.stdout.contains(&format!("{attempt} of run quickstart")), "{}{}", shown.stdout, shown.stderr);
    }
    // Not the paper's CAT, which starts from the published parent.
    let table = json(&run(&["--json", "table", "metadrive-main", "--run", path(&folder)]));
    let rows = table["rows"].as_array().unwrap();
    assert!(rows.iter().any(|row| row["method"] == "CAT" && row["missing"] == true), "{table}");
    // Exported again, a program names both runs.
    let next = dir.path().join("next.json");
    export(&folder, "cat-idm/parent", &next);
    let next = ProgramFile::read(&next).unwrap();
    assert_eq!(next.origins.len(), 2);
    assert_eq!(next.program_hash, ProgramFile::read(&exported().1).unwrap().program_hash);
}

#[test]
fn an_experiment_says_what_is_wrong_with_its_program_file() {
    let dir = tempfile::tempdir().unwrap();
    let base = home().join("experiments/quickstart.toml");
    std::fs::copy(&exported().1, dir.path().join("cat.json")).unwrap();
    let whole = std::fs::read_to_string(&exported().1).unwrap();
    std::fs::write(dir.path().join("cut.json"), &whole[..whole.len() / 2]).unwrap();
    for (family, more, words) in [
        ("at", "parent_program = \"cat.json\"", ["lineage[0].parent_program", "a program of family cat"]),
        ("cat", "parent_program = \"cut.json\"", ["lineage[0].parent_program", "cut off"]),
        ("cat", "parent_program = \"none.json\"", ["lineage[0].parent_program", "none.json"]),
        ("cat", "parent_program = 3", ["lineage[0].parent_program is 3", "`evodrive program export`"]),
        (
            "cat",
            "parent_program = \"cat.json\"\nparent = { duration_s = 3.0 }",
            ["lineage[0].parent", "nothing: parent_program already names the whole parent"],
        ),
    ] {
        let experiment = dir.path().join("e.toml");
        let text = format!(
            "base = {base:?}\nname = \"e\"\n[[lineage]]\nid = \"l\"\nfamily = \"{family}\"\nego = \"idm\"\n{more}\n"
        );
        std::fs::write(&experiment, text).unwrap();
        let ran = run(&["run", path(&experiment), "--out", path(&dir.path().join("runs"))]);
        assert_eq!(ran.code, 2, "{}", ran.stderr);
        words.iter().for_each(|word| assert!(ran.stderr.contains(word), "{word:?} is not in {}", ran.stderr));
    }
}

#[test]
fn the_program_and_not_the_place_of_its_file_is_part_of_the_experiment() {
    let dir = tempfile::tempdir().unwrap();
    let base = home().join("experiments/quickstart.toml");
    let (_, folder) = finished();
    let digest = |name: &str, source: &Path| {
        let file = dir.path().join(name);
        std::fs::copy(source, &file).unwrap();
        let text = format!(
            "base = {base:?}\nname = \"e\"\n[[lineage]]\nid = \"l\"\nfamily = \"cat\"\nego = \"idm\"\nparent_program = {name:?}\n"
        );
        let experiment = dir.path().join("e.toml");
        std::fs::write(&experiment, text).unwrap();
        Experiment::read(&experiment).unwrap().digest().unwrap()
    };
    let parent = dir.path().join("parent.json");
    export(folder, "cat-idm/parent", &parent);
    let (one, moved, other) =
        (digest("a.json", &exported().1), digest("b.json", &exported().1), digest("c.json", &parent));
    assert!(one == moved && one != other);
}

/// A family's parent as a file, under the conditions of an experiment.
fn parent_file(family: &str, experiment: &str, counsel: BTreeMap<String, CarriedCounsel>, to: &Path) {
    let experiment = Experiment::read(&home().join(experiment)).unwrap();
    let source = sources().get(&FamilyName::new(family)).unwrap().clone();
    let parent = source.parent.adopted(&LineageId::new(family));
    let file = ProgramFile {
        format: PROGRAM_FORMAT.into(),
        digest: Digest::of_bytes(&[]),
        family: FamilyName::new(family),
        contract: ContractMark::of(&source.contract).unwrap(),
        program_hash: parent.hash().unwrap(),
        program: parent.clone(),
        parent,
        parent_settings: BTreeMap::new(),
        conditions: Conditions {
            ego: "idm".into(),
            seed: experiment.seed,
            versions: Versions { adapter: ADAPTER_VERSION, sim: SIM_VERSION, eval: EVAL_VERSION },
            simulator: experiment.simulator.rules(),
            backend: None,
            evaluation: experiment.evaluation,
        },
        counsel,
        sequences: BTreeMap::new(),
        evolution_scenes: BTreeSet::new(),
        origins: vec![],
    };
    sealed(file, to);
}

/// Eight staged scenes: two draws of four families on one route.
fn staged(to: &Path) {
    let options = FamilyOptions { routes: vec![4], draws: 2, ..FamilyOptions::all() };
    let scenes = (0..8).map(|i| family_member(&options, Seed(3), i).unwrap()).collect();
    std::fs::write(to, pool::encode(&Pool::new(scenes, vec![]).unwrap())).unwrap();
}

#[test]
fn a_program_of_one_protocol_refuses_the_scenes_of_the_other() {
    let dir = tempfile::tempdir().unwrap();
    let (pool, file) = (dir.path().join("staged.pool"), dir.path().join("advsim.json"));
    staged(&pool);
    parent_file("advsim", "experiments/safebench/advsim-idm.toml", BTreeMap::new(), &file);
    let ran = run(&["apply", path(&exported().1), "--scenes", path(&pool)]);
    assert_eq!(ran.code, 2, "{}", ran.stderr);
    assert!(ran.stderr.contains("8 of 8 scenes are staged for a traffic family of SafeBench"), "{}", ran.stderr);
    let ran = run(&["apply", path(&file), "--scenes", path(&finished().1.join("scenes.pool"))]);
    assert_eq!(ran.code, 2, "{}", ran.stderr);
    assert!(ran.stderr.contains("scenes are recorded or generated traffic"), "{}", ran.stderr);
}

#[test]
fn staged_scenes_are_scored_by_safebenchs_rates() {
    let dir = tempfile::tempdir().unwrap();
    let (pool, file) = (dir.path().join("staged.pool"), dir.path().join("human.json"));
    staged(&pool);
    parent_file("human", "experiments/safebench/human-idm.toml", BTreeMap::new(), &file);
    let applied = json(&run(&["--json", "apply", path(&file), "--scenes", path(&pool)]));
    let (row, mean) = (&applied["tables"][0]["rows"][2]["values"], &applied["program"]["score"]["benchmark"]["mean"]);
    for (ours, theirs) in [("cr", "collision_rate"), ("os", "overall_score"), ("ars", "realism"), ("attack", "attack")]
    {
        assert_eq!(row[ours]["ours"]["value"], mean[theirs], "{ours}");
        assert!(row[ours]["ours"]["value"].is_f64(), "{row}");
    }
    // The parent is the program itself: no difference, without width.
    assert_eq!(
        applied["tables"][0]["rows"][3]["values"]["cr"]["ours"],
        serde_json::json!({"value": 0.0, "interval": [0.0, 0.0]})
    );
}

#[test]
fn counsel_travels_for_its_scenes_and_is_missed_in_others() {
    let dir = tempfile::tempdir().unwrap();
    let pool = read_pool(&finished().1.join("scenes.pool")).unwrap();
    let recorded_run = read_run(&finished().1);
    let names: Vec<&String> = recorded_run.opened.evolution_scenes.iter().take(3).collect();
    let advised = |track: usize| {
        let scene = pool.scene(names[0]).unwrap();
        CarriedCounsel { scene: scene.digest(), counsel: Counsel { attackers: vec![track], ..Counsel::default() } }
    };
    let file = dir.path().join("llm.json");
    let play = |counsel: BTreeMap<String, CarriedCounsel>| {
        parent_file("llm_attacker", "experiments/metadrive/llm_attacker-idm.toml", counsel, &file);
        let mut command = evodrive();
        command.args(["--json", "apply", path(&file), "--scenes", path(&finished().1.join("scenes.pool"))]);
        command.args(names.iter().flat_map(|name| ["--scene", name.as_str()]));
        json(&Ran::of(&mut command))
    };
    let (with, without) = (play([(names[0].clone(), advised(0))].into()), play(BTreeMap::new()));
    assert_eq!((&with["counselled"], &without["counselled"]), (&Value::from(1), &Value::from(0)));
    let noted = |part: &str| with["notes"].as_array().unwrap().iter().any(|note| note.as_str().unwrap().contains(part));
    assert!(noted("for 1 of 3 scenes"), "{}", with["notes"]);
    // Nobody evolved or chose it on these scenes.
    assert!(noted("its lineage's own parent") && !noted("by its labels there"), "{}", with["notes"]);
    let (with, without) = (labels(&with["program"]["score"]), labels(&without["program"]["score"]));
    assert_ne!(with[names[0]]["request"], without[names[0]]["request"]);
    assert_eq!(with[names[1]], without[names[1]]);
    // A scene of the same name with other content takes none.
    let stale = CarriedCounsel { scene: Digest::of_bytes(b"another scene"), ..advised(0) };
    assert_eq!(play([(names[0].clone(), stale)].into())["counselled"], 0);
}

#[test]
fn attempts_that_left_no_program_and_unknown_names_are_told() {
    let (_, folder) = finished();
    let recorded_run = read_run(folder);
    let declined = recorded_run.attempts.iter().find(|attempt| attempt.exit.candidate().is_none()).unwrap();
    let ran = run(&["program", "show", path(folder), declined.id.as_str()]);
    assert_eq!(ran.code, 2);
    assert!(ran.stderr.contains("so there is no program"), "{}", ran.stderr);
    let ran = run(&["program", "export", path(folder), "cat-idm/e0s99"]);
    assert_eq!(ran.code, 2);
    assert!(ran.stderr.contains("no attempt `cat-idm/e0s99`"), "{}", ran.stderr);
    // Without an attempt those that the run reports are named, each with its command.
    let evolved = recorded_run.result.as_ref().unwrap().lineages[0].evolved.solution.clone();
    for words in [vec!["program", "export", path(folder)], vec!["program", "export", "--run", path(folder)]] {
        let ran = run(&words);
        assert_eq!(ran.code, 2);
        let suggested = format!("evodrive program export --run {} {evolved}\n", folder.display());
        assert!(ran.stderr.contains(&suggested), "{}", ran.stderr);
    }
    let ran = run(&["program", "export", path(folder), evolved.as_str(), "--run", path(folder)]);
    assert!(ran.code == 2 && ran.stderr.contains("named twice"), "{}", ran.stderr);
    let by_option = run(&["program", "export", "--run", path(folder), evolved.as_str()]);
    assert!(by_option.code == 0 && by_option.stdout.contains(evolved.as_str()), "{}", by_option.stderr);
    let shown = run(&["program", "show", path(folder), &exported().2]);
    for word in ["from     ", "changed of cat-idm/parent", "operator_graph", "ego idm"] {
        assert!(shown.stdout.contains(word), "{word:?} is not in {}", shown.stdout);
    }
    let file = std::fs::read_to_string(&exported().1).unwrap().replacen("\"generation\": ", "\"generation\": 1", 1);
    let dir = tempfile::tempdir().unwrap();
    let path_of = dir.path().join("edited.json");
    std::fs::write(&path_of, file).unwrap();
    let ran = run(&["apply", path(&path_of), "--scenes", path(&folder.join("scenes.pool"))]);
    assert_eq!(ran.code, 5, "{}", ran.stderr);
}

#[test]
fn an_unknown_ego_is_answered_with_the_nearest() {
    let ((_, folder), (_, file, ..)) = (finished(), exported());
    let pool = folder.join("scenes.pool");
    let refused = run(&["apply", path(file), "--scenes", path(&pool), "--ego", "idmm"]);
    assert!(refused.code == 2 && refused.stderr.contains("did you mean idm?"), "{}", refused.stderr);
}

#[test]
fn another_experiments_rules_judge_the_same_rollouts_and_those_of_other_scenes_are_refused() {
    let ((_, folder), (dir, file, _, score)) = (finished(), exported());
    let rules = dir.path().join("sideswipes_count.toml");
    let base = home().join("experiments/quickstart.toml");
    let attack = "[evaluation.attack]\ncounts = [\"sideswipe\"]\ncounts_if_avoidable = []\n";
    std::fs::write(&rules, format!("base = {:?}\nname = \"sideswipes-count\"\n{attack}", path(&base))).unwrap();
    let by = |rules: &Path| {
        let mut command = evodrive();
        command.args(["--json", "apply", path(file), "--scenes", path(&folder.join("scenes.pool")), "--ego", "idm"]);
        command.args(score.scenes.iter().flat_map(|scene| ["--scene", &scene.scene]));
        json(&Ran::of(command.args(["--rules", path(rules)])))
    };
    let attacks = |of: &Value| -> Vec<String> {
        let all = of["program"]["score"]["scenes"].as_array().unwrap().iter().filter(|scene| scene["attack"] == 1.0);
        all.map(|scene| scene["contact"]["class"].as_str().unwrap().to_string()).collect()
    };
    let (own, other) = (by(&base), by(&rules));
    assert_eq!(labels(&own["program"]["score"]), recorded(score), "its own rules, named");
    let (before, now) = (attacks(&own), attacks(&other));
    assert!(before.iter().any(|class| class != "sideswipe") && !now.is_empty(), "{before:?} {now:?}");
    assert!(now.iter().all(|class| class == "sideswipe"), "{now:?}");
    let noted =
        |part: &str| other["notes"].as_array().unwrap().iter().any(|note| note.as_str().unwrap().contains(part));
    assert!(noted("sideswipes_count.toml"), "{}", other["notes"]);
    let staged = home().join("experiments/safebench/preventable-idm.toml");
    let refused = run(&["apply", path(file), "--scenes", path(&folder.join("scenes.pool")), "--rules", path(&staged)]);
    assert!(
        refused.code == 2 && refused.stderr.contains("the program is one for recorded traffic"),
        "{}",
        refused.stderr
    );
}
