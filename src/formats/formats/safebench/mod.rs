//! SafeBench's traffic families on CARLA's towns: route files (XML), scenario files (JSON) and the towns' OpenDRIVE
//! together give scenes. A route file gives the ego's way. The scenario file of its family says where the
//! scenario starts and where the actors of families 5 to 8 stand. CARLA's frame is left-handed with yaw clockwise in
//! degrees: (x, y, yaw) becomes (x, -y, -yaw).

mod events;
pub mod parameters;
mod pose;
mod road;
mod way;

use std::collections::BTreeMap;

use super::import_error::{ImportError, shown};
use super::imported::Imported;
use super::xml_read::{Document, Element};
use crate::kernel::{Polyline, Pose, num};
use crate::scene::safebench::{STEPS, Staging, TrafficFamily};
use crate::scene::{LaneGraph, Origin, Road, Scene};
pub use events::Events;

use self::pose::pose;

/// Most waypoints of one route.
const WAYPOINTS_MAX: usize = 64;
/// Most routes of one file.
const ROUTES_MAX: usize = 16;
/// Largest distance between a trigger and a route that it belongs to, metres.
const TRIGGER_WITHIN_M: f64 = 5.0;

/// The files that routes need: roads of towns by name, and events of all scenario files.
#[derive(Clone, Debug, Default)]
pub struct Library {
    towns: BTreeMap<String, (Road, LaneGraph)>,
    events: Events,
}

impl Library {
    /// Adds the road of a town: the name of its file up to the first dot.
    ///
    /// # Errors
    /// The name is taken by another road.
    pub fn add_town(&mut self, file: &str, road: Road) -> Result<(), ImportError> {
        let town = file.split('.').next().unwrap_or(file).to_string();
        if let Some((taken, _)) = self.towns.get(&town) {
            let expected = format!("one road for the town {}, found another read before it", shown(&town));
            let remedy = "import the routes of each road by themselves, or give the town a name of its own";
            return if *taken == road { Ok(()) } else { Err(ImportError::new(file, "file name", expected, remedy)) };
        }
        let graph = LaneGraph::of(&road);
        self.towns.insert(town, (road, graph));
        Ok(())
    }

    /// Adds a scenario file. Events that cannot be read are left out in `imported`.
    pub fn add_scenarios(&mut self, file: &str, bytes: &[u8], imported: &mut Imported) -> Result<(), ImportError> {
        self.events.add(file, bytes, imported)
    }
}

/// Returns `true` if a text is a scenario file.
pub fn looks_like_scenarios(head: &[u8]) -> bool {
    let needle = b"\"available_scenarios\"";
    head.windows(needle.len()).any(|window| window == needle)
}

/// Returns the scenes of a route file `scenario_<family>_route_<number>.xml`. Routes whose town is not in the library, or that
/// cannot be followed on its road, are left out with the reason.
///
/// # Errors The file has another name, or is not a route file.
pub fn import(file: &str, bytes: &[u8], library: &Library) -> Result<Imported, ImportError> {
    let document = Document::parse(file, bytes)?;
    let root = document.root();
    if root.name() != "routes" {
        return Err(root.refuse(format!("a root element <routes>, found <{}>", shown(root.name()))));
    }
    let Some((family, number)) = named(file) else {
        let expected = "a name scenario_<01 to 08>_route_<number>.xml, which says the family";
        return Err(ImportError::new(file, "file name", expected, "give the file its name in the benchmark"));
    };
    let mut imported = Imported::default();
    for (k, element) in root.named("route").enumerate() {
        if k >= ROUTES_MAX {
            return Err(element.refuse(format!("at most {ROUTES_MAX} routes")));
        }
        let id = if k == 0 {
            format!("safebench/{}/{number:02}", family.name())
        } else {
            format!("safebench/{}/{number:02}.{k}", family.name())
        };
        let place = Place { file, id: &id, family, number };
        match place.scene(&element, library) {
            Ok(Ok(scene)) => imported.scenes.push(scene),
            Ok(Err(reason)) => imported.leave_out(file, || (id.clone(), reason)),
            Err(error) => imported.leave_out_for(id.clone(), &error, "the other routes of the file are kept"),
        }
    }
    if imported.scenes.is_empty() && imported.left_out.is_empty() {
        return Err(root.refuse("at least one <route>"));
    }
    document.was_read_whole()?;
    Ok(imported)
}

