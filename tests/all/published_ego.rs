//! The egos that others published, and the names of those that the program carries.

use crate::harness::{Ran, evodrive, home, shared, text};
use serde_json::Value;

const PUBLISHED: &str = "evodrive:sac-chatscene";

fn here(folder: &std::path::Path, args: &[&str]) -> Ran {
    Ran::of(evodrive().current_dir(folder).args(args))
}

#[test]
fn the_plain_rows_of_safebenchs_egos_are_the_goldens() {
    let policies = [PUBLISHED, "evodrive:sac-safebench", "evodrive:sac-safebench-2"];
    let args: Vec<&str> = policies.into_iter().flat_map(|name| ["--policy", name]).collect();
    let ran = here(home(), &[&["egos", "experiments/safebench/all-idm.toml"], &args[..]].concat());
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    assert_eq!(ran.stdout, text("golden/safebench/egos.txt"));
}

#[test]
fn chatscenes_checkpoint_gives_the_weights_that_are_shipped() {
    let Some(checkpoint) = shared("data/safebench_ego/model.pt") else { return };
    let folder = tempfile::tempdir().unwrap();
    let at = |args: &[&str]| here(folder.path(), args);
    let path = checkpoint.to_str().unwrap();
    let import = ["policy", "import", path, "--out", "own.safetensors"];
    let ran = at(&import);
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    assert!(ran.stdout.contains("an actor of 4-256-256-2 that drives by safebench-2"), "{}", ran.stdout);
    let shipped = std::fs::read(home().join("policies/sac-chatscene.safetensors")).unwrap();
    assert!(std::fs::read(folder.path().join("own.safetensors")).unwrap() == shipped);
    let card: Value = serde_json::from_str(&text("policies/sac-chatscene.json")).unwrap();
    let digest = card["digest"].as_str().unwrap();
    assert!(ran.stdout.contains(digest), "{}", ran.stdout);
    // Damage of the actor is told by its place, and nothing is written.
    let mut bytes = std::fs::read(&checkpoint).unwrap();
    bytes[600_000] ^= 1;
    std::fs::write(folder.path().join("damaged.pt"), &bytes).unwrap();
    let ran = at(&["policy", "import", "damaged.pt", "--out", "none.safetensors"]);
    assert!(
        ran.code == 2 && ran.stderr.contains("damaged.pt: archive/data/2: expected bytes with the check sum"),
        "{}",
        ran.stderr
    );
    assert!(!folder.path().join("none.safetensors").exists());
}

#[test]
fn a_learned_ego_of_safebenchs_families_is_chatscenes_and_others_are_chosen_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let at = |args: &[&str]| here(folder.path(), args);
    let digest = |name: &str| {
        let card: Value = serde_json::from_str(&text(&format!("policies/{name}.json"))).unwrap();
        card["digest"].as_str().unwrap().to_string()
    };
    let lineage = |policy: &str| {
        let base =
            text("experiments/safebench/human-idm.toml").replace("../protocols/safebench.toml", "evodrive:safebench");
        let file = base.replace("ego = \"idm\"", &format!("ego = \"learned\"\n{policy}"));
        std::fs::write(folder.path().join("mine.toml"), file).unwrap();
        evodrive::experiment::composed(&folder.path().join("mine.toml"))
            .map(|composed| composed.table["lineage"][0]["policy"]["digest"].as_str().unwrap().to_string())
    };
    assert_eq!(lineage("").unwrap(), digest("sac-chatscene"));
    assert_eq!(lineage("policy = \"evodrive:sac-safebench\"").unwrap(), digest("sac-safebench"));
    let pinned = format!("policy = {{ file = \"{PUBLISHED}\", digest = \"{}\" }}", digest("sac-chatscene"));
    assert_eq!(lineage(&pinned).unwrap(), digest("sac-chatscene"));
    let other = lineage(&pinned.replace("sac-chatscene\"", "sac-metadrive\"")).unwrap_err().to_string();
    assert!(other.contains("lineage[0].policy.digest"), "{other}");
    let unknown = lineage("policy = \"evodrive:sac-chatscenes\"").unwrap_err().to_string();
    assert!(unknown.contains("lineage[0].policy") && unknown.contains(PUBLISHED), "{unknown}");
    for (family, policy) in [("human", PUBLISHED), ("cat", "evodrive:sac-metadrive")] {
        let ran = at(&["init", family, "--family", family, "--ego", "learned"]);
        assert_eq!(ran.code, 0, "{}", ran.stderr);
        assert!(ran.stdout.contains(&format!("ego = \"learned\"\npolicy = \"{policy}\"")), "{}", ran.stdout);
        // It is read, and its questions are known; nobody has answered them yet.
        assert_eq!(at(&["plan", &format!("{family}.toml")]).code, 3);
    }
    let ran = at(&["egos", "human.toml", "--policy", "evodrive:sac-chat"]);
    assert!(ran.code == 2 && ran.stderr.contains(PUBLISHED), "{}", ran.stderr);
}
