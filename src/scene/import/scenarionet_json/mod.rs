//! ScenarioNet's ScenarioDescription as JSON: what this project exports, and what `json.dump` makes of the pickles'
//! dictionaries (arrays as lists). Coordinates become metres from the ego's place at the current step, unless the
//! file is an export of this project, which is in a local frame already.

mod keys;
mod road;
mod tracks;

use std::collections::BTreeMap;

use super::error::{ImportError, shown};
use super::summary::Imported;
use crate::kernel::Vec2;
use crate::scene::validate::STEPS_MAX;
use crate::scene::{DT_S, Ego, LaneIx, LeftOut, Light, LightState, Origin, Road, Scene, StopSign, Track};
use keys::{Description, FeatureIn, Name, Names};
use tracks::{driven, track};

const BYTES_MAX: usize = 512 << 20;
/// Stamps may be off by this much, seconds; the Waymo data stay below a millisecond.
const STAMP_OFF_S_MAX: f64 = 0.005;

/// The scene of a ScenarioDescription in JSON. An export of this project gives the very scene it was made of; if it
/// was edited since, what its standard keys say, with that said in `left_out`.
///
/// # Errors
/// No JSON, no ScenarioDescription, no self-driving car, or another rate than 10 Hz.
pub fn import(file: &str, bytes: &[u8]) -> Result<Imported, ImportError> {
    let description = parsed(file, bytes)?;
    let origin = Origin { format: "scenarionet-json".into(), name: file.into() };
    let mut left_out = Vec::new();
    let is_local = description.metadata.evodrive.is_some();
    let read = Reading { file, description: &description, is_local }.scene(origin.clone(), &mut left_out)?;
    let scene = match &description.metadata.evodrive {
        None => read,
        Some(remainder) => remainder.laid_over(&read, &origin).unwrap_or_else(|| {
            let reason = "the file was edited after its export, or exported by another version; what its standard \
                          keys say was read, without the exact lane boundaries, start and route";
            left_out.push(LeftOut { file: file.into(), what: "metadata.evodrive".into(), reason: reason.into() });
            read
        }),
    };
    Ok(Imported { scenes: vec![scene], left_out })
}

/// What the standard keys of an export of this project say, without what stands beside them.
pub(in crate::scene) fn read_plainly(file: &str, bytes: &[u8]) -> Result<Scene, ImportError> {
    let description = parsed(file, bytes)?;
    Reading { file, description: &description, is_local: true }.scene(Origin::default(), &mut Vec::new())
}

fn parsed(file: &str, bytes: &[u8]) -> Result<Description, ImportError> {
    if bytes.len() > BYTES_MAX {
        return Err(ImportError::new(file, "byte 0", "at most 512 MiB of JSON", "split the file"));
    }
    serde_json::from_slice(bytes).map_err(|error| {
        let place = format!("line {} column {}", error.line(), error.column());
        let expected = format!("a ScenarioDescription as JSON ({})", shown(&error.to_string()));
        ImportError::new(file, place, expected, "write the dictionary of a ScenarioNet pickle as JSON, arrays as lists")
    })
}

struct Reading<'d> {
    file: &'d str,
    description: &'d Description,
    /// Coordinates are to stay as they are.
    is_local: bool,
}

