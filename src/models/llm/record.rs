//! The recorder between a run and its models: it answers recorded requests, asks the models the others, and keeps every
//! answer.

use std::{
    collections::BTreeMap,
    sync::{Mutex, MutexGuard},
};

use super::{
    Ask, AskError, Cassette, CassetteError, Completion, DraftJudge, DrawSlot, Metadata, Miss, Model, ModelError,
    ModelSpec, Reply, Request, replay::key_of, reply, unwrap,
};
use crate::{
    kernel::Digest,
    store::{MemoKind, Store, StoreError},
};

/// Which answers count as recorded.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum RecordMode {
    /// All answers in the cassette or in the store's memo.
    Missing,
    /// Only answers that this same recording got before it was killed. `recording` names it, e.g. by its run folder; a
    /// new name asks everything anew.
    Fresh {
        /// Name of the recording.
        recording: String,
    },
}

/// Records a run. Answers go to the store before they are used, so that a killed recording does not ask twice.
pub struct Record<'a> {
    store: &'a Store,
    cassette: Cassette,
    mode: RecordMode,
    /// By the name that a request's `ModelSpec` has.
    models: BTreeMap<String, Box<dyn Model + 'a>>,
    collected: Mutex<BTreeMap<(DrawSlot, Digest), Collected>>,
    /// Number of replies of a model that were refused in one way.
    refused: Mutex<BTreeMap<(String, &'static str), usize>>,
    tell: &'a (dyn Fn(&str) + Sync),
}

/// After so many refusals of one kind it is told what to set.
const REFUSALS: usize = 3;

/// An exchange of this recording.
#[derive(Clone)]
struct Collected {
    request: Request,
    response: Digest,
    metadata: Option<Metadata>,
}

impl<'a> Record<'a> {
    /// `cassette` holds what was recorded before; it may be empty.
    pub fn new(
        store: &'a Store,
        cassette: Cassette,
        mode: RecordMode,
        models: BTreeMap<String, Box<dyn Model + 'a>>,
    ) -> Record<'a> {
        let (collected, refused) = (Mutex::default(), Mutex::default());
        Record { store, cassette, mode, models, collected, refused, tell: &|_| {} }
    }

    /// The same, which tells what to set where a model's replies cannot be read again and again.
    pub fn telling(self, tell: &'a (dyn Fn(&str) + Sync)) -> Record<'a> {
        Record { tell, ..self }
    }

    /// Counts a reply that cannot be read.
    fn look_at(&self, model: &ModelSpec, bytes: &[u8]) {
        let Err(refusal) = reply::json_object(model.opened(bytes).0) else { return };
        let Some((kind, remedy)) = unwrap::remedy(model, bytes, &refusal) else { return };
        let mut refused = self.refused.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        let count = refused.entry((model.name.clone(), kind)).or_default();
        *count += 1;
        if *count == REFUSALS {
            (self.tell)(&format!(
                "warning: {REFUSALS} replies of models.{} could not be read for the same reason ({kind}): {remedy}",
                model.name
            ));
        }
    }

    /// Returns what was asked and answered, in the given order of draw slots and then, for slots not named there,
    /// in slot order: the cassette is the same for any order of threads.
    pub fn into_cassette(self, name: &str, order: &[DrawSlot]) -> Result<Cassette, CassetteError> {
        let collected = std::mem::take(&mut *self.collected());
        self.cassette_of(collected, name, order)
    }

    /// Returns what was asked and answered so far, in slot order.
    pub fn to_cassette(&self, name: &str) -> Result<Cassette, CassetteError> {
        let collected = self.collected().clone();
        self.cassette_of(collected, name, &[])
    }

    fn collected(&self) -> MutexGuard<'_, BTreeMap<(DrawSlot, Digest), Collected>> {
        self.collected.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
    }

    fn cassette_of(
        &self,
        mut collected: BTreeMap<(DrawSlot, Digest), Collected>,
        name: &str,
        order: &[DrawSlot],
    ) -> Result<Cassette, CassetteError> {
        let seals = self.seals_metadata();
        let mut ordered = Vec::new();
        for slot in order {
            let first = (slot.clone(), Digest::from_array([0; 32]));
            let last = (slot.clone(), Digest::from_array([255; 32]));
            let keys: Vec<_> = collected.range(first..=last).map(|(key, _)| key.clone()).collect();
            ordered.extend(keys.into_iter().filter_map(|key| collected.remove(&key)));
        }
        ordered.extend(collected.into_values());
        let mut cassette = Cassette::new(name).sealing_metadata(seals);
        for Collected { request, response, metadata } in ordered {
            cassette.push_with(&request, self.store.get(&response)?, metadata)?;
        }
        Ok(cassette)
    }

    /// Keeps an answer that a model gave elsewhere, as if it had been asked here.
    ///
    /// # Errors
    /// Another answer to the same question.
    pub fn keep_elsewhere(store: &Store, key: &Digest, answer: &Completion) -> Result<(), AskError> {
        let response = store.put(&answer.bytes).map_err(on_disk)?;
        if let Some(metadata) = &answer.metadata {
            keep_metadata(store, key, &response, metadata)?;
        }
        store.memo_put(MemoKind::Llm, key, &response).map_err(on_disk)
    }

    fn answer(
        &self,
        request: &Request,
        key: &Digest,
        judge: Option<&dyn DraftJudge>,
    ) -> Result<(Digest, Option<Metadata>), AskError> {
        if self.mode == RecordMode::Missing
            && let Some(found) = self.cassette.get(key)
        {
            return Ok((self.store.put(&found.bytes).map_err(on_disk)?, found.metadata.clone()));
        }
        let memo_key = self.memo_key(key)?;
        if let Some(response) = self.store.memo_get(MemoKind::Llm, &memo_key) {
            return Ok((response, self.kept_metadata(&memo_key, &response)?));
        }
        let Completion { bytes, metadata } = self.complete(request, *key, judge)?;
        self.look_at(&request.model, &bytes);
        let response = self.store.put(&bytes).map_err(on_disk)?;
        // Written before the answer, so that no answer exists without it.
        if let Some(metadata) = &metadata {
            keep_metadata(self.store, &memo_key, &response, metadata)?;
        }
        match self.store.memo_put(MemoKind::Llm, &memo_key, &response) {
            Ok(()) => {
                // A provider's answer costs money, so it must survive a power cut too.
                metadata.is_some().then(|| self.store.flush()).transpose().map_err(on_disk)?;
                Ok((response, metadata))
            }
            // If two threads ask the same request at once, the first answer counts.
            Err(StoreError::Conflict { recorded, .. }) => Ok((recorded, self.kept_metadata(&memo_key, &recorded)?)),
            Err(error) => Err(on_disk(error)),
        }
    }

    /// A recording that goes on with a cassette whose metadata no run seals does not begin to: its run keeps its root.
    fn seals_metadata(&self) -> bool {
        self.mode != RecordMode::Missing || self.cassette.seals_metadata()
    }

    fn kept_metadata(&self, memo_key: &Digest, response: &Digest) -> Result<Option<Metadata>, AskError> {
        let Some(object) = self.store.memo_get(MemoKind::Llm, &metadata_key(memo_key, response)?) else {
            return Ok(None);
        };
        let text = self.store.get(&object).map_err(on_disk)?;
        serde_json::from_slice(&text)
            .map(Some)
            .map_err(|error| AskError::Store(format!("metadata of an answer, object {object}: {error}")))
    }

    /// A fresh recording keeps its answers apart from those of earlier ones, without replacing them.
    fn memo_key(&self, key: &Digest) -> Result<Digest, AskError> {
        match &self.mode {
            RecordMode::Missing => Ok(*key),
            RecordMode::Fresh { recording } => Digest::of("evodrive/fresh-recording/1", &(recording, key))
                .map_err(|error| AskError::Store(error.to_string())),
        }
    }

    /// Without models it is a recording that others fill.
    fn complete(&self, request: &Request, key: Digest, judge: Option<&dyn DraftJudge>) -> Result<Completion, AskError> {
        if self.models.is_empty() {
            let miss = Miss::plain("the recording", key, request.slot.clone(), "evodrive record");
            return Err(AskError::Miss(Box::new(miss)));
        }
        let failed = |error: ModelError| AskError::Model { model: request.model.name.clone(), error };
        let model = self.models.get(&request.model.name).ok_or_else(|| {
            let known: Vec<&str> = self.models.keys().map(String::as_str).collect();
            let reason = format!("no such model is set up for recording (there are: {})", known.join(", "));
            failed(ModelError::Unanswerable { reason })
        })?;
        let answer = judge.map_or_else(|| model.complete(request), |judge| model.complete_with(request, judge));
        answer.map_err(failed)
    }
}

