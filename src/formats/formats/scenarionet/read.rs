//! MetaDrive and ScenarioNet scene descriptions, in any file form: Waymo, nuScenes and others in one schema.

use super::pickle::{Node, Numbers};
use crate::formats::assemble::assembled;
use crate::formats::centreline::{Across, widths_within};
use crate::formats::conventions::Conventions;
use crate::formats::derived::kind_named;
use crate::formats::import_error::{ImportError, shown};
use crate::formats::imported::Imported;
use crate::formats::log::{Log, LogLane, LogLight, LogTrack, SampleTimes};
use crate::formats::speed_limit::limit_mps;
use crate::kernel::{Vec2, num};
use crate::scene::validate::{SPEED_MAX_MPS, STEPS_MAX, how_many};
use crate::scene::{DT_S, LaneKind, LeftOut, LightState, Origin, Sample};

/// Most samples of all tracks, observed or not.
const SAMPLES_MAX: usize = 4_000_000;
const FEATURES_MAX: usize = 50_000;
/// Most links, neighbours or lanes of one element.
const LINKS_MAX: usize = 64;
/// Most points of all map features together: arrays may be shared, so the file's size does not bound them.
const POINTS_MAX: usize = 8_000_000;
/// The current step if the file does not name one: after one second of history, as in Waymo's data.
const CURRENT_UNSAID: usize = 10;
const MPH_IN_MPS: f64 = 0.44704;
/// A reader's words on the rest when it leaves out a part.
const REST_KEPT: &str = "the rest of the scene is kept";

/// Returns the log of a description from a pickle or JSON. Parts that cannot be read are left out in `imported`.
pub(super) fn log_of(
    file_name: &str,
    root: &Node<'_>,
    format: &str,
    imported: &mut Imported,
) -> Result<Log, ImportError> {
    let metadata = root.needed("metadata")?;
    let times_s = times(root, &metadata)?;
    let steps = times_s.len();
    let id = [root.get("id"), metadata.get("scenario_id"), metadata.get("id")].into_iter().flatten();
    let id = id.filter_map(|node| node.id()).map(|id| id.to_string()).find(|id| !id.is_empty());
    let id = id.unwrap_or_else(|| {
        let stem = file_name.split('.').next().unwrap_or(file_name).to_string();
        imported.leave_out(file_name, || (LeftOut::SCENE_ID.into(), format!("there is none; {stem:?} was taken")));
        stem
    });
    let sdc = metadata.needed("sdc_id")?;
    let sdc_id = sdc.id().ok_or_else(|| sdc.refuse("the id of a track"))?;
    let tracks = tracks(&root.needed("tracks")?, steps, &sdc_id, imported)?;
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
    features(&root.needed("map_features")?, &mut log, imported)?;
    if let Some(lights) = root.get("dynamic_map_states").filter(|node| !node.is_none()) {
        log.lights = lights_of(&lights, steps, imported)?;
    }
    Ok(log)
}

