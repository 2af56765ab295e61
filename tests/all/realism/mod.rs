//! Realism from both sides: recorded traffic keeps it, implausible motions lose it, each by its own diagnostic.

mod catalogue;
mod kinds;
mod motions;
mod places;
mod recorded;

use evodrive::ego::Policy;
use evodrive::evaluation::{Calibration, RealismOptions, Weights};
use evodrive::scene::Scene;
use evodrive::sim::{Action, Intervention, Outcome, Plant, rollout};
use std::path::Path;

/// Equal weights and the calibration that the repository ships.
pub fn options() -> RealismOptions {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("experiments/calibration/recorded.toml");
    let calibration: Calibration = toml::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    let weights = Weights {
        rolling: None,
        speed_of_kind: None,
        place_of_kind: None,
        map_validity: 0.1,
        lane_direction: 0.1,
        route_completion: 0.1,
        initial_non_overlap: 0.1,
        collision_validity: 0.1,
        parked_obstacles: 0.1,
        trajectory_continuity: 0.1,
        bounded_acceleration: 0.1,
        bounded_jerk: 0.1,
        bounded_slip: 0.1,
    };
    let options = RealismOptions { weights, calibration: Box::new(calibration) };
    options.check().unwrap();
    options
}

/// The same with the two diagnostics of kinds, and bounds by kind.
pub fn options_of_kind() -> RealismOptions {
    by_kind(1.0 / 12.0, None)
}

/// The same with the diagnostic of places, too.
pub fn options_of_place() -> RealismOptions {
    by_kind(1.0 / 13.0, Some(1.0 / 13.0))
}

fn by_kind(share: f64, place_of_kind: Option<f64>) -> RealismOptions {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("experiments/calibration/kinds.toml");
    let calibration: Calibration = toml::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    let weights = Weights {
        rolling: Some(share),
        speed_of_kind: Some(share),
        place_of_kind,
        map_validity: share,
        lane_direction: share,
        route_completion: share,
        initial_non_overlap: share,
        collision_validity: share,
        parked_obstacles: share,
        trajectory_continuity: share,
        bounded_acceleration: share,
        bounded_jerk: share,
        bounded_slip: share,
    };
    let options = RealismOptions { weights, calibration: Box::new(calibration) };
    options.check().unwrap();
    options
}

pub fn played(scene: &Scene, action: Action, ego: &Policy) -> Outcome {
    let plant = Plant::new(scene).unwrap();
    rollout(&plant, &Intervention { actions: vec![action] }, ego.driver().as_mut()).unwrap()
}
