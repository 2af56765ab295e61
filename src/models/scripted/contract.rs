//! A family's contract as the prompt shows it: values in one line each, features in groups.

use serde::Deserialize;
use serde_json::Value;
use std::collections::BTreeMap;

use super::refusal::unanswerable;
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

/// Reader of a scene feature.
const EVERYBODY: &str = "every expression";
/// Parts of a name that say its unit.
const UNITS: [(&str, &str); 8] = [
    ("mps3", "m/s^3"),
    ("mps2", "m/s^2"),
    ("mps", "m/s"),
    ("radps", "rad/s"),
    ("rad", "rad"),
    ("1pm", "1/m"),
    ("m", "m"),
    ("s", "s"),
];

/// The contract as it grows line by line.
#[derive(Default)]
struct Lines {
    section: String,
    slot: String,
    kind: String,
    read_by: Vec<String>,
    limits: BTreeMap<String, usize>,
    parameters: BTreeMap<String, Domain>,
    operators: BTreeMap<String, SlotSpec>,
    /// Ports of each slot's kinds that name none.
    common: (Vec<String>, String),
    mechanism_slots: BTreeMap<String, MechanismSlot>,
    scene_features: Vec<String>,
    features: BTreeMap<String, Feature>,
}

impl Contract {
    /// The block as it stands in a prompt.
    pub fn read(text: &str) -> Result<Contract, ModelError> {
        let mut lines = Lines::default();
        for line in text.lines() {
            lines
                .take(line)
                .ok_or_else(|| unanswerable(format!("the family contract has an unreadable line: {line}")))?;
        }
        let limits = serde_json::to_value(&lines.limits).and_then(serde_json::from_value);
        Ok(Contract {
            parameters: lines.parameters,
            operators: lines.operators,
            mechanism_slots: lines.mechanism_slots,
            scene_features: lines.scene_features,
            features: lines.features,
            limits: limits.map_err(|error| unanswerable(format!("the limits of the family contract: {error}")))?,
        })
    }
}

impl Lines {
    fn take(&mut self, line: &str) -> Option<()> {
        if let Some(section) = line.strip_prefix("== ") {
            self.section = section.into();
            return Some(());
        }
        match self.section.as_str() {
            "parameters" => {
                let (name, said) = line.split_once(": ")?;
                self.parameters.insert(name.into(), Domain::read(name, said)?);
            }
            "operators" => self.operator(line)?,
            "mechanism slots" => {
                let (name, said) = line.split_once(": ")?;
                let (output, meaning) = said.split_once(": ")?;
                let slot = MechanismSlot { output: output.into(), reads: vec![], meaning: meaning.into() };
                self.mechanism_slots.insert(name.into(), slot);
            }
            "features" => self.feature(line)?,
            _ => {
                if let Some(limits) = line.strip_prefix("limits: ") {
                    let read =
                        |part: &str| Some((part.split_once(' ')?.0.into(), part.split_once(' ')?.1.parse().ok()?));
                    self.limits = limits.split(", ").map(read).collect::<Option<_>>()?;
                }
            }
        }
        Some(())
    }

    /// `slot <name>, 0..8 nodes: <ports>`, `- <kind>: meaning`, `- <kind> (<ports>): meaning`, `  as parameters: a, b`,
    /// `  <setting>: <domain>: meaning`.
    fn operator(&mut self, line: &str) -> Option<()> {
        if let Some(slot) = line.strip_prefix("slot ") {
            let (head, ports) = slot.split_once(" nodes: ")?;
            let (name, range) = head.split_once(", ")?;
            let (fewest, most) = range.split_once("..")?;
            self.slot = name.into();
            self.common = read_ports(ports)?;
            let spec = SlotSpec { nodes: [fewest.parse().ok()?, most.parse().ok()?], kinds: BTreeMap::new() };
            self.operators.insert(name.into(), spec);
            return Some(());
        }
        let kinds = &mut self.operators.get_mut(&self.slot)?.kinds;
        if let Some(kind) = line.strip_prefix("- ") {
            let end = kind.find([' ', ':'])?;
            let (name, rest) = kind.split_at(end);
            let own = rest.strip_prefix(" (").and_then(|rest| rest.split_once("): "));
            let (inputs, output) = match own {
                Some((ports, _)) => read_ports(ports)?,
                None => self.common.clone(),
            };
            self.kind = name.into();
            kinds.insert(name.into(), Kind { inputs, output, settings: BTreeMap::new() });
            return Some(());
        }
        let settings = &mut kinds.get_mut(&self.kind)?.settings;
        let (name, said) = line.strip_prefix("  ")?.split_once(": ")?;
        if name == "as parameters" {
            let alike = said.split(", ").map(|name| Some((name.to_string(), self.parameters.get(name)?.clone())));
            settings.extend(alike.collect::<Option<Vec<_>>>()?);
        } else {
            settings.insert(name.into(), Domain::read(name, said)?);
        }
        Some(())
    }

