//! Cassettes, replay and recording from the outside: keys, damage, misses, order.

use std::{
    collections::BTreeMap,
    path::Path,
    sync::atomic::{AtomicUsize, Ordering},
};

use evodrive::{
    kernel::Threads,
    llm::{
        Ask, AskError, Cassette, CassetteError, Completion, DrawSlot, Message, Metadata, Model, ModelError, ModelSpec,
        Record, RecordMode, Replay, Reply, Request, ResponseFormat, Schema,
    },
    store::{MemoKind, Store},
};
use serde_json::{Value, json};

fn slot(epoch: u32, slot: u32) -> DrawSlot {
    DrawSlot { lineage: "cat-idm".into(), epoch, slot, role: "actor".into(), round: 0 }
}

fn schema(value: Value) -> Schema {
    Schema::new(value).unwrap()
}

fn request(at: DrawSlot) -> Request {
    Request {
        adapter_version: 1,
        model: ModelSpec {
            name: "echo".into(),
            kind: "scripted".into(),
            model: "echo-1".into(),
            sampling: BTreeMap::from([("temperature".into(), 0.7)]),
            response_format: None,
            body: BTreeMap::new(),
            here: Default::default(),
        },
        messages: vec![
            Message { role: "system".into(), text: "You evolve programs.".into() },
            Message {
                role: "user".into(),
                text: format!("Parent: p\nEpoch {} slot {}\nEnd", at.epoch, at.slot).into(),
            },
        ],
        schema: schema(json!({"type": "object", "properties": {"b": 1, "a": 2.5}})),
        slot: at,
    }
}

/// Answers with the prompt it saw and counts its calls.
struct Echo<'a>(&'a AtomicUsize);

impl Model for Echo<'_> {
    fn complete(&self, request: &Request) -> Result<Completion, ModelError> {
        let call = self.0.fetch_add(1, Ordering::SeqCst);
        if request.messages.iter().any(|message| message.text.contains("fail")) {
            return Err(ModelError::Transport { address: "here".into(), attempts: 3, reason: "cable cut".into() });
        }
        let bytes = if call.is_multiple_of(2) { b"{\"even\": \"\xc3\xbc\"}".to_vec() } else { vec![0xff, 0x00, 0x10] };
        Ok(bytes.into())
    }
}

