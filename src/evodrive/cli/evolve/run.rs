//! `run`, `resume`, `check`, `verify`, `record`: one way through a study, with different sources of answers and labels.

use serde_json::json;
use std::path::{Path, PathBuf};

use crate::backend::{Answers, BackendOptions, DriverOptions, Planners, Recorder, Replay as RecordedRollouts, Workers};
use crate::cli::cluster::worker_process::Processes;
use crate::cli::evolve::job_args::{JobArgs, RecordArgs, ResumeArgs, RunArgs};
use crate::cli::evolve::{announce, behind, cost, held::Held, models, other_pool, overwriting};
use crate::cli::look::page;
use crate::cli::records::covered::{RESULT_BYTES_MAX, generated, of_result};
use crate::cli::records::folder::{Recording, RunFolder, open_store, open_store_to_look};
use crate::cli::records::run_name::OneRun;
use crate::cli::scenes::left_out;
use crate::cli::terminal::answer::{Answer, progress};
use crate::cli::terminal::exit::Failure;
use crate::cli::terminal::interrupt::{Interrupt, Until};
use crate::cli::terminal::moving_line::{Heard, MovingLine};
use crate::cli::terminal::result_text::{self, Summary};
use crate::cli::terminal::typed::{instead, resume_command};
use crate::cli::terminal::width::{stderr_width, table_width};
use crate::epoch::{self, Desk, Meter, Mode, Progress, RolloutCounts, Rollouts, Study, Tools};
use crate::evidence::choice::Choice;
use crate::evidence::realism::LineageRealisms;
use crate::evidence::tables::LineagePreventable;
use crate::evidence::{RecordedRun, unlabelled};
use crate::experiment::Experiment;
use crate::kernel::{Digest, Threads};
use crate::llm::{Ask, Cassette, Record, RecordMode, Replay};
use crate::objects::event::RunResult;
use crate::scene::{Pool, pool};
use crate::store::{self, Store, Transcript};
use crate::text::counted;

/// Bytes that a cassette file may have.
const CASSETTE_BYTES_MAX: u64 = 1 << 30;

/// Replays an experiment from its cassette into its run folder. A run that fails leaves no folder that was not there before:
/// all that is in it can be derived again.
pub fn run(args: &RunArgs, jobs: usize) -> Result<Answer, Failure> {
    let job = Job::new(&args.job, jobs)?;
    let path = job.cassette(&args.job);
    let remedy = instead("run", "record", job.own_cassette(&args.job)?.as_deref());
    let cassette = Cassette::load_on(&path, Some(&job.threads))
        .map_err(|error| Failure { message: format!("{error}\n  to record it: {remedy}"), ..Failure::from(error) })?;
    other_pool::check(&cassette, &job.scenes)
        .map_err(|error| Failure { message: format!("{}\n  to record it: {remedy}", error.message), ..error })?;
    let rollouts = behind::replay(&job.experiment, &remedy)?;
    job.announce()?;
    let interrupt = Interrupt::listen()?;
    let held = job.open_folder(None)?;
    let ran = replayed(
        job,
        &held,
        &path,
        Replay::new(cassette, remedy),
        rollouts,
        &interrupt,
        RunMode::Replay { report: !args.no_report },
    );
    held.or_gone(ran.and_then(|answer| held.folder.mark_latest().map(|()| answer)), |_| false)
}

/// The run of a cassette, with the recorded rollouts of another simulator where the experiment names one.
fn replayed(
    job: Job,
    Held { folder, objects, .. }: &Held,
    path: &Path,
    replay: Replay,
    rollouts: Option<RecordedRollouts>,
    interrupt: &Interrupt,
    way: RunMode,
) -> Result<Answer, Failure> {
    if folder.card()?.recording.is_some() {
        return Err(interrupted(folder));
    }
    // The cassette of an existing run stays until this run has derived the same events.
    if !folder.cassette().exists() {
        store::copy(path, &folder.cassette())?;
    }
    let of = behind::path(&job.experiment);
    // So do its rollouts.
    if let Some(of) = of.as_ref().filter(|_| !folder.rollouts().exists()) {
        store::copy(of, &folder.rollouts())?;
    }
    let rollouts = rollouts.as_ref().map(|rollouts| rollouts as &dyn Answers);
    let sources = Sources { way, ask: &replay, open: None, rollouts };
    let done = carry_out(job, folder, objects, &sources, interrupt)?;
    store::copy(path, &folder.cassette())?;
    if let Some(of) = of {
        store::copy(&of, &folder.rollouts())?;
    }
    done.summary(folder, way, rollouts)
}

