//! ChatScene's templates as typed data: which behaviour the adversary shows, and the ranges of the numbers that its
//! sampler draws. A language model's composition of a template is a choice among these words and bounds.

use super::chat_behaviour::{Behaviour, Drawn};
use crate::kernel::{Vec2, num};
use crate::scene::AgentKind;
use crate::sim::{Script, Until};

/// The numbers that a template draws, in the order of its ranges.
pub const DRAWN: [&str; 6] = ["ahead_m", "aside_m", "speed_mps", "trigger_m", "act_within_m", "lateral_m"];

/// Meanings of the drawn numbers, in words for the model.
pub const DRAWN_MEANS: [&str; 6] = [
    "shift of the place along the ego's road; at a crossing, along its own",
    "shift of the place to the right of that road",
    "speed once it is set off",
    "distance of the ego that sets it off",
    "distance of the ego, or of the ego's way, at which the second phase begins",
    "how far it moves sideways, toward the ego's way if positive; behaviours without a sideways move do not read it",
];

/// Frame of reference of a template's numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// Direction in which a place is shifted ahead, radians.
    pub heading_rad: f64,
    /// On which side of the adversary the ego's way lies: 1 on its left, -1 on its right.
    pub toward_left: f64,
}

/// A behaviour with the bounds of its numbers.
#[derive(Clone, Debug, PartialEq)]
pub struct Template {
    /// Behaviour of the scenario's actor.
    pub behaviour: Behaviour,
    /// Frame of reference of its numbers.
    pub frame: Frame,
    /// Low and high of [`DRAWN`].
    pub ranges: Vec<(f64, f64)>,
}

impl Template {
    /// How far a point of the cube shifts the place.
    pub fn shift(&self, place: &[f64]) -> Vec2 {
        let forward = Vec2::from_heading(self.frame.heading_rad);
        forward * self.value(place, 0) - forward.left() * self.value(place, 1)
    }

    /// Puts the numbers of a point of the cube into a script.
    pub fn apply(&self, script: &mut Script, place: &[f64]) {
        script.spawn.position = script.spawn.position + self.shift(place);
        script.spawn.heading_rad = num::wrap_angle(script.spawn.heading_rad);
        script.trigger.distance_m = self.value(place, 3);
        let on_foot = script.kind == AgentKind::Pedestrian;
        // SafeBench's walker stops at a share of its own way, which a shifted one does not have.
        let end = script.phases.last().filter(|_| !on_foot).map_or(Until::Forever, |phase| phase.until);
        let drawn = Drawn {
            mps: self.value(place, 2),
            within_m: self.value(place, 4),
            left_m: self.value(place, 5) * self.frame.toward_left,
            on_foot,
            end,
        };
        script.phases = self.behaviour.phases(&drawn);
    }

    fn value(&self, place: &[f64], i: usize) -> f64 {
        let (low, high) = self.ranges.get(i).copied().unwrap_or_default();
        low + (high - low) * place.get(i).copied().unwrap_or(0.5).clamp(0.0, 1.0)
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
        (0..self.ranges.len().min(place.len())).map(|i| self.value(place, i)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernel::Pose;
    use crate::sim::{Phase, Trigger, Way};

    const FRAME: Frame = Frame { heading_rad: 0.0, toward_left: -1.0 };

    #[test]
    fn ranges_shrink_to_mean_and_deviation_of_what_collided_within_what_they_were() {
        let template = Template { behaviour: Behaviour::Steady, frame: FRAME, ranges: vec![(0.0, 10.0), (1.0, 3.0)] };
        let shrunk = template.shrunk(&[vec![2.0, 1.0], vec![4.0, 3.0], vec![6.0, 2.0]]);
        // Mean 4, deviation sqrt(8/3) = 1.63; mean 2, deviation sqrt(2/3) = 0.82.
        assert_eq!(shrunk.ranges, [(2.37, 5.63), (1.18, 2.82)]);
        assert_eq!(template.shrunk(&[vec![2.0, 1.0]]), template, "one collision says nothing about a spread");
    }

    #[test]
    fn a_point_of_the_cube_is_put_into_a_script_as_seen_from_the_frame() {
        let ranges = vec![(-10.0, 10.0), (1.0, 1.0), (8.0, 8.0), (30.0, 30.0), (12.0, 12.0), (3.5, 3.5)];
        let spawn = Pose { position: Vec2::ZERO, heading_rad: 0.0 };
        let trigger = Trigger { reference: 0, distance_m: 1.0, ego_speed_mps_min: 0.0 };
        let phases = vec![Phase::straight(1.0, Until::Forever)];
        let mut script = Script { kind: AgentKind::Vehicle, length_m: 4.8, width_m: 2.0, spawn, trigger, phases };
        let template = Template { behaviour: Behaviour::CutIn, frame: FRAME, ranges };
        template.apply(&mut script, &[0.75, 0.5, 0.5, 0.5, 0.5, 0.5]);
        assert!(script.spawn.position.distance(Vec2::new(5.0, -1.0)) < 1e-12, "5 m ahead, 1 m to the right");
        assert_eq!((script.trigger.distance_m, script.phases[0].until), (30.0, Until::EgoWithin { m: 12.0 }));
        let Way::Shift { left_m, .. } = script.phases[1].way else { panic!("{:?}", script.phases) };
        assert_eq!(left_m, -3.5, "toward the ego's way, which lies on the right");
    }
}
