//! Writes files for MetaDrive's `ScenarioEnv` and ScenarioNet: a scene's description as a pickle with numpy arrays, and the two
//! files that make a folder of them a data set.
//!
//! The pickle is the JSON description, so it is imported as the same scene.

use std::collections::{BTreeMap, BTreeSet};

use serde::Deserialize;
use serde_json::{Map, Value, json};

use super::pickle::{self, Lists, Node};
use crate::formats::import_error::ImportError;
use crate::kernel::{Vec2, num};

/// Distance beyond which a road user counts as moving in a data set's summary, as in MetaDrive, metres.
const MOVING_M: f64 = 1.0;

/// Files that MetaDrive and ScenarioNet look for beside pickles: the folders of the pickles, and their contents.
pub const DATA_SET_FILES: [&str; 2] = ["dataset_mapping.pkl", "dataset_summary.pkl"];

/// Returns the name of the pickle of a scene: MetaDrive reads no others.
pub fn pickle_name(scene_name: &str) -> String {
    format!("sd_{scene_name}.pkl")
}

/// A description as a pickle.
#[derive(Clone, Debug, PartialEq)]
pub struct Pickled {
    /// The file, to be named by [`pickle_name`].
    pub bytes: Vec<u8>,
    /// Its metadata with counts of road users, lights and map features: its entry in a [`DataSet`].
    pub summary: Value,
}

/// The part of a description that a data set's summary repeats.
#[derive(Deserialize)]
struct Head {
    metadata: Map<String, Value>,
}

/// Returns the pickle of a description that [`super::export`] wrote.
///
/// # Errors The bytes are no description.
pub fn pickled(description: &[u8]) -> Result<Pickled, ImportError> {
    let tree = pickle::read_json("description", description)?;
    let root = tree.root();
    let text = |node: &Node<'_>| node.text().unwrap_or_default().to_string();
    let head: Head = serde_json::from_slice(description).map_err(|_| root.refuse("a description with metadata"))?;
    let mut summary = head.metadata;
    // The remainder is as large as a scene may be, and belongs to the scene's own file.
    summary.remove("evodrive");
    let mut objects = Map::new();
    let mut kinds: BTreeMap<String, u32> = BTreeMap::new();
    let mut moving: BTreeMap<String, u32> = BTreeMap::new();
    for (id, track) in root.needed("tracks")?.entries().unwrap_or_default() {
        let kind = text(&track.needed("type")?);
        let (object, moved_m) = object_summary(&id, &kind, &track.needed("state")?)?;
        objects.insert(id.to_string(), object);
        *kinds.entry(kind.clone()).or_default() += 1;
        if moved_m > MOVING_M {
            *moving.entry(kind).or_default() += 1;
        }
    }
    let lights = root.needed("dynamic_map_states")?.entries().unwrap_or_default();
    let mut shown: BTreeMap<String, u32> = BTreeMap::new();
    for (_, light) in &lights {
        for state in light.needed("state")?.needed("object_state")?.items().into_iter().flatten() {
            *shown.entry(text(&state)).or_default() += 1;
        }
    }
    let number_summary = json!({
        "num_objects": objects.len(),
        "object_types": kinds.keys().collect::<BTreeSet<_>>(),
        "num_objects_each_type": kinds,
        "num_moving_objects": moving.values().sum::<u32>(),
        "num_moving_objects_each_type": moving,
        "num_traffic_lights": lights.len(),
        "num_traffic_light_types": shown.keys().collect::<BTreeSet<_>>(),
        "num_traffic_light_each_step": shown,
        "num_map_features": root.needed("map_features")?.entries().unwrap_or_default().len(),
        // A scene is flat.
        "map_height_diff": 0.0,
    });
    // MetaDrive sorts the scenes of a curriculum by the summaries in the pickles themselves.
    let summaries = json!({"object_summary": objects, "number_summary": number_summary});
    let summarised =
        with_metadata(description, &summaries).ok_or_else(|| root.refuse("a description with metadata"))?;
    summary.insert("object_summary".into(), Value::Object(objects));
    summary.insert("number_summary".into(), number_summary);
    let bytes = pickle::write(&pickle::read_json("description", &summarised)?.root(), Lists::Arrays);
    Ok(Pickled { bytes, summary: Value::Object(summary) })
}

/// Returns the description's text with further keys in its metadata. Every other byte stays, so no number is read and written again.
fn with_metadata(description: &[u8], further: &Value) -> Option<Vec<u8>> {
    // A quote inside a text has a backslash before it, so this is the key and no part of an id.
    const KEY: &[u8] = b",\"metadata\":{";
    let at = description.windows(KEY.len()).position(|window| window == KEY)? + KEY.len();
    let further = further.to_string();
    let inside = further.strip_prefix('{')?.strip_suffix('}')?;
    Some([&description[..at], inside.as_bytes(), b",", &description[at..]].concat())
}

/// Returns a road user's kind, the time that it is seen, and the way that it moves, metres.
fn object_summary(id: &str, kind: &str, state: &Node<'_>) -> Result<(Value, f64), ImportError> {
    let (places, valid) = (state.needed("position")?.needed_numbers()?, state.needed("valid")?.needed_numbers()?);
    let seen: Vec<usize> = (0..valid.rows).filter(|&k| valid.at(k, 0) > 0.5).collect();
    let place = |k: usize| Vec2::new(places.at(k, 0), places.at(k, 1));
    let moved_m = num::sum(seen.windows(2).map(|pair| place(pair[0]).distance(place(pair[1]))));
    let unbroken = seen.iter().zip(seen.first().copied().unwrap_or(0)..).take_while(|(k, at)| *k == at).count();
    let object = json!({
        "type": kind,
        "object_id": id,
        "track_length": places.rows,
        "moving_distance": moved_m,
        "valid_length": seen.len(),
        "continuous_valid_length": unbroken,
    });
    Ok((object, moved_m))
}

/// The scenes of a folder, by the names of their pickles.
#[derive(Clone, Debug, Default)]
pub struct DataSet {
    summaries: Map<String, Value>,
}

impl DataSet {
    /// Adds a scene's pickle.
    pub fn add(&mut self, file: impl Into<String>, summary: Value) {
        self.summaries.insert(file.into(), summary);
    }

    /// Returns the [`DATA_SET_FILES`]; none without scenes.
    pub fn files(&self) -> Vec<(&'static str, Vec<u8>)> {
        if self.summaries.is_empty() {
            return vec![];
        }
        // Folders of the files, relative to this one.
        let places: Map<String, Value> = self.summaries.keys().map(|file| (file.clone(), "".into())).collect();
        let made = |value: Value| {
            let text = value.to_string();
            match pickle::read_json("data set", text.as_bytes()) {
                Ok(tree) => pickle::write(&tree.root(), Lists::Plain),
                Err(error) => unreachable!("JSON that was just written: {error}"),
            }
        };
        let contents = [Value::Object(places), Value::Object(self.summaries.clone())];
        DATA_SET_FILES.into_iter().zip(contents.map(made)).collect()
    }
}

/// Returns `true` if a pickle is one of a data set's [`DataSet::files`]: a dictionary by the names of pickles.
pub(super) fn is_of_data_set(root: &Node<'_>) -> bool {
    root.entries().is_some_and(|entries| !entries.is_empty() && entries.iter().all(|(file, _)| file.ends_with(".pkl")))
}
