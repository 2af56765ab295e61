//! A node: a place where paths cross, merge or split, with its connectors, their conflicts, and its signal.

use super::curve::Curve;
use super::network::Network;
use crate::scene::{LaneIx, LightState};

/// Centre lines closer than this are in conflict, metres: two half widths, the swing of a van's corner, and a margin.
const CLEARANCE_M: f64 = 3.0;

/// How two connectors meet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Meeting {
    Cross,
    /// They leave the same lane: the driver behind follows.
    Part,
    /// They end in the same lane.
    Join,
}

/// The stretch of one connector where another one is in conflict with it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Zone {
    pub meeting: Meeting,
    pub from_s: f64,
    pub to_s: f64,
}

/// One movement through a node.
#[derive(Clone, Debug)]
pub(super) struct Connector {
    pub lane: LaneIx,
    pub origin: LaneIx,
    /// 0 goes first; a higher rank yields to every lower one.
    pub rank: u8,
    /// Signal group.
    pub group: usize,
    pub stop_sign: bool,
}

#[derive(Clone, Debug, Default)]
pub(super) struct Node {
    pub connectors: Vec<Connector>,
    /// `zones[a][b]`: where `b` is in the way of `a`.
    pub zones: Vec<Vec<Option<Zone>>>,
    pub signal: Option<Signal>,
}

/// Two signal groups in turn, with fixed times.
#[derive(Clone, Copy, Debug)]
pub(super) struct Signal {
    pub offset_s: f64,
    pub green_s: [f64; 2],
    pub amber_s: f64,
    pub clearance_s: f64,
}

impl Signal {
    /// State of a group and the seconds until it changes.
    pub fn state(&self, group: usize, time_s: f64) -> (LightState, f64) {
        let block = |g: usize| self.green_s[g] + self.amber_s + self.clearance_s;
        let cycle = block(0) + block(1);
        let at = time_s + self.offset_s;
        let at = at - (at / cycle).floor() * cycle;
        let start = if group == 0 { 0.0 } else { block(0) };
        let since = if at >= start { at - start } else { at - start + cycle };
        let green = self.green_s[group.min(1)];
        if since < green {
            (LightState::Go, green - since)
        } else if since < green + self.amber_s {
            (LightState::Caution, green + self.amber_s - since)
        } else {
            (LightState::Stop, cycle - since)
        }
    }
}

impl Network {
    /// Registers lanes as the connectors of a new node and finds their conflicts.
    pub fn add_node(&mut self, connectors: Vec<Connector>, signal: Option<Signal>) -> usize {
        let node = self.nodes.len();
        for (k, connector) in connectors.iter().enumerate() {
            self.lanes[connector.lane].connector = Some((node, k));
        }
        let zones = connectors.iter().map(|a| connectors.iter().map(|b| self.zone(a, b)).collect()).collect();
        self.nodes.push(Node { connectors, zones, signal });
        node
    }

    fn zone(&self, a: &Connector, b: &Connector) -> Option<Zone> {
        if a.lane == b.lane {
            return None;
        }
        let (one, other) = (&self.lanes[a.lane], &self.lanes[b.lane]);
        let (from_s, to_s) = near_stretch(&one.curve, &other.curve)?;
        let meeting = if a.origin == b.origin {
            Meeting::Part
        } else if one.exits == other.exits {
            Meeting::Join
        } else {
            Meeting::Cross
        };
        Some(Zone { meeting, from_s, to_s })
    }
}

/// First and last arc length on `a` that lie within the clearance of `b`.
fn near_stretch(a: &Curve, b: &Curve) -> Option<(f64, f64)> {
    let count = (b.length_m() / 0.7).ceil() as usize;
    let others: Vec<_> = (0..=count).map(|k| b.at(b.length_m() * k as f64 / count as f64).position).collect();
    let steps = (a.length_m() / 0.5).ceil() as usize;
    let place = |k: usize| a.length_m() * k as f64 / steps as f64;
    let near = |k: &usize| {
        let here = a.at(place(*k)).position;
        others.iter().any(|p| (*p - here).norm_squared() < CLEARANCE_M * CLEARANCE_M)
    };
    let first = (0..=steps).find(near)?;
    let last = (0..=steps).rev().find(near)?;
    Some(((place(first) - 0.5).max(0.0), (place(last) + 0.5).min(a.length_m())))
}
