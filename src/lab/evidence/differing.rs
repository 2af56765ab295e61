//! Difference of two recorded runs: their inputs, the first event that is not the same, the field in it, and what that points to.

use std::collections::BTreeSet;
use std::path::Path;

use serde::Serialize;
use serde_json::Value;

use crate::kernel::Digest;
use crate::objects::event::kind;
use crate::store::{Event, StoreError, each_event, first_difference};

/// Floats this many steps apart are one number, computed in two ways.
const STEPS_MAX: u64 = 64;

/// Two runs compared event by event. What stands in an event counts, not the chain that it hangs on.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Differing {
    /// Events of the first and of the second.
    pub events: [usize; 2],
    /// Fields in which the opening events differ: what the runs are functions of.
    pub inputs: Vec<Parting>,
    /// The first later event that differs.
    pub first: Option<FirstEvent>,
}

impl Differing {
    /// Returns `true` if every event is the same.
    pub fn is_nothing(&self) -> bool {
        self.inputs.is_empty() && self.first.is_none()
    }
}

/// A field with both values.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Parting {
    /// JSON Pointer in the event's body.
    pub field: String,
    /// Value in the first run.
    pub first: String,
    /// Value in the second run.
    pub second: String,
}

/// The first event that differs.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FirstEvent {
    /// Its place in both transcripts.
    pub seq: usize,
    /// Its kind in the first and in the second; `None` where one run has no more events.
    pub kinds: [Option<String>; 2],
    /// Owner of the event: attempt, lineage or epoch, as far as it says.
    pub of: String,
    /// The first field that differs; `None` where the kinds do.
    pub field: Option<Parting>,
    /// Cause that such a difference points to.
    pub cause: Cause,
}

/// Cause that a difference points to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Cause {
    /// One run is the beginning of the other.
    Unfinished,
    /// The same events in another order.
    Order,
    /// A question to a model is another one: its key differs.
    Key,
    /// The same question has another answer.
    Answer,
    /// A number differs in its last bits alone.
    FloatBits,
    /// The rollout behind a label is another one.
    Rollout,
    /// Other scenes were used.
    Scene,
    /// The code decides otherwise.
    Code,
}

impl Cause {
    /// Returns the cause in words, with what helps.
    pub fn text(self) -> &'static str {
        match self {
            Cause::Unfinished => {
                "one run ends here: it was interrupted, or its end is lost (evodrive resume, evodrive fsck)"
            }
            Cause::Order => "the same events in another order: something depends on who finishes first",
            Cause::Key => {
                "another question was asked: a prompt, its history or a model's settings differ (evodrive show --full in both runs)"
            }
            Cause::Answer => "the same question was answered differently: the cassettes differ",
            Cause::FloatBits => {
                "a number differs in its last bits: another processor, build or library computes it differently"
            }
            Cause::Rollout => {
                "a rollout came out differently: simulator, program or scene differ (evodrive verify in both runs)"
            }
            Cause::Scene => "other scenes were used: pool, split or window differ",
            Cause::Code => {
                "the same inputs led to another decision: versions of the program differ in gates, archive, memory or world evaluator"
            }
        }
    }
}

/// Compares two transcripts. Damage of one is an error that names it.
pub fn compare(first: &Path, second: &Path) -> Result<Differing, StoreError> {
    let (one, other) = (Bodies::of(first)?, Bodies::of(second)?);
    let inputs = one.opened.as_ref().zip(other.opened.as_ref()).map(|(a, b)| partings(a, b)).unwrap_or_default();
    let events = [one.digests.len(), other.digests.len()];
    let behind = usize::from(!inputs.is_empty());
    let seq = (behind..events[0].max(events[1])).find(|seq| one.digests.get(*seq) != other.digests.get(*seq));
    let difference = |seq| -> Result<FirstEvent, StoreError> {
        let elsewhere = |bodies: &Bodies, digest: Option<&Digest>| digest.is_some_and(|d| bodies.all.contains(d));
        let swapped = elsewhere(&one, other.digests.get(seq)) && elsewhere(&other, one.digests.get(seq));
        Ok(first_event(seq, event_at(first, seq)?, event_at(second, seq)?, swapped))
    };
    Ok(Differing { events, inputs, first: seq.map(difference).transpose()? })
}

