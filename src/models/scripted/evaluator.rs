//! The world agent: rules that read the audit of the world evaluator and name one change each. The change whose reason weighs most
//! is proposed, now and then the second; what was proposed before is not proposed again.

use serde::Deserialize;
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;

use super::{
    Draws,
    errors::Rates,
    reader::{blocks, take},
};
use crate::{
    kernel::num,
    llm::{ModelError, Request},
};

pub const ROLE: &str = "world_agent";

/// How often the change with the second best reason is proposed.
const SECOND_RATE: f64 = 0.25;
/// Percentage points by which coverage may miss its level.
const COVERAGE_OFF_PCT: f64 = 3.0;
/// A rank correlation below this is no help.
const RANKED: f64 = 0.4;

#[derive(Debug, Deserialize)]
struct Task {
    response_id: String,
}

/// The keys of the active configuration that rules look at.
#[derive(Debug, Deserialize)]
struct Active {
    /// An evaluator of pairs has no choice of it.
    model: Option<String>,
    ridge_lambda: f64,
    #[serde(default)]
    trees: u64,
    #[serde(default)]
    learning_rate: f64,
    beta_attack: f64,
    beta_realism: f64,
    calibration_group: String,
    interval_level: f64,
    realism_weight: f64,
    explore: f64,
    lambda_a: f64,
    lambda_r: f64,
    excluded_groups: Vec<String>,
    lambda_u: f64,
    /// Uncertainty above which the evaluator abstains, where it predicts pairs.
    abstain_above: Option<f64>,
}

#[derive(Debug, Deserialize)]
struct Audit {
    level_pct: f64,
    measures: Measures,
    groups: Vec<Group>,
    selected: Routed,
    audited: Routed,
}

#[derive(Debug, Deserialize)]
struct Measures {
    rank_correlation: Option<f64>,
    attack_error: Option<f64>,
    realism_error: Option<f64>,
    coverage_pct: Option<f64>,
    false_reject_pct: Option<f64>,
}

#[derive(Debug, Deserialize)]
struct Group {
    group: String,
    columns: usize,
    residual: Option<(String, f64)>,
}

#[derive(Debug, Deserialize)]
struct Routed {
    accepted_pct: Option<f64>,
}

#[derive(Debug, Deserialize)]
struct Earlier {
    changes: Option<Map<String, Value>>,
}

/// A change with what speaks for it.
struct Idea {
    /// How much speaks for it, > 0.
    weight: f64,
    changes: Value,
    why: String,
    gains: &'static str,
}

/// The reply object.
pub fn answer(request: &Request, rates: Rates, draws: &Draws) -> Result<Value, ModelError> {
    let shown: BTreeMap<String, Value> =
        request.messages.iter().filter(|m| m.role == "user").flat_map(|m| blocks(&m.text)).collect();
    let (task, active): (Task, Active) = (take(&shown, "Task")?, take(&shown, "Active configuration")?);
    let (audit, earlier): (Audit, Vec<Earlier>) = (take(&shown, "Audit")?, take(&shown, "Earlier proposals")?);
    let known = |idea: &Idea| earlier.iter().any(|of| of.changes.as_ref() == idea.changes.as_object());
    let mut ideas: Vec<Idea> = ideas(&active, &audit).into_iter().filter(|idea| !known(idea)).collect();
    ideas.sort_by(|a, b| b.weight.total_cmp(&a.weight));
    let second = draws.stream("idea").chance(SECOND_RATE) && ideas.len() > 1;
    let mut idea = match ideas.into_iter().nth(usize::from(second)) {
        Some(idea) => idea,
        None => another_penalty(&active, earlier.len()),
    };
    let mut errors = draws.stream("errors");
    if errors.chance(rates.out_of_range_rate) {
        idea.changes["audit_share"] = json!(1.0);
    }
    if errors.chance(rates.foreign_mechanism_rate) {
        idea.changes["rollout_budget"] = json!(1000);
    }
    let candidate = json!({
        "evaluation_hypothesis": idea.why,
        "expected_judge_metric_improvement": idea.gains,
        "proposed_evaluator_configuration": idea.changes,
        "calibration_rationale": "predictions are held to the group's mean by the two weights",
        "audit_routing_policy": "audits stay a random draw among those that the rank leaves out",
        "risk_notes": ["a gain on few held candidates may be chance"],
    });
    Ok(json!({"response_id": task.response_id, "world_candidate": candidate}))
}

