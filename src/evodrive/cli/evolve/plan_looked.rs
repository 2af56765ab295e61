//! A source of answers that notes what it was asked: recorded answers are given, everything else is noted as missing, and no
//! model is there to be asked.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Mutex;

use crate::kernel::Digest;
use crate::llm::{Ask, AskError, Cassette, DraftJudge, DrawSlot, Miss, Reply, Request};
use crate::store::{MemoKind, Store};

/// A question, as far as a plan needs it.
#[derive(Clone, Debug)]
pub struct Question {
    pub slot: DrawSlot,
    pub key: Digest,
    /// Bytes of its messages.
    pub bytes: u64,
}

/// Questions that were asked so far.
#[derive(Debug, Default)]
pub struct Seen {
    /// By slot and key, so that the order of threads does not show.
    pub answered: BTreeSet<(DrawSlot, Digest)>,
    pub missing: BTreeMap<(DrawSlot, Digest), Question>,
}

/// Recorded answers: a cassette's, and those that an interrupted recording got already.
pub struct Looked<'a> {
    cassette: &'a Cassette,
    kept: Option<&'a Store>,
    seen: Mutex<Seen>,
}

impl<'a> Looked<'a> {
    pub fn new(cassette: &'a Cassette, kept: Option<&'a Store>) -> Looked<'a> {
        Looked { cassette, kept, seen: Mutex::new(Seen::default()) }
    }

    pub fn into_seen(self) -> Seen {
        self.seen.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner)
    }

    fn recorded(&self, key: &Digest) -> Result<Option<(Digest, Vec<u8>)>, AskError> {
        if let Some(found) = self.cassette.get(key) {
            return Ok(Some((found.response, found.bytes.clone())));
        }
        let Some(store) = self.kept else { return Ok(None) };
        let Some(response) = store.memo_get(MemoKind::Llm, key) else { return Ok(None) };
        let bytes = store.get(&response).map_err(|error| AskError::Store(error.to_string()))?;
        Ok(Some((response, bytes)))
    }
}

impl Ask for Looked<'_> {
    fn ask_with(&self, request: &Request, _: Option<&dyn DraftJudge>) -> Result<Reply, AskError> {
        let key = request.key().map_err(|error| AskError::Store(error.to_string()))?;
        let recorded = self.recorded(&key)?;
        let slot = request.slot.clone();
        let mut seen = self.seen.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        if let Some((response, bytes)) = recorded {
            seen.answered.insert((slot, key));
            return Ok(Reply { request: key, response, bytes, metadata: None, sealed_metadata: None });
        }
        let bytes = request.messages.iter().map(|message| message.text.len() as u64).sum();
        seen.missing.insert((slot.clone(), key), Question { slot: slot.clone(), key, bytes });
        Err(AskError::Miss(Box::new(Miss::plain(self.cassette.name.clone(), key, slot, ""))))
    }
}
