//! Resamples states at a file's own times to one sample every 0.1 s: linear in place and velocity, along the shorter
//! arc in heading.

use crate::kernel::{Vec2, num};
use crate::scene::{DT_S, Sample};

/// Between two states at most this far apart a road user counts as observed, seconds.
const GAP_MAX_S: f64 = 0.5;
const SAME_TIME_S: f64 = 1e-6;

/// A state at a time of the file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct State {
    /// After the first step of the scene, seconds; may be negative.
    pub time_s: f64,
    /// Centre of the box, metres.
    pub position: Vec2,
    /// Counter-clockwise from +x.
    pub heading_rad: f64,
    /// Along the heading, m/s; derived from the places where it is not given.
    pub speed_mps: Option<f64>,
}

/// Returns samples at steps `0..steps` of states sorted by time, strictly increasing. A road user seen so briefly that no step
/// lies between two states is kept at the nearest step of each.
pub fn resample(states: &[State], steps: usize) -> Vec<Option<Sample>> {
    let velocities: Vec<Vec2> = (0..states.len()).map(|k| velocity(states, k)).collect();
    let mut samples = between(states, &velocities, steps);
    if samples.iter().all(Option::is_none) {
        for (state, velocity) in states.iter().zip(velocities) {
            let step = (state.time_s / DT_S).round();
            if let Some(sample) = (step >= 0.0).then(|| samples.get_mut(step as usize)).flatten() {
                let position = state.position + velocity * (step * DT_S - state.time_s);
                *sample = Some(Sample { position, heading_rad: num::wrap_angle(state.heading_rad), velocity });
            }
        }
    }
    samples
}

fn between(states: &[State], velocities: &[Vec2], steps: usize) -> Vec<Option<Sample>> {
    let mut next = 0;
    (0..steps)
        .map(|step| {
            let time_s = step as f64 * DT_S;
            while next < states.len() && states[next].time_s < time_s - SAME_TIME_S {
                next += 1;
            }
            let after = states.get(next)?;
            if after.time_s <= time_s + SAME_TIME_S {
                let heading_rad = num::wrap_angle(after.heading_rad);
                return Some(Sample { position: after.position, heading_rad, velocity: velocities[next] });
            }
            let before = states.get(next.checked_sub(1)?)?;
            let span = after.time_s - before.time_s;
            if span > GAP_MAX_S + SAME_TIME_S {
                return None;
            }
            let share = (time_s - before.time_s) / span;
            let turn = num::wrap_angle(after.heading_rad - before.heading_rad);
            Some(Sample {
                position: before.position.lerp(after.position, share),
                heading_rad: num::wrap_angle(before.heading_rad + turn * share),
                velocity: velocities[next - 1].lerp(velocities[next], share),
            })
        })
        .collect()
}

fn velocity(states: &[State], k: usize) -> Vec2 {
    if let Some(speed) = states[k].speed_mps {
        return Vec2::from_heading(states[k].heading_rad) * speed;
    }
    let (from, to) = (k.saturating_sub(1), (k + 1).min(states.len() - 1));
    let span = states[to].time_s - states[from].time_s;
    if span > 0.0 { (states[to].position - states[from].position) * (1.0 / span) } else { Vec2::ZERO }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn state(time_s: f64, x: f64, heading_rad: f64) -> State {
        State { time_s, position: Vec2::new(x, 0.0), heading_rad, speed_mps: None }
    }

    #[test]
    fn states_every_fifth_of_a_second_become_samples_every_tenth() {
        let samples = resample(&[state(0.0, 0.0, 3.1), state(0.2, 2.0, -3.1), state(0.4, 4.0, -3.1)], 6);
        let xs: Vec<Option<f64>> = samples.iter().map(|s| s.map(|s| num::rounded(s.position.x, 9))).collect();
        assert_eq!(xs, [Some(0.0), Some(1.0), Some(2.0), Some(3.0), Some(4.0), None]);
        assert!((samples[1].unwrap().heading_rad.abs() - num::PI).abs() < 1e-9, "the shorter arc");
        assert!((samples[1].unwrap().velocity.x - 10.0).abs() < 1e-9);
    }

    #[test]
    fn who_is_seen_between_two_steps_only_is_kept_at_the_nearest() {
        let once = resample(&[State { speed_mps: Some(10.0), ..state(0.23, 2.3, 0.0) }], 5);
        assert_eq!(once.iter().flatten().count(), 1);
        let kept = once[2].unwrap();
        assert!((kept.position.x - 2.0).abs() < 1e-12 && kept.velocity == Vec2::new(10.0, 0.0), "{kept:?}");
        let twice = resample(&[state(0.12, 1.2, 0.0), state(0.18, 1.8, 0.0)], 5);
        assert_eq!(twice.iter().map(Option::is_some).collect::<Vec<_>>(), [false, true, true, false, false]);
        assert!(resample(&[state(0.74, 0.0, 0.0)], 5).iter().all(Option::is_none), "beyond the end");
    }

    #[test]
    fn nothing_is_invented_before_after_or_in_long_gaps() {
        let samples = resample(&[state(0.2, 0.0, 0.0), state(0.3, 1.0, 0.0), state(1.0, 8.0, 0.0)], 13);
        let seen: Vec<usize> = (0..13).filter(|&k| samples[k].is_some()).collect();
        assert_eq!(seen, [2, 3, 10]);
    }
}
