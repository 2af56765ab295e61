//! Reads lane sections: offsets, widths and borders become lanes in driving direction, with their neighbours across the section.

use super::plan_view::{self, Geometry};
use super::{Network, ROAD_LENGTH_MAX_M, cubic, cubics};
use crate::formats::centreline::{Across, lines, thinned};
use crate::formats::import_error::{ImportError, shown};
use crate::formats::imported::Imported;
use crate::formats::speed_limit::limit_mps;
use crate::formats::xml_read::Element;
use crate::kernel::Vec2;
use crate::scene::{Lane, LaneIx, LaneKind, Neighbour};

/// Distance between stations of a lane before thinning, metres.
const SPACING_M: f64 = 1.0;
const SECTIONS_MAX: usize = 10_000;
const LANES_MAX: usize = 200;
/// Most stations of all lanes of a file, also of lanes that are not kept.
pub(super) const POINTS_MAX: usize = 8_000_000;
/// Most lanes of a file.
pub(super) const LANES_IN_ALL_MAX: usize = 200_000;
/// Most type records of a road.
const TYPES_MAX: usize = 1000;
/// Width that a lane must exceed somewhere to be kept, metres.
const WIDTH_MIN_M: f64 = 0.1;

/// Adds all lanes of a road.
///
/// # Errors The road cannot be read, or the file is too large.
pub(super) fn add(
    network: &mut Network,
    id: &str,
    road: &Element<'_>,
    imported: &mut Imported,
) -> Result<(), ImportError> {
    let length_m = road.number_attribute("length")?;
    if !(length_m > 0.0 && length_m <= ROAD_LENGTH_MAX_M) {
        return Err(road.refuse(format!("a length above 0, at most {ROAD_LENGTH_MAX_M} m, found {length_m}")));
    }
    let line = plan_view::read(road)?;
    if road.named("type").nth(TYPES_MAX).is_some() {
        return Err(road.refuse(format!("at most {TYPES_MAX} types")));
    }
    let lanes = road.needed_child("lanes")?;
    let offsets = cubics(&lanes, "laneOffset", "s")?;
    let types = types(id, road, imported);
    let mut sections: Vec<(f64, Element<'_>)> = Vec::new();
    for section in lanes.named("laneSection") {
        sections.push((section.number_attribute("s")?, section));
    }
    if sections.is_empty() || sections.len() > SECTIONS_MAX || sections.windows(2).any(|w| w[1].0 < w[0].0) {
        return Err(lanes.refuse(format!("1 to {SECTIONS_MAX} lane sections in order")));
    }
    network.sections.insert(id.to_string(), sections.len());
    for (index, (from_m, section)) in sections.iter().enumerate() {
        let to_m = sections.get(index + 1).map_or(length_m, |next| next.0);
        let stretch = Stretch { id, index, from_m: *from_m, to_m, line: &line, offsets: &offsets, types: &types, road };
        stretch.add(network, section, imported)?;
    }
    Ok(())
}

/// One lane section of a road.
struct Stretch<'r> {
    id: &'r str,
    index: usize,
    from_m: f64,
    to_m: f64,
    line: &'r [Geometry],
    offsets: &'r [(f64, [f64; 4])],
    types: &'r [(f64, Option<f64>)],
    road: &'r Element<'r>,
}

