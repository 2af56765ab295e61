//! The transcript of a run: ordered events in a JSON-lines file, each holding the hash of the one before it. Its last
//! hash is the root of the run. This module does not know what the events mean.
//!
//! One line per event, `{"body":...,"hash":"<64 hex>","kind":"...","prev":"<64 hex>","seq":N}`, keys of every object
//! sorted, no spaces, ended by one line feed. `hash` = BLAKE3 of the canonical bytes of `(seq, prev, kind, body)` under
//! the domain `evodrive/transcript-event/1`; `prev` of event 0 is BLAKE3 of the text `evodrive/transcript/1`, so that
//! the format's version is part of every hash. A line is damaged if it differs in any byte from the text that its event
//! prints.

use std::{
    fs::{File, OpenOptions, TryLockError},
    io::{BufReader, Read, Seek, SeekFrom, Write},
    path::{Path, PathBuf},
};

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::{Damage, Divergence, Line, StoreError, batch, difference::first_difference, file, next_line, too_large};
use crate::kernel::{
    Digest, Threads,
    canon::{CanonError, canonical_json_bytes, json_text},
};

/// Kind of the event that ends a transcript.
pub const SEALED: &str = "sealed";
/// A transcript file larger than this is refused before it is read.
const MAX_BYTES: u64 = 8 << 30;
/// Bodies nested deeper than this could not be read back.
const MAX_BODY_DEPTH: usize = 100;

/// One thing that happened in a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Event {
    // In the order of their names: this is the order in which they are printed.
    /// Content of the event, as JSON.
    pub body: Value,
    /// Hash of the other four fields.
    pub hash: Digest,
    /// Kind of the body, e.g. `attempt`.
    pub kind: String,
    /// Hash of the event before.
    pub prev: Digest,
    /// Place in the transcript, from 0.
    pub seq: u64,
}

/// A transcript that can be appended to. It holds an exclusive lock on its file.
#[derive(Debug)]
pub struct Transcript {
    path: PathBuf,
    file: File,
    /// Hashes of the events that the file held when it was opened. The events themselves are on disk only.
    recorded: Vec<Digest>,
    /// True if the last of them is a seal.
    recorded_seal: bool,
    /// Number of events that this run has produced, or has accepted as recorded.
    confirmed: usize,
    /// Hash of the last of them.
    head: Digest,
    /// Index of the sealing event among them.
    sealed: Option<u64>,
}

/// `prev` of the first event.
fn genesis() -> Digest {
    Digest::of_bytes(b"evodrive/transcript/1")
}

const EVENT_DOMAIN: &str = "evodrive/transcript-event/1";

fn unstorable(kind: &str, error: impl std::fmt::Display) -> StoreError {
    refused(kind)(CanonError::Other(error.to_string()))
}

fn refused(kind: &str) -> impl Fn(CanonError) -> StoreError {
    move |source| StoreError::Unstorable { kind: kind.to_string(), source }
}

/// Returns the line of an event, from the canonical bytes of `(seq, prev, kind, body)`: what `Event::line` prints.
fn line_of(hashed: &[u8], hash: Digest) -> Result<Vec<u8>, CanonError> {
    let (text, ends) = json_text::elements(hashed, MAX_BODY_DEPTH)?;
    let [seq, prev, kind, _] = ends[..] else { return Err(CanonError::Other("an event has four parts".into())) };
    let hash = hash.to_hex();
    let parts: [&[u8]; 11] = [
        b"{\"body\":",
        &text[kind..],
        b",\"hash\":\"",
        hash.as_bytes(),
        b"\",\"kind\":",
        &text[prev..kind],
        b",\"prev\":",
        &text[seq..prev],
        b",\"seq\":",
        &text[..seq],
        b"}\n",
    ];
    Ok(parts.concat())
}

impl Transcript {
    /// A new, empty transcript; a file that is there already is an error.
    pub fn create(path: &Path) -> Result<Transcript, StoreError> {
        let file = OpenOptions::new()
            .read(true)
            .write(true)
            .create_new(true)
            .open(path)
            .map_err(|source| StoreError::io("create", path, source))?;
        file::lock(&file, path)?;
        Ok(Transcript::at_start(path, file, Vec::new(), false))
    }

