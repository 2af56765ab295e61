//! Steps that a program takes with a scene, in the words of its contract, for somebody who reads no operator graph.

use std::collections::{BTreeMap, BTreeSet};

use super::contract::Contract;
use crate::objects::expr::canonical_text;
use crate::objects::{FlowStep, OperatorNode, ParameterValue, PolicyRule, Program, Setting, Slot};
use crate::text::in_words;

impl Contract {
    /// Returns the steps of `program`, marked where `before` differs.
    ///
    /// A node in which two ways meet stands before them, since it says when each of them is taken. The common beginning of both is told once.
    pub fn flow(&self, before: &Program, program: &Program) -> Vec<FlowStep> {
        let graph = &program.operator_graph;
        let fed: BTreeSet<&str> = graph.values().flat_map(|node| &node.inputs).map(String::as_str).collect();
        let (said, entered) = (BTreeMap::new(), BTreeSet::new());
        let mut walk = Walk { contract: self, before, program, said, entered, steps: Vec::new() };
        graph.keys().filter(|name| !fed.contains(name.as_str())).for_each(|name| walk.node(name, 0));
        for rule in &program.scenario_conditioned_policy {
            let is_new = !before.scenario_conditioned_policy.contains(rule);
            walk.steps.push(FlowStep { depth: 0, says: overridden(rule), is_new });
        }
        walk.steps
    }
}

/// A walk from the choice to the scene.
struct Walk<'p> {
    contract: &'p Contract,
    before: &'p Program,
    program: &'p Program,
    /// Nodes that were told, with the step of each.
    said: BTreeMap<&'p str, usize>,
    /// Nodes that the walk has come to: it ends even in a graph with a circle, which the contract refuses.
    entered: BTreeSet<&'p str>,
    steps: Vec<FlowStep>,
}

impl<'p> Walk<'p> {
    fn node(&mut self, name: &'p str, depth: usize) {
        let Some(node) = self.program.operator_graph.get(name).filter(|_| self.entered.insert(name)) else { return };
        match &node.inputs[..] {
            [] => self.step(name, node, depth),
            [one] => {
                self.input(one, depth);
                self.step(name, node, depth);
            }
            ways => {
                self.step(name, node, depth);
                for (way, nth) in ways.iter().zip(1..) {
                    self.steps.push(FlowStep { depth: depth + 1, says: format!("Way {nth}:"), is_new: false });
                    self.input(way, depth + 2);
                }
            }
        }
    }

    /// Tells the input of a node; in short if it was told with another way.
    fn input(&mut self, name: &'p str, depth: usize) {
        match self.said.get(name).and_then(|step| self.steps.get(*step)) {
            Some(step) => {
                let says = format!("As above up to “{}”", step.says);
                self.steps.push(FlowStep { depth, says, is_new: false });
            }
            None => self.node(name, depth),
        }
    }

    fn step(&mut self, name: &'p str, node: &'p OperatorNode, depth: usize) {
        let spec = self.contract.operator(node.slot, &node.kind);
        let (does, at) = match fallback(node) {
            Some(does) => (does.to_string(), "Of two ways"),
            None => {
                let says =
                    spec.map_or_else(|| in_words(&node.kind), |spec| first_sentence(&spec.describes).to_string());
                (says, if node.inputs.len() > 1 { "Of two ways" } else { question(node.slot) })
            }
        };
        let explained = |name: &str| fallback(node).is_some() && name == UNTIL;
        let settings: Vec<String> = node
            .settings
            .iter()
            .filter(|(name, _)| !explained(name))
            .filter_map(|(name, value)| self.set(name, value))
            .collect();
        let settings = if settings.is_empty() { String::new() } else { format!(" ({})", settings.join(", ")) };
        let is_new = self.before.operator_graph.get(name).is_none_or(|old| !self.same(old, node));
        self.said.insert(name, self.steps.len());
        self.steps.push(FlowStep { depth, says: format!("{at}: {does}{settings}"), is_new });
    }

    /// Returns `true` if a node does the same as before with its inputs.
    fn same(&self, old: &OperatorNode, node: &OperatorNode) -> bool {
        let changed = |value: &Setting| match value {
            Setting::Parameter(of) => self.moved(&of.parameter).is_some(),
            Setting::Mechanism(of) => {
                let of =
                    |program: &Program| program.mechanism_modules.get(&of.mechanism).map(|of| of.expression.clone());
                of(self.before) != of(self.program)
            }
            Setting::Number(_) | Setting::Choice(_) => false,
        };
        (old.slot, &old.kind, &old.settings) == (node.slot, &node.kind, &node.settings)
            && !node.settings.values().any(changed)
    }

    /// Old and new value of a parameter that has changed; `None` otherwise.
    fn moved(&self, name: &str) -> Option<[&'p ParameterValue; 2]> {
        let of = |program: &'p Program| program.parameters.get(name);
        Some([of(self.before)?, of(self.program)?]).filter(|[old, new]| old != new)
    }

    /// Returns a setting that is worth telling: one that follows a parameter is so only where the parameter has changed.
    fn set(&self, name: &str, value: &Setting) -> Option<String> {
        match value {
            Setting::Parameter(of) => self
                .moved(&of.parameter)
                .map(|[old, new]| format!("{} {}, was {}", in_words(name), new.in_words(), old.in_words())),
            value => Some(format!("{} {}", in_words(name), value.in_words())),
        }
    }
}

