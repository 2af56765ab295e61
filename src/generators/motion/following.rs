//! Controls with which a vehicle model follows recorded samples. Gradient searches start from them.

use super::Window;
use super::bicycle::State;
use super::kinematics::{Controls, Curved, Kinematics};
use crate::scene::{DT_S, Sample, Track};

/// The target point for steering lies this many samples after the control's end.
const LEAD_STEPS: usize = 5;
/// Time in which an error along the way is corrected, seconds.
const CATCH_UP_S: f64 = 1.0;
/// A nearer point is no target for steering, metres.
const NEAR_M: f64 = 0.5;
/// A shorter record cannot be followed, samples.
const SAMPLES_MIN: usize = 10;

/// The state just before a window and the record in it, up to its first gap; `None` for fewer than 10 samples.
pub fn record(track: &Track, window: Window) -> Option<(State, Vec<Sample>)> {
    let before = track.at(window.from_step.checked_sub(1)?)?;
    let steps = window.from_step..window.from_step + window.steps;
    let samples: Vec<Sample> = steps.map_while(|step| track.at(step).copied()).collect();
    (samples.len() >= SAMPLES_MIN).then(|| (State::of(before), samples))
}

/// Speed to have and curvature to hold from `state`, so that after `hold` steps the vehicle is where sample
/// `k + hold - 1` is: pure pursuit across, a proportional rule along. `state` is the state before sample `k`.
pub fn toward(state: &State, samples: &[Sample], k: usize, hold: usize) -> (f64, f64) {
    let at = |k: usize| &samples[k.min(samples.len() - 1)];
    let axis = crate::kernel::Vec2::from_heading(state.heading_rad);
    let end = at(k + hold.max(1) - 1);
    let way = end.position - state.position;
    let time_s = hold.max(1) as f64 * DT_S;
    let missing = way.dot(axis) - 0.5 * (state.speed_mps + end.speed_mps()) * time_s;
    let speed = (end.speed_mps() + missing / CATCH_UP_S).max(0.0);
    let ahead = at(k + hold + LEAD_STEPS).position - state.position;
    let distance = ahead.norm();
    if distance < NEAR_M || ahead.dot(axis) <= 0.0 {
        return (speed, 0.0);
    }
    (speed, 2.0 * axis.cross(ahead) / (distance * distance))
}

/// Acceleration and curvature at every step that follow the samples.
pub fn controls(model: &Curved, start: State, samples: &[Sample]) -> Vec<Controls> {
    let mut state = start;
    let mut controls = Vec::with_capacity(samples.len());
    for k in 0..samples.len() {
        let (speed, curvature) = toward(&state, samples, k, 1);
        let limit = model.curvature_1pm_max;
        let acceleration = ((speed - state.speed_mps) / DT_S).clamp(-model.brake_mps2_max, model.acceleration_mps2_max);
        let control = [acceleration, curvature.clamp(-limit, limit)];
        state = model.step(&state, control, DT_S);
        controls.push(control);
    }
    controls
}

#[cfg(test)]
mod tests {
    use super::super::kinematics::unroll;
    use super::*;
    use crate::kernel::{Vec2, num};

    #[test]
    fn a_turn_with_braking_is_followed_within_a_quarter_metre() {
        // 10 m/s, braking to 5 m/s through a right angle of 12 m radius.
        let mut state = State { position: Vec2::ZERO, heading_rad: 0.0, speed_mps: 10.0 };
        let start = state;
        let samples: Vec<Sample> = (0..60)
            .map(|k| {
                let acceleration = if k < 25 { -2.0 } else { 0.0 };
                let curvature = if state.heading_rad < num::FRAC_PI_2 && k > 15 { 1.0 / 12.0 } else { 0.0 };
                state = Curved::CAR.step(&state, [acceleration, curvature], DT_S);
                state.sample()
            })
            .collect();
        let (states, _) = unroll(&Curved::CAR, start, &controls(&Curved::CAR, start, &samples), DT_S);
        let worst = samples.iter().zip(&states[1..]).map(|(s, q)| s.position.distance(q.position)).fold(0.0, f64::max);
        assert!(worst < 0.25, "{worst}");
    }

    #[test]
    fn a_record_ends_at_its_first_gap() {
        let mut track = crate::scene::fixture::two_lane_scene().tracks[0].clone();
        track.samples[20] = None;
        let (_, samples) = record(&track, Window { from_step: 5, steps: 40 }).unwrap();
        assert_eq!(samples.len(), 15);
        assert!(record(&track, Window { from_step: 15, steps: 40 }).is_none());
    }
}
