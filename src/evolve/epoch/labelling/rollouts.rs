//! Rollout records over the store: the memo that makes a label cost a look-up the second time.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use serde::{Deserialize, Serialize, de::DeserializeOwned};

use crate::evaluation::{CacheError, RolloutCache, RolloutRecord};
use crate::kernel::{Digest, LruCache, canon::CanonError};
use crate::objects::Probe;
use crate::store::{MemoKind, Store, StoreError, first_difference};

/// Source of labels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// A rollout whose record is at hand is not simulated again.
    Reuse,
    /// Every rollout is simulated again and compared with its record, where there is one.
    Verify,
}

/// Number of rollouts that were read from the store, and of those that were simulated.
#[derive(Clone, Copy, Debug)]
pub struct RolloutCounts {
    pub reused: usize,
    pub simulated: usize,
}

/// Record of the compile gate's trial of one program on one scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrialRecord {
    pub program: Digest,
    pub scene: String,
    pub scene_digest: Digest,
    pub ego: String,
    /// Part that the compiler could not lower; `None` where it compiles.
    pub failure: Option<String>,
    /// Digest of the compiled intervention; `None` where there is none.
    pub intervention: Option<Digest>,
    /// Probe of the intervention, which needs no rollout.
    pub probe: Option<Probe>,
}

/// The store's rollouts, and the compile gate's trials.
pub struct Rollouts<'a> {
    store: &'a Store,
    mode: Mode,
    seen: Mutex<Seen>,
    records: Latest<RolloutRecord>,
    trials: Latest<TrialRecord>,
}

/// The digest that a record is stored under, by the key of its request.
type Met = BTreeMap<Digest, Digest>;

/// Records that were read or made last, by the digest that they are stored under. All of them together would be what a long run
/// needs most of its memory for.
type Latest<T> = LruCache<Digest, Option<Arc<T>>>;

/// Most rollout records that are kept to be asked for again: a lineage's front on all its windows.
const RECORDS_MAX: usize = 16_384;

/// Most trial records.
const TRIALS_MAX: usize = 16_384;

/// Records that this run met so far.
#[derive(Default)]
struct Seen {
    records: Met,
    reused: usize,
    simulated: usize,
    trials: Met,
}

/// A kind of record that the store keeps as a memo of its request.
trait Memoed: Serialize + DeserializeOwned {
    const KIND: MemoKind;

    fn met(seen: &mut Seen) -> &mut Met;

    fn latest<'r>(rollouts: &'r Rollouts<'_>) -> &'r Latest<Self>;

    /// The scene it is about, for people.
    fn scene(&self) -> &str;
}

impl Memoed for RolloutRecord {
    const KIND: MemoKind = MemoKind::Rollout;

    fn met(seen: &mut Seen) -> &mut Met {
        &mut seen.records
    }

    fn latest<'r>(rollouts: &'r Rollouts<'_>) -> &'r Latest<RolloutRecord> {
        &rollouts.records
    }

    fn scene(&self) -> &str {
        &self.scene
    }
}

impl Memoed for TrialRecord {
    const KIND: MemoKind = MemoKind::Compile;

    fn met(seen: &mut Seen) -> &mut Met {
        &mut seen.trials
    }

    fn latest<'r>(rollouts: &'r Rollouts<'_>) -> &'r Latest<TrialRecord> {
        &rollouts.trials
    }

    fn scene(&self) -> &str {
        &self.scene
    }
}

impl<'a> Rollouts<'a> {
    pub fn new(store: &'a Store, mode: Mode) -> Rollouts<'a> {
        let (records, trials) = (LruCache::new(RECORDS_MAX), LruCache::new(TRIALS_MAX));
        Rollouts { store, mode, seen: Mutex::new(Seen::default()), records, trials }
    }

    /// The same store under a count of its own: for rollouts on which no label rests.
    pub fn beside(&self) -> Rollouts<'a> {
        Rollouts::new(self.store, self.mode)
    }

    /// Makes every record kept so far survive a power cut.
    pub fn flush(&self) -> Result<(), StoreError> {
        self.store.flush()
    }

    /// Distinct rollouts that the run rested on so far.
    pub fn distinct(&self) -> usize {
        self.seen().records.len()
    }

    /// Returns how they came about.
    pub fn counts(&self) -> RolloutCounts {
        let seen = self.seen();
        RolloutCounts { reused: seen.reused, simulated: seen.simulated }
    }

    /// Returns `true` if a request has a record in the store. The record is not read.
    pub fn has(&self, kind: MemoKind, key: &Digest) -> bool {
        self.store.memo_get(kind, key).is_some()
    }

