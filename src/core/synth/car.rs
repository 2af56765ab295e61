//! A driver on the road: its place on its lanes, the connectors that it may enter, and the resulting pose.

use super::driver::Driver;
use super::network::Network;
use super::variation::{Pedals, Weave};
use crate::kernel::{Stream, num};
use crate::scene::{LaneIx, Sample};

/// Distance that drivers look ahead, metres of lane.
pub(super) const SIGHT_M: f64 = 140.0;

/// Permission to use a connector.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pass {
    pub node: usize,
    pub connector: usize,
    /// Lower goes first wherever two are in conflict.
    pub turn: u64,
    /// Odometer where the connector starts.
    pub start_odo: f64,
}

/// A lane change under way: the offset from the new lane's centre fades over a distance.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shift {
    pub from_lane: LaneIx,
    pub offset_m: f64,
    pub start_odo: f64,
    pub length_m: f64,
}

impl Shift {
    /// Returns the offset, its slope by distance, and the share that is done.
    pub fn at(&self, odo: f64) -> (f64, f64, f64) {
        let t = ((odo - self.start_odo) / self.length_m).clamp(0.0, 1.0);
        let done = t * t * t * (10.0 + t * (-15.0 + 6.0 * t));
        let slope = 30.0 * t * t * (1.0 - t) * (1.0 - t) / self.length_m;
        (self.offset_m * (1.0 - done), -self.offset_m * slope, done)
    }
}

/// A driver on the road.
#[derive(Clone, Debug)]
pub(super) struct Car {
    pub number: usize,
    pub driver: Driver,
    /// Lanes from the current one on.
    pub path: Vec<LaneIx>,
    /// Arc length of the centre along `path[0]`.
    pub s: f64,
    pub speed: f64,
    pub acceleration: f64,
    /// Distance travelled along lane centres.
    pub odo: f64,
    pub shift: Option<Shift>,
    pub pedals: Option<Pedals>,
    pub weave: Option<Weave>,
    pub passes: Vec<Pass>,
    /// Lane at whose stop sign the car has stood.
    pub stood_at: Option<LaneIx>,
    pub change_after: f64,
    pub choice: Stream,
    pub gone: bool,
}

impl Car {
    pub fn half(&self) -> f64 {
        0.5 * self.driver.length_m
    }

    pub fn lane(&self) -> LaneIx {
        self.path[0]
    }

    /// The lane it is leaving, while it is still partly there.
    pub fn also_in(&self) -> Option<LaneIx> {
        let shift = self.shift?;
        (shift.at(self.odo).2 < 0.985).then_some(shift.from_lane)
    }

    /// Looks further along the path where it has become short.
    pub fn extend(&mut self, net: &Network) {
        let mut seen = -self.s + num::sum(self.path.iter().map(|&l| net.lanes[l].curve.length_m()));
        while seen < SIGHT_M + 20.0 {
            let exits = &net.lanes[self.path[self.path.len() - 1]].exits;
            let Some(&next) = self.choice.pick(exits) else { break };
            self.path.push(next);
            seen += net.lanes[next].curve.length_m();
        }
    }

    /// Returns the permission for connectors that lie completely behind.
    pub fn release(&mut self, net: &Network) {
        let rear = self.odo - self.half() - 0.5;
        self.passes.retain(|pass| {
            let lane = net.nodes[pass.node].connectors[pass.connector].lane;
            rear < pass.start_odo + net.lanes[lane].curve.length_m()
        });
    }

    /// Gives a car a new way ahead after a lane change.
    pub fn reroute(&mut self, net: &Network, lane: LaneIx) {
        self.path.clear();
        self.path.push(lane);
        self.extend(net);
    }

    /// Returns metres beside the lane's centre, to the left, and their slope by distance, without the part of a lane change.
    pub fn aside(&self) -> (f64, f64) {
        let (weave_m, slope) = self.weave.map_or((0.0, 0.0), |weave| weave.at(self.odo));
        (self.driver.bias_m + weave_m, slope)
    }

    pub fn sample(&self, net: &Network) -> Sample {
        let place = net.lanes[self.lane()].curve.at(self.s);
        let (mut offset, mut slope) = self.aside();
        if let Some(shift) = self.shift {
            let (at, rate, _) = shift.at(self.odo);
            (offset, slope) = (offset + at, slope + rate);
        }
        let along = crate::kernel::Vec2::from_heading(place.heading_rad);
        let stretch = 1.0 - place.curvature * offset;
        let direction = along * stretch + along.left() * slope;
        Sample {
            position: place.position + along.left() * offset,
            heading_rad: num::wrap_angle(direction.heading()),
            velocity: direction * self.speed,
        }
    }
}