/// Everything that the audit gives a reason for.
fn ideas(active: &Active, audit: &Audit) -> Vec<Idea> {
    let mut ideas = Vec::new();
    coverage(active, audit, &mut ideas);
    errors(active, audit, &mut ideas);
    ranking(active, audit, &mut ideas);
    abstention(active, audit, &mut ideas);
    columns(active, audit, &mut ideas);
    ideas
}

/// Intervals that hold too few labels or too many are made wider or narrower by as much.
fn coverage(active: &Active, audit: &Audit, ideas: &mut Vec<Idea>) {
    let Some(covered) = audit.measures.coverage_pct else { return };
    let off = audit.level_pct - covered;
    let level = num::rounded((active.interval_level + off / 100.0).clamp(0.5, 0.95), 2);
    if off.abs() > COVERAGE_OFF_PCT {
        ideas.push(Idea {
            weight: off.abs() / COVERAGE_OFF_PCT,
            changes: json!({"interval_level": level}),
            why: format!("intervals hold {covered:.1} % of the labels in place of {:.1} %", audit.level_pct),
            gains: "coverage",
        });
    }
}

/// A prediction that is no better than the guess is held to the mean; a good one is let go.
fn errors(active: &Active, audit: &Audit, ideas: &mut Vec<Idea>) {
    let objectives = [
        ("beta_attack", active.beta_attack, audit.measures.attack_error),
        ("beta_realism", active.beta_realism, audit.measures.realism_error),
    ];
    for (name, beta, error) in objectives {
        let Some(error) = error else { continue };
        let to = if error > 0.97 { beta - 0.3 } else { beta + 0.1 };
        let to = num::rounded(to.clamp(0.0, 1.0), 2);
        if to != beta {
            ideas.push(Idea {
                weight: 0.5 + 2.0 * (error - 0.97).abs(),
                changes: json!({ name: to }),
                why: format!("the error is {error:.3} of the guess that nothing changes"),
                gains: "error of realism, rank correlation",
            });
        }
    }
    if audit.measures.realism_error.is_some_and(|error| error > 0.9) {
        let group = if active.calibration_group == "family" { "mechanism_class" } else { "family" };
        ideas.push(Idea {
            weight: 0.6,
            changes: json!({"calibration_group": group}),
            why: format!("means by {} do not help", active.calibration_group),
            gains: "error of realism",
        });
    }
}

/// A rank that is hardly better than a draw: another regression, a stiffer one, other weights.
fn ranking(active: &Active, audit: &Audit, ideas: &mut Vec<Idea>) {
    let rank = audit.measures.rank_correlation.unwrap_or(0.0);
    let lack = (RANKED - rank).max(0.0);
    if lack <= 0.0 {
        return;
    }
    let mut idea = |weight: f64, changes: Value, why: String| {
        let gains = "rank correlation, false rejects";
        ideas.push(Idea { weight: weight * lack / RANKED, changes, why, gains });
    };
    let said = format!("the rank correlation is {rank:.3}");
    if active.explore > 0.0 {
        idea(2.0, json!({"explore": 0.0}), format!("{said}, and the half widths in the rank are no gain"));
    }
    if active.model.as_deref() == Some("boosted") {
        let slower = json!({"trees": (active.trees * 2).clamp(1, 200), "learning_rate": active.learning_rate * 0.5});
        idea(1.5, slower, format!("{said}: more and smaller steps fit less noise"));
        let fewer = json!({"trees": (active.trees / 2).max(1)});
        idea(0.9, fewer, format!("{said}: fewer trees fit less noise"));
        idea(1.2, json!({"model": "ridge"}), format!("{said} with trees"));
    } else {
        if active.model.is_some() {
            idea(1.2, json!({"model": "boosted"}), format!("{said} with a line"));
        }
        let stiffer = num::rounded((active.ridge_lambda * 3.0).min(1e5), 3);
        idea(1.4, json!({"ridge_lambda": stiffer}), format!("{said}: a stiffer line fits less noise"));
    }
    let (attack, realism) = (audit.measures.attack_error, audit.measures.realism_error);
    if let (Some(attack), Some(realism)) = (attack, realism) {
        let factor = if realism < attack { 1.5 } else { 0.67 };
        let weight = num::rounded((active.realism_weight * factor).clamp(0.0, 5.0), 2);
        let why = format!("{said}; errors are {attack:.3} in attack and {realism:.3} in realism");
        idea(1.3, json!({"realism_weight": weight}), why);
    }
    if audit.selected.accepted_pct.zip(audit.audited.accepted_pct).is_some_and(|(ranked, drawn)| ranked <= drawn) {
        let explore = num::rounded((active.explore * 2.0 + 0.1).min(2.0), 2);
        idea(1.0, json!({"explore": explore}), format!("{said}, and the drawn are accepted as often as the ranked"));
    }
    if audit.measures.false_reject_pct.is_some_and(|missed| missed > 5.0) && active.lambda_a < 1.0 {
        let (a, r) = ((active.lambda_a * 2.0).min(1.0), (active.lambda_r * 2.0).min(1.0));
        idea(0.8, json!({"lambda_a": a, "lambda_r": r}), format!("{said}; too many that are accepted are turned away"));
    }
}

