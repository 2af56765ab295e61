//! SAGE, steerable alignment at test time (Nie et al. 2025): two experts are trained from one motion prior by preference
//! pairs, one for danger and one for realism; their weights are mixed, w adversarial + (1 - w) realistic, and the mixed
//! expert proposes the candidates among which a reward chooses.
//!
//! The learned prior is replaced by the lane-graph prior, an expert by a log-linear change of it over ten features
//! (`measure`). Pairs and loss are the method's (`training`); the two weight vectors are committed beside this file and
//! a test trains them again. The weight w is the parameter `preference_weight`: 0.5 in the parent, and a lineage may
//! start from another value, as the table's rows 0 and 1 do.

pub mod contract;
pub mod experts;
pub mod measure;
pub mod training;
mod words;

pub use contract::family;
pub use words::{MIXED_EXPERTS, NAME, PREFERENCE_REWARD};

use self::experts::Experts;
use self::measure::Measured;
use self::words::PRIOR;
use super::prior;
use crate::motion::Window;
use crate::motion::motion_prior::{self, Goals, PriorOptions};
use crate::stage::judged::Judged;
use crate::stage::{Part, Settings, Source, Stage, StageError};

const SEARCH_IN_WORDS: &str = "The search compares up to 32 trajectories (`kept_count`) that two mixed experts find most probable for \
     one vehicle; no score brings in others. Ranked is w x danger - (1 - w) x penalty - 50 off the road - 10 \
     through a bystander, w 0.5: danger is 10 (1 - t/T) for a predicted contact at t of T, else at most 1, the \
     penalty 2.1 straight on: contacts score -1 to 4, a second earlier is worth 0.6. `preference_score` is \
     added or replaces all, the -50 too. A `reshape` before the search is judged. Example: `if(struck_by_ego, \
     3, 0) - wrong_way_m / 10` prefers contacts that the ego causes.";

/// The family as it is registered: what it declares, and the code that carries it out.
pub fn source() -> Source {
    Source::new(family(), SEARCH_IN_WORDS).operator(MIXED_EXPERTS, motion).operator(PREFERENCE_REWARD, search)
}

/// Proposes what the mixed expert thinks likely. It scores every goal of the reference prior before goals that lie close
/// together are suppressed, so that it decides which of them survive. Keeps the most probable ones, most probable first.
pub fn motion(stage: &Stage<'_>, settings: &Settings, parts: &mut [Part]) -> Result<(), StageError> {
    let weight = settings.number("preference_weight")?;
    let kept = settings.count("kept_count")?;
    let known = Experts::committed();
    known.check(settings.word("experts")?)?;
    propose(stage, &prior::options(settings, PRIOR)?, &known.mixed(weight), parts);
    for part in parts {
        part.candidates.truncate(kept.max(1));
    }
    Ok(())
}

/// Gives every part the candidates of the expert with these weights, most probable first.
pub fn propose(stage: &Stage<'_>, options: &PriorOptions, theta: &[f64], parts: &mut [Part]) {
    let adversaries: Vec<usize> = parts.iter().map(|part| part.actor).collect();
    let situation = stage.situation;
    for part in parts {
        let track = situation.track(part.actor);
        let Some(anchor) = part.window.from_step.checked_sub(1).and_then(|step| track.at(step)) else { continue };
        let judged = judged(stage, part, &adversaries);
        let mut stream = stage.stream("prior", part.actor);
        let (steps, key) = (part.window.steps, goals_key(part, options));
        let log_ratios = |goals: &Goals<'_>| -> Vec<f64> {
            let measure = || features_of(goals, &judged).into();
            let kept = situation.measured_goals.of(key, measure);
            kept.chunks_exact(measure::FEATURES.len()).map(|features| experts::dot(theta, features)).collect()
        };
        part.candidates = motion_prior::reweighed(&situation.lanes, anchor, steps, options, &mut stream, log_ratios);
    }
}

/// φ of every goal's motion, one after the other. `[goals x features]`
fn features_of(goals: &Goals<'_>, judged: &Judged<'_>) -> Vec<f64> {
    (0..goals.count()).flat_map(|place| Measured::for_expert(&goals.candidate(place), judged).features()).collect()
}

/// All that the goals of a part and their features depend on beside the situation: no expert, no weight.
fn goals_key(part: &Part, options: &PriorOptions) -> [u64; 6] {
    let Window { from_step, steps } = part.window;
    let (spacing, step) = (options.goal_spacing_m.to_bits(), options.profile_step_mps2.to_bits());
    [part.actor as u64, from_step as u64, steps as u64, spacing, step, options.profile_levels as u64]
}

/// Scores by the reward with weights (w, 1 - w), plus a share of the mixed expert's log-probability.
pub fn search(stage: &Stage<'_>, settings: &Settings, parts: &mut [Part]) -> Result<(), StageError> {
    let weight = settings.number("selection_weight")?;
    let expert_share = settings.number("expert_share")?;
    let replaces = settings.word("combine")? == "replace";
    let adversaries: Vec<usize> = parts.iter().map(|part| part.actor).collect();
    for part in parts {
        let judged = judged(stage, part, &adversaries);
        for candidate in &mut part.candidates {
            let reward = Measured::of(candidate, &judged).reward(weight, 1.0 - weight);
            candidate.score = reward + expert_share * candidate.prior_log_probability;
            if let Some(module) = settings.optional("score") {
                let own = module.of_candidate(candidate, &judged);
                candidate.score = if replaces { own } else { candidate.score + own };
            }
        }
    }
    Ok(())
}

fn judged<'a>(stage: &Stage<'a>, part: &Part, adversaries: &'a [usize]) -> Judged<'a> {
    Judged { situation: stage.situation, actor: part.actor, from_step: part.window.from_step, adversaries }
}

#[cfg(test)]
mod tests;
