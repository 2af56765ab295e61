//! A driver that repeats the recording.

use crate::sim::{Control, Driver, Plant, View};

/// Repeats the ego's recorded motion.
#[derive(Clone, Copy, Debug, Default)]
pub struct ReplayDriver;

impl Driver for ReplayDriver {
    fn begin(&mut self, _: &Plant) {}

    fn decide(&mut self, _: &View<'_>) -> Control {
        Control::FollowLog
    }

    fn follows_log(&self) -> bool {
        true
    }
}
