//! Tables of ablations: other search methods at the same rollouts (tab:attack-only-openevolve-ablation), the system without one
//! part at a time, and the number of parallel proposals (tab:kwidth-sensitivity). The first run named is what the others are
//! compared with; differences are paired by family, seed and held-out scene.

use std::collections::{BTreeMap, BTreeSet};

use super::basis::{Combine, Derivation, Leaf};
use super::derivations::{Derivations, SEARCHES, Source};
use super::error::TableError;
use super::key::{RowKey, Side};
use super::labels::{self, LineageLabels, Reading};
use super::layout::{Cell, Column, Form, Head, METHOD, Numbers, Part, REPLAY, Row, Sourced, Table, heads};
use super::metadrive::{SCENES, SEEDS, row, sourced};
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

const AGAINST: &str = "Against the whole";
const ATTACK: Column = column("attack", "", "Attack", Some(true), Form::Rate);
const REALISM: Column = column("realism", "", "Realism", Some(true), Form::Rate);
const ATTACK_REL: Column = column("attack_change_pct", AGAINST, "Attack rel.", Some(true), Form::Gain);
const REALISM_REL: Column = column("realism_change_pct", AGAINST, "Realism rel.", Some(true), Form::Gain);
const PF_AREA: &str = "pf_area_at_3_pct";
/// Keys of what is tested: the difference, and its p.
const TESTED: [[&str; 2]; 2] = [["attack_change", "attack_p_holm"], ["realism_change", "realism_p_holm"]];

/// Source of a p, and of the 0 of no program.
pub(super) const OF_RESAMPLES: Source = Source::Undivided(
    "it comes from the resamples of all differences of the table together; ask for the difference itself, `attack_change` or \
     `realism_change`",
);

/// Attack, realism and frontier gain of a side, and its differences to another run, where there is one.
fn columns(side: Side, whole: Option<usize>) -> Vec<Sourced> {
    let area = Source::of(move |bases, row| (side == Side::Evolved).then(|| bases.frontier(&bases.lineages_of(row))));
    let change = move |bases: &Derivations<'_>, row: &RowKey, reading: Reading| {
        bases.paired(&bases.lineages_of(row), &bases.run(whole?), reading)
    };
    let difference = |reading: Reading| Source::of(move |bases, row| change(bases, row, reading));
    let relative = |reading: Reading| {
        Source::of(move |bases, row| {
            let base = bases.read(&bases.run(whole?), Side::Evolved, reading)?;
            let terms = [change(bases, row, reading)?, base];
            Some(Derivation::percent("100 times the paired difference over the number of the whole", terms))
        })
    };
    let [[attack_change, attack_p], [realism_change, realism_p]] = TESTED;
    let changed = |key, head| column(key, AGAINST, head, Some(true), Form::RateChange);
    let p = |key, head| (column(key, AGAINST, head, None, Form::Rate), OF_RESAMPLES);
    vec![
        sourced((ATTACK, side, labels::ATTACK)),
        sourced((REALISM, side, labels::ACTED_REALISM)),
        (column(PF_AREA, "", "PF-Area@3", Some(true), Form::Gain), area),
        (changed(attack_change, "Attack diff."), difference(labels::ATTACK)),
        (ATTACK_REL, relative(labels::ATTACK)),
        p(attack_p, "Attack p"),
        (changed(realism_change, "Realism diff."), difference(labels::ACTED_REALISM)),
        (REALISM_REL, relative(labels::ACTED_REALISM)),
        p(realism_p, "Realism p"),
    ]
}

/// Rollouts on evolution scenes of all lineages.
const EVOLUTION_ROLLOUTS: Head = Head { key: "evolution_rollouts", head: "Rollouts" };
const LINEAGES: Head = Head { key: "lineages", head: "Searches" };
const PROPOSED: Head = Head { key: "proposed", head: "Proposed" };

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

/// A run with the labels of its lineages.
struct Ablation<'a> {
    bases: &'a Derivations<'a>,
    place: usize,
    recorded: &'a RecordedRun,
    lineages: Vec<&'a LineageLabels>,
}

