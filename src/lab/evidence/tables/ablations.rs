//! Tables of ablations: other search methods at the same rollouts (tab:attack-only-openevolve-ablation), the system without one
//! part at a time, and the number of parallel proposals (tab:kwidth-sensitivity). The first run named is what the others are
//! compared with; differences are paired by family, seed and held-out scene.

use std::collections::{BTreeMap, BTreeSet};

use super::error::TableError;
use super::key::{Reads, RowKey, Side};
use super::labels::{self, LineageLabels, Reading};
use super::layout::{Cell, Column, Form, Head, METHOD, Numbers, Part, REPLAY, Row, Table};
use super::metadrive::{SCENES, SEEDS, quantity};
use super::notes;
use super::paper::Figures;
use crate::evidence::recorded_run::RecordedRun;
use crate::kernel::Digest;
use crate::objects::event::Frozen;
use crate::objects::{Attempt, LineageId, Score};
use crate::statistics::bootstrap::{self, Estimate, PerScene, Quantity, Search};

/// Labels of the paper's tables.
const METHODS_LABEL: &str = "tab:attack-only-openevolve-ablation";
const WIDTH_LABEL: &str = "tab:kwidth-sensitivity";

/// Declared for the wall clock of [`kwidth`]: seconds that a model takes for an answer, and a rollout in the paper's kind of
/// simulator. Measured are the numbers of questions and rollouts.
const ANSWER_S: f64 = 10.0;
const ROLLOUT_S: f64 = 1.0;

const fn column(
    key: &'static str,
    group: &'static str,
    head: &'static str,
    upward: Option<bool>,
    form: Form,
) -> Column {
    Column { key, group, head, upward, form }
}

pub(super) const ATTACK: Column = column("attack", "", "Attack", Some(true), Form::Rate);
pub(super) const REALISM: Column = column("realism", "", "Realism", Some(true), Form::Rate);
pub(super) const PF_AREA: Column = column("pf_area_at_3_pct", "", "PF-Area@3", Some(true), Form::Gain);
pub(super) const ATTACK_CHANGE: Column =
    column("attack_change", "Against the whole", "Attack diff.", Some(true), Form::RateChange);
pub(super) const ATTACK_REL: Column =
    column("attack_change_pct", "Against the whole", "Attack rel.", Some(true), Form::Gain);
const ATTACK_P: Column = column("attack_p_holm", "Against the whole", "Attack p", None, Form::Rate);
pub(super) const REALISM_CHANGE: Column =
    column("realism_change", "Against the whole", "Realism diff.", Some(true), Form::RateChange);
pub(super) const REALISM_REL: Column =
    column("realism_change_pct", "Against the whole", "Realism rel.", Some(true), Form::Gain);
const REALISM_P: Column = column("realism_p_holm", "Against the whole", "Realism p", None, Form::Rate);

const COLUMNS: [Column; 9] =
    [ATTACK, REALISM, PF_AREA, ATTACK_CHANGE, ATTACK_REL, ATTACK_P, REALISM_CHANGE, REALISM_REL, REALISM_P];

/// Rollouts on evolution scenes of all lineages.
const EVOLUTION_ROLLOUTS: Head = Head { key: "evolution_rollouts", head: "Rollouts" };
const LINEAGES: Head = Head { key: "lineages", head: "Searches" };
const PROPOSED: Head = Head { key: "proposed", head: "Proposed" };

/// r(τ) of the scenes that the program acts in.
pub(super) const ACTED_REALISM: Reading = |scene| scene.acted.then_some(scene.realism);

/// The run that differences of another one are taken from.
pub(super) fn whole_of(table: &Table, run: usize, recorded_runs: &[RecordedRun]) -> Option<usize> {
    let whole = match table.name {
        "attack-only" => Some(0),
        "without" => {
            recorded_runs.get(..=run)?.iter().rposition(|recorded| recorded.opened.without.is_empty()).or(Some(0))
        }
        _ => None,
    };
    whole.filter(|whole| *whole != run)
}

/// What a run is called in a row: its method, and what it leaves out; the run's own name behind it.
fn title(recorded: &RecordedRun) -> String {
    let opened = &recorded.opened;
    let what = match (opened.without.as_slice(), method(recorded)) {
        ([], method) => method.to_string(),
        (parts, "pareto") => format!("without {}", parts.join(", ")),
        (parts, method) => format!("{method} without {}", parts.join(", ")),
    };
    format!("{what} ({})", opened.name)
}

