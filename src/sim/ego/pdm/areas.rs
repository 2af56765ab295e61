//! Areas of the map under a box: one lane, several lanes, off the road, against traffic.

use crate::kernel::{OrientedBox, Vec2};
use crate::scene::LaneIx;
use crate::sim::Plant;

/// Corners of a box.
const CORNERS: usize = 4;

/// Facts of the map that PDM needs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Areas {
    /// True if several lanes hold a corner, and none holds all.
    pub in_several_lanes: bool,
    /// True if some corner is in no lane.
    pub off_road: bool,
    /// True if the middle is in no lane of the route.
    pub oncoming: bool,
}

/// Returns the areas of a box. On a map without lanes it is on the road, and where the route meets no lane nothing is oncoming.
/// `on_route`: `[lanes]`, or empty.
pub fn areas(plant: &Plant, on_route: &[bool], own: &OrientedBox) -> Areas {
    if plant.lanes().lane_count() == 0 {
        return Areas::default();
    }
    // Few lanes lie over one another: a list that is searched is fastest.
    let mut corners_in: Vec<(LaneIx, usize)> = Vec::with_capacity(8);
    let mut off_road = false;
    for corner in own.corners() {
        let mut is_in_some = false;
        let mut seen: Vec<LaneIx> = Vec::with_capacity(4);
        for lane in lanes_at(plant, corner) {
            is_in_some = true;
            if seen.contains(&lane) {
                continue;
            }
            seen.push(lane);
            match corners_in.iter_mut().find(|(of, _)| *of == lane) {
                Some((_, count)) => *count += 1,
                None => corners_in.push((lane, 1)),
            }
        }
        off_road |= !is_in_some;
    }
    let in_one = corners_in.iter().any(|(_, count)| *count == CORNERS);
    let oncoming = !on_route.is_empty() && !lanes_at(plant, own.center).any(|lane| on_route[lane]);
    Areas { in_several_lanes: corners_in.len() > 1 && !in_one, off_road, oncoming }
}

fn lanes_at(plant: &Plant, point: Vec2) -> impl Iterator<Item = LaneIx> {
    plant
        .lanes()
        .pieces()
        .touching(point)
        .filter(move |(_, piece)| piece.contains(point))
        .map(|(_, piece)| piece.lane())
}
