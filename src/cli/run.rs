//! `run`, `resume`, `replay`, `verify`, `record`: one way through a study, with different sources of answers and labels.

use serde_json::json;
use std::collections::BTreeMap;
use std::path::Path;

use super::answer::{Answer, progress};
use super::args::{FolderArgs, RecordArgs, RunArgs};
use super::exit::Failure;
use super::experiment::Experiment;
use super::folder::RunFolder;
use super::{inputs, playables, result_text};
use crate::epoch::{self, Desk, Mode, Progress, Rollouts, Study};
use crate::evidence::report;
use crate::kernel::{Digest, par::Pool as Threads};
use crate::llm::{Ask, Cassette, DrawSlot, Model, Record, RecordMode, Replay, scripted::Scripted};
use crate::objects::event::RunResult;
use crate::scene::{Pool, pool};
use crate::store::{self, Store, Transcript};

/// Replays an experiment from its cassette into its run folder.
pub fn run(args: &RunArgs) -> Result<Answer, Failure> {
    let job = Job::new(args)?;
    let path = args.cassette.clone().unwrap_or_else(|| job.beside(&job.experiment.cassette));
    let cassette = Cassette::load(&path).map_err(|error| {
        let record = format!("evodrive record {}", args.experiment.display());
        Failure { message: format!("{error}\n  to record it: {record}"), ..Failure::from(error) }
    })?;
    let folder = job.open_folder(false)?;
    store::copy(&path, &folder.cassette())?;
    let remedy = format!("evodrive record {}", args.experiment.display());
    let replay = Replay::new(cassette, remedy);
    carry_out(job, &folder, &replay, Mode::Reuse, !args.no_report)
}

/// Asks the models for what the cassette lacks, and writes it.
pub fn record(args: &RecordArgs) -> Result<Answer, Failure> {
    let job = Job::new(&args.run)?;
    let path = args.run.cassette.clone().unwrap_or_else(|| job.beside(&job.experiment.cassette));
    let before = match path.exists() && !args.fresh {
        true => Cassette::load(&path)?,
        false => Cassette::new(path.display().to_string()),
    };
    let folder = job.open_folder(true)?;
    // Answers may differ from those of an earlier recording of the same inputs.
    store::remove_file(&folder.transcript())?;
    let answers = Store::open(&folder.dir.join("recording"))?;
    let mode = match args.fresh {
        true => RecordMode::Fresh { recording: folder.dir.display().to_string() },
        false => RecordMode::Missing,
    };
    let recorder = Record::new(&answers, before, mode, models(&job.experiment)?);
    let name = job.experiment.name.clone();
    let report = !args.run.no_report;
    let answer = carry_out(job, &folder, &recorder, Mode::Reuse, report)?;
    let order: Vec<DrawSlot> = Vec::new();
    let cassette = recorder.into_cassette(&name, &order)?;
    cassette.save(&path, &name)?;
    store::copy(&path, &folder.cassette())?;
    folder.write_card(&name, false)?;
    progress(format!("recorded {} exchanges in {}", cassette.exchanges().len(), path.display()));
    Ok(answer)
}

/// Goes on with an interrupted run, or confirms a finished one.
pub fn resume(args: &FolderArgs) -> Result<Answer, Failure> {
    again(args, Mode::Reuse, true)
}

pub fn replay(args: &FolderArgs) -> Result<Answer, Failure> {
    again(args, Mode::Reuse, false)
}

pub fn verify(args: &FolderArgs) -> Result<Answer, Failure> {
    again(args, Mode::Verify, false)
}

/// Derives a run folder's run again from its own copies of experiment, scenes and cassette.
fn again(args: &FolderArgs, mode: Mode, report: bool) -> Result<Answer, Failure> {
    let folder = RunFolder::find(args.run.as_deref())?;
    if folder.card()?.recording {
        return Err(Failure::bad_input(format!(
            "{} belongs to a recording that was interrupted; repeat the `evodrive record` command: what was answered is not asked again",
            folder.dir.display()
        )));
    }
    let threads = Threads::new(args.jobs).map_err(Failure::internal)?;
    let experiment = Experiment::read(&folder.experiment())?;
    let scenes = inputs::read_pool(&folder.pool())?;
    let job = Job { experiment, file: folder.experiment(), scenes, threads, out: folder.dir.clone() };
    let remedy = format!("evodrive record with the experiment of {}", folder.dir.display());
    let replay = Replay::new(Cassette::load(&folder.cassette())?, remedy);
    carry_out(job, &folder, &replay, mode, report)
}

