//! Kinematic models as differentiable steps, and motions unrolled through them: forward for the states, backward
//! (adjoint) for the gradients at the controls.

use super::bicycle::State;
use crate::kernel::{Vec2, num};

/// How a quantity changes with a state: ∂/∂position, ∂/∂heading, ∂/∂speed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Slope {
    /// Change by the position, 1/m.
    pub position: Vec2,
    /// Change by the heading, 1/rad.
    pub heading: f64,
    /// Change by the speed, s/m.
    pub speed: f64,
}

impl Slope {
    /// Adds `share` times another slope.
    pub fn add(&mut self, share: f64, other: &Slope) {
        self.position = self.position + other.position * share;
        self.heading += share * other.heading;
        self.speed += share * other.speed;
    }
}

/// The two controls of a vehicle; the model defines their meaning.
pub type Controls = [f64; 2];

/// Intermediate values that a step and its chain rule share: sines, cosines and tangents are most of what either costs,
/// so they are worked out once for the two.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Turn {
    /// Unit vector along which the step goes, or from which its course turns.
    pub axis: Vec2,
    /// Tangent of the wheels' angle; 0 in a model without wheels.
    wheel_tan: f64,
}

/// A vehicle model.
pub trait Kinematics {
    /// Returns the intermediate values of a step at a state. `before` are the controls and the turn of the last step:
    /// values of controls that are held need not be worked out again.
    fn turn(&self, state: &State, controls: Controls, dt_s: f64, before: Option<(Controls, Turn)>) -> Turn;

    /// The state `dt_s` later, by the step's turn.
    fn advance(&self, state: &State, controls: Controls, dt_s: f64, turn: &Turn) -> State;

    /// Chain rule of a step: from the slope at the next state to the slopes at this state and its controls.
    fn pull(&self, state: &State, controls: Controls, dt_s: f64, turn: &Turn, next: &Slope) -> (Slope, Controls);

    /// The state `dt_s` later.
    fn step(&self, state: &State, controls: Controls, dt_s: f64) -> State {
        self.advance(state, controls, dt_s, &self.turn(state, controls, dt_s, None))
    }
}

/// The start and the state after every step, with the turn of each step.
pub fn unroll<K: Kinematics>(model: &K, start: State, controls: &[Controls], dt_s: f64) -> (Vec<State>, Vec<Turn>) {
    let mut states = Vec::with_capacity(controls.len() + 1);
    let mut turns: Vec<Turn> = Vec::with_capacity(controls.len());
    states.push(start);
    for (k, control) in controls.iter().enumerate() {
        let before = k.checked_sub(1).map(|last| (controls[last], turns[last]));
        let turn = model.turn(&states[k], *control, dt_s, before);
        states.push(model.advance(&states[k], *control, dt_s, &turn));
        turns.push(turn);
    }
    (states, turns)
}

/// Slopes at the controls that led through `states` (start included) by `turns`; `slopes[k]` belongs to `states[k]`.
pub fn pull_back<K: Kinematics>(
    model: &K,
    states: &[State],
    turns: &[Turn],
    controls: &[Controls],
    slopes: &[Slope],
    dt_s: f64,
) -> Vec<Controls> {
    let mut pulled = vec![[0.0; 2]; controls.len()];
    let mut carried = Slope::default();
    for k in (0..controls.len()).rev() {
        carried.add(1.0, &slopes[k + 1]);
        (carried, pulled[k]) = model.pull(&states[k], controls[k], dt_s, &turns[k], &carried);
    }
    pulled
}

/// KING's bicycle (Hanselmann et al. 2022; constants of "World on Rails"): controls are steering and throttle in
/// [-1, 1], negative throttle brakes. A smooth maximum keeps the speed above 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Steered {
    /// Acceleration at full throttle (0.5633837 in KING), m/s².
    pub throttle_mps2: f64,
    /// Deceleration at full brake (4.952399 in KING), m/s².
    pub brake_mps2: f64,
}

const FRONT_M: f64 = -0.090_769_015;
const REAR_M: f64 = 1.417_827_5;
const STEER_GAIN_RAD: f64 = 0.368_483_36;
/// Sharpness of the smooth maximum, s/m.
const SOFTPLUS: f64 = 7.0;

