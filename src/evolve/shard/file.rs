//! A shard: JSON lines. Line 1 is the header with the study, then one line a program, then one line a task; or, of a whole lineage,
//! where it stands, its records and its answers. Its file is named by the BLAKE3 of its bytes, so a changed or cut one is known before
//! anything is done.

use std::collections::{BTreeMap, BTreeSet};
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize, de::DeserializeOwned};

use super::error::{COPY_AGAIN, ShardError, place};
use super::mark::StudyMark;
use crate::epoch::{LineageJob, RecordedAnswer, Task, WalkRecord};
use crate::kernel::Digest;
use crate::objects::Program;
use crate::store::{self, shortened};

/// Ending of a shard's file name, behind the digest of its bytes.
pub const SHARD_ENDING: &str = ".shard";
const FORMAT: &str = "evodrive-shard";
pub(super) const VERSION: &str = "1.1";
/// Bytes that a shard or a result may have.
pub(super) const MAX_BYTES: u64 = 1 << 30;

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct HeadLine {
    format: String,
    version: String,
    study: StudyMark,
    programs: usize,
    tasks: usize,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    lineage: Option<LineageLine>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    needs: Vec<Need>,
}

/// Head of a whole lineage: how many records and answers follow its place.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct LineageLine {
    records: usize,
    answers: usize,
    asks: bool,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ProgramLine {
    pub program: Digest,
    pub body: Program,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct TaskLine {
    pub task: Digest,
    pub of: Task,
}

/// A file that a worker must have beside the study, by its digest.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Need {
    pub file: String,
    pub digest: Digest,
}

/// Tasks of one study with the programs that they take, or all that follows in one of its lineages.
#[derive(Clone, Debug)]
pub struct Shard {
    pub study: StudyMark,
    pub programs: BTreeMap<Digest, Program>,
    /// With the keys of their records.
    pub tasks: Vec<(Digest, Task)>,
    pub lineage: Option<Lineage>,
    /// Requirements of a worker besides the study.
    pub needs: Vec<Need>,
}

/// All that follows in a lineage.
#[derive(Clone, Debug)]
pub struct Lineage {
    pub walk: LineageJob,
    /// Records of the run that the lineage's work reads.
    pub records: Vec<WalkRecord>,
    /// Recorded answers of models.
    pub answers: Vec<RecordedAnswer>,
    /// True if the worker asks the stand-in for answers that are not recorded.
    pub asks: bool,
}

/// Cuts tasks into shards of at most `size`, program by program, so that few shards hold each program. Where another
/// simulator is asked they are cut scene by scene: it plays every scene without a program, too, once a shard.
pub fn split<'a>(
    study: &'a StudyMark,
    tasks: BTreeMap<Digest, Task>,
    programs: &'a BTreeMap<Digest, Program>,
    needs: &'a [Need],
    size: usize,
) -> impl Iterator<Item = Shard> + 'a {
    let mut tasks: Vec<(Digest, Task)> = tasks.into_iter().collect();
    let by_scene = study.backend.is_some();
    let place = |(key, task): &(Digest, Task)| {
        let (program, scene) = (task.program(), task.scene().to_string());
        if by_scene { (None, scene, program, *key) } else { (program, scene, None, *key) }
    };
    tasks.sort_by_cached_key(place);
    let size = size.max(1);
    let mut rest = tasks.into_iter();
    std::iter::from_fn(move || {
        let tasks: Vec<(Digest, Task)> = rest.by_ref().take(size).collect();
        let none = tasks.is_empty();
        let used: BTreeSet<Digest> = tasks.iter().filter_map(|(_, task)| task.program()).collect();
        let own = used.iter().filter_map(|hash| Some((*hash, programs.get(hash)?.clone()))).collect();
        let made = || Shard { study: study.clone(), programs: own, tasks, lineage: None, needs: needs.to_vec() };
        (!none).then(made)
    })
}

