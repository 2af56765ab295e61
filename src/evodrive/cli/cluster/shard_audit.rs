//! `shard merge --audit`: a drawn share of what workers brought is computed again here, before any of it is merged. Of another
//! simulator's motion only the summing up is: nobody here can play it.

use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::backend::{Answers, Replay};
use crate::cli::cluster::shard_done::{Nobody, done, hold_keys};
use crate::cli::evolve::behind;
use crate::cli::records::folder::open_store;
use crate::cli::terminal::exit::Failure;
use crate::epoch::{Meter, Mode, Rollouts, Study, Tools, Workbench};
use crate::experiment::Experiment;
use crate::kernel::{Digest, Threads};
use crate::shard::{Merge, ResultFile, Shard, ShardError, TaskOutcome, Untrue};
use crate::store::{self, Scratch};

/// Result of an audit.
pub struct Audited {
    /// Tasks that were computed again.
    pub checked: usize,
    /// Results in which nothing was found.
    pub usable: Vec<PathBuf>,
    /// Results of others that are not true, each with one error.
    pub untrue: Vec<(PathBuf, ShardError)>,
}

/// Means to compute tasks again.
pub struct Auditor<'a> {
    pub experiment: &'a Experiment,
    pub study: &'a Study,
    pub threads: &'a Threads,
    /// The run's folder, for a folder that is soon gone.
    pub folder: &'a Path,
}

impl Auditor<'_> {
    /// Draws tasks of every result by their outcomes, so that nobody knows beforehand which ones are checked, and does them again.
    ///
    /// # Errors
    /// A reason why this machine cannot do a task.
    pub fn audit(&self, share: f64, merge: &Merge<'_>, results: Vec<PathBuf>) -> Result<Audited, Failure> {
        let scratch = Scratch::under(self.folder, ".audit-")?;
        let mut audited = Audited { checked: 0, usable: Vec::new(), untrue: Vec::new() };
        for (number, path) in results.into_iter().enumerate() {
            // The merge refuses what cannot be read.
            let found = match merge.load(&path) {
                Ok((shard, result)) => self.untrue(share, &shard, result, &scratch.dir.join(number.to_string()))?,
                Err(_) => (0, None),
            };
            audited.checked += found.0;
            match found.1 {
                Some(untrue) => audited.untrue.push((path, untrue)),
                None => audited.usable.push(path),
            }
        }
        Ok(audited)
    }

    /// Returns the number of tasks of a result that were done again, and the first that came out otherwise.
    fn untrue(
        &self,
        share: f64,
        shard: &Shard,
        result: ResultFile,
        scratch: &Path,
    ) -> Result<(usize, Option<ShardError>), Failure> {
        let mut drawn = Vec::new();
        for (place, of) in result.results.iter().enumerate() {
            if of.is_drawn(share)? {
                drawn.push(place);
            }
        }
        let store = open_store(scratch)?;
        let replay = result.answers.map(|answers| Replay::new(answers, "do the shard again"));
        let answers = replay.as_ref().map(|replay| replay as &dyn Answers);
        let rollouts = Rollouts::new(&store, Mode::Verify);
        let tools = Tools::new(self.study, &Nobody, self.threads, &rollouts, Meter::default());
        let tools = tools.behind(behind::backend(self.experiment, answers));
        let bench = Workbench::new(self.study, &tools);
        hold_keys(&bench, shard, Path::new(&result.file))?;
        let again = self.threads.map(&drawn, |_, &place| {
            let (key, task) = &shard.tasks[place];
            done(&bench, shard, *key, task, &store)
        });
        for (&place, again) in drawn.iter().zip(again) {
            let (key, task) = &shard.tasks[place];
            let wrong = match again {
                Ok(again) => difference(&again.came, &result.results[place].came),
                // Where motion was brought along, the record must follow from it.
                Err(failure) if answers.is_some() => {
                    Some(("its motion".into(), "one that it follows from".into(), failure.message))
                }
                Err(failure) => return Err(failure),
            };
            if let Some((field, expected, found)) = wrong {
                let (file, scene) = (result.file.clone(), task.scene().to_string());
                let untrue = Untrue { file, task: *key, scene, field, expected, found };
                return Ok((drawn.len(), Some(ShardError::from(Box::new(untrue)))));
            }
        }
        Ok((drawn.len(), None))
    }
}

/// The first field in which what came of a task here is not what the result says.
fn difference(here: &TaskOutcome, brought: &TaskOutcome) -> Option<(String, String, String)> {
    match (here, brought) {
        (TaskOutcome::Record(here), TaskOutcome::Record(brought)) if here.get() == brought.get() => None,
        (TaskOutcome::Record(here), TaskOutcome::Record(brought)) => {
            let [due, found] = [here, brought].map(|of| serde_json::from_str::<Value>(of.get()).unwrap_or_default());
            let said = |of: &str| Digest::of_bytes(of.as_bytes()).to_hex();
            // Another spelling of the same values has another name.
            let spelling = || ("its bytes".into(), said(here.get()), said(brought.get()));
            Some(if due == found { spelling() } else { store::first_difference("", &due, &found) })
        }
        (TaskOutcome::NoLabel(_), TaskOutcome::NoLabel(_)) | (TaskOutcome::Asked, TaskOutcome::Asked) => None,
        (here, brought) => Some(("what came of it".into(), kind(here), kind(brought))),
    }
}

fn kind(came: &TaskOutcome) -> String {
    match came {
        TaskOutcome::Record(_) => "a record".into(),
        TaskOutcome::NoLabel(reason) => format!("no label ({reason})"),
        TaskOutcome::Asked => "an answer".into(),
    }
}

/// A share as it is typed.
pub fn share(word: &str) -> Result<f64, String> {
    let share = word.parse().ok().filter(|share| (0.0..=1.0).contains(share) && *share > 0.0);
    share.ok_or_else(|| "expected a share above 0 and at most 1, e.g. 0.05".into())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shard::TaskResult;

    fn result(key: &[u8]) -> TaskResult {
        TaskResult { key: Digest::of_bytes(key), came: TaskOutcome::NoLabel("why".into()) }
    }

    #[test]
    fn a_draw_takes_about_its_share_and_all_where_all_are_asked_for() {
        let all: Vec<TaskResult> = (0..2000u32).map(|i| result(&i.to_le_bytes())).collect();
        let drawn = |share: f64| all.iter().filter(|of| of.is_drawn(share).unwrap()).count();
        assert_eq!(drawn(1.0), 2000);
        assert!((150..250).contains(&drawn(0.1)), "{}", drawn(0.1));
        // A larger draw holds the smaller one.
        assert!(all.iter().all(|of| !of.is_drawn(0.1).unwrap() || of.is_drawn(0.2).unwrap()));
    }

    #[test]
    fn shares_that_are_none_are_refused() {
        for word in ["0", "-0.1", "1.5", "NaN", "all"] {
            assert!(share(word).is_err(), "{word}");
        }
        assert_eq!(share("1"), Ok(1.0));
    }
}
