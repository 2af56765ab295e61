//! Typed ids from one macro, so that an id of one kind cannot be used in the place of another.

use serde::{Deserialize, Serialize};
use std::fmt;

macro_rules! ids {
    ($($(#[$doc:meta])* $name:ident;)*) => {$(
        $(#[$doc])*
        #[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
        #[serde(transparent)]
        pub struct $name(pub String);

        impl $name {
            /// Takes the text as it is.
            pub fn new(text: impl Into<String>) -> $name {
                $name(text.into())
            }

            /// The text.
            pub fn as_str(&self) -> &str {
                &self.0
            }
        }

        impl fmt::Display for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(&self.0)
            }
        }
    )*};
}

ids! {
    /// A source family such as `cat`: the method whose contract a program obeys.
    FamilyName;
    /// One line of descent: a family evolved against one ego, e.g. `cat-idm`.
    LineageId;
    /// One program of a lineage: `<lineage>/<attempt place>`, e.g. `cat-idm/e2s5`; the parent is `<lineage>/parent`.
    SolutionId;
    /// One proposal, however it ended: `<lineage>/e<epoch>s<slot>`.
    AttemptId;
    /// A memory card: `<attempt>#<n>`.
    CardId;
}

impl AttemptId {
    /// The id of a slot of an epoch of a lineage.
    pub fn at(lineage: &LineageId, epoch: u32, slot: u32) -> AttemptId {
        AttemptId(format!("{lineage}/e{epoch}s{slot}"))
    }

    /// The name of its lineage.
    pub fn lineage(&self) -> &str {
        self.0.rsplit_once('/').map_or(&self.0, |(lineage, _)| lineage)
    }
}
