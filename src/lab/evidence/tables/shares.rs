//! Tables of shares of proposals, a row a source family and ego over all its lineages.

use std::collections::{BTreeMap, BTreeSet};

use super::error::TableError;
use super::key::{Of, RowKey};
use super::layout::{Cell, Column, Form, Head, METHOD, Numbers, POLICY, Part, Row, Table};
use super::metadrive::SEEDS;
use super::paper::Figures;
use super::{labels, notes};
use crate::evidence::recorded_run::RecordedRun;
use crate::objects::{Attempt, LineageId};
use crate::statistics::bootstrap::Estimate;

/// Whether a proposal counts for a share.
pub type Holds = fn(&Attempt) -> bool;

/// A share: its column, what it is taken of, and what holds of those that it counts.
#[derive(Clone, Copy)]
pub(super) struct Share {
    column: Column,
    among: Holds,
    holds: Holds,
}

/// A share in per cent.
pub(super) const fn percent(
    key: &'static str,
    group: &'static str,
    head: &'static str,
    among: Holds,
    holds: Holds,
) -> Share {
    Share { column: Column { key, group, head, upward: None, form: Form::Percent }, among, holds }
}

/// A table of shares.
pub(super) struct Spec {
    pub name: &'static str,
    pub title: &'static str,
    /// Label of the paper's table, where it has one.
    pub source: Option<&'static str>,
    pub shares: &'static [Share],
    /// What the shares rest on, counted.
    pub counts: &'static [(Head, Holds)],
    /// The paper's figures of a family and ego.
    pub figures: fn(&str, &str) -> Option<Figures>,
    /// What a reader must know first.
    pub note: &'static str,
}

impl Spec {
    /// Whether a proposal counts for a column at all, and whether what the column says holds of it; `None` without such a column.
    pub fn counted(&self, key: &str, attempt: &Attempt) -> Option<(bool, bool)> {
        let share = self.shares.iter().find(|share| share.column.key == key)?;
        let counts = (share.among)(attempt);
        Some((counts, counts && (share.holds)(attempt)))
    }

    fn columns(&self) -> Vec<Column> {
        self.shares.iter().map(|share| share.column).collect()
    }
}

/// The table of these runs.
pub(super) fn table(spec: &Spec, runs: &[RecordedRun]) -> Result<Table, TableError> {
    let mut rows: BTreeMap<(String, String, String, Option<String>), Group<'_>> = BTreeMap::new();
    // What two proposers did is told apart; runs of one proposer are told together.
    let kinds: BTreeSet<String> = runs.iter().map(labels::proposals).collect();
    for (place, recorded) in runs.iter().enumerate() {
        let run = (kinds.len() > 1).then(|| recorded.opened.name.clone());
        for parent in &recorded.parents {
            let (family, policy) = (parent.program.source_family.to_string(), labels::policy(recorded, &parent.ego));
            let key = (family, parent.ego.clone(), policy, run.clone());
            let group = rows.entry(key).or_default();
            group.lineages.push(Of { run: place, of: parent.lineage.clone() });
            group.attempts.extend(recorded.attempts.iter().filter(|attempt| attempt.lineage == parent.lineage));
            group.proposals = labels::proposals(recorded);
        }
    }
    let mut notes = vec![spec.note.to_string()];
    notes.extend(notes::of_runs(runs));
    notes.extend(notes::different_versions(runs));
    Ok(Table {
        name: spec.name,
        labels: vec![METHOD, POLICY],
        columns: spec.columns(),
        counts: spec.counts.iter().map(|(head, _)| *head).chain([SEEDS]).collect(),
        parts: vec![Part {
            name: spec.name.into(),
            title: spec.title.into(),
            source: spec.source,
            rows: rows
                .into_iter()
                .map(|((family, ego, policy, run), group)| group.row(spec, (&family, &ego), policy, run))
                .collect(),
        }],
        runs: notes::runs(runs)?,
        notes,
    })
}

/// The attempts of one family against one ego.
#[derive(Default)]
struct Group<'a> {
    lineages: Vec<Of<LineageId>>,
    attempts: Vec<&'a Attempt>,
    proposals: String,
}

impl Group<'_> {
    fn row(self, spec: &Spec, (family, ego): (&str, &str), policy: String, run: Option<String>) -> Row {
        let count = |holds: &dyn Fn(&Attempt) -> bool| self.attempts.iter().filter(|attempt| holds(attempt)).count();
        let share = |share: &Share| {
            let (all, counted) =
                (count(&share.among), count(&|attempt| (share.among)(attempt) && (share.holds)(attempt)));
            (all > 0).then(|| (share.column.key, Estimate::plain(100.0 * counted as f64 / all as f64)))
        };
        let numbers: Numbers = spec.shares.iter().filter_map(share).collect();
        let counts: Vec<usize> = spec.counts.iter().map(|(_, counts)| count(counts)).collect();
        let figures = (spec.figures)(family, ego);
        Row {
            labels: vec![of_run(family, run.as_deref()), policy],
            cells: Cell::row(&spec.columns(), &numbers, figures.as_ref()),
            counts: counts.into_iter().chain([self.lineages.len()]).collect(),
            lineages: self.lineages.iter().map(|own| own.of.to_string()).collect(),
            key: RowKey::of(self.lineages),
            proposals: self.proposals,
            notes: Vec::new(),
        }
    }
}

/// A family's label in a row of all runs, or of one.
fn of_run(family: &str, run: Option<&str>) -> String {
    run.map_or_else(|| family.to_string(), |run| format!("{family} ({run})"))
}
