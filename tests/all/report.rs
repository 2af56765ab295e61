//! What the report tells of runs of any size.

use evodrive::archive::SelectorOptions;
use evodrive::evidence::RecordedRun;
use evodrive::evidence::report::{Beside, Stage, html};
use evodrive::store::read_events;
use serde_json::Value;

use crate::harness::report_data;
use crate::quickstart::finished;

/// As in the quickstart.
const SELECTOR: SelectorOptions = SelectorOptions { realism_min: 0.95, tolerance: 0.05, also_at: None };

fn attempts(run: &RecordedRun) -> Vec<Value> {
    let beside = Beside { selector: &SELECTOR, cost: None, credits: &[], agreement: None, live: None };
    report_data(&html(run, &Stage::default(), &beside))[0]["attempts"].as_array().unwrap().clone()
}

/// A page of ten thousand whole stories has forty megabytes: of a large run only accepted attempts are told in full. None is left
/// out, and what the charts draw of one is the same.
#[test]
fn attempts_of_a_large_run_are_told_in_short_but_for_the_accepted_ones() {
    let mut run = RecordedRun::read(&read_events(&finished().1.join("transcript.jsonl")).unwrap()).unwrap();
    let whole = attempts(&run);
    assert_eq!(whole.len(), run.attempts.len());
    assert!(whole.iter().all(|attempt| attempt.get("in_short").is_none()), "a small run is told whole");
    let accepted: Vec<bool> =
        run.attempts.iter().map(|a| a.exit.decision().is_some_and(|decision| decision.gates.any())).collect();
    assert!(accepted.contains(&true) && accepted.contains(&false), "the run has both");

    let copies = 1_000 / whole.len() + 1;
    run.attempts = std::iter::repeat_n(run.attempts.clone(), copies).flatten().collect();
    let large = attempts(&run);
    assert_eq!(large.len(), run.attempts.len());
    for (at, attempt) in large.iter().enumerate() {
        let before = &whole[at % whole.len()];
        if accepted[at % whole.len()] {
            assert_eq!(attempt, before);
            continue;
        }
        assert_eq!(attempt["in_short"], true, "{}", attempt["id"]);
        assert!(attempt.get("reviews").is_none() && attempt.get("exchanges").is_none(), "{}", attempt["id"]);
        for field in ["id", "lineage", "epoch", "slot", "parent", "exit", "solution", "objectives"] {
            assert_eq!(attempt.get(field), before.get(field), "{field}");
        }
    }
}
