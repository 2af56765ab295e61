//! ScenarioNet's and MetaDrive's ScenarioDescription as JSON: the dictionary of the pickles with arrays as lists.
//!
//! [`super::write_pickle`] makes the pickle that MetaDrive loads of it.
//!
//! Samples that were not observed are zeros with `valid` false. Values that have no key in the description are in
//! `metadata.evodrive`, which MetaDrive ignores.

mod keys;

use super::read_json::read_plainly;
use crate::formats::export_error::{ExportError, Exported, Note};
use crate::formats::staging::{Staging, height_m, staged};
use crate::kernel::Vec2;
use crate::scene::remainder::Remainder;
use crate::scene::{AgentKind, DT_S, Lane, LaneIx, LaneKind, Light, LightState, Neighbour, Scene, Track};
use keys::{
    Description, Entries, Feature, LaneOut, LightMetadata, LightOut, LightStates, Metadata, NeighbourOut, State,
    TrackMetadata, TrackOut,
};

/// The version of the description whose keys are written.
const VERSION: &str = "MetaDrive v0.3.0.1";
const MPS_TO_KMH: f64 = 3.6;
const MPS_TO_MPH: f64 = 2.236_936_292_054_402;

/// The scene, as logged or as played, as a ScenarioDescription in JSON. Reading it with
/// [`super::read_json`] gives the same scene.
///
/// # Errors The scene breaks a rule of a valid scene, or the staging does not fit it.
pub fn export(scene: &Scene, staging: Option<&Staging>) -> Result<Exported, ExportError> {
    let mut notes = Vec::new();
    let scene = staged(scene, staging, &mut notes)?;
    let mut description = describe(&scene);
    let read = read_plainly(&scene.id, &json(&description))
        .map_err(|error| ExportError::Unsound { scene: scene.id.clone(), violation: error.to_string() })?;
    let remainder = Remainder::between(&read, &scene);
    description.metadata.evodrive = Some(remainder.to_ascii());
    notes.push(Note::new("", "heights are not known to a scene; usual ones of each kind are written"));
    if scene.ego.track.samples.iter().flatten().count() < 2 {
        let reason = "its motion is not known; MetaDrive takes the ego's route from it and is at its end at once";
        notes.push(Note::new("ego", reason));
    }
    if remainder.paths().count() > 0 {
        let reason = "exact lane boundaries, the ego's start and route, and whatever else the description has no \
                      key for stand in metadata.evodrive, which other readers ignore";
        notes.push(Note::new("", reason));
    }
    let bytes = json(&description);
    Ok(Exported { bytes, notes })
}

fn json(description: &Description<'_>) -> Vec<u8> {
    match serde_json::to_vec(description) {
        Ok(bytes) => bytes,
        Err(error) => unreachable!("texts, lists and finite numbers under text keys: {error}"),
    }
}

fn describe(scene: &Scene) -> Description<'_> {
    let ego = &scene.ego.track;
    let all = std::iter::once(ego).chain(&scene.tracks);
    let interest = scene.objects_of_interest.iter().map(|&ix| scene.tracks[ix].id.as_str());
    Description {
        version: VERSION,
        length: scene.steps,
        id: &scene.id,
        metadata: Metadata {
            dataset: "evodrive",
            scenario_id: &scene.id,
            source_file: &scene.origin.name,
            metadrive_processed: false,
            coordinate: "right-handed",
            sample_rate: DT_S,
            ts: (0..scene.steps).map(|step| step as f64 / 10.0).collect(),
            // The description needs the ego at the current step.
            current_time_index: if ego.at(scene.current_step).is_some() {
                scene.current_step
            } else {
                scene.ego.start_step
            },
            sdc_id: &ego.id,
            sdc_track_index: 0,
            objects_of_interest: interest.collect(),
            evodrive: None,
        },
        tracks: Entries(all.map(|track| (track.id.clone(), track_out(track))).collect()),
        dynamic_map_states: lights(scene),
        map_features: features(scene),
    }
}

fn track_out(track: &Track) -> TrackOut<'_> {
    let kind = match track.kind {
        AgentKind::Vehicle => "VEHICLE",
        AgentKind::Pedestrian => "PEDESTRIAN",
        AgentKind::Cyclist => "CYCLIST",
        AgentKind::Static => "OTHER",
    };
    let samples = || track.samples.iter().map(|sample| sample.unwrap_or_default());
    let while_seen = |value: f64| track.samples.iter().map(move |s| if s.is_some() { value } else { 0.0 }).collect();
    TrackOut {
        kind,
        state: State {
            position: samples().map(|s| point(s.position)).collect(),
            heading: samples().map(|s| s.heading_rad).collect(),
            velocity: samples().map(|s| [s.velocity.x, s.velocity.y]).collect(),
            length: while_seen(track.length_m),
            width: while_seen(track.width_m),
            height: while_seen(height_m(track)),
            valid: track.samples.iter().map(Option::is_some).collect(),
        },
        metadata: TrackMetadata { track_length: track.samples.len(), kind, object_id: &track.id },
    }
}