    /// Opens for appending behind the recorded events. A line that was cut off while it was written is removed; any other
    /// damage is an error that names the line.
    pub fn open(path: &Path) -> Result<Transcript, StoreError> {
        let mut transcript = Transcript::continue_from_start(path)?;
        transcript.confirmed = transcript.recorded.len();
        transcript.head = transcript.recorded.last().copied().unwrap_or(transcript.head);
        transcript.sealed = transcript.recorded_seal.then(|| transcript.confirmed as u64 - 1);
        Ok(transcript)
    }

    fn at_start(path: &Path, file: File, recorded: Vec<Digest>, recorded_seal: bool) -> Transcript {
        let path = path.to_path_buf();
        Transcript { path, file, recorded, recorded_seal, confirmed: 0, head: genesis(), sealed: None }
    }

    /// Opens for a run that starts over: each appended event is first compared with the recorded one at its place, and
    /// writing begins where the recorded ones end.
    pub fn continue_from_start(path: &Path) -> Result<Transcript, StoreError> {
        Transcript::continue_on(path, None)
    }

    /// Does the same with threads that check the recorded events.
    pub fn continue_on(path: &Path, threads: Option<&Threads>) -> Result<Transcript, StoreError> {
        let io = |source| StoreError::io("open", path, source);
        file::no_device(path)?;
        let mut file = OpenOptions::new().read(true).write(true).open(path).map_err(io)?;
        file::lock(&file, path)?;
        let (Walked { whole_bytes, unfinished, sealed, .. }, hashes) = whole(path, threads)?;
        file.set_len(whole_bytes).map_err(io)?;
        file.seek(SeekFrom::End(0)).map_err(io)?;
        if unfinished {
            file.write_all(b"\n").map_err(io)?;
        }
        Ok(Transcript::at_start(path, file, hashes, sealed))
    }

    /// Opens a finished run's transcript to compare it with itself: nothing is written or mended, so the file may be one that cannot be
    /// written to.
    pub fn compare_on(path: &Path, threads: Option<&Threads>) -> Result<Transcript, StoreError> {
        file::no_device(path)?;
        let file = File::open(path).map_err(|source| StoreError::io("open", path, source))?;
        // A file that nobody can lock to look at is written by nobody, either.
        if let Err(TryLockError::WouldBlock) = file.try_lock_shared() {
            return Err(StoreError::Locked { path: path.to_path_buf(), holder: "another process".into() });
        }
        let (Walked { sealed, .. }, hashes) = whole(path, threads)?;
        Ok(Transcript::at_start(path, file, hashes, sealed))
    }

    /// Adds an event and gives its hash. The body is stored as the JSON it serialises to; NaN and infinities are refused.
    /// While recorded events remain, a difference is a `StoreError::Divergence` and nothing is written.
    pub fn append<T: Serialize + ?Sized>(&mut self, kind: &str, body: &T) -> Result<Digest, StoreError> {
        if let Some(seq) = self.sealed {
            return Err(StoreError::Sealed { path: self.path.clone(), seq });
        }
        let (seq, prev) = (self.confirmed as u64, self.head);
        let hashed = canonical_json_bytes(&(seq, prev, kind, body)).map_err(refused(kind))?;
        let hash = Digest::under(EVENT_DOMAIN, &hashed);
        match self.recorded.get(self.confirmed) {
            Some(recorded) if *recorded == hash => {}
            Some(_) => {
                let body = serde_json::to_value(body).map_err(|e| unstorable(kind, e))?;
                return Err(divergence(&self.path, &event_at(&self.path, seq)?, kind, &body));
            }
            None => {
                let line = line_of(&hashed, hash).map_err(refused(kind))?;
                if let Some((expected, found)) = too_large(&line) {
                    return Err(unstorable(kind, format!("expected {expected}, found {found}")));
                }
                self.write(&line)?;
            }
        }
        self.confirmed += 1;
        self.head = hash;
        self.sealed = (kind == SEALED).then_some(seq);
        Ok(hash)
    }

