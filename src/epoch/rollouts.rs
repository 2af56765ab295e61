//! Rollout records over the store: the memo that makes a label cost a look-up the second time.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use serde::{Deserialize, Serialize, de::DeserializeOwned};

use crate::evaluation::{CacheError, RolloutCache, RolloutRecord};
use crate::kernel::Digest;
use crate::store::{MemoKind, Store, StoreError, first_difference};

/// Where labels come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// A rollout whose record is at hand is not simulated again.
    Reuse,
    /// Every rollout is simulated again and compared with its record, where there is one.
    Verify,
}

/// What the compile gate's trial of one program on one scene left behind.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrialRecord {
    pub program: Digest,
    pub scene: String,
    pub scene_digest: Digest,
    pub ego: String,
    /// What the compiler could not lower; `None` where it compiles.
    pub failure: Option<String>,
}

/// The store's rollouts, and the compile gate's trials.
pub struct Rollouts<'a> {
    store: &'a Store,
    mode: Mode,
    desk: Mutex<Seen>,
}

/// What this run met so far.
#[derive(Default)]
struct Seen {
    records: BTreeMap<Digest, (Arc<RolloutRecord>, Digest)>,
    reused: usize,
    simulated: usize,
    trials: BTreeMap<Digest, TrialRecord>,
}

impl<'a> Rollouts<'a> {
    pub fn new(store: &'a Store, mode: Mode) -> Rollouts<'a> {
        Rollouts { store, mode, desk: Mutex::new(Seen::default()) }
    }

    /// Makes every record kept so far survive a power cut.
    pub fn flush(&self) -> Result<(), StoreError> {
        self.store.flush()
    }

    /// Distinct rollouts that the run rested on so far.
    pub fn distinct(&self) -> usize {
        self.seen().records.len()
    }

    /// Whether a record is at hand. Looking does not count as resting on it.
    pub fn has(&self, key: &Digest) -> bool {
        self.mode == Mode::Reuse && self.store.memo_get(MemoKind::Rollout, key).is_some()
    }

    /// How many of them were read from the store, and how many simulated.
    pub fn counts(&self) -> (usize, usize) {
        let seen = self.seen();
        (seen.reused, seen.simulated)
    }

    /// The record of a trial, if there is one to rely on.
    pub fn tried(&self, key: &Digest) -> Result<Option<TrialRecord>, CacheError> {
        if let Some(found) = self.seen().trials.get(key) {
            return Ok(Some(found.clone()));
        }
        if self.mode == Mode::Verify {
            return Ok(None);
        }
        let found = self.stored_trial(key)?;
        if let Some(trial) = &found {
            self.seen().trials.insert(*key, trial.clone());
        }
        Ok(found)
    }

    /// Keeps a trial; one that differs from an earlier record of the same request is a divergence.
    pub fn keep_trial(&self, key: &Digest, trial: TrialRecord) -> Result<(), CacheError> {
        match self.stored_trial(key)? {
            Some(before) if before == trial => {}
            Some(before) => return Err(diverged(key, &trial.scene, &before, &trial)),
            None => {
                let bytes = serde_json::to_vec(&trial).map_err(|error| CacheError::Store(Box::new(error)))?;
                let object = self.store.put(&bytes).map_err(from_store)?;
                self.store.memo_put(MemoKind::Compile, key, &object).map_err(from_store)?;
            }
        }
        self.seen().trials.insert(*key, trial);
        Ok(())
    }

    fn stored_trial(&self, key: &Digest) -> Result<Option<TrialRecord>, CacheError> {
        self.stored_as(MemoKind::Compile, key).map(|found| found.map(|(trial, _)| trial))
    }

    fn seen(&self) -> MutexGuard<'_, Seen> {
        self.desk.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn stored(&self, key: &Digest) -> Result<Option<(Arc<RolloutRecord>, Digest)>, CacheError> {
        let found = self.stored_as(MemoKind::Rollout, key)?;
        Ok(found.map(|(record, object)| (Arc::new(record), object)))
    }

    fn stored_as<T: DeserializeOwned>(&self, kind: MemoKind, key: &Digest) -> Result<Option<(T, Digest)>, CacheError> {
        let Some(object) = self.store.memo_get(kind, key) else { return Ok(None) };
        let bytes = self.store.get(&object).map_err(from_store)?;
        let record = serde_json::from_slice(&bytes)
            .map_err(|error| CacheError::Damaged { key: *key, reason: error.to_string() })?;
        Ok(Some((record, object)))
    }
}

impl RolloutCache for Rollouts<'_> {
    fn recorded(&self, key: &Digest) -> Result<Option<(Arc<RolloutRecord>, Digest)>, CacheError> {
        if let Some(found) = self.seen().records.get(key) {
            return Ok(Some(found.clone()));
        }
        if self.mode == Mode::Verify {
            return Ok(None);
        }
        let found = self.stored(key)?;
        if let Some(found) = &found {
            let mut seen = self.seen();
            if seen.records.insert(*key, found.clone()).is_none() {
                seen.reused += 1;
            }
        }
        Ok(found)
    }

    fn keep(&self, key: &Digest, record: &RolloutRecord) -> Result<Digest, CacheError> {
        let bytes = record_bytes(record).map_err(|error| CacheError::Store(Box::new(error)))?;
        if let Some((before, stored)) = self.stored(key)?
            && Digest::of_bytes(&bytes) != stored
        {
            return Err(diverged(key, &record.scene, &*before, record));
        }
        let object = self.store.put(&bytes).map_err(from_store)?;
        self.store.memo_put(MemoKind::Rollout, key, &object).map_err(from_store)?;
        let mut seen = self.seen();
        if seen.records.insert(*key, (Arc::new(record.clone()), object)).is_none() {
            seen.simulated += 1;
        }
        Ok(object)
    }
}

/// The bytes of a record as the store keeps them.
fn record_bytes(record: &RolloutRecord) -> Result<Vec<u8>, serde_json::Error> {
    serde_json::to_vec(record)
}

/// The digest under which the store keeps a record.
///
/// # Errors
/// None for a record that came from a rollout: its numbers are finite and its keys are texts.
pub fn record_digest(record: &RolloutRecord) -> Result<Digest, serde_json::Error> {
    Ok(Digest::of_bytes(&record_bytes(record)?))
}

fn from_store(error: StoreError) -> CacheError {
    CacheError::Store(Box::new(error))
}

fn diverged<T: Serialize>(key: &Digest, scene: &str, before: &T, now: &T) -> CacheError {
    let value = |record: &T| serde_json::to_value(record).unwrap_or_default();
    let (field, recorded, computed) = first_difference("", &value(before), &value(now));
    let difference = format!("at {field}: recorded {recorded}, computed {computed}");
    CacheError::Diverged { key: *key, scene: scene.to_string(), difference }
}
