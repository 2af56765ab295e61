//! The two MetaDrive tables: parent against evolved generator on held-out scenes, averaged over egos and an ego a row.

use std::collections::{BTreeMap, BTreeSet};

use super::error::TableError;
use super::key::{RowKey, Side};
use super::labels::{self, LineageLabels, Reading, ReplayLabels};
use super::layout::{Cell, Column, Form, Head, METHOD, Numbers, POLICY, Part, REPLAY, ROLLOUTS, Row, Table};
use super::notes;
use super::paper::{self, Figures, metadrive as printed};
use super::searches::{searches, stops};
use crate::evidence::recorded_run::RecordedRun;
use crate::kernel::Digest;
use crate::objects::replay::ReplayScene;
use crate::statistics::bootstrap::{self, Estimate, PerScene, Quantity, Search};
use crate::text::counted;

const fn column(
    key: &'static str,
    group: &'static str,
    head: &'static str,
    upward: Option<bool>,
    form: Form,
) -> Column {
    Column { key, group, head, upward, form }
}

const PARENT_ATTACK: Column = column("parent_attack", "Parent", "Attack", Some(true), Form::Rate);
const PARENT_CRASH: Column = column("parent_any_contact", "Parent", "Any crash", None, Form::Rate);
const PARENT_RP: Column = column("parent_rp_pct", "Parent", "RP", Some(false), Form::Percent);
const PARENT_SUCCESS_RP: Column =
    column("parent_success_rp_pct", "Parent", "RP of successes", Some(false), Form::Percent);
const PARENT_COVERAGE: Column = column("parent_coverage", "Parent", "Coverage", Some(true), Form::Rate);
const EVOLVED_ATTACK: Column = column("evolved_attack", "Evolved", "Attack", Some(true), Form::Rate);
const EVOLVED_CRASH: Column = column("evolved_any_contact", "Evolved", "Any crash", None, Form::Rate);
const EVOLVED_RP: Column = column("evolved_rp_pct", "Evolved", "RP", Some(false), Form::Percent);
const EVOLVED_SUCCESS_RP: Column =
    column("evolved_success_rp_pct", "Evolved", "RP of successes", Some(false), Form::Percent);
const EVOLVED_COVERAGE: Column = column("evolved_coverage", "Evolved", "Coverage", Some(true), Form::Rate);
const ENDPOINT_ATTACK: Column = column("endpoint_attack", "Endpoint", "Attack", Some(true), Form::Rate);
const ENDPOINT_RP: Column = column("endpoint_rp_pct", "Endpoint", "RP", Some(false), Form::Percent);
const ATTACK_CHANGE: Column = column("attack_change", "Change", "Attack diff.", Some(true), Form::RateChange);
const ATTACK_CHANGE_PCT: Column = column("attack_change_pct", "Change", "Attack rel.", Some(true), Form::Gain);
const RP_CHANGE: Column = column("rp_change_pp", "Change", "RP", Some(false), Form::Points);
const PF_AREA: Column = column("pf_area_at_3_pct", "Frontier", "PF-Area@3", Some(true), Form::Gain);

/// A column with the side and the reading that its number is a mean of.
type Read = (Column, Side, Reading);

/// Columns that are means over labels.
const READ: [Read; 12] = [
    (PARENT_ATTACK, Side::Parent, labels::ATTACK),
    (PARENT_CRASH, Side::Parent, labels::ANY_CONTACT),
    (PARENT_RP, Side::Parent, labels::PENALTY_PCT),
    (PARENT_SUCCESS_RP, Side::Parent, labels::SUCCESS_PENALTY_PCT),
    (PARENT_COVERAGE, Side::Parent, labels::ACTED),
    (EVOLVED_ATTACK, Side::Evolved, labels::ATTACK),
    (EVOLVED_CRASH, Side::Evolved, labels::ANY_CONTACT),
    (EVOLVED_RP, Side::Evolved, labels::PENALTY_PCT),
    (EVOLVED_SUCCESS_RP, Side::Evolved, labels::SUCCESS_PENALTY_PCT),
    (EVOLVED_COVERAGE, Side::Evolved, labels::ACTED),
    (ATTACK_CHANGE, Side::Change, labels::ATTACK),
    (RP_CHANGE, Side::Change, labels::PENALTY_PCT),
];
const READ_AT_THE_END: [Read; 2] =
    [(ENDPOINT_ATTACK, Side::Endpoint, labels::ATTACK), (ENDPOINT_RP, Side::Endpoint, labels::PENALTY_PCT)];

