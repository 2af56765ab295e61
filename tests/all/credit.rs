//! `credit`: the edits of a program taken out and put on alone give what the programs between parent and program gave.

use serde_json::Value;

use evodrive::evidence::RecordedRun;
use evodrive::objects::LineageId;
use evodrive::store::read_events;

use crate::harness::run;
use crate::quickstart::finished;

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