/// Contents of a transcript's events, each as a digest.
struct Bodies {
    opened: Option<Value>,
    digests: Vec<Digest>,
    all: BTreeSet<Digest>,
}

impl Bodies {
    fn of(path: &Path) -> Result<Bodies, StoreError> {
        let (mut opened, mut digests) = (None, Vec::new());
        each_event(path, &mut |event| {
            // What was read can be written.
            digests.push(Digest::of("evodrive/event-body/1", &(&event.kind, &event.body)).unwrap_or(event.hash));
            if event.kind == kind::OPENED {
                opened = Some(event.body);
            }
        })?;
        let all = digests.iter().copied().collect();
        Ok(Bodies { opened, digests, all })
    }
}

fn event_at(path: &Path, seq: usize) -> Result<Option<Event>, StoreError> {
    let mut difference = None;
    each_event(path, &mut |event| {
        if event.seq == seq as u64 {
            difference = Some(event);
        }
    })?;
    Ok(difference)
}

/// Every field of the opening events that differs.
fn partings(first: &Value, second: &Value) -> Vec<Parting> {
    let fields = |of: &Value| of.as_object().map(|o| o.keys().cloned().collect::<Vec<_>>()).unwrap_or_default();
    let names: BTreeSet<String> = fields(first).into_iter().chain(fields(second)).collect();
    let differs = |name: &String| {
        let (old, new) = (first.get(name), second.get(name));
        let absent = Value::Null;
        (old != new).then(|| parting(&format!("/{name}"), old.unwrap_or(&absent), new.unwrap_or(&absent)))
    };
    names.iter().filter_map(differs).collect()
}

fn parting(at: &str, first: &Value, second: &Value) -> Parting {
    let (field, first, second) = first_difference(at, first, second);
    Parting { field, first, second }
}

fn first_event(seq: usize, one: Option<Event>, other: Option<Event>, swapped: bool) -> FirstEvent {
    let kinds = [&one, &other].map(|event| event.as_ref().map(|event| event.kind.clone()));
    let of = one.as_ref().or(other.as_ref()).map(|event| whose(&event.body)).unwrap_or_default();
    let field = match (&one, &other) {
        (Some(a), Some(b)) if a.kind == b.kind => Some(parting("", &a.body, &b.body)),
        _ => None,
    };
    let cause = match (&one, &other, &field) {
        (None, ..) | (_, None, _) => Cause::Unfinished,
        _ if swapped => Cause::Order,
        (Some(a), Some(b), Some(field)) => cause(&field.field, &a.body, &b.body),
        _ => Cause::Code,
    };
    FirstEvent { seq, kinds, of, field, cause }
}

/// The attempt, or lineage, epoch and scene.
fn whose(body: &Value) -> String {
    let named = |name: &str| match body.get(name) {
        Some(Value::String(text)) => Some(text.clone()),
        Some(Value::Number(number)) => Some(format!("{name} {number}")),
        _ => None,
    };
    named("id").unwrap_or_else(|| {
        ["lineage", "epoch", "scene", "solution"].into_iter().filter_map(named).collect::<Vec<_>>().join(", ")
    })
}

