//! Labels: measured or absent, means of their scenes, from scenes that were open at the time; fronts and results made of
//! recorded labels only.

use std::collections::{BTreeMap, BTreeSet};

use super::finding::Finding;
use crate::evaluation::scene_over_egos;
use crate::evidence::recorded_run::RecordedRun;
use crate::kernel::num;
use crate::objects::event::{Frozen, LineageResult, Measured};
use crate::objects::{AttackRequirement, FrontOf, LineageId, Objectives, RealismSums, SceneScore, Score, SolutionId};

/// Up to which difference a mean counts as the recorded one: the order of a sum may differ.
const TOLERANCE: f64 = 1e-9;

pub fn check(run: &RecordedRun, findings: &mut Vec<Finding>) {
    let opened = &run.opened;
    let open = opened.evolution_scenes.iter().map(|scene| (scene, "an evolution"));
    let open = open.chain(opened.selection_scenes.iter().map(|scene| (scene, "a selection")));
    let both = open.filter(|(scene, _)| opened.held_out_scenes.contains(scene));
    findings.extend(
        both.map(|(scene, of)| Finding::breach("closed suite", scene, format!("is both {of} and a held-out scene"))),
    );
    let searched = opened.evolution_scenes.iter().filter(|scene| opened.selection_scenes.contains(scene));
    findings.extend(
        searched.map(|scene| Finding::breach("closed suite", scene, "is both an evolution and a selection scene")),
    );
    let evolution: BTreeSet<&str> = opened.evolution_scenes.iter().map(String::as_str).collect();
    let held_out: BTreeSet<&str> = opened.held_out_scenes.iter().map(String::as_str).collect();
    let selection: BTreeSet<&str> = opened.selection_scenes.iter().map(String::as_str).collect();
    let chosen_on = if selection.is_empty() { &evolution } else { &selection };
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
    run.finalists.iter().for_each(|f| of(f.solution.to_string(), &f.score, chosen_on));
    run.held_out.iter().for_each(|h| of(format!("{} on held-out scenes", h.solution), &h.score, &held_out));
    fronts(run, findings);
    for lineage in run.result.iter().flat_map(|result| &result.lineages) {
        measured(run, lineage, findings);
    }
}

/// Returns the faults of labels taken by themselves.
fn score_faults(score: &Score) -> impl Iterator<Item = String> {
    let scenes = score.scenes.iter();
    let out_of_range = scenes.filter(|s| !(0.0..=1.0).contains(&s.attack) || !(0.0..=1.0).contains(&s.realism));
    let mut faults: Vec<String> = out_of_range
        .map(|s| {
            format!("attack {} and realism {} of scene {} are not both between 0 and 1", s.attack, s.realism, s.scene)
        })
        .collect();
    let labelled: BTreeSet<&str> = score.scenes.iter().map(|s| s.scene.as_str()).collect();
    if labelled.len() != score.scenes.len() {
        faults.push("a scene is labelled twice".into());
    }
    let failed = score.failures.iter().filter(|failure| labelled.contains(failure.scene.as_str()));
    faults.extend(failed.map(|failure| format!("scene {} both failed and has a label", failure.scene)));
    let asked = |of| score.rules.attack.has(of);
    let acts = asked(AttackRequirement::Acts);
    let alone = || score.scenes.iter().flat_map(SceneScore::each);
    let credited = alone().filter(|s| acts && !s.acted && s.attack > 0.0);
    faults
        .extend(credited.map(|s| format!("scene {} counts as attacked, but the program does not act in it", s.scene)));
    let met_anyway = |s: &&SceneScore| s.contact.as_ref().is_some_and(|met| met.anyway);
    let anyway = asked(AttackRequirement::NotMetAnyway);
    let unearned = alone().filter(|s| anyway && s.attack > 0.0).filter(met_anyway);
    faults
        .extend(unearned.map(|s| {
            format!("scene {} counts as attacked, but the ego has that contact in plain replay too", s.scene)
        }));
    for label in score.scenes.iter().filter(|label| !label.by_ego.is_empty()) {
        let alone: Vec<(String, SceneScore)> = label.by_ego.clone().into_iter().collect();
        let again = score.rules.over_egos.map(|rule| scene_over_egos(rule, score.rules.mean, label, alone));
        if !again.is_some_and(|again| near(again.attack, label.attack) && near(again.realism, label.realism)) {
            faults.push(format!("the label of scene {} does not follow from those against each driver", label.scene));
        }
    }
    // SafeBench's objectives are read off its own rows; `tables` compares those with their runs.
    if score.benchmark.is_none() {
        let mean = |of: &dyn Fn(&SceneScore) -> Option<f64>| {
            num::mean(&score.scenes.iter().filter_map(of).collect::<Vec<_>>())
        };
        let realism = RealismSums::of(&score.scenes).realism(score.rules.mean).unwrap_or(0.0);
        let means = mean(&|s| Some(s.attack)).map(|attack| Objectives { attack, realism });
        if !means.is_some_and(|means| same(&means, &score.objectives)) {
            faults.push(format!("objectives {:?} are not the means of the scenes, {means:?}", score.objectives));
        }
        let all = mean(&|s| Some(s.realism)).zip(mean(&|s| Some(if s.acted { 1.0 } else { 0.0 })));
        if !all.is_some_and(|(realism, coverage)| near(realism, score.realism_all) && near(coverage, score.coverage)) {
            let computed = (score.realism_all, score.coverage);
            faults.push(format!(
                "realism over all scenes and coverage {computed:?} are not those of the scenes, {all:?}"
            ));
        }
    }
    faults.into_iter()
}

