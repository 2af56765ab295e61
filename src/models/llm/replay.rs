//! Answers from a cassette, and a useful message for a missing answer. It never asks a model.

use serde::Serialize;
use std::cmp::Reverse;

use super::{
    Ask, AskError, Cassette, DraftJudge, DrawSlot, Message, Miss, ModelError, Reply, Request, cassette::Recorded,
};
use crate::store::{first_difference, shortened};

/// A cassette as the source of answers. A request without a recorded answer is a miss; no model is asked by accident.
#[derive(Debug)]
pub struct Replay {
    cassette: Cassette,
    /// The command that would record what is missing, for the message.
    remedy: String,
}

impl Replay {
    /// Answers from a cassette; `remedy` is the command that would record what it lacks.
    pub fn new(cassette: Cassette, remedy: impl Into<String>) -> Replay {
        Replay { cassette, remedy: remedy.into() }
    }

    /// The cassette.
    pub fn cassette(&self) -> &Cassette {
        &self.cassette
    }
}

impl Ask for Replay {
    fn ask_with(&self, request: &Request, _: Option<&dyn DraftJudge>) -> Result<Reply, AskError> {
        let key = key_of(request)?;
        match self.cassette.get(&key) {
            Some(found) => Ok(Reply {
                request: key,
                response: found.response,
                bytes: found.bytes.clone(),
                metadata: found.metadata.clone(),
                sealed_metadata: self.cassette.sealed_metadata(found),
            }),
            None => Err(AskError::Miss(Box::new(miss(&self.cassette, request, key, &self.remedy)))),
        }
    }
}

pub(super) fn key_of(request: &Request) -> Result<crate::kernel::Digest, AskError> {
    request.key().map_err(|error| AskError::Model {
        model: request.model.name.clone(),
        error: ModelError::Unanswerable { reason: format!("it has no key: {error}") },
    })
}

fn miss(cassette: &Cassette, request: &Request, key: crate::kernel::Digest, remedy: &str) -> Miss {
    let nearest = nearest(cassette.exchanges(), request);
    Miss {
        cassette: cassette.name.clone(),
        key,
        slot: request.slot.clone(),
        nearest: nearest.map(|recorded| recorded.slot.clone()),
        difference: nearest.and_then(|recorded| difference(recorded, request)),
        remedy: remedy.to_string(),
    }
}

/// Returns, of the exchanges nearest in their slot, the one that shares most with the request: a slot may have been
/// recorded several times. If two share as much, returns the one recorded first.
fn nearest<'c>(exchanges: &'c [Recorded], request: &Request) -> Option<&'c Recorded> {
    let least = exchanges.iter().map(|recorded| distance(&recorded.slot, &request.slot)).min()?;
    let near = exchanges.iter().filter(|recorded| distance(&recorded.slot, &request.slot) == least);
    near.min_by_key(|recorded| Reverse(shared(recorded, request)))
}

/// Same lineage and role first, then near in (epoch, slot, round).
fn distance(a: &DrawSlot, b: &DrawSlot) -> (bool, u32, u32, u32) {
    let elsewhere = a.lineage != b.lineage || a.role != b.role;
    (elsewhere, a.epoch.abs_diff(b.epoch), a.slot.abs_diff(b.slot), a.round.abs_diff(b.round))
}

/// Counts the fields besides the messages' texts that are equal, the messages that are, and the bytes that are at the beginnings and the
/// ends of the others, and says how little these differ in length. A question that is asked once more repeats the first one and goes on
/// behind it: where something ahead of that has changed, only the ends tell the two apart.
fn shared(recorded: &Recorded, request: &Request) -> (usize, usize, usize, Reverse<usize>) {
    let fields = [
        recorded.adapter_version == request.adapter_version,
        recorded.slot == request.slot,
        *recorded.model == request.model,
        recorded.schema == request.schema,
        recorded.messages.len() == request.messages.len(),
    ];
    let (mut same, mut bytes, mut longer) = (0, 0, 0);
    for ((role, old), Message { role: asked, text: new }) in recorded.messages.iter().zip(&request.messages) {
        if *role == *asked && *old == *new {
            same += 1;
            continue;
        }
        let alike = |pairs: &mut dyn Iterator<Item = (u8, u8)>| pairs.take_while(|(a, b)| a == b).count();
        let begun = alike(&mut old.bytes().zip(new.bytes()));
        let rest = old.len().min(new.len()) - begun;
        bytes += begun + alike(&mut old.bytes().rev().zip(new.bytes().rev()).take(rest));
        longer += old.len().abs_diff(new.len());
    }
    (fields.into_iter().filter(|equal| *equal).count(), same, bytes, Reverse(longer))
}

