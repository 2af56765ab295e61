//! The road of a generated world: lanes along curves, topology, and stopping rules.

use super::curve::Curve;
use super::node::{Node, Signal};
use crate::kernel::Vec2;
use crate::scene::{LaneIx, LaneKind};

/// Kind of a lane's end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum LaneEnd {
    /// Traffic goes on into an exit, or leaves the world if there is none.
    Open,
    /// The lane ends: drivers must change lanes before.
    Closed,
}

/// A line that drivers pass only with the node's permission.
#[derive(Clone, Copy, Debug)]
pub(super) struct Gate {
    pub node: usize,
    pub stop_s: f64,
}

/// Place where a crosswalk lies over a lane.
#[derive(Clone, Copy, Debug)]
pub(super) struct Crossing {
    pub crosswalk: usize,
    /// Begin, along the lane.
    pub from_s: f64,
    pub to_s: f64,
    /// Places along the crosswalk at which the lane's far side lies as seen from its start, and from its end.
    pub from_c: f64,
    pub to_c: f64,
}

#[derive(Clone, Debug)]
pub(super) struct SynthLane {
    pub curve: Curve,
    pub width_m: f64,
    pub kind: LaneKind,
    pub limit_mps: f64,
    pub entries: Vec<LaneIx>,
    pub exits: Vec<LaneIx>,
    /// Neighbour, and true if it runs the same way.
    pub left: Option<(LaneIx, bool)>,
    pub right: Option<(LaneIx, bool)>,
    pub end: LaneEnd,
    pub gate: Option<Gate>,
    /// Node and index among its connectors.
    pub connector: Option<(usize, usize)>,
    /// `(start, end, largest curvature)`.
    pub bends: Vec<(f64, f64, f64)>,
    pub crossings: Vec<Crossing>,
}

/// A straight way over the road for people on foot, from curb to curb.
#[derive(Clone, Debug)]
pub(super) struct Crosswalk {
    pub start: Vec2,
    pub end: Vec2,
    pub width_m: f64,
    /// Lanes it lies over.
    pub lanes: Vec<LaneIx>,
}

impl Crosswalk {
    pub fn polygon(&self) -> Vec<Vec2> {
        let along = self.end - self.start;
        let aside = along.left() * (0.5 * self.width_m / along.norm());
        vec![self.start + aside, self.start - aside, self.end - aside, self.end + aside]
    }
}

#[derive(Clone, Debug, Default)]
pub(super) struct Network {
    pub lanes: Vec<SynthLane>,
    pub edges: Vec<Vec<Vec2>>,
    pub nodes: Vec<Node>,
    pub crosswalks: Vec<Crosswalk>,
}

/// Cross section of a road.
#[derive(Clone, Copy, Debug)]
pub(super) struct Profile {
    pub forward: usize,
    pub backward: usize,
    pub lane_width_m: f64,
    /// Width between the two directions, metres; a curb stands on both sides of one that is wider than 0.
    pub median_m: f64,
    pub limit_mps: f64,
    pub kind: LaneKind,
    /// True if the outer curbs are drawn; a caller may draw its own.
    pub edges: bool,
}

/// Lanes of a road, left-most first in their own driving direction.
#[derive(Clone, Debug)]
pub(super) struct RoadLanes {
    pub reference: Curve,
    pub profile: Profile,
    pub forward: Vec<LaneIx>,
    pub backward: Vec<LaneIx>,
}

impl RoadLanes {
    /// Distance from the reference line to the outer curb of the forward lanes.
    pub fn half_forward_m(&self) -> f64 {
        0.5 * self.profile.median_m + self.profile.forward as f64 * self.profile.lane_width_m
    }

    pub fn half_backward_m(&self) -> f64 {
        0.5 * self.profile.median_m + self.profile.backward as f64 * self.profile.lane_width_m
    }
}

impl Network {
    pub fn add_lane(&mut self, curve: Curve, width_m: f64, limit_mps: f64, kind: LaneKind) -> LaneIx {
        let bends = curve.bends(20.0);
        self.lanes.push(SynthLane {
            curve,
            width_m,
            kind,
            limit_mps,
            entries: Vec::new(),
            exits: Vec::new(),
            left: None,
            right: None,
            end: LaneEnd::Open,
            gate: None,
            connector: None,
            bends,
            crossings: Vec::new(),
        });
        self.lanes.len() - 1
    }

    pub fn connect(&mut self, from: LaneIx, to: LaneIx) {
        self.lanes[from].exits.push(to);
        self.lanes[to].entries.push(from);
    }

    /// Lanes on both sides of a reference line; traffic keeps to the right.
    pub fn add_road(&mut self, reference: Curve, profile: Profile) -> RoadLanes {
        let width = profile.lane_width_m;
        let place = |k: usize| 0.5 * profile.median_m + (k as f64 + 0.5) * width;
        let mut lay = |base: &Curve, count: usize| -> Vec<LaneIx> {
            (0..count).map(|k| self.add_lane(base.offset(-place(k)), width, profile.limit_mps, profile.kind)).collect()
        };
        let forward = lay(&reference, profile.forward);
        let backward = lay(&reference.reversed(), profile.backward);
        for side in [&forward, &backward] {
            for pair in side.windows(2) {
                self.lanes[pair[0]].right = Some((pair[1], true));
                self.lanes[pair[1]].left = Some((pair[0], true));
            }
        }
        if let (Some(&a), Some(&b)) = (forward.first(), backward.first())
            && profile.median_m == 0.0
        {
            self.lanes[a].left = Some((b, false));
            self.lanes[b].left = Some((a, false));
        }
        let road = RoadLanes { reference, profile, forward, backward };
        if profile.edges {
            self.edges.push(road.reference.line(-road.half_forward_m()));
            self.edges.push(road.reference.line(road.half_backward_m()));
        }
        if profile.median_m > 0.0 && profile.backward > 0 {
            self.edges.push(road.reference.line(0.5 * profile.median_m));
            self.edges.push(road.reference.line(-0.5 * profile.median_m));
        }
        road
    }

    /// Lanes where traffic enters the world.
    pub fn sources(&self) -> Vec<LaneIx> {
        (0..self.lanes.len()).filter(|&l| self.lanes[l].entries.is_empty()).collect()
    }

    /// The signal over a lane's gate, if there is one, with the lane's signal group.
    pub fn signal_of(&self, lane: LaneIx) -> Option<(&Signal, usize)> {
        let node = &self.nodes[self.lanes[lane].gate?.node];
        let group = node.connectors.iter().find(|c| c.origin == lane)?.group;
        Some((node.signal.as_ref()?, group))
    }
}
