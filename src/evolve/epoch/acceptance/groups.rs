//! SafeBench's archive by family and route (paper, appendix CARLA/SafeBench Protocol): each group has its own front, a child is accepted
//! where a gate holds in one of them, and the frontier gain of a group is of the programs that its own archive holds.

use std::collections::{BTreeMap, BTreeSet};

use super::rounds::{Points, gains_pct};
use crate::archive::{self as gates, Archive, Contender, first_by_rule};
use crate::epoch::RunError;
use crate::epoch::labelling::measure::{groups, measure, staged_runs};
use crate::epoch::labelling::standings::Standings;
use crate::epoch::setting::desk::Tools;
use crate::epoch::setting::study::{LineageSpec, Study};
use crate::epoch::state::State;
use crate::evaluation::{Group, SafebenchOptions, group_name, group_points};
use crate::kernel::num;
use crate::objects::{FrontOf, FrontPer, Score, SolutionId};

/// Returns `true` if each group of family and route has an archive of its own.
pub fn apart(study: &Study) -> bool {
    study.archive.front_per == FrontPer::Group
}

/// The groups of scenes, each once.
fn distinct(of_scene: &BTreeMap<&str, Group>) -> BTreeSet<Group> {
    of_scene.values().copied().collect()
}

/// Enters a lineage's parent into the archives of all groups of the study.
pub fn begin(study: &Study, archive: &mut Archive, parent: &SolutionId) {
    if apart(study) {
        distinct(&groups(study, &study.evolution))
            .into_iter()
            .for_each(|group| archive.enter(group_name(group), parent.clone()));
    }
}

/// The groups in which a child is accepted beside its parent and the group's archive; `None` where there is one archive for all.
pub fn accepted_in(
    study: &Study,
    archive: &Archive,
    standings: &Standings,
    parent: &SolutionId,
    child: &Score,
    tools: &Tools<'_>,
) -> Result<Option<Vec<String>>, RunError> {
    if !apart(study) {
        return Ok(None);
    }
    let missing = || RunError::Study(format!("the labels of parent {parent} are missing from its epoch's snapshot"));
    let standing = |solution: &SolutionId| standings.get(solution).map(|labels| &labels.window);
    let parent_score = standing(parent).ok_or_else(missing)?;
    let members: BTreeMap<&SolutionId, &Score> =
        archive.members().filter_map(|solution| Some((solution, standing(solution)?))).collect();
    let all: Vec<&Score> = [child, parent_score].into_iter().chain(members.values().copied()).collect();
    let measure = measure(study, &all, tools)?;
    let of_scene = groups(study, &study.evolution);
    let within = |score: &Score, group: Group| -> Score {
        let scenes = score.scenes.iter().filter(|scene| of_scene.get(scene.scene.as_str()) == Some(&group));
        Score { scenes: scenes.cloned().collect(), failures: Vec::new(), benchmark: None, ..score.clone() }
    };
    let mut accepted = Vec::new();
    for group in distinct(&of_scene) {
        let name = group_name(group);
        let own = within(child, group);
        if own.scenes.is_empty() {
            continue;
        }
        let front: Vec<Score> =
            archive.group(&name).iter().filter_map(|solution| Some(within(members.get(solution)?, group))).collect();
        let before = within(parent_score, group);
        let front: Vec<&Score> = front.iter().collect();
        let standing = gates::Standing { child: &own, parent: &before, front: &front };
        if gates::consider(&standing, &study.archive, &*measure)?.any() {
            accepted.push(name);
        }
    }
    Ok(Some(accepted))
}

/// Enters a child into the archives of groups: of those that accepted it, or of all where the front is of all evaluated.
pub fn enter(study: &Study, archive: &mut Archive, child: &SolutionId, accepted: &[String]) {
    for name in distinct(&groups(study, &study.evolution)).into_iter().map(group_name) {
        if study.archive.front == FrontOf::Evaluated || accepted.contains(&name) {
            archive.enter(name, child.clone());
        }
    }
}

/// PF-Area@k of every group, percent: up to `k` members of the group's own archive beside the parent, taken by the selector's rule among
/// their points in the group. A group without one gains nothing.
pub fn gains_of_archives_pct(
    study: &Study,
    state: &State,
    spec: &LineageSpec,
    options: &SafebenchOptions,
    parent_score: &Score,
    k: usize,
    tools: &Tools<'_>,
) -> Result<BTreeMap<String, f64>, RunError> {
    let of_scene = groups(study, &study.evolution);
    let points = |score: &Score| -> Result<Points, RunError> {
        let failed = score.failures.iter().filter_map(|failure| of_scene.get(failure.scene.as_str()).copied());
        Ok(group_points(&staged_runs(study, options, score, tools)?, &failed.collect::<Vec<Group>>()))
    };
    let (archive, parent) = (&state.archives[&spec.id], &state.lineages.get(&spec.id)?.parent);
    let before = points(parent_score)?;
    let mut after: BTreeMap<SolutionId, Points> = BTreeMap::new();
    for attempt in state.attempts.iter().filter(|attempt| attempt.lineage == spec.id) {
        let (Some(candidate), Some(score)) = (attempt.exit.candidate(), attempt.exit.score()) else { continue };
        let solution = &candidate.program.solution_id;
        if solution != parent && archive.members().any(|member| member == solution) {
            after.insert(solution.clone(), points(score)?);
        }
    }
    let gain = |group: Group| {
        let name = group_name(group);
        let contender = |solution: &SolutionId| {
            let objectives = *after.get(solution)?.get(&group).filter(|point| point.realism > 0.0)?;
            Some(Contender { solution: solution.clone(), objectives, coverage: 1.0 })
        };
        let members: Vec<Contender> = archive.group(&name).iter().filter_map(contender).collect();
        let first = first_by_rule(members, k, &study.selector);
        let chosen: Vec<Points> = first.iter().filter_map(|solution| after.get(solution).cloned()).collect();
        gains_pct(std::iter::once(group), &before, &chosen, k, &study.archive)
    };
    Ok(distinct(&of_scene).into_iter().flat_map(gain).collect())
}

/// The mean over groups.
pub fn mean_pct(gains: &BTreeMap<String, f64>) -> f64 {
    num::mean(&gains.values().copied().collect::<Vec<f64>>()).unwrap_or(0.0)
}
