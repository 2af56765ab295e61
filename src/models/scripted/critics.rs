//! The four critics: each checks its side of the patch against the prompt and advises.

use serde_json::{Value, json};
use std::collections::BTreeSet;

use super::{
    Draws,
    check::{self, Finding, Fix},
    edit,
    forms::Purpose,
    names::words,
    reader::{Program, PromptView},
    refusal::unanswerable,
};
use crate::{kernel::Stream, llm::ModelError};

pub const ROLES: [&str; 4] = ["structural_critic", "attack_critic", "realism_critic", "isolation_critic"];

/// If the weakest diagnostic has a lower mean, patches that add pressure need a guard.
const WEAK_DIAGNOSTIC: f64 = 0.75;

/// A critic's objection to a patch.
struct Objection {
    blocker: String,
    hint: String,
    /// No local change helps.
    fatal: bool,
}

/// The review of one role. `asks_for_guards`: whether patches that add pressure need a guard where a diagnostic is weak.
pub fn review(
    page: &PromptView,
    role: &str,
    oversight_rate: f64,
    asks_for_guards: bool,
    draws: &Draws,
) -> Result<Value, ModelError> {
    let patch = page.patch.as_ref().ok_or_else(|| unanswerable("a critic's prompt has no JSON block `Patch`"))?;
    let mut objections = match role {
        "structural_critic" => structural(page, patch),
        "attack_critic" => attack(page, patch),
        "realism_critic" => realism(page, patch, asks_for_guards),
        _ => isolation(page, patch),
    };
    let stream: &mut Stream = &mut draws.stream("oversight");
    objections.retain(|_| !stream.chance(oversight_rate));
    let decision = if objections.is_empty() {
        "approve"
    } else if objections.iter().any(|objection| objection.fatal) {
        "reject"
    } else {
        "repair"
    };
    objections.truncate(16);
    Ok(json!({
        "role": role,
        "blockers": objections.iter().map(|o| cut(&o.blocker)).collect::<Vec<_>>(),
        "decision": decision,
        "repair_hints": objections.iter().filter(|o| !o.fatal).map(|o| cut(&o.hint)).collect::<Vec<_>>(),
        "risk_tags": risk_tags(page, patch, role),
        "scope": "pre_simulation",
    }))
}

fn cut(text: &str) -> String {
    text.chars().take(1_000).collect()
}

fn structural(page: &PromptView, patch: &Value) -> Vec<Objection> {
    let local = |finding: Finding| Objection { blocker: finding.blocker(), hint: finding.hint(), fatal: false };
    check::findings(page, patch).into_iter().map(local).collect()
}

/// Objects to a patch that cannot do what the target asks, or whose mechanism memory warns of.
fn attack(page: &PromptView, patch: &Value) -> Vec<Objection> {
    let mut objections = vec![];
    let operations = edit::operations(patch);
    if page.target() == "raise_attack" && !operations.is_empty() && operations.iter().all(|o| restricts(page, o)) {
        objections.push(Objection {
            blocker:
                "every operation only takes candidates, actors or scenes away: nothing raises the pressure on the ego"
                    .into(),
            hint: String::new(),
            fatal: true,
        });
    }
    let failed = page.failed_tags();
    let present: BTreeSet<&String> = page.program.mechanism_modules.values().flat_map(|module| &module.tags).collect();
    for operation in operations {
        let tags = operation["value"]["tags"].as_array().into_iter().flatten().filter_map(Value::as_str);
        for tag in tags.filter(|tag| failed.contains(tag) && !present.iter().any(|p| p == tag)) {
            objections.push(Objection {
                blocker: format!("{}: memory says that `{tag}` failed", edit::path_of(operation)),
                hint: format!("add a guard beside `{tag}` so that it fails no more for the same reason"),
                fatal: false,
            });
        }
    }
    objections
}

/// Filters, guards and gates can only remove candidates, actors and scenes.
fn restricts(page: &PromptView, operation: &Value) -> bool {
    let value = &operation["value"];
    let guards = |slot: &str| matches!(Purpose::of(page, slot), Some(Purpose::Guard | Purpose::Gate));
    let path = edit::path_of(operation);
    let filter = value["slot"] == "filter" && operation["op"] == "add";
    let module = value["slot"].as_str().is_some_and(guards);
    let setting = value["mechanism"].is_string() && path.contains("guard");
    filter || module || setting || path.contains("/inputs/")
}

