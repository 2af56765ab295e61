//! The SafeBench tables: what balanced selection keeps of the parent's scenes against what it keeps after the last round,
//! and every round by traffic family.

use std::collections::BTreeSet;

use super::archives::{LineageArchive, Round, Scores};
use super::basis::{Combine, Derivation, Leaf, Repetition, Selected};
use super::derivations::{Derivations, Source};
use super::error::TableError;
use super::key::{Of, RowKey};
use super::layout::{Cell, Column, Form, Head, METHOD, POLICY, Part, REPLAY, ROLLOUTS, Row, Table};
use super::notes;
use super::paper::{
    self, Figures,
    safebench::{AVERAGE, EGO, MAIN_LABEL, METHODS, Method, ROUNDS},
};
use super::resampled::Resampled;
use super::searches::{searches, stops};
use crate::evaluation::{Group, group_name};
use crate::evidence::recorded_run::RecordedRun;
use crate::kernel::num;
use crate::objects::benchmark::{ArchiveRound, Benchmark, BenchmarkRow, SelectedScene};
use crate::objects::replay::{ReplayRow, Replayed, Suite};
use crate::scene::safebench::TrafficFamily;

const GROUPS: Head = Head { key: "groups", head: "Groups" };
const SCENES: Head = Head { key: "scenes", head: "Scenes" };
const SEEDS: Head = Head { key: "seeds", head: "Seeds" };
pub(super) const COUNTS: [Head; 4] = [GROUPS, SCENES, SEEDS, ROLLOUTS];

/// A rate of the tables, read off a row of the recorded scores.
#[derive(Clone, Copy)]
pub(super) struct Metric {
    name: &'static str,
    upward: Option<bool>,
    of: fn(&BenchmarkRow) -> Option<f64>,
}

const ATTACK: Metric = Metric { name: "Attack", upward: Some(true), of: |row| Some(row.attack) };
const ARS: Metric = Metric { name: "ARS", upward: Some(true), of: |row| Some(row.realism) };
const CR: Metric = Metric { name: "CR", upward: Some(true), of: |row| Some(row.collision_rate) };
const OS: Metric = Metric { name: "OS", upward: Some(false), of: |row| Some(row.overall_score) };
/// Scenarios simulated before one was chosen.
const LOOKS: Metric = Metric { name: "Rollouts a scene", upward: None, of: |row| row.search_rollouts };

/// Runs that balanced selection keeps, by whose they are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kept {
    /// The search's.
    Evolved,
    /// The parent's, drawn as often.
    Redrawn,
    /// The first less the second.
    Change,
}

/// Runs to look at, and the round after which; `None` is the last round.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) struct Look {
    pub kept: Kept,
    pub round: Option<usize>,
}
pub(super) const PARENT: Look = Look { kept: Kept::Evolved, round: Some(0) };
const DRAWN: Look = Look { kept: Kept::Redrawn, round: None };
pub(super) const EVOLVED: Look = Look { kept: Kept::Evolved, round: None };
const CHANGE: Look = Look { kept: Kept::Change, round: None };

/// A column of the main table.
#[derive(Clone, Copy)]
pub(super) struct Main {
    pub column: Column,
    pub look: Look,
    pub what: What,
}

#[derive(Clone, Copy)]
pub(super) enum What {
    Rate(Metric),
    /// A mean over groups, and what of.
    Gain(fn(&Scores) -> Option<f64>, &'static str),
}

impl Main {
    /// Its number of one repetition's scores.
    pub(super) fn number(self, scores: &Scores) -> Option<f64> {
        match self.what {
            What::Rate(metric) => rate(metric, self.look, AVERAGE, self.column.form, scores),
            What::Gain(of, _) => of(scores),
        }
    }

