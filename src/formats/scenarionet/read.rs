//! MetaDrive and ScenarioNet scene descriptions, whatever file they stand in: Waymo, nuScenes and others in one schema.

use super::pickle::{Node, Numbers};
use crate::formats::assemble::{Log, LogLane, LogLight, LogTrack, assembled};
use crate::formats::centreline::{Across, widths_within};
use crate::formats::import_error::{ImportError, shown};
use crate::formats::imported::Imported;
use crate::kernel::{Vec2, num};
use crate::scene::validate::{STEPS_MAX, how_many};
use crate::scene::{AgentKind, DT_S, LaneKind, LeftOut, LightState, Origin, Sample};

/// Most samples of all tracks, observed or not.
const SAMPLES_MAX: usize = 4_000_000;
const FEATURES_MAX: usize = 50_000;
/// Most links, neighbours or lanes of one element.
const LINKS_MAX: usize = 64;
/// Points of all map features together: arrays may be shared, so the file's size does not bound them.
const POINTS_MAX: usize = 8_000_000;
/// The current step if the file does not name one: after one second of history, as in Waymo's data.
const CURRENT_UNSAID: usize = 10;
const MPH_IN_MPS: f64 = 0.44704;

/// The scenes of a description, whether it was a pickle or JSON.
pub(super) fn log_of(file_name: &str, root: &Node<'_>, format: &str) -> Result<Log, ImportError> {
    let metadata = root.needed("metadata")?;
    let times_s = times(root, &metadata)?;
    let steps = times_s.len();
    let id = [root.get("id"), metadata.get("scenario_id"), metadata.get("id")].into_iter().flatten();
    let id = id.filter_map(|node| node.id()).map(|id| id.to_string()).find(|id| !id.is_empty());
    let id = id.ok_or_else(|| root.refuse("an id"))?;
    let tracks = tracks(&root.needed("tracks")?, steps)?;
    let sdc = metadata.needed("sdc_id")?;
    let sdc_id = sdc.id().ok_or_else(|| sdc.refuse("the id of a track"))?;
    let ego = tracks.iter().position(|track| track.id == sdc_id);
    let current = metadata.get("current_time_index").and_then(|node| node.index());
    let mut log = Log {
        id: id.clone(),
        origin: Origin { format: format.into(), name: file_name.into() },
        current: current.unwrap_or(CURRENT_UNSAID.min(steps - 1)),
        times_s,
        ego: ego.ok_or_else(|| sdc.refuse("the id of a track"))?,
        tracks,
        objects_of_interest: metadata.get("objects_of_interest").map(|node| ids(&node)).unwrap_or_default(),
        ..Log::default()
    };
    features(&root.needed("map_features")?, &mut log)?;
    if let Some(lights) = root.get("dynamic_map_states") {
        log.lights = lights_of(&lights, steps)?;
    }
    Ok(log)
}

/// A log as a scene, or as something left out.
pub(in crate::formats) fn finished(file_name: &str, log: Log) -> Imported {
    let (id, file) = (log.id.clone(), file_name.to_string());
    let out = |what: String, reason: String| LeftOut { file: file.clone(), what, reason };
    match assembled(log) {
        Err(reason) => Imported { scenes: vec![], left_out: vec![out(id, reason)] },
        Ok((scene, parts)) => {
            let mut left_out: Vec<LeftOut> = parts.into_iter().map(|(what, why)| out(what, why)).collect();
            let violations = scene.validate();
            match violations.first() {
                None => Imported { scenes: vec![scene], left_out },
                Some(first) => {
                    let reason = format!("it breaks {} validation rules, the first is: {first}", how_many(&violations));
                    left_out.push(out(id, reason));
                    Imported { scenes: vec![], left_out }
                }
            }
        }
    }
}

fn times(root: &Node<'_>, metadata: &Node<'_>) -> Result<Vec<f64>, ImportError> {
    let given = ["ts", "timestep"].into_iter().filter_map(|name| metadata.get(name)).find(|times| !times.is_none());
    let times: Vec<f64> = match given {
        Some(given) => {
            let table = given.needed_numbers()?;
            if table.rows > STEPS_MAX {
                return Err(given.refuse("at most 1200 samples"));
            }
            (0..table.rows).map(|k| table.at(k, 0)).collect()
        }
        None => {
            let length = root.needed("length")?;
            let count = length.index().filter(|&n| n <= STEPS_MAX);
            let count = count.ok_or_else(|| length.refuse("a number of samples, at most 1200"))?;
            (0..count).map(|k| k as f64 * DT_S).collect()
        }
    };
    if times.len() < 2 || times.iter().any(|t| !t.is_finite()) {
        return Err(metadata.refuse("at least 2 finite sample times under \"ts\""));
    }
    Ok(times)
}

fn ids(node: &Node<'_>) -> Vec<String> {
    let items = node.items().into_iter().flatten();
    items.take(LINKS_MAX).filter_map(|item| item.id().map(|id| id.to_string())).collect()
}

