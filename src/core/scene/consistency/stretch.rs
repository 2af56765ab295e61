//! Ways of about a second, by places and by velocities. Over a second the jitter of single places hardly counts: of 3131 road
//! users of nuScenes, NGSIM and CommonRoad that go at 3 m/s or more, the worst one's velocities give ways that differ by 17 % from
//! those of its places, and the worst one's heading lies 7 degrees beside its motion (medians of a road user).

use crate::kernel::{Vec2, num};
use crate::scene::Sample;

/// Least length of a stretch, seconds: ten steps of 0.1 s, or two of 0.5 s, less what recorded times waver.
const STRETCH_MIN_S: f64 = 0.95;
/// Largest gap between two samples in a stretch, seconds: beyond it the motion is unknown. nuScenes labels two times a second.
const GAP_MAX_S: f64 = 0.51;
/// Least speed for a judgement of conventions, m/s: parked cars jitter, and nobody drives backwards faster for long. Below it
/// recorded cars of Lankershim go backwards, and their headings lie up to 178 degrees beside the motion.
pub const MOVING_MIN_MPS: f64 = 3.0;
/// Least number of stretches for a judgement of a road user: two seconds at steps of 0.1 s.
pub const JUDGED_MIN: usize = 10;

/// Motion of a road user over about a second.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stretch {
    /// Index of the sample in its middle.
    pub middle: usize,
    /// How long it takes, seconds.
    pub span_s: f64,
    /// Displacement from its first place to its last, metres.
    pub way: Vec2,
    /// The way that the velocities give, metres.
    pub by_velocity: Vec2,
}

impl Stretch {
    /// Speed by places, m/s.
    pub fn way_mps(&self) -> f64 {
        self.way.norm() / self.span_s
    }

    /// Returns `true` if the road user moves, by places or by velocities.
    pub fn moves(&self) -> bool {
        self.way_mps().max(self.by_velocity.norm() / self.span_s) >= MOVING_MIN_MPS
    }

    /// How far a way by velocities differs from that by places, as a share of the longer one.
    pub fn differs(&self, by_velocity: Vec2) -> f64 {
        share_between(self.way, by_velocity)
    }

    /// Angle between a heading and the motion, radians, from 0 to pi.
    pub fn askew_rad(&self, heading_rad: f64) -> f64 {
        num::wrap_angle(heading_rad - self.way.heading()).abs()
    }
}

/// How far two vectors differ, as a share of the longer one.
pub fn share_between(a: Vec2, b: Vec2) -> f64 {
    let longer = a.norm().max(b.norm());
    if longer > 0.0 { a.distance(b) / longer } else { 0.0 }
}

/// A stretch from each sample on that has one: about a second without a gap. Samples whose place or velocity is not finite
/// count as not observed. Times increase.
pub fn stretches(times_s: &[f64], samples: &[Option<Sample>], velocity: impl Fn(&Sample) -> Vec2) -> Vec<Stretch> {
    let known: Vec<(usize, f64, Vec2, Vec2)> = samples
        .iter()
        .zip(times_s)
        .enumerate()
        .filter_map(|(k, (sample, time_s))| {
            let sample = sample.as_ref()?;
            let velocity = velocity(sample);
            (sample.position.is_finite() && velocity.is_finite()).then_some((k, *time_s, sample.position, velocity))
        })
        .collect();
    // The way by velocities from the first sample on, and where the last gap before a sample ends.
    let (mut by_velocity, mut whole_from) = (vec![Vec2::ZERO; known.len()], vec![0; known.len()]);
    for k in 1..known.len() {
        let ((_, before_s, _, before), (_, time_s, _, now)) = (known[k - 1], known[k]);
        by_velocity[k] = by_velocity[k - 1] + (before + now) * (0.5 * (time_s - before_s));
        whole_from[k] = if time_s - before_s > GAP_MAX_S { k } else { whole_from[k - 1] };
    }
    let mut stretches = Vec::new();
    let mut to = 0;
    for from in 0..known.len() {
        while to < known.len() && known[to].1 - known[from].1 < STRETCH_MIN_S {
            to += 1;
        }
        if to >= known.len() {
            break;
        }
        if whole_from[to] <= from {
            stretches.push(Stretch {
                middle: known[usize::midpoint(from, to)].0,
                span_s: known[to].1 - known[from].1,
                way: known[to].2 - known[from].2,
                by_velocity: by_velocity[to] - by_velocity[from],
            });
        }
    }
    stretches
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_way_by_velocities_is_that_by_places_also_around_a_bend_and_over_no_gap() {
        let times: Vec<f64> = (0..40).map(|k| 0.1 * f64::from(k)).collect();
        let on_circle = |t: &f64| {
            let heading_rad = 0.4 * t;
            let position = Vec2::new(num::sin(heading_rad), 1.0 - num::cos(heading_rad)) * 20.0;
            Some(Sample { position, heading_rad, velocity: Vec2::from_heading(heading_rad) * 8.0 })
        };
        let mut samples: Vec<Option<Sample>> = times.iter().map(on_circle).collect();
        let all = stretches(&times, &samples, |s| s.velocity);
        assert_eq!(all.len(), 30);
        for stretch in &all {
            assert!(stretch.differs(stretch.by_velocity) < 1e-3 && stretch.moves(), "{stretch:?}");
            assert!(stretch.askew_rad(0.4 * times[stretch.middle]) < 1e-6, "{stretch:?}");
        }
        samples[12..18].fill(None);
        assert_eq!(stretches(&times, &samples, |s| s.velocity).len(), 2 + 12, "before and behind the gap");
        samples.fill(Some(Sample { position: Vec2::new(f64::NAN, 0.0), ..Sample::default() }));
        assert_eq!(stretches(&times, &samples, |s| s.velocity), vec![]);
    }
}
