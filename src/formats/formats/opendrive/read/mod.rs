//! Reads OpenDRIVE 1.4 to 1.8: reference lines, lane sections, links and junctions become a road. Heights, objects and
//! signals are ignored. Right lanes run with the reference line, left lanes against it (the other way round where a
//! road says `rule="LHT"`).

mod lanes;
mod links;
mod plan_view;

use std::collections::{BTreeMap, BTreeSet};

use crate::formats::import_error::{ImportError, shown};
use crate::formats::imported::Imported;
use crate::formats::xml_read::{Document, Element};
use crate::scene::{LaneIx, Road};

const ROADS_MAX: usize = 50_000;
/// Words on the rest that is kept where a road, a lane or a link is left out.
const OTHERS_KEPT: &str = "the other roads are kept";
/// Longest single road, metres.
const ROAD_LENGTH_MAX_M: f64 = 100_000.0;

/// Name of a lane of the file: road id, index of the section, lane id.
type LaneName = (String, usize, i64);

/// A network under construction.
struct Network {
    road: Road,
    index: BTreeMap<LaneName, LaneIx>,
    /// True for lanes that run with their reference line.
    forward: Vec<bool>,
    /// Number of lane sections of each road.
    sections: BTreeMap<String, usize>,
    /// Number of stations counted so far.
    stations: usize,
}

/// Returns the road of an OpenDRIVE file, in its own coordinates (right-handed, x east). Lane ids are `road/section/lane`. Roads,
/// lanes and links that cannot be read (the deprecated `poly3` is not) are left out in `imported`.
///
/// # Errors The file is not OpenDRIVE, is cut off, or no road of it can be read.
pub fn road(file_name: &str, bytes: &[u8], imported: &mut Imported) -> Result<Road, ImportError> {
    let document = Document::parse(file_name, bytes)?;
    let root = document.root();
    if root.name() != "OpenDRIVE" {
        return Err(root.refuse(format!("a root element <OpenDRIVE>, found <{}>", shown(root.name()))));
    }
    let mut network = Network {
        road: Road::default(),
        index: BTreeMap::new(),
        forward: vec![],
        sections: BTreeMap::new(),
        stations: 0,
    };
    let mut roads: BTreeMap<&str, Element<'_>> = BTreeMap::new();
    for element in root.named("road") {
        if roads.len() >= ROADS_MAX {
            return Err(element.refuse(format!("at most {ROADS_MAX} roads")));
        }
        let taken = |id: &&str| roads.contains_key(id).then(|| element.refuse("an id that no road before it has"));
        let id = element.needed_attribute("id").and_then(|id| taken(&id).map_or(Ok(id), Err));
        if let Some(id) = imported.read(&named(&element), id, OTHERS_KEPT) {
            roads.insert(id, element);
        }
    }
    if root.child("road").is_none() {
        return Err(root.refuse("at least one <road>"));
    }
    let mut first = None;
    let mut lost = BTreeSet::new();
    for (id, element) in &roads {
        if let Err(error) = lanes::add(&mut network, id, element, imported) {
            if network.stations > lanes::POINTS_MAX || network.road.lanes.len() >= lanes::LANES_IN_ALL_MAX {
                return Err(error);
            }
            imported.leave_out_for(named(element), &error, OTHERS_KEPT);
            first = first.or(Some(error));
            lost.insert(*id);
        }
    }
    roads.retain(|id, _| !lost.contains(id));
    if let Some(error) = first.filter(|_| roads.is_empty()) {
        return Err(error);
    }
    for (id, element) in &roads {
        links::within_and_between(&mut network, id, element, &roads, imported);
    }
    for junction in root.named("junction") {
        links::through_junction(&mut network, &junction, &roads, imported);
    }
    document.was_read_whole()?;
    Ok(network.road)
}

/// Names an element by its name and id.
fn named(element: &Element<'_>) -> String {
    format!("{} {}", element.name(), shown(element.attribute("id").unwrap_or("without id")))
}

/// Returns the value at `s_m` of the last cubic record that starts at or before it; 0 before the first record.
fn cubic(records: &[(f64, [f64; 4])], s_m: f64) -> f64 {
    let after = records.partition_point(|record| record.0 <= s_m + 1e-9);
    let Some((start, [a, b, c, d])) = after.checked_sub(1).and_then(|ix| records.get(ix)) else { return 0.0 };
    let ds = s_m - start;
    a + ds * (b + ds * (c + ds * d))
}

