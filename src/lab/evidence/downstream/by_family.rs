//! tab:carla-chatscene-finetune: collision rate and overall score of each traffic family and their mean, a row an arm, then a row a pair.

use super::found::{ADVERSARIAL, Question, Read, difference, last, reference};
use super::table::{Line, pairs};
use crate::evidence::tables::{
    AVERAGE, Cell, Column, Estimate, Form, Head, Part, Row, Source, Table, estimates, family_columns,
};
use crate::objects::downstream::Downstream;

/// The paper's table.
const LABEL: &str = "tab:carla-chatscene-finetune";
/// The families in the order of the columns, then their mean: CR and OS of the paper's two rows.
const PAPER: [(&str, Read, [f64; 9]); 4] = [
    ("original", Read::Crash, [0.250, 0.150, 0.000, 0.050, 0.000, 0.500, 0.350, 0.000, 0.163]),
    ("evolved", Read::Crash, [0.100, 0.050, 0.000, 0.200, 0.000, 0.500, 0.000, 0.000, 0.106]),
    ("original", Read::Score, [0.800, 0.847, 0.949, 0.921, 0.948, 0.711, 0.705, 0.949, 0.854]),
    ("evolved", Read::Score, [0.854, 0.892, 0.952, 0.851, 0.949, 0.682, 0.945, 0.950, 0.884]),
];
/// Quantities that the parts show, with their names.
const METRICS: [(Read, &str, &str); 2] =
    [(Read::Crash, "CR", "Collision rate (lower is better)"), (Read::Score, "OS", "Overall score (higher is better)")];

/// The table of a study by family.
pub fn of_arms(record: &Downstream) -> Table {
    let opening = &record.opening;
    let columns = family_columns();
    let (mut parts, pairs) = (Vec::new(), pairs(record));
    for (read, name, title) in METRICS {
        let mut rows = Vec::new();
        for (arm, _) in &opening.arms {
            rows.push(row(record, &columns, Line { label: arm.clone(), arms: vec![arm], form: Form::Rate }, read));
        }
        for known in &opening.references {
            let line = Line { label: known.driver.clone(), arms: Vec::new(), form: Form::Rate };
            rows.push(row(record, &columns, line, read));
        }
        for pair in &pairs {
            let label = format!("{} less {}", pair[0], pair[1]);
            rows.push(row(record, &columns, Line { label, arms: pair.to_vec(), form: Form::RateChange }, read));
        }
        let title = format!("{}: {}", title, opening.describes);
        parts.push(Part {
            name: format!("{}-{}", opening.name, name.to_lowercase()),
            title,
            source: Some(LABEL),
            rows,
        });
    }
    Table {
        name: "downstream",
        labels: vec![Head { key: "arm", head: "Trained on" }, Head { key: "metric", head: "Metric" }],
        columns,
        counts: vec![Head { key: "trainings", head: "Trainings" }, Head { key: "scenes", head: "Scenes" }],
        parts,
        runs: Vec::new(),
        notes: super::table::notes(record, &pairs),
    }
}

fn row(record: &Downstream, columns: &[Column], line: Line<'_>, read: Read) -> Row {
    let asked =
        |column: &Column| Question { sets: &ADVERSARIAL, read, family: (column.key != AVERAGE).then_some(column.key) };
    // A family that the study does not have is no zero.
    let has = |column: &Column| column.key == AVERAGE || record.opening.families.iter().any(|of| of == column.key);
    let quantity = |column: &Column| match line.arms.as_slice() {
        _ if !has(column) => Vec::new(),
        [] => reference(record, &line.label, asked(column)),
        [arm, other] => difference(record, [arm, other], asked(column)),
        _ => last(record, &line.label, asked(column)),
    };
    let quantities: Vec<_> = columns.iter().map(quantity).collect();
    let paper = PAPER.iter().find(|(arm, of, _)| *arm == line.label && *of == read).map(|(_, _, figures)| figures);
    let cell = |((place, column), ours): ((usize, &Column), Option<Estimate>)| Cell {
        column: Column { form: line.form, ..*column },
        source: Source::ELSEWHERE,
        ours: ours.filter(|_| has(column)).map(|own| line.form.bounded(own)),
        paper: paper.and_then(|figures| figures.get(place).copied()),
    };
    let cells = columns.iter().enumerate().zip(estimates(&quantities)).map(cell).collect();
    let metric = METRICS.iter().find(|(of, ..)| *of == read).map_or("", |(_, name, _)| *name);
    line.row(record, Some(metric), cells)
}
