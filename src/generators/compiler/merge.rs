//! Merges two ways through the graph where they meet: one of them is taken, or their candidates unite.

use super::flow::Flow;
use crate::stage::judged::{self, Judged, Needs};
use crate::stage::{Settings, Situation, StageError};

/// Which of two ways goes on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Branch {
    First,
    Second,
    Both,
}

/// The way that is known before either is walked; `None` where the first has to be.
pub fn before_walking(kind: &str, settings: &Settings) -> Result<Option<Branch>, StageError> {
    Ok(match kind {
        "either" if settings.module("gate")?.boolean(vec![]) => Some(Branch::First),
        "either" => Some(Branch::Second),
        "first_of" | "all_of" => None,
        other => return Err(StageError::Missing(format!("operator {other}"))),
    })
}

/// Returns the way that follows from the result of the first one.
pub(super) fn after_first(
    situation: &Situation,
    kind: &str,
    settings: &Settings,
    first: &Flow,
) -> Result<Branch, StageError> {
    if kind == "all_of" {
        return Ok(Branch::Both);
    }
    let wants_meeting = settings.word("until")? == "meeting";
    let serves = first.stop.is_none() && !first.forced && (!wants_meeting || meets(situation, first));
    Ok(if serves { Branch::First } else { Branch::Second })
}

/// Returns `true` if some candidate is predicted to touch the ego, which drives as it did in its rollout.
fn meets(situation: &Situation, flow: &Flow) -> bool {
    let needs = Needs { ego: true, ..Needs::default() };
    flow.parts.iter().any(|part| {
        let judged =
            Judged { situation, actor: part.actor, from_step: part.window.from_step, adversaries: &flow.actors };
        part.candidates.iter().any(|candidate| {
            let values = judged::features(candidate, &judged, needs);
            judged::feature(&values, "collision_likelihood").is_some_and(|likelihood| likelihood > 0.0)
        })
    })
}

/// The candidates of both ways, adversary by adversary; the first way's first. What one way has nothing of is the other's.
pub(super) fn united(mut first: Flow, second: Flow) -> Flow {
    if first.stop.is_some() {
        return second;
    }
    if second.stop.is_some() {
        return first;
    }
    // Iterates belong together within a way, not across ways.
    let iterates = first.parts.iter().flat_map(|part| &part.candidates).filter_map(|c| c.iterate).max();
    let beyond = iterates.map_or(0, |last| last + 1);
    for mut part in second.parts {
        for candidate in &mut part.candidates {
            candidate.iterate = candidate.iterate.map(|iterate| iterate + beyond);
        }
        match first.parts.iter_mut().find(|own| own.actor == part.actor) {
            // The contract's check has both ways come from one timing node.
            Some(own) => {
                own.candidates.append(&mut part.candidates);
                own.simulated += part.simulated;
            }
            None => first.parts.push(part),
        }
    }
    first.forced &= second.forced;
    first
}
