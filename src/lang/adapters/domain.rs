//! Checks values against their domains: parameters, and settings that may refer to parameters and mechanisms.

use std::collections::BTreeMap;

use super::{
    contract::{Contract, Domain, OperatorSpec, SettingSpec},
    problem::Problem,
};
use crate::objects::{ParameterValue, Program, Setting, pointer::within};

impl Domain {
    /// Returns the domain in words for messages and prompts, e.g. `a number in [0, 5] m`.
    pub fn describe(&self) -> String {
        match self {
            Domain::Number { low, high, unit } => format!("a number in [{low}, {high}]{}", suffix(unit)),
            Domain::Integer { low, high, unit } => format!("a whole number in [{low}, {high}]{}", suffix(unit)),
            Domain::Choice { options } => format!("one of {}", options.join(", ")),
            Domain::Mechanism { slot } => format!("{{\"mechanism\": name}} with a module of slot `{slot}`"),
        }
    }

    /// Returns `true` if a literal lies in it. A mechanism is never a literal.
    pub fn accepts(&self, value: &ParameterValue) -> bool {
        match (self, value) {
            (Domain::Number { low, high, .. }, ParameterValue::Number(x)) => (*low..=*high).contains(x),
            (Domain::Integer { low, high, .. }, ParameterValue::Number(x)) => {
                x.fract() == 0.0 && (*low as f64..=*high as f64).contains(x)
            }
            (Domain::Choice { options }, ParameterValue::Choice(word)) => options.contains(word),
            _ => false,
        }
    }

    /// Returns `true` if expressions may read a parameter of this domain.
    pub fn is_numeric(&self) -> bool {
        matches!(self, Domain::Number { .. } | Domain::Integer { .. })
    }
}

fn suffix(unit: &str) -> String {
    if unit.is_empty() || unit == "1" { String::new() } else { format!(" {unit}") }
}

fn quoted(value: &ParameterValue) -> String {
    match value {
        ParameterValue::Number(x) => x.to_string(),
        ParameterValue::Choice(word) => format!("`{word}`"),
    }
}

impl Contract {
    /// θ ∈ Θ_b: every declared parameter has a value of its domain, and no other has one.
    pub fn check_parameters(&self, program: &Program) -> Vec<Problem> {
        let missing = self.parameters.iter().filter(|(name, _)| !program.parameters.contains_key(*name));
        let missing = missing
            .map(|(name, spec)| Problem::new(within("/parameters", name), "no value", spec.domain.describe()))
            .collect::<Vec<_>>();
        [missing, self.check_values("/parameters", &program.parameters)].concat()
    }

    /// Checks the given values, all or some: names must be known, values in their domains.
    pub(super) fn check_values(&self, place: &str, values: &BTreeMap<String, ParameterValue>) -> Vec<Problem> {
        let check = |(name, value): (&String, &ParameterValue)| {
            let place = within(place, name);
            match self.parameters.get(name) {
                None => Some(Problem::unknown(place, "parameter", name, self.parameters.keys().map(String::as_str))),
                Some(spec) if spec.domain.accepts(value) => None,
                Some(spec) => Some(Problem::new(place, quoted(value), spec.domain.describe())),
            }
        };
        values.iter().filter_map(check).collect()
    }

    /// Checks the given settings of a node of this kind: names must be known, values and references in their domains.
    pub(super) fn check_settings(
        &self,
        program: &Program,
        place: &str,
        spec: &OperatorSpec,
        settings: &BTreeMap<String, Setting>,
    ) -> Vec<Problem> {
        let mut problems = Vec::new();
        for (name, setting) in settings {
            let place = within(place, name);
            match spec.settings.get(name) {
                None => {
                    let what = format!("setting of `{}`", spec.kind);
                    problems.push(Problem::unknown(place, &what, name, spec.settings.keys().map(String::as_str)));
                }
                Some(spec) => problems.extend(self.check_setting(program, place, spec, setting)),
            }
        }
        problems
    }

    fn check_setting(
        &self,
        program: &Program,
        place: String,
        spec: &SettingSpec,
        setting: &Setting,
    ) -> Option<Problem> {
        let literal = match setting {
            Setting::Number(x) => ParameterValue::Number(*x),
            Setting::Choice(word) => ParameterValue::Choice(word.clone()),
            Setting::Parameter(to) => return self.check_parameter_reference(program, place, spec, &to.parameter),
            Setting::Mechanism(to) => return check_mechanism_reference(program, place, spec, &to.mechanism),
        };
        (!spec.domain.accepts(&literal)).then(|| Problem::new(place, quoted(&literal), spec.domain.describe()))
    }

    /// Checks that the parameter exists, and that its value and every value a rule of ρ may give it lie in the setting's domain.
    fn check_parameter_reference(
        &self,
        program: &Program,
        place: String,
        spec: &SettingSpec,
        name: &str,
    ) -> Option<Problem> {
        if !self.parameters.contains_key(name) {
            return Some(Problem::unknown(place, "parameter", name, self.parameters.keys().map(String::as_str)));
        }
        let by_rules = program.scenario_conditioned_policy.iter().filter_map(|rule| rule.parameters.get(name));
        let mut values = program.parameters.get(name).into_iter().chain(by_rules);
        let outside = values.find(|value| !spec.domain.accepts(value))?;
        let found = format!("parameter `{name}` with the value {}", quoted(outside));
        Some(Problem::new(place, found, spec.domain.describe()))
    }
}

fn check_mechanism_reference(program: &Program, place: String, spec: &SettingSpec, name: &str) -> Option<Problem> {
    let Domain::Mechanism { slot } = &spec.domain else {
        return Some(Problem::new(place, format!("mechanism `{name}`"), spec.domain.describe()));
    };
    let of_slot = program.mechanism_modules.iter().filter(|(_, module)| module.slot == *slot);
    match program.mechanism_modules.get(name) {
        Some(module) if module.slot == *slot => None,
        Some(module) => {
            let found = format!("module `{name}` of slot `{}`", module.slot);
            Some(Problem::new(place, found, spec.domain.describe()))
        }
        None => {
            let what = format!("module of slot `{slot}`");
            Some(Problem::unknown(place, &what, name, of_slot.map(|(name, _)| name.as_str())))
        }
    }
}