impl<'a> Ablation<'a> {
    fn all(bases: &'a Derivations<'a>) -> Result<Vec<Ablation<'a>>, TableError> {
        notes::one_attack(bases.runs)?;
        bases.by_run()?;
        let one = |place| Ablation { bases, place, recorded: &bases.runs[place], lineages: bases.run(place) };
        Ok((0..bases.runs.len()).map(one).collect())
    }

    /// Returns its name in a row: its method and what it leaves out, with the run's own name behind it.
    fn title(&self) -> String {
        let opened = &self.recorded.opened;
        let what = match (opened.without.as_slice(), method(self.recorded)) {
            ([], method) => method.to_string(),
            (parts, "pareto") => format!("without {}", parts.join(", ")),
            (parts, method) => format!("{method} without {}", parts.join(", ")),
        };
        format!("{what} ({})", opened.name)
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

    /// A row of some of its lineages.
    fn row(&self, labels: Vec<String>, of: &[&LineageLabels], columns: &[Sourced], figures: Option<&Figures>) -> Row {
        let row = row(self.bases, labels, of, columns, figures);
        let seeds = of.iter().map(|lineage| lineage.replica).collect::<BTreeSet<u32>>().len();
        let rollouts = of.iter().map(|lineage| self.rollouts(&lineage.lineage)).sum();
        let attempts = of.iter().map(|lineage| self.attempts(&lineage.lineage).count()).sum();
        let counts = vec![row.counts[0], seeds, of.len(), rollouts, attempts];
        Row { counts, proposals: labels::proposals(self.recorded), notes: Vec::new(), ..row }
    }

    /// Makes a row of the results of one side of all its lineages, against another run.
    fn own_row(&self, title: String, side: Side, whole: Option<&Ablation<'_>>, figures: Option<&Figures>) -> Row {
        let columns = columns(side, whole.map(|whole| whole.place));
        let mut row = self.row(vec![title], &self.lineages, &columns, figures);
        row.counts[4] = self.recorded.attempts.len();
        // An area that was measured once has an interval here, without width.
        let areas = row.cells.iter_mut().filter(|cell| cell.column.key == PF_AREA);
        areas
            .filter_map(|cell| cell.ours.as_mut())
            .for_each(|own| own.interval = own.interval.or(Some([own.value; 2])));
        put_chances(self.bases, &mut row, &TESTED);
        row
    }
}

/// Puts in a row the chances of its differences under none, from the same t or draws as their intervals.
pub(super) fn put_chances(bases: &Derivations<'_>, row: &mut Row, tested: &[[&str; 2]]) {
    for [change, p] in tested {
        let quantity = row.derivation(change, bases).map_or(Quantity::new(), |change| change.quantity());
        let chance = bootstrap::compared_with_zero(&[quantity]).pop().flatten();
        row.put(p, chance.map(|(_, chance)| Estimate::plain(chance)));
    }
}

/// Corrects all chances of these rows together.
pub(super) fn correct(rows: &mut [Row], tested: &[[&str; 2]]) {
    let is_chance = |cell: &&mut Cell| tested.iter().any(|[_, p]| *p == cell.column.key);
    let cells = rows.iter_mut().flat_map(|row| &mut row.cells).filter(is_chance);
    let chances: Vec<&mut Estimate> = cells.filter_map(|cell| cell.ours.as_mut()).collect();
    let corrected = holm(&chances.iter().map(|chance| chance.value).collect::<Vec<f64>>());
    chances.into_iter().zip(corrected).for_each(|(chance, corrected)| chance.value = corrected);
}