/// Adds a log as a scene, or as a part left out.
pub(in crate::formats) fn finish(file_name: &str, log: Log, conventions: Conventions, imported: &mut Imported) {
    let id = log.id.clone();
    let (log, differ) = log.timed(conventions.times);
    if let SampleTimes::Every(step_s) = conventions.times
        && differ
    {
        let reason = format!("they were not read: each sample counts as {step_s} s after the one before it");
        imported.leave_out(file_name, || (LeftOut::SAMPLE_TIMES.into(), reason));
    }
    match assembled(Log { conventions: Some(conventions), ..log }) {
        Err(reason) => imported.leave_out(file_name, || (id, reason)),
        Ok((scene, parts)) => {
            parts.into_iter().for_each(|part| imported.leave_out(file_name, || part));
            let violations = scene.validate();
            match violations.first() {
                None => imported.scenes.push(scene),
                Some(first) => imported.leave_out(file_name, || {
                    (id, format!("it breaks {} validation rules, the first is: {first}", how_many(&violations)))
                }),
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
    if times.len() < 2 || times.iter().filter(|t| t.is_finite()).count() < 2 {
        return Err(metadata.refuse("at least 2 finite sample times under \"ts\""));
    }
    Ok(times)
}

fn ids(node: &Node<'_>) -> Vec<String> {
    let items = node.items().into_iter().flatten();
    items.take(LINKS_MAX).filter_map(|item| item.id().map(|id| id.to_string())).collect()
}

/// Returns the tracks that can be read; the one of the ego must be.
fn tracks(node: &Node<'_>, steps: usize, ego: &str, imported: &mut Imported) -> Result<Vec<LogTrack>, ImportError> {
    let entries = node.entries().ok_or_else(|| node.refuse("a dictionary of tracks"))?;
    if entries.len().saturating_mul(steps) > SAMPLES_MAX {
        return Err(node.refuse("at most 4 million samples of tracks"));
    }
    let mut tracks = Vec::with_capacity(entries.len());
    for (id, entry) in &entries {
        match track(id, entry, steps) {
            Ok(track) => tracks.push(track),
            Err(error) if id == ego => return Err(error),
            Err(error) => imported.leave_out_for(format!("track {}", shown(id)), &error, "the other tracks are kept"),
        }
    }
    Ok(tracks)
}

/// Reads a track. NaN stays NaN: its sample is dropped later, or filled in from the others.
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
    let given = |name: &str, columns: usize| {
        let is_there = state.get(name).is_some_and(|node| !node.is_none());
        is_there.then(|| table(name, columns)).transpose()
    };
    let (position, valid) = (table("position", 2)?, table("valid", 1)?);
    let (heading, velocity) = (given("heading", 1)?, given("velocity", 2)?);
    let mut samples = Vec::with_capacity(steps);
    for k in 0..steps {
        let number = |table: &Option<Numbers<'_>>, column| table.as_ref().map_or(f64::NAN, |t| t.at(k, column));
        samples.push((valid.at(k, 0) > 0.5).then(|| Sample {
            position: Vec2::new(position.at(k, 0), position.at(k, 1)),
            heading_rad: number(&heading, 0),
            velocity: Vec2::new(number(&velocity, 0), number(&velocity, 1)),
        }));
    }
    let kind = entry.get("type").and_then(|kind| kind.text()).unwrap_or_default();
    Ok(LogTrack {
        id: id.to_string(),
        kind: kind_named(kind).ok_or_else(|| kind.to_string()),
        length_m: median(&state, "length", &samples),
        width_m: median(&state, "width", &samples),
        samples,
        heights_m: if position.columns > 2 { (0..steps).map(|k| position.at(k, 2)).collect() } else { vec![] },
    })
}

/// Returns the median of a size over the observed samples; 0 if there is none.
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

fn features(node: &Node<'_>, log: &mut Log, imported: &mut Imported) -> Result<(), ImportError> {
    let entries = node.entries().ok_or_else(|| node.refuse("a dictionary of map features"))?;
    if entries.len() > FEATURES_MAX {
        return Err(node.refuse("at most 50000 map features"));
    }
    let mut left = POINTS_MAX;
    for (id, feature) in &entries {
        if let Err(error) = add_feature(id, feature, log, &mut left, imported) {
            if left == 0 {
                return Err(error);
            }
            let kind = feature.get("type").and_then(|kind| kind.text()).unwrap_or_default();
            let what = if kind.starts_with("LANE_") { "lane" } else { "map feature" };
            imported.leave_out_for(format!("{what} {}", shown(id)), &error, REST_KEPT);
        }
    }
    if log.lanes.is_empty() && entries.iter().any(|(_, feature)| is_lane(feature)) {
        return Err(node.refuse("at least one lane that can be read"));
    }
    Ok(())
}

fn is_lane(feature: &Node<'_>) -> bool {
    feature.get("type").and_then(|kind| kind.text()).is_some_and(|kind| kind.starts_with("LANE_"))
}

fn add_feature(
    id: &str,
    feature: &Node<'_>,
    log: &mut Log,
    left: &mut usize,
    imported: &mut Imported,
) -> Result<(), ImportError> {
    let kind = feature.needed("type")?.needed_text()?;
    match kind {
        _ if kind.starts_with("LANE_") => log.lanes.push(lane(id, kind, feature, left, imported)?),
        _ if kind.starts_with("ROAD_EDGE") || kind.starts_with("BOUNDARY") => {
            log.edges.push(line(feature, "polyline", left)?);
        }
        "CROSSWALK" => log.crosswalks.push(line(feature, "polygon", left)?),
        "STOP_SIGN" => {
            let table = feature.needed("position")?.needed_numbers()?;
            log.stop_signs.push((place(&table), feature.get("lane").map(|lanes| ids(&lanes)).unwrap_or_default()));
        }
        // Painted lines, bumps and driveways are left out, because a rollout does not see them.
        _ => {}
    }
    Ok(())
}

/// Reads a single place: one row of coordinates, which is read as a column.
fn place(table: &Numbers<'_>) -> Vec2 {
    let (x, y) = if table.columns > 1 { (table.at(0, 0), table.at(0, 1)) } else { (table.at(0, 0), table.at(1, 0)) };
    Vec2::new(x, y)
}

/// Returns the points of a line; points that are no places are left out later. `left` becomes 0 where there are too many in all.
fn line(feature: &Node<'_>, name: &str, left: &mut usize) -> Result<Vec<Vec2>, ImportError> {
    let node = feature.needed(name)?;
    if node.items().is_some_and(|items| items.len() == 0) {
        return Ok(vec![]);
    }
    let table = node.needed_numbers()?;
    let Some(fewer) = left.checked_sub(table.rows).filter(|fewer| *fewer > 0) else {
        *left = 0;
        return Err(node.refuse("at most 8 million map points"));
    };
    *left = fewer;
    Ok((0..table.rows).map(|k| Vec2::new(table.at(k, 0), table.at(k, 1))).collect())
}

fn lane(
    id: &str,
    kind: &str,
    feature: &Node<'_>,
    left: &mut usize,
    imported: &mut Imported,
) -> Result<LogLane, ImportError> {
    let centre = line(feature, "polyline", left)?;
    let width = feature.get("width").and_then(|node| node.numbers());
    let width = width.filter(|table| table.rows == centre.len() && table.columns >= 2);
    let whole = centre.iter().all(|p| p.is_finite());
    let points = match (&width, feature.get("polygon").filter(|_| whole)) {
        (Some(width), _) => {
            let across = |(k, p): (usize, &Vec2)| Across::new(*p, width.at(k, 0), width.at(k, 1));
            centre.iter().enumerate().map(across).collect()
        }
        (None, Some(_)) => {
            let outline =
                imported.read(&format!("outline of lane {}", shown(id)), line(feature, "polygon", left), REST_KEPT);
            widths_within(&centre, &outline.unwrap_or_default())
        }
        (None, None) => centre.iter().map(|&p| Across::new(p, 0.0, 0.0)).collect(),
    };
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
        speed_limit_mps: limit(id, feature, imported),
    })
}

