//! ChatScene's templates as typed data: which behaviour the adversary shows, and the ranges of the numbers that its
//! sampler draws. A language model's composition of a template is a choice among these words and bounds.

use crate::kernel::{Vec2, num};
use crate::scene::AgentKind;
use crate::sim::{Phase, Script, Speed, Until};

/// What the adversary does once it is set off.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Behaviour {
    /// Keeps the drawn speed.
    Steady,
    /// Adapts its speed so that it meets the ego where their ways cross (ChatScene's `CrossingBehavior`).
    Intercept,
    /// Drives until the ego is within the drawn distance, then stops in its way.
    StopBefore,
    /// Half the drawn speed until the ego is within the drawn distance, then all of it.
    SpeedUp,
    /// As fast as the ego, at most the drawn speed (ChatScene's parallel block).
    MatchEgo,
}

impl Behaviour {
    /// Words of a contract, in the order of the variants.
    pub const WORDS: [&str; 5] = ["steady", "intercept", "stop_before", "speed_up", "match_ego"];

    /// What each of them does, in words for the model.
    pub const DESCRIBES: [&str; 5] = [
        "crosses or drives on at a steady speed, whatever the ego does",
        "times its speed so that it meets the ego where their ways cross: intercepts it",
        "drives ahead of the ego and suddenly brakes: stops and stands in its way",
        "waits or goes slowly first, then speeds up: accelerates hard when the ego is near",
        "matches the speed of the ego beside it and keeps parallel: blocks the lane",
    ];

    /// The behaviour of a contract's word.
    pub fn of_word(word: &str) -> Option<Behaviour> {
        let all = [Self::Steady, Self::Intercept, Self::StopBefore, Self::SpeedUp, Self::MatchEgo];
        Behaviour::WORDS.iter().position(|w| *w == word).map(|i| all[i])
    }
}

/// The numbers that a template draws, in the order of its ranges.
pub const DRAWN: [&str; 5] = ["ahead_m", "aside_m", "speed_mps", "trigger_m", "act_within_m"];

/// What they are, in words for the model.
pub const DRAWN_MEANS: [&str; 5] = [
    "shift of the place along the ego's road",
    "shift of the place to the right of the ego's road",
    "speed once it is set off",
    "distance of the ego that sets it off",
    "distance of the ego at which the second phase begins",
];

/// A behaviour with the bounds of its numbers.
#[derive(Clone, Debug, PartialEq)]
pub struct Template {
    /// What the scenario's actor does.
    pub behaviour: Behaviour,
    /// Heading of the ego's road where the scenario is set off, radians: `ahead` and `aside` are seen from there.
    pub heading_rad: f64,
    /// Low and high of [`DRAWN`].
    pub ranges: Vec<(f64, f64)>,
}

impl Template {
    /// Puts the numbers of a point of the cube into a script.
    pub fn apply(&self, script: &mut Script, place: &[f64]) {
        let value = |i: usize| {
            let (low, high) = self.ranges.get(i).copied().unwrap_or_default();
            low + (high - low) * place.get(i).copied().unwrap_or(0.5).clamp(0.0, 1.0)
        };
        let (ahead_m, aside_m, mps, trigger_m, within_m) = (value(0), value(1), value(2), value(3), value(4));
        let forward = Vec2::from_heading(self.heading_rad);
        script.spawn.position = script.spawn.position + forward * ahead_m - forward.left() * aside_m;
        script.spawn.heading_rad = num::wrap_angle(script.spawn.heading_rad);
        script.trigger.distance_m = trigger_m;
        let on_foot = script.kind == AgentKind::Pedestrian;
        script.phases = self.phases(mps, within_m, on_foot);
    }

    fn phases(&self, mps: f64, within_m: f64, on_foot: bool) -> Vec<Phase> {
        let straight = |mps| Phase::straight(mps, Until::Forever);
        let until = |mps| Phase::straight(mps, Until::EgoWithin { m: within_m });
        match self.behaviour {
            Behaviour::Steady => vec![straight(mps)],
            Behaviour::Intercept => {
                // Nobody on foot runs faster than this (world-class sprint speed is 12 m/s; joggers keep to 5).
                let mps_max = if on_foot { mps.max(5.0) } else { (2.0 * mps).max(1.0) };
                let speed = Speed::Intercept { mps_min: mps.min(mps_max), mps_max };
                vec![Phase { speed, ..straight(0.0) }]
            }
            Behaviour::StopBefore => vec![until(mps), straight(0.0)],
            Behaviour::SpeedUp => vec![until(0.5 * mps), straight(mps)],
            Behaviour::MatchEgo => vec![Phase { speed: Speed::MatchEgo { mps_max: mps }, ..straight(0.0) }],
        }
    }

    /// The ranges after ChatScene's step: mean +- standard deviation of the values of the scenarios that collided, cut
    /// to what they were, and rounded to 0.01. Unchanged with fewer than two.
    pub fn shrunk(&self, collided: &[Vec<f64>]) -> Template {
        let mut shrunk = self.clone();
        if collided.len() < 2 {
            return shrunk;
        }
        for (i, (low, high)) in shrunk.ranges.iter_mut().enumerate() {
            let values: Vec<f64> = collided.iter().filter_map(|v| v.get(i).copied()).collect();
            let Some(mean) = num::mean(&values) else { continue };
            let deviations: Vec<f64> = values.iter().map(|v| (v - mean) * (v - mean)).collect();
            let std = num::mean(&deviations).map_or(0.0, f64::sqrt);
            let (from, to) = (num::rounded(mean - std, 2).max(*low), num::rounded(mean + std, 2).min(*high));
            // Rounding may push both beyond a bound that all values lie at.
            (*low, *high) = if from <= to { (from, to) } else { (*low, *high) };
        }
        shrunk
    }

    /// The values of a point of the cube.
    pub fn values(&self, place: &[f64]) -> Vec<f64> {
        self.ranges.iter().zip(place).map(|((low, high), u)| low + (high - low) * u.clamp(0.0, 1.0)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_shrink_to_mean_and_deviation_of_what_collided_within_what_they_were() {
        let template =
            Template { behaviour: Behaviour::Steady, heading_rad: 0.0, ranges: vec![(0.0, 10.0), (1.0, 3.0)] };
        let shrunk = template.shrunk(&[vec![2.0, 1.0], vec![4.0, 3.0], vec![6.0, 2.0]]);
        // Mean 4, deviation sqrt(8/3) = 1.63; mean 2, deviation sqrt(2/3) = 0.82.
        assert_eq!(shrunk.ranges, [(2.37, 5.63), (1.18, 2.82)]);
        assert_eq!(template.shrunk(&[vec![2.0, 1.0]]), template, "one collision says nothing about a spread");
    }

    #[test]
    fn every_word_is_a_behaviour() {
        assert!(Behaviour::WORDS.iter().all(|word| Behaviour::of_word(word).is_some()));
        assert_eq!(Behaviour::of_word("fly"), None);
    }
}