impl Steered {
    fn gain_mps2(&self, throttle: f64) -> f64 {
        if throttle < 0.0 { self.brake_mps2 } else { self.throttle_mps2 }
    }

    /// The controls, within ±1, that come nearest to a change of speed and a curvature of the centre's heading.
    pub fn controls_for(&self, state: &State, speed_mps: f64, curvature_1pm: f64, time_s: f64) -> Controls {
        let wished = SOFTPLUS * speed_mps.max(1e-3);
        let before = if wished > 30.0 { speed_mps } else { num::ln(num::exp(wished) - 1.0) / SOFTPLUS };
        let acceleration = (before - state.speed_mps) / time_s;
        let throttle = (acceleration / self.gain_mps2(acceleration)).clamp(-1.0, 1.0);
        let sine = (REAR_M * curvature_1pm).clamp(-0.7, 0.7);
        let slip = sine / (1.0 - sine * sine).sqrt();
        let steering = num::atan(slip * (FRONT_M + REAR_M) / REAR_M) / STEER_GAIN_RAD;
        [steering.clamp(-1.0, 1.0), throttle]
    }
}

fn softplus(x: f64) -> f64 {
    if SOFTPLUS * x > 30.0 { x } else { num::ln(1.0 + num::exp(SOFTPLUS * x)) / SOFTPLUS }
}

impl Kinematics for Steered {
    fn turn(&self, state: &State, [steering, _]: Controls, _: f64, before: Option<(Controls, Turn)>) -> Turn {
        let held = before.filter(|(last, _)| last[0].to_bits() == steering.to_bits());
        let wheel_tan = held.map_or_else(|| num::tan(STEER_GAIN_RAD * steering), |(_, turn)| turn.wheel_tan);
        Turn { axis: Vec2::from_heading(state.heading_rad), wheel_tan }
    }

    fn advance(&self, state: &State, [_, throttle]: Controls, dt_s: f64, turn: &Turn) -> State {
        let slip = REAR_M / (FRONT_M + REAR_M) * turn.wheel_tan;
        let length = (1.0 + slip * slip).sqrt();
        let course = turned(turn.axis, slip / length, 1.0 / length);
        State {
            position: state.position + course * (state.speed_mps * dt_s),
            heading_rad: state.heading_rad + state.speed_mps / REAR_M * (slip / length) * dt_s,
            speed_mps: softplus(state.speed_mps + self.gain_mps2(throttle) * throttle * dt_s),
        }
    }

    fn pull(
        &self,
        state: &State,
        [_, throttle]: Controls,
        dt_s: f64,
        &Turn { axis, wheel_tan }: &Turn,
        next: &Slope,
    ) -> (Slope, Controls) {
        let slip = REAR_M / (FRONT_M + REAR_M) * wheel_tan;
        let length = (1.0 + slip * slip).sqrt();
        let (sine, cosine) = (slip / length, 1.0 / length);
        let course = turned(axis, sine, cosine);
        let way = state.speed_mps * dt_s;
        let aside = next.position.dot(course.left()) * way;
        let gain = self.gain_mps2(throttle);
        let before = state.speed_mps + gain * throttle * dt_s;
        let kept = next.speed * num::sigmoid(SOFTPLUS * before);
        let by_slip = aside + next.heading * way / REAR_M * cosine;
        let slip_by_steering =
            REAR_M / (FRONT_M + REAR_M) * (1.0 + wheel_tan * wheel_tan) * STEER_GAIN_RAD / (length * length);
        let slope = Slope {
            position: next.position,
            heading: next.heading + aside,
            speed: (next.position.dot(course) + next.heading * sine / REAR_M) * dt_s + kept,
        };
        (slope, [by_slip * slip_by_steering, kept * gain * dt_s])
    }
}

/// A unit vector turned by an angle given by sine and cosine.
fn turned(axis: Vec2, sine: f64, cosine: f64) -> Vec2 {
    axis * cosine + axis.left() * sine
}

