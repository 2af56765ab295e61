//! The expression language of mechanisms and conditions: small, total, typed, without side effects.
//!
//! ```text
//! or < and < not < (< <= > >= == !=) < + - < * / < unary -      names, numbers, true, false, (...)
//! min(a, b, ..) max(a, b, ..) clamp(x, low, high) abs(x) sqrt(x) exp(x) log(x) if(condition, a, b)
//! ```
//! Every operation has a finite result: see `kernel::total`.

mod compile;
mod error;
mod lex;
mod parse;
mod scope;
mod tree;

use std::collections::BTreeMap;

use super::program::{MechanismModule, PolicyRule};

pub use crate::kernel::total::{DENOMINATOR_MIN, LOG_ARGUMENT_MIN, MAGNITUDE_MAX};
pub use compile::Compiled;
pub use error::ExprError;
pub use parse::{DEPTH_MAX, NODES_MAX, TEXT_MAX_BYTES};
pub use scope::Scope;
pub use tree::{Expr, FUNCTIONS};

/// Modules with their expressions in canonical text; one that does not parse keeps its own text.
pub fn normalised_modules(modules: &BTreeMap<String, MechanismModule>) -> BTreeMap<String, MechanismModule> {
    let mut modules = modules.clone();
    for module in modules.values_mut() {
        module.expression = canonical_text(&module.expression);
    }
    modules
}

/// Rules with their conditions in canonical text; one that does not parse keeps its own text.
pub fn normalised_policy(rules: &[PolicyRule]) -> Vec<PolicyRule> {
    let mut rules = rules.to_vec();
    for rule in &mut rules {
        rule.when = canonical_text(&rule.when);
    }
    rules
}

fn canonical_text(text: &str) -> String {
    Expr::parse(text).map_or_else(|_| text.to_string(), |expr| expr.to_string())
}

#[cfg(test)]
mod tests;
