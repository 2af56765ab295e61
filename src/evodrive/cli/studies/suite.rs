//! `suite`: frozen scenes for planners, driven, compared and played.

use clap::Subcommand;

use crate::cli::studies::{suite_compare, suite_freeze, suite_play, suite_run, suite_show};
use crate::cli::terminal::{answer::Answer, exit::Failure};

#[derive(Debug, Subcommand)]
pub enum Command {
    /// Freeze what programs do on scenes into one file: scenes, interventions, labels of the driver that was planned around.
    Freeze(suite_freeze::Options),
    /// List the cases of a suite with the labels that were frozen, and say where it comes from.
    Show(suite_show::Options),
    /// Drive a suite with a planner or a policy: totals with intervals, thresholds, JUnit; exit code 1 where a threshold is broken.
    Run(suite_run::Options),
    /// Compare results in one suite, paired by scene: who lost which, and whether the difference can be chance; side by side as a page.
    Compare(suite_compare::Options),
    /// Play one case with one or more drivers side by side, as a page.
    Play(suite_play::Options),
}

pub fn run(command: &Command, jobs: usize) -> Result<Answer, Failure> {
    match command {
        Command::Freeze(options) => suite_freeze::run(options, jobs),
        Command::Show(options) => suite_show::run(options),
        Command::Run(options) => suite_run::run(options, jobs),
        Command::Compare(options) => suite_compare::run(options),
        Command::Play(options) => suite_play::run(options, jobs),
    }
}
