//! Results of a program on scenes of any pool: the scenes without a program, the parent that it descends from, the program,
//! and what it adds to its parent. Numbers and intervals are those of the paper's tables.

use std::collections::BTreeMap;

use super::archives::{Archived, Round, Scores};
use super::contacts;
use super::key::RowKey;
use super::labels::{self, Labels};
use super::layout::{Cell, Column, Form, Head, Numbers, Part, REPLAY, Row, Table};
use super::metadrive::{SCENES, estimated};
use super::notes;
use super::resampled::Resampled;
use crate::evaluation::Group;
use crate::evidence::realism::Realisms;
use crate::kernel::Digest;
use crate::objects::benchmark::{BenchmarkRow, SafebenchRun};
use crate::objects::replay::{ReplayScene, Replayed};
use crate::objects::{SceneScore, Score};
use crate::statistics::bootstrap::{self, Estimate, PerScene, Quantity, Search};

/// Results of one program.
#[derive(Clone, Copy)]
pub struct Played<'a> {
    pub name: &'a str,
    /// Kinds of the models that it came from; `none` for a published parent.
    pub proposals: &'a str,
    pub score: &'a Score,
    /// Its runs in SafeBench's protocol, and the scenes that could not be run; empty in the other.
    pub runs: &'a BTreeMap<Group, Vec<SafebenchRun>>,
    pub failures: &'a BTreeMap<Group, usize>,
}

/// All that was played on one list of scenes against one ego.
#[derive(Clone, Copy)]
pub struct Applied<'a> {
    /// Digest of the pool.
    pub pool: Digest,
    /// Ids of the scenes that were asked for.
    pub scenes: &'a [String],
    pub replay: &'a Replayed,
    pub parent: Played<'a>,
    pub program: Played<'a>,
}

const fn column(key: &'static str, head: &'static str, upward: Option<bool>, form: Form) -> Column {
    Column { key, group: "", head, upward, form }
}

const ATTACK: Column = column("attack", "Attack", Some(true), Form::Rate);
const ANY: Column = column("any_contact", "Any crash", None, Form::Rate);
const REALISM: Column = column("realism", "Realism", Some(true), Form::Rate);
const STRICT: Column = column("strict_realism", "Strict realism", Some(true), Form::Rate);
const FAILS: Column = column("fails", "Fails", Some(false), Form::Rate);
const PENALTY: Column = column("rp_pct", "RP", Some(false), Form::Percent);
const COVERAGE: Column = column("coverage", "Coverage", Some(true), Form::Rate);
const LOOKS: Column = column("search_rollouts", "Rollouts", None, Form::Rate);
const CR: Column = column("cr", "CR", Some(true), Form::Rate);
const OS: Column = column("os", "OS", Some(false), Form::Rate);
const ARS: Column = column("ars", "ARS", Some(true), Form::Rate);

const PROGRAM: Head = Head { key: "program", head: "Program" };
const ACTED: Head = Head { key: "acted", head: "Acted in" };
/// Label of the last row.
const DIFFERENCE: &str = "program - parent";

/// A rate of SafeBench's protocol.
type Rate = fn(&BenchmarkRow) -> f64;
const RATES: [(Column, Rate); 4] = [
    (ATTACK, |row| row.attack),
    (CR, |row| row.collision_rate),
    (OS, |row| row.overall_score),
    (ARS, |row| row.realism),
];

/// The table of outcomes and the table of contacts.
pub fn applied(of: &Applied<'_>) -> [Table; 2] {
    let staged = !of.program.runs.is_empty();
    let mut outcomes = if staged {
        RATES.map(|(column, _)| column).into_iter().chain([ANY, COVERAGE]).collect()
    } else {
        vec![ATTACK, ANY, REALISM, STRICT, FAILS, PENALTY, COVERAGE]
    };
    let mut numbers = if staged { staged_numbers(of) } else { recorded_numbers(of) };
    per_scene(of, &[(ANY, labels::ANY_CONTACT.of), (COVERAGE, labels::ACTED.of)], &mut numbers);
    let looks = values(of, &of.program, labels::LOOKS.of).values.iter().any(Option::is_some);
    if looks {
        outcomes.push(LOOKS);
        per_scene(of, &[(LOOKS, labels::LOOKS.of)], &mut numbers);
    }
    numbers[0].extend(replayed(of, ANY, |scene| Some(labels::share(scene.contact))));
    numbers[0].insert(COVERAGE.key, Estimate::plain(0.0));
    // The other table has the two of them that stand for outcomes.
    let told_above = ["attack", "rp_all_pct"];
    let readings = contacts::readings().into_iter().filter(|(column, ..)| !told_above.contains(&column.key));
    let readings: Vec<_> = readings.map(|(column, read, _)| (column, move |scene: &SceneScore| read(scene))).collect();
    let columns: Vec<Column> = readings.iter().map(|(column, _)| *column).collect();
    let mut met: [Numbers; 4] = Default::default();
    per_scene(of, &readings, &mut met);
    met[0].extend(replayed(of, ANY, |scene| Some(labels::share(scene.contact))));
    [
        table("applied", "Outcomes", of, &outcomes, &numbers, notes(staged, looks)),
        table("applied-contacts", "Contacts", of, &columns, &met, vec![contacts_note()]),
    ]
}

