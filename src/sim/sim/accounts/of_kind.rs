//! Motion that no road user of a kind does: standing still and sliding aside, turning on the spot, running faster than its kind runs.
//! Only `simulator.of_kind` turns this account on, because an outcome with it differs from one without.
//!
//! Wheels roll along their heading. Any motion beyond that is summed up as a vector, so that the noise of a
//! recording, which goes to and fro, does not add up, while a slow slide does.

use serde::{Deserialize, Serialize};

use super::feasibility::{Level, beyond_turning, windows};
use super::smooth::{HALF_WINDOW, cubic};
use crate::kernel::{Vec2, num};
use crate::scene::{AgentKind, DT_S, Sample};
use crate::sim::prepared::body::Size;

/// Longest time over which a slide or a turn is summed up, samples (6 s).
const SPAN: usize = 60;
/// Way across the heading that rolling explains, as a share of the way along it: headings of recordings are off by some degrees.
const ACROSS_SHARE: f64 = 0.1;
/// Least radius on which anything on wheels turns, metres. Passenger cars need 5 m and more, a bicycle about 1.5 m.
const TURN_RADIUS_M: f64 = 1.5;

/// Motion that its kind does not do.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OfKind {
    /// Largest displacement within 6 s that rolling wheels do not explain, or way of the box's end in a turn on the spot, metres; 0 for
    /// someone on foot.
    pub unrolled_m: f64,
    /// Level of the speed: the value that the filtered speed reaches for 0.3 s in all, m/s.
    pub speed_mps: f64,
}

impl OfKind {
    /// Takes the larger of each.
    fn max(self, other: OfKind) -> OfKind {
        OfKind { unrolled_m: self.unrolled_m.max(other.unrolled_m), speed_mps: self.speed_mps.max(other.speed_mps) }
    }
}

/// Returns the account of a whole recorded motion; a gap begins it anew.
pub(in crate::sim) fn of_recording(samples: &[Option<Sample>], size: &Size) -> OfKind {
    let part = |part: &[Option<Sample>]| {
        let run: Vec<Sample> = part.iter().copied().flatten().collect();
        of_motion(&run, 0, size)
    };
    samples.split(Option::is_none).map(part).fold(OfKind::default(), OfKind::max)
}

/// Returns the account of samples that lie 0.1 s apart, from sample `from` on.
pub(in crate::sim) fn of_motion(samples: &[Sample], from: usize, size: &Size) -> OfKind {
    OfKind {
        unrolled_m: unrolled_m(samples.get(from..).unwrap_or_default(), size),
        speed_mps: speed_mps(samples, from),
    }
}

/// Returns the third largest filtered speed over the windows that reach sample `from` or later; of a shorter motion the mean speed.
fn speed_mps(samples: &[Sample], from: usize) -> f64 {
    let Some((half, centres)) = windows(samples.len(), from) else {
        let way_m = num::sum(samples.windows(2).map(|two| two[0].position.distance(two[1].position)));
        return way_m / (DT_S * samples.len().saturating_sub(1).max(1) as f64);
    };
    let places: Vec<Vec2> = samples.iter().map(|sample| sample.position).collect();
    let mut level = Level::default();
    centres.for_each(|centre| level.push(cubic(&places[centre - half..=centre + half]).velocity.norm()));
    level.value()
}

/// A step of something on wheels: way along the heading, way across it beyond what turning explains, and the turn.
struct Step {
    along: Vec2,
    across: Vec2,
    turned_rad: f64,
}

fn step(from: &Sample, to: &Sample, size: &Size) -> Step {
    let turned_rad = num::wrap_angle(to.heading_rad - from.heading_rad);
    let ahead = Vec2::from_heading(from.heading_rad + 0.5 * turned_rad);
    let moved = to.position - from.position;
    let across_m = beyond_turning(moved.dot(ahead.left()), turned_rad, size);
    Step { along: ahead * moved.dot(ahead), across: ahead.left() * across_m, turned_rad }
}

