//! Lineages that are played against several drivers, and programs carried over to drivers that they were not evolved on.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::harness::{events, experiment, folder_below, record, run as evodrive, set, write_small};

fn small(folder: &Path, lineages: &str) -> PathBuf {
    let mut table = experiment("metadrive/cat-idm.toml");
    let changes = [
        ("scenes", "count", 14.into()),
        ("split", "held_out", 4.into()),
        ("split", "window", 6.into()),
        ("budget", "epochs", 1.into()),
        ("budget", "slots", 4.into()),
        ("budget", "probe_scenes", 2.into()),
        ("budget", "finalists", 1.into()),
    ];
    set(&mut table, &changes);
    table["split"]["evolution"]["count"] = 8.into();
    table.insert("seeds".into(), 1.into());
    let given: toml::Table = lineages.parse().unwrap();
    table.insert("lineage".into(), given["lineage"].clone());
    write_small(folder, table)
}

/// Every label of a lineage in a run: program and scene -> label.
fn labels(run: &Path, lineage: &str) -> BTreeMap<(String, String), Value> {
    let mut found = BTreeMap::new();
    for event in events(run).iter().filter(|event| event["body"]["lineage"] == lineage) {
        let scores = [&event["body"]["score"], &event["body"]["parent_score"]];
        for label in scores.into_iter().filter_map(|score| score["scenes"].as_array()).flatten() {
            let solution = ["solution", "parent"].iter().find_map(|key| event["body"][*key].as_str()).unwrap();
            let program = solution.rsplit('/').next().unwrap().to_string();
            found.insert((program, label["scene"].as_str().unwrap().to_string()), label.clone());
        }
    }
    found
}

/// The parent alone against either driver and against both: what is counted follows from its labels against each.
#[test]
fn a_label_against_several_drivers_is_their_mean_or_their_least_and_shows_each() {
    let both = record(|folder| {
        small(
            folder,
            "lineage = [{ id = \"alone\", family = \"cat\", ego = \"pdm\" }, { id = \"mean\", family = \"cat\", egos = [\"idm\", \"pdm\"] }, \
             { id = \"worst\", family = \"cat\", egos = [\"idm\", \"pdm\"], over_egos = \"worst\" }]",
        )
    });
    let parents = events(&both.run).into_iter().filter(|event| event["kind"] == "parent").collect::<Vec<_>>();
    let egos: Vec<&str> = parents.iter().filter_map(|event| event["body"]["ego"].as_str()).collect();
    assert_eq!(egos, ["pdm", "mean of idm+pdm", "worst of idm+pdm"]);
    let [alone, mean, worst] = ["alone", "mean", "worst"].map(|lineage| labels(&both.run, lineage));
    let of_parent = |(program, _): &&(String, String)| program == "parent";
    let scenes: Vec<_> = mean.keys().filter(of_parent).cloned().collect();
    assert_eq!(scenes.len(), 8 + 4);
    let number = |label: &Value, key: &str| label[key].as_f64().unwrap();
    let mut differing = 0;
    for key in &scenes {
        let (mean, worst, alone) = (&mean[key], &worst[key], &alone[key]);
        let each = |key: &str| ["idm", "pdm"].map(|ego| number(&mean["by_ego"][ego], key));
        assert_eq!(mean["by_ego"], worst["by_ego"]);
        assert_eq!(&mean["by_ego"]["pdm"], alone, "against each it is the label of a lineage with that driver");
        let [idm, pdm] = each("attack");
        assert_eq!((number(mean, "attack"), number(worst, "attack")), (0.5 * (idm + pdm), idm.min(pdm)));
        differing += usize::from(idm != pdm);
    }
    assert!(differing > 0, "the drivers come through every scene alike: nothing is shown here");
    // The seal and every number hold, and the run is the same again, in one piece or in shards.
    let [run, file] = [&both.run, &both.experiment].map(|path| path.to_str().unwrap());
    assert_eq!(evodrive(&["verify", run]).code, 0);
    let again = tempfile::tempdir().unwrap();
    let out = again.path().to_str().unwrap();
    assert_eq!(evodrive(&["run", file, "--out", out, "--jobs", "2"]).root(), both.root);
    let shown = evodrive(&["table", "metadrive-policy", "--run", run]).stdout;
    assert!(shown.contains("mean of idm+pdm") && shown.contains("worst of idm+pdm"), "{shown}");
    let attempt = evodrive(&["show", "--run", run, "mean/e0s0"]).stdout;
    assert!(!attempt.contains("\nlabels:") || attempt.contains("pdm        attack"), "{attempt}");
}

