//! What past edits did: the change of each simulated child against its parent on the same scenes, and which of them the
//! prompts of an epoch show.

use std::collections::{BTreeMap, BTreeSet};

use super::briefing::cluster_of;
use crate::agents::{Change, PastEdit};
use crate::archive::Archive;
use crate::epoch::setting::study::Study;
use crate::epoch::state::State;
use crate::kernel::num;
use crate::objects::{Attempt, AttemptId, Card, Exit, LineageId, SceneScore, Score};

/// How many of a lineage's latest attempts are shown, whatever became of them.
const RECENT_ATTEMPTS: usize = 3;
/// Most problems of a refused patch, and characters of each.
const PROBLEMS: usize = 2;
const PROBLEM_CHARS: usize = 160;

/// What a simulated attempt did; `None` where there are no labels. `parent` is its parent's score on its window.
pub fn change(study: &Study, attempt: &Attempt, parent: &Score) -> Option<Change> {
    let (score, decision) = (attempt.exit.score()?, attempt.exit.decision()?);
    let (gates, pairs) = (&decision.gates, paired(score, parent));
    let named = |holds: &dyn Fn(&SceneScore, &SceneScore) -> bool| {
        let pairs_held = pairs.iter().filter(|(child, parent)| holds(child, parent));
        pairs_held.map(|(child, _)| child.scene.clone()).collect::<Vec<String>>()
    };
    let trade = &gates.parent_tradeoff;
    Some(Change {
        scenes: gates.scenes,
        attack: (trade.attack_change, trade.attack_uncertainty),
        realism: (trade.realism_change, trade.realism_uncertainty),
        coverage: gates.coverage.coverage - gates.coverage.parent,
        diagnostics: diagnostics(&pairs),
        clusters: clusters(study, &pairs),
        won: named(&|child, parent| child.attack > parent.attack),
        lost: named(&|child, parent| child.attack < parent.attack),
    })
}

/// Labels of child and parent in the scenes in which both have one, in the child's order.
fn paired<'s>(child: &'s Score, parent: &'s Score) -> Vec<(&'s SceneScore, &'s SceneScore)> {
    let of_parent: BTreeMap<&str, &SceneScore> = parent.scenes.iter().map(|s| (s.scene.as_str(), s)).collect();
    child.scenes.iter().filter_map(|scene| Some((scene, *of_parent.get(scene.scene.as_str())?))).collect()
}

fn means(all: BTreeMap<String, Vec<f64>>) -> BTreeMap<String, f64> {
    all.into_iter().filter_map(|(name, all)| Some((name, num::mean(&all)?))).collect()
}

/// Mean change of each diagnostic over the scenes in which both act.
fn diagnostics(pairs: &[(&SceneScore, &SceneScore)]) -> BTreeMap<String, f64> {
    let mut all: BTreeMap<String, Vec<f64>> = BTreeMap::new();
    for (child, parent) in pairs.iter().filter(|(child, parent)| child.acted && parent.acted) {
        for (name, value) in &child.diagnostics {
            if let Some(before) = parent.diagnostics.get(name) {
                all.entry(name.clone()).or_default().push(value - before);
            }
        }
    }
    means(all)
}

/// Mean change of attack in each cluster.
fn clusters(study: &Study, pairs: &[(&SceneScore, &SceneScore)]) -> BTreeMap<String, f64> {
    let mut all: BTreeMap<String, Vec<f64>> = BTreeMap::new();
    for (child, parent) in pairs {
        if let Some(entry) = study.scene(&child.scene) {
            let name = cluster_of(entry.features()).to_string();
            all.entry(name).or_default().push(child.attack - parent.attack);
        }
    }
    means(all)
}

/// The edits behind every front member and every card shown, and the latest ones, in the order in which they were made.
pub fn shown(state: &State, lineage: &LineageId, archive: &Archive, memory: &[Card]) -> Vec<PastEdit> {
    let own: Vec<&Attempt> = state.attempts.iter().filter(|attempt| attempt.lineage == *lineage).collect();
    let on_front: BTreeSet<&AttemptId> = archive.front().filter_map(|entry| entry.attempt.as_ref()).collect();
    let carded = memory.iter().filter_map(|card| card.attempt.as_ref());
    let recent = own[own.len().saturating_sub(RECENT_ATTEMPTS)..].iter().map(|attempt| &attempt.id);
    let wanted: BTreeSet<&AttemptId> = on_front.iter().copied().chain(carded).chain(recent).collect();
    let edits = own.iter().filter(|attempt| wanted.contains(&attempt.id));
    edits.map(|attempt| edit(attempt, on_front.contains(&attempt.id), state.changes.get(&attempt.id))).collect()
}

fn edit(attempt: &Attempt, on_front: bool, change: Option<&Change>) -> PastEdit {
    let patch = attempt.proposal.patch();
    let problems = match &attempt.exit {
        Exit::Declined { reason } => vec![reason.clone()],
        Exit::Invalid { gates } => gates.failed().flat_map(|v| v.problems.iter().cloned()).collect(),
        Exit::Rejected { .. } | Exit::Evaluated { .. } => Vec::new(),
    };
    PastEdit {
        attempt: attempt.id.clone(),
        parent: attempt.parent.clone(),
        ended: ended(attempt, on_front).into(),
        operations: patch.map(|patch| patch.operations.clone()).unwrap_or_default(),
        hypothesis: patch.map(|patch| patch.hypothesis.clone()).unwrap_or_default(),
        problems: problems.into_iter().take(PROBLEMS).map(|p| p.chars().take(PROBLEM_CHARS).collect()).collect(),
        change: change.cloned(),
    }
}

fn ended(attempt: &Attempt, on_front: bool) -> &'static str {
    match &attempt.exit {
        Exit::Declined { .. } => "declined by critics",
        Exit::Invalid { .. } => "refused by gates",
        Exit::Rejected { .. } => "not simulated",
        Exit::Evaluated { .. } if on_front => "on the front",
        Exit::Evaluated { decision, .. } if decision.gates.any() => "accepted, but dominated",
        Exit::Evaluated { decision, .. } if decision.gates.differing_scenes == 0 => {
            "not accepted: the parent's labels in every scene"
        }
        Exit::Evaluated { decision, .. } if !decision.gates.coverage.holds => "not accepted: acted in too few scenes",
        Exit::Evaluated { .. } => "not accepted",
    }
}
