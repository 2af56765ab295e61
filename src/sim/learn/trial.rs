//! How an ego drives a set of scenes: the figures by which actors are screened and compared.

use serde::{Deserialize, Serialize};

use super::lesson::Lesson;
use crate::ego::Policy;
use crate::kernel::{Threads, num};
use crate::sim::{Control, Driver, End, Outcome, Plant, SimError, View, rollout};

/// Figures over scenes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Trial {
    pub scenes: usize,
    /// Share of the scenes with a contact, whoever caused it.
    pub crash_rate: f64,
    /// Share that ended beside the road.
    pub off_road_rate: f64,
    /// Share that arrived.
    pub arrival_rate: f64,
    /// Mean share of the route driven.
    pub route_completion: f64,
    /// Mean speed, m/s.
    pub speed_mps: f64,
}

/// A driver that brakes and stands. A standing ego crashes little: a trained ego's crash rate only means something beside this one's, and
/// beside the way that it drives.
#[derive(Clone, Copy, Debug)]
pub struct Stopped;

impl Driver for Stopped {
    fn begin(&mut self, _: &Plant) {}

    fn decide(&mut self, _: &View<'_>) -> Control {
        // Clamped to what the brakes give.
        Control::Drive { acceleration_mps2: -100.0, steering_rad: 0.0 }
    }
}

/// Drives every scene once: what came of each, in their order.
pub fn driven(lessons: &[Lesson], policy: &Policy, threads: &Threads) -> Result<Vec<Outcome>, SimError> {
    driven_by(lessons, &|| policy.driver(), threads)
}

/// The same by any driver, a new one for each scene.
pub fn driven_by(
    lessons: &[Lesson],
    driver: &(dyn Fn() -> Box<dyn Driver> + Sync),
    threads: &Threads,
) -> Result<Vec<Outcome>, SimError> {
    let one = |_: usize, lesson: &Lesson| rollout(&lesson.plant, &lesson.intervention, driver().as_mut());
    threads.map(lessons, one).into_iter().collect()
}

/// Drives every scene once, for its figures.
pub fn trial(lessons: &[Lesson], policy: &Policy, threads: &Threads) -> Result<Trial, SimError> {
    driven(lessons, policy, threads).map(|outcomes| figures(&outcomes))
}

/// Figures of rollouts, whoever drove.
pub fn figures(outcomes: &[Outcome]) -> Trial {
    let count = outcomes.len();
    let share = |end: End| outcomes.iter().filter(|o| o.end == end).count() as f64 / count.max(1) as f64;
    let mean = |values: Vec<f64>| num::mean(&values).unwrap_or(0.0);
    Trial {
        scenes: count,
        crash_rate: share(End::Contact),
        off_road_rate: share(End::OffRoad),
        arrival_rate: share(End::Arrived),
        route_completion: mean(outcomes.iter().map(|o| o.route_completion).collect()),
        speed_mps: mean(outcomes.iter().map(|o| o.ego.speed_mps_mean).collect()),
    }
}
