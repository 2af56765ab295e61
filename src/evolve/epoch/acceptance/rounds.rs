//! SafeBench's archive of a run: what balanced selection keeps after every round is an event, and the frontier gain is
//! taken group by group (paper, appendix CARLA/SafeBench Protocol).

use std::collections::{BTreeMap, BTreeSet};

use crate::archive::{ArchiveOptions, pf_area_pct};
use crate::epoch::RunError;
use crate::epoch::labelling::measure::{groups, staged_runs};
use crate::epoch::setting::desk::Desk;
use crate::epoch::setting::study::{LineageSpec, Study};
use crate::epoch::state::State;
use crate::evaluation::{Group, SafebenchOptions, SceneArchive, Selecting, group_name, group_points};
use crate::objects::{Objectives, Score, SolutionId, event::kind};

/// Records the archive after every round, from the parent's scenes alone on. `parent` is scored on all evolution scenes.
pub fn record(
    study: &Study,
    state: &State,
    spec: &LineageSpec,
    options: &SafebenchOptions,
    parent: &SolutionId,
    parent_score: &Score,
    desk: &mut Desk<'_>,
) -> Result<(), RunError> {
    let mut archive = SceneArchive::default();
    archive.add(0, parent, staged_runs(study, options, parent_score, &desk.tools)?);
    for attempt in state.attempts.iter().filter(|attempt| attempt.lineage == spec.id) {
        if let (Some(candidate), Some(score)) = (attempt.exit.candidate(), attempt.exit.score()) {
            let runs = staged_runs(study, options, score, &desk.tools)?;
            archive.add(attempt.epoch + 1, &candidate.program.solution_id, runs);
        }
    }
    let (per_group, coverage_floor) = (options.selected_per_group, study.archive.coverage_floor);
    let selecting = Selecting { per_group, coverage_floor };
    for round in 0..=study.budget.epochs {
        if let Some(event) = archive.after(round, &selecting, &spec.id) {
            desk.log.append(kind::ROUND, &event)?;
        }
    }
    Ok(())
}

/// PF-Area@k of every group of the study, percent.
pub fn pf_area_by_group_pct(
    study: &Study,
    options: &SafebenchOptions,
    parent: &Score,
    descendants: &[&Score],
    k: usize,
    desk: &Desk<'_>,
) -> Result<BTreeMap<String, f64>, RunError> {
    let groups = groups(study, &study.evolution);
    let points = |score: &Score| -> Result<Points, RunError> {
        let failed = score.failures.iter().filter_map(|failure| groups.get(failure.scene.as_str()).copied());
        Ok(group_points(&staged_runs(study, options, score, &desk.tools)?, &failed.collect::<Vec<Group>>()))
    };
    let before = points(parent)?;
    let after = descendants.iter().map(|score| points(score)).collect::<Result<Vec<_>, _>>()?;
    Ok(gains_pct(groups.values().copied(), &before, &after, k, &study.archive))
}

/// A program's point in every group that it acts in: its score over the group's runs.
pub type Points = BTreeMap<Group, Objectives>;

/// PF-Area@k of these groups, percent. A group without an eligible descendant gains nothing. Eligible is who acts in the group and is
/// valid there (its ARS is not 0).
pub fn gains_pct(
    groups: impl Iterator<Item = Group>,
    before: &Points,
    after: &[Points],
    k: usize,
    options: &ArchiveOptions,
) -> BTreeMap<String, f64> {
    let gain = |group: Group| {
        let own: Vec<Objectives> = before.get(&group).copied().into_iter().collect();
        let eligible = after.iter().filter_map(|points| points.get(&group)).filter(|point| point.realism > 0.0);
        (group_name(group), pf_area_pct(&own, &eligible.copied().collect::<Vec<_>>(), k, options))
    };
    groups.collect::<BTreeSet<Group>>().into_iter().map(gain).collect()
}
