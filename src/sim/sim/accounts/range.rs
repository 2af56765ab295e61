//! Bounds on the numbers of a rollout, whatever the scene: checked where records come from elsewhere.

use super::end::End;
use super::outcome::{Motion, Outcome};
use crate::kernel::num;
use crate::scene::DT_S;
use crate::sim::prepared::body::SUBSTEP_S;
use crate::sim::rollouts::reported::ReportedRollout;

/// Number of decision steps in an hour; no scene is as long.
const STEPS_MAX: usize = 36_000;
/// Speed above anything on a road, m/s.
const SPEED_MPS_MAX: f64 = 1000.0;
/// Largest length, acceleration, jerk or time that a number may have, in its unit.
const SIZE_MAX: f64 = 1e7;
/// Half a turn in a physics step, rad/s: nothing turns faster between two samples.
const YAW_RATE_RADPS_MAX: f64 = num::PI / SUBSTEP_S;
/// Largest part of a step that the velocities at its ends do not explain, metres: for a car, and for a repeated recording. Recordings
/// have gaps; of 292 000 steps of MetaDrive's car the worst goes 0.013 m beyond.
const JUMP_M_MAX: [f64; 2] = [0.5, 10.0];
/// Speed above any car under test, m/s. MetaDrive's fastest start is 25 m/s.
const CAR_MPS_MAX: f64 = 100.0;

/// The expected range of a number, and the number found.
pub type OutOfRange = (String, String);

impl Outcome {
    /// Returns the first number that no rollout has.
    pub fn out_of_range(&self) -> Option<OutOfRange> {
        let seconds = self.steps as f64 * DT_S;
        let within = |name: &str, x: f64, low: f64, high: f64| {
            // NaN is in no range.
            let fits = x >= low && x <= high;
            (!fits).then(|| (format!("{name} within {low} and {high}"), x.to_string()))
        };
        let size = |name: &str, x: Option<f64>| x.and_then(|x| within(name, x, 0.0, SIZE_MAX));
        if self.steps > STEPS_MAX {
            return Some((format!("steps of at most {STEPS_MAX}"), self.steps.to_string()));
        }
        if (self.end == End::Contact) != self.contact.is_some() {
            let found = if self.contact.is_some() { "a contact" } else { "no contact" };
            return Some((
                "a contact where the end is one, and none elsewhere".into(),
                format!("{found} beside the end {:?}", self.end),
            ));
        }
        let contact = self.contact.as_ref().and_then(|contact| {
            within("contact.time_s", contact.time_s, 0.0, seconds + DT_S)
                .or_else(|| within("contact.relative_speed_mps", contact.relative_speed_mps, 0.0, SPEED_MPS_MAX))
                .or_else(|| within("contact.impact_angle_rad", contact.impact_angle_rad, -4.0, 4.0))
                .or_else(|| size("contact.visible_s", contact.visible_s))
        });
        contact
            .or_else(|| within("route_completion", self.route_completion, 0.0, 1.0 + 1e-9))
            .or_else(|| size("ego_lateral_m_max", Some(self.ego_lateral_m_max)))
            .or_else(|| size("distance_m_min", self.distance_m_min))
            .or_else(|| size("ttc_s_min", self.ttc_s_min))
            .or_else(|| size("post_encroachment_s_min", self.post_encroachment_s_min))
            .or_else(|| self.ego.out_of_range("ego"))
            .or_else(|| self.adversaries.iter().find_map(|one| one.motion.out_of_range("adversaries")))
    }
}

impl Motion {
    fn out_of_range(&self, whose: &str) -> Option<OutOfRange> {
        let numbers = [
            ("speed_mps_mean", self.speed_mps_mean, SPEED_MPS_MAX),
            ("speed_mps_max", self.speed_mps_max, SPEED_MPS_MAX),
            ("acceleration_mps2_max", self.acceleration_mps2_max, SIZE_MAX),
            ("deceleration_mps2_max", self.deceleration_mps2_max, SIZE_MAX),
            ("lateral_acceleration_mps2_max", self.lateral_acceleration_mps2_max, SIZE_MAX),
            ("jerk_mps3_max", self.jerk_mps3_max, SIZE_MAX),
            ("yaw_rate_radps_max", self.yaw_rate_radps_max, YAW_RATE_RADPS_MAX + 1e-6),
            ("distance_m", self.distance_m, SIZE_MAX),
            ("speed_mps_mean, no more than speed_mps_max,", self.speed_mps_mean, self.speed_mps_max + 1e-6),
        ];
        // All are sizes; NaN is in no range.
        let (name, x, most) = numbers.into_iter().find(|(_, x, most)| !(0.0..=*most).contains(x))?;
        Some((format!("{whose}.{name} within 0 and {most}"), x.to_string()))
    }
}

