//! Drivers and suites as results name them.

use serde::{Deserialize, Serialize};

use crate::kernel::Digest;

/// A driver by name and identity.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DriverMark {
    pub name: String,
    pub digest: Digest,
}

/// A suite by name and digest.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SuiteMark {
    pub name: String,
    pub digest: Digest,
}

/// Which cases of a suite: those that have one of the words of each list that is not empty.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Selected {
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub family: Vec<String>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub cluster: Vec<String>,
    /// Class of the frozen contact.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub class: Vec<String>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub case: Vec<String>,
}

impl Selected {
    /// Returns `true` if no case is left out.
    pub fn is_all(&self) -> bool {
        *self == Selected::default()
    }
}