/// A number of a scene without a program.
type ReplayRead = fn(&ReplayScene) -> Option<f64>;

/// Columns of the row without a program. The empty program acts nowhere, so its attack and coverage are 0; RP is that of the
/// recorded traffic itself.
const READ_OF_REPLAY: [(Column, ReplayRead); 4] = [
    (PARENT_ATTACK, |_| Some(0.0)),
    (PARENT_CRASH, |scene| Some(labels::share(scene.contact))),
    (PARENT_RP, |scene| Some(100.0 * (1.0 - scene.realism?))),
    (PARENT_COVERAGE, |_| Some(0.0)),
];

/// Side and reading of a column that is a mean over labels.
pub(super) fn read_of(key: &str) -> Option<(Side, Reading)> {
    let estimated = READ.iter().chain(&READ_AT_THE_END).find(|(column, ..)| column.key == key);
    estimated.map(|(_, side, reading)| (*side, *reading))
}

/// What a column of the row without a program is a mean of.
pub(super) fn read_of_replay(key: &str) -> Option<ReplayRead> {
    READ_OF_REPLAY.iter().find(|(column, _)| column.key == key).map(|(_, read)| *read)
}

/// Keys of the relative change with those of its two numbers: the change, paired by scene, and what it is taken of.
pub(super) const RELATIVE: [&str; 3] = [ATTACK_CHANGE_PCT.key, ATTACK_CHANGE.key, PARENT_ATTACK.key];
/// Key of the column of frontier gains.
pub(super) const FRONTIER: &str = PF_AREA.key;

/// What both tables show of parent and evolved generator.
const BOTH: [Column; 10] = [
    PARENT_ATTACK,
    PARENT_CRASH,
    PARENT_RP,
    PARENT_SUCCESS_RP,
    PARENT_COVERAGE,
    EVOLVED_ATTACK,
    EVOLVED_CRASH,
    EVOLVED_RP,
    EVOLVED_SUCCESS_RP,
    EVOLVED_COVERAGE,
];

/// Columns of the main table.
fn main_columns() -> Vec<Column> {
    BOTH.into_iter().chain([ATTACK_CHANGE, ATTACK_CHANGE_PCT, RP_CHANGE, PF_AREA]).collect()
}

/// Columns of the table by policy.
fn policy_columns() -> Vec<Column> {
    BOTH.into_iter().chain([ENDPOINT_ATTACK, ENDPOINT_RP, ATTACK_CHANGE, RP_CHANGE, PF_AREA]).collect()
}

/// The paper's main table: a row a family, averaged over those of the paper's egos that were run.
pub fn metadrive_main(runs: &[RecordedRun]) -> Result<Table, TableError> {
    let all = labels::lineages(runs)?;
    let mut groups: Vec<&str> = printed::METHODS.iter().map(|method| method.group).collect();
    groups.dedup();
    let averaged = |l: &&LineageLabels| l.method.is_some() && paper::policy_name(&l.ego).is_some();
    let mut rows: Vec<Row> = replay_row(&labels::replays(runs)?, &main_columns()).into_iter().collect();
    for group in groups {
        let of: Vec<&LineageLabels> = all.iter().filter(averaged).filter(|l| l.group() == group).collect();
        rows.push(main_row(group, &of, printed::main_figures(group)));
    }
    rows.extend(searches(all.iter().filter(|l| !averaged(l))).iter().map(|of| main_row(&of[0].label, of, None)));
    let average = format!(
        "The paper averages over the egos IDM and RL; ours averages over those that were run, named in the column Policy. \
         SAGE averages over its preference weights too, as in the paper ({}).",
        printed::POLICY_LABEL
    );
    let title = "Generator evolution in MetaDrive";
    let notes = notes(runs, &all, &rows, Some(average));
    table("metadrive-main", title, printed::MAIN_LABEL, &main_columns(), rows, notes, runs)
}

