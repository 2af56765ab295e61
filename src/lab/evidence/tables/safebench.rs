//! The SafeBench tables: what balanced selection keeps of the parent's scenes against what it keeps after the last round,
//! and every round by traffic family.

use std::collections::BTreeSet;

use super::archives::{self, LineageArchive, Round, Scores};
use super::error::TableError;
use super::key::{Kept, Of, Reads, RowKey};
use super::layout::{Cell, Column, Form, Head, METHOD, Numbers, POLICY, Part, REPLAY, ROLLOUTS, Row, Table};
use super::notes;
use super::paper::{
    self,
    safebench::{AVERAGE, EGO, MAIN_LABEL, METHODS, Method, ROUNDS},
};
use super::resampled::Resampled;
use super::searches::{searches, stops};
use crate::evidence::recorded_run::RecordedRun;
use crate::kernel::num;
use crate::objects::benchmark::{Benchmark, BenchmarkRow};
use crate::objects::replay::{ReplayRow, Suite};
use crate::scene::safebench::TrafficFamily;
use crate::statistics::bootstrap::Estimate;

const GROUPS: Head = Head { key: "groups", head: "Groups" };
const SCENES: Head = Head { key: "scenes", head: "Scenes" };
const SEEDS: Head = Head { key: "seeds", head: "Seeds" };
pub(super) const COUNTS: [Head; 4] = [GROUPS, SCENES, SEEDS, ROLLOUTS];

/// A rate of the tables, read off a row of the recorded scores.
struct Metric {
    name: &'static str,
    of: fn(&BenchmarkRow) -> f64,
}

const ATTACK: Metric = Metric { name: "Attack", of: |row| row.attack };
const ARS: Metric = Metric { name: "ARS", of: |row| row.realism };
const CR: Metric = Metric { name: "CR", of: |row| row.collision_rate };
const OS: Metric = Metric { name: "OS", of: |row| row.overall_score };

/// The paper's main table: a row a generator and ego.
pub fn safebench_main(runs: &[RecordedRun]) -> Result<Table, TableError> {
    let all = archives::lineages(runs)?;
    let columns = told_columns(&all);
    let row = |of: &Subject<'_>| {
        let ours = if of.seeds.is_empty() { Numbers::new() } else { main_numbers(&of.seeds) };
        let figures = of.printed.map(Method::main_figures);
        of.row(Reads::ByColumn, &[], Cell::row(&columns, &ours, figures.as_ref()))
    };
    let replays = replays(runs).into_iter().map(|replay| replay_row(replay, None, &columns));
    let rows: Vec<Row> = replays.chain(in_order(&all).iter().map(row)).collect();
    let notes = notes(runs, &all).into_iter().chain(saturated(&rows, &all)).chain(searched_more(&rows)).collect();
    let title = "Generator evolution on SafeBench's traffic families".to_string();
    Ok(Table {
        name: "safebench-main",
        labels: vec![METHOD, POLICY],
        columns: columns.clone(),
        counts: COUNTS.to_vec(),
        parts: vec![Part { name: "safebench-main".into(), title, source: Some(MAIN_LABEL), rows }],
        runs: notes::runs(runs)?,
        notes,
    })
}

/// A collision rate from which a row is called saturated.
const SATURATED: f64 = 0.95;

/// Columns of the main table.
pub(super) fn main_columns() -> Vec<Column> {
    let column = |key, group, head, upward, form| Column { key, group, head, upward: Some(upward), form };
    vec![
        column("parent_attack", "Parent", "Attack", true, Form::Rate),
        column("parent_ars", "Parent", "ARS", true, Form::Rate),
        column("parent_cr", "Parent", "CR", true, Form::Rate),
        column("parent_os", "Parent", "OS", false, Form::Rate),
        Column { upward: None, ..column(SEARCHED[0], "Parent", SEARCHED_HEAD, false, Form::Number) },
        column("redrawn_attack", REDRAWN, "Attack", true, Form::Rate),
        column("redrawn_ars", REDRAWN, "ARS", true, Form::Rate),
        column("redrawn_cr", REDRAWN, "CR", true, Form::Rate),
        column("redrawn_os", REDRAWN, "OS", false, Form::Rate),
        Column { upward: None, ..column(SEARCHED[1], REDRAWN, SEARCHED_HEAD, false, Form::Number) },
        column(FRONTIERS[0], REDRAWN, "PF-Area@3", true, Form::Gain),
        column("evolved_attack", "Evolved", "Attack", true, Form::Rate),
        column("evolved_ars", "Evolved", "ARS", true, Form::Rate),
        column("evolved_cr", "Evolved", "CR", true, Form::Rate),
        column("evolved_os", "Evolved", "OS", false, Form::Rate),
        Column { upward: None, ..column(SEARCHED[2], "Evolved", SEARCHED_HEAD, false, Form::Number) },
        column(FRONTIERS[1], "Evolved", "PF-Area@3", true, Form::Gain),
        column("attack_change_pct", "Change", "Attack rel.", true, Form::Gain),
        column("ars_change_pp", "Change", "ARS", true, Form::Points),
        column("cr_change_pp", "Change", "CR", true, Form::Points),
        column("os_change_pp", "Change", "OS", false, Form::Points),
        column(FRONTIERS[2], "Change", "PF-Area@3", true, Form::Points),
    ]
}

