//! Builds junctions of straight arms: connectors, right of way, stop lines, crosswalks, corner curbs.

use super::curve::{Curve, Place};
use super::network::{Crossing, Crosswalk, Gate, Network, Profile, RoadLanes};
use super::node::{Connector, Signal};
use crate::kernel::{Vec2, num};
use crate::scene::{LaneIx, LaneKind};

/// Rule of who goes first.
#[derive(Clone, Copy, Debug)]
pub(super) enum Control {
    Signals(Signal),
    /// Arms whose flag is not set have a stop sign.
    Priority,
    AllWayStop,
}

/// A road that ends at a junction, seen from its centre outwards.
#[derive(Clone, Debug)]
pub(super) struct Arm {
    pub heading_rad: f64,
    pub reference: Curve,
    /// Towards and away from the junction, left-most first in driving direction.
    pub inbound: Vec<LaneIx>,
    pub outbound: Vec<LaneIx>,
    pub profile: Profile,
    /// True for the main road: signal group 0, priority.
    pub major: bool,
}

impl Arm {
    /// A road whose reference line starts at the junction.
    pub fn starting(road: &RoadLanes, major: bool) -> Arm {
        Arm {
            heading_rad: road.reference.start().heading_rad,
            reference: road.reference.clone(),
            inbound: road.backward.clone(),
            outbound: road.forward.clone(),
            profile: road.profile,
            major,
        }
    }

    /// A road whose reference line ends at the junction; it must be as wide on both sides.
    pub fn ending(road: &RoadLanes, major: bool) -> Arm {
        let reference = road.reference.reversed();
        Arm {
            heading_rad: reference.start().heading_rad,
            reference,
            inbound: road.forward.clone(),
            outbound: road.backward.clone(),
            profile: road.profile,
            major,
        }
    }

    /// Returns the point where the curb on the inbound side (+1) or the outbound side (-1) meets the junction.
    fn curb(&self, side: f64) -> Vec2 {
        let lanes = if side > 0.0 { self.inbound.len() } else { self.outbound.len() };
        let half = 0.5 * self.profile.median_m + lanes as f64 * self.profile.lane_width_m;
        let start = self.reference.start();
        start.position + Vec2::from_heading(start.heading_rad).left() * (side * half)
    }
}

/// Metres between the end of the inbound lanes and the stop line, where a crosswalk lies in between.
const STOP_SETBACK_M: f64 = 6.0;
const CROSSWALK_M: (f64, f64) = (1.5, 4.5);

/// Speed limit of a connector, m/s; the bend slows drivers further.
const TURN_LIMIT_MPS: f64 = 11.0;

/// Joins arms, given counter-clockwise, by every legal movement.
pub(super) fn lay_junction(net: &mut Network, arms: &[Arm], control: Control, crosswalks: bool) {
    let mut connectors = Vec::new();
    for (i, from) in arms.iter().enumerate() {
        for (j, to) in arms.iter().enumerate() {
            if i != j {
                lay_movement(net, from, to, &control, &mut connectors);
            }
        }
    }
    let signal = match control {
        Control::Signals(signal) => Some(signal),
        Control::Priority | Control::AllWayStop => None,
    };
    let node = net.add_node(connectors, signal);
    let setback = if crosswalks { STOP_SETBACK_M } else { 1.5 };
    for arm in arms {
        for &lane in &arm.inbound {
            let stop_s = net.lanes[lane].curve.length_m() - setback;
            net.lanes[lane].gate = Some(Gate { node, stop_s });
        }
        if crosswalks {
            lay_crosswalk(net, arm);
        }
    }
    for (i, arm) in arms.iter().enumerate() {
        let next = &arms[(i + 1) % arms.len()];
        let place = |position, heading_rad| Place { position, heading_rad, curvature: 0.0 };
        let corner =
            Curve::between(place(arm.curb(1.0), arm.heading_rad + num::PI), place(next.curb(-1.0), next.heading_rad));
        net.edges.push(corner.points);
    }
}

fn lay_movement(net: &mut Network, from: &Arm, to: &Arm, control: &Control, connectors: &mut Vec<Connector>) {
    let turn = num::wrap_angle(to.heading_rad - from.heading_rad - num::PI);
    let (last_in, last_out) = (from.inbound.len() - 1, to.outbound.len() - 1);
    let straight = turn.abs() < num::PI / 5.0;
    let pairs: Vec<(usize, usize)> = if straight {
        (0..=last_in.min(last_out)).map(|k| (k, k)).collect()
    } else if turn > 0.0 {
        vec![(0, 0)]
    } else {
        vec![(last_in, last_out)]
    };
    let minor = u8::from(!from.major);
    let (rank, stop_sign) = match control {
        Control::Signals(_) => (u8::from(!straight && turn > 0.0), false),
        Control::AllWayStop => (0, true),
        Control::Priority if straight => (minor * 3, !from.major),
        Control::Priority if turn > 0.0 => (1 + minor * 3, !from.major),
        Control::Priority => (minor * 2, !from.major),
    };
    for (a, b) in pairs {
        let (origin, target) = (from.inbound[a], to.outbound[b]);
        let (start, end) = (net.lanes[origin].curve.end(), net.lanes[target].curve.start());
        let flat = |p: Place| Place { curvature: 0.0, ..p };
        let limit = if straight { from.profile.limit_mps } else { TURN_LIMIT_MPS };
        let lane =
            net.add_lane(Curve::between(flat(start), flat(end)), from.profile.lane_width_m, limit, LaneKind::Street);
        net.connect(origin, lane);
        net.connect(lane, target);
        connectors.push(Connector { lane, origin, rank, group: usize::from(!from.major), stop_sign });
    }
}

fn lay_crosswalk(net: &mut Network, arm: &Arm) {
    let (near, far) = CROSSWALK_M;
    let middle = 0.5 * (near + far);
    let outward = Vec2::from_heading(arm.heading_rad);
    let (start, end) = (arm.curb(1.0) + outward * middle, arm.curb(-1.0) + outward * middle);
    let crosswalk = net.crosswalks.len();
    let width = arm.profile.lane_width_m;
    let across = start.distance(end);
    for (k, &lane) in arm.inbound.iter().rev().enumerate() {
        let length = net.lanes[lane].curve.length_m();
        let (from_c, to_c) = (k as f64 * width, (k + 1) as f64 * width);
        net.lanes[lane].crossings.push(Crossing { crosswalk, from_s: length - far, to_s: length - near, from_c, to_c });
    }
    for (k, &lane) in arm.outbound.iter().rev().enumerate() {
        let (from_c, to_c) = (across - (k + 1) as f64 * width, across - k as f64 * width);
        net.lanes[lane].crossings.push(Crossing { crosswalk, from_s: near, to_s: far, from_c, to_c });
    }
    let lanes = arm.inbound.iter().chain(&arm.outbound).copied().collect();
    net.crosswalks.push(Crosswalk { start, end, width_m: far - near, lanes });
}