impl Shard {
    /// The bytes of the file.
    pub fn to_bytes(&self) -> Vec<u8> {
        let (format, version) = (FORMAT.to_string(), VERSION.to_string());
        let (programs, tasks) = (self.programs.len(), self.tasks.len());
        let counted =
            |of: &Lineage| LineageLine { records: of.records.len(), answers: of.answers.len(), asks: of.asks };
        let (lineage, needs) = (self.lineage.as_ref().map(counted), self.needs.clone());
        let mut bytes = line(&HeadLine { format, version, study: self.study.clone(), programs, tasks, lineage, needs });
        for (program, body) in &self.programs {
            bytes.extend(line(&ProgramLine { program: *program, body: body.clone() }));
        }
        for (task, of) in &self.tasks {
            bytes.extend(line(&TaskLine { task: *task, of: of.clone() }));
        }
        if let Some(Lineage { walk, records, answers, .. }) = &self.lineage {
            bytes.extend(line(walk));
            records.iter().for_each(|record| bytes.extend(line(record)));
            answers.iter().for_each(|answer| bytes.extend(line(answer)));
        }
        bytes
    }

    /// Reads so many programs and then so many tasks; each program has the hash that its line says, and no task is of another one.
    /// `file` is what messages call the file.
    pub(super) fn read_tasks(
        &mut self,
        lines: &mut Lines<'_>,
        programs: usize,
        tasks: usize,
        file: &str,
        damaged: &dyn Fn(usize, Wrong) -> ShardError,
    ) -> Result<(), ShardError> {
        for _ in 0..programs {
            let (at, read) = lines.next::<ProgramLine>("a program");
            let ProgramLine { program, body } = read.map_err(|wrong| damaged(at, wrong))?;
            let hash = body.hash()?;
            if hash != program {
                return Err(damaged(at, (format!("program {program}"), format!("one with the hash {hash}"))));
            }
            self.programs.insert(program, body);
        }
        for _ in 0..tasks {
            let (at, read) = lines.next::<TaskLine>("a task");
            let TaskLine { task, of } = read.map_err(|wrong| damaged(at, wrong))?;
            if let Some(program) = of.program().filter(|program| !self.programs.contains_key(program)) {
                return Err(damaged(at, (format!("program {program} in this {file}"), "none".into())));
            }
            self.tasks.push((task, of));
        }
        Ok(())
    }

    /// Writes it unless it is there: the path, and whether it is new.
    pub fn saved(&self, folder: &Path) -> Result<(PathBuf, bool), ShardError> {
        let bytes = self.to_bytes();
        let path = folder.join(format!("{}{SHARD_ENDING}", Digest::of_bytes(&bytes)));
        let is_new = !path.exists();
        if is_new {
            store::write_atomic(&path, &bytes)?;
        }
        Ok((path, is_new))
    }

    /// Reads a file, and holds it to its name: the shard and its digest.
    pub fn load(path: &Path) -> Result<(Shard, Digest), ShardError> {
        let file = path.display().to_string();
        let (digest, shard) = (store::digest_of_file(path, MAX_BYTES)?, Shard::read(Lines::open(path)?, &file));
        let named = path.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default();
        if named == digest.to_hex() {
            return Ok((shard?, digest));
        }
        // A line that cannot be read says more than the digest of all of them.
        shard?;
        let (expected, found) = (format!("bytes with the digest of its name, {}", shortened(&named)), digest.to_hex());
        Err(ShardError::Damaged { file, place: place(0), expected, found, remedy: COPY_AGAIN })
    }

    /// Reads the bytes of a file; `file` names it in messages.
    pub fn parse(bytes: &[u8], file: &str) -> Result<Shard, ShardError> {
        Shard::read(Lines::of(bytes), file)
    }

    fn read(mut lines: Lines<'_>, file: &str) -> Result<Shard, ShardError> {
        let damaged = |line: usize, (expected, found): (String, String)| ShardError::Damaged {
            file: file.to_string(),
            place: place(line),
            expected,
            found,
            remedy: COPY_AGAIN,
        };
        let head: HeadLine = lines.head(FORMAT, file)?.map_err(|wrong| damaged(1, wrong))?;
        let (study, needs) = (head.study, head.needs);
        let mut shard = Shard { study, programs: BTreeMap::new(), tasks: Vec::new(), lineage: None, needs };
        shard.read_tasks(&mut lines, head.programs, head.tasks, "shard", &damaged)?;
        if let Some(LineageLine { records, answers, asks }) = head.lineage {
            let (at, walk) = lines.next::<LineageJob>("where a lineage stands");
            let walk = walk.map_err(|wrong| damaged(at, wrong))?;
            let mut lineage = Lineage { walk, records: Vec::new(), answers: Vec::new(), asks };
            for _ in 0..records {
                let (at, read) = lines.next::<WalkRecord>("a record of the lineage");
                lineage.records.push(read.map_err(|wrong| damaged(at, wrong))?);
            }
            for _ in 0..answers {
                let (at, read) = lines.next::<RecordedAnswer>("a recorded answer");
                lineage.answers.push(read.map_err(|wrong| damaged(at, wrong))?);
            }
            shard.lineage = Some(lineage);
        }
        lines.end().map_err(|(at, wrong)| damaged(at, wrong))?;
        Ok(shard)
    }
}