/// The name of the method that searched.
pub(super) fn method(recorded: &RecordedRun) -> &str {
    recorded.opened.search.as_ref().map_or("pareto", |search| &search.method)
}

/// K.
fn width(recorded: &RecordedRun) -> u32 {
    recorded.frozen.first().map_or(0, |frozen| frozen.slots)
}

/// Title of the row of the parents.
const PARENT: &str = "parent (no search)";

/// The paper's row of a method: attack, realism, and their changes in percent.
fn printed(recorded: &RecordedRun) -> Option<Figures> {
    // The paper has none under a measure of the experimenter's own.
    let method = Some(method(recorded)).filter(|_| recorded.opened.attack.is_none())?;
    let figures = match method {
        "pareto" => [0.400, 0.983, 0.0, 0.0],
        "attack_only" => [0.210, 0.933, -47.5, -5.0],
        "openevolve" => [0.180, 0.933, -55.0, -5.0],
        _ => return None,
    };
    Some(Figures::new([ATTACK.key, REALISM.key, ATTACK_REL.key, REALISM_REL.key], &figures))
}

/// The evolved programs minus those of another run, by lineage, seed and scene; of lineages that both have.
pub(super) fn against(of: &[&LineageLabels], others: &[LineageLabels], reading: Reading) -> Quantity {
    let shared: Vec<&LineageLabels> = of.iter().copied().filter(|own| own.counterpart(others).is_some()).collect();
    quantity(&shared, |own| {
        let after = own.read(Side::Evolved, reading);
        let before = own.counterpart(others).map(|other| other.read(Side::Evolved, reading));
        let before = before.map(|before| before.values).unwrap_or_default();
        let difference = |(after, before): (Option<f64>, Option<f64>)| Some(after? - before?);
        PerScene { suite: own.suite, values: after.values.into_iter().zip(before).map(difference).collect() }
    })
}

/// A run with the labels of its lineages.
struct Ablation<'a> {
    recorded: &'a RecordedRun,
    lineages: Vec<LineageLabels>,
}

impl<'a> Ablation<'a> {
    fn all(recorded_runs: &'a [RecordedRun]) -> Result<Vec<Ablation<'a>>, TableError> {
        notes::one_attack(recorded_runs)?;
        let one = |(place, recorded)| Ok(Ablation { recorded, lineages: labels::of_run(recorded_runs, place)? });
        recorded_runs.iter().enumerate().map(one).collect()
    }

    fn method(&self) -> &str {
        method(self.recorded)
    }

    fn title(&self) -> String {
        title(self.recorded)
    }

    /// A reading of the programs on one side.
    fn quantity(&self, side: Side, reading: Reading) -> Quantity {
        quantity(&self.lineages.iter().collect::<Vec<_>>(), |lineage| lineage.read(side, reading))
    }

    /// Its evolved programs minus another run's.
    fn against(&self, whole: &Ablation<'_>, reading: Reading) -> Quantity {
        against(&self.lineages.iter().collect::<Vec<_>>(), &whole.lineages, reading)
    }

    fn attempts<'s>(&'s self, lineage: &'s LineageId) -> impl Iterator<Item = &'s Attempt> {
        self.recorded.attempts.iter().filter(move |attempt| attempt.lineage == *lineage)
    }

    /// Distinct rollouts on evolution scenes that a lineage's search rested on; those of the final choice are the same for all.
    fn rollouts(&self, lineage: &LineageId) -> usize {
        let frozen = self.recorded.frozen.iter().filter(|frozen| frozen.lineage == *lineage);
        let second = |of: &'a Frozen| {
            let others = of.realism_anchor.iter().chain(&of.portfolio).chain(&of.drawn);
            std::iter::once(&of.parent_score).chain(others.map(|other| &other.parent_score))
        };
        let scores = frozen.flat_map(second).chain(self.attempts(lineage).filter_map(|attempt| attempt.exit.score()));
        let requests = |score: &Score| score.scenes.iter().map(|scene| scene.request).collect::<Vec<Digest>>();
        scores.flat_map(requests).collect::<BTreeSet<Digest>>().len()
    }

