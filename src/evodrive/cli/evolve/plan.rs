//! `plan`: what of an experiment is recorded, what is missing, and what recording the rest would cost. No model is asked: the
//! run is walked through as far as recorded answers carry it.

use clap::Args;
use serde_json::json;
use std::fmt::Write as _;
use std::path::Path;

use crate::agents::AgentError;
use crate::backend::{Answers, BackendError, Replay as Recorded};
use crate::cli::evolve::job_args::JobArgs;
use crate::cli::evolve::plan_cost::{RoleCost, rest};
use crate::cli::evolve::plan_looked::{Looked, Seen};
use crate::cli::evolve::run::Job;
use crate::cli::evolve::{behind, held::Held, other_pool};
use crate::cli::records::folder::{RunFolder, open_store};
use crate::cli::terminal::answer::{Answer, progress};
use crate::cli::terminal::exit::{Exit, Failure};
use crate::cli::terminal::typed::instead;
use crate::epoch::{self, Desk, Meter, Mode, Rollouts, RunError, Study, Tools};
use crate::evaluation::EvaluationError;
use crate::experiment::Experiment;
use crate::llm::{AskError, Cassette};
use crate::store::{Scratch, Transcript};
use crate::text::counted;

/// Missing questions that the text names; `--json` names all.
const NAMED_MAX: usize = 12;

#[derive(Debug, Args)]
#[command(
    after_help = "Exit code 0 if every answer is recorded, 3 if some are missing. Rollouts that the plan simulates are kept in \
                  the run folder, and the run uses them."
)]
pub struct Options {
    #[command(flatten)]
    pub job: JobArgs,
}

/// Point at which the walk ended.
#[derive(Clone, Copy, PartialEq, Eq)]
enum End {
    /// At the end of the run.
    Complete,
    /// At questions without an answer.
    Answers,
    /// At a rollout of another simulator that is not recorded.
    Rollouts,
}

pub fn run(options: &Options, jobs: usize) -> Result<Answer, Failure> {
    let job = Job::new(&options.job, jobs)?;
    let path = job.cassette(&options.job);
    let cassette = if path.exists() { Cassette::load(&path)? } else { Cassette::new(path.display().to_string()) };
    // None of its answers will be used: the plan then says that everything is missing.
    other_pool::difference(&cassette, &job.scenes).into_iter().for_each(progress);
    let held = job.open_folder(None)?;
    held.or_gone(planned(options, job, &held, &cassette), |_| false)
}

fn planned(options: &Options, job: Job, held: &Held, cassette: &Cassette) -> Result<Answer, Failure> {
    let kept = held.folder.recording();
    let kept = kept.exists().then(|| open_store(&kept)).transpose()?;
    let looked = Looked::new(cassette, kept.as_ref());
    let own = job.own_cassette(&options.job)?;
    let Job { experiment, scenes, threads, .. } = job;
    let study = experiment.study(scenes, &threads)?;
    let end = walk(&experiment, &study, held, &looked, &threads)?;
    let seen = looked.into_seen();
    let costs = match end {
        End::Complete => Vec::new(),
        _ => rest(&experiment, &epoch::asked_at_most(&study)?, cassette, &seen, end == End::Answers),
    };
    let planned = Planned { own: own.as_deref(), experiment: &experiment, cassette, seen, end, costs };
    Ok(planned.answer(&held.folder))
}

/// Carries the run out as far as it goes.
fn walk(
    experiment: &Experiment,
    study: &Study,
    held: &Held,
    looked: &Looked<'_>,
    threads: &crate::kernel::Threads,
) -> Result<End, Failure> {
    let recorded = match (&experiment.simulator.backend, behind::path(experiment)) {
        (Some(backend), Some(path)) => Some(Recorded::new(behind::recorded(backend, &path, false)?, String::new())),
        _ => None,
    };
    let answers = recorded.as_ref().map(|recorded| recorded as &dyn Answers);
    let scratch = Scratch::under(&held.folder.dir, ".plan-")?;
    progress(format!("run folder: {}", held.folder.dir.display()));
    let rollouts = Rollouts::new(&held.objects, Mode::Reuse);
    let ended = {
        let tools = Tools::new(study, looked, threads, &rollouts, Meter::default());
        let tools = tools.behind(behind::backend(experiment, answers));
        let mut desk = Desk { log: Transcript::create(&scratch.dir.join("plan.jsonl"))?, watch: &mut |_| {}, tools };
        epoch::run(study, &mut desk)
    };
    held.objects.flush()?;
    match ended {
        Ok(_) => Ok(End::Complete),
        Err(RunError::Agent(AgentError::Ask(AskError::Miss(_)))) => Ok(End::Answers),
        Err(RunError::Evaluation(EvaluationError::Backend(BackendError::Miss(_)))) => Ok(End::Rollouts),
        Err(error) => Err(error.into()),
    }
}

/// Result of the walk.
struct Planned<'a> {
    /// The cassette that a recording should take, where it is not the one that was looked at.
    own: Option<&'a Path>,
    experiment: &'a Experiment,
    cassette: &'a Cassette,
    seen: Seen,
    end: End,
    costs: Vec<RoleCost>,
}