fn interrupted(folder: &RunFolder) -> Failure {
    Failure::bad_input(format!(
        "{} belongs to a recording that was interrupted; continue it with `{}` or repeat the `evodrive record` command: recorded answers are not asked for again",
        folder.dir.display(),
        resume_command(&folder.dir)
    ))
}

/// A way through a study. What is asked, simulated, written and compared follows from it alone.
#[derive(Clone, Copy, PartialEq, Eq)]
enum RunMode {
    /// From recorded answers to the events and the result, with a report where one is wanted.
    Replay { report: bool },
    /// The same, and whoever has an answer that is not recorded is asked for it: a model, another simulator, a planner.
    Record { report: bool },
    /// A finished run is derived again from its records and compared.
    Check,
    /// The same, and every rollout is simulated again. Quietly, where another command says what came of it.
    Verify { quiet: bool },
}

impl RunMode {
    /// Returns which rollouts are simulated. Another simulator is not asked for what the store has, which would then be missing in its cassette.
    fn mode(self, elsewhere: bool) -> Mode {
        match self {
            RunMode::Verify { .. } => Mode::Verify,
            RunMode::Record { .. } if elsewhere => Mode::Verify,
            RunMode::Replay { .. } | RunMode::Record { .. } | RunMode::Check => Mode::Reuse,
        }
    }

    /// Returns `true` if a finished run is compared with, and stays as it is.
    fn compares(self) -> bool {
        matches!(self, RunMode::Check | RunMode::Verify { .. })
    }

    /// Returns `true` if another simulator's rollouts are recorded motion that is summed up again.
    fn sums_up_again(self) -> bool {
        !matches!(self, RunMode::Record { .. })
    }

    fn is_quiet(self) -> bool {
        matches!(self, RunMode::Verify { quiet: true })
    }

    fn reports(self) -> bool {
        matches!(self, RunMode::Replay { report: true } | RunMode::Record { report: true })
    }
}

/// Sources of a run's answers and rollouts.
struct Sources<'a> {
    way: RunMode,
    ask: &'a dyn Ask,
    /// Most questions that are open together, where whoever answers takes their time.
    open: Option<usize>,
    /// Answers of another simulator, where the experiment names one.
    rollouts: Option<&'a dyn Answers>,
}

/// Asks the models for what the cassette lacks, and writes it.
pub fn record(args: &RecordArgs, jobs: usize) -> Result<Answer, Failure> {
    let read = Experiment::read_under(&args.run.job.experiment, &args.run.job.set);
    // Before whatever else such a model needs.
    if read.is_err() {
        models::check_build_of(&args.run.job.experiment)?;
    }
    models::check_build(&read?)?;
    let job = Job::new(&args.run.job, jobs)?;
    let path = job.cassette(&args.run.job);
    // The working directory may be another one when an interrupted recording goes on.
    let cassette = std::path::absolute(&path).map_err(Failure::internal)?;
    let rollouts = behind::path(&job.experiment).map(std::path::absolute).transpose().map_err(Failure::internal)?;
    // What was asked for is written at the end.
    std::iter::once(&cassette).chain(&rollouts).try_for_each(|path| store::fits(path))?;
    let driver_folder = job.experiment.driver.as_ref().map(|driver| driver.folder().to_path_buf());
    let recording = Recording { cassette, fresh: args.fresh, overwrite: args.overwrite, rollouts, driver_folder };
    let before = overwriting::Held::before(&recording, &job.experiment, &job.scenes)?;
    if let (Some(options), Some(path)) = (&job.experiment.simulator.backend, &recording.rollouts) {
        behind::recorded(options, path, args.fresh)?;
    }
    job.announce()?;
    let interrupt = Interrupt::listen()?;
    let held = job.open_folder(Some(&recording))?;
    let recorded = carry_out_recording(
        job,
        &held,
        &recording,
        before,
        &interrupt,
        RunMode::Record { report: !args.run.no_report },
        args.open,
    );
    let recorded = recorded.map_err(|failure| repair(failure, &interrupt, &instead("record", "record", None)));
    // Answers were paid for: a folder that holds some stays.
    held.or_gone(recorded.and_then(|answer| held.folder.mark_latest().map(|()| answer)), RunFolder::holds_answers)
}

