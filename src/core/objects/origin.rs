//! Origin of a program that now travels in a file: the run, the attempt and the models that its proposals came from, or the hand
//! that wrote it.

use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

use super::ids::SolutionId;
use crate::kernel::Digest;

/// One step in the history of a program.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Origin {
    /// It came out of a run.
    Run(RunOrigin),
    /// Somebody wrote it.
    Hand(HandOrigin),
}

/// One run that a program came out of.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RunOrigin {
    /// Name of the experiment.
    pub run: String,
    /// Hash of the transcript's last event: which run it was.
    pub root: Digest,
    /// Which of its programs, e.g. `cat-idm/e2s5`.
    pub solution: SolutionId,
    /// Label of the model of each role. It begins with the model's kind.
    pub models: BTreeMap<String, String>,
}

/// A program that somebody wrote or changed.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HandOrigin {
    /// Its name since then.
    pub by_hand: SolutionId,
    /// Hash of the program that it was before; `None` where it was written from nothing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub from: Option<Digest>,
}

impl Origin {
    /// Kinds of the models, e.g. `scripted` or `openai_compatible + scripted`; `by hand` where somebody wrote it.
    pub fn kinds(&self) -> String {
        match self {
            Origin::Hand(_) => "by hand".into(),
            Origin::Run(of) => {
                let kinds: BTreeSet<&str> = of.models.values().filter_map(|label| label.split(' ').next()).collect();
                kinds.into_iter().collect::<Vec<_>>().join(" + ")
            }
        }
    }

    /// The texts that came from a file: names and labels.
    pub fn texts(&self) -> Vec<&str> {
        match self {
            Origin::Hand(of) => vec![of.by_hand.as_str()],
            Origin::Run(of) => {
                let models = of.models.iter().flat_map(|(role, label)| [role.as_str(), label.as_str()]);
                [of.run.as_str(), of.solution.as_str()].into_iter().chain(models).collect()
            }
        }
    }

    /// Returns the origin in a few words, for captions.
    pub fn short(&self) -> String {
        match self {
            Origin::Hand(_) => "written by hand".into(),
            Origin::Run(of) => format!("{} (root {})", of.run, of.root.short(12)),
        }
    }
}

impl fmt::Display for Origin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Origin::Hand(HandOrigin { by_hand, from: None }) => write!(f, "{by_hand}, written by hand"),
            Origin::Hand(HandOrigin { by_hand, from: Some(from) }) => {
                write!(f, "{by_hand}, written by hand from program {}", from.short(16))
            }
            Origin::Run(of) => {
                let labels: BTreeSet<&str> = of.models.values().map(String::as_str).collect();
                let labels = labels.into_iter().collect::<Vec<_>>().join("; ");
                write!(f, "{} of run {} (root {}), models: {labels}", of.solution, of.run, of.root.short(16))
            }
        }
    }
}
