//! The first proposal's score: what a vehicle promises as an attacker before anything is tried.

use crate::kernel::num;
use crate::scene::TrackIx;
use crate::stage::actors::ActorFacts;
use crate::stage::{Settings, Stage, StageError};

/// Weights of the first proposal's score.
pub(super) const WEIGHTS: [&str; 5] =
    ["urgency_weight", "nearness_weight", "conflict_weight", "lane_relation_weight", "behind_weight"];
/// Time scale of the urgency, s, and length scale of the nearness, metres.
const URGENCY_S: f64 = 3.0;
const NEARNESS_M: f64 = 20.0;

/// Vehicles that may attack, in the scene's order.
pub(super) fn known<'s>(stage: &Stage<'s>) -> impl Iterator<Item = (TrackIx, &'s ActorFacts)> + use<'s> {
    stage.situation.actors.iter().enumerate().filter_map(|(track, facts)| Some((track, facts.as_ref()?)))
}

pub(super) fn weights(settings: &Settings) -> Result<[f64; WEIGHTS.len()], StageError> {
    let mut weights = [0.0; WEIGHTS.len()];
    for (weight, name) in weights.iter_mut().zip(WEIGHTS) {
        *weight = settings.number(name)?;
    }
    Ok(weights)
}

/// e^(-TTC/3) + 0.7 e^(-d/20) + 0.5 conflict + 0.3 same or adjacent lane - 0.5 behind, with the program's weights.
pub(super) fn promise(facts: &ActorFacts, [urgency, nearness, conflict, lane, behind]: &[f64; WEIGHTS.len()]) -> f64 {
    let value = |name: &str| facts.value(name).unwrap_or(0.0);
    let flag = |holds: bool| if holds { 1.0 } else { 0.0 };
    let collision_s = time_to_collision_s(facts).unwrap_or(f64::INFINITY);
    let beside = value("same_lane") != 0.0 || value("adjacent_lane") != 0.0;
    urgency * num::exp(-collision_s / URGENCY_S)
        + nearness * num::exp(-value("gap_m") / NEARNESS_M)
        + conflict * value("paths_cross")
        + lane * flag(beside)
        - behind * value("behind")
}

/// Gap over closing speed; `None` where the distance does not shrink.
pub(super) fn time_to_collision_s(facts: &ActorFacts) -> Option<f64> {
    let closing_mps = facts.value("closing_speed_mps").filter(|mps| *mps > 0.1)?;
    Some(facts.value("gap_m")? / closing_mps)
}