fn cause(field: &str, first: &Value, second: &Value) -> Cause {
    let float = |of: &Value| of.pointer(field).filter(|value| value.is_f64()).and_then(Value::as_f64);
    if let (Some(a), Some(b)) = (float(first), float(second))
        && a.is_sign_negative() == b.is_sign_negative()
        && a.to_bits().abs_diff(b.to_bits()) <= STEPS_MAX
    {
        return Cause::FloatBits;
    }
    let parts: Vec<&str> = field.split('/').collect();
    let holds = |name: &str| parts.contains(&name);
    match parts.last().copied().unwrap_or_default() {
        "request" if holds("exchanges") => Cause::Key,
        "response" if holds("exchanges") => Cause::Answer,
        _ if holds("window") || holds("evolution_scenes") || holds("held_out_scenes") => Cause::Scene,
        _ if holds("score") || holds("parent_score") || holds("probes") || holds("trial") => Cause::Rollout,
        _ => Cause::Code,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::Transcript;
    use serde_json::json;
    use std::path::PathBuf;

    fn attempt(slot: u32) -> Value {
        json!({
            "id": format!("cat/e0s{slot}"),
            "proposal": {"exchanges": [{"request": "aa", "response": "bb"}]},
            "exit": {"score": {"objectives": {"attack": 0.1, "realism": 0.9}}, "gates": ["ok"]},
        })
    }

    fn written(folder: &Path, name: &str, events: &[(&str, Value)]) -> PathBuf {
        let path = folder.join(name);
        let mut transcript = Transcript::create(&path).unwrap();
        for (kind, body) in events {
            transcript.append(kind, body).unwrap();
        }
        path
    }

    fn run() -> Vec<(&'static str, Value)> {
        let opened = json!({"name": "x", "experiment": "e1", "pool": "p1"});
        vec![("opened", opened), ("attempt", attempt(0)), ("attempt", attempt(1)), ("sealed", json!({"n": 2}))]
    }

    fn compared(change: impl Fn(&mut Vec<(&'static str, Value)>)) -> Differing {
        let dir = tempfile::tempdir().unwrap();
        let mut other = run();
        change(&mut other);
        compare(&written(dir.path(), "a", &run()), &written(dir.path(), "b", &other)).unwrap()
    }

    #[test]
    fn equal_runs_differ_in_nothing() {
        assert!(compared(|_| ()).is_nothing());
    }

    #[test]
    fn every_change_is_found_where_it_is_and_given_its_cause() {
        let set = |place: usize, field: &'static str, to: Value| {
            compared(move |run| *run[place].1.pointer_mut(field).unwrap() = to.clone())
        };
        let next = f64::from_bits(0.9f64.to_bits() + 1);
        let cases = [
            (2, "/proposal/exchanges/0/request", json!("cc"), Cause::Key),
            (2, "/proposal/exchanges/0/response", json!("cc"), Cause::Answer),
            (1, "/exit/score/objectives/realism", json!(0.8), Cause::Rollout),
            (1, "/exit/score/objectives/realism", json!(next), Cause::FloatBits),
            (2, "/exit/gates/0", json!("no"), Cause::Code),
        ];
        for (place, field, to, cause) in cases {
            let difference = set(place, field, to).first.unwrap();
            assert_eq!((difference.seq, difference.cause), (place, cause), "{field}");
            assert_eq!(difference.field.unwrap().field, field);
            assert_eq!(difference.of, format!("cat/e0s{}", place - 1));
        }
    }

    #[test]
    fn inputs_are_named_apart_from_the_first_event_behind_them() {
        let difference = compared(|run| {
            run[0].1["experiment"] = json!("e2");
            run[0].1["pool"] = json!("p2");
            run[2].1["exit"]["gates"][0] = json!("no");
        });
        let named: Vec<&str> = difference.inputs.iter().map(|parting| parting.field.as_str()).collect();
        assert_eq!(named, ["/experiment", "/pool"]);
        assert_eq!(difference.first.unwrap().seq, 2);
        // Other inputs, and every event the same.
        let renamed = compared(|run| run[0].1["name"] = json!("y"));
        assert!(renamed.first.is_none() && !renamed.is_nothing());
    }

    #[test]
    fn an_end_and_an_order_are_no_fields() {
        let cut = compared(|run| run.truncate(3)).first.unwrap();
        assert_eq!((cut.seq, cut.kinds, cut.cause), (3, [Some("sealed".into()), None], Cause::Unfinished));
        let swapped = compared(|run| run.swap(1, 2)).first.unwrap();
        assert_eq!((swapped.seq, swapped.cause), (1, Cause::Order));
    }
}
