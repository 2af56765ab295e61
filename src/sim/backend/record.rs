//! The recorder between a run and the workers: it answers recorded requests, asks the workers the others, and keeps every
//! answer.

use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};

use super::answer::{Answer, AnswerLine};
use super::cassette::{Recorded, RolloutCassette};
use super::error::BackendError;
use super::request::{Answers, Request};
use crate::kernel::Digest;
use crate::store::{MemoKind, Store, StoreError};

/// Records rollouts. A motion goes to the store before it is used, so that a killed recording does not ask twice; so does the
/// driver's decision to abandon a scene. Failures of earlier recordings are asked again.
pub struct Recorder<'a> {
    store: &'a Store,
    /// Earlier recorded rollouts; empty for a fresh recording.
    before: RolloutCassette,
    /// Source of the answers that are not recorded.
    asked: Box<dyn Answers + 'a>,
    /// Separates the answers of a fresh recording from earlier ones; empty otherwise.
    fresh: String,
    collected: Mutex<BTreeMap<Digest, Recorded>>,
}

impl<'a> Recorder<'a> {
    /// `fresh` names a recording that asks everything anew; it is empty for one that fills gaps.
    pub fn new(store: &'a Store, before: RolloutCassette, asked: Box<dyn Answers + 'a>, fresh: String) -> Recorder<'a> {
        Recorder { store, before, asked, fresh, collected: Mutex::new(BTreeMap::new()) }
    }

    /// Returns everything that was asked, and how many of these requests failed.
    pub fn cassette(&self) -> (RolloutCassette, usize) {
        let collected = self.collected.lock().unwrap_or_else(PoisonError::into_inner);
        let failed = collected.values().filter(|recorded| !recorded.answer.is_settled()).count();
        let mut cassette = RolloutCassette::new(self.before.file.clone(), self.before.backend.clone());
        collected.iter().for_each(|(key, recorded)| cassette.insert(*key, recorded.clone()));
        (cassette, failed)
    }

    fn find(&self, request: &Request<'_>) -> Result<Answer, BackendError> {
        if let Some(Recorded { answer, .. }) = self.before.get(&request.key)
            && answer.is_settled()
        {
            return Ok(answer.clone());
        }
        let memo = Digest::of("evodrive/backend-answer/1", &(&self.fresh, request.key))?;
        if let Some(object) = self.store.memo_get(MemoKind::Rollout, &memo) {
            let bytes = self.store.get(&object)?;
            let kept = serde_json::from_slice::<AnswerLine>(&bytes).ok().and_then(|line| line.into_answer().ok());
            if let Some(answer) = kept {
                return Ok(answer);
            }
        }
        let answer = self.asked.answer(request)?;
        if answer.is_settled() {
            let object = self.store.put(&AnswerLine::of(request.key, &answer).to_bytes())?;
            match self.store.memo_put(MemoKind::Rollout, &memo, &object) {
                // Two threads may ask the same at once. A backend that answers differently is found at the next recording.
                Ok(()) | Err(StoreError::Conflict { .. }) => self.store.flush()?,
                Err(error) => return Err(error.into()),
            }
        }
        Ok(answer)
    }
}

impl Answers for Recorder<'_> {
    fn answer(&self, request: &Request<'_>) -> Result<Answer, BackendError> {
        let answer = self.find(request)?;
        let recorded = Recorded { scene: request.scene().into(), ego: request.ego.into(), answer: answer.clone() };
        let mut collected = self.collected.lock().unwrap_or_else(PoisonError::into_inner);
        Ok(collected.entry(request.key).or_insert(recorded).answer.clone())
    }

    fn compared(&self) -> Option<String> {
        self.asked.compared()
    }
}
