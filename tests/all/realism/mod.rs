//! Realism from both sides: recorded traffic keeps it, implausible motions lose it, each by its own diagnostic.

mod catalogue;
mod kinds;
mod motions;
mod places;
mod recorded;

use evodrive::ego::Policy;
use evodrive::evaluation::{Calibration, RealismOptions, Weights};
use evodrive::kernel::Seed;
use evodrive::objects::RealismMean;
use evodrive::scene::{AgentKind, Scene};
use evodrive::sim::{Action, Intervention, Outcome, Plant, rollout};
use evodrive::synth::{self, SynthOptions, WorldKind};
use std::path::Path;

/// Generated scenes of these worlds, cars alone; a world that finds no interacting pair gives none.
fn worlds(kinds: &[WorldKind], tracks_per_scene: usize, seed: Seed, scenes: usize) -> Vec<Scene> {
    let options = SynthOptions {
        kinds: kinds.to_vec(),
        steps: 91,
        current_step: 10,
        warm_up_s: 4.0,
        tracks_per_scene,
        pedestrian_share: 0.0,
        cyclist_share: 0.0,
        ego_travel_m_min: 10.0,
        interaction_time_s_max: 6.0,
        interaction_gap_m_max: 30.0,
        following_share: 1.0,
        attempts_max: 20,
    };
    (0..scenes).filter_map(|i| synth::pool_member(&options, seed, i).ok()).collect()
}

/// Length and width of somebody who is inserted.
fn body_m(kind: AgentKind) -> (f64, f64) {
    match kind {
        AgentKind::Vehicle => (4.6, 1.9),
        AgentKind::Cyclist => (1.8, 0.6),
        _ => (0.6, 0.6),
    }
}

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
    let options = RealismOptions {
        weights,
        calibration: Box::new(calibration),
        mean: RealismMean::Strict,
        excuses_recordings: true,
    };
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
    let options = RealismOptions {
        weights,
        calibration: Box::new(calibration),
        mean: RealismMean::Strict,
        excuses_recordings: true,
    };
    options.check().unwrap();
    options
}

pub fn played(scene: &Scene, action: Action, ego: &Policy) -> Outcome {
    let plant = Plant::new(scene).unwrap();
    rollout(&plant, &Intervention { actions: vec![action] }, ego.driver().as_mut()).unwrap()
}
