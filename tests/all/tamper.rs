//! Tampering and bit rot: what `fsck --read`, `check` and `verify` find in a finished run that somebody changed, and by which name.

use evodrive::store::{Event, SEALED, Transcript, read_events};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

use crate::bundle::imported;
use crate::harness::{evodrive, home, named_folder, run, write_small};
use crate::short::{copied, finished};

/// Command that finds it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum By {
    /// `fsck --read`, exit code 5.
    Fsck,
    /// `check`, exit code 4.
    Check,
}

/// One way to tamper with a run.
struct Class {
    name: &'static str,
    by: By,
    /// Word that must be said of it.
    word: &'static str,
    how: How,
}

enum How {
    /// A change of a file's text.
    Text(&'static str, fn(&str) -> String),
    /// A change of a file's bytes, the draw with it.
    Bytes(&'static str, fn(&mut Vec<u8>, usize)),
    /// A value of an event of this kind, changed at the first of these places that it has; the chain and the result's file are made
    /// anew, as somebody would do to hide the change.
    Event(&'static str, &'static str),
    /// The same by a change of all events.
    Events(fn(&mut Vec<Said>)),
}

/// Kind and body of an event.
type Said = (String, Value);

const fn class(name: &'static str, by: By, word: &'static str, how: How) -> Class {
    Class { name, by, word, how }
}

fn cut_lines(text: &str, from_end: usize) -> String {
    let lines: Vec<&str> = text.lines().collect();
    lines[..lines.len() - from_end].iter().map(|line| format!("{line}\n")).collect()
}

/// Puts an event behind the seal that continues its chain.
fn appended(text: &str) -> String {
    let sealed: Event = serde_json::from_str(text.lines().last().unwrap()).unwrap();
    let body = json!({"rate": 1.0});
    let (seq, prev, kind) = (sealed.seq + 1, sealed.hash, "held_out");
    let hash = evodrive::kernel::Digest::of("evodrive/transcript-event/1", &(seq, prev, kind, &body)).unwrap();
    let event = json!({"body": body, "hash": hash, "kind": kind, "prev": prev, "seq": seq});
    format!("{text}{event}\n")
}

fn swapped_lines(text: &str) -> String {
    let mut lines: Vec<&str> = text.lines().collect();
    lines.swap(4, 5);
    lines.iter().map(|line| format!("{line}\n")).collect()
}

fn swapped_pages(bytes: &mut [u8], page: usize, draw: usize) {
    let pages = bytes.len() / page;
    let (one, other) = (draw % pages, (draw + 1 + draw / pages) % pages);
    for at in 0..page {
        bytes.swap(one * page + at, other * page + at);
    }
}

fn flip(bytes: &mut [u8], draw: usize) {
    let at = draw * 7919 % bytes.len();
    bytes[at] ^= 1 << (draw % 8);
}

/// An exchange's reply, with a digest that fits it.
fn other_reply(text: &str) -> String {
    let line = text.lines().find(|line| line.starts_with("{\"exchange\"") && line.contains("\"reply\"")).unwrap();
    let mut exchange: Value = serde_json::from_str(line).unwrap();
    exchange["reply"] = json!("{}");
    exchange["response"] = json!(evodrive::kernel::Digest::of_bytes(b"{}"));
    text.replacen(line, &exchange.to_string(), 1)
}

fn of_kind<'e>(events: &'e mut [Said], kind: &str) -> Vec<&'e mut Value> {
    events.iter_mut().filter(|(own, _)| own == kind).map(|(_, body)| body).collect()
}

/// The first evaluated attempt.
fn evaluated(events: &mut [Said]) -> &mut Value {
    of_kind(events, "attempt")
        .into_iter()
        .find(|body| body["exit"]["exit"] == "evaluated")
        .expect("an evaluated attempt")
}

