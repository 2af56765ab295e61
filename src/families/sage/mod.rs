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

pub use contract::family;

use self::experts::Experts;
use self::measure::Measured;
use super::prior;
use crate::motion::Candidate;
use crate::motion::motion_prior::normalise;
use crate::stage::judged::Judged;
use crate::stage::{Part, Settings, Source, Stage, StageError};

/// The family's name in programs, experiments and tables.
pub const NAME: &str = "sage";
/// Motion operator: candidates of the mixed expert.
pub const MIXED_EXPERTS: &str = "mixed_experts";
/// Search operator: the reward with its weights.
pub const PREFERENCE_REWARD: &str = "preference_reward";
/// Prefix of the prior's words in this family.
const PRIOR: &str = "reference_";

/// The family as it is registered: what it declares, and the code that carries it out.
pub fn source() -> Source {
    Source::new(family()).operator(MIXED_EXPERTS, motion).operator(PREFERENCE_REWARD, search)
}

/// Candidates of the reference prior under the mixed expert: the most probable ones, most probable first.
pub fn motion(stage: &Stage<'_>, settings: &Settings, parts: &mut [Part]) -> Result<(), StageError> {
    let weight = settings.number("preference_weight")?;
    let kept = settings.count("kept_count")?;
    let known = Experts::committed();
    known.check(settings.word("experts")?)?;
    let mixed = known.mixed(weight);
    prior::propose(stage, &prior::options(settings, PRIOR)?, parts);
    let adversaries: Vec<usize> = parts.iter().map(|part| part.actor).collect();
    for part in parts {
        let judged = judged(stage, part, &adversaries);
        reweigh(&mut part.candidates, &judged, &mixed);
        part.candidates.sort_by(|a, b| b.prior_log_probability.total_cmp(&a.prior_log_probability));
        part.candidates.truncate(kept.max(1));
    }
    Ok(())
}

/// log π(τ) of an expert: log-softmax of the reference's log-probability plus θ · φ(τ).
pub fn reweigh(candidates: &mut [Candidate], judged: &Judged<'_>, theta: &[f64]) {
    let along = |c: &Candidate| c.prior_log_probability + experts::dot(theta, &Measured::of(c, judged).features());
    let mut logs: Vec<f64> = candidates.iter().map(along).collect();
    normalise(&mut logs);
    for (candidate, log) in candidates.iter_mut().zip(logs) {
        candidate.prior_log_probability = log;
        candidate.score = log;
    }
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
