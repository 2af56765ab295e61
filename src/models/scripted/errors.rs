//! Errors at the rates that the experiment file declares. They are put into finished drafts; some can be repaired, some
//! cannot.

use serde_json::{Value, json};

use super::{edit, reader::PromptView, refusal::unanswerable};
use crate::{
    kernel::{Stream, num},
    llm::{ModelError, ModelSpec},
};

/// Shares of replies with an error, each in 0..1. All must be declared in `ModelSpec.sampling` under these names.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rates {
    /// Share of all replies that are cut off, fenced, or have prose around the object.
    pub malformed_json_rate: f64,
    /// Share of patches with a number outside its declared range, of sets of attackers with a vehicle that the scene
    /// does not have, of templates with a range beyond its bounds, and of changes of the world evaluator with a value out of its range.
    pub out_of_range_rate: f64,
    /// Share of patches with a mechanism that reads a word of another family, or an unknown word, and of changes of the world evaluator
    /// that name what is protected.
    pub foreign_mechanism_rate: f64,
    /// Share of patches with a wrong parent hash.
    pub stale_hash_rate: f64,
    /// Share of a critic's findings that it overlooks, as reviewers do; the gates still find them. Also the share of
    /// feedback that an attacker agent overlooks.
    pub oversight_rate: f64,
}

impl Rates {
    /// The error rates among a model's sampling parameters.
    pub fn of(model: &ModelSpec) -> Result<Rates, ModelError> {
        let rate = |name: &str| {
            let value = required(model, name)?;
            if (0.0..=1.0).contains(&value) {
                return Ok(value);
            }
            Err(unanswerable(format!("sampling.{name} of model `{}` is {value}, expected 0 to 1", model.name)))
        };
        Ok(Rates {
            malformed_json_rate: rate("malformed_json_rate")?,
            out_of_range_rate: rate("out_of_range_rate")?,
            foreign_mechanism_rate: rate("foreign_mechanism_rate")?,
            stale_hash_rate: rate("stale_hash_rate")?,
            oversight_rate: rate("oversight_rate")?,
        })
    }
}

/// A sampling value that has no default.
pub fn required(model: &ModelSpec, name: &str) -> Result<f64, ModelError> {
    model.sampling.get(name).copied().ok_or_else(|| {
        unanswerable(format!("model `{}` has no sampling.{name}; declare it in the experiment file", model.name))
    })
}

/// Plants errors of content. Every kind is drawn in every patch, so that one rate does not influence errors of another
/// kind.
pub fn plant(page: &PromptView, patch: &mut Value, rates: Rates, stream: &mut Stream) {
    let [range, foreign, stale] =
        [rates.out_of_range_rate, rates.foreign_mechanism_rate, rates.stale_hash_rate].map(|rate| stream.chance(rate));
    if range {
        out_of_range(page, patch, stream);
    }
    if foreign {
        foreign_mechanism(page, patch, stream);
    }
    if stale {
        patch["parent_program_hash"] = (0..4).map(|_| format!("{:016x}", stream.bits())).collect::<String>().into();
    }
}

fn out_of_range(page: &PromptView, patch: &mut Value, stream: &mut Stream) {
    let numeric: Vec<(String, [f64; 2])> = page
        .contract
        .parameters
        .iter()
        .filter(|(_, domain)| domain.is_numeric())
        .filter_map(|(name, domain)| Some((format!("/parameters/{name}"), domain.range?)))
        .collect();
    let edited =
        |path: &str| edit::operations(patch).iter().position(|o| edit::path_of(o) == path && o["op"] == "replace");
    let touched: Vec<_> = numeric.iter().filter(|(path, _)| edited(path).is_some()).collect();
    let Some((path, [low, high])) = stream.pick(&touched).copied().or_else(|| stream.pick(&numeric)).cloned() else {
        return;
    };
    let beyond = stream.uniform(0.3, 2.0) * (high - low).max(1.0);
    let value = if stream.chance(0.5) { high + beyond } else { low - beyond };
    let at = edited(&path);
    put(page, patch, at, edit::replace(path, Value::from(num::rounded(value.round(), 2))));
}

fn foreign_mechanism(page: &PromptView, patch: &mut Value, stream: &mut Stream) {
    let word = stream.pick(&page.foreign).map_or("borrowed_mechanism", String::as_str);
    let expression = edit::operations(patch).iter().position(|o| o["value"]["expression"].is_string());
    if let Some(at) = expression {
        let module = &mut patch["operations"][at]["value"];
        let text = module["expression"].as_str().unwrap_or_default();
        let longer = if module["output"] == "boolean" {
            format!("({text}) and {word} > 0")
        } else {
            format!("({text}) + {word}")
        };
        module["expression"] = longer.into();
        if let Some(inputs) = module["inputs"].as_array_mut() {
            inputs.push(word.into());
        }
        return;
    }
    let Some(slot) =
        page.contract.mechanism_slots.iter().find(|(_, slot)| slot.output == "number").map(|(name, _)| name)
    else {
        return;
    };
    let module = json!({"slot": slot, "inputs": [word], "output": "number", "expression": word, "tags": ["borrowed"]});
    put(page, patch, None, edit::add("/mechanism_modules/borrowed".into(), module));
}

/// In place of an operation, or one more, or in place of the last one where there is no room.
fn put(page: &PromptView, patch: &mut Value, at: Option<usize>, operation: Value) {
    let most = page.contract.limits.operations_per_patch.max(1);
    let Some(operations) = patch["operations"].as_array_mut() else { return };
    match at {
        Some(at) if at < operations.len() => operations[at] = operation,
        _ if operations.len() < most => operations.push(operation),
        _ => {
            operations.pop();
            operations.push(operation);
        }
    }
}

/// The reply, or at the declared rate a form of it that is not exactly one JSON object.
pub fn garbled(reply: String, rates: Rates, stream: &mut Stream) -> String {
    if !stream.chance(rates.malformed_json_rate) {
        return reply;
    }
    match stream.below(4) {
        0 => {
            let cut = (1 + stream.below(reply.len().max(2) - 1)).min(reply.len().saturating_sub(1));
            let end = (0..=cut).rev().find(|at| reply.is_char_boundary(*at)).unwrap_or(0);
            reply.get(..end).unwrap_or_default().to_string()
        }
        1 => format!("{reply}\n\nThis patch should raise the pressure on the ego without hurting plausibility."),
        2 => format!("```json\n{reply}\n```"),
        _ => format!("Here is the JSON object:\n{reply}"),
    }
}