    pub(super) fn is_gain(self) -> bool {
        matches!(self.what, What::Gain(..))
    }
}

/// A rate of a family, or over all, of one repetition's scores; a change is in the unit of its form.
fn rate(metric: Metric, look: Look, family: &str, form: Form, scores: &Scores) -> Option<f64> {
    let rate = |rounds: &[Option<Benchmark>]| {
        let scores = look.round.map_or(rounds.last(), |round| rounds.get(round))?.as_ref()?;
        (metric.of)(if family == AVERAGE { &scores.mean } else { scores.families.get(family)? })
    };
    let (before, after) = match look.kept {
        Kept::Evolved => return rate(&scores.rounds),
        Kept::Redrawn => return rate(&scores.redrawn),
        Kept::Change => (rate(&scores.redrawn)?, rate(&scores.rounds)?),
    };
    match form {
        Form::Gain => (before > 0.0).then(|| 100.0 * (after - before) / before),
        Form::Points => Some(100.0 * (after - before)),
        _ => Some(after - before),
    }
}

/// The paper's main table: a row a generator and ego.
pub fn safebench_main(runs: &[RecordedRun]) -> Result<Table, TableError> {
    let bases = Derivations::of(runs);
    let all = bases.archives()?;
    let columns = told_columns(all);
    let row = |of: &Subject<'_>| {
        let (resampled, figures) = (of.resampled(), of.printed.map(Method::main_figures));
        let cell = |of: &Main| main_cell(*of, resampled.as_ref(), figures.as_ref());
        of.row(&[], columns.iter().map(cell).collect())
    };
    let heads: Vec<Column> = columns.iter().map(|of| of.column).collect();
    let replays =
        replays(runs).into_iter().map(|(run, replay)| replay_row(&bases, run, replay, &[], &heads, &OF_PARENT));
    let rows: Vec<Row> = replays.chain(in_order(all).iter().map(row)).collect();
    let notes = notes(runs, all).into_iter().chain(saturated(&rows, all)).chain(searched_more(&rows)).collect();
    let title = "Generator evolution on SafeBench's traffic families".to_string();
    Ok(Table {
        name: "safebench-main",
        labels: vec![METHOD, POLICY],
        columns: heads,
        counts: COUNTS.to_vec(),
        parts: vec![Part { name: "safebench-main".into(), title, source: Some(MAIN_LABEL), rows }],
        runs: notes::runs(runs)?,
        notes,
    })
}

/// A cell whose number is of a repetition's scores: this one function gives it, its interval, and what each repetition has.
pub(super) fn scored(
    column: Column,
    number: impl Fn(&Scores) -> Option<f64> + Send + Sync + 'static,
    resampled: Option<&Resampled>,
    figures: Option<&Figures>,
    derive: impl Fn(&Derivations<'_>, &RowKey, &dyn Fn(&Scores) -> Option<f64>) -> Derivation + Send + Sync + 'static,
) -> Cell {
    let ours = resampled.and_then(|resampled| resampled.estimate(&number));
    Cell::new(column, &Source::of(move |bases, row| Some(derive(bases, row, &number))), ours, figures)
}

fn main_cell(of: Main, resampled: Option<&Resampled>, figures: Option<&Figures>) -> Cell {
    let number = move |scores: &Scores| of.number(scores);
    scored(of.column, number, resampled, figures, move |bases, row, number| match of.what {
        What::Gain(_, what) => gains(bases, row, number, what),
        What::Rate(_) => kept(bases, row, number, of.look, AVERAGE, &format!("{},", of.column.key)),
    })
}

/// The archives of a row's lineages.
pub(super) fn archives_of<'a>(
    all: Result<&'a Vec<LineageArchive>, TableError>,
    row: &RowKey,
) -> impl Iterator<Item = &'a LineageArchive> {
    all.into_iter().flatten().filter(|archive| row.has(archive.place, &archive.lineage))
}

/// A number of the archive's rounds, which is of the selected runs of a family, or of all, together.
fn kept(
    bases: &Derivations<'_>,
    row: &RowKey,
    number: &dyn Fn(&Scores) -> Option<f64>,
    look: Look,
    family: &str,
    what: &str,
) -> Derivation {
    let part = |archive: &LineageArchive| -> Option<Repetition> {
        let (run, _) = bases.result(archive.place, &archive.lineage)?;
        let round = look.round.unwrap_or(archive.rounds.len().saturating_sub(1));
        let leaves_of = |whose: Kept, rounds: Vec<&ArchiveRound>, drawn: &str| -> Vec<Leaf> {
            let read =
                rounds.into_iter().filter(|r| r.round as usize == round && [whose, Kept::Change].contains(&look.kept));
            let own = |scene: &&SelectedScene| family == AVERAGE || scene.group.split('/').next() == Some(family);
            let leaf = |r: &ArchiveRound, scene: &SelectedScene| Leaf {
                selected: Some(Selected { round: r.round, run: scene.run }),
                note: Some(format!(
                    "{} after round {}{drawn}: attack {:.3}, ARS {:.3}",
                    scene.group, r.round, scene.attack, scene.realism
                )),
                ..Leaf::scene(&scene.scene, std::slice::from_ref(&scene.solution), None)
            };
            read.flat_map(|r| r.selected.iter().filter(own).map(move |scene| leaf(r, scene))).collect()
        };
        let evolved = run.rounds.iter().filter(|r| r.lineage == archive.lineage).collect();
        let redrawn = run.redrawn.iter().filter(|of| of.lineage == archive.lineage).flat_map(|of| &of.rounds).collect();
        let leaves = [leaves_of(Kept::Evolved, evolved, ""), leaves_of(Kept::Redrawn, redrawn, ", the parent redrawn")];
        Some(archive.part(number(&archive.scores()), leaves.concat()))
    };
    let parts = archives_of(bases.archives(), row).filter_map(part).collect();
    let formula = format!(
        "mean over repetitions of {what} of all runs that balanced selection keeps, families weighing alike (docs/OBJECTIVES.md)"
    );
    Derivation::of(formula, Combine::MeansOfAll, parts)
}

