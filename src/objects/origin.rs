//! Where a program was made that now travels in a file: the run, the attempt, the models that its proposals came from.

use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

use super::ids::SolutionId;
use crate::kernel::Digest;

/// One run that a program came out of.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Origin {
    /// Name of the experiment.
    pub run: String,
    /// Hash of the transcript's last event: which run it was.
    pub root: Digest,
    /// Which of its programs, e.g. `cat-idm/e2s5`.
    pub solution: SolutionId,
    /// Label of the model of each role. It begins with the model's kind.
    pub models: BTreeMap<String, String>,
}

impl Origin {
    /// Kinds of the models, e.g. `scripted` or `openai_compatible + scripted`.
    pub fn kinds(&self) -> String {
        let kinds: BTreeSet<&str> = self.models.values().filter_map(|label| label.split(' ').next()).collect();
        kinds.into_iter().collect::<Vec<_>>().join(" + ")
    }
}

impl fmt::Display for Origin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let labels: BTreeSet<&str> = self.models.values().map(String::as_str).collect();
        let labels = labels.into_iter().collect::<Vec<_>>().join("; ");
        write!(f, "{} of run {} (root {}), models: {labels}", self.solution, self.run, self.root.short(16))
    }
}