/// Of these without the cost of searches, where no run tells it.
pub(super) fn told_columns(all: &[LineageArchive]) -> Vec<Column> {
    let tells = |round: &Round| round.runs.values().flatten().any(|run| run.search_rollouts.is_some());
    let is_told = all.iter().any(|archive| archive.rounds.iter().any(tells));
    main_columns().into_iter().filter(|column| is_told || !SEARCHED.contains(&column.key)).collect()
}

/// Keys of what programs simulated against the ego, in the mean over the runs that are kept, before each run's scenario was chosen.
pub(super) const SEARCHED: [&str; 3] = ["parent_search_rollouts", "redrawn_search_rollouts", "evolved_search_rollouts"];
const SEARCHED_HEAD: &str = "Rollouts a scene";

/// What intervals of a search are drawn from.
fn resampled(seeds: &[&LineageArchive]) -> Resampled {
    Resampled::new(&seeds.iter().map(|archive| archive.archived()).collect::<Vec<_>>())
}

/// Ours under the keys of the main columns.
pub(super) fn main_numbers(seeds: &[&LineageArchive]) -> Numbers {
    let resampled = resampled(seeds);
    let estimated = |column: &Column| resampled.estimate(|scores| main_number(column.key, scores));
    main_columns().iter().filter_map(|column| Some((column.key, estimated(column)?))).collect()
}

/// Head over the columns of the parent that was drawn as often as the search drew.
pub(super) const REDRAWN: &str = "Parent redrawn";

/// Keys of the frontier gains: the redrawn parent's, the search's, and their difference.
pub(super) const FRONTIERS: [&str; 3] = ["redrawn_pf_area_at_3_pct", "pf_area_at_3_pct", "pf_area_change_pp"];

/// The number of a main column from one repetition's scores.
pub(super) fn main_number(key: &str, scores: &Scores) -> Option<f64> {
    let Scores { rounds, redrawn, gain_pct, redrawn_gain_pct } = scores;
    let parent = |metric: Metric| mean(rounds.first(), metric.of);
    let drawn = |metric: Metric| mean(redrawn.last(), metric.of);
    let after = |metric: Metric| mean(rounds.last(), metric.of);
    let points = |before: f64, after: f64| 100.0 * (after - before);
    match key {
        "parent_attack" => parent(ATTACK),
        "parent_ars" => parent(ARS),
        "parent_cr" => parent(CR),
        "parent_os" => parent(OS),
        "redrawn_attack" => drawn(ATTACK),
        "redrawn_ars" => drawn(ARS),
        "redrawn_cr" => drawn(CR),
        "redrawn_os" => drawn(OS),
        "evolved_attack" => after(ATTACK),
        "evolved_ars" => after(ARS),
        "evolved_cr" => after(CR),
        "evolved_os" => after(OS),
        "parent_search_rollouts" => searched(rounds.first()),
        "redrawn_search_rollouts" => searched(redrawn.last()),
        "evolved_search_rollouts" => searched(rounds.last()),
        "attack_change_pct" => {
            let (before, after) = (drawn(ATTACK)?, after(ATTACK)?);
            (before > 0.0).then(|| 100.0 * (after - before) / before)
        }
        "ars_change_pp" => Some(points(drawn(ARS)?, after(ARS)?)),
        "cr_change_pp" => Some(points(drawn(CR)?, after(CR)?)),
        "os_change_pp" => Some(points(drawn(OS)?, after(OS)?)),
        _ => {
            let place = FRONTIERS.iter().position(|of| *of == key)?;
            [*redrawn_gain_pct, *gain_pct, redrawn_gain_pct.zip(*gain_pct).map(|(before, after)| after - before)][place]
        }
    }
}

/// The number of a line of the tables by round, from one repetition's scores.
pub(super) fn round_number(metric: &str, round: usize, of: Kept, key: &str, scores: &Scores) -> Option<f64> {
    let line = LINES.iter().find(|line| line.name == metric)?;
    let rate = |rounds: &[Option<Benchmark>]| {
        let scores = rounds.get(round)?.as_ref()?;
        let row = if key == AVERAGE { &scores.mean } else { scores.families.get(key)? };
        Some((line.of)(row))
    };
    match of {
        Kept::Evolved => rate(&scores.rounds),
        Kept::Redrawn => rate(&scores.redrawn),
        Kept::Change => Some(rate(&scores.rounds)? - rate(&scores.redrawn)?),
    }
}

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

