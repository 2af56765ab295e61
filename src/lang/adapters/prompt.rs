//! The contract as agents see it: ranges, units and meanings of everything that may be edited.

use serde_json::{Map, Value, json};

use super::{
    contract::{Contract, Domain, OperatorSpec},
    graph::node_count_range,
    vocabulary::Feature,
};
use crate::{kernel::num, objects::expr::FUNCTIONS};

/// Decimals of numbers in prompts.
const DECIMALS: u32 = 6;

impl Contract {
    /// Compact and stable: it depends only on the contract. Features are described once under `features` and named
    /// where they may be read.
    pub fn to_prompt_json(&self) -> Value {
        let parameters =
            self.parameters.iter().map(|(name, spec)| (name.clone(), described(&spec.domain, &spec.describes)));
        let operators = self.operators.iter().map(|(slot, kinds)| {
            let (fewest, most) = node_count_range(*slot);
            let kinds: Map<String, Value> = kinds.iter().map(|spec| (spec.kind.clone(), operator(spec))).collect();
            (slot.name().to_string(), json!({ "nodes": [fewest, most], "kinds": kinds }))
        });
        let slots = self.mechanism_slots.iter().map(|(name, slot)| {
            let reads: Vec<&str> = slot.features.iter().map(|feature| feature.name).collect();
            (name.clone(), json!({ "output": slot.output, "reads": reads, "meaning": slot.describes }))
        });
        let scene_features: Vec<&str> = self.scene_features.iter().map(|feature| feature.name).collect();
        json!({
            "family": self.family,
            "title": self.title,
            "meaning": self.describes,
            "backend": self.backend,
            "parameters": Map::from_iter(parameters),
            "operators": Map::from_iter(operators),
            "mechanism_slots": Map::from_iter(slots),
            "scene_features": scene_features,
            "features": self.described_features(),
            "limits": self.limits,
            "expressions": {
                "functions": FUNCTIONS,
                "operators": "or, and, not, < <= > >= == !=, + - * /, unary -, ( )",
                "rules": "conditions read scene_features and numeric parameters; mechanisms also read what their slot reads",
            },
        })
    }

    fn described_features(&self) -> Map<String, Value> {
        let of_slots = self.mechanism_slots.values().flat_map(|slot| &slot.features);
        self.scene_features
            .iter()
            .chain(of_slots)
            .map(|feature| (feature.name.to_string(), one_feature(feature)))
            .collect()
    }
}

fn one_feature(feature: &Feature) -> Value {
    let mut shown = json!({ "type": feature.value, "meaning": feature.describes });
    if !feature.unit.is_empty() {
        shown["unit"] = json!(feature.unit);
    }
    shown
}

fn operator(spec: &OperatorSpec) -> Value {
    let settings = spec.settings.iter().map(|(name, setting)| {
        let mut shown = described(&setting.domain, &setting.describes);
        shown["required"] = json!(setting.required);
        (name.clone(), shown)
    });
    json!({
        "inputs": spec.inputs,
        "output": spec.output,
        "settings": Map::from_iter(settings),
        "meaning": spec.describes,
    })
}

fn described(domain: &Domain, meaning: &str) -> Value {
    match domain {
        Domain::Number { low, high, unit } => json!({
            "type": "number",
            "range": [num::rounded(*low, DECIMALS), num::rounded(*high, DECIMALS)],
            "unit": unit,
            "meaning": meaning,
        }),
        Domain::Integer { low, high, unit } => {
            json!({ "type": "integer", "range": [low, high], "unit": unit, "meaning": meaning })
        }
        Domain::Choice { options } => json!({ "type": "choice", "options": options, "meaning": meaning }),
        Domain::Mechanism { slot } => json!({ "type": "mechanism", "slot": slot, "meaning": meaning }),
    }
}
