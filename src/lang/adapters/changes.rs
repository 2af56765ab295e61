//! Differences of a program from another of its family, in words with the units of the contract.

use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};

use super::contract::{Contract, Domain, SettingSpec};
use crate::objects::expr::canonical_text;
use crate::objects::pointer::within;
use crate::objects::{MechanismModule, OperatorNode, ParameterValue, PolicyRule, Program, Setting};

/// One place that differs.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Change {
    /// JSON pointer into the program.
    pub place: String,
    /// The value that was there and the value that is there now.
    pub says: String,
}

impl Contract {
    /// Returns everything of `after` that differs from `before`, part by part; empty where both do the same.
    pub fn changes(&self, before: &Program, after: &Program) -> Vec<Change> {
        let mut changes = Vec::new();
        for (name, [was, is]) in both(&before.parameters, &after.parameters) {
            let place = within("/parameters", name);
            let domain = self.parameters.get(name).map(|spec| &spec.domain);
            let means = self.parameters.get(name).map_or("", |spec| spec.describes.as_str());
            let what = format!("parameter {name}");
            changes.extend(moved(place, &what, [was, is].map(|value| value.map(|v| valued(v, domain))), means));
        }
        for (name, [was, is]) in both(&before.operator_graph, &after.operator_graph) {
            changes.extend(self.node(&within("/operator_graph", name), name, was, is));
        }
        changes.extend(self.rules(before, after));
        for (name, [was, is]) in both(&before.mechanism_modules, &after.mechanism_modules) {
            changes.extend(module(&within("/mechanism_modules", name), name, was, is));
        }
        changes
    }

    fn node(&self, place: &str, name: &str, was: Option<&OperatorNode>, is: Option<&OperatorNode>) -> Vec<Change> {
        let (was, is) = match (was, is) {
            (Some(was), Some(is)) => (was, is),
            (None, Some(is)) => return vec![Change { place: place.into(), says: self.added(name, is) }],
            (Some(was), None) => {
                let says = format!("node {name} ({} {}) is gone", was.slot.name(), was.kind);
                return vec![Change { place: place.into(), says }];
            }
            (None, None) => return Vec::new(),
        };
        let mut changes = Vec::new();
        let mut field = |field: &str, was: String, is: String| {
            let what = format!("node {name}: {field}");
            changes.extend(moved(within(place, field), &what, [Some(was), Some(is)], ""));
        };
        field("slot", was.slot.name().into(), is.slot.name().into());
        field("kind", was.kind.clone(), is.kind.clone());
        field("inputs", was.inputs.join(", "), is.inputs.join(", "));
        let place = within(place, "settings");
        for (setting, [of, to]) in both(&was.settings, &is.settings) {
            let [old, new] = [was, is].map(|node| self.setting_spec(node, setting));
            let values = [of.map(|value| set(value, old)), to.map(|value| set(value, new))];
            let means = new.or(old).map_or("", |spec| spec.describes.as_str());
            changes.extend(moved(within(&place, setting), &format!("node {name}: setting {setting}"), values, means));
        }
        changes
    }

    fn added(&self, name: &str, node: &OperatorNode) -> String {
        let settings: Vec<String> = node
            .settings
            .iter()
            .map(|(setting, value)| format!("{setting} = {}", set(value, self.setting_spec(node, setting))))
            .collect();
        let behind = if node.inputs.is_empty() { String::new() } else { format!(" behind {}", node.inputs.join(", ")) };
        let with = if settings.is_empty() { String::new() } else { format!(" with {}", settings.join(", ")) };
        format!("node {name} is new: {} {}{behind}{with}", node.slot.name(), node.kind)
    }

    fn setting_spec(&self, node: &OperatorNode, setting: &str) -> Option<&SettingSpec> {
        self.operator(node.slot, &node.kind)?.settings.get(setting)
    }

