//! What a search gained, told so that it cannot be bought: the attack that its finalists reach at several floors of realism, areas in
//! absolute units, and the gain over null searches instead of over nothing.

use std::collections::{BTreeMap, BTreeSet};

use super::ablations::{against, holm, method};
use super::error::TableError;
use super::frontier::Spanned;
use super::key::Side;
use super::labels::{self, LineageLabels};
use super::layout::{Cell, Column, Form, METHOD, Numbers, POLICY, Part, ROLLOUTS, Row, Table};
use super::metadrive::{SCENES, SEEDS, estimated, of_lineages, policies, quantity, row};
use super::notes;
use super::searches::searches;
use crate::archive::search::Method;
use crate::evidence::recorded_run::RecordedRun;
use crate::objects::LineageId;
use crate::statistics::bootstrap::{self, Estimate};

/// Name of the table.
pub(super) const NAME: &str = "metadrive-gains";

const fn rate(key: &'static str, group: &'static str, head: &'static str) -> Column {
    Column { key, group, head, upward: Some(true), form: Form::Rate }
}

const fn change(key: &'static str, group: &'static str, head: &'static str) -> Column {
    Column { key, group, head, upward: Some(true), form: Form::RateChange }
}

const fn chance(key: &'static str, group: &'static str, head: &'static str) -> Column {
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
const AREA_PARENT: Column = rate("area_parent", AREA, "Parent");
const AREA_EVOLVED: Column = rate("area_evolved", AREA, "With descendants");
const AREA_CHANGE: Column = change("area_change", AREA, "Change");

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
        p: chance("p_random_proposals", NULLS, "p (patches)"),
    },
    Null {
        method: Method::ShuffledLabels,
        over: change("over_shuffled_labels", NULLS, "Shuffled labels"),
        p: chance("p_shuffled_labels", NULLS, "p (labels)"),
    },
];

fn columns() -> Vec<Column> {
    let areas = [AREA_PARENT, AREA_EVOLVED, AREA_CHANGE];
    let nulls = NULL_SEARCHES.iter().flat_map(|null| [null.over, null.p]);
    READ.iter().map(|(column, _)| *column).chain(areas).chain(nulls).collect()
}

/// The side of a column that is a mean over labels.
pub(super) fn side_of(key: &str) -> Option<Side> {
    READ.iter().find(|(column, _)| column.key == key).map(|(_, side)| *side)
}

/// Which of a lineage's areas a column shows: a number of what spans its front.
pub(super) fn area_of(key: &str) -> Option<fn(&Spanned) -> f64> {
    match key {
        _ if key == AREA_PARENT.key => Some(|of| of.areas[0]),
        _ if key == AREA_EVOLVED.key => Some(|of| of.areas[1]),
        _ if key == AREA_CHANGE.key => Some(|of| of.areas[1] - of.areas[0]),
        _ => None,
    }
}

/// The method of the null search that a column compares with.
pub(super) fn null_of(key: &str) -> Option<Method> {
    NULL_SEARCHES.iter().find(|null| null.over.key == key).map(|null| null.method)
}

/// The place of the run that is a null search of this method; the first run is never one.
pub(super) fn null_run(runs: &[RecordedRun], wanted: Method) -> Option<usize> {
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
    let own = labels::of_run(runs, 0)?;
    let nulls = NULL_SEARCHES.iter().map(|null| match null_run(runs, null.method) {
        Some(place) => labels::of_run(runs, place),
        None => Ok(Vec::new()),
    });
    let nulls: Vec<Vec<LineageLabels>> = nulls.collect::<Result<_, _>>()?;
    let groups = searches(own.iter());
    let several = groups.len() > 1;
    let all = several.then(|| own.iter().collect::<Vec<_>>());
    let titled = groups.iter().map(|of| (of[0].label.clone(), of[0].policy.clone(), of.clone()));
    let titled = titled.chain(all.map(|of| (format!("All {}", groups.len()), policies(&of), of)));
    let mut pending: Vec<(Row, Numbers, [Option<f64>; 2])> = Vec::new();
    for (title, policy, of) in titled {
        let (numbers, p) = numbers(runs, &of, &nulls);
        pending.push((row(&title, policy, &of, Vec::new()), numbers, p));
    }
    // The row over all rests on the others: it is no further test.
    let tested = if several { pending.len().saturating_sub(1) } else { pending.len() };
    let family: Vec<f64> = pending[..tested].iter().flat_map(|(.., p)| p.iter().flatten().copied()).collect();
    let mut corrected = holm(&family).into_iter();
    let rows = pending.into_iter().enumerate().map(|(place, (row, mut numbers, p))| {
        for (null, p) in NULL_SEARCHES.iter().zip(p) {
            let Some(p) = p else { continue };
            let shown = if place < tested { corrected.next().unwrap_or(p) } else { p };
            numbers.insert(null.p.key, Estimate::plain(shown));
        }
        Row { cells: Cell::row(&columns(), &numbers, None), notes: Vec::new(), ..row }
    });
    let rows: Vec<Row> = rows.collect();
    let notes = notes(runs, &own, &nulls, &rows);
    Ok(Table {
        name: NAME,
        labels: vec![METHOD, POLICY],
        columns: columns(),
        counts: vec![SCENES, SEEDS, ROLLOUTS],
        parts: vec![Part {
            name: NAME.into(),
            title: "What the search gained: floors of realism, absolute areas, and null searches".into(),
            source: None,
            rows,
        }],
        runs: notes::runs(runs)?,
        notes,
    })
}