/// PF-Area@3: the mean over groups of what one group has.
fn gains(bases: &Derivations<'_>, row: &RowKey, number: &dyn Fn(&Scores) -> Option<f64>, what: &str) -> Derivation {
    let part = |archive: &LineageArchive| {
        let leaf = |group: &Group| Leaf::scene(&group_name(*group), &[], number(&archive.archived().scores(&[*group])));
        archive.part(number(&archive.scores()), archive.gains_pct.keys().map(leaf).collect())
    };
    let parts = archives_of(bases.archives(), row).map(part).collect();
    Derivation::of(format!("mean over repetitions of the mean over groups of the {what}"), Combine::Means, parts)
}

/// A collision rate from which a row is called saturated.
const SATURATED: f64 = 0.95;

const fn main(key: &'static str, look: Look, metric: Metric, form: Form) -> Main {
    let group = match (look.kept, look.round) {
        (Kept::Evolved, Some(_)) => "Parent",
        (Kept::Evolved, None) => "Evolved",
        (Kept::Redrawn, _) => "Parent redrawn",
        (Kept::Change, _) => "Change",
    };
    let column = Column { key, group, head: metric.name, upward: metric.upward, form };
    Main { column, look, what: What::Rate(metric) }
}

const fn gain(of: fn(&Scores) -> Option<f64>, what: &'static str, of_column: Main) -> Main {
    let column = Column { head: "PF-Area@3", ..of_column.column };
    Main { column, what: What::Gain(of, what), ..of_column }
}

/// Columns of the main table.
const MAIN: [Main; 22] = [
    main("parent_attack", PARENT, ATTACK, Form::Rate),
    main("parent_ars", PARENT, ARS, Form::Rate),
    main("parent_cr", PARENT, CR, Form::Rate),
    main("parent_os", PARENT, OS, Form::Rate),
    main(SEARCHED[0], PARENT, LOOKS, Form::Number),
    main("redrawn_attack", DRAWN, ATTACK, Form::Rate),
    main("redrawn_ars", DRAWN, ARS, Form::Rate),
    main("redrawn_cr", DRAWN, CR, Form::Rate),
    main("redrawn_os", DRAWN, OS, Form::Rate),
    main(SEARCHED[1], DRAWN, LOOKS, Form::Number),
    gain(
        |of| of.redrawn_gain_pct,
        "frontier gain of the redrawn parent",
        main("redrawn_pf_area_at_3_pct", DRAWN, ATTACK, Form::Gain),
    ),
    main("evolved_attack", EVOLVED, ATTACK, Form::Rate),
    main("evolved_ars", EVOLVED, ARS, Form::Rate),
    main("evolved_cr", EVOLVED, CR, Form::Rate),
    main("evolved_os", EVOLVED, OS, Form::Rate),
    main(SEARCHED[2], EVOLVED, LOOKS, Form::Number),
    gain(
        |of| of.gain_pct,
        "frontier gain, as sealed in the results",
        main("pf_area_at_3_pct", EVOLVED, ATTACK, Form::Gain),
    ),
    main("attack_change_pct", CHANGE, Metric { name: "Attack rel.", ..ATTACK }, Form::Gain),
    main("ars_change_pp", CHANGE, ARS, Form::Points),
    main("cr_change_pp", CHANGE, CR, Form::Points),
    main("os_change_pp", CHANGE, OS, Form::Points),
    gain(
        |of| Some(of.gain_pct? - of.redrawn_gain_pct?),
        "frontier gain, as sealed in the results, less that of the redrawn parent",
        main("pf_area_change_pp", CHANGE, ATTACK, Form::Points),
    ),
];

