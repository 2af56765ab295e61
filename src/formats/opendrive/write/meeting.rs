//! Gives lanes that follow each other one cross section, because roads would otherwise have gaps of centimetres where
//! they turn.

use std::collections::{BTreeMap, BTreeSet};

use super::curve::{HALF_WIDTH_M_MIN, Station};
use crate::kernel::{Vec2, num};
use crate::scene::{Lane, LaneIx, Road};

/// Lane ends at most this far apart are joined in one point, metres.
const MEET_M: f64 = 0.5;
/// A gap between following lanes that is worth a note, metres.
const GAP_M: f64 = 0.01;

/// Gives lanes that follow each other one cross section where they meet: place, heading and half widths. Returns the
/// pairs that lie too far apart for that.
pub(super) fn meet(
    road: &Road,
    links: &[(LaneIx, LaneIx)],
    stations: &mut [Option<Vec<Station>>],
) -> Vec<(LaneIx, LaneIx)> {
    let mut groups = Groups::new(2 * road.lanes.len());
    links.iter().for_each(|(from, to)| groups.unite(2 * from + 1, 2 * to));
    let mut members: BTreeMap<usize, BTreeSet<(LaneIx, bool)>> = BTreeMap::new();
    for &(from, to) in links {
        members.entry(groups.of(2 * to)).or_default().extend([(from, true), (to, false)]);
    }
    for group in members.values() {
        let here: Vec<Station> =
            group.iter().filter_map(|&(lane, end)| end_of(stations[lane].as_ref()?, end)).collect();
        let share = 1.0 / here.len().max(1) as f64;
        let point = here.iter().fold(Vec2::ZERO, |sum, s| sum + s.point * share);
        let ahead = here.iter().fold(Vec2::ZERO, |sum, s| sum + Vec2::from_heading(s.heading_rad));
        if ahead.norm() < 0.5 * here.len() as f64 || here.iter().any(|s| s.point.distance(point) > MEET_M) {
            continue;
        }
        let aside = ahead.left() * (1.0 / ahead.norm());
        let halves = |side: fn(&Lane) -> &Vec<Vec2>, sign: f64| -> Vec<f64> {
            let of = |&(lane, end): &(LaneIx, bool)| {
                let line = side(&road.lanes[lane]);
                let corner = if end { line[line.len() - 1] } else { line[0] };
                ((corner - point).dot(aside) * sign).max(HALF_WIDTH_M_MIN)
            };
            group.iter().map(of).collect()
        };
        let (left, right) = (halves(|lane| &lane.left, 1.0), halves(|lane| &lane.right, -1.0));
        let (left, right) = (agreed(&left), agreed(&right));
        for (k, &(lane, end)) in group.iter().enumerate() {
            let Some(stations) = stations[lane].as_mut() else { continue };
            make_room(stations, end, point);
            let at = if end { stations.len() - 1 } else { 0 };
            let (left_m, right_m) = (left[k], right[k]);
            stations[at] = Station { point, heading_rad: ahead.heading(), left_m, right_m, s_m: 0.0 };
        }
    }
    let gap = |&(from, to): &(LaneIx, LaneIx)| {
        let (Some(a), Some(b)) = (&stations[from], &stations[to]) else { return false };
        let (Some(a), Some(b)) = (end_of(a, true), end_of(b, false)) else { return false };
        let corners = |s: &Station| {
            let aside = Vec2::from_heading(s.heading_rad).left();
            (s.point + aside * s.left_m, s.point - aside * s.right_m)
        };
        let ((al, ar), (bl, br)) = (corners(&a), corners(&b));
        al.distance(bl).max(ar.distance(br)) > GAP_M
    };
    links.iter().copied().filter(gap).collect()
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

fn end_of(stations: &[Station], end: bool) -> Option<Station> {
    if end { stations.last().copied() } else { stations.first().copied() }
}

/// Their mean, if they are nearly the same.
fn agreed(values: &[f64]) -> Vec<f64> {
    let mean = num::mean(values).unwrap_or(0.0);
    let same = values.iter().all(|value| (value - mean).abs() <= MEET_M);
    values.iter().map(|value| if same { mean } else { *value }).collect()
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
