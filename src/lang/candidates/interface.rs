//! The interface gate: every edit lies on the editable surface, at a place that the family's vocabulary knows, and
//! the edits together change something.

use std::collections::BTreeSet;

use super::apply::shortened;
use crate::{
    adapters::{Contract, Problem},
    objects::{Pointer, ProgramPatch, Surface},
};

const NODE_FIELDS: [&str; 4] = ["slot", "kind", "settings", "inputs"];
const RULE_FIELDS: [&str; 4] = ["name", "when", "parameters", "operators"];
const MODULE_FIELDS: [&str; 5] = ["slot", "inputs", "output", "expression", "tags"];

pub fn check(patch: &ProgramPatch, contract: &Contract, changes_nothing: bool) -> Vec<Problem> {
    let mut problems = Vec::new();
    let (count, most) = (patch.operations.len(), contract.limits.operations_per_patch);
    if count == 0 || count > most {
        problems.push(Problem::new("patch/operations", format!("{count} operations"), format!("1 to {most}")));
    }
    let words = Words::of(contract);
    for (index, operation) in patch.operations.iter().take(most.saturating_mul(2)).enumerate() {
        let place = format!("patch/operations/{index}/path");
        let path = shortened(&operation.path);
        let parsed = Pointer::parse(&operation.path)
            .map_err(|error| Problem::new(&place, format!("`{path}`"), error.to_string()));
        problems.extend(match parsed {
            Err(problem) => Some(problem),
            Ok(pointer) => words.check(&pointer).map(|expected| Problem::new(&place, format!("`{path}`"), expected)),
        });
    }
    if changes_nothing {
        problems.push(Problem::new("patch/operations", "edits that change nothing", "a program other than the parent"));
    }
    problems
}

/// Words that may stand in paths.
struct Words<'a> {
    parameters: BTreeSet<&'a str>,
    settings: BTreeSet<&'a str>,
}

impl<'a> Words<'a> {
    fn of(contract: &'a Contract) -> Words<'a> {
        let kinds = contract.operators.values().flatten();
        Words {
            parameters: contract.parameters.keys().map(String::as_str).collect(),
            settings: kinds.flat_map(|spec| spec.settings.keys().map(String::as_str)).collect(),
        }
    }

    /// Returns what is expected in place of an illegal path; `None` for a legal one.
    fn check(&self, pointer: &Pointer) -> Option<String> {
        let tokens: Vec<&str> = pointer.tokens.iter().map(String::as_str).collect();
        let surface = tokens.first().and_then(|first| Surface::ALL.into_iter().find(|s| s.name() == *first));
        let Some(surface) = surface else {
            return Some(format!("a path under {}", crate::objects::EDITABLE_SURFACE.join(", ")));
        };
        let rest = tokens.get(1..).unwrap_or_default();
        if rest.is_empty() {
            return Some(format!("one entry, /{}/<name or index>, not the whole part", surface.name()));
        }
        match surface {
            Surface::Parameters => self.parameter(rest),
            Surface::OperatorGraph => self.node(rest),
            Surface::ScenarioConditionedPolicy => self.rule(rest),
            Surface::MechanismModules => module(rest),
        }
    }

    fn parameter(&self, rest: &[&str]) -> Option<String> {
        match rest {
            [name] => known(&self.parameters, name, "a parameter of the family"),
            _ => Some("/parameters/<name>".into()),
        }
    }

    fn node(&self, rest: &[&str]) -> Option<String> {
        match rest {
            [_] => None,
            [_, "settings", name] => known(&self.settings, name, "a setting of an operator kind of the family"),
            [_, "inputs", index] => place_in_list(index),
            [_, field] if NODE_FIELDS.contains(field) => None,
            _ => Some(format!("/operator_graph/<node>/ and one of {}", NODE_FIELDS.join(", "))),
        }
    }

    fn rule(&self, rest: &[&str]) -> Option<String> {
        if let Some(expected) = rest.first().and_then(|index| place_in_list(index)) {
            return Some(expected);
        }
        match rest {
            [_] => None,
            [_, "parameters", name] => known(&self.parameters, name, "a parameter of the family"),
            [_, "operators", _node] => None,
            [_, "operators", _node, name] => known(&self.settings, name, "a setting of an operator kind of the family"),
            [_, field] if RULE_FIELDS.contains(field) => None,
            _ => Some(format!("/scenario_conditioned_policy/<index>/ and one of {}", RULE_FIELDS.join(", "))),
        }
    }
}

fn module(rest: &[&str]) -> Option<String> {
    match rest {
        [_] => None,
        [_, "inputs" | "tags", index] => place_in_list(index),
        [_, field] if MODULE_FIELDS.contains(field) => None,
        _ => Some(format!("/mechanism_modules/<name>/ and one of {}", MODULE_FIELDS.join(", "))),
    }
}

fn known(words: &BTreeSet<&str>, name: &str, what: &str) -> Option<String> {
    if words.contains(name) {
        return None;
    }
    let near = crate::text::nearest(name, words.iter().copied());
    Some(format!("{what}{}", near.map(|near| format!("; did you mean `{near}`?")).unwrap_or_default()))
}

fn place_in_list(token: &str) -> Option<String> {
    let index = token == "-" || (!token.is_empty() && token.bytes().all(|b| b.is_ascii_digit()));
    (!index).then(|| "an index, or `-` to append".into())
}
