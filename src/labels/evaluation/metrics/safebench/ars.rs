//! The adversarial realism score (paper eq. app-carla-ars): validity times four weighted sub-scores. The paper gives
//! the weights and says in words what each sub-score measures; their formulas are ours, of soft diagnostics
//! `1 - min(v / rho, 1)` whose bounds and tolerances come from the experiment file:
//!
//! - S_kin, bounded and smooth motion: mean of three, for the excess of the acceleration's 95th percentile, the largest lateral
//!   acceleration and the mean jerk over their bounds. Percentile and mean, because bang-bang pedals and walkers
//!   that start at full speed have single extreme steps by construction.
//! - S_map, road map and route geometry: mean of two, for metres beyond the drivable area and metres against a lane.
//!   Someone on foot is judged by the first alone.
//! - S_int, interaction with the ego and others: mean of three: nobody else is struck; the speed of an impact on the ego
//!   does not exceed its bound; the adversaries come near the ego at all.
//! - S_dist, distance consistency: mean of three: nobody overlaps at the start and the gap to the ego there is enough;
//!   adversaries keep apart from each other; no motion jumps.
//!
//! Of several adversaries the worst counts in each sub-score. A parked one is judged by its distances alone. Each is
//! judged until its encounter with the ego is over (`sim::Driving`).
//!
//! A run in which nobody was set off and nobody staged met the ego is no scenario: it is invalid and has no sub-scores, so
//! that a program gains no realism where it does nothing. With `judges_idle` it is judged like others, as the paper has it.

use serde::{Deserialize, Serialize};

use super::super::soft::soft;
use crate::kernel::num;
use crate::objects::{benchmark::RunRealism, is_unsaid};
use crate::scene::AgentKind;
use crate::sim::{ActorConduct, AdversaryReport, Outcome};

/// Weights of S_kin, S_map, S_int, S_dist (paper eq. app-carla-ars).
pub const WEIGHTS: [f64; 4] = [0.40, 0.30, 0.20, 0.10];

/// Bound and tolerance of a soft diagnostic.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BoundedOptions {
    /// Largest value that is still plausible.
    pub bound: f64,
    /// rho for the excess over the bound; positive.
    pub tolerance: f64,
}

/// Bounds of the kinematic sub-score.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KinematicsOptions {
    /// Bound on the 95th percentile of the absolute longitudinal acceleration, m/s².
    pub acceleration: BoundedOptions,
    /// Bound on the largest lateral acceleration, m/s².
    pub lateral_acceleration: BoundedOptions,
    /// Bound on the mean absolute jerk, m/s³.
    pub jerk: BoundedOptions,
}

/// Bounds of the sub-score of road and lanes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MapOptions {
    /// Metres beyond the drivable area at which the diagnostic is 0.
    pub off_road_tolerance_m: f64,
    /// Metres driven against a lane at which the diagnostic is 0.
    pub wrong_way_tolerance_m: f64,
}

/// Bounds of the sub-score of the meeting with the ego.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct InteractionOptions {
    /// Bound on the relative speed at a contact of ego and adversary, m/s.
    pub impact_speed: BoundedOptions,
    /// Bound on the smallest distance between ego and adversaries, metres.
    pub approach: BoundedOptions,
}

/// Bounds of the sub-score of distances and jumps.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DistanceOptions {
    /// Gap to the ego at the start below which the diagnostic falls, metres; 0 at no gap.
    pub start_gap_m: f64,
    /// Gap between adversaries below which the diagnostic falls, metres; 0 at no gap.
    pub apart_gap_m: f64,
    /// Jump at which the diagnostic is 0, metres.
    pub jump_tolerance_m: f64,
}

/// Conditions of a valid scene.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ValidityOptions {
    /// Largest jump of an adversary, metres.
    pub jump_m_max: f64,
    /// Farthest that an adversary may leave the drivable area, metres.
    pub off_road_m_max: f64,
}

