//! Ways open to a road user on a lane: along it and along the lanes that it leads to, as far beside the centre lines as now.

use crate::kernel::{Vec2, num};
use crate::scene::{LaneGraph, LaneIx};
use crate::sim::prepared::body::Place;

/// Distance from every lane of its direction beyond which a road user follows none, metres.
const LANE_WITHIN_M: f64 = 2.0;

/// A lane on a road user's way.
pub(super) struct Ahead<'a> {
    lanes: &'a LaneGraph,
    lane: LaneIx,
    /// Distance to the lane's beginning, metres; negative for the lane that it is on.
    start_m: f64,
    offset_m: f64,
}

impl Ahead<'_> {
    /// Returns the place on this lane that much farther on, metres; straight on beyond a lane that leads nowhere.
    pub fn after(&self, way_m: f64) -> Option<Place> {
        let (s_m, length_m) = (way_m - self.start_m, self.lanes.length_m(self.lane));
        let beyond_m = (s_m - length_m).max(0.0);
        if s_m < 0.0 || beyond_m > 0.0 && !self.lanes.exits(self.lane).is_empty() {
            return None;
        }
        let pose = self.lanes.pose_at(self.lane, s_m.min(length_m))?;
        let (sine, cosine) = num::sin_cos(pose.heading_rad);
        let axis = Vec2::new(cosine, sine);
        Some(Place { position: pose.position + axis * beyond_m + axis.left() * self.offset_m, axis })
    }
}

/// Returns the lanes that a road user reaches within `reach_m` without a lane change, from every lane that it may be on.
pub(super) fn ahead<'a>(lanes: &'a LaneGraph, from: &Place, reach_m: f64) -> Vec<Ahead<'a>> {
    let mut all = Vec::new();
    for place in lanes.lanes_near(from.position, from.axis.heading(), LANE_WITHIN_M) {
        let reached = lanes.reachable(place.lane, place.s_m, reach_m);
        let straight_on = reached.into_iter().filter(|of| of.lane_changes == 0);
        all.extend(straight_on.map(|of| Ahead { lanes, lane: of.lane, start_m: of.start_m, offset_m: place.offset_m }));
    }
    all
}