/// The first field, in the order of `Request`, whose value differs; texts by their first differing line. Messages are compared
/// where they lie: thousands of them may share one long text.
fn difference(recorded: &Recorded, request: &Request) -> Option<String> {
    if recorded.adapter_version != request.adapter_version {
        return Some(differs("adapter_version", &recorded.adapter_version, &request.adapter_version));
    }
    if recorded.slot != request.slot {
        return by_value("slot", &recorded.slot, &request.slot);
    }
    if *recorded.model != request.model {
        return by_value("model", &*recorded.model, &request.model);
    }
    for (i, ((role, text), message)) in recorded.messages.iter().zip(&request.messages).enumerate() {
        if *role != message.role {
            return Some(differs(&format!("role of message {}", i + 1), role, &message.role));
        }
        if *text != message.text {
            return Some(text_difference(&format!("message {} ({role})", i + 1), text, &message.text));
        }
    }
    if recorded.messages.len() != request.messages.len() {
        return Some(differs("number of messages", &recorded.messages.len(), &request.messages.len()));
    }
    if recorded.schema != request.schema {
        return by_value("schema", &recorded.schema, &request.schema);
    }
    None
}

fn by_value(name: &str, old: &impl Serialize, new: &impl Serialize) -> Option<String> {
    let (old, new) = (serde_json::to_value(old).ok()?, serde_json::to_value(new).ok()?);
    let (field, old, new) = first_difference(name, &old, &new);
    Some(differs(&field, &old, &new))
}

fn differs(field: &str, old: &dyn std::fmt::Display, new: &dyn std::fmt::Display) -> String {
    format!("{field}: recorded {old}, asked {new}")
}

fn text_difference(name: &str, old: &str, new: &str) -> String {
    let (mut old, mut new) = (old.split('\n'), new.split('\n'));
    let mut number = 1;
    loop {
        match (old.next(), new.next()) {
            (Some(a), Some(b)) if a == b => number += 1,
            (a, b) => {
                let (a, b) = (around(a, b), around(b, a));
                return format!("{name} line {number}: recorded {a}, asked {b}");
            }
        }
    }
}

/// A line for the message. A long common beginning is left out, so that the difference is visible.
fn around(line: Option<&str>, other: Option<&str>) -> String {
    let Some(line) = line else { return "no such line".to_string() };
    let common = line.char_indices().zip(other.unwrap_or("").chars()).take_while(|((_, a), b)| a == b).count();
    let start = line.char_indices().nth(common.saturating_sub(40)).map_or(0, |(at, _)| at);
    let start = if common > 80 { start } else { 0 };
    format!("{}{:?}", if start > 0 { "…" } else { "" }, shortened(&line[start..]))
}

#[cfg(test)]
mod tests {
    use super::super::Text;
    use super::*;
    use crate::llm::{ModelSpec, Schema};
    use proptest::prelude::*;
    use serde_json::json;
    use std::collections::BTreeMap;

    fn request(epoch: u32, slot: u32, texts: &[String]) -> Request {
        Request {
            adapter_version: 3,
            slot: DrawSlot { lineage: "cat".into(), epoch, slot, role: "actor".into(), round: 0 },
            model: ModelSpec {
                name: "m".into(),
                kind: "scripted".into(),
                model: "m".into(),
                sampling: BTreeMap::new(),
                response_format: None,
                body: BTreeMap::new(),
                here: Default::default(),
            },
            messages: texts.iter().map(|text| Message { role: "user".into(), text: text.as_str().into() }).collect(),
            schema: Schema::new(json!({"type": "object"})).unwrap(),
        }
    }

    fn cassette(requests: &[Request]) -> Cassette {
        let mut cassette = Cassette::default();
        for request in requests {
            cassette.push(request, b"{}".to_vec()).unwrap();
        }
        cassette
    }

    fn missed(cassette: &Cassette, request: &Request) -> Miss {
        miss(cassette, request, request.key().unwrap(), "record it")
    }

