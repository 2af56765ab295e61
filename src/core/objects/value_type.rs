//! The types of the expression language.

use serde::{Deserialize, Serialize};

/// Type of the value that a mechanism's expression gives.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ValueType {
    /// A number.
    Number,
    /// True or false.
    Boolean,
}
