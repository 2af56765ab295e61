//! The four editable parts of a program as somebody wrote them: typed one by one, so that every fault has its own place.

use serde::de::DeserializeOwned;
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;

use crate::adapters::Problem;
use crate::objects::expr::Expr;
use crate::objects::pointer::within;
use crate::objects::{MechanismModule, OperatorNode, ParameterValue, PolicyRule, Program, Setting, Slot};

const NODE_FIELDS: [&str; 4] = ["slot", "kind", "settings", "inputs"];
const RULE_FIELDS: [&str; 4] = ["name", "when", "parameters", "operators"];
const MODULE_FIELDS: [&str; 5] = ["slot", "inputs", "output", "expression", "tags"];

const VALUE: &str = "a number or a word";
const SETTING: &str = "a number, a word, { parameter = name } or { mechanism = name }";

/// Parts that a program is made of.
#[derive(Clone, Debug, Default)]
pub struct Parts {
    pub parameters: BTreeMap<String, ParameterValue>,
    pub operator_graph: BTreeMap<String, OperatorNode>,
    pub scenario_conditioned_policy: Vec<PolicyRule>,
    pub mechanism_modules: BTreeMap<String, MechanismModule>,
}

impl Parts {
    /// A program with these parts in place of its own.
    pub fn put_into(self, program: Program) -> Program {
        let Parts { parameters, operator_graph, scenario_conditioned_policy, mechanism_modules } = self;
        Program { parameters, operator_graph, scenario_conditioned_policy, mechanism_modules, ..program }
    }
}

/// Problems that are collected on the way.
struct Reading {
    problems: Vec<Problem>,
}

/// The parts of an object that has them as its fields; what is missing is empty. `place` is the object's own.
pub fn typed(of: &Map<String, Value>, place: &str) -> (Parts, Vec<Problem>) {
    let mut reading = Reading { problems: Vec::new() };
    let part = |name: &str| (within(place, name), of.get(name).cloned());
    let (at, value) = part("parameters");
    let parameters = reading.entries(&at, value, |reading, at, value| reading.value(at, value));
    let (at, value) = part("operator_graph");
    let operator_graph = reading.entries(&at, value, Reading::node);
    let (at, value) = part("scenario_conditioned_policy");
    let scenario_conditioned_policy = reading.rules(&at, value);
    let (at, value) = part("mechanism_modules");
    let mechanism_modules = reading.entries(&at, value, Reading::module);
    (Parts { parameters, operator_graph, scenario_conditioned_policy, mechanism_modules }, reading.problems)
}

impl Reading {
    fn wrong<T>(&mut self, place: &str, found: &Value, expected: impl Into<String>) -> Option<T> {
        self.problems.push(Problem::new(place, found.to_string(), expected));
        None
    }

    fn entries<T>(
        &mut self,
        place: &str,
        value: Option<Value>,
        one: impl Fn(&mut Reading, &str, Value) -> Option<T>,
    ) -> BTreeMap<String, T> {
        match value {
            None => BTreeMap::new(),
            Some(Value::Object(entries)) => {
                let typed =
                    |(name, value): (String, Value)| Some((name.clone(), one(self, &within(place, &name), value)?));
                entries.into_iter().filter_map(typed).collect()
            }
            Some(other) => self.wrong(place, &other, "a table").unwrap_or_default(),
        }
    }

    fn value(&mut self, place: &str, value: Value) -> Option<ParameterValue> {
        match value {
            Value::Number(_) | Value::String(_) => self.plain(place, value, VALUE),
            other => self.wrong(place, &other, VALUE),
        }
    }

    fn setting(&mut self, place: &str, value: Value) -> Option<Setting> {
        self.plain(place, value, SETTING)
    }

    fn node(&mut self, place: &str, value: Value) -> Option<OperatorNode> {
        let mut fields = self.fields(place, value, &NODE_FIELDS)?;
        let settings = fields.remove("settings");
        let settings = self.entries(&within(place, "settings"), settings, Reading::setting);
        let slots = Slot::ALL.map(Slot::name);
        if let Some(Value::String(word)) = fields.get("slot").filter(|slot| !slots.iter().any(|name| slot == name)) {
            self.problems.push(Problem::unknown(within(place, "slot"), "slot", word, slots));
            return None;
        }
        let node: OperatorNode = self.whole(place, fields)?;
        Some(OperatorNode { settings, ..node })
    }

    fn rules(&mut self, place: &str, value: Option<Value>) -> Vec<PolicyRule> {
        match value {
            None => Vec::new(),
            Some(Value::Array(items)) => {
                let typed = |(index, value)| self.rule(&within(place, &usize::to_string(&index)), value);
                items.into_iter().enumerate().filter_map(typed).collect()
            }
            Some(other) => self.wrong(place, &other, "a list of rules").unwrap_or_default(),
        }
    }

    fn rule(&mut self, place: &str, value: Value) -> Option<PolicyRule> {
        let mut fields = self.fields(place, value, &RULE_FIELDS)?;
        let (parameters, operators) = (fields.remove("parameters"), fields.remove("operators"));
        let parameters =
            self.entries(&within(place, "parameters"), parameters, |reading, at, value| reading.value(at, value));
        let operators = self.entries(&within(place, "operators"), operators, |reading, at, value| {
            Some(reading.entries(at, Some(value), Reading::setting))
        });
        let rule: PolicyRule = self.whole(place, fields)?;
        Some(PolicyRule { parameters, operators, ..rule })
    }

    /// A module whose inputs are left out reads what its expression reads.
    fn module(&mut self, place: &str, value: Value) -> Option<MechanismModule> {
        let mut fields = self.fields(place, value, &MODULE_FIELDS)?;
        let expression = fields.get("expression").and_then(Value::as_str).unwrap_or_default();
        if !fields.contains_key("inputs") {
            fields.insert("inputs".into(), json!(names_read(expression)));
        }
        self.whole(place, fields)
    }

    /// The fields of an object, if it has none that nobody knows.
    fn fields(&mut self, place: &str, value: Value, known: &[&str]) -> Option<Map<String, Value>> {
        let Value::Object(fields) = value else { return self.wrong(place, &value, "a table") };
        for name in fields.keys().filter(|name| !known.contains(&name.as_str())) {
            self.problems.push(Problem::unknown(within(place, name), "key", name, known.iter().copied()));
        }
        fields.keys().all(|name| known.contains(&name.as_str())).then_some(fields)
    }

    fn plain<T: DeserializeOwned>(&mut self, place: &str, value: Value, expected: &str) -> Option<T> {
        match serde_json::from_value(value.clone()) {
            Ok(typed) => Some(typed),
            Err(_) => self.wrong(place, &value, expected),
        }
    }

    /// An object whose fields serde names.
    fn whole<T: DeserializeOwned>(&mut self, place: &str, fields: Map<String, Value>) -> Option<T> {
        match serde_json::from_value(Value::Object(fields)) {
            Ok(typed) => Some(typed),
            Err(error) => {
                self.problems.push(Problem::new(place, error.to_string(), "its keys with values of their types"));
                None
            }
        }
    }
}

/// The names that an expression reads, sorted; none of one that cannot be parsed.
pub fn names_read(expression: &str) -> Vec<String> {
    Expr::parse(expression).map_or_else(|_| Vec::new(), |expr| expr.names().into_iter().collect())
}
