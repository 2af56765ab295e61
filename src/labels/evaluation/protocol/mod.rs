//! SafeBench's protocol: scores of groups of runs, balanced selection, the archive after every round. MetaDrive's needs only
//! the means over scenes in `score.rs`.

pub mod balanced;
pub mod rounds;
pub mod safebench;