/// Keyed by lane, as in Waymo's data; a second light over one lane gets a key of its own.
fn lights(scene: &Scene) -> Entries<LightOut<'_>> {
    let mut entries: Vec<(String, LightOut<'_>)> = Vec::new();
    for light in &scene.lights {
        let lane = scene.road.lanes[light.lane].id.as_str();
        let mut key = lane.to_string();
        while entries.iter().any(|(taken, _)| *taken == key) {
            key.push('_');
        }
        let out = light_out(light, lane, &key);
        entries.push((key, out));
    }
    Entries(entries)
}

fn light_out<'s>(light: &Light, lane: &'s str, key: &str) -> LightOut<'s> {
    let name = |state: &LightState| match state {
        LightState::Unknown => "LANE_STATE_UNKNOWN",
        LightState::Stop => "LANE_STATE_STOP",
        LightState::Caution => "LANE_STATE_CAUTION",
        LightState::Go => "LANE_STATE_GO",
    };
    LightOut {
        kind: "TRAFFIC_LIGHT",
        state: LightStates { object_state: light.states.iter().map(name).collect() },
        lane,
        stop_point: point(light.stop_point),
        metadata: LightMetadata { kind: "TRAFFIC_LIGHT", track_length: light.states.len(), object_id: key.into() },
    }
}

fn features(scene: &Scene) -> Entries<Feature<'_>> {
    let lanes = &scene.road.lanes;
    let id = |ix: &LaneIx| lanes[*ix].id.as_str();
    let mut entries: Vec<(String, Feature<'_>)> =
        lanes.iter().map(|lane| (lane.id.clone(), Feature::Lane(Box::new(lane_out(lane, lanes))))).collect();
    let longest = lanes.iter().map(|lane| lane.id.bytes().take_while(|b| *b == b'_').count()).max().unwrap_or(0);
    // It begins with more underscores than any lane's id, so that the key is free.
    let free = "_".repeat(longest + 1);
    let key = |name: &str, ix: usize| format!("{free}{name}_{ix}");
    for (ix, edge) in scene.road.edges.iter().enumerate() {
        entries.push((key("edge", ix), Feature::Edge { r#type: "ROAD_EDGE_BOUNDARY", polyline: points(edge) }));
    }
    for (ix, polygon) in scene.crosswalks.iter().enumerate() {
        entries
            .push((key("crosswalk", ix), Feature::Crosswalk { r#type: "CROSSWALK", polygon: outline(polygon.iter()) }));
    }
    for (ix, sign) in scene.stop_signs.iter().enumerate() {
        let lane = sign.lanes.iter().map(id).collect();
        let sign = Feature::StopSign { r#type: "STOP_SIGN", position: point(sign.position), lane };
        entries.push((key("stop_sign", ix), sign));
    }
    Entries(entries)
}

fn lane_out<'s>(lane: &'s Lane, lanes: &'s [Lane]) -> LaneOut<'s> {
    let r#type = match lane.kind {
        LaneKind::Street => "LANE_SURFACE_STREET",
        LaneKind::Freeway => "LANE_FREEWAY",
        LaneKind::Bike => "LANE_BIKE_LANE",
        LaneKind::Other => "LANE_SURFACE_UNSTRUCTURE",
    };
    let ids = |all: &[LaneIx]| all.iter().map(|&ix| lanes[ix].id.as_str()).collect();
    let beside = |side: &[Neighbour]| {
        let out = side.iter().map(|&Neighbour { lane: other, same_direction }| NeighbourOut {
            feature_id: &lanes[other].id,
            self_start_index: 0,
            self_end_index: lane.centre.len() - 1,
            neighbor_start_index: 0,
            neighbor_end_index: lanes[other].centre.len() - 1,
            same_direction,
            boundaries: [],
        });
        out.collect()
    };
    let sides = lane.left.iter().zip(&lane.right);
    LaneOut {
        r#type,
        polyline: points(&lane.centre),
        polygon: outline(lane.left.iter().chain(lane.right.iter().rev())),
        width: lane.centre.iter().zip(sides).map(|(c, (l, r))| [c.distance(*l), c.distance(*r)]).collect(),
        entry_lanes: ids(&lane.entries),
        exit_lanes: ids(&lane.exits),
        left_neighbor: beside(&lane.left_neighbours),
        right_neighbor: beside(&lane.right_neighbours),
        interpolating: true,
        speed_limit_mph: lane.speed_limit_mps.map(|limit| limit * MPS_TO_MPH),
        speed_limit_kmh: lane.speed_limit_mps.map(|limit| limit * MPS_TO_KMH),
    }
}

fn point(p: Vec2) -> [f64; 3] {
    [p.x, p.y, 0.0]
}

fn outline<'p>(polygon: impl Iterator<Item = &'p Vec2>) -> Vec<[f64; 2]> {
    polygon.map(|p| [p.x, p.y]).collect()
}

fn points(line: &[Vec2]) -> Vec<[f64; 3]> {
    line.iter().map(|p| point(*p)).collect()
}
