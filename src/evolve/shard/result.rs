//! Result of a shard: JSON lines. The header names the shard and the study; then comes one line per task in the shard's order, with the
//! record as the store keeps it; then, where another simulator was asked, its answers as lines of a rollout cassette; last a line with
//! both counts. The result of a whole lineage says itself which programs and tasks its records are of, and what a model was asked. Lines
//! and digests reveal a cut or altered result.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use serde::{Deserialize, Serialize};
use serde_json::value::RawValue;

use super::error::{ShardError, WORK_AGAIN, place};
use super::file::{Lines, ProgramLine, Shard, TaskLine, VERSION, Wrong, line};
use super::mark::StudyMark;
use crate::backend::RolloutCassette;
use crate::epoch::{RecordedAnswer, Task, TrialRecord};
use crate::evaluation::RolloutRecord;
use crate::kernel::Digest;
use crate::objects::Program;

/// Ending of a result's file name, behind the digest of its shard.
pub const RESULT_ENDING: &str = ".result";
const FORMAT: &str = "evodrive-shard-result";

/// Outcome of one task.
#[derive(Clone, Debug)]
pub enum TaskOutcome {
    /// The record, as the store keeps it.
    Record(Box<RawValue>),
    /// Why there is no label.
    NoLabel(String),
    /// Another simulator was asked; its answer is among the answers.
    Asked,
}

/// A task's key with what came of it.
#[derive(Clone, Debug)]
pub struct TaskResult {
    pub key: Digest,
    pub came: TaskOutcome,
}

impl TaskResult {
    /// Returns `true` if an audit of this share does the task again. The outcome takes part in the draw: whoever makes a record
    /// up does not know before whether it will be looked at.
    pub fn is_drawn(&self, share: f64) -> Result<bool, ShardError> {
        let came = match &self.came {
            TaskOutcome::Record(record) => record.get(),
            TaskOutcome::NoLabel(reason) => reason,
            TaskOutcome::Asked => return Ok(false),
        };
        let drawn = Digest::of("evodrive/shard-audit/1", &(self.key, came))?;
        let first = drawn.as_bytes().iter().take(8).fold(0u64, |all, byte| all << 8 | u64::from(*byte));
        Ok(share >= 1.0 || (first as f64) < share * (u64::MAX as f64))
    }
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct HeadLine {
    format: String,
    version: String,
    shard: Digest,
    study: StudyMark,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    lineage: Option<MadeLine>,
}

/// Head of a whole lineage: how many programs, tasks and answers of models follow.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct MadeLine {
    programs: usize,
    tasks: usize,
    asked: usize,
}

