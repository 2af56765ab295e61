//! Checks a patch against the prompt by rules: identity, paths, ranges, names, types of edges. The structural critic
//! uses it, the actor before it answers, and the repair to find what it must mend.

use serde::Deserialize;
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};

use super::{
    contract::Domain,
    edit,
    names::names_in,
    reader::{EDITABLE, Module, Node, Program, PromptView, Rule},
};

/// A blocking fault, and what would mend it.
#[derive(Debug)]
pub struct Finding {
    /// The operation that caused it; `None` if the identifiers are wrong.
    pub operation: Option<usize>,
    pub path: String,
    pub problem: String,
    pub fix: Fix,
}

#[derive(Debug)]
pub enum Fix {
    /// Copy the identifiers of the prompt.
    Identity,
    /// Put this at a JSON Pointer inside the operation's value.
    Set {
        pointer: String,
        value: Value,
    },
    /// Replace one name by another, everywhere in the operation.
    Rename {
        from: String,
        to: String,
    },
    Drop,
}

impl Finding {
    /// Returns what a critic writes into `repair_hints`.
    pub fn hint(&self) -> String {
        match &self.fix {
            Fix::Identity => "copy the identifiers of the identity block".into(),
            Fix::Set { pointer, value } => format!("set {}{pointer} to {value}", self.path),
            Fix::Rename { from, to } => format!("in {} use `{to}` in place of `{from}`", self.path),
            Fix::Drop => format!("drop the operation at {}", self.path),
        }
    }

    /// Returns what a critic writes into `blockers`.
    pub fn blocker(&self) -> String {
        format!("{}: {}", self.path, self.problem)
    }
}

/// All blocking faults, in the order of the operations.
pub fn findings(page: &PromptView, patch: &Value) -> Vec<Finding> {
    let mut objections = identity(page, patch);
    objections.extend(surface(page, patch));
    if !objections.iter().any(|finding| matches!(finding.fix, Fix::Drop)) {
        objections.extend(content(page, patch));
    }
    objections
}

/// The program after all operations that can be applied.
pub fn child(page: &PromptView, patch: &Value) -> Option<Program> {
    let mut parts = page.parts.clone();
    edit::operations(patch).iter().try_for_each(|operation| edit::apply(&mut parts, operation)).ok()?;
    Program::deserialize(&parts).ok()
}

/// Family, parent id and hash as the prompt has them.
pub fn identity(page: &PromptView, patch: &Value) -> Vec<Finding> {
    let expected = [
        ("source_baseline", &page.identity.source_family),
        ("parent_solution_id", &page.identity.parent_solution_id),
        ("parent_program_hash", &page.identity.parent_program_hash),
    ];
    let differs = expected.into_iter().filter(|(field, value)| patch[*field].as_str() != Some(value.as_str()));
    differs
        .map(|(field, value)| Finding {
            operation: None,
            path: field.into(),
            problem: format!("found {}, the identity block says {value:?}", patch[field]),
            fix: Fix::Identity,
        })
        .collect()
}

/// Checks the number of operations, paths, repeats, edits without effect, and whether each can be applied.
fn surface(page: &PromptView, patch: &Value) -> Vec<Finding> {
    let operations = edit::operations(patch);
    let (mut parts, mut seen, mut found) = (page.parts.clone(), BTreeSet::new(), vec![]);
    for (index, operation) in operations.iter().enumerate() {
        let path = edit::path_of(operation);
        let legal = EDITABLE
            .iter()
            .any(|part| path.strip_prefix(*part).is_some_and(|rest| rest.len() > 1 && rest.starts_with('/')));
        let problem = if !legal {
            Some("the path is not on the editable surface".to_string())
        } else if index >= page.contract.limits.operations_per_patch {
            Some(format!("more than {} operations", page.contract.limits.operations_per_patch))
        } else if !path.ends_with("/-") && !seen.insert(path) {
            Some("the same place is edited twice".into())
        } else if operation["op"] == "replace" && parts.pointer(path) == Some(&operation["value"]) {
            Some("the value is the present one".into())
        } else {
            edit::apply(&mut parts, operation).err()
        };
        let finding = |problem| Finding { operation: Some(index), path: path.into(), problem, fix: Fix::Drop };
        found.extend(problem.map(finding));
    }
    found
}

