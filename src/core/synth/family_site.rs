//! The roads of SafeBench's traffic families: straight roads, bends and crossings whose measures are those of the
//! routes on CARLA's towns. A site also holds the ego's way over it.

use super::curve::Curve;
use super::junction::{Arm, Control, lay_junction};
use super::network::{Network, Profile, RoadLanes};
use crate::kernel::{Vec2, num};
use crate::scene::{LaneIx, LaneKind};

/// Road before the ego's start, after its goal and on each arm of a crossing, metres. A car that drives straight on at 20 m/s
/// from the ego's trigger to the end of a run does not reach their ends.
const BEFORE_M: f64 = 400.0;
const AFTER_M: f64 = 600.0;
const ARM_M: f64 = 300.0;
/// Stop lines lie this far before the end of the inbound lanes (where `lay_junction` puts them), metres.
const STOP_SETBACK_M: f64 = 1.5;
/// Speed limit in CARLA's towns: 25 mph.
const LIMIT_MPS: f64 = 11.1;
/// Distance between points of a route, metres.
const ROUTE_SPACING_M: f64 = 1.0;

/// A road with the ego's way over it.
pub(super) struct Site {
    pub net: Network,
    /// Lanes of the route, one after the other.
    lanes: Vec<LaneIx>,
    /// Start of the route on the first of them, metres.
    start_s_m: f64,
    /// Inbound lanes of the arms, the ego's own arm first, then counter-clockwise as the ego sees it: from the right,
    /// oncoming, from the left. Empty without a junction.
    pub inbound: Vec<Vec<LaneIx>>,
}

/// A bend of the ego's road before its trigger.
#[derive(Clone, Copy)]
pub(super) struct Bend {
    /// Angle of the bend, positive to the left, radians.
    pub turn_rad: f64,
    pub straight_before_m: f64,
    pub length_m: f64,
}

/// A crossing of four arms.
#[derive(Clone, Copy)]
pub(super) struct Crossing {
    /// Lanes each way on the ego's road and on the crossing one.
    pub own_lanes: usize,
    pub cross_lanes: usize,
    pub lane_width_m: f64,
    /// Distance from the centre to the ends of the arms, metres.
    pub reach_m: f64,
    /// Distance from the ego's start to the centre along its road, metres.
    pub start_to_centre_m: f64,
    /// Arm by which the ego leaves: 1 right, 2 ahead, 3 left.
    pub exit: usize,
    /// Directions of the right and of the left arm against the ego's, radians: about -pi/2 and pi/2.
    pub right_rad: f64,
    pub left_rad: f64,
}

fn street(lanes: usize, lane_width_m: f64) -> Profile {
    Profile {
        forward: lanes,
        backward: lanes,
        lane_width_m,
        median_m: 0.0,
        limit_mps: LIMIT_MPS,
        kind: LaneKind::Street,
        edges: false,
    }
}

/// A strip as wide as a lane on both sides of a road.
fn lay_sidewalks(net: &mut Network, road: &RoadLanes, lanes: usize, width_m: f64) {
    let beside_m = (lanes as f64 + 0.5) * width_m;
    for base in [road.reference.clone(), road.reference.reversed()] {
        net.add_lane(base.offset(-beside_m), width_m, LIMIT_MPS, LaneKind::Other);
    }
}

impl Site {
    /// A road with sidewalks; the ego drives in the right-most lane, which starts straight or with a bend.
    pub fn road(heading_rad: f64, lanes: usize, lane_width_m: f64, length_m: f64, bend: Option<Bend>) -> Site {
        let mut net = Network::default();
        let pieces = match bend {
            None => vec![(BEFORE_M + length_m + AFTER_M, 0.0, 0.0)],
            Some(bend) => {
                let ramp = 0.25 * bend.length_m;
                let curvature = bend.turn_rad / (bend.length_m - ramp);
                vec![
                    (BEFORE_M + bend.straight_before_m, 0.0, 0.0),
                    (ramp, 0.0, curvature),
                    (bend.length_m - 2.0 * ramp, curvature, curvature),
                    (ramp, curvature, 0.0),
                    (length_m + AFTER_M, 0.0, 0.0),
                ]
            }
        };
        let reference = Curve::bend(Vec2::ZERO, heading_rad, &pieces);
        let road = net.add_road(reference, street(lanes, lane_width_m));
        lay_sidewalks(&mut net, &road, lanes, lane_width_m);
        for side in [1.0, -1.0] {
            net.edges.push(road.reference.line(side * (lanes as f64 + 1.0) * lane_width_m));
        }
        let own = road.forward[lanes - 1];
        Site { net, lanes: vec![own], start_s_m: BEFORE_M, inbound: vec![] }
    }