/// Returns records `<name s=... a= b= c= d=>`, sorted by their start.
fn cubics(parent: &Element<'_>, name: &str, start: &str) -> Result<Vec<(f64, [f64; 4])>, ImportError> {
    let mut records = Vec::new();
    for record in parent.children().filter(|child| child.name() == name) {
        let number = |name: &str| record.number_attribute(name);
        records.push((number(start)?, [number("a")?, number("b")?, number("c")?, number("d")?]));
    }
    records.sort_by(|a: &(f64, _), b| a.0.total_cmp(&b.0));
    Ok(records)
}

#[cfg(test)]
pub(in crate::formats) mod tests {
    use super::*;
    use crate::kernel::{Polyline, Vec2, num};
    use crate::scene::{LaneGraph, LaneKind};

    /// Road 1 runs 50 m east, road 2 (in junction 9) turns left on an arc of radius 20 m, road 3 runs on north.
    pub const TURN: &str = r#"<OpenDRIVE><header revMajor="1" revMinor="4"/>
<road id="1" length="50" junction="-1"><link><successor elementType="junction" elementId="9"/></link>
 <type s="0" type="town"><speed max="30" unit="mph"/></type>
 <planView><geometry s="0" x="0" y="0" hdg="0" length="50"><line/></geometry></planView>
 <lanes><laneSection s="0"><left><lane id="1" type="driving"><width sOffset="0" a="3" b="0" c="0" d="0"/></lane></left>
  <center><lane id="0" type="none"/></center>
  <right><lane id="-1" type="driving"><link><successor id="-1"/></link><width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane>
   <lane id="-2" type="driving"><link><successor id="-2"/></link><width sOffset="0" a="3" b="0" c="0" d="0"/></lane>
   <lane id="-3" type="sidewalk"><width sOffset="0" a="2" b="0" c="0" d="0"/></lane></right></laneSection>
  <laneSection s="30"><center><lane id="0" type="none"/></center>
  <right><lane id="-1" type="driving"><link><predecessor id="-1"/></link><width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane>
   <lane id="-2" type="driving"><link><predecessor id="-2"/></link><width sOffset="0" a="3" b="0" c="0" d="0"/></lane></right></laneSection></lanes></road>
<road id="2" length="31.41592653589793" junction="9"><link><predecessor elementType="road" elementId="1" contactPoint="end"/><successor elementType="road" elementId="3" contactPoint="end"/></link>
 <planView><geometry s="0" x="50" y="0" hdg="0" length="31.41592653589793"><arc curvature="0.05"/></geometry></planView>
 <lanes><laneSection s="0"><right><lane id="-1" type="driving"><link><predecessor id="-1"/><successor id="1"/></link><width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane></right></laneSection></lanes></road>
<road id="3" length="40" junction="-1"><link><successor elementType="junction" elementId="9"/></link>
 <planView><geometry s="0" x="70" y="60" hdg="-1.5707963267948966" length="40"><line/></geometry></planView>
 <lanes><laneOffset s="0" a="0" b="0" c="0" d="0"/><laneSection s="0"><left><lane id="1" type="driving"><width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane></left></laneSection></lanes></road>
<junction id="9" name=""><connection id="0" incomingRoad="1" connectingRoad="2" contactPoint="start"><laneLink from="-1" to="-1"/></connection></junction>
</OpenDRIVE>"#;

    fn ix(road: &Road, id: &str) -> LaneIx {
        road.lanes.iter().position(|lane| lane.id == id).unwrap()
    }

    #[test]
    fn sections_junctions_and_reversed_roads_are_linked_in_driving_direction() {
        let imported = road("f.xodr", TURN.as_bytes(), &mut Imported::default()).unwrap();
        let lane = |id: &str| &imported.lanes[ix(&imported, id)];
        assert_eq!(lane("1/0/-1").exits, [ix(&imported, "1/1/-1")]);
        assert_eq!(lane("1/1/-1").exits, [ix(&imported, "2/0/-1")]);
        assert_eq!(lane("2/0/-1").exits, [ix(&imported, "3/0/1")], "a left lane, entered at its road's end");
        assert_eq!((lane("1/1/-2").exits.len(), lane("2/0/-1").entries.len()), (0, 1));
        assert_eq!(lane("1/0/-3").kind, LaneKind::Other);
        let neighbour = lane("1/0/-2").left_neighbours[0];
        assert_eq!((neighbour.lane, neighbour.same_direction), (ix(&imported, "1/0/-1"), true));
        let oncoming = lane("1/0/-1").left_neighbours[0];
        assert_eq!((oncoming.lane, oncoming.same_direction), (ix(&imported, "1/0/1"), false));
        assert!((lane("1/0/-1").speed_limit_mps.unwrap() - 13.4112).abs() < 1e-9);
    }

