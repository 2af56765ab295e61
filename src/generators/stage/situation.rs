//! All that a program may know of a scene before the rollout: built once per scene and ego, shared by every program.

use std::sync::{Arc, OnceLock};

use super::actors::{self, ActorFacts};
use super::ego_path::EgoPath;
use super::road_field::RoadField;
use crate::adapters::vocabulary;
use crate::ego;
use crate::kernel::{Digest, LruCache, OrientedBox, Vec2};
use crate::scene::{AgentKind, LaneGraph, PreparedScene, Sample, Scene, SceneFeatures, Track, TrackIx};
use crate::sim::{self, ActorRef, Intervention, Outcome, Plant, SimError, Trace};

/// Most sets of goals whose measurements a situation keeps: programs of a lineage mostly differ in how they weigh goals, not
/// in the goals.
const MEASURED_GOALS_MAX: usize = 16;

/// Key of the goals that were measured.
pub type GoalsKey = [u64; 6];

/// A scene with everything derived from it and from the ego's rollout on it as recorded.
#[derive(Debug)]
pub struct Situation {
    pub scene: Arc<Scene>,
    pub plant: Plant,
    /// Policy that drives the ego, for searches that simulate it again.
    pub policy: ego::Policy,
    pub lanes: Arc<LaneGraph>,
    /// The ego's closed-loop rollout on the unchanged scene.
    pub ego: EgoPath,
    /// The road user that the ego ran into there, if any.
    pub ego_meets: Option<ActorRef>,
    /// Per track; `None` for whoever cannot be an adversary: no vehicle, or not observed now.
    pub actors: Vec<Option<ActorFacts>>,
    /// How hard the ego braked in that rollout, m/s².
    pub ego_deceleration_mps2_max: f64,
    /// Values of `vocabulary::SCENE`, in its order.
    pub scene_values: Vec<f64>,
    /// Road users that a program may insert: vehicle, cyclist, pedestrian, never observed.
    guests: [Track; 3],
    guest_facts: ActorFacts,
    /// Measurements of goals by earlier programs, kept for later ones.
    pub measured_goals: LruCache<GoalsKey, Arc<[f64]>>,
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
    /// [`Situation::under`] the simulator's shipped options.
    pub fn new(scene: Arc<Scene>, policy: &ego::Policy) -> Result<Situation, SituationError> {
        Situation::under(PreparedScene::new(scene), policy, &sim::SimulatorOptions::SHIPPED)
    }

    /// Prepares a scene for programs that will meet this ego: simulates the ego once on the scene as recorded. The rollout is
    /// ours; [`Situation::around`] takes another one's.
    pub fn under(
        prepared: Arc<PreparedScene>,
        policy: &ego::Policy,
        simulator: &sim::SimulatorOptions,
    ) -> Result<Situation, SituationError> {
        let failed = |source| SituationError::Rollout { scene: prepared.scene.id.clone(), source };
        let plant = Plant::with_options(prepared.clone(), simulator).map_err(failed)?;
        let mut driver = policy.driver();
        let (outcome, trace) =
            sim::rollout_traced(&plant, &Intervention::default(), driver.as_mut()).map_err(failed)?;
        Ok(Situation::around(prepared.clone(), plant, policy, outcome, trace))
    }

    /// The same around an undisturbed drive of the ego that somebody else simulated. Searches that ask what the ego would do
    /// about an adversary ask `plant` and `policy`.
    pub fn around(
        prepared: Arc<PreparedScene>,
        plant: Plant,
        policy: &ego::Policy,
        outcome: Outcome,
        trace: Trace,
    ) -> Situation {
        let (scene, lanes) = (prepared.scene.clone(), prepared.lanes.clone());
        let ego = EgoPath::new(&scene, trace.from_step, trace.ego);
        let actors = (0..scene.tracks.len()).map(|track| actors::facts(&scene, &lanes, &ego, track)).collect();
        let scene_values = scene_values(&prepared.features);
        let (policy, guests, guest_facts) = (policy.clone(), guests(&scene), ActorFacts::of_guest());
        Situation {
            scene,
            plant,
            lanes,
            ego,
            ego_meets: outcome.contact.map(|contact| contact.with),
            actors,
            ego_deceleration_mps2_max: outcome.ego.deceleration_mps2_max,
            scene_values,
            policy,
            guests,
            guest_facts,
            measured_goals: LruCache::new(MEASURED_GOALS_MAX),
            road_field: OnceLock::new(),
        }
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
        let track = self.track(track);
        OrientedBox::new(sample.position, sample.heading_rad, track.length_m, track.width_m)
    }

    /// The same at a place, by the unit vector of its heading.
    pub fn body_along(&self, track: TrackIx, center: Vec2, axis: Vec2) -> OrientedBox {
        let track = self.track(track);
        OrientedBox::along(center, axis, track.length_m, track.width_m)
    }

    /// Index of the road user that a program may insert: beyond the scene's own tracks.
    pub fn guest(&self, kind: AgentKind) -> TrackIx {
        let place = self.guests.iter().position(|guest| guest.kind == kind).unwrap_or(0);
        self.scene.tracks.len() + place
    }

    /// The inserted road user of an index; `None` for the scene's own tracks.
    pub fn as_guest(&self, track: TrackIx) -> Option<&Track> {
        self.guests.get(track.checked_sub(self.scene.tracks.len())?)
    }

    /// A track of the scene, or a road user that may be inserted.
    pub fn track(&self, track: TrackIx) -> &Track {
        self.as_guest(track).unwrap_or_else(|| &self.scene.tracks[track])
    }

    /// Facts of an adversary; an inserted one has none, so that each of them says "never" or "far away".
    pub fn facts(&self, track: TrackIx) -> Option<&ActorFacts> {
        if self.as_guest(track).is_some() { Some(&self.guest_facts) } else { self.actors.get(track)?.as_ref() }
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

/// Values of `vocabulary::SCENE` in its order: what conditions of a policy read.
pub fn scene_values(features: &SceneFeatures) -> Vec<f64> {
    vocabulary::SCENE.iter().map(|feature| features.value(feature.name).unwrap_or(0.0)).collect()
}

/// A vehicle of the ego's size, a cyclist, a pedestrian.
fn guests(scene: &Scene) -> [Track; 3] {
    let (length_m, width_m) = (scene.ego.track.length_m, scene.ego.track.width_m);
    let guest = |kind, length_m, width_m| Track { id: "inserted".into(), kind, length_m, width_m, samples: vec![] };
    [
        guest(AgentKind::Vehicle, length_m, width_m),
        guest(AgentKind::Cyclist, 1.8, 0.7),
        guest(AgentKind::Pedestrian, 0.6, 0.6),
    ]
}
