//! Reads scenario files: where the scenarios of a family start in each town, and where their actors stand.

use std::collections::BTreeMap;

use serde::Deserialize;
use serde_json::value::RawValue;

use crate::formats::import_error::{ImportError, shown};
use crate::formats::imported::Imported;
use crate::formats::json_numbers::without_nan;
use crate::kernel::{Polyline, Pose};
use crate::scene::safebench::{SPAWNS_MAX, TrafficFamily};

/// The benchmark's files have less than 1 MiB.
const BYTES_MAX: usize = 16 << 20;
/// Events of one file.
const EVENTS_MAX: usize = 100_000;
/// Coordinates of a town lie within this, metres.
const COORDINATE_MAX_M: f64 = 100_000.0;

/// One place where a scenario may start.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Event {
    pub trigger: Pose,
    /// In the order left, front, right.
    pub actors: Vec<Pose>,
}

/// The events of all scenario files by family and town, in the order of the files.
#[derive(Clone, Debug, Default)]
pub struct Events(BTreeMap<(TrafficFamily, String), Vec<Event>>);

/// Its events as they stand in the file: each is read by itself, so that a bad one is left out alone.
#[derive(Deserialize)]
struct File<'f> {
    #[serde(borrow)]
    available_scenarios: Vec<BTreeMap<String, Vec<Scenario<'f>>>>,
}

#[derive(Deserialize)]
struct Scenario<'f> {
    #[serde(borrow)]
    available_event_configurations: Vec<&'f RawValue>,
    #[serde(alias = "scenario_type")]
    scenario_name: String,
}

#[derive(Deserialize)]
struct Configuration {
    transform: Transform,
    #[serde(default)]
    other_actors: Option<Actors>,
}

#[derive(Default, Deserialize)]
struct Actors {
    #[serde(default)]
    left: Vec<Transform>,
    #[serde(default)]
    front: Vec<Transform>,
    #[serde(default)]
    right: Vec<Transform>,
}

#[derive(Deserialize)]
struct Transform {
    x: Number,
    y: Number,
    yaw: Number,
}

/// The files often write numbers as texts.
#[derive(Deserialize)]
#[serde(untagged)]
enum Number {
    Plain(f64),
    Text(String),
}

impl Number {
    fn value(&self) -> Option<f64> {
        let value = match self {
            Number::Plain(value) => *value,
            Number::Text(text) => text.trim().parse().ok()?,
        };
        (value.abs() <= COORDINATE_MAX_M).then_some(value)
    }
}

impl Transform {
    fn pose(&self) -> Option<Pose> {
        Some(super::pose::pose(self.x.value()?, self.y.value()?, self.yaw.value()?))
    }
}

impl Events {
    pub(super) fn add(&mut self, file: &str, bytes: &[u8], imported: &mut Imported) -> Result<(), ImportError> {
        let remedy = "fetch the benchmark's file again";
        let refuse = |place: String, expected: &str| ImportError::new(file, place, expected, remedy);
        if bytes.len() > BYTES_MAX {
            return Err(refuse("byte 0".into(), "at most 16 MiB"));
        }
        let bytes = without_nan(bytes);
        let read: File<'_> = serde_json::from_slice(&bytes).map_err(|error| {
            refuse(format!("line {}", error.line()), &format!("a scenario file of SafeBench ({error})"))
        })?;
        let mut count = 0;
        for (town, scenarios) in read.available_scenarios.into_iter().flatten() {
            for scenario in scenarios {
                let name = &scenario.scenario_name;
                let family = TrafficFamily::ALL.into_iter().find(|family| family.scenario_name() == name);
                // Ordinary driving (scenario_00) and all unknown scenarios belong to no traffic family.
                let Some(family) = family else { continue };
                for (k, raw) in scenario.available_event_configurations.iter().enumerate() {
                    count += 1;
                    let place = || format!("{}, {} event {k}", shown(&town), shown(name));
                    if count > EVENTS_MAX {
                        return Err(refuse(place(), "at most 100000 events"));
                    }
                    let read = serde_json::from_str::<Configuration>(raw.get()).map_err(|error| {
                        refuse(place(), &format!("an event of SafeBench ({})", shown(&error.to_string())))
                    });
                    let read = read.and_then(|configuration| {
                        event(&configuration)
                            .ok_or_else(|| refuse(place(), "finite x, y and yaw, and at most 16 actors"))
                    });
                    if let Some(event) = imported.read(&place(), read, "the other events are kept") {
                        self.0.entry((family, town.clone())).or_default().push(event);
                    }
                }
            }
        }
        Ok(())
    }

    /// The event of a family in a town that lies nearest to a route, at most `within_m` beside it; if two are equally
    /// near, the first.
    pub(super) fn nearest(&self, family: TrafficFamily, town: &str, route: &Polyline, within_m: f64) -> Option<&Event> {
        let events = self.0.get(&(family, town.to_string()))?;
        let mut best: Option<(f64, &Event)> = None;
        for event in events {
            let at = route.project(event.trigger.position);
            // The distance to the clamped point: a trigger beyond the route's end is then far from the route.
            let beside_m = route.at(at.s_m).distance(event.trigger.position);
            if beside_m <= within_m && best.is_none_or(|(least_m, _)| beside_m < least_m - 1e-6) {
                best = Some((beside_m, event));
            }
        }
        best.map(|(_, event)| event)
    }
}

fn event(configuration: &Configuration) -> Option<Event> {
    let none = Actors::default();
    let others = configuration.other_actors.as_ref().unwrap_or(&none);
    let actors: Option<Vec<Pose>> =
        others.left.iter().chain(&others.front).chain(&others.right).map(Transform::pose).collect();
    let actors = actors.filter(|actors| actors.len() <= SPAWNS_MAX)?;
    Some(Event { trigger: configuration.transform.pose()?, actors })
}
