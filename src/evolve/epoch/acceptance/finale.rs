//! The end of a run: accepted descendants meet the scenes of selection, or the whole evolution pool, one is chosen by them, and only then are the
//! held-out scenes opened.

use std::collections::BTreeMap;

use super::{groups, rounds};
use crate::archive::{Contender, SelectionRule, SelectorOptions, first_by_rule, pf_area_pct, select_active};
use crate::epoch::RunError;
use crate::epoch::briefs::counsel;
use crate::epoch::labelling::labels::{self, Labelling};
use crate::epoch::labelling::measure::held_out_runs;
use crate::epoch::labelling::replayed;
use crate::epoch::setting::desk::{Desk, Tools};
use crate::epoch::setting::progress::Progress;
use crate::epoch::setting::study::{LineageSpec, Study};
use crate::epoch::state::State;
use crate::objects::{
    Attempt, Objectives, RealismMean, Score, SolutionId,
    event::{AtRealism, ExitCounts, Finalist, FrontPoint, HeldOut, LineageResult, Measured, RunResult, kind},
};

/// k of PF-Area@k, as in the paper's tables.
pub const FRONTIER_BUDGET: usize = 3;

/// Chooses and reports, lineage by lineage.
pub fn report(study: &Study, state: &mut State, desk: &mut Desk<'_>) -> Result<RunResult, RunError> {
    let mut lineages = Vec::new();
    let mut wanting = false;
    side_by_side(study, state, desk)?;
    for spec in &study.lineages {
        match one_lineage(study, state, spec, desk) {
            Ok(result) => lineages.push(result),
            // A plan hears of all lineages: none of them depends on another one any more.
            Err(RunError::Wanting) => wanting = true,
            Err(error) => return Err(error),
        }
        desk.tools.meter.turn(&spec.id);
    }
    if wanting {
        return Err(RunError::Wanting);
    }
    let replay = replayed::record(study, desk)?;
    Ok(RunResult {
        replay,
        lineages,
        exits: count(&state.attempts.iter().collect::<Vec<_>>()),
        epochs: study.budget.epochs,
        rollouts: desk.tools.rollouts.distinct(),
    })
}

/// Makes the labels of all lineages side by side: those of the finalists on the scenes on which they are chosen, then those of the chosen on the
/// held-out scenes. Lineage by lineage threads would wait at the end of each one's. What is made is kept label by label, so a run that is
/// stopped here goes on where it was. Under a plan each lineage asks for its own.
fn side_by_side(study: &Study, state: &State, desk: &mut Desk<'_>) -> Result<(), RunError> {
    if desk.tools.wanted.is_some() {
        return Ok(());
    }
    let Desk { watch, tools, .. } = desk;
    let tools = &*tools;
    let (mut choosing, mut choices) = (Vec::new(), Vec::new());
    for spec in &study.lineages {
        // Counsel for scenes outside the evolution pool is taken lineage by lineage.
        let advised = study.source(spec)?.asks.counsel.is_some();
        if advised && !study.selection.is_empty() {
            continue;
        }
        let parent = &state.lineages.get(&spec.id)?.parent;
        for solution in std::iter::once(parent).chain(&finalists(study, state, spec)?.measured) {
            let program = state.lineages.program(&spec.id, solution)?;
            choosing.push((labelling(study, state, spec, tools), program, study.choosing()));
        }
        if !advised {
            choices.push((spec, parent));
        }
    }
    labels::ahead_of_all(&choosing, tools, &mut |done, all| watch(Progress::Choosing { done, all }))?;
    let mut held_out = Vec::new();
    for (spec, parent) in choices {
        for solution in reported(parent, &choose(study, state, spec, parent, tools)?) {
            let program = state.lineages.program(&spec.id, solution)?;
            held_out.push((labelling(study, state, spec, tools), program, &study.held_out[..]));
        }
    }
    labels::ahead_of_all(&held_out, tools, &mut |done, all| watch(Progress::Opening { done, all }))
}

/// The chosen program, and what the choice compared.
struct Choice {
    active: SolutionId,
    reason: String,
    endpoint: Option<SolutionId>,
    /// The first three descendants by the same rule: the matched budget.
    top: Vec<SolutionId>,
    /// Further values of `realism_min`, whether each is reached, and the program that the rule chooses there.
    at_realism: Vec<(f64, bool, SolutionId)>,
    /// Parent and finalists, in this order, and their scores on the scenes on which they were chosen.
    compared: Vec<SolutionId>,
    scores: BTreeMap<SolutionId, Score>,
    /// The programs that the budget of finalists had no room for.
    cut: Vec<SolutionId>,
}

