//! A driver that repeats earlier decisions: it turns an episode that was driven from outside into a rollout like any other.

use crate::sim::prepared::plant::Plant;
use crate::sim::road_users::driver::{Control, Driver, View};

/// Repeats the decisions of an episode.
#[derive(Clone, Copy, Debug)]
pub struct Repeated<'c> {
    controls: &'c [Control],
    follows_log: bool,
}

impl<'c> Repeated<'c> {
    /// Takes one decision a step; `follows_log` is true if the ego repeated its recording.
    pub fn new(controls: &'c [Control], follows_log: bool) -> Repeated<'c> {
        Repeated { controls, follows_log }
    }
}

impl Driver for Repeated<'_> {
    fn begin(&mut self, _: &Plant) {}

    fn decide(&mut self, view: &View<'_>) -> Control {
        // A step beyond the last decision means that another rollout is played, which the simulator refuses.
        let never = Control::Drive { acceleration_mps2: f64::NAN, steering_rad: f64::NAN };
        self.controls.get(view.decision()).copied().unwrap_or(never)
    }

    fn follows_log(&self) -> bool {
        self.follows_log
    }
}
