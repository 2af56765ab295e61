//! The road of a generated network, as scenes hold it.

use super::network::{Network, SynthLane};
use crate::kernel::num;
use crate::scene::{Lane, LaneIx, Neighbour, Road};

/// Its lanes, in the order of the network, and its edges.
pub(super) fn road(net: &Network) -> Road {
    let lane = |(i, lane): (usize, &SynthLane)| {
        let half = 0.5 * lane.width_m;
        let beside = |n: Option<(LaneIx, bool)>| {
            n.map(|(lane, same_direction)| Neighbour { lane, same_direction }).into_iter().collect()
        };
        Lane {
            id: i.to_string(),
            kind: lane.kind,
            centre: lane.curve.points.clone(),
            left: lane.curve.line(half),
            right: lane.curve.line(-half),
            entries: lane.entries.clone(),
            exits: lane.exits.clone(),
            left_neighbours: beside(lane.left),
            right_neighbours: beside(lane.right),
            speed_limit_mps: Some(num::rounded(lane.limit_mps, 3)),
        }
    };
    Road { lanes: net.lanes.iter().enumerate().map(lane).collect(), edges: net.edges.clone() }
}
