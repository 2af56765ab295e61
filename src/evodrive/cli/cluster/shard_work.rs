//! `shard work`: the tasks of shards, or all that follows in a lineage, done here. A result is written whole or not at all; what a killed worker had done
//! stays in a hidden folder beside the result, and the next one goes on from there.

use clap::Args;
use serde_json::json;
use std::path::{Path, PathBuf};

use crate::backend::{Answers, BackendOptions, DriverOptions, Fault, Planners, Recorder, Workers};
use crate::cli::cluster::shard_done::{Nobody, done, hold_keys};
use crate::cli::cluster::shard_lineage::{self, Bench};
use crate::cli::cluster::shard_needs;
use crate::cli::cluster::worker_process::Processes;
use crate::cli::evolve::behind;
use crate::cli::records::folder::{RunFolder, open_store};
use crate::cli::terminal::answer::{Answer, progress};
use crate::cli::terminal::exit::Failure;
use crate::epoch::{Mode, Rollouts, Study, Task, Workbench};
use crate::experiment::Experiment;
use crate::kernel::{Digest, Threads};
use crate::shard::{ResultFile, Shard, StudyMark, TaskOutcome, TaskResult};
use crate::store::{self, OwnDir};

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
    /// Questions to models that are open together [default: as many as there are threads].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=4096))]
    pub open: Option<u16>,
}

pub fn run(options: &WorkOptions, jobs: usize) -> Result<Answer, Failure> {
    let threads = Threads::new(jobs)?;
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
        shard_needs::hold(&shard.needs, &site.folder)?;
        let known = |_: Digest| Ok(shard.clone());
        if result.exists() && ResultFile::load(&result, &site.mark, &known).is_ok() {
            progress(format!("is done already: {}", result.display()));
        } else {
            let results = site.work(&shard, digest, &result, &threads, options.open.map(usize::from))?;
            without_label += results.iter().filter(|result| matches!(result.came, TaskOutcome::NoLabel(_))).count();
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
        open: Option<usize>,
    ) -> Result<Vec<TaskResult>, Failure> {
        let scratch = result.with_file_name(format!(".{}.work", digest.short(16)));
        // The work of a killed try is continued, and a folder of somebody else is not touched.
        let own = OwnDir::open(&scratch, &digest.to_hex())?;
        let store = open_store(&scratch)?;
        let processes = Processes::default();
        let driver = self.experiment.driver.as_ref();
        let planner = driver.map(|driver| shard_needs::planner(driver, &self.folder)).transpose()?;
        let recorder = match &self.experiment.simulator.backend {
            None => None,
            Some(options) => {
                let before = behind::recorded(options, &self.folder.rollouts(), false)?;
                Some(Recorder::new(&store, before, self.asked(options, planner.as_ref(), &processes)?, String::new()))
            }
        };
        let answers = recorder.as_ref().map(|recorder| recorder as &dyn Answers);
        // The recorder is not asked for what the store has, which would then be missing among the answers.
        let mode = if answers.is_some() { Mode::Verify } else { Mode::Reuse };
        let rollouts = Rollouts::new(&store, mode);
        let (study, experiment, folder) = (&self.study, &self.experiment, &self.folder);
        let here = Bench { study, experiment, folder, threads, open, rollouts: &rollouts, answers };
        let (way, results) = match &shard.lineage {
            Some(lineage) => {
                if answers.is_none() {
                    shard_lineage::remember(lineage, &store)?;
                }
                let (way, results) = here.go(shard, lineage, &store, &scratch.join("walk.jsonl"))?;
                (Some(way), results)
            }
            None => {
                let tools = here.tools(&Nobody);
                let bench = Workbench::new(study, &tools);
                hold_keys(&bench, shard, result)?;
                let one = |_: usize, (key, task): &(Digest, Task)| done(&bench, shard, *key, task, &store);
                (None, threads.map(&shard.tasks, one).into_iter().collect::<Result<Vec<TaskResult>, Failure>>()?)
            }
        };
        let answers = recorder.map(|recorder| recorder.cassette().0);
        store::write_atomic(result, &ResultFile::bytes(digest, &self.mark, &results, answers.as_ref(), way.as_ref()))?;
        drop(store);
        own.remove()?;
        Ok(results)
    }

    /// Returns what simulates rollouts here in place of our own simulator.
    ///
    /// # Errors
    /// It cannot be started on this machine: another one may have it.
    fn asked<'a>(
        &'a self,
        options: &'a BackendOptions,
        planner: Option<&'a DriverOptions>,
        processes: &'a Processes,
    ) -> Result<Box<dyn Answers + 'a>, Failure> {
        let lacks = |fault: Fault| Failure::lacking(format!("this machine cannot do the shard: {fault}"));
        if let Some(planner) = planner {
            let planners = Planners::new(planner, processes);
            planners.ready().map_err(lacks)?;
            return Ok(Box::new(planners));
        }
        let workers = Workers::new(options, processes);
        workers.ready().map_err(lacks)?;
        Ok(Box::new(workers))
    }
}