    #[test]
    fn lanes_lie_where_widths_and_curves_put_them() {
        let imported = road("f.xodr", TURN.as_bytes(), &mut Imported::default()).unwrap();
        let lane = |id: &str| &imported.lanes[ix(&imported, id)];
        assert_eq!(lane("1/0/-2").centre[0], Vec2::new(0.0, -5.0));
        assert!(lane("1/0/1").centre[0].distance(Vec2::new(30.0, 1.5)) < 1e-6, "against the reference line");
        let arc = Polyline::new(lane("2/0/-1").centre.clone()).unwrap();
        let centre = Vec2::new(50.0, 20.0);
        assert!(arc.points().iter().all(|p| (p.distance(centre) - 21.75).abs() < 1e-9));
        assert!((arc.length_m() - 21.75 * num::FRAC_PI_2).abs() < 0.1);
        let graph = LaneGraph::of(&imported);
        let way = graph.reachable(ix(&imported, "1/0/-1"), 0.0, 200.0);
        assert!(way.iter().any(|r| r.lane == ix(&imported, "3/0/1") && (r.start_m - 84.1).abs() < 0.2));
    }

    #[test]
    fn a_border_says_the_same_as_a_width_and_what_gives_no_room_is_named() {
        let of = |text: &str| {
            let mut imported = Imported::default();
            (road("f.xodr", text.as_bytes(), &mut imported).unwrap(), imported.left_out)
        };
        // Lanes of 3.5 and 3 m on the right of road 1, 3 m on its left, in metres from the reference line.
        let bordered = TURN
            .replacen("<width sOffset=\"0\" a=\"3.5\"", "<border sOffset=\"0\" a=\"-3.5\"", 1)
            .replacen(
                "<link><successor id=\"-2\"/></link><width sOffset=\"0\" a=\"3\"",
                "<link><successor id=\"-2\"/></link><border sOffset=\"0\" a=\"-6.5\"",
                1,
            )
            .replacen(
                "<left><lane id=\"1\" type=\"driving\"><width sOffset=\"0\" a=\"3\"",
                "<left><lane id=\"1\" type=\"driving\"><border sOffset=\"0\" a=\"3\"",
                1,
            );
        assert_eq!(bordered.matches("<border ").count(), 3);
        // A sidewalk by width beyond a lane by border.
        assert_eq!(of(&bordered), of(TURN));
        let both = TURN.replacen(
            "<width sOffset=\"0\" a=\"3.5\"",
            "<border sOffset=\"0\" a=\"-9\" b=\"0\" c=\"0\" d=\"0\"/><width sOffset=\"0\" a=\"3.5\"",
            1,
        );
        assert_eq!(of(&both), of(TURN), "widths count where both stand");
        for (from, to, expected) in [
            ("a=\"-3.5\"", "a=\"3.5\"", "a <border> beyond the lane's inner border"),
            ("<border sOffset=\"0\" a=\"-3.5\" b=\"0\" c=\"0\" d=\"0\"/>", "", "a <width> or a <border>"),
        ] {
            let (_, left_out) = of(&bordered.replacen(from, to, 1));
            let named = left_out.iter().find(|left| left.reason.contains(expected));
            assert!(named.is_some_and(|left| left.what.starts_with("lane -1 ")), "{expected}: {left_out:?}");
        }
    }

    #[test]
    fn damaged_and_hostile_networks_are_refused_by_place() {
        let refusal = |from: &str, to: &str| {
            assert!(TURN.contains(from), "{from}");
            let mut imported = Imported::default();
            let read = road("f.xodr", TURN.replacen(from, to, 1).as_bytes(), &mut imported);
            read.map_or_else(|error| error.to_string(), |_| imported.left_out[0].reason.clone())
        };
        assert!(refusal("<line/>", "<poly3 a=\"0\"/>").contains("planView"));
        assert!(refusal("length=\"50\" junction", "length=\"1e12\" junction").contains("100000"));
        assert!(refusal("hdg=\"0\"", "hdg=\"nan\"").contains("finite number"));
        assert!(refusal("road id=\"3\"", "road id=\"2\"").contains("no road before it has"));
        assert!(refusal("connectingRoad=\"2\"", "connectingRoad=\"77\"").contains("77"));
        assert!(refusal("elementId=\"3\"", "elementId=\"5\"").contains("5"));
        assert!(refusal("OpenDRIVE>", "OpenDrive>").contains("line"));
        for end in (0..TURN.len() - 1).step_by(83) {
            assert!(road("cut.xodr", &TURN.as_bytes()[..end], &mut Imported::default()).is_err(), "{end}");
        }
    }
}
