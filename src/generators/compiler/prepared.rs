//! A program checked against its contract, with its expressions parsed and its graph in order: done once, used for
//! every scene.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use serde::Serialize;

use super::{CompileFailure, Compiled, Searched, Situation, walk};
use crate::kernel::{Digest, Seed, canon::CanonError};
use crate::objects::expr::{self, Expr};
use crate::objects::{Counsel, FamilyName, OperatorNode, ParameterValue, Program, Setting, Slot};
use crate::stage::judged::Needs;
use crate::stage::{Module, Settings, Source, Stage, Watched};

/// A module's code and the groups of candidate features that it reads.
#[derive(Clone, Debug)]
struct Code {
    compiled: Arc<expr::Compiled>,
    needs: Needs,
    /// All that it reads.
    names: BTreeSet<String>,
}

/// A node as it takes effect in one scene.
#[derive(Serialize)]
pub(super) struct NodeInEffect<'a> {
    family: &'a FamilyName,
    slot: Slot,
    kind: &'a str,
    settings: BTreeMap<String, InEffect<'a>>,
}

/// A setting as it takes effect in one scene.
#[derive(Serialize)]
pub(super) enum InEffect<'a> {
    Number(f64),
    Word(String),
    Parameter(Option<&'a ParameterValue>),
    Mechanism(Option<&'a str>, BTreeMap<&'a String, &'a ParameterValue>),
}

/// A program ready to be compiled for scenes.
#[derive(Clone, Debug)]
pub struct Prepared<'p> {
    program: &'p Program,
    source: &'p Source,
    hash: Digest,
    /// Node names from the graph's start to its choice.
    order: Vec<&'p str>,
    conditions: Vec<expr::Compiled>,
    modules: BTreeMap<&'p str, Code>,
    searched: Option<&'p Searched>,
    /// Modules whose values are taken down, by name.
    watched: BTreeMap<&'p str, Arc<Watched>>,
}