impl ReportedRollout {
    /// Returns the first step in which the ego is further away than it can have driven, whatever the scene. `replays` is true if it
    /// repeats a recording.
    pub fn jump(&self, replays: bool) -> Option<OutOfRange> {
        let (jump_m, speed_mps) = if replays { (JUMP_M_MAX[1], SPEED_MPS_MAX) } else { (JUMP_M_MAX[0], CAR_MPS_MAX) };
        let steps = self.ego.windows(2).enumerate();
        steps.map(|(row, pair)| (row, pair[0].sample, pair[1].sample)).find_map(|(row, from, to)| {
            let way_m = from.position.distance(to.position);
            let most_m = jump_m + DT_S * from.speed_mps().max(to.speed_mps()).min(speed_mps);
            let fits = way_m <= most_m;
            (!fits)
                .then(|| (format!("an ego that drives at most {most_m:.1} m in step {row}"), format!("{way_m:.1} m")))
        })
    }
}

#[cfg(test)]
mod tests {
    use crate::ego::Policy;
    use crate::kernel::Vec2;
    use crate::scene::PreparedScene;
    use crate::sim::scenes::{crossing, intercept};
    use crate::sim::{End, Outcome, Plant, SimulatorOptions, rollout, tell};
    use std::sync::Arc;

    fn played(seed: u64) -> (Plant, crate::sim::Intervention) {
        let scene = crossing(seed, 5, 91);
        let act = intercept(&scene, seed as usize % 30);
        (Plant::with_options(PreparedScene::new(Arc::new(scene)), &SimulatorOptions::SHIPPED).unwrap(), act)
    }

    fn outcome(seed: u64) -> Outcome {
        let (plant, act) = played(seed);
        rollout(&plant, &act, Policy::Idm.driver().as_mut()).unwrap()
    }

    #[test]
    fn every_rollout_of_our_own_is_in_range() {
        for seed in 0..60 {
            assert_eq!(outcome(seed).out_of_range(), None, "seed {seed}");
            let (plant, act) = played(seed);
            assert_eq!(tell(&plant, &act, Policy::Idm.driver().as_mut()).unwrap().jump(false), None, "seed {seed}");
        }
    }

    #[test]
    fn numbers_that_no_rollout_has_are_named() {
        let hit = (0..60).map(outcome).find(|outcome| outcome.contact.is_some()).unwrap();
        type Change = (fn(&mut Outcome), &'static str);
        let changes: [Change; 11] = [
            (|o| o.steps = 1_000_000_000, "steps"),
            (|o| o.route_completion = 1e308, "route_completion"),
            (|o| o.route_completion = -5.0, "route_completion"),
            (|o| o.end = End::Arrived, "a contact where the end is one"),
            (|o| o.ego.speed_mps_max = 1e300, "ego.speed_mps_max"),
            (|o| o.distance_m_min = Some(-1.0), "distance_m_min"),
            (|o| o.ego.speed_mps_mean = -10.0, "ego.speed_mps_mean"),
            (|o| o.ego.speed_mps_mean = o.ego.speed_mps_max + 1.0, "no more than speed_mps_max"),
            (|o| o.ego.distance_m = -0.5, "ego.distance_m"),
            (|o| o.ego.jerk_mps3_max = f64::NAN, "ego.jerk_mps3_max"),
            (|o| o.ego.yaw_rate_radps_max = 200.0, "ego.yaw_rate_radps_max"),
        ];
        for (change, name) in changes {
            let mut changed = hit.clone();
            change(&mut changed);
            let (expected, _) = changed.out_of_range().unwrap();
            assert!(expected.contains(name), "{expected}");
        }
    }

    #[test]
    fn an_ego_that_jumps_is_named_with_its_step() {
        let (plant, act) = played(3);
        let mut reported = tell(&plant, &act, Policy::Idm.driver().as_mut()).unwrap();
        reported.ego[4].sample.position = reported.ego[4].sample.position + Vec2::new(500.0, 0.0);
        let (expected, found) = reported.jump(false).unwrap();
        assert!(expected.contains("in step 3") && found.ends_with(" m"), "{expected}, {found}");
        // No speed explains it.
        reported.ego.iter_mut().for_each(|pose| pose.sample.velocity = Vec2::new(900.0, 0.0));
        assert!(reported.jump(false).unwrap().0.contains("at most 10.5 m in step 3"));
    }
}
