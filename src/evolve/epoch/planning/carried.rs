//! Recorded answers that travel with a lineage's work. In the epochs that the run has reached, a question is answered by its key
//! alone. Later prompts may show cards of other lineages that are not written yet: there the answer that was recorded at the
//! question's place in the run, if any, stands for the answer. Results are kept by keys, so a wrong guess costs time and changes
//! nothing.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};

use serde::{Deserialize, Serialize};

use crate::kernel::{Digest, hex};
use crate::llm::{Ask, AskError, Cassette, DraftJudge, DrawSlot, Metadata, Miss, Recorded, Reply, Request};
use crate::objects::LineageId;

/// An answer by the key of its question and by its place.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RecordedAnswer {
    pub answer: Digest,
    pub slot: DrawSlot,
    /// The bytes; as hex digits where they are no text.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reply: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reply_hex: Option<String>,
    /// Metadata that its model gave with it, where a worker asked.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub metadata: Option<Metadata>,
}

impl RecordedAnswer {
    pub fn of(answer: Digest, slot: DrawSlot, bytes: &[u8]) -> RecordedAnswer {
        let (reply, reply_hex) = match std::str::from_utf8(bytes) {
            Ok(text) => (Some(text.to_string()), None),
            Err(_) => (None, Some(hex::encoded(bytes))),
        };
        RecordedAnswer { answer, slot, reply, reply_hex, metadata: None }
    }

    /// The bytes; `None` where there are none, or no hex digits.
    pub fn bytes(&self) -> Option<Vec<u8>> {
        match (&self.reply, &self.reply_hex) {
            (Some(text), None) => Some(text.as_bytes().to_vec()),
            (None, Some(digits)) => hex::decoded(digits),
            _ => None,
        }
    }

    /// Returns the answers of a lineage from an epoch on. Those of one place are in the order in which they were asked: a question that is
    /// asked once more repeats the first one, and goes on behind it.
    pub fn of_lineage(recorded: &Cassette, lineage: &LineageId, epoch: u32) -> Vec<RecordedAnswer> {
        let of = |exchange: &&Recorded| exchange.slot.lineage == lineage.as_str() && exchange.slot.epoch >= epoch;
        let length = |of: &&Recorded| of.messages.iter().map(|(_, text)| text.len()).sum::<usize>();
        let mut exchanges: Vec<&Recorded> = recorded.exchanges().iter().filter(of).collect();
        exchanges.sort_by_key(length);
        exchanges.into_iter().map(|of| RecordedAnswer::of(of.key, of.slot.clone(), &of.bytes)).collect()
    }
}

/// Answers to the questions that come up in a lineage's work.
pub struct CarriedAnswers<'a> {
    by_key: BTreeMap<Digest, &'a RecordedAnswer>,
    by_place: BTreeMap<&'a DrawSlot, Vec<&'a RecordedAnswer>>,
    /// Models that can be asked here where no answer was recorded.
    models: Option<&'a dyn Ask>,
    guesses: AtomicBool,
    met: Mutex<Met>,
}

#[derive(Default)]
struct Met {
    /// Number of questions that each place has answered: a critic may be asked once more.
    at: BTreeMap<DrawSlot, usize>,
    /// Answers of models that were asked here.
    asked: BTreeMap<Digest, RecordedAnswer>,
}

impl<'a> CarriedAnswers<'a> {
    pub fn new(answers: &'a [RecordedAnswer], models: Option<&'a dyn Ask>) -> CarriedAnswers<'a> {
        let mut by_place: BTreeMap<&DrawSlot, Vec<&RecordedAnswer>> = BTreeMap::new();
        answers.iter().for_each(|of| by_place.entry(&of.slot).or_default().push(of));
        let by_key = answers.iter().map(|of| (of.answer, of)).collect();
        CarriedAnswers { by_key, by_place, models, guesses: AtomicBool::new(false), met: Mutex::default() }
    }

    /// Returns `true` if models can be asked here.
    pub fn asks(&self) -> bool {
        self.models.is_some()
    }

    /// Returns `true` if any answer of an epoch was recorded.
    pub fn knows(&self, epoch: u32) -> bool {
        self.by_place.keys().any(|slot| slot.epoch == epoch)
    }

    /// Switches to guesses: from now on the answer that was recorded at a question's place stands for its answer.
    pub(in crate::epoch) fn guess(&self) {
        self.guesses.store(true, Ordering::Relaxed);
    }

    /// Returns the models' answers from here, by the keys of their questions.
    pub fn asked(self) -> Vec<RecordedAnswer> {
        self.met.into_inner().unwrap_or_else(PoisonError::into_inner).asked.into_values().collect()
    }

    /// Returns the next answer that was recorded at this place, question by question.
    fn at_place(&self, slot: &DrawSlot) -> Option<&RecordedAnswer> {
        let recorded = self.by_place.get(slot)?;
        let mut met = self.met.lock().unwrap_or_else(PoisonError::into_inner);
        let place = met.at.entry(slot.clone()).or_default();
        *place += 1;
        recorded.get(*place - 1).copied()
    }

    fn asked_here(
        &self,
        models: &dyn Ask,
        request: &Request,
        judge: Option<&dyn DraftJudge>,
        key: Digest,
    ) -> Result<Reply, AskError> {
        let reply = models.ask_with(request, judge)?;
        let metadata = reply.metadata.clone();
        let answer = RecordedAnswer { metadata, ..RecordedAnswer::of(key, request.slot.clone(), &reply.bytes) };
        self.met.lock().unwrap_or_else(PoisonError::into_inner).asked.insert(key, answer);
        Ok(reply)
    }
}

