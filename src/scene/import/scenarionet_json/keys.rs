//! The dictionary's keys as types, lenient where writers differ: numbers or rows of one number, ids as texts or numbers.

use std::fmt;
use std::marker::PhantomData;

use serde::Deserialize;
use serde::de::{Deserializer, MapAccess, Visitor};

use crate::scene::remainder::Remainder;

#[derive(Deserialize)]
pub(super) struct Description {
    pub id: Option<Name>,
    pub length: usize,
    pub metadata: Metadata,
    pub tracks: Entries<TrackIn>,
    #[serde(default)]
    pub dynamic_map_states: Entries<LightIn>,
    pub map_features: Entries<FeatureIn>,
}

#[derive(Deserialize)]
pub(super) struct Metadata {
    #[serde(alias = "timestep")]
    pub ts: Option<Vec<f64>>,
    #[serde(default)]
    pub current_time_index: usize,
    pub sdc_id: Option<Name>,
    pub scenario_id: Option<Name>,
    #[serde(default)]
    pub objects_of_interest: Vec<Name>,
    pub evodrive: Option<Remainder>,
}

#[derive(Deserialize)]
pub(super) struct TrackIn {
    pub r#type: String,
    pub state: StateIn,
}

#[derive(Deserialize)]
pub(super) struct StateIn {
    pub position: Vec<Vec<f64>>,
    pub heading: Vec<Cell>,
    pub velocity: Option<Vec<Vec<f64>>>,
    pub length: Option<Column>,
    pub width: Option<Column>,
    pub valid: Option<Vec<Cell>>,
}

#[derive(Deserialize)]
pub(super) struct LightIn {
    pub lane: Option<Name>,
    pub stop_point: Option<Vec<f64>>,
    pub state: LightStates,
}

#[derive(Deserialize)]
pub(super) struct LightStates {
    pub object_state: Vec<Option<String>>,
}

#[derive(Deserialize)]
pub(super) struct FeatureIn {
    pub r#type: String,
    pub polyline: Option<Vec<Vec<f64>>>,
    pub polygon: Option<Vec<Vec<f64>>>,
    pub position: Option<Vec<f64>>,
    pub lane: Option<Names>,
    pub width: Option<Vec<Vec<f64>>>,
    #[serde(default)]
    pub entry_lanes: Vec<Name>,
    #[serde(default)]
    pub exit_lanes: Vec<Name>,
    #[serde(default)]
    pub left_neighbor: Vec<NeighbourIn>,
    #[serde(default)]
    pub right_neighbor: Vec<NeighbourIn>,
    pub speed_limit_mps: Option<f64>,
    pub speed_limit_mph: Option<f64>,
    pub speed_limit_kmh: Option<f64>,
}

#[derive(Deserialize)]
#[serde(untagged)]
pub(super) enum NeighbourIn {
    Described { feature_id: Name, same_direction: Option<bool> },
    Named(Name),
}

/// An id, which some writers leave a number.
#[derive(Deserialize, Clone, PartialEq)]
#[serde(untagged)]
pub(super) enum Name {
    Text(String),
    Number(i64),
}

impl Name {
    pub fn text(&self) -> String {
        match self {
            Name::Text(text) => text.clone(),
            Name::Number(number) => number.to_string(),
        }
    }
}

#[derive(Deserialize)]
#[serde(untagged)]
pub(super) enum Names {
    Many(Vec<Name>),
    One(Name),
}

/// A value of one step: a number, a flag, or a row of one number.
#[derive(Deserialize)]
#[serde(untagged)]
pub(super) enum Cell {
    Number(f64),
    Flag(bool),
    Row(Vec<f64>),
}

impl Cell {
    pub fn number(&self) -> Option<f64> {
        match self {
            Cell::Number(number) => Some(*number),
            Cell::Flag(flag) => Some(f64::from(u8::from(*flag))),
            Cell::Row(row) => row.first().copied(),
        }
    }
}

#[derive(Deserialize)]
#[serde(untagged)]
pub(super) enum Column {
    Many(Vec<Cell>),
    One(f64),
}

/// A dictionary in the order of the file; keys that occur twice stay two entries.
pub(super) struct Entries<V>(pub Vec<(String, V)>);

impl<V> Default for Entries<V> {
    fn default() -> Self {
        Entries(Vec::new())
    }
}

impl<'de, V: Deserialize<'de>> Deserialize<'de> for Entries<V> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct InOrder<V>(PhantomData<V>);
        impl<'de, V: Deserialize<'de>> Visitor<'de> for InOrder<V> {
            type Value = Entries<V>;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a dictionary")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Entries<V>, A::Error> {
                let mut entries = Vec::new();
                while let Some(entry) = map.next_entry()? {
                    entries.push(entry);
                }
                Ok(Entries(entries))
            }
        }
        deserializer.deserialize_map(InOrder(PhantomData))
    }
}
