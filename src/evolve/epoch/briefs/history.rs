//! Effects of past edits: the change of each simulated child against its parent on the same scenes, and the choice of
//! those that the prompts of an epoch show.

use std::collections::{BTreeMap, BTreeSet};

use super::briefing::cluster_of;
use crate::agents::{Change, Numbers, PastEdit};
use crate::archive::Archive;
use crate::epoch::setting::study::Study;
use crate::epoch::state::State;
use crate::kernel::num;
use crate::objects::{Attempt, AttemptId, Card, Exit, LineageId, SceneScore, Score};

/// Number of a lineage's latest attempts that are shown, whatever became of them.
const RECENT_ATTEMPTS: usize = 3;
/// Most problems of a refused patch that are shown, and most characters of each.
const PROBLEMS: usize = 2;
const PROBLEM_CHARS: usize = 160;

/// Returns what a simulated attempt changed; `None` where there are no labels. `parent` is its parent's score on its window. Clusters
/// are those of `conflicts`, where there are any.
pub fn change(
    study: &Study,
    conflicts: &BTreeMap<String, &'static str>,
    attempt: &Attempt,
    parent: &Score,
    near: Option<[usize; 2]>,
) -> Option<Change> {
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
        clusters: clusters(study, conflicts, &pairs),
        won: named(&|child, parent| child.attack > parent.attack),
        lost: named(&|child, parent| child.attack < parent.attack),
        near,
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
fn clusters(
    study: &Study,
    conflicts: &BTreeMap<String, &'static str>,
    pairs: &[(&SceneScore, &SceneScore)],
) -> BTreeMap<String, f64> {
    let mut all: BTreeMap<String, Vec<f64>> = BTreeMap::new();
    for (child, parent) in pairs {
        if let Some(entry) = study.scene(&child.scene) {
            let conflict = conflicts.get(&child.scene).copied();
            let name = conflict.unwrap_or_else(|| cluster_of(entry.features())).to_string();
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
    let measured_on: BTreeSet<&AttemptId> =
        archive.challengers().iter().filter_map(|of| archive.entry(&of.solution)?.attempt.as_ref()).collect();
    let wanted: BTreeSet<&AttemptId> =
        on_front.iter().copied().chain(carded).chain(recent).chain(measured_on.iter().copied()).collect();
    let edits = own.iter().filter(|attempt| wanted.contains(&attempt.id));
    let shown = |attempt: &Attempt| {
        let mut edit = edit(attempt, on_front.contains(&attempt.id), state.changes.get(&attempt.id));
        if measured_on.contains(&attempt.id) {
            edit.ended = "not accepted yet: its gain is measured on".into();
        }
        edit
    };
    edits.map(|attempt| shown(attempt)).collect()
}

/// Says in a sentence what became of the attempts of a lineage that its history does not show; empty where it shows all.
pub fn not_shown(state: &State, lineage: &LineageId, shown: &[PastEdit]) -> String {
    let seen: BTreeSet<&AttemptId> = shown.iter().map(|edit| &edit.attempt).collect();
    let left_out = state.attempts.iter().filter(|attempt| attempt.lineage == *lineage && !seen.contains(&attempt.id));
    let mut counts: BTreeMap<String, usize> = BTreeMap::new();
    for attempt in left_out {
        let became = match &attempt.exit {
            Exit::Invalid { gates } => {
                let by: Vec<String> =
                    gates.failed().map(|verdict| format!("{:?}", verdict.gate).to_lowercase()).collect();
                format!("refused by {}", by.join(" and "))
            }
            _ => ended(attempt, false).to_string(),
        };
        *counts.entry(became).or_default() += 1;
    }
    let total: usize = counts.values().sum();
    let all = counts.into_iter().map(|(became, count)| format!("{count} {became}")).collect::<Vec<_>>().join(", ");
    if total == 0 { String::new() } else { format!("Not shown are {total} earlier attempts: {all}.") }
}

/// Adds what the acceptance compared, where it turned a child down; the comparison with the parent is the change itself.
pub fn with_verdicts(state: &State, shown: &mut [PastEdit], numbers: Numbers) {
    for edit in shown {
        let attempt = state.attempts.iter().find(|attempt| attempt.id == edit.attempt);
        let Some(decision) = attempt.and_then(|attempt| attempt.exit.decision()) else { continue };
        let gates = &decision.gates;
        if gates.any() || gates.method.is_some() {
            continue;
        }
        let with = |value: f64, error: Option<f64>| numbers.difference(value, error);
        let (area, push) = (&gates.densification, &gates.local_push);
        let mut says = vec![if area.non_dominated {
            format!("area {}", with(area.hypervolume_gain, area.uncertainty))
        } else {
            "dominated".into()
        }];
        for (title, best, difference) in [
            ("push_A", push.best_attack_at_r0, &push.attack_push),
            ("push_R", push.best_realism_at_a0, &push.realism_push),
        ] {
            if let (Some(best), Some(difference)) = (best, difference) {
                says.push(format!("{title} {} on {best:.3}", with(difference.value, difference.uncertainty)));
            }
        }
        let coverage = &gates.coverage;
        if !coverage.holds {
            says.push(format!("acts in {:.2} of the scenes, needs {:.2}", coverage.coverage, coverage.floor));
        }
        edit.verdict = Some(says.join("; "));
    }
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
        verdict: None,
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
