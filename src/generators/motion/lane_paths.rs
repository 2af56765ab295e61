//! Paths that a vehicle may take from where it is: along every reachable lane, joined by a quintic in arc length that
//! starts with the vehicle's offset and heading and ends on the centre line; and arcs of constant turn off the lanes.

use crate::kernel::{Vec2, num};
use crate::scene::{LaneGraph, LaneIx, Reached, Sample};

/// Distance between two points of a path, metres.
const SPACING_M: f64 = 2.0;
/// Shortest way over which a vehicle moves onto a centre line, metres.
const BLEND_M_MIN: f64 = 15.0;
/// Time over which it does so when driving, seconds.
const BLEND_S: f64 = 3.0;
/// A vehicle farther than this from every lane has no lane paths, metres.
const LANE_WITHIN_M: f64 = 5.0;
/// A lane change in the middle of a way skips this much of the new lane, metres.
const CHANGE_M: f64 = 20.0;
/// At most this many lanes are followed, nearest in lane changes first.
const LANES_MAX: usize = 48;
/// Yaw rates of off-lane arcs, rad/s.
const ARC_RATES: [f64; 7] = [-0.4, -0.2, -0.1, 0.0, 0.1, 0.2, 0.4];
/// Largest change of heading along an arc, radians; straight on after it.
const ARC_TURN_MAX_RAD: f64 = 1.5;
/// Heading differences beyond this are cut before they enter the quintic, radians.
const SLOPE_MAX_RAD: f64 = 0.6;

/// A possible path, as evenly spaced points from the vehicle's place.
#[derive(Clone, Debug, PartialEq)]
pub struct LanePath {
    points: Vec<Vec2>,
    /// Unit direction of each piece.
    directions: Vec<Vec2>,
    lengths: Vec<f64>,
    /// Range of arc lengths in which goals belong to this path and to no other, metres.
    pub goals_m: (f64, f64),
    /// Lane changes on the way.
    pub lane_changes: usize,
    /// How far the goal lane lies beside the vehicle's own lane, metres; `None` for arcs.
    pub sideways_m: Option<f64>,
    /// The lane that the path ends in; `None` for arcs.
    pub lane: Option<LaneIx>,
    /// Largest curvature up to each point, 1/m.
    curvature_max: Vec<f64>,
}

impl LanePath {
    fn new(points: Vec<Vec2>, goals_m: (f64, f64), lane_changes: usize, sideways_m: Option<f64>) -> Option<LanePath> {
        let mut kept: Vec<Vec2> = Vec::with_capacity(points.len());
        for point in points {
            if point.is_finite() && kept.last().is_none_or(|last| last.distance(point) > 1e-3) {
                kept.push(point);
            }
        }
        if kept.len() < 2 {
            return None;
        }
        let mut lengths = vec![0.0];
        let mut directions = Vec::with_capacity(kept.len());
        let mut curvature_max = vec![0.0];
        for pair in kept.windows(2) {
            let step = pair[1] - pair[0];
            let length = step.norm();
            let direction = step * (1.0 / length);
            let bend = directions.last().map_or(0.0, |last: &Vec2| last.cross(direction).abs() / length);
            let largest: f64 = curvature_max[curvature_max.len() - 1];
            curvature_max.push(largest.max(bend));
            lengths.push(lengths[lengths.len() - 1] + length);
            directions.push(direction);
        }
        Some(LanePath {
            points: kept,
            directions,
            lengths,
            goals_m,
            lane_changes,
            sideways_m,
            lane: None,
            curvature_max,
        })
    }

    fn piece(&self, s_m: f64) -> usize {
        self.lengths.partition_point(|&l| l <= s_m).clamp(1, self.points.len() - 1) - 1
    }

    /// Point at an arc length; runs straight on beyond the end.
    pub fn at(&self, s_m: f64) -> Vec2 {
        self.on_piece(self.piece(s_m), s_m)
    }

    fn on_piece(&self, i: usize, s_m: f64) -> Vec2 {
        self.points[i] + self.directions[i] * (s_m - self.lengths[i])
    }

