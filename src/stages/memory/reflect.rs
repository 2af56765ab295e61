//! Reflection on an epoch's exits for the next one: repair, reuse, diversify or pivot. A hint for actors, never a rule.

use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};

use super::{
    curate::CurationContext,
    text::{normalised, number, tag_set},
};
use crate::objects::{Attempt, Card, CardId, CardKind, Exit, Gate, LineageId, Objectives};

/// Advice of a reflection.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Hint {
    /// At least half of the proposals were unusable: mend what the gates complain of.
    Repair,
    /// Something was accepted: build on it.
    Reuse,
    /// Nothing was accepted, and the admitted proposals were much alike.
    Diversify,
    /// Nothing was accepted although the proposals differed: another mechanism is needed.
    Pivot,
}

impl Hint {
    /// The word in cards and prompts.
    pub fn name(self) -> &'static str {
        match self {
            Hint::Repair => "repair",
            Hint::Reuse => "reuse",
            Hint::Diversify => "diversify",
            Hint::Pivot => "pivot",
        }
    }
}

/// Returns the hint that the exits of one epoch give; `None` where nothing was learned: no attempt, or none that was simulated. "Alike":
/// at most half as many sets of mechanism tags as simulated candidates. Candidates that the world evaluator turned away say nothing.
pub fn hint(attempts: &[Attempt]) -> Option<Hint> {
    let unusable = attempts.iter().filter(|a| matches!(a.exit, Exit::Declined { .. } | Exit::Invalid { .. })).count();
    let sets: BTreeSet<&[String]> = attempts.iter().filter_map(tags).collect();
    let simulated = attempts.iter().filter(|a| matches!(a.exit, Exit::Evaluated { .. })).count();
    if attempts.is_empty() {
        None
    } else if unusable * 2 >= attempts.len() {
        Some(Hint::Repair)
    } else if attempts.iter().any(accepted) {
        Some(Hint::Reuse)
    } else if simulated == 0 {
        None
    } else if sets.len() * 2 <= simulated {
        Some(Hint::Diversify)
    } else {
        Some(Hint::Pivot)
    }
}

/// The lineage card and the reflection card of an epoch, after its barrier. `active` are the objectives of the active
/// parent after promotion. Both cards stay in their lineage. An epoch without attempts gives no card.
pub fn reflect(
    lineage: &LineageId,
    epoch: u32,
    attempts: &[Attempt],
    active: Objectives,
    context: &CurationContext<'_>,
) -> Vec<Card> {
    if attempts.is_empty() {
        return Vec::new();
    }
    let winners = tag_set(attempts.iter().filter(|a| accepted(a)).filter_map(tags).flatten());
    let card = |name: &str, kind, text: String, mechanism_tags| Card {
        id: CardId::new(format!("{lineage}/e{epoch}#{name}")),
        kind,
        lineage: lineage.clone(),
        family: context.family.clone(),
        epoch,
        attempt: None,
        text: normalised(&text, context.options.digits, context.options.text_chars),
        mechanism_tags,
        scene_tags: tag_set(context.scene_tags),
        shareable: false,
    };
    let progress_card =
        card("lineage", CardKind::Lineage, progress(attempts, active, context.options.digits), winners.clone());
    let advice = hint(attempts).map(|hint| advice(hint, attempts, &winners));
    let advice = advice.map(|text| card("reflection", CardKind::Reflection, text, winners.clone()));
    std::iter::once(progress_card).chain(advice).collect()
}

fn progress(attempts: &[Attempt], active: Objectives, digits: u32) -> String {
    let count = |name: &str| attempts.iter().filter(|a| a.exit.name() == name).count();
    format!(
        "{} proposals: {} declined, {} invalid, {} rejected, {} evaluated, {} accepted; the parent now has attack {}, realism {}.",
        attempts.len(),
        count("declined"),
        count("invalid"),
        count("rejected"),
        count("evaluated"),
        attempts.iter().filter(|a| accepted(a)).count(),
        number(active.attack, digits),
        number(active.realism, digits)
    )
}

fn advice(hint: Hint, attempts: &[Attempt], winners: &[String]) -> String {
    let detail = match hint {
        Hint::Repair => match commonest_gate(attempts) {
            Some(gate) => format!("most proposals never ran; the {gate} gate refuses most often"),
            None => "most proposals were no usable patch".to_string(),
        },
        Hint::Reuse if winners.is_empty() => "build on the accepted edits".to_string(),
        Hint::Reuse => format!("build on {}", winners.join(", ")),
        Hint::Diversify => "the proposals were much alike; try mechanisms not yet tried".to_string(),
        Hint::Pivot => "different mechanisms brought nothing; change slot, condition or timing instead".to_string(),
    };
    format!("{}: {detail}.", hint.name())
}

/// The gate that was most often the first to fail; among equals the one that runs first.
fn commonest_gate(attempts: &[Attempt]) -> Option<String> {
    let mut counts: BTreeMap<Gate, usize> = BTreeMap::new();
    for attempt in attempts {
        if let Exit::Invalid { gates } = &attempt.exit
            && let Some(first) = gates.failed().next()
        {
            *counts.entry(first.gate).or_default() += 1;
        }
    }
    let most = counts.values().copied().max()?;
    counts.into_iter().find(|(_, count)| *count == most).map(|(gate, _)| format!("{gate:?}").to_lowercase())
}

fn accepted(attempt: &Attempt) -> bool {
    matches!(&attempt.exit, Exit::Evaluated { decision, .. } if decision.gates.any())
}

fn tags(attempt: &Attempt) -> Option<&[String]> {
    match &attempt.exit {
        Exit::Evaluated { candidate, .. } => Some(&candidate.mechanism_tags),
        Exit::Declined { .. } | Exit::Invalid { .. } | Exit::Rejected { .. } => None,
    }
}
