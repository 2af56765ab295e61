//! Answers from a cassette, and a useful message for a missing answer. It never asks a model.

use super::{Ask, AskError, Cassette, DrawSlot, Miss, ModelError, Reply, Request, cassette::Recorded};
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
    fn ask(&self, request: &Request) -> Result<Reply, AskError> {
        let key = key_of(request)?;
        match self.cassette.get(&key) {
            Some(found) => Ok(Reply {
                request: key,
                response: found.response,
                bytes: found.bytes.clone(),
                metadata: found.metadata.clone(),
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
    let nearest = cassette.exchanges().iter().min_by_key(|recorded| distance(&recorded.slot, &request.slot));
    Miss {
        cassette: cassette.name.clone(),
        key,
        slot: request.slot.clone(),
        nearest: nearest.map(|recorded| recorded.slot.clone()),
        difference: nearest.and_then(|recorded| difference(recorded, request)),
        remedy: remedy.to_string(),
    }
}

/// Same lineage and role first, then near in (epoch, slot, round). If two are equally near, the one recorded first.
fn distance(a: &DrawSlot, b: &DrawSlot) -> (bool, u32, u32, u32) {
    let elsewhere = a.lineage != b.lineage || a.role != b.role;
    (elsewhere, a.epoch.abs_diff(b.epoch), a.slot.abs_diff(b.slot), a.round.abs_diff(b.round))
}

/// The first field, in the order of `Request`, whose value differs; texts by their first differing line.
fn difference(recorded: &Recorded, request: &Request) -> Option<String> {
    let old = recorded.request();
    for (i, pair) in old.messages.iter().zip(&request.messages).enumerate() {
        let same_before =
            old.adapter_version == request.adapter_version && old.slot == request.slot && old.model == request.model;
        if same_before && pair.0.role == pair.1.role && pair.0.text != pair.1.text {
            return Some(text_difference(&format!("message {} ({})", i + 1, pair.1.role), &pair.0.text, &pair.1.text));
        }
        if pair.0 != pair.1 {
            break;
        }
    }
    let names = ["adapter_version", "slot", "model", "messages", "schema"];
    let (old, new) = (serde_json::to_value(&old).ok()?, serde_json::to_value(request).ok()?);
    let name = names.into_iter().find(|name| old.get(name) != new.get(name))?;
    let (field, old, new) = first_difference(name, old.get(name)?, new.get(name)?);
    Some(format!("{field}: recorded {old}, asked {new}"))
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
