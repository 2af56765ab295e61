//! The list of keys as a JSON Schema, for editors that complete and check experiment files: `docs/experiment.schema.json`.
//!
//! A file may leave any key to its base, so the schema requires none. It refuses what no file may hold: a key that no table has, and a
//! value of another type or outside its range. What depends on other keys, `evodrive plan` says.

use serde_json::{Value, json};
use std::collections::BTreeMap;

use super::check::{Part, parts};
use super::key::{Key, Need, Range};
use super::keys::keys;

/// The draft that editors read: Even Better TOML and taplo know this one.
const DRAFT: &str = "http://json-schema.org/draft-07/schema#";
/// A [`Range::Name`].
const NAME_PATTERN: &str = "^[a-z0-9_-]{1,64}$";
const BASE: &str = "The file whose keys hold wherever this one does not say otherwise: a path relative to this file, or \
                    `evodrive:metadrive` or `evodrive:safebench`, which the program carries.";

/// The schema of an experiment file.
pub fn schema() -> Value {
    let mut root = Place::default();
    root.named
        .insert("base", Place { value: Some(json!({"type": "string", "description": BASE})), ..Place::default() });
    for key in keys() {
        root.put(&parts(key.key), value(&key));
    }
    let mut schema = root.schema();
    if let Some(fields) = schema.as_object_mut() {
        fields.insert("$schema".into(), DRAFT.into());
        fields.insert("title".into(), "EvoDrive experiment file".into());
    }
    schema
}

/// Contents that a place of the file may have: a value, a list, or a table of known or of free names.
#[derive(Default)]
struct Place {
    value: Option<Value>,
    named: BTreeMap<&'static str, Place>,
    each_key: Option<Box<Place>>,
    each_index: Option<Box<Place>>,
}

impl Place {
    fn put(&mut self, parts: &[Part], value: Value) {
        match parts.split_first() {
            None => self.value = Some(value),
            Some((Part::Name(name), rest)) => self.named.entry(name).or_default().put(rest, value),
            Some((Part::EachKey, rest)) => self.each_key.get_or_insert_default().put(rest, value),
            Some((Part::EachIndex, rest)) => self.each_index.get_or_insert_default().put(rest, value),
        }
    }

    fn schema(self) -> Value {
        if let Some(value) = self.value {
            return value;
        }
        if let Some(items) = self.each_index {
            return json!({"type": "array", "items": items.schema()});
        }
        let named: BTreeMap<&str, Value> = self.named.into_iter().map(|(name, place)| (name, place.schema())).collect();
        let others = self.each_key.map_or(Value::Bool(false), |place| place.schema());
        json!({"type": "object", "properties": named, "additionalProperties": others})
    }
}

/// A key's range, with what an editor shows of it.
fn value(key: &Key) -> Value {
    let mut schema = range(&key.range);
    if let Some(fields) = schema.as_object_mut() {
        fields.insert("description".into(), description(key).into());
    }
    schema
}

fn range(range: &Range) -> Value {
    let list = |items: Value, least: usize| json!({"type": "array", "items": items, "minItems": least});
    let of = |words: &fn() -> Vec<String>| json!({"type": "string", "enum": words()});
    match range {
        Range::Whole(least, most) => json!({"type": "integer", "minimum": least, "maximum": most}),
        Range::Number(least, most) => json!({"type": "number", "minimum": least, "maximum": most}),
        Range::Above(least, most) => json!({"type": "number", "exclusiveMinimum": least, "maximum": most}),
        Range::Text(most) => json!({"type": "string", "minLength": 1, "maxLength": most}),
        Range::Unshown => json!({"type": "string"}),
        Range::Name => json!({"type": "string", "pattern": NAME_PATTERN}),
        Range::Word(words) => of(words),
        Range::Words(words) => list(of(words), 1),
        Range::Subset(words) => list(of(words), 0),
        Range::Texts { empty } => list(json!({"type": "string", "minLength": 1}), usize::from(!empty)),
        Range::Wholes(least, most) => list(json!({"type": "integer", "minimum": least, "maximum": most}), 1),
        Range::Pair(least, below) => {
            let item = json!({"type": "number", "minimum": least, "exclusiveMaximum": below});
            json!({"type": "array", "items": item, "minItems": 2, "maxItems": 2})
        }
        Range::Ends(least, most) => {
            let item = json!({"type": "number", "minimum": least, "maximum": most});
            json!({"type": "array", "items": item, "minItems": 2, "maxItems": 2})
        }
        Range::Truth => json!({"type": "boolean"}),
        Range::Any => json!({}),
    }
}

/// Meaning, unit, symbol, and when the key stands in a file.
fn description(key: &Key) -> String {
    let mut text = key.meaning.to_string();
    if !key.unit.is_empty() {
        text += &format!(" Unit: {}.", key.unit);
    }
    if !key.symbol.is_empty() {
        text += &format!(" The paper's {}.", key.symbol);
    }
    match key.need {
        Need::Always => {}
        Need::Optional => text += " May be left out.",
        Need::With(place) => text += &format!(" Belongs to [{place}]."),
        Need::Without(place) => text += &format!(" Not beside [{place}]."),
        Need::Of(place, values) => text += &format!(" Where `{place}` is {}.", values.join(" or ")),
    }
    text
}

#[cfg(test)]
mod tests;