/// A recording, begun or gone on with: what was answered is in the folder's store and not asked again.
fn carry_out_recording(
    job: Job,
    Held { folder, objects, .. }: &Held,
    recording: &Recording,
    mut before: overwriting::Held<'_>,
    interrupt: &Interrupt,
    way: RunMode,
    open: Option<u16>,
) -> Result<Answer, Failure> {
    let path = &recording.cassette;
    let answers = open_store(&folder.recording())?;
    // Answers may differ from those of an earlier recording of the same inputs. A finished run is kept until this one is.
    folder.set_aside()?;
    let mode = if recording.fresh { RecordMode::Fresh { recording: before_fresh(path)? } } else { RecordMode::Missing };
    let fresh = match &mode {
        RecordMode::Fresh { recording } => Some(recording.clone()),
        RecordMode::Missing => None,
    };
    let models = models::askable(&job.experiment, folder, fresh.as_deref(), interrupt)?;
    let recorder =
        Record::new(&answers, std::mem::take(&mut before.cassette), mode, models).telling(&|line| progress(line));
    let name = job.experiment.name.clone();
    let (backend, driver) = (job.experiment.simulator.backend.clone(), job.experiment.driver.clone());
    let processes = Processes::until(interrupt).kept_in(folder.processes());
    let rollouts = match (&backend, &recording.rollouts) {
        (Some(options), Some(path)) => {
            Some(rollout_recorder(options, driver.as_ref(), path, recording.fresh, &answers, &processes)?)
        }
        _ => None,
    };
    let asked = rollouts.as_ref().map(|recorder| recorder as &dyn Answers);
    let open = open.map(usize::from).or_else(|| models::open_by_default(&job.experiment));
    let sources = Sources { way, ask: &recorder, open, rollouts: asked };
    let done = carry_out(job, folder, objects, &sources, interrupt)?;
    // The report comes after the cassette: no drawing may keep the answers from being saved.
    let cassette = recorder.into_cassette(&name, &[])?;
    cassette.save(&folder.cassette(), &name)?;
    before.lost(&cassette, folder)?;
    cassette.save(path, &name)?;
    store::copy(path, &folder.cassette())?;
    progress(format!("recorded {} in {}", counted(cassette.exchanges().len(), "exchange"), path.display()));
    if let Some(digest) = driver.as_ref().and_then(|driver| driver.digest) {
        progress(format!("where the planner's files are not available, write into [driver]: digest = \"{digest}\""));
    }
    if let (Some(recorder), Some(path)) = (&rollouts, &recording.rollouts) {
        keep_rollouts(recorder, folder, recording, path)?;
    }
    folder.write_card(&name, None)?;
    folder.forget_what_was_set_aside()?;
    done.summary(folder, way, asked)
}

/// Adds what to do about a planner that stopped its recording: once repaired it is another ego, whose recording is a new one.
fn repair(mut failure: Failure, interrupt: &Interrupt, record: &str) -> Failure {
    failure.is_planners &= !interrupt.is_asked();
    if failure.is_planners {
        failure.message += &format!("\n  repair the planner, then `{record}`");
    }
    failure
}

fn rollout_recorder<'a>(
    options: &'a BackendOptions,
    driver: Option<&'a DriverOptions>,
    path: &Path,
    fresh: bool,
    answers: &'a Store,
    processes: &'a Processes,
) -> Result<Recorder<'a>, Failure> {
    let name = if fresh { before_fresh(path)? } else { String::new() };
    let before = behind::recorded(options, path, fresh)?;
    let asked: Box<dyn Answers + 'a> = match driver {
        Some(driver) if driver.folder().as_os_str().is_empty() => {
            let expected = "the experiment file beside the planner's files";
            return Err(Failure::bad_input(format!(
                "a run folder's copy of an experiment starts no planner: expected {expected}"
            )));
        }
        Some(driver) => Box::new(Planners::new(driver, processes)),
        None => Box::new(Workers::new(options, processes)),
    };
    Ok(Recorder::new(answers, before, asked, name))
}

