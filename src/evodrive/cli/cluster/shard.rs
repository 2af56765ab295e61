//! `shard`: missing work of a run as files for other machines.

use clap::Subcommand;

use crate::cli::cluster::{shard_merge, shard_plan, shard_withdraw, shard_work};
use crate::cli::terminal::{answer::Answer, exit::Failure};

#[derive(Debug, Subcommand)]
pub enum Command {
    /// Write the work that a run still lacks as shards.
    Plan(shard_plan::PlanOptions),
    /// Do the tasks of shards, on any machine.
    Work(shard_work::WorkOptions),
    /// Add the results of shards to the run.
    Merge(shard_merge::MergeOptions),
    /// Take one record out of a run by name, so that it is asked for again.
    Withdraw(shard_withdraw::WithdrawOptions),
}

pub fn run(command: &Command, jobs: usize) -> Result<Answer, Failure> {
    match command {
        Command::Plan(options) => shard_plan::run(options, jobs),
        Command::Work(options) => shard_work::run(options, jobs),
        Command::Merge(options) => shard_merge::run(options, jobs),
        Command::Withdraw(options) => shard_withdraw::run(options),
    }
}
