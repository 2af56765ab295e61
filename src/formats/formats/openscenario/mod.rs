//! OpenSCENARIO XML with OpenDRIVE: every road user, also the ego, follows its own trajectory by time, so that a player shows the
//! recording or the rollout. Revision 1.2 is the form for esmini, 1.0 the one that CARLA's ScenarioRunner loads.
//!
//! Scripts that wait for the ego have a form of their own (`triggered.rs`).
//!
//! Simulation time 0 is step 0 of the scene. Positions are centres of bounding boxes, so the box's centre in an
//! entity's own axes is 0. A road user that comes later, leaves earlier, or has gaps is added and deleted by events.
//! Names are the scene's ids in letters, figures and underscores.
//!
//! To check: `pip install asam-qc-openscenarioxml asam-qc-opendrive`, then `qc_openscenario -c config.xml` and
//! `qc_opendrive -c config.xml` with the file as `InputFile` (see the checkers' manuals).

mod entities;
mod story;
mod triggered;

use super::export_error::{ExportError, Note};
use super::opendrive::write::{self, light_signal_id};
use super::staging::{Staging, staged};
use super::xml_write::{Xml, decimal};
use crate::scene::{DT_S, LightState, Scene};
use entities::Cast;
pub use triggered::{TriggeredScenario, triggered};

/// A revision of OpenSCENARIO XML.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Revision {
    /// 1.0, the only one that CARLA's ScenarioRunner reads.
    V1_0,
    /// 1.2.
    V1_2,
}

/// The two files of an OpenSCENARIO export.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OpenScenario {
    /// The scenario; it refers to the road network by the name given.
    pub xosc: Vec<u8>,
    /// The road network.
    pub xodr: Vec<u8>,
    /// Notes on parts of the scene that the file cannot hold.
    pub notes: Vec<Note>,
}

/// Returns the scene, as logged or as played. `road_file` is the name under which the road network will lie beside the
/// scenario, such as `scene.xodr`.
///
/// # Errors
/// The scene breaks a rule of a sound scene or has no lane, or the staging does not fit it.
pub fn export(
    scene: &Scene,
    staging: Option<&Staging>,
    road_file: &str,
    revision: Revision,
) -> Result<OpenScenario, ExportError> {
    let mut notes = Vec::new();
    let played = staged(scene, staging, &mut notes)?;
    let scene = played.as_ref();
    if scene.road.lanes.is_empty() {
        return Err(ExportError::Missing { scene: scene.id.clone(), format: "OpenDRIVE", missing: "lane" });
    }
    let xodr = write::network(scene, &mut notes);
    let cast = Cast::of(scene);
    let mut xml = Xml::new();
    xml.open("OpenSCENARIO", &[]);
    header(&mut xml, scene, revision);
    xml.empty("CatalogLocations", &[]);
    road_network(&mut xml, scene, road_file);
    cast.write(&mut xml, revision);
    story::write(&mut xml, scene, &cast, revision);
    notes.push(Note::new(
        "",
        "these files cannot be imported again; to bring a scene back, export CommonRoad or ScenarioNet JSON",
    ));
    notes.push(Note::new(
        "",
        "heights, weights and axles are not known to a scene; usual ones of each kind are written",
    ));
    if scene.ego.track.samples.iter().flatten().count() < 2 {
        notes.push(Note::new("ego", "its motion is not known, so it only stands at its start; give it a controller"));
    }
    Ok(OpenScenario { xosc: xml.finish(), xodr, notes })
}

fn header(xml: &mut Xml, scene: &Scene, revision: Revision) {
    let (minor, description) = match revision {
        // ScenarioRunner takes y and headings with the other sign where a description begins with "CARLA:".
        Revision::V1_0 => (0, format!("EvoDrive: {}", scene.id)),
        Revision::V1_2 => (2, scene.id.clone()),
    };
    xml.empty(
        "FileHeader",
        &[
            ("revMajor", &1),
            ("revMinor", &minor),
            ("date", &"2020-01-01T00:00:00"),
            ("description", &description),
            ("author", &"EvoDrive"),
        ],
    );
}

fn road_network(xml: &mut Xml, scene: &Scene, road_file: &str) {
    xml.within("RoadNetwork", &[], |xml| {
        xml.empty("LogicFile", &[("filepath", &road_file)]);
        if scene.lights.is_empty() {
            return;
        }
        xml.within("TrafficSignals", &[], |xml| {
            for ix in 0..scene.lights.len() {
                controller(xml, scene, ix);
            }
        });
    });
}

/// Writes one controller for each light; its phases are the light's recorded states.
fn controller(xml: &mut Xml, scene: &Scene, ix: usize) {
    let mut phases: Vec<(usize, LightState)> = Vec::new();
    for &state in &scene.lights[ix].states {
        match phases.last_mut() {
            Some((steps, last)) if *last == state => *steps += 1,
            _ => phases.push((1, state)),
        }
    }
    let id = light_signal_id(ix);
    xml.within("TrafficSignalController", &[("name", &format!("controller_{id}"))], |xml| {
        for (number, (steps, state)) in phases.iter().enumerate() {
            let seconds = seconds(*steps);
            xml.within("Phase", &[("name", &format!("phase_{number}")), ("duration", &seconds)], |xml| {
                let state = match state {
                    LightState::Unknown => "off",
                    LightState::Stop => "red",
                    LightState::Caution => "yellow",
                    LightState::Go => "green",
                };
                xml.empty("TrafficSignalState", &[("trafficSignalId", &id), ("state", &state)]);
            });
        }
    });
}

/// Returns a step as seconds, in its shortest form.
fn seconds(step: usize) -> String {
    // 1 / DT_S is whole, so that 3 steps are 0.3 s and not 0.30000000000000004 s.
    decimal(step as f64 / (1.0 / DT_S).round())
}
