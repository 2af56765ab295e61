//! `watch`: the report of a run that goes on, written anew as events land.

use clap::Args;
use serde_json::json;
use std::time::Duration;

use crate::backend::Answers;
use crate::cli::evolve::{behind, cost};
use crate::cli::look::page;
use crate::cli::records::{folder::RunFolder, run_name::OneRun};
use crate::cli::terminal::answer::{Answer, progress};
use crate::cli::terminal::{exit::Failure, interrupt::Interrupt, timed::timed, typed::resume_command};
use crate::evidence::RecordedRun;
use crate::evidence::report::{self, Beside, Live, Stage, Words};
use crate::experiment::Experiment;
use crate::kernel::Threads;
use crate::store;

/// How soon Ctrl-C is noticed.
const LOOK: Duration = Duration::from_millis(100);

/// A page of a large run takes seconds to make: the pause after it is at least this many times as long.
const PAUSE_TIMES: u32 = 4;

/// After this long without an event, the user is told how to go on.
const SILENT: Duration = Duration::from_secs(60);

/// Which run is watched.
const RUN: &str = "Run: its folder, its name below runs/, or the beginning of either; without it the one that is not finished, or else the \
                   latest";

#[derive(Debug, Args)]
#[command(mut_arg("run", |arg| arg.help(RUN)))]
pub struct Options {
    #[command(flatten)]
    pub run: OneRun,
    /// Seconds between two looks at the run, and between two reloads of an open page.
    #[arg(long, default_value_t = 2.0, allow_negative_numbers = true)]
    pub every: f64,
}

/// Writes report.html whenever the run has a new event, until the run is finished; then the page is the one that `report` writes.
pub fn run(options: &Options, jobs: usize) -> Result<Answer, Failure> {
    if !(0.2..=3600.0).contains(&options.every) {
        return Err(Failure::bad_input(format!("--every {}: expected 0.2 to 3600 seconds", options.every)));
    }
    let folder = options.run.unfinished_or_latest()?;
    let interrupt = Interrupt::listen()?;
    let threads = Threads::new(jobs)?;
    let experiment = folder.read_experiment()?;
    let shown = folder.report();
    progress(format!("page: {}; it is kept up to date until the run is finished; Ctrl-C stops that", shown.display()));
    let (mut written, mut silent) = (0, Duration::ZERO);
    loop {
        if !folder.has_card() {
            return Err(Failure::bad_input(format!(
                "{}: the run folder is gone: the command that made it failed and printed the reason",
                folder.dir.display()
            )));
        }
        let bytes = store::length(&folder.transcript())?;
        let (seen, took) =
            timed(|| if bytes > written { look(&folder, &experiment, options.every, &threads) } else { Ok(None) });
        match seen? {
            Some(run) if run.result.is_some() => return finished(&folder, &experiment, &run, &threads),
            Some(run) => progress(standing(&run, &experiment)),
            None => {}
        }
        let pause = Duration::from_secs_f64(options.every).max(took * PAUSE_TIMES);
        silent = if bytes > written { Duration::ZERO } else { silent + pause };
        if silent >= SILENT && silent < SILENT + pause {
            let go_on = resume_command(&folder.dir);
            progress(format!(
                "no new event for a minute; if no command is working on the run, continue it with: {go_on}"
            ));
        }
        written = bytes;
        if !waited(pause, &interrupt) {
            return Err(Failure::interrupted(format!(
                "stopped watching; the run itself goes on as before; the page so far: {}",
                shown.display()
            )));
        }
    }
}

/// Reads the run as far as it goes and writes the page of what it holds; a run without a parent yet has nothing to show. The page of a finished run is
/// not written here.
fn look(
    folder: &RunFolder,
    experiment: &Experiment,
    reload_s: f64,
    threads: &Threads,
) -> Result<Option<RecordedRun>, Failure> {
    let run = folder.recorded_on(Some(threads))?;
    if run.result.is_some() || run.parents.is_empty() {
        return Ok(Some(run).filter(|run| run.result.is_some()));
    }
    let live = Live { epochs: experiment.budget.epochs, proposals: proposals(experiment), reload_s };
    let cost = cost::kept(folder);
    let (selector, cost, words) = (&experiment.selector, cost.as_ref(), Words::default());
    let beside = Beside { selector, cost, credits: &[], agreement: None, others: &[], words: &words, live: Some(live) };
    store::write_atomic(&folder.report(), report::html(&run, &Stage::default(), &beside).as_bytes())?;
    Ok(Some(run))
}

/// The whole report, as `run` and `report` write it.
fn finished(
    folder: &RunFolder,
    experiment: &Experiment,
    run: &RecordedRun,
    threads: &Threads,
) -> Result<Answer, Failure> {
    let study = experiment.study(folder.read_pool()?, threads)?;
    let replay = behind::replay_of(experiment, folder)?;
    let answers = replay.as_ref().map(|replay| replay as &dyn Answers);
    page::write(&study, folder, run, behind::backend(experiment, answers), page::Asked::default(), threads)?;
    let report = folder.report();
    let text = format!("the run is finished\nreport: {}\nroot: {}", report.display(), run.root);
    Ok(Answer::new(text, json!({"report": report, "root": run.root})))
}

fn proposals(experiment: &Experiment) -> u64 {
    let lineages = experiment.lineages.len() as u64 * u64::from(experiment.seeds);
    u64::from(experiment.budget.epochs) * u64::from(experiment.budget.slots) * lineages
}

fn standing(run: &RecordedRun, experiment: &Experiment) -> String {
    let settled = run.settled.last().map(|s| format!(", {} settled epoch {}", s.lineage, s.epoch));
    format!("{} of {} proposals are finished{}", run.attempts.len(), proposals(experiment), settled.unwrap_or_default())
}

/// Waits for the pause and returns `true` if it went by without Ctrl-C.
fn waited(pause: Duration, interrupt: &Interrupt) -> bool {
    let mut left = pause;
    while !left.is_zero() && !interrupt.is_asked() {
        let step = left.min(LOOK);
        std::thread::sleep(step);
        left -= step;
    }
    !interrupt.is_asked()
}
