//! Lanes of the map: centre lines with widths, links, neighbours, speed limits.

use std::collections::BTreeMap;

use super::keys::{FeatureIn, Name, NeighbourIn};
use super::{Reading, point};
use crate::kernel::Vec2;
use crate::scene::{Lane, LaneIx, LaneKind, Neighbour, Road};

/// Half widths of a lane: where it is not known, and the bounds of what is believed, metres.
const HALF_WIDTH_M: f64 = 1.75;
const HALF_WIDTH_M_RANGE: (f64, f64) = (1.3, 2.5);

impl Reading<'_> {
    /// Lanes with mutual links, and their places by id.
    pub(super) fn road(&self, leave: &mut impl FnMut(&str, String)) -> (Road, BTreeMap<String, LaneIx>) {
        let mut lanes: Vec<Lane> = Vec::new();
        let mut index = BTreeMap::new();
        let mut sources = Vec::new();
        for (id, feature) in &self.description.map_features.0 {
            let Some(kind) = lane_kind(&feature.r#type) else { continue };
            match lane(id, kind, feature) {
                _ if index.contains_key(id) => leave(id, "a lane of the same id came before".into()),
                None => leave(id, "its centre line has no two points that differ".into()),
                Some(lane) => {
                    index.insert(id.clone(), lanes.len());
                    lanes.push(lane);
                    sources.push(feature);
                }
            }
        }
        for (ix, feature) in sources.iter().enumerate() {
            let place = |name: &Name| index.get(&name.text()).copied().filter(|&other| other != ix);
            // Lanes beyond the cut-out of the map are named but not there.
            let entries = feature.entry_lanes.iter().filter_map(place).map(|from| (from, ix));
            let exits = feature.exit_lanes.iter().filter_map(place).map(|to| (ix, to));
            for (from, to) in entries.chain(exits) {
                if !lanes[from].exits.contains(&to) {
                    lanes[from].exits.push(to);
                    lanes[to].entries.push(from);
                }
            }
            lanes[ix].left_neighbour = beside(&lanes, ix, &feature.left_neighbor, &index);
            lanes[ix].right_neighbour = beside(&lanes, ix, &feature.right_neighbor, &index);
        }
        (Road { lanes, edges: vec![] }, index)
    }
}

fn lane_kind(name: &str) -> Option<LaneKind> {
    Some(match name {
        "LANE_FREEWAY" => LaneKind::Freeway,
        "LANE_BIKE_LANE" => LaneKind::Bike,
        "LANE_SURFACE_STREET" | "LANE_UNKNOWN" => LaneKind::Street,
        "LANE_SURFACE_UNSTRUCTURE" => LaneKind::Other,
        _ => return None,
    })
}

fn lane(id: &str, kind: LaneKind, feature: &FeatureIn) -> Option<Lane> {
    let given = feature.polyline.as_ref()?;
    let centre: Vec<Vec2> = given.iter().filter_map(|p| point(p)).collect();
    if !centre.windows(2).any(|w| w[0].distance(w[1]) > 1e-6) {
        return None;
    }
    let (low, high) = HALF_WIDTH_M_RANGE;
    let half = |k: usize, side: usize| {
        let rows = feature.width.as_ref().filter(|rows| rows.len() == given.len() && given.len() == centre.len());
        let width = rows.and_then(|rows| rows[k].get(side)).filter(|width| **width > 0.0);
        width.map_or(HALF_WIDTH_M, |width| width.clamp(low, high))
    };
    let side = |side: usize, sign: f64| {
        (0..centre.len()).map(|k| centre[k] + aside(&centre, k) * (sign * half(k, side))).collect()
    };
    let (left, right) = (side(0, 1.0), side(1, -1.0));
    let limit = feature.speed_limit_mps.or(feature.speed_limit_mph.map(|mph| mph * 0.44704));
    let limit = limit.or(feature.speed_limit_kmh.map(|kmh| kmh / 3.6)).filter(|limit| *limit > 0.0);
    Some(Lane {
        id: id.into(),
        kind,
        centre,
        left,
        right,
        entries: vec![],
        exits: vec![],
        left_neighbour: None,
        right_neighbour: None,
        speed_limit_mps: limit,
    })
}

/// Unit vector to the left of a line at one of its points.
fn aside(line: &[Vec2], k: usize) -> Vec2 {
    let ahead = line[k..].iter().find(|p| p.distance(line[k]) > 1e-6).copied().unwrap_or(line[k]);
    let behind = line[..k].iter().rev().find(|p| p.distance(line[k]) > 1e-6).copied().unwrap_or(line[k]);
    let along = ahead - behind;
    if along.norm() > 1e-9 { along.left() * (1.0 / along.norm()) } else { (ahead - line[k]).left() }
}

fn beside(lanes: &[Lane], ix: LaneIx, given: &[NeighbourIn], index: &BTreeMap<String, LaneIx>) -> Option<Neighbour> {
    let place = |neighbour: &NeighbourIn| {
        let (name, direction) = match neighbour {
            NeighbourIn::Described { feature_id, same_direction } => (feature_id, *same_direction),
            NeighbourIn::Named(name) => (name, None),
        };
        index.get(&name.text()).copied().filter(|&other| other != ix).map(|other| (other, direction))
    };
    let (lane, direction) = given.iter().find_map(place)?;
    let along = |lane: &Lane| lane.centre[lane.centre.len() - 1] - lane.centre[0];
    let same_direction = direction.unwrap_or_else(|| along(&lanes[ix]).dot(along(&lanes[lane])) >= 0.0);
    Some(Neighbour { lane, same_direction })
}