    /// Why an earlier attempt at this rollout gave no label, where shards noted that.
    pub fn no_label(&self, key: &Digest) -> Result<Option<String>, CacheError> {
        let note = no_label_key(key).map_err(|error| CacheError::Store(Box::new(error)))?;
        let Some(object) = self.store.memo_get(MemoKind::Rollout, &note) else { return Ok(None) };
        let reason = self.store.get(&object).map_err(from_store)?;
        Ok(Some(String::from_utf8_lossy(&reason).into_owned()))
    }

    /// The record of a trial, if there is one to rely on.
    pub fn tried(&self, key: &Digest) -> Result<Option<Arc<TrialRecord>>, CacheError> {
        Ok(self.at_hand(key)?.map(|(trial, _, _)| trial))
    }

    /// Keeps a trial; one that differs from an earlier record of the same request is a divergence.
    pub fn keep_trial(&self, key: &Digest, trial: TrialRecord) -> Result<(), CacheError> {
        self.keep_new(key, trial).map(drop)
    }

    /// A record to rely on, and whether this run meets it for the first time. A run that verifies relies on its own only.
    fn at_hand<T: Memoed>(&self, key: &Digest) -> Result<Option<(Arc<T>, Digest, bool)>, CacheError> {
        let met = T::met(&mut self.seen()).get(key).copied();
        if met.is_none() && self.mode == Mode::Verify {
            return Ok(None);
        }
        let Some(object) = met.or_else(|| self.store.memo_get(T::KIND, key)) else { return Ok(None) };
        // What cannot be read is read again for its error.
        let record = match T::latest(self).of(object, || self.stored(key, &object).ok()) {
            Some(record) => record,
            None => self.stored(key, &object)?,
        };
        let new = T::met(&mut self.seen()).insert(*key, object).is_none();
        Ok(Some((record, object, new)))
    }

    /// Stores a record that this run made, and says whether it is the first of its request.
    fn keep_new<T: Memoed>(&self, key: &Digest, record: T) -> Result<(Digest, bool), CacheError> {
        let bytes = serde_json::to_vec(&record).map_err(|error| CacheError::Store(Box::new(error)))?;
        if let Some(stored) = self.store.memo_get(T::KIND, key)
            && Digest::of_bytes(&bytes) != stored
        {
            return Err(diverged(key, &*self.stored::<T>(key, &stored)?, &record));
        }
        let object = self.store.put(&bytes).map_err(from_store)?;
        self.store.memo_put(T::KIND, key, &object).map_err(from_store)?;
        T::latest(self).of(object, || Some(Arc::new(record)));
        let new = T::met(&mut self.seen()).insert(*key, object).is_none();
        Ok((object, new))
    }

    /// The record of a request that is stored under this digest.
    fn stored<T: Memoed>(&self, key: &Digest, object: &Digest) -> Result<Arc<T>, CacheError> {
        let bytes = self.store.get(object).map_err(from_store)?;
        let record = serde_json::from_slice(&bytes);
        record.map(Arc::new).map_err(|error| CacheError::Damaged { key: *key, reason: error.to_string() })
    }

    fn seen(&self) -> MutexGuard<'_, Seen> {
        self.seen.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl RolloutCache for Rollouts<'_> {
    fn recorded(&self, key: &Digest) -> Result<Option<(Arc<RolloutRecord>, Digest)>, CacheError> {
        Ok(self.at_hand(key)?.map(|(record, object, new)| {
            self.seen().reused += usize::from(new);
            (record, object)
        }))
    }

    fn keep(&self, key: &Digest, record: &RolloutRecord) -> Result<Digest, CacheError> {
        let (object, new) = self.keep_new(key, record.clone())?;
        self.seen().simulated += usize::from(new);
        Ok(object)
    }
}

/// The key under which it is noted why a rollout request has no label. Runs do not read it.
pub fn no_label_key(request: &Digest) -> Result<Digest, CanonError> {
    Digest::of("evodrive/no-label/1", request)
}

/// The digest under which the store keeps a record.
///
/// # Errors
/// None for a record that came from a rollout: its numbers are finite and its keys are texts.
pub fn record_digest(record: &RolloutRecord) -> Result<Digest, serde_json::Error> {
    Ok(Digest::of_bytes(&serde_json::to_vec(record)?))
}

fn from_store(error: StoreError) -> CacheError {
    CacheError::Store(Box::new(error))
}

fn diverged<T: Memoed>(key: &Digest, before: &T, now: &T) -> CacheError {
    let value = |record: &T| serde_json::to_value(record).unwrap_or_default();
    let (field, recorded, computed) = first_difference("", &value(before), &value(now));
    let difference = format!("at {field}: recorded {recorded}, computed {computed}");
    CacheError::Diverged { key: *key, scene: now.scene().to_string(), difference }
}
