//! The two MetaDrive tables: parent against evolved generator on held-out scenes, averaged over egos and an ego a row.

use std::collections::{BTreeMap, BTreeSet};

use super::basis::Derivation;
use super::derivations::{Derivations, ReplayRead, Source};
use super::error::TableError;
use super::key::{RowKey, Side};
use super::labels::{self, LineageLabels, Reading, ReplayLabels};
use super::layout::{
    Cell, Column, Form, Head, METHOD, Numbers, POLICY, Part, REPLAY, ROLLOUTS, Row, Sourced, Table, heads,
};
use super::notes;
use super::paper::{self, Figures, metadrive as printed};
use super::searches::{searches, stops};
use crate::evidence::recorded_run::RecordedRun;
use crate::kernel::Digest;
use crate::objects::RealismMean;
use crate::statistics::bootstrap::{self, PerScene, Quantity, Search};
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
const PARENT_COVERAGE: Column = column("parent_coverage", "Parent", "Coverage", Some(true), Form::Rate);

/// A column with the side and the reading that its number is a mean of.
pub(super) type Read = (Column, Side, Reading);

/// Columns of parent and evolved generator that both tables show.
const BOTH: [Read; 10] = [
    (PARENT_ATTACK, Side::Parent, labels::ATTACK),
    (PARENT_CRASH, Side::Parent, labels::ANY_CONTACT),
    (PARENT_RP, Side::Parent, labels::PENALTY_PCT),
    (success("parent_success_rp_pct", "Parent"), Side::Parent, labels::SUCCESS_PENALTY_PCT),
    (PARENT_COVERAGE, Side::Parent, labels::ACTED),
    (column("evolved_attack", "Evolved", "Attack", Some(true), Form::Rate), Side::Evolved, labels::ATTACK),
    (column("evolved_any_contact", "Evolved", "Any crash", None, Form::Rate), Side::Evolved, labels::ANY_CONTACT),
    (column("evolved_rp_pct", "Evolved", "RP", Some(false), Form::Percent), Side::Evolved, labels::PENALTY_PCT),
    (success("evolved_success_rp_pct", "Evolved"), Side::Evolved, labels::SUCCESS_PENALTY_PCT),
    (column("evolved_coverage", "Evolved", "Coverage", Some(true), Form::Rate), Side::Evolved, labels::ACTED),
];
const AT_THE_END: [Read; 2] = [
    (column("endpoint_attack", "Endpoint", "Attack", Some(true), Form::Rate), Side::Endpoint, labels::ATTACK),
    (column("endpoint_rp_pct", "Endpoint", "RP", Some(false), Form::Percent), Side::Endpoint, labels::PENALTY_PCT),
];
const ATTACK_CHANGE: Read =
    (column("attack_change", "Change", "Attack diff.", Some(true), Form::RateChange), Side::Change, labels::ATTACK);
const RP_CHANGE: Read =
    (column("rp_change_pp", "Change", "RP", Some(false), Form::Points), Side::Change, labels::PENALTY_PCT);

const fn success(key: &'static str, group: &'static str) -> Column {
    column(key, group, "RP of successes", Some(false), Form::Percent)
}

/// Columns of the row without a program. The empty program acts nowhere, so its coverage is 0; RP is that of the recorded traffic itself.
const READ_OF_REPLAY: [(Column, ReplayRead); 4] = [
    (PARENT_ATTACK, |scene, rules| Some(scene.attack(rules))),
    (PARENT_CRASH, |scene, _| Some(labels::share(scene.contact))),
    (PARENT_RP, |scene, _| Some(100.0 * (1.0 - scene.realism?))),
    (PARENT_COVERAGE, |_, _| Some(0.0)),
];

pub(super) fn sourced((column, side, reading): Read) -> Sourced {
    (column, Source::of(move |bases, row| bases.read(&bases.lineages_of(row), side, reading)))
}

/// The row's own change: where scenes lack a label, parent and evolved rest on different ones, and their difference is no change.
fn relative_change() -> Sourced {
    let source = Source::of(|bases, row| {
        let own = bases.lineages_of(row);
        let attack = |side| bases.read(&own, side, labels::ATTACK);
        let terms = [attack(Side::Change)?, attack(Side::Parent)?];
        Some(Derivation::percent("100 attack_change / parent_attack", terms))
    });
    (column("attack_change_pct", "Change", "Attack rel.", Some(true), Form::Gain), source)
}