/// The row of a program that does nothing: under the parent's heads.
fn replay_row((run, replay): (usize, &ReplayRow), metric: Option<&'static str>, columns: &[Column]) -> Row {
    let mut ours = Numbers::new();
    if let Some(row) = &replay.benchmark {
        for (key, Metric { of, .. }) in
            [("parent_attack", ATTACK), ("parent_ars", ARS), ("parent_cr", CR), ("parent_os", OS)]
        {
            ours.insert(key, Estimate::plain(of(row)));
        }
    }
    Row {
        key: RowKey::Replay { egos: vec![Of { run, of: replay.ego.clone() }], metric },
        labels: vec![REPLAY.to_string(), paper::policy(&replay.ego)],
        lineages: vec![format!("replay/{}", replay.ego)],
        cells: Cell::row(columns, &ours, None),
        counts: vec![0, replay.scenes, 1, replay.scenes],
        proposals: "none".into(),
        notes: Vec::new(),
    }
}

/// The same for the tables by round: a line a metric, in the column of all families.
fn replay_part(runs: &[RecordedRun]) -> Option<Part> {
    let line = |of: (usize, &ReplayRow), metric: &Metric| {
        let replay = of.1;
        let ours: Numbers = replay.benchmark.iter().map(|row| (AVERAGE, Estimate::plain((metric.of)(row)))).collect();
        let row = replay_row(of, Some(metric.name), &[]);
        let labels = row.labels.iter().cloned().chain([metric.name.to_string(), "-".to_string()]).collect();
        Row { labels, cells: Cell::row(&round_columns(), &ours, None), ..row }
    };
    let rows: Vec<Row> =
        replays(runs).into_iter().flat_map(|replay| LINES.map(|metric| line(replay, &metric))).collect();
    let title = "The evolution scenes without a program".to_string();
    (!rows.is_empty()).then(|| Part { name: "safebench-rounds-replay".into(), title, source: None, rows })
}

/// Scenarios simulated before one was chosen, over all families after a round.
fn searched(round: Option<&Option<Benchmark>>) -> Option<f64> {
    round?.as_ref()?.mean.search_rollouts
}

/// A rate over all families after a round.
fn mean(round: Option<&Option<Benchmark>>, of: fn(&BenchmarkRow) -> f64) -> Option<f64> {
    Some(of(&round?.as_ref()?.mean))
}

/// The paper's tables by round: a part a generator and ego, a line a metric and round, a column a traffic family.
pub fn safebench_rounds(runs: &[RecordedRun]) -> Result<Table, TableError> {
    let all = archives::lineages(runs)?;
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
        parts: replay_part(runs).into_iter().chain(in_order(&all).iter().map(part)).collect(),
        runs: notes::runs(runs)?,
        notes: notes(runs, &all),
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
    let resampled = (!of.seeds.is_empty()).then(|| self::resampled(&of.seeds));
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
        let columns: Vec<Column> = round_columns().into_iter().map(|column| Column { form, ..column }).collect();
        let ours = |column: &Column| {
            let number = |scores: &Scores| round_number(metric.name, round, kept, column.key, scores);
            Some((column.key, resampled.as_ref()?.estimate(number)?))
        };
        let ours: Numbers = columns.iter().filter_map(ours).collect();
        let reads = Reads::Round { metric: metric.name, round, of: kept };
        of.row(reads, &[metric.name, &called], Cell::row(&columns, &ours, figures.as_ref()))
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

/// Who has a row or a part: a method of the paper with a search that fills it, or without, or a search alone.
pub(super) struct Subject<'a> {
    method: Option<&'static Method>,
    /// The method whose printed figures stand beside it: they are of the paper's ego, where that was run, and else beside what was.
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
    /// A row of numbers, with labels after the method and the ego.
    pub(super) fn row(&self, reads: Reads, labels: &[&str], cells: Vec<Cell>) -> Row {
        let policy = self.seeds.first().map_or(String::new(), |archive| archive.policy.clone());
        let groups: BTreeSet<_> = self.seeds.iter().flat_map(|archive| archive.groups()).collect();
        let sum = |of: fn(&LineageArchive) -> usize| self.seeds.iter().map(|archive| of(archive)).sum();
        Row {
            key: RowKey::reading(self.seeds.iter().map(|archive| archive.key()), reads),
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

/// Of how many of a row's groups every kept run of what it is compared with is a collision.
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

/// What a reader must know beside the numbers.
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