impl Stretch<'_> {
    fn add(&self, network: &mut Network, section: &Element<'_>, imported: &mut Imported) -> Result<(), ImportError> {
        self.count(network, section)?;
        let stations = self.stations();
        let poses = plan_view::poses(self.line, &stations);
        let mut across: Vec<(i64, LaneIx)> = Vec::new();
        for (side, name) in [(1.0, "left"), (-1.0, "right")] {
            let Some(group) = section.child(name) else { continue };
            let what =
                |lane: &str| format!("{lane} of the {name} side of section {} of road {}", self.index, shown(self.id));
            // Without its number it is not known beside which others a lane lies.
            let Some(lanes) = imported.read(&what("the lanes"), numbered(&group, side), "the other lanes are kept")
            else {
                continue;
            };
            let mut inner: Vec<f64> = stations.iter().map(|&s| cubic(self.offsets, s)).collect();
            for (lane_id, lane) in &lanes {
                // Widths add up from the middle outwards: beyond a lane of unknown width it is not known where a lane lies.
                let outer = what(&format!("lane {lane_id} and those beyond it"));
                let Some(outline) = imported.read(&outer, Outline::of(lane), "the inner lanes are kept") else {
                    break;
                };
                let kind = kind(lane, self.road);
                let mut points = Vec::with_capacity(stations.len());
                for (k, pose) in poses.iter().enumerate() {
                    let width = outline.width_m(stations[k] - self.from_m, inner[k], side);
                    let middle = inner[k] + side * 0.5 * width;
                    let centre = pose.position + Vec2::from_heading(pose.heading_rad).left() * middle;
                    points.push(Across { centre, left_m: 0.5 * width, right_m: 0.5 * width });
                    inner[k] += side * width;
                }
                let Some(kind) = kind else { continue };
                if points.iter().all(|point| 2.0 * point.left_m < WIDTH_MIN_M)
                    && let Some(expected) = outline.without_room()
                {
                    imported.leave_out_for(
                        what(&format!("lane {lane_id}")),
                        &lane.refuse(expected),
                        "the other lanes are kept",
                    );
                    continue;
                }
                if let Some(ix) = self.push(network, *lane_id, lane, kind, points, imported)? {
                    across.push((*lane_id, ix));
                }
            }
        }
        neighbours(network, &across);
        Ok(())
    }

    /// Counts the stations of the section's reference line and lanes before they are made.
    fn count(&self, network: &mut Network, section: &Element<'_>) -> Result<(), ImportError> {
        let groups = ["left", "right"].into_iter().filter_map(|side| section.child(side));
        let lanes: usize = groups.map(|group| group.named("lane").count()).sum();
        network.stations = network.stations.saturating_add((1 + lanes).saturating_mul(self.pieces() + 1));
        if network.stations > POINTS_MAX {
            return Err(section.refuse("fewer or shorter lanes: the network is out of all proportion"));
        }
        Ok(())
    }

    fn pieces(&self) -> usize {
        ((self.to_m - self.from_m).max(0.0) / SPACING_M).ceil().max(1.0) as usize
    }

    fn stations(&self) -> Vec<f64> {
        let length = (self.to_m - self.from_m).max(0.0);
        let pieces = self.pieces();
        // Just inside both ends, because at the very end the records of the next section or stretch apply.
        let inside = |s: f64| s.clamp(self.from_m, (self.to_m - 1e-7).max(self.from_m));
        (0..=pieces).map(|k| inside(self.from_m + length * k as f64 / pieces as f64)).collect()
    }

    /// Adds a lane. `None` if it is nowhere wide enough or too short.
    fn push(
        &self,
        network: &mut Network,
        lane_id: i64,
        lane: &Element<'_>,
        kind: LaneKind,
        mut points: Vec<Across>,
        imported: &mut Imported,
    ) -> Result<Option<LaneIx>, ImportError> {
        let forward = (lane_id < 0) != (self.road.attribute("rule") == Some("LHT"));
        if !forward {
            points.reverse();
        }
        if network.road.lanes.len() >= LANES_IN_ALL_MAX {
            return Err(lane.refuse(format!("at most {LANES_IN_ALL_MAX} lanes in all")));
        }
        if points.iter().any(|p| !p.centre.is_finite() || !p.left_m.is_finite()) {
            return Err(lane.refuse("finite widths and places"));
        }
        let thin = thinned(&points);
        if thin.len() < 2 || points.iter().all(|p| 2.0 * p.left_m < WIDTH_MIN_M) {
            return Ok(None);
        }
        let (centre, left, right) = lines(&thin);
        let ix = network.road.lanes.len();
        network.index.insert((self.id.to_string(), self.index, lane_id), ix);
        network.forward.push(forward);
        network.road.lanes.push(Lane {
            id: format!("{}/{}/{lane_id}", self.id, self.index),
            kind,
            centre,
            left,
            right,
            entries: vec![],
            exits: vec![],
            left_neighbours: vec![],
            right_neighbours: vec![],
            speed_limit_mps: speed(lane, || format!("lane {lane_id} of road {}", shown(self.id)), imported)
                .or(self.road_speed()),
        });
        Ok(Some(ix))
    }

    /// Returns the speed limit of the last road type that starts at or before the section.
    fn road_speed(&self) -> Option<f64> {
        self.types.iter().rfind(|(from_m, _)| *from_m <= self.from_m + 1e-9).and_then(|(_, limit)| *limit)
    }
}

/// Outer limit of a lane, as records along its section.
enum Outline {
    /// Its width.
    Widths(Vec<(f64, [f64; 4])>),
    /// The place of its outer border, measured from the reference line: to the left above 0, to the right below.
    Border(Vec<(f64, [f64; 4])>),
}

impl Outline {
    /// Reads the outline; widths count where the file has both.
    fn of(lane: &Element<'_>) -> Result<Outline, ImportError> {
        if lane.child("width").is_none() && lane.child("border").is_some() {
            return cubics(lane, "border", "sOffset").map(Outline::Border);
        }
        cubics(lane, "width", "sOffset").map(Outline::Widths)
    }

    /// Returns the width `s_m` into the section, of a lane whose inner border lies at `inner_m`.
    fn width_m(&self, s_m: f64, inner_m: f64, side: f64) -> f64 {
        match self {
            Outline::Widths(widths) => cubic(widths, s_m).max(0.0),
            Outline::Border(border) => (side * (cubic(border, s_m) - inner_m)).max(0.0),
        }
    }