    /// A crossing of roads with sidewalks; the ego comes along `heading_rad`, in the right-most lane unless it turns left.
    pub fn crossing(heading_rad: f64, crossing: &Crossing) -> Site {
        let mut net = Network::default();
        let width_m = crossing.lane_width_m;
        // Counter-clockwise, as `lay_junction` wants them.
        let directions = [num::PI, crossing.right_rad, 0.0, crossing.left_rad];
        let mut arms = Vec::with_capacity(4);
        for (k, direction) in directions.into_iter().enumerate() {
            let outward = heading_rad + direction;
            let lanes = if k % 2 == 0 { crossing.own_lanes } else { crossing.cross_lanes };
            let start = Vec2::from_heading(outward) * crossing.reach_m;
            let reference = Curve::bend(start, outward, &[(ARM_M, 0.0, 0.0)]);
            let road = net.add_road(reference, street(lanes, width_m));
            lay_sidewalks(&mut net, &road, lanes, width_m);
            arms.push(Arm::starting(&road, k % 2 == 0));
        }
        lay_junction(&mut net, &arms, Control::Priority, false);
        let inbound: Vec<Vec<LaneIx>> = arms.iter().map(|arm| arm.inbound.clone()).collect();
        let own = if crossing.exit == 3 { inbound[0][0] } else { inbound[0][crossing.own_lanes - 1] };
        let outbound = &arms[crossing.exit].outbound;
        let through = net.lanes[own].exits.iter().copied().find(|&c| outbound.contains(&net.lanes[c].exits[0]));
        // Every arm can be reached from every other. If not, the ego's own lane alone would be the route.
        let lanes = through.map_or(vec![own], |c| vec![own, c, net.lanes[c].exits[0]]);
        let start_s_m = net.lanes[own].curve.length_m() - (crossing.start_to_centre_m - crossing.reach_m);
        Site { net, lanes, start_s_m, inbound }
    }

    /// Returns the ego's route of this length.
    pub fn route(&self, length_m: f64) -> Vec<Vec2> {
        let count = (length_m / ROUTE_SPACING_M).ceil().max(1.0) as usize;
        (0..=count).map(|k| self.on_way(length_m * k as f64 / count as f64).0).collect()
    }

    /// Position and heading on the ego's way at a distance from its start.
    pub fn on_way(&self, way_m: f64) -> (Vec2, f64) {
        let mut left_m = self.start_s_m + way_m;
        for (k, &lane) in self.lanes.iter().enumerate() {
            let curve = &self.net.lanes[lane].curve;
            if left_m <= curve.length_m() || k + 1 == self.lanes.len() {
                let place = curve.at(left_m);
                return (place.position, num::wrap_angle(place.heading_rad));
            }
            left_m -= curve.length_m();
        }
        (Vec2::ZERO, 0.0)
    }

    /// Metres of the ego's way to the beginning and to the end of its turn; `None` without a junction.
    pub fn turn_m(&self) -> Option<(f64, f64)> {
        let [own, connector, _] = self.lanes[..] else { return None };
        let from_m = self.net.lanes[own].curve.length_m() - self.start_s_m;
        Some((from_m, from_m + self.net.lanes[connector].curve.length_m()))
    }

    /// The stop point of an inbound lane.
    pub fn stop_point(&self, lane: LaneIx) -> Vec2 {
        let curve = &self.net.lanes[lane].curve;
        curve.at(curve.length_m() - STOP_SETBACK_M).position
    }
}