impl Reading<'_> {
    fn refuse(&self, place: &str, expected: impl Into<String>) -> ImportError {
        ImportError::new(self.file, place, expected, "mend the file or leave it out")
    }

    fn scene(&self, origin: Origin, left_out: &mut Vec<LeftOut>) -> Result<Scene, ImportError> {
        let Description { length: steps, metadata, .. } = self.description;
        let steps = *steps;
        self.check_times(steps)?;
        let mut leave = |what: &str, reason: String| {
            left_out.push(LeftOut { file: self.file.into(), what: shown(what), reason });
        };
        let sdc = metadata.sdc_id.as_ref().map(Name::text);
        let sdc = sdc.ok_or_else(|| self.refuse("metadata.sdc_id", "the id of the self-driving car's track"))?;
        let mut ego = None;
        let mut tracks: Vec<Track> = Vec::new();
        for (id, given) in &self.description.tracks.0 {
            match track(id, given, steps) {
                Ok(track) if *id == sdc && ego.is_none() => ego = Some(track),
                Ok(track) if track.span().is_some() => tracks.push(track),
                Ok(_) => leave(id, "no sample of it is valid".into()),
                Err(reason) => leave(id, reason),
            }
        }
        let ego = ego.ok_or_else(|| self.refuse("tracks", format!("a readable track {:?}, the ego", shown(&sdc))))?;
        let current_step = metadata.current_time_index;
        let here = ego.at(current_step).map(|sample| sample.position);
        let here = here.ok_or_else(|| self.refuse("tracks", "the ego's sample at current_time_index"))?;
        let (mut road, index) = self.road(&mut leave);
        let lights = self.lights(steps, &road, &index, &mut leave);
        let named = metadata.objects_of_interest.iter().map(Name::text);
        let objects_of_interest = named.filter_map(|id| tracks.iter().position(|track| track.id == id)).collect();
        road.edges = self.lines(&["ROAD_EDGE_BOUNDARY", "ROAD_EDGE_MEDIAN"], 2, |f| f.polyline.as_ref());
        let id = self.description.id.as_ref().or(metadata.scenario_id.as_ref());
        let mut scene = Scene {
            id: id.map_or_else(|| self.file.to_string(), Name::text),
            origin,
            steps,
            current_step,
            road,
            tracks,
            ego: Ego {
                route: driven(&ego, current_step),
                track: ego,
                start_step: current_step,
                target_speed_mps: None,
            },
            objects_of_interest,
            lights,
            stop_signs: self.stop_signs(&index),
            crosswalks: self.lines(&["CROSSWALK"], 3, |f| f.polygon.as_ref()),
        };
        if !self.is_local {
            shift(&mut scene, here);
        }
        Ok(scene)
    }

    fn check_times(&self, steps: usize) -> Result<(), ImportError> {
        if !(2..=STEPS_MAX).contains(&steps) {
            return Err(self.refuse("length", format!("2 to {STEPS_MAX} steps, found {steps}")));
        }
        let Some(stamps) = &self.description.metadata.ts else {
            return Err(self.refuse("metadata.ts", "the time of every step, seconds"));
        };
        let first = stamps.first().copied().unwrap_or(0.0);
        let off = |(k, stamp): (usize, &f64)| (stamp - first - k as f64 * DT_S).abs() > STAMP_OFF_S_MAX;
        if stamps.len() != steps || stamps.iter().enumerate().any(off) {
            return Err(self.refuse("metadata.ts", format!("{steps} times, 0.1 s apart (resample the scene to 10 Hz)")));
        }
        Ok(())
    }

    fn lights(
        &self,
        steps: usize,
        road: &Road,
        index: &BTreeMap<String, LaneIx>,
        leave: &mut impl FnMut(&str, String),
    ) -> Vec<Light> {
        let mut lights = Vec::new();
        for (id, given) in &self.description.dynamic_map_states.0 {
            let lane = index.get(&given.lane.as_ref().map_or_else(|| id.clone(), Name::text));
            let Some(&lane) = lane else {
                leave(id, "its lane is not in the map".into());
                continue;
            };
            let mut states: Vec<LightState> = given.state.object_state.iter().take(steps).map(light_state).collect();
            states.resize(steps, LightState::Unknown);
            let end = road.lanes[lane].centre[0];
            let stop_point = given.stop_point.as_deref().and_then(point).unwrap_or(end);
            lights.push(Light { lane, stop_point, states });
        }
        lights
    }

    fn stop_signs(&self, index: &BTreeMap<String, LaneIx>) -> Vec<StopSign> {
        let signs = self.description.map_features.0.iter().filter(|(_, feature)| feature.r#type == "STOP_SIGN");
        let read = |(_, feature): &(String, FeatureIn)| {
            let names = match &feature.lane {
                Some(Names::Many(names)) => names.clone(),
                Some(Names::One(name)) => vec![name.clone()],
                None => vec![],
            };
            let lanes = names.iter().filter_map(|name| index.get(&name.text()).copied()).collect();
            Some(StopSign { position: point(feature.position.as_deref()?)?, lanes })
        };
        signs.filter_map(read).collect()
    }

    fn lines<'f>(
        &'f self,
        types: &[&str],
        least: usize,
        of: impl Fn(&'f FeatureIn) -> Option<&'f Vec<Vec<f64>>>,
    ) -> Vec<Vec<Vec2>> {
        let features = self.description.map_features.0.iter().filter(|(_, f)| types.contains(&f.r#type.as_str()));
        let lines = features.filter_map(|(_, f)| of(f).or(f.polygon.as_ref()).or(f.polyline.as_ref()));
        lines.map(|line| line.iter().filter_map(|p| point(p)).collect()).filter(|l: &Vec<_>| l.len() >= least).collect()
    }
}

fn light_state(name: &Option<String>) -> LightState {
    match name.as_deref().unwrap_or("") {
        name if name.ends_with("STOP") || name.ends_with("RED") => LightState::Stop,
        name if name.ends_with("CAUTION") || name.ends_with("YELLOW") => LightState::Caution,
        name if name.ends_with("GO") || name.ends_with("GREEN") => LightState::Go,
        _ => LightState::Unknown,
    }
}

/// The first two numbers, if they are finite.
fn point(row: &[f64]) -> Option<Vec2> {
    let p = Vec2::new(*row.first()?, *row.get(1)?);
    p.is_finite().then_some(p)
}

fn shift(scene: &mut Scene, origin: Vec2) {
    let move_line = |line: &mut Vec<Vec2>| line.iter_mut().for_each(|p| *p = *p - origin);
    for lane in &mut scene.road.lanes {
        [&mut lane.centre, &mut lane.left, &mut lane.right].into_iter().for_each(move_line);
    }
    scene.road.edges.iter_mut().for_each(move_line);
    scene.crosswalks.iter_mut().for_each(move_line);
    move_line(&mut scene.ego.route);
    for track in scene.tracks.iter_mut().chain([&mut scene.ego.track]) {
        track.samples.iter_mut().flatten().for_each(|s| s.position = s.position - origin);
    }
    scene.lights.iter_mut().for_each(|light| light.stop_point = light.stop_point - origin);
    scene.stop_signs.iter_mut().for_each(|sign| sign.position = sign.position - origin);
}