fn tracks(node: &Node<'_>, steps: usize) -> Result<Vec<LogTrack>, ImportError> {
    let entries = node.entries().ok_or_else(|| node.refuse("a dictionary of tracks"))?;
    if entries.len().saturating_mul(steps) > SAMPLES_MAX {
        return Err(node.refuse("at most 4 million samples of tracks"));
    }
    entries.iter().map(|(id, entry)| track(id, entry, steps)).collect()
}

fn track(id: &str, entry: &Node<'_>, steps: usize) -> Result<LogTrack, ImportError> {
    let state = entry.needed("state")?;
    let table = |name: &str, columns: usize| -> Result<Numbers<'_>, ImportError> {
        let node = state.needed(name)?;
        let table = node.needed_numbers()?;
        if table.rows != steps || table.columns < columns {
            return Err(node.refuse(format!("{steps} rows of {columns}")));
        }
        Ok(table)
    };
    let (position, heading, valid) = (table("position", 2)?, table("heading", 1)?, table("valid", 1)?);
    let velocity = state.get("velocity").is_some().then(|| table("velocity", 2)).transpose()?;
    let mut samples = Vec::with_capacity(steps);
    for k in 0..steps {
        let observed = valid.at(k, 0) > 0.5;
        if !observed {
            samples.push(None);
            continue;
        }
        let velocity = velocity.as_ref().map_or(Vec2::ZERO, |v| Vec2::new(v.at(k, 0), v.at(k, 1)));
        let position = Vec2::new(position.at(k, 0), position.at(k, 1));
        let heading_rad = heading.at(k, 0);
        if !(position.is_finite() && velocity.is_finite() && heading_rad.is_finite()) {
            return Err(state.refuse(format!("finite numbers at valid step {k}")));
        }
        samples.push(Some(Sample { position, heading_rad, velocity }));
    }
    let kind = entry.needed("type")?;
    Ok(LogTrack {
        id: id.to_string(),
        kind: kind_of(kind.needed_text()?),
        length_m: median(&state, "length", &samples),
        width_m: median(&state, "width", &samples),
        samples,
    })
}

fn kind_of(name: &str) -> AgentKind {
    match name {
        "VEHICLE" => AgentKind::Vehicle,
        "PEDESTRIAN" => AgentKind::Pedestrian,
        "CYCLIST" => AgentKind::Cyclist,
        _ => AgentKind::Static,
    }
}

/// Median of a size over the observed samples; 0 if there is none.
fn median(state: &Node<'_>, name: &str, samples: &[Option<Sample>]) -> f64 {
    let Some(node) = state.get(name) else { return 0.0 };
    if let Some(number) = node.number() {
        return number;
    }
    let Some(table) = node.numbers() else { return 0.0 };
    let observed = (0..samples.len()).filter(|&k| samples[k].is_some()).map(|k| table.at(k, 0));
    let sizes: Vec<f64> = observed.filter(|size| size.is_finite() && *size > 0.0).collect();
    num::quantile(&sizes, 0.5).unwrap_or(0.0)
}

fn features(node: &Node<'_>, log: &mut Log) -> Result<(), ImportError> {
    let entries = node.entries().ok_or_else(|| node.refuse("a dictionary of map features"))?;
    if entries.len() > FEATURES_MAX {
        return Err(node.refuse("at most 50000 map features"));
    }
    let mut left = POINTS_MAX;
    for (id, feature) in &entries {
        let kind = feature.needed("type")?.needed_text()?;
        match kind {
            _ if kind.starts_with("LANE_") => log.lanes.push(lane(id, kind, feature, &mut left)?),
            _ if kind.starts_with("ROAD_EDGE") || kind.starts_with("BOUNDARY") => {
                log.edges.push(line(feature, "polyline", &mut left)?);
            }
            "CROSSWALK" => log.crosswalks.push(line(feature, "polygon", &mut left)?),
            "STOP_SIGN" => {
                let position = feature.needed("position")?;
                let table = position.needed_numbers()?;
                // A single place is one row of coordinates, which is read as a column.
                let place =
                    if table.columns > 1 { (table.at(0, 0), table.at(0, 1)) } else { (table.at(0, 0), table.at(1, 0)) };
                let place = Vec2::new(place.0, place.1);
                if !place.is_finite() {
                    return Err(position.refuse("a finite place"));
                }
                log.stop_signs.push((place, feature.get("lane").map(|lanes| ids(&lanes)).unwrap_or_default()));
            }
            // Painted lines, bumps and driveways are left out, because a rollout does not see them.
            _ => {}
        }
    }
    Ok(())
}

