//! The end of a run: accepted descendants meet the whole evolution pool, one is chosen by it, and only then are the
//! held-out scenes opened.

use std::collections::BTreeMap;

use super::{
    RunError, counsel,
    desk::Desk,
    labels::Labelling,
    progress::Progress,
    rounds,
    state::State,
    study::{LineageSpec, Study},
};
use crate::archive::{Contender, pf_area_pct, select_active};
use crate::kernel::num;
use crate::objects::{
    Attempt, Objectives, Score, SolutionId,
    event::{ExitCounts, Finalist, FrontPoint, HeldOut, LineageResult, Measured, RunResult, kind},
};

/// k of PF-Area@k, as in the paper's tables.
const FRONTIER_BUDGET: usize = 3;

/// Chooses and reports, lineage by lineage.
pub fn report(study: &Study, state: &mut State, desk: &mut Desk<'_>) -> Result<RunResult, RunError> {
    let mut lineages = Vec::new();
    for spec in &study.lineages {
        lineages.push(one_lineage(study, state, spec, desk)?);
        desk.tools.meter.turn(&spec.id);
    }
    Ok(RunResult {
        lineages,
        exits: count(&state.attempts.iter().collect::<Vec<_>>()),
        epochs: study.budget.epochs,
        rollouts: desk.tools.rollouts.distinct(),
    })
}

/// Who was chosen on evolution labels.
struct Choice {
    active: SolutionId,
    reason: String,
    endpoint: Option<SolutionId>,
    /// The first three descendants by the same rule: the matched budget.
    top: Vec<SolutionId>,
    /// Scores of parent and finalists on the evolution scenes.
    scores: BTreeMap<SolutionId, Score>,
}

fn one_lineage(
    study: &Study,
    state: &mut State,
    spec: &LineageSpec,
    desk: &mut Desk<'_>,
) -> Result<LineageResult, RunError> {
    let parent = state.lineages.get(&spec.id)?.parent.clone();
    let choice = choose(study, state, spec, &parent, desk)?;
    counsel::take(study, spec, &study.held_out, &mut state.counsels, desk)?;
    let state = &*state;
    let mut measured: BTreeMap<SolutionId, Objectives> = BTreeMap::new();
    let wanted = [Some(&parent), Some(&choice.active), choice.endpoint.as_ref()];
    for solution in wanted.into_iter().flatten().chain(&choice.top) {
        if measured.contains_key(solution) {
            continue;
        }
        let score = held_out(study, state, spec, solution, &parent, &choice, desk)?;
        measured.insert(solution.clone(), score.objectives);
    }
    (desk.watch)(Progress::HeldOut {
        lineage: spec.id.to_string(),
        programs: measured.len(),
        scenes: study.held_out.len(),
    });
    let of = |solution: &SolutionId| Measured::new(solution.clone(), measured[solution]);
    let (pf_area_at_3_pct, by_group) = frontier_gain(study, state, spec, &parent, &choice, &measured, desk)?;
    let archive = &state.archives[&spec.id];
    Ok(LineageResult {
        lineage: spec.id.clone(),
        family: spec.family.clone(),
        ego: spec.ego.name().to_string(),
        parent: of(&parent),
        evolved: of(&choice.active),
        selection: choice.reason,
        endpoint: choice.endpoint.as_ref().map(of),
        pf_area_at_3_pct,
        pf_area_at_3_pct_by_group: by_group,
        front: archive.front().map(|e| FrontPoint { solution: e.solution.clone(), objectives: e.objectives }).collect(),
        hypervolume_by_epoch: state.settled.iter().filter(|s| s.lineage == spec.id).map(|s| s.hypervolume).collect(),
        exits: count(&state.attempts.iter().filter(|a| a.lineage == spec.id).collect::<Vec<_>>()),
        held_out_scenes: study.held_out.len(),
    })
}