/// Holm's correction: p-values times how many are at least as large, never falling, at most 1 (Holm 1979).
fn holm(p: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..p.len()).collect();
    order.sort_by(|&a, &b| p[a].total_cmp(&p[b]));
    let (mut corrected, mut least) = (vec![0.0; p.len()], 0.0_f64);
    for (rank, place) in order.into_iter().enumerate() {
        least = least.max((p[place] * (p.len() - rank) as f64).min(1.0));
        corrected[place] = least;
    }
    corrected
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
    let seeds: Vec<usize> = all.iter().flat_map(|one| notes::repeats(one.lineages.iter().copied())).collect();
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
    title: &str,
    source: Option<&'static str>,
    rows: Vec<Row>,
    notes: Vec<String>,
    runs: &[RecordedRun],
) -> Result<Table, TableError> {
    let part = Part { name: name.into(), title: title.into(), source, rows };
    let columns = heads(&columns(Side::Evolved, None));
    let (labels, counts, parts, runs) = (vec![METHOD], HEADS.to_vec(), vec![part], notes::runs(runs)?);
    Ok(Table { name, labels, columns, counts, parts, runs, notes })
}

/// The cheapest rows: the scenes without a program, and the parent without a search.
fn cheapest(whole: &Ablation<'_>) -> Vec<Row> {
    let parent = whole.own_row(PARENT.into(), Side::Parent, None, None);
    let nothing = Numbers::from([(ATTACK.key, Estimate::plain(0.0))]);
    let mut cells = Cell::row(&heads(&columns(Side::Parent, None)), &nothing);
    cells.iter_mut().for_each(|cell| cell.source = OF_RESAMPLES);
    let mut rows = vec![Row { key: RowKey::Elsewhere, labels: vec![REPLAY.into()], cells, ..parent.clone() }, parent];
    for row in &mut rows {
        row.counts[3..].fill(0);
        row.proposals = "none".into();
    }
    rows
}

/// Search methods beside each other.
pub fn attack_only(recorded_runs: &[RecordedRun]) -> Result<Table, TableError> {
    let bases = Derivations::of(recorded_runs);
    let all = Ablation::all(&bases)?;
    let Some((whole, others)) = all.split_first() else { return Err(TableError::NoRuns) };
    let mut rows = cheapest(whole);
    rows.push(whole.own_row(whole.title(), Side::Evolved, None, printed(whole.recorded).as_ref()));
    rows.extend(others.iter().map(|one| {
        // The paper's one row of OpenEvolve stands beside the first of ours.
        let first = others.iter().find(|other| method(other.recorded) == method(one.recorded));
        let figures = printed(one.recorded).filter(|_| first.is_some_and(|first| first.place == one.place));
        one.own_row(one.title(), Side::Evolved, Some(whole), figures.as_ref())
    }));
    correct(&mut rows, &TESTED);
    let notes = notes(recorded_runs, &all, format!("The whole is the first run named, {}.", whole.title()));
    let title = "Search methods at the same rollouts";
    table("attack-only", title, Some(METHODS_LABEL), rows, notes, recorded_runs)
}

/// The system without one part at a time. A run that leaves something out is compared with the last one before it that leaves
/// nothing out.
pub fn without(recorded_runs: &[RecordedRun]) -> Result<Table, TableError> {
    let bases = Derivations::of(recorded_runs);
    let all = Ablation::all(&bases)?;
    let Some(mut whole) = all.first() else { return Err(TableError::NoRuns) };
    let mut rows = Vec::new();
    for one in &all {
        let is_whole = one.recorded.opened.without.is_empty();
        if is_whole {
            whole = one;
        }
        rows.push(one.own_row(one.title(), Side::Evolved, (!is_whole).then_some(whole), None));
    }
    correct(&mut rows, &TESTED);
    let compared =
        "A row that leaves a part out is compared with the last row above it that leaves nothing out.".to_string();
    let notes = notes(recorded_runs, &all, compared);
    table("without", "The system without one part at a time", None, rows, notes, recorded_runs)
}

