//! KING's decision space: steering and throttle at even spacing, squashed by tanh, through the bicycle model.

use crate::kernel::{Vec2, num};
use crate::motion::bicycle::State;
use crate::motion::following;
use crate::motion::kinematics::{Controls, Kinematics, Slope, Steered, pull_back, unroll};
use crate::motion::{Drive, Driven};
use crate::scene::{DT_S, Sample};

/// The first actions stay this far from ±1, where tanh has no slope.
const ACTION_MAX: f64 = 0.97;

/// Actions of one adversary.
#[derive(Clone, Debug)]
pub struct ActionSpace {
    model: Steered,
    start: State,
    /// Place in the decision vector of the action held at each step; spacings below a step skip actions.
    held: Vec<usize>,
    /// Steering, throttle, steering, throttle, .. before tanh.
    record: Vec<f64>,
}

/// Which action is held at a step.
fn action(spacing_s: f64, step: usize) -> usize {
    (step as f64 * DT_S / spacing_s + 1e-9) as usize
}

impl ActionSpace {
    /// With the actions that follow a record.
    pub fn following(
        start: State,
        samples: &[Sample],
        spacing_s: f64,
        throttle_mps2: f64,
        brake_mps2: f64,
    ) -> ActionSpace {
        let model = Steered { throttle_mps2, brake_mps2 };
        let mut space = ActionSpace { model, start, held: Vec::with_capacity(samples.len()), record: vec![] };
        let mut state = start;
        let mut k = 0;
        while k < samples.len() {
            let own = action(spacing_s, k);
            let hold = (k..samples.len()).take_while(|later| action(spacing_s, *later) == own).count();
            space.held.extend(std::iter::repeat_n(space.record.len() / 2, hold));
            let (speed, curvature) = following::toward(&state, samples, k, hold);
            let held = model.controls_for(&state, speed, curvature, hold as f64 * DT_S);
            let held = held.map(|x| x.clamp(-ACTION_MAX, ACTION_MAX));
            space.record.extend(held.map(|x| 0.5 * num::ln((1.0 + x) / (1.0 - x))));
            for _ in 0..hold {
                state = model.step(&state, held, DT_S);
            }
            k += hold;
        }
        space
    }

    fn controls(&self, place: &[f64]) -> Vec<Controls> {
        let squashed: Vec<f64> = place.iter().map(|x| num::tanh(*x)).collect();
        self.held.iter().map(|k| [squashed[2 * k], squashed[2 * k + 1]]).collect()
    }
}

impl Driven for ActionSpace {
    fn start(&self) -> &[f64] {
        &self.record
    }

    fn drive(&self, place: &[f64]) -> Drive {
        let controls = self.controls(place);
        let (states, turns) = unroll(&self.model, self.start, &controls, DT_S);
        Drive { states, turns, controls }
    }

    fn axis(&self, drive: &Drive, state: usize) -> Option<Vec2> {
        drive.turns.get(state).map(|turn| turn.axis)
    }

    fn pull(&self, drive: &Drive, slopes: &[Slope]) -> Vec<f64> {
        let pulled = pull_back(&self.model, &drive.states, &drive.turns, &drive.controls, slopes, DT_S);
        let mut slope = vec![0.0; self.record.len()];
        for ((k, by), at) in self.held.iter().zip(pulled).zip(&drive.controls) {
            for which in 0..2 {
                slope[2 * k + which] += by[which] * (1.0 - at[which] * at[which]);
            }
        }
        slope
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A car that brakes from 9 to 4 m/s and then turns left.
    fn record() -> (State, Vec<Sample>) {
        let mut state = State { position: Vec2::new(5.0, 2.0), heading_rad: 0.4, speed_mps: 9.0 };
        let start = state;
        let samples = (0..70).map(|k| {
            let control = [if k < 20 { -2.5 } else { 0.0 }, if (20..60).contains(&k) { 0.06 } else { 0.0 }];
            state = crate::motion::kinematics::Curved::CAR.step(&state, control, DT_S);
            state.sample()
        });
        (start, samples.collect())
    }

    #[test]
    fn the_first_actions_follow_the_record() {
        let (start, samples) = record();
        for (spacing_s, bound_m) in [(0.1, 0.3), (0.25, 0.6)] {
            let space = ActionSpace::following(start, &samples, spacing_s, 3.0, 4.952399);
            let states = space.drive(space.start()).states;
            let worst =
                samples.iter().zip(&states[1..]).map(|(s, q)| s.position.distance(q.position)).fold(0.0, f64::max);
            assert!(worst < bound_m, "{spacing_s}: {worst}");
        }
    }

    #[test]
    fn a_quarter_second_gives_four_actions_a_second() {
        let (start, samples) = record();
        let space = ActionSpace::following(start, &samples, 0.25, 3.0, 4.952399);
        assert_eq!(space.start().len(), 2 * 28);
    }

    proptest! {
        #[test]
        fn the_action_spaces_slope_matches_finite_differences(
            shifts in prop::collection::vec(-0.4..0.4f64, 56), spacing in 0usize..3,
        ) {
            let (start, samples) = record();
            let space = ActionSpace::following(start, &samples, [0.1, 0.25, 0.5][spacing], 3.0, 4.952399);
            let place: Vec<f64> = space.start().iter().zip(shifts.iter().cycle()).map(|(x, s)| x + s).collect();
            prop_assume!(place.iter().all(|x| x.abs() > 1e-3));
            let value = |place: &[f64]| num::sum(space.drive(place).states.iter().map(|s| s.position.x * 0.5 - s.position.y));
            let drive = space.drive(&place);
            let slopes = vec![Slope { position: Vec2::new(0.5, -1.0), ..Slope::default() }; drive.states.len()];
            for (k, found) in space.pull(&drive, &slopes).into_iter().enumerate() {
                let at = |step: f64| {
                    let mut moved = place.clone();
                    moved[k] += step;
                    value(&moved)
                };
                let difference = (at(1e-5) - at(-1e-5)) / 2e-5;
                prop_assert!((difference - found).abs() < 1e-6 * (1.0 + difference.abs()), "{k}: {found} {difference}");
            }
        }
    }
}
