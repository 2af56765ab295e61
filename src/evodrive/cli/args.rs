//! All arguments. Their help texts are goldens: change them on purpose.

use clap::{CommandFactory, Parser, Subcommand};

use crate::cli::cluster::{bench, shard, worker};
use crate::cli::evolve::job_args::{RecordArgs, ResumeArgs, RunArgs};
use crate::cli::evolve::{ask, exchange, init, plan, run, watch};
use crate::cli::look::{compare, credit, data, diff, figure, impact, lineage, report, show, table, why, world};
use crate::cli::records::{bundle, fsck, run_name::OneRun};
use crate::cli::reference::{known, manual, options};
use crate::cli::scenes::{calibrate, command};
use crate::cli::studies::{
    agree, apply, claims, downstream, egos, harden, leaderboard, paper, policy, program, suite, train, transfer,
};
use crate::cli::terminal::{answer::Answer, examples::with_examples, exit::Failure};

/// Deterministic, replay-first evolution of driving-scenario generators by LLM agents.
///
/// Exit codes: 0 success, 1 a threshold of a suite is broken, 2 bad input, 3 no recorded answer, 4 something came out differently, 5 stored bytes are damaged,
/// 70 internal, 130 interrupted by Ctrl-C.
#[derive(Debug, Parser)]
#[command(name = "evodrive", version)]
pub struct Arguments {
    /// Print one JSON object on stdout instead of text.
    #[arg(long, global = true)]
    pub json: bool,
    /// Worker threads; 0 = one a core. Never changes a result.
    #[arg(long, global = true, default_value_t = 0)]
    pub jobs: usize,
    #[command(subcommand)]
    pub command: Command,
}

#[derive(Debug, Subcommand)]
pub enum Command {
    /// Write a short experiment file for scenes of your own.
    Init(init::Options),
    /// Say what of an experiment is recorded, what is missing and what recording it would cost; no model is asked.
    Plan(plan::Options),
    /// Carry an experiment out from its cassette; the same command again gives the same root.
    Run(RunArgs),
    /// Go on with a run that was interrupted; without a name, the one below runs/ that is not finished.
    Resume(ResumeArgs),
    /// Derive a finished run again from its recorded answers and rollouts, and compare every event.
    #[command(alias = "replay")]
    Check(OneRun),
    /// Derive a finished run again and simulate every rollout again; those of another simulator or of a planner of one's own come
    /// from recorded motion.
    Verify(OneRun),
    /// Ask the experiment's models and write its cassette.
    Record(RecordArgs),
    /// Questions to models of the kind `exchange`, which are answered in files.
    #[command(subcommand)]
    Exchange(exchange::Command),
    /// Try a draft of an answer: says whether it can be read, passes the gates and compiles, before you give it. Nothing of attack or
    /// realism is said, and the answer keeps how often you tried. Exit code 1: it would not pass.
    Ask(ask::Options),
    /// Import, generate, list, show and compare scenes.
    #[command(subcommand)]
    Scenes(command::Command),
    /// Take bounds and tolerances of the realism diagnostics from recorded traffic.
    Calibrate(calibrate::Options),
    /// Show how a lineage's programs descend from each other, with their patches as diffs.
    Lineage(lineage::Options),
    /// Show one attempt: prompts, replies, reviews, gates, route, rollouts, decision; or the counsel for one scene, or the
    /// composition of one template.
    Show(show::Options),
    /// Take one evolved program out of a run as a file.
    #[command(subcommand)]
    Program(program::Command),
    /// Play a program file on any scenes, against its parent and against no program; no model is asked.
    Apply(apply::Options),
    /// Frozen scenes for planners: freeze, drive with thresholds for CI, compare two versions, play (docs/SUITES.md).
    #[command(subcommand)]
    Suite(suite::Command),
    /// Drive a suite with several planners and policies: a table of them, and by family, with intervals (docs/SUITES.md).
    Leaderboard(leaderboard::Options),
    /// Play the reported programs of runs and their parents against drivers that they were not evolved on: a matrix, with intervals (docs/EGOS.md).
    Transfer(transfer::Options),
    /// Search PDM's constants against a suite, then generators against the hardened driver, in rounds: payoffs and their equilibrium (docs/EGOS.md).
    Harden(harden::Options),
    /// Check the stored objects, memo and transcript of a run.
    Fsck(fsck::Options),
    /// Write a run's report as one HTML file.
    Report(report::Options),
    /// Write a run's report while the run goes on, anew whenever it has something new; an open page follows it.
    Watch(watch::Options),
    /// Print one of the paper's tables from recorded runs, with intervals and the paper's numbers beside ours.
    Table(table::Options),
    /// Judge the paper's claims by recorded runs: estimate, interval, verdict, and what each rests on; those that fail first.
    Claims(claims::Options),
    /// Make every table, figure, claim and number of our paper again from the runs of paper/plan.toml, and compare or write them.
    Paper(paper::Options),
    /// Draw one of the paper's figures from recorded runs, as SVG or PDF.
    Figure(figure::Options),
    /// Say what a cell of a table rests on, from its formula down to scenes, patches, prompts and answers (docs/QUALITY.md).
    Why(why::Options),
    /// Say which cells of which tables rest on a rollout, program, patch, question, answer or scene (docs/QUALITY.md).
    Impact(impact::Options),
    /// Say how good the world evaluator of a run was: rank, error, intervals, false rejects, by epoch and family (docs/WORLD.md).
    World(world::Options),
    /// Say how much of a program's gain each of its edits carries: it is taken out, and put on the parent alone.
    Credit(credit::Options),
    /// Compare two runs, lineages or programs: paired by scene, with intervals, and what changed in the experiment.
    Compare(compare::Options),
    /// Say where two runs part: their inputs, the first event that differs, the field, and what that points to.
    Diff(diff::Options),
    /// Write a run as tables for pandas, DuckDB and the like: attempts, labels, rollouts, reviews, exchanges, cost (docs/BUNDLES.md).
    Data(data::Options),
    /// Write a run as one file that travels, look into one, carry its run out again, unpack it (docs/BUNDLES.md).
    #[command(subcommand)]
    Bundle(bundle::Command),
    /// Compare two runs that differ in their simulator alone: who says contact, with whom, when.
    Agree(agree::Options),
    /// Print every key of an experiment file: symbol, unit, range, values in the shipped protocols, meaning.
    Options(options::Options),
    /// List the source families that can be evolved.
    Families,
    /// List the scene formats that are read and written.
    Formats,
    /// List the quantities that expressions of programs may read, with their units.
    Features,
    /// Print the completions of a shell.
    Completions(manual::CompletionsOptions),
    /// Write manual pages, one a command.
    Man(manual::ManOptions),
    /// Serve our own simulator's rollouts as a backend's worker does: JSON lines on stdin and stdout (docs/BACKENDS.md).
    Worker,
    /// Do the missing work of a run on many machines: plan shards, work on them anywhere, merge their results
    /// (docs/SHARDS.md).
    #[command(subcommand)]
    Shard(shard::Command),
    /// Train a learned ego on generated scenes and write its weights and card (docs/EGOS.md).
    Train(train::Options),
    /// Train egos on scenes of the original and of the evolved generator, and compare how they drive: replayed from a record, or
    /// trained (docs/DOWNSTREAM.md).
    Downstream(downstream::Options),
    /// Weights of learned egos that were trained elsewhere (docs/EGOS.md).
    #[command(subcommand)]
    Policy(policy::Command),
    /// Drive an experiment's held-out scenes with replay, IDM and learned egos: who crashes, who arrives (docs/EGOS.md).
    Egos(egos::Options),
    /// Measure speed.
    #[command(subcommand)]
    Bench(bench::Command),
}