/// Rows replay, parent, program, difference.
fn table(
    name: &'static str,
    title: &str,
    of: &Applied<'_>,
    columns: &[Column],
    numbers: &[Numbers; 4],
    mut notes: Vec<String>,
) -> Table {
    let labelled = |played: &Played<'_>| played.score.scenes.len();
    let acted = |played: &Played<'_>| played.score.scenes.iter().filter(|scene| scene.acted).count();
    let both = paired(of, labels::ACTED_REALISM.of).values.iter().flatten().count();
    let shared = paired(of, labels::ACTED.of).values.iter().flatten().count();
    let heads = [
        (REPLAY, "none", [of.replay.scenes.len(), 0]),
        (of.parent.name, of.parent.proposals, [labelled(&of.parent), acted(&of.parent)]),
        (of.program.name, of.program.proposals, [labelled(&of.program), acted(&of.program)]),
        (DIFFERENCE, of.program.proposals, [shared, both]),
    ];
    let changes: Vec<Column> = columns.iter().map(|column| Column { form: changed(column.form), ..*column }).collect();
    let row = |((label, proposals, counts), numbers): (&(&str, &str, [usize; 2]), &Numbers)| Row {
        key: RowKey::Elsewhere,
        labels: vec![label.to_string()],
        lineages: vec![label.to_string()],
        cells: Cell::row(if *label == DIFFERENCE { &changes } else { columns }, numbers),
        counts: counts.to_vec(),
        proposals: proposals.to_string(),
        notes: Vec::new(),
    };
    let rows: Vec<Row> = heads.iter().zip(numbers).map(row).collect();
    // Of the scores of SafeBench's protocol none is a share of scenes, nor is a realism.
    let scores = [REALISM, STRICT, CR, OS, ARS];
    let staged = columns.contains(&CR);
    let is_share =
        |column: &Column| column.form == Form::Rate && !scores.contains(column) && !(staged && *column == ATTACK);
    notes.extend(notes::all_alike(rows.get(1..3).unwrap_or_default(), 0, is_share));
    Table {
        name,
        labels: vec![PROGRAM],
        columns: columns.to_vec(),
        counts: vec![SCENES_PLAYED, ACTED],
        parts: vec![Part { name: name.into(), title: title.into(), source: None, rows }],
        runs: Vec::new(),
        notes,
    }
}

const SCENES_PLAYED: Head = Head { key: "scenes", ..SCENES };

/// Returns the form of the difference of two such numbers.
fn changed(form: Form) -> Form {
    match form {
        Form::Percent => Form::Points,
        Form::Rate => Form::RateChange,
        other => other,
    }
}

/// The numbers of the MetaDrive protocol, by row.
fn recorded_numbers(of: &Applied<'_>) -> [Numbers; 4] {
    let mut numbers: [Numbers; 4] = Default::default();
    let read = [
        (ATTACK, labels::ATTACK),
        (REALISM, labels::ACTED_REALISM),
        (FAILS, labels::FAILS),
        (PENALTY, labels::PENALTY_PCT),
    ]
    .map(|(column, reading)| (column, reading.of));
    per_scene(of, &read, &mut numbers);
    let [before, after] = [of.parent, of.program].map(|played| Realisms::of(played.score).strict_realism);
    let change = before.zip(after).map(|(before, after)| after - before);
    for (numbers, strict) in numbers[1..].iter_mut().zip([before, after, change]) {
        numbers.extend(strict.map(|value| (STRICT.key, Estimate::plain(value))));
    }
    let rules = &of.program.score.rules;
    if rules.counts_any_contact() {
        numbers[0].extend(replayed(of, ATTACK, |scene| Some(scene.attack(rules))));
    } else {
        numbers[0].insert(ATTACK.key, Estimate::plain(0.0));
    }
    numbers[0].extend(replayed(of, REALISM, |scene| scene.realism));
    numbers[0].extend(replayed(of, PENALTY, |scene| Some(100.0 * (1.0 - scene.realism?))));
    numbers
}

