//! The two MetaDrive tables: parent against evolved generator on held-out scenes, averaged over egos and an ego a row.

use std::collections::{BTreeMap, BTreeSet};

use super::bootstrap::{self, Estimate, PerScene, Quantity};
use super::labels::{self, LineageLabels, TableError};
use super::layout::{Cell, Column, Form, Head, METHOD, Numbers, POLICY, Part, ROLLOUTS, Row, Table};
use super::notes;
use super::paper::{self, Figures, metadrive as printed};
use crate::evidence::recorded_run::RecordedRun;
use crate::kernel::num;

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
const PARENT_RP: Column = column("parent_rp_pct", "Parent", "RP", Some(false), Form::Percent);
const EVOLVED_ATTACK: Column = column("evolved_attack", "Evolved", "Attack", Some(true), Form::Rate);
const EVOLVED_RP: Column = column("evolved_rp_pct", "Evolved", "RP", Some(false), Form::Percent);
const ENDPOINT_ATTACK: Column = column("endpoint_attack", "Endpoint", "Attack", Some(true), Form::Rate);
const ENDPOINT_RP: Column = column("endpoint_rp_pct", "Endpoint", "RP", Some(false), Form::Percent);
const ATTACK_CHANGE: Column = column("attack_change", "Change", "Attack diff.", Some(true), Form::RateChange);
const ATTACK_CHANGE_PCT: Column = column("attack_change_pct", "Change", "Attack rel.", Some(true), Form::Gain);
const RP_CHANGE: Column = column("rp_change_pp", "Change", "RP", Some(false), Form::Points);
const PF_AREA: Column = column("pf_area_at_3_pct", "Frontier", "PF-Area@3", Some(true), Form::Gain);

/// Columns of the main table.
const MAIN: [Column; 8] =
    [PARENT_ATTACK, PARENT_RP, EVOLVED_ATTACK, EVOLVED_RP, ATTACK_CHANGE, ATTACK_CHANGE_PCT, RP_CHANGE, PF_AREA];

/// Columns of the table by policy.
const BY_POLICY: [Column; 9] = [
    PARENT_ATTACK,
    PARENT_RP,
    EVOLVED_ATTACK,
    EVOLVED_RP,
    ENDPOINT_ATTACK,
    ENDPOINT_RP,
    ATTACK_CHANGE,
    RP_CHANGE,
    PF_AREA,
];

/// The paper's main table: a row a family, averaged over those of the paper's egos that were run.
pub fn metadrive_main(stories: &[RecordedRun]) -> Result<Table, TableError> {
    let all = labels::lineages(stories)?;
    let mut groups: Vec<&str> = printed::METHODS.iter().map(|method| method.group).collect();
    groups.dedup();
    let averaged = |l: &&LineageLabels| l.method.is_some() && paper::policy_name(&l.ego).is_some();
    let mut rows = Vec::new();
    for group in groups {
        let of: Vec<&LineageLabels> = all.iter().filter(averaged).filter(|l| l.group() == group).collect();
        rows.push(main_row(group, &of, printed::main_figures(group)));
    }
    rows.extend(all.iter().filter(|l| !averaged(l)).map(|l| main_row(&l.name, &[l], None)));
    let average = format!(
        "The paper averages over the egos IDM and RL; ours averages over those that were run, named in the column Policy. \
         SAGE averages over its preference weights too, as in the paper ({}).",
        printed::POLICY_LABEL
    );
    let title = "Generator evolution in MetaDrive";
    table("metadrive-main", title, printed::MAIN_LABEL, &MAIN, rows, told(stories, &all, Some(average)), stories)
}

