//! A family's contract as prompts show it: every value in one line, every feature once. It is written from the contract's own
//! JSON, so that whatever else a contract comes to hold is shown as it stands there.

use serde_json::{Map, Value, json};
use std::collections::{BTreeMap, BTreeSet};

use super::json_text::dense_json;
use crate::adapters::Contract;

/// Parts that are written anew; `expressions`, `family` and `backend` are said elsewhere in a prompt.
const REWRITTEN: [&str; 8] =
    ["parameters", "operators", "mechanism_slots", "scene_features", "features", "expressions", "family", "backend"];

/// Levels whose members have a line each: parts, slots, fields of a slot, operator kinds.
const DEPTH: usize = 4;

/// A contract as prompts show it: the same in every epoch, so a run writes it out once.
pub fn contract_text(contract: &Contract) -> String {
    let whole = contract.to_prompt_json();
    let parameters = &whole["parameters"];
    let mut shown: Map<String, Value> = members(&whole)
        .filter(|(name, _)| !REWRITTEN.contains(&name.as_str()))
        .map(|(name, value)| (name.clone(), value.clone()))
        .collect();
    let line = |(name, value): (&String, &Value)| (name.clone(), json!(value_line(value)));
    shown.insert("parameters".into(), members(parameters).map(line).collect::<Map<_, _>>().into());
    let slots = members(&whole["operators"]).map(|(slot, spec)| (slot.clone(), operators(spec, parameters)));
    shown.insert("operators".into(), slots.collect::<Map<_, _>>().into());
    let slots = members(&whole["mechanism_slots"]).map(|(name, slot)| {
        let (output, meaning) = (text(&slot["output"]), text(&slot["meaning"]));
        (name.clone(), json!(format!("{output}: {meaning}")))
    });
    shown.insert("mechanism_slots".into(), slots.collect::<Map<_, _>>().into());
    shown.insert("features".into(), features(&whole));
    dense_json(&shown.into(), DEPTH)
}

fn members(value: &Value) -> impl Iterator<Item = (&String, &Value)> {
    value.as_object().into_iter().flatten()
}

fn text(value: &Value) -> &str {
    value.as_str().unwrap_or_default()
}

/// The operators of a slot; ports that all its kinds share stand beside them.
fn operators(spec: &Value, parameters: &Value) -> Value {
    let kinds = &spec["kinds"];
    let ports: BTreeSet<String> =
        members(kinds).map(|(_, kind)| json!([kind["inputs"], kind["output"]]).to_string()).collect();
    let alike = ports.len() == 1;
    let mut shown = json!({"nodes": spec["nodes"]});
    if let Some((_, first)) = members(kinds).next().filter(|_| alike) {
        (shown["inputs"], shown["output"]) = (first["inputs"].clone(), first["output"].clone());
    }
    let of = |(name, kind): (&String, &Value)| {
        let settings = members(&kind["settings"]).map(|(name, setting)| {
            let same = is_alike(setting, &parameters[name.as_str()]);
            (name.clone(), json!(if same { "as the parameter".to_string() } else { value_line(setting) }))
        });
        let mut one = json!({"meaning": kind["meaning"]});
        let settings: Map<String, Value> = settings.collect();
        if !settings.is_empty() {
            one["settings"] = settings.into();
        }
        if !alike {
            (one["inputs"], one["output"]) = (kind["inputs"].clone(), kind["output"].clone());
        }
        (name.clone(), one)
    };
    shown["kinds"] = members(kinds).map(of).collect::<Map<_, _>>().into();
    shown
}

/// Whether a setting takes the values of a parameter of its name.
fn is_alike(setting: &Value, parameter: &Value) -> bool {
    let same = |field: &str| setting[field] == parameter[field];
    parameter.is_object() && ["type", "range", "options", "unit"].into_iter().all(same)
}

/// `1..8 s: meaning`, `whole 1..3: meaning`, `one of a, b: meaning`, `module of slot: meaning`, `optional module of slot: meaning`.
fn value_line(value: &Value) -> String {
    let bound = |at: usize| value["range"][at].to_string();
    let range = || {
        let unit = text(&value["unit"]);
        let unit = if unit.is_empty() || unit == "1" { String::new() } else { format!(" {unit}") };
        format!("{}..{}{unit}", bound(0), bound(1))
    };
    let domain = match text(&value["type"]) {
        "number" => range(),
        "integer" => format!("whole {}", range()),
        "choice" => {
            let options = value["options"].as_array().into_iter().flatten().map(text);
            format!("one of {}", options.collect::<Vec<_>>().join(", "))
        }
        "mechanism" => {
            let optional = if value["required"] == json!(false) { "optional " } else { "" };
            format!("{optional}module of {}", text(&value["slot"]))
        }
        other => other.to_string(),
    };
    format!("{domain}: {}", text(&value["meaning"]))
}

/// Features in groups of those that the same mechanism slots read; `every expression` reads those of the scene.
fn features(whole: &Value) -> Value {
    let mut readers: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
    for (slot, spec) in members(&whole["mechanism_slots"]) {
        for feature in spec["reads"].as_array().into_iter().flatten() {
            readers.entry(text(feature)).or_default().push(slot);
        }
    }
    for feature in whole["scene_features"].as_array().into_iter().flatten() {
        readers.insert(text(feature), vec!["every expression"]);
    }
    let mut groups: BTreeMap<Vec<&str>, Map<String, Value>> = BTreeMap::new();
    for (name, feature) in members(&whole["features"]) {
        let read_by = readers.get(name.as_str()).cloned().unwrap_or_default();
        let unit = match (text(&feature["type"]), text(&feature["unit"])) {
            ("boolean", _) => "true or false",
            (_, "" | "1") => "number",
            (_, unit) => unit,
        };
        let line = json!(format!("{unit}: {}", text(&feature["meaning"])));
        groups.entry(read_by).or_default().insert(name.clone(), line);
    }
    groups.into_iter().map(|(read_by, features)| json!({"read_by": read_by, "features": features})).collect()
}