/// The setting of a fallback: the condition on the first way.
const UNTIL: &str = "until";

/// Returns the condition of a fallback on its first way, in place of the word of its setting.
fn fallback(node: &OperatorNode) -> Option<&'static str> {
    match node.settings.get(UNTIL)? {
        Setting::Choice(word) if word == "meeting" => {
            Some("the first where one of its candidates is predicted to touch the ego, else the second")
        }
        Setting::Choice(word) if word == "candidate" => {
            Some("the first where a candidate is left of it, else the second")
        }
        _ => None,
    }
}

/// Returns the question that a slot answers.
fn question(slot: Slot) -> &'static str {
    match slot {
        Slot::Select => "Where",
        Slot::Actor => "Who",
        Slot::Timing => "When",
        Slot::Motion => "Which motions",
        Slot::Search => "Which is better",
        Slot::Filter => "Then",
        Slot::Law => "While driving",
        Slot::Diversity => "Which is taken",
    }
}

fn overridden(rule: &PolicyRule) -> String {
    let set = |name: &String, value: String| format!("{} {value}", in_words(name));
    let parameters = rule.parameters.iter().map(|(name, value)| set(name, value.in_words()));
    let settings = rule.operators.values().flatten().map(|(name, value)| set(name, value.in_words()));
    let sets: Vec<String> = parameters.chain(settings).collect();
    let when = in_words(&canonical_text(&rule.when));
    format!("Where the rule “{}” holds ({when}): {}", in_words(&rule.name), sets.join(", "))
}

/// Returns the first sentence without its full stop.
fn first_sentence(text: &str) -> &str {
    let end = text.find(". ").or_else(|| text.find("; ")).unwrap_or(text.len());
    text.get(..end).unwrap_or(text).trim_end_matches('.')
}

#[cfg(test)]
mod tests {
    use super::super::toy;
    use super::*;

    fn lines(before: &Program, after: &Program) -> Vec<String> {
        let line =
            |step: FlowStep| format!("{}{}{}", "  ".repeat(step.depth), if step.is_new { "+ " } else { "" }, step.says);
        toy::contract().flow(before, after).into_iter().map(line).collect()
    }

    #[test]
    fn steps_follow_the_scene_and_what_is_new_is_marked() {
        let before = toy::program();
        let same = lines(&before, &before);
        assert!(same.iter().all(|line| !line.contains("+ ")), "{same:#?}");
        let place = |text: &str| same.iter().position(|line| line.starts_with(text)).unwrap();
        assert!(place("Where: does every_scene") < place("Who: "), "{same:#?}");
        assert!(place("Who: ") < place("When: ") && place("When: ") < place("Which motions: "), "{same:#?}");
        assert!(same.last().unwrap().starts_with("Where the rule “"), "{same:#?}");
        let mut after = before.clone();
        after.operator_graph.get_mut("actor").unwrap().settings.insert("score".into(), Setting::Number(2.0));
        let new: Vec<String> = lines(&before, &after).into_iter().filter(|line| line.contains("+ ")).collect();
        assert_eq!(new, ["+ Who: does ranked_actors (score 2)"]);
        // A module or a parameter behind a setting counts as the setting.
        let mut after = before.clone();
        after.mechanism_modules.get_mut("pressure").unwrap().expression = "gap_m".into();
        after.parameters.insert("duration_s".into(), ParameterValue::Number(2.0));
        let new: Vec<String> = lines(&before, &after).into_iter().filter(|line| line.contains("+ ")).collect();
        let expected = ["+ Who: does ranked_actors (score “pressure”)", "+ When: does window (duration s 2, was 5)"];
        assert_eq!(new, expected);
        after.scenario_conditioned_policy.clear();
        assert!(!lines(&before, &after).iter().any(|line| line.contains("Where the rule")));
    }

    #[test]
    fn two_ways_stand_below_the_node_in_which_they_meet_and_share_what_both_begin_with() {
        let before = toy::program();
        let mut after = before.clone();
        let end =
            after.operator_graph.iter().find(|(_, node)| node.slot == Slot::Diversity).map(|(name, _)| name.clone());
        let end = end.unwrap();
        let one = after.operator_graph[&end].inputs[0].clone();
        let mut other = after.operator_graph[&one].clone();
        other.kind = "gap_filter".into();
        let ways = vec![one.clone(), "other_way".to_string()];
        let settings = BTreeMap::from([("until".to_string(), Setting::Choice("meeting".into()))]);
        let meeting = OperatorNode { slot: Slot::Filter, kind: "first_of".into(), settings, inputs: ways };
        after.operator_graph.insert("other_way".into(), other);
        after.operator_graph.insert("meeting".into(), meeting);
        after.operator_graph.get_mut(&end).unwrap().inputs = vec!["meeting".into()];
        let said = lines(&before, &after);
        let place =
            |text: &str| said.iter().position(|line| line.contains(text)).unwrap_or_else(|| panic!("{said:#?}"));
        assert!(
            place("Of two ways: the first where one of its candidates is predicted to touch") < place("  Way 1:")
                && place("Way 1:") < place("Way 2:"),
            "{said:#?}"
        );
        assert_eq!(said.iter().filter(|line| line.contains("Who: ")).count(), 1, "{said:#?}");
        assert!(said[place("Way 2:") + 1].contains("As above up to “"), "{said:#?}");
        assert!(said[place("Which is taken")].starts_with("Which is taken"), "{said:#?}");
    }
}