pub fn one_lineage(
    study: &Study,
    state: &mut State,
    spec: &LineageSpec,
    desk: &mut Desk<'_>,
) -> Result<LineageResult, RunError> {
    let parent = state.lineages.get(&spec.id)?.parent.clone();
    if !study.selection.is_empty() {
        counsel::take(study, spec, &study.selection, &mut state.counsels, desk)?;
    }
    let choice = choose(study, state, spec, &parent, &desk.tools)?;
    for solution in &choice.compared {
        let score = choice.scores[solution].clone();
        desk.log.append(kind::FINALIST, &Finalist { lineage: spec.id.clone(), solution: solution.clone(), score })?;
    }
    counsel::take(study, spec, &study.held_out, &mut state.counsels, desk)?;
    let state = &*state;
    let mut measured: BTreeMap<SolutionId, Measured> = BTreeMap::new();
    let wanted = reported(&parent, &choice);
    ahead(study, state, spec, wanted.iter().copied(), &study.held_out, &desk.tools)?;
    for solution in wanted {
        let score = held_out(study, state, spec, solution, &parent, &choice, desk)?;
        measured.insert(solution.clone(), Measured::new(solution.clone(), &score));
    }
    (desk.watch)(Progress::HeldOut {
        lineage: spec.id.to_string(),
        programs: measured.len(),
        scenes: study.held_out.len(),
    });
    let of = |solution: &SolutionId| measured[solution].clone();
    let (pf_area_at_3_pct, by_group) = frontier_gain(study, state, spec, &parent, &choice, &measured, desk)?;
    let archive = &state.archives[&spec.id];
    Ok(LineageResult {
        lineage: spec.id.clone(),
        group: spec.group.clone(),
        replica: spec.replica,
        cut: choice.cut,
        family: spec.family.clone(),
        ego: spec.ego_label(),
        parent: of(&parent),
        evolved: of(&choice.active),
        selection: choice.reason,
        endpoint: choice.endpoint.as_ref().map(of),
        at_realism: choice
            .at_realism
            .iter()
            .map(|(realism_min, reached, solution)| AtRealism {
                realism_min: *realism_min,
                reached: *reached,
                chosen: of(solution),
            })
            .collect(),
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
    measured: &BTreeMap<SolutionId, Measured>,
    desk: &mut Desk<'_>,
) -> Result<(f64, BTreeMap<String, f64>), RunError> {
    if let (Some(options), Some(parent_score)) = (study.evaluation.safebench(), choice.scores.get(parent)) {
        rounds::record(study, state, spec, options, parent, parent_score, desk)?;
        if groups::apart(study) {
            let tools = &desk.tools;
            let gains =
                groups::gains_of_archives_pct(study, state, spec, options, parent_score, FRONTIER_BUDGET, tools)?;
            return Ok((groups::mean_pct(&gains), gains));
        }
        let descendants: Vec<&Score> = choice.top.iter().filter_map(|s| choice.scores.get(s)).collect();
        let gains = rounds::pf_area_by_group_pct(study, options, parent_score, &descendants, FRONTIER_BUDGET, desk)?;
        return Ok((groups::mean_pct(&gains), gains));
    }
    // Whoever acts nowhere has no place in the plane, but by the plain mean: neither parent nor descendants.
    let placed = |of: &Measured| of.coverage > 0.0 || study.evaluation.realism_mean() == RealismMean::Plain;
    let acting = |solutions: &[SolutionId]| -> Vec<Objectives> {
        solutions.iter().map(|s| &measured[s]).filter(|of| placed(of)).map(|of| of.objectives).collect()
    };
    let parents = acting(std::slice::from_ref(parent));
    Ok((pf_area_pct(&parents, &acting(&choice.top), FRONTIER_BUDGET, &study.archive), BTreeMap::new()))
}

/// Labels the finalists on every scene of selection, or of evolution, so that one window's luck does not choose, and applies the
/// realism-constrained rule, here and nowhere before: with the parent for the active generator, without it for endpoint
/// and budget.
fn choose(
    study: &Study,
    state: &State,
    spec: &LineageSpec,
    parent: &SolutionId,
    tools: &Tools<'_>,
) -> Result<Choice, RunError> {
    let (mut contenders, mut scores) = (Vec::new(), BTreeMap::new());
    let Finalists { measured, cut } = finalists(study, state, spec)?;
    let compared: Vec<SolutionId> = std::iter::once(parent.clone()).chain(measured).collect();
    ahead(study, state, spec, compared.iter(), study.choosing(), tools)?;
    for solution in compared.iter().cloned() {
        let program = state.lineages.program(&spec.id, &solution)?;
        let score = labelling(study, state, spec, tools).score(program.hashed()?, study.choosing())?;
        let (objectives, coverage) = (score.objectives, score.coverage);
        contenders.push(Contender { solution: solution.clone(), objectives, coverage });
        scores.insert(solution, score);
    }
    let Some(active) = select_active(&contenders, &study.selector) else {
        return Err(RunError::Study(format!("lineage {} has nobody to select from", spec.id)));
    };
    let at_realism = study.selector.floors().into_iter().filter_map(|realism_min| {
        let chosen = select_active(&contenders, &SelectorOptions { realism_min, ..study.selector.clone() })?;
        Some((realism_min, chosen.rule == SelectionRule::RealismConstrained, chosen.solution))
    });
    let at_realism = at_realism.collect();
    let descendants = contenders.split_off(1);
    let filled_up = SelectorOptions { fills_up: true, ..study.selector.clone() };
    let endpoint = first_by_rule(descendants.clone(), 1, &filled_up).pop();
    let top = first_by_rule(descendants, FRONTIER_BUDGET, &study.selector);
    Ok(Choice { reason: active.reason(), active: active.solution, endpoint, top, at_realism, compared, scores, cut })
}

/// The programs that meet the held-out scenes: the parent, the chosen one, endpoint, budget and those of further values of `realism_min`; each once.
fn reported<'c>(parent: &'c SolutionId, choice: &'c Choice) -> Vec<&'c SolutionId> {
    let at_realism = choice.at_realism.iter().map(|(_, _, solution)| solution);
    let first = [Some(parent), Some(&choice.active), choice.endpoint.as_ref()].into_iter().flatten();
    let mut distinct: Vec<&SolutionId> = Vec::new();
    for solution in first.chain(&choice.top).chain(at_realism) {
        if !distinct.contains(&solution) {
            distinct.push(solution);
        }
    }
    distinct
}

/// Makes labels of programs together that will be needed one by one.
fn ahead<'s>(
    study: &Study,
    state: &State,
    spec: &LineageSpec,
    solutions: impl Iterator<Item = &'s SolutionId>,
    places: &[usize],
    tools: &Tools<'_>,
) -> Result<(), RunError> {
    let programs =
        solutions.map(|solution| state.lineages.program(&spec.id, solution)).collect::<Result<Vec<_>, _>>()?;
    labelling(study, state, spec, tools).ahead(&programs, places)
}

fn labelling<'a>(study: &'a Study, state: &'a State, spec: &'a LineageSpec, tools: &'a Tools<'_>) -> Labelling<'a> {
    Labelling { study, spec, counsels: &state.counsels, tools }
}

