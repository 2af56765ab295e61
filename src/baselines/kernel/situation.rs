//! All that a program may know of a scene before the rollout: built once per scene and ego, shared by every program.

use std::sync::{Arc, OnceLock};

use super::actors::{self, ActorFacts};
use super::road_field::RoadField;
use crate::adapters::vocabulary;
use crate::ego;
use crate::kernel::{Digest, OrientedBox};
use crate::scene::{AgentKind, LaneGraph, Sample, Scene, SceneFeatures, TrackIx};
use crate::sim::{self, Intervention, Plant, SimError};

/// A scene with everything derived from it and from the ego's rollout on it as recorded.
#[derive(Debug)]
pub struct Situation {
    pub scene: Arc<Scene>,
    pub plant: Plant,
    /// Who drives the ego, for searches that simulate it again.
    pub policy: ego::Policy,
    pub lanes: LaneGraph,
    pub features: SceneFeatures,
    /// The ego's latest closed-loop rollout: on the unchanged scene.
    pub ego: EgoPath,
    /// Per track; `None` for whoever cannot be an adversary: no vehicle, or not observed now.
    pub actors: Vec<Option<ActorFacts>>,
    /// Values of `vocabulary::SCENE`, in its order.
    pub scene_values: Vec<f64>,
    /// Built on first use: few families need it.
    road_field: OnceLock<Option<RoadField>>,
}

/// Why a scene cannot be prepared.
#[derive(Debug, thiserror::Error)]
pub enum SituationError {
    #[error("scene {scene}: the ego's rollout on the recorded scene failed: {source}")]
    Rollout { scene: String, source: SimError },
}

impl Situation {
    /// Prepares a scene for programs that will meet this ego: simulates the ego once on the scene as recorded.
    pub fn new(scene: Arc<Scene>, policy: &ego::Policy) -> Result<Situation, SituationError> {
        let failed = |source| SituationError::Rollout { scene: scene.id.clone(), source };
        let plant = Plant::new(&scene).map_err(failed)?;
        let mut driver = policy.driver();
        let (_, trace) = sim::rollout_traced(&plant, &Intervention::default(), driver.as_mut()).map_err(failed)?;
        let ego = EgoPath::new(&scene, trace.from_step, trace.ego);
        let lanes = LaneGraph::of(&scene.road);
        let features = SceneFeatures::of(&scene, &lanes);
        let actors = (0..scene.tracks.len()).map(|track| actors::facts(&scene, &lanes, &ego, track)).collect();
        let scene_values = vocabulary::SCENE.iter().map(|f| features.value(f.name).unwrap_or(0.0)).collect();
        let (policy, road_field) = (policy.clone(), OnceLock::new());
        Ok(Situation { scene, plant, policy, lanes, features, ego, actors, scene_values, road_field })
    }

    /// Signed distances to the road's edge; `None` for a road without lanes.
    pub fn road_field(&self) -> Option<&RoadField> {
        self.road_field.get_or_init(|| RoadField::of(&self.scene, &self.lanes)).as_ref()
    }

    /// Identity of the scene for logs and random streams.
    pub fn scene_id(&self) -> &str {
        &self.scene.id
    }

    /// First step that a program may change.
    pub fn first_step(&self) -> usize {
        self.scene.current_step.max(self.scene.ego.start_step) + 1
    }

    /// Bounding box of a track at a sample.
    pub fn body(&self, track: TrackIx, sample: &Sample) -> OrientedBox {
        let track = &self.scene.tracks[track];
        OrientedBox::new(sample.position, sample.heading_rad, track.length_m, track.width_m)
    }

    /// Vehicles marked as interacting with the ego that can be adversaries, in the data set's order.
    pub fn marked(&self) -> impl Iterator<Item = TrackIx> + '_ {
        let fits = |track: &TrackIx| {
            self.actors.get(*track).is_some_and(Option::is_some) && self.scene.tracks[*track].kind == AgentKind::Vehicle
        };
        self.scene.objects_of_interest.iter().copied().filter(fits)
    }

    /// Digest of the simulated content, part of rollout keys.
    pub fn digest(&self) -> Digest {
        self.plant.digest()
    }
}

/// The ego's motion by scene step, with its size.
#[derive(Clone, Debug)]
pub struct EgoPath {
    from_step: usize,
    samples: Vec<Sample>,
    boxes: Vec<OrientedBox>,
    pub length_m: f64,
    pub width_m: f64,
}

impl EgoPath {
    /// `samples[k]` lies at scene step `from_step + k`.
    pub fn new(scene: &Scene, from_step: usize, samples: Vec<Sample>) -> EgoPath {
        let (length_m, width_m) = (scene.ego.track.length_m, scene.ego.track.width_m);
        let boxes = samples.iter().map(|s| OrientedBox::new(s.position, s.heading_rad, length_m, width_m)).collect();
        EgoPath { from_step, samples, boxes, length_m, width_m }
    }

    /// Where the ego was at a scene step; `None` before its start and after its rollout ended.
    pub fn at(&self, step: usize) -> Option<&Sample> {
        self.samples.get(step.checked_sub(self.from_step)?)
    }

    /// Its bounding box at a scene step.
    pub fn body(&self, step: usize) -> Option<&OrientedBox> {
        self.boxes.get(step.checked_sub(self.from_step)?)
    }

    /// The steps at which it is known.
    pub fn steps(&self) -> std::ops::Range<usize> {
        self.from_step..self.from_step + self.samples.len()
    }
}