    /// `read by <slots>:`, `<name>: meaning`, `<name> (bool): meaning` of one that is true or false, `<name> (<unit>): meaning`.
    fn feature(&mut self, line: &str) -> Option<()> {
        if let Some(readers) = line.strip_prefix("read by ") {
            self.read_by = readers.strip_suffix(':')?.split(", ").map(str::to_string).collect();
            return Some(());
        }
        let (head, _) = line.split_once(": ")?;
        let (name, said) = head.split_once(" (").map_or((head, ""), |(name, said)| (name, said.trim_end_matches(')')));
        let (value, unit) = match said {
            "bool" => ("boolean", String::new()),
            _ => ("number", unit_of(name, said)),
        };
        self.features.insert(name.into(), Feature { value: value.into(), unit });
        for reader in &self.read_by {
            match self.mechanism_slots.get_mut(reader) {
                Some(slot) => slot.reads.push(name.into()),
                None if reader == EVERYBODY => self.scene_features.push(name.into()),
                None => return None,
            }
        }
        Some(())
    }
}

fn read_ports(text: &str) -> Option<(Vec<String>, String)> {
    let (inputs, output) = text.split_once(" -> ")?;
    let inputs = if inputs == "nothing" { vec![] } else { inputs.split(", ").map(str::to_string).collect() };
    Some((inputs, output.into()))
}

/// The unit that stands beside a value or in its name.
fn unit_of(name: &str, said: &str) -> String {
    let in_name = || UNITS.iter().find(|(part, _)| name.split('_').any(|word| word == *part));
    match said {
        "" => in_name().map(|(_, unit)| (*unit).to_string()).unwrap_or_default(),
        said => said.into(),
    }
}

impl Domain {
    /// `1..8: meaning`, `1..8 km: meaning`, `whole 1..3: ..`, `one of a, b: ..`, `module of slot: ..`, `optional module of slot: ..`.
    fn read(name: &str, text: &str) -> Option<Domain> {
        let (said, _) = text.split_once(": ")?;
        let nothing = Domain {
            kind: String::new(),
            range: None,
            unit: String::new(),
            options: vec![],
            slot: None,
            required: !said.starts_with("optional "),
        };
        let said = said.strip_prefix("optional ").unwrap_or(said);
        if let Some(slot) = said.strip_prefix("module of ") {
            return Some(Domain { kind: "mechanism".into(), slot: Some(slot.into()), ..nothing });
        }
        if let Some(options) = said.strip_prefix("one of ") {
            let options = options.split(", ").map(str::to_string).collect();
            return Some(Domain { kind: "choice".into(), options, ..nothing });
        }
        let (kind, said) = said.strip_prefix("whole ").map_or(("number", said), |said| ("integer", said));
        let (range, unit) = said.split_once(' ').unwrap_or((said, ""));
        let (low, high) = range.split_once("..")?;
        let range = Some([low.parse().ok()?, high.parse().ok()?]);
        Some(Domain { kind: kind.into(), range, unit: unit_of(name, unit), ..nothing })
    }

    pub fn is_numeric(&self) -> bool {
        self.kind == "number" || self.kind == "integer"
    }

    /// Returns `true` if a literal lies in it.
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
