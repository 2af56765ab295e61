//! The repair: the smallest change that answers the objections of the reviews.

use serde_json::Value;

use super::{
    Draws, actor,
    check::{self, Finding, Fix},
    critics, edit,
    names::words,
    reader::PromptView,
    refusal::unanswerable,
    strategies,
};
use crate::llm::ModelError;

/// Most passes over the findings, because mending one may reveal another.
const PASSES: usize = 4;

/// The repaired patch, with its summary.
pub fn repair(page: &PromptView, draws: &Draws) -> Result<Value, ModelError> {
    let Some(original) = &page.patch else { return redrafted(page, draws) };
    if page.refused.contains_key("effect") {
        // What has no effect has nothing to mend: another edit takes its place.
        let mut other = actor::propose(page, draws)?;
        other["repair_summary"] = "Replaced an edit without effect by another one.".into();
        return Ok(other);
    }
    let mut patch = original.clone();
    let mut done = vec![];
    for _ in 0..PASSES {
        let findings: Vec<Finding> = check::findings(page, &patch).into_iter().filter(|f| is_raised(page, f)).collect();
        let Some(finding) = findings.first() else { break };
        mend(page, &mut patch, finding);
        done.push(finding.hint());
    }
    done.extend(drop_foreign(page, &mut patch));
    done.extend(drop_references(page, &mut patch));
    done.extend(add_guard(page, &mut patch, draws));
    if edit::operations(&patch).is_empty() {
        patch["operations"] = original["operations"].clone();
        done = vec!["nothing: what is blocked is all of the patch".into()];
    }
    let summary = if done.is_empty() { "no change: no blocker names one".to_string() } else { done.join("; ") };
    patch["repair_summary"] = summary.chars().take(1_800).collect::<String>().into();
    Ok(patch)
}

/// Returns `true` if a review or a gate mentions it. A repair mends nothing else.
fn is_raised(page: &PromptView, finding: &Finding) -> bool {
    let said = page
        .reviews
        .iter()
        .filter(|review| review.decision != "approve")
        .flat_map(|r| r.blockers.iter().chain(&r.repair_hints));
    let named =
        |text: &String| text.contains(&finding.path) || matches!(finding.fix, Fix::Identity) && text.contains("identi");
    said.into_iter().chain(page.refused.values().flatten()).any(named) || gates_name(page, finding)
}

/// Returns `true` if the gate of identifiers refuses the patch and the finding is about them.
fn gates_name(page: &PromptView, finding: &Finding) -> bool {
    matches!(finding.fix, Fix::Identity) && page.refused.contains_key("parent")
}

fn mend(page: &PromptView, patch: &mut Value, finding: &Finding) {
    if let Fix::Identity = finding.fix {
        patch["source_baseline"] = page.identity.source_family.as_str().into();
        patch["parent_solution_id"] = page.identity.parent_solution_id.as_str().into();
        patch["parent_program_hash"] = page.identity.parent_program_hash.as_str().into();
        return;
    }
    let Some(index) = finding.operation else { return };
    let Some(operation) = patch["operations"].get_mut(index) else { return };
    match &finding.fix {
        Fix::Set { pointer, value } => {
            if let Some(place) = operation["value"].pointer_mut(pointer) {
                *place = value.clone();
            }
        }
        Fix::Rename { from, to } => {
            operation["value"] = renamed(&operation["value"], from, to);
            if let Some(path) = operation["path"].as_str() {
                operation["path"] = with_word(path, from, to).into();
            }
        }
        Fix::Drop | Fix::Identity => drop_operation(patch, index),
    }
}

/// Removes an operation, and everything that refers to a module or node that it would have added.
fn drop_operation(patch: &mut Value, index: usize) {
    let Some(operations) = patch["operations"].as_array_mut() else { return };
    let gone = operations.remove(index);
    let name = edit::steps(edit::path_of(&gone)).into_iter().nth(1);
    let (Some(name), Some("add")) = (name, gone["op"].as_str()) else { return };
    operations.retain(|operation| {
        operation["value"]["mechanism"].as_str() != Some(&name) && operation["value"].as_str() != Some(&name)
    });
}

