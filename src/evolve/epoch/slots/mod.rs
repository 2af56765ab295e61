//! The steps of a worker, from a question to labels of a child.

pub(super) mod admit;
pub(super) mod draft;
pub(super) mod evaluate;
mod nothing;
pub(super) mod pilot;
pub(super) mod probes;
pub(super) mod propose;
pub(super) mod route;
pub(super) mod tune;
