//! One task of a shard: done, and its record read back.

use std::path::Path;

use crate::cli::terminal::exit::Failure;
use crate::epoch::{Done, Task, Workbench};
use crate::kernel::Digest;
use crate::llm::{Ask, AskError, DraftJudge, Reply, Request};
use crate::shard::{Shard, TaskOutcome, TaskResult};
use crate::store::Store;

/// Refuses tasks that this program would keep under other keys, before anything is done.
pub fn hold_keys(bench: &Workbench<'_>, shard: &Shard, result: &Path) -> Result<(), Failure> {
    for (key, task) in &shard.tasks {
        let own = bench.key(task)?;
        if own != *key {
            return Err(Failure::bad_input(format!(
                "shard of {}: the task of scene {} has the key {key}, this build expects {own}; use the same release of \
                 evodrive on all machines",
                result.display(),
                task.scene()
            )));
        }
    }
    Ok(())
}

/// Does one task and reads its record back.
pub fn done(
    bench: &Workbench<'_>,
    shard: &Shard,
    key: Digest,
    task: &Task,
    store: &Store,
) -> Result<TaskResult, Failure> {
    let program = task.program().and_then(|hash| shard.programs.get(&hash));
    let came = match (bench.carry_out(task, program)?, task.memo()) {
        (Done::NoLabel(reason), _) => TaskOutcome::NoLabel(reason),
        (Done::Record, Some(memo)) => {
            let absent = || Failure::internal(format!("the record of {key} was not kept"));
            let bytes = store.get(&store.memo_get(memo, &key).ok_or_else(absent)?)?;
            let text = String::from_utf8(bytes).map_err(Failure::internal)?;
            TaskOutcome::Record(serde_json::value::RawValue::from_string(text).map_err(Failure::internal)?)
        }
        (Done::Asked | Done::Record, _) => TaskOutcome::Asked,
    };
    Ok(TaskResult { key, came })
}

/// No task asks a model.
pub struct Nobody;

impl Ask for Nobody {
    fn ask_with(&self, _: &Request, _: Option<&dyn DraftJudge>) -> Result<Reply, AskError> {
        unreachable!("no task asks a model")
    }
}
