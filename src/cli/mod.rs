//! The command line: arguments to each room's options, one file a command.

mod agree;
mod answer;
mod applied_text;
mod apply;
mod args;
mod behind;
mod bench;
mod bench_ledger;
mod bench_observe;
mod bench_shards;
mod bundle;
mod bundle_replay;
mod calibrate;
mod claims;
mod compare;
mod cost;
mod covered;
mod data;
mod diff;
mod downstream;
mod downstream_sets;
mod downstream_train;
mod egos;
mod examples;
mod exchange;
mod exit;
mod exit_from;
mod figure;
mod folder;
mod fsck;
mod groups;
mod held;
mod impact;
mod init;
mod interrupt;
mod known;
mod left_out;
mod lineage;
mod manual;
mod models;
mod moving_line;
mod options;
mod other_pool;
mod overwriting;
mod page;
mod paper;
mod plan;
mod plan_cost;
mod plan_looked;
mod playables;
mod program;
mod readable;
mod redacted;
mod report;
mod result_text;
mod rollout;
mod run;
mod run_name;
mod scene_best;
mod scene_draw;
mod scene_export;
mod scene_formula;
mod scene_pools;
mod scene_show;
mod scenes;
mod shard;
mod shard_merge;
mod shard_plan;
mod shard_target;
mod shard_work;
mod shell;
mod show;
mod table;
mod terminal;
mod timed;
mod train;
mod train_text;
mod typed;
mod watch;
mod why;
mod worker;
mod worker_process;
mod world;

use clap::{CommandFactory, FromArgMatches};
use std::process::ExitCode;

pub use exit::{Exit, Failure};

/// Characters of a line of help in a pipe or a file.
const HELP_WIDTH: usize = 100;

/// Reads the arguments, runs one command, prints its answer.
pub fn main() -> ExitCode {
    let width = terminal::stdout_width().unwrap_or(HELP_WIDTH);
    let command = groups::grouped(args::Arguments::command().term_width(width), width);
    let matches = examples::with_examples(command).try_get_matches();
    let arguments = match matches.and_then(|matches| args::Arguments::from_arg_matches(&matches)) {
        Ok(arguments) => arguments,
        Err(error) => {
            // clap's own words: help and version go to stdout and are a success.
            let exit = if error.use_stderr() { Exit::BadInput } else { Exit::Success };
            let _ = error.print();
            return exit.into();
        }
    };
    let json = arguments.json;
    match arguments.command.run(arguments.jobs) {
        Ok(answer) => answer.print(json).into(),
        Err(failure) => {
            answer::complain(&failure, json);
            failure.exit.into()
        }
    }
}