/// Returns the speed limit of a lane: a number, or a text that may name its unit.
fn limit(id: &str, feature: &Node<'_>, imported: &mut Imported) -> Option<f64> {
    let (mph, kmh) = (feature.get("speed_limit_mph"), feature.get("speed_limit_kmh"));
    let number = |node: &Option<Node<'_>>| node.as_ref().and_then(|node| node.number());
    // A limit of 0, or infinity, means that there is none.
    let plain = number(&mph).map(|v| v * MPH_IN_MPS).or(number(&kmh).map(|v| v / 3.6));
    if plain.is_some() {
        return plain.filter(|v| v.is_finite() && *v > 0.0 && *v <= SPEED_MAX_MPS);
    }
    let given =
        [(mph, "mph"), (kmh, "km/h")].into_iter().find_map(|(node, unit)| Some((node.clone()?.text()?, node?, unit)));
    let (text, node, unit) = given?;
    let limit = limit_mps(text, unit).map_err(|expected| node.refuse(expected));
    imported.read(&format!("speed limit of lane {}", shown(id)), limit, "the lane is kept without it")
}

/// Returns the neighbours of a side, the one that is beside the lane for the longest way first; plain ids in their order.
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

fn lights_of(node: &Node<'_>, steps: usize, imported: &mut Imported) -> Result<Vec<LogLight>, ImportError> {
    let entries = node.entries().ok_or_else(|| node.refuse("a dictionary of lights"))?;
    if entries.len().saturating_mul(steps) > SAMPLES_MAX {
        return Err(node.refuse("at most 4 million states of lights"));
    }
    let read = |(key, entry): &(std::borrow::Cow<'_, str>, Node<'_>)| {
        imported.read(&format!("light {}", shown(key)), light(key, entry, steps), "the other lights are kept")
    };
    Ok(entries.iter().filter_map(read).collect())
}

fn light(key: &str, entry: &Node<'_>, steps: usize) -> Result<LogLight, ImportError> {
    let state = entry.needed("state")?;
    let states = state.get("object_state").and_then(|node| node.items());
    let states = states.ok_or_else(|| state.refuse("a list under \"object_state\""))?;
    if states.len() > steps {
        return Err(state.refuse(format!("at most {steps} states")));
    }
    let lane = entry.get("lane").and_then(|node| node.id().map(|id| id.to_string()));
    let stop_point = entry.get("stop_point").and_then(|node| node.numbers()).map(|table| place(&table));
    Ok(LogLight {
        lane: lane.unwrap_or_else(|| key.to_string()),
        stop_point: stop_point.filter(|p| p.is_finite()),
        states: states.map(|node| node.text().map_or(LightState::Unknown, light_state)).collect(),
    })
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
