//! A pilot before the rank: which scenes a candidate is simulated in, and what its rank score is when they are known.
//!
//! Successive halving (Jamieson and Talwalkar, 2016) with two rungs: everybody is simulated in a few scenes, the best by rank on
//! the whole window. What a pilot shows decides who is simulated, and nothing else: acceptance rests on the whole window.

use super::verdict::Prediction;
use crate::kernel::Seed;
use crate::objects::{LineageId, Objectives, Pilot, PilotOptions, WorldConfiguration};

/// The order in which the pilots of an epoch take the scenes of its window: places in the window. It is one order for all
/// candidates, so that they are compared on the same scenes as far as these are open to them.
pub fn pilot_order(seed: Seed, lineage: &LineageId, epoch: u32, scenes: usize) -> Vec<usize> {
    let mut order: Vec<usize> = (0..scenes).collect();
    seed.stream(&["world", "pilot", lineage.as_str(), &epoch.to_string()]).shuffle(&mut order);
    order
}

/// The scenes of a candidate's pilot: the first in that order in which it may differ from its parent. In the others its label
/// is its parent's, so that nothing is learned there.
pub fn pilot_places(order: &[usize], open: &[bool], options: &PilotOptions) -> Vec<usize> {
    let is_open = |place: &usize| open.get(*place).copied().unwrap_or(false);
    order.iter().copied().filter(is_open).take(options.scenes as usize).collect()
}

/// Returns the rank score of a candidate after its pilot. The predicted difference of an open scene counts as `prior_scenes`
/// scenes beside those that were seen, and what is not known of it shrinks accordingly. `None` where nothing was seen.
pub(super) fn rank_score(
    prediction: &Prediction,
    open_share: f64,
    pilot: &Pilot,
    options: &PilotOptions,
    configuration: &WorldConfiguration,
) -> Option<f64> {
    let (prior, seen) = (options.prior_scenes, f64::from(pilot.labelled));
    let gain = |of: &Objectives| of.attack + configuration.realism_weight * of.realism;
    if open_share <= 0.0 || seen <= 0.0 {
        return None;
    }
    let mixed = (prior * gain(&prediction.difference) + seen * open_share * gain(&pilot.difference)) / (prior + seen);
    let unknown = (prior / (prior + seen)).sqrt();
    Some(mixed + configuration.explore * unknown * prediction.half_width.as_ref().map_or(0.0, gain))
}