    /// Unit direction at an arc length, turning evenly from piece to piece.
    #[cfg(test)]
    fn direction(&self, s_m: f64) -> Vec2 {
        self.direction_on(self.piece(s_m), s_m)
    }

    fn direction_on(&self, i: usize, s_m: f64) -> Vec2 {
        let share = ((s_m - self.lengths[i]) / (self.lengths[i + 1] - self.lengths[i])).clamp(0.0, 1.0);
        // In the middle of a piece it is the piece's direction, at its ends the mean with the neighbour's.
        let (other, weight) = if share < 0.5 {
            (self.directions[i.saturating_sub(1)], 0.5 - share)
        } else {
            (self.directions[(i + 1).min(self.directions.len() - 1)], share - 0.5)
        };
        let mixed = self.directions[i].lerp(other, weight);
        let norm = mixed.norm();
        if norm > 1e-9 { mixed * (1.0 / norm) } else { self.directions[i] }
    }

    /// Point and unit direction, which turns evenly from piece to piece, at arc lengths that mostly rise: `near` is the piece of the last one, 0 at
    /// first.
    pub fn place(&self, s_m: f64, near: &mut usize) -> (Vec2, Vec2) {
        if s_m < self.lengths[*near] {
            *near = self.piece(s_m);
        }
        while *near + 2 < self.lengths.len() && self.lengths[*near + 1] <= s_m {
            *near += 1;
        }
        (self.on_piece(*near, s_m), self.direction_on(*near, s_m))
    }

    /// Largest curvature up to an arc length, 1/m.
    pub fn curvature_max(&self, s_m: f64) -> f64 {
        self.curvature_max[(self.piece(s_m) + 1).min(self.curvature_max.len() - 1)]
    }
}

/// All possible paths of a vehicle within `reach_m`.
pub fn paths(lanes: &LaneGraph, anchor: &Sample, reach_m: f64) -> Vec<LanePath> {
    let mut paths = Vec::new();
    if let Some(own) = lanes.nearest_lane(anchor.position, anchor.heading_rad, LANE_WITHIN_M) {
        let reached = lanes.reachable(own.lane, own.s_m, reach_m);
        let reached = &reached[..reached.len().min(LANES_MAX)];
        for target in reached {
            paths.extend(lane_path(lanes, anchor, reached, target, own.offset_m, reach_m));
        }
    }
    paths.extend(ARC_RATES.iter().filter_map(|rate| arc(anchor, *rate, reach_m)));
    paths
}

/// The lanes that lead to a target: a lane that is left sideways at the very start does not count.
fn chain(reached: &[Reached], target: &Reached, lanes: &LaneGraph) -> Vec<(usize, bool)> {
    let mut chain = vec![];
    let mut next = Some(*target);
    while let Some(current) = next {
        let aside = current.via.is_some_and(|via| !lanes.exits(via).contains(&current.lane));
        chain.push((current.lane, aside));
        next = current.via.and_then(|via| reached.iter().find(|r| r.lane == via)).copied();
        if chain.len() > reached.len() {
            break;
        }
    }
    chain.reverse();
    let start = chain.iter().skip(1).take_while(|(_, aside)| *aside).count();
    chain.split_off(start.min(chain.len().saturating_sub(1)))
}

