//! A memory card: a short, typed summary of one attempt, or of a lineage's way so far.

use serde::{Deserialize, Serialize};

use super::ids::{AttemptId, CardId, FamilyName, LineageId};

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum CardKind {
    Failure,
    Success,
    Critic,
    Lineage,
    Reflection,
}

/// What later actors may be shown (paper, appendix Archive, Memory, and Retrieval).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Card {
    pub id: CardId,
    pub kind: CardKind,
    pub lineage: LineageId,
    pub family: FamilyName,
    /// Epoch after which it exists; it can be read from the next epoch on.
    pub epoch: u32,
    pub attempt: Option<AttemptId>,
    /// One or two sentences that hold across scenes.
    pub text: String,
    pub mechanism_tags: Vec<String>,
    /// Words for the scenes it speaks of, e.g. `junction`, `dense`.
    pub scene_tags: Vec<String>,
    /// True where the text is about a mechanism in general and carries nothing of a family's implementation: only
    /// such cards may be shown to other lineages.
    pub shareable: bool,
}