fn models(calls: &AtomicUsize) -> BTreeMap<String, Box<dyn Model + '_>> {
    BTreeMap::from([("echo".to_string(), Box::new(Echo(calls)) as Box<dyn Model + '_>)])
}

fn recorded() -> Cassette {
    let mut cassette = Cassette::new("test");
    for (n, at) in [slot(0, 0), slot(0, 1), slot(1, 0)].into_iter().enumerate() {
        let bytes = if n == 2 { vec![0xff, 0xfe, 0x0a] } else { format!("{{\"n\": {n}}}").into_bytes() };
        cassette.push(&request(at), bytes).unwrap();
    }
    cassette
}

fn miss_of(asked: &Request) -> evodrive::llm::Miss {
    match Replay::new(recorded(), "evodrive run x.toml --record-missing").ask(asked) {
        Err(AskError::Miss(miss)) => *miss,
        other => panic!("{other:?}"),
    }
}

#[test]
fn one_key_is_pinned() {
    let key = request(slot(2, 5)).key().unwrap().to_hex();
    assert_eq!(key, "d4d1148e779b02138e7ae6748d790d6e2ffbeaa1f8172fc892818caca0ba1231");
}

#[test]
fn each_field_changes_the_key() {
    let base = request(slot(0, 0));
    let changes: Vec<fn(&mut Request)> = vec![
        |r| r.adapter_version = 2,
        |r| r.slot.lineage = "at-idm".into(),
        |r| r.slot.epoch = 1,
        |r| r.slot.slot = 1,
        |r| r.slot.role = "repair".into(),
        |r| r.slot.round = 1,
        |r| r.model.name = "other".into(),
        |r| r.model.kind = "openai".into(),
        |r| r.model.model = "echo-2".into(),
        |r| r.model.sampling = BTreeMap::from([("temperature".into(), 0.700_000_000_000_000_1)]),
        |r| r.model.response_format = Some(ResponseFormat::JsonSchema),
        |r| r.model.response_format = Some(ResponseFormat::None),
        |r| drop(r.model.body.insert("cache_prompt".into(), json!(false))),
        |r| r.messages[0].role = "user".into(),
        |r| r.messages[1].text = format!("{} ", r.messages[1].text).into(),
        |r| r.messages.swap(0, 1),
        |r| drop(r.messages.pop()),
        |r| r.schema = schema(json!({"type": "object"})),
    ];
    let mut keys = std::collections::BTreeSet::from([base.key().unwrap()]);
    for (i, change) in changes.iter().enumerate() {
        let mut changed = base.clone();
        change(&mut changed);
        assert!(keys.insert(changed.key().unwrap()), "change {i} left the key as it was");
    }
}

#[test]
fn the_order_of_schema_keys_does_not_change_the_key() {
    let mut other = request(slot(0, 0));
    other.schema = schema(serde_json::from_str(r#"{"properties": {"a": 2.5, "b": 1}, "type": "object"}"#).unwrap());
    assert_eq!(other.key().unwrap(), request(slot(0, 0)).key().unwrap());
}

#[test]
fn neighbouring_texts_cannot_run_together() {
    let (mut one, mut two) = (request(slot(0, 0)), request(slot(0, 0)));
    (one.slot.lineage, one.slot.role) = ("ab".into(), "c".into());
    (two.slot.lineage, two.slot.role) = ("a".into(), "bc".into());
    assert_ne!(one.key().unwrap(), two.key().unwrap());
    (one.messages[0].text, one.messages[1].text) = ("ab".into(), "c".into());
    (two.messages[0].text, two.messages[1].text) = ("a".into(), "bc".into());
    two.slot = one.slot.clone();
    assert_ne!(one.key().unwrap(), two.key().unwrap());
}

#[test]
fn a_cassette_is_read_back_as_it_was_written_also_compressed() {
    let dir = tempfile::tempdir().unwrap();
    for name in ["a.jsonl", "a.jsonl.zst"] {
        let path = dir.path().join(name);
        recorded().save(&path, "test").unwrap();
        let read = Cassette::load(&path).unwrap();
        assert_eq!(read.exchanges(), recorded().exchanges());
        assert_eq!(read.to_bytes("test").unwrap(), recorded().to_bytes("test").unwrap());
    }
    let plain = std::fs::read(dir.path().join("a.jsonl")).unwrap();
    assert_eq!(String::from_utf8(plain).unwrap().matches("You evolve programs.").count(), 1);
    assert!(std::fs::read(dir.path().join("a.jsonl.zst")).unwrap().starts_with(&[0x28, 0xb5, 0x2f, 0xfd]));
    // A run folder keeps its copy under one name, whatever the original's.
    std::fs::copy(dir.path().join("a.jsonl.zst"), dir.path().join("copy.jsonl")).unwrap();
    assert_eq!(Cassette::load(&dir.path().join("copy.jsonl")).unwrap().exchanges(), recorded().exchanges());
}

#[test]
fn replay_gives_the_recorded_bytes() {
    let replay = Replay::new(recorded(), "");
    let reply = replay.ask(&request(slot(1, 0))).unwrap();
    assert_eq!(reply.bytes, vec![0xff, 0xfe, 0x0a]);
    assert_eq!(reply.request, request(slot(1, 0)).key().unwrap());
}

#[test]
fn every_changed_byte_of_an_exchange_is_refused_or_changes_nothing() {
    let bytes = recorded().to_bytes("test").unwrap();
    let header = bytes.iter().position(|b| *b == b'\n').unwrap();
    for at in header + 1..bytes.len() {
        let mut changed = bytes.clone();
        changed[at] ^= 1;
        match Cassette::parse(&changed, "x.jsonl") {
            Err(CassetteError::Damaged { line, .. }) => assert!(line > 1),
            Err(other) => panic!("byte {at}: {other}"),
            // A hex digit may change its case, the last line feed may go: nothing that is read differs.
            Ok(read) => assert_eq!(read.exchanges(), recorded().exchanges(), "byte {at}"),
        }
    }
}

#[test]
fn a_changed_reply_is_named_with_file_line_and_both_digests() {
    let text = String::from_utf8(recorded().to_bytes("test").unwrap()).unwrap();
    let changed = text.replace("{\\\"n\\\": 1}", "{\\\"n\\\": 7}");
    assert_ne!(text, changed);
    let error = Cassette::parse(changed.as_bytes(), "x.jsonl").unwrap_err().to_string();
    assert!(error.starts_with("x.jsonl line 7: expected digest of the reply "), "{error}");
    assert!(error.contains("restore the file"), "{error}");
}

#[test]
fn another_major_version_and_other_files_are_refused() {
    let text = String::from_utf8(recorded().to_bytes("test").unwrap()).unwrap();
    let newer = text.replacen("\"1.0\"", "\"2.0\"", 1);
    assert!(matches!(Cassette::parse(newer.as_bytes(), "x"), Err(CassetteError::Version { .. })));
    Cassette::parse(text.replacen("\"1.0\"", "\"1.9\"", 1).as_bytes(), "x").unwrap();
    for hostile in ["", "{}", "[[[[", "\u{0}", &"[".repeat(100_000)] {
        assert!(matches!(Cassette::parse(hostile.as_bytes(), "x"), Err(CassetteError::Damaged { line: 1, .. })));
    }
    assert!(Cassette::load(Path::new("no/such/file")).unwrap_err().to_string().contains("no/such/file"));
}

#[test]
fn two_answers_for_one_request_are_refused() {
    let mut cassette = recorded();
    cassette.push(&request(slot(0, 0)), b"{\"n\": 0}".to_vec()).unwrap();
    assert!(matches!(cassette.push(&request(slot(0, 0)), b"other".to_vec()), Err(CassetteError::TwoAnswers { .. })));
    let mut renamed = request(slot(5, 5));
    renamed.model.model = "echo-2".into();
    assert!(matches!(cassette.push(&renamed, vec![]), Err(CassetteError::TwoModels(_))));
    assert_eq!(cassette.exchanges().len(), 3);
}

#[test]
fn a_removed_line_is_a_miss_that_names_the_nearest_slot_and_the_remedy() {
    let text = String::from_utf8(recorded().to_bytes("test").unwrap()).unwrap();
    let key = request(slot(0, 1)).key().unwrap().to_hex();
    let kept: Vec<&str> = text.lines().filter(|line| !line.starts_with(&format!("{{\"exchange\":\"{key}\""))).collect();
    assert_eq!(kept.len() + 1, text.lines().count());
    let replay = Replay::new(Cassette::parse(kept.join("\n").as_bytes(), "x.jsonl").unwrap(), "evodrive record");
    let Err(AskError::Miss(miss)) = replay.ask(&request(slot(0, 1))) else { panic!("expected a miss") };
    assert_eq!(miss.nearest, Some(slot(0, 0)));
    assert_eq!(miss.difference.as_deref(), Some("slot/slot: recorded 0, asked 1"));
    let text = miss.to_string();
    assert!(text.contains("x.jsonl") && text.contains("to record it: evodrive record"), "{text}");
}

#[test]
fn a_changed_prompt_is_a_miss_that_shows_message_line_and_both_texts() {
    let mut asked = request(slot(0, 1));
    asked.messages[1].text = asked.messages[1].text.replace("slot 1", "slot one").into();
    let miss = miss_of(&asked);
    assert_eq!(miss.nearest, Some(slot(0, 1)));
    let expected = "message 2 (user) line 2: recorded \"Epoch 0 slot 1\", asked \"Epoch 0 slot one\"";
    assert_eq!(miss.difference.as_deref(), Some(expected));
    asked.messages[1].text = "Parent: p\nEpoch 0 slot 1".into();
    assert_eq!(miss_of(&asked).difference.unwrap(), "message 2 (user) line 3: recorded \"End\", asked no such line");
}

#[test]
fn a_changed_model_or_schema_is_a_miss_that_shows_both_values() {
    let mut asked = request(slot(0, 1));
    asked.model.sampling.insert("temperature".into(), 0.8);
    assert_eq!(miss_of(&asked).difference.unwrap(), "model/sampling/temperature: recorded 0.7, asked 0.8");
    let mut asked = request(slot(0, 1));
    asked.schema = schema(json!({"type": "object", "properties": {"b": 1, "a": 3}}));
    assert_eq!(miss_of(&asked).difference.unwrap(), "schema/properties/a: recorded 2.5, asked 3");
}

#[test]
fn the_nearest_exchange_is_of_the_same_lineage_and_role_if_there_is_one() {
    let mut cassette = recorded();
    let mut other = slot(7, 7);
    other.role = "repair".into();
    cassette.push(&request(other), vec![]).unwrap();
    let Err(AskError::Miss(miss)) = Replay::new(cassette, "").ask(&request(slot(7, 7))) else {
        panic!("expected a miss")
    };
    assert_eq!(miss.nearest, Some(slot(1, 0)));
    let Err(AskError::Miss(miss)) = Replay::new(Cassette::new("empty"), "").ask(&request(slot(0, 0))) else {
        panic!("expected a miss")
    };
    assert_eq!((miss.nearest, miss.difference), (None, None));
}

#[test]
fn a_recording_asks_once_and_its_cassette_does_not_depend_on_threads() {
    let slots: Vec<DrawSlot> = (0..24).map(|n| slot(n / 8, n % 8)).collect();
    let mut texts = Vec::new();
    for threads in [1, 4] {
        let dir = tempfile::tempdir().unwrap();
        let store = Store::open(dir.path()).unwrap();
        let calls = AtomicUsize::new(0);
        let constant: BTreeMap<String, Box<dyn Model>> =
            BTreeMap::from([("echo".into(), Box::new(Constant) as Box<dyn Model>)]);
        let record = Record::new(&store, Cassette::new(""), RecordMode::Missing, constant);
        let mut mixed = slots.clone();
        mixed.reverse();
        Threads::new(threads).unwrap().map(&mixed, |_, at| record.ask(&request(at.clone())).unwrap());
        texts.push(record.into_cassette("t", &slots).unwrap().to_bytes("t").unwrap());
        // Killed and started again: everything is in the memo.
        let record = Record::new(&store, Cassette::new(""), RecordMode::Missing, models(&calls));
        slots.iter().for_each(|at| drop(record.ask(&request(at.clone())).unwrap()));
        assert_eq!(calls.load(Ordering::SeqCst), 0);
        texts.push(record.into_cassette("t", &slots).unwrap().to_bytes("t").unwrap());
    }
    assert!(texts.windows(2).all(|pair| pair[0] == pair[1]));
    let read = Cassette::parse(&texts[0], "t").unwrap();
    assert_eq!(read.exchanges().iter().map(|e| e.slot.clone()).collect::<Vec<_>>(), slots);
}

struct Constant;

impl Model for Constant {
    fn complete(&self, request: &Request) -> Result<Completion, ModelError> {
        Ok(request.messages[1].text.as_bytes().to_vec().into())
    }
}

#[test]
fn record_missing_takes_what_the_cassette_has_and_asks_for_the_rest() {
    let dir = tempfile::tempdir().unwrap();
    let store = Store::open(dir.path()).unwrap();
    let calls = AtomicUsize::new(0);
    let record = Record::new(&store, recorded(), RecordMode::Missing, models(&calls));
    assert_eq!(record.ask(&request(slot(0, 1))).unwrap().bytes, b"{\"n\": 1}");
    assert_eq!(calls.load(Ordering::SeqCst), 0);
    record.ask(&request(slot(3, 0))).unwrap();
    assert_eq!((calls.load(Ordering::SeqCst), store.memo_len(MemoKind::Llm)), (1, 1));
    assert_eq!(record.into_cassette("t", &[slot(3, 0), slot(0, 1)]).unwrap().exchanges()[0].slot, slot(3, 0));
}

#[test]
fn record_fresh_asks_anew_but_not_twice_in_one_recording() {
    let dir = tempfile::tempdir().unwrap();
    let store = Store::open(dir.path()).unwrap();
    let calls = AtomicUsize::new(0);
    let ask = |recording: &str| {
        let mode = RecordMode::Fresh { recording: recording.into() };
        Record::new(&store, recorded(), mode, models(&calls)).ask(&request(slot(0, 0))).unwrap().bytes
    };
    let first = ask("monday");
    assert_eq!(ask("monday"), first);
    assert_eq!(calls.load(Ordering::SeqCst), 1);
    assert_ne!(ask("tuesday"), first);
    assert_eq!(calls.load(Ordering::SeqCst), 2);
}

/// Answers like a provider: with metadata.
struct Provider;

impl Model for Provider {
    fn complete(&self, _: &Request) -> Result<Completion, ModelError> {
        Ok(Completion { bytes: b"{}".to_vec(), metadata: Some(with_tokens(17)) })
    }
}

fn with_tokens(input_tokens: u64) -> Metadata {
    Metadata { model: "echo-1-exact".into(), input_tokens: Some(input_tokens), ..Metadata::default() }
}

/// The same of a model that has a provider.
fn provided(at: DrawSlot) -> Request {
    let mut request = request(at);
    request.model.kind = "command".into();
    request
}

#[test]
fn metadata_are_recorded_survive_a_kill_and_change_no_digest() {
    let dir = tempfile::tempdir().unwrap();
    let store = Store::open(dir.path()).unwrap();
    let providers = || BTreeMap::from([("echo".to_string(), Box::new(Provider) as Box<dyn Model>)]);
    let nobody = BTreeMap::new;
    let first =
        Record::new(&store, Cassette::new(""), RecordMode::Missing, providers()).ask(&provided(slot(0, 0))).unwrap();
    // Killed and started again, then from its own cassette: the metadata stay with the answer.
    let again = Record::new(&store, Cassette::new(""), RecordMode::Missing, nobody());
    assert_eq!(again.ask(&provided(slot(0, 0))).unwrap(), first);
    let text = again.into_cassette("t", &[]).unwrap().to_bytes("t").unwrap();
    let read = Cassette::parse(&text, "t").unwrap();
    assert_eq!(read.exchanges()[0].metadata, Some(with_tokens(17)));
    let third = Record::new(&store, read, RecordMode::Missing, nobody());
    third.ask(&provided(slot(0, 0))).unwrap();
    assert_eq!(third.into_cassette("t", &[]).unwrap().to_bytes("t").unwrap(), text);
    let mut without = Cassette::new("t");
    without.push(&provided(slot(0, 0)), b"{}".to_vec()).unwrap();
    let bare = Replay::new(without, "").ask(&provided(slot(0, 0))).unwrap();
    assert_eq!(bare, Reply { metadata: None, sealed_metadata: None, ..first });
}

#[test]
fn a_cassette_says_the_lowest_version_that_holds_it_and_changed_metadata_are_refused() {
    assert!(recorded().to_bytes("t").unwrap().starts_with(b"{\"format\":\"evodrive-cassette\",\"version\":\"1.0\""));
    let mut cassette = Cassette::new("t");
    cassette.push_with(&provided(slot(0, 0)), b"{}".to_vec(), Some(with_tokens(17))).unwrap();
    let text = String::from_utf8(cassette.to_bytes("t").unwrap()).unwrap();
    assert!(text.starts_with("{\"format\":\"evodrive-cassette\",\"version\":\"1.2\""), "{text}");
    for (from, to) in [(":17", ":18"), ("-exact", "-wrong"), (",\"metadata_digest\"", ",\"reply_hexx\"")] {
        let error = Cassette::parse(text.replacen(from, to, 1).as_bytes(), "x").unwrap_err();
        assert!(matches!(error, CassetteError::Damaged { .. }), "{error}");
    }
}

#[test]
fn what_a_provider_said_is_sealed_by_runs_on_new_cassettes_and_not_on_those_that_came_before() {
    let mut cassette = Cassette::new("t");
    cassette.push_with(&provided(slot(0, 0)), b"{}".to_vec(), Some(with_tokens(17))).unwrap();
    let new = String::from_utf8(cassette.to_bytes("t").unwrap()).unwrap();
    let old = new.replacen("\"1.2\"", "\"1.1\"", 1);
    let sealed = |text: &str| {
        let read = Cassette::parse(text.as_bytes(), "t").unwrap();
        assert_eq!(read.to_bytes("t").unwrap(), text.as_bytes(), "it is written as it was");
        Replay::new(read, "").ask(&provided(slot(0, 0))).unwrap().sealed_metadata
    };
    assert_eq!((sealed(&new), sealed(&old)), (with_tokens(17).digest().ok(), None));
    // A recording that goes on with an old cassette leaves its run's root as it is; one that begins anew does not.
    let dir = tempfile::tempdir().unwrap();
    let store = Store::open(dir.path()).unwrap();
    let providers = || BTreeMap::from([("echo".to_string(), Box::new(Provider) as Box<dyn Model>)]);
    let before = || Cassette::parse(old.as_bytes(), "t").unwrap();
    let goes_on = Record::new(&store, before(), RecordMode::Missing, providers());
    for place in [0, 1] {
        assert_eq!(goes_on.ask(&provided(slot(0, place))).unwrap().sealed_metadata, None);
    }
    let text = goes_on.into_cassette("t", &[]).unwrap().to_bytes("t").unwrap();
    assert!(text.starts_with(b"{\"format\":\"evodrive-cassette\",\"version\":\"1.1\""));
    let mode = RecordMode::Fresh { recording: "first".into() };
    let anew = Record::new(&store, before(), mode, providers());
    assert!(anew.ask(&provided(slot(0, 0))).unwrap().sealed_metadata.is_some());
}

#[test]
fn the_scripted_model_has_no_provider_that_could_have_said_something() {
    let scripted = || {
        let mut request = request(slot(0, 0));
        request.model.kind = "scripted".into();
        request
    };
    let mut cassette = Cassette::new("t");
    cassette.push_with(&scripted(), b"{}".to_vec(), Some(with_tokens(17))).unwrap();
    let error = Cassette::parse(&cassette.to_bytes("t").unwrap(), "x").unwrap_err().to_string();
    assert!(error.contains("no metadata: the scripted model has no provider"), "{error}");
    let mut bare = Cassette::new("t");
    bare.push(&scripted(), b"{}".to_vec()).unwrap();
    assert!(Cassette::parse(&bare.to_bytes("t").unwrap(), "x").is_ok());
}

#[test]
fn a_transport_error_leaves_no_trace_in_the_memo() {
    let dir = tempfile::tempdir().unwrap();
    let store = Store::open(dir.path()).unwrap();
    let calls = AtomicUsize::new(0);
    let record = Record::new(&store, Cassette::new(""), RecordMode::Missing, models(&calls));
    let mut asked = request(slot(0, 0));
    asked.messages[1].text = "fail".into();
    let error = record.ask(&asked).unwrap_err();
    assert!(matches!(&error, AskError::Model { model, .. } if model == "echo"), "{error}");
    assert!(error.to_string().contains("cable cut"), "{error}");
    asked.model.name = "other".into();
    assert!(record.ask(&asked).unwrap_err().to_string().contains("there are: echo"));
    assert_eq!(store.memo_len(MemoKind::Llm), 0);
    assert_eq!(record.into_cassette("t", &[]).unwrap().exchanges().len(), 0);
}

/// Answers every question with the same words.
struct Says(&'static str);

impl Model for Says {
    fn complete(&self, _: &Request) -> Result<Completion, ModelError> {
        Ok(self.0.as_bytes().to_vec().into())
    }
}

#[test]
fn after_three_refusals_of_one_kind_it_is_told_once_what_to_set() {
    let by_kind = |kind: &str, says: &'static str, unwrap: bool, questions: u32| {
        let dir = tempfile::tempdir().unwrap();
        let store = Store::open(dir.path()).unwrap();
        let lines = std::sync::Mutex::new(Vec::new());
        let tell = |line: &str| lines.lock().unwrap().push(line.to_string());
        let models: BTreeMap<String, Box<dyn Model>> =
            BTreeMap::from([("echo".into(), Box::new(Says(says)) as Box<dyn Model>)]);
        let record = Record::new(&store, Cassette::new(""), RecordMode::Missing, models).telling(&tell);
        for n in 0..questions {
            let mut asked = request(slot(0, n));
            asked.model.here.unwrap = unwrap;
            asked.model.kind = kind.into();
            record.ask(&asked).unwrap();
        }
        drop(record);
        lines.into_inner().unwrap()
    };
    let with_tokens = |says, unwrap, questions| by_kind("openai_compatible", says, unwrap, questions);
    let fenced = "```json\n{}\n```";
    let lines = with_tokens(fenced, false, 5);
    assert!(lines.len() == 1 && lines[0].contains("unwrap = true in [models.echo]"), "{lines:?}");
    assert_eq!(with_tokens(fenced, false, 2), Vec::<String>::new());
    assert_eq!(with_tokens(fenced, true, 5), Vec::<String>::new());
    assert_eq!(with_tokens("{\"a\": 1}", false, 5), Vec::<String>::new());
    assert_eq!(by_kind("scripted", fenced, false, 5), Vec::<String>::new(), "there is nothing to set");
}
