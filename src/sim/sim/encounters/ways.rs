//! Where somebody on a lane may go: along it and along the lanes that it leads to, as far beside the centre lines as now.

use crate::kernel::{Vec2, num};
use crate::scene::{LaneGraph, LaneIx};
use crate::sim::prepared::body::Place;

/// Who is farther from every lane of their direction follows none, metres.
const LANE_WITHIN_M: f64 = 2.0;
/// Ways that are followed, nearest lanes and first exits first.
const WAYS_MAX: usize = 24;

/// A way: lanes one behind the other.
pub(super) struct Way<'a> {
    lanes: &'a LaneGraph,
    /// Each with the arc length along the way at which it begins, metres; the first begins behind whoever is on it.
    parts: Vec<(LaneIx, f64)>,
    offset_m: f64,
}

impl Way<'_> {
    /// Where on the way somebody is that much farther on, metres; beyond the last lane straight on.
    pub fn after(&self, way_m: f64) -> Option<Place> {
        let (lane, start_m) = *self.parts.iter().rev().find(|(_, start_m)| *start_m <= way_m)?;
        let (s_m, length_m) = (way_m - start_m, self.lanes.length_m(lane));
        let pose = self.lanes.pose_at(lane, s_m.min(length_m))?;
        let (sine, cosine) = num::sin_cos(pose.heading_rad);
        let axis = Vec2::new(cosine, sine);
        let beyond_m = (s_m - length_m).max(0.0);
        Some(Place { position: pose.position + axis * beyond_m + axis.left() * self.offset_m, axis })
    }
}

/// The ways from a place, `reach_m` far. A lane that leads nowhere ends its way.
pub(super) fn ways<'a>(lanes: &'a LaneGraph, from: &Place, reach_m: f64) -> Vec<Way<'a>> {
    let mut open: Vec<Way<'a>> = lanes
        .lanes_near(from.position, from.axis.heading(), LANE_WITHIN_M)
        .into_iter()
        .map(|place| Way { lanes, parts: vec![(place.lane, -place.s_m)], offset_m: place.offset_m })
        .collect();
    let mut ways = Vec::new();
    while let Some(way) = open.pop() {
        if ways.len() == WAYS_MAX {
            break;
        }
        let Some(&(lane, start_m)) = way.parts.last() else { continue };
        let end_m = start_m + lanes.length_m(lane);
        // A circle of lanes is followed no farther than the reach, and lanes without length only once.
        let on = |next: &&LaneIx| !way.parts.iter().any(|(known, _)| known == *next);
        let next: Vec<LaneIx> =
            if end_m < reach_m { lanes.exits(lane).iter().filter(on).copied().collect() } else { Vec::new() };
        if next.is_empty() {
            ways.push(way);
            continue;
        }
        for lane in next.into_iter().rev() {
            let mut parts = way.parts.clone();
            parts.push((lane, end_m));
            open.push(Way { lanes, parts, offset_m: way.offset_m });
        }
    }
    ways
}
