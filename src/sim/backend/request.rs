//! A request to a worker: a scene, the commands of its adversaries, an ego. One JSON line.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::answer::Answer;
use super::error::BackendError;
use super::spec::BackendOptions;
use super::under::{DriveContext, ProgramContext};
use crate::ego::Policy;
use crate::kernel::{Digest, Seed, canon::CanonError};
use crate::scene::{AgentKind, Sample, Scene};
use crate::sim::{Action, ActorRef, Intervention, Plant, adversaries_of, commands};

/// Version of the lines.
pub const PROTOCOL: u32 = 1;

/// A rollout that is asked for. Its interventions are samples alone.
pub struct Request<'a> {
    pub key: Digest,
    pub plant: &'a Plant,
    pub intervention: &'a Intervention,
    pub ego: &'a str,
    /// True if the ego repeats its recording.
    pub replays: bool,
    pub(super) seed: Seed,
    /// The program under which it drives, for planners that are told.
    pub(super) under: Option<ProgramContext>,
    options: &'a BTreeMap<String, Value>,
}

/// A source of answers to requests. Called from many threads.
pub trait Answers: Sync {
    fn answer(&self, request: &Request<'_>) -> Result<Answer, BackendError>;

    /// Says how many answers were compared with a second one; `None` if none are compared.
    fn compared(&self) -> Option<String> {
        None
    }
}

#[derive(Serialize)]
struct RequestLine<'a> {
    request: Digest,
    scene: &'a Scene,
    /// Step of the scene at which the closed loop begins, and most decision steps that follow.
    first_step: usize,
    steps: usize,
    ego: &'a str,
    seed: u64,
    adversaries: Vec<Commanded>,
    options: &'a BTreeMap<String, Value>,
}

/// An adversary's motion, with one sample for each simulated step from the first on.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Commanded {
    pub who: ActorRef,
    pub kind: AgentKind,
    pub length_m: f64,
    pub width_m: f64,
    pub samples: Vec<Option<Sample>>,
}

impl<'a> Request<'a> {
    /// Creates a request. `intervention` has been lowered to samples.
    pub fn new(
        backend: &'a BackendOptions,
        plant: &'a Plant,
        intervention: &'a Intervention,
        ego: &'a Policy,
        DriveContext { seed, under }: DriveContext,
    ) -> Result<Request<'a>, CanonError> {
        let asked = (plant.scene().digest(), ego.digest(), seed, intervention);
        // Programs that command the same motion share a rollout, unless the driver is told which of them it is.
        let under = (!backend.is_blind()).then_some(under);
        let key = match under {
            None => Digest::of("evodrive/backend-request/1", &(PROTOCOL, backend.key()?, asked))?,
            Some(under) => Digest::of("evodrive/backend-request/2", &(PROTOCOL, backend.key()?, asked, under))?,
        };
        let replays = ego.driver().follows_log();
        Ok(Request { key, plant, intervention, ego: ego.name(), replays, seed, under, options: &backend.options })
    }

    /// Returns the scene's id, for messages.
    pub fn scene(&self) -> &str {
        self.plant.scene_id()
    }

    /// Returns the line that a worker reads, without its end.
    pub fn line(&self) -> String {
        let scene = self.plant.scene();
        let who = adversaries_of(self.intervention).into_iter();
        let samples = commands(self.plant, self.intervention).into_iter();
        let commanded = |((action, who), samples): ((&Action, ActorRef), Vec<Option<Sample>>)| {
            let (kind, length_m, width_m) = match (action, who) {
                (Action::Insert { kind, length_m, width_m, .. }, _) => (*kind, *length_m, *width_m),
                (Action::Triggered(script), _) => (script.kind, script.length_m, script.width_m),
                (
                    Action::Follow { track, .. }
                    | Action::FollowThenReact { track, .. }
                    | Action::FollowThenObey { track, .. },
                    _,
                ) => {
                    let track = &scene.tracks[*track];
                    (track.kind, track.length_m, track.width_m)
                }
            };
            Commanded { who, kind, length_m, width_m, samples }
        };
        let line = RequestLine {
            request: self.key,
            scene,
            first_step: self.plant.first_step(),
            steps: self.plant.steps(),
            ego: self.ego,
            seed: self.seed.0,
            adversaries: self.intervention.actions.iter().zip(who).zip(samples).map(commanded).collect(),
            options: self.options,
        };
        match serde_json::to_string(&line) {
            Ok(line) => line,
            Err(error) => unreachable!("texts, lists and finite numbers under text keys: {error}"),
        }
    }
}
