//! A road as OpenDRIVE 1.7: one road with one lane, -1, for every lane of the scene, its reference line along the
//! lane's centre, links and junctions as in the lane graph. Right-handed metres, as in the scene.
//!
//! If one lane follows exactly one other, their roads are linked. Lanes that lead from one lane to one other across a
//! split or merge become the connecting roads of a junction. At any other split or merge the first metres of each
//! following lane become the connecting roads, so that every link is legal. Lanes beside each other become separate
//! roads beside each other: OpenDRIVE has no link for that, and the notes say so.

mod curve;
mod graph;
mod meeting;
mod signals;

use crate::formats::export_error::Note;
use crate::formats::xml_write::{Xml, decimal};
use crate::kernel::Vec2;
use crate::scene::{Lane, LaneIx, LaneKind, Scene};
use curve::{Curve, Station};
use graph::{Link, Network, Piece};

pub(in crate::formats) use signals::light_signal_id;

const NOT_A_JUNCTION: &str = "-1";
/// Widths that differ by less than this count as equal, metres.
const SAME_WIDTH_M: f64 = 1e-4;

/// The bytes of an .xodr file.
pub(in crate::formats) fn network(scene: &Scene, notes: &mut Vec<Note>) -> Vec<u8> {
    let mut xml = Xml::new();
    let network = Network::of(&scene.road);
    for ix in network.skipped() {
        let what = format!("road.lanes[{ix}] {:?}", scene.road.lanes[ix].id);
        notes.push(Note::new(what, "it is too short for a road and is left out"));
    }
    notes.push(Note::new(
        "road",
        "lanes beside each other are roads beside each other; curbs, crosswalks and who is whose neighbour are left out",
    ));
    if let [(from, to), ..] = network.apart[..] {
        let ids = (&scene.road.lanes[from].id, &scene.road.lanes[to].id);
        let count = network.apart.len();
        let reason = format!(
            "{count} lanes begin elsewhere than the lane before them ends and are not linked to it, as {:?} after {:?}",
            ids.1, ids.0
        );
        notes.push(Note::new("road.lanes", reason));
    }
    xml.open("OpenDRIVE", &[]);
    header(&mut xml, scene);
    for (number, piece) in network.pieces.iter().enumerate() {
        road(&mut xml, scene, &network, number, piece);
    }
    for (number, links) in network.junctions.iter().enumerate() {
        junction(&mut xml, number, links);
    }
    xml.finish()
}

fn header(xml: &mut Xml, scene: &Scene) {
    let points = || scene.road.lanes.iter().flat_map(|lane| lane.left.iter().chain(&lane.right)).copied();
    let first = points().next().unwrap_or(Vec2::ZERO);
    let low = points().fold(first, |m, p| Vec2::new(m.x.min(p.x), m.y.min(p.y)));
    let high = points().fold(first, |m, p| Vec2::new(m.x.max(p.x), m.y.max(p.y)));
    xml.empty(
        "header",
        &[
            ("revMajor", &1),
            ("revMinor", &7),
            ("name", &scene.id),
            ("version", &"1.00"),
            ("date", &"2020-01-01T00:00:00"),
            ("north", &decimal(high.y)),
            ("south", &decimal(low.y)),
            ("east", &decimal(high.x)),
            ("west", &decimal(low.x)),
            ("vendor", &"EvoDrive"),
        ],
    );
}

fn road(xml: &mut Xml, scene: &Scene, network: &Network, number: usize, piece: &Piece) {
    let lane = &scene.road.lanes[piece.lane];
    let junction = piece.junction.map_or_else(|| NOT_A_JUNCTION.to_string(), graph::junction_id);
    let length = decimal(piece.curve.length_m());
    let id = graph::road_id(number);
    xml.open(
        "road",
        &[("name", &lane.id), ("length", &length), ("id", &id), ("junction", &junction), ("rule", &"RHT")],
    );
    xml.within("link", &[], |xml| {
        link(xml, "predecessor", piece.from, "end");
        link(xml, "successor", piece.to, "start");
    });
    let kind = if lane.kind == LaneKind::Freeway { "motorway" } else { "town" };
    match lane.speed_limit_mps {
        None => xml.empty("type", &[("s", &0), ("type", &kind)]),
        Some(limit) => xml.within("type", &[("s", &0), ("type", &kind)], |xml| {
            xml.empty("speed", &[("max", &decimal(limit)), ("unit", &"m/s")]);
        }),
    }
    plan_view(xml, &piece.curve);
    lanes(xml, lane, piece);
    signals::write(xml, scene, network, number);
    xml.close();
}

fn link(xml: &mut Xml, name: &'static str, to: Link, contact: &'static str) {
    match to {
        Link::None => {}
        Link::Road(piece) => {
            let id = graph::road_id(piece);
            xml.empty(name, &[("elementType", &"road"), ("elementId", &id), ("contactPoint", &contact)]);
        }
        Link::Junction(number) => {
            let id = graph::junction_id(number);
            xml.empty(name, &[("elementType", &"junction"), ("elementId", &id)]);
        }
    }
}