/// A model controlled by acceleration and curvature, both clamped. The speed never falls below 0, and a standing
/// vehicle does not turn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Curved {
    /// Largest deceleration, m/s².
    pub brake_mps2_max: f64,
    /// Largest acceleration, m/s².
    pub acceleration_mps2_max: f64,
    /// Largest curvature, 1/m.
    pub curvature_1pm_max: f64,
}

impl Curved {
    /// A car's limits: full brake at 0.8 g, MetaDrive's engine with some room, a turning circle of 10 m.
    pub const CAR: Curved = Curved { brake_mps2_max: 8.0, acceleration_mps2_max: 4.0, curvature_1pm_max: 0.2 };

    fn clamped(&self, [acceleration, curvature]: Controls) -> Controls {
        let bound = self.curvature_1pm_max;
        [acceleration.clamp(-self.brake_mps2_max, self.acceleration_mps2_max), curvature.clamp(-bound, bound)]
    }
}

impl Kinematics for Curved {
    fn turn(&self, state: &State, controls: Controls, dt_s: f64, _: Option<(Controls, Turn)>) -> Turn {
        let [acceleration, curvature] = self.clamped(controls);
        let speed_mps = (state.speed_mps + acceleration * dt_s).max(0.0);
        let way = 0.5 * (state.speed_mps + speed_mps) * dt_s;
        Turn { axis: Vec2::from_heading(state.heading_rad + 0.5 * (curvature * way)), wheel_tan: 0.0 }
    }

    fn advance(&self, state: &State, controls: Controls, dt_s: f64, turn: &Turn) -> State {
        let [acceleration, curvature] = self.clamped(controls);
        let speed_mps = (state.speed_mps + acceleration * dt_s).max(0.0);
        let way = 0.5 * (state.speed_mps + speed_mps) * dt_s;
        let heading_rad = state.heading_rad + curvature * way;
        State { position: state.position + turn.axis * way, heading_rad, speed_mps }
    }