/// Returns family and route number in a file's name.
fn named(file: &str) -> Option<(TrafficFamily, u32)> {
    let (family, route) = file.strip_prefix("scenario_")?.strip_suffix(".xml")?.split_once("_route_")?;
    let digits = |text: &str| !text.is_empty() && text.len() <= 6 && text.bytes().all(|b| b.is_ascii_digit());
    (digits(family) && digits(route)).then_some(())?;
    Some((TrafficFamily::of_number(family.parse().ok()?)?, route.parse().ok()?))
}

/// A route that is being turned into a scene.
struct Place<'f> {
    file: &'f str,
    id: &'f str,
    family: TrafficFamily,
    number: u32,
}

impl Place<'_> {
    /// Returns the scene, or why there is none.
    fn scene(&self, route: &Element<'_>, library: &Library) -> Result<Result<Scene, String>, ImportError> {
        let town = route.needed_attribute("town")?;
        let waypoints = waypoints(route)?;
        let Some((road, graph)) = library.towns.get(town) else {
            let known: Vec<&str> = library.towns.keys().map(String::as_str).collect();
            let have = if known.is_empty() { "none".to_string() } else { known.join(", ") };
            let town = shown(town);
            return Ok(Err(format!(
                "it lies on {town}, and {town}.xodr is missing (towns at hand: {have}); add it with --towns FOLDER: CARLA has it \
                 in CarlaUE4/Content/Carla/Maps/OpenDrive; or generate the route (source = \"safebench\" in an experiment file)"
            )));
        };
        Ok(self.on_town(town, &waypoints, road, graph, &library.events))
    }

    fn on_town(
        &self,
        town: &str,
        waypoints: &[Pose],
        road: &Road,
        graph: &LaneGraph,
        events: &Events,
    ) -> Result<Scene, String> {
        let points = way::along(graph, waypoints)?;
        let route = Polyline::new(points.clone()).map_err(|error| format!("its route is not a path: {error}"))?;
        let event = events.nearest(self.family, town, &route, TRIGGER_WITHIN_M).ok_or_else(|| {
            format!(
                "no event of {} lies within 5 m of it; import scenario_{:02}.json with it",
                self.family.scenario_name(),
                self.family.number()
            )
        })?;
        // The trigger faces along the route; its own yaw is only approximate.
        let at = route.project(event.trigger.position);
        let trigger = Pose { position: route.at(at.s_m), heading_rad: num::wrap_angle(route.heading_at(at.s_m)) };
        let mut staging = Staging { family: self.family, route: self.number, trigger, spawns: vec![] };
        if self.family.has_spawn_frames() {
            if event.actors.is_empty() {
                return Err("its event names no other actor, which this family needs".into());
            }
            staging.spawns = event.actors.iter().map(|actor| staging.frame(*actor)).collect();
        }
        let (near, kept) = road::near(road, &route);
        let lights = road::lights(self.family, graph, &kept, &near, &route, at.s_m, &event.actors);
        let heading_rad = (points[1] - points[0]).heading();
        Ok(Scene {
            id: self.id.into(),
            origin: Origin { format: "safebench".into(), name: format!("{town}/{}", self.file) },
            steps: STEPS,
            current_step: 0,
            road: near,
            tracks: vec![],
            ego: crate::scene::safebench::ego_at_rest(points[0], heading_rad, points),
            objects_of_interest: vec![],
            lights,
            stop_signs: vec![],
            crosswalks: vec![],
            staging: Some(staging),
        })
    }
}

fn waypoints(route: &Element<'_>) -> Result<Vec<Pose>, ImportError> {
    let mut scenes = Vec::new();
    for element in route.named("waypoint") {
        if scenes.len() >= WAYPOINTS_MAX {
            return Err(element.refuse(format!("at most {WAYPOINTS_MAX} waypoints")));
        }
        let number = |name: &str| element.number_attribute(name);
        scenes.push(pose(number("x")?, number("y")?, number("yaw")?));
    }
    if scenes.len() < 2 {
        return Err(route.refuse(format!("at least 2 waypoints, found {}", scenes.len())));
    }
    Ok(scenes)
}

#[cfg(test)]
pub(super) mod tests;
