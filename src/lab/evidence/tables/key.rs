//! Subject of a table's row, as opposed to its name. Whoever asks for the labels behind a number finds them by this key, so
//! neither a label's wording nor the order of rows can lead to another row's labels.

use crate::objects::LineageId;

/// A lineage, or an ego in scenes without a program, with the place of its run among those that the table was made from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Of<T> {
    pub run: usize,
    pub of: T,
}

/// Subject of a row.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum RowKey {
    /// Scenes without a program, each under an ego.
    Replay(Vec<Of<String>>),
    /// Lineages, none where the row is the paper's alone.
    Lineages(Vec<Of<LineageId>>),
    /// Records that are not those of the runs, such as trainings.
    Elsewhere,
}

/// Program of a lineage that a number is read off.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    Parent,
    Evolved,
    /// The best descendant; there is no number where a lineage has none.
    Endpoint,
    /// Program that the rule chooses at one of the declared floors of realism, counted from the lowest; there is no number where none are.
    AtFloor(usize),
    /// Evolved minus parent, on the scenes that count for both.
    Change,
}

impl RowKey {
    /// Returns `true` if the row is about a lineage of a run.
    pub(super) fn has(&self, run: usize, lineage: &LineageId) -> bool {
        matches!(self, RowKey::Lineages(of) if of.iter().any(|own| own.run == run && own.of == *lineage))
    }

    /// The egos of a row without a program.
    pub(super) fn egos(&self) -> &[Of<String>] {
        if let RowKey::Replay(egos) = self { egos } else { &[] }
    }
}