fn line(feature: &Node<'_>, name: &str, left: &mut usize) -> Result<Vec<Vec2>, ImportError> {
    let node = feature.needed(name)?;
    if node.items().is_some_and(|items| items.len() == 0) {
        return Ok(vec![]);
    }
    let table = node.needed_numbers()?;
    *left = left.checked_sub(table.rows).ok_or_else(|| node.refuse("at most 8 million map points"))?;
    let points: Vec<Vec2> = (0..table.rows).map(|k| Vec2::new(table.at(k, 0), table.at(k, 1))).collect();
    match points.iter().position(|p| !p.is_finite()) {
        Some(bad) => Err(node.refuse(format!("finite coordinates at point {bad}"))),
        None => Ok(points),
    }
}

fn lane(id: &str, kind: &str, feature: &Node<'_>, left: &mut usize) -> Result<LogLane, ImportError> {
    let centre = line(feature, "polyline", left)?;
    let width = feature.get("width").and_then(|node| node.numbers());
    let width = width.filter(|table| table.rows == centre.len() && table.columns >= 2);
    let points = match (&width, feature.get("polygon").is_some()) {
        (Some(width), _) => {
            let across = |(k, p): (usize, &Vec2)| Across::new(*p, width.at(k, 0), width.at(k, 1));
            centre.iter().enumerate().map(across).collect()
        }
        (None, true) => widths_within(&centre, &line(feature, "polygon", left)?),
        (None, false) => centre.iter().map(|&p| Across::new(p, 0.0, 0.0)).collect(),
    };
    let mph = feature.get("speed_limit_mph").and_then(|node| node.number());
    let kmh = feature.get("speed_limit_kmh").and_then(|node| node.number());
    let limit = mph.map(|v| v * MPH_IN_MPS).or(kmh.map(|v| v / 3.6));
    Ok(LogLane {
        id: id.to_string(),
        kind: match kind {
            "LANE_FREEWAY" => LaneKind::Freeway,
            "LANE_BIKE_LANE" => LaneKind::Bike,
            _ => LaneKind::Street,
        },
        points,
        entries: feature.get("entry_lanes").map(|node| ids(&node)).unwrap_or_default(),
        exits: feature.get("exit_lanes").map(|node| ids(&node)).unwrap_or_default(),
        left: feature.get("left_neighbor").map(|node| beside(&node)).unwrap_or_default(),
        right: feature.get("right_neighbor").map(|node| beside(&node)).unwrap_or_default(),
        speed_limit_mps: limit.filter(|v| v.is_finite() && *v > 0.0 && *v <= 100.0),
    })
}

/// The neighbours of a side, the one that is beside the lane for the longest way first; plain ids in their order.
fn beside(node: &Node<'_>) -> Vec<String> {
    let mut side: Vec<(usize, String)> = Vec::new();
    for item in node.items().into_iter().flatten().take(LINKS_MAX) {
        let (id, length) = match item.get("feature_id") {
            Some(id) => {
                let index = |key: &str| item.get(key).and_then(|n| n.index()).unwrap_or(0);
                (id.id(), index("self_end_index").saturating_sub(index("self_start_index")))
            }
            None => (item.id(), 0),
        };
        side.extend(id.map(|id| (length, id.to_string())));
    }
    side.sort_by_key(|(length, _)| std::cmp::Reverse(*length));
    side.into_iter().map(|(_, id)| id).collect()
}

fn lights_of(node: &Node<'_>, steps: usize) -> Result<Vec<LogLight>, ImportError> {
    let entries = node.entries().ok_or_else(|| node.refuse("a dictionary of lights"))?;
    if entries.len().saturating_mul(steps) > SAMPLES_MAX {
        return Err(node.refuse("at most 4 million states of lights"));
    }
    let mut lights = Vec::new();
    for (key, entry) in &entries {
        let state = entry.needed("state")?;
        let states = state.get("object_state").and_then(|node| node.items());
        let states = states.ok_or_else(|| state.refuse("a list under \"object_state\""))?;
        if states.len() > steps {
            return Err(state.refuse(format!("at most {steps} states")));
        }
        let lane = entry.get("lane").and_then(|node| node.id().map(|id| id.to_string()));
        let stop = entry.get("stop_point").and_then(|node| node.numbers());
        let stop_point = stop.map(|t| if t.columns > 1 { (t.at(0, 0), t.at(0, 1)) } else { (t.at(0, 0), t.at(1, 0)) });
        lights.push(LogLight {
            lane: lane.unwrap_or_else(|| key.to_string()),
            stop_point: stop_point.map(|(x, y)| Vec2::new(x, y)).filter(|p| p.is_finite()),
            states: states.map(|node| node.text().map_or(LightState::Unknown, light_state)).collect(),
        });
    }
    Ok(lights)
}

fn light_state(name: &str) -> LightState {
    let name = shown(name);
    let says = |word: &str| name.contains(word);
    if says("STOP") || says("RED") {
        LightState::Stop
    } else if says("CAUTION") || says("YELLOW") {
        LightState::Caution
    } else if says("GO") || says("GREEN") {
        LightState::Go
    } else {
        LightState::Unknown
    }
}
