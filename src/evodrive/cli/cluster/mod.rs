//! Work on many machines, the processes beside this one, and how fast this one is.

pub mod bench;
pub mod bench_env;
mod bench_ledger;
pub mod bench_observe;
pub mod bench_shards;
mod printed;
pub mod shard;
pub mod shard_audit;
pub mod shard_done;
pub mod shard_lineage;
pub mod shard_merge;
pub mod shard_needs;
pub mod shard_plan;
pub mod shard_target;
pub mod shard_withdraw;
pub mod shard_work;
pub mod worker;
pub mod worker_process;