    fn rules(&self, before: &Program, after: &Program) -> Vec<Change> {
        let place = "/scenario_conditioned_policy";
        let (old, new) = (&before.scenario_conditioned_policy, &after.scenario_conditioned_policy);
        let mut changes = Vec::new();
        for rule in old.iter().filter(|rule| !new.iter().any(|other| other.name == rule.name)) {
            changes.push(Change { place: place.into(), says: format!("rule {} is gone", rule.name) });
        }
        for (index, rule) in new.iter().enumerate() {
            let place = within(place, &index.to_string());
            let says = self.rule(after, rule);
            match old.iter().find(|other| other.name == rule.name) {
                None => changes.push(Change { place, says: format!("rule {} is new: {says}", rule.name) }),
                Some(was) => {
                    let was = self.rule(before, was);
                    changes.extend(moved(place, &format!("rule {}", rule.name), [Some(was), Some(says)], ""));
                }
            }
        }
        let names = |rules: &[PolicyRule], others: &[PolicyRule]| -> Vec<String> {
            let kept = rules.iter().filter(|rule| others.iter().any(|other| other.name == rule.name));
            kept.map(|rule| rule.name.clone()).collect()
        };
        let (was, is) = (names(old, new), names(new, old));
        if was != is {
            let says = format!("rules are tried in the order {} in place of {}", is.join(", "), was.join(", "));
            changes.push(Change { place: place.into(), says });
        }
        changes
    }

    /// Returns a rule on one line.
    fn rule(&self, program: &Program, rule: &PolicyRule) -> String {
        let parameters = rule.parameters.iter().map(|(name, value)| {
            format!("{name} = {}", valued(value, self.parameters.get(name).map(|spec| &spec.domain)))
        });
        let settings = rule.operators.iter().flat_map(|(node, settings)| {
            let of = program.operator_graph.get(node);
            settings.iter().map(move |(setting, value)| {
                format!("{node}.{setting} = {}", set(value, of.and_then(|of| self.setting_spec(of, setting))))
            })
        });
        let all: Vec<String> = parameters.chain(settings).collect();
        format!("where `{}`, {}", canonical_text(&rule.when), all.join(", "))
    }
}

fn module(place: &str, name: &str, was: Option<&MechanismModule>, is: Option<&MechanismModule>) -> Vec<Change> {
    let text = |module: &MechanismModule| format!("`{}`", canonical_text(&module.expression));
    match (was, is) {
        (None, None) => Vec::new(),
        (None, Some(is)) => {
            let says = format!("module {name} is new: {} {}", is.slot, text(is));
            vec![Change { place: place.into(), says }]
        }
        (Some(was), None) => {
            vec![Change { place: place.into(), says: format!("module {name} ({}) is gone", was.slot) }]
        }
        (Some(was), Some(is)) => {
            let fields = [
                ("slot", was.slot.clone(), is.slot.clone()),
                ("expression", text(was), text(is)),
                ("inputs", was.inputs.join(", "), is.inputs.join(", ")),
                ("tags", was.tags.join(", "), is.tags.join(", ")),
            ];
            let of = |(field, was, is): (&str, String, String)| {
                moved(within(place, field), &format!("module {name}: {field}"), [Some(was), Some(is)], "")
            };
            fields.into_iter().filter_map(of).collect()
        }
    }
}

/// Returns the change from one text to another; `None` where they are equal.
fn moved(place: String, what: &str, values: [Option<String>; 2], means: &str) -> Option<Change> {
    let shown = |text: String| if text.is_empty() { "nothing".to_string() } else { text };
    let says = match values {
        [was, is] if was == is => return None,
        [Some(was), Some(is)] => format!("{what} from {} to {}", shown(was), shown(is)),
        [None, Some(is)] => format!("{what} is new: {}", shown(is)),
        [Some(was), None] => format!("{what} is gone, it was {}", shown(was)),
        [None, None] => return None,
    };
    let means = if means.is_empty() { String::new() } else { format!(" ({})", means.trim_end_matches('.')) };
    Some(Change { place, says: format!("{says}{means}") })
}

fn valued(value: &ParameterValue, domain: Option<&Domain>) -> String {
    match value {
        ParameterValue::Choice(word) => word.clone(),
        ParameterValue::Number(number) => format!("{number}{}", unit(domain)),
    }
}