impl Planned<'_> {
    fn answer(&self, folder: &RunFolder) -> Answer {
        let [known, at_most] = [|cost: &RoleCost| cost.known, |cost: &RoleCost| cost.at_most]
            .map(|count| self.costs.iter().map(count).sum::<u64>());
        let likely: Option<u64> = self.costs.iter().map(|cost| cost.likely).sum();
        let complete = self.end == End::Complete;
        let usd_known: f64 = self.costs.iter().map(|cost| cost.usd(cost.known, false)).sum();
        let usd_likely: Option<f64> =
            self.costs.iter().map(|cost| cost.likely.map(|count| cost.usd(count, false))).sum();
        let usd_at_most: f64 = self.costs.iter().map(|cost| cost.usd(cost.at_most, true)).sum();
        let missing: Vec<_> =
            self.seen.missing.values().map(|of| json!({"slot": of.slot, "key": of.key, "bytes": of.bytes})).collect();
        let object = json!({
            "name": self.experiment.name, "folder": folder.dir, "cassette": self.cassette.name, "complete": complete,
            "stopped_at": match self.end { End::Complete => "nothing", End::Answers => "answers", End::Rollouts => "rollouts" },
            "answered": self.seen.answered.len(), "not_asked_for": self.not_asked_for(), "missing": missing,
            "questions": {"known": known, "likely": likely, "at_most": at_most},
            "usd_estimate": {"known": usd_known, "likely": usd_likely, "at_most": usd_at_most},
            "usd_max": self.experiment.spend.map(|cap| cap.usd_max), "roles": self.costs,
        });
        let money =
            Money { known: (known, usd_known), likely: likely.zip(usd_likely), at_most: (at_most, usd_at_most) };
        let exit = if complete { Exit::Success } else { Exit::CassetteMiss };
        Answer { exit, ..Answer::new(self.text(&money), object) }
    }

    /// Recorded answers that the walk did not reach: for questions of another version, or beyond the point where it stopped.
    fn not_asked_for(&self) -> usize {
        let asked = |key| self.seen.answered.iter().any(|(_, answered)| answered == key);
        self.cassette.exchanges().iter().filter(|of| !asked(&of.key)).count()
    }

    fn text(&self, money: &Money) -> String {
        let mut text = format!(
            "{}: {} answers used, {} not asked for\n",
            self.cassette.name,
            self.seen.answered.len(),
            self.not_asked_for()
        );
        match self.end {
            End::Complete => {
                let _ = write!(
                    text,
                    "complete: every question has a recorded answer; next: {}",
                    instead("plan", "run", None)
                );
                return text;
            }
            End::Answers => {}
            End::Rollouts => {
                let whose = if self.experiment.driver.is_some() { "your planner" } else { "the other simulator" };
                let _ = writeln!(
                    text,
                    "the plan stops at a rollout of {whose} that is not recorded, so no question to a model is known yet; `evodrive \
                     record` records both"
                );
            }
        }
        for question in self.seen.missing.values().take(NAMED_MAX) {
            let slot = &question.slot;
            let _ = writeln!(
                text,
                "missing: {}/e{}s{} {} round {} (key {})",
                slot.lineage,
                slot.epoch,
                slot.slot,
                slot.role,
                slot.round,
                question.key.short(12)
            );
        }
        if let Some(more) = self.seen.missing.len().checked_sub(NAMED_MAX).filter(|more| *more > 0) {
            let _ = writeln!(text, "missing: {more} more; --json names them all");
        }
        text.push_str("what follows a missing answer depends on it, so the rest is an upper bound and estimates:\n");
        text.push_str(&self.table());
        text.push_str(&money.text());
        if let Some(cap) = self.experiment.spend {
            let _ = writeln!(text, "the experiment's cap: {} USD, {} tokens", cap.usd_max, cap.tokens_max);
        }
        if self.own.is_some() && !self.seen.answered.is_empty() {
            let _ = writeln!(
                text,
                "{} belongs to the experiment as its file says it, so a recording takes a cassette of its own and asks everything; a copy \
                 of that one in its place keeps the answers that are there",
                self.cassette.name
            );
        }
        let _ = write!(text, "next: {}", instead("plan", "record", self.own));
        text
    }

    fn table(&self) -> String {
        let mut text = format!(
            "questions, and tokens per question:\n{:<18} {:<16} {:>7} {:>7} {:>8} {:>9} {:>9}  estimated from\n",
            "role", "model", "known", "likely", "at most", "tokens in", "out"
        );
        for of in self.costs.iter().filter(|of| of.at_most > 0) {
            let likely = of.likely.map_or("?".to_string(), |count| count.to_string());
            let _ = writeln!(
                text,
                "{:<18} {:<16} {:>7} {:>7} {:>8} {:>9.0} {:>9.0}  {}",
                of.role, of.model, of.known, likely, of.at_most, of.input_tokens, of.output_tokens, of.tokens_from
            );
        }
        text
    }
}

/// Questions and their price, three ways.
struct Money {
    known: (u64, f64),
    likely: Option<(u64, f64)>,
    at_most: (u64, f64),
}

impl Money {
    fn text(&self) -> String {
        let row = |(count, usd): (u64, f64)| format!("{}, {usd:.4} USD", counted(count as usize, "question"));
        let likely = self.likely.map_or("not known yet: no proposal has all its answers recorded".to_string(), row);
        format!(
            "known to be missing: {}\nlikely: {likely}\nat most: {} (if every answer is as long as allowed)\n\
             prices are those of the experiment file (0 if it has none), tokens are estimates\n",
            row(self.known),
            row(self.at_most)
        )
    }
}