/// The paper's table by policy: a row a generator and ego, with the best descendant of the local trace.
pub fn metadrive_policy(runs: &[RecordedRun]) -> Result<Table, TableError> {
    let all = labels::lineages(runs)?;
    let of_each = |replay: ReplayLabels| replay_row(&[replay], &policy_columns());
    let mut rows: Vec<Row> = labels::replays(runs)?.into_iter().filter_map(of_each).collect();
    for method in &printed::METHODS {
        for (ego, policy) in expected_policies(&all) {
            let estimated: Vec<&LineageLabels> =
                all.iter().filter(|l| l.method == Some(method) && l.ego == ego).collect();
            let theirs = printed::policy_figures(method.name, policy);
            rows.push(policy_row(method.name, policy, &estimated, theirs));
        }
    }
    let others = all.iter().filter(|l| l.method.is_none() || paper::policy_name(&l.ego).is_none());
    rows.extend(searches(others).iter().map(|of| policy_row(&of[0].label, &of[0].policy, of, None)));
    let title = "Policy-specific results in MetaDrive";
    let notes = notes(runs, &all, &rows, None);
    table("metadrive-policy", title, printed::POLICY_LABEL, &policy_columns(), rows, notes, runs)
}

pub(super) const SCENES: Head = Head { key: "held_out_scenes", head: "Scenes" };
pub(super) const SEEDS: Head = Head { key: "seeds", head: "Seeds" };

fn table(
    name: &'static str,
    title: &str,
    source: &'static str,
    columns: &[Column],
    rows: Vec<Row>,
    notes: Vec<String>,
    runs: &[RecordedRun],
) -> Result<Table, TableError> {
    let parts = vec![Part { name: name.into(), title: title.into(), source: Some(source), rows }];
    let (labels, counts) = (vec![METHOD, POLICY], vec![SCENES, SEEDS, ROLLOUTS]);
    Ok(Table { name, labels, columns: columns.to_vec(), counts, parts, runs: notes::runs(runs)?, notes })
}

/// The paper's policies whose rows are listed also where a lineage is missing: IDM, and the learned one once it was run.
fn expected_policies(all: &[LineageLabels]) -> Vec<(&'static str, &'static str)> {
    let wanted = |(ego, _): &&(&str, &str)| *ego == "idm" || all.iter().any(|l| l.ego == *ego);
    paper::POLICIES.iter().filter(wanted).copied().collect()
}

fn main_row(method: &str, of: &[&LineageLabels], figures: Option<Figures>) -> Row {
    let mut ours = measured(of);
    // The row's own change: where scenes lack a label, parent and evolved rest on different ones, and their difference is no change.
    if let (Some(before), Some(change)) = (ours.get(PARENT_ATTACK.key), ours.get(ATTACK_CHANGE.key)) {
        let relative = (before.value > 0.0).then(|| 100.0 * change.value / before.value);
        ours.extend(relative.map(|relative| (ATTACK_CHANGE_PCT.key, Estimate::plain(relative))));
    }
    let cells = Cell::row(&main_columns(), &ours, figures.as_ref());
    row(method, policies(of), of, cells)
}

/// The egos of these lineages as tables call them.
pub(super) fn policies(of: &[&LineageLabels]) -> String {
    let all: BTreeSet<&str> = of.iter().map(|l| l.policy.as_str()).collect();
    all.into_iter().collect::<Vec<_>>().join(" + ")
}

fn policy_row(method: &str, policy: &str, of: &[&LineageLabels], figures: Option<Figures>) -> Row {
    let mut ours = measured(of);
    ours.extend(endpoint(of));
    row(method, policy.to_string(), of, Cell::row(&policy_columns(), &ours, figures.as_ref()))
}

