//! The record of one rollout and the key that it is kept under.

use std::sync::Arc;

use serde::{Deserialize, Serialize, de::DeserializeOwned};
use serde_json::value::RawValue;

use crate::adapters::ADAPTER_VERSION;
use crate::kernel::{Digest, Seed, canon::CanonError};
use crate::sim::{ActorRef, Outcome, SIM_VERSION};

/// Stored result of one rollout of one program in one scene.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RolloutRecord {
    /// The scene's name.
    pub scene: String,
    /// Digest of the scene's content.
    pub scene_digest: Digest,
    /// The program's hash.
    pub program: Digest,
    /// The driver's name.
    pub ego: String,
    /// True if the program intervened; where it did not, the outcome is plain replay.
    pub intervened: bool,
    /// The road user that the ego runs into in plain replay: the program did not cause a contact with it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub meets_anyway: Option<ActorRef>,
    /// The scene-level decision ω in the compiler's words, for people and audits.
    pub decision: Written,
    /// Outcome of the rollout.
    pub outcome: Outcome,
}

impl RolloutRecord {
    /// Returns the number of scenarios simulated against the ego before this one was chosen; `None` for a record that does not tell.
    pub fn search_rollouts(&self) -> Option<u32> {
        #[derive(Deserialize)]
        struct Told {
            search_rollouts: Option<u32>,
        }
        self.decision.read::<Told>().ok()?.search_rollouts
    }
}

/// A JSON value as the text that was written: a run holds a hundred thousand of them and reads hardly any.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Written(Box<RawValue>);

impl Written {
    /// # Errors
    /// A value that cannot be JSON: a map whose keys are not texts.
    pub fn of(value: &impl Serialize) -> Result<Written, serde_json::Error> {
        serde_json::value::to_raw_value(value).map(Written)
    }

    /// Reads it.
    pub fn read<T: DeserializeOwned>(&self) -> Result<T, serde_json::Error> {
        serde_json::from_str(self.0.get())
    }
}

/// Key of a rollout request. It needs neither the scene's content nor a compilation. `simulator` is the digest of the
/// simulator's options; `counsel` is that of the counsel with which the program is compiled, where its family takes any.
pub fn request_key(
    program: Digest,
    scene: Digest,
    ego: Digest,
    simulator: Digest,
    seed: Seed,
    counsel: Option<Digest>,
) -> Result<Digest, CanonError> {
    let request = (SIM_VERSION, ADAPTER_VERSION, program, scene, ego, simulator, seed);
    match counsel {
        None => Digest::of("evodrive/rollout-request/3", &request),
        Some(counsel) => Digest::of("evodrive/counselled-rollout-request/3", &(request, counsel)),
    }
}

/// Store of records between runs. Called from many threads.
pub trait RolloutCache: Sync {
    /// Returns the record of a request and the digest it is stored under. A cache that wants everything simulated again
    /// (verify) returns none.
    fn recorded(&self, key: &Digest) -> Result<Option<(Arc<RolloutRecord>, Digest)>, CacheError>;

    /// Keeps a record; one that differs from an earlier record of the same request is a divergence.
    fn keep(&self, key: &Digest, record: &RolloutRecord) -> Result<Digest, CacheError>;
}

/// The cache cannot be trusted or used.
#[derive(Debug, thiserror::Error)]
pub enum CacheError {
    /// Error of the store; `evaluation` does not know stores.
    #[error(transparent)]
    Store(Box<dyn std::error::Error + Send + Sync>),
    /// The record stored under a request cannot be read.
    #[error("stored rollout {key} is damaged: {reason}; run `evodrive fsck --read`")]
    Damaged {
        /// Key of the rollout's request.
        key: Digest,
        /// Fault of the bytes.
        reason: String,
    },
    /// A request that was recorded before has another outcome now.
    #[error(
        "rollout {key} of scene {scene} came out differently than recorded: {difference}; if the simulator, the \
         compiler or a family was changed, raise its version and record again"
    )]
    Diverged {
        /// Key of the rollout's request.
        key: Digest,
        /// The scene's name.
        scene: String,
        /// The first place at which both differ.
        difference: String,
    },
}
