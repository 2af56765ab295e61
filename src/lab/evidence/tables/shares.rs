//! Tables of shares of proposals, a row a source family and ego over all its lineages.

use std::collections::{BTreeMap, BTreeSet};

use super::basis::{Combine, Derivation, Leaf, Repetition};
use super::derivations::{Derivations, Source};
use super::error::TableError;
use super::key::{Of, RowKey};
use super::layout::{Cell, Column, Form, Head, METHOD, POLICY, Part, Row, Sourced, Table, heads};
use super::metadrive::SEEDS;
use super::paper::Figures;
use super::{labels, notes};
use crate::evidence::recorded_run::RecordedRun;
use crate::kernel::num;
use crate::objects::event::ParentAdopted;
use crate::objects::{Attempt, LineageId};

/// Test of whether a proposal counts for a share.
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
    /// Counts that the shares rest on.
    pub counts: &'static [(Head, Holds)],
    /// The paper's figures of a family and ego.
    pub figures: fn(&str, &str) -> Option<Figures>,
    /// Note that a reader needs first.
    pub note: &'static str,
}

impl Share {
    fn sourced(&self) -> Sourced {
        let Share { column, among, holds } = *self;
        (column, Source::of(move |bases, row| Some(counted(bases, row, |of| among(of).then(|| holds(of))))))
    }
}

/// A share of the proposals of a row's lineages; `None` is one that does not count.
fn counted(bases: &Derivations<'_>, row: &RowKey, holds: impl Fn(&Attempt) -> Option<bool>) -> Derivation {
    let part = |(place, run, parent): (usize, &RecordedRun, &ParentAdopted)| {
        let attempts = run.attempts.iter().filter(|attempt| attempt.lineage == parent.lineage);
        let leaves: Vec<Leaf> = attempts.map(|of| Leaf::attempt(of, holds(of).map(labels::share))).collect();
        let counted: Vec<f64> = leaves.iter().filter_map(|leaf| leaf.value).collect();
        let value = num::mean(&counted).map(|share| 100.0 * share);
        Repetition::of(parent.program.source_family.to_string(), place, parent.lineage.to_string(), value, leaves)
    };
    let parents =
        bases.runs.iter().enumerate().flat_map(|(place, run)| run.parents.iter().map(move |of| (place, run, of)));
    let own = parents.filter(|(place, _, parent)| row.has(*place, &parent.lineage));
    let formula = "100 times the proposals that it holds of, over all that count, of all lineages together";
    Derivation::of(formula.into(), Combine::Pooled, own.map(part).collect())
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
    let (bases, columns) = (Derivations::of(runs), spec.shares.iter().map(Share::sourced).collect::<Vec<_>>());
    let row = |((family, ego, policy, run), group): ((String, String, String, Option<String>), Group<'_>)| {
        let (figures, key) = ((spec.figures)(&family, &ego), RowKey::Lineages(group.lineages.clone()));
        let count = |(_, counts): &(Head, Holds)| group.attempts.iter().filter(|attempt| counts(attempt)).count();
        Row {
            labels: vec![of_run(&family, run.as_deref()), policy],
            cells: Cell::derived(&bases, &key, &columns, figures.as_ref()),
            key,
            counts: spec.counts.iter().map(count).chain([group.lineages.len()]).collect(),
            lineages: group.lineages.iter().map(|own| own.of.to_string()).collect(),
            proposals: group.proposals,
            notes: Vec::new(),
        }
    };
    let mut notes = vec![spec.note.to_string()];
    notes.extend(notes::of_runs(runs));
    notes.extend(notes::different_versions(runs));
    Ok(Table {
        name: spec.name,
        labels: vec![METHOD, POLICY],
        columns: heads(&columns),
        counts: spec.counts.iter().map(|(head, _)| *head).chain([SEEDS]).collect(),
        parts: vec![Part {
            name: spec.name.into(),
            title: spec.title.into(),
            source: spec.source,
            rows: rows.into_iter().map(row).collect(),
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

/// A family's label in a row of all runs, or of one.
fn of_run(family: &str, run: Option<&str>) -> String {
    run.map_or_else(|| family.to_string(), |run| format!("{family} ({run})"))
}
