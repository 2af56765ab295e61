//! A program checked against its contract, with its expressions parsed and its graph in order: done once, used for
//! every scene.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::{CompileFailure, Compiled, Situation, walk};
use crate::kernel::{Digest, Seed};
use crate::objects::expr::{self, Expr};
use crate::objects::{Counsel, OperatorNode, ParameterValue, Program, Setting, Slot};
use crate::stage::judged::Needs;
use crate::stage::{Module, Settings, Source, Stage};

/// A module's code and the groups of candidate features that it reads.
#[derive(Clone, Debug)]
struct Code {
    compiled: Arc<expr::Compiled>,
    needs: Needs,
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
            modules.insert(name.as_str(), Code { compiled, needs });
        }
        Ok(Prepared { program, source, hash, order, conditions, modules })
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

    /// Nodes in the order in which a scene passes them.
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
        self.compile_as(self.hash, situation, seed, counsel)
    }

    /// The same with the random draws of the program whose hash is given: two programs that decide alike then decide the
    /// same, bit for bit.
    pub fn compile_as(
        &self,
        draws_of: Digest,
        situation: &Situation,
        seed: Seed,
        counsel: Option<&Counsel>,
    ) -> Result<Compiled, CompileFailure> {
        let program = draws_of.short(16);
        walk::walk(self, &Stage { situation, seed, program: &program, counsel })
    }

    /// Indices of the policy rules that hold in a scene with these values of `vocabulary::SCENE`.
    pub fn rules(&self, scene_values: &[f64]) -> Vec<usize> {
        let mut values = scene_values.to_vec();
        values.extend(self.numeric(&self.program.parameters));
        (0..self.conditions.len()).filter(|&rule| self.conditions[rule].boolean(&values)).collect()
    }

    /// Whether the select gate opens a scene with these values of `vocabulary::SCENE`; programs without a gate open all.
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

    /// The settings of a node in a scene.
    pub(super) fn settings(
        &self,
        name: &str,
        node: &OperatorNode,
        rules: &[usize],
        parameters: &BTreeMap<String, ParameterValue>,
        scene_values: &[f64],
    ) -> Settings {
        let mut given = node.settings.clone();
        for rule in rules {
            let overrides = self.program.scenario_conditioned_policy[*rule].operators.get(name);
            given.extend(overrides.cloned().unwrap_or_default());
        }
        let mut settings = Settings::default();
        for (setting, value) in given {
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
                        let module = Module { code: code.compiled.clone(), needs: code.needs, tail };
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

/// From the choice back along the only input of every node. The contract's check has ruled out circles and forks.
fn order(graph: &BTreeMap<String, OperatorNode>) -> Vec<&str> {
    let fed: Vec<&String> = graph.values().flat_map(|node| &node.inputs).collect();
    let mut next = graph.keys().find(|name| !fed.contains(name));
    let mut order = Vec::with_capacity(graph.len());
    while let Some(name) = next.filter(|_| order.len() < graph.len()) {
        order.push(name.as_str());
        next = graph.get(name).and_then(|node| node.inputs.first());
    }
    order.reverse();
    order
}