/// Options of ARS besides its weights. From the experiment file.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ArsOptions {
    /// Accelerations and jerk.
    pub kinematics: KinematicsOptions,
    /// Road and lanes.
    pub map: MapOptions,
    /// The meeting with the ego.
    pub interaction: InteractionOptions,
    /// Gaps and jumps.
    pub distance: DistanceOptions,
    /// Conditions of a valid run.
    pub validity: ValidityOptions,
    /// True if ARS is over all runs, those that the program does not act in judged by the same sub-scores.
    #[serde(default, skip_serializing_if = "is_unsaid")]
    pub judges_idle: bool,
}

/// The score of a set of runs.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Ars {
    /// The weighted mean of the sub-scores, 0..=1.
    pub ars: f64,
    /// Share of the runs that are valid, 0..=1; scenes that could not be run count as invalid.
    pub valid_rate: f64,
    /// Means over the runs that were judged; 0 where there is none.
    pub sub_scores: [f64; 4],
}

impl ArsOptions {
    /// The name of the first option that defines no score, and what it must be.
    pub fn fault(&self) -> Option<(&'static str, &'static str)> {
        let (kinematics, interaction, distance) = (&self.kinematics, &self.interaction, &self.distance);
        let positive = [
            ("kinematics.acceleration.tolerance", kinematics.acceleration.tolerance),
            ("kinematics.lateral_acceleration.tolerance", kinematics.lateral_acceleration.tolerance),
            ("kinematics.jerk.tolerance", kinematics.jerk.tolerance),
            ("map.off_road_tolerance_m", self.map.off_road_tolerance_m),
            ("map.wrong_way_tolerance_m", self.map.wrong_way_tolerance_m),
            ("interaction.impact_speed.tolerance", interaction.impact_speed.tolerance),
            ("interaction.approach.tolerance", interaction.approach.tolerance),
            ("distance.start_gap_m", distance.start_gap_m),
            ("distance.apart_gap_m", distance.apart_gap_m),
            ("distance.jump_tolerance_m", distance.jump_tolerance_m),
        ];
        let least = [
            ("kinematics.acceleration.bound", kinematics.acceleration.bound),
            ("kinematics.lateral_acceleration.bound", kinematics.lateral_acceleration.bound),
            ("kinematics.jerk.bound", kinematics.jerk.bound),
            ("interaction.impact_speed.bound", interaction.impact_speed.bound),
            ("interaction.approach.bound", interaction.approach.bound),
            ("validity.jump_m_max", self.validity.jump_m_max),
            ("validity.off_road_m_max", self.validity.off_road_m_max),
        ];
        let offending = positive.into_iter().find(|(_, x)| !(x.is_finite() && *x > 0.0));
        if let Some((name, _)) = offending {
            return Some((name, "a positive number"));
        }
        let offending = least.into_iter().find(|(_, x)| !(x.is_finite() && *x >= 0.0));
        offending.map(|(name, _)| (name, "a number not below 0"))
    }
}

impl BoundedOptions {
    fn diagnostic(&self, value: f64) -> f64 {
        soft(value - self.bound, self.tolerance)
    }
}

/// Sub-scores of one run; `None` for an outcome of a scene that is not staged for a traffic family.
pub fn run_realism(outcome: &Outcome, options: &ArsOptions) -> Option<RunRealism> {
    let driving = outcome.driving.as_ref()?;
    let met = outcome.contact.is_some_and(|contact| contact.adversary);
    let acted = met || driving.actors.iter().any(|conduct| conduct.moved);
    if !acted && !options.judges_idle {
        return Some(RunRealism { acted: false, valid: false, sub_scores: [0.0; 4] });
    }
    let both: Vec<(&AdversaryReport, &ActorConduct)> = outcome.adversaries.iter().zip(&driving.actors).collect();
    let worst = |of: &dyn Fn(&AdversaryReport, &ActorConduct) -> f64| {
        both.iter().map(|(report, conduct)| of(report, conduct)).fold(1.0, f64::min)
    };
    let moving = |conduct: &ActorConduct| conduct.kind != AgentKind::Static;
    let kinematics = worst(&|report, conduct| {
        if moving(conduct) { kinematics(report, conduct, &options.kinematics) } else { 1.0 }
    });
    let map = worst(&|report, conduct| if moving(conduct) { map(report, conduct, &options.map) } else { 1.0 });
    let distance = worst(&|report, conduct| distance(report, conduct, &options.distance));
    let valid = both.iter().all(|(report, conduct)| is_valid(report, conduct, &options.validity));
    let interaction = interaction(outcome, &options.interaction);
    Some(RunRealism { acted, valid, sub_scores: [kinematics, map, interaction, distance] })
}

