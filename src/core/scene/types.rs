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
    /// Origin of the scene; not part of the digest.
    pub origin: Origin,
    /// Number of samples; sample `k` lies at `k * DT_S` seconds.
    pub steps: usize,
    /// The last sample of history ("now"): interventions start after it. 10 for Waymo, 0 where nothing precedes.
    pub current_step: usize,
    /// Lanes and edges.
    pub road: Road,
    /// Everyone but the ego.
    pub tracks: Vec<Track>,
    /// The vehicle under test.
    pub ego: Ego,
    /// Tracks that the data set marks as interacting with the ego; may be empty.
    pub objects_of_interest: Vec<TrackIx>,
    /// Traffic lights.
    pub lights: Vec<Light>,
    /// Stop signs.
    pub stop_signs: Vec<StopSign>,
    /// Outlines of crosswalks, metres.
    pub crosswalks: Vec<Vec<Vec2>>,
    /// Data of a scene of SafeBench's traffic families; `None` for every other scene.
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

/// Kind of a road user.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum AgentKind {
    /// A motor vehicle.
    Vehicle,
    /// Someone on foot.
    Pedestrian,
    /// Someone on a bicycle.
    Cyclist,
    /// Barriers, cones, parked or unknown things.
    Static,
}

/// Centre of the bounding box and its motion at one sample.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Sample {
    /// Centre of the box, metres.
    pub position: Vec2,
    /// Heading, counter-clockwise from +x.
    pub heading_rad: f64,
    /// Velocity in global axes, m/s.
    pub velocity: Vec2,
}

impl Sample {
    /// Length of the velocity, m/s.
    pub fn speed_mps(&self) -> f64 {
        self.velocity.norm()
    }
}

/// A road user's recorded motion.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Track {
    /// Unique in the scene.
    pub id: String,
    /// Kind of the road user.
    pub kind: AgentKind,
    /// Length of the box, metres.
    pub length_m: f64,
    /// Width of the box, metres.
    pub width_m: f64,
    /// `steps` long; `None` where the road user was not observed.
    pub samples: Vec<Option<Sample>>,
}

impl Track {
    /// The sample at a step; `None` where it was not observed or the scene has ended.
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

/// The road: its lanes and its edges.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Road {
    /// All lanes; a [`LaneIx`] is an index into this list.
    pub lanes: Vec<Lane>,
    /// Curbs and other edges that nobody drives over.
    pub edges: Vec<Vec<Vec2>>,
}

/// Use of a lane.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LaneKind {
    /// An ordinary road.
    Street,
    /// A motorway.
    Freeway,
    /// A lane for bicycles.
    Bike,
    /// Shoulders, parking, sidewalks: drivable surface without through traffic.
    Other,
}

/// A stretch of lane in driving direction. The three lines have equal counts.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Lane {
    /// Id in the source; unique in the scene.
    pub id: String,
    /// Use of the lane.
    pub kind: LaneKind,
    /// Centre line in driving direction, metres. `[points]`
    pub centre: Vec<Vec2>,
    /// Left border, metres. `[points]`
    pub left: Vec<Vec2>,
    /// Right border, metres. `[points]`
    pub right: Vec<Vec2>,
    /// Lanes that lead into this one.
    pub entries: Vec<LaneIx>,
    /// Lanes that this one leads into.
    pub exits: Vec<LaneIx>,
    /// Lanes to the left: one where it runs beside all of this one, several where they take turns. The longest first.
    pub left_neighbours: Vec<Neighbour>,
    /// Lanes to the right, likewise.
    pub right_neighbours: Vec<Neighbour>,
    /// Speed limit where one is known, m/s.
    pub speed_limit_mps: Option<f64>,
}

/// A lane beside another one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Neighbour {
    /// Which lane.
    pub lane: LaneIx,
    /// True if its traffic drives the same way.
    pub same_direction: bool,
}

/// A traffic light over a lane.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Light {
    /// The lane that it holds for.
    pub lane: LaneIx,
    /// Point at which traffic stops, metres.
    pub stop_point: Vec2,
    /// `steps` long.
    pub states: Vec<LightState>,
}

/// State of a traffic light.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LightState {
    /// Not observed.
    Unknown,
    /// Red.
    Stop,
    /// Yellow.
    Caution,
    /// Green.
    Go,
}

/// A stop sign.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StopSign {
    /// Position of the sign, metres.
    pub position: Vec2,
    /// The lanes that it holds for.
    pub lanes: Vec<LaneIx>,
}
