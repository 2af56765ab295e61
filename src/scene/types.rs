//! The nouns of a driving scene: road, tracks, lights, ego, route. Local metric frame, right-handed, SI
//! units, headings counter-clockwise from +x. A value that may be absent is an `Option`, never a magic number.

use serde::{Deserialize, Serialize};

use super::safebench::Staging;
use crate::kernel::Vec2;

/// Index of a lane in [`Road::lanes`].
pub type LaneIx = usize;
/// Index of a track in [`Scene::tracks`].
pub type TrackIx = usize;

/// Seconds between two samples of every scene; importers resample to it.
pub const DT_S: f64 = 0.1;

/// One recorded or generated traffic situation.
///
/// Everything here can be seen by a rollout and counts into the scene's digest, except `origin`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Scene {
    /// Unique in a pool.
    pub id: String,
    /// Where it came from; not part of the digest.
    pub origin: Origin,
    /// Number of samples; sample `k` lies at `k * DT_S` seconds.
    pub steps: usize,
    /// The last sample of history ("now"): interventions start after it. 10 for Waymo, 0 where nothing precedes.
    pub current_step: usize,
    pub road: Road,
    /// Everyone but the ego.
    pub tracks: Vec<Track>,
    pub ego: Ego,
    /// Tracks that the data set marks as interacting with the ego; may be empty.
    pub objects_of_interest: Vec<TrackIx>,
    pub lights: Vec<Light>,
    pub stop_signs: Vec<StopSign>,
    pub crosswalks: Vec<Vec<Vec2>>,
    /// What a scene of SafeBench's traffic families knows beside; `None` for every other scene.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub staging: Option<Staging>,
}

/// Provenance for people and reports; a rollout never sees it.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Origin {
    /// `commonroad-2020a`, `scenarionet`, `synth/crossing`, ...
    pub format: String,
    /// File name without folder, or the generator's name and seed.
    pub name: String,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum AgentKind {
    Vehicle,
    Pedestrian,
    Cyclist,
    /// Barriers, cones, parked or unknown things.
    Static,
}

/// Centre of the bounding box and its motion at one sample.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Sample {
    pub position: Vec2,
    pub heading_rad: f64,
    /// Global axes, m/s.
    pub velocity: Vec2,
}

impl Sample {
    pub fn speed_mps(&self) -> f64 {
        self.velocity.norm()
    }
}

/// A road user's recorded motion.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Track {
    pub id: String,
    pub kind: AgentKind,
    pub length_m: f64,
    pub width_m: f64,
    /// `steps` long; `None` where the road user was not observed.
    pub samples: Vec<Option<Sample>>,
}

impl Track {
    pub fn at(&self, step: usize) -> Option<&Sample> {
        self.samples.get(step).and_then(Option::as_ref)
    }

    /// First and last observed step.
    pub fn span(&self) -> Option<(usize, usize)> {
        let first = self.samples.iter().position(Option::is_some)?;
        let last = self.samples.iter().rposition(Option::is_some)?;
        Some((first, last))
    }
}

/// The vehicle under test. A recording knows its whole motion; a planning problem only its start and goal.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Ego {
    /// `samples[start_step]` is always there; the rest may not be.
    pub track: Track,
    /// Step at which the closed loop begins.
    pub start_step: usize,
    /// The path to drive, at least 2 points: the logged path, or the route through the lane graph.
    pub route: Vec<Vec2>,
    /// Speed to aim at where the scene gives one, m/s.
    pub target_speed_mps: Option<f64>,
}

#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Road {
    pub lanes: Vec<Lane>,
    /// Curbs and other edges that nobody drives over.
    pub edges: Vec<Vec<Vec2>>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LaneKind {
    Street,
    Freeway,
    Bike,
    /// Shoulders, parking, sidewalks: drivable surface without through traffic.
    Other,
}

/// A stretch of lane in driving direction. The three lines have equal counts.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Lane {
    pub id: String,
    pub kind: LaneKind,
    pub centre: Vec<Vec2>,
    pub left: Vec<Vec2>,
    pub right: Vec<Vec2>,
    pub entries: Vec<LaneIx>,
    pub exits: Vec<LaneIx>,
    pub left_neighbour: Option<Neighbour>,
    pub right_neighbour: Option<Neighbour>,
    pub speed_limit_mps: Option<f64>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Neighbour {
    pub lane: LaneIx,
    pub same_direction: bool,
}

/// A traffic light over a lane.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Light {
    pub lane: LaneIx,
    pub stop_point: Vec2,
    /// `steps` long.
    pub states: Vec<LightState>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LightState {
    Unknown,
    Stop,
    Caution,
    Go,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StopSign {
    pub position: Vec2,
    pub lanes: Vec<LaneIx>,
}
