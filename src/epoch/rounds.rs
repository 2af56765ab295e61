//! SafeBench's archive: labelled scenes by group of family and route, what balanced selection keeps of them after every
//! round, and the frontier gain of every group (paper, appendix CARLA/SafeBench Protocol).

use std::collections::{BTreeMap, BTreeSet};

use super::{
    RunError,
    run::Desk,
    state::State,
    study::{LineageSpec, Study},
};
use crate::archive::pf_area_pct;
use crate::evaluation::{Group, RolloutCache, Runs, SafebenchOptions, balanced};
use crate::objects::benchmark::{ArchiveRound, SafebenchRun, SelectedScene};
use crate::objects::{Objectives, Score, SolutionId, event::kind};

/// A labelled scene of the archive.
struct Archived {
    /// The round that added it; 0 for the parent's.
    round: u32,
    solution: SolutionId,
    labelled: Labelled,
}

/// A scene's run in its group.
#[derive(Clone)]
struct Labelled {
    scene: String,
    group: Group,
    run: SafebenchRun,
}

/// Records the archive after every round, from the parent's scenes alone on. `parent` is scored on all evolution scenes.
pub fn record(
    study: &Study<'_>,
    state: &State,
    spec: &LineageSpec,
    options: &SafebenchOptions,
    (parent, parent_score): (&SolutionId, &Score),
    desk: &mut Desk<'_>,
) -> Result<(), RunError> {
    let mut archive = Vec::new();
    let mut add = |round: u32, solution: &SolutionId, score: &Score| -> Result<(), RunError> {
        let labelled = labelled(study, options, score, desk)?;
        archive.extend(labelled.into_iter().map(|labelled| Archived { round, solution: solution.clone(), labelled }));
        Ok(())
    };
    add(0, parent, parent_score)?;
    for attempt in state.attempts.iter().filter(|attempt| attempt.lineage == spec.id) {
        if let (Some(candidate), Some(score)) = (attempt.exit.candidate(), attempt.exit.score()) {
            add(attempt.epoch + 1, &candidate.program.solution_id, score)?;
        }
    }
    for round in 0..=study.budget.epochs {
        if let Some(event) = after(round, &archive, spec, options) {
            desk.log.append(kind::ROUND, &event)?;
        }
    }
    Ok(())
}

/// The labelled runs of a score, read back from their records.
fn labelled(
    study: &Study<'_>,
    options: &SafebenchOptions,
    score: &Score,
    desk: &Desk<'_>,
) -> Result<Vec<Labelled>, RunError> {
    let groups = groups(study);
    let mut runs = Vec::with_capacity(score.scenes.len());
    for scene in &score.scenes {
        let Some(group) = groups.get(scene.scene.as_str()) else { continue };
        let Some((record, _)) = desk.rollouts.recorded(&scene.request)? else { continue };
        let Some(run) = SafebenchRun::of(&record.outcome, &options.ars) else { continue };
        runs.push(Labelled { scene: scene.scene.clone(), group: *group, run });
    }
    Ok(runs)
}

/// What balanced selection keeps of the scenes up to a round.
fn after(round: u32, archive: &[Archived], spec: &LineageSpec, options: &SafebenchOptions) -> Option<ArchiveRound> {
    let so_far: Vec<&Archived> = archive.iter().filter(|scene| scene.round <= round).collect();
    let runs: Vec<(Group, SafebenchRun)> = so_far.iter().map(|s| (s.labelled.group, s.labelled.run)).collect();
    let kept = balanced(&runs, options.selected_per_group);
    let mut selected = Runs::default();
    kept.iter().for_each(|place| selected.add(runs[*place].0, runs[*place].1));
    let scene = |place: &usize| {
        let Archived { solution, labelled, .. } = so_far[*place];
        let (attack, realism) = labelled.run.point();
        SelectedScene {
            group: name(labelled.group),
            scene: labelled.scene.clone(),
            solution: solution.clone(),
            attack,
            realism,
            run: labelled.run,
        }
    };
    let (lineage, benchmark) = (spec.id.clone(), selected.benchmark()?);
    Some(ArchiveRound { lineage, round, benchmark, selected: kept.iter().map(scene).collect() })
}

/// PF-Area@k of every group of the study, percent. A point of a group is a program's score over the group's runs; a
/// group without an eligible descendant gains nothing. Eligible is what was labelled and is valid (its ARS is not 0).
pub fn pf_area_by_group_pct(
    study: &Study<'_>,
    options: &SafebenchOptions,
    parent: &Score,
    descendants: &[&Score],
    k: usize,
    desk: &Desk<'_>,
) -> Result<BTreeMap<String, f64>, RunError> {
    let points = |score: &Score| -> Result<BTreeMap<Group, Objectives>, RunError> {
        let groups = groups(study);
        let mut runs = Runs::default();
        labelled(study, options, score, desk)?.iter().for_each(|scene| runs.add(scene.group, scene.run));
        let failed = score.failures.iter().filter_map(|failure| groups.get(failure.scene.as_str()));
        failed.for_each(|group| runs.add_failure(*group));
        Ok(runs.groups().into_iter().map(|(group, score)| (group, score.point())).collect())
    };
    let before = points(parent)?;
    let after = descendants.iter().map(|score| points(score)).collect::<Result<Vec<_>, _>>()?;
    let gain = |group: Group| {
        let own: Vec<Objectives> = before.get(&group).copied().into_iter().collect();
        let eligible = after.iter().filter_map(|points| points.get(&group)).filter(|point| point.realism > 0.0);
        (name(group), pf_area_pct(&own, &eligible.copied().collect::<Vec<_>>(), k, &study.archive))
    };
    Ok(groups(study).into_values().collect::<BTreeSet<Group>>().into_iter().map(gain).collect())
}

fn groups<'s>(study: &'s Study<'_>) -> BTreeMap<&'s str, Group> {
    let entries = study.evolution.iter().map(|&place| &study.scenes[place]);
    entries.filter_map(|entry| Some((entry.scene.id.as_str(), entry.group()?))).collect()
}

fn name((family, route): Group) -> String {
    format!("{}/{route}", family.name())
}