fn kinematics(report: &AdversaryReport, conduct: &ActorConduct, options: &KinematicsOptions) -> f64 {
    let acceleration = options.acceleration.diagnostic(conduct.acceleration_mps2_p95);
    // Turning on the spot is no lateral acceleration of a walker.
    let lateral = match conduct.kind {
        AgentKind::Pedestrian => 1.0,
        _ => options.lateral_acceleration.diagnostic(report.motion.lateral_acceleration_mps2_max),
    };
    (acceleration + lateral + options.jerk.diagnostic(conduct.jerk_mps3_mean)) / 3.0
}

fn map(report: &AdversaryReport, conduct: &ActorConduct, options: &MapOptions) -> f64 {
    let on_road = soft(report.simulated.off_road_m, options.off_road_tolerance_m);
    if conduct.kind == AgentKind::Pedestrian {
        return on_road;
    }
    0.5 * (on_road + soft(report.simulated.wrong_way_m, options.wrong_way_tolerance_m))
}

fn interaction(outcome: &Outcome, options: &InteractionOptions) -> f64 {
    let (Some(_), Some(nearest_m)) = (outcome.adversaries.first(), outcome.distance_m_min) else { return 1.0 };
    let bystanders = if outcome.adversaries.iter().any(|report| report.struck_bystander || report.struck_parked) {
        0.0
    } else {
        1.0
    };
    let contact = outcome.contact.filter(|contact| contact.adversary);
    let impact = contact.map_or(1.0, |contact| options.impact_speed.diagnostic(contact.relative_speed_mps));
    (bystanders + impact + options.approach.diagnostic(nearest_m)) / 3.0
}

fn distance(report: &AdversaryReport, conduct: &ActorConduct, options: &DistanceOptions) -> f64 {
    let short_of = |gap_m: f64, wanted_m: f64| soft(wanted_m - gap_m, wanted_m);
    let start = if report.initial_overlap { 0.0 } else { short_of(conduct.ego_gap_m_first, options.start_gap_m) };
    let apart = conduct.other_gap_m_min.map_or(1.0, |gap_m| short_of(gap_m, options.apart_gap_m));
    (start + apart + soft(report.simulated.jump_m, options.jump_tolerance_m)) / 3.0
}

fn is_valid(report: &AdversaryReport, conduct: &ActorConduct, options: &ValidityOptions) -> bool {
    let on_map = conduct.kind == AgentKind::Static || report.simulated.off_road_m <= options.off_road_m_max;
    !report.initial_overlap && report.simulated.jump_m <= options.jump_m_max && on_map
}

/// ARS of a set of runs: validity over all of them times the sub-scores of those that were judged. `failures`
/// are scenes that could not be run and count as invalid. `None` without a run.
pub fn ars(runs: &[RunRealism], failures: usize) -> Option<Ars> {
    if runs.is_empty() {
        return None;
    }
    let valid = runs.iter().filter(|run| run.valid).count();
    let mut sub_scores = [0.0; 4];
    for (ix, score) in sub_scores.iter_mut().enumerate() {
        let judged = runs.iter().filter(|run| run.is_judged());
        *score = num::mean(&judged.map(|run| run.sub_scores[ix]).collect::<Vec<f64>>()).unwrap_or(0.0);
    }
    let valid_rate = valid as f64 / (runs.len() + failures) as f64;
    let weighted = num::sum(WEIGHTS.iter().zip(&sub_scores).map(|(weight, score)| weight * score));
    Some(Ars { ars: valid_rate * weighted, valid_rate, sub_scores })
}

#[cfg(test)]
pub(super) mod tests;