const PROPOSED_MEAN: Column = column("proposed", "A search", "Proposed", None, Form::Number);
const SIMULATED_MEAN: Column = column("simulated", "A search", "Simulator-eval.", None, Form::Number);
const ACCEPTED_MEAN: Column = column("validated", "A search", "Validated", Some(true), Form::Number);
const YIELD: Column = column("accepted_of_simulated_pct", "", "Accepted of simulated", Some(true), Form::Percent);
const SERIAL_H: Column = column("serial_h", "Wall clock", "Serial, h", None, Form::Number);
const PARALLEL_H: Column = column("parallel_h", "Wall clock", "Parallel, h", None, Form::Number);
const SPEEDUP: Column = column("speedup", "Wall clock", "Speed-up", Some(true), Form::Number);
const WALL_CLOCK: Source = Source::Undivided(
    "wall clocks are the counted answers and rollouts times the seconds that the table's note declares; for the counts \
     ask for `proposed` or `simulated` of that row",
);

fn width_columns() -> Vec<Sourced> {
    type Counted = fn(&Derivations<'_>, &RowKey) -> Derivation;
    let proposed: Counted = |bases, row| counted(bases, row, "proposals", |_| true);
    let simulated: Counted = |bases, row| counted(bases, row, "simulated proposals", simulated);
    let accepted: Counted = |bases, row| counted(bases, row, "accepted proposals", accepted);
    let of = |derive: Counted| Source::of(move |bases, row| Some(derive(bases, row)));
    let share = move |bases: &Derivations<'_>, row: &RowKey| {
        let terms = [accepted(bases, row), simulated(bases, row)];
        Some(Derivation::percent("100 times accepted over simulated proposals", terms))
    };
    vec![
        (PROPOSED_MEAN, of(proposed)),
        (SIMULATED_MEAN, of(simulated)),
        (ACCEPTED_MEAN, of(accepted)),
        (YIELD, Source::of(share)),
        (SERIAL_H, WALL_CLOCK),
        (PARALLEL_H, WALL_CLOCK),
        (SPEEDUP, WALL_CLOCK),
        sourced((ATTACK, Side::Evolved, labels::ATTACK)),
        sourced((REALISM, Side::Evolved, labels::ACTED_REALISM)),
    ]
}

/// Derives the mean number of a lineage's proposals for which something holds.
fn counted(bases: &Derivations<'_>, row: &RowKey, what: &str, holds: fn(&Attempt) -> bool) -> Derivation {
    let part = |l: &LineageLabels| {
        let attempts = bases.runs[l.place].attempts.iter().filter(|attempt| attempt.lineage == l.lineage);
        let leaves: Vec<Leaf> = attempts.map(|of| Leaf::attempt(of, Some(labels::share(holds(of))))).collect();
        let value = leaves.iter().filter_map(|leaf| leaf.value).sum();
        l.part(Vec::new(), Some(value), leaves)
    };
    let parts = bases.lineages_of(row).into_iter().map(part).collect();
    Derivation::of(format!("{SEARCHES} the number of {what}"), Combine::Means, parts)
}

fn simulated(attempt: &Attempt) -> bool {
    attempt.exit.decision().is_some()
}