    /// Each line is one write. A write that fails half-way is undone, so that the next line does not continue it.
    fn write(&mut self, line: &[u8]) -> Result<(), StoreError> {
        let io = |source| StoreError::io("append to", &self.path, source);
        let end = self.file.seek(SeekFrom::End(0)).map_err(io)?;
        if let Err(source) = self.file.write_all(line) {
            let _ = self.file.set_len(end);
            return Err(io(source));
        }
        Ok(())
    }

    /// Appends the event that ends the transcript, makes it durable, and gives the root. No more events are taken.
    pub fn seal<T: Serialize + ?Sized>(&mut self, body: &T) -> Result<Digest, StoreError> {
        let root = self.append(SEALED, body)?;
        self.flush()?;
        Ok(root)
    }

    /// Makes everything appended so far survive a power cut.
    pub fn flush(&mut self) -> Result<(), StoreError> {
        self.file.sync_data().map_err(|source| StoreError::io("sync", &self.path, source))
    }

    /// Hash of the last event that this run produced or accepted; before the first one, the digest of the format's name.
    pub fn head(&self) -> Digest {
        self.head
    }

    /// Returns `true` if the file held a sealed transcript when it was opened.
    pub fn is_recorded_whole(&self) -> bool {
        self.recorded_seal
    }

    /// Returns the number of recorded events that a continued run still has to reproduce.
    pub fn remaining(&self) -> usize {
        self.recorded.len().saturating_sub(self.confirmed)
    }
}

/// Hands the events of a transcript on one by one, without locking or repairing it: those of a long run do not fit in memory
/// together. Damage is an error, which comes after the events before it.
pub fn each_event(path: &Path, each: &mut dyn FnMut(Event)) -> Result<(), StoreError> {
    each_event_on(path, None, each)
}

/// Does the same with threads that check the events; they are handed on in their order.
pub fn each_event_on(path: &Path, threads: Option<&Threads>, each: &mut dyn FnMut(Event)) -> Result<(), StoreError> {
    walk(path, threads, each)?.damage.map_or(Ok(()), |damage| Err(StoreError::corrupt(damage)))
}

/// All events of a transcript.
pub fn read_events(path: &Path) -> Result<Vec<Event>, StoreError> {
    let mut events = Vec::new();
    each_event(path, &mut |event| events.push(event)).map(|()| events)
}

/// Damage of a transcript: only the first damaged line, because the hash chain proves nothing about the lines after it.
/// Empty if there is none.
pub fn fsck_transcript(path: &Path) -> Result<Vec<Damage>, StoreError> {
    Ok(walk(path, None, &mut |_| ())?.damage.into_iter().collect())
}

/// Walks through a transcript without damage; returns the findings of the walk and the hashes of the events.
fn whole(path: &Path, threads: Option<&Threads>) -> Result<(Walked, Vec<Digest>), StoreError> {
    let mut hashes = Vec::new();
    let mut walked = walk(path, threads, &mut |event| hashes.push(event.hash))?;
    match walked.damage.take() {
        Some(damage) => Err(StoreError::corrupt(damage)),
        None => Ok((walked, hashes)),
    }
}

/// The recorded event at a place.
fn event_at(path: &Path, seq: u64) -> Result<Event, StoreError> {
    let mut difference = None;
    each_event(path, &mut |event| {
        if event.seq == seq {
            difference = Some(event);
        }
    })?;
    let gone = || format!("expected event {seq}, which was there when the run began, found none");
    difference.ok_or_else(|| StoreError::corrupt(Damage::at(path, format!("line {}", seq + 1), gone())))
}

/// Findings of a walk through a transcript, besides its events.
struct Walked {
    /// Length of the file up to the end of the last whole event.
    whole_bytes: u64,
    damage: Option<Damage>,
    /// The last event is whole but its line feed is missing.
    unfinished: bool,
    /// The last event is a seal.
    sealed: bool,
}

/// Place at which the next event has to go on.
#[derive(Clone, Copy)]
struct Place {
    seq: u64,
    prev: Digest,
}

