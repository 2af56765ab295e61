//! A family's contract as prompts show it: a line a value, every feature once, units where the name does not say them. It is
//! written from the contract's own JSON, so that whatever else a contract comes to hold is shown as it stands there.

use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::LazyLock;

use super::{json_text::lean_json, program_text::part_text};
use crate::{adapters::Contract, objects::Program};

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
    written(contract, Form::Whole)
}

/// The same as compact questions show it: without articles, each parameter once, with its value in the family's parent.
pub fn compact_contract_text(contract: &Contract, parent: &Program) -> String {
    written(contract, Form::Compact(&json!(parent.parameters)))
}

/// Parts of a meaning that a name and its unit leave open, for those of the shared vocabulary and of CAT; others stand as they are.
static SHORT_MEANINGS: LazyLock<BTreeMap<&str, &str>> = LazyLock::new(|| {
    include_str!("prompts/short_meanings.txt").lines().filter_map(|line| line.split_once(" => ")).collect()
});

/// How a contract is written.
#[derive(Clone, Copy)]
enum Form<'p> {
    Whole,
    /// With the parameters of the family's parent.
    Compact(&'p Value),
}

fn written(contract: &Contract, form: Form<'_>) -> String {
    let whole = contract.to_prompt_json();
    let others = members(&whole).filter(|(name, _)| !REWRITTEN.contains(&name.as_str()));
    let mut text: Vec<String> = others.map(|(name, value)| format!("{name}: {}", plain(value))).collect();
    let parameters = &whole["parameters"];
    text.push("== parameters".into());
    match form {
        Form::Whole => text.extend(members(parameters).map(|(name, value)| form.value_line(name, value))),
        Form::Compact(values) => text.extend(by_kind(&whole, values, form)),
    }
    text.push("== operators".into());
    members(&whole["operators"]).for_each(|(slot, spec)| operators(slot, spec, parameters, form, &mut text));
    text.push("== mechanism slots".into());
    let slot = |(name, slot): (&String, &Value)| {
        format!("{name}: {}: {}", word(&slot["output"]), form.said(word(&slot["meaning"])))
    };
    text.extend(members(&whole["mechanism_slots"]).map(slot));
    text.push("== features".into());
    features(&whole, form, &mut text);
    text.join("\n")
}

/// The parameters in groups of those that the same kinds take as they are; last those that none does.
fn by_kind(whole: &Value, values: &Value, form: Form<'_>) -> Vec<String> {
    let parameters = &whole["parameters"];
    let mut takers: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
    for (kind, spec) in members(&whole["operators"]).flat_map(|(_, slot)| members(&slot["kinds"])) {
        for (name, _) in alike(spec, parameters) {
            takers.entry(name.as_str()).or_default().push(kind);
        }
    }
    let mut groups: BTreeMap<Vec<&str>, Vec<String>> = BTreeMap::new();
    for (name, parameter) in members(parameters) {
        let mut line = form.value_line(name, parameter);
        if let (Some(value), Some((end, _))) = (values.get(name), line.split_once(": ")) {
            line.insert_str(end.len(), &format!(" = {}", part_text(value)));
        }
        groups.entry(takers.remove(name.as_str()).unwrap_or_default()).or_default().push(line);
    }
    let mut groups: Vec<(Vec<&str>, Vec<String>)> = groups.into_iter().collect();
    let without = groups.first().is_some_and(|(kinds, _)| kinds.is_empty());
    groups.rotate_left(usize::from(without));
    let group = |(kinds, lines): (Vec<&str>, Vec<String>)| {
        let kinds = if kinds.is_empty() { "no kind".to_string() } else { kinds.join(", ") };
        [format!("of {kinds}:")].into_iter().chain(lines)
    };
    groups.into_iter().flat_map(group).collect()
}

