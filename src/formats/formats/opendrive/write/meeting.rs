//! Gives lanes that follow each other one cross section, because roads would otherwise have gaps where they turn and
//! steps where their widths differ. Lanes that begin elsewhere than the lane before them ends are not linked.

use std::collections::BTreeMap;

use super::curve::{HALF_WIDTH_M_MIN, SAME_PLACE_M, Station};
use crate::kernel::{Vec2, num};
use crate::scene::{Lane, LaneIx, Road};

/// Lane ends at most this far from their middle are joined there, metres.
const MEET_M: f64 = 0.5;
/// A lane comes from its own width to that of the joint within this distance, metres.
const TAPER_M: f64 = 5.0;
/// Widths that differ by less need no such stretch, metres.
const SAME_WIDTH_M: f64 = 0.01;

/// A lane, and whether its end is meant or its start.
type End = (LaneIx, bool);

/// Links between lanes that meet, and those that do not.
pub(super) struct Met {
    pub links: Vec<(LaneIx, LaneIx)>,
    pub apart: Vec<(LaneIx, LaneIx)>,
}

/// Gives lanes that follow each other one cross section where they meet: place, heading and half widths. A link to a lane
/// that begins too far away or turns too sharply is not taken.
pub(super) fn meet(road: &Road, links: &[(LaneIx, LaneIx)], stations: &mut [Option<Vec<Station>>]) -> Met {
    let (joints, mut met) = joints(road.lanes.len(), links, stations);
    for members in &joints {
        let Some((point, ahead)) = joint(members, stations) else { continue };
        let left_m = half_m(road, members, |lane| &lane.left, |corner| (corner - point).dot(ahead.left()));
        let right_m = half_m(road, members, |lane| &lane.right, |corner| (point - corner).dot(ahead.left()));
        let joined = Station { point, heading_rad: ahead.heading(), left_m, right_m, s_m: 0.0 };
        for &(lane, end) in members {
            if let Some(stations) = stations[lane].as_mut() {
                move_end(stations, end, joined);
            }
        }
    }
    // A lane of centimetres between two joints may have no length any more.
    for of in stations.iter_mut() {
        if of.as_ref().is_some_and(|of| of.len() == 2 && of[0].point.distance(of[1].point) <= SAME_PLACE_M) {
            *of = None;
        }
    }
    met.links.retain(|(from, to)| stations[*from].is_some() && stations[*to].is_some());
    met
}

/// Ends and starts that are one place: nearest pairs first, as long as all of a place lie within reach of their middle.
fn joints(lanes: usize, links: &[(LaneIx, LaneIx)], stations: &[Option<Vec<Station>>]) -> (Vec<Vec<End>>, Met) {
    let gap_m = |&(from, to): &(LaneIx, LaneIx)| {
        let ends = (station_at(stations, from, true), station_at(stations, to, false));
        if let (Some(a), Some(b)) = ends { a.point.distance(b.point) } else { f64::INFINITY }
    };
    let mut order: Vec<(f64, usize)> = links.iter().enumerate().map(|(ix, link)| (gap_m(link), ix)).collect();
    order.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let mut groups = Groups::new(2 * lanes);
    let mut members: BTreeMap<usize, Vec<End>> = BTreeMap::new();
    let mut meets = vec![false; links.len()];
    for (_, ix) in order {
        let (from, to) = links[ix];
        let (a, b) = (groups.of(2 * from + 1), groups.of(2 * to));
        let of = |group: usize, end: End| members.get(&group).cloned().unwrap_or_else(|| vec![end]);
        let mut both = of(a, (from, true));
        if a != b {
            both.extend(of(b, (to, false)));
        }
        if joint(&both, stations).is_some() {
            groups.unite(a, b);
            members.remove(&a);
            members.remove(&b);
            both.sort_unstable();
            members.insert(groups.of(a), both);
            meets[ix] = true;
        }
    }
    let those =
        |wanted: bool| links.iter().zip(&meets).filter(move |(_, meets)| **meets == wanted).map(|(link, _)| *link);
    (members.into_values().collect(), Met { links: those(true).collect(), apart: those(false).collect() })
}

/// The middle of ends that lie close together and look the same way, and that way, of length 1.
fn joint(members: &[End], stations: &[Option<Vec<Station>>]) -> Option<(Vec2, Vec2)> {
    let here: Vec<Station> =
        members.iter().map(|&(lane, end)| station_at(stations, lane, end)).collect::<Option<_>>()?;
    let share = 1.0 / here.len() as f64;
    let point = here.iter().fold(Vec2::ZERO, |sum, s| sum + s.point * share);
    let ahead = here.iter().fold(Vec2::ZERO, |sum, s| sum + Vec2::from_heading(s.heading_rad));
    let near = here.iter().all(|s| s.point.distance(point) <= MEET_M);
    (near && ahead.norm() >= 0.5 * here.len() as f64).then(|| (point, ahead * (1.0 / ahead.norm())))
}

/// Mean distance from a joint to the boundaries of its lanes on one side.
fn half_m(road: &Road, members: &[End], side: fn(&Lane) -> &Vec<Vec2>, away_m: impl Fn(Vec2) -> f64) -> f64 {
    let of = |&(lane, end): &End| {
        let line = side(&road.lanes[lane]);
        away_m(if end { line[line.len() - 1] } else { line[0] }).max(HALF_WIDTH_M_MIN)
    };
    num::mean(&members.iter().map(of).collect::<Vec<f64>>()).unwrap_or(HALF_WIDTH_M_MIN)
}

