//! The planning problem: where the ego starts, where it must go, and the route between them.

use super::obstacles::place;
use super::road::Network;
use super::{EGO_LENGTH_M, EGO_WIDTH_M, File, exact_or_middle, point, step};
use crate::formats::import_error::{ImportError, shown};
use crate::formats::imported::Imported;
use crate::formats::xml_read::Element;
use crate::kernel::{Polyline, Vec2};
use crate::scene::route::{GoalPlace, plan};
use crate::scene::{AgentKind, Ego, Sample, Track};

/// The ego starts in a lane if the lane's centre line is at most this far away, metres.
const START_WITHIN_M: f64 = 5.0;
/// Comfortable acceleration in the estimate of how far and how long the ego drives, m/s^2.
const ACCELERATION_MPS2: f64 = 1.0;
/// Target speed in that estimate if no limit is given, m/s.
const SPEED_UNKNOWN_MPS: f64 = 13.9;
/// A route shorter than this is extended along the lanes, metres.
const ROUTE_MIN_M: f64 = 30.0;

/// One planning problem in the file's coordinates and steps.
pub(super) struct Problem {
    pub id: String,
    pub position: Vec2,
    heading_rad: f64,
    speed_mps: f64,
    pub start_step: f64,
    /// Last step at which the goal counts.
    pub goal_step: Option<f64>,
    goals: Vec<GoalPlace>,
    has_goal_place: bool,
    dt_s: f64,
}

/// The problem; goals that cannot be read are left out in `imported`.
pub(super) fn read(
    file: &File<'_>,
    element: &Element<'_>,
    network: &Network,
    imported: &mut Imported,
) -> Result<Problem, ImportError> {
    let initial = element.needed_child("initialState")?;
    let place = initial.needed_child("position")?.needed_child("point")?;
    let speed_mps = file.velocities.speed_mps(exact_or_middle(&initial.needed_child("velocity")?)?);
    let mut problem = Problem {
        id: element.needed_attribute("id")?.to_string(),
        position: point(&place)?,
        heading_rad: file.angle(&initial.needed_child("orientation")?)?,
        speed_mps,
        start_step: step(&initial.needed_child("time")?.needed_child("exact")?)?,
        goal_step: None,
        goals: vec![],
        has_goal_place: false,
        dt_s: file.dt_s,
    };
    // Several goal states are alternatives. The route leads to the nearest that can be reached.
    for goal in element.named("goalState") {
        if let Err(error) = problem.read_goal(file, &goal, network, imported) {
            imported.leave_out_for(
                format!("goal of problem {}", shown(&problem.id)),
                &error,
                "the ego's start is kept",
            );
        }
    }
    Ok(problem)
}

impl Problem {
    fn read_goal(
        &mut self,
        file: &File<'_>,
        goal: &Element<'_>,
        network: &Network,
        imported: &mut Imported,
    ) -> Result<(), ImportError> {
        let position = goal.child("position");
        self.has_goal_place |= position.is_some();
        if let Some(time) = goal.child("time") {
            let last = time.child("exact").or(time.child("intervalEnd"));
            let last = last.ok_or_else(|| time.refuse("<exact> or <intervalEnd>")).and_then(|last| step(&last));
            let what = format!("goal time of problem {}", shown(&self.id));
            let last = imported.read(&what, last, "the goal's place is kept");
            self.goal_step = self.goal_step.into_iter().chain(last).reduce(f64::max);
        }
        let Some(position) = position else { return Ok(()) };
        for lanelet in position.named("lanelet") {
            let lane = lanelet.needed_attribute("ref").and_then(|id| {
                let expected = || format!("the id of a lanelet that can be read, found {:?}", shown(id));
                network.index.get(id).copied().ok_or_else(|| lanelet.refuse(expected()))
            });
            let what = format!("goal of problem {}", shown(&self.id));
            let lane = imported.read(&what, lane, "other goals are kept");
            self.goals.extend(lane.map(|lane| GoalPlace { lane, s_m: 0.0 }));
        }
        if let Some(middle) = place(&position)? {
            let heading = goal.child("orientation").map(|o| file.angle(&o)).transpose()?;
            let graph = &network.graph;
            let state = match heading {
                Some(heading) => graph.nearest_lane(middle, heading, START_WITHIN_M),
                None => graph.nearest_lane_any_heading(middle, START_WITHIN_M),
            };
            self.goals.extend(state.map(|place| GoalPlace { lane: place.lane, s_m: place.s_m }));
        }
        Ok(())
    }
}