/// Returns the main columns, without the cost of searches where no run tells it.
pub(super) fn told_columns(all: &[LineageArchive]) -> Vec<Main> {
    let tells = |round: &Round| round.runs.values().flatten().any(|run| run.search_rollouts.is_some());
    let is_told = all.iter().any(|archive| archive.rounds.iter().any(tells));
    MAIN.into_iter().filter(|of| is_told || !SEARCHED.contains(&of.column.key)).collect()
}

/// Keys of what programs simulated against the ego, in the mean over the runs that are kept, before each run's scenario was chosen.
pub(super) const SEARCHED: [&str; 3] = ["parent_search_rollouts", "redrawn_search_rollouts", "evolved_search_rollouts"];

/// The metrics of the tables by round.
const LINES: [Metric; 3] = [CR, OS, ARS];

/// The evolution scenes without a program, an ego a row.
fn replays(runs: &[RecordedRun]) -> Vec<(usize, &ReplayRow)> {
    let mut estimated: Vec<(usize, &ReplayRow)> = Vec::new();
    let all = runs
        .iter()
        .enumerate()
        .flat_map(|(place, recorded)| recorded.replays.iter().map(move |replayed| (place, &replayed.row)));
    for (place, row) in all.filter(|(_, row)| row.suite == Suite::Evolution) {
        if !estimated.iter().any(|(_, known)| *known == row) {
            estimated.push((place, row));
        }
    }
    estimated
}

/// The columns of a parent that say something of a program that does nothing.
const OF_PARENT: [(&str, Metric); 4] =
    [("parent_attack", ATTACK), ("parent_ars", ARS), ("parent_cr", CR), ("parent_os", OS)];

/// The row of a program that does nothing, under these columns, with labels after the ego.
fn replay_row(
    bases: &Derivations<'_>,
    run: usize,
    replay: &ReplayRow,
    labels: &[&str],
    columns: &[Column],
    read: &[(&str, Metric)],
) -> Row {
    let sourced = |column: &Column| {
        let metric = read.iter().find(|(key, _)| *key == column.key).map(|(_, metric)| *metric);
        (*column, metric.map_or(Source::none(), |metric| Source::of(move |bases, row| replayed(bases, row, metric))))
    };
    let key = RowKey::Replay(vec![Of { run, of: replay.ego.clone() }]);
    let names = [REPLAY.to_string(), paper::policy(&replay.ego)];
    Row {
        labels: names.into_iter().chain(labels.iter().map(|label| label.to_string())).collect(),
        lineages: vec![format!("replay/{}", replay.ego)],
        cells: Cell::derived(bases, &key, &columns.iter().map(sourced).collect::<Vec<_>>(), None),
        key,
        counts: vec![0, replay.scenes, 1, replay.scenes],
        proposals: "none".into(),
        notes: Vec::new(),
    }
}

/// A number of the evolution scenes without a program, which is recorded as a whole.
fn replayed(bases: &Derivations<'_>, row: &RowKey, metric: Metric) -> Option<Derivation> {
    let Of { run, of: ego } = row.egos().first()?;
    let own = |replayed: &&Replayed| replayed.row.suite == Suite::Evolution && replayed.row.ego == *ego;
    let replayed = bases.runs.get(*run)?.replays.iter().find(own)?;
    let value = (metric.of)(replayed.row.benchmark.as_ref()?);
    let leaves = replayed.scenes.iter().map(|scene| Leaf::scene(&scene.scene, &[], None)).collect();
    let part = Repetition::of("replay".into(), *run, format!("replay/{ego}"), value, leaves);
    let formula = format!("{} of the empty program on the evolution scenes, recorded as a whole", metric.name);
    Some(Derivation::of(formula, Combine::Means, vec![part]))
}

/// The same for the tables by round: a line a metric, in the column of all families.
fn replay_part(bases: &Derivations<'_>) -> Option<Part> {
    let of_each = |(run, replay)| {
        LINES.map(|metric| replay_row(bases, run, replay, &[metric.name, "-"], &round_columns(), &[(AVERAGE, metric)]))
    };
    let rows: Vec<Row> = replays(bases.runs).into_iter().flat_map(of_each).collect();
    let title = "The evolution scenes without a program".to_string();
    (!rows.is_empty()).then(|| Part { name: "safebench-rounds-replay".into(), title, source: None, rows })
}

