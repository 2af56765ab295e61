//! `options`: the reference of experiment files, as `docs/EXPERIMENT.md` holds it.

use serde_json::json;

use super::answer::Answer;
use crate::experiment;

pub fn run() -> Answer {
    let page = experiment::page();
    Answer::new(page.clone(), json!({"page": page}))
}