/// The folder keeps the rollouts of its run. The cassette keeps those of other runs too, which may have no other copy: another seed,
/// other scenes, another file with the same planner.
fn keep_rollouts(
    recorder: &Recorder<'_>,
    folder: &RunFolder,
    recording: &Recording,
    path: &Path,
) -> Result<(), Failure> {
    let (own, failed) = recorder.cassette();
    let name = folder.card()?.name;
    own.save(&folder.rollouts(), &name)?;
    let (all, others) = if recording.overwrite { (own.clone(), 0) } else { own.clone().beside(path) };
    all.save(path, &name)?;
    let beside = if others == 0 { String::new() } else { format!(", besides {others} of other recordings") };
    recorder.compared().into_iter().for_each(progress);
    let abandoned = match own.abandoned() {
        0 => String::new(),
        count => format!(", the planner abandoned {count}"),
    };
    progress(format!(
        "recorded {} in {}{beside}; {failed} of them failed{abandoned}",
        counted(own.len(), "rollout"),
        path.display()
    ));
    Ok(())
}

/// Names a fresh recording by the cassette that it will replace: the same until it is finished, another one afterwards.
fn before_fresh(cassette: &Path) -> Result<String, Failure> {
    if !cassette.exists() {
        return Ok("first".to_string());
    }
    Ok(store::digest_of_file(cassette, CASSETTE_BYTES_MAX)?.to_hex())
}

/// Goes on with an interrupted run or recording, or confirms a finished run. Without a folder it takes the one below `runs` that
/// is not finished, and the latest one where all are.
pub fn resume(args: &ResumeArgs, jobs: usize) -> Result<Answer, Failure> {
    let folder = args.run.unfinished_or_latest()?;
    let (card, went_on) = (folder.card()?, folder.is_unfinished()?);
    if let (None, Some(cassette)) = (&card.recording, &args.cassette) {
        let (cassette, dir) = (cassette.display(), folder.dir.display());
        let expected = "expected a recording that is not finished, which is written into a cassette";
        return Err(Failure::bad_input(format!(
            "--cassette {cassette}: {expected}; {dir} is none: leave the option out"
        )));
    }
    let answer = match card.recording {
        Some(mut recording) => {
            if let Some(cassette) = &args.cassette {
                recording.cassette = std::path::absolute(cassette).map_err(Failure::internal)?;
                folder.write_card(&card.name, Some(&recording))?;
            }
            let mut job = Job::of_folder(&folder, jobs)?;
            if let (Some(driver), Some(folder)) = (&mut job.experiment.driver, &recording.driver_folder) {
                driver.folder.clone_from(folder);
            }
            let before = overwriting::Held::before(&recording, &job.experiment, &job.scenes)?;
            let interrupt = Interrupt::listen()?;
            let way = RunMode::Record { report: true };
            let recorded =
                carry_out_recording(job, &Held::of(folder.clone())?, &recording, before, &interrupt, way, args.open);
            recorded.map_err(|failure| repair(failure, &interrupt, "evodrive record FILE"))
        }
        None => again(folder.clone(), jobs, RunMode::Replay { report: true }),
    }?;
    if went_on {
        folder.mark_latest()?;
    }
    Ok(answer)
}

pub fn check(args: &OneRun, jobs: usize) -> Result<Answer, Failure> {
    again(args.folder()?, jobs, RunMode::Check)
}

pub fn verify(args: &OneRun, jobs: usize) -> Result<Answer, Failure> {
    again(args.folder()?, jobs, RunMode::Verify { quiet: false })
}

/// The same for a folder that another command made and will take away: it speaks of the run itself.
pub fn verify_quietly(folder: &RunFolder, jobs: usize) -> Result<Answer, Failure> {
    again(folder.clone(), jobs, RunMode::Verify { quiet: true })
}