/// The paper's tables by round: a part a generator and ego, a line a metric and round, a column a traffic family.
pub fn safebench_rounds(runs: &[RecordedRun]) -> Result<Table, TableError> {
    let bases = Derivations::of(runs);
    let all = bases.archives()?;
    let part = |of: &Subject<'_>| {
        // A label of LaTeX is made of the search's plain name.
        let plain = of.seeds.first().map_or(of.name.as_str(), |archive| &archive.name);
        let (title, stem) = (of.method.map_or(of.name.as_str(), |m| m.title), plain.to_lowercase().replace('_', "-"));
        let (ego, ending) = match of.seeds.first() {
            Some(archive) => (format!(" with {}", archive.policy), format!("-{}", archive.ego)),
            None => Default::default(),
        };
        Part {
            name: format!("safebench-rounds-{stem}{ending}"),
            title: format!("{title}{ego}: results by traffic family and evolution round on SafeBench"),
            source: of.method.map(|method| method.rounds_label),
            rows: round_rows(of),
        }
    };
    Ok(Table {
        name: "safebench-rounds",
        labels: vec![METHOD, POLICY, Head { key: "metric", head: "Metric" }, Head { key: "round", head: "Round" }],
        columns: round_columns(),
        counts: COUNTS.to_vec(),
        parts: replay_part(&bases).into_iter().chain(in_order(all).iter().map(part)).collect(),
        runs: notes::runs(runs)?,
        notes: notes(runs, all),
    })
}

/// Heads as in the paper's tables.
pub(in crate::evidence) fn round_columns() -> Vec<Column> {
    let heads = [
        "Straight Obs.",
        "Turn. Obs.",
        "Lane Change",
        "Veh. Pass.",
        "Red-light",
        "Unprot. Left",
        "Right-turn",
        "Crossing",
    ];
    let families = TrafficFamily::ALL.into_iter().map(TrafficFamily::name).zip(heads);
    let column = |(key, head)| Column { key, group: "", head, upward: None, form: Form::Rate };
    families.chain([(AVERAGE, "Avg.")]).map(column).collect()
}

fn round_rows(of: &Subject<'_>) -> Vec<Row> {
    let resampled = of.resampled();
    let printed = if of.printed.is_some() { ROUNDS } else { 0 };
    let rounds = of.seeds.iter().map(|archive| archive.rounds.len()).max().unwrap_or(0).max(printed);
    let drawn = of.seeds.iter().map(|archive| archive.redrawn.len()).min().unwrap_or(0);
    let line = |metric: &Metric, round: usize, kept: Kept| {
        let figures = of.printed.and_then(|method| method.round_figures(metric.name, round));
        let figures = figures.filter(|_| kept == Kept::Evolved);
        let (called, form) = match kept {
            Kept::Evolved => (round.to_string(), Form::Rate),
            Kept::Redrawn => (format!("{round} redrawn"), Form::Rate),
            Kept::Change => (format!("{round} change"), Form::RateChange),
        };
        let cell = |column: Column| {
            let (metric, look, key) = (*metric, Look { kept, round: Some(round) }, column.key);
            let whose = match kept {
                Kept::Evolved => "",
                Kept::Redrawn => " of the redrawn parent",
                Kept::Change => " less that of the redrawn parent",
            };
            let number = move |scores: &Scores| rate(metric, look, key, form, scores);
            let column = Column { form, ..column };
            scored(column, number, resampled.as_ref(), figures.as_ref(), move |bases, row, number| {
                let what = format!("{} after round {round} in {key}{whose},", metric.name);
                self::kept(bases, row, number, look, key, &what)
            })
        };
        of.row(&[metric.name, &called], round_columns().into_iter().map(cell).collect())
    };
    let lines = |metric: &Metric| -> Vec<Row> {
        let evolved = (0..rounds).map(|round| line(metric, round, Kept::Evolved));
        // Before the first round nothing is redrawn.
        let redrawn = (1..drawn).map(|round| line(metric, round, Kept::Redrawn));
        let change = (drawn > 1).then(|| line(metric, drawn - 1, Kept::Change));
        evolved.chain(redrawn).chain(change).collect()
    };
    LINES.iter().flat_map(lines).collect()
}

