//! `credit`: the edits of a program taken out and put on alone give what the programs between parent and program gave.

use serde_json::Value;
use std::path::Path;

use evodrive::evidence::RecordedRun;
use evodrive::objects::LineageId;
use evodrive::store::read_events;

use crate::harness::{report_data, run};
use crate::quickstart::{copied, finished};

fn folder() -> String {
    finished().1.to_str().unwrap().to_string()
}

fn credit(program: &str) -> Value {
    let ran = run(&["--json", "credit", program, "--run", &folder()]);
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    serde_json::from_str::<Value>(&ran.stdout).unwrap()["credits"][0].clone()
}

fn attack(of: &Value) -> f64 {
    of["attack"]["value"].as_f64().unwrap()
}

#[test]
fn what_an_edit_is_worth_is_what_the_program_before_it_lacks() {
    let recorded = RecordedRun::read(&read_events(&finished().1.join("transcript.jsonl")).unwrap()).unwrap();
    let lineage = LineageId::new("adv_bmt-idm");
    let result = recorded.result.as_ref().unwrap().lineages.iter().find(|of| of.lineage == lineage).unwrap();
    let last = &result.evolved.solution;
    let names: Vec<String> = recorded.chain(last).iter().map(|program| program.solution_id.to_string()).collect();
    let [parent, .., before, last] = &names[..] else { panic!("expected a chain of some edits, found {names:?}") };
    let of_last = credit(last);

    // The program as a whole gains what its recorded labels say.
    let places = [format!("{}:{parent}", folder()), format!("{}:{last}", folder())];
    let compared = run(&["--json", "compare", &places[0], &places[1]]);
    let compared: Value = serde_json::from_str(&compared.stdout).unwrap();
    let text = compared.to_string();
    let gain = attack(&of_last["whole"]);
    assert!(gain > 0.0 && text.contains(&format!("{{\"difference\":{}", of_last["whole"]["attack"])), "{gain}: {text}");

    let edits = of_last["edits"].as_array().unwrap();
    assert_eq!(edits.iter().map(|edit| edit["name"].as_str().unwrap()).collect::<Vec<_>>(), names[1..]);
    let of_before = credit(before);
    let (needed, without) = (attack(&edits[edits.len() - 1]["taken_out"]["Ok"]), attack(&of_before["whole"]));
    assert!((gain - needed - without).abs() < 1e-12, "{gain} is not {needed} more than {without}");
    assert_eq!(edits[0]["alone"], of_before["edits"][0]["alone"]);

    // The way of the chain: each step is what the program of that step gained.
    let so_far = |of: &Value, nth: usize| of["edits"][nth]["so_far"]["Ok"].clone();
    assert_eq!(so_far(&of_last, edits.len() - 1), of_last["whole"]);
    assert_eq!(so_far(&of_last, edits.len() - 2), of_before["whole"]);
    assert_ne!(of_before["whole"], of_last["whole"]);
}

#[test]
fn a_parent_has_no_edit() {
    let ran = run(&["credit", "cat-idm/parent", "--run", &folder()]);
    assert!(ran.code == 0 && ran.stdout.contains("cat-idm/parent is a parent"), "{}", ran.stderr);
    let ran = run(&["credit", "cat-idm", "--run", &folder()]);
    assert!(ran.code == 0 && ran.stdout.contains("the run reports the parent of cat-idm"), "{}", ran.stderr);
}

#[test]
fn labels_that_are_not_the_recorded_ones_get_no_credit() {
    let ran = run(&["credit", "adv_bmt-idm/e4s1", "--ego", "replay", "--run", &folder()]);
    assert!(ran.code == 4 && ran.stderr.contains("the run recorded another rollout"), "{}", ran.stderr);
}

/// The report's data, of the lineage that has a descendant to report.
fn reported(folder: &Path) -> Value {
    let page = std::fs::read_to_string(folder.join("report.html")).unwrap();
    let lineages = report_data(&page)[0]["lineages"].as_array().unwrap().clone();
    lineages.into_iter().find(|of| of["id"] == "adv_bmt-idm").unwrap()
}

#[test]
fn a_report_shows_what_each_patch_accounts_for_and_plays_nothing_once_that_is_kept() {
    let dir = tempfile::tempdir().unwrap();
    let folder = copied(dir.path());
    let name = folder.to_str().unwrap();
    let report = |more: &[&str]| {
        let ran = run(&[["report", "--run", name].as_slice(), more].concat());
        assert_eq!(ran.code, 0, "{}", ran.stderr);
        (reported(&folder), ran.stderr.contains("playing it without each of its edits"))
    };
    let (page, played) = report(&[]);
    assert!(page.get("credit").is_none() && !played, "nobody worked anything out yet");
    let (page, played) = report(&["--credit"]);
    assert!(played);
    let shown = &page["credit"];
    let result = &page["result"];
    let recorded = |of: &str| result[of]["objectives"]["attack"].as_f64().unwrap();
    let gain = attack(&shown["whole"]);
    assert!(gain > 0.0 && (gain - recorded("evolved") + recorded("parent")).abs() < 1e-12, "{gain}: {result}");
    assert_eq!((&shown["program"], &shown["parent"]), (&result["evolved"]["solution"], &result["parent"]["solution"]));
    let worked_out = credit(shown["program"].as_str().unwrap());
    let edits = shown["edits"].as_array().unwrap();
    assert_eq!(edits.len(), worked_out["edits"].as_array().unwrap().len());
    for (shown, known) in edits.iter().zip(worked_out["edits"].as_array().unwrap()) {
        for (name, of) in [("needed", "taken_out"), ("alone", "alone")] {
            let known = known[of].get("Ok").map(|gain| (&gain["attack"], &gain["realism"]));
            assert_eq!(shown[name].as_object().map(|gain| (&gain["attack"], &gain["realism"])), known, "{shown}");
        }
        let says = shown["says"].as_str().unwrap();
        assert!(says.starts_with(known["name"].as_str().unwrap()), "{says}");
    }
    let total = format!("of +{gain:.3} attack");
    assert!(edits.iter().any(|edit| edit["says"].as_str().unwrap().contains(&total)), "{total}: {edits:?}");
    assert_eq!(report(&["--credit"]), (page.clone(), false));
    assert_eq!(report(&[]), (page, false));
}

#[test]
fn credit_of_another_run_is_not_shown_and_a_changed_number_is_damage() {
    let dir = tempfile::tempdir().unwrap();
    let folder = copied(dir.path());
    let (name, kept) = (folder.to_str().unwrap(), folder.join("credit.json"));
    let ran = run(&["credit", "adv_bmt-idm", "--run", name]);
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    let text = std::fs::read_to_string(&kept).unwrap();
    let root = serde_json::from_str::<Value>(&text).unwrap()["root"].as_str().unwrap().to_string();
    std::fs::write(&kept, text.replace(&root, &"0".repeat(root.len()))).unwrap();
    assert_eq!(run(&["report", "--run", name]).code, 0);
    assert!(reported(&folder).get("credit").is_none());
    let changed = text.replacen("\"value\": 0.", "\"value\": 0.9", 1);
    assert_ne!(changed, text);
    std::fs::write(&kept, changed).unwrap();
    let ran = run(&["report", "--run", name]);
    assert!(ran.code == 5 && ran.stderr.contains("credit.json: expected contents of digest"), "{}", ran.stderr);
    // Working it out again mends it.
    assert_eq!(run(&["credit", "adv_bmt-idm", "--run", name]).code, 0);
    assert_eq!(std::fs::read_to_string(&kept).unwrap(), text);
}
