//! A family's contract as the prompt shows it: values in one line each, features in groups.

use serde::Deserialize;
use serde_json::Value;
use std::collections::BTreeMap;

use super::unanswerable;
use crate::llm::ModelError;

#[derive(Debug)]
pub struct Contract {
    pub parameters: BTreeMap<String, Domain>,
    pub operators: BTreeMap<String, SlotSpec>,
    pub mechanism_slots: BTreeMap<String, MechanismSlot>,
    pub scene_features: Vec<String>,
    pub features: BTreeMap<String, Feature>,
    pub limits: Limits,
}

#[derive(Clone, Debug)]
pub struct Domain {
    /// `number`, `integer`, `choice` or `mechanism`.
    pub kind: String,
    pub range: Option<[f64; 2]>,
    pub unit: String,
    pub options: Vec<String>,
    pub slot: Option<String>,
    pub required: bool,
}

#[derive(Debug)]
pub struct SlotSpec {
    /// Fewest and most.
    pub nodes: [usize; 2],
    pub kinds: BTreeMap<String, Kind>,
}

#[derive(Debug)]
pub struct Kind {
    pub inputs: Vec<String>,
    pub output: String,
    pub settings: BTreeMap<String, Domain>,
}

#[derive(Debug)]
pub struct MechanismSlot {
    /// `number` or `boolean`.
    pub output: String,
    pub reads: Vec<String>,
    pub meaning: String,
}

#[derive(Debug)]
pub struct Feature {
    /// `number` or `boolean`.
    pub value: String,
    pub unit: String,
}

#[derive(Debug, Deserialize)]
pub struct Limits {
    pub operations_per_patch: usize,
    pub nodes: usize,
    pub rules: usize,
    pub modules: usize,
    pub expression_nodes: usize,
    pub expression_depth: usize,
}

/// The block as it stands in a prompt.
#[derive(Deserialize)]
pub struct Written {
    parameters: BTreeMap<String, String>,
    operators: BTreeMap<String, WrittenSlot>,
    mechanism_slots: BTreeMap<String, String>,
    features: Vec<WrittenFeatures>,
    limits: Limits,
}

#[derive(Deserialize)]
struct WrittenSlot {
    nodes: [usize; 2],
    /// Of all kinds, where they are alike.
    inputs: Option<Vec<String>>,
    output: Option<String>,
    kinds: BTreeMap<String, WrittenKind>,
}

#[derive(Deserialize)]
struct WrittenKind {
    inputs: Option<Vec<String>>,
    output: Option<String>,
    #[serde(default)]
    settings: BTreeMap<String, String>,
}

#[derive(Deserialize)]
struct WrittenFeatures {
    read_by: Vec<String>,
    features: BTreeMap<String, Value>,
}

/// Who reads a scene feature.
const EVERYBODY: &str = "every expression";
/// A setting with the range of the parameter of its name.
const AS_PARAMETER: &str = "as the parameter";

