//! Search by another method than the archive's own (`[search]`): the programs that its slots edit, the one that leads, what a slot is asked for,
//! and the number of rollouts that a lineage has used.
//!
//! `archive/search` holds the method's two decisions, `archive/openevolve` OpenEvolve's database; this file and `rival.rs` call them
//! at the epoch's steps. The method's memory is part of the state and changes in `settle` alone. The epoch's frozen event names the
//! parents that it drew, the attempt's decision holds what it said of a child, and its draws are named streams. Windows do not rotate
//! under such a method. A declared budget bounds a lineage's rollouts: candidates that it does not pay for are turned away behind the
//! barrier, and a lineage that cannot pay for one more has no further epoch. `docs/ABLATIONS.md` describes the methods.

use std::collections::BTreeSet;

use crate::agents::{Target, TargetKind};
use crate::archive::search::{Method, SearchOptions, SearchState, SlotDraw};
use crate::archive::{Contender, Leaders};
use crate::epoch::briefs::target;
use crate::epoch::briefs::target::Aims;
use crate::epoch::labelling::standings::Standings;
use crate::epoch::setting::study::{LineageSpec, Study};
use crate::epoch::state::State;
use crate::kernel::{Digest, Stream};
use crate::objects::{Objectives, Program, SceneScore, Score};

/// The random numbers of a slot for one purpose.
pub fn stream(study: &Study, spec: &LineageSpec, epoch: u32, slot: u32, purpose: &str) -> Stream {
    study.seed.stream(&["search", spec.id.as_str(), &epoch.to_string(), &slot.to_string(), purpose])
}

/// The parts of a program that a patch can change, as canonical text with two spaces of indent: what OpenEvolve calls code.
pub fn text(program: &Program) -> String {
    let Program { source_family, parameters, operator_graph, scenario_conditioned_policy, mechanism_modules, .. } =
        program;
    let parts = serde_json::json!({
        "source_family": source_family,
        "parameters": parameters,
        "operator_graph": operator_graph,
        "scenario_conditioned_policy": scenario_conditioned_policy,
        "mechanism_modules": mechanism_modules,
    });
    format!("{parts:#}")
}

/// The number of a slot's proposal, counted over the lineage.
pub fn iteration(study: &Study, epoch: u32, slot: u32) -> usize {
    epoch as usize * study.budget.slots as usize + slot as usize
}

/// The parents of an epoch's slots, where the method draws them.
pub fn draw(study: &Study, spec: &LineageSpec, epoch: u32, search: &mut Option<SearchState>) -> Vec<SlotDraw> {
    let Some(search) = search else { return Vec::new() };
    let drawn = study
        .slots()
        .into_iter()
        .map(|slot| search.draw(iteration(study, epoch, slot), &mut stream(study, spec, epoch, slot, "parent")));
    drawn.collect::<Option<Vec<SlotDraw>>>().unwrap_or_default()
}

/// Returns the leader after an epoch: under a method with one score the best accepted child that acts, if it is better
/// than the leader before. A population has no leader, and random patches change none.
pub fn lead(rival: &SearchOptions, parents: &[Contender], accepted: &[Contender]) -> Option<Leaders> {
    if matches!(rival.method, Method::Random | Method::Nsga2 | Method::Pareto) {
        return None;
    }
    let score = |of: &Contender| rival.scalar(of.objectives);
    let led = score(parents.first()?);
    let better = accepted.iter().filter(|child| child.coverage > 0.0 && score(child) > led);
    let best = better.reduce(|best, next| if score(next) > score(best) { next } else { best })?;
    Some(Leaders { active: best.solution.clone(), realism_anchor: None })
}

/// Returns what a slot is asked for. Methods with one score ask for more of it; the others ask as the archive does.
pub fn target(study: &Study, aims: &Aims<'_>, epoch: u32, slot: u32) -> Target {
    let slots = study.budget.slots;
    let Objectives { attack, .. } = aims.parent.objectives;
    match (study.method(), study.rival()) {
        (Method::AttackOnly, _) => {
            let text = format!("Raise attack above {attack:.3}. Realism does not count.");
            Target { text, ..target::target(aims, epoch, 3 * slot, slots) }
        }
        (Method::HillClimbing | Method::OpenEvolve, Some(rival)) => {
            // Half of the slots look for attack first, half for realism: both are part of the score.
            let asked = target::target(aims, epoch, slot / 2 * 3 + slot % 2, slots);
            let more = if asked.kind == TargetKind::RaiseRealism { "realism" } else { "attack" };
            let score = rival.scalar(aims.parent.objectives);
            Target { text: format!("Raise the score above {score:.3}, first by more {more}."), ..asked }
        }
        _ => target::target(aims, epoch, slot, slots),
    }
}

/// The requests behind a score.
pub fn requests(score: &Score) -> impl Iterator<Item = Digest> + '_ {
    score.scenes.iter().flat_map(SceneScore::each).map(|label| label.request)
}

/// The lineage's requests of rollouts so far, those of the epoch's parents included; empty where nothing bounds them.
pub fn spent(study: &Study, state: &State, spec: &LineageSpec, standing: &Standings) -> BTreeSet<Digest> {
    if study.search.as_ref().and_then(|search| search.rollouts).is_none() {
        return BTreeSet::new();
    }
    let mut spent = state.spent.get(&spec.id).cloned().unwrap_or_default();
    standing.values().for_each(|labels| spent.extend(requests(&labels.so_far)));
    spent
}

/// Returns `true` if a lineage cannot pay for one more candidate.
pub fn is_over(study: &Study, state: &State, spec: &LineageSpec) -> bool {
    let Some(budget) = study.search.as_ref().and_then(|search| search.rollouts) else { return false };
    let spent = state.spent.get(&spec.id).map_or(0, BTreeSet::len);
    spent + study.budget.window.min(study.evolution.len()) > budget
}
