//! CommonRoad XML 2020a, valid against its schema: lanelets, signs, lights, obstacles, and the ego as a planning
//! problem. Step 0 of the file is the step at which the ego starts; coordinates are the scene's.
//!
//! The schema knows neither history before the planning problem, nor road users that come later than its first step,
//! nor gaps in a trajectory. The schema asks for a state at step 0, so road users that come later wait beside the map
//! until then. A track with gaps becomes one obstacle per stretch. Whatever the format cannot hold is named in the
//! notes and kept exactly in a processing instruction `<?evodrive ...?>`, which other readers ignore. So
//! [`super::read`] gives the same scene back, unless the file was edited.
//!
//! To check a file: `xmllint --noout --schema XML_commonRoad_XSD.xsd scene.xml` (Debian: `libxml2-utils`).

mod ids;
mod obstacles;
mod road;
mod standing;

use super::read::read_plainly;
use crate::formats::export_error::{ExportError, Exported, Note};
use crate::formats::staging::{Staging, staged};
use crate::formats::xml_write::{Xml, decimal};
use crate::kernel::{Vec2, num};
use crate::scene::remainder::Remainder;
use crate::scene::{DT_S, Scene};
use ids::Ids;

/// The schema asks for a date. An export depends on its scene alone, so the date is always the same.
const DATE: &str = "2020-01-01";
/// The values that CommonRoad uses if the place on the globe is unknown.
const NOWHERE: [(&str, &str); 3] = [("geoNameId", "-999"), ("gpsLatitude", "999"), ("gpsLongitude", "999")];
/// Sides of the goal region around the end of the route, metres.
const GOAL_LENGTH_M: f64 = 8.0;
const GOAL_WIDTH_M: f64 = 4.0;
/// The goal is reached with a heading this near to the route's, radians.
const GOAL_HEADING_RAD: f64 = 0.6;

/// The scene, as logged or as played, as a CommonRoad file with one planning problem.
///
/// # Errors The scene breaks a rule of a valid scene or has no lane, or the staging does not fit it.
pub fn export(scene: &Scene, staging: Option<&Staging>) -> Result<Exported, ExportError> {
    let mut notes = Vec::new();
    let played = staged(scene, staging, &mut notes)?;
    let scene = played.as_ref();
    if scene.road.lanes.is_empty() {
        return Err(ExportError::Missing { scene: scene.id.clone(), format: "CommonRoad", missing: "lane" });
    }
    let plain = document(scene, staging.is_some(), None, &mut notes);
    let read = read_plainly(&scene.id, &plain)
        .map_err(|error| ExportError::Unsound { scene: scene.id.clone(), violation: error.to_string() })?;
    let remainder = Remainder::between(&read, scene);
    note_fields(&remainder, &mut notes);
    let bytes = document(scene, staging.is_some(), Some(&remainder), &mut Vec::new());
    Ok(Exported { bytes, notes })
}

fn document(scene: &Scene, is_staged: bool, remainder: Option<&Remainder>, notes: &mut Vec<Note>) -> Vec<u8> {
    let ids = Ids::of(scene);
    let mut xml = Xml::new();
    let source = format!("{} {}", scene.origin.format, scene.origin.name);
    xml.open(
        "commonRoad",
        &[
            ("commonRoadVersion", &"2020a"),
            ("benchmarkID", &benchmark_id(&scene.id)),
            ("date", &DATE),
            ("author", &"EvoDrive"),
            ("affiliation", &"none"),
            ("source", &source.trim()),
            ("timeStepSize", &decimal(DT_S)),
        ],
    );
    if let Some(remainder) = remainder {
        xml.instruction("evodrive", &remainder.to_ascii());
    }
    xml.within("location", &[], |xml| NOWHERE.iter().for_each(|(name, value)| xml.leaf(name, value)));
    xml.within("scenarioTags", &[], |xml| xml.empty(if is_staged { "critical" } else { "simulated" }, &[]));
    road::write(&mut xml, scene, &ids, notes);
    obstacles::write(&mut xml, scene, &ids, notes);
    planning_problem(&mut xml, scene, &ids);
    xml.finish()
}

/// The scene's id if it has CommonRoad's form (`DEU_Muc-1_1_T-1`). Otherwise an id of that form in Zamunda,
/// CommonRoad's invented country.
fn benchmark_id(id: &str) -> String {
    let mut parts = id.splitn(2, '_');
    let country = parts.next().is_some_and(|c| c.len() == 3 && c.bytes().all(|b| b.is_ascii_uppercase()));
    let rest = parts.next().unwrap_or("");
    let numbered = rest.split_once('-').is_some_and(|(name, number)| {
        let plain = |c: u8| c.is_ascii_alphanumeric();
        let figures = |c: u8| plain(c) || matches!(c, b'_' | b'-');
        !name.is_empty()
            && name.bytes().all(plain)
            && number.starts_with(|c: char| c.is_ascii_digit())
            && number.bytes().all(figures)
    });
    if country && numbered && id.len() <= 100 {
        return id.to_string();
    }
    let mut name: String = id.chars().filter(char::is_ascii_alphanumeric).take(60).collect();
    if !name.starts_with(|c: char| c.is_ascii_alphabetic()) {
        name.insert_str(0, "Scene");
    }
    format!("ZAM_{name}-1_1_T-1")
}

