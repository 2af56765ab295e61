//! The actor: it draws an edit strategy that fits the context, checks its draft, and states what it expects.

use serde_json::{Value, json};
use std::collections::BTreeSet;

use super::{
    Draws, check, edit, forms,
    reader::PromptView,
    refusal::unanswerable,
    strategies::{STRATEGIES, Strategy},
    wiring::Draft,
};
use crate::{kernel::Stream, llm::ModelError};

/// Most rejected drafts before it gives up.
const TRIES: usize = 48;
/// Share of patches that join two edits.
const DOUBLE_SHARE: f64 = 0.25;

/// A patch for the parent of the prompt.
pub fn propose(page: &PromptView, draws: &Draws) -> Result<Value, ModelError> {
    let stream = &mut draws.stream("draft");
    for _ in 0..TRIES {
        if let Some(patch) = attempt(page, stream) {
            return Ok(patch);
        }
    }
    Err(unanswerable("no edit strategy finds anything to change in this parent under this contract"))
}

fn attempt(page: &PromptView, stream: &mut Stream) -> Option<Value> {
    let mut draft = Draft::default();
    let first = chosen(page, "", stream)?;
    let mut says = (first.apply)(page, &mut draft, stream)?;
    if stream.chance(DOUBLE_SHARE) {
        let before = draft.clone();
        let more = chosen(page, first.name, stream).and_then(|second| (second.apply)(page, &mut draft, stream));
        match more.map(|more| format!("{says}. {more}")) {
            Some(both) if check::findings(page, &patch(page, &draft, &both)).is_empty() => says = both,
            _ => draft = before,
        }
    }
    let patch = patch(page, &draft, &says);
    (!draft.operations.is_empty() && check::findings(page, &patch).is_empty()).then_some(patch)
}

fn chosen(page: &PromptView, except: &str, stream: &mut Stream) -> Option<&'static Strategy> {
    let weights: Vec<f64> = STRATEGIES.iter().map(|s| if s.name == except { 0.0 } else { weight(page, s) }).collect();
    STRATEGIES.get(forms::weighted(&weights, stream)?)
}

/// The strategy's weight for the target, changed by the results of the latest attempts and of the parent.
fn weight(page: &PromptView, strategy: &Strategy) -> f64 {
    let [attack, realism, diversify] = strategy.weights;
    let mut weight = match page.target() {
        "raise_attack" => attack,
        "raise_realism" => realism,
        _ => diversify,
    };
    let guarding = ["insert_filter", "rule_on_parameters"].contains(&strategy.name);
    if guarding && lost_realism(page) {
        weight *= 1.6;
    }
    if strategy.name == "remove_filter" && page.weakest().is_some_and(|(_, value)| value < 0.9) {
        weight *= 0.3;
    }
    weight
}

/// Returns `true` if the latest labelled attempt had less realism than its parent, by more than 0.01.
fn lost_realism(page: &PromptView) -> bool {
    let latest = page.history.iter().rev().find_map(|edit| edit.change.as_ref());
    latest.is_some_and(|change| change.realism() < -0.01)
}

fn patch(page: &PromptView, draft: &Draft, says: &str) -> Value {
    let clusters: BTreeSet<&String> = draft.clusters.iter().collect();
    json!({
        "source_baseline": page.identity.source_family,
        "parent_solution_id": page.identity.parent_solution_id,
        "parent_program_hash": page.identity.parent_program_hash,
        "operations": draft.operations,
        "hypothesis": hypothesis(page, says, &draft.operations),
        "memory_refs_used": memory_refs(page, draft),
        "cluster_refs_used": clusters,
    })
}

/// The hypothesis: what was changed, and what effect is expected for the target.
fn hypothesis(page: &PromptView, says: &str, operations: &[Value]) -> String {
    let restricts = operations.iter().all(|o| o["value"]["slot"] == "filter" || edit::path_of(o).contains("/inputs/"));
    let expects = match (page.target(), restricts) {
        ("raise_attack", false) => "attack should rise on scenes that were missed, with realism kept",
        ("raise_realism", true) => "realism should rise by what is filtered out, at little loss of attack",
        ("raise_realism", false) => "realism should rise while the attack that is there is kept",
        (_, true) => "realism should rise; some attack may be lost",
        (_, false) => "this should reach scenes and trade-offs that the front does not cover",
    };
    let says: String = says.chars().take(1_600).collect();
    format!("{says}: {expects}.")
}

/// References to cards with mechanisms that the draft uses, and to one that warns of a mechanism that it avoids.
fn memory_refs(page: &PromptView, draft: &Draft) -> Vec<String> {
    let uses = |tags: &[String]| tags.iter().any(|tag| draft.tags.contains(tag));
    let helped = page.memory.iter().filter(|card| card.kind == "success" && uses(&card.mechanism_tags)).take(3);
    let heeded = |tags: &[String]| !tags.is_empty() && !uses(tags);
    let warned = page.memory.iter().filter(|card| card.kind == "failure" && heeded(&card.mechanism_tags)).take(1);
    let warned = warned.filter(|_| !draft.tags.is_empty());
    helped.chain(warned).map(|card| card.id.clone()).collect()
}
