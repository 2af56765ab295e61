//! The lane-graph goal prior, which replaces CAT's learned one: goals along every possible path, the mildest speed
//! profile to each, a log-linear probability, and greedy suppression of goals that lie close together.
//!
//! The prior sees the lane graph and the actor, never the ego: what is likely is decided before what is dangerous.

use super::Candidate;
use super::lane_paths::{LanePath, paths};
use super::speed_profile::SpeedProfile;
use crate::kernel::{Stream, Vec2, num};
use crate::scene::{DT_S, LaneGraph, LaneIx, Sample};

/// Largest deviation from the lanes that counts for the goal of an arc, metres.
const OFF_LANE_M_MAX: f64 = 6.0;
/// Added if that lane is not on the actor's own way, metres: a lane's width.
const FOREIGN_LANE_M: f64 = 3.5;

/// Settings of the prior; figures of the stand-in's reference in parentheses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PriorOptions {
    /// M (32)
    pub count: usize,
    /// Suppression radius at full speed, metres (7.2).
    pub nms_radius_m: f64,
    /// Distance between goals on a path, metres (2).
    pub goal_spacing_m: f64,
    /// Speed profiles: ±step, .. ±levels step (1, 3).
    pub profile_step_mps2: f64,
    /// Acceleration profiles on each side of keeping the speed.
    pub profile_levels: usize,
    /// Scales of the log-prior's terms (2 m/s, 3 m/s², 3 m/s², 1.5 m) and the cost of a lane change (0.5).
    pub speed_change_scale_mps: f64,
    /// Scale of the acceleration term, m/s².
    pub acceleration_scale_mps2: f64,
    /// Scale of the lateral acceleration term, m/s².
    pub lateral_scale_mps2: f64,
    /// Scale of the deviation from the vehicle's own lane, metres.
    pub lane_offset_scale_m: f64,
    /// Log-prior cost of each lane change.
    pub lane_change_cost: f64,
    /// From this rank on all candidates have equal probability (6).
    pub flatten_rank: usize,
}

impl PriorOptions {
    /// The figures in parentheses, for families whose signature is not the prior itself.
    pub const REFERENCE: PriorOptions = PriorOptions {
        count: 32,
        nms_radius_m: 7.2,
        goal_spacing_m: 2.0,
        profile_step_mps2: 1.0,
        profile_levels: 3,
        speed_change_scale_mps: 2.0,
        acceleration_scale_mps2: 3.0,
        lateral_scale_mps2: 3.0,
        lane_offset_scale_m: 1.5,
        lane_change_cost: 0.5,
        flatten_rank: 6,
    };
}

/// A place to be at the end of the window.
#[derive(Clone, Copy, Debug)]
struct Goal {
    path: usize,
    profile: SpeedProfile,
    place: Vec2,
    log_prior: f64,
}

/// Candidate trajectories of `steps` samples after `anchor`, most probable first, log-probabilities normalised.
///
/// If fewer than `count` goals survive suppression, suppressed ones are drawn at random to fill the list. There are
/// fewer candidates only if there are fewer goals.
pub fn candidates(
    lanes: &LaneGraph,
    anchor: &Sample,
    steps: usize,
    options: &PriorOptions,
    stream: &mut Stream,
) -> Vec<Candidate> {
    let (ways, goals) = ways_and_goals(lanes, anchor, steps, options);
    let mut kept = survivors(goals, anchor, options, stream);
    kept.sort_by(|a, b| b.log_prior.total_cmp(&a.log_prior));
    let mut logs: Vec<f64> = kept.iter().map(|g| g.log_prior).collect();
    flatten_and_normalise(&mut logs, options.flatten_rank);
    let along = |(goal, log): (&Goal, &f64)| Candidate::new(drive(&ways[goal.path], goal, anchor, steps), *log);
    kept.iter().zip(&logs).map(along).collect()
}

/// The goals of an actor, each with the motion to it.
pub struct Goals<'a> {
    ways: Vec<LanePath>,
    goals: Vec<Goal>,
    anchor: &'a Sample,
    steps: usize,
}

impl Goals<'_> {
    /// Returns the number of goals.
    pub fn count(&self) -> usize {
        self.goals.len()
    }

    /// The motion to the goal at a place, with the prior's log-probability up to a constant.
    pub fn candidate(&self, place: usize) -> Candidate {
        let goal = &self.goals[place];
        Candidate::new(drive(&self.ways[goal.path], goal, self.anchor, self.steps), goal.log_prior)
    }
}

