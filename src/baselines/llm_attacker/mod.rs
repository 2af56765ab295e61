//! LLM-Attacker (Mei et al. 2025): who attacks is searched with feedback. A few vehicles are proposed, each is given CAT's
//! trajectory, the attack is tried against the driver, and what went wrong decides who attacks how in the next round.
//!
//! The paper's agents propose, reflect on and modify the attackers of a scene in prose; their texts and code are not
//! public. Here two things stand for them. Within a scene, proposal, reflection and modification are rules
//! (`deliberation`), so that compiling stays pure. Across epochs, the agents of this framework do what the paper's do:
//! they propose the expressions by which attackers are ranked and admitted (`attacker_score`, `attacker_guard`), see what
//! the attacks came to, and modify them. What is missing is a language model's answer for one scene as a recorded input
//! of its compilation; it would take the place of the first proposal.

pub mod contract;
pub mod deliberation;
pub mod reflection;

pub use contract::family;

use super::kernel::actors::ActorFacts;
use super::kernel::{Part, Settings, Situation, Stage, StageError};
use super::prior;
use crate::kernel::num;
use crate::scene::TrackIx;

pub use deliberation::search;

/// The family's name in programs, experiments and tables.
pub const NAME: &str = "llm_attacker";
/// Actor operator: vehicles that may attack, most promising first.
pub const ATTACKER_POOL: &str = "attacker_pool";
/// Motion operator: candidates of the lane-graph prior for each of them.
pub const ATTACKER_PRIOR: &str = "attacker_prior";
/// Search operator: propose, evaluate, reflect.
pub const DELIBERATION: &str = "attacker_deliberation";
/// Prefix of the prior's words in this family.
const PRIOR: &str = "attacker_";

/// Weights of the first proposal's score.
const WEIGHTS: [&str; 5] =
    ["urgency_weight", "nearness_weight", "conflict_weight", "lane_relation_weight", "behind_weight"];
/// Time scale of the urgency, s, and length scale of the nearness, metres.
const URGENCY_S: f64 = 3.0;
const NEARNESS_M: f64 = 20.0;

/// Vehicles by the first proposal's score (all of it but whether they can reach the ego, which only candidates tell).
pub fn pool(situation: &Situation, settings: &Settings) -> Result<Vec<TrackIx>, StageError> {
    let size = settings.count("pool_size")?;
    let mut weights = [0.0; WEIGHTS.len()];
    for (weight, name) in weights.iter_mut().zip(WEIGHTS) {
        *weight = settings.number(name)?;
    }
    let replaces = settings.word("combine")? == "replace";
    let score = |facts: &ActorFacts| {
        let own = settings.optional("score").map(|module| module.number(facts.values.clone()));
        match own {
            Some(own) if replaces => own,
            Some(own) => own + promise(facts, &weights),
            None => promise(facts, &weights),
        }
    };
    let admitted =
        |facts: &ActorFacts| settings.optional("guard").is_none_or(|guard| guard.boolean(facts.values.clone()));
    let known = situation.actors.iter().enumerate().filter_map(|(track, facts)| Some((track, facts.as_ref()?)));
    let mut rank: Vec<(TrackIx, f64)> =
        known.filter(|(_, f)| admitted(f)).map(|(track, f)| (track, score(f))).collect();
    rank.sort_by(|a, b| b.1.total_cmp(&a.1));
    rank.truncate(size.max(1));
    Ok(rank.into_iter().map(|(track, _)| track).collect())
}

/// e^(-TTC/3) + 0.7 e^(-d/20) + 0.5 conflict + 0.3 same or adjacent lane - 0.5 behind, with the program's weights.
fn promise(facts: &ActorFacts, [urgency, nearness, conflict, lane, behind]: &[f64; WEIGHTS.len()]) -> f64 {
    let value = |name: &str| facts.value(name).unwrap_or(0.0);
    let flag = |holds: bool| if holds { 1.0 } else { 0.0 };
    let closing = value("closing_speed_mps");
    let collision_s = if closing > 0.1 { value("gap_m") / closing } else { f64::INFINITY };
    let beside = value("same_lane") != 0.0 || value("adjacent_lane") != 0.0;
    urgency * num::exp(-collision_s / URGENCY_S)
        + nearness * num::exp(-value("gap_m") / NEARNESS_M)
        + conflict * value("paths_cross")
        + lane * flag(beside)
        - behind * value("behind")
}

/// Candidates of the lane-graph prior for every vehicle of the pool.
pub fn motion(stage: &Stage<'_>, settings: &Settings, parts: &mut [Part]) -> Result<(), StageError> {
    prior::propose(stage, &prior::options(settings, PRIOR)?, parts);
    Ok(())
}

#[cfg(test)]
mod tests;