    #[test]
    fn of_a_slot_that_was_recorded_twice_the_one_that_shares_more_is_compared() {
        let text = |last: &str| vec!["system".to_string(), format!("line 1\nline 2\n{last}")];
        let first = request(1, 2, &["another system".to_string(), "other".to_string()]);
        let second = request(1, 2, &text("as it was"));
        let found = missed(&cassette(&[first, second]), &request(1, 2, &text("as it is")));
        assert_eq!(found.difference.unwrap(), r#"message 2 (user) line 3: recorded "as it was", asked "as it is""#);
    }

    #[test]
    fn a_question_asked_once_more_is_compared_with_its_own_record_wherever_it_has_changed() {
        let first = |line: &str| format!("head\n{line}\nthe program\nreply in JSON");
        let again = |line: &str| format!("{}\n\nYour reply cannot be read:\n{{broken", first(line));
        let texts = |last: String| vec!["handbook".to_string(), last];
        let (one, two) = (request(1, 2, &texts(first("was"))), request(1, 2, &texts(again("was"))));
        for recorded in [[one.clone(), two.clone()], [two, one]] {
            for asked in [again("is"), first("is")] {
                let found = missed(&cassette(&recorded), &request(1, 2, &texts(asked)));
                assert_eq!(found.difference.unwrap(), r#"message 2 (user) line 2: recorded "was", asked "is""#);
            }
            let found = missed(&cassette(&recorded), &request(1, 2, &texts(again("was") + " off")));
            assert_eq!(
                found.difference.unwrap(),
                r#"message 2 (user) line 7: recorded "{broken", asked "{broken off""#
            );
            let near = cassette(&recorded);
            let near = nearest(near.exchanges(), &request(1, 2, &texts(again("is")))).unwrap();
            assert!(near.messages[1].1.contains("cannot be read"));
        }
    }

    #[test]
    fn thousands_of_messages_that_share_a_text_are_compared_where_they_lie() {
        // Written out, they have four gigabytes.
        let long: Text = "x".repeat(1 << 20).as_str().into();
        let messages = |last: &str| {
            let shared = std::iter::repeat_n(&long, 4000).cloned().chain([Text::from(last)]);
            shared.map(|text| Message { role: "user".into(), text }).collect()
        };
        let of = |last: &str| Request { messages: messages(last), ..request(0, 0, &[]) };
        let recorded = of("was");
        let recorded = Recorded {
            key: crate::kernel::Digest::of_bytes(b"key"),
            adapter_version: recorded.adapter_version,
            slot: recorded.slot.clone(),
            model: recorded.model.clone().into(),
            messages: recorded.messages.iter().map(|m| (m.role.clone(), m.text.clone())).collect(),
            schema: recorded.schema.clone(),
            response: crate::kernel::Digest::of_bytes(b"{}"),
            bytes: b"{}".to_vec(),
            metadata: None,
        };
        let asked = of("is");
        assert_eq!(shared(&recorded, &asked), (5, 4000, 1, Reverse(1)));
        let differs = difference(&recorded, &asked).unwrap();
        assert_eq!(differs, r#"message 4001 (user) line 1: recorded "was", asked "is""#);
    }

    /// Change in a request that was recorded, and the word by which the message names it.
    #[derive(Clone, Debug)]
    enum Change {
        Version,
        Model,
        Text(usize),
        Role(usize),
        Longer,
        Schema,
    }

    impl Change {
        fn make(&self, request: &mut Request) -> String {
            match *self {
                Change::Version => {
                    request.adapter_version += 1;
                    "adapter_version".into()
                }
                Change::Model => {
                    request.model.sampling.insert("temperature".into(), 0.25);
                    "model/sampling/temperature".into()
                }
                Change::Text(place) => {
                    let changed = format!("{}, and more", &*request.messages[place].text);
                    request.messages[place].text = changed.as_str().into();
                    format!("message {} (user) line 2", place + 1)
                }
                Change::Role(place) => {
                    request.messages[place].role = "assistant".into();
                    format!("role of message {}", place + 1)
                }
                Change::Longer => {
                    request.messages.push(Message { role: "user".into(), text: "more".into() });
                    "number of messages".into()
                }
                Change::Schema => {
                    request.schema = Schema::new(json!({"type": "array"})).unwrap();
                    "schema/type".into()
                }
            }
        }
    }

    fn change() -> impl Strategy<Value = Change> {
        prop_oneof![
            Just(Change::Version),
            Just(Change::Model),
            (0usize..3).prop_map(Change::Text),
            (0usize..3).prop_map(Change::Role),
            Just(Change::Longer),
            Just(Change::Schema),
        ]
    }

    proptest! {
        #[test]
        fn a_near_miss_names_the_record_and_the_field(which in 0u32..40, change in change()) {
            // Every slot is recorded twice, with other texts.
            let texts = |slot: u32, turn: u32| -> Vec<String> {
                (0..3).map(|k| format!("head {k}\nslot {slot}, turn {turn}")).collect()
            };
            let all: Vec<Request> =
                (0..40).flat_map(|k| (0..2).map(move |turn| request(k / 20, k % 20, &texts(k, turn)))).collect();
            let mut asked = all[2 * which as usize + 1].clone();
            let field = change.make(&mut asked);
            let found = missed(&cassette(&all), &asked);
            prop_assert_eq!(found.nearest.as_ref(), Some(&asked.slot));
            let differs = found.difference.unwrap();
            prop_assert!(differs.starts_with(&format!("{field}: recorded ")), "{}: {}", field, differs);
        }
    }
}
