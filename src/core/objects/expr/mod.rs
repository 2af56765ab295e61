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
mod outline;
mod parse;
mod scope;
mod tree;

pub use crate::kernel::total::{DENOMINATOR_MIN, LOG_ARGUMENT_MIN, MAGNITUDE_MAX};
pub use compile::Compiled;
pub use error::ExprError;
pub use outline::outline;
pub use parse::{DEPTH_MAX, NODES_MAX, TEXT_MAX_BYTES};
pub use scope::Scope;
pub use tree::{Expr, FUNCTIONS};

/// The canonical text of an expression; one that does not parse keeps its own text.
pub fn canonical_text(text: &str) -> String {
    Expr::parse(text).map_or_else(|_| text.to_string(), |expr| expr.to_string())
}

#[cfg(test)]
mod tests;
