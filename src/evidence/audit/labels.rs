//! Labels: measured or absent, means of their scenes, from scenes that were open at the time; fronts and results made of
//! recorded labels only.

use std::collections::{BTreeMap, BTreeSet};

use super::finding::Finding;
use crate::evidence::recorded_run::RecordedRun;
use crate::kernel::num;
use crate::objects::event::{LineageResult, Measured};
use crate::objects::{LineageId, Objectives, Score, SolutionId};

/// Up to which difference a mean counts as the recorded one: the order of a sum may differ.
const TOLERANCE: f64 = 1e-9;

pub fn check(run: &RecordedRun, findings: &mut Vec<Finding>) {
    let opened = &run.opened;
    let both = opened.evolution_scenes.iter().filter(|scene| opened.held_out_scenes.contains(scene));
    findings
        .extend(both.map(|scene| Finding::breach("closed suite", scene, "is both an evolution and a held-out scene")));
    let evolution: BTreeSet<&str> = opened.evolution_scenes.iter().map(String::as_str).collect();
    let held_out: BTreeSet<&str> = opened.held_out_scenes.iter().map(String::as_str).collect();
    let mut of = |place: String, score: &Score, open: &BTreeSet<&str>| {
        score_faults(score).for_each(|what| findings.push(Finding::breach("labels", &place, what)));
        let named = score.scenes.iter().map(|s| &s.scene).chain(score.failures.iter().map(|f| &f.scene));
        for scene in named.filter(|scene| !open.contains(scene.as_str())) {
            let what = format!("has a label of scene {scene}, which was not open to it");
            findings.push(Finding::breach("closed suite", &place, what));
        }
    };
    for frozen in &run.frozen {
        let place = format!("{} epoch {}", frozen.lineage, frozen.epoch);
        of(place, &frozen.parent_score, &evolution);
        let window: BTreeSet<&str> = frozen.window.iter().map(String::as_str).collect();
        let epoch = run.attempts.iter().filter(|a| a.lineage == frozen.lineage && a.epoch == frozen.epoch);
        epoch.for_each(|a| a.exit.score().into_iter().for_each(|score| of(a.id.to_string(), score, &window)));
    }
    run.finalists.iter().for_each(|f| of(f.solution.to_string(), &f.score, &evolution));
    run.held_out.iter().for_each(|h| of(format!("{} on held-out scenes", h.solution), &h.score, &held_out));
    fronts(run, findings);
    for lineage in run.result.iter().flat_map(|result| &result.lineages) {
        measured(run, lineage, findings);
    }
}

/// What is wrong with labels taken by themselves.
fn score_faults(score: &Score) -> impl Iterator<Item = String> {
    let scenes = score.scenes.iter();
    let out_of_range = scenes.filter(|s| !(0.0..=1.0).contains(&s.attack) || !(0.0..=1.0).contains(&s.realism));
    let mut faults: Vec<String> = out_of_range
        .map(|s| format!("attack {} and realism {} of scene {} are no rates", s.attack, s.realism, s.scene))
        .collect();
    let labelled: BTreeSet<&str> = score.scenes.iter().map(|s| s.scene.as_str()).collect();
    if labelled.len() != score.scenes.len() {
        faults.push("a scene is labelled twice".into());
    }
    let failed = score.failures.iter().filter(|failure| labelled.contains(failure.scene.as_str()));
    faults.extend(failed.map(|failure| format!("scene {} both failed and has a label", failure.scene)));
    // SafeBench's objectives are read off its own rows; `tables` compares those with their runs.
    if score.benchmark.is_none() {
        let attack: Vec<f64> = score.scenes.iter().map(|s| s.attack).collect();
        let realism: Vec<f64> = score.scenes.iter().map(|s| s.realism).collect();
        let means = num::mean(&attack).zip(num::mean(&realism)).map(|(attack, realism)| Objectives { attack, realism });
        if !means.is_some_and(|means| same(&means, &score.objectives)) {
            faults.push(format!("objectives {:?} are not the means of the scenes, {means:?}", score.objectives));
        }
    }
    faults.into_iter()
}

fn same(a: &Objectives, b: &Objectives) -> bool {
    (a.attack - b.attack).abs() <= TOLERANCE && (a.realism - b.realism).abs() <= TOLERANCE
}

/// Every member of a front has the labels that its attempt or the parent's first window recorded; none dominates another.
fn fronts(run: &RecordedRun, findings: &mut Vec<Finding>) {
    let mut labels: BTreeMap<(&LineageId, &SolutionId), Vec<Objectives>> = BTreeMap::new();
    for frozen in &run.frozen {
        labels.entry((&frozen.lineage, &frozen.parent)).or_default().push(frozen.parent_score.objectives);
    }
    for attempt in &run.attempts {
        if let (Some(candidate), Some(score)) = (attempt.exit.candidate(), attempt.exit.score()) {
            let solution = &candidate.program.solution_id;
            labels.entry((&attempt.lineage, solution)).or_default().push(score.objectives);
        }
    }
    for settled in &run.settled {
        let place = format!("{} epoch {}", settled.lineage, settled.epoch);
        for member in &settled.front {
            let recorded = labels.get(&(&settled.lineage, &member.solution));
            if !recorded.is_some_and(|all| all.iter().any(|objectives| same(objectives, &member.objectives))) {
                let what = format!("{} is on the front with labels that no rollout gave it", member.solution);
                findings.push(Finding::breach("front", &place, what));
            }
            if let Some(better) = settled.front.iter().find(|other| other.objectives.dominates(&member.objectives)) {
                let what = format!("{} is on the front, but {} dominates it", member.solution, better.solution);
                findings.push(Finding::breach("front", &place, what));
            }
        }
    }
}

/// Every number of the result is a held-out label of the program that it names.
fn measured(run: &RecordedRun, lineage: &LineageResult, findings: &mut Vec<Finding>) {
    let named = [Some(&lineage.parent), Some(&lineage.evolved), lineage.endpoint.as_ref()];
    for Measured { solution, objectives, realism_penalty_pct } in named.into_iter().flatten() {
        let found = run.held_out.iter().find(|h| h.lineage == lineage.lineage && h.solution == *solution);
        let penalty = (objectives.realism_penalty_pct() - realism_penalty_pct).abs() <= TOLERANCE;
        if !penalty || !found.is_some_and(|held_out| same(&held_out.score.objectives, objectives)) {
            let what = format!("the result gives {solution} numbers that are not its held-out labels");
            findings.push(Finding::breach("result", &lineage.lineage, what));
        }
    }
}
