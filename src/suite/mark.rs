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

/// Which suite.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SuiteMark {
    pub name: String,
    pub digest: Digest,
}