/// Returns the samples with fitted places and headings, those at either end from the outermost whole window. A motion shorter than a
/// window stays as it is. The jitter of a recording is no slide, and no turn.
///
/// Places follow a cubic and headings a line: a turn on the spot goes one way, and at a window's end a cubic would follow the
/// error of a single sample.
fn filtered(samples: &[Sample]) -> Vec<Sample> {
    if samples.len() <= 2 * HALF_WINDOW {
        return samples.to_vec();
    }
    let places: Vec<Vec2> = samples.iter().map(|sample| sample.position).collect();
    let mut heading_rad = samples[0].heading_rad;
    // Without the jump from π to -π.
    let headings_rad: Vec<f64> = samples
        .iter()
        .map(|sample| {
            heading_rad += num::wrap_angle(sample.heading_rad - heading_rad);
            heading_rad
        })
        .collect();
    let at = |k: usize| {
        let centre = k.clamp(HALF_WINDOW, samples.len() - 1 - HALF_WINDOW);
        let window = centre - HALF_WINDOW..=centre + HALF_WINDOW;
        let off = k as f64 - centre as f64;
        let position = cubic(&places[window.clone()]).position_at(off * DT_S);
        Sample { position, heading_rad: line_at(&headings_rad[window], off), ..samples[k] }
    };
    (0..samples.len()).map(at).collect()
}

/// Evaluates the line that fits an odd number of values best, so many samples from their centre.
fn line_at(values: &[f64], off: f64) -> f64 {
    let half = (values.len() / 2) as f64;
    let centred = || values.iter().enumerate().map(|(k, value)| (k as f64 - half, value));
    let slope = num::sum(centred().map(|(i, value)| i * value)) / num::sum(centred().map(|(i, _)| i * i));
    num::sum(values.iter().copied()) / values.len() as f64 + slope * off
}

