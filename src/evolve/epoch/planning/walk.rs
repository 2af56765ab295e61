//! All that follows in one lineage, as work that travels: where the lineage stands, and what the run has on record of it.

use serde::{Deserialize, Serialize};
use serde_json::value::RawValue;

use crate::epoch::state::State;
use crate::kernel::Digest;
use crate::objects::LineageId;
use crate::store::MemoKind;

/// A lineage's way from where its records end. Whoever has the study can go it alone.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LineageJob {
    pub lineage: LineageId,
    /// The epoch that comes next; that behind the last one is the end of the run.
    pub epoch: u32,
    /// What the lineage's epochs can read of the state that the run has come to; `None` where it has not begun.
    pub(in crate::epoch) state: Option<Box<State>>,
}

impl LineageJob {
    /// What people call it.
    pub fn name(&self) -> String {
        match self.state {
            None => format!("{} from its parent", self.lineage),
            Some(_) => format!("{} epoch {}", self.lineage, self.epoch),
        }
    }
}

/// A record that a lineage's way begins with.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WalkRecord {
    pub kind: MemoKind,
    pub key: Digest,
    pub record: Box<RawValue>,
}
