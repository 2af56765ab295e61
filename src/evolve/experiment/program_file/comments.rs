//! The comments of a program in TOML: everything that a contract says of the places around them.

use crate::adapters::{Contract, Domain, Feature, OperatorSpec, SettingSpec, node_count_range};
use crate::objects::{Slot, ValueType};
use std::collections::BTreeMap;

/// Columns of a comment.
const WIDTH: usize = 116;

/// Text as lines behind `#`, with this much in front of its words.
pub fn comment(indent: &str, text: &str) -> String {
    let mut lines = vec![String::new()];
    for word in text.split_whitespace() {
        let line = lines.last().map_or(0, |line| line.chars().count());
        if line > 0 && line + word.chars().count() + indent.len() + 3 > WIDTH {
            lines.push(String::new());
        }
        if let Some(last) = lines.last_mut() {
            last.push_str(if last.is_empty() { "" } else { " " });
            last.push_str(word);
        }
    }
    lines.iter().map(|line| format!("# {indent}{line}\n")).collect()
}

/// Says what a slot decides.
fn decides(slot: Slot) -> &'static str {
    match slot {
        Slot::Select => "the scenes in which the program acts",
        Slot::Actor => "who becomes an adversary",
        Slot::Timing => "when the motion is changed",
        Slot::Motion => "which motions are possible",
        Slot::Search => "which of them is best",
        Slot::Filter => "which of them are removed or changed, and where ways meet",
        Slot::Law => "what an adversary does while it observes the ego",
        Slot::Diversity => "which of those left is taken",
    }
}

/// A slot with the kinds that it may hold.
pub fn slot(slot: Slot, kinds: &[OperatorSpec]) -> String {
    let (fewest, most) = node_count_range(slot);
    let nodes = if fewest == most { format!("{fewest} node") } else { format!("{fewest} to {most} nodes") };
    let mut text = comment("", &format!("{}: {}. {nodes}, each of one of these kinds:", slot.name(), decides(slot)));
    for spec in kinds {
        text.push_str(&comment("  ", &format!("{}: {}", spec.kind, spec.describes)));
    }
    text
}

/// A value with its range: `what it is; a number in [0, 5] m`.
pub fn value(domain: &Domain, describes: &str) -> String {
    format!("{}; {}", describes.trim_end_matches('.'), range(domain))
}

/// The range as a file writes its values.
pub fn range(domain: &Domain) -> String {
    match domain {
        Domain::Mechanism { slot } => format!("{{ mechanism = name }} with a module of slot `{slot}`"),
        other => other.describe(),
    }
}

/// A setting that a node does not have.
pub fn unset(name: &str, spec: &SettingSpec) -> String {
    comment("", &format!("{name} is not set, and need not be: {}", value(&spec.domain, &spec.describes)))
}

/// Writes what the modules of a family may be, and the features that expressions read.
pub fn mechanism_slots(contract: &Contract) -> String {
    let mut text = comment(
        "",
        "Expressions that operators plug in by { mechanism = name }. Besides what is named with its slot they read what rules read. \
         `inputs` may be left out. Slots:",
    );
    for (name, slot) in &contract.mechanism_slots {
        let gives = match slot.output {
            ValueType::Number => "a number",
            ValueType::Boolean => "true or false",
        };
        let reads: Vec<&str> = slot.features.iter().map(|feature| feature.name).collect();
        let reads = if reads.is_empty() { String::new() } else { format!(". Reads {}", reads.join(", ")) };
        text.push_str(&comment(
            "  ",
            &format!("{name}: gives {gives}; {}{reads}", slot.describes.trim_end_matches('.')),
        ));
    }
    text
}

/// Writes what conditions of rules are made of.
pub fn rules(contract: &Contract) -> String {
    let reads: Vec<&str> = contract.scene_features.iter().map(|feature| feature.name).collect();
    let text = format!(
        "Rules, tried in order: where `when` holds in a scene, its parameters and operators (node -> setting) stand above those \
         here. At most {} rules. `when` reads the numeric parameters and {}.",
        contract.limits.rules,
        reads.join(", ")
    );
    comment("", &text)
}

/// Every feature with its unit and meaning.
pub fn features(contract: &Contract) -> String {
    let of_slots = contract.mechanism_slots.values().flat_map(|slot| &slot.features);
    let all: BTreeMap<&str, &Feature> =
        contract.scene_features.iter().chain(of_slots).map(|feature| (feature.name, feature)).collect();
    let mut text = comment("", "What expressions read, with units:");
    for feature in all.values() {
        let unit = match feature.unit {
            "" => " (true or false)".to_string(),
            "1" => String::new(),
            unit => format!(" ({unit})"),
        };
        text.push_str(&comment("  ", &format!("{}{unit}: {}", feature.name, feature.describes)));
    }
    text
}