/// Owner of a row or a part: a method of the paper with a search that fills it, or without, or a search alone.
pub(super) struct Subject<'a> {
    method: Option<&'static Method>,
    /// Method whose printed figures stand beside it: beside the paper's ego where that was run, else beside every ego.
    printed: Option<&'static Method>,
    name: String,
    /// The search's repetitions, one a seed; none = missing.
    pub(super) seeds: Vec<&'a LineageArchive>,
}

/// The paper's methods, then what else was run.
pub(super) fn in_order(all: &[LineageArchive]) -> Vec<Subject<'_>> {
    let mut order = Vec::new();
    for method in &METHODS {
        let of = searches(all.iter().filter(|archive| archive.method == Some(method)));
        let missing = of.is_empty().then(Vec::new);
        let papers =
            |seeds: &Vec<&LineageArchive>| seeds.iter().any(|archive| paper::policy_name(&archive.ego) == Some(EGO));
        let was_run = of.iter().any(papers);
        let subject = |seeds| {
            let printed = (!was_run || papers(&seeds)).then_some(method);
            Subject { method: Some(method), printed, name: method.name.into(), seeds }
        };
        order.extend(of.into_iter().chain(missing).map(subject));
    }
    let others = searches(all.iter().filter(|archive| archive.method.is_none()));
    order.extend(others.into_iter().map(|seeds| Subject {
        method: None,
        printed: None,
        name: seeds[0].label.clone(),
        seeds,
    }));
    order
}

impl Subject<'_> {
    /// Returns what intervals are drawn from; `None` where it is missing.
    pub(super) fn resampled(&self) -> Option<Resampled> {
        let archived = || self.seeds.iter().map(|archive| archive.archived()).collect::<Vec<_>>();
        (!self.seeds.is_empty()).then(|| Resampled::new(&archived()))
    }

    /// Returns the subject of its rows.
    pub(super) fn key(&self) -> RowKey {
        RowKey::Lineages(self.seeds.iter().map(|archive| archive.key()).collect())
    }

    /// A row of numbers, with labels after the method and the ego.
    pub(super) fn row(&self, labels: &[&str], cells: Vec<Cell>) -> Row {
        let policy = self.seeds.first().map_or(String::new(), |archive| archive.policy.clone());
        let groups: BTreeSet<_> = self.seeds.iter().flat_map(|archive| archive.groups()).collect();
        let sum = |of: fn(&LineageArchive) -> usize| self.seeds.iter().map(|archive| of(archive)).sum();
        Row {
            key: self.key(),
            labels: [self.name.clone(), policy].into_iter().chain(labels.iter().map(|l| l.to_string())).collect(),
            lineages: self.seeds.iter().map(|archive| archive.lineage.to_string()).collect(),
            cells,
            counts: vec![groups.len(), sum(LineageArchive::scenes), self.seeds.len(), sum(|archive| archive.rollouts)],
            proposals: self.seeds.first().map_or(String::new(), |archive| archive.proposals.clone()),
            notes: stops(&self.seeds).into_iter().collect(),
        }
    }
}

/// The rows in which nearly every selected run is a collision already: little of their attack is left to gain.
pub(super) fn saturated(rows: &[Row], all: &[LineageArchive]) -> Option<String> {
    let full = |row: &&Row| value(row, "evolved_cr").is_some_and(|rate| rate >= SATURATED);
    let named: Vec<String> = rows.iter().filter(full).map(|row| row.labels.join("/")).collect();
    let ceilings: Vec<String> = rows.iter().filter(full).filter_map(|row| at_ceiling(row, all)).collect();
    (!named.is_empty()).then(|| {
        format!(
            "Saturated: in {} the ego collides in nearly every run that is kept (CR at least {SATURATED}), so such rows tell programs apart \
             by the overall score and realism alone; look at safebench-held-out first. A group in which all that is kept of the parent, \
             drawn as often as the search drew, are collisions can show no gain: {}.",
            named.join(", "),
            ceilings.join(", ")
        )
    })
}

/// Our value in a column of a row.
fn value(row: &Row, key: &str) -> Option<f64> {
    let cell = row.cells.iter().find(|cell| cell.column.key == key)?;
    cell.ours.map(|own| own.value)
}

/// So many times the parent's looks at the ego are said.
const MORE_LOOKS: f64 = 1.5;

