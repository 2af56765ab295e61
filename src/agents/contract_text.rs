//! A family's contract as prompts show it: a line a value, every feature once, units where the name does not say them. It is
//! written from the contract's own JSON, so that whatever else a contract comes to hold is shown as it stands there.

use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};

use super::json_text::lean_json;
use crate::adapters::Contract;

/// Parts that have a section of their own, and those that a prompt says elsewhere: `expressions`, `family`, `backend`, `title`.
const REWRITTEN: [&str; 9] = [
    "parameters",
    "operators",
    "mechanism_slots",
    "scene_features",
    "features",
    "expressions",
    "family",
    "backend",
    "title",
];

/// Units and the part of a name that says them.
const UNITS: [(&str, &str); 8] = [
    ("m", "m"),
    ("s", "s"),
    ("m/s", "mps"),
    ("m/s^2", "mps2"),
    ("m/s^3", "mps3"),
    ("rad", "rad"),
    ("rad/s", "radps"),
    ("1/m", "1pm"),
];

/// A contract as prompts show it: the same in every epoch, so a run writes it out once. Line breaks inside a text would end its
/// line, and contracts hold none.
pub fn contract_text(contract: &Contract) -> String {
    let whole = contract.to_prompt_json();
    let others = members(&whole).filter(|(name, _)| !REWRITTEN.contains(&name.as_str()));
    let mut text: Vec<String> = others.map(|(name, value)| format!("{name}: {}", plain(value))).collect();
    let parameters = &whole["parameters"];
    text.push("== parameters".into());
    text.extend(members(parameters).map(|(name, value)| format!("{name}: {}", value_line(name, value))));
    text.push("== operators".into());
    members(&whole["operators"]).for_each(|(slot, spec)| operators(slot, spec, parameters, &mut text));
    text.push("== mechanism slots".into());
    let slot =
        |(name, slot): (&String, &Value)| format!("{name}: {}: {}", word(&slot["output"]), word(&slot["meaning"]));
    text.extend(members(&whole["mechanism_slots"]).map(slot));
    text.push("== features".into());
    features(&whole, &mut text);
    text.join("\n")
}

fn members(value: &Value) -> impl Iterator<Item = (&String, &Value)> {
    value.as_object().into_iter().flatten()
}

fn word(value: &Value) -> &str {
    value.as_str().unwrap_or_default()
}

fn words(value: &Value) -> String {
    value.as_array().into_iter().flatten().map(word).collect::<Vec<_>>().join(", ")
}

/// A text as it is, an object as its members with their values.
fn plain(value: &Value) -> String {
    match value {
        Value::String(text) => text.clone(),
        Value::Object(map) => {
            map.iter().map(|(name, value)| format!("{name} {}", plain(value))).collect::<Vec<_>>().join(", ")
        }
        other => lean_json(other),
    }
}

fn ports(kind: &Value) -> String {
    let inputs = words(&kind["inputs"]);
    format!("{} -> {}", if inputs.is_empty() { "nothing" } else { &inputs }, word(&kind["output"]))
}

/// The operators of a slot: its line with the ports that most of its kinds have, and two lines a kind.
fn operators(slot: &str, spec: &Value, parameters: &Value, text: &mut Vec<String>) {
    let all: Vec<String> = members(&spec["kinds"]).map(|(_, kind)| ports(kind)).collect();
    let count = |ports: &String| all.iter().filter(|other| *other == ports).count();
    let common = all.iter().max_by_key(|ports| (count(ports), *ports)).cloned().unwrap_or_default();
    let (fewest, most) = (&spec["nodes"][0], &spec["nodes"][1]);
    text.push(format!("slot {slot}, {fewest}..{most} nodes: {common}"));
    for (name, kind) in members(&spec["kinds"]) {
        let own = ports(kind);
        let own = if own == common { String::new() } else { format!(" ({own})") };
        text.push(format!("- {name}{own}: {}", word(&kind["meaning"])));
        let same = |name: &str, setting: &Value| !is_optional(setting) && is_alike(setting, &parameters[name]);
        let (alike, others): (Vec<_>, Vec<_>) =
            members(&kind["settings"]).partition(|(name, setting)| same(name.as_str(), setting));
        if !alike.is_empty() {
            let names: Vec<&str> = alike.into_iter().map(|(name, _)| name.as_str()).collect();
            text.push(format!("  as parameters: {}", names.join(", ")));
        }
        text.extend(others.into_iter().map(|(name, setting)| format!("  {name}: {}", value_line(name, setting))));
    }
}

fn is_optional(setting: &Value) -> bool {
    setting["required"] == Value::Bool(false)
}

/// Whether a setting takes the values of a parameter of its name.
fn is_alike(setting: &Value, parameter: &Value) -> bool {
    let same = |field: &str| setting[field] == parameter[field];
    parameter.is_object() && ["type", "range", "options", "unit"].into_iter().all(same)
}

/// The unit with brackets, or nothing where the name says it or there is none.
fn unit_of(name: &str, unit: &str) -> String {
    let said = UNITS.iter().any(|(of, part)| *of == unit && name.split('_').any(|word| word == *part));
    if said || unit.is_empty() || unit == "1" { String::new() } else { format!(" {unit}") }
}

/// `1..8: meaning`, `0..2 km: meaning`, `whole 1..3: meaning`, `one of a, b: meaning`, `module of slot: meaning`, each with `optional `
/// before it where a node need not give it.
fn value_line(name: &str, value: &Value) -> String {
    let bound = |at: usize| short(&value["range"][at]);
    let range = || format!("{}..{}{}", bound(0), bound(1), unit_of(name, word(&value["unit"])));
    let domain = match word(&value["type"]) {
        "number" => range(),
        "integer" => format!("whole {}", range()),
        "choice" => format!("one of {}", words(&value["options"])),
        "mechanism" => format!("module of {}", word(&value["slot"])),
        other => other.to_string(),
    };
    format!("{}{domain}: {}", if is_optional(value) { "optional " } else { "" }, word(&value["meaning"]))
}

/// A number without a fraction of zero.
fn short(number: &Value) -> String {
    let text = number.to_string();
    text.strip_suffix(".0").map_or(text.clone(), str::to_string)
}

/// Features in groups of those that the same mechanism slots read; every expression reads those of the scene.
fn features(whole: &Value, text: &mut Vec<String>) {
    let mut readers: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
    for (slot, spec) in members(&whole["mechanism_slots"]) {
        for feature in spec["reads"].as_array().into_iter().flatten() {
            readers.entry(word(feature)).or_default().insert(slot);
        }
    }
    for feature in whole["scene_features"].as_array().into_iter().flatten() {
        readers.insert(word(feature), BTreeSet::from(["every expression"]));
    }
    let mut groups: BTreeMap<BTreeSet<&str>, Vec<String>> = BTreeMap::new();
    for (name, feature) in members(&whole["features"]) {
        let read_by = readers.get(name.as_str()).cloned().unwrap_or_default();
        let kind = match word(&feature["type"]) {
            "boolean" => " (bool)".to_string(),
            _ => match unit_of(name, word(&feature["unit"])) {
                unit if unit.is_empty() => unit,
                unit => format!(" ({})", unit.trim_start()),
            },
        };
        groups.entry(read_by).or_default().push(format!("{name}{kind}: {}", word(&feature["meaning"])));
    }
    for (read_by, lines) in groups {
        text.push(format!("read by {}:", read_by.into_iter().collect::<Vec<_>>().join(", ")));
        text.extend(lines);
    }
}
