//! Where another method than the archive's own searches (`[search]`), and what bounds it: whom its slots edit, what it keeps,
//! who leads, what a slot is asked for, and how many rollouts a lineage has left.

use std::collections::{BTreeMap, BTreeSet};

use super::{
    RunError,
    consider::Judged,
    draft::{Draft, Head, Reached},
    freeze::Snapshot,
    standings::Standings,
    state::State,
    study::{LineageSpec, Study},
    target::{self, Aims},
};
use crate::agents::{Target, TargetKind};
use crate::archive::search::{Child, Method, SearchOptions, SearchState, SlotDraw};
use crate::archive::{Contender, Leaders, is_shown};
use crate::candidates::{Places, random_patch};
use crate::kernel::{Digest, Stream};
use crate::objects::{
    AcceptanceGates, Candidate, Difference, MethodVerdict, Objectives, Program, Proposal, Round, RouteDecision, Score,
};

fn stream(study: &Study, spec: &LineageSpec, epoch: u32, slot: u32, purpose: &str) -> Stream {
    study.seed.stream(&["search", spec.id.as_str(), &epoch.to_string(), &slot.to_string(), purpose])
}

/// The parts of a program that a patch can change, as canonical text with two spaces of indent: what OpenEvolve calls code.
fn text(program: &Program) -> String {
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

fn iteration(study: &Study, epoch: u32, slot: u32) -> usize {
    epoch as usize * study.budget.slots as usize + slot as usize
}

/// What a method remembers when a lineage begins.
pub fn begin(study: &Study, first: &Snapshot<'_>) -> Option<SearchState> {
    let parent = &first.parents[0];
    let (solution, objectives) = (&parent.program.solution_id, parent.score.objectives);
    let child = Child { solution, objectives, text: text(&parent.program), iteration: 0 };
    SearchState::begin(study.rival()?, child, &mut stream(study, first.spec, 0, 0, "begin"))
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

/// What the method says of a labelled child; `None` under the archive's own gates.
pub fn verdict(
    study: &Study,
    snapshot: &Snapshot<'_>,
    slot: u32,
    (candidate, score): (&Candidate, &Score),
    gates: &AcceptanceGates,
    judged: &mut Judged,
) -> Option<MethodVerdict> {
    let rival = study.rival()?;
    let epoch = snapshot.event.epoch;
    let trade = &gates.parent_tradeoff;
    let mut stream = stream(study, snapshot.spec, epoch, slot, "keep");
    let child = Child {
        solution: &candidate.program.solution_id,
        objectives: score.objectives,
        text: text(&candidate.program),
        iteration: iteration(study, epoch, slot),
    };
    let value = rival.scalar(score.objectives);
    let (holds, own) = match (rival.method, &mut judged.search) {
        (Method::AttackOnly, _) => {
            let gain = Difference { value: trade.attack_change, uncertainty: trade.attack_uncertainty };
            (is_shown(&gain, study.archive.level), Some(score.objectives.attack))
        }
        (Method::HillClimbing, _) => (value > rival.scalar(snapshot.parent_of(slot).score.objectives), Some(value)),
        (_, Some(search)) => (search.consider(rival, child, &mut stream), rival.attack_weight.map(|_| value)),
        // Everybody is kept to be reported, nobody leads.
        (_, None) => (true, None),
    };
    Some(MethodVerdict { method: rival.method.name().into(), holds, score: own })
}

/// Who leads after an epoch: under a method with one score the best of its accepted children, where it is better than who
/// led. A population has no leader, and random patches lead nowhere.
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

/// What a slot is asked for. Methods with one score ask for more of it; the others as the archive does.
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

/// A proposal that nobody was asked for: a random legal patch of the lineage's parent.
pub fn random(study: &Study, snapshot: &Snapshot<'_>, slot: u32, target: String) -> Result<Draft, RunError> {
    let parent = snapshot.parent_of(slot);
    let contract = &study.source(snapshot.spec)?.contract;
    let mut values: BTreeMap<&'static str, Vec<f64>> = BTreeMap::new();
    for feature in &contract.scene_features {
        let of = study.evolution.iter().filter_map(|&place| study.scenes[place].features().value(feature.name));
        values.insert(feature.name, of.collect());
    }
    let edits_max = study.rival().and_then(|rival| rival.edits_max).unwrap_or(1);
    let mut stream = stream(study, snapshot.spec, snapshot.event.epoch, slot, "patch");
    let places = Places { contract, values: &values, closed: &study.without.closed() };
    let patch = random_patch((&parent.program, parent.hash), &places, edits_max, &mut stream);
    let proposal =
        Proposal { exchanges: Vec::new(), rounds: vec![Round { patch: Some(patch.clone()), reviews: Vec::new() }] };
    let reached = Reached::Proposed { patch: Box::new(patch), verdict: None };
    Ok(Draft { head: Head { slot, target, proposal }, reached })
}

fn requests(score: &Score) -> impl Iterator<Item = Digest> + '_ {
    score.scenes.iter().map(|scene| scene.request)
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

/// The same after an epoch.
pub fn spent_after(snapshot: &Snapshot<'_>, judged: &Judged) -> BTreeSet<Digest> {
    let scores = judged.attempts.iter().filter_map(|attempt| attempt.exit.score());
    snapshot.spent.iter().copied().chain(scores.flat_map(requests)).collect()
}

/// Whether a lineage cannot pay for one more candidate.
pub fn is_over(study: &Study, state: &State, spec: &LineageSpec) -> bool {
    let Some(budget) = study.search.as_ref().and_then(|search| search.rollouts) else { return false };
    let spent = state.spent.get(&spec.id).map_or(0, BTreeSet::len);
    spent + study.budget.window.min(study.evolution.len()) > budget
}

/// Turns away, in slot order, the candidates that the lineage's budget of rollouts no longer pays for.
pub fn within_budget(
    study: &Study,
    snapshot: &Snapshot<'_>,
    mut drafts: Vec<Result<Draft, RunError>>,
) -> Vec<Result<Draft, RunError>> {
    let Some(budget) = study.search.as_ref().and_then(|search| search.rollouts) else { return drafts };
    let mut left = budget.saturating_sub(snapshot.spent.len()) / snapshot.window.len().max(1);
    for draft in drafts.iter_mut().flatten() {
        let Reached::Routed { routed, .. } = &mut draft.reached else { continue };
        if routed.is_rejected() {
            continue;
        }
        if left == 0 {
            routed.route.decision = RouteDecision::Reject;
            routed.route.reason = format!("the lineage's budget of {budget} rollouts is used up");
        }
        left = left.saturating_sub(1);
    }
    drafts
}