/// PF-Area@3, with the spread between seeds where a search was repeated.
fn pf_area() -> Sourced {
    let column = column("pf_area_at_3_pct", "Frontier", "PF-Area@3", Some(true), Form::Gain);
    (column, Source::of(|bases, row| Some(bases.frontier(&bases.lineages_of(row)))))
}

/// Rollouts before the choice, where a program of these lineages rehearses.
fn looks(all: &[&LineageLabels]) -> Vec<Sourced> {
    let tells = |l: &&LineageLabels| l.evolved.values(labels::LOOKS.of).iter().any(Option::is_some);
    let column = column("evolved_search_rollouts", "Evolved", "Rollouts", None, Form::Rate);
    if all.iter().any(tells) { vec![sourced((column, Side::Evolved, labels::LOOKS))] } else { Vec::new() }
}

/// Columns of the main table.
fn main_columns(all: &[&LineageLabels]) -> Vec<Sourced> {
    let changes = [sourced(ATTACK_CHANGE), relative_change(), sourced(RP_CHANGE), pf_area()];
    BOTH.map(sourced).into_iter().chain(looks(all)).chain(changes).collect()
}

/// Columns of the table by policy.
fn policy_columns(all: &[&LineageLabels]) -> Vec<Sourced> {
    let at_the_end = AT_THE_END.into_iter().chain([ATTACK_CHANGE, RP_CHANGE]).map(sourced);
    BOTH.map(sourced).into_iter().chain(looks(all)).chain(at_the_end).chain([pf_area()]).collect()
}

/// The paper's main table: a row a family, averaged over those of the paper's egos that were run.
pub fn metadrive_main(runs: &[RecordedRun]) -> Result<Table, TableError> {
    let bases = Derivations::of(runs);
    let all = bases.lineages()?;
    let columns = main_columns(&all);
    let mut groups: Vec<&str> = printed::METHODS.iter().map(|method| method.group).collect();
    groups.dedup();
    let averaged = |l: &LineageLabels| l.method.is_some() && paper::policy_name(&l.ego).is_some();
    let main_row = |method: &str, of: &[&LineageLabels], figures: Option<Figures>| {
        row(&bases, vec![method.to_string(), policies(of)], of, &columns, figures.as_ref())
    };
    let replays: Vec<&ReplayLabels> = bases.replays()?.iter().collect();
    let without = (!replays.is_empty()).then(|| replay_row(&bases, &replays, &columns, &READ_OF_REPLAY));
    let mut rows: Vec<Row> = without.into_iter().collect();
    for group in groups {
        let of: Vec<&LineageLabels> = all.iter().copied().filter(|l| averaged(l) && l.group() == group).collect();
        rows.push(main_row(group, &of, printed::main_figures(group)));
    }
    let others = all.iter().copied().filter(|l| !averaged(l));
    rows.extend(searches(others).iter().map(|of| main_row(&of[0].label, of, None)));
    let average = format!(
        "The paper averages over the egos IDM and RL; ours averages over those that were run, named in the column Policy. \
         SAGE averages over its preference weights too, as in the paper ({}).",
        printed::POLICY_LABEL
    );
    let title = "Generator evolution in MetaDrive";
    let notes = notes(runs, &all, &rows, Some(average));
    table("metadrive-main", title, Some(printed::MAIN_LABEL), heads(&columns), rows, notes, runs)
}

/// The paper's table by policy: a row a generator and ego, with the best descendant of the local trace.
pub fn metadrive_policy(runs: &[RecordedRun]) -> Result<Table, TableError> {
    let bases = Derivations::of(runs);
    let all = bases.lineages()?;
    let columns = policy_columns(&all);
    let policy_row = |method: &str, policy: &str, of: &[&LineageLabels], figures: Option<Figures>| {
        row(&bases, vec![method.to_string(), policy.to_string()], of, &columns, figures.as_ref())
    };
    let of_each = |replay: &ReplayLabels| replay_row(&bases, &[replay], &columns, &READ_OF_REPLAY);
    let mut rows: Vec<Row> = bases.replays()?.iter().map(of_each).collect();
    for method in &printed::METHODS {
        for (ego, policy) in expected_policies(&all) {
            let of: Vec<&LineageLabels> =
                all.iter().copied().filter(|l| l.method == Some(method) && l.ego == ego).collect();
            rows.push(policy_row(method.name, policy, &of, printed::policy_figures(method.name, policy)));
        }
    }
    let others = all.iter().copied().filter(|l| l.method.is_none() || paper::policy_name(&l.ego).is_none());
    rows.extend(searches(others).iter().map(|of| policy_row(&of[0].label, &of[0].policy, of, None)));
    let title = "Policy-specific results in MetaDrive";
    let notes = notes(runs, &all, &rows, None);
    table("metadrive-policy", title, Some(printed::POLICY_LABEL), heads(&columns), rows, notes, runs)
}

