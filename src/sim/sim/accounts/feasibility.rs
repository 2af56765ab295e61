//! Measures of a road user's motion in each thing that realism judges. The same account is taken of a simulated motion
//! and of a recorded one, so that the two can be compared.
//!
//! Acceleration, jerk, slip and roughness are levels: the value that the windows of the motion reach for 0.3 s in all
//! (the third largest of the windows' values). A single noisy window counts nothing, and a longer rollout does not
//! dilute a short violation, as a share of all windows would.

use std::ops::Range;

use serde::{Deserialize, Serialize};

use super::smooth::{HALF_WINDOW, HALF_WINDOW_MIN, cubic};
use crate::kernel::{Vec2, num};
use crate::scene::{AgentKind, DT_S, Sample};
use crate::sim::prepared::body::{Place, Size};
use crate::sim::prepared::drivable::Drivable;

/// Distance beyond the lanes up to which a corner counts as on the road: lane lines of recordings are no better, metres.
pub const DRIVABLE_TOLERANCE_M: f64 = 0.5;
/// Windows that must reach a level: 0.3 s.
pub const LEVEL_WINDOWS: usize = 3;
/// Farthest place without side slip, from a vehicle's centre towards its rear end, as a share of its length.
const SLIP_FREE_SHARE_MAX: f64 = 0.5;

/// Data of one motion that realism judges.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Feasibility {
    /// Largest distance of a corner of the box beyond the drivable area, metres.
    pub off_road_m: f64,
    /// Distance driven against a lane's direction, metres.
    pub wrong_way_m: f64,
    /// Level of the norm of the filtered acceleration, m/s².
    pub acceleration_mps2: f64,
    /// Level of the norm of the filtered jerk, m/s³.
    pub jerk_mps3: f64,
    /// Level of the filtered velocity across the heading that turning does not explain, m/s; 0 for someone on foot.
    pub slip_mps: f64,
    /// Level of the distance between the places and the filtered ones, metres: jitter that the filter takes away.
    pub roughness_m: f64,
    /// Largest step that the velocities at its ends do not explain, metres.
    pub jump_m: f64,
    /// Largest step that the step before it does not explain, metres.
    pub kink_m: f64,
}

/// Values that are summed up step by step; the others need windows.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::sim) struct StepMeter {
    before: Option<Vec2>,
    last: Option<Sample>,
    so_far: Feasibility,
    /// Lane pieces that last held the corners and the centre.
    hints: [u32; 5],
}

impl StepMeter {
    /// Notes that the road user is not there: the next sample begins anew.
    pub fn lose(&mut self) {
        (self.before, self.last) = (None, None);
    }

    /// Takes the next sample, `seconds` after the last one; `counts` is true from where the motion is judged.
    pub fn push(&mut self, road: &Drivable, now: &Sample, axis: Vec2, size: &Size, seconds: f64, counts: bool) {
        if counts {
            self.judge(road, now, axis, size, seconds);
        }
        self.before = self.last.map(|last| last.position);
        self.last = Some(*now);
    }

    fn judge(&mut self, road: &Drivable, now: &Sample, axis: Vec2, size: &Size, seconds: f64) {
        let so_far = &mut self.so_far;
        if let Some(last) = self.last {
            let explained = (last.velocity + now.velocity) * (0.5 * seconds);
            so_far.jump_m = so_far.jump_m.max((now.position - last.position - explained).norm());
            if road.is_wrong_way(now.position, axis, &mut self.hints[4]) {
                so_far.wrong_way_m += last.position.distance(now.position);
            }
            if let Some(before) = self.before {
                let as_before = (last.position - before) * (seconds / DT_S);
                so_far.kink_m = so_far.kink_m.max((now.position - last.position - as_before).norm());
            }
        }
        for (corner, hint) in size.at(Place { position: now.position, axis }).corners().into_iter().zip(&mut self.hints)
        {
            let floor_m = so_far.off_road_m + DRIVABLE_TOLERANCE_M;
            let distance_m = road.distance_m(corner, floor_m, hint);
            so_far.off_road_m = so_far.off_road_m.max(distance_m - DRIVABLE_TOLERANCE_M);
        }
    }

    /// Returns the account with the levels of the windows that reach sample `from` or later.
    pub fn finish(&self, samples: &[Sample], from: usize, size: &Size) -> Feasibility {
        let [acceleration_mps2, jerk_mps3, slip_mps, roughness_m] = levels(samples, from, size);
        Feasibility { acceleration_mps2, jerk_mps3, slip_mps, roughness_m, ..self.so_far }
    }
}

/// Returns the levels of acceleration, jerk, slip and roughness over the windows that reach sample `from` or later.
fn levels(samples: &[Sample], from: usize, size: &Size) -> [f64; 4] {
    let Some((half, centres)) = windows(samples.len(), from) else { return [0.0; 4] };
    let places: Vec<Vec2> = samples.iter().map(|sample| sample.position).collect();
    let mut levels = [Level::default(); 4];
    for centre in centres {
        let fit = cubic(&places[centre - half..=centre + half]);
        let slip = slip_mps(&samples[centre - half..=centre + half], fit.velocity, size);
        let rough = (places[centre] - fit.position).norm();
        let values = [fit.acceleration.norm(), fit.jerk.norm(), slip, rough];
        levels.iter_mut().zip(values).for_each(|(level, value)| level.push(value));
    }
    levels.map(|level| level.value())
}