/// The programs that are measured on the whole evolution pool, and those that the budget had no room for; the most promising first.
struct Finalists {
    measured: Vec<SolutionId>,
    cut: Vec<SolutionId>,
}

/// All members of the front, all programs that led, and who leads last, ranked by what they alone add to the front; of
/// equals the later leader first. The budget cuts from the bottom.
fn finalists(study: &Study, state: &State, spec: &LineageSpec) -> Result<Finalists, RunError> {
    let (archive, lineage) = (&state.archives[&spec.id], state.lineages.get(&spec.id)?);
    let heads = std::iter::once(&lineage.active).chain(lineage.realism_anchor.as_ref());
    let led = lineage.promotions.iter().rev().map(|promotion| &promotion.to);
    let mut ranked: Vec<(f64, SolutionId)> = Vec::new();
    for solution in heads.chain(led).chain(archive.front().map(|entry| &entry.solution)) {
        if *solution != lineage.parent && !ranked.iter().any(|(_, known)| known == solution) {
            ranked.push((archive.contribution(solution, study.archive.reference), solution.clone()));
        }
    }
    ranked.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut measured: Vec<SolutionId> = ranked.into_iter().map(|(_, solution)| solution).collect();
    let cut = measured.split_off(study.budget.finalists.min(measured.len()));
    Ok(Finalists { measured, cut })
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
    let score = labelling(study, state, spec, &desk.tools).score(program.hashed()?, &study.held_out)?;
    let roles = [
        ("parent", solution == parent),
        ("active", *solution == choice.active),
        ("endpoint", choice.endpoint.as_ref() == Some(solution)),
        ("descendant", choice.top.contains(solution)),
        ("at_realism", choice.at_realism.iter().any(|(_, _, of)| of == solution)),
    ];
    let roles = roles.into_iter().filter(|(_, holds)| *holds).map(|(role, _)| role.to_string()).collect();
    let runs = held_out_runs(study, &score, &desk.tools)?;
    desk.log.append(
        kind::HELD_OUT,
        &HeldOut { lineage: spec.id.clone(), solution: solution.clone(), roles, score: score.clone(), runs },
    )?;
    Ok(score)
}

fn count(attempts: &[&Attempt]) -> ExitCounts {
    let mut counts = ExitCounts::default();
    attempts.iter().for_each(|attempt| counts.count(attempt));
    counts
}