/// Moves an end of a lane into a joint; its own width begins a little further on.
fn move_end(stations: &mut Vec<Station>, end: bool, joined: Station) {
    make_room(stations, end, joined.point);
    let (at, beside) = if end { (stations.len() - 1, stations.len() - 2) } else { (0, 1) };
    let (own, next) = (stations[at], stations[beside]);
    stations[at] = joined;
    let differs = (own.left_m - joined.left_m).abs().max((own.right_m - joined.right_m).abs()) > SAME_WIDTH_M;
    let run = own.point.distance(next.point);
    if !differs || run <= 2.0 * TAPER_M {
        return;
    }
    let share = TAPER_M / run;
    let way = if end { own.point - next.point } else { next.point - own.point };
    let taper = Station {
        point: own.point.lerp(next.point, share),
        heading_rad: way.heading(),
        left_m: own.left_m + share * (next.left_m - own.left_m),
        right_m: own.right_m + share * (next.right_m - own.right_m),
        s_m: 0.0,
    };
    stations.insert(at.max(beside), taper);
}

/// Drops points that a lane end would pass or almost reach when it moves.
fn make_room(stations: &mut Vec<Station>, end: bool, point: Vec2) {
    while stations.len() > 2 {
        let (at, beside) = if end { (stations.len() - 1, stations.len() - 2) } else { (0, 1) };
        let moved = stations[at].point.distance(point);
        if stations[at].point.distance(stations[beside].point) > 2.0 * moved {
            return;
        }
        stations.remove(beside);
    }
}

fn station_at(stations: &[Option<Vec<Station>>], lane: LaneIx, end: bool) -> Option<Station> {
    let of = stations[lane].as_ref()?;
    if end { of.last().copied() } else { of.first().copied() }
}

/// Disjoint sets of lane ends (odd) and starts (even).
pub(super) struct Groups(Vec<usize>);

impl Groups {
    pub fn new(count: usize) -> Groups {
        Groups((0..count).collect())
    }

    pub fn of(&mut self, mut item: usize) -> usize {
        while self.0[item] != item {
            self.0[item] = self.0[self.0[item]];
            item = self.0[item];
        }
        item
    }

    pub fn unite(&mut self, a: usize, b: usize) {
        let (a, b) = (self.of(a), self.of(b));
        let (low, high) = (a.min(b), a.max(b));
        self.0[high] = low;
    }
}

#[cfg(test)]
mod tests {
    use super::super::curve::stations_of;
    use super::*;
    use crate::scene::LaneKind;

    fn lane(from: (f64, f64), to: (f64, f64), half_m: f64) -> Lane {
        let (from, to) = (Vec2::new(from.0, from.1), Vec2::new(to.0, to.1));
        let aside = Vec2::from_heading((to - from).heading()).left() * half_m;
        Lane {
            id: String::new(),
            kind: LaneKind::Street,
            centre: vec![from, to],
            left: vec![from + aside, to + aside],
            right: vec![from - aside, to - aside],
            entries: vec![],
            exits: vec![],
            left_neighbours: vec![],
            right_neighbours: vec![],
            speed_limit_mps: None,
        }
    }

    #[test]
    fn lanes_of_two_widths_meet_in_one_cross_section_and_one_elsewhere_is_not_linked() {
        let lanes = vec![
            lane((0.0, 0.0), (50.0, 0.0), 1.75),
            lane((50.2, 0.1), (90.0, 0.1), 3.0),
            lane((50.0, 3.5), (90.0, 3.5), 1.75),
            lane((50.0, 0.0), (10.0, 0.0), 1.75),
        ];
        let mut stations: Vec<_> = lanes.iter().map(stations_of).collect();
        let road = Road { lanes, edges: vec![] };
        let met = meet(&road, &[(0, 1), (0, 2), (0, 3)], &mut stations);
        assert_eq!((met.links, met.apart), (vec![(0, 1)], vec![(0, 2), (0, 3)]));
        let (before, after) = (stations[0].as_ref().unwrap(), stations[1].as_ref().unwrap());
        let (end, start) = (before[before.len() - 1], after[0]);
        assert_eq!(end, start);
        assert!((end.left_m + end.right_m - 4.75).abs() < 0.1, "the mean width: {end:?}");
        let (own, taper) = (before[0], before[before.len() - 2]);
        assert!((own.left_m - 1.75).abs() < 1e-9 && (taper.left_m - 1.75).abs() < 1e-9, "its own width before");
        assert!((taper.point.x - 45.0).abs() < 1e-9, "{taper:?}");
    }

    #[test]
    fn a_lane_that_a_joint_takes_up_is_no_road() {
        let lanes = vec![
            lane((0.0, 0.0), (50.0, 0.0), 1.75),
            lane((50.0, 0.0), (50.0015, 0.0), 1.75),
            lane((50.0, 0.0), (90.0, 0.0), 1.75),
        ];
        let mut stations: Vec<_> = lanes.iter().map(stations_of).collect();
        let met = meet(&Road { lanes, edges: vec![] }, &[(0, 1), (1, 2)], &mut stations);
        assert!(met.links.is_empty() && stations[1].is_none());
    }
}
