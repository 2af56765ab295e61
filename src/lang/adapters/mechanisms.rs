//! H ⊆ H_b and ρ ∈ R_b: checks modules, rules, and the names that their expressions read.

use std::collections::BTreeSet;

use super::{
    contract::Contract,
    problem::{Problem, check_name},
};
use crate::objects::{
    MechanismModule, PolicyRule, Program, ValueType,
    expr::{Expr, Scope},
    pointer::within,
};

/// Most tags of one module.
const TAGS_MAX: usize = 8;

impl Contract {
    /// Returns the scope of conditions of ρ: scene features, then numeric parameters (their values in θ).
    pub fn condition_scope(&self) -> Scope {
        let mut scope = Scope::default();
        for feature in &self.scene_features {
            scope.add(feature.name, feature.value);
        }
        self.add_parameters(&mut scope);
        scope
    }

    /// Returns the scope of a module of the slot: the slot's features, scene features, then numeric parameters. `None` for
    /// a slot that the family does not have.
    pub fn mechanism_scope(&self, slot: &str) -> Option<Scope> {
        let features = &self.mechanism_slots.get(slot)?.features;
        let mut scope = Scope::default();
        for feature in features.iter().chain(&self.scene_features) {
            scope.add(feature.name, feature.value);
        }
        self.add_parameters(&mut scope);
        Some(scope)
    }

    fn add_parameters(&self, scope: &mut Scope) {
        for (name, spec) in &self.parameters {
            if spec.domain.is_numeric() {
                scope.add(name, ValueType::Number);
            }
        }
    }

    /// Checks every module: slot, type, expression, inputs, tags.
    pub fn check_mechanisms(&self, program: &Program) -> Vec<Problem> {
        let modules = program.mechanism_modules.iter();
        modules
            .flat_map(|(name, module)| self.check_module(&within("/mechanism_modules", name), name, module))
            .collect()
    }

    fn check_module(&self, place: &str, name: &str, module: &MechanismModule) -> Vec<Problem> {
        let mut problems: Vec<Problem> = check_name(place, name).into_iter().collect();
        problems.extend(check_tags(&within(place, "tags"), &module.tags));
        let (Some(slot), Some(scope)) = (self.mechanism_slots.get(&module.slot), self.mechanism_scope(&module.slot))
        else {
            let known = self.mechanism_slots.keys().map(String::as_str);
            problems.push(Problem::unknown(within(place, "slot"), "mechanism slot", &module.slot, known));
            return problems;
        };
        if module.output != slot.output {
            let expected = format!("{:?}, which slot `{}` needs", slot.output, module.slot);
            problems.push(Problem::new(within(place, "output"), format!("{:?}", module.output), expected));
        }
        match self.check_expression(&within(place, "expression"), &module.expression, &scope, slot.output) {
            Err(problem) => problems.push(problem),
            Ok(expr) => problems.extend(check_inputs(&within(place, "inputs"), &module.inputs, &expr.names())),
        }
        problems
    }

    /// Checks the conditions of all rules; `check_policy` checks the overrides of the rules.
    pub fn check_conditions(&self, program: &Program) -> Vec<Problem> {
        let scope = self.condition_scope();
        let check = |(index, rule): (usize, &PolicyRule)| {
            let place = format!("/scenario_conditioned_policy/{index}/when");
            self.check_expression(&place, &rule.when, &scope, ValueType::Boolean).err()
        };
        program.scenario_conditioned_policy.iter().enumerate().filter_map(check).collect()
    }

    /// Checks names of rules, conditions, and overrides.
    pub fn check_policy(&self, program: &Program) -> Vec<Problem> {
        let mut problems = self.check_conditions(program);
        let mut names = BTreeSet::new();
        for (index, rule) in program.scenario_conditioned_policy.iter().enumerate() {
            let place = format!("/scenario_conditioned_policy/{index}");
            problems.extend(check_name(&within(&place, "name"), &rule.name));
            if !names.insert(&rule.name) {
                let found = format!("the name `{}` a second time", rule.name);
                problems.push(Problem::new(within(&place, "name"), found, "a name that no other rule has"));
            }
            if rule.parameters.is_empty() && rule.operators.values().all(|settings| settings.is_empty()) {
                problems.push(Problem::new(
                    &place,
                    "a rule that overrides nothing",
                    "a parameter or an operator setting",
                ));
            }
            problems.extend(self.check_values(&within(&place, "parameters"), &rule.parameters));
            problems.extend(self.check_operator_overrides(program, &within(&place, "operators"), rule));
        }
        problems
    }

    fn check_operator_overrides(&self, program: &Program, place: &str, rule: &PolicyRule) -> Vec<Problem> {
        let mut problems = Vec::new();
        for (name, settings) in &rule.operators {
            let place = within(place, name);
            let Some(node) = program.operator_graph.get(name) else {
                let known = program.operator_graph.keys().map(String::as_str);
                problems.push(Problem::unknown(place, "node", name, known));
                continue;
            };
            // A node of unknown kind has its own problem.
            if let Some(spec) = self.operator(node.slot, &node.kind) {
                problems.extend(self.check_settings(program, &place, spec, settings));
            }
        }
        problems
    }

    /// Checks that it can be parsed, has the right type and is within the contract's size bounds.
    fn check_expression(&self, place: &str, text: &str, scope: &Scope, wanted: ValueType) -> Result<Expr, Problem> {
        let refused = |error: crate::objects::expr::ExprError| {
            Problem::new(place, format!("{} in column {}", error.found, error.column), error.expected)
        };
        let expr = Expr::parse(text).map_err(refused)?;
        let depth = if self.limits.chains_are_one_level { expr.depth_of_chains() } else { expr.depth() };
        let nodes = expr.node_count();
        let (most, deepest) = (self.limits.expression_nodes, self.limits.expression_depth);
        if nodes > most || depth > deepest {
            let found = format!("an expression of {nodes} nodes and depth {depth}");
            return Err(Problem::new(place, found, format!("at most {most} nodes and depth {deepest}")));
        }
        let compiled = expr.compile(scope).map_err(refused)?.value_type();
        if compiled != wanted {
            return Err(Problem::new(place, format!("an expression of type {compiled:?}"), format!("{wanted:?}")));
        }
        Ok(expr)
    }
}

/// Checks that inputs are exactly the names that the expression reads, each once.
fn check_inputs(place: &str, inputs: &[String], read: &BTreeSet<String>) -> Vec<Problem> {
    let listed: BTreeSet<&String> = inputs.iter().collect();
    let mut problems = Vec::new();
    if listed.len() < inputs.len() {
        problems.push(Problem::new(place, "a name listed twice", "each input once"));
    }
    for name in read.iter().filter(|name| !listed.contains(name)) {
        problems.push(Problem::new(
            place,
            format!("no `{name}`, which the expression reads"),
            "every name that is read",
        ));
    }
    for name in listed.into_iter().filter(|name| !read.contains(*name)) {
        problems.push(Problem::new(
            place,
            format!("`{name}`, which the expression does not read"),
            "only names that are read",
        ));
    }
    problems
}

fn check_tags(place: &str, tags: &[String]) -> Vec<Problem> {
    let many = (tags.len() > TAGS_MAX)
        .then(|| Problem::new(place, format!("{} tags", tags.len()), format!("at most {TAGS_MAX}")));
    many.into_iter().chain(tags.iter().filter_map(|tag| check_name(place, tag))).collect()
}
