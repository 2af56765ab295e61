//! SafeBench's archive: labelled scenes by group of family and route, what balanced selection keeps of them after every
//! round, and the frontier gain as the mean over groups (paper, appendix CARLA/SafeBench Protocol).

use std::collections::BTreeMap;

use super::{
    RunError,
    run::Desk,
    state::State,
    study::{LineageSpec, Study},
};
use crate::archive::pf_area_pct;
use crate::evaluation::{Group, RolloutCache, Runs, SafebenchOptions, SafebenchRun, balanced};
use crate::kernel::num;
use crate::objects::benchmark::{ArchiveRound, SelectedScene};
use crate::objects::{Objectives, SceneScore, Score, SolutionId, event::kind};

/// A labelled scene of the archive.
struct Archived {
    /// The round that added it; 0 for the parent's.
    round: u32,
    solution: SolutionId,
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
    let groups = groups(study);
    let mut archive = Vec::new();
    let mut add = |round: u32, solution: &SolutionId, scenes: &[SceneScore]| -> Result<(), RunError> {
        for scene in scenes {
            let Some(group) = groups.get(scene.scene.as_str()) else { continue };
            let Some((record, _)) = desk.rollouts.recorded(&scene.request)? else { continue };
            let Some(run) = SafebenchRun::of(&record.outcome, &options.ars) else { continue };
            archive.push(Archived { round, solution: solution.clone(), group: *group, run });
        }
        Ok(())
    };
    add(0, parent, &parent_score.scenes)?;
    for attempt in state.attempts.iter().filter(|attempt| attempt.lineage == spec.id) {
        if let (Some(candidate), Some(score)) = (attempt.exit.candidate(), attempt.exit.score()) {
            add(attempt.epoch + 1, &candidate.program.solution_id, &score.scenes)?;
        }
    }
    for round in 0..=study.budget.epochs {
        if let Some(event) = after(round, &archive, spec, options) {
            desk.log.append(kind::ROUND, &event)?;
        }
    }
    Ok(())
}

/// What balanced selection keeps of the scenes up to a round.
fn after(round: u32, archive: &[Archived], spec: &LineageSpec, options: &SafebenchOptions) -> Option<ArchiveRound> {
    let so_far: Vec<&Archived> = archive.iter().filter(|scene| scene.round <= round).collect();
    let runs: Vec<(Group, SafebenchRun)> = so_far.iter().map(|scene| (scene.group, scene.run)).collect();
    let kept = balanced(&runs, options.selected_per_group);
    let mut selected = Runs::default();
    kept.iter().for_each(|place| selected.add(runs[*place].0, runs[*place].1));
    let scene = |place: &usize| {
        let (family, route) = so_far[*place].group;
        let (attack, realism) = so_far[*place].run.point();
        SelectedScene {
            group: format!("{}/{route}", family.name()),
            solution: so_far[*place].solution.clone(),
            attack,
            realism,
        }
    };
    let (lineage, benchmark) = (spec.id.clone(), selected.benchmark()?);
    Some(ArchiveRound { lineage, round, benchmark, selected: kept.iter().map(scene).collect() })
}

/// PF-Area@k in a study of groups: the mean of the groups' gains, where a group without an eligible descendant has
/// none. Eligible is a scene that was labelled and is valid (its ARS is not 0).
pub fn pf_area_over_groups_pct(study: &Study<'_>, parent: &Score, descendants: &[Score], k: usize) -> f64 {
    let points = |score: &Score| -> BTreeMap<Group, Objectives> {
        let groups = groups(study);
        let of = |s: &SceneScore| {
            Some((*groups.get(s.scene.as_str())?, Objectives { attack: s.attack, realism: s.realism }))
        };
        score.scenes.iter().filter_map(of).collect()
    };
    let (before, after) = (points(parent), descendants.iter().map(points).collect::<Vec<_>>());
    let gain = |group: &Group| {
        let own: Vec<Objectives> = before.get(group).copied().into_iter().collect();
        let eligible = after.iter().filter_map(|points| points.get(group)).filter(|point| point.realism > 0.0);
        pf_area_pct(&own, &eligible.copied().collect::<Vec<_>>(), k, &study.archive)
    };
    let groups: std::collections::BTreeSet<Group> =
        study.evolution.iter().filter_map(|&place| study.scenes[place].group()).collect();
    num::mean(&groups.iter().map(gain).collect::<Vec<f64>>()).unwrap_or(0.0)
}

fn groups<'s>(study: &'s Study<'_>) -> BTreeMap<&'s str, Group> {
    let entries = study.evolution.iter().map(|&place| &study.scenes[place]);
    entries.filter_map(|entry| Some((entry.scene.id.as_str(), entry.group()?))).collect()
}