fn lane_path(
    lanes: &LaneGraph,
    anchor: &Sample,
    reached: &[Reached],
    target: &Reached,
    own_offset_m: f64,
    reach_m: f64,
) -> Option<LanePath> {
    let chain = chain(reached, target, lanes);
    let first = lanes.place_in(chain.first()?.0, anchor.position)?;
    let mut reference = vec![lanes.pose_at(first.lane, first.s_m)?.position];
    for (index, (lane, aside)) in chain.iter().enumerate() {
        let centre = lanes.centre(*lane)?;
        let skipped = match (index, aside) {
            (0, _) => first.s_m,
            (_, true) => CHANGE_M.min(0.5 * centre.length_m()),
            (_, false) => 0.0,
        };
        let from = centre.lengths().partition_point(|&l| l <= skipped + 0.5);
        reference.extend_from_slice(&centre.points()[from..]);
    }
    let sideways_m = (first.offset_m - own_offset_m).abs();
    let line = crate::kernel::Polyline::new(reference).ok()?;
    let blend_m = (BLEND_S * anchor.speed_mps()).max(BLEND_M_MIN);
    let slope = num::tan(num::wrap_angle(anchor.heading_rad - first.heading_rad).clamp(-SLOPE_MAX_RAD, SLOPE_MAX_RAD));
    let length_m = line.length_m().min(reach_m);
    let count = (length_m / SPACING_M).ceil().max(1.0) as usize;
    let point = |k: usize| {
        let s = length_m * k as f64 / count as f64;
        let side = quintic_offset(first.offset_m, slope, (s / blend_m).min(1.0), blend_m);
        let along = Vec2::from_heading(line.heading_at(s));
        line.at(s) + along.left() * side
    };
    let points: Vec<Vec2> = std::iter::once(anchor.position).chain((1..=count).map(point)).collect();
    let from_m = target.start_m.max(0.0);
    let to_m = (target.start_m + lanes.length_m(target.lane)).min(reach_m);
    let path = LanePath::new(points, (from_m, to_m), target.lane_changes, Some(sideways_m))?;
    Some(LanePath { lane: Some(target.lane), ..path })
}

/// Offset from the centre line at a share of the blend: given offset and slope at 0, all derivatives 0 at 1.
fn quintic_offset(offset_m: f64, slope: f64, share: f64, blend_m: f64) -> f64 {
    let (u, u3) = (share, share * share * share);
    let from_offset = 1.0 - u3 * (10.0 - 15.0 * u + 6.0 * u * u);
    let from_slope = u - u3 * (6.0 - 8.0 * u + 3.0 * u * u);
    offset_m * from_offset + slope * blend_m * from_slope
}

fn arc(anchor: &Sample, rate: f64, reach_m: f64) -> Option<LanePath> {
    let curvature = rate / anchor.speed_mps().max(4.0);
    let count = (reach_m / SPACING_M).ceil().clamp(1.0, 200.0) as usize;
    let mut heading = anchor.heading_rad;
    let mut position = anchor.position;
    let mut points = vec![position];
    for _ in 0..count {
        if (heading - anchor.heading_rad).abs() < ARC_TURN_MAX_RAD {
            heading += curvature * SPACING_M;
        }
        position = position + Vec2::from_heading(heading) * SPACING_M;
        points.push(position);
    }
    LanePath::new(points, (0.0, reach_m), 0, None)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_along_a_way_are_those_of_a_search_for_each() {
        let curve = |k: i32| Vec2::from_heading(0.02 * f64::from(k * k)) * 7.0 + Vec2::new(3.0 * f64::from(k), 0.0);
        let path = LanePath::new((0..12).map(curve).collect(), (0.0, 30.0), 0, None).unwrap();
        let length_m = path.lengths[path.lengths.len() - 1];
        // Forward, standing, back, at the very points, and beyond both ends.
        let at = |k: usize| length_m * k as f64 / 90.0;
        let forward = (0..100).map(at).chain((0..9).map(|_| at(40))).chain((0..60).rev().map(at));
        let all = forward.chain(path.lengths.clone()).chain([-2.0, 0.0, length_m, length_m + 9.0]);
        let mut near = 0;
        for s_m in all {
            let (point, direction) = path.place(s_m, &mut near);
            assert_eq!((point, direction), (path.at(s_m), path.direction(s_m)), "{s_m}");
        }
    }

    #[test]
    fn the_joining_curve_has_the_ends_asked_for() {
        assert_eq!(quintic_offset(2.0, 0.1, 0.0, 20.0), 2.0);
        assert!(quintic_offset(2.0, 0.1, 1.0, 20.0).abs() < 1e-12);
        let slope = (quintic_offset(2.0, 0.1, 1e-6, 20.0) - 2.0) / (1e-6 * 20.0);
        assert!((slope - 0.1).abs() < 1e-4, "{slope}");
        let end = quintic_offset(2.0, 0.1, 1.0 - 1e-4, 20.0) / (1e-4 * 20.0);
        assert!(end.abs() < 1e-4, "{end}");
    }
}