impl Contract {
    pub fn read(written: Written) -> Result<Contract, ModelError> {
        let domain = |name: &String, text: &String| {
            let read = Domain::read(text);
            Ok((name.clone(), read.ok_or_else(|| unanswerable(format!("`{name}` has no readable range: {text}")))?))
        };
        let parameters: BTreeMap<String, Domain> =
            written.parameters.iter().map(|(name, text)| domain(name, text)).collect::<Result<_, ModelError>>()?;
        let setting = |name: &String, text: &String| match parameters.get(name) {
            Some(parameter) if text == AS_PARAMETER => Ok((name.clone(), parameter.clone())),
            _ => domain(name, text),
        };
        let mut operators = BTreeMap::new();
        for (slot, WrittenSlot { nodes, inputs, output, kinds }) in written.operators {
            let mut read = BTreeMap::new();
            for (name, kind) in kinds {
                let settings = kind.settings.iter().map(|(name, text)| setting(name, text));
                let kind = Kind {
                    inputs: kind.inputs.or_else(|| inputs.clone()).unwrap_or_default(),
                    output: kind.output.or_else(|| output.clone()).unwrap_or_default(),
                    settings: settings.collect::<Result<_, ModelError>>()?,
                };
                read.insert(name, kind);
            }
            operators.insert(slot, SlotSpec { nodes, kinds: read });
        }
        let reads = |slot: &String| {
            let groups = written.features.iter().filter(|group| group.read_by.contains(slot));
            groups.flat_map(|group| group.features.keys().cloned()).collect::<Vec<String>>()
        };
        let mechanism_slots = written.mechanism_slots.iter().map(|(slot, text)| {
            let (output, meaning) = text.split_once(": ").unwrap_or((text, ""));
            (slot.clone(), MechanismSlot { output: output.into(), reads: reads(slot), meaning: meaning.into() })
        });
        let feature = |text: &Value| match text.as_str().and_then(|text| text.split_once(": ")) {
            Some(("true or false", _)) => Feature { value: "boolean".into(), unit: String::new() },
            Some((unit, _)) => Feature { value: "number".into(), unit: unit.into() },
            None => Feature { value: "number".into(), unit: String::new() },
        };
        let features = written.features.iter().flat_map(|group| &group.features);
        Ok(Contract {
            operators,
            mechanism_slots: mechanism_slots.collect(),
            scene_features: reads(&EVERYBODY.to_string()),
            features: features.map(|(name, text)| (name.clone(), feature(text))).collect(),
            limits: written.limits,
            parameters,
        })
    }
}

impl Domain {
    /// `1..8 s: meaning`, `whole 1..3: ..`, `one of a, b: ..`, `module of slot: ..`, `optional module of slot: ..`.
    fn read(text: &str) -> Option<Domain> {
        let (said, _) = text.split_once(": ")?;
        let nothing = Domain {
            kind: String::new(),
            range: None,
            unit: String::new(),
            options: vec![],
            slot: None,
            required: true,
        };
        let required = !said.starts_with("optional ");
        let said = said.strip_prefix("optional ").unwrap_or(said);
        if let Some(slot) = said.strip_prefix("module of ") {
            return Some(Domain { kind: "mechanism".into(), slot: Some(slot.into()), required, ..nothing });
        }
        if let Some(options) = said.strip_prefix("one of ") {
            let options = options.split(", ").map(str::to_string).collect();
            return Some(Domain { kind: "choice".into(), options, ..nothing });
        }
        let kind = if said.starts_with("whole ") { "integer" } else { "number" };
        let (range, unit) = said.strip_prefix("whole ").unwrap_or(said).split_once(' ').unwrap_or((said, ""));
        let range = if unit.is_empty() { said.strip_prefix("whole ").unwrap_or(said) } else { range };
        let (low, high) = range.split_once("..")?;
        let range = Some([low.parse().ok()?, high.parse().ok()?]);
        Some(Domain { kind: kind.into(), range, unit: unit.into(), ..nothing })
    }

    pub fn is_numeric(&self) -> bool {
        self.kind == "number" || self.kind == "integer"
    }

    /// Whether a literal lies in it.
    pub fn accepts(&self, value: &Value) -> bool {
        match (self.kind.as_str(), value.as_f64(), value.as_str(), self.range) {
            ("number", Some(x), _, Some([low, high])) => (low..=high).contains(&x),
            ("integer", Some(x), _, Some([low, high])) => x.fract() == 0.0 && (low..=high).contains(&x),
            ("choice", _, Some(word), _) => self.options.iter().any(|option| option == word),
            _ => false,
        }
    }

    /// For blockers and hints.
    pub fn describe(&self) -> String {
        match (self.kind.as_str(), self.range) {
            ("choice", _) => format!("one of {}", self.options.join(", ")),
            ("mechanism", _) => format!("a module of slot `{}`", self.slot.as_deref().unwrap_or("?")),
            (kind, Some([low, high])) => format!("a {kind} in [{low}, {high}]"),
            (kind, None) => kind.to_string(),
        }
    }
}