impl Place {
    fn first() -> Place {
        Place { seq: 0, prev: genesis() }
    }
}

/// Bytes of lines that threads check at once.
const BATCH_BYTES: usize = 1 << 20;

fn walk(path: &Path, threads: Option<&Threads>, each: &mut dyn FnMut(Event)) -> Result<Walked, StoreError> {
    let io = |source| StoreError::io("read", path, source);
    let file = file::open_bounded(path, MAX_BYTES)?;
    let length = file.metadata().map_err(io)?.len();
    let mut reader = BufReader::with_capacity(1 << 20, file.take(length));
    let mut walked = Walked { whole_bytes: 0, damage: None, unfinished: false, sealed: false };
    let mut next = Place::first();
    // Without threads line by line.
    let batch_bytes = threads.map_or(1, |_| BATCH_BYTES);
    loop {
        let batch = batch(|| next_line(&mut reader), batch_bytes).map_err(io)?;
        if batch.is_empty() {
            return Ok(walked);
        }
        let alone = match threads {
            Some(threads) => threads.map(&batch, |_, line| read_alone(text(line))),
            None => batch.iter().map(|line| read_alone(text(line))).collect(),
        };
        for (line, read) in batch.iter().zip(alone) {
            let place = || format!("line {}", next.seq + 1);
            // The chain alone does not protect the seal: anyone who can write the file can continue the chain behind it.
            if walked.sealed {
                let behind = length - walked.whole_bytes;
                let what = format!("expected nothing behind the seal, found {behind} bytes; cut them off");
                walked.damage = Some(Damage::at(path, place(), what));
                return Ok(walked);
            }
            match read.and_then(|read| read.behind(next)) {
                Ok(event) => {
                    walked.whole_bytes += text(line).len() as u64 + u64::from(line.ended);
                    walked.unfinished = !line.ended;
                    walked.sealed = event.kind == SEALED;
                    next = Place { seq: event.seq + 1, prev: event.hash };
                    each(event);
                }
                Err(BadLine::CutOff) if !line.ended => return Ok(walked),
                Err(bad) => {
                    walked.damage = Some(Damage::at(path, place(), bad.text()));
                    return Ok(walked);
                }
            }
        }
    }
}

/// Returns the text of a line. A power cut can leave zeros where the end of the last line had not reached the disk.
fn text(line: &Line) -> &[u8] {
    if line.ended { &line.bytes } else { without_zeros_at_the_end(&line.bytes) }
}

fn without_zeros_at_the_end(line: &[u8]) -> &[u8] {
    let kept = line.iter().rposition(|&b| b != 0).map_or(0, |last| last + 1);
    &line[..kept]
}

enum BadLine {
    /// The line ends in the middle of its JSON.
    CutOff,
    Other(String),
}

impl BadLine {
    fn text(self) -> String {
        match self {
            BadLine::CutOff => "expected a whole event, found one that breaks off".to_string(),
            BadLine::Other(text) => text,
        }
    }
}

/// A line that was read without knowing those ahead of it: its event, and what follows from the place, kind and body that it
/// claims.
struct Alone {
    event: Event,
    hash: Result<Digest, BadLine>,
    /// True if the line is spelled as this event is printed.
    as_printed: bool,
}

fn read_alone(line: &[u8]) -> Result<Alone, BadLine> {
    if let Some((expected, found)) = too_large(line) {
        return Err(BadLine::Other(format!("expected {expected}, found {found}")));
    }
    let event: Event = serde_json::from_slice(line).map_err(|error| {
        if error.is_eof() { BadLine::CutOff } else { BadLine::Other(format!("expected an event, found: {error}")) }
    })?;
    // Encoded once for hash and text: this is most of the cost of reading.
    let hashed = canonical_json_bytes(&(event.seq, event.prev, &event.kind, &event.body));
    let (hash, as_printed) = match hashed {
        Ok(hashed) => {
            let hash = Digest::under(EVENT_DOMAIN, &hashed);
            let printed = line_of(&hashed, hash);
            (Ok(hash), printed.is_ok_and(|printed| printed.strip_suffix(b"\n") == Some(line)))
        }
        Err(error) => (Err(BadLine::Other(refused(&event.kind)(error).to_string())), false),
    };
    Ok(Alone { event, hash, as_printed })
}