/// Returns the samples on each side of a window's centre, and the centres of the windows that reach sample `from` or later; `None` where
/// there are too few samples for a window.
pub(super) fn windows(samples: usize, from: usize) -> Option<(usize, Range<usize>)> {
    let half = HALF_WINDOW.min(samples.saturating_sub(1) / 2);
    (half >= HALF_WINDOW_MIN).then(|| (half, from.saturating_sub(half).max(half)..samples - half))
}

/// The level of a quantity: its third largest value over windows; of fewer windows than three the largest.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Level {
    /// Largest values, in falling order.
    highest: [f64; LEVEL_WINDOWS],
    windows: usize,
}

impl Level {
    /// Takes the next window's value, at least 0.
    pub fn push(&mut self, mut value: f64) {
        self.windows += 1;
        for place in &mut self.highest {
            if value > *place {
                std::mem::swap(place, &mut value);
            }
        }
    }

    pub fn value(&self) -> f64 {
        if self.windows < LEVEL_WINDOWS { self.highest[0] } else { self.highest[LEVEL_WINDOWS - 1] }
    }
}

/// Returns the velocity across the heading at the place of the vehicle where it is least. A car turns about a place on its
/// rear axle. Recordings and generators differ in which place follows the path, so all between centre and rear end count.
fn slip_mps(window: &[Sample], velocity: Vec2, size: &Size) -> f64 {
    if size.kind == AgentKind::Pedestrian {
        return 0.0;
    }
    let half = window.len() / 2;
    let heading_rad = window[half].heading_rad;
    let (mut turned, mut squares) = (0.0, 0.0);
    for (k, sample) in window.iter().enumerate() {
        let i = k as f64 - half as f64;
        turned += i * num::wrap_angle(sample.heading_rad - heading_rad);
        squares += i * i;
    }
    let yaw_rate_radps = turned / (squares * DT_S);
    let across_mps = velocity.dot(Vec2::from_heading(heading_rad).left());
    beyond_turning(across_mps, yaw_rate_radps, size).abs()
}

/// Returns the motion across the heading that turning does not explain, in the unit of `across` (m or m/s; `turned` is rad or rad/s).
pub(super) fn beyond_turning(across: f64, turned: f64, size: &Size) -> f64 {
    let explained = turned * 2.0 * size.half_length_m * SLIP_FREE_SHARE_MAX;
    across - across.clamp(explained.min(0.0), explained.max(0.0))
}

