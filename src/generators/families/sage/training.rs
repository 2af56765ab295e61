//! Hierarchical group preference optimisation: pairs of candidates of one scene, feasible before infeasible, then larger
//! before smaller reward; the loss -log σ(β [(log π_w - log π_l) - (log π_ref,w - log π_ref,l)]), mean over each level.
//!
//! For a log-linear expert the normaliser and the reference cancel in a pair, so that the loss is the logistic one on
//! β θ · (φ_w - φ_l): convex, and training it twice gives the same bits. β, epochs, pairs a group, margin and the two
//! reward weightings are the method's, as is AdamW; its learning rate is ours, for ten weights instead of a network: small
//! ones leave both experts at the signs of their gradients after 200 epochs, and so nearly alike.

use std::sync::Arc;

use super::contract::prior_options;
use super::experts::{Experts, dot};
use super::measure::{FEATURES, Measured};
use crate::ego;
use crate::kernel::{Seed, Stream, num};
use crate::motion::motion_prior;
use crate::scene::Scene;
use crate::stage::judged::Judged;
use crate::stage::{Situation, SituationError};
use crate::synth::{SynthError, SynthOptions, WorldKind, pool_member};

/// Temperature of the loss.
pub const BETA: f64 = 0.05;
/// Passes over all pairs.
pub const EPOCHS: usize = 200;
/// Second-level pairs a scene; the first level takes every infeasible candidate.
pub const PAIRS: usize = 8;
/// Rewards of a second-level pair differ by more than this.
pub const MARGIN: f64 = 0.2;
/// (a, b) of a R_adv - b (kinematic + behaviour) - map for the adversarial and the realistic expert.
pub const REWARDS: [(f64, f64); 2] = [(10.0, 1.0), (1.0, 10.0)];

/// Settings of AdamW: step, decay and the usual moments.
const LEARNING_RATE: f64 = 0.5;
const WEIGHT_DECAY: f64 = 0.01;
const MOMENTS: (f64, f64) = (0.9, 0.999);
/// Scenes of the training split; every kind of world four times.
const SCENES: usize = 44;
/// Root of the split's and the pairs' random streams; no experiment uses it.
const SEED: Seed = Seed(0x5a6e);