fn planning_problem(xml: &mut Xml, scene: &Scene, ids: &Ids) {
    let ego = &scene.ego;
    let Some(start) = ego.track.at(ego.start_step) else { unreachable!("a sound scene has its ego at its start") };
    let next = ego.track.at(ego.start_step + 1);
    let yaw_rate = next.map_or(0.0, |next| num::wrap_angle(next.heading_rad - start.heading_rad) / DT_S);
    let (speed, slip) = speed_and_slip(start.velocity, start.heading_rad);
    let end = ego.route[ego.route.len() - 1];
    let before = ego.route.iter().rev().find(|p| p.distance(end) > 0.1).copied().unwrap_or(ego.route[0]);
    let heading = (end - before).heading();
    let last_step = (scene.steps - 1).saturating_sub(ego.start_step).max(1);
    xml.within("planningProblem", &[("id", &ids.problem)], |xml| {
        xml.within("initialState", &[], |xml| {
            xml.within("position", &[], |xml| point(xml, "point", start.position));
            exact(xml, "velocity", decimal(speed));
            exact(xml, "orientation", decimal(start.heading_rad));
            exact(xml, "yawRate", decimal(yaw_rate));
            exact(xml, "slipAngle", decimal(slip));
            exact(xml, "time", 0);
        });
        xml.within("goalState", &[], |xml| {
            xml.within("time", &[], |xml| interval(xml, 0, last_step));
            xml.within("position", &[], |xml| rectangle(xml, GOAL_LENGTH_M, GOAL_WIDTH_M, heading, Some(end)));
            let (from, to) = (heading - GOAL_HEADING_RAD, heading + GOAL_HEADING_RAD);
            xml.within("orientation", &[], |xml| interval(xml, decimal(from), decimal(to)));
        });
    });
}

/// Speed, negative in reverse, and the angle from the heading to the motion; the angle is 0 at very low speed.
fn speed_and_slip(velocity: Vec2, heading_rad: f64) -> (f64, f64) {
    let along = velocity.dot(Vec2::from_heading(heading_rad));
    if velocity.norm() < 0.5 {
        return (along, 0.0);
    }
    let (speed, motion) = if along < 0.0 { (-velocity.norm(), -velocity) } else { (velocity.norm(), velocity) };
    (speed, num::wrap_angle(motion.heading() - heading_rad))
}

/// The losses of the format, one entry a kind: where the fields are, what they are about, what became of them.
const LOST: [(&str, &str, &str, &str); 7] = [
    (
        "/road/lanes/",
        "/centre",
        "road.lanes",
        "centre lines are not exactly the middle between their boundaries, which is all that the format knows",
    ),
    ("/road/lanes/", "/id", "road.lanes", "lane ids that were not plain numbers were replaced by numbers"),
    ("/tracks/", "/id", "tracks", "ids of road users that were not plain numbers were replaced by numbers"),
    (
        "/road/edges",
        "",
        "road.edges",
        "edges are curbs of the lanelets beside them; their own lines stand in <?evodrive?>",
    ),
    ("/objects_of_interest", "", "objects_of_interest", "who interacts with the ego stands in <?evodrive?> alone"),
    ("/current_step", "", "", "the step that is \"now\" stands in <?evodrive?> alone"),
    (
        "/ego/",
        "",
        "ego",
        "its size, its log, its route and its target speed stand beside the planning problem, in <?evodrive?> alone",
    ),
];

fn note_fields(remainder: &Remainder, notes: &mut Vec<Note>) {
    for (begins, ends, what, reason) in LOST {
        if remainder.paths().any(|path| path.starts_with(begins) && path.ends_with(ends)) {
            notes.push(Note::new(what, reason));
        }
    }
}

fn point(xml: &mut Xml, name: &'static str, p: Vec2) {
    xml.within(name, &[], |xml| {
        xml.leaf("x", decimal(p.x));
        xml.leaf("y", decimal(p.y));
    });
}

fn exact(xml: &mut Xml, name: &'static str, value: impl std::fmt::Display) {
    xml.within(name, &[], |xml| xml.leaf("exact", value));
}

fn interval(xml: &mut Xml, from: impl std::fmt::Display, to: impl std::fmt::Display) {
    xml.leaf("intervalStart", from);
    xml.leaf("intervalEnd", to);
}

fn rectangle(xml: &mut Xml, length_m: f64, width_m: f64, heading_rad: f64, centre: Option<Vec2>) {
    xml.within("rectangle", &[], |xml| {
        xml.leaf("length", decimal(length_m));
        xml.leaf("width", decimal(width_m));
        if let Some(centre) = centre {
            xml.leaf("orientation", decimal(heading_rad));
            point(xml, "center", centre);
        }
    });
}
