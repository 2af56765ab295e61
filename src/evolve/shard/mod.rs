//! Work that travels: missing records of a run as files of tasks, each of which any machine can do, and the union of what
//! comes back. A shard is named by its bytes; results are records that never change. `docs/SHARDS.md` describes the files.

mod error;
mod file;
mod mark;
mod merge;
mod result;
mod withdrawn;

pub use error::{Conflict, ShardError, Untrue, WithdrawnRecord};
pub use file::{Lineage, Need, SHARD_ENDING, Shard, split};
pub use mark::StudyMark;
pub use merge::{Merge, Merged};
pub use result::{OnTheWay, RESULT_ENDING, ResultFile, TaskOutcome, TaskResult};
pub use withdrawn::Withdrawn;