    fn row(&self, title: String, numbers: &Numbers, figures: Option<&Figures>) -> Row {
        let suites: BTreeMap<_, usize> = self.lineages.iter().map(|l| (l.suite, l.suite_scenes)).collect();
        let seeds = self.lineages.iter().map(|lineage| lineage.replica).collect::<BTreeSet<u32>>().len();
        let rollouts = self.lineages.iter().map(|lineage| self.rollouts(&lineage.lineage)).sum();
        Row {
            key: RowKey::of(self.lineages.iter().map(LineageLabels::key)),
            labels: vec![title],
            lineages: self.lineages.iter().map(|lineage| lineage.lineage.to_string()).collect(),
            cells: Cell::row(&COLUMNS, numbers, figures),
            counts: vec![suites.values().sum(), seeds, self.lineages.len(), rollouts, self.recorded.attempts.len()],
            proposals: labels::proposals(self.recorded),
            notes: Vec::new(),
        }
    }

    /// Attack, realism and frontier gain of what it reports.
    fn own_numbers(&self) -> Numbers {
        let suite = Digest::of_bytes(b"one value");
        let area = |lineage: &LineageLabels| PerScene { suite, values: vec![Some(lineage.pf_area_at_3_pct)] };
        let areas = quantity(&self.lineages.iter().collect::<Vec<_>>(), area);
        let estimated = bootstrap::estimates(&[
            self.quantity(Side::Evolved, labels::ATTACK),
            self.quantity(Side::Evolved, ACTED_REALISM),
            areas,
        ]);
        let keys = [ATTACK.key, REALISM.key, PF_AREA.key];
        keys.into_iter().zip(estimated).filter_map(|(key, estimate)| Some((key, estimate?))).collect()
    }
}

/// A row whose p-values wait for the correction.
struct Pending {
    row: Row,
    numbers: Numbers,
    figures: Option<Figures>,
    p: [Option<f64>; 2],
}

/// Whole against ablation: differences, and how likely none is.
fn compared(one: &Ablation<'_>, whole: &Ablation<'_>, numbers: &mut Numbers) -> [Option<f64>; 2] {
    let quantities = [one.against(whole, labels::ATTACK), one.against(whole, ACTED_REALISM)];
    let estimated = bootstrap::compared_with_zero(&quantities);
    let base = whole.own_numbers();
    let keys = [(ATTACK.key, ATTACK_CHANGE.key, ATTACK_REL.key), (REALISM.key, REALISM_CHANGE.key, REALISM_REL.key)];
    let mut p = [None; 2];
    for ((estimated, (own, change, relative)), p) in estimated.into_iter().zip(keys).zip(&mut p) {
        let Some((estimate, chance)) = estimated else { continue };
        numbers.insert(change, estimate);
        *p = Some(chance);
        let before = base.get(own).map(|before| before.value).filter(|before| *before > 0.0);
        numbers.extend(before.map(|before| (relative, Estimate::plain(100.0 * estimate.value / before))));
    }
    p
}

/// Holm's correction: p-values times how many are at least as large, never falling, at most 1 (Holm 1979).
pub(super) fn holm(p: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..p.len()).collect();
    order.sort_by(|&a, &b| p[a].total_cmp(&p[b]));
    let (mut corrected, mut least) = (vec![0.0; p.len()], 0.0_f64);
    for (rank, place) in order.into_iter().enumerate() {
        least = least.max((p[place] * (p.len() - rank) as f64).min(1.0));
        corrected[place] = least;
    }
    corrected
}

fn corrected(pending: Vec<Pending>) -> Vec<Row> {
    let all: Vec<f64> = pending.iter().flat_map(|row| row.p.iter().flatten().copied()).collect();
    let mut corrected = holm(&all).into_iter();
    let finish = |Pending { mut row, mut numbers, figures, p }: Pending| {
        for (key, known) in [ATTACK_P.key, REALISM_P.key].into_iter().zip(p) {
            let value = known.and_then(|_| corrected.next());
            numbers.extend(value.map(|value| (key, Estimate::plain(value))));
        }
        row.cells = Cell::row(&COLUMNS, &numbers, figures.as_ref());
        row
    };
    pending.into_iter().map(finish).collect()
}

