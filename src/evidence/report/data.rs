//! What the page shows, as one JSON value: the story of the run in the shapes that the page's script draws.

use serde_json::{Value, json};

use super::super::story::Story;
use crate::objects::{Attempt, Counselled, LineageId, edit_categories, event::LineageResult, program_diff};

/// Everything but the player's scenes.
pub fn of(story: &Story) -> Value {
    let lineages: Vec<Value> = story.parents.iter().map(|p| lineage(story, &p.lineage)).collect();
    json!({
        "name": story.opened.name,
        "root": story.root,
        "sealed": story.result.is_some(),
        "models": story.opened.models,
        "scripted_roles": story.opened.scripted_roles(),
        "versions": story.opened.versions,
        "experiment": story.opened.experiment,
        "pool": story.opened.pool,
        "evolution_scenes": story.opened.evolution_scenes.len(),
        "held_out_scenes": story.opened.held_out_scenes.len(),
        "exits": story.result.as_ref().map(|r| r.exits),
        "rollouts": story.result.as_ref().map(|r| r.rollouts),
        "lineages": lineages,
        "counsels": story.counsels.iter().map(counsel).collect::<Vec<_>>(),
        "attempts": story.attempts.iter().map(|a| attempt(story, a)).collect::<Vec<_>>(),
    })
}

fn lineage(story: &Story, id: &LineageId) -> Value {
    let parent = story.parents.iter().find(|p| p.lineage == *id);
    let result: Option<&LineageResult> =
        story.result.as_ref().and_then(|r| r.lineages.iter().find(|l| l.lineage == *id));
    let epochs: Vec<Value> = story
        .settled
        .iter()
        .filter(|s| s.lineage == *id)
        .map(|s| json!({"epoch": s.epoch, "hypervolume": s.hypervolume, "front": s.front, "active": s.active}))
        .collect();
    let parent_scores: Vec<Value> = story
        .frozen
        .iter()
        .filter(|f| f.lineage == *id)
        .map(|f| json!({"epoch": f.epoch, "solution": f.parent, "objectives": f.parent_score.objectives}))
        .collect();
    json!({
        "id": id,
        "family": parent.map(|p| &p.program.source_family),
        "ego": parent.map(|p| &p.ego),
        "parent": parent.map(|p| &p.program.solution_id),
        "active": story.active(id),
        "epochs": epochs,
        "parent_scores": parent_scores,
        "result": result,
    })
}

fn counsel(counselled: &Counselled) -> Value {
    let rounds = counselled.rounds.iter().map(|round| {
        json!({
            "attackers": round.attackers,
            "reason": round.reason,
            "by": round.proposed_by,
            "outcome": round.trial.code(),
            "distance_m": Some(round.trial.distance_m()).filter(|m| m.is_finite()),
        })
    });
    json!({
        "lineage": counselled.lineage,
        "scene": counselled.scene,
        "rounds": rounds.collect::<Vec<_>>(),
        "advised": counselled.chosen().map(|round| &round.attackers),
        "exchanges": counselled.exchanges,
    })
}

fn attempt(story: &Story, attempt: &Attempt) -> Value {
    let patch = attempt.proposal.patch();
    let candidate = attempt.exit.candidate();
    let change = candidate
        .and_then(|c| story.program(&attempt.parent).map(|parent| program_diff(parent, &c.program)))
        .unwrap_or_default();
    let reason = match &attempt.exit {
        crate::objects::Exit::Declined { reason } => Some(reason),
        _ => None,
    };
    json!({
        "id": attempt.id,
        "lineage": attempt.lineage,
        "epoch": attempt.epoch,
        "slot": attempt.slot,
        "parent": attempt.parent,
        "target": attempt.target,
        "exit": attempt.exit.name(),
        "reason": reason,
        "hypothesis": patch.map(|p| &p.hypothesis),
        "operations": patch.map(|p| &p.operations),
        "categories": patch.map(|p| edit_categories(p).into_iter().map(|s| s.name()).collect::<Vec<_>>()),
        "tags": candidate.map(|c| &c.mechanism_tags),
        "solution": candidate.map(|c| &c.program.solution_id),
        "memory": attempt.memory_shown,
        "exchanges": attempt.proposal.exchanges,
        "reviews": attempt.proposal.rounds.iter().map(|r| &r.reviews).collect::<Vec<_>>(),
        "gates": attempt.exit.gates().map(|g| &g.verdicts),
        "route": attempt.exit.route(),
        "objectives": attempt.exit.score().map(|s| s.objectives),
        "scenes": attempt.exit.score().map(|s| &s.scenes),
        "failures": attempt.exit.score().map(|s| &s.failures),
        "decision": attempt.exit.decision(),
        "diff": change,
    })
}