/// Proposes that a configuration abstains sooner if it predicts worse than the guess, and audits more if it turns away what is accepted.
fn abstention(active: &Active, audit: &Audit, ideas: &mut Vec<Idea>) {
    let Some(abstain_above) = active.abstain_above else { return };
    if let Some(error) = audit.measures.attack_error.filter(|error| *error > 1.0) {
        ideas.push(Idea {
            weight: 1.0 + error,
            changes: json!({"abstain_above": num::rounded((0.6 * abstain_above).clamp(0.01, 1.0), 3)}),
            why: format!("the error of attack is {error:.3} of the guess: what is known least says nothing"),
            gains: "error of realism, rank correlation",
        });
    }
    if audit.measures.false_reject_pct.is_some_and(|missed| missed > 5.0) {
        ideas.push(Idea {
            weight: 1.1,
            changes: json!({"lambda_u": num::rounded((0.6 * active.lambda_u).clamp(0.01, 1.0), 3)}),
            why: "too many that are accepted are turned away: less counts as certain".into(),
            gains: "false rejects",
        });
    }
}

/// Columns that tell nothing new are left out; a group that was left out comes back where it knows what predictions miss.
fn columns(active: &Active, audit: &Audit, ideas: &mut Vec<Idea>) {
    let is_out = |group: &Group| active.excluded_groups.contains(&group.group);
    let residual = |group: &Group| group.residual.as_ref().map_or(0.0, |(_, correlation)| correlation.abs());
    let excluded = |with: Option<&str>, without: Option<&str>| {
        let groups = active.excluded_groups.iter().map(String::as_str).filter(|name| Some(*name) != without);
        json!({"excluded_groups": groups.chain(with).collect::<Vec<_>>()})
    };
    let used = audit.groups.iter().filter(|group| !is_out(group) && group.columns > 3);
    if let Some(least) = used.min_by(|a, b| residual(a).total_cmp(&residual(b))) {
        ideas.push(Idea {
            weight: 0.7,
            changes: excluded(Some(&least.group), None),
            why: format!("the {} columns of `{}` are noise to the regression", least.columns, least.group),
            gains: "rank correlation, error of realism",
        });
    }
    for group in audit.groups.iter().filter(|group| is_out(group) && residual(group) > 0.15) {
        ideas.push(Idea {
            weight: 5.0 * residual(group),
            changes: excluded(None, Some(&group.group)),
            why: format!("`{}` knows what predictions miss: {:.3}", group.group, residual(group)),
            gains: "rank correlation",
        });
    }
}

/// Proposes another penalty each time, where nothing speaks for anything else.
fn another_penalty(active: &Active, turn: usize) -> Idea {
    let factors = [0.3, 2.0, 0.1, 5.0];
    let lambda = num::rounded((active.ridge_lambda * factors[turn % factors.len()]).clamp(0.1, 1e5), 3);
    Idea {
        weight: 1.0,
        changes: match active.model {
            Some(_) => json!({"model": "ridge", "ridge_lambda": lambda}),
            None => json!({"ridge_lambda": lambda}),
        },
        why: "everything that the audit gives a reason for was tried".into(),
        gains: "error of realism",
    }
}

#[cfg(test)]
mod tests;
