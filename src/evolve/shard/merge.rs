//! The union of results. All results are read and compared before anything is written; a result that cannot be used costs
//! nobody else, and two records of one request stop everything.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::error::{Conflict, ShardError, WORK_AGAIN, WithdrawnRecord, place};
use super::file::{SHARD_ENDING, Shard};
use super::mark::StudyMark;
use super::result::{ResultFile, TaskOutcome};
use super::withdrawn::Withdrawn;
use crate::backend::{Answer, Recorded, RolloutCassette};
use crate::epoch::{RecordedAnswer, RunError, Task, no_label_key};
use crate::kernel::Digest;
use crate::store::{MemoKind, Store, StoreError};

/// Records between two flushes of the store.
const FLUSH_EVERY: usize = 20_000;

/// The key under which a study keeps what comes of a task.
pub type KeyOf<'a> = dyn Fn(&Task) -> Result<Digest, RunError> + 'a;

/// Destination of results.
pub struct Merge<'a> {
    pub study: &'a StudyMark,
    /// The folder with the shards.
    pub shards: &'a Path,
    pub store: &'a Store,
    /// Records that were taken out of the run and may not come back.
    pub withdrawn: &'a [Withdrawn],
    /// Answers of another simulator, where one is asked.
    pub cassette: Option<&'a mut RolloutCassette>,
    /// The key of a task, where results say themselves which tasks they are of.
    pub key: Option<&'a KeyOf<'a>>,
}

/// Result of a merge.
#[derive(Debug, Default)]
pub struct Merged {
    /// Results that were read whole.
    pub results: usize,
    /// Records that were new, and those that were there already.
    pub records: usize,
    pub known: usize,
    /// Tasks that gave no label.
    pub no_label: usize,
    /// Answers of another simulator that were new.
    pub answers: usize,
    /// Answers of models that were asked on the way, by the keys of their questions.
    pub asked: Vec<RecordedAnswer>,
    /// Why results were left out.
    pub refused: Vec<(PathBuf, ShardError)>,
}

/// First place at which each record was met: its digest, and the number of the result; `None` is the run itself.
type Met = BTreeMap<(Kind, Digest), (Digest, Option<usize>)>;

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Kind {
    Memo(MemoKind),
    Answer,
}

impl Kind {
    fn name(self) -> &'static str {
        match self {
            Kind::Memo(MemoKind::Compile) => "trial",
            Kind::Memo(_) => "rollout",
            Kind::Answer => "answer of the backend",
        }
    }
}