/// The ego with its one sample and its route, in local coordinates; or the reason why there is none.
pub(super) fn ego(problem: &Problem, network: &Network) -> Result<Ego, String> {
    let graph = &network.graph;
    // Where lanes overlap, as in a junction, the ego takes the nearest lane from which the goal can be reached.
    let starts = graph.lanes_near(problem.position, problem.heading_rad, START_WITHIN_M);
    let Some(nearest) = starts.first() else {
        return Err("the ego does not start in a lane: none of its direction lies within 5 m".into());
    };
    if problem.has_goal_place && problem.goals.is_empty() {
        return Err("the goal region lies in no lane".into());
    }
    let limit = network.speed_limit_mps(nearest.lane);
    let aim = limit.unwrap_or(SPEED_UNKNOWN_MPS).max(problem.speed_mps);
    let seconds = problem.goal_step.map_or(5.0, |last| ((last - problem.start_step) * problem.dt_s).max(0.0));
    let length_m = distance_m(problem.speed_mps, aim, seconds).max(ROUTE_MIN_M);
    let transition_m = (3.0 * problem.speed_mps).clamp(15.0, 60.0);
    let mut routes =
        starts.iter().filter_map(|start| plan(graph, problem.position, *start, &problem.goals, length_m, transition_m));
    let route = routes.next().ok_or("no way through the lanes leads from the ego's start to its goal")?;
    let velocity = Vec2::from_heading(problem.heading_rad) * problem.speed_mps;
    let sample = Sample { position: Vec2::ZERO, heading_rad: problem.heading_rad, velocity };
    Ok(Ego {
        track: Track {
            id: "ego".into(),
            kind: AgentKind::Vehicle,
            length_m: EGO_LENGTH_M,
            width_m: EGO_WIDTH_M,
            samples: vec![Some(sample)],
        },
        start_step: 0,
        route: route.into_iter().map(|p| p - problem.position).collect(),
        target_speed_mps: limit,
    })
}

/// The ego with its one sample and a straight way ahead, as the problem gives it, without a search through the lanes.
pub(super) fn unplanned_ego(problem: &Problem) -> Ego {
    let ahead = Vec2::from_heading(problem.heading_rad);
    Ego {
        track: Track {
            id: "ego".into(),
            kind: AgentKind::Vehicle,
            length_m: EGO_LENGTH_M,
            width_m: EGO_WIDTH_M,
            samples: vec![Some(Sample {
                position: problem.position,
                heading_rad: problem.heading_rad,
                velocity: ahead * problem.speed_mps,
            })],
        },
        start_step: 0,
        route: vec![problem.position, problem.position + ahead * ROUTE_MIN_M],
        target_speed_mps: None,
    }
}

/// Way driven in a time with constant acceleration up to a speed, metres.
fn distance_m(from_mps: f64, to_mps: f64, seconds: f64) -> f64 {
    let ramp_s = ((to_mps - from_mps).max(0.0) / ACCELERATION_MPS2).min(seconds);
    let reached = from_mps + ACCELERATION_MPS2 * ramp_s;
    0.5 * (from_mps + reached) * ramp_s + reached * (seconds - ramp_s)
}

/// Time that the same driver takes for the whole route, seconds.
pub(super) fn driving_time_s(ego: &Ego) -> f64 {
    let length_m = Polyline::new(ego.route.clone()).map_or(0.0, |route| route.length_m());
    let from = ego.track.at(0).map_or(0.0, Sample::speed_mps);
    let to = ego.target_speed_mps.unwrap_or(SPEED_UNKNOWN_MPS).max(from);
    let ramp_s = (to - from) / ACCELERATION_MPS2;
    let ramp_m = 0.5 * (from + to) * ramp_s;
    if ramp_m >= length_m {
        return ((from * from + 2.0 * ACCELERATION_MPS2 * length_m).sqrt() - from) / ACCELERATION_MPS2;
    }
    ramp_s + (length_m - ramp_m) / to
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_route_takes_the_time_in_which_it_is_driven() {
        for (from, seconds) in [(0.0, 4.0), (5.0, 30.0), (13.0, 2.0)] {
            let length = distance_m(from, 13.9, seconds);
            let sample = Sample { velocity: Vec2::new(from, 0.0), ..Sample::default() };
            let track = Track {
                id: "ego".into(),
                kind: AgentKind::Vehicle,
                length_m: 4.0,
                width_m: 2.0,
                samples: vec![Some(sample)],
            };
            let route = vec![Vec2::ZERO, Vec2::new(length, 0.0)];
            let ego = Ego { track, start_step: 0, route, target_speed_mps: Some(13.9) };
            assert!((driving_time_s(&ego) - seconds).abs() < 1e-9);
        }
    }
}
