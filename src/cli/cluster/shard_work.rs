//! `shard work`: the tasks of shards, done here. A result is written whole or not at all; what a killed worker had done
//! stays in a hidden folder beside the result, and the next one goes on from there.

use clap::Args;
use serde_json::json;
use std::path::{Path, PathBuf};

use crate::backend::{Answers, Recorder, Workers};
use crate::cli::cluster::worker_process::Processes;
use crate::cli::evolve::behind;
use crate::cli::records::folder::RunFolder;
use crate::cli::terminal::answer::{Answer, progress};
use crate::cli::terminal::exit::Failure;
use crate::epoch::{Done, Meter, Mode, Rollouts, Study, Task, Tools, Workbench};
use crate::experiment::Experiment;
use crate::kernel::{Digest, Threads};
use crate::shard::{Came, ResultFile, Shard, StudyMark, TaskResult};
use crate::store::{self, Store};

#[derive(Debug, Args)]
pub struct WorkOptions {
    /// Shards.
    #[arg(required = true)]
    pub shards: Vec<PathBuf>,
    /// Folder with the run's experiment.toml and scenes.pool; without it the run folder in which the shard lies.
    #[arg(long)]
    pub study: Option<PathBuf>,
    /// Folder for results; without it beside the shard.
    #[arg(long)]
    pub out: Option<PathBuf>,
}

pub fn run(options: &WorkOptions, jobs: usize) -> Result<Answer, Failure> {
    let threads = Threads::new(jobs).map_err(Failure::internal)?;
    let (mut written, mut tasks, mut without_label) = (Vec::new(), 0, 0);
    let mut site: Option<Site> = None;
    for path in &options.shards {
        let (shard, digest) = Shard::load(path)?;
        let folder = options.study.clone().unwrap_or_else(|| run_folder_of(path));
        if site.as_ref().is_none_or(|site| site.folder.dir != folder) {
            site = Some(Site::open(RunFolder { dir: folder }, &threads)?);
        }
        let Some(site) = &site else { continue };
        site.mark.check(&shard.study, &path.display().to_string())?;
        let out = options.out.clone().unwrap_or_else(|| folder_of(path));
        let result = out.join(ResultFile::name(digest));
        let known = |_: Digest| Ok(shard.clone());
        if result.exists() && ResultFile::load(&result, &site.mark, &known).is_ok() {
            progress(format!("is done already: {}", result.display()));
        } else {
            let results = site.work(&shard, digest, &result, &threads)?;
            without_label += results.iter().filter(|result| matches!(result.came, Came::NoLabel(_))).count();
            tasks += results.len();
            progress(format!("done: {}", result.display()));
        }
        written.push(result);
    }
    let text = format!("{} results, {tasks} tasks done, {without_label} of them gave no label\n", written.len());
    Ok(Answer::new(text, json!({"results": written, "tasks": tasks, "no_label": without_label})))
}

/// The folder of a file.
fn folder_of(path: &Path) -> PathBuf {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent.to_path_buf(),
        _ => PathBuf::from("."),
    }
}

/// The run folder in whose `shards` a shard lies.
fn run_folder_of(shard: &Path) -> PathBuf {
    folder_of(shard).join("..")
}

/// A study as this machine has it.
struct Site {
    folder: RunFolder,
    experiment: Experiment,
    study: Study,
    mark: StudyMark,
}

impl Site {
    fn open(folder: RunFolder, threads: &Threads) -> Result<Site, Failure> {
        let name = |failure: Failure| Failure {
            message: format!(
                "{}\n  a worker needs the run's experiment.toml and scenes.pool: name their folder with --study",
                failure.message
            ),
            ..failure
        };
        let experiment = folder.read_experiment().map_err(name)?;
        let scenes = folder.read_pool().map_err(name)?;
        let study = experiment.study(scenes, threads)?;
        let mark = StudyMark::of(&study);
        Ok(Site { folder, experiment, study, mark })
    }

    /// Does a shard and writes its result.
    fn work(
        &self,
        shard: &Shard,
        digest: Digest,
        result: &Path,
        threads: &Threads,
    ) -> Result<Vec<TaskResult>, Failure> {
        let scratch = result.with_file_name(format!(".{}.work", digest.short(16)));
        let store = Store::open(&scratch)?;
        let processes = Processes::default();
        let recorder = match &self.experiment.simulator.backend {
            None => None,
            Some(options) if options.drives() => {
                let reason = "the ego `command` needs its planner on this machine: record this run with `evodrive record` on one machine";
                return Err(Failure::bad_input(reason));
            }
            Some(options) => {
                let before = behind::recorded(options, &self.folder.rollouts(), false)?;
                Some(Recorder::new(&store, before, Box::new(Workers::new(options, &processes)), String::new()))
            }
        };
        let answers = recorder.as_ref().map(|recorder| recorder as &dyn Answers);
        // What the store has was not asked of the recorder, and would be missing among the answers.
        let mode = if answers.is_some() { Mode::Verify } else { Mode::Reuse };
        let rollouts = Rollouts::new(&store, mode);
        let results = {
            let tools = Tools::new(&self.study, &Nobody, threads, &rollouts, Meter::default());
            let tools = tools.behind(behind::backend(&self.experiment, answers));
            let bench = Workbench::new(&self.study, &tools);
            hold_keys(&bench, shard, result)?;
            let one = |_: usize, (key, task): &(Digest, Task)| done(&bench, shard, *key, task, &store);
            threads.map(&shard.tasks, one).into_iter().collect::<Result<Vec<TaskResult>, Failure>>()?
        };
        let answers = recorder.map(|recorder| recorder.cassette().0);
        store::write_atomic(result, &ResultFile::bytes(digest, &self.mark, &results, answers.as_ref()))?;
        drop(store);
        store::remove_dir(&scratch)?;
        Ok(results)
    }
}

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
        (Done::NoLabel(reason), _) => Came::NoLabel(reason),
        (Done::Record, Some(memo)) => {
            let absent = || Failure::internal(format!("the record of {key} was not kept"));
            let bytes = store.get(&store.memo_get(memo, &key).ok_or_else(absent)?)?;
            let text = String::from_utf8(bytes).map_err(Failure::internal)?;
            Came::Record(serde_json::value::RawValue::from_string(text).map_err(Failure::internal)?)
        }
        (Done::Asked | Done::Record, _) => Came::Asked,
    };
    Ok(TaskResult { key, came })
}

/// No task asks a model.
pub struct Nobody;

impl crate::llm::Ask for Nobody {
    fn ask(&self, _: &crate::llm::Request) -> Result<crate::llm::Reply, crate::llm::AskError> {
        unreachable!("no task asks a model")
    }
}