fn plan_view(xml: &mut Xml, curve: &Curve) {
    xml.open("planView", &[]);
    for part in &curve.parts {
        let place = (decimal(part.s_m), decimal(part.from.x), decimal(part.from.y));
        let (heading, length) = (decimal(part.heading_rad), decimal(part.length_m));
        xml.open(
            "geometry",
            &[("s", &place.0), ("x", &place.1), ("y", &place.2), ("hdg", &heading), ("length", &length)],
        );
        match &part.cubic {
            None => xml.empty("line", &[]),
            Some(cubic) => {
                let [bu, cu, du] = cubic.u.map(decimal);
                let [bv, cv, dv] = cubic.v.map(decimal);
                let range = "normalized";
                xml.empty(
                    "paramPoly3",
                    &[
                        ("aU", &0),
                        ("bU", &bu),
                        ("cU", &cu),
                        ("dU", &du),
                        ("aV", &0),
                        ("bV", &bv),
                        ("cV", &cv),
                        ("dV", &dv),
                        ("pRange", &range),
                    ],
                );
            }
        }
        xml.close();
    }
    xml.close();
}

/// Lane 0 runs along the left boundary; lane -1 is as wide as the scene's lane.
fn lanes(xml: &mut Xml, lane: &Lane, piece: &Piece) {
    let stations = &piece.curve.stations;
    xml.open("lanes", &[]);
    for (s, a, b) in profile(stations, |station| station.left_m) {
        xml.empty("laneOffset", &[("s", &s), ("a", &a), ("b", &b), ("c", &0), ("d", &0)]);
    }
    xml.open("laneSection", &[("s", &0)]);
    xml.within("center", &[], |xml| {
        xml.within("lane", &[("id", &0), ("type", &"none"), ("level", &"false")], |xml| {
            mark(xml, lane.left_neighbours.iter().any(|n| n.same_direction));
        });
    });
    let kind = match lane.kind {
        LaneKind::Street | LaneKind::Freeway => "driving",
        LaneKind::Bike => "biking",
        LaneKind::Other => "shoulder",
    };
    xml.open("right", &[]);
    xml.open("lane", &[("id", &-1), ("type", &kind), ("level", &"false")]);
    xml.within("link", &[], |xml| {
        for (name, link) in [("predecessor", piece.from), ("successor", piece.to)] {
            if matches!(link, Link::Road(_)) {
                xml.empty(name, &[("id", &-1)]);
            }
        }
    });
    for (s, a, b) in profile(stations, |station| station.left_m + station.right_m) {
        xml.empty("width", &[("sOffset", &s), ("a", &a), ("b", &b), ("c", &0), ("d", &0)]);
    }
    mark(xml, lane.right_neighbours.iter().any(|n| n.same_direction));
    for _ in 0..4 {
        xml.close();
    }
}

/// Start, value and slope of the straight pieces that a value along a road is made of.
fn profile(stations: &[Station], of: impl Fn(&Station) -> f64) -> Vec<(String, String, String)> {
    let mut pieces: Vec<(f64, f64, f64)> = Vec::new();
    for pair in stations.windows(2) {
        let (here, next) = (of(&pair[0]), of(&pair[1]));
        let run = pair[1].s_m - pair[0].s_m;
        let foreseen = pieces.last().map(|(s, a, b)| a + b * (pair[1].s_m - s));
        if foreseen.is_none_or(|value| (value - next).abs() > SAME_WIDTH_M) && run > 0.0 {
            let slope = if (next - here).abs() > SAME_WIDTH_M { (next - here) / run } else { 0.0 };
            pieces.push((pair[0].s_m, here, slope));
        }
    }
    pieces.into_iter().map(|(s, a, b)| (decimal(s), decimal(a), decimal(b))).collect()
}

fn mark(xml: &mut Xml, may_cross: bool) {
    let kind = if may_cross { "broken" } else { "solid" };
    xml.empty("roadMark", &[("sOffset", &0), ("type", &kind), ("color", &"standard"), ("width", &"0.12")]);
}

fn junction(xml: &mut Xml, number: usize, connections: &[graph::Connection]) {
    let id = graph::junction_id(number);
    xml.within("junction", &[("id", &id), ("name", &format!("junction {id}"))], |xml| {
        for (ix, connection) in connections.iter().enumerate() {
            let (incoming, connecting) = (graph::road_id(connection.incoming), graph::road_id(connection.connecting));
            xml.within(
                "connection",
                &[
                    ("id", &ix),
                    ("incomingRoad", &incoming),
                    ("connectingRoad", &connecting),
                    ("contactPoint", &"start"),
                ],
                |xml| xml.empty("laneLink", &[("from", &-1), ("to", &-1)]),
            );
        }
    });
}

/// The road in which a place of a lane lies, and how far along it.
fn place_on(network: &Network, lane: LaneIx, point: Vec2) -> Option<(usize, f64, f64)> {
    let body = network.bodies.get(lane).copied().flatten()?;
    let (s_m, t_m) = network.pieces[body].curve.nearest(point);
    Some((body, s_m, t_m))
}