pub(super) const SCENES: Head = Head { key: "held_out_scenes", head: "Scenes" };
pub(super) const SEEDS: Head = Head { key: "seeds", head: "Seeds" };

/// A table of one part, a row a method and ego.
pub(super) fn table(
    name: &'static str,
    title: &str,
    source: Option<&'static str>,
    columns: Vec<Column>,
    rows: Vec<Row>,
    notes: Vec<String>,
    runs: &[RecordedRun],
) -> Result<Table, TableError> {
    let parts = vec![Part { name: name.into(), title: title.into(), source, rows }];
    let (labels, counts) = (vec![METHOD, POLICY], vec![SCENES, SEEDS, ROLLOUTS]);
    Ok(Table { name, labels, columns, counts, parts, runs: notes::runs(runs)?, notes })
}

/// The paper's policies whose rows are listed also where a lineage is missing: IDM, and the learned one once it was run.
fn expected_policies(all: &[&LineageLabels]) -> Vec<(&'static str, &'static str)> {
    let wanted = |(ego, _): &&(&str, &str)| *ego == "idm" || all.iter().any(|l| l.ego == *ego);
    paper::POLICIES.iter().filter(wanted).copied().collect()
}

/// The egos of these lineages as tables call them.
pub(super) fn policies(of: &[&LineageLabels]) -> String {
    let all: BTreeSet<&str> = of.iter().map(|l| l.policy.as_str()).collect();
    all.into_iter().collect::<Vec<_>>().join(" + ")
}

/// Recorded scenes without a program, under those columns that say something of them.
pub(super) fn replay_row(
    bases: &Derivations<'_>,
    of: &[&ReplayLabels],
    columns: &[Sourced],
    read: &[(Column, ReplayRead)],
) -> Row {
    let sourced = |(column, _): &Sourced| {
        let read = read.iter().find(|(known, _)| known.key == column.key).map(|(_, read)| *read);
        (*column, read.map_or(Source::none(), |read| Source::of(move |bases, row| Some(bases.replayed(row, read)))))
    };
    let columns: Vec<Sourced> = columns.iter().map(sourced).collect();
    let policies: BTreeSet<&str> = of.iter().map(|replay| replay.policy.as_str()).collect();
    let suites: BTreeMap<_, usize> = of.iter().map(|replay| (replay.suite, replay.scenes.len())).collect();
    let key = RowKey::Replay(of.iter().map(|replay| replay.key()).collect());
    Row {
        labels: vec![REPLAY.to_string(), policies.into_iter().collect::<Vec<_>>().join(" + ")],
        lineages: of.iter().map(|replay| format!("replay/{}", replay.ego)).collect(),
        cells: Cell::derived(bases, &key, &columns, None),
        counts: vec![suites.values().sum(), 1, of.iter().map(|replay| replay.scenes.iter().flatten().count()).sum()],
        key,
        proposals: "none".into(),
        notes: Vec::new(),
    }
}

/// A number of every lineage, gathered by search.
pub(super) fn quantity(of: &[&LineageLabels], part: impl Fn(&LineageLabels) -> PerScene) -> Quantity {
    let gathered = |of: &Vec<&LineageLabels>| Search {
        id: Digest::of_bytes(format!("{} {}", of[0].name, of[0].ego).as_bytes()),
        seeds: of.iter().map(|l| part(l)).collect(),
    };
    searches(of.iter().copied()).iter().map(gathered).collect()
}