/// A number of one held-out label is made better, and everything that is computed from it fits: labels, means, result.
fn forged_label(events: &mut [Said]) {
    let held_out = of_kind(events, "held_out").into_iter().next().unwrap();
    let solution = held_out["solution"].clone();
    let scenes = held_out["score"]["scenes"].as_array_mut().unwrap();
    let label = scenes
        .iter_mut()
        .find(|label| label["acted"] == true && label["realism"].as_f64() < Some(0.99))
        .expect("a label");
    label["realism"] = json!(0.999);
    let labels: Vec<evodrive::objects::SceneScore> = serde_json::from_value(json!(scenes)).unwrap();
    let realism = evodrive::objects::RealismSums::of(&labels).realism(Default::default()).unwrap();
    let all = labels.iter().map(|label| label.realism).sum::<f64>() / labels.len() as f64;
    held_out["score"]["objectives"]["realism"] = json!(realism);
    held_out["score"]["realism_all"] = json!(all);
    let sealed = of_kind(events, SEALED).into_iter().next().unwrap();
    for lineage in sealed["lineages"].as_array_mut().unwrap() {
        for role in ["parent", "evolved", "endpoint"] {
            if lineage[role]["solution"] == solution {
                lineage[role]["objectives"]["realism"] = json!(realism);
                lineage[role]["realism_penalty_pct"] = json!(100.0 * (1.0 - realism));
            }
        }
    }
}