/// Programs, tasks and answers of a lineage's work: the tasks are the result's own.
#[derive(Clone, Debug, Default)]
pub struct OnTheWay {
    pub programs: BTreeMap<Digest, Program>,
    pub tasks: Vec<(Digest, Task)>,
    /// Answers of a model that was asked, by the keys of its questions.
    pub asked: Vec<RecordedAnswer>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct ResultLine {
    task: Digest,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    digest: Option<Digest>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    record: Option<Box<RawValue>>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    no_label: Option<String>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct EndLine {
    tasks: usize,
    answers: usize,
}

/// The result of a shard.
pub struct ResultFile {
    /// As messages name it.
    pub file: String,
    pub results: Vec<TaskResult>,
    /// Answers of another simulator; none of ours.
    pub answers: Option<RolloutCassette>,
    /// Answers of a model that was asked in a lineage's work.
    pub asked: Vec<RecordedAnswer>,
}

impl ResultFile {
    /// The name of a shard's result.
    pub fn name(shard: Digest) -> String {
        format!("{shard}{RESULT_ENDING}")
    }

    /// The bytes of a result.
    pub fn bytes(
        shard: Digest,
        study: &StudyMark,
        results: &[TaskResult],
        answers: Option<&RolloutCassette>,
        way: Option<&OnTheWay>,
    ) -> Vec<u8> {
        let (format, version) = (FORMAT.to_string(), VERSION.to_string());
        let counted =
            |way: &OnTheWay| MadeLine { programs: way.programs.len(), tasks: way.tasks.len(), asked: way.asked.len() };
        let lineage = way.map(counted);
        let mut bytes = line(&HeadLine { format, version, shard, study: study.clone(), lineage });
        if let Some(OnTheWay { programs, tasks, asked }) = way {
            for (program, body) in programs {
                bytes.extend(line(&ProgramLine { program: *program, body: body.clone() }));
            }
            for (task, of) in tasks {
                bytes.extend(line(&TaskLine { task: *task, of: of.clone() }));
            }
            asked.iter().for_each(|answer| bytes.extend(line(answer)));
        }
        for TaskResult { key, came } in results {
            let mut of = ResultLine { task: *key, digest: None, record: None, no_label: None };
            match came {
                TaskOutcome::Record(record) => {
                    of.digest = Some(Digest::of_bytes(record.get().as_bytes()));
                    of.record = Some(record.clone());
                }
                TaskOutcome::NoLabel(reason) => of.no_label = Some(reason.clone()),
                TaskOutcome::Asked => {}
            }
            bytes.extend(line(&of));
        }
        answers.into_iter().flat_map(RolloutCassette::lines).for_each(|line| bytes.extend(line));
        bytes.extend(line(&EndLine { tasks: results.len(), answers: answers.map_or(0, RolloutCassette::len) }));
        bytes
    }

    /// Reads a result, and holds it to its shard and its study, line by line. `shards` finds a shard by its digest. The shard comes
    /// back with it: of a whole lineage with the programs and tasks that the result is of.
    pub fn load(
        path: &Path,
        study: &StudyMark,
        shards: &dyn Fn(Digest) -> Result<Shard, ShardError>,
    ) -> Result<(Shard, ResultFile), ShardError> {
        let file = path.display().to_string();
        let damaged = |at: usize, (expected, found): Wrong| ShardError::Damaged {
            file: file.clone(),
            place: place(at),
            expected,
            found,
            remedy: WORK_AGAIN,
        };
        let mut lines = Lines::open(path)?;
        let head: HeadLine = lines.head(FORMAT, &file)?.map_err(|wrong| damaged(1, wrong))?;
        study.check(&head.study, &file)?;
        let mut shard = shards(head.shard)?;
        let mut asked = Vec::new();
        match (head.lineage, shard.lineage.is_some()) {
            (Some(made), true) => {
                shard.read_tasks(&mut lines, made.programs, made.tasks, "result", &damaged)?;
                for _ in 0..made.asked {
                    let (at, read) = lines.next::<RecordedAnswer>("what a model was asked");
                    asked.push(read.map_err(|wrong| damaged(at, wrong))?);
                }
            }
            (None, false) => {}
            (_, whole) => {
                let say = |whole: bool| if whole { "a result of a whole lineage" } else { "a result of tasks" };
                return Err(damaged(1, (say(whole).into(), say(!whole).into())));
            }
        }
        let mut results = Vec::with_capacity(shard.tasks.len());
        for (key, task) in &shard.tasks {
            let (at, read) = lines.next::<ResultLine>("the result of a task");
            let came = read.and_then(|line| line.of(*key, task)).map_err(|wrong| damaged(at, wrong))?;
            results.push(TaskResult { key: *key, came });
        }
        let answers = study.backend.as_ref().map(|backend| RolloutCassette::new(file.clone(), backend.clone()));
        let (answers, end) = answers_of(&mut lines, answers).map_err(|(at, wrong)| damaged(at, wrong))?;
        let counts = (end.tasks, end.answers);
        let expected = (results.len(), answers.as_ref().map_or(0, RolloutCassette::len));
        if counts != expected {
            let say = |(tasks, answers): (usize, usize)| format!("{tasks} tasks and {answers} answers");
            return Err(damaged(lines.at(), (say(expected), say(counts))));
        }
        lines.end().map_err(|(at, wrong)| damaged(at, wrong))?;
        match answers.as_ref().and_then(|answers| unanswered(&shard, &results, answers)) {
            Some(scene) => Err(damaged(0, (format!("an answer for scene {scene}"), "none".into()))),
            None => Ok((shard, ResultFile { file, results, answers, asked })),
        }
    }
}

/// A scene for which another simulator must have been asked and of which there is no answer.
fn unanswered(shard: &Shard, results: &[TaskResult], answers: &RolloutCassette) -> Option<String> {
    let of: BTreeSet<&str> = answers.rollouts().map(|(_, recorded)| recorded.scene.as_str()).collect();
    let asked = shard.tasks.iter().zip(results).filter(|((_, task), result)| {
        matches!((task, &result.came), (Task::Label { .. }, TaskOutcome::Record(_)) | (Task::Undisturbed { .. }, _))
    });
    asked.map(|((_, task), _)| task.scene()).find(|scene| !of.contains(scene)).map(str::to_string)
}

/// The answers and the last line.
fn answers_of(
    lines: &mut Lines<'_>,
    mut answers: Option<RolloutCassette>,
) -> Result<(Option<RolloutCassette>, EndLine), (usize, Wrong)> {
    loop {
        let raw = lines.raw("an answer or the last line").map_err(|wrong| (lines.at(), wrong))?;
        if let Ok(end) = serde_json::from_slice::<EndLine>(&raw) {
            return Ok((answers, end));
        }
        match &mut answers {
            Some(answers) => answers.read_line(&raw).map_err(|wrong| (lines.at(), wrong))?,
            None => {
                let wrong = ("the last line, with the counts".to_string(), "another line".to_string());
                return Err((lines.at(), wrong));
            }
        }
    }
}

impl ResultLine {
    /// Returns the outcome of a task, if this is its line and the record is about what the task is about.
    fn of(self, key: Digest, task: &Task) -> Result<TaskOutcome, Wrong> {
        if self.task != key {
            return Err((format!("the result of task {key}"), format!("one of {}", self.task)));
        }
        match (task, self.digest, self.record, self.no_label) {
            (Task::Label { .. } | Task::Trial { .. }, Some(digest), Some(record), None) => {
                let computed = Digest::of_bytes(record.get().as_bytes());
                if computed != digest {
                    return Err((format!("a record with digest {digest}"), format!("one with {computed}")));
                }
                about(task, record.get())?;
                Ok(TaskOutcome::Record(record))
            }
            (Task::Label { .. }, None, None, Some(reason)) => Ok(TaskOutcome::NoLabel(reason)),
            (Task::Undisturbed { .. }, None, None, None) => Ok(TaskOutcome::Asked),
            _ => Err(("a record with its digest, or why there is no label".into(), "neither".into())),
        }
    }
}

/// Refuses a record of another program or scene than the task's, and numbers that no rollout has.
fn about(task: &Task, record: &str) -> Result<(), Wrong> {
    let unread = |error: serde_json::Error| ("a record".to_string(), error.to_string());
    let (program, scene) = match task {
        Task::Trial { .. } => {
            let TrialRecord { program, scene, .. } = serde_json::from_str(record).map_err(unread)?;
            (program, scene)
        }
        _ => {
            let RolloutRecord { program, scene, outcome, .. } = serde_json::from_str(record).map_err(unread)?;
            if let Some(wrong) = outcome.out_of_range() {
                return Err(wrong);
            }
            (program, scene)
        }
    };
    if Some(program) == task.program() && scene == task.scene() {
        return Ok(());
    }
    let say = |program: Digest, scene: &str| format!("program {} in scene {scene}", program.short(16));
    Err((say(task.program().unwrap_or(program), task.scene()), say(program, &scene)))
}
