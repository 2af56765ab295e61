//! Cuts out the part of a town that a scene needs, and adds the lights of its family.

use crate::kernel::{Polyline, Pose, Vec2};
use crate::scene::safebench::{STEPS, TrafficFamily};
use crate::scene::{LaneGraph, LaneIx, Light, LightState, Neighbour, Road};

/// Lanes farther from the route than this are left out, metres.
const NEAR_M: f64 = 80.0;
/// An actor stands in a lane if it is at most this far from it, metres.
const ACTOR_LANE_M: f64 = 4.0;
/// Lanes that are followed to a junction.
const LANES_TO_JUNCTION_MAX: usize = 50;
/// Stop points lie this far before the junction, metres.
const SETBACK_M: f64 = 1.0;

/// The road near a route, and the new index of each lane that is kept.
pub(super) fn near(road: &Road, route: &Polyline) -> (Road, Vec<Option<LaneIx>>) {
    let line = route.resampled(10.0);
    let close = |point: &Vec2| line.points().iter().any(|p| p.distance(*point) <= NEAR_M);
    let mut kept = vec![None; road.lanes.len()];
    let mut count = 0;
    for (slot, lane) in kept.iter_mut().zip(&road.lanes) {
        // Long straight lanes have few points, so the middles of their segments count too.
        let middles = lane.centre.windows(2).map(|w| w[0].lerp(w[1], 0.5));
        if lane.centre.iter().any(close) || middles.into_iter().any(|p| close(&p)) {
            *slot = Some(count);
            count += 1;
        }
    }
    let moved = |links: &[LaneIx]| links.iter().filter_map(|&ix| kept.get(ix).copied().flatten()).collect();
    let beside = |side: &[Neighbour]| {
        let moved = |n: &Neighbour| Some(Neighbour { lane: kept.get(n.lane).copied().flatten()?, ..*n });
        side.iter().filter_map(moved).collect::<Vec<_>>()
    };
    let lanes = road.lanes.iter().zip(&kept).filter(|(_, slot)| slot.is_some()).map(|(lane, _)| {
        let mut lane = lane.clone();
        (lane.entries, lane.exits) = (moved(&lane.entries), moved(&lane.exits));
        lane.left_neighbours = beside(&lane.left_neighbours);
        lane.right_neighbours = beside(&lane.right_neighbours);
        lane
    });
    let lanes = lanes.collect();
    let edges = road.edges.iter().filter(|edge| edge.iter().any(close)).cloned().collect();
    (Road { lanes, edges }, kept)
}

/// Lights as SafeBench freezes them: families 5 and 6 give the ego green, 7 gives it red; the actor of family 5 has
/// red, those of 6 and 7 have green. The others have none.
pub(super) fn lights(
    family: TrafficFamily,
    graph: &LaneGraph,
    kept: &[Option<LaneIx>],
    near: &Road,
    route: &Polyline,
    trigger_s_m: f64,
    actors: &[Pose],
) -> Vec<Light> {
    let (own, other) = match family {
        TrafficFamily::RedLightRunning => (LightState::Go, LightState::Stop),
        TrafficFamily::UnprotectedLeftTurn => (LightState::Go, LightState::Go),
        TrafficFamily::RightTurn => (LightState::Stop, LightState::Go),
        _ => return vec![],
    };
    let ego = Pose { position: route.at(trigger_s_m), heading_rad: route.heading_at(trigger_s_m) };
    let mut lights: Vec<Light> = Vec::new();
    let wanted = std::iter::once((ego, own)).chain(actors.iter().map(|actor| (*actor, other)));
    for (pose, state) in wanted {
        let lane = graph.nearest_lane(pose.position, pose.heading_rad, ACTOR_LANE_M).map(|place| place.lane);
        let lane = lane.map(|lane| before_junction(graph, lane)).and_then(|lane| kept.get(lane).copied().flatten());
        let Some(lane) = lane.filter(|lane| lights.iter().all(|light| light.lane != *lane)) else { continue };
        let line = near.lanes.get(lane).and_then(|lane| Polyline::new(lane.centre.clone()).ok());
        let Some(line) = line else { continue };
        let stop_point = line.at((line.length_m() - SETBACK_M).max(0.0));
        lights.push(Light { lane, stop_point, states: vec![state; STEPS] });
    }
    lights
}

/// The last lane before several ways lead on.
fn before_junction(graph: &LaneGraph, lane: LaneIx) -> LaneIx {
    let mut at = lane;
    for _ in 0..LANES_TO_JUNCTION_MAX {
        match graph.exits(at) {
            [only] if graph.entries(*only).len() == 1 => at = *only,
            _ => break,
        }
    }
    at
}