impl<'p> Prepared<'p> {
    /// Checks the program against its family's contract and parses every expression.
    pub fn new(program: &'p Program, source: &'p Source) -> Result<Prepared<'p>, CompileFailure> {
        let contract = &source.contract;
        let problems = contract.check_program(program);
        if !problems.is_empty() {
            return Err(CompileFailure::Contract(problems.iter().map(ToString::to_string).collect()));
        }
        let hash = program.hash().map_err(|error| CompileFailure::Hash(error.to_string()))?;
        let order = order(&program.operator_graph);
        let scope = contract.condition_scope();
        let conditions = program.scenario_conditioned_policy.iter();
        let conditions = conditions.map(|rule| code_of(&rule.when, &scope)).collect::<Result<_, _>>()?;
        let mut modules = BTreeMap::new();
        for (name, module) in &program.mechanism_modules {
            let scope = contract.mechanism_scope(&module.slot).unwrap_or_default();
            let names = Expr::parse(&module.expression).map_err(refused)?.names();
            let needs = Needs::of(names.iter().map(String::as_str));
            let compiled = Arc::new(code_of(&module.expression, &scope)?);
            modules.insert(name.as_str(), Code { compiled, needs, names });
        }
        Ok(Prepared { program, source, hash, order, conditions, modules, searched: None, watched: BTreeMap::new() })
    }

    /// Returns the same, but with the results of its motion and search nodes looked up and kept, for programs that differ elsewhere.
    pub fn sharing(self, searched: &'p Searched) -> Prepared<'p> {
        Prepared { searched: Some(searched), ..self }
    }

    /// Returns the same, but with its modules' values recorded and nothing looked up: a result that is looked up asks no module.
    pub fn watching(self) -> Prepared<'p> {
        let watched = self.modules.keys().map(|name| (*name, Arc::default())).collect();
        Prepared { searched: None, watched, ..self }
    }

    /// Returns the values of a module so far, the smallest first; nothing if nobody watches.
    pub fn watched(&self, module: &str) -> Vec<f64> {
        self.watched.get(module).map(|watched| watched.sorted()).unwrap_or_default()
    }

    /// Returns the place where motion and search nodes are looked up.
    pub(super) fn searched(&self) -> Option<&'p Searched> {
        self.searched
    }

    /// Hash of the program.
    pub fn hash(&self) -> Digest {
        self.hash
    }

    /// The program's family.
    pub(super) fn source(&self) -> &'p Source {
        self.source
    }

    /// The constraints of κ.
    pub fn constraints(&self) -> &[String] {
        &self.program.compile_contract.constraints
    }

    /// The node that makes the choice.
    pub(super) fn last_node(&self) -> Option<&'p str> {
        self.order.last().copied()
    }

    /// A node by its name.
    pub(super) fn node(&self, name: &str) -> Option<&'p OperatorNode> {
        self.program.operator_graph.get(name)
    }

    /// Returns how many times a node is an input of another node.
    pub(super) fn feeds(&self, name: &str) -> usize {
        self.program.operator_graph.values().flat_map(|node| &node.inputs).filter(|input| *input == name).count()
    }

    /// Nodes, each behind those that feed it.
    pub(super) fn nodes(&self) -> impl Iterator<Item = (&'p str, &'p OperatorNode)> + '_ {
        self.order.iter().map(|name| (*name, &self.program.operator_graph[*name]))
    }

    /// The decision and the intervention for one scene.
    pub fn compile(&self, situation: &Situation, seed: Seed) -> Result<Compiled, CompileFailure> {
        self.compile_counselled(situation, seed, None)
    }

    /// The same with the counsel that was taken for the scene.
    pub fn compile_counselled(
        &self,
        situation: &Situation,
        seed: Seed,
        counsel: Option<&Counsel>,
    ) -> Result<Compiled, CompileFailure> {
        walk::walk(self, &Stage { situation, seed, counsel })
    }

    /// All of the program that decides in a scene with these values of `vocabulary::SCENE`, beside the scene, the ego, the
    /// counsel and the seed: the family, the rules that hold, every node with its settings as they are resolved there, the
    /// constraints. Two programs with the same digest compile to the same, bit for bit.
    pub fn in_effect(&self, scene_values: &[f64]) -> Result<Digest, CanonError> {
        let rules = self.rules(scene_values);
        let parameters = self.parameters(&rules);
        let names: Vec<&str> = rules.iter().map(|rule| self.rule_name(*rule)).collect();
        let nodes: Vec<_> = self
            .nodes()
            .map(|(name, node)| (name, self.taking_effect(name, &rules, &parameters), &node.inputs))
            .collect();
        Digest::of("evodrive/in-effect/1", &(&self.program.source_family, names, nodes, self.constraints()))
    }

    /// All of a node that decides in a scene, but for what is fed into it.
    pub(super) fn taking_effect<'a>(
        &'a self,
        name: &str,
        rules: &[usize],
        parameters: &'a BTreeMap<String, ParameterValue>,
    ) -> Option<NodeInEffect<'a>> {
        let node = self.node(name)?;
        let given = self.given(name, node, rules).into_iter();
        let settings = given.map(|(setting, value)| (setting, self.resolved(value, parameters))).collect();
        Some(NodeInEffect { family: &self.program.source_family, slot: node.slot, kind: &node.kind, settings })
    }

    /// Returns the value of a setting. For a mechanism: its text, and the parameters that it reads.
    fn resolved<'a>(&'a self, value: Setting, parameters: &'a BTreeMap<String, ParameterValue>) -> InEffect<'a> {
        match value {
            Setting::Number(number) => InEffect::Number(number),
            Setting::Choice(word) => InEffect::Word(word),
            Setting::Parameter(reference) => InEffect::Parameter(parameters.get(&reference.parameter)),
            Setting::Mechanism(reference) => {
                let text = self.program.mechanism_modules.get(&reference.mechanism).map(|m| m.expression.as_str());
                let code = self.modules.get(reference.mechanism.as_str());
                let reads = |name: &&String| code.is_some_and(|code| code.names.contains(*name));
                InEffect::Mechanism(text, parameters.iter().filter(|(name, _)| reads(name)).collect())
            }
        }
    }

    /// Indices of the policy rules that hold in a scene with these values of `vocabulary::SCENE`.
    pub fn rules(&self, scene_values: &[f64]) -> Vec<usize> {
        let mut values = scene_values.to_vec();
        values.extend(self.numeric(&self.program.parameters));
        (0..self.conditions.len()).filter(|&rule| self.conditions[rule].boolean(&values)).collect()
    }

    /// Returns `true` if the select gate opens a scene with these values of `vocabulary::SCENE`; programs without a gate open all.
    pub fn opens(&self, scene_values: &[f64]) -> bool {
        let rules = self.rules(scene_values);
        let parameters = self.parameters(&rules);
        let gates = self.nodes().filter(|(_, node)| node.slot == Slot::Select);
        gates
            .map(|(name, node)| self.settings(name, node, &rules, &parameters, scene_values))
            .all(|settings| settings.optional("gate").is_none_or(|gate| gate.boolean(vec![])))
    }

    pub(super) fn rule_name(&self, rule: usize) -> &str {
        &self.program.scenario_conditioned_policy[rule].name
    }

    /// θ as the rules that hold leave it; later rules win.
    pub(super) fn parameters(&self, rules: &[usize]) -> BTreeMap<String, ParameterValue> {
        let mut parameters = self.program.parameters.clone();
        for rule in rules {
            parameters.extend(self.program.scenario_conditioned_policy[*rule].parameters.clone());
        }
        parameters
    }

    /// Returns the settings that a node is given; the rules that hold override them.
    fn given(&self, name: &str, node: &OperatorNode, rules: &[usize]) -> BTreeMap<String, Setting> {
        let mut given = node.settings.clone();
        for rule in rules {
            let overrides = self.program.scenario_conditioned_policy[*rule].operators.get(name);
            given.extend(overrides.cloned().unwrap_or_default());
        }
        given
    }

    /// The settings of a node in a scene.
    pub(super) fn settings(
        &self,
        name: &str,
        node: &OperatorNode,
        rules: &[usize],
        parameters: &BTreeMap<String, ParameterValue>,
        scene_values: &[f64],
    ) -> Settings {
        let mut settings = Settings::default();
        for (setting, value) in self.given(name, node, rules) {
            match value {
                Setting::Number(number) => drop(settings.numbers.insert(setting, number)),
                Setting::Choice(word) => drop(settings.words.insert(setting, word)),
                Setting::Parameter(reference) => match parameters.get(&reference.parameter) {
                    Some(ParameterValue::Number(number)) => drop(settings.numbers.insert(setting, *number)),
                    Some(ParameterValue::Choice(word)) => drop(settings.words.insert(setting, word.clone())),
                    None => {}
                },
                Setting::Mechanism(reference) => {
                    if let Some(code) = self.modules.get(reference.mechanism.as_str()) {
                        let mut tail = scene_values.to_vec();
                        tail.extend(self.numeric(parameters));
                        let watched = self.watched.get(reference.mechanism.as_str()).cloned();
                        let module = Module { code: code.compiled.clone(), needs: code.needs, tail, watched };
                        settings.modules.insert(setting, module);
                    }
                }
            }
        }
        settings
    }

    /// Values of the contract's numeric parameters in its order, which is the scope's.
    fn numeric(&self, parameters: &BTreeMap<String, ParameterValue>) -> Vec<f64> {
        let numeric = self.source.contract.parameters.iter().filter(|(_, spec)| spec.domain.is_numeric());
        let value = |name: &String| match parameters.get(name) {
            Some(ParameterValue::Number(number)) => *number,
            _ => 0.0,
        };
        numeric.map(|(name, _)| value(name)).collect()
    }
}

fn refused(error: expr::ExprError) -> CompileFailure {
    CompileFailure::Contract(vec![error.to_string()])
}

fn code_of(text: &str, scope: &expr::Scope) -> Result<expr::Compiled, CompileFailure> {
    Expr::parse(text).and_then(|parsed| parsed.compile(scope)).map_err(refused)
}

/// Every node behind those that feed it; the choice last. The contract's check has ruled out circles.
fn order(graph: &BTreeMap<String, OperatorNode>) -> Vec<&str> {
    let fed: BTreeSet<&String> = graph.values().flat_map(|node| &node.inputs).collect();
    let mut open: Vec<&str> = graph.keys().filter(|name| !fed.contains(name)).map(String::as_str).collect();
    let mut order: Vec<&str> = Vec::with_capacity(graph.len());
    while let Some(name) = open.last().copied() {
        let inputs = graph.get(name).into_iter().flat_map(|node| &node.inputs).map(String::as_str);
        match inputs.filter(|input| graph.contains_key(*input)).find(|input| !order.contains(input)) {
            Some(input) if open.len() <= graph.len() => open.push(input),
            _ => {
                open.pop();
                if !order.contains(&name) {
                    order.push(name);
                }
            }
        }
    }
    order
}