fn accepted(attempt: &Attempt) -> bool {
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

/// Makes the table over the number of proposals in an epoch: yield, and wall clock with a declared latency.
pub fn kwidth(recorded_runs: &[RecordedRun]) -> Result<Table, TableError> {
    let (bases, columns) = (Derivations::of(recorded_runs), width_columns());
    let all = Ablation::all(&bases)?;
    let mut rows = Vec::new();
    for one in &all {
        for of in super::searches::searches(one.lineages.iter().copied()) {
            rows.push(width_row(one, &of, &columns));
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
    Ok(Table { name: "kwidth", labels, columns: heads(&columns), counts, parts, runs, notes })
}

/// K.
const WIDTH: Head = Head { key: "k", head: "K" };

fn width_row(one: &Ablation<'_>, of: &[&LineageLabels], columns: &[Sourced]) -> Row {
    // One value a seed: only seeds are drawn.
    let hours = |way: usize| -> Quantity {
        let seed = |lineage: &&LineageLabels| PerScene {
            suite: Digest::of_bytes(lineage.lineage.as_str().as_bytes()),
            values: vec![Some(wall_clock_s(one, &lineage.lineage)[way] / 3600.0)],
        };
        vec![Search { id: Digest::of_bytes(of[0].name.as_bytes()), seeds: of.iter().map(seed).collect() }]
    };
    let slots = width(one.recorded);
    let name = format!("{} + {}", of[0].label, of[0].policy);
    let figures =
        printed_width(&of[0].name, slots).filter(|_| of[0].ego == "idm" && one.recorded.opened.attack.is_none());
    let mut row = one.row(vec![name, slots.to_string()], of, columns, figures.as_ref());
    let share = row.derivation(YIELD.key, one.bases);
    let ratio = share.and_then(|share| bootstrap::ratio(&share.terms[0].quantity(), &share.terms[1].quantity()));
    let percent = |of: Estimate| Estimate {
        value: 100.0 * of.value,
        interval: of.interval.map(|ends| ends.map(|end| 100.0 * end)),
        spread: None,
    };
    let [serial, parallel] = [hours(0), hours(1)];
    let whole = |quantity: &Quantity| bootstrap::estimates(std::slice::from_ref(quantity)).pop().flatten();
    for (column, estimate) in [
        (YIELD, ratio.map(percent)),
        (SERIAL_H, whole(&serial)),
        (PARALLEL_H, whole(&parallel)),
        (SPEEDUP, bootstrap::ratio(&serial, &parallel)),
    ] {
        // One search has no spread.
        let own = |estimate: Estimate| Estimate { interval: estimate.interval.filter(|_| of.len() > 1), ..estimate };
        row.put(column.key, estimate.map(own));
    }
    row
}

#[cfg(test)]
mod tests {
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
        near(value(&table, "openevolve (oe)", "attack_change"), -0.25);
        near(value(&table, "openevolve (oe)", ATTACK_REL.key), -50.0);
        near(value(&table, "openevolve (oe)", "realism_change"), 0.0);
        near(value(&table, REPLAY, ATTACK.key), 0.0);
        near(value(&table, "parent (no search)", ATTACK.key), 0.25);
        let row = table.rows().find(|row| row.labels[0] == "openevolve (oe)").unwrap();
        assert_eq!(row.cell(ATTACK.key).paper, Some(0.18));
        let [low, high] = row.cell("attack_change").ours.unwrap().interval.unwrap();
        // One scene in four differs, by one: four draws of it leave none to all four.
        assert!((-1.0..=-0.5).contains(&low) && high == 0.0, "{low} {high}");
        let p = row.cell("attack_p_holm").ours.unwrap().value;
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
        near(value(&table, "without critics (no-critics)", "attack_change"), -0.25);
        near(value(&table, "without audit (no-audit)", "attack_change"), 0.0);
        assert!(table.rows().next().unwrap().cell("attack_change").ours.is_none());
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
        let unnoted = ["attack_p_holm", "realism_p_holm", SERIAL_H.key, PARALLEL_H.key, SPEEDUP.key];
        let mut notes = BTreeSet::new();
        for table in
            [attack_only(&recorded_runs).unwrap(), without(&recorded_runs).unwrap(), kwidth(&recorded_runs).unwrap()]
        {
            let bases = Derivations::of(&recorded_runs);
            for row in table.rows() {
                for cell in row.cells.iter().filter(|cell| cell.ours.is_some()) {
                    let (key, ours) = (cell.column.key, cell.ours.unwrap().value);
                    let Some(basis) = row.derivation(key, &bases) else {
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
            let bases = Derivations::of(&recorded_runs);
            let numbers = |row: &Row| -> Vec<Option<f64>> {
                row.cells.iter().map(|cell| row.derivation(cell.column.key, &bases)?.value()).collect()
            };
            let wanted: Vec<_> = table.rows().map(numbers).collect();
            assert!(wanted.iter().flatten().any(Option::is_some), "{}", table.name);
            let mut other = table.clone();
            for row in other.parts.iter_mut().flat_map(|part| &mut part.rows) {
                row.labels.iter_mut().for_each(|label| *label = "renamed".into());
            }
            other.parts.iter_mut().for_each(|part| part.rows.reverse());
            let mut estimated: Vec<_> = other.rows().map(numbers).collect();
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