const HEADS: [Head; 5] = [SCENES, SEEDS, LINEAGES, EVOLUTION_ROLLOUTS, PROPOSED];

fn notes(recorded_runs: &[RecordedRun], all: &[Ablation<'_>], compared: String) -> Vec<String> {
    let mut notes = vec![
        compared,
        "Attack: share of held-out scenes in which the ego fails by a contact that counts. Realism: mean r over the held-out scenes that the \
         program acts in. PF-Area@3: percent of the parent's area that the first three descendants add. What a search reports is chosen by one \
         rule for all, on evolution scenes."
            .to_string(),
        notes::intervals("held-out scenes")
            + " Differences are paired by family, seed and scene. p: two-sided, from the same t or draws, corrected by Holm over all \
               differences of the table.",
        "Rollouts: distinct ones on evolution scenes, over all searches; a declared budget bounds them.".to_string(),
    ];
    let seeds: Vec<usize> = all.iter().flat_map(|one| notes::repeats(one.lineages.iter())).collect();
    notes.splice(3..3, notes::one_seed(&seeds, "held-out scenes"));
    let most = all.iter().map(|one| one.lineages.iter().map(|l| one.rollouts(&l.lineage)).max().unwrap_or(0)).max();
    for one in all {
        let few = one.lineages.iter().filter(|l| 10 * one.rollouts(&l.lineage) < 9 * most.unwrap_or(0)).count();
        if few > 0 {
            notes.push(format!(
                "{}: {few} of {} searches ended below nine tenths of the largest number of rollouts.",
                one.title(),
                one.lineages.len()
            ));
        }
    }
    notes.extend(notes::own_attack(recorded_runs));
    notes.extend(notes::of_runs(recorded_runs));
    notes.extend(notes::different_versions(recorded_runs));
    notes
}

fn table(
    name: &'static str,
    part: Part,
    recorded_runs: &[RecordedRun],
    notes: Vec<String>,
) -> Result<Table, TableError> {
    let (labels, counts) = (vec![METHOD], HEADS.to_vec());
    Ok(Table {
        name,
        labels,
        columns: COLUMNS.to_vec(),
        counts,
        parts: vec![part],
        runs: notes::runs(recorded_runs)?,
        notes,
    })
}

/// The cheapest rows: the scenes without a program, and the parent without a search.
fn cheapest(whole: &Ablation<'_>) -> Vec<Row> {
    let nothing = Numbers::from([(ATTACK.key, Estimate::plain(0.0))]);
    let mut idle = whole.row(REPLAY.into(), &nothing, None);
    let estimated = bootstrap::estimates(&[
        whole.quantity(Side::Parent, labels::ATTACK),
        whole.quantity(Side::Parent, ACTED_REALISM),
    ]);
    let numbers =
        [ATTACK.key, REALISM.key].into_iter().zip(estimated).filter_map(|(key, of)| Some((key, of?))).collect();
    let mut parent = whole.row(PARENT.into(), &numbers, None);
    idle.key = RowKey::Elsewhere;
    parent.key = RowKey::reading(whole.lineages.iter().map(LineageLabels::key), Reads::Side(Side::Parent));
    for row in [&mut idle, &mut parent] {
        row.counts[3..].fill(0);
        row.proposals = "none".into();
    }
    vec![idle, parent]
}

/// Search methods beside each other.
pub fn attack_only(recorded_runs: &[RecordedRun]) -> Result<Table, TableError> {
    let all = Ablation::all(recorded_runs)?;
    let Some((whole, others)) = all.split_first() else { return Err(TableError::NoRuns) };
    let mut rows = cheapest(whole);
    rows.push(whole.row(whole.title(), &whole.own_numbers(), printed(whole.recorded).as_ref()));
    let pending = others.iter().map(|one| {
        let mut numbers = one.own_numbers();
        let p = compared(one, whole, &mut numbers);
        // The paper's one row of OpenEvolve stands beside the first of ours.
        let first = others.iter().find(|other| other.method() == one.method());
        let figures = printed(one.recorded).filter(|_| first.is_some_and(|first| std::ptr::eq(first, one)));
        Pending { row: one.row(one.title(), &numbers, figures.as_ref()), numbers, figures, p }
    });
    rows.extend(corrected(pending.collect()));
    let notes = notes(recorded_runs, &all, format!("The whole is the first run named, {}.", whole.title()));
    let title = "Search methods at the same rollouts".to_string();
    let part = Part { name: "attack-only".into(), title, source: Some(METHODS_LABEL), rows };
    table("attack-only", part, recorded_runs, notes)
}

/// The system without one part at a time. A run that leaves something out is compared with the last one before it that leaves
/// nothing out.
pub fn without(recorded_runs: &[RecordedRun]) -> Result<Table, TableError> {
    let all = Ablation::all(recorded_runs)?;
    let Some(first) = all.first() else { return Err(TableError::NoRuns) };
    let (mut whole, mut pending) = (first, Vec::new());
    for one in &all {
        let mut numbers = one.own_numbers();
        let p = if one.recorded.opened.without.is_empty() {
            whole = one;
            [None; 2]
        } else {
            compared(one, whole, &mut numbers)
        };
        pending.push(Pending { row: one.row(one.title(), &numbers, None), numbers, figures: None, p });
    }
    let compared =
        "A row that leaves a part out is compared with the last row above it that leaves nothing out.".to_string();
    let title = "The system without one part at a time".to_string();
    let part = Part { name: "without".into(), title, source: None, rows: corrected(pending) };
    table("without", part, recorded_runs, notes(recorded_runs, &all, compared))
}

pub(super) const YIELD: Column =
    column("accepted_of_simulated_pct", "", "Accepted of simulated", Some(true), Form::Percent);
const SERIAL_H: Column = column("serial_h", "Wall clock", "Serial, h", None, Form::Number);
const PARALLEL_H: Column = column("parallel_h", "Wall clock", "Parallel, h", None, Form::Number);
const SPEEDUP: Column = column("speedup", "Wall clock", "Speed-up", Some(true), Form::Number);
pub(super) const PROPOSED_MEAN: Column = column("proposed", "A search", "Proposed", None, Form::Number);
pub(super) const SIMULATED_MEAN: Column = column("simulated", "A search", "Simulator-eval.", None, Form::Number);
pub(super) const ACCEPTED_MEAN: Column = column("validated", "A search", "Validated", Some(true), Form::Number);
const WIDTH_COLUMNS: [Column; 9] =
    [PROPOSED_MEAN, SIMULATED_MEAN, ACCEPTED_MEAN, YIELD, SERIAL_H, PARALLEL_H, SPEEDUP, ATTACK, REALISM];

pub(super) fn simulated(attempt: &Attempt) -> bool {
    attempt.exit.decision().is_some()
}

pub(super) fn accepted(attempt: &Attempt) -> bool {
    attempt.exit.decision().is_some_and(|decision| decision.gates.any())
}

/// The paper's row of a family against IDM at a width.
fn printed_width(family: &str, slots: u32) -> Option<Figures> {
    let keys = [PROPOSED_MEAN.key, SIMULATED_MEAN.key, ACCEPTED_MEAN.key];
    let with_speedup = [keys[0], keys[1], keys[2], SPEEDUP.key];
    match (family, slots) {
        ("CAT", 1) => Some(Figures::new(keys, &[10.0, 0.0, 0.0])),
        ("CAT", 20) => Some(Figures::new(with_speedup, &[200.0, 10.0, 8.0, 3.83])),
        ("ADV-BMT", 20) => Some(Figures::new(with_speedup, &[200.0, 10.0, 9.0, 3.92])),
        _ => None,
    }
}

/// Seconds of a search: serial, and with the questions of an epoch's slots asked at once.
fn wall_clock_s(ablation: &Ablation<'_>, lineage: &LineageId) -> [f64; 2] {
    let mut asked: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
    for attempt in ablation.attempts(lineage) {
        asked.entry(attempt.epoch).or_default().push(attempt.proposal.exchanges.len());
    }
    let answers = |of: &dyn Fn(&Vec<usize>) -> usize| ANSWER_S * asked.values().map(of).sum::<usize>() as f64;
    let evaluation = ROLLOUT_S * ablation.rollouts(lineage) as f64;
    let (serial, parallel) =
        (answers(&|slots| slots.iter().sum()), answers(&|slots| slots.iter().copied().max().unwrap_or(0)));
    [serial + evaluation, parallel + evaluation]
}

/// Whether a column is a wall clock or made of two.
pub(super) fn is_wall_clock(key: &str) -> bool {
    [SERIAL_H, PARALLEL_H, SPEEDUP].iter().any(|column| column.key == key)
}

/// How many proposals an epoch has: yield, and wall clock with a declared latency.
pub fn kwidth(recorded_runs: &[RecordedRun]) -> Result<Table, TableError> {
    let all = Ablation::all(recorded_runs)?;
    let mut rows = Vec::new();
    for one in &all {
        for of in super::searches::searches(one.lineages.iter()) {
            rows.push(width_row(one, &of));
        }
    }
    let mut notes = notes(recorded_runs, &all, "A row a run and family.".into());
    notes.push(format!(
        "Proposed, simulated and validated (accepted): means over the seeds, intervals over them. Wall clock: questions and rollouts as counted, {ANSWER_S} s \
         an answer and {ROLLOUT_S} s a rollout as declared; serial asks one question after the other, parallel those of an epoch's \
         slots at once, and both simulate one rollout after the other."
    ));
    let title = "Parallel proposals".to_string();
    let parts = vec![Part { name: "kwidth".into(), title, source: Some(WIDTH_LABEL), rows }];
    let (labels, counts) = (vec![METHOD, WIDTH], HEADS.to_vec());
    let runs = notes::runs(recorded_runs)?;
    Ok(Table { name: "kwidth", labels, columns: WIDTH_COLUMNS.to_vec(), counts, parts, runs, notes })
}

/// K.
const WIDTH: Head = Head { key: "k", head: "K" };

fn width_row(one: &Ablation<'_>, of: &[&LineageLabels]) -> Row {
    let searches = Ablation { recorded: one.recorded, lineages: of.iter().map(|lineage| (*lineage).clone()).collect() };
    // One value a seed: only seeds are drawn.
    let over_seeds = |count: &dyn Fn(&LineageId) -> f64| -> Quantity {
        let seed = |lineage: &&LineageLabels| PerScene {
            suite: Digest::of_bytes(lineage.lineage.as_str().as_bytes()),
            values: vec![Some(count(&lineage.lineage))],
        };
        vec![Search { id: Digest::of_bytes(of[0].name.as_bytes()), seeds: of.iter().map(seed).collect() }]
    };
    let counted = |holds: fn(&Attempt) -> bool| {
        over_seeds(&|lineage: &LineageId| one.attempts(lineage).filter(|attempt| holds(attempt)).count() as f64)
    };
    let hours = |way: usize| over_seeds(&|lineage: &LineageId| wall_clock_s(one, lineage)[way] / 3600.0);
    let (simulated, accepted) = (counted(simulated), counted(accepted));
    let means = [counted(|_| true), simulated.clone(), accepted.clone(), hours(0), hours(1)]
        .map(|quantity| bootstrap::estimates(&[quantity]).pop().flatten());
    let percent = |of: Estimate| Estimate {
        value: 100.0 * of.value,
        interval: of.interval.map(|ends| ends.map(|end| 100.0 * end)),
        spread: None,
    };
    let keys = [PROPOSED_MEAN, SIMULATED_MEAN, ACCEPTED_MEAN, SERIAL_H, PARALLEL_H].map(|column| column.key);
    let mut estimated: Vec<(&'static str, Option<Estimate>)> = keys.into_iter().zip(means).collect();
    estimated.push((SPEEDUP.key, bootstrap::ratio(&hours(0), &hours(1))));
    estimated.push((YIELD.key, bootstrap::ratio(&accepted, &simulated).map(percent)));
    let mut numbers = searches.own_numbers();
    for (key, estimate) in estimated.into_iter().filter_map(|(key, estimate)| Some((key, estimate?))) {
        // One search has no spread.
        let interval = estimate.interval.filter(|_| of.len() > 1);
        numbers.insert(key, Estimate { interval, ..estimate });
    }
    let slots = width(one.recorded);
    let name = format!("{} + {}", of[0].label, of[0].policy);
    let figures =
        printed_width(&of[0].name, slots).filter(|_| of[0].ego == "idm" && one.recorded.opened.attack.is_none());
    let mut row = searches.row(name, &numbers, None);
    row.counts[4] = of.iter().map(|lineage| one.attempts(&lineage.lineage).count()).sum();
    row.labels.push(slots.to_string());
    row.cells = Cell::row(&WIDTH_COLUMNS, &numbers, figures.as_ref());
    row
}

#[cfg(test)]
mod tests {
    use super::super::bases::Derivations;
    use super::super::layout::Table;
    use super::super::tests::{CAT, add, attempt, near, run};
    use super::*;
    use crate::objects::attempt::Exchange;
    use crate::objects::event::Searched;
    use crate::objects::{Exit, Role};

    /// A run of the worked example; a worse one loses the second of its two successes.
    fn recorded(name: &str, method: &str, without: &[&str], worse: bool) -> RecordedRun {
        let mut recorded = run(name, &[("actor", "scripted (s, s)")]);
        add(&mut recorded, &CAT);
        recorded.opened.search = Some(Searched { method: method.into(), rollouts: None });
        recorded.opened.without = without.iter().map(|part| part.to_string()).collect();
        if worse {
            recorded.held_out[1].score.scenes[1].attack = 0.0;
        }
        recorded
    }

    fn value(table: &Table, title: &str, key: &str) -> f64 {
        let row = table.rows().find(|row| row.labels[0] == title).unwrap();
        row.cell(key).ours.unwrap().value
    }

    #[test]
    fn methods_are_compared_scene_by_scene_with_the_first_run() {
        let recorded_runs = [recorded("whole", "pareto", &[], false), recorded("oe", "openevolve", &[], true)];
        let table = attack_only(&recorded_runs).unwrap();
        near(value(&table, "pareto (whole)", ATTACK.key), 0.5);
        near(value(&table, "openevolve (oe)", ATTACK.key), 0.25);
        near(value(&table, "openevolve (oe)", ATTACK_CHANGE.key), -0.25);
        near(value(&table, "openevolve (oe)", ATTACK_REL.key), -50.0);
        near(value(&table, "openevolve (oe)", REALISM_CHANGE.key), 0.0);
        near(value(&table, REPLAY, ATTACK.key), 0.0);
        near(value(&table, "parent (no search)", ATTACK.key), 0.25);
        let row = table.rows().find(|row| row.labels[0] == "openevolve (oe)").unwrap();
        assert_eq!(row.cell(ATTACK.key).paper, Some(0.18));
        let [low, high] = row.cell(ATTACK_CHANGE.key).ours.unwrap().interval.unwrap();
        // One scene in four differs, by one: four draws of it leave none to all four.
        assert!((-1.0..=-0.5).contains(&low) && high == 0.0, "{low} {high}");
        let p = row.cell(ATTACK_P.key).ours.unwrap().value;
        // No draw holds the scene with (3/4)^4 = 0.316; twice that, and twice again for two differences.
        assert!((p - 1.0).abs() < 1e-9, "{p}");
        assert!(attack_only(&[]).is_err());
    }

    #[test]
    fn a_part_is_missed_against_the_last_whole_above_it() {
        let recorded_runs = [
            recorded("whole", "pareto", &[], false),
            recorded("no-critics", "pareto", &["critics"], true),
            recorded("routed", "pareto", &[], true),
            recorded("no-audit", "pareto", &["audit"], true),
        ];
        let table = without(&recorded_runs).unwrap();
        near(value(&table, "without critics (no-critics)", ATTACK_CHANGE.key), -0.25);
        near(value(&table, "without audit (no-audit)", ATTACK_CHANGE.key), 0.0);
        assert!(table.rows().next().unwrap().cell(ATTACK_CHANGE.key).ours.is_none());
    }

    #[test]
    fn a_width_is_as_fast_as_its_longest_slot() {
        let mut recorded = recorded("wide", "pareto", &[], false);
        for (slot, questions) in [(0, 3), (1, 5)] {
            let mut attempt = attempt("cat-idm", slot, Exit::Declined { reason: "no patch".into() });
            let any = Digest::of_bytes(b"any");
            let question = Exchange {
                role: Role::Actor,
                round: 0,
                request: any,
                response: any,
                model: "m".into(),
                metadata: None,
                unwrapped: vec![],
                refusal: None,
            };
            attempt.proposal.exchanges = vec![question; questions];
            recorded.attempts.push(attempt);
        }
        let table = kwidth(&[recorded]).unwrap();
        // Eight answers of ten seconds, or the five of the slower slot; nothing was simulated.
        near(value(&table, "CAT + IDM", SPEEDUP.key), 80.0 / 50.0);
        near(value(&table, "CAT + IDM", PROPOSED_MEAN.key), 2.0);
        near(value(&table, "CAT + IDM", SIMULATED_MEAN.key), 0.0);
    }

    /// Every number but p-values, wall clocks and the zero of no program comes out again of labels and proposals.
    #[test]
    fn every_number_comes_out_of_its_basis() {
        let mut recorded_runs = vec![
            recorded("whole", "pareto", &[], false),
            recorded("no-critics", "pareto", &["critics"], true),
            recorded("routed", "pareto", &[], true),
            recorded("no-audit", "pareto", &["audit"], false),
        ];
        recorded_runs[1].attempts.push(attempt("cat-idm", 0, Exit::Declined { reason: "no patch".into() }));
        let unnoted = [ATTACK_P.key, REALISM_P.key, SERIAL_H.key, PARALLEL_H.key, SPEEDUP.key];
        let mut notes = BTreeSet::new();
        for table in
            [attack_only(&recorded_runs).unwrap(), without(&recorded_runs).unwrap(), kwidth(&recorded_runs).unwrap()]
        {
            let bases = Derivations::of(&table, &recorded_runs).unwrap();
            for row in table.rows() {
                for cell in row.cells.iter().filter(|cell| cell.ours.is_some()) {
                    let (key, ours) = (cell.column.key, cell.ours.unwrap().value);
                    let Some(basis) = bases.basis(&table, row, key) else {
                        assert!(
                            unnoted.contains(&key) || row.labels[0] == REPLAY,
                            "{} {:?} {key}",
                            table.name,
                            row.labels
                        );
                        continue;
                    };
                    near(basis.value().unwrap(), ours);
                    notes.insert((table.name, key));
                }
            }
        }
        assert!(notes.len() >= 7 + 6 + 5, "{notes:?}");
    }

    /// Two runs of one title, with other numbers: a row's labels say nothing of which run it is.
    #[test]
    fn rows_are_found_whatever_they_are_called_and_wherever_they_stand() {
        let recorded_runs = [
            recorded("whole", "pareto", &[], false),
            recorded("twin", "pareto", &["critics"], true),
            recorded("twin", "pareto", &["critics"], false),
        ];
        for table in
            [attack_only(&recorded_runs).unwrap(), without(&recorded_runs).unwrap(), kwidth(&recorded_runs).unwrap()]
        {
            let bases = Derivations::of(&table, &recorded_runs).unwrap();
            let numbers = |table: &Table, row: &Row| -> Vec<Option<f64>> {
                row.cells.iter().map(|cell| bases.basis(table, row, cell.column.key)?.value()).collect()
            };
            let wanted: Vec<_> = table.rows().map(|row| numbers(&table, row)).collect();
            assert!(wanted.iter().flatten().any(Option::is_some), "{}", table.name);
            let mut other = table.clone();
            for row in other.parts.iter_mut().flat_map(|part| &mut part.rows) {
                row.labels.iter_mut().for_each(|label| *label = "renamed".into());
            }
            other.parts.iter_mut().for_each(|part| part.rows.reverse());
            let mut estimated: Vec<_> = other.rows().map(|row| numbers(&other, row)).collect();
            estimated.reverse();
            assert_eq!(estimated, wanted, "{}", table.name);
        }
    }

    #[test]
    fn holm_multiplies_the_smallest_by_all_and_never_falls() {
        // Holm's step down by hand: 0.01 * 4, max(0.04, 0.02 * 3), max(0.06, 0.03 * 2), 0.5 * 1.
        let estimated = holm(&[0.02, 0.5, 0.01, 0.03]);
        let wanted = [0.06, 0.5, 0.04, 0.06];
        assert!(estimated.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-12), "{estimated:?}");
        assert_eq!(holm(&[0.6, 0.9]), [1.0, 1.0]);
        assert!(holm(&[]).is_empty());
    }
}