/// The paper's table by policy: a row a generator and ego, with the best descendant of the local trace.
pub fn metadrive_policy(stories: &[RecordedRun]) -> Result<Table, TableError> {
    let all = labels::lineages(stories)?;
    let mut rows = Vec::new();
    for method in &printed::METHODS {
        for (ego, policy) in expected_policies(&all) {
            let found = all.iter().find(|l| l.method == Some(method) && l.ego == ego);
            let theirs = printed::policy_figures(method.name, policy);
            rows.push(policy_row(method.name, policy, found, theirs));
        }
    }
    let others = all.iter().filter(|l| l.method.is_none() || paper::policy_name(&l.ego).is_none());
    rows.extend(others.map(|l| policy_row(&l.name, &l.policy(), Some(l), None)));
    let title = "Policy-specific results in MetaDrive";
    table("metadrive-policy", title, printed::POLICY_LABEL, &BY_POLICY, rows, told(stories, &all, None), stories)
}

const SCENES: Head = Head { key: "held_out_scenes", head: "Scenes" };

fn table(
    name: &'static str,
    title: &str,
    source: &'static str,
    columns: &[Column],
    rows: Vec<Row>,
    notes: Vec<String>,
    stories: &[RecordedRun],
) -> Result<Table, TableError> {
    let parts = vec![Part { name: name.into(), title: title.into(), source: Some(source), rows }];
    let (labels, counts) = (vec![METHOD, POLICY], vec![SCENES, ROLLOUTS]);
    Ok(Table { name, labels, columns: columns.to_vec(), counts, parts, runs: notes::runs(stories)?, notes })
}

/// The paper's policies whose rows are listed also where a lineage is missing: IDM, and the learned one once it was run.
fn expected_policies(all: &[LineageLabels]) -> Vec<(&'static str, &'static str)> {
    let wanted = |(ego, _): &&(&str, &str)| *ego == "idm" || all.iter().any(|l| l.ego == *ego);
    paper::POLICIES.iter().filter(wanted).copied().collect()
}

fn main_row(method: &str, of: &[&LineageLabels], figures: Option<Figures>) -> Row {
    let mut ours = measured(of);
    if let (Some(before), Some(after)) = (ours.get(PARENT_ATTACK.key), ours.get(EVOLVED_ATTACK.key)) {
        let relative = (before.value > 0.0).then(|| 100.0 * (after.value - before.value) / before.value);
        ours.extend(relative.map(|relative| (ATTACK_CHANGE_PCT.key, Estimate::plain(relative))));
    }
    let policies: BTreeSet<String> = of.iter().map(|l| l.policy()).collect();
    let cells = Cell::row(&MAIN, &ours, figures.as_ref());
    row(method, policies.into_iter().collect::<Vec<_>>().join(" + "), of, cells)
}

fn policy_row(method: &str, policy: &str, of: Option<&LineageLabels>, figures: Option<Figures>) -> Row {
    let of: Vec<&LineageLabels> = of.into_iter().collect();
    let mut ours = measured(&of);
    ours.extend(endpoint(&of));
    row(method, policy.to_string(), &of, Cell::row(&BY_POLICY, &ours, figures.as_ref()))
}

/// Attack and RP of parent and evolved, the differences evolved - parent paired by scene, and PF-Area@3: means over lineages.
fn measured(of: &[&LineageLabels]) -> Numbers {
    let each = |part: fn(&LineageLabels) -> PerScene| -> Quantity { of.iter().map(|l| part(l)).collect() };
    let mut numbers = estimated(&[
        (PARENT_ATTACK, each(|l| l.per_scene(&l.parent.attack))),
        (PARENT_RP, each(|l| l.per_scene(&l.parent.penalty_pct))),
        (EVOLVED_ATTACK, each(|l| l.per_scene(&l.evolved.attack))),
        (EVOLVED_RP, each(|l| l.per_scene(&l.evolved.penalty_pct))),
        (ATTACK_CHANGE, each(|l| l.paired(&l.parent.attack, &l.evolved.attack))),
        (RP_CHANGE, each(|l| l.paired(&l.parent.penalty_pct, &l.evolved.penalty_pct))),
    ]);
    let pf_area = num::mean(&of.iter().map(|l| l.pf_area_at_3_pct).collect::<Vec<_>>());
    numbers.extend(pf_area.map(|area| (PF_AREA.key, Estimate::plain(area))));
    numbers
}