/// The same where every goal is scored anew before suppression; nothing is flattened. `log_ratios` says of every goal, in
/// their order, by how much a model's log-probability is larger than the prior's.
pub fn reweighed(
    lanes: &LaneGraph,
    anchor: &Sample,
    steps: usize,
    options: &PriorOptions,
    stream: &mut Stream,
    log_ratios: impl FnOnce(&Goals<'_>) -> Vec<f64>,
) -> Vec<Candidate> {
    let (ways, goals) = ways_and_goals(lanes, anchor, steps, options);
    let mut all = Goals { ways, goals, anchor, steps };
    for (place, ratio) in log_ratios(&all).into_iter().enumerate() {
        all.goals[place].log_prior += ratio;
    }
    let mut kept = survivors(all.goals, anchor, options, stream);
    kept.sort_by(|a, b| b.log_prior.total_cmp(&a.log_prior));
    let mut logs: Vec<f64> = kept.iter().map(|g| g.log_prior).collect();
    normalise(&mut logs);
    let along = |(goal, log): (&Goal, &f64)| Candidate::new(drive(&all.ways[goal.path], goal, anchor, steps), *log);
    kept.iter().zip(&logs).map(along).collect()
}

/// The ways on within reach, and the goals along them.
fn ways_and_goals(
    lanes: &LaneGraph,
    anchor: &Sample,
    steps: usize,
    options: &PriorOptions,
) -> (Vec<LanePath>, Vec<Goal>) {
    let time_s = steps as f64 * DT_S;
    let hardest = options.profile_step_mps2 * options.profile_levels as f64;
    let reach_m = anchor.speed_mps() * time_s + 0.5 * hardest * time_s * time_s;
    let ways = paths(lanes, anchor, reach_m.max(1.0));
    let goals = goals(lanes, anchor, &ways, time_s, options);
    (ways, goals)
}

/// Returns the goals that suppression leaves.
fn survivors(mut goals: Vec<Goal>, anchor: &Sample, options: &PriorOptions, stream: &mut Stream) -> Vec<Goal> {
    goals.sort_by(|a, b| b.log_prior.total_cmp(&a.log_prior));
    let radius_m = options.nms_radius_m * speed_share(anchor.speed_mps());
    suppressed(&goals, radius_m, options.count, stream)
}

/// s(v): CAT's share of the suppression radius, 0.5 below 1.4 m/s, 1 above 11 m/s, linear between.
pub fn speed_share(speed_mps: f64) -> f64 {
    (0.5 + 0.5 * (speed_mps - 1.4) / (11.0 - 1.4)).clamp(0.5, 1.0)
}

/// Sets `p[rank..] = p[rank]`, then takes the log-softmax. `logs` are sorted, largest first. `[candidates]`
pub fn flatten_and_normalise(logs: &mut [f64], rank: usize) {
    if let Some(level) = logs.get(rank).copied() {
        logs[rank..].fill(level);
    }
    normalise(logs);
}

/// Log-softmax, in any order.
pub fn normalise(logs: &mut [f64]) {
    if logs.is_empty() {
        return;
    }
    let largest = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let total = num::ln(num::sum(logs.iter().map(|p| num::exp(p - largest)))) + largest;
    for log in logs {
        *log -= total;
    }
}

fn goals(lanes: &LaneGraph, anchor: &Sample, ways: &[LanePath], time_s: f64, options: &PriorOptions) -> Vec<Goal> {
    let speed = anchor.speed_mps();
    let own: Vec<LaneIx> = ways.iter().filter(|w| w.lane_changes == 0).filter_map(|w| w.lane).collect();
    let mut neighbours = Vec::new();
    for (path, way) in ways.iter().enumerate() {
        let (from, to) = way.goals_m;
        let count = ((to - from).max(0.0) / options.goal_spacing_m) as usize;
        for k in 0..=count {
            let distance_m = from + options.goal_spacing_m * k as f64;
            let profile =
                SpeedProfile::reaching(distance_m, time_s, speed, options.profile_step_mps2, options.profile_levels);
            let Some(profile) = profile else { continue };
            let place = way.at(distance_m);
            let aside_m = way.sideways_m.unwrap_or_else(|| off_lane_m(lanes, &own, place));
            let log_prior = log_prior(way, &profile, distance_m, time_s, aside_m, options);
            neighbours.push(Goal { path, profile, place, log_prior });
        }
    }
    neighbours
}

/// How far a place lies off the lanes that the actor can follow without changing lane.
fn off_lane_m(lanes: &LaneGraph, own: &[LaneIx], place: Vec2) -> f64 {
    if lanes.lane_count() == 0 {
        return 0.0;
    }
    match lanes.nearest_lane_any_heading(place, OFF_LANE_M_MAX) {
        None => OFF_LANE_M_MAX,
        Some(near) if own.contains(&near.lane) => near.distance_m,
        Some(near) => near.distance_m + FOREIGN_LANE_M,
    }
}

/// −[(Δv̄/a)² + (a_max/b)² + (a_lat,max/c)² + (aside/d)² + e·lane changes]
fn log_prior(
    way: &LanePath,
    profile: &SpeedProfile,
    distance_m: f64,
    time_s: f64,
    aside_m: f64,
    options: &PriorOptions,
) -> f64 {
    let square = |x: f64| x * x;
    let speed_change = distance_m / time_s - profile.speed_mps;
    let fastest = profile.speed_mps.max(profile.speed_at(time_s));
    let lateral = fastest * fastest * way.curvature_max(distance_m);
    let acceleration = if profile.until_s > 0.0 { profile.acceleration_mps2 } else { 0.0 };
    -(square(speed_change / options.speed_change_scale_mps)
        + square(acceleration / options.acceleration_scale_mps2)
        + square(lateral / options.lateral_scale_mps2)
        + square(aside_m / options.lane_offset_scale_m)
        + options.lane_change_cost * way.lane_changes as f64)
}

/// Greedy suppression: the most probable goal, then the next that is no nearer than the radius to any kept, up to
/// `count`; then random ones of the rest.
fn suppressed(goals: &[Goal], radius_m: f64, count: usize, stream: &mut Stream) -> Vec<Goal> {
    let mut kept: Vec<Goal> = Vec::with_capacity(count);
    let mut rest: Vec<Goal> = Vec::new();
    for goal in goals {
        if kept.len() == count {
            break;
        }
        let near = |k: &Goal| (k.place - goal.place).norm_squared() < radius_m * radius_m;
        if kept.iter().any(near) { rest.push(*goal) } else { kept.push(*goal) }
    }
    while kept.len() < count && !rest.is_empty() {
        kept.push(rest.swap_remove(stream.below(rest.len())));
    }
    kept
}

fn drive(way: &LanePath, goal: &Goal, anchor: &Sample, steps: usize) -> Vec<Sample> {
    let (mut last_heading, mut near) = (anchor.heading_rad, 0);
    let sample = |k: usize| {
        let time_s = (k + 1) as f64 * DT_S;
        let (distance_m, speed) = (goal.profile.distance_at(time_s), goal.profile.speed_at(time_s));
        let (position, direction) = way.place(distance_m, &mut near);
        // A standing actor keeps its heading.
        if distance_m > 0.05 {
            last_heading = direction.heading();
        }
        Sample { position, heading_rad: last_heading, velocity: direction * speed }
    };
    (0..steps).map(sample).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernel::Seed;
    use crate::scene::Road;

    fn eastbound(speed: f64) -> Sample {
        Sample { position: Vec2::new(20.0, 0.3), heading_rad: 0.05, velocity: Vec2::new(speed, 0.0) }
    }

    fn of(scene: &crate::scene::Scene, speed: f64) -> Vec<Candidate> {
        let lanes = LaneGraph::of(&scene.road);
        candidates(&lanes, &eastbound(speed), 80, &PriorOptions::REFERENCE, &mut Seed(1).stream(&["prior"]))
    }

    #[test]
    fn candidates_are_sorted_probabilities_that_sum_to_one() {
        let neighbours = of(&crate::scene::fixture::two_lane_scene(), 8.0);
        assert_eq!(neighbours.len(), 32);
        let total = num::sum(neighbours.iter().map(|c| num::exp(c.prior_log_probability)));
        assert!((total - 1.0).abs() < 1e-12);
        assert!(neighbours.windows(2).all(|p| p[0].prior_log_probability >= p[1].prior_log_probability));
        let level = neighbours[6].prior_log_probability;
        assert!(neighbours[6..].iter().all(|c| c.prior_log_probability == level));
        // The likeliest way on keeps lane and speed.
        let end = neighbours[0].samples[79];
        assert!(end.position.y.abs() < 0.5 && (end.position.x - 84.0).abs() < 8.0, "{end:?}");
    }

    #[test]
    fn goals_that_survive_suppression_are_a_radius_apart() {
        let goal = |x: f64, log_prior: f64| Goal {
            path: 0,
            profile: SpeedProfile { speed_mps: 1.0, acceleration_mps2: 0.0, until_s: 0.0 },
            place: Vec2::new(x, 0.0),
            log_prior,
        };
        let goals: Vec<Goal> = (0..40).map(|k| goal(2.0 * k as f64, -(k as f64))).collect();
        let kept = suppressed(&goals, 7.2, 5, &mut Seed(1).stream(&["nms"]));
        assert_eq!(kept.iter().map(|g| g.place.x).collect::<Vec<_>>(), [0.0, 8.0, 16.0, 24.0, 32.0]);
        let padded = suppressed(&goals[..6], 7.2, 5, &mut Seed(1).stream(&["nms"]));
        assert_eq!(padded.len(), 5);
    }

    #[test]
    fn every_candidate_moves_as_its_velocity_says() {
        for candidate in of(&crate::scene::fixture::two_lane_scene(), 8.0) {
            for pair in candidate.samples.windows(2) {
                let moved = (pair[0].velocity + pair[1].velocity) * (0.5 * DT_S);
                assert!((pair[1].position - pair[0].position - moved).norm() < 0.25);
            }
        }
    }

    #[test]
    fn without_any_lane_there_are_still_arcs() {
        let lanes = LaneGraph::of(&Road::default());
        let neighbours =
            candidates(&lanes, &eastbound(5.0), 80, &PriorOptions::REFERENCE, &mut Seed(1).stream(&["prior"]));
        assert!(!neighbours.is_empty());
    }

    #[test]
    fn the_radius_shrinks_for_slow_vehicles() {
        assert_eq!(speed_share(0.0), 0.5);
        assert_eq!(speed_share(20.0), 1.0);
        assert!((speed_share(6.2) - 0.75).abs() < 1e-12);
    }
}