/// The child's entries and references.
fn content(page: &PromptView, patch: &Value) -> Vec<Finding> {
    let Some(child) = child(page, patch) else {
        let last = edit::operations(patch).len().saturating_sub(1);
        let path = edit::operations(patch).last().map(edit::path_of).unwrap_or_default().to_string();
        let problem = "the value does not have the shape of its place".into();
        return vec![Finding { operation: Some(last), path, problem, fix: Fix::Drop }];
    };
    let inherited: BTreeSet<Flaw> = Check::all(page, &page.program).into_iter().collect();
    let flaws = Check::all(page, &child).into_iter().filter(|flaw| !inherited.contains(flaw));
    flaws.map(|flaw| blame(page, patch, flaw)).collect()
}

/// Unknown words of a program for which a similar one is looked for: each is compared with every known one.
const COMPARED_MAX: usize = 200;
/// Bytes of a word for which that is done: no name is longer.
const WORD_BYTES_MAX: usize = 200;

/// A fault at an absolute path in the child.
#[derive(PartialEq, Eq, PartialOrd, Ord)]
struct Flaw {
    place: String,
    problem: String,
    mend: Mend,
}

#[derive(PartialEq, Eq, PartialOrd, Ord)]
enum Mend {
    /// JSON text of the value to put there.
    Put(String),
    Rename(String, String),
    /// The operation must be dropped.
    Drop,
}

/// The last operation whose path contains the fault; otherwise one that removed something, or the last one.
fn blame(page: &PromptView, patch: &Value, flaw: Flaw) -> Finding {
    let operations = edit::operations(patch);
    let rules = page.program.scenario_conditioned_policy.len();
    let mut appended = rules;
    let places: Vec<String> = operations
        .iter()
        .map(|operation| {
            let path = edit::path_of(operation);
            match path.strip_suffix("/-") {
                Some(list) => {
                    appended += 1;
                    format!("{list}/{}", appended - 1)
                }
                None => path.to_string(),
            }
        })
        .collect();
    let holds =
        |place: &String| flaw.place.strip_prefix(place.as_str()).is_some_and(|r| r.is_empty() || r.starts_with('/'));
    let cause = places.iter().rposition(holds);
    let removal = operations.iter().position(|operation| operation["op"] == "remove");
    let index = cause.or(removal).unwrap_or(operations.len().saturating_sub(1));
    let pointer = cause.and_then(|at| flaw.place.strip_prefix(&places[at])).unwrap_or_default().to_string();
    let fix = match flaw.mend {
        Mend::Put(text) if cause.is_some() => {
            Fix::Set { pointer, value: serde_json::from_str(&text).unwrap_or_default() }
        }
        Mend::Rename(from, to) if cause.is_some() => Fix::Rename { from, to },
        _ => Fix::Drop,
    };
    let path = operations.get(index).map(edit::path_of).unwrap_or_default().to_string();
    Finding { operation: Some(index), path, problem: flaw.problem, fix }
}

struct Check<'a> {
    page: &'a PromptView,
    child: &'a Program,
    flaws: Vec<Flaw>,
    /// Unknown words that were compared with known ones.
    compared: usize,
}

impl<'a> Check<'a> {
    fn all(page: &'a PromptView, program: &'a Program) -> Vec<Flaw> {
        let mut check = Check { page, child: program, flaws: vec![], compared: 0 };
        check.sizes();
        check.values("/parameters", &program.parameters);
        for (name, node) in &program.operator_graph {
            check.node(&format!("/operator_graph/{name}"), node);
        }
        check.shape();
        for (index, rule) in program.scenario_conditioned_policy.iter().enumerate() {
            check.rule(&format!("/scenario_conditioned_policy/{index}"), rule);
        }
        for (name, module) in &program.mechanism_modules {
            check.module(&format!("/mechanism_modules/{name}"), module);
        }
        check.flaws
    }

