//! Contribution of each edit of the reported programs, as a table (`evodrive credit --format`).

use std::collections::BTreeMap;

use super::credit::{Credit, Gain, in_short};
use super::lineage_text::shortened;
use super::recorded_run::RecordedRun;
use super::tables::{
    Cell, Column, Estimate, Form, Head, Part, Row, RowKey, Table, TableError, proposers, run_notes, run_sources,
};

const NAME: &str = "credit";
/// Characters of an operation.
const OPERATION_MAX: usize = 56;

const fn change(key: &'static str, group: &'static str, head: &'static str) -> Column {
    Column { key, group, head, upward: Some(true), form: Form::RateChange }
}

const SO_FAR: &str = "With the edits so far";
const NEEDED: &str = "Lost without it";
const ALONE: &str = "Alone on the parent";
const COLUMNS: [Column; 6] = [
    change("so_far_attack", SO_FAR, "Attack"),
    change("so_far_realism", SO_FAR, "Realism"),
    change("needed_attack", NEEDED, "Attack"),
    change("needed_realism", NEEDED, "Realism"),
    change("alone_attack", ALONE, "Attack"),
    change("alone_realism", ALONE, "Realism"),
];
const PROGRAM: Head = Head { key: "program", head: "Program" };
const EDIT: Head = Head { key: "edit", head: "Edit" };
const WHAT: Head = Head { key: "what", head: "What it does" };
const VERDICT: Head = Head { key: "verdict", head: "Verdict" };
const SCENES: Head = Head { key: "held_out_scenes", head: "Scenes" };

/// A row for each reported program, and below it one for each of its edits.
///
/// # Errors
/// A run that is not finished.
pub fn credits(run: &RecordedRun, credits: &[Credit]) -> Result<Table, TableError> {
    let mut rows = Vec::new();
    for credit in credits {
        let program = credit.program.to_string();
        let (whole, none) = (Ok(credit.whole.clone()), Err(String::new()));
        let whole = [&whole, &whole, &none];
        let labels = vec![program.clone(), "all".into(), "the whole chain".into(), credit.whole.verdict()];
        rows.push(row(run, labels, whole, credit.scenes));
        for edit in &credit.edits {
            // The command says in full what a page has no room for.
            let verdict = match &edit.taken_out {
                Ok(gain) => gain.verdict(),
                Err(reason) => in_short(reason).to_string(),
            };
            let what: Vec<String> = edit.what.iter().map(|operation| shortened(operation, OPERATION_MAX)).collect();
            let labels = vec![program.clone(), edit.name.clone(), what.join("; "), verdict];
            rows.push(row(
                run,
                labels,
                [edit.so_far.as_ref().unwrap_or(&none), &edit.taken_out, &edit.alone],
                credit.scenes,
            ));
        }
    }
    let mut notes = vec![
        "With the edits so far: the parent with the edits up to this one minus the parent. Lost without it: the program minus the program without this edit. Alone on the parent: the parent with this edit minus the parent. \
         The shares of edits need not add up to the whole, because edits may need each other or do the same. Realism: over the scenes in \
         which both act."
            .to_string(),
        "In brackets: 95 % percentile bootstrap intervals over held-out scenes, paired by scene. They hold for these programs; another seed \
         of the search may give others."
            .to_string(),
    ];
    notes.extend(run_notes(std::slice::from_ref(run)));
    Ok(Table {
        name: NAME,
        labels: vec![PROGRAM, EDIT, WHAT, VERDICT],
        columns: COLUMNS.to_vec(),
        counts: vec![SCENES],
        parts: vec![Part {
            name: NAME.into(),
            title: "What each edit of the reported programs accounts for".into(),
            source: None,
            rows,
        }],
        runs: run_sources(std::slice::from_ref(run))?,
        notes,
    })
}

fn row(run: &RecordedRun, labels: Vec<String>, gains: [&Result<Gain, String>; 3], scenes: usize) -> Row {
    let mut numbers: BTreeMap<&'static str, Estimate> = BTreeMap::new();
    for (gain, [attack, realism]) in
        gains.into_iter().zip([[0, 1], [2, 3], [4, 5]].map(|of| of.map(|k| COLUMNS[k].key)))
    {
        let Ok(gain) = gain else { continue };
        numbers.insert(attack, gain.attack);
        numbers.extend(gain.realism.map(|own| (realism, own)));
    }
    Row {
        key: RowKey::Elsewhere,
        lineages: vec![labels[0].clone()],
        labels,
        cells: Cell::row(&COLUMNS, &numbers),
        counts: vec![scenes],
        proposals: proposers(run),
        notes: Vec::new(),
    }
}