/// The recorded scenes without a program, under the columns of a parent; `None` where no run recorded them.
fn replay_row(of: &[ReplayLabels], columns: &[Column]) -> Option<Row> {
    let quantity = |value: ReplayRead| -> Quantity {
        of.iter().map(|replay| Search { id: replay.suite, seeds: vec![replay.per_scene(value)] }).collect()
    };
    let ours = estimated(&READ_OF_REPLAY.map(|(column, value)| (column, quantity(value))));
    let policies: BTreeSet<String> = of.iter().map(|replay| replay.policy.clone()).collect();
    let suites: BTreeMap<_, usize> = of.iter().map(|replay| (replay.suite, replay.scenes.len())).collect();
    (!of.is_empty()).then(|| Row {
        key: RowKey::Replay { egos: of.iter().map(ReplayLabels::key).collect(), metric: None },
        labels: vec![REPLAY.to_string(), policies.into_iter().collect::<Vec<_>>().join(" + ")],
        lineages: of.iter().map(|replay| format!("replay/{}", replay.ego)).collect(),
        cells: Cell::row(columns, &ours, None),
        counts: vec![suites.values().sum(), 1, of.iter().map(|replay| replay.scenes.iter().flatten().count()).sum()],
        proposals: "none".into(),
        notes: Vec::new(),
    })
}

/// A number of every lineage, gathered by search.
pub(super) fn quantity(of: &[&LineageLabels], part: impl Fn(&LineageLabels) -> PerScene) -> Quantity {
    let gathered = |of: &Vec<&LineageLabels>| Search {
        id: Digest::of_bytes(format!("{} {}", of[0].name, of[0].ego).as_bytes()),
        seeds: of.iter().map(|l| part(l)).collect(),
    };
    searches(of.iter().copied()).iter().map(gathered).collect()
}

/// Readings of parent and evolved, the differences evolved - parent paired by scene, and PF-Area@3: means over searches
/// and their seeds.
fn measured(of: &[&LineageLabels]) -> Numbers {
    let mut numbers = estimated(&READ.map(|(column, side, reading)| (column, quantity(of, |l| l.read(side, reading)))));
    numbers.extend(pf_area(of).map(|area| (PF_AREA.key, area)));
    numbers
}

/// PF-Area@3, with the spread between seeds where a search was repeated.
fn pf_area(of: &[&LineageLabels]) -> Option<Estimate> {
    of_lineages(of, |l| Some(l.pf_area_at_3_pct))
}

/// A number of a lineage as a whole, with the spread between seeds where a search was repeated.
pub(super) fn of_lineages(of: &[&LineageLabels], number: impl Fn(&LineageLabels) -> Option<f64>) -> Option<Estimate> {
    // One value a seed: as a suite of one scene.
    let suite = Digest::of_bytes(b"one value");
    let numbers = quantity(of, |l| PerScene { suite, values: vec![number(l)] });
    let repeated = numbers.iter().any(|search| search.seeds.len() > 1);
    let estimated = bootstrap::estimates(&[numbers]).into_iter().next().flatten()?;
    Some(if repeated { estimated } else { Estimate::plain(estimated.value) })
}

/// Attack and RP of the best descendants; nothing where a lineage has none.
fn endpoint(of: &[&LineageLabels]) -> Numbers {
    if of.iter().any(|l| l.endpoint.is_none()) {
        return Numbers::new();
    }
    estimated(&READ_AT_THE_END.map(|(column, side, reading)| (column, quantity(of, |l| l.read(side, reading)))))
}

/// The quantities of these columns with their intervals, all from the same draws.
pub(super) fn estimated(quantities: &[(Column, Quantity)]) -> Numbers {
    let (columns, quantities): (Vec<Column>, Vec<Quantity>) = quantities.iter().cloned().unzip();
    let estimated = columns.iter().zip(bootstrap::estimates(&quantities));
    estimated.filter_map(|(column, estimate)| Some((column.key, estimate?))).collect()
}