/// Pair of what was expected and what was found.
pub(super) type Wrong = (String, String);

/// The lines of a file, each ended by a line feed, counted from 1. No more than one is in memory.
pub(super) struct Lines<'a> {
    from: Box<dyn BufRead + 'a>,
    at: usize,
}

impl<'a> Lines<'a> {
    pub fn of(bytes: &'a [u8]) -> Lines<'a> {
        Lines { from: Box::new(bytes), at: 0 }
    }

    pub fn open(path: &Path) -> Result<Lines<'static>, ShardError> {
        let from = Box::new(BufReader::new(store::open_bounded(path, MAX_BYTES)?));
        Ok(Lines { from, at: 0 })
    }

    /// The header of a format. Another major version is an error of its own.
    pub fn head<T: DeserializeOwned>(&mut self, format: &str, file: &str) -> Result<Result<T, Wrong>, ShardError> {
        #[derive(Deserialize)]
        struct Mark {
            format: String,
            version: String,
        }
        let bytes = match self.raw(&format!("the header of format {format}")) {
            Ok(bytes) => bytes,
            Err(wrong) => return Ok(Err(wrong)),
        };
        let mark: Mark = match read(&bytes, &format!("the header of format {format}")) {
            Ok(mark) => mark,
            Err(wrong) => return Ok(Err(wrong)),
        };
        if mark.format != format {
            return Ok(Err((format!("format {format}"), shortened(&mark.format))));
        }
        if mark.version.split('.').next() != VERSION.split('.').next() {
            return Err(ShardError::Foreign {
                file: file.to_string(),
                field: "the file's version",
                expected: VERSION.to_string(),
                found: shortened(&mark.version),
                remedy: "use the same release of evodrive on all machines",
            });
        }
        Ok(read(&bytes, "a header"))
    }

    /// The next line as a value, with its number.
    pub fn next<T: DeserializeOwned>(&mut self, expected: &str) -> (usize, Result<T, Wrong>) {
        let value = self.raw(expected).and_then(|bytes| read(&bytes, expected));
        (self.at, value)
    }

    /// The bytes of the next line, without its end.
    pub fn raw(&mut self, expected: &str) -> Result<Vec<u8>, Wrong> {
        self.at += 1;
        let line = store::next_line(&mut self.from).map_err(|error| (expected.to_string(), error.to_string()))?;
        let Some(line) = line else { return Err((expected.to_string(), "the end of the file".into())) };
        match store::too_large(&line.bytes) {
            Some(wrong) => Err(wrong),
            None if line.ended => Ok(line.bytes),
            None => {
                let found = format!("half a line of {} bytes", line.bytes.len());
                Err((format!("{expected}, ended by a line feed"), found))
            }
        }
    }

    /// Returns `true` if nothing more can be read.
    pub fn is_at_end(&mut self) -> bool {
        self.from.fill_buf().is_ok_and(<[u8]>::is_empty)
    }

    pub fn at(&self) -> usize {
        self.at
    }

    /// Nothing may follow.
    pub fn end(mut self) -> Result<(), (usize, Wrong)> {
        match self.from.fill_buf().map(<[u8]>::is_empty) {
            Ok(true) => Ok(()),
            Ok(false) => Err((self.at + 1, ("the end of the file".into(), "more bytes".into()))),
            Err(error) => Err((self.at + 1, ("the end of the file".into(), error.to_string()))),
        }
    }
}

fn read<T: DeserializeOwned>(bytes: &[u8], expected: &str) -> Result<T, Wrong> {
    serde_json::from_slice(bytes).map_err(|error| (expected.to_string(), error.to_string()))
}

/// A value as a line with its end.
pub(super) fn line(value: &impl Serialize) -> Vec<u8> {
    match serde_json::to_vec(value) {
        Ok(mut bytes) => {
            bytes.push(b'\n');
            bytes
        }
        Err(error) => unreachable!("texts, lists and finite numbers under text keys: {error}"),
    }
}
