//! The way along which proposals are made: the scene's route, and beyond its end the lanes that go straightest on.

use crate::kernel::{Polyline, Vec2, num};
use crate::scene::{LaneGraph, LaneIx};
use crate::sim::Plant;

/// Spacing of its points, metres.
const SPACING_M: f64 = 1.0;
/// Length beyond the route's end, so that nobody brakes for it, metres: an ego that arrives is done.
const BEYOND_M: f64 = 120.0;
/// Largest distance at which the lane of a place of the route is looked for, metres.
const LANE_WITHIN_M: f64 = 3.0;

/// A line with a heading at each point, between which it is interpolated.
#[derive(Clone, Debug)]
pub struct Centreline {
    line: Polyline,
    /// Unwrapped, radians. `[points]`
    headings_rad: Vec<f64>,
}

/// A place and a heading of the line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// Metres.
    pub position: Vec2,
    /// Radians, not wrapped.
    pub heading_rad: f64,
}

impl Centreline {
    /// Through points; `None` where no two of them differ.
    fn through(points: Vec<Vec2>) -> Option<Centreline> {
        let line = Polyline::new(points).ok()?.resampled(SPACING_M);
        let last = line.points().len() - 2;
        let mut headings_rad: Vec<f64> = Vec::with_capacity(last + 2);
        for k in 0..=last + 1 {
            // Between two segments the heading is the mean of both.
            let (before, after) = (line.segment_heading(k.saturating_sub(1)), line.segment_heading(k.min(last)));
            let heading = before + 0.5 * num::wrap_angle(after - before);
            let known = headings_rad.last().copied().unwrap_or(heading);
            headings_rad.push(known + num::wrap_angle(heading - known));
        }
        Some(Centreline { line, headings_rad })
    }

    /// That of a scene.
    pub fn of(plant: &Plant) -> Option<Centreline> {
        let mut points = plant.route().points().to_vec();
        points.extend(beyond(plant.lanes(), &points));
        Centreline::through(points)
    }

    /// The same line, this far to its left, metres. Headings stay.
    pub fn beside(&self, offset_m: f64) -> Centreline {
        let beside = |(point, heading): (&Vec2, &f64)| *point + Vec2::from_heading(*heading).left() * offset_m;
        let points: Vec<Vec2> = self.line.points().iter().zip(&self.headings_rad).map(beside).collect();
        match Polyline::new(points) {
            Ok(line) if line.points().len() == self.headings_rad.len() => {
                Centreline { line, headings_rad: self.headings_rad.clone() }
            }
            // Two points met in a bend: the line has lost one.
            _ => self.clone(),
        }
    }

    /// From its first point to its last, metres.
    pub fn length_m(&self) -> f64 {
        self.line.length_m()
    }

    /// The pose at an arc length, which is held at both ends.
    pub fn at(&self, s_m: f64) -> Pose {
        let s_m = s_m.clamp(1e-5, self.length_m());
        let k = self.line.segment_at(s_m);
        let (from, to) = (self.line.lengths()[k], self.line.lengths()[k + 1]);
        let share = (s_m - from) / (to - from);
        let position = self.line.points()[k].lerp(self.line.points()[k + 1], share);
        Pose { position, heading_rad: self.headings_rad[k] + share * (self.headings_rad[k + 1] - self.headings_rad[k]) }
    }

    /// Arc length of the nearest place, metres, and the distance to it.
    pub fn project(&self, point: Vec2) -> (f64, f64) {
        let near = self.line.project(point);
        (near.s_m, near.offset_m.abs())
    }

    /// Its points between two arc lengths, both of these included.
    pub fn between(&self, from_m: f64, to_m: f64) -> Vec<Vec2> {
        let inner =
            self.line.lengths().iter().zip(self.line.points()).filter(|(s_m, _)| **s_m > from_m && **s_m < to_m);
        let mut points = vec![self.at(from_m).position];
        points.extend(inner.map(|(_, point)| *point));
        points.push(self.at(to_m).position);
        points
    }
}

/// Points behind the end of a route: along the lane of its end, and of its exits the one that turns least; straight on where no lane
/// goes on.
fn beyond(lanes: &LaneGraph, route: &[Vec2]) -> Vec<Vec2> {
    let [.., before, end] = route else { return Vec::new() };
    let mut heading_rad = (*end - *before).heading();
    let (mut points, mut left_m, mut at) = (Vec::new(), BEYOND_M, *end);
    let mut lane = lanes.nearest_lane(*end, heading_rad, LANE_WITHIN_M).map(|place| (place.lane, place.s_m));
    while let Some((ix, from_m)) = lane.filter(|_| left_m > 0.0) {
        let Some(centre) = lanes.centre(ix) else { break };
        let mut s_m = from_m + SPACING_M;
        while s_m <= centre.length_m() && left_m > 0.0 {
            let point = centre.at(s_m);
            left_m -= (point - at).norm();
            heading_rad = centre.heading_at(s_m);
            points.push(point);
            at = point;
            s_m += SPACING_M;
        }
        lane = straightest(lanes, ix, heading_rad).map(|next| (next, 0.0));
        // A lane shorter than a step adds no point: it must not be walked for ever.
        left_m -= 1e-3 + 1e-2 * f64::from(lane.is_some());
    }
    if left_m > 0.0 {
        points.push(at + Vec2::from_heading(heading_rad) * left_m);
    }
    points
}

fn straightest(lanes: &LaneGraph, lane: LaneIx, heading_rad: f64) -> Option<LaneIx> {
    let turn = |exit: LaneIx| {
        let centre = lanes.centre(exit)?;
        Some((num::wrap_angle(centre.heading_at(0.5 * centre.length_m().min(20.0)) - heading_rad).abs(), exit))
    };
    let best = |a: (f64, LaneIx), b: (f64, LaneIx)| if b.0 < a.0 { b } else { a };
    lanes.exits(lane).iter().filter_map(|exit| turn(*exit)).reduce(best).map(|(_, exit)| exit)
}

/// The lanes of the route: those along which it leads, and their neighbours of the same direction. `[lanes]`; empty where it
/// meets none.
pub fn route_lanes(plant: &Plant, centreline: &Centreline) -> Vec<bool> {
    let lanes = plant.lanes();
    let mut on_route = vec![false; lanes.lane_count()];
    let mut s_m = 0.0;
    while s_m <= centreline.length_m() {
        let pose = centreline.at(s_m);
        let place = lanes.nearest_lane(pose.position, num::wrap_angle(pose.heading_rad), LANE_WITHIN_M);
        if let Some(lane) = place.map(|place| place.lane).filter(|lane| !on_route[*lane]) {
            on_route[lane] = true;
            for beside in lanes.beside(lane) {
                on_route[beside] = true;
            }
        }
        s_m += SPACING_M;
    }
    if on_route.contains(&true) { on_route } else { Vec::new() }
}