/// What a run starts from.
struct Job {
    experiment: Experiment,
    file: std::path::PathBuf,
    scenes: Pool,
    threads: Threads,
    out: std::path::PathBuf,
}

impl Job {
    fn new(args: &RunArgs) -> Result<Job, Failure> {
        let threads = Threads::new(args.jobs).map_err(Failure::internal)?;
        let experiment = Experiment::read(&args.experiment)?;
        let scenes = inputs::scenes(&experiment, &args.experiment, &args.scenes, &threads)?;
        inputs::tell_left_out(&scenes);
        Ok(Job { experiment, file: args.experiment.clone(), scenes, threads, out: args.out.clone() })
    }

    fn beside(&self, path: &Path) -> std::path::PathBuf {
        self.file.parent().unwrap_or(Path::new(".")).join(path)
    }

    /// Makes the run folder self-contained before anything is computed.
    fn open_folder(&self, recording: bool) -> Result<RunFolder, Failure> {
        let folder = RunFolder::of(&self.out, &self.experiment.name, self.experiment.digest()?, self.scenes.digest())?;
        store::create_dir(&folder.dir)?;
        store::copy(&self.file, &folder.experiment())?;
        if !folder.pool().exists() {
            store::write_atomic(&folder.pool(), &pool::encode(&self.scenes))?;
        }
        folder.write_card(&self.experiment.name, recording)?;
        folder.mark_latest()?;
        Ok(folder)
    }
}

/// The models that the experiment names.
fn models(experiment: &Experiment) -> Result<BTreeMap<String, Box<dyn Model>>, Failure> {
    let mut models: BTreeMap<String, Box<dyn Model>> = BTreeMap::new();
    for (name, options) in &experiment.models {
        match options.kind.as_str() {
            "scripted" => models.insert(name.clone(), Box::new(Scripted)),
            other => {
                return Err(Failure::bad_input(format!(
                    "models.{name}.kind is \"{other}\"; this build can ask \"scripted\" (a build with --features live also real models)"
                )));
            }
        };
    }
    Ok(models)
}

/// The run itself, its result files and its report.
fn carry_out(job: Job, folder: &RunFolder, ask: &dyn Ask, mode: Mode, report: bool) -> Result<Answer, Failure> {
    let study = inputs::study(&job.experiment, job.scenes, ask, &job.threads)?;
    let objects = Store::open(&folder.store())?;
    let path = folder.transcript();
    let log = if path.exists() { Transcript::continue_from_start(&path)? } else { Transcript::create(&path)? };
    let confirmed = log.remaining();
    if confirmed > 0 {
        progress(format!("{confirmed} recorded events: each is derived again and compared"));
    }
    let mut watch = |news: Progress| progress(result_text::progress(&news));
    let rollouts = Rollouts::new(&objects, mode);
    let mut desk = Desk { log, rollouts: &rollouts, watch: &mut watch };
    let result = epoch::run(&study, &mut desk)?;
    let root = desk.log.head();
    let (reused, simulated) = desk.rollouts.counts();
    drop(desk);
    let result_json = serde_json::to_vec_pretty(&json!({"root": root, "result": result})).map_err(Failure::internal)?;
    store::write_atomic(&folder.result(), &result_json)?;
    if report {
        write_report(&study, folder)?;
    }
    progress(format!("rollouts: {simulated} simulated, {reused} read from the store"));
    Ok(answer(&job.experiment, folder, &result, root, (reused, simulated)))
}

/// Writes report.html of a finished run.
pub fn write_report(study: &Study<'_>, folder: &RunFolder) -> Result<(), Failure> {
    let story = folder.story()?;
    let playables = playables::choose(study, &story)?;
    Ok(store::write_atomic(&folder.report(), report::html(&story, &playables).as_bytes())?)
}

fn answer(
    experiment: &Experiment,
    folder: &RunFolder,
    result: &RunResult,
    root: Digest,
    (reused, simulated): (usize, usize),
) -> Answer {
    let text = result_text::summary(experiment, folder, result, root);
    let object = json!({
        "name": experiment.name,
        "root": root,
        "folder": folder.dir,
        "report": folder.report(),
        "result": result,
        "rollouts": {"simulated": simulated, "reused": reused},
    });
    Answer::new(text, object)
}
