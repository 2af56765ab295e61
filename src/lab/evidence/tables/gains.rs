//! Gain of a search, measured so that it cannot be bought: the attack that its finalists reach at several floors of realism, areas in
//! absolute units, and the gain over null searches instead of over nothing.

use std::collections::BTreeSet;

use super::ablations::{OF_RESAMPLES, correct, method, put_chances};
use super::basis::Derivation;
use super::derivations::{Derivations, Source};
use super::error::TableError;
use super::frontier::Spanned;
use super::key::{RowKey, Side};
use super::labels::{self, LineageLabels};
use super::layout::{Column, Form, Row, Sourced, Table, heads};
use super::metadrive::{policies, row, sourced, table};
use super::notes;
use super::searches::searches;
use crate::archive::search::Method;
use crate::evidence::recorded_run::RecordedRun;

/// Name of the table.
const NAME: &str = "metadrive-gains";

const fn rate(key: &'static str, group: &'static str, head: &'static str) -> Column {
    Column { key, group, head, upward: Some(true), form: Form::Rate }
}

const fn change(key: &'static str, group: &'static str, head: &'static str) -> Column {
    Column { key, group, head, upward: Some(true), form: Form::RateChange }
}

const fn p(key: &'static str, group: &'static str, head: &'static str) -> Column {
    Column { key, group, head, upward: None, form: Form::Rate }
}

const ATTACK: &str = "Attack";
const FLOORS: &str = "Attack at a floor of realism";
const AREA: &str = "Area of the front";
const NULLS: &str = "Attack over a null search";

/// Columns that are means over labels, with the side that each reads.
const READ: [(Column, Side); 6] = [
    (rate("parent_attack", ATTACK, "Parent"), Side::Parent),
    (rate("evolved_attack", ATTACK, "Evolved"), Side::Evolved),
    (change("attack_change", ATTACK, "Change"), Side::Change),
    (rate("floor_low", FLOORS, "Low"), Side::AtFloor(0)),
    (rate("floor_middle", FLOORS, "Middle"), Side::AtFloor(1)),
    (rate("floor_high", FLOORS, "High"), Side::AtFloor(2)),
];
/// Area of a lineage that a column shows: a number of what spans its front.
type Area = fn(&Spanned) -> f64;
const AREAS: [(Column, Area); 3] = [
    (rate("area_parent", AREA, "Parent"), |of| of.areas[0]),
    (rate("area_evolved", AREA, "With descendants"), |of| of.areas[1]),
    (change("area_change", AREA, "Change"), |of| of.areas[1] - of.areas[0]),
];

/// A null search: the name of its method, the columns of the difference to it and of its chance.
struct Null {
    method: Method,
    over: Column,
    p: Column,
}

const NULL_SEARCHES: [Null; 2] = [
    Null {
        method: Method::RandomProposals,
        over: change("over_random_proposals", NULLS, "Random patches"),
        p: p("p_random_proposals", NULLS, "p (patches)"),
    },
    Null {
        method: Method::ShuffledLabels,
        over: change("over_shuffled_labels", NULLS, "Shuffled labels"),
        p: p("p_shuffled_labels", NULLS, "p (labels)"),
    },
];

fn columns(runs: &[RecordedRun]) -> Vec<Sourced> {
    let read = READ.map(|(column, side)| sourced((column, side, labels::ATTACK)));
    let areas = AREAS.map(|(column, number)| (column, Source::of(move |bases, row| Some(area(bases, row, number)))));
    let nulls = NULL_SEARCHES.iter().flat_map(|null| {
        let place = null_run(runs, null.method);
        let over = Source::of(move |bases, row| {
            let (own, null) = (bases.lineages_of(row), bases.run(place?));
            is_matched(&own, &null).then(|| bases.paired(&own, &null, labels::ATTACK))?
        });
        [(null.over, over), (null.p, OF_RESAMPLES)]
    });
    read.into_iter().chain(areas).chain(nulls).collect()
}

fn area(bases: &Derivations<'_>, row: &RowKey, number: Area) -> Derivation {
    let what = "an area in the plane of attack and strict realism, on held-out objectives";
    bases.spanned(&bases.lineages_of(row), what, number)
}

/// The place of the run that is a null search of this method; the first run is never one.
fn null_run(runs: &[RecordedRun], wanted: Method) -> Option<usize> {
    (1..runs.len()).find(|place| method(&runs[*place]) == wanted.name())
}