/// The training split cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum TrainingError {
    #[error(transparent)]
    Scene(#[from] SynthError),
    #[error(transparent)]
    Situation(#[from] SituationError),
}

/// φ(winner) - φ(loser)
pub type Pair = [f64; FEATURES.len()];

/// Trains both experts on the frozen split.
pub fn experts() -> Result<Experts, TrainingError> {
    let mut pairs = [Levels::default(), Levels::default()];
    for index in 0..SCENES {
        let scene = pool_member(&split(), SEED, index)?;
        let group = group(scene, index)?;
        for (expert, pairs) in pairs.iter_mut().enumerate() {
            let (adversarial, realistic) = REWARDS[expert];
            let mut stream = SEED.stream(&["pairs", &expert.to_string(), &index.to_string()]);
            let preferred = preferences(&group, adversarial, realistic, &mut stream);
            pairs.feasibility.extend(preferred.feasibility);
            pairs.reward.extend(preferred.reward);
        }
    }
    Ok(Experts::new(&fit(&pairs[0]), &fit(&pairs[1])))
}

/// The worlds of the training split.
fn split() -> SynthOptions {
    SynthOptions {
        kinds: WorldKind::ALL.to_vec(),
        steps: 91,
        current_step: 10,
        warm_up_s: 12.0,
        tracks_per_scene: 20,
        pedestrian_share: 0.1,
        cyclist_share: 0.06,
        ego_travel_m_min: 10.0,
        interaction_time_s_max: 4.0,
        interaction_gap_m_max: 12.0,
        traffic: None,
        attempts_max: 40,
        following_share: 0.2,
    }
}

/// The reference's candidates for a scene's marked vehicle against the IDM ego.
fn group(scene: Scene, index: usize) -> Result<Vec<Measured>, TrainingError> {
    let situation = Situation::new(Arc::new(scene), &ego::Policy::Idm)?;
    let from_step = situation.first_step();
    let Some(actor) = situation.marked().next() else { return Ok(vec![]) };
    let Some(anchor) = situation.track(actor).at(from_step - 1) else { return Ok(vec![]) };
    let mut stream = SEED.stream(&["prior", &index.to_string()]);
    let steps = situation.scene.steps - from_step;
    let candidates = motion_prior::candidates(&situation.lanes, anchor, steps, &prior_options(), &mut stream);
    let judged = Judged { situation: &situation, actor, from_step, adversaries: &[actor] };
    Ok(candidates.iter().map(|candidate| Measured::of(candidate, &judged)).collect())
}

/// Pairs by level.
#[derive(Clone, Debug, Default)]
pub struct Levels {
    /// Every infeasible candidate loses against a feasible one.
    pub feasibility: Vec<Pair>,
    /// Feasible ones whose rewards lie apart.
    pub reward: Vec<Pair>,
}

/// The pairs of one scene.
pub fn preferences(group: &[Measured], adversarial: f64, realistic: f64, stream: &mut Stream) -> Levels {
    let (feasible, infeasible): (Vec<&Measured>, Vec<&Measured>) = group.iter().partition(|m| m.is_feasible());
    let mut pairs = Levels::default();
    for loser in infeasible {
        pairs.feasibility.extend(stream.pick(&feasible).map(|winner| pair(winner, loser)));
    }
    if feasible.len() < 2 {
        return pairs;
    }
    let reward = |m: &Measured| m.reward(adversarial, realistic);
    // Groups of equal rewards have no such pair: the draws are bounded.
    for _ in 0..20 * PAIRS {
        let (one, other) = (feasible[stream.below(feasible.len())], feasible[stream.below(feasible.len())]);
        let apart = reward(one) - reward(other);
        if pairs.reward.len() < PAIRS && apart.abs() > MARGIN {
            pairs.reward.push(if apart > 0.0 { pair(one, other) } else { pair(other, one) });
        }
    }
    pairs
}

fn pair(winner: &Measured, loser: &Measured) -> Pair {
    let (winner, loser) = (winner.features(), loser.features());
    std::array::from_fn(|k| winner[k] - loser[k])
}

/// Mean of -log σ(β θ · Δφ) and its gradient.
pub fn loss(theta: &[f64], pairs: &[Pair]) -> (f64, Pair) {
    let count = pairs.len().max(1) as f64;
    let (mut total, mut gradient) = (0.0, [0.0; FEATURES.len()]);
    for pair in pairs {
        let margin = BETA * dot(theta, pair);
        total += (num::ln(1.0 + num::exp(-margin.abs())) + (-margin).max(0.0)) / count;
        let slope = -BETA * num::sigmoid(-margin) / count;
        for (g, x) in gradient.iter_mut().zip(pair) {
            *g += slope * x;
        }
    }
    (total, gradient)
}

/// AdamW from the reference, θ = 0; both levels weigh alike.
pub fn fit(pairs: &Levels) -> Pair {
    let (mut theta, mut first, mut second) = ([0.0; FEATURES.len()], [0.0; FEATURES.len()], [0.0; FEATURES.len()]);
    for epoch in 1..=EPOCHS as u32 {
        let (_, feasibility) = loss(&theta, &pairs.feasibility);
        let (_, reward) = loss(&theta, &pairs.reward);
        let unbiased = (1.0 - num::powu(MOMENTS.0, epoch), 1.0 - num::powu(MOMENTS.1, epoch));
        for k in 0..theta.len() {
            let gradient = feasibility[k] + reward[k];
            first[k] = MOMENTS.0 * first[k] + (1.0 - MOMENTS.0) * gradient;
            second[k] = MOMENTS.1 * second[k] + (1.0 - MOMENTS.1) * gradient * gradient;
            let step = (first[k] / unbiased.0) / ((second[k] / unbiased.1).sqrt() + 1e-8);
            theta[k] -= LEARNING_RATE * (step + WEIGHT_DECAY * theta[k]);
        }
    }
    theta
}
