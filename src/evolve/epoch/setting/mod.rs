//! Inputs of a run, and what acts in it: scenes, lineages and options; the desk; the meter.

pub(super) mod cost;
pub(super) mod desk;
pub(super) mod options;
pub(super) mod progress;
pub(super) mod questions;
pub(super) mod situations;
pub(super) mod study;
