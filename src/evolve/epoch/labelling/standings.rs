//! Labels of the programs with which an epoch's children are compared.

use std::collections::BTreeMap;

use crate::objects::{Score, SolutionId};

/// Labels of programs that others are compared with.
pub type Standings = BTreeMap<SolutionId, Standing>;

/// One program's labels.
#[derive(Clone, Debug)]
pub struct Standing {
    pub window: Score,
    pub so_far: Score,
}
