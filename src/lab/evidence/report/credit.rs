//! Contribution of each patch of a reported program, as the page shows it.

use serde_json::{Value, json};

use crate::evidence::credit::{Credit, EditCredit, Gain};
use crate::objects::SolutionId;

/// Returns the contributions in the program that a lineage reports; `None` where nobody worked them out.
pub fn of(credits: &[Credit], reported: &SolutionId) -> Option<Value> {
    let credit = credits.iter().find(|of| of.program == *reported)?;
    let edit = |edit: &EditCredit| {
        json!({
            "name": edit.name,
            "what": edit.what,
            "so_far": edit.so_far.as_ref().and_then(|of| of.as_ref().ok()).map(gain),
            "needed": edit.taken_out.as_ref().ok().map(gain),
            "alone": edit.alone.as_ref().ok().map(gain),
            "says": credit.sentence(edit),
        })
    };
    Some(json!({
        "program": credit.program,
        "parent": credit.parent,
        "scenes": credit.scenes,
        "whole": gain(&credit.whole),
        "verdict": credit.whole.verdict(),
        "edits": credit.edits.iter().map(edit).collect::<Vec<_>>(),
    }))
}

fn gain(of: &Gain) -> Value {
    json!({"attack": of.attack, "realism": of.realism})
}
