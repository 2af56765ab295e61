//! A cassette of rollouts: recorded answers of a backend in a text file, JSON lines, optionally compressed (a name that ends
//! in `.zst`). Line 1 is the header `{"format":"evodrive-rollout-cassette","version":"1.0","name":..,"backend":{..}}` (1.1 where
//! answers hold a planner's controls). Every other line is `{"rollout":"<key>","scene":"<id>","ego":"..","digest":"<BLAKE3 of the answer>","answer":{..}}`, in the
//! order of the keys, with the answer as `docs/BACKENDS.md` describes it.

use std::collections::BTreeMap;
use std::path::Path;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::answer::{Answer, AnswerLine};
use super::spec::{BackendOptions, DRIVER, is_blind};
use crate::kernel::Digest;
use crate::sim::Undriven;
use crate::store::{self, StoreError, TextFault, shortened};

const FORMAT: &str = "evodrive-rollout-cassette";
const VERSION: &str = "1.0";
/// Version of a cassette that also holds planners' decisions. Readers of 1.0 refuse each such line.
const VERSION_WITH_CONTROLS: &str = "1.1";
const MAJOR: &str = "1";
/// Name of the ego that repeats its recording.
const REPLAY: &str = "replay";
/// Most bytes of a cassette, before and after decompression.
const MAX_BYTES: u64 = 1 << 30;
/// Most bytes of the first line, whose values take many times that in memory.
const MAX_HEADER_BYTES: usize = 1 << 20;

/// Why a cassette cannot be read or written.
#[derive(Debug, thiserror::Error)]
pub enum RolloutCassetteError {
    #[error("{file} line {line}: expected {expected}, found {found}; restore the file, or record its rollouts anew")]
    Damaged { file: String, line: usize, expected: String, found: String },
    #[error(
        "{file} is a rollout cassette of format {found}, this build reads {MAJOR}.x; use the release that wrote it, or record anew"
    )]
    Version { file: String, found: String },
    #[error(
        "{file} was recorded with another backend: {field} is {found}, the experiment declares {expected}; name another \
         cassette, or record anew with `evodrive record --fresh`"
    )]
    Backend { file: String, field: &'static str, expected: String, found: String },
    #[error(
        "{file} was recorded with another planner: its digest is {found}, and that of the files and arguments in [driver] is {expected}. \
         A file, an argument or what it hears has changed; restore it, or give driver.cassette another name and record again: recorded answers of models are \
         kept"
    )]
    Planner { file: String, expected: String, found: String },
    #[error(transparent)]
    Store(#[from] StoreError),
}

/// Identity of the backend or planner that answered.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Header {
    pub name: String,
    pub version: String,
    pub digest: Digest,
    pub options: BTreeMap<String, Value>,
}

impl Header {
    /// Returns the header of the backend that an experiment declares.
    pub fn of(backend: &BackendOptions) -> Header {
        let BackendOptions { name, version, digest, options, .. } = backend.clone();
        Header { name, version, digest, options }
    }