#[rustfmt::skip]
fn classes() -> Vec<Class> {
    use By::{Check, Fsck};
    use How::{Bytes, Event, Events, Text};
    vec![
        // Bytes of files.
        class("a byte of the transcript", Fsck, "transcript.jsonl", Bytes("transcript.jsonl", |b, d| flip(b, d))),
        class("a byte of the cassette", Fsck, "cassette.jsonl", Bytes("cassette.jsonl", |b, d| flip(b, d))),
        class("a byte of the pool", Fsck, "scenes.pool", Bytes("scenes.pool", |b, d| flip(b, d))),
        class("a byte of the pack", Fsck, "objects.pack", Bytes("store/objects.pack", |b, d| flip(b, d))),
        class("pages of the pack swapped", Fsck, "objects.pack", Bytes("store/objects.pack", |b, d| swapped_pages(b, 4096, d))),
        class("pages of the pool swapped", Fsck, "scenes.pool", Bytes("scenes.pool", |b, d| swapped_pages(b, 4096, d))),
        class("the pack cut", Fsck, "objects.pack", Bytes("store/objects.pack", |b, d| b.truncate(b.len() - 1 - d % 1000))),
        class("the pool cut", Fsck, "scenes.pool", Bytes("scenes.pool", |b, d| b.truncate(b.len() - 1 - d % 1000))),
        class("the index emptied of its pages", Fsck, "index.sqlite", Bytes("store/index.sqlite", |b, _| b[4096..].fill(0))),
        class("the transcript emptied", Fsck, "transcript.jsonl", Text("transcript.jsonl", |_| String::new())),
        class("the cassette emptied", Fsck, "cassette.jsonl", Text("cassette.jsonl", |_| String::new())),
        class("the experiment emptied", Fsck, "experiment.toml", Text("experiment.toml", |_| String::new())),
        class("a number of the experiment", Fsck, "experiment.toml", Text("experiment.toml", |text| text.replacen("seed = ", "seed = 1", 1))),
        class("a figure of the result's file", Fsck, "result.json", Text("result.json", |text| text.replacen("\"coverage\": ", "\"coverage\": -", 1))),
        class("the root of the result's file", Fsck, "/root", Text("result.json", |text| text.replacen("\"root\": \"", "\"root\": \"00", 1))),
        // Lines of the transcript, the chain left as it is.
        class("the seal cut off", Fsck, "to end with a seal", Text("transcript.jsonl", |text| cut_lines(text, 1))),
        class("the last twenty events cut off", Fsck, "to end with a seal", Text("transcript.jsonl", |text| cut_lines(text, 20))),
        class("an event behind the seal", Fsck, "behind the seal", Text("transcript.jsonl", appended)),
        class("two events swapped", Fsck, "seq: expected", Text("transcript.jsonl", swapped_lines)),
        class("an event taken out", Fsck, "seq: expected", Text("transcript.jsonl", |text| text.replacen(&format!("{}\n", text.lines().nth(4).unwrap()), "", 1))),
        class("an event doubled", Fsck, "seq: expected", Text("transcript.jsonl", |text| text.replacen(text.lines().nth(4).unwrap(), &format!("{0}\n{0}", text.lines().nth(4).unwrap()), 1))),
        class("an event spelled otherwise", Fsck, "another spelling", Text("transcript.jsonl", |text| text.replacen(",\"seq\":3}", ", \"seq\":3}", 1))),
        // Answers.
        class("an answer with a digest that fits", Fsck, "found another one", Text("cassette.jsonl", other_reply)),
        class("the last answer taken away", Fsck, "found none", Text("cassette.jsonl", |text| cut_lines(text, 1))),
        class("an answer's digest in the record", Fsck, "found another one", Event("attempt", "/proposal/exchanges/0/response")),
        class("a question's key in the record", Fsck, "found none", Event("attempt", "/proposal/exchanges/0/request")),
        // The record, chained anew: what contradicts itself.
        class("a scene's attack", Fsck, "breach (labels)", Events(|events| { let s = &mut evaluated(events)["exit"]["score"]["scenes"][0]["attack"]; *s = json!(1.0 - s.as_f64().unwrap()); })),
        class("a score's realism", Fsck, "breach (labels)", Events(|events| evaluated(events)["exit"]["score"]["objectives"]["realism"] = json!(0.999))),
        class("a score's coverage", Fsck, "breach (labels)", Events(|events| evaluated(events)["exit"]["score"]["coverage"] = json!(0.123))),
        class("a label of a closed scene", Fsck, "breach (closed suite)", Events(|events| {
            let closed = of_kind(events, "opened")[0]["held_out_scenes"][0].clone();
            evaluated(events)["exit"]["score"]["scenes"][0]["scene"] = closed;
        })),
        class("a scene in both suites", Fsck, "breach (closed suite)", Events(|events| {
            let mut opened = of_kind(events, "opened");
            let closed = opened[0]["held_out_scenes"][0].clone();
            opened[0]["evolution_scenes"].as_array_mut().unwrap().push(closed);
        })),
        class("a proposal taken out", Fsck, "breach (epochs)", Events(|events| { let at = events.iter().position(|(kind, _)| kind == "attempt").unwrap(); events.remove(at); })),
        class("a proposal under another name", Fsck, "breach (epochs)", Event("attempt", "/id")),
        class("another parent of a proposal", Fsck, "breach (epochs)", Event("attempt", "/parent_hash")),
        class("a route turned round", Fsck, "breach (epochs)", Events(|events| evaluated(events)["exit"]["route"]["decision"] = json!("reject"))),
        class("a promotion that was none", Fsck, "breach (epochs)", Events(|events| { let p = &mut evaluated(events)["exit"]["decision"]["promoted"]; *p = json!(!p.as_bool().unwrap()); })),
        class("a parameter of a program", Fsck, "breach (continuity)", Events(|events| {
            let parameters = evaluated(events)["exit"]["candidate"]["program"]["parameters"].as_object_mut().unwrap();
            let first = parameters.keys().next().unwrap().clone();
            parameters.remove(&first);
        })),
        class("the hash of a program", Fsck, "breach (continuity)", Events(|events| {
            let hash = &mut evaluated(events)["exit"]["candidate"]["program_hash"];
            *hash = altered(hash, 1);
        })),
        class("another active program", Fsck, "breach (continuity)", Event("settled", "/active")),
        class("a point of the front", Fsck, "breach (front)", Event("settled", "/front/0/objectives/attack")),
        class("a member of the front that nobody accepted", Fsck, "breach (front)", Event("settled", "/front/0/solution")),
        class("how many proposals left by an exit", Fsck, "breach (result)", Event(SEALED, "/exits/declined")),
        class("a figure of the sealed result", Fsck, "breach (result)", Event(SEALED, "/lineages/0/evolved/objectives/attack")),
        class("crashes in the sealed result", Fsck, "breach (result)", Event(SEALED, "/lineages/0/evolved/any_contact")),
        // The record, chained anew: what does not contradict itself, and is not what comes out.
        class("a held-out label with all that follows from it", Check, "held_out", Events(|events| forged_label(events))),
        class("the frontier gain in the result", Check, "/pf_area_at_3_pct", Event(SEALED, "/lineages/0/pf_area_at_3_pct")),
        class("why a program was chosen", Check, "/selection", Event(SEALED, "/lineages/0/selection")),
        class("a hypervolume", Check, "/hypervolume", Event("settled", "/hypervolume")),
        class("the digest of the state", Check, "/state", Event("settled", "/state")),
        class("the world evaluator's snapshot", Check, "/world", Event("frozen", "/world")),
        class("the digest of a rollout's record", Check, "/record", Event("held_out", "/score/scenes/0/record")),
        class("the key of a rollout", Check, "/request", Event("held_out", "/score/scenes/0/request")),
        class("the contact in a replay", Check, "/contact", Event("replay", "/scenes/0/contact")),
        class("the name of a model", Check, "/models", Event("opened", "/models/actor")),
        class("a version", Check, "/versions", Event("opened", "/versions/sim")),
        class("what a slot was asked for", Check, "/target", Event("attempt", "/target")),
        class("a hypothesis", Check, "/hypothesis", Event("attempt", "/proposal/rounds/0/patch/hypothesis")),
        class("a review", Check, "/reviews", Event("attempt", "/proposal/rounds/0/reviews/0/risk_tags/0")),
        class("a label of a finalist", Check, "finalist", Event("finalist", "/score/scenes/0/diagnostics/bounded_jerk")),
        class("the roles of a program", Check, "/roles", Event("held_out", "/roles/0")),
    ]
}

