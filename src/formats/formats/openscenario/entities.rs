//! The entities of a scenario: names, kinds, boxes.

use std::collections::BTreeSet;

use super::super::staging::height_m;
use super::Revision;
use crate::formats::xml_write::{Attribute, Xml, decimal};
use crate::scene::{AgentKind, Scene, Track};

/// Length beyond which a vehicle is a truck, metres.
const CAR_LENGTH_M_MAX: f64 = 6.5;
/// Share of a vehicle's length between its axles.
const WHEELBASE_SHARE: f64 = 0.6;

/// Ego first, then the tracks, with names that any reader takes.
pub(super) struct Cast<'s> {
    pub members: Vec<Member<'s>>,
}

pub(super) struct Member<'s> {
    pub name: String,
    pub track: &'s Track,
    pub is_ego: bool,
}

impl<'s> Cast<'s> {
    pub fn of(scene: &'s Scene) -> Cast<'s> {
        let mut taken = BTreeSet::new();
        let mut members = vec![];
        let tracks = std::iter::once((&scene.ego.track, true)).chain(scene.tracks.iter().map(|track| (track, false)));
        for (track, is_ego) in tracks {
            let prefix = if is_ego { "ego" } else { word(track.kind) };
            let figures = |c: char| if c.is_ascii_alphanumeric() { c } else { '_' };
            let mut name: String = format!("{prefix}_{}", track.id).chars().map(figures).take(60).collect();
            while !taken.insert(name.clone()) {
                name.push('_');
            }
            members.push(Member { name, track, is_ego });
        }
        Cast { members }
    }

    pub fn write(&self, xml: &mut Xml, revision: Revision) {
        xml.within("Entities", &[], |xml| {
            for member in &self.members {
                xml.within("ScenarioObject", &[("name", &member.name)], |xml| member.write(xml, revision));
            }
        });
    }
}

fn word(kind: AgentKind) -> &'static str {
    match kind {
        AgentKind::Vehicle => "vehicle",
        AgentKind::Pedestrian => "pedestrian",
        AgentKind::Cyclist => "cyclist",
        AgentKind::Static => "object",
    }
}

impl Member<'_> {
    fn write(&self, xml: &mut Xml, revision: Revision) {
        match self.track.kind {
            AgentKind::Vehicle if self.track.length_m > CAR_LENGTH_M_MAX => {
                self.vehicle(xml, revision, ["truck", "vehicle.carlamotors.firetruck", "12000"]);
            }
            AgentKind::Vehicle => self.vehicle(xml, revision, ["car", "vehicle.tesla.model3", "1500"]),
            AgentKind::Cyclist => self.vehicle(xml, revision, ["bicycle", "vehicle.diamondback.century", "90"]),
            AgentKind::Pedestrian => {
                let model = "walker.pedestrian.0001";
                let mut attributes: Vec<Attribute<'_>> =
                    vec![("name", &model), ("mass", &"75"), ("pedestrianCategory", &"pedestrian")];
                if revision == Revision::V1_0 {
                    attributes.push(("model", &model));
                }
                xml.within("Pedestrian", &attributes, |xml| {
                    self.bounding_box(xml);
                    self.properties(xml);
                });
            }
            AgentKind::Static => xml.within(
                "MiscObject",
                &[("name", &"static.prop.streetbarrier"), ("mass", &"100"), ("miscObjectCategory", &"obstacle")],
                |xml| {
                    self.bounding_box(xml);
                    self.properties(xml);
                },
            ),
        }
    }

    fn vehicle(&self, xml: &mut Xml, revision: Revision, [category, model, mass_kg]: [&str; 3]) {
        let half = decimal(0.5 * WHEELBASE_SHARE * self.track.length_m);
        let track_width = decimal(0.85 * self.track.width_m);
        let mut attributes: Vec<Attribute<'_>> = vec![("name", &model), ("vehicleCategory", &category)];
        if revision == Revision::V1_2 {
            attributes.push(("mass", &mass_kg));
        }
        xml.within("Vehicle", &attributes, |xml| {
            self.bounding_box(xml);
            xml.empty("Performance", &[("maxSpeed", &"100"), ("maxAcceleration", &"10"), ("maxDeceleration", &"10")]);
            xml.within("Axles", &[], |xml| {
                for (name, steering, place) in
                    [("FrontAxle", "0.6", half.clone()), ("RearAxle", "0", format!("-{half}"))]
                {
                    xml.empty(
                        name,
                        &[
                            ("maxSteering", &steering),
                            ("wheelDiameter", &"0.6"),
                            ("trackWidth", &track_width),
                            ("positionX", &place),
                            ("positionZ", &"0.3"),
                        ],
                    );
                }
            });
            self.properties(xml);
        });
    }

    fn bounding_box(&self, xml: &mut Xml) {
        let height = height_m(self.track);
        xml.within("BoundingBox", &[], |xml| {
            xml.empty("Center", &[("x", &0), ("y", &0), ("z", &decimal(0.5 * height))]);
            let (width, length) = (decimal(self.track.width_m), decimal(self.track.length_m));
            xml.empty("Dimensions", &[("width", &width), ("length", &length), ("height", &decimal(height))]);
        });
    }

    /// Writes the properties by which ScenarioRunner recognises the ego.
    fn properties(&self, xml: &mut Xml) {
        let kind = if self.is_ego { "ego_vehicle" } else { "simulation" };
        xml.within("Properties", &[], |xml| {
            xml.empty("Property", &[("name", &"type"), ("value", &kind)]);
            xml.empty("Property", &[("name", &"scene_id"), ("value", &self.track.id)]);
        });
    }
}