impl Ask for CarriedAnswers<'_> {
    fn ask_with(&self, request: &Request, judge: Option<&dyn DraftJudge>) -> Result<Reply, AskError> {
        let unkeyed = |error| AskError::Store(format!("a question has no key: {error}"));
        let key = request.key().map_err(unkeyed)?;
        let known = self.by_key.get(&key).copied();
        // A question with an answer of its own also takes its turn at its place.
        let placed = if self.guesses.load(Ordering::Relaxed) { self.at_place(&request.slot) } else { None };
        let bytes = match (known.or(placed).and_then(RecordedAnswer::bytes), self.models) {
            (Some(bytes), _) => bytes,
            (None, Some(models)) => return self.asked_here(models, request, judge, key),
            (None, None) => {
                let miss = Miss::plain("the shard", key, request.slot.clone(), "plan the next round");
                return Err(AskError::Miss(Box::new(miss)));
            }
        };
        Ok(Reply { request: key, response: Digest::of_bytes(&bytes), bytes, metadata: None, sealed_metadata: None })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::llm::{Message, ModelSpec, Schema};

    fn request(epoch: u32, text: &str) -> Request {
        Request {
            adapter_version: 1,
            slot: DrawSlot { lineage: "cat".into(), epoch, slot: 0, role: "actor".into(), round: 0 },
            model: ModelSpec {
                name: "m".into(),
                kind: "scripted".into(),
                model: "m".into(),
                sampling: BTreeMap::new(),
                response_format: None,
                body: BTreeMap::new(),
                here: Default::default(),
            },
            messages: vec![Message { role: "user".into(), text: text.into() }],
            schema: Schema::new(serde_json::json!({"type": "object"})).unwrap(),
        }
    }

    fn said(carried: &CarriedAnswers<'_>, epoch: u32, text: &str) -> Result<String, AskError> {
        carried.ask(&request(epoch, text)).map(|reply| String::from_utf8(reply.bytes).unwrap())
    }

    #[test]
    fn where_nobody_has_come_yet_an_answer_is_taken_by_its_place_in_the_order_of_asking() {
        let mut cassette = Cassette::default();
        // A question that was asked once more repeats the first one; a cassette has both in the order of their keys.
        let again = "what now?\nyour reply cannot be read";
        for (epoch, text, reply) in [(0, "what?", "first"), (1, again, "better"), (1, "what now?", "worse")] {
            cassette.push(&request(epoch, text), reply.into()).unwrap();
        }
        let answers = RecordedAnswer::of_lineage(&cassette, &LineageId::new("cat"), 0);
        let carried = CarriedAnswers::new(&answers, None);
        assert_eq!(said(&carried, 0, "what?").unwrap(), "first");
        let asked = "what now, beside a card of another lineage?";
        assert!(matches!(said(&carried, 1, asked), Err(AskError::Miss(_))), "the run may ask this otherwise");
        carried.guess();
        assert_eq!(said(&carried, 1, asked).unwrap(), "worse");
        assert_eq!(said(&carried, 1, &format!("{asked}\nyour reply cannot be read")).unwrap(), "better");
        assert!(matches!(said(&carried, 1, asked), Err(AskError::Miss(_))), "nothing more was asked there");
        assert!(matches!(said(&carried, 2, asked), Err(AskError::Miss(_))));
        assert!(carried.knows(1) && !carried.knows(2));
    }

    #[test]
    fn bytes_that_are_no_text_come_back_as_they_were() {
        let slot = request(0, "x").slot;
        for bytes in [&b"text"[..], &[0xff, 0, 0x80]] {
            let answer = RecordedAnswer::of(Digest::of_bytes(b"k"), slot.clone(), bytes);
            let line = serde_json::to_string(&answer).unwrap();
            assert_eq!(serde_json::from_str::<RecordedAnswer>(&line).unwrap().bytes().unwrap(), bytes);
        }
    }

    /// Answers with what is said of a draft.
    struct Tries;

    impl Ask for Tries {
        fn ask_with(&self, request: &Request, judge: Option<&dyn DraftJudge>) -> Result<Reply, AskError> {
            let bytes = judge.map_or_else(String::new, |judge| judge.tried(b"draft").says).into_bytes();
            let (request, response) = (request.key().unwrap(), Digest::of_bytes(&bytes));
            Ok(Reply { request, response, bytes, metadata: None, sealed_metadata: None })
        }
    }

    struct Says;

    impl DraftJudge for Says {
        fn tried(&self, draft: &[u8]) -> crate::llm::Tried {
            crate::llm::Tried { passes: true, says: format!("{} looked at", String::from_utf8_lossy(draft)) }
        }
    }

    #[test]
    fn who_is_asked_here_may_try_drafts_as_in_a_plain_recording() {
        let carried = CarriedAnswers::new(&[], Some(&Tries));
        let reply = carried.ask_with(&request(0, "what?"), Some(&Says)).unwrap();
        assert_eq!(reply.bytes, b"draft looked at");
        assert_eq!(said(&carried, 0, "and without?").unwrap(), "");
    }
}