/// The settings of a kind that take the values of the parameter of their name.
fn alike<'k>(kind: &'k Value, parameters: &'k Value) -> impl Iterator<Item = (&'k String, &'k Value)> {
    let same = |name: &str, setting: &Value| !is_optional(setting) && is_alike(setting, &parameters[name]);
    members(&kind["settings"]).filter(move |(name, setting)| same(name.as_str(), setting))
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
fn operators(slot: &str, spec: &Value, parameters: &Value, form: Form<'_>, text: &mut Vec<String>) {
    let all: Vec<String> = members(&spec["kinds"]).map(|(_, kind)| ports(kind)).collect();
    let count = |ports: &String| all.iter().filter(|other| *other == ports).count();
    let common = all.iter().max_by_key(|ports| (count(ports), *ports)).cloned().unwrap_or_default();
    let (fewest, most) = (&spec["nodes"][0], &spec["nodes"][1]);
    text.push(format!("slot {slot}, {fewest}..{most} nodes: {common}"));
    for (name, kind) in members(&spec["kinds"]) {
        let own = ports(kind);
        let own = if own == common { String::new() } else { format!(" ({own})") };
        text.push(format!("- {name}{own}: {}", form.said(word(&kind["meaning"]))));
        let as_parameters: Vec<&str> = alike(kind, parameters).map(|(name, _)| name.as_str()).collect();
        let others = members(&kind["settings"]).filter(|(name, _)| !as_parameters.contains(&name.as_str()));
        if let (Form::Whole, false) = (form, as_parameters.is_empty()) {
            text.push(format!("  as parameters: {}", as_parameters.join(", ")));
        }
        text.extend(others.map(|(name, setting)| format!("  {}", form.value_line(name, setting))));
    }
}

fn is_optional(setting: &Value) -> bool {
    setting["required"] == Value::Bool(false)
}

/// Returns `true` if a setting takes the values of a parameter of its name.
fn is_alike(setting: &Value, parameter: &Value) -> bool {
    let same = |field: &str| setting[field] == parameter[field];
    parameter.is_object() && ["type", "range", "options", "unit"].into_iter().all(same)
}

/// The unit with brackets, or nothing where the name says it or there is none.
fn unit_of(name: &str, unit: &str) -> String {
    let said = UNITS.iter().any(|(of, part)| *of == unit && name.split('_').any(|word| word == *part));
    if said || unit.is_empty() || unit == "1" { String::new() } else { format!(" {unit}") }
}

impl Form<'_> {
    /// A meaning; in compact form what its name leaves open, without articles.
    fn said(self, meaning: &str) -> String {
        let is_article = |word: &&str| ["the", "a", "an", "The", "A", "An"].contains(word);
        match self {
            Form::Whole => meaning.to_string(),
            Form::Compact(_) => {
                let short = SHORT_MEANINGS.get(meaning).copied().unwrap_or(meaning).split(' ');
                short.filter(|word| !is_article(word)).collect::<Vec<_>>().join(" ")
            }
        }
    }

    /// `name: 1..8: meaning`, `name: 0..2 km: meaning`, `name: whole 1..3: meaning`, `name: one of a, b: meaning`, `name: module of slot:
    /// meaning`, each with `optional ` before the value where a node need not give it; in compact form `name 1..8: meaning`, `name a|b:
    /// meaning`, `name [slot]: meaning`, with `?` behind the name.
    fn value_line(self, name: &str, value: &Value) -> String {
        let bound = |at: usize| short(&value["range"][at]);
        let range = || format!("{}..{}{}", bound(0), bound(1), unit_of(name, word(&value["unit"])));
        let compact = matches!(self, Form::Compact(_));
        let domain = match (word(&value["type"]), compact) {
            ("number", _) => range(),
            ("integer", _) => format!("whole {}", range()),
            ("choice", false) => format!("one of {}", words(&value["options"])),
            ("choice", true) => words(&value["options"]).replace(", ", "|"),
            ("mechanism", false) => format!("module of {}", word(&value["slot"])),
            ("mechanism", true) => format!("[{}]", word(&value["slot"])),
            (other, _) => other.to_string(),
        };
        let meaning = self.said(word(&value["meaning"]));
        match (compact, is_optional(value)) {
            (false, optional) => format!("{name}: {}{domain}: {meaning}", if optional { "optional " } else { "" }),
            (true, optional) => format!("{name}{} {domain}: {meaning}", if optional { "?" } else { "" }),
        }
    }
}

/// A number without a fraction of zero.
fn short(number: &Value) -> String {
    let text = number.to_string();
    text.strip_suffix(".0").map_or(text.clone(), str::to_string)
}

/// Features in groups of those that the same mechanism slots read; every expression reads those of the scene.
fn features(whole: &Value, form: Form<'_>, text: &mut Vec<String>) {
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
        let kind = match (word(&feature["type"]), form) {
            ("boolean", Form::Whole) => " (bool)".to_string(),
            ("boolean", Form::Compact(_)) => "?".to_string(),
            _ => match unit_of(name, word(&feature["unit"])) {
                unit if unit.is_empty() => unit,
                unit => format!(" ({})", unit.trim_start()),
            },
        };
        groups.entry(read_by).or_default().push(format!("{name}{kind}: {}", form.said(word(&feature["meaning"]))));
    }
    for (read_by, lines) in groups {
        text.push(format!("read by {}:", read_by.into_iter().collect::<Vec<_>>().join(", ")));
        text.extend(lines);
    }
}
