//! Road data for SafeBench's criteria in a staged scene: driving lanes, painted lines, and stop lines.
//! Prepared once for each scene.

use std::sync::Arc;

use crate::kernel::{Extent, Vec2};
use crate::scene::pieces::Pieces;
use crate::scene::{Lane, LaneKind, Road, Scene};

use super::drivable::Drivable;
use super::path::Path;
use super::segment::Segment;

/// Distance from the box around the route beyond which lines are left out, metres.
const NEAR_M: f64 = 40.0;
/// Largest distance from the route of a valid stop sign's place or of the end of its lane, metres.
const SIGN_OFFSET_M: f64 = 2.0;

/// The road under SafeBench's criteria.
#[derive(Clone, Debug)]
pub(in crate::sim) struct Course {
    /// Streets and freeways; no shoulders, no sidewalks.
    pub driving: Drivable,
    marks: Vec<Segment>,
    /// Arc lengths of the stop lines of stop signs on the route, metres.
    pub stop_lines_s_m: Vec<f64>,
}

impl Course {
    pub fn new(scene: &Scene, route: &Path) -> Course {
        let lanes: Vec<&Lane> = scene.road.lanes.iter().filter(|l| is_driven(l)).collect();
        let around = Extent::around(route.points().iter().copied()).grown(NEAR_M);
        // Inside junctions no lines are painted.
        let marked = lanes.iter().filter(|lane| !is_connector(lane, &scene.road));
        let lines = marked.flat_map(|lane| [&lane.left, &lane.right]);
        let pieces = lines.flat_map(|line| line.windows(2).map(|w| Segment::new(w[0], w[1])));
        let marks = pieces.filter(|m| m.meets(&around)).collect();
        let mut stop_lines_s_m: Vec<f64> = scene.stop_signs.iter().flat_map(|s| stop_line(scene, s, route)).collect();
        stop_lines_s_m.sort_by(f64::total_cmp);
        // One sign may name several lanes of one approach.
        stop_lines_s_m.dedup_by(|b, a| *b - *a < SIGN_OFFSET_M);
        Course { driving: Drivable::of(Arc::new(Pieces::of_lanes(&scene.road, is_driven))), marks, stop_lines_s_m }
    }

    /// Returns `true` if the way from one place to another crosses a painted line.
    pub fn crosses_mark(&self, from: Vec2, to: Vec2) -> bool {
        let step = Segment::new(from, to);
        self.marks.iter().any(|mark| mark.is_crossed(&step))
    }
}

fn is_driven(lane: &Lane) -> bool {
    matches!(lane.kind, LaneKind::Street | LaneKind::Freeway)
}

/// A lane that is one of several ways on from a lane, or one of several ways into one.
fn is_connector(lane: &Lane, road: &Road) -> bool {
    let several = |links: &[usize], of: fn(&Lane) -> &[usize]| {
        links.iter().filter_map(|&ix| road.lanes.get(ix)).any(|other| of(other).len() > 1)
    };
    several(&lane.entries, |l| &l.exits) || several(&lane.exits, |l| &l.entries)
}

fn stop_line(scene: &Scene, sign: &crate::scene::StopSign, route: &Path) -> Option<f64> {
    let ends = sign.lanes.iter().filter_map(|&ix| scene.road.lanes.get(ix)?.centre.last().copied());
    std::iter::once(sign.position).chain(ends).find_map(|place| {
        let at = route.project(place);
        let on_route = at.offset_m.abs() <= SIGN_OFFSET_M && at.s_m >= 0.0 && at.s_m <= route.length_m();
        on_route.then_some(at.s_m)
    })
}