#[test]
fn drivers_that_do_not_fit_together_are_refused_with_what_to_do() {
    let cases = [
        ("egos = [\"pdm\"]", "two drivers at least"),
        ("egos = [\"pdm\", \"pdm\"]", "each driver once"),
        ("ego = \"idm\", egos = [\"pdm\", \"idm\"]", "first"),
        ("ego = \"idm\", over_egos = \"worst\"", "several drivers"),
        ("egos = [\"idm\", \"pdn\"]", "pdm"),
        ("egos = [\"idm\", \"learned\"]", "needs its weights"),
        ("egos = [\"idm\", \"command\"]", "egos[1]"),
        ("egos = [\"idm\", \"pdm\"], over_egos = \"best\"", "worst"),
    ];
    for (egos, said) in cases {
        let folder = tempfile::tempdir().unwrap();
        let file = small(folder.path(), &format!("lineage = [{{ id = \"cat\", family = \"cat\", {egos} }}]"));
        let refused = evodrive(&["run", file.to_str().unwrap(), "--out", folder.path().to_str().unwrap()]);
        assert!(refused.code == 2 && refused.stderr.contains(said), "{egos}: {} {}", refused.code, refused.stderr);
    }
    let folder = tempfile::tempdir().unwrap();
    let file =
        small(folder.path(), "lineage = [{ id = \"cat\", family = \"cat\", egos = [\"idm\", \"sac-metadrive-2\"] }]");
    let plan = evodrive(&["plan", file.to_str().unwrap(), "--out", folder.path().to_str().unwrap()]);
    assert!(plan.code != 2, "weights that the program carries are named without more: {}", plan.stderr);
}

/// Each column is `apply` against its driver, and the drivers do not come through alike.
#[test]
fn a_matrix_has_in_each_column_what_applying_to_that_driver_gives() {
    let evolved = record(|folder| small(folder, "lineage = [{ id = \"cat-idm\", family = \"cat\", ego = \"idm\" }]"));
    let folder = tempfile::tempdir().unwrap();
    let place = |name: &str| folder.path().join(name).to_str().unwrap().to_string();
    let mut other = experiment("metadrive/cat-idm.toml");
    set(&mut other, &[("scenes", "count", 12.into()), ("scenes", "seed", 977.into())]);
    let (file, pool) = (write_small(folder.path(), other), place("other.pool"));
    assert_eq!(evodrive(&["scenes", "generate", file.to_str().unwrap(), "--out", &pool]).code, 0);
    let run = evolved.run.to_str().unwrap();
    let matrix = evodrive(&[
        "transfer",
        "--run",
        run,
        "--scenes",
        &pool,
        "--drivers",
        "idm,pdm",
        "--figure",
        &place("map.svg"),
        "--judges",
        &place("judges.md"),
        "--recognised",
        &place("recognised.md"),
        "--json",
    ]);
    assert_eq!(matrix.code, 0, "{}", matrix.stderr);
    let matrix: Value = serde_json::from_str(&matrix.stdout).unwrap();
    let text =
        evodrive(&["transfer", "--run", run, "--scenes", &pool, "--drivers", "idm,pdm", "--format", "csv"]).stdout;
    let mut shares: Vec<[f64; 2]> = Vec::new();
    for row in csv::Reader::from_reader(text.as_bytes()).deserialize::<BTreeMap<String, String>>() {
        let row = row.unwrap();
        if row.values().any(|of| of == "parent") {
            shares.push(["idm", "pdm"].map(|driver| row[driver].parse().unwrap()));
        }
    }
    assert!(matrix["programs"].as_u64() >= Some(1) && shares.len() >= 3, "{matrix}");
    assert!(shares.iter().any(|[idm, pdm]| idm != pdm), "both columns are one driver: {text}");
    let program = place("program.json");
    let exported = evodrive(&["program", "export", "--run", run, "cat-idm/parent", "--out", &program]);
    assert_eq!(exported.code, 0, "{}", exported.stderr);
    for (column, ego) in ["idm", "pdm"].into_iter().enumerate() {
        let applied = evodrive(&["apply", &program, "--scenes", &pool, "--ego", ego, "--at-fault", "--json"]);
        let applied: Value = serde_json::from_str(&applied.stdout).unwrap();
        // Contacts of the parent with an adversary, but for those that plain replay has too.
        let values = &applied["tables"][1]["rows"][1]["values"];
        let of = |key: &str| values[key]["ours"]["value"].as_f64().unwrap();
        let share = of("adversary_contact") - of("met_anyway");
        assert!((share - shares[0][column]).abs() < 1e-9, "{ego}: {share} {shares:?}");
    }
    let figure = std::fs::read_to_string(place("map.svg")).unwrap();
    let judges = std::fs::read_to_string(place("judges.md")).unwrap();
    assert!(figure.contains("PDM") && judges.contains("## Driven by PDM"), "{judges}");
    // Among a hundred scenes some contact was in plain view before it was a threat by its motion, and declared judges are the run's.
    let mut more = experiment("metadrive/cat-idm.toml");
    set(&mut more, &[("scenes", "count", 120.into()), ("scenes", "seed", 20_261_129.into())]);
    let (file, many) = (write_small(folder.path(), more), place("many.pool"));
    assert_eq!(evodrive(&["scenes", "generate", file.to_str().unwrap(), "--out", &many]).code, 0);
    let judged = [
        "transfer",
        "--run",
        run,
        "--scenes",
        &many,
        "--drivers",
        "idm",
        "--sensitivity",
        &place("sensitivity.md"),
        "--json",
    ];
    let judged: Value = serde_json::from_str(&evodrive(&judged).stdout).unwrap();
    let sensitivity = std::fs::read_to_string(place("sensitivity.md")).unwrap();
    let shares_of = |name: &str| -> Vec<f64> {
        let line = sensitivity.lines().find(|line| line.starts_with(&format!("| {name}"))).unwrap();
        line.split('|').filter_map(|cell| cell.trim().parse().ok()).collect()
    };
    let rows = judged["table"]["rows"].as_array().unwrap();
    // Parents stand in the parts of shares alone: published, preventable, at fault.
    let row = rows.iter().filter(|row| row["evolved_on"] == "parent").nth(1).unwrap();
    let declared = row["values"]["idm"]["ours"]["value"].as_f64().unwrap();
    let (parent, moved) = (shares_of("cat: parent"), shares_of("contacts judged otherwise"));
    assert!(parent.len() == 6 && (parent[0] - declared).abs() < 1e-3, "{declared} {sensitivity}");
    assert!(moved[0] == 0.0 && moved[3] > 0.0 && moved[5] >= moved[3], "{sensitivity}");
    // The program moves somebody in most of the scenes, among many who keep to their recording.
    let recognised = std::fs::read_to_string(place("recognised.md")).unwrap();
    let counts = |name: &str| -> [usize; 2] {
        let line = recognised.lines().find(|line| line.starts_with(&format!("| {name}"))).unwrap();
        let cells: Vec<&str> = line.split('|').map(str::trim).collect();
        [4, 5].map(|place| cells[place].parse().unwrap())
    };
    let [acted, recorded] = counts("cat: parent");
    assert!((6..=24).contains(&acted) && recorded > 2 * acted, "{recognised}");
    assert_eq!(counts("recorded against recorded").iter().sum::<usize>(), recorded, "{recognised}");
    let compared = evodrive(&["scenes", "compare", &pool, &pool, "--json"]);
    let compared: Value = serde_json::from_str(&compared.stdout).unwrap();
    let quantities = compared["difference"]["quantities"].as_array().unwrap();
    assert!(quantities.len() > 30 && quantities.iter().all(|of| of["distance"] == 0.0), "{compared}");
    // Scenes of the search itself are no proof.
    let own = folder_below(evolved.run.parent().unwrap()).join("scenes.pool");
    if own.is_file() {
        let seen = evodrive(&["transfer", "--run", run, "--scenes", own.to_str().unwrap()]);
        assert!(seen.code == 2 && seen.stderr.contains("no search has seen"), "{}", seen.stderr);
    }
    let unknown = evodrive(&["transfer", "--run", run, "--scenes", &pool, "--drivers", "pdn"]);
    assert!(unknown.code == 2 && unknown.stderr.contains("pdm"), "{}", unknown.stderr);
}

