//! Other search methods (`[search]`) at an epoch's snapshot: how they begin, whether they keep a child, random proposals, and
//! candidates that are dropped because the budget of rollouts is used up.

use std::collections::{BTreeMap, BTreeSet};

use super::search::{iteration, requests, stream, text};
use crate::archive::is_shown;
use crate::archive::search::{Child, Method, SearchState};
use crate::candidates::{Places, random_patch};
use crate::epoch::RunError;
use crate::epoch::freeze::Snapshot;
use crate::epoch::setting::study::Study;
use crate::epoch::slots::draft::{Draft, Head, Reached};
use crate::kernel::Digest;
use crate::objects::{
    AcceptanceGates, Attempt, Candidate, Difference, MethodVerdict, Proposal, Round, RouteDecision, Score,
};

/// Returns the memory of a method when a lineage begins.
pub fn begin(study: &Study, first: &Snapshot<'_>) -> Option<SearchState> {
    let parent = &first.parents[0];
    let (solution, objectives) = (&parent.program.solution_id, parent.score.objectives);
    let child = Child { solution, objectives, text: text(&parent.program), iteration: 0 };
    SearchState::begin(study.rival()?, child, &mut stream(study, first.spec, 0, 0, "begin"))
}

/// Returns the method's verdict on a labelled child; `None` under the archive's own gates.
pub fn verdict(
    study: &Study,
    snapshot: &Snapshot<'_>,
    slot: u32,
    candidate: &Candidate,
    score: &Score,
    gates: &AcceptanceGates,
    search: &mut Option<SearchState>,
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
    let (holds, own) = match (rival.method, search) {
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

/// A proposal that nobody was asked for: a random legal patch of the program that the slot edits.
pub fn random(study: &Study, snapshot: &Snapshot<'_>, slot: u32, target: String) -> Result<Draft, RunError> {
    let parent = snapshot.parent_of(slot);
    let contract = &study.source(snapshot.spec)?.contract;
    let mut values: BTreeMap<&'static str, Vec<f64>> = BTreeMap::new();
    for feature in &contract.scene_features {
        let of = study.evolution.iter().filter_map(|&place| study.scenes[place].features().value(feature.name));
        values.insert(feature.name, of.collect());
    }
    let edits_max = study.search.as_ref().and_then(|search| search.edits_max).unwrap_or(1);
    let mut stream = stream(study, snapshot.spec, snapshot.event.epoch, slot, "patch");
    let numbers = study.method() == Method::Numbers;
    let places = Places { contract, values: &values, closed: &study.without.closed(), numbers };
    let patch = random_patch(&parent.program, parent.hash, &places, edits_max, &mut stream);
    let rounds = vec![Round { patch: Some(patch.clone()), reviews: Vec::new() }];
    let proposal = Proposal { rounds, ..Proposal::default() };
    let reached = Reached::Proposed { patch: Box::new(patch), verdict: None };
    Ok(Draft { head: Head::new(slot, target, proposal), reached })
}

/// The lineage's requests of rollouts after an epoch with these attempts.
pub fn spent_after(snapshot: &Snapshot<'_>, attempts: &[Attempt], tuning: &BTreeSet<Digest>) -> BTreeSet<Digest> {
    let scores = attempts.iter().filter_map(|attempt| attempt.exit.score());
    snapshot.spent.iter().chain(tuning).copied().chain(scores.flat_map(requests)).collect()
}

/// Turns away, in slot order, the candidates that the lineage's budget of rollouts no longer pays for.
pub fn within_budget(
    study: &Study,
    snapshot: &Snapshot<'_>,
    mut drafts: Vec<Result<Draft, RunError>>,
) -> Vec<Result<Draft, RunError>> {
    let Some(budget) = study.search.as_ref().and_then(|search| search.rollouts) else { return drafts };
    let tuning: BTreeSet<&Digest> = drafts.iter().flatten().flat_map(|draft| &draft.head.tuning).collect();
    let mut left = budget.saturating_sub(snapshot.spent.len() + tuning.len()) / snapshot.window.len().max(1);
    for draft in drafts.iter_mut().flatten() {
        let Reached::Routed { routed, .. } = &mut draft.reached else { continue };
        if routed.is_rejected() {
            continue;
        }
        if left == 0 {
            routed.route.decision = RouteDecision::Reject;
            routed.route.reason = format!("the lineage's budget of {budget} rollouts is used up").into();
        }
        left = left.saturating_sub(1);
    }
    drafts
}