fn renamed(value: &Value, from: &str, to: &str) -> Value {
    match value {
        Value::String(text) => with_word(text, from, to).into(),
        Value::Array(items) => items.iter().map(|item| renamed(item, from, to)).collect(),
        Value::Object(map) => {
            map.iter().map(|(key, item)| (with_word(key, from, to), renamed(item, from, to))).collect()
        }
        other => other.clone(),
    }
}

/// The text with a whole word replaced.
fn with_word(text: &str, from: &str, to: &str) -> String {
    let is_word = |c: char| c.is_ascii_alphanumeric() || c == '_';
    let mut out = String::new();
    for piece in text.split_inclusive(|c: char| !is_word(c)) {
        let body = piece.trim_end_matches(|c: char| !is_word(c));
        out.push_str(if body == from { to } else { body });
        out.push_str(piece.get(body.len()..).unwrap_or_default());
    }
    out
}

fn drop_foreign(page: &PromptView, patch: &mut Value) -> Vec<String> {
    let raised = |word: &str| {
        let said = page.reviews.iter().flat_map(|review| &review.blockers).chain(page.refused.values().flatten());
        said.into_iter().any(|text| words(text).any(|w| w == word))
    };
    let tainted =
        edit::operations(patch).iter().position(|o| critics::foreign_word(page, o).is_some_and(|word| raised(&word)));
    match tainted {
        Some(index) => {
            let path = edit::path_of(&edit::operations(patch)[index]).to_string();
            drop_operation(patch, index);
            vec![format!("dropped the foreign mechanism at {path}")]
        }
        None => vec![],
    }
}

fn drop_references(page: &PromptView, patch: &mut Value) -> Vec<String> {
    let known: Vec<&String> =
        page.memory.iter().map(|card| &card.id).chain(page.clusters.iter().map(|c| &c.name)).collect();
    let mut dropped = vec![];
    for field in ["memory_refs_used", "cluster_refs_used"] {
        if let Some(items) = patch[field].as_array_mut() {
            let before = items.len();
            items.retain(|item| known.iter().any(|known| item.as_str() == Some(known)));
            if items.len() < before {
                dropped.push(format!("dropped references from {field} that were not shown"));
            }
        }
    }
    dropped
}

/// A guard where a review asks for one and the patch has room.
fn add_guard(page: &PromptView, patch: &mut Value, draws: &Draws) -> Vec<String> {
    let asked = page.reviews.iter().flat_map(|review| &review.repair_hints).any(|hint| hint.contains("add a guard"));
    let (Some(program), true) = (check::child(page, patch), asked) else { return vec![] };
    let stream = &mut draws.stream("guard");
    for _ in 0..8 {
        let Some(draft) = strategies::guard(page, &program, stream) else { break };
        let mut longer = patch.clone();
        if let Some(operations) = longer["operations"].as_array_mut() {
            operations.extend(draft.operations);
        }
        if check::findings(page, &longer).len() <= check::findings(page, patch).len() {
            *patch = longer;
            return vec!["added a guard on the candidates".into()];
        }
    }
    vec![]
}

/// Without a readable patch: the patch in the text if it can be read after all, else the actor's draft once more.
fn redrafted(page: &PromptView, draws: &Draws) -> Result<Value, ModelError> {
    let text = page
        .unreadable
        .as_ref()
        .ok_or_else(|| unanswerable("a repair's prompt has neither `Patch` nor `Unreadable reply`"))?;
    let repaired =
        text.find('{').and_then(|at| serde_json::Deserializer::from_str(&text[at..]).into_iter::<Value>().next());
    let meant = repaired.and_then(Result::ok).map(|reply| reply["program_patch"].clone()).filter(is_patch);
    let mut patch = match meant {
        Some(patch) => patch,
        None => actor::propose(page, &draws.of_actor())?,
    };
    patch["repair_summary"] = "Returned the patch as one JSON object.".into();
    Ok(patch)
}

/// Returns `true` if it has the fields of a patch and no others.
fn is_patch(value: &Value) -> bool {
    let fields = [
        "source_baseline",
        "parent_solution_id",
        "parent_program_hash",
        "operations",
        "hypothesis",
        "memory_refs_used",
        "cluster_refs_used",
    ];
    value.as_object().is_some_and(|map| {
        fields.iter().all(|field| map.contains_key(*field))
            && map.keys().all(|key| fields.contains(&key.as_str()) || key == "repair_summary")
    })
}