fn near(a: f64, b: f64) -> bool {
    (a - b).abs() <= TOLERANCE
}

fn same(a: &Objectives, b: &Objectives) -> bool {
    near(a.attack, b.attack) && near(a.realism, b.realism)
}

/// Every member of a front is a parent or an accepted child. While there was one window only, its point is what that
/// window's labels say; later it is the mean over the scenes of all windows so far. No member dominates another.
fn fronts(run: &RecordedRun, findings: &mut Vec<Finding>) {
    let mut labels: BTreeMap<(&LineageId, &SolutionId), Vec<Objectives>> = BTreeMap::new();
    for frozen in &run.frozen {
        labels.entry((&frozen.lineage, &frozen.parent)).or_default().push(frozen.parent_score.objectives);
    }
    for attempt in &run.attempts {
        let all = run.declared.archive.as_ref().is_some_and(|archive| archive.front == FrontOf::Evaluated);
        let accepted = all || attempt.exit.decision().is_some_and(|decision| decision.gates.any());
        if let (Some(candidate), Some(score), true) = (attempt.exit.candidate(), attempt.exit.score(), accepted) {
            let solution = &candidate.program.solution_id;
            labels.entry((&attempt.lineage, solution)).or_default().push(score.objectives);
        }
    }
    for settled in &run.settled {
        let place = format!("{} epoch {}", settled.lineage, settled.epoch);
        let of_epoch = |f: &&Frozen| f.lineage == settled.lineage && f.epoch == settled.epoch;
        let first = run.frozen.iter().find(|f| f.lineage == settled.lineage);
        let one_window =
            run.frozen.iter().find(of_epoch).is_some_and(|f| {
                f.scenes_so_far == f.window.len() && first.is_some_and(|first| first.window == f.window)
            });
        for member in &settled.front {
            let fault = match labels.get(&(&settled.lineage, &member.solution)) {
                None => Some("but no gate accepted it"),
                Some(all) if one_window && !all.iter().any(|objectives| same(objectives, &member.objectives)) => {
                    Some("with labels that no rollout gave it")
                }
                Some(_) => None,
            };
            if let Some(fault) = fault {
                let what = format!("{} is on the front {fault}", member.solution);
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
    for measured in named.into_iter().flatten() {
        let computed = run.held_out.iter().find(|h| h.lineage == lineage.lineage && h.solution == measured.solution);
        let read = computed.map(|held_out| Measured::new(measured.solution.clone(), &held_out.score));
        let agree = |read: &Measured| {
            same(&read.objectives, &measured.objectives)
                && near(read.realism_penalty_pct, measured.realism_penalty_pct)
                && near(read.coverage, measured.coverage)
                && near(read.any_contact, measured.any_contact)
        };
        if !read.is_some_and(|read| agree(&read)) {
            let what = format!("the result gives {} numbers that are not its held-out labels", measured.solution);
            findings.push(Finding::breach("result", &lineage.lineage, what));
        }
    }
}