/// Another value of the same kind.
fn altered(value: &Value, draw: usize) -> Value {
    match value {
        Value::Bool(is) => json!(!is),
        Value::Number(number) if number.is_f64() => json!(number.as_f64().unwrap() + 0.0625),
        Value::Number(number) => json!(number.as_i64().unwrap() + 1),
        Value::String(text) if text.len() == 64 && text.chars().all(|c| c.is_ascii_hexdigit()) => {
            let at = draw % 64;
            let digit = if text.as_bytes()[at] == b'0' { "1" } else { "0" };
            json!(format!("{}{digit}{}", &text[..at], &text[at + 1..]))
        }
        Value::String(text) => json!(format!("{text}s9")),
        other => panic!("{other} cannot be altered"),
    }
}

/// Writes a transcript anew with other events, and the file of the result that fits it.
fn rechain(folder: &Path, change: impl FnOnce(&mut Vec<Said>)) {
    let path = folder.join("transcript.jsonl");
    let mut events: Vec<Said> = read_events(&path).unwrap().into_iter().map(|event| (event.kind, event.body)).collect();
    change(&mut events);
    std::fs::remove_file(&path).unwrap();
    let mut transcript = Transcript::create(&path).unwrap();
    let (sealed, before) = events.split_last().unwrap();
    for (kind, body) in before {
        transcript.append(kind, body).unwrap();
    }
    let root = transcript.seal(&sealed.1).unwrap();
    transcript.flush().unwrap();
    let result = json!({"root": root, "result": sealed.1});
    std::fs::write(folder.join("result.json"), serde_json::to_vec_pretty(&result).unwrap()).unwrap();
}

impl Class {
    fn tamper(&self, folder: &Path, draw: usize) {
        match self.how {
            How::Text(file, change) => {
                let path = folder.join(file);
                let (before, path) = (std::fs::read_to_string(&path).unwrap(), path);
                let after = change(&before);
                assert_ne!(before, after, "{} changes nothing", self.name);
                std::fs::write(path, after).unwrap();
            }
            How::Bytes(file, change) => {
                let path = folder.join(file);
                let before = std::fs::read(&path).unwrap();
                let mut after = before.clone();
                change(&mut after, draw);
                assert_ne!(before, after, "{} changes nothing", self.name);
                std::fs::write(path, after).unwrap();
            }
            How::Event(kind, place) => rechain(folder, |events| {
                let mut of = of_kind(events, kind);
                of.retain(|body| body.pointer(place).is_some_and(|found| !found.is_null()));
                assert!(!of.is_empty(), "{}: no {kind} with {place}", self.name);
                let chosen = draw % of.len();
                let value = of[chosen].pointer_mut(place).unwrap();
                *value = altered(value, draw);
            }),
            How::Events(change) => rechain(folder, change),
        }
    }