/// Returns the account of a whole recorded motion; a gap begins it anew.
pub(in crate::sim) fn of_recording(road: &Drivable, samples: &[Option<Sample>], size: &Size) -> Feasibility {
    let mut meter = StepMeter::default();
    let mut so_far = Feasibility::default();
    let mut run: Vec<Sample> = Vec::with_capacity(samples.len());
    for part in samples.split(Option::is_none) {
        run.clear();
        run.extend(part.iter().flatten());
        meter.lose();
        for sample in &run {
            meter.push(road, sample, Vec2::from_heading(sample.heading_rad), size, DT_S, true);
        }
        let own = meter.finish(&run, 0, size);
        so_far = Feasibility {
            acceleration_mps2: so_far.acceleration_mps2.max(own.acceleration_mps2),
            jerk_mps3: so_far.jerk_mps3.max(own.jerk_mps3),
            slip_mps: so_far.slip_mps.max(own.slip_mps),
            roughness_m: so_far.roughness_m.max(own.roughness_m),
            ..own
        };
    }
    so_far
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sim::prepared::plant::Plant;
    use crate::sim::scenes::{car, sample, straight, straight_road};

    fn account(samples: Vec<Option<Sample>>) -> Feasibility {
        let steps = samples.len();
        let plant = Plant::new(&straight_road(steps, 5.0, vec![car("a", samples)])).unwrap();
        plant.recorded(0)
    }

    /// Makes a motion straight along the lane with an added shift at each step.
    fn shifted(steps: usize, shift: impl Fn(f64) -> Vec2) -> Vec<Option<Sample>> {
        let mut samples = straight(sample(20.0, 0.0, 0.0, 8.0), steps);
        for (k, sample) in samples.iter_mut().flatten().enumerate() {
            sample.position = sample.position + shift(k as f64 * DT_S);
        }
        samples
    }

    #[test]
    fn a_steady_drive_shows_nothing() {
        let found = account(straight(sample(20.0, 0.0, 0.0, 8.0), 60));
        for value in [found.acceleration_mps2, found.jerk_mps3, found.slip_mps, found.roughness_m, found.jump_m] {
            assert!(value < 1e-6, "{found:?}");
        }
    }

    #[test]
    fn a_constant_brake_shows_as_it_is() {
        let found = account(shifted(21, |t| Vec2::new(-0.5 * 3.0 * t * t, 0.0)));
        assert!((found.acceleration_mps2 - 3.0).abs() < 1e-6 && found.jerk_mps3 < 1e-6, "{found:?}");
    }

    #[test]
    fn a_sideways_drift_is_slip_and_no_acceleration() {
        let found = account(shifted(40, |t| Vec2::new(0.0, -1.5 * t)));
        assert!((found.slip_mps - 1.5).abs() < 1e-6 && found.acceleration_mps2 < 1e-6, "{found:?}");
    }

    #[test]
    fn a_car_that_turns_about_its_rear_axle_or_its_centre_does_not_slip() {
        for rear_m in [0.0, 1.4] {
            let on_arc = |k: usize| {
                let heading = 0.05 * k as f64;
                let rear = Vec2::new(num::sin(heading), 1.0 - num::cos(heading)) * 12.0;
                let ahead = Vec2::from_heading(heading) * rear_m;
                Some(Sample {
                    position: rear + ahead,
                    heading_rad: heading,
                    velocity: Vec2::from_heading(heading) * 6.0,
                })
            };
            let found = account((0..50).map(on_arc).collect());
            assert!(found.slip_mps < 0.05, "{rear_m}: {found:?}");
        }
    }

    #[test]
    fn jitter_above_the_cut_off_is_roughness_where_the_acceleration_hides_it() {
        let found = account(shifted(60, |t| Vec2::new(0.0, 0.3 * num::cos(2.0 * num::PI * 4.0 * t))));
        assert!(found.roughness_m > 0.25 && found.kink_m > 0.5, "{found:?}");
        // The true acceleration is 190 m/s².
        assert!(found.acceleration_mps2 < 20.0, "{found:?}");
    }

    #[test]
    fn a_zigzag_from_sample_to_sample_is_roughness_worked_by_hand() {
        // The weights of the fitted place are (25 - i²) / 143, i = -6..=6. Of a sign that changes with every sample they
        // leave (25 - 42) / 143 = -17 / 143, so a place lies 160 / 143 of the amplitude from the fitted one.
        let found = account(shifted(60, |t| Vec2::new(0.0, 0.143 * num::cos(10.0 * num::PI * t))));
        assert!((found.roughness_m - 0.160).abs() < 1e-9, "{found:?}");
        // A step goes 2 * 0.143 m aside, where the velocities say 0; the step before went as far to the other side.
        assert!((found.jump_m - 0.286).abs() < 1e-9 && (found.kink_m - 0.572).abs() < 1e-9, "{found:?}");
    }

    #[test]
    fn a_step_that_is_two_metres_too_long_is_a_jump_and_a_kink_of_two_metres() {
        let found = account(shifted(60, |t| Vec2::new(if t > 2.95 { 2.0 } else { 0.0 }, 0.0)));
        assert!((found.jump_m - 2.0).abs() < 1e-9 && (found.kink_m - 2.0).abs() < 1e-9, "{found:?}");
    }

    #[test]
    fn a_constant_jerk_shows_as_it_is_and_the_level_of_the_acceleration_is_its_third_largest_value() {
        // 21 samples have windows centred at 0.6 to 1.4 s, where the acceleration is 2 t: 2.8, 2.6, 2.4, ..
        let found = account(shifted(21, |t| Vec2::new(-2.0 * t * t * t / 6.0, 0.0)));
        assert!((found.jerk_mps3 - 2.0).abs() < 1e-6 && (found.acceleration_mps2 - 2.4).abs() < 1e-6, "{found:?}");
    }

    #[test]
    fn metres_off_the_road_are_those_of_the_outermost_corner_less_the_tolerance() {
        // The lane ends 2 m aside. The outer corners of a car of 1.9 m width that is 2 m aside lie at 2.95 m: 0.95 - 0.5.
        let found = account(shifted(30, |_| Vec2::new(0.0, 2.0)));
        assert!((found.off_road_m - 0.45).abs() < 1e-9, "{found:?}");
        assert_eq!(account(shifted(30, |_| Vec2::new(0.0, 1.5))).off_road_m, 0.0, "0.45 m is within the tolerance");
    }

    #[test]
    fn metres_on_the_wrong_way_are_those_driven_against_the_only_lane() {
        let heading = |degrees: f64| account(straight(sample(120.0, 0.0, degrees.to_radians(), 8.0), 21)).wrong_way_m;
        // Twenty steps of 0.8 m.
        assert!((heading(180.0) - 16.0).abs() < 1e-9);
        assert_eq!(heading(80.0), 0.0, "across it, but less than 90 degrees off");
    }

    #[test]
    fn a_level_is_the_third_largest_value() {
        let mut level = Level::default();
        [5.0, 1.0, 9.0, 7.0, 2.0].into_iter().for_each(|value| level.push(value));
        assert_eq!(level.highest, [9.0, 7.0, 5.0]);
        assert_eq!(level.value(), 5.0);
    }
}