/// The rates of SafeBench's protocol, by row; intervals are drawn over groups, those of parent and program together.
fn staged_numbers(of: &Applied<'_>) -> [Numbers; 4] {
    let round = |played: &Played<'_>| Round { runs: played.runs.clone(), failures: played.failures.clone() };
    let (rounds, none) = ([round(&of.parent), round(&of.program)], BTreeMap::new());
    let archived = Archived { rounds: &rounds, gains_pct: &none, redrawn: &[], redrawn_gains_pct: &none };
    let resampled = Resampled::new(&[archived]);
    let mut numbers: [Numbers; 4] = Default::default();
    for (column, rate) in RATES {
        let of_round = |scores: &Scores, k: usize| Some(rate(&scores.rounds.get(k)?.as_ref()?.mean));
        let replayed = [
            of.replay.row.benchmark.as_ref().map(|row| Estimate::plain(rate(row))),
            resampled.estimate(|scores| of_round(scores, 0)),
            resampled.estimate(|scores| of_round(scores, 1)),
            resampled.estimate(|scores| Some(of_round(scores, 1)? - of_round(scores, 0)?)),
        ];
        for (numbers, estimate) in numbers.iter_mut().zip(replayed) {
            numbers.extend(estimate.map(|estimate| (column.key, estimate)));
        }
    }
    numbers
}

/// Adds readings of parent and program and their differences, all from the same draws of scenes.
fn per_scene<R: Fn(&SceneScore) -> Option<f64>>(
    of: &Applied<'_>,
    readings: &[(Column, R)],
    numbers: &mut [Numbers; 4],
) {
    let by_row: [&dyn Fn(&R) -> PerScene; 3] =
        [&|read| values(of, &of.parent, read), &|read| values(of, &of.program, read), &|read| paired(of, read)];
    for (numbers, quantity) in numbers[1..].iter_mut().zip(by_row) {
        let quantities: Vec<(Column, Quantity)> =
            readings.iter().map(|(column, read)| (*column, once(quantity(read)))).collect();
        numbers.extend(estimated(&quantities));
    }
}

fn replayed(of: &Applied<'_>, column: Column, value: impl Fn(&ReplayScene) -> Option<f64>) -> Numbers {
    let replayed = |id: &String| of.replay.scenes.iter().find(|scene| scene.scene == *id);
    let values = of.scenes.iter().map(|id| value(replayed(id)?)).collect();
    estimated(&[(column, once(PerScene { suite: suite(of), values }))])
}

fn values(of: &Applied<'_>, played: &Played<'_>, read: impl Fn(&SceneScore) -> Option<f64>) -> PerScene {
    PerScene { suite: suite(of), values: Labels::of(played.score, of.scenes).values(read) }
}

/// Program minus parent, on the scenes that count for both.
fn paired(of: &Applied<'_>, read: impl Fn(&SceneScore) -> Option<f64>) -> PerScene {
    let (before, after) = (values(of, &of.parent, &read).values, values(of, &of.program, &read).values);
    let difference = |(before, after): (Option<f64>, Option<f64>)| Some(after? - before?);
    PerScene { suite: suite(of), values: before.into_iter().zip(after).map(difference).collect() }
}

/// One search without repetition.
fn once(part: PerScene) -> Quantity {
    vec![Search { id: part.suite, seeds: vec![part] }]
}

/// Returns the digest of the scenes, by which the streams of the bootstrap are named.
fn suite(of: &Applied<'_>) -> Digest {
    Digest::of_bytes(format!("{} {}", of.pool, of.scenes.join("\n")).as_bytes())
}

fn notes(staged: bool, looks: bool) -> Vec<String> {
    let labels = if staged {
        "CR: collision rate; OS: SafeBench's overall score, lower is the stronger scenario; ARS: adversarial realism score; \
             Attack = CR (1 - OS). Intervals of these four are drawn over groups of family and route, the others over scenes."
    } else {
        "Attack: share of scenes in which the ego fails by a contact with an adversary that the program's experiment counts. \
             Realism: mean over the scenes that the program acts in, for the replay that of the recorded traffic itself; RP = \
             100 (1 - realism). Strict realism: the smaller one of that and the mean over the program's successes, which the search \
             uses; it has no interval, and its difference is that of the two numbers."
    };
    let rehearsed = looks.then(|| {
        "Rollouts: mean over scenes of the rollouts against the ego before the program chose; a parent without has none."
            .to_string()
    });
    let mut all = vec![
        labels.to_string(),
        "Any crash: share in which the ego meets anyone; what the replay shows, the ego runs into anyway. Coverage: share of \
         scenes that the program acts in."
            .to_string(),
        format!(
            "In brackets: 95 % percentile bootstrap intervals, {} resamples, seed {}; the last row is paired by scene, in \
             realism and RP over the scenes that both act in. They cover these scenes and this one program: what another seed of \
             its search would give is not in them and may differ by more.",
            bootstrap::RESAMPLES,
            bootstrap::SEED.0
        ),
    ];
    all.extend(rehearsed);
    all
}

fn contacts_note() -> String {
    "Shares of scenes. By class: contacts with an adversary of the program, which add up to Adversary.".to_string()
}