    /// Returns `true` if a later command finds what the one that should has not: drawn elsewhere, a change may contradict nothing.
    fn caught_later(&self, folder: &Path) -> bool {
        self.by == By::Fsck && [4, 5].contains(&run(&["check", folder.to_str().unwrap()]).code)
    }

    /// Checks that the command that should find it does, under the right name; else returns what it said.
    fn caught(&self, folder: &Path) -> Result<(), String> {
        let dir = folder.to_str().unwrap();
        let (ran, code) = match self.by {
            By::Fsck => (run(&["fsck", "--read", dir]), 5),
            By::Check => (run(&["check", dir]), 4),
        };
        let said = format!("{}{}", ran.stdout, ran.stderr);
        if ran.code == code && said.contains(self.word) { Ok(()) } else { Err(format!("exit {}: {said}", ran.code)) }
    }
}

/// Tampers with a copy of the finished run and says what was not caught.
fn not_caught(class: &Class, draw: usize) -> Option<String> {
    let dir = tempfile::tempdir().unwrap();
    let folder = copied(dir.path());
    class.tamper(&folder, draw);
    let missed = class.caught(&folder).err().filter(|_| draw == 0 || !class.caught_later(&folder));
    missed.map(|said| format!("{} (draw {draw}): {said}", class.name))
}

#[test]
fn tampering_is_found_and_named_by_fsck() {
    let classes = classes();
    assert!(classes.len() >= 40, "{}", classes.len());
    let missed: Vec<String> =
        classes.iter().filter(|of| of.by == By::Fsck).filter_map(|of| not_caught(of, 0)).collect();
    assert!(missed.is_empty(), "{}", missed.join("\n\n"));
}

#[test]
fn what_does_not_contradict_itself_is_found_by_deriving_it_again() {
    let drawn = ["a held-out label with all that follows from it", "the frontier gain in the result", "a review"];
    for class in classes().iter().filter(|class| drawn.contains(&class.name)) {
        let dir = tempfile::tempdir().unwrap();
        let folder = copied(dir.path());
        class.tamper(&folder, 0);
        let ran = run(&["fsck", "--read", folder.to_str().unwrap()]);
        assert_eq!(ran.code, 0, "{}: the record agrees with itself: {}", class.name, ran.stdout);
        class.caught(&folder).unwrap_or_else(|said| panic!("{}: {said}", class.name));
    }
}

/// Returns the number of times that each trial of the full form is made: `EVODRIVE_TRIALS`, else 20.
fn trials() -> usize {
    named_folder("EVODRIVE_TRIALS").and_then(|count| count.to_str()?.parse().ok()).unwrap_or(20)
}

#[test]
#[ignore = "some thousand commands: .ci/tamper --full"]
fn every_class_of_tampering_is_found_each_time() {
    let (mut made, mut missed) = (0, Vec::new());
    for class in classes() {
        for draw in 0..trials() {
            made += 1;
            missed.extend(not_caught(&class, 31 * draw + 1));
        }
    }
    println!("{} classes, {made} trials, {} missed", classes().len(), missed.len());
    assert!(missed.len() * 1000 <= 5 * made, "{}", missed.join("\n\n"));
}

/// Files of the folder that the seal or the store's own digests speak for.
const COVERED: [&str; 5] = ["transcript.jsonl", "cassette.jsonl", "scenes.pool", "store/objects.pack", "result.json"];

/// Runs `fsck --read` on a folder with one file in place of another; returns whether it names the file, and what it says.
fn found(folder: &Path, file: &str, bytes: &[u8]) -> (bool, String) {
    let whole = std::fs::read(folder.join(file)).unwrap();
    std::fs::write(folder.join(file), bytes).unwrap();
    let ran = run(&["fsck", "--read", folder.to_str().unwrap()]);
    std::fs::write(folder.join(file), &whole).unwrap();
    let said = format!("{}{}", ran.stdout, ran.stderr);
    let name = Path::new(file).file_name().unwrap().to_str().unwrap();
    // Other lines name the files that are whole.
    let named = ran.stdout.lines().filter(|line| line.starts_with("damaged: ")).chain(ran.stderr.lines());
    (ran.code == 5 && named.into_iter().any(|line| line.contains(name)), said)
}