    fn pull(&self, state: &State, controls: Controls, dt_s: f64, turn: &Turn, next: &Slope) -> (Slope, Controls) {
        let held = self.clamped(controls);
        let [acceleration, curvature] = held;
        let wished = state.speed_mps + acceleration * dt_s;
        let way = 0.5 * (state.speed_mps + wished.max(0.0)) * dt_s;
        let direction = turn.axis;
        let aside = next.position.dot(direction.left()) * way;
        let by_way = next.position.dot(direction) + 0.5 * curvature * aside + next.heading * curvature;
        let by_next_speed = if wished > 0.0 { next.speed + 0.5 * dt_s * by_way } else { 0.0 };
        let slope = Slope {
            position: next.position,
            heading: next.heading + aside,
            speed: 0.5 * dt_s * by_way + by_next_speed,
        };
        let free = |k: usize, value: f64| if held[k] == controls[k] { value } else { 0.0 };
        (slope, [free(0, by_next_speed * dt_s), free(1, way * (next.heading + 0.5 * aside))])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A smooth quantity of a whole motion, and its slope.
    fn quantity(states: &[State]) -> f64 {
        states
            .iter()
            .enumerate()
            .map(|(k, s)| {
                let w = 1.0 + 0.1 * k as f64;
                0.01 * w * (s.position.x * s.position.y) + num::sin(s.heading_rad) * w + 0.1 * s.speed_mps * s.speed_mps
            })
            .sum()
    }

    fn slopes(states: &[State]) -> Vec<Slope> {
        let one = |(k, s): (usize, &State)| {
            let w = 1.0 + 0.1 * k as f64;
            Slope {
                position: Vec2::new(0.01 * w * s.position.y, 0.01 * w * s.position.x),
                heading: w * num::cos(s.heading_rad),
                speed: 0.2 * s.speed_mps,
            }
        };
        states.iter().enumerate().map(one).collect()
    }

    /// Largest difference of adjoint and central differences, relative to the size of the slope.
    fn error<K: Kinematics>(model: &K, start: State, controls: &[Controls]) -> f64 {
        let (states, turns) = unroll(model, start, controls, 0.1);
        let pulled = pull_back(model, &states, &turns, controls, &slopes(&states), 0.1);
        let mut worst: f64 = 0.0;
        for k in 0..controls.len() {
            for which in 0..2 {
                let at = |step: f64| {
                    let mut moved = controls.to_vec();
                    moved[k][which] += step;
                    quantity(&unroll(model, start, &moved, 0.1).0)
                };
                let difference = (at(1e-5) - at(-1e-5)) / 2e-5;
                worst = worst.max((difference - pulled[k][which]).abs() / (1.0 + difference.abs()));
            }
        }
        worst
    }

    /// The plain form of KING's bicycle: every sine, cosine and tangent where it is used.
    fn plainly_steered(
        model: &Steered,
        state: &State,
        [steering, throttle]: Controls,
        next: &Slope,
    ) -> (State, Slope, Controls) {
        let dt_s = 0.1;
        let wheel_tan = num::tan(STEER_GAIN_RAD * steering);
        let slip = REAR_M / (FRONT_M + REAR_M) * wheel_tan;
        let length = (1.0 + slip * slip).sqrt();
        let (sine, cosine) = (slip / length, 1.0 / length);
        let course = turned(Vec2::from_heading(state.heading_rad), sine, cosine);
        let (way, gain) = (state.speed_mps * dt_s, model.gain_mps2(throttle));
        let before = state.speed_mps + gain * throttle * dt_s;
        let after = State {
            position: state.position + course * (state.speed_mps * dt_s),
            heading_rad: state.heading_rad + state.speed_mps / REAR_M * (slip / length) * dt_s,
            speed_mps: softplus(before),
        };
        let aside = next.position.dot(course.left()) * way;
        let kept = next.speed * (1.0 / (1.0 + num::exp(-(SOFTPLUS * before))));
        let by_slip = aside + next.heading * way / REAR_M * cosine;
        let by_steering =
            REAR_M / (FRONT_M + REAR_M) * (1.0 + wheel_tan * wheel_tan) * STEER_GAIN_RAD / (length * length);
        let speed = (next.position.dot(course) + next.heading * sine / REAR_M) * dt_s + kept;
        let slope = Slope { position: next.position, heading: next.heading + aside, speed };
        (after, slope, [by_slip * by_steering, kept * gain * dt_s])
    }

    /// The plain form of the curved model.
    fn plainly_curved(model: &Curved, state: &State, controls: Controls, next: &Slope) -> (State, Slope, Controls) {
        let dt_s = 0.1;
        let held = model.clamped(controls);
        let [acceleration, curvature] = held;
        let wished = state.speed_mps + acceleration * dt_s;
        let way = 0.5 * (state.speed_mps + wished.max(0.0)) * dt_s;
        let direction = Vec2::from_heading(state.heading_rad + 0.5 * curvature * way);
        let heading_rad = state.heading_rad + curvature * way;
        let after = State { position: state.position + direction * way, heading_rad, speed_mps: wished.max(0.0) };
        let aside = next.position.dot(direction.left()) * way;
        let by_way = next.position.dot(direction) + 0.5 * curvature * aside + next.heading * curvature;
        let by_next_speed = if wished > 0.0 { next.speed + 0.5 * dt_s * by_way } else { 0.0 };
        let speed = 0.5 * dt_s * by_way + by_next_speed;
        let slope = Slope { position: next.position, heading: next.heading + aside, speed };
        let free = |k: usize, value: f64| if held[k] == controls[k] { value } else { 0.0 };
        (after, slope, [free(0, by_next_speed * dt_s), free(1, way * (next.heading + 0.5 * aside))])
    }

    type Plain<K> = fn(&K, &State, Controls, &Slope) -> (State, Slope, Controls);

    /// Returns `true` if a motion and its slopes are those of the plain form, bit for bit.
    fn is_plain<K: Kinematics>(model: &K, plain: Plain<K>, start: State, controls: &[Controls]) -> bool {
        let (states, turns) = unroll(model, start, controls, 0.1);
        let slopes = slopes(&states);
        let mut expected = vec![start];
        for (k, control) in controls.iter().enumerate() {
            expected.push(plain(model, &expected[k], *control, &Slope::default()).0);
        }
        let (mut pulled, mut carried) = (vec![[0.0; 2]; controls.len()], Slope::default());
        for k in (0..controls.len()).rev() {
            carried.add(1.0, &slopes[k + 1]);
            (_, carried, pulled[k]) = plain(model, &expected[k], controls[k], &carried);
        }
        let bits = |of: &[f64]| of.iter().map(|x| x.to_bits()).collect::<Vec<u64>>();
        let of_state = |s: &State| bits(&[s.position.x, s.position.y, s.heading_rad, s.speed_mps]);
        let found = pull_back(model, &states, &turns, controls, &slopes, 0.1);
        states.iter().map(of_state).eq(expected.iter().map(of_state))
            && found.iter().map(|c| bits(c)).eq(pulled.iter().map(|c| bits(c)))
    }

    fn start(speed: f64, heading: f64) -> State {
        State { position: Vec2::new(3.0, -4.0), heading_rad: heading, speed_mps: speed }
    }

    proptest! {
        #[test]
        fn the_adjoint_of_kings_bicycle_matches_finite_differences(
            speed in 0.0..15.0f64, heading in -3.0..3.0f64,
            actions in prop::collection::vec((-0.95..0.95f64, 0.01..0.95f64, any::<bool>()), 40),
        ) {
            // A throttle of 0 is a kink: brake and throttle differ.
            let controls: Vec<Controls> = actions.iter().map(|(s, t, brake)| [*s, if *brake { -t } else { *t }]).collect();
            let model = Steered { throttle_mps2: 3.0, brake_mps2: 4.952399 };
            prop_assert!(error(&model, start(speed, heading), &controls) < 1e-6);
        }

        #[test]
        fn what_step_and_slope_share_changes_no_bit_of_either(
            speed in 0.0..25.0f64, heading in -3.0..3.0f64, hold in 1usize..5,
            actions in prop::collection::vec((-0.95..0.95f64, -0.95..0.95f64, -9.0..5.0f64, -0.3..0.3f64), 40),
        ) {
            // Held for some steps, as an action is; with zeros of either sign among them.
            let held = |k: usize| actions[k - k % hold];
            let sign = |k: usize| if k.is_multiple_of(7) { 0.0 } else { -0.0 };
            let steered: Vec<Controls> =
                (0..40).map(|k| if k % 11 < 2 { [sign(k), held(k).1] } else { [held(k).0, held(k).1] }).collect();
            let model = Steered { throttle_mps2: 3.0, brake_mps2: 4.952399 };
            prop_assert!(is_plain(&model, plainly_steered, start(speed, heading), &steered));
            let curved: Vec<Controls> = (0..40).map(|k| [held(k).2, held(k).3]).collect();
            prop_assert!(is_plain(&Curved::CAR, plainly_curved, start(speed, heading), &curved));
        }

        #[test]
        fn the_adjoint_of_the_curved_model_matches_finite_differences(
            speed in 8.0..15.0f64, heading in -3.0..3.0f64,
            controls in prop::collection::vec((-1.5..2.0f64, -0.1..0.1f64), 40),
        ) {
            let controls: Vec<Controls> = controls.iter().map(|(a, k)| [*a, *k]).collect();
            prop_assert!(error(&Curved::CAR, start(speed, heading), &controls) < 1e-6);
        }

        #[test]
        fn controls_for_a_speed_and_a_curvature_lead_there(
            speed in 2.0..15.0f64, change in -0.4..0.25f64, curvature in -0.15..0.15f64,
        ) {
            let model = Steered { throttle_mps2: 3.0, brake_mps2: 4.952399 };
            let from = start(speed, 0.3);
            let controls = model.controls_for(&from, speed + change, curvature, 0.1);
            let next = model.step(&from, controls, 0.1);
            prop_assert!((next.speed_mps - speed - change).abs() < 1e-6);
            prop_assert!((next.heading_rad - 0.3 - curvature * speed * 0.1).abs() < 1e-9);
        }
    }

    #[test]
    fn braking_ends_at_standstill() {
        let controls = vec![[-20.0, 0.1]; 40];
        let (states, _) = unroll(&Curved::CAR, start(6.0, 0.0), &controls, 0.1);
        assert_eq!(states[40].speed_mps, 0.0);
        assert_eq!(states[30].heading_rad, states[40].heading_rad);
    }
}