    fn flaw(&mut self, place: &str, problem: String) {
        self.flaws.push(Flaw { place: place.into(), problem, mend: Mend::Drop });
    }

    /// A word that the contract does not have; the most similar one mends it.
    fn unknown<'w>(&mut self, place: &str, what: &str, word: &str, known: impl Iterator<Item = &'w str>) {
        let is_compared = self.compared < COMPARED_MAX && word.len() <= WORD_BYTES_MAX;
        self.compared += usize::from(is_compared);
        let near = if is_compared { crate::text::nearest(word, known) } else { None };
        let mend = near.map_or(Mend::Drop, |near| Mend::Rename(word.to_string(), near.to_string()));
        self.flaws.push(Flaw { place: place.into(), problem: format!("unknown {what} `{word}`"), mend });
    }

    fn sizes(&mut self) {
        let (limits, child) = (&self.page.contract.limits, self.child);
        let counts = [
            ("/operator_graph", child.operator_graph.len(), limits.nodes),
            ("/scenario_conditioned_policy", child.scenario_conditioned_policy.len(), limits.rules),
            ("/mechanism_modules", child.mechanism_modules.len(), limits.modules),
        ];
        for (place, count, most) in counts.into_iter().filter(|(_, count, most)| count > most) {
            self.flaw(place, format!("{count} entries, at most {most} are allowed"));
        }
    }

    fn values(&mut self, place: &str, values: &BTreeMap<String, Value>) {
        for (name, value) in values {
            match self.page.contract.parameters.get(name) {
                Some(domain) => self.literal(&format!("{place}/{name}"), domain, value),
                None => {
                    self.unknown(place, "parameter", name, self.page.contract.parameters.keys().map(String::as_str));
                }
            }
        }
    }

    fn literal(&mut self, place: &str, domain: &Domain, value: &Value) {
        if domain.accepts(value) {
            return;
        }
        let mended = match (value.as_f64(), domain.range) {
            (Some(x), Some([low, high])) if domain.kind == "integer" => {
                Some(Value::from(x.round().clamp(low, high) as i64))
            }
            (Some(x), Some([low, high])) => Some(Value::from(x.clamp(low, high))),
            _ => domain.options.first().map(|option| Value::from(option.as_str())),
        };
        let problem = format!("found {value}, expected {}", domain.describe());
        self.flaws.push(Flaw { place: place.into(), problem, mend: mended.map_or(Mend::Drop, put) });
    }

    fn node(&mut self, place: &str, node: &Node) {
        let Some(slot) = self.page.contract.operators.get(&node.slot) else {
            return self.unknown(place, "slot", &node.slot, self.page.contract.operators.keys().map(String::as_str));
        };
        let Some(kind) = slot.kinds.get(&node.kind) else {
            return self.unknown(place, "operator kind", &node.kind, slot.kinds.keys().map(String::as_str));
        };
        for (name, _) in kind.settings.iter().filter(|(name, s)| s.required && !node.settings.contains_key(*name)) {
            self.flaw(place, format!("the setting `{name}` of `{}` is missing", node.kind));
        }
        self.settings(&format!("{place}/settings"), node, &node.settings);
        let outputs: Vec<Option<&str>> = node
            .inputs
            .iter()
            .map(|input| {
                let source = self.child.operator_graph.get(input)?;
                Some(self.page.kind(&source.slot, &source.kind)?.output.as_str())
            })
            .collect();
        if outputs.len() != kind.inputs.len() || outputs.iter().zip(&kind.inputs).any(|(o, i)| *o != Some(i.as_str())) {
            self.flaw(&format!("{place}/inputs"), format!("inputs of `{}` must be {:?}", node.kind, kind.inputs));
        }
    }

    fn settings(&mut self, place: &str, node: &Node, settings: &BTreeMap<String, Value>) {
        let Some(kind) = self.page.kind(&node.slot, &node.kind) else { return };
        for (name, value) in settings {
            let at = format!("{place}/{name}");
            match kind.settings.get(name) {
                None => self.unknown(place, "setting", name, kind.settings.keys().map(String::as_str)),
                Some(domain) => self.setting(&at, domain, value),
            }
        }
    }

    fn setting(&mut self, place: &str, domain: &Domain, value: &Value) {
        if let Some(name) = value["parameter"].as_str() {
            match self.child.parameters.get(name) {
                Some(value) if domain.accepts(value) => {}
                Some(value) => {
                    self.flaw(place, format!("parameter `{name}` is {value}, expected {}", domain.describe()))
                }
                None => self.unknown(place, "parameter", name, self.child.parameters.keys().map(String::as_str)),
            }
        } else if let Some(name) = value["mechanism"].as_str() {
            let of_slot = |module: &Module| Some(&module.slot) == domain.slot.as_ref();
            if !self.child.mechanism_modules.get(name).is_some_and(of_slot) {
                let known = self.child.mechanism_modules.iter().filter(|(_, module)| of_slot(module));
                self.unknown(place, "module for this setting", name, known.map(|(name, _)| name.as_str()));
            }
        } else {
            self.literal(place, domain, value);
        }
    }

    /// Checks how many nodes each slot has, and that every node but one feeds another.
    fn shape(&mut self) {
        let graph = &self.child.operator_graph;
        for (slot, spec) in &self.page.contract.operators {
            let count = graph.values().filter(|node| node.slot == *slot).count();
            if !(spec.nodes[0]..=spec.nodes[1]).contains(&count) {
                self.flaw("/operator_graph", format!("{count} nodes of slot `{slot}`, expected {:?}", spec.nodes));
            }
        }
        let fed: BTreeSet<&String> = graph.values().flat_map(|node| &node.inputs).collect();
        let ends: Vec<&String> = graph.keys().filter(|name| !fed.contains(name)).collect();
        if ends.len() != 1 {
            self.flaw("/operator_graph", format!("{} nodes lead nowhere, expected one end", ends.len()));
        }
    }

    fn rule(&mut self, place: &str, rule: &Rule) {
        self.names(&format!("{place}/when"), &rule.when, None);
        self.values(&format!("{place}/parameters"), &rule.parameters);
        for (name, settings) in &rule.operators {
            match self.child.operator_graph.get(name) {
                Some(node) => self.settings(&format!("{place}/operators/{name}"), node, settings),
                None => self.unknown(place, "node", name, self.child.operator_graph.keys().map(String::as_str)),
            }
        }
        if rule.parameters.is_empty() && rule.operators.is_empty() {
            self.flaw(place, "the rule overrides nothing".into());
        }
        if self.child.scenario_conditioned_policy.iter().filter(|other| other.name == rule.name).count() > 1 {
            self.flaw(place, format!("the name `{}` is taken by another rule", rule.name));
        }
    }

    fn module(&mut self, place: &str, module: &Module) {
        let slots = &self.page.contract.mechanism_slots;
        let Some(slot) = slots.get(&module.slot) else {
            return self.unknown(place, "mechanism slot", &module.slot, slots.keys().map(String::as_str));
        };
        if slot.output != module.output {
            let mend = put(Value::from(slot.output.as_str()));
            let problem = format!("the slot gives `{}`, the module says `{}`", slot.output, module.output);
            self.flaws.push(Flaw { place: format!("{place}/output"), problem, mend });
        }
        let before = self.flaws.len();
        self.names(&format!("{place}/expression"), &module.expression, Some(&module.slot));
        let read = names_in(&module.expression);
        let listed: BTreeSet<&str> = module.inputs.iter().map(String::as_str).collect();
        if self.flaws.len() == before && (read != listed || listed.len() != module.inputs.len()) {
            let (mend, problem) = (put(read.into_iter().collect()), "inputs differ from what is read".into());
            self.flaws.push(Flaw { place: format!("{place}/inputs"), problem, mend });
        }
    }

    /// Every name may be read here, and the text is not too large.
    fn names(&mut self, place: &str, text: &str, slot: Option<&str>) {
        let readable = self.page.readable(slot);
        for name in names_in(text).into_iter().filter(|name| !readable.contains(name)) {
            self.unknown(place, "feature", name, readable.iter().copied());
        }
        let (nodes, depth) = size(text, self.page.chains_are_one_level);
        let limits = &self.page.contract.limits;
        if nodes > limits.expression_nodes || depth > limits.expression_depth {
            self.flaw(place, format!("the expression is too large: about {nodes} nodes, {depth} levels"));
        }
    }
}