impl Command {
    pub fn run(self, jobs: usize) -> Result<Answer, Failure> {
        match self {
            Command::Init(options) => init::run(&options, jobs),
            Command::Options(options) => options::run(&options),
            Command::Plan(options) => plan::run(&options, jobs),
            Command::Run(args) => run::run(&args, jobs),
            Command::Resume(args) => run::resume(&args, jobs),
            Command::Check(args) => run::check(&args, jobs),
            Command::Verify(args) => run::verify(&args, jobs),
            Command::Record(args) => run::record(&args, jobs),
            Command::Exchange(command) => exchange::run(&command),
            Command::Ask(options) => ask::run(&options),
            Command::Scenes(command) => command::run(command, jobs),
            Command::Calibrate(options) => calibrate::run(&options, jobs),
            Command::Lineage(options) => lineage::run(&options),
            Command::Show(options) => show::run(&options),
            Command::Program(command) => program::run(&command, jobs),
            Command::Apply(options) => apply::run(&options, jobs),
            Command::Suite(command) => suite::run(&command, jobs),
            Command::Leaderboard(options) => leaderboard::run(&options, jobs),
            Command::Transfer(options) => transfer::run(&options, jobs),
            Command::Harden(options) => harden::run(&options, jobs),
            Command::Fsck(options) => fsck::run(&options),
            Command::Report(options) => report::run(&options, jobs),
            Command::Watch(options) => watch::run(&options, jobs),
            Command::Claims(options) => claims::run(&options, jobs),
            Command::Paper(options) => paper::run(&options, jobs),
            Command::Figure(options) => figure::run(&options, jobs),
            Command::Table(options) => table::run(&options, jobs),
            Command::Why(options) => why::run(&options, jobs),
            Command::Impact(options) => impact::run(&options),
            Command::World(options) => world::run(&options),
            Command::Credit(options) => credit::run(&options, jobs),
            Command::Compare(options) => compare::run(&options),
            Command::Diff(options) => diff::run(&options),
            Command::Data(options) => data::run(&options, jobs),
            Command::Bundle(command) => bundle::run(&command, jobs),
            Command::Agree(options) => agree::run(&options, jobs),
            Command::Families => Ok(known::families()),
            Command::Formats => Ok(known::formats()),
            Command::Features => Ok(known::features()),
            Command::Completions(options) => Ok(manual::completions(&options, Arguments::command())),
            Command::Man(options) => manual::man(&options, with_examples(Arguments::command())),
            Command::Worker => worker::run(),
            Command::Shard(command) => shard::run(&command, jobs),
            Command::Train(options) => train::run(&options, jobs),
            Command::Downstream(options) => downstream::run(&options, jobs),
            Command::Policy(command) => policy::run(&command),
            Command::Egos(options) => egos::run(&options, jobs),
            Command::Bench(command) => bench::run(command, jobs),
        }
    }
}