/// Kept work depends on what was simulated: other draws in the same folder come to what they come to in an empty one.
#[test]
fn a_hardening_that_goes_on_in_a_folder_is_that_of_an_empty_one() {
    let folder = tempfile::tempdir().unwrap();
    let place = |name: &str| folder.path().join(name).to_str().unwrap().to_string();
    let mut scenes = experiment("metadrive/cat-idm.toml");
    set(&mut scenes, &[("scenes", "count", 9.into()), ("scenes", "seed", 977.into())]);
    let (file, pool) = (write_small(folder.path(), scenes), place("other.pool"));
    assert_eq!(evodrive(&["scenes", "generate", file.to_str().unwrap(), "--out", &pool]).code, 0);
    let hardened = |out: &str, seed: &str| -> Value {
        let suite = ["harden", "golden/suite/pdm.suite", "--scenes", &pool, "--out", &place(out), "--seed", seed];
        let few = ["--families", "cat", "--rounds", "2", "--trials", "1", "--patches", "4", "--overwrite"];
        let ran = evodrive(&[&suite[..], &few[..]].concat());
        assert_eq!(ran.code, 0, "{}", ran.stderr);
        serde_json::from_slice(&std::fs::read(PathBuf::from(place(out)).join("harden.json")).unwrap()).unwrap()
    };
    let (first, again) = (hardened("one", "1"), hardened("one", "1"));
    assert_eq!(first, again);
    let other = hardened("two", "2");
    assert_ne!(first["rounds"], other["rounds"], "the seed draws other constants");
    assert_eq!(hardened("one", "2"), other, "nothing of the first draws is taken for the second's");
    let payoffs = other["payoffs"].as_array().unwrap();
    assert_eq!(payoffs.len(), 3, "parents and both rounds: {other}");
    let least = |row: &Value| row.as_array().unwrap().iter().all(|count| count.as_u64() <= other["rollouts"].as_u64());
    assert!(payoffs.iter().all(least), "{other}");
}