/// A row's numbers, and the chances under no difference to the null searches.
fn numbers(runs: &[RecordedRun], of: &[&LineageLabels], nulls: &[Vec<LineageLabels>]) -> (Numbers, [Option<f64>; 2]) {
    let mut numbers = estimated(&READ.map(|(column, side)| (column, quantity(of, |l| l.read(side, labels::ATTACK)))));
    // Drawing up an area costs more than reading a label, and three columns show it.
    let spanned = |l: &LineageLabels| {
        let run = &runs[l.place];
        Spanned::of(run, run.result_of(&l.lineage)?)
    };
    let areas: BTreeMap<&LineageId, Spanned> = of.iter().filter_map(|l| Some((&l.lineage, spanned(l)?))).collect();
    for column in [AREA_PARENT, AREA_EVOLVED, AREA_CHANGE] {
        let Some(number) = area_of(column.key) else { continue };
        let shown = of_lineages(of, |l| areas.get(&l.lineage).map(number));
        numbers.extend(shown.map(|own| (column.key, own)));
    }
    let mut chances = [None; 2];
    for ((null, labels), p) in NULL_SEARCHES.iter().zip(nulls).zip(&mut chances) {
        if !is_matched(of, labels) {
            continue;
        }
        let differences = against(of, labels, labels::ATTACK);
        let Some((estimate, chance)) = bootstrap::compared_with_zero(&[differences]).into_iter().next().flatten()
        else {
            continue;
        };
        numbers.insert(null.over.key, estimate);
        *p = Some(chance);
    }
    (numbers, chances)
}

/// Whether a null search was made for every repetition of these. A mean over those that it was made for would say something of whom it was
/// made for.
pub(super) fn is_matched(of: &[&LineageLabels], null: &[LineageLabels]) -> bool {
    of.iter().all(|own| own.counterpart(null).is_some())
}

/// What a null search was not made for.
fn without_counterpart(own: &[LineageLabels], null: &Null, labels: &[LineageLabels]) -> Option<String> {
    // Without a run every cell below the column is empty, which says it.
    labels.first()?;
    let lacking = searches(own.iter()).into_iter().filter(|of| !is_matched(of, labels));
    let lacking: Vec<String> = lacking.map(|of| format!("{} against {}", of[0].label, of[0].policy)).collect();
    let head = null.over.head;
    (!lacking.is_empty()).then(|| {
        format!(
            "{head}: not searched for {}, or less often, so these rows and the one over all say nothing there.",
            lacking.join(", ")
        )
    })
}

fn notes(runs: &[RecordedRun], own: &[LineageLabels], nulls: &[Vec<LineageLabels>], rows: &[Row]) -> Vec<String> {
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
    notes.extend(NULL_SEARCHES.iter().zip(nulls).filter_map(|(null, labels)| without_counterpart(own, null, labels)));
    notes.extend(notes::one_seed(&notes::repeats(own.iter()), "held-out scenes"));
    notes.extend(notes::all_alike(rows, 0, |column| column.group == ATTACK && column.form == Form::Rate));
    notes.extend(notes::own_attack(runs));
    notes.extend(notes::of_runs(runs));
    notes.extend(notes::different_versions(runs));
    notes
}
