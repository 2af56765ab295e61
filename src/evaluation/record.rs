//! What identifies a rollout, and what is kept of it.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};

use crate::adapters::ADAPTER_VERSION;
use crate::compiler::Decision;
use crate::ego;
use crate::kernel::canon::CanonError;
use crate::kernel::{Digest, Seed};
use crate::sim::{Outcome, SIM_VERSION};

/// Everything that a rollout's outcome depends on. Known before anything is compiled, so that a recorded rollout costs
/// neither a compilation nor a prepared scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RolloutRequest {
    pub sim_version: u32,
    pub adapter_version: u32,
    pub program: Digest,
    pub scene: Digest,
    /// Random streams of the compilation are named by the scene's id.
    pub scene_id: String,
    pub ego: Digest,
    pub seed: Seed,
}

impl RolloutRequest {
    pub fn new(program: Digest, scene_id: &str, scene: Digest, policy: &ego::Policy, seed: Seed) -> RolloutRequest {
        RolloutRequest {
            sim_version: SIM_VERSION,
            adapter_version: ADAPTER_VERSION,
            program,
            scene,
            scene_id: scene_id.to_string(),
            ego: policy.digest(),
            seed,
        }
    }

    /// The key under which its record is kept.
    pub fn key(&self) -> Result<Digest, CanonError> {
        Digest::of("evodrive/rollout-request/1", self)
    }
}

/// A rollout with what led to it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RolloutRecord {
    pub request: RolloutRequest,
    pub result: RolloutResult,
}

/// How it ended. A failure is recorded too: it is as deterministic as an outcome.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RolloutResult {
    Labelled {
        decision: Decision,
        outcome: Box<Outcome>,
    },
    /// The program could not be compiled for the scene, or the simulator refused it.
    Failed {
        reason: String,
    },
}

/// A cache that cannot read or write.
#[derive(Debug, thiserror::Error)]
#[error("rollout {key}: {source}")]
pub struct CacheError {
    pub key: Digest,
    pub source: Box<dyn std::error::Error + Send + Sync>,
}

/// Where rollout records are kept. `get` of an unknown key is `None`; `put` gives the digest of the stored record.
pub trait RolloutCache: Sync {
    fn get(&self, key: &Digest) -> Result<Option<(RolloutRecord, Digest)>, CacheError>;
    fn put(&self, key: &Digest, record: &RolloutRecord) -> Result<Digest, CacheError>;
}

/// Records in memory, for tests and one-off evaluations.
#[derive(Debug, Default)]
pub struct MemoryCache(Mutex<BTreeMap<Digest, (RolloutRecord, Digest)>>);

impl MemoryCache {
    pub fn len(&self) -> usize {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).len()
    }

    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

impl RolloutCache for MemoryCache {
    fn get(&self, key: &Digest) -> Result<Option<(RolloutRecord, Digest)>, CacheError> {
        Ok(self.0.lock().unwrap_or_else(PoisonError::into_inner).get(key).cloned())
    }

    fn put(&self, key: &Digest, record: &RolloutRecord) -> Result<Digest, CacheError> {
        let failed = |e: CanonError| CacheError { key: *key, source: Box::new(e) };
        let digest = Digest::of("evodrive/rollout-record/1", record).map_err(failed)?;
        self.0.lock().unwrap_or_else(PoisonError::into_inner).insert(*key, (record.clone(), digest));
        Ok(digest)
    }
}
