//! A memory card: a short, typed summary of one attempt, or of the history of a lineage.

use serde::{Deserialize, Serialize};

use super::ids::{AttemptId, CardId, FamilyName, LineageId};

/// Subject of a memory card (paper: typed memory cards).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum CardKind {
    /// Why a proposal failed.
    Failure,
    /// A motif that worked.
    Success,
    /// A remark of the critics.
    Critic,
    /// A note on the lineage.
    Lineage,
    /// A plan made by looking back.
    Reflection,
}

/// Summary that later actors may be shown (paper, appendix Archive, Memory, and Retrieval).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Card {
    /// Unique in a run.
    pub id: CardId,
    /// Subject of the card.
    pub kind: CardKind,
    /// The lineage whose attempt it came from.
    pub lineage: LineageId,
    /// The family of that lineage.
    pub family: FamilyName,
    /// Epoch after which it exists; it can be read from the next epoch on.
    pub epoch: u32,
    /// The attempt behind it; `None` for a card about several attempts.
    pub attempt: Option<AttemptId>,
    /// One or two sentences that hold across scenes.
    pub text: String,
    /// Words that say which mechanisms it is about.
    pub mechanism_tags: Vec<String>,
    /// Words for the scenes it speaks of, e.g. `junction`, `dense`.
    pub scene_tags: Vec<String>,
    /// True if the text is about a mechanism in general and holds no details of a family's implementation. Only such
    /// cards may be shown to other lineages.
    pub shareable: bool,
}