    /// Returns the expected element of a lane that has no room anywhere. A width of 0 is allowed, because the file says so.
    fn without_room(&self) -> Option<&'static str> {
        match self {
            Outline::Widths(widths) if widths.is_empty() => Some("a <width> or a <border>"),
            Outline::Widths(_) => None,
            Outline::Border(_) => {
                Some("a <border> beyond the lane's inner border (below 0 on the right, above 0 on the left)")
            }
        }
    }
}

/// Returns the start of each type of a road, with its speed limit, in the order of the file.
fn types(id: &str, road: &Element<'_>, imported: &mut Imported) -> Vec<(f64, Option<f64>)> {
    let mut types = Vec::new();
    for kind in road.named("type") {
        let what = || format!("a type of road {}", shown(id));
        let limit = speed(&kind, what, imported);
        let from_m = imported.read(&what(), kind.number_attribute("s"), "the road is kept without it");
        types.extend(from_m.map(|from_m| (from_m, limit)));
    }
    types
}

/// Returns the lanes of a side from the middle outwards.
fn numbered<'d>(group: &Element<'d>, side: f64) -> Result<Vec<(i64, Element<'d>)>, ImportError> {
    let mut lanes: Vec<(i64, Element<'_>)> = Vec::new();
    for lane in group.named("lane") {
        lanes.push((lane_id(&lane, side)?, lane));
    }
    if lanes.len() > LANES_MAX {
        return Err(group.refuse(format!("at most {LANES_MAX} lanes")));
    }
    lanes.sort_by_key(|(id, _)| id.abs());
    Ok(lanes)
}

fn lane_id(lane: &Element<'_>, side: f64) -> Result<i64, ImportError> {
    let id = lane.needed_attribute("id")?.parse::<i64>().ok();
    let id = id.filter(|id| *id != 0 && id.abs() < 1000 && (*id > 0) == (side > 0.0));
    id.ok_or_else(|| lane.refuse("a lane id: above 0 on the left, below 0 on the right"))
}

/// Returns the kind of a lane; `None` for lane types that nobody drives or walks on.
fn kind(lane: &Element<'_>, road: &Element<'_>) -> Option<LaneKind> {
    let motorway = || {
        let mut types = road.children().filter(|child| child.name() == "type");
        types.any(|kind| kind.attribute("type") == Some("motorway"))
    };
    match lane.attribute("type").unwrap_or("none") {
        "driving" | "entry" | "exit" | "onRamp" | "offRamp" | "connectingRamp" | "bidirectional" | "HOV" | "bus"
        | "taxi" | "mwyEntry" | "mwyExit" | "slipLane" => {
            Some(if motorway() { LaneKind::Freeway } else { LaneKind::Street })
        }
        "biking" => Some(LaneKind::Bike),
        "shoulder" | "border" | "stop" | "parking" | "sidewalk" | "walking" | "shared" => Some(LaneKind::Other),
        _ => None,
    }
}

/// Reads `<speed max= unit=>`; m/s where no unit is given. `None` for a text that says there is no limit.
fn speed(parent: &Element<'_>, what: impl Fn() -> String, imported: &mut Imported) -> Option<f64> {
    let given = parent.child("speed")?;
    let max = given.attribute("max").filter(|max| !matches!(*max, "no limit" | "undefined" | "0" | "0.0"))?;
    let unit = given.attribute("unit").filter(|unit| !unit.is_empty()).unwrap_or("m/s");
    let limit = limit_mps(max, unit).map_err(|expected| given.refuse(expected));
    imported.read(&format!("speed limit of {}", what()), limit, "it is kept without the limit")
}

/// Sets neighbours among the lanes with through traffic of one section.
fn neighbours(network: &mut Network, across: &[(i64, LaneIx)]) {
    for &(id, ix) in across {
        let through = |ix: LaneIx| matches!(network.road.lanes[ix].kind, LaneKind::Street | LaneKind::Freeway);
        if !through(ix) {
            continue;
        }
        let find = |wanted: i64| across.iter().find(|(other, _)| *other == wanted).map(|(_, ix)| *ix);
        let step = |id: i64, by: i64| if id + by == 0 { id + 2 * by } else { id + by };
        // If a lane runs with the reference line, the lane with the next higher id lies to its left.
        let by = if network.forward[ix] { 1 } else { -1 };
        let beside = |wanted: i64| {
            let lane = find(wanted).filter(|&lane| through(lane))?;
            Some(Neighbour { lane, same_direction: network.forward[lane] == network.forward[ix] })
        };
        let (left, right) = (beside(step(id, by)), beside(step(id, -by)));
        network.road.lanes[ix].left_neighbours = left.into_iter().collect();
        network.road.lanes[ix].right_neighbours = right.into_iter().collect();
    }
}
