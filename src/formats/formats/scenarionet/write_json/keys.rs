//! The dictionary's keys as types, in the order in which they are written.

use serde::ser::SerializeMap;
use serde::{Serialize, Serializer};

#[derive(Serialize)]
pub(super) struct Description<'s> {
    // An importer recognises the format by the first keys of a file, and a long id could push them away.
    pub version: &'static str,
    pub length: usize,
    pub id: &'s str,
    pub metadata: Metadata<'s>,
    pub tracks: Entries<TrackOut<'s>>,
    pub dynamic_map_states: Entries<LightOut<'s>>,
    pub map_features: Entries<Feature<'s>>,
}

/// A dictionary in the order of the scene.
pub(super) struct Entries<V>(pub Vec<(String, V)>);

impl<V: Serialize> Serialize for Entries<V> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(Some(self.0.len()))?;
        for (key, value) in &self.0 {
            map.serialize_entry(key, value)?;
        }
        map.end()
    }
}

#[derive(Serialize)]
pub(super) struct Metadata<'s> {
    pub dataset: &'static str,
    pub scenario_id: &'s str,
    pub source_file: &'s str,
    pub metadrive_processed: bool,
    pub coordinate: &'static str,
    pub sample_rate: f64,
    /// Seconds.
    pub ts: Vec<f64>,
    pub current_time_index: usize,
    pub sdc_id: &'s str,
    pub sdc_track_index: usize,
    pub objects_of_interest: Vec<&'s str>,
    /// A [`crate::scene::remainder::Remainder`] as text.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub evodrive: Option<String>,
}

#[derive(Serialize)]
pub(super) struct TrackOut<'s> {
    #[serde(rename = "type")]
    pub kind: &'static str,
    pub state: State,
    pub metadata: TrackMetadata<'s>,
}

#[derive(Serialize)]
pub(super) struct State {
    pub position: Vec<[f64; 3]>,
    pub heading: Vec<f64>,
    pub velocity: Vec<[f64; 2]>,
    pub length: Vec<f64>,
    pub width: Vec<f64>,
    pub height: Vec<f64>,
    pub valid: Vec<bool>,
}

#[derive(Serialize)]
pub(super) struct TrackMetadata<'s> {
    pub track_length: usize,
    #[serde(rename = "type")]
    pub kind: &'static str,
    pub object_id: &'s str,
}

#[derive(Serialize)]
pub(super) struct LightOut<'s> {
    #[serde(rename = "type")]
    pub kind: &'static str,
    pub state: LightStates,
    pub lane: &'s str,
    pub stop_point: [f64; 3],
    pub metadata: LightMetadata,
}

#[derive(Serialize)]
pub(super) struct LightStates {
    pub object_state: Vec<&'static str>,
}

#[derive(Serialize)]
pub(super) struct LightMetadata {
    #[serde(rename = "type")]
    pub kind: &'static str,
    pub track_length: usize,
    pub object_id: String,
}

#[derive(Serialize)]
#[serde(untagged)]
pub(super) enum Feature<'s> {
    Lane(Box<LaneOut<'s>>),
    Edge { r#type: &'static str, polyline: Vec<[f64; 3]> },
    Crosswalk { r#type: &'static str, polygon: Vec<[f64; 2]> },
    StopSign { r#type: &'static str, position: [f64; 3], lane: Vec<&'s str> },
}

#[derive(Serialize)]
pub(super) struct LaneOut<'s> {
    pub r#type: &'static str,
    pub polyline: Vec<[f64; 3]>,
    pub polygon: Vec<[f64; 2]>,
    /// Distance from the centre line to the left and the right boundary.
    pub width: Vec<[f64; 2]>,
    pub entry_lanes: Vec<&'s str>,
    pub exit_lanes: Vec<&'s str>,
    pub left_neighbor: Vec<NeighbourOut<'s>>,
    pub right_neighbor: Vec<NeighbourOut<'s>>,
    pub interpolating: bool,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub speed_limit_mph: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub speed_limit_kmh: Option<f64>,
}

#[derive(Serialize)]
pub(super) struct NeighbourOut<'s> {
    pub feature_id: &'s str,
    pub self_start_index: usize,
    pub self_end_index: usize,
    pub neighbor_start_index: usize,
    pub neighbor_end_index: usize,
    pub same_direction: bool,
    pub boundaries: [(); 0],
}
