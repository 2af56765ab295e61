//! The part of a scene that a foreign format cannot hold: the fields that do not come back bit for bit when the
//! format's own elements are read. An exported file carries them where its format has a place for private data, so that
//! importing it gives the same scene. If the file was edited later, the digest no longer fits, and only the format's
//! own elements count.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use super::{Origin, Scene};
use crate::kernel::Digest;

/// Rises when an older reader could not use what is written.
const VERSION: u32 = 2;

/// Fields by path, such as `/tracks/3/samples`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Remainder {
    version: u32,
    /// Digest of the whole scene.
    scene: Digest,
    /// Digest of the scene that the format's own elements gave.
    read: Digest,
    lanes: usize,
    tracks: usize,
    fields: BTreeMap<String, Value>,
}

impl Remainder {
    /// The fields that must be put over `read` to get `scene`. `read` is what the format's own elements give.
    pub fn between(read: &Scene, scene: &Scene) -> Remainder {
        let known = fields_of(read);
        let mut fields = fields_of(scene);
        fields.retain(|path, value| known.get(path) != Some(value));
        Remainder {
            version: VERSION,
            scene: scene.digest(),
            read: read.digest(),
            lanes: scene.road.lanes.len(),
            tracks: scene.tracks.len(),
            fields,
        }
    }

    /// The scene. `None` if `read` changed since the remainder was taken, or if the result breaks a rule of a valid
    /// scene.
    pub fn laid_over(&self, read: &Scene, origin: &Origin) -> Option<Scene> {
        let most = |known: usize| known.saturating_add(self.fields.len());
        let counts_fit = self.lanes <= most(read.road.lanes.len()) && self.tracks <= most(read.tracks.len());
        if self.version != VERSION || !counts_fit || read.digest() != self.read {
            return None;
        }
        let mut whole = serde_json::to_value(read).ok()?;
        whole.pointer_mut("/road/lanes")?.as_array_mut()?.resize(self.lanes, Value::Object(Map::new()));
        whole.pointer_mut("/tracks")?.as_array_mut()?.resize(self.tracks, Value::Object(Map::new()));
        for (path, value) in &self.fields {
            let (parent, name) = path.rsplit_once('/')?;
            whole.pointer_mut(parent)?.as_object_mut()?.insert(name.to_string(), value.clone());
        }
        let mut scene: Scene = serde_json::from_value(whole).ok()?;
        scene.origin = origin.clone();
        (scene.digest() == self.scene && scene.validate().is_empty()).then_some(scene)
    }

    /// Returns it as JSON in ASCII without `>`, so that it may stand in a processing instruction.
    pub fn to_ascii(&self) -> String {
        let Ok(json) = serde_json::to_string(self) else {
            unreachable!("texts, counts and what came from finite numbers")
        };
        let mut text = String::with_capacity(json.len());
        for c in json.chars() {
            if c.is_ascii() && c != '>' && c != '\u{7f}' {
                text.push(c);
            } else {
                let mut units = [0u16; 2];
                c.encode_utf16(&mut units).iter().for_each(|unit| text.push_str(&format!("\\u{unit:04x}")));
            }
        }
        text
    }

    /// The inverse of [`Remainder::to_ascii`]; `None` for any other text.
    pub fn from_text(text: &str) -> Option<Remainder> {
        serde_json::from_str(text).ok()
    }

    /// The paths of the fields, for notes.
    pub fn paths(&self) -> impl Iterator<Item = &str> {
        self.fields.keys().map(String::as_str)
    }
}

/// All fields of a scene but its origin; lanes and tracks field by field.
fn fields_of(scene: &Scene) -> BTreeMap<String, Value> {
    let mut fields = BTreeMap::new();
    let Ok(Value::Object(whole)) = serde_json::to_value(scene) else {
        unreachable!("a scene is a struct of numbers, texts and lists")
    };
    for (name, value) in whole {
        match (name.as_str(), value) {
            ("origin", _) => {}
            ("road" | "ego", Value::Object(parts)) => {
                for (part, value) in parts {
                    split(&format!("/{name}/{part}"), value, &mut fields);
                }
            }
            (_, value) => split(&format!("/{name}"), value, &mut fields),
        }
    }
    fields
}

fn split(path: &str, value: Value, fields: &mut BTreeMap<String, Value>) {
    match value {
        Value::Array(items) if matches!(path, "/road/lanes" | "/tracks") => {
            for (index, item) in items.into_iter().enumerate() {
                let Value::Object(parts) = item else { continue };
                fields.extend(parts.into_iter().map(|(part, value)| (format!("{path}/{index}/{part}"), value)));
            }
        }
        value => {
            fields.insert(path.to_string(), value);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::fixture::two_lane_scene;

    #[test]
    fn nothing_remains_of_a_scene_that_was_read_whole() {
        let scene = two_lane_scene();
        let remainder = Remainder::between(&scene, &scene);
        assert_eq!(remainder.paths().count(), 0);
        assert_eq!(remainder.laid_over(&scene, &scene.origin), Some(scene));
    }

    #[test]
    fn fields_lanes_and_tracks_that_were_not_read_come_back() {
        let scene = two_lane_scene();
        let mut read = scene.clone();
        read.current_step = 7;
        read.road.lanes.pop();
        read.tracks[1].samples[3] = None;
        read.tracks.push(read.tracks[0].clone());
        read.ego.route.clear();
        let remainder = Remainder::between(&read, &scene);
        assert!(remainder.paths().any(|path| path == "/tracks/1/samples"));
        assert!(!remainder.paths().any(|path| path.starts_with("/tracks/0")));
        assert_eq!(remainder.laid_over(&read, &scene.origin), Some(scene));
    }

    #[test]
    fn a_changed_file_or_a_lying_remainder_gives_nothing() {
        let scene = two_lane_scene();
        let mut read = scene.clone();
        read.steps = 9;
        let remainder = Remainder::between(&read, &scene);
        read.tracks[0].length_m = 9.0;
        assert_eq!(remainder.laid_over(&read, &scene.origin), None);
        let lie = Remainder { tracks: usize::MAX, ..remainder.clone() };
        assert_eq!(lie.laid_over(&scene, &scene.origin), None);
        let back = Remainder::from_text(&remainder.to_ascii());
        assert_eq!(back, Some(remainder.clone()));
        let fields = BTreeMap::from([("/nowhere/at/all".to_string(), Value::Null), ("x".to_string(), Value::Null)]);
        assert_eq!(Remainder { fields, ..remainder }.laid_over(&scene, &scene.origin), None);
    }
}