/// The quantities of these columns with their intervals, all from the same draws.
pub(super) fn estimated(quantities: &[(Column, Quantity)]) -> Numbers {
    let (columns, quantities): (Vec<Column>, Vec<Quantity>) = quantities.iter().cloned().unzip();
    let estimated = columns.iter().zip(bootstrap::estimates(&quantities));
    estimated.filter_map(|(column, estimate)| Some((column.key, estimate?))).collect()
}

/// A row of these lineages, with what stopped those that show no gain.
pub(super) fn row(
    bases: &Derivations<'_>,
    labels: Vec<String>,
    of: &[&LineageLabels],
    columns: &[Sourced],
    figures: Option<&Figures>,
) -> Row {
    let suites: BTreeMap<_, usize> = of.iter().map(|l| (l.suite, l.suite_scenes)).collect();
    let kinds: BTreeSet<&str> = of.iter().flat_map(|l| l.proposals.split(" + ")).collect();
    let seeds = searches(of.iter().copied()).iter().map(Vec::len).max().unwrap_or(0);
    let key = RowKey::Lineages(of.iter().map(|l| l.key()).collect());
    Row {
        labels,
        lineages: of.iter().map(|l| l.lineage.to_string()).collect(),
        cells: Cell::derived(bases, &key, columns, figures),
        key,
        counts: vec![suites.values().sum(), seeds, of.iter().map(|l| l.rollouts).sum()],
        proposals: kinds.into_iter().collect::<Vec<_>>().join(" + "),
        notes: searches(of.iter().copied()).iter().flat_map(|of| stops(of)).collect(),
    }
}

/// Definition of attack where the experiment has no expression of its own. A run's events do not say which reading it counted, so
/// the note is true of each.
const PROTOCOLS_ATTACK: &str = "Attack: share of held-out scenes in which the ego fails by a contact with an adversary that the experiment \
                                counts: any that the program brings about (published reading), one that the ego could have prevented \
                                (preventable), or, where a file names neither, one that it caused or could have avoided.";

/// Returns the notes that a reader needs beside the numbers.
fn notes(runs: &[RecordedRun], all: &[&LineageLabels], rows: &[Row], average: Option<String>) -> Vec<String> {
    let plain = runs.iter().filter(|run| run.label_rules().mean == RealismMean::Plain).count();
    let search_uses = if plain == runs.len() {
        "search uses the plain mean over all scenes."
    } else {
        "search uses strict realism, which goes by the larger RP of the two, so that small nudges in other scenes gain nothing."
    };
    let all_scenes = if plain > 0 { ", over all where the run's realism is the plain mean" } else { "" };
    let nothing = if runs.iter().any(|run| run.label_rules().counts_any_contact()) {
        "coverage 0, and where an experiment asks nothing of a contact, its attack is what the ego runs into anyway"
    } else {
        "attack and coverage 0, and no place in the frontier"
    };
    let mut notes = vec![
        format!(
            "{PROTOCOLS_ATTACK} Any crash: share in which the ego meets anyone, as MetaDrive and CAT \
         count. RP = 100 (1 - r) over the scenes that the program acts in{all_scenes}; RP of successes: over those in which it succeeds. The \
         {search_uses} Coverage: share of scenes acted in. \
         Evolved: the active generator, chosen on evolution labels."
        ),
        format!(
            "{REPLAY}: the recorded scenes without a program. Its crashes are what the ego runs into anyway, its RP is that of \
             the recorded traffic itself. A program that does nothing has {nothing}."
        ),
        notes::intervals("held-out scenes")
            + " Differences are paired by scene, that of RP over the scenes that both act in. PF-Area@3 varies over seeds only, the \
               relative change has no interval.",
    ];
    notes.extend(notes::one_seed(&notes::repeats(all.iter().copied()), "held-out scenes"));
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
    notes.extend(searches(all.iter().copied()).iter().filter_map(|of| stops(of)));
    notes
}

/// The paper's rows without a lineage in these runs.
fn missing(all: &[&LineageLabels]) -> Vec<String> {
    let mut absent = Vec::new();
    for (ego, policy) in expected_policies(all) {
        let gone = printed::METHODS.iter().filter(|m| !all.iter().any(|l| l.method == Some(*m) && l.ego == ego));
        absent.extend(gone.map(|m| format!("{} with {policy}", m.name)));
    }
    absent
}