/// The rows whose programs look at the ego more often than the parent that they are held against: asking it more often gains by itself.
pub(super) fn searched_more(rows: &[Row]) -> Option<String> {
    let [parent, redrawn, evolved] = SEARCHED;
    let more = |row: &Row| {
        let (own, before) = (value(row, evolved)?, value(row, redrawn).or_else(|| value(row, parent))?);
        let text = || format!("{} {} for {}", row.labels.join("/"), num::fixed(own, 1), num::fixed(before, 1));
        (own >= MORE_LOOKS * before).then(text)
    };
    let named: Vec<String> = rows.iter().filter_map(more).collect();
    (!named.is_empty()).then(|| {
        format!(
            "More looks at the ego: some programs simulate more scenarios before one is chosen than the parent in their column of change, a scene: \
             {}. The same parent that may ask as often gains, too (docs/OBJECTIVES.md), and no column takes that off.",
            named.join(", ")
        )
    })
}

/// Says in how many of a row's groups every kept run of the compared program is a collision.
fn at_ceiling(row: &Row, all: &[LineageArchive]) -> Option<String> {
    let own: Vec<&LineageArchive> = all.iter().filter(|of| row.lineages.contains(&of.lineage.to_string())).collect();
    let (mut full, mut groups) = (0, 0);
    for archive in own {
        let before = archive.redrawn.last().or(archive.rounds.first())?;
        full += before.runs.values().filter(|runs| runs.iter().all(|run| run.run.collision)).count();
        groups += archive.groups().len();
    }
    Some(format!("{} {full} of {groups}", row.labels.join("/")))
}

/// Returns the notes that a reader needs beside the numbers.
fn notes(runs: &[RecordedRun], all: &[LineageArchive]) -> Vec<String> {
    let mut notes = vec![
        "CR: collision rate; OS: SafeBench's overall score, lower is the stronger scenario; ARS: adversarial realism score. \
         Attack = CR (1 - OS) of the means over the eight traffic families. Rows: AS is AdvSim, AT SafeBench's port of \
         adversarial trajectories, CS ChatScene, Human the benchmark's own parameter grid."
            .to_string(),
        "Parent is what balanced selection keeps of the parent's scenes (round 0), Evolved what it keeps of all scenes up to \
         the last round, the same number for each group of family and route. The best few of many runs are ahead of all runs of a \
         parent whatever made them. So the parent is redrawn: it takes the place of every program that was labelled, on the same \
         scenes with other random numbers, and the same rules keep and choose. Change is Evolved against that, where the \
         paper's own change is against its parent. It is the archive's, put together group by group from many programs on the \
         scenes that evolution saw; what the one chosen program does on held-out routes is in the table safebench-held-out. PF-Area@3 is \
         the mean over groups, 0 for one without an eligible descendant; a group whose parent scenes have less frontier area than the \
         experiment's epsilon_pf, as those without a collision, is divided by that epsilon instead, a choice of ours that the paper does \
         not name."
            .to_string(),
        notes::intervals("groups, drawn within their traffic family")
            + " Differences are paired by group. A rate that some draw leaves undefined has none.",
    ];
    notes.extend(notes::one_seed(&notes::repeats(all.iter()), "groups"));
    if !all.iter().any(|archive| paper::policy_name(&archive.ego) == Some(EGO)) {
        notes.push(format!(
            "The paper's ego is a learned policy ({EGO}), which no run named here has: its figures are another ego's."
        ));
    }
    let undrawn: Vec<&str> =
        runs.iter().filter(|run| run.redrawn.is_empty()).map(|run| run.opened.name.as_str()).collect();
    if !undrawn.is_empty() {
        notes.push(format!(
            "Not redrawn, so without a change: {}. `evodrive table` redraws the parents of a run of its own version and simulator.",
            undrawn.join(", ")
        ));
    }
    notes.extend(notes::of_runs(runs));
    let filled = |method: &&Method| all.iter().any(|archive| archive.method == Some(*method));
    let missing: Vec<&str> = METHODS.iter().filter(|method| !filled(method)).map(|method| method.name).collect();
    if !missing.is_empty() {
        notes.push(format!("Missing in these runs: {}.", missing.join(", ")));
    }
    if all.iter().map(LineageArchive::groups).collect::<BTreeSet<_>>().len() > 1 {
        notes.push("The lineages were evolved on different groups of family and route.".into());
    }
    notes.extend(notes::different_versions(runs));
    notes.extend(searches(all.iter()).iter().filter_map(|seeds| stops(seeds)));
    notes
}