/// Derives a run folder's run again from its own copies of experiment, scenes and cassette.
fn again(folder: RunFolder, jobs: usize, way: RunMode) -> Result<Answer, Failure> {
    if folder.card()?.recording.is_some() {
        return Err(interrupted(&folder));
    }
    let job = Job::of_folder(&folder, jobs)?;
    let (folder, objects) = if way.compares() {
        (folder.clone(), open_store_to_look(&folder.store())?)
    } else {
        let Held { folder, objects, .. } = Held::of(folder)?;
        (folder, objects)
    };
    if way.compares() {
        generated(&folder, &job.scenes).map_err(Failure::corruption)?;
    }
    let remedy = format!("evodrive record with the experiment of {}", folder.dir.display());
    let replay = Replay::new(Cassette::load_on(&folder.cassette(), Some(&job.threads))?, remedy);
    let rollouts = behind::replay_of(&job.experiment, &folder)?;
    let rollouts = rollouts.as_ref().map(|rollouts| rollouts as &dyn Answers);
    let interrupt = Interrupt::listen()?;
    let done = carry_out(job, &folder, &objects, &Sources { way, ask: &replay, open: None, rollouts }, &interrupt)?;
    done.summary(&folder, way, rollouts)
}

/// Inputs of a run.
pub(in crate::cli) struct Job {
    pub experiment: Experiment,
    pub scenes: Pool,
    pub threads: Threads,
    out: PathBuf,
}

impl Job {
    /// Everything that can be refused is refused here, before a file is created.
    pub fn new(args: &JobArgs, jobs: usize) -> Result<Job, Failure> {
        let threads = Threads::new(jobs)?;
        let experiment = Experiment::read_under(&args.experiment, &args.set)?;
        let mut scenes = experiment.scenes(&args.scenes, &threads)?;
        tell_left_out(&scenes);
        if scenes.seals_provenance {
            // The same scenes from files of other names are the same run: its folder says where they came from.
            let folder = RunFolder::of(&args.out, &experiment.name, experiment.digest()?, scenes.digest())?;
            let kept = folder.pool().exists().then(|| folder.read_pool().ok()).flatten();
            scenes = kept.filter(|kept| kept.digest() == scenes.digest()).unwrap_or(scenes);
        }
        let dropped = experiment.with_plain_contacts(&scenes, &threads)?;
        let why = |id: &String| (id.clone(), "an ego meets somebody there although no program acts".to_string());
        left_out::listed("left out", dropped.iter().map(why)).into_iter().for_each(progress);
        experiment.split_without(&scenes, &dropped)?;
        Ok(Job { experiment, scenes, threads, out: args.out.clone() })
    }

    /// The cassette that was named, or the experiment's.
    pub fn cassette(&self, args: &JobArgs) -> PathBuf {
        args.cassette.clone().unwrap_or_else(|| self.experiment.beside(&self.experiment.cassette))
    }

    /// The cassette that a proposed recording names: a new one beside the run folders, where the command line changes the experiment and
    /// the experiment's own cassette holds answers. Those belong to the experiment as it stands in its file.
    pub fn own_cassette(&self, args: &JobArgs) -> Result<Option<PathBuf>, Failure> {
        let changed = !args.set.is_empty() || !args.scenes.is_empty();
        let shared = changed && args.cassette.is_none() && self.cassette(args).exists();
        shared.then(|| self.folder().map(|folder| folder.cassette_beside())).transpose()
    }

    fn folder(&self) -> Result<RunFolder, Failure> {
        RunFolder::of(&self.out, &self.experiment.name, self.experiment.digest()?, self.scenes.digest())
    }

    /// From a run folder's own copies.
    pub fn of_folder(folder: &RunFolder, jobs: usize) -> Result<Job, Failure> {
        let threads = Threads::new(jobs)?;
        let experiment = folder.read_experiment()?;
        let scenes = folder.read_pool()?;
        Ok(Job { experiment, scenes, threads, out: folder.dir.clone() })
    }

    /// Says what is to come where nothing of it is there yet.
    fn announce(&self) -> Result<(), Failure> {
        if self.folder()?.dir.exists() {
            Ok(())
        } else {
            announce::announce(&self.experiment, self.scenes.scenes.len(), &self.threads)
        }
    }

