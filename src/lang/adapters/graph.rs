//! G ∈ G_b: kinds, settings, ports, and the shape of the operator graph.

use std::collections::{BTreeMap, BTreeSet};

use super::{
    contract::{Contract, OperatorSpec, Port},
    problem::{Problem, check_name},
};
use crate::objects::{OperatorNode, Program, Slot, pointer::within};

const PLACE: &str = "/operator_graph";

/// The filter kind that unites its inputs, which must come from one timing node.
pub const UNITES: &str = "all_of";

/// Fewest and most nodes of a slot. Ways may part after the selection of scenes and meet again before the choice.
pub fn node_count_range(slot: Slot) -> (usize, usize) {
    match slot {
        Slot::Select | Slot::Diversity => (1, 1),
        Slot::Actor | Slot::Timing | Slot::Motion | Slot::Search => (1, 3),
        Slot::Filter => (0, 8),
        Slot::Law => (0, 3),
    }
}

impl Contract {
    /// The kind's declaration, if the slot may hold it.
    pub fn operator(&self, slot: Slot, kind: &str) -> Option<&OperatorSpec> {
        self.operators.get(&slot)?.iter().find(|spec| spec.kind == kind)
    }

    /// Checks everything about the graph that needs no scene.
    pub fn check_graph(&self, program: &Program) -> Vec<Problem> {
        let graph = &program.operator_graph;
        let mut problems = Vec::new();
        for (name, node) in graph {
            let place = within(PLACE, name);
            problems.extend(check_name(&place, name));
            problems.extend(self.check_node(program, &place, node));
        }
        problems.extend(self.check_slot_counts(graph));
        problems.extend(self.check_shape(graph));
        problems
    }

    fn check_node(&self, program: &Program, place: &str, node: &OperatorNode) -> Vec<Problem> {
        let Some(spec) = self.operator(node.slot, &node.kind) else {
            let known = self.operators.get(&node.slot).into_iter().flatten().map(|spec| spec.kind.as_str());
            let what = format!("kind of slot `{}`", node.slot.name());
            return vec![Problem::unknown(within(place, "kind"), &what, &node.kind, known)];
        };
        let settings = within(place, "settings");
        let missing = spec.settings.iter().filter(|(name, s)| s.required && !node.settings.contains_key(*name));
        let mut problems: Vec<Problem> =
            missing.map(|(name, s)| Problem::new(within(&settings, name), "no value", s.domain.describe())).collect();
        problems.extend(self.check_settings(program, &settings, spec, &node.settings));
        problems.extend(self.check_inputs(&program.operator_graph, &within(place, "inputs"), spec, node));
        problems
    }

    fn check_inputs(
        &self,
        graph: &BTreeMap<String, OperatorNode>,
        place: &str,
        spec: &OperatorSpec,
        node: &OperatorNode,
    ) -> Vec<Problem> {
        if node.inputs.len() != spec.inputs.len() {
            let expected = format!("{} ({})", spec.inputs.len(), port_names(&spec.inputs));
            return vec![Problem::new(place, format!("{} inputs", node.inputs.len()), expected)];
        }
        let mut problems = Vec::new();
        for (index, (input, port)) in node.inputs.iter().zip(&spec.inputs).enumerate() {
            let place = within(place, &index.to_string());
            let Some(source) = graph.get(input) else {
                problems.push(Problem::unknown(place, "node", input, graph.keys().map(String::as_str)));
                continue;
            };
            // A source of unknown kind has its own problem.
            if let Some(given) = self.operator(source.slot, &source.kind).map(|s| s.output).filter(|g| g != port) {
                let found = format!("`{input}`, which gives {}", port_names(&[given]));
                problems.push(Problem::new(place, found, format!("a node that gives {}", port_names(&[*port]))));
            }
        }
        problems
    }

    fn check_slot_counts(&self, graph: &BTreeMap<String, OperatorNode>) -> Vec<Problem> {
        let declared = Slot::ALL.into_iter().filter(|slot| self.operators.get(slot).is_some_and(|s| !s.is_empty()));
        let check = |slot: Slot| {
            let (fewest, most) = node_count_range(slot);
            let count = graph.values().filter(|node| node.slot == slot).count();
            let expected = if fewest == most { format!("{fewest}") } else { format!("{fewest} to {most}") };
            let found = format!("{count} nodes of slot `{}`", slot.name());
            (!(fewest..=most).contains(&count)).then(|| Problem::new(PLACE, found, expected))
        };
        declared.filter_map(check).collect()
    }