fn put(value: Value) -> Mend {
    Mend::Put(value.to_string())
}

/// An upper estimate of an expression's nodes and depth: words, numbers and signs; parentheses, and a level for each term of a chain, or
/// for each sort of operator in it where a chain is one level.
fn size(text: &str, chains_are_one_level: bool) -> (usize, usize) {
    let spaced = text.replace(['(', ')', ','], " ");
    let nodes = spaced.split_whitespace().count();
    let (mut open, mut deepest, mut chain, mut sorts) = (0usize, 0usize, vec![Vec::<u8>::new()], 0);
    for token in text.replace('(', " ( ").replace(')', " ) ").replace(',', " , ").split_whitespace() {
        let sort = match token {
            "(" => {
                open += 1;
                chain.push(Vec::new());
                None
            }
            ")" => {
                open = open.saturating_sub(1);
                sorts -= chain.pop().map_or(0, |closed| closed.len());
                None
            }
            "," => {
                sorts -= chain.last_mut().map_or(0, |last| last.drain(..).count());
                None
            }
            "or" => Some(0),
            "and" => Some(1),
            "not" => Some(2),
            "<" | "<=" | ">" | ">=" | "==" | "!=" => Some(3),
            "+" | "-" => Some(4),
            "*" | "/" => Some(5),
            _ => None,
        };
        if let (Some(sort), Some(last)) = (sort, chain.last_mut())
            && !(chains_are_one_level && last.contains(&sort))
        {
            last.push(sort);
            sorts += 1;
        }
        deepest = deepest.max(open + sorts + 1);
    }
    (nodes, deepest)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernel::Seed;

    /// The depth as it is defined: at each token the sorts of all open chains are counted anew.
    fn depth_plainly(text: &str, chains_are_one_level: bool) -> usize {
        let (mut open, mut deepest, mut chain) = (0usize, 0usize, vec![Vec::<usize>::new()]);
        for token in text.split_whitespace() {
            match token {
                "(" => {
                    open += 1;
                    chain.push(Vec::new());
                }
                ")" => {
                    open = open.saturating_sub(1);
                    chain.pop();
                }
                "," => chain.last_mut().into_iter().for_each(Vec::clear),
                _ => {}
            }
            let sorts = [&["or"][..], &["and"], &["not"], &["<", "=="], &["+", "-"], &["*", "/"]];
            let sort = sorts.iter().position(|sort| sort.contains(&token));
            if let (Some(sort), Some(last)) = (sort, chain.last_mut())
                && !(chains_are_one_level && last.contains(&sort))
            {
                last.push(sort);
            }
            deepest = deepest.max(open + chain.iter().map(Vec::len).sum::<usize>() + 1);
        }
        deepest
    }

    #[test]
    fn an_expression_has_the_depth_of_its_definition_and_one_of_many_brackets_is_looked_at_once() {
        let mut stream = Seed(7).stream(&["scripted", "size"]);
        for length in 0..300 {
            const TOKENS: [&str; 14] = ["(", "(", ")", ",", "or", "and", "not", "<", "==", "+", "-", "*", "x", "min"];
            let tokens: Vec<&str> = (0..length).map(|_| TOKENS[stream.below(TOKENS.len())]).collect();
            let text = tokens.join(" ");
            for one in [false, true] {
                assert_eq!(size(&text, one).1, depth_plainly(&text, one), "{text}");
            }
        }
        // As many as a reply has room for: counted anew at each it would be 10^10 sums.
        let count = 120_000;
        assert_eq!(size(&format!("{}x{}", "(".repeat(count), ")".repeat(count)), true), (1, count + 1));
    }
}