impl Merge<'_> {
    /// Unites results, given by their files.
    ///
    /// # Errors
    /// Two different records of one request: nothing was merged. A store that cannot be written.
    pub fn merge(&mut self, results: &[PathBuf]) -> Result<Merged, ShardError> {
        let mut merged = Merged::default();
        let mut met = Met::new();
        let mut usable = Vec::with_capacity(results.len());
        for (number, path) in results.iter().enumerate() {
            match self.load(path) {
                Ok((shard, result)) => {
                    if let Some(refused) = self.was_withdrawn(&shard, &result) {
                        merged.refused.push((path.clone(), refused));
                        continue;
                    }
                    self.compare(&shard, &result, number, results, &mut met)?;
                    usable.push(path);
                }
                Err(ShardError::Canon(error)) => return Err(error.into()),
                Err(refused) => merged.refused.push((path.clone(), refused)),
            }
        }
        drop(met);
        let mut unflushed = 0;
        for path in usable {
            // Its keys were held to their tasks above.
            let (shard, result) = self.read(path)?;
            unflushed += result.results.len();
            self.keep(&shard, result, &mut merged)?;
            if unflushed >= FLUSH_EVERY {
                self.store.flush()?;
                unflushed = 0;
            }
            merged.results += 1;
        }
        self.store.flush()?;
        Ok(merged)
    }

    /// A record of the result that somebody took out of the run.
    fn was_withdrawn(&self, shard: &Shard, result: &ResultFile) -> Option<ShardError> {
        let of = |((key, task), came): ((&Digest, &Task), &TaskOutcome)| {
            let (TaskOutcome::Record(record), Some(memo)) = (came, task.memo()) else { return None };
            let digest = Digest::of_bytes(record.get().as_bytes());
            let same = |of: &&Withdrawn| (of.kind, of.request, of.record) == (memo, *key, digest);
            let of = self.withdrawn.iter().find(same).filter(|_| self.store.memo_get(memo, key).is_none())?;
            let (file, scene, reason) = (result.file.clone(), task.scene().to_string(), of.reason.clone());
            Some(Box::new(WithdrawnRecord { file, task: *key, scene, record: digest, reason }).into())
        };
        shard.tasks.iter().map(|(key, task)| (key, task)).zip(result.results.iter().map(|of| &of.came)).find_map(of)
    }

    /// A result with the shard that it is of.
    ///
    /// # Errors
    /// One that cannot be used.
    pub fn load(&self, path: &Path) -> Result<(Shard, ResultFile), ShardError> {
        let (shard, result) = self.read(path)?;
        if let (Some(key_of), true) = (self.key, shard.lineage.is_some()) {
            for (key, task) in &shard.tasks {
                let own = key_of(task).map_or_else(|error| error.to_string(), |own| own.to_hex());
                if own != key.to_hex() {
                    let (expected, found) =
                        (format!("the key {own} of a task of scene {}", task.scene()), key.to_hex());
                    let (file, place) = (result.file, place(0));
                    return Err(ShardError::Damaged { file, place, expected, found, remedy: WORK_AGAIN });
                }
            }
        }
        Ok((shard, result))
    }

    /// The same without a look at its keys.
    fn read(&self, path: &Path) -> Result<(Shard, ResultFile), ShardError> {
        let shards =
            |digest: Digest| Shard::load(&self.shards.join(format!("{digest}{SHARD_ENDING}"))).map(|(shard, _)| shard);
        ResultFile::load(path, self.study, &shards)
    }

    /// Compares with what the run has and with the results before this one.
    fn compare(
        &self,
        shard: &Shard,
        result: &ResultFile,
        number: usize,
        results: &[PathBuf],
        met: &mut Met,
    ) -> Result<(), ShardError> {
        let mut meet = |kind: Kind, key: Digest, scene: &str, digest: Digest, stored: Option<Digest>| {
            let before = met.get(&(kind, key)).copied().or(stored.map(|stored| (stored, None)));
            match before {
                Some((first, from)) if first != digest => Err(ShardError::from(Box::new(Conflict {
                    what: kind.name(),
                    key,
                    scene: scene.to_string(),
                    first,
                    first_from: from.map_or("the run itself".into(), |number| results[number].display().to_string()),
                    second: digest,
                    second_from: result.file.clone(),
                }))),
                Some(_) => Ok(()),
                None => {
                    met.insert((kind, key), (digest, Some(number)));
                    Ok(())
                }
            }
        };
        for ((key, task), of) in shard.tasks.iter().zip(&result.results) {
            if let (TaskOutcome::Record(record), Some(memo)) = (&of.came, task.memo()) {
                let digest = Digest::of_bytes(record.get().as_bytes());
                meet(Kind::Memo(memo), *key, task.scene(), digest, self.store.memo_get(memo, key))?;
            }
        }
        for (key, recorded) in answered(result.answers.as_ref()) {
            let stored = self.cassette.as_ref().and_then(|cassette| cassette.answer_digest(key));
            let digest = RolloutCassette::digest_of(*key, &recorded.answer);
            meet(Kind::Answer, *key, &recorded.scene, digest, stored)?;
        }
        Ok(())
    }

    fn keep(&mut self, shard: &Shard, result: ResultFile, merged: &mut Merged) -> Result<(), ShardError> {
        for ((key, task), of) in shard.tasks.iter().zip(result.results) {
            match (of.came, task.memo()) {
                (TaskOutcome::Record(record), Some(memo)) => {
                    if self.store.memo_get(memo, key).is_some() {
                        merged.known += 1;
                        continue;
                    }
                    let object = self.store.put(record.get().as_bytes())?;
                    self.store.memo_put(memo, key, &object)?;
                    merged.records += 1;
                }
                (TaskOutcome::NoLabel(reason), _) => {
                    merged.no_label += 1;
                    let object = self.store.put(reason.as_bytes())?;
                    match self.store.memo_put(MemoKind::Rollout, &no_label_key(key)?, &object) {
                        // The first reason stays: it names the scene's trouble as well as another one.
                        Ok(()) | Err(StoreError::Conflict { .. }) => {}
                        Err(error) => return Err(error.into()),
                    }
                }
                (TaskOutcome::Record(_) | TaskOutcome::Asked, _) => {}
            }
        }
        merged.asked.extend(result.asked);
        if let (Some(cassette), Some(answers)) = (&mut self.cassette, &result.answers) {
            for (key, recorded) in answers.rollouts() {
                // A motion stands above a failure, never the other way round.
                let better = match cassette.get(key).map(|before| &before.answer) {
                    None => true,
                    Some(Answer::Failed(_)) => matches!(recorded.answer, Answer::ReportedRollout(_)),
                    Some(Answer::ReportedRollout(_)) => false,
                };
                if better {
                    cassette.insert(*key, recorded.clone());
                    merged.answers += 1;
                }
            }
        }
        Ok(())
    }
}

/// Answers that are motions.
fn answered(answers: Option<&RolloutCassette>) -> impl Iterator<Item = (&Digest, &Recorded)> {
    let all = answers.into_iter().flat_map(RolloutCassette::rollouts);
    all.filter(|(_, recorded)| matches!(recorded.answer, Answer::ReportedRollout(_)))
}