/// A row of these lineages, with what stopped those that show no gain.
pub(super) fn row(method: &str, policy: String, of: &[&LineageLabels], cells: Vec<Cell>) -> Row {
    let suites: BTreeMap<_, usize> = of.iter().map(|l| (l.suite, l.suite_scenes)).collect();
    let kinds: BTreeSet<&str> = of.iter().flat_map(|l| l.proposals.split(" + ")).collect();
    let seeds = searches(of.iter().copied()).iter().map(Vec::len).max().unwrap_or(0);
    Row {
        key: RowKey::of(of.iter().map(|l| l.key())),
        labels: vec![method.to_string(), policy],
        lineages: of.iter().map(|l| l.lineage.to_string()).collect(),
        cells,
        counts: vec![suites.values().sum(), seeds, of.iter().map(|l| l.rollouts).sum()],
        proposals: kinds.into_iter().collect::<Vec<_>>().join(" + "),
        notes: searches(of.iter().copied()).iter().flat_map(|of| stops(of)).collect(),
    }
}

/// What counts as an attack where the experiment has no expression of its own. A run's events do not say which reading it counted, so
/// the note is true of each.
const PROTOCOLS_ATTACK: &str = "Attack: share of held-out scenes in which the ego fails by a contact with an adversary that the experiment \
                                counts: any that the program brings about (published reading), one that the ego could have prevented \
                                (preventable), or, where a file names neither, one that it caused or could have avoided.";

/// What a reader must know beside the numbers.
fn notes(runs: &[RecordedRun], all: &[LineageLabels], rows: &[Row], average: Option<String>) -> Vec<String> {
    let mut notes = vec![
        format!(
            "{PROTOCOLS_ATTACK} Any crash: share in which the ego meets anyone, as MetaDrive and CAT \
         count. RP = 100 (1 - r) over the scenes that the program acts in; RP of successes: over those in which it succeeds. The \
         search uses strict realism, which goes by the larger RP of the two, so that small nudges in other scenes gain nothing. Coverage: share of scenes acted in. \
         Evolved: the active generator, chosen on evolution labels."
        ),
        format!(
            "{REPLAY}: the recorded scenes without a program. Its crashes are what the ego runs into anyway, its RP is that of \
             the recorded traffic itself. A program that does nothing has attack and coverage 0, and no place in the frontier."
        ),
        notes::intervals("held-out scenes")
            + " Differences are paired by scene, that of RP over the scenes that both act in. PF-Area@3 varies over seeds only, the \
               relative change has no interval.",
    ];
    notes.extend(notes::one_seed(&notes::repeats(all.iter()), "held-out scenes"));
    notes.extend(notes::all_alike(rows, 0, |column| column.form == Form::Rate));
    notes.extend(notes::own_attack(runs));
    notes.extend(average);
    if !all.iter().any(|l| paper::policy_name(&l.ego) == Some("RL")) {
        notes.push("The paper's learned ego (RL) is absent: no run named here has one.".into());
    }
    notes.extend(notes::of_runs(runs));
    let absent = missing(all);
    let own = runs.iter().all(|run| run.opened.attack.is_some());
    if own {
        notes[0] = notes[0].replace(PROTOCOLS_ATTACK, "Attack: see below.");
    }
    // The paper has no row under another measure, so none is missing.
    if !absent.is_empty() && !own {
        notes.push(format!("Missing in these runs: {}.", absent.join(", ")));
    }
    if all.iter().map(|l| l.suite).collect::<BTreeSet<_>>().len() > 1 {
        notes.push("The runs have different held-out scenes: rows of different runs are not paired by scene.".into());
    }
    notes.extend(notes::different_versions(runs));
    for l in all {
        let count = l.parent.unlabelled().max(l.evolved.unlabelled());
        if count > 0 {
            notes.push(format!(
                "{}: up to {count} of {} have no label and count nowhere.",
                l.lineage,
                counted(l.suite_scenes, "held-out scene")
            ));
        }
    }
    notes.extend(searches(all.iter()).iter().filter_map(|of| stops(of)));
    notes
}

/// The paper's rows without a lineage in these runs.
fn missing(all: &[LineageLabels]) -> Vec<String> {
    let mut absent = Vec::new();
    for (ego, policy) in expected_policies(all) {
        let gone = printed::METHODS.iter().filter(|m| !all.iter().any(|l| l.method == Some(*m) && l.ego == ego));
        absent.extend(gone.map(|m| format!("{} with {policy}", m.name)));
    }
    absent
}