    /// Locks the run folder and makes it self-contained before anything is computed. What stands there already stays.
    pub fn open_folder(&self, recording: Option<&Recording>) -> Result<Held, Failure> {
        let held = Held::of(self.folder()?)?;
        let furnished = self.furnish(&held.folder, recording);
        match furnished {
            Ok(()) => Ok(held),
            Err(failure) => held.or_gone(Err(failure), |_| false),
        }
    }

    fn furnish(&self, folder: &RunFolder, recording: Option<&Recording>) -> Result<(), Failure> {
        if !folder.experiment().exists() {
            store::write_atomic(&folder.experiment(), self.experiment.whole_text.as_bytes())?;
        }
        if !folder.pool().exists() {
            store::write_atomic(&folder.pool(), &pool::encode(&self.scenes))?;
        }
        if recording.is_some() || !folder.has_card() {
            folder.write_card(&self.experiment.name, recording)?;
        }
        Ok(())
    }
}

/// Says which scenes are left out of evolution and why.
fn tell_left_out(pool: &Pool) {
    left_out::lines(pool).into_iter().chain(left_out::unusable(pool)).for_each(progress);
}

/// The events of a run, and its result files.
fn carry_out(
    job: Job,
    folder: &RunFolder,
    objects: &Store,
    sources: &Sources<'_>,
    interrupt: &Interrupt,
) -> Result<Done, Failure> {
    let quiet = sources.way.is_quiet();
    let say = |text: String| {
        if !quiet {
            progress(text)
        }
    };
    say(format!("run folder: {}", folder.dir.display()));
    let Job { experiment, scenes, threads, .. } = job;
    let study = experiment.study(scenes, &threads)?;
    let clock = cost::clock();
    let log = transcript(folder, sources.way, &threads)?;
    let confirmed = log.remaining();
    if confirmed > 0 {
        say(format!("{}: each is worked out again and compared", counted(confirmed, "recorded event")));
    }
    let rollouts = Rollouts::new(objects, sources.way.mode(sources.rollouts.is_some()));
    let line = MovingLine::new(&study, &folder.dir);
    // The moving line of a terminal moves for a quiet command too.
    let moves = stderr_width().is_some();
    let mut watch = |news: Progress| {
        if !quiet || moves && matches!(news, Progress::Attempt { .. }) {
            line.tell(&news, rollouts.counts());
        }
    };
    let backend = behind::backend(&experiment, sources.rollouts);
    let heard = Heard { ask: sources.ask, line: &line };
    let (ask, stop) = (Until { ask: &heard, interrupt }, || interrupt.is_asked());
    let tools = Tools::new(&study, &ask, &threads, &rollouts, Meter::new(&clock)).behind(backend).until(&stop);
    let tools = match sources.open {
        Some(open) => tools.asking_at_once(open),
        None => tools,
    };
    let mut desk = Desk { log, watch: &mut watch, tools };
    let result = epoch::run(&study, &mut desk).or_else(|error| {
        rollouts.flush()?;
        // Whatever else went wrong then: who is stopped by its planner's end is stopped all the same.
        Err(if interrupt.is_asked() { stopped(folder, sources.way) } else { error.into() })
    })?;
    let root = desk.log.head();
    let cost = cost::of(&study, &desk.tools);
    let counts = rollouts.counts();
    drop(desk);
    line.finish();
    let text = serde_json::to_vec_pretty(&json!({"root": root, "result": result})).map_err(Failure::internal)?;
    if sources.way.compares() {
        compare_result(folder, &text)?;
    } else {
        cost::keep(folder, &cost)?;
        store::write_atomic(&folder.result(), &text)?;
    }
    say(cost::table(&cost, stderr_width().unwrap_or(usize::MAX)));
    let RolloutCounts { reused, simulated } = counts;
    let motion = if sources.rollouts.is_some() && sources.way.sums_up_again() {
        "; those of the planner or the other simulator were evaluated again from recorded motion, without asking it"
    } else {
        ""
    };
    say(format!("rollouts: {simulated} simulated, {reused} read from the store{motion}"));
    if sources.way.compares() {
        say(format!("all {confirmed} recorded events and the result are as recorded"));
    }
    Ok(Done { experiment, study, threads, result, root, counts })
}

