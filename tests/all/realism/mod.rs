//! Realism from both sides: recorded traffic keeps it, implausible motions lose it, each by its own diagnostic.

mod catalogue;
mod kinds;
mod motions;
mod places;
mod recorded;

use evodrive::ego::Policy;
use evodrive::evaluation::{Calibration, Counts, DIAGNOSTICS, RealismOptions};
use evodrive::kernel::Seed;
use evodrive::objects::RealismMean;
use evodrive::scene::{AgentKind, Scene};
use evodrive::sim::{Action, Intervention, Outcome, Plant, rollout};
use evodrive::synth::{self, SynthOptions, WorldKind};
use std::collections::BTreeMap;
use std::path::Path;

/// Name of the diagnostic of places.
pub const PLACE: &str = "place_of_kind";

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
        traffic: None,
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
    equal("recorded", &[Counts::Always])
}

/// The same with the two diagnostics of kinds, and bounds by kind.
pub fn options_of_kind() -> RealismOptions {
    equal("kinds", &[Counts::Always, Counts::OfKind])
}

/// The same with the diagnostic of places, too.
pub fn options_of_place() -> RealismOptions {
    equal("kinds", &[Counts::Always, Counts::OfKind, Counts::OfPlace])
}

fn equal(calibration: &str, counting: &[Counts]) -> RealismOptions {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("experiments/calibration/{calibration}.toml"));
    let calibration: Calibration = toml::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    let those: Vec<_> = DIAGNOSTICS.iter().filter(|of| counting.contains(&of.counts)).collect();
    let weights: BTreeMap<_, _> = those.iter().map(|of| (of.name().to_string(), 1.0 / those.len() as f64)).collect();
    let options = RealismOptions {
        weights: weights.try_into().unwrap(),
        calibration: Box::new(calibration),
        mean: RealismMean::Strict,
        excuses_recordings: true,
    };
    options.check().unwrap();
    options
}

#[test]
fn the_page_of_objectives_tells_of_every_diagnostic() {
    let page = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/OBJECTIVES.md")).unwrap();
    let names = DIAGNOSTICS.iter().map(|of| of.name());
    let missing = names.filter(|name| !page.contains(&format!("| `{name}`")) && !page.contains(&format!("**{name}**")));
    assert_eq!(missing.collect::<Vec<_>>(), Vec::<&str>::new());
}

pub fn played(scene: &Scene, action: Action, ego: &Policy) -> Outcome {
    let plant = Plant::new(scene).unwrap();
    rollout(&plant, &Intervention { actions: vec![action] }, ego.driver().as_mut()).unwrap()
}