/// Metadata belong to one answer to one request.
fn metadata_key(memo_key: &Digest, response: &Digest) -> Result<Digest, AskError> {
    Digest::of("evodrive/llm-metadata-of/1", &(memo_key, response)).map_err(|error| AskError::Store(error.to_string()))
}

fn keep_metadata(store: &Store, memo_key: &Digest, response: &Digest, metadata: &Metadata) -> Result<(), AskError> {
    let text = serde_json::to_vec(metadata).map_err(|error| AskError::Store(error.to_string()))?;
    let object = store.put(&text).map_err(on_disk)?;
    match store.memo_put(MemoKind::Llm, &metadata_key(memo_key, response)?, &object) {
        // If the same answer comes twice with different counts, the first counts stay.
        Ok(()) | Err(StoreError::Conflict { .. }) => Ok(()),
        Err(error) => Err(on_disk(error)),
    }
}

fn on_disk(error: StoreError) -> AskError {
    AskError::Disk(error.into())
}

impl Ask for Record<'_> {
    fn ask_with(&self, request: &Request, judge: Option<&dyn DraftJudge>) -> Result<Reply, AskError> {
        let key = key_of(request)?;
        let (response, metadata) = self.answer(request, &key, judge)?;
        let bytes = self.store.get(&response).map_err(on_disk)?;
        let own = Collected { request: request.clone(), response, metadata: metadata.clone() };
        self.collected().insert((request.slot.clone(), key), own);
        let digest = metadata.as_ref().filter(|_| self.seals_metadata()).map(Metadata::digest).transpose();
        let sealed_metadata = digest.map_err(|error| AskError::Store(format!("metadata of an answer: {error}")))?;
        Ok(Reply { request: key, response, bytes, metadata, sealed_metadata })
    }
}
