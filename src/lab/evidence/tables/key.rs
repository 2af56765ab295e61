//! What a row of a table is about, beside how it is called. Whoever asks for the labels behind a number finds them by this key, so
//! neither a label's wording nor the order of rows can lead to another row's labels.

use crate::objects::LineageId;

/// A lineage, or an ego in scenes without a program, with the place of its run among those that the table was made from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Of<T> {
    pub run: usize,
    pub of: T,
}

/// What a row is about.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum RowKey {
    /// Scenes without a program, each under an ego.
    Replay { egos: Vec<Of<String>>, metric: Option<&'static str> },
    /// Lineages, none where the row is the paper's alone.
    Lineages { of: Vec<Of<LineageId>>, reads: Reads },
    /// Records that are not those of the runs, such as trainings.
    Elsewhere,
}

/// Which of a lineage's programs a number is read off.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    Parent,
    Evolved,
    /// The best descendant; there is no number where a lineage has none.
    Endpoint,
    /// Whom the rule chooses at one of the declared floors of realism, counted from the lowest; there is no number where none are.
    AtFloor(usize),
    /// Evolved minus parent, on the scenes that count for both.
    Change,
}

/// What of its lineages a row reads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reads {
    /// What a column says: the parent, the program that is reported, or the difference.
    ByColumn,
    /// The programs of one side, in every column.
    Side(Side),
    /// What balanced selection keeps after a round, by one metric.
    Round { metric: &'static str, round: usize, of: Kept },
}

/// What balanced selection keeps of whose runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kept {
    /// The search's.
    Evolved,
    /// The parent's, drawn as often.
    Redrawn,
    /// The first less the second.
    Change,
}

impl RowKey {
    /// Of these lineages, read as the columns say.
    pub(super) fn of(lineages: impl IntoIterator<Item = Of<LineageId>>) -> RowKey {
        RowKey::reading(lineages, Reads::ByColumn)
    }

    pub(super) fn reading(lineages: impl IntoIterator<Item = Of<LineageId>>, reads: Reads) -> RowKey {
        RowKey::Lineages { of: lineages.into_iter().collect(), reads }
    }

    /// Whether the row is about a lineage of a run.
    pub(super) fn has(&self, run: usize, lineage: &LineageId) -> bool {
        matches!(self, RowKey::Lineages { of, .. } if of.iter().any(|own| own.run == run && own.of == *lineage))
    }

    /// The run of all its lineages; `None` where they are of several, or there are none.
    pub(super) fn one_run(&self) -> Option<usize> {
        let RowKey::Lineages { of, .. } = self else { return None };
        let first = of.first()?.run;
        of.iter().all(|own| own.run == first).then_some(first)
    }

    /// The side that all columns read; `None` where a column says it.
    pub(super) fn side(&self) -> Option<Side> {
        match self {
            RowKey::Lineages { reads: Reads::Side(side), .. } => Some(*side),
            _ => None,
        }
    }
}