/// One kind of rot in one file, by its draw; `None` where it leaves the file as it was.
fn rotten(whole: &[u8], kind: usize, draw: usize) -> Option<Vec<u8>> {
    let mut bytes = whole.to_vec();
    match kind {
        0 => flip(&mut bytes, draw),
        1 => bytes.truncate(draw * 104_729 % bytes.len()),
        _ if bytes.len() < 3 * 512 => return None,
        _ => swapped_pages(&mut bytes, 512, draw),
    }
    (bytes != whole).then_some(bytes)
}

/// Rots files and returns trials and those that were not found. What a file means is what is covered: blanks between the figures of the
/// result's file say nothing.
fn rot(folder: &Path, kinds: [usize; 3]) -> (usize, Vec<String>) {
    let (mut made, mut missed) = (0, Vec::new());
    for (kind, count) in kinds.into_iter().enumerate() {
        for draw in 0..count {
            let file = COVERED[draw % COVERED.len()];
            let whole = std::fs::read(folder.join(file)).unwrap();
            let Some(bytes) = rotten(&whole, kind, draw + 1) else { continue };
            let json = |bytes: &[u8]| serde_json::from_slice::<Value>(bytes).ok();
            if file == "result.json" && json(&bytes).is_some() && json(&bytes) == json(&whole) {
                continue;
            }
            made += 1;
            let (is_found, said) = found(folder, file, &bytes);
            if !is_found {
                missed.push(format!("{file}, kind {kind}, draw {draw}: {said}"));
            }
        }
    }
    (made, missed)
}

#[test]
fn bit_rot_in_covered_files_is_found_and_the_file_named() {
    let dir = tempfile::tempdir().unwrap();
    let (made, missed) = rot(&copied(dir.path()), [10, 5, 5]);
    assert!(made >= 15 && missed.is_empty(), "{made}: {}", missed.join("\n\n"));
}

#[test]
fn a_pack_cut_between_two_records_is_found_by_what_the_events_name_where_no_index_is() {
    let dir = tempfile::tempdir().unwrap();
    let folder = imported(dir.path());
    let pack = folder.join("store/objects.pack");
    let whole = std::fs::read(&pack).unwrap();
    // A record is a header of 56 bytes, whose second eight are the length of what follows (docs/FORMAT.md).
    let next = |at: usize| at + 56 + u64::from_le_bytes(whole[at + 8..at + 16].try_into().unwrap()) as usize;
    let ends: Vec<usize> = std::iter::successors(Some(next(0)), |at| Some(next(*at))).take(12).collect();
    for end in [ends[0], ends[1], ends[11]] {
        let (is_found, said) = found(&folder, "store/objects.pack", &whole[..end]);
        assert!(is_found && said.contains("rollouts that the sealed events name"), "cut at {end}: {said}");
    }
    // It counts which are there, not how many: one rollout taken out with its entry leaves more objects than are named.
    let without: Vec<u8> = [&whole[..ends[9]], &whole[ends[11]..]].concat();
    let (is_found, said) = found(&folder, "store/objects.pack", &without);
    assert!(is_found && said.contains("rollouts that the sealed events name, 1 of them"), "{said}");
    // A store that holds nothing at all is a note.
    std::fs::write(&pack, []).unwrap();
    let ran = run(&["fsck", "--read", folder.to_str().unwrap()]);
    assert!(ran.code == 0 && ran.stdout.contains("the store is empty"), "{} {}", ran.code, ran.stdout);
}

#[test]
fn another_spelling_of_the_same_digest_is_damage() {
    let dir = tempfile::tempdir().unwrap();
    let folder = copied(dir.path());
    let whole = std::fs::read_to_string(folder.join("cassette.jsonl")).unwrap();
    for key in ["\"text\":\"", "\"schema\":\"", "\"response\":\""] {
        let from = whole.match_indices(key).map(|(at, _)| at + key.len());
        let is_digest = |at: &usize| whole[*at..].bytes().take(64).all(|byte| byte.is_ascii_hexdigit());
        let at = from.clone().find(is_digest).unwrap();
        let mut bytes = whole.clone().into_bytes();
        bytes[at..at + 64].make_ascii_uppercase();
        assert_ne!(bytes, whole.as_bytes());
        let (is_found, said) = found(&folder, "cassette.jsonl", &bytes);
        assert!(is_found, "{key} {said}");
    }
}