    /// Returns `true` if the driver was not told under which program it drove ([`BackendOptions::is_blind`]).
    pub fn is_blind(&self) -> bool {
        is_blind(&self.name, &self.options)
    }
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct FirstLine {
    format: String,
    version: String,
    name: String,
    backend: Header,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct RolloutLine {
    rollout: Digest,
    scene: String,
    ego: String,
    digest: Digest,
    answer: AnswerLine,
}

/// One recorded rollout.
#[derive(Clone, Debug, PartialEq)]
pub struct Recorded {
    pub scene: String,
    pub ego: String,
    pub answer: Answer,
}

/// Recorded rollouts of one backend, by the key of their request.
#[derive(Clone, Debug, PartialEq)]
pub struct RolloutCassette {
    /// The file's name in messages.
    pub file: String,
    pub backend: Header,
    rollouts: BTreeMap<Digest, Recorded>,
}

/// Content that was expected in a line, and content that was found.
type Wrong = (String, String);

impl RolloutCassette {
    /// Creates a cassette with nothing recorded yet.
    pub fn new(file: impl Into<String>, backend: Header) -> RolloutCassette {
        RolloutCassette { file: file.into(), backend, rollouts: BTreeMap::new() }
    }

    /// Adds the rollouts of a file that are missing here and that the same backend answered. Returns the union and the number added.
    /// A file of another backend or a damaged one adds nothing.
    pub fn beside(mut self, path: &Path) -> (RolloutCassette, usize) {
        let own = self.rollouts.len();
        if let Ok(there) = RolloutCassette::load(path)
            && there.backend == self.backend
        {
            for (key, recorded) in there.rollouts {
                self.rollouts.entry(key).or_insert(recorded);
            }
        }
        let others = self.rollouts.len() - own;
        (self, others)
    }

    /// Returns the ids of the scenes whose rollouts are here.
    pub fn scenes(&self) -> std::collections::BTreeSet<&str> {
        self.rollouts.values().map(|recorded| recorded.scene.as_str()).collect()
    }

    /// Reads a file, and verifies every digest.
    pub fn load(path: &Path) -> Result<RolloutCassette, RolloutCassetteError> {
        let file = path.display().to_string();
        let mut lines = store::text_lines(path, MAX_BYTES)?;
        RolloutCassette::read_from(&mut || lines.next_line(), &file)
    }

    /// Reads the text of a cassette; `file` names it in messages.
    pub fn parse(mut text: &[u8], file: &str) -> Result<RolloutCassette, RolloutCassetteError> {
        let next =
            &mut || store::next_line(&mut text).map_err(|error| TextFault::Wrong("a text".into(), error.to_string()));
        RolloutCassette::read_from(next, file)
    }

    /// Reads line by line, and stops at the first bad line.
    fn read_from(
        next: &mut dyn FnMut() -> Result<Option<store::Line>, TextFault>,
        file: &str,
    ) -> Result<RolloutCassette, RolloutCassetteError> {
        let damaged = |line: usize, (expected, found): Wrong| RolloutCassetteError::Damaged {
            file: file.to_string(),
            line,
            expected,
            found,
        };
        let mut at = 0;
        let mut line = || -> Result<(usize, Option<Vec<u8>>), RolloutCassetteError> {
            at += 1;
            match next() {
                Ok(line) => Ok((at, line.map(|line| line.bytes))),
                Err(TextFault::Store(error)) => Err(error.into()),
                Err(TextFault::Wrong(expected, found)) => Err(damaged(at, (expected, found))),
            }
        };
        let header = line()?.1.unwrap_or_default();
        if header.len() > MAX_HEADER_BYTES {
            let expected = format!("at most {MAX_HEADER_BYTES} bytes in the header of a rollout cassette");
            return Err(damaged(1, (expected, header.len().to_string())));
        }
        let first: FirstLine =
            parsed(&header, "the header of a rollout cassette").map_err(|wrong| damaged(1, wrong))?;
        if first.format != FORMAT {
            return Err(damaged(1, (format!("format {FORMAT}"), shortened(&first.format))));
        }
        if first.version.split('.').next() != Some(MAJOR) {
            return Err(RolloutCassetteError::Version { file: file.to_string(), found: shortened(&first.version) });
        }
        let mut cassette = RolloutCassette::new(file, first.backend);
        while let (at, Some(line)) = line()? {
            cassette.read(&line).map_err(|wrong| damaged(at, wrong))?;
        }
        Ok(cassette)
    }

    fn read(&mut self, line: &[u8]) -> Result<(), Wrong> {
        let RolloutLine { rollout, scene, ego, digest, answer } = parsed(line, "a recorded rollout")?;
        let computed = Digest::of_bytes(&answer.to_bytes());
        if computed != digest {
            return Err((format!("digest of the answer {computed}"), digest.to_hex()));
        }
        if answer.request != rollout {
            return Err((format!("an answer to {rollout}"), format!("one to {}", answer.request)));
        }
        let answer = answer.into_answer().map_err(|found| ("a motion or a failure".to_string(), found))?;
        if let Answer::ReportedRollout(rollout) = &answer
            && let Some((expected, found)) = rollout.jump(ego == REPLAY)
        {
            return Err((format!("{expected} of scene {scene}"), found));
        }
        match self.rollouts.insert(rollout, Recorded { scene, ego, answer }) {
            None => Ok(()),
            Some(_) => Err(("one answer for a request".into(), format!("a second one for {rollout}"))),
        }
    }

    /// Refuses a cassette of another backend than the declared one.
    pub fn check(&self, declared: &BackendOptions) -> Result<(), RolloutCassetteError> {
        let declared = Header::of(declared);
        let options = |header: &Header| serde_json::to_string(&header.options).unwrap_or_default();
        let fields = [
            ("name", declared.name.clone(), self.backend.name.clone()),
            ("version", declared.version.clone(), self.backend.version.clone()),
            ("digest", declared.digest.to_hex(), self.backend.digest.to_hex()),
            ("options", options(&declared), options(&self.backend)),
        ];
        match fields.into_iter().find(|(_, expected, found)| expected != found) {
            None => Ok(()),
            Some(("digest", expected, found)) if declared.name == DRIVER => {
                Err(RolloutCassetteError::Planner { file: self.file.clone(), expected, found })
            }
            Some((field, expected, found)) => {
                Err(RolloutCassetteError::Backend { file: self.file.clone(), field, expected, found })
            }
        }
    }

    /// Adds a line of a cassette: a recorded rollout whose digests hold and that is not there already. The error holds what was
    /// expected and what was found.
    pub fn read_line(&mut self, line: &[u8]) -> Result<(), (String, String)> {
        self.read(line)
    }

    /// Returns the identity of the backend or planner that was recorded.
    pub fn recorded_of(&self) -> Digest {
        self.backend.digest
    }

    /// The lines of its rollouts, each with its end, in the order of their keys.
    pub fn lines(&self) -> impl Iterator<Item = Vec<u8>> {
        self.rollouts.iter().map(|(key, Recorded { scene, ego, answer })| {
            let digest = RolloutCassette::digest_of(*key, answer);
            let answer = AnswerLine::of(*key, answer);
            let (scene, ego) = (scene.clone(), ego.clone());
            line(&RolloutLine { rollout: *key, scene, ego, digest, answer })
        })
    }

    /// Returns the digest under which a line holds an answer.
    pub fn digest_of(key: Digest, answer: &Answer) -> Digest {
        Digest::of_bytes(&AnswerLine::of(key, answer).to_bytes())
    }

    /// Returns the digest of the motion that is recorded for a request.
    pub fn answer_digest(&self, key: &Digest) -> Option<Digest> {
        let recorded = self.rollouts.get(key).filter(|recorded| matches!(recorded.answer, Answer::ReportedRollout(_)));
        recorded.map(|recorded| RolloutCassette::digest_of(*key, &recorded.answer))
    }

    pub fn get(&self, key: &Digest) -> Option<&Recorded> {
        self.rollouts.get(key)
    }

    pub fn insert(&mut self, key: Digest, recorded: Recorded) {
        self.rollouts.insert(key, recorded);
    }

    /// Returns all rollouts, in the order of their keys.
    pub fn rollouts(&self) -> impl Iterator<Item = (&Digest, &Recorded)> {
        self.rollouts.iter()
    }

    pub fn len(&self) -> usize {
        self.rollouts.len()
    }

    /// Returns the number of rollouts in which the driver abandoned the scene.
    pub fn abandoned(&self) -> usize {
        let gave_up = |recorded: &&Recorded| matches!(&recorded.answer, Answer::Failed(Undriven::Abandoned(_)));
        self.rollouts.values().filter(gave_up).count()
    }

    pub fn is_empty(&self) -> bool {
        self.rollouts.is_empty()
    }

    /// Returns the text of the file.
    pub fn to_bytes(&self, name: &str) -> Vec<u8> {
        let decides = |of: &Recorded| matches!(&of.answer, Answer::ReportedRollout(of) if !of.controls.is_empty());
        let version = if self.rollouts.values().any(decides) { VERSION_WITH_CONTROLS } else { VERSION };
        let first = FirstLine {
            format: FORMAT.into(),
            version: version.into(),
            name: name.into(),
            backend: self.backend.clone(),
        };
        let mut text = line(&first);
        self.lines().for_each(|line| text.extend(line));
        text
    }

    /// Writes the file, whole or not at all.
    pub fn save(&self, path: &Path, name: &str) -> Result<(), RolloutCassetteError> {
        Ok(store::write_text(path, &self.to_bytes(name))?)
    }
}

fn line(value: &impl Serialize) -> Vec<u8> {
    match serde_json::to_vec(value) {
        Ok(mut bytes) => {
            bytes.push(b'\n');
            bytes
        }
        Err(error) => unreachable!("texts, lists and numbers under text keys: {error}"),
    }
}

fn parsed<'a, T: Deserialize<'a>>(line: &'a [u8], expected: &str) -> Result<T, Wrong> {
    serde_json::from_slice(line).map_err(|error| (expected.to_string(), error.to_string()))
}
