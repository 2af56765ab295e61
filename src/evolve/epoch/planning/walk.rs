//! All that follows in one lineage, as work that travels: where the lineage stands, and what the run has on record of it.

use serde::{Deserialize, Serialize};
use serde_json::value::RawValue;

use crate::epoch::state::State;
use crate::kernel::Digest;
use crate::objects::LineageId;
use crate::store::MemoKind;

/// The work of a lineage from where its records end. Whoever has the study can do it alone.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LineageJob {
    pub lineage: LineageId,
    /// The epoch that comes next; that behind the last one is the end of the run.
    pub epoch: u32,
    /// Part of the run's present state that the lineage's epochs can read; `None` where the lineage has not begun.
    pub(in crate::epoch) state: Option<Box<State>>,
}

impl LineageJob {
    /// Returns its name for people.
    pub fn name(&self) -> String {
        match self.state {
            None => format!("{} from its parent", self.lineage),
            Some(_) => format!("{} epoch {}", self.lineage, self.epoch),
        }
    }
}

/// A record that a lineage's work begins with.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WalkRecord {
    pub kind: MemoKind,
    pub key: Digest,
    pub record: Box<RawValue>,
}
