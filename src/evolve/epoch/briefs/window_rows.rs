//! The parent's outcome scene by scene: what happened, and why a contact did not count or none came about.

use super::briefing::cluster_of;
use crate::agents::SceneRow;
use crate::compiler::Decision;
use crate::epoch::RunError;
use crate::epoch::setting::desk::Tools;
use crate::epoch::setting::study::{SceneEntry, Study};
use crate::evaluation::{RolloutCache, RolloutRecord};
use crate::objects::{SceneScore, Score};
use crate::sim::ActorRef;

/// An adversary that stays farther away never came close, metres.
const CLOSE_M: f64 = 10.0;
/// The ego braked if it slowed down harder than this, m/s².
const BRAKED_MPS2: f64 = 2.5;

/// An adversary that comes nearer than this nearly met the ego, metres.
const NEAR_MISS_M: f64 = 1.0;
/// The same of the time to collision, s.
const NEAR_MISS_S: f64 = 1.0;

/// One row a labelled scene. `telling` are the tags that say something about a scene of the window.
pub fn rows(study: &Study, score: &Score, telling: &[String], tools: &Tools<'_>) -> Result<Vec<SceneRow>, RunError> {
    let mut rows = Vec::with_capacity(score.scenes.len());
    for scene in &score.scenes {
        if let (Some(entry), Some((record, _))) = (study.scene(&scene.scene), tools.rollouts.recorded(&scene.request)?)
        {
            rows.push(row(entry, scene, &record, telling)?);
        }
    }
    Ok(rows)
}

fn row(
    entry: &SceneEntry,
    scene: &SceneScore,
    record: &RolloutRecord,
    telling: &[String],
) -> Result<SceneRow, RunError> {
    let unread = |error| RunError::Study(format!("a rollout record's decision cannot be read: {error}"));
    let decision: Decision = record.decision.read().map_err(unread)?;
    let tags = entry.features().tags.iter().map(|tag| tag.to_string());
    Ok(SceneRow {
        scene: scene.scene.clone(),
        cluster: cluster_of(entry.features()).to_string(),
        tags: tags.filter(|tag| telling.contains(tag)).collect(),
        actors: record.outcome.adversaries.iter().map(|report| named(entry, report.actor)).collect(),
        attack: scene.attack,
        outcome: outcome(scene, record),
        contact: record.outcome.contact.map(|contact| contact.class.name().to_string()),
        nearest_m: record.outcome.distance_m_min.filter(|_| scene.acted),
        note: note(scene, &decision),
        diagnostics: if scene.acted { scene.diagnostics.clone() } else { Default::default() },
        metrics: scene.metrics.clone(),
        encounter: None,
    })
}

/// Returns `true` if an attack nearly came about: an adversary that acts came very near, or was about to.
pub fn near_miss(scene: &SceneScore, record: &RolloutRecord) -> bool {
    let within = |value: Option<f64>, least: f64| value.is_some_and(|value| value < least);
    let outcome = &record.outcome;
    scene.acted
        && scene.attack == 0.0
        && (within(outcome.distance_m_min, NEAR_MISS_M) || within(outcome.ttc_s_min, NEAR_MISS_S))
}

/// An adversary by its id in the scene, or as an inserted one.
fn named(entry: &SceneEntry, actor: ActorRef) -> String {
    match actor {
        ActorRef::Track(track) => entry.scene().tracks.get(track).map_or_else(|| track.to_string(), |t| t.id.clone()),
        ActorRef::Inserted(place) => format!("inserted_{place}"),
    }
}

/// Returns the outcome of the scene, in the words that the prompt explains.
fn outcome(scene: &SceneScore, record: &RolloutRecord) -> &'static str {
    let outcome = &record.outcome;
    let Some(contact) = outcome.contact else {
        let struck = outcome.adversaries.iter().any(|report| report.struck_bystander || report.struck_parked);
        return match outcome.distance_m_min {
            _ if !scene.acted => "not_acting",
            _ if struck => "blocked",
            Some(distance_m) if distance_m > CLOSE_M => "never_close",
            None => "never_close",
            _ if outcome.ego.deceleration_mps2_max > BRAKED_MPS2 => "ego_braked",
            _ => "missed",
        };
    };
    let acts = outcome.adversaries.iter().any(|report| report.actor == contact.with && report.acted);
    if scene.attack > 0.0 {
        "attack"
    } else if record.meets_anyway == Some(contact.with) {
        "anyway"
    } else if !contact.adversary {
        "bystander"
    } else if !acts {
        "unmoved"
    } else if contact.avoidable == Some(false) {
        "unavoidable"
    } else {
        "not_counted"
    }
}

/// Returns the attack against each of several drivers, and why the program did not act or which filters refused every candidate.
fn note(scene: &SceneScore, decision: &Decision) -> String {
    let each = scene.by_ego.iter().map(|(ego, label)| format!("{ego} {:.2}", label.attack)).collect::<Vec<_>>();
    if each.is_empty() {
        decided(decision)
    } else {
        format!("attack against {}; {}", each.join(", "), decided(decision)).trim_end_matches("; ").to_string()
    }
}

fn decided(decision: &Decision) -> String {
    if !decision.applies {
        return decision.reason.clone();
    }
    let emptied = decision.filters.iter().filter_map(|filter| Some((&filter.node, filter.violation?)));
    emptied
        .map(|(node, by)| format!("{node} refused all, nearest violates it by {by:.2}"))
        .collect::<Vec<_>>()
        .join("; ")
}