    /// Checks that there is no circle, that one end makes the choice, and that every node leads to it.
    fn check_shape(&self, graph: &BTreeMap<String, OperatorNode>) -> Vec<Problem> {
        if let Some(names) = circle(graph) {
            return vec![Problem::new(
                PLACE,
                format!("a circle through {}", names.join(", ")),
                "a graph without circles",
            )];
        }
        let output = |node: &OperatorNode| self.operator(node.slot, &node.kind).map(|spec| spec.output);
        let ends: Vec<&String> =
            graph.iter().filter(|(_, node)| output(node) == Some(Port::Choice)).map(|(name, _)| name).collect();
        let [end] = ends.as_slice() else {
            let found = format!("{} nodes that make the choice", ends.len());
            return vec![Problem::new(PLACE, found, "exactly one, at the end")];
        };
        let used = ancestors(graph, end);
        let idle = graph.keys().filter(|name| !used.contains(name.as_str()));
        let idle = idle.map(|name| {
            Problem::new(within(PLACE, name), "a node that leads nowhere", format!("a way from it to `{end}`"))
        });
        idle.chain(graph.iter().filter_map(|(name, node)| check_meeting(graph, name, node))).collect()
    }
}

/// Checks that two different ways meet in a node of two inputs, and that united ways have one window per adversary.
fn check_meeting(graph: &BTreeMap<String, OperatorNode>, name: &str, node: &OperatorNode) -> Option<Problem> {
    let [one, other] = node.inputs.as_slice() else { return None };
    let place = within(&within(PLACE, name), "inputs");
    if one == other {
        return Some(Problem::new(place, format!("`{one}` twice"), "two different nodes"));
    }
    let timings = |of: &str| -> BTreeSet<String> {
        let all = ancestors(graph, of);
        let timing = all.into_iter().filter(|name| graph.get(*name).is_some_and(|n| n.slot == Slot::Timing));
        timing.map(String::from).collect()
    };
    let (ours, theirs) = (timings(one), timings(other));
    (node.kind == UNITES && (ours != theirs || ours.len() != 1)).then(|| {
        let found = format!("ways from {:?} and {:?}", ours, theirs);
        Problem::new(place, found, "two ways from the same timing node: an adversary has one window")
    })
}

fn port_names(ports: &[Port]) -> String {
    let name = |port: &Port| match port {
        Port::Scene => "scene",
        Port::Actors => "actors",
        Port::Window => "window",
        Port::Candidates => "candidates",
        Port::Choice => "choice",
    };
    if ports.is_empty() { "none".into() } else { ports.iter().map(name).collect::<Vec<_>>().join(", ") }
}

/// Nodes whose inputs can never all be computed; there are some exactly if the graph has a circle.
fn circle(graph: &BTreeMap<String, OperatorNode>) -> Option<Vec<&str>> {
    let mut open: BTreeMap<&str, &OperatorNode> = graph.iter().map(|(name, node)| (name.as_str(), node)).collect();
    loop {
        let ready: Vec<&str> = open
            .iter()
            .filter(|(_, node)| !node.inputs.iter().any(|input| open.contains_key(input.as_str())))
            .map(|(name, _)| *name)
            .collect();
        for name in &ready {
            open.remove(name);
        }
        if ready.is_empty() {
            return (!open.is_empty()).then(|| open.into_keys().collect());
        }
    }
}

/// `end` and everything that feeds it.
fn ancestors<'a>(graph: &'a BTreeMap<String, OperatorNode>, end: &'a str) -> BTreeSet<&'a str> {
    let mut feeding = BTreeSet::from([end]);
    let mut open = vec![end];
    while let Some(name) = open.pop() {
        for input in graph.get(name).into_iter().flat_map(|node| &node.inputs) {
            if feeding.insert(input) {
                open.push(input);
            }
        }
    }
    feeding
}
