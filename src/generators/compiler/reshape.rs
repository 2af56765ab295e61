//! Retimes and reshapes candidates: the same way at another speed, or beside itself, by expressions over its progress.

use crate::kernel::{Vec2, num};
use crate::motion::Candidate;
use crate::scene::{DT_S, Sample};
use crate::sim::law::{OFFSET_M_MAX, OFFSET_MPS_MAX};
use crate::stage::{Part, Settings, Situation};

/// A candidate is at most this much faster than it was.
const SPEED_SHARE_MAX: f64 = 2.0;

/// Changes every candidate of every part; the features are those of `vocabulary::SHAPE`. Scores stay.
pub fn apply(situation: &Situation, settings: &Settings, parts: &mut [Part]) {
    for part in parts {
        let recorded = part.window.from_step.checked_sub(1).and_then(|step| situation.track(part.actor).at(step));
        for candidate in &mut part.candidates {
            let Some(before) = recorded.copied().or_else(|| candidate.samples.first().copied()) else { continue };
            candidate.samples = reshaped(&before, candidate, settings);
        }
    }
}

/// The way of a candidate from the sample before it: points, and the way driven up to each, metres.
struct Way {
    points: Vec<Vec2>,
    headings_rad: Vec<f64>,
    driven_m: Vec<f64>,
}

impl Way {
    fn of(before: &Sample, samples: &[Sample]) -> Way {
        let all = || std::iter::once(before).chain(samples);
        let points: Vec<Vec2> = all().map(|sample| sample.position).collect();
        let mut driven_m = vec![0.0; points.len()];
        for k in 1..points.len() {
            driven_m[k] = driven_m[k - 1] + points[k - 1].distance(points[k]);
        }
        Way { points, headings_rad: all().map(|sample| sample.heading_rad).collect(), driven_m }
    }

    /// Place and heading where this much is driven; straight on beyond the end. `from` is a place not beyond it.
    fn at(&self, driven_m: f64, from: &mut usize) -> (Vec2, f64) {
        let last = self.points.len() - 1;
        while *from < last && self.driven_m[*from + 1] < driven_m {
            *from += 1;
        }
        let (k, next) = (*from, (*from + 1).min(last));
        let length_m = self.driven_m[next] - self.driven_m[k];
        let left_m = driven_m - self.driven_m[k];
        if length_m <= 0.0 {
            let heading_rad = self.headings_rad[k];
            return (self.points[k] + Vec2::from_heading(heading_rad) * left_m, heading_rad);
        }
        let share = left_m / length_m;
        let turn_rad = num::wrap_angle(self.headings_rad[next] - self.headings_rad[k]);
        (self.points[k].lerp(self.points[next], share), self.headings_rad[k] + turn_rad * share.min(1.0))
    }
}

fn reshaped(before: &Sample, candidate: &Candidate, settings: &Settings) -> Vec<Sample> {
    let samples = &candidate.samples;
    let way = Way::of(before, samples);
    let steps = samples.len();
    let (mut driven_m, mut offset_m, mut place) = (0.0, 0.0, 0);
    let mut last = *before;
    (1..=steps)
        .map(|k| {
            let own_m = way.driven_m[k] - way.driven_m[k - 1];
            let features = || vec![k as f64 / steps as f64, k as f64 * DT_S, own_m / DT_S];
            let share = settings.optional("speed").map_or(1.0, |speed| speed.number(features()));
            let wanted_m = settings.optional("offset").map_or(0.0, |offset| offset.number(features()));
            let most_m = OFFSET_MPS_MAX * DT_S;
            let moved_m = (wanted_m.clamp(-OFFSET_M_MAX, OFFSET_M_MAX) - offset_m).clamp(-most_m, most_m);
            let ahead_m = own_m * share.clamp(0.0, SPEED_SHARE_MAX);
            // A standing road user cannot move sideways.
            offset_m += if ahead_m > 0.0 { moved_m } else { 0.0 };
            driven_m += ahead_m;
            let (point, course_rad) = way.at(driven_m, &mut place);
            let position = point + Vec2::from_heading(course_rad).left() * offset_m;
            let turn_rad = if ahead_m > 0.0 { num::atan2(moved_m, ahead_m) } else { 0.0 };
            let velocity = (position - last.position) * (1.0 / DT_S);
            last = Sample { position, heading_rad: num::wrap_angle(course_rad + turn_rad), velocity };
            last
        })
        .collect()
}
