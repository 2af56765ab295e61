//! Commands that make a run: from the first experiment file to the recording.

pub mod announce;
pub mod ask;
pub mod behind;
pub mod cost;
pub mod exchange;
#[cfg(test)]
pub mod first_epoch;
pub mod held;
pub mod init;
pub mod job_args;
pub mod models;
pub mod other_pool;
pub mod overwriting;
pub mod plan;
pub mod plan_cost;
pub mod plan_looked;
pub mod run;
pub mod watch;