/// Attack and RP of the best descendants; nothing where a lineage has none.
fn endpoint(of: &[&LineageLabels]) -> Numbers {
    let Some(ends) = of.iter().map(|l| l.endpoint.as_ref().map(|e| (l, e))).collect::<Option<Vec<_>>>() else {
        return Numbers::new();
    };
    estimated(&[
        (ENDPOINT_ATTACK, ends.iter().map(|(l, end)| l.per_scene(&end.attack)).collect()),
        (ENDPOINT_RP, ends.iter().map(|(l, end)| l.per_scene(&end.penalty_pct)).collect()),
    ])
}

/// The quantities of these columns with their intervals, all from the same draws.
fn estimated(quantities: &[(Column, Quantity)]) -> Numbers {
    let (columns, quantities): (Vec<Column>, Vec<Quantity>) = quantities.iter().cloned().unzip();
    let found = columns.iter().zip(bootstrap::estimates(&quantities));
    found.filter_map(|(column, estimate)| Some((column.key, estimate?))).collect()
}

fn row(method: &str, policy: String, of: &[&LineageLabels], cells: Vec<Cell>) -> Row {
    let suites: BTreeMap<_, usize> = of.iter().map(|l| (l.suite, l.suite_scenes)).collect();
    let kinds: BTreeSet<&str> = of.iter().flat_map(|l| l.proposals.split(" + ")).collect();
    Row {
        labels: vec![method.to_string(), policy],
        lineages: of.iter().map(|l| l.lineage.to_string()).collect(),
        cells,
        counts: vec![suites.values().sum(), of.iter().map(|l| l.rollouts).sum()],
        proposals: kinds.into_iter().collect::<Vec<_>>().join(" + "),
        notes: of
            .iter()
            .filter_map(|l| Some(format!("{}, {}: {}.", l.name, l.policy(), l.stopped.as_ref()?)))
            .collect(),
    }
}

/// What a reader must know beside the numbers.
fn told(stories: &[RecordedRun], all: &[LineageLabels], average: Option<String>) -> Vec<String> {
    let mut told = vec![
        "Attack: share of held-out scenes in which the ego fails. RP = 100 (1 - R). Evolved: the active generator, chosen on \
         evolution labels."
            .to_string(),
        format!(
            "In brackets: 95 % percentile bootstrap intervals over held-out scenes, {} resamples, seed {}; differences are paired by \
             scene. The relative change and PF-Area@3 have none.",
            bootstrap::RESAMPLES,
            bootstrap::SEED.0
        ),
    ];
    told.extend(average);
    if !all.iter().any(|l| paper::policy_name(&l.ego) == Some("RL")) {
        told.push("The paper's learned ego (RL) is absent: no run named here has one.".into());
    }
    told.extend(stories.iter().map(notes::run));
    let absent = missing(all);
    if !absent.is_empty() {
        told.push(format!("Missing in these runs: {}.", absent.join(", ")));
    }
    if all.iter().map(|l| l.suite).collect::<BTreeSet<_>>().len() > 1 {
        told.push("The runs have different held-out scenes: rows of different runs are not paired by scene.".into());
    }
    told.extend(notes::different_versions(stories));
    for l in all {
        let count = l.parent.unlabelled().max(l.evolved.unlabelled());
        if count > 0 {
            let scenes = l.suite_scenes;
            told.push(format!(
                "{}: up to {count} of {scenes} held-out scenes have no label and count nowhere.",
                l.lineage
            ));
        }
    }
    told.extend(all.iter().filter_map(|l| Some(format!("{}, {}: {}.", l.name, l.policy(), l.stopped.as_ref()?))));
    told
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
