//! The table: a row an arm, then a row a pair of arms.

use super::found::{ADVERSARIAL, Quantity, Question, Read, difference, last, reference};
use crate::evidence::tables::{
    Cell, Column, Estimate, Form, Head, Part, RESAMPLES, Row, RowKey, Source, Table, estimates,
};
use crate::objects::downstream::{Downstream, SetName, Trained};

/// A column and what is read for it.
struct Shown {
    column: Column,
    sets: &'static [SetName],
    read: Read,
}

impl Shown {
    fn asked(&self) -> Question<'static> {
        Question { sets: self.sets, read: self.read, family: None }
    }
}

const fn shown(
    key: &'static str,
    group: &'static str,
    head: &'static str,
    sets: &'static [SetName],
    read: Read,
) -> Shown {
    let upward = Some(!matches!(read, Read::Crash | Read::Failure));
    Shown { column: Column { key, group, head, upward, form: Form::Rate }, sets, read }
}

const COLUMNS: [Shown; 7] = [
    shown("crash_adversarial", "Adversarial", "crash rate", &ADVERSARIAL, Read::Crash),
    shown("failure_adversarial", "Adversarial", "own crashes", &ADVERSARIAL, Read::Failure),
    shown("completion_adversarial", "Adversarial", "route completion", &ADVERSARIAL, Read::Completion),
    shown("crash_original", "Original", "crash rate", &[SetName::Original], Read::Crash),
    shown("crash_evolved", "Evolved", "crash rate", &[SetName::Evolved], Read::Crash),
    shown("crash_plain", "Plain", "crash rate", &[SetName::Plain], Read::Crash),
    shown("completion_plain", "Plain", "route completion", &[SetName::Plain], Read::Completion),
];

/// The label that the paper gives the same question.
const LABEL: &str = "fig:sac-adv-bmt";

/// The pairs that are compared: later arms with earlier ones, so the study's order says what is compared with what.
pub fn pairs(record: &Downstream) -> Vec<[&str; 2]> {
    let arms: Vec<&str> = record.opening.arms.iter().map(|(name, _)| name.as_str()).collect();
    let before = |i: usize| arms[..i].iter().copied();
    arms.iter().enumerate().flat_map(|(i, arm)| before(i).map(|before| [*arm, before]).collect::<Vec<_>>()).collect()
}

/// The table of a record whose arms train one ego for all scenes.
pub fn of_arms(record: &Downstream) -> Table {
    let opening = &record.opening;
    let of_arms = opening.arms.iter().map(|(arm, _)| arm_row(record, arm)).collect();
    let of_references = opening.references.iter().map(|known| reference_row(record, &known.driver)).collect();
    let pairs = pairs(record);
    let of_pairs = pairs.iter().map(|pair| pair_row(record, *pair)).collect();
    let part = |name: &str, title: String, rows| Part { name: name.into(), title, source: Some(LABEL), rows };
    Table {
        name: "downstream",
        labels: vec![Head { key: "arm", head: "Trained on" }],
        columns: COLUMNS.iter().map(|shown| shown.column).collect(),
        counts: vec![Head { key: "trainings", head: "Trainings" }, Head { key: "scenes", head: "Scenes" }],
        parts: vec![
            part("arms", format!("{}: after {} updates", opening.describes, opening.updates), of_arms),
            part("references", "Not trained".into(), of_references),
            part("pairs", "Differences, paired by seed and scene".into(), of_pairs),
        ],
        runs: Vec::new(),
        notes: notes(record, &pairs),
    }
}

/// A row before its cells.
pub struct Line<'l> {
    pub label: String,
    /// One arm, or the two that are compared; none of a driver that was not trained.
    pub arms: Vec<&'l str>,
    pub form: Form,
}

impl Line<'_> {
    /// The row with these cells, under a metric where the table has several; its lineages are the trainings behind it with the weights that came of them.
    pub fn row(self, record: &Downstream, metric: Option<&str>, cells: Vec<Cell>) -> Row {
        let own = record.trainings.iter().filter(|trained| self.arms.contains(&trained.arm.as_str()));
        let weights = |of: &Trained| {
            let family = of.family.as_ref().map_or(String::new(), |family| format!("{family}-"));
            format!("{family}{}-s{}:{}", of.arm, of.seed, of.weights.short(12))
        };
        // A row without lineages is not printed.
        let lineages: Vec<String> =
            if self.arms.is_empty() { vec![self.label.clone()] } else { own.map(weights).collect() };
        let trainings = if self.arms.is_empty() { 0 } else { lineages.len() };
        let scenes = record.opening.sets.evaluation.first().map_or(0, |set| set.scenes.len());
        Row {
            key: RowKey::Elsewhere,
            labels: [Some(self.label), metric.map(String::from)].into_iter().flatten().collect(),
            counts: vec![trainings, scenes],
            lineages,
            cells,
            proposals: record.opening.proposals.clone(),
            notes: Vec::new(),
        }
    }
}