/// The message after Ctrl-C.
fn stopped(folder: &RunFolder, way: RunMode) -> Failure {
    Failure::interrupted(if way.compares() {
        "interrupted before the comparison was complete; the run is unchanged".into()
    } else {
        format!(
            "interrupted; what was answered and simulated is kept in {}\n  to go on: {}",
            folder.dir.display(),
            resume_command(&folder.dir)
        )
    })
}

/// The transcript to write to, or to compare with.
fn transcript(folder: &RunFolder, way: RunMode, threads: &Threads) -> Result<Transcript, Failure> {
    let path = folder.transcript();
    let open = if way.compares() { Transcript::compare_on } else { Transcript::continue_on };
    let log = path.exists().then(|| open(&path, Some(threads))).transpose()?;
    if way.compares() && !log.as_ref().is_some_and(Transcript::is_recorded_whole) {
        return Err(Failure::corruption(format!(
            "{}: expected the sealed transcript of a finished run, found {}; nothing was compared. If the run was interrupted, `evodrive resume` finishes it; if it was finished before, its transcript has lost its end",
            path.display(),
            log.map_or("none".to_string(), |log| format!("{} without a seal", counted(log.remaining(), "event")))
        )));
    }
    Ok(log.map_or_else(|| Transcript::create(&path), Ok)?)
}

/// Checks that `result.json` is what the events say.
fn compare_result(folder: &RunFolder, text: &[u8]) -> Result<(), Failure> {
    let path = folder.result();
    // As `fsck` reads it: spaces and line feeds mean nothing.
    let read = |bytes: &[u8]| of_result(bytes).ok();
    if path.exists()
        && read(text).is_some_and(|due| {
            store::read_bounded(&path, RESULT_BYTES_MAX).is_ok_and(|there| read(&there).as_ref() == Some(&due))
        })
    {
        return Ok(());
    }
    Err(Failure::divergence(format!(
        "{}: expected the result that follows from the run's events, found {}; the events are as recorded, and `evodrive resume` writes the file again",
        path.display(),
        if path.exists() { "another one" } else { "no file" }
    )))
}

/// A run that was carried out.
struct Done {
    experiment: Experiment,
    study: Study,
    threads: Threads,
    result: RunResult,
    root: Digest,
    counts: RolloutCounts,
}

impl Done {
    /// Returns what is said of the run at its end, and writes its report if one is wanted.
    fn summary(&self, folder: &RunFolder, way: RunMode, rollouts: Option<&dyn Answers>) -> Result<Answer, Failure> {
        let run = folder.recorded_on(Some(&self.threads))?;
        if way.reports() {
            let backend = behind::backend(&self.experiment, rollouts);
            page::write(&self.study, folder, &run, backend, page::Asked::default(), &self.threads)?;
        }
        Ok(answer(&self.experiment, folder, &run, &self.result, self.root, self.counts))
    }
}

fn answer(
    experiment: &Experiment,
    folder: &RunFolder,
    run: &RecordedRun,
    result: &RunResult,
    root: Digest,
    RolloutCounts { reused, simulated }: RolloutCounts,
) -> Answer {
    let choices: Vec<Choice> =
        result.lineages.iter().filter_map(|of| Choice::of(run, &of.lineage, &experiment.selector)).collect();
    let realisms: Vec<LineageRealisms> = result.lineages.iter().filter_map(|of| LineageRealisms::of(run, of)).collect();
    let preventable: Vec<LineagePreventable> =
        result.lineages.iter().filter_map(|of| LineagePreventable::of(run, of)).collect();
    let unlabelled = unlabelled(run);
    let summary = Summary {
        result,
        from: &run.proposals_from(),
        choices: &choices,
        realisms: &realisms,
        preventable: &preventable,
        unlabelled: &unlabelled,
    };
    let text = result_text::summary(experiment, folder, summary, root, table_width());
    let object = json!({
        "name": experiment.name,
        "root": root,
        "folder": folder.dir,
        "report": folder.report().exists().then(|| folder.report()),
        "cost": folder.cost(),
        "result": result,
        "choices": choices,
        "held_out_realism": realisms,
        "held_out_preventable": preventable,
        "rollouts": {"simulated": simulated, "reused": reused},
    });
    Answer::new(text, object)
}