#[test]
#[ignore = "some thousand commands: .ci/tamper --full"]
fn every_flip_truncation_and_swap_is_found() {
    let trials = trials();
    let dir = tempfile::tempdir().unwrap();
    // A small run: the draw is as dense in its files as it can be. The first command that opens its store makes the index.
    let folder = imported(dir.path());
    assert_eq!(run(&["check", folder.to_str().unwrap()]).code, 0);
    assert!(folder.join("store/index.sqlite").exists());
    let (made, missed) = rot(&folder, [10 * trials, trials, trials]);
    println!("{made} rotten files, {} not found", missed.len());
    assert!(missed.is_empty(), "{}", missed.join("\n\n"));
}

#[test]
#[ignore = "some thousand commands: .ci/tamper --full"]
fn clean_copies_raise_no_alarm() {
    for copy in 0..trials() {
        let dir = tempfile::tempdir().unwrap();
        let folder = if copy % 2 == 0 { imported(dir.path()) } else { copied(dir.path()) };
        let ran = run(&["fsck", "--read", folder.to_str().unwrap()]);
        assert_eq!(ran.code, 0, "copy {copy}: {}", ran.stdout);
    }
}

#[test]
fn a_run_that_was_derived_from_other_answers_is_sound_and_has_another_root() {
    // Whoever makes a whole run anew contradicts nothing; only the root, if somebody else has told it, shows that it is another run.
    let dir = tempfile::tempdir().unwrap();
    let mut table = crate::short::table();
    table["name"] = "quicker".into();
    let path = write_small(dir.path(), table);
    let cassette = finished().experiment.with_file_name("small.jsonl");
    let out = dir.path().join("runs");
    let place = |path: &Path| path.to_str().unwrap().to_string();
    let ran = run(&["run", &place(&path), "--cassette", &place(&cassette), "--out", &place(&out), "--no-report"]);
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    let folder = crate::harness::folder_below(&out);
    assert_eq!(run(&["fsck", "--read", folder.to_str().unwrap()]).code, 0);
    let original = std::fs::read_to_string(finished().run.join("result.json")).unwrap();
    assert!(!original.contains(&ran.root()));
}

/// Texts that a folder must not hold: who ran it, where, as which process.
fn tells(bytes: &[u8], text: &str) -> bool {
    text.len() > 3 && bytes.windows(text.len()).any(|window| window == text.as_bytes())
}

fn files_below(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() { files_below(&path, found) } else { found.push(path) }
    }
}

#[test]
fn no_kept_file_says_who_ran_it_where_or_as_which_process() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("canary-place");
    let mut child = evodrive()
        .args(["run", finished().experiment.to_str().unwrap(), "--out", out.to_str().unwrap()])
        .env("USER", "canary-user")
        .env("LOGNAME", "canary-user")
        .env("HOME", "/canary-home")
        .env("HOSTNAME", "canary-host")
        .env("MY_API_KEY", "canary-secret")
        .stdout(std::process::Stdio::null())
        .stderr(std::process::Stdio::null())
        .spawn()
        .unwrap();
    let process = child.id().to_string();
    assert!(child.wait().unwrap().success());
    let folder = crate::harness::folder_below(&out);
    let mut kept = Vec::new();
    files_below(&folder, &mut kept);
    assert!(kept.len() > 6, "{kept:?}");
    let places = [dir.path().to_str().unwrap(), home().to_str().unwrap()];
    for path in kept {
        let bytes = std::fs::read(&path).unwrap();
        assert_ne!(String::from_utf8_lossy(&bytes), process, "{}", path.display());
        for canary in
            ["canary-place", "canary-user", "canary-home", "canary-host", "canary-secret"].iter().chain(&places)
        {
            assert!(!tells(&bytes, canary), "{} holds {canary}", path.display());
        }
    }
}