/// PF-Area@3: on held-out objectives; in SafeBench's protocol the mean over its groups, which follow, and whose archive
/// is recorded here too.
fn frontier_gain(
    study: &Study,
    state: &State,
    spec: &LineageSpec,
    parent: &SolutionId,
    choice: &Choice,
    measured: &BTreeMap<SolutionId, Objectives>,
    desk: &mut Desk<'_>,
) -> Result<(f64, BTreeMap<String, f64>), RunError> {
    if let (Some(options), Some(parent_score)) = (study.evaluation.safebench(), choice.scores.get(parent)) {
        rounds::record(study, state, spec, options, (parent, parent_score), desk)?;
        let descendants: Vec<&Score> = choice.top.iter().filter_map(|s| choice.scores.get(s)).collect();
        let gains = rounds::pf_area_by_group_pct(study, options, parent_score, &descendants, FRONTIER_BUDGET, desk)?;
        return Ok((num::mean(&gains.values().copied().collect::<Vec<f64>>()).unwrap_or(0.0), gains));
    }
    let descendants: Vec<Objectives> = choice.top.iter().map(|s| measured[s]).collect();
    Ok((pf_area_pct(&[measured[parent]], &descendants, FRONTIER_BUDGET, &study.archive), BTreeMap::new()))
}

/// Labels the finalists on every evolution scene, so that one window's luck does not choose, and applies the
/// realism-constrained rule: with the parent for the active generator, without it for endpoint and budget.
fn choose(
    study: &Study,
    state: &State,
    spec: &LineageSpec,
    parent: &SolutionId,
    desk: &mut Desk<'_>,
) -> Result<Choice, RunError> {
    let (mut contenders, mut scores) = (Vec::new(), BTreeMap::new());
    for solution in std::iter::once(parent.clone()).chain(finalists(study, state, spec, parent)) {
        let program = state.lineages.program(&spec.id, &solution)?;
        let score = labelling(study, state, spec, desk).score((program, program.hash()?), &study.evolution)?;
        desk.log.append(
            kind::FINALIST,
            &Finalist { lineage: spec.id.clone(), solution: solution.clone(), score: score.clone() },
        )?;
        contenders.push(Contender { solution: solution.clone(), objectives: score.objectives });
        scores.insert(solution, score);
    }
    let Some(active) = select_active(&contenders, &study.selector) else {
        return Err(RunError::Study(format!("lineage {} has nobody to select from", spec.id)));
    };
    let mut rest = contenders.split_off(1);
    let mut top = Vec::new();
    while let Some(next) = select_active(&rest, &study.selector).filter(|_| top.len() < FRONTIER_BUDGET) {
        rest.retain(|c| c.solution != next.solution);
        top.push(next.solution);
    }
    Ok(Choice { reason: active.reason(), active: active.solution, endpoint: top.first().cloned(), top, scores })
}

fn labelling<'a>(study: &'a Study, state: &'a State, spec: &'a LineageSpec, desk: &'a Desk<'_>) -> Labelling<'a> {
    Labelling { study, spec, counsels: &state.counsels, tools: &desk.tools }
}

/// Accepted descendants: the front's first, each group in order of insertion, as many as the budget allows.
fn finalists(study: &Study, state: &State, spec: &LineageSpec, parent: &SolutionId) -> Vec<SolutionId> {
    let archive = &state.archives[&spec.id];
    let accepted = |e: &&crate::objects::Entry| e.gates.as_ref().is_some_and(|gates| gates.any());
    let on_front = archive.front().filter(accepted).map(|e| e.solution.clone());
    let others = archive.entries().iter().filter(accepted).map(|e| e.solution.clone());
    let mut chosen: Vec<SolutionId> = Vec::new();
    for solution in on_front.chain(others) {
        if solution != *parent && !chosen.contains(&solution) && chosen.len() < study.budget.finalists {
            chosen.push(solution);
        }
    }
    chosen
}

fn held_out(
    study: &Study,
    state: &State,
    spec: &LineageSpec,
    solution: &SolutionId,
    parent: &SolutionId,
    choice: &Choice,
    desk: &mut Desk<'_>,
) -> Result<Score, RunError> {
    let program = state.lineages.program(&spec.id, solution)?;
    let score = labelling(study, state, spec, desk).score((program, program.hash()?), &study.held_out)?;
    let roles = [
        ("parent", solution == parent),
        ("active", *solution == choice.active),
        ("endpoint", choice.endpoint.as_ref() == Some(solution)),
        ("descendant", choice.top.contains(solution)),
    ];
    let roles = roles.into_iter().filter(|(_, holds)| *holds).map(|(role, _)| role.to_string()).collect();
    desk.log.append(
        kind::HELD_OUT,
        &HeldOut { lineage: spec.id.clone(), solution: solution.clone(), roles, score: score.clone() },
    )?;
    Ok(score)
}

fn count(attempts: &[&Attempt]) -> ExitCounts {
    let mut counts = ExitCounts::default();
    attempts.iter().for_each(|attempt| counts.count(attempt));
    counts
}
