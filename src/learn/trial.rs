//! How an ego drives a set of scenes without a program: the figures by which actors are screened and compared.

use serde::{Deserialize, Serialize};

use crate::ego::Policy;
use crate::kernel::{Threads, num};
use crate::sim::{End, Intervention, Outcome, Plant, SimError, rollout};

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

/// Drives every scene once.
pub fn trial(plants: &[Plant], policy: &Policy, threads: &Threads) -> Result<Trial, SimError> {
    let driven = threads.map(plants, |_, plant| rollout(plant, &Intervention::default(), policy.driver().as_mut()));
    Ok(figures(&driven.into_iter().collect::<Result<Vec<_>, _>>()?))
}

/// Figures of rollouts without a program, whoever drove.
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