fn cells(quantities: &[Quantity], form: Form) -> Vec<Cell> {
    let cell = |(shown, ours): (&Shown, Option<Estimate>)| Cell {
        column: Column { form, ..shown.column },
        source: Source::ELSEWHERE,
        ours: ours.map(|own| form.bounded(own)),
        paper: None,
    };
    COLUMNS.iter().zip(estimates(quantities)).map(cell).collect()
}

fn arm_row(record: &Downstream, arm: &str) -> Row {
    let quantities: Vec<Quantity> = COLUMNS.iter().map(|shown| last(record, arm, shown.asked())).collect();
    let line = Line { label: arm.to_string(), arms: vec![arm], form: Form::Rate };
    line.row(record, None, cells(&quantities, Form::Rate))
}

fn reference_row(record: &Downstream, driver: &str) -> Row {
    let quantities: Vec<Quantity> = COLUMNS.iter().map(|shown| reference(record, driver, shown.asked())).collect();
    let line = Line { label: driver.to_string(), arms: Vec::new(), form: Form::Rate };
    line.row(record, None, cells(&quantities, Form::Rate))
}

fn pair_row(record: &Downstream, pair: [&str; 2]) -> Row {
    let quantities: Vec<Quantity> = COLUMNS.iter().map(|shown| difference(record, pair, shown.asked())).collect();
    let line = Line { label: format!("{} less {}", pair[0], pair[1]), arms: pair.to_vec(), form: Form::RateChange };
    line.row(record, None, cells(&quantities, Form::RateChange))
}

/// Returns the notes under the table.
pub fn notes(record: &Downstream, pairs: &[[&str; 2]]) -> Vec<String> {
    let opening = &record.opening;
    let sets = |of: &[SetName]| of.iter().map(|set| set.name()).collect::<Vec<_>>().join(" and ");
    let arms: Vec<String> = opening.arms.iter().map(|(name, of)| format!("{name} on {}", sets(of))).collect();
    let count = |name| opening.sets.training.iter().find(|set| set.name == name).map_or(0, |set| set.scenes.len());
    let begins = match opening.plain_updates {
        0 => "begins with the same weights where the seed is the same".to_string(),
        plain => format!(
            "goes on from the same training where the seed is the same: {plain} updates on the plain scenes of all families"
        ),
    };
    let of_families = match opening.families.len() {
        0 => String::new(),
        families => format!(
            " An ego is trained for each of {families} traffic families, on scenes of that family, and examined on its scenes; sizes are of \
             all families together. The overall score is the mean of the scores of single runs."
        ),
    };
    let mut notes = vec![
        format!(
            "Arms are trained on these sets of {} scenes each: {}. Original and evolved are the plain scenes as the parent and as the \
             evolved program play them; benign are as many other scenes without a program. Every arm makes {} updates and {begins}.{of_families}",
            count(SetName::Plain),
            arms.join("; "),
            opening.updates
        ),
        format!("Generators: the parent and {}.", opening.generator),
        format!(
            "Crash: contact with anyone, whoever caused it; an own crash is one that the ego caused or could have avoided (docs/OBJECTIVES.md). \
             Adversarial: the mean of both generators' sets. In brackets 95 % intervals: \
             Student's t over seeds and {RESAMPLES} draws of scenes; they are not corrected for the number of comparisons."
        ),
    ];
    notes.extend(pairs.iter().map(|pair| verdict(record, *pair)));
    notes
}

/// Says what the study shows of a pair: crashes in adversarial scenes, and the way driven there and in plain ones, since an ego that
/// stands seldom crashes.
fn verdict(record: &Downstream, pair: [&str; 2]) -> String {
    let way = if record.opening.families.is_empty() { Read::Completion } else { Read::Score };
    let side = |sets: &[SetName], read: Read, words: [&str; 3]| {
        let asked = Question { sets, read, family: None };
        let estimated = estimates(&[difference(record, pair, asked)]).into_iter().next().flatten();
        match estimated.and_then(|estimated| estimated.interval) {
            Some([_, high]) if high < 0.0 => words[0],
            Some([low, _]) if low > 0.0 => words[2],
            _ => words[1],
        }
        .to_string()
    };
    let ways = match way {
        Read::Score => ["scores lower", "score undecided", "scores higher"],
        _ => ["drives less of its route", "way undecided", "drives more of its route"],
    };
    format!(
        "{} against {}: {} and {} in adversarial scenes; {} in plain ones.",
        pair[0],
        pair[1],
        side(&ADVERSARIAL, Read::Crash, ["crashes less", "crashes undecided", "crashes more"]),
        side(&ADVERSARIAL, way, ways),
        side(&[SetName::Plain], way, ways)
    )
}