/// Objects to removed guards, looser bounds, and, where it is to, more pressure where plausibility is already low.
fn realism(page: &PromptView, patch: &Value, asks_for_guards: bool) -> Vec<Objection> {
    let operations = edit::operations(patch);
    let Some(child) = check::child(page, patch) else { return vec![] };
    let hint = |why: &str| format!("add a guard {why}: a filter between the candidates and the choice");
    let mut objections = vec![];
    if guards(page, &child) < guards(page, &page.program) && page.target() != "diversify" {
        objections.push(Objection {
            blocker: "the patch takes a filter or a guard away and puts none in its place".into(),
            hint: hint("in its place"),
            fatal: false,
        });
    }
    for operation in operations.iter().filter(|operation| loosens(page, operation)) {
        objections.push(Objection {
            blocker: format!("{}: a bound becomes much looser", edit::path_of(operation)),
            hint: hint("for what the bound held"),
            fatal: false,
        });
    }
    let presses = operations.iter().any(|o| {
        o["value"]["slot"]
            .as_str()
            .is_some_and(|s| matches!(Purpose::of(page, s), Some(Purpose::Score | Purpose::Loss)))
    });
    if asks_for_guards
        && let Some((weakest, value)) = page.weakest()
        && value < WEAK_DIAGNOSTIC
        && presses
        && guards(page, &child) == 0
    {
        objections.push(Objection {
            blocker: format!("pressure is added while {weakest} stands at {value} and nothing guards it"),
            hint: hint(&format!("on {weakest}")),
            fatal: false,
        });
    }
    objections
}

/// Nodes of filters, and settings that hold a guard.
fn guards(page: &PromptView, program: &Program) -> usize {
    let filters = program.operator_graph.values().filter(|node| node.slot == "filter").count();
    let settings = program.operator_graph.values().flat_map(|node| node.settings.values());
    let is_guard = |value: &&Value| {
        let module = value["mechanism"].as_str().and_then(|name| program.mechanism_modules.get(name));
        module.is_some_and(|module| Purpose::of(page, &module.slot) == Some(Purpose::Guard))
    };
    filters + settings.filter(is_guard).count()
}

/// A limit parameter or setting that rises by more than a quarter of its range.
fn loosens(page: &PromptView, operation: &Value) -> bool {
    let path = edit::path_of(operation);
    let steps = edit::steps(path);
    let [part, name] = steps.as_slice() else { return false };
    let is_bound = name.contains("limit") || name.ends_with("_max");
    let (Some(domain), Some(old)) = (page.contract.parameters.get(name), page.parameter(name)) else { return false };
    let (Some(new), Some([low, high])) = (operation["value"].as_f64(), domain.range) else { return false };
    part == "parameters" && is_bound && new - old > 0.25 * (high - low)
}

/// Family, parent, foreign and protected words, references.
fn isolation(page: &PromptView, patch: &Value) -> Vec<Objection> {
    let mut objections = vec![];
    for finding in check::identity(page, patch) {
        let fatal = finding.path == "source_baseline";
        let hint = Finding { fix: Fix::Identity, ..finding };
        objections.push(Objection { blocker: hint.blocker(), hint: hint.hint(), fatal });
    }
    let operations = edit::operations(patch);
    let tainted: Vec<(usize, String)> = operations
        .iter()
        .enumerate()
        .filter_map(|(index, operation)| foreign_word(page, operation).map(|word| (index, word)))
        .collect();
    for (index, word) in &tainted {
        let path = edit::path_of(&operations[*index]);
        objections.push(Objection {
            blocker: format!("{path}: `{word}` belongs to another family"),
            hint: format!("drop the operation at {path}, or its use of `{word}`"),
            fatal: tainted.len() == operations.len() && operations.len() > 1,
        });
    }
    for (field, known) in [
        ("memory_refs_used", page.memory.iter().map(|card| card.id.as_str()).collect::<Vec<_>>()),
        ("cluster_refs_used", page.clusters.iter().map(|cluster| cluster.name.as_str()).collect()),
    ] {
        let cited = patch[field].as_array().into_iter().flatten().filter_map(Value::as_str);
        for unknown in cited.filter(|cited| !known.contains(cited)) {
            objections.push(Objection {
                blocker: format!("{field}: `{unknown}` was not shown"),
                hint: format!("drop `{unknown}` from {field}"),
                fatal: false,
            });
        }
    }
    objections
}

/// The first word of another family in an operation.
pub fn foreign_word(page: &PromptView, operation: &Value) -> Option<String> {
    let text = operation.to_string();
    let objections = words(&text).find(|word| page.foreign.iter().any(|foreign| foreign == word));
    objections.map(str::to_string)
}

fn risk_tags(page: &PromptView, patch: &Value, role: &str) -> Vec<String> {
    let mut tags: BTreeSet<String> = BTreeSet::new();
    for operation in edit::operations(patch) {
        let named = operation["value"]["tags"].as_array().into_iter().flatten().filter_map(Value::as_str);
        tags.extend(named.map(|tag| tag.chars().take(48).collect()));
    }
    if let (Some((weakest, _)), "realism_critic") = (page.weakest(), role) {
        tags.insert(weakest.chars().take(48).collect());
    }
    tags.into_iter().filter(|tag| !tag.is_empty()).take(6).collect()
}