fn set(value: &Setting, spec: Option<&SettingSpec>) -> String {
    match value {
        Setting::Number(number) => format!("{number}{}", unit(spec.map(|spec| &spec.domain))),
        Setting::Choice(word) => word.clone(),
        Setting::Parameter(of) => format!("parameter {}", of.parameter),
        Setting::Mechanism(of) => format!("module {}", of.mechanism),
    }
}

fn unit(domain: Option<&Domain>) -> String {
    match domain {
        Some(Domain::Number { unit, .. } | Domain::Integer { unit, .. }) if !unit.is_empty() && unit != "1" => {
            format!(" {unit}")
        }
        _ => String::new(),
    }
}

/// Returns every name of either map with the values of both.
fn both<'a, T>(
    before: &'a BTreeMap<String, T>,
    after: &'a BTreeMap<String, T>,
) -> impl Iterator<Item = (&'a String, [Option<&'a T>; 2])> {
    let names: BTreeSet<&String> = before.keys().chain(after.keys()).collect();
    names.into_iter().map(move |name| (name, [before.get(name), after.get(name)]))
}

#[cfg(test)]
mod tests {
    use super::super::toy;
    use super::*;

    fn says(edit: impl FnOnce(&mut Program)) -> Vec<String> {
        let (contract, before) = (toy::contract(), toy::program());
        let mut after = before.clone();
        edit(&mut after);
        contract
            .changes(&before, &after)
            .into_iter()
            .map(|change| format!("{} {}", change.place, change.says))
            .collect()
    }

    #[test]
    fn nothing_is_said_of_spacing_and_of_equal_programs() {
        assert!(says(|_| ()).is_empty());
        let spaced = says(|program| {
            for module in program.mechanism_modules.values_mut() {
                module.expression = format!("  {} ", module.expression);
            }
        });
        assert!(spaced.is_empty(), "{spaced:?}");
    }

    #[test]
    fn every_part_that_changes_is_named_with_both_values_and_units() {
        let duration = says(|program| {
            program.parameters.insert("duration_s".into(), ParameterValue::Number(2.5));
        });
        let [only] = &duration[..] else { panic!("{duration:?}") };
        let was = match toy::program().parameters["duration_s"] {
            ParameterValue::Number(number) => number,
            _ => unreachable!("a number"),
        };
        assert!(
            only.starts_with(&format!("/parameters/duration_s parameter duration_s from {was} s to 2.5 s (")),
            "{only}"
        );
        let node = says(|program| {
            program.operator_graph.get_mut("actor").unwrap().kind = "marked_actor".into();
        });
        assert!(
            node.iter().any(|line| line.contains("node actor: kind from ranked_actors to marked_actor")),
            "{node:?}"
        );
        let gone = says(|program| drop(program.operator_graph.remove("filter")));
        assert!(gone.iter().any(|line| line.contains("node filter (filter ") && line.ends_with("is gone")), "{gone:?}");
        let rules = says(|program| program.scenario_conditioned_policy.clear());
        assert_eq!(rules.len(), toy::program().scenario_conditioned_policy.len());
        assert!(rules[0].contains("is gone"), "{rules:?}");
        let module = says(|program| {
            program.mechanism_modules.values_mut().next().unwrap().expression = "1 + 1".into();
        });
        assert!(module[0].contains(": expression from `") && module[0].ends_with("to `1 + 1`"), "{module:?}");
    }

    #[test]
    fn a_rule_that_moves_or_says_something_else_is_told() {
        let (contract, mut before) = (toy::contract(), toy::program());
        let mut second = before.scenario_conditioned_policy[0].clone();
        second.name = "second".into();
        before.scenario_conditioned_policy.push(second);
        let mut after = before.clone();
        after.scenario_conditioned_policy.reverse();
        let [only] = &contract.changes(&before, &after)[..] else { panic!("one change") };
        assert!(only.says.starts_with("rules are tried in the order second, "), "{}", only.says);
        after = before.clone();
        after.scenario_conditioned_policy[1].when = "vehicle_count > 7".into();
        let [only] = &contract.changes(&before, &after)[..] else { panic!("one change") };
        assert!(
            only.says.starts_with("rule second from where `") && only.says.contains("vehicle_count > 7"),
            "{}",
            only.says
        );
    }
}