fn unrolled_m(samples: &[Sample], size: &Size) -> f64 {
    if size.kind == AgentKind::Pedestrian {
        return 0.0;
    }
    let samples = filtered(samples);
    let steps: Vec<Step> = samples.windows(2).map(|two| step(&two[0], &two[1], size)).collect();
    let mut most_m: f64 = 0.0;
    for first in 0..steps.len() {
        let (mut along, mut across, mut turned_rad) = (Vec2::ZERO, Vec2::ZERO, 0.0);
        for step in &steps[first..steps.len().min(first + SPAN)] {
            (along, across, turned_rad) = (along + step.along, across + step.across, turned_rad + step.turned_rad);
            let rolled_m = along.norm();
            let slid_m = across.norm() - ACROSS_SHARE * rolled_m;
            let spun_m = size.half_length_m * (turned_rad.abs() - rolled_m / TURN_RADIUS_M);
            most_m = most_m.max(slid_m).max(spun_m);
        }
    }
    most_m
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernel::Seed;

    fn size(kind: AgentKind) -> Size {
        Size::new(kind, 4.6, 1.9)
    }

    fn drive(steps: usize, at: impl Fn(f64) -> (Vec2, f64)) -> Vec<Sample> {
        let sample = |k: usize| {
            let (position, heading_rad) = at(k as f64 * DT_S);
            Sample { position, heading_rad, velocity: Vec2::ZERO }
        };
        (0..steps).map(sample).collect()
    }

    fn unrolled(kind: AgentKind, steps: usize, at: impl Fn(f64) -> (Vec2, f64)) -> f64 {
        of_motion(&drive(steps, at), 0, &size(kind)).unrolled_m
    }

    #[test]
    fn a_standing_car_that_is_slid_aside_has_slid_as_far_as_it_was_slid_in_six_seconds() {
        let slid = |kind| unrolled(kind, 41, |t| (Vec2::new(0.0, 0.2 * t), 0.0));
        assert!((slid(AgentKind::Vehicle) - 0.8).abs() < 1e-9);
        let brief = unrolled(AgentKind::Vehicle, 11, |t| (Vec2::new(0.0, 0.2 * t), 0.0));
        assert!((brief - 0.2).abs() < 1e-9, "shorter than a window: unfiltered");
        assert_eq!(slid(AgentKind::Pedestrian), 0.0, "someone on foot steps aside");
        let long = unrolled(AgentKind::Vehicle, 91, |t| (Vec2::new(0.0, 0.2 * t), 0.0));
        assert!((long - 1.2).abs() < 1e-9, "6 s of 0.2 m/s: {long}");
    }

    #[test]
    fn who_is_slid_aside_within_half_a_second_of_appearing_has_slid() {
        for (from_s, for_s) in [(0.0, 0.3), (0.0, 0.5), (3.5, 0.5), (1.0, 0.5)] {
            let slid = unrolled(AgentKind::Vehicle, 41, |t| {
                (Vec2::new(0.0, 0.8 * ((t - from_s) / for_s).clamp(0.0, 1.0)), 0.0)
            });
            assert!((0.6..1.2).contains(&slid), "0.8 m within {for_s} s from {from_s} s on: {slid}");
        }
    }

    #[test]
    fn a_turn_on_the_spot_is_the_way_of_the_box_s_end() {
        // About its centre, where half the length of the box is 2.3 m: the rear end would have to move sideways.
        let spun = unrolled(AgentKind::Vehicle, 21, |t| (Vec2::ZERO, 0.25 * t));
        assert!((spun - 2.3 * 0.5).abs() < 1e-9, "{spun}");
    }

    #[test]
    fn what_rolls_has_slid_nowhere_on_a_curve_in_a_lane_change_or_backwards() {
        for rear_m in [0.0, 1.4] {
            let curve = |t: f64| {
                let heading = 0.5 * t;
                let rear = Vec2::new(num::sin(heading), 1.0 - num::cos(heading)) * 12.0;
                (rear + Vec2::from_heading(heading) * rear_m, heading)
            };
            assert!(unrolled(AgentKind::Vehicle, 60, curve) < 0.05);
        }
        // Over 4 s by 3.5 m aside, at 12 m/s; the heading is that of the way.
        let change = |t: f64| {
            let share = (t / 4.0).min(1.0);
            let aside = 3.5 * share * share * (3.0 - 2.0 * share);
            let rate = 3.5 * 6.0 * share * (1.0 - share) / 4.0;
            (Vec2::new(12.0 * t, aside), num::atan2(rate, 12.0))
        };
        assert!(unrolled(AgentKind::Vehicle, 60, change) < 0.05);
        assert!(unrolled(AgentKind::Vehicle, 60, |t| (Vec2::new(-2.0 * t, 0.0), 0.0)) < 1e-9, "reverses");
    }

    #[test]
    fn a_recording_with_jitter_of_five_centimetres_and_two_degrees_of_heading_slides_little() {
        for (speed_mps, most_m) in [(0.0, 0.15), (10.0, 0.15)] {
            let mut stream = Seed(3).stream(&["jitter"]);
            let mut noise = |size: f64| size * (stream.unit() + stream.unit() + stream.unit() - 1.5) * 2.0;
            let mut samples = drive(91, |t| (Vec2::new(speed_mps * t, 0.0), 0.035));
            for sample in &mut samples {
                sample.position = sample.position + Vec2::new(noise(0.05), noise(0.05));
            }
            let slid = of_motion(&samples, 0, &size(AgentKind::Vehicle)).unrolled_m;
            assert!(slid < most_m, "{speed_mps} m/s: {slid}");
        }
    }

    #[test]
    fn who_stands_while_its_recorded_heading_jitters_by_two_degrees_turns_little() {
        let mut stream = Seed(4).stream(&["jitter"]);
        let mut samples = drive(91, |_| (Vec2::ZERO, std::f64::consts::PI));
        for sample in &mut samples {
            sample.heading_rad = num::wrap_angle(sample.heading_rad + 0.035 * 2.0 * (stream.unit() - 0.5) * 1.7);
        }
        let spun = of_motion(&samples, 0, &size(AgentKind::Vehicle)).unrolled_m;
        assert!(spun < 0.2, "{spun}");
    }

    #[test]
    fn the_speed_is_its_third_largest_filtered_value_and_a_gap_begins_anew() {
        let at = |t: f64| (Vec2::new(0.5 * 3.0 * t * t, 0.0), 0.0);
        // 21 samples have windows centred at 0.6 to 1.4 s, where the speed is 3 t: 4.2, 3.9, 3.6.
        assert!((of_motion(&drive(21, at), 0, &size(AgentKind::Cyclist)).speed_mps - 3.6).abs() < 1e-6);
        let mut gap: Vec<Option<Sample>> = drive(61, at).into_iter().map(Some).collect();
        gap[21..61].fill(None);
        assert!((of_recording(&gap, &size(AgentKind::Cyclist)).speed_mps - 3.6).abs() < 1e-6);
    }
}