impl Alone {
    /// Returns the event, if it is the one that has to stand here.
    fn behind(self, Place { seq, prev }: Place) -> Result<Event, BadLine> {
        let Alone { event, hash, as_printed } = self;
        let differs = |field: &str, expected: &dyn std::fmt::Display, found: &dyn std::fmt::Display| {
            Err(BadLine::Other(format!("{field}: expected {expected}, found {found}")))
        };
        if event.seq != seq {
            return differs("seq", &seq, &event.seq);
        }
        if event.prev != prev {
            return differs("prev", &prev, &event.prev);
        }
        let hash = hash?;
        if event.hash != hash {
            return differs("hash of its kind and body", &hash, &event.hash);
        }
        if as_printed {
            return Ok(event);
        }
        Err(BadLine::Other("expected the event printed with sorted keys and no spaces, found another spelling".into()))
    }
}

fn divergence(path: &Path, recorded: &Event, kind: &str, body: &Value) -> StoreError {
    let (field, old, new) = if recorded.kind == kind {
        first_difference("/body", &recorded.body, body)
    } else {
        ("/kind".to_string(), recorded.kind.clone(), kind.to_string())
    };
    StoreError::Divergence(Box::new(Divergence {
        file: path.to_path_buf(),
        seq: recorded.seq,
        kind: recorded.kind.clone(),
        field,
        recorded: old,
        computed: new,
    }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    // The plain way to an event and its line.
    impl Event {
        fn new(seq: u64, prev: Digest, kind: &str, body: Value) -> Result<Event, StoreError> {
            let hash = Digest::of(EVENT_DOMAIN, &(seq, prev, kind, &body))
                .map_err(|source| StoreError::Unstorable { kind: kind.to_string(), source })?;
            Ok(Event { body, hash, kind: kind.to_string(), prev, seq })
        }

        fn line(&self) -> Result<Vec<u8>, StoreError> {
            let mut line = serde_json::to_vec(self).map_err(|e| unstorable(&self.kind, e))?;
            line.push(b'\n');
            Ok(line)
        }
    }

    fn three_events(path: &Path) -> Digest {
        let mut transcript = Transcript::create(path).unwrap();
        transcript.append("start", &json!({"seed": 7, "rate": 0.1})).unwrap();
        transcript.append("attempt", &json!({"gain": [1.0, -0.0, 1e300], "text": "ü\n"})).unwrap();
        transcript.append("attempt", &json!({"z": 1, "a": {"c": null, "b": true}})).unwrap()
    }

    fn temp() -> (tempfile::TempDir, PathBuf) {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("transcript.jsonl");
        (dir, path)
    }

    #[test]
    fn what_was_appended_is_read_back_with_the_same_head() {
        let (_dir, path) = temp();
        let head = three_events(&path);
        assert_eq!(Transcript::open(&path).unwrap().head(), head);
        let events = read_events(&path).unwrap();
        assert_eq!(events.len(), 3);
        assert_eq!(events[0].body, json!({"rate": 0.1, "seed": 7}));
    }

    #[test]
    fn damage_says_what_stands_on_the_line() {
        let (_dir, path) = temp();
        three_events(&path);
        let whole = std::fs::read_to_string(&path).unwrap();
        let lines: Vec<&str> = whole.lines().collect();
        let said = |second: &str| {
            std::fs::write(&path, [lines[0], second, lines[2], ""].join("\n")).unwrap();
            let damage = fsck_transcript(&path).unwrap();
            assert_eq!(damage.len(), 1);
            damage[0].to_string()
        };
        let half = &lines[1][..lines[1].len() / 2];
        assert!(
            said(half).contains("line 2") && said(half).contains("expected a whole event, found one that breaks off")
        );
        assert!(said("[1, 2]").contains("expected an event, found: "), "{}", said("[1, 2]"));
        assert!(said(lines[0]).contains("expected ") && said(lines[0]).contains(", found "), "{}", said(lines[0]));
        assert!(said(&lines[1].replacen(':', ": ", 1)).contains("found another spelling"));
    }

    #[test]
    fn the_head_of_three_events_is_pinned() {
        let (_dir, path) = temp();
        assert_eq!(three_events(&path).to_hex(), "e3699c7c283826239ef7181b171e1ff79a33ed3a98ff294161a00c03e8495d5d");
    }

    #[test]
    fn a_line_cut_anywhere_is_removed_and_the_run_goes_on_to_the_same_head() {
        let (_dir, path) = temp();
        let head = three_events(&path);
        let whole = std::fs::read(&path).unwrap();
        let second_line_end = whole.iter().enumerate().filter(|(_, b)| **b == b'\n').nth(1).unwrap().0;
        for cut in second_line_end + 1..whole.len() {
            std::fs::write(&path, &whole[..cut]).unwrap();
            let mut transcript = Transcript::open(&path).unwrap();
            if transcript.confirmed == 2 {
                transcript.append("attempt", &json!({"z": 1, "a": {"c": null, "b": true}})).unwrap();
            }
            assert_eq!(transcript.head(), head, "cut at {cut}");
            drop(transcript);
            assert_eq!(std::fs::read(&path).unwrap(), whole, "cut at {cut}");
        }
    }

    #[test]
    fn a_continued_run_that_repeats_itself_begins_to_write_where_the_recorded_one_ended() {
        let (_dir, path) = temp();
        let head = three_events(&path);
        let mut transcript = Transcript::continue_from_start(&path).unwrap();
        assert_eq!(transcript.remaining(), 3);
        transcript.append("start", &json!({"rate": 0.1, "seed": 7})).unwrap();
        transcript.append("attempt", &json!({"gain": [1.0, 0.0, 1e300], "text": "ü\n"})).unwrap();
        let again = transcript.append("attempt", &json!({"z": 1, "a": {"c": null, "b": true}})).unwrap();
        assert_eq!(again, head);
        transcript.append("epoch", &json!(4)).unwrap();
        drop(transcript);
        assert_eq!(read_events(&path).unwrap().len(), 4);
    }

    #[test]
    fn a_continued_run_that_differs_is_told_event_field_and_both_values() {
        let (_dir, path) = temp();
        three_events(&path);
        let mut transcript = Transcript::continue_from_start(&path).unwrap();
        transcript.append("start", &json!({"rate": 0.1, "seed": 7})).unwrap();
        let error = transcript.append("attempt", &json!({"gain": [1.0, 0.5, 1e300], "text": "ü\n"})).unwrap_err();
        let StoreError::Divergence(found) = error else { panic!("{error}") };
        assert_eq!((found.seq, found.kind.as_str(), found.field.as_str()), (1, "attempt", "/body/gain/1"));
        assert_eq!((found.recorded.as_str(), found.computed.as_str()), ("0.0", "0.5"));
        let kind = transcript.append("epoch", &json!(null)).unwrap_err();
        assert!(kind.to_string().contains("at /kind: recorded attempt, computed epoch"), "{kind}");
        drop(transcript);
        assert_eq!(read_events(&path).unwrap().len(), 3);
    }

    #[test]
    fn a_sealed_transcript_takes_no_more_events() {
        let (_dir, path) = temp();
        three_events(&path);
        let mut transcript = Transcript::open(&path).unwrap();
        let root = transcript.seal(&json!({"attempts": 2})).unwrap();
        assert!(matches!(transcript.append("late", &1), Err(StoreError::Sealed { seq: 3, .. })));
        drop(transcript);
        let mut transcript = Transcript::open(&path).unwrap();
        assert_eq!(transcript.head(), root);
        assert!(matches!(transcript.append("late", &1), Err(StoreError::Sealed { seq: 3, .. })));
    }

    #[test]
    fn whatever_stands_behind_the_seal_is_damage_even_if_it_continues_the_chain() {
        let (_dir, path) = temp();
        three_events(&path);
        let root = Transcript::open(&path).unwrap().seal(&json!({"attempts": 2})).unwrap();
        let sealed = std::fs::read(&path).unwrap();
        let forged = Event::new(4, root, "attempt", json!({"gain": 9.0})).unwrap().line().unwrap();
        let resealed = Event::new(4, root, SEALED, json!({"attempts": 3})).unwrap().line().unwrap();
        for tail in [forged.as_slice(), &resealed, &forged[..20], b"\n", b"\0"] {
            std::fs::write(&path, [sealed.as_slice(), tail].concat()).unwrap();
            let damage = fsck_transcript(&path).unwrap();
            assert!(damage.len() == 1 && damage[0].to_string().contains("behind the seal"), "{damage:?}");
            assert!(read_events(&path).is_err());
            assert!(Transcript::open(&path).is_err() && Transcript::continue_from_start(&path).is_err());
        }
        std::fs::write(&path, &sealed).unwrap();
        assert!(fsck_transcript(&path).unwrap().is_empty());
    }

    /// Every byte changed, and every cut: threads find what one finds.
    #[test]
    fn threads_find_the_same_events_and_the_same_damage() {
        let (_dir, path) = temp();
        three_events(&path);
        let whole = std::fs::read(&path).unwrap();
        let threads = Threads::new(3).unwrap();
        let difference = |threads: Option<&Threads>| {
            let mut hashes = Vec::new();
            let walked = walk(&path, threads, &mut |event| hashes.push(event.hash)).unwrap();
            let damage = walked.damage.map(|damage| damage.to_string());
            (hashes, walked.whole_bytes, walked.unfinished, walked.sealed, damage)
        };
        for at in 0..whole.len() {
            let mut changed = whole.clone();
            changed[at] ^= 1;
            for bytes in [&changed[..], &whole[..at]] {
                std::fs::write(&path, bytes).unwrap();
                assert_eq!(difference(Some(&threads)), difference(None), "byte {at}");
            }
        }
        std::fs::write(&path, &whole).unwrap();
        assert_eq!(difference(Some(&threads)), difference(None));
        assert_eq!(difference(None).0.len(), 3);
    }

    #[test]
    fn a_second_writer_is_refused() {
        let (_dir, path) = temp();
        let first = Transcript::create(&path).unwrap();
        assert!(matches!(Transcript::open(&path), Err(StoreError::Locked { .. })));
        drop(first);
        Transcript::open(&path).unwrap();
    }

    #[test]
    fn a_nan_is_refused_and_leaves_no_trace() {
        let (_dir, path) = temp();
        let mut transcript = Transcript::create(&path).unwrap();
        let error = transcript.append("score", &[1.0, f64::NAN]).unwrap_err();
        assert!(matches!(error, StoreError::Unstorable { .. }), "{error}");
        assert_eq!(transcript.head(), genesis());
        assert_eq!(std::fs::read(&path).unwrap(), b"");
    }

    #[test]
    fn a_body_too_deep_to_be_read_back_is_refused() {
        let (_dir, path) = temp();
        let mut transcript = Transcript::create(&path).unwrap();
        let nested = |n: usize| (0..n).fold(json!(0), |inner, _| json!([inner]));
        transcript.append("deep", &nested(MAX_BODY_DEPTH)).unwrap();
        assert!(matches!(transcript.append("deep", &nested(MAX_BODY_DEPTH + 1)), Err(StoreError::Unstorable { .. })));
        drop(transcript);
        assert_eq!(read_events(&path).unwrap().len(), 1);
    }

    proptest::proptest! {
        #[test]
        fn every_finite_float_keeps_its_hash_through_the_file(bits in proptest::prelude::any::<u64>()) {
            let x = f64::from_bits(bits);
            proptest::prop_assume!(x.is_finite());
            let event = Event::new(0, genesis(), "x", json!([x])).unwrap();
            let line = event.line().unwrap();
            proptest::prop_assert_eq!(read_alone(&line[..line.len() - 1]).and_then(|read| read.behind(Place::first())).ok().map(|e| e.hash), Some(event.hash));
        }
    }
}