/// Gains of the first run's searches; the other runs are its null searches.
pub fn metadrive_gains(runs: &[RecordedRun]) -> Result<Table, TableError> {
    notes::one_attack(runs)?;
    for (place, run) in runs.iter().enumerate().skip(1) {
        let known = NULL_SEARCHES.iter().any(|null| null_run(runs, null.method) == Some(place));
        if !known {
            return Err(TableError::NoNullSearch { run: labels::run_name(run), method: method(run).to_string() });
        }
    }
    let bases = Derivations::of(runs);
    bases.by_run()?;
    let (own, columns) = (bases.run(0), columns(runs));
    let groups = searches(own.iter().copied());
    let titled = groups.iter().map(|of| (of[0].label.clone(), of[0].policy.clone(), of.clone()));
    let all = (groups.len() > 1).then(|| (format!("All {}", groups.len()), policies(&own), own.clone()));
    let tested = NULL_SEARCHES.map(|null| [null.over.key, null.p.key]);
    let row = |(title, policy, of): (String, String, Vec<&LineageLabels>)| {
        let mut row = Row { notes: Vec::new(), ..row(&bases, vec![title, policy], &of, &columns, None) };
        put_chances(&bases, &mut row, &tested);
        row
    };
    let mut rows: Vec<Row> = titled.chain(all).map(row).collect();
    // The row over all rests on the others: it is no further test.
    correct(&mut rows[..groups.len()], &tested);
    let notes = notes(runs, &bases, &own, &rows);
    let title = "What the search gained: floors of realism, absolute areas, and null searches";
    table(NAME, title, None, heads(&columns), rows, notes, runs)
}

/// Returns `true` if a null search was made for every repetition of these. A mean over fewer would depend on which ones it was made for.
fn is_matched(of: &[&LineageLabels], null: &[&LineageLabels]) -> bool {
    of.iter().all(|own| own.counterpart(null.iter().copied()).is_some())
}

/// Names the searches that a null search was not made for; `None` where there are none.
fn without_counterpart(own: &[&LineageLabels], null: &Null, labels: &[&LineageLabels]) -> Option<String> {
    // Without a run every cell below the column is empty, which says it.
    labels.first()?;
    let lacking = searches(own.iter().copied()).into_iter().filter(|of| !is_matched(of, labels));
    let lacking: Vec<String> = lacking.map(|of| format!("{} against {}", of[0].label, of[0].policy)).collect();
    let head = null.over.head;
    (!lacking.is_empty()).then(|| {
        format!(
            "{head}: not searched for {}, or less often, so these rows and the one over all say nothing there.",
            lacking.join(", ")
        )
    })
}

fn notes(runs: &[RecordedRun], bases: &Derivations<'_>, own: &[&LineageLabels], rows: &[Row]) -> Vec<String> {
    let floors: BTreeSet<String> = own.iter().flat_map(|l| &l.floors).map(|floor| format!("{floor:.2}")).collect();
    let mut notes = vec![
        "Attack: share of held-out scenes in which the ego fails by a contact that the experiment counts. Evolved: the program that is \
         reported. All programs are chosen on evolution scenes."
            .to_string(),
        if floors.is_empty() { "No further floors of realism are declared (selector.also_at), so those columns are empty.".to_string() } else { format!(
                "Low, Middle, High: attack of the finalist, or parent, that the same rule chooses where realism on evolution scenes must be \
                 at least {}; where nobody reaches that it is the most realistic one.",
                floors.into_iter().collect::<Vec<_>>().join(", ")
            ) },
        "Area: what the parent dominates in the plane of attack and strict realism on held-out scenes, in absolute units (1 is everything), \
         and what it dominates with the first three descendants by the reporting rule."
            .to_string(),
        "Random patches: the same loop with a random legal patch in place of every proposal. Shuffled labels: the same proposals, but \
         accepted by the labels of another candidate. Differences are paired by lineage, seed and scene. p: two-sided, corrected by Holm \
         over the rows of single searches; that of the row over all is not corrected."
            .to_string(),
        notes::intervals("held-out scenes"),
    ];
    notes.extend(NULL_SEARCHES.iter().filter_map(|null| {
        let place = null_run(runs, null.method)?;
        without_counterpart(own, null, &bases.run(place))
    }));
    notes.extend(notes::one_seed(&notes::repeats(own.iter().copied()), "held-out scenes"));
    notes.extend(notes::all_alike(rows, 0, |column| column.group == ATTACK && column.form == Form::Rate));
    notes.extend(notes::own_attack(runs));
    notes.extend(notes::of_runs(runs));
    notes.extend(notes::different_versions(runs));
    notes
}
