//! Scenes in detailed questions: those of the window that say most, each with what led to its outcome. Our own simulator
//! plays their motion once more; another simulator plays nothing again, and the record of its rollout says what it can.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use super::window_rows::near_miss;
use crate::agents::{Encounter, Moment, Remark, SceneRow};
use crate::backend::Backend;
use crate::compiler::Decision;
use crate::epoch::RunError;
use crate::epoch::labelling::labels::Labelling;
use crate::epoch::labelling::made::{Lazy, Made};
use crate::evaluation::{RolloutCache, RolloutRecord};
use crate::kernel::{OrientedBox, Pose, num};
use crate::objects::{Program, SceneScore, Score};
use crate::scene::{DT_S, Sample};
use crate::sim::{Action, ActorRef, Striker, Trace, lateness_s, rollout_traced};

/// Most scenes that a question shows.
const SHOWN_MAX: usize = 12;
/// Of these at most so many of one outcome, before the rest is filled up.
const OF_ONE_OUTCOME: usize = 3;
/// Scenes of lowest realism that are shown in any case.
const LEAST_REALISTIC: usize = 3;
/// The ego brakes from where it slows down harder than this, m/s².
const BRAKES_MPS2: f64 = 1.5;
/// A law has taken over where its road user is this far from the way that was chosen for it, metres.
const DEPARTED_M: f64 = 0.3;

/// The scenes of a window that say most, in its order: of every outcome some, those of least realism, near misses first.
fn telling(score: &Score, rows: &[SceneRow], near: &BTreeSet<String>) -> Vec<usize> {
    let realism: BTreeMap<&str, f64> = score.scenes.iter().map(|of| (of.scene.as_str(), of.realism)).collect();
    let mut order: Vec<usize> = (0..rows.len()).collect();
    order.sort_by_key(|&at| !near.contains(&rows[at].scene));
    let mut by_realism: Vec<usize> = (0..rows.len()).filter(|&at| !rows[at].diagnostics.is_empty()).collect();
    by_realism.sort_by(|a, b| realism[rows[*a].scene.as_str()].total_cmp(&realism[rows[*b].scene.as_str()]));
    let mut chosen: Vec<usize> = by_realism.into_iter().take(LEAST_REALISTIC.min(SHOWN_MAX)).collect();
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    let (first, rest): (Vec<usize>, Vec<usize>) = order.into_iter().partition(|&at| {
        let count = counts.entry(rows[at].outcome).or_default();
        *count += 1;
        *count <= OF_ONE_OUTCOME
    });
    for at in first.into_iter().chain(rest) {
        if chosen.len() < SHOWN_MAX && !chosen.contains(&at) {
            chosen.push(at);
        }
    }
    chosen.sort_unstable();
    chosen
}

/// The scenes in which an attack nearly came about.
pub fn near_misses(score: &Score, rollouts: &dyn RolloutCache) -> Result<BTreeSet<String>, RunError> {
    let mut near = BTreeSet::new();
    for scene in &score.scenes {
        if rollouts.recorded(&scene.request)?.is_some_and(|(record, _)| near_miss(scene, &record)) {
            near.insert(scene.scene.clone());
        }
    }
    Ok(near)
}

/// Describes what led to the outcome of the scene at a place.
fn encounter<'l>(
    labelling: &'l Labelling<'l>,
    program: &'l Lazy<'l>,
    place: usize,
    record: &RolloutRecord,
) -> Result<Encounter, RunError> {
    let unread = |error| RunError::Study(format!("a rollout record's decision cannot be read: {error}"));
    let decision: Decision = record.decision.read().map_err(unread)?;
    let mut encounter = Encounter { ttc_s: record.outcome.ttc_s_min, ..Encounter::default() };
    if !record.outcome.acted() {
        return Ok(Encounter::default());
    }
    encounter.remarks.extend(struck(record));
    let relived = relived(labelling, program, place, record)?;
    if let Some(relived) = &relived {
        encounter.moment = moment(record, relived);
        encounter.remarks.extend(relived.late_s.and_then(late));
        encounter.remarks.extend(braking(&relived.trace));
    }
    encounter.remarks.extend(chosen(&decision));
    encounter.remarks.extend(relived.as_ref().and_then(law));
    Ok(encounter)
}

/// A rollout with its motion.
struct Relived {
    made: Arc<Made>,
    trace: Trace,
    late_s: Option<f64>,
    /// Length and width of the ego, metres.
    ego_size: (f64, f64),
}

/// The rollout of a record once more; `None` where another simulator or a planner made it.
fn relived<'l>(
    labelling: &'l Labelling<'l>,
    program: &'l Lazy<'l>,
    place: usize,
    record: &RolloutRecord,
) -> Result<Option<Relived>, RunError> {
    let Labelling { study, spec, counsels, tools } = *labelling;
    if !matches!(tools.backend, Backend::Own) {
        return Ok(None);
    }
    let Ok(situation) = tools.situations.at(place, &spec.ego, &tools.backend) else { return Ok(None) };
    let Ok(prepared) = program.prepared(study.source(spec)?, &tools.searched) else { return Ok(None) };
    let made = labelling.compiled(prepared, place, &situation, counsels.at(study, spec, place)?)?;
    let relive = |made: Arc<Made>| {
        let (plant, intervention, mut driver) = (&situation.plant, &made.compiled.intervention, spec.ego.driver());
        let (_, trace) = rollout_traced(plant, intervention, driver.as_mut()).ok()?;
        // The record is of the same rollout, and its contact is assessed.
        let late_s = lateness_s(plant, intervention, driver.as_mut(), &record.outcome).ok()?;
        let ego = &situation.scene.ego.track;
        Some(Relived { late_s, ego_size: (ego.length_m, ego.width_m), trace, made })
    };
    Ok(made.ok().and_then(relive))
}

/// The contact with an adversary, or the moment at which one that acts was nearest.
fn moment(record: &RolloutRecord, relived: &Relived) -> Option<Moment> {
    let trace = &relived.trace;
    let acts = |who: ActorRef| record.outcome.adversaries.iter().any(|of| of.actor == who && of.acted);
    let body =
        |sample: &Sample, (length_m, width_m)| OrientedBox::new(sample.position, sample.heading_rad, length_m, width_m);
    let at = |actor: usize, k: usize| trace.actors[actor].samples.get(k).and_then(Option::as_ref);
    let (actor, k) = match record.outcome.contact {
        Some(contact) => {
            let last = trace.ego.len().checked_sub(1)?;
            let actor = trace.actors.iter().position(|of| of.actor == contact.with)?;
            at(actor, last).map(|_| (actor, last)).or_else(|| Some((actor, last.checked_sub(1)?)))?
        }
        None => {
            let mut nearest: Option<(f64, usize, usize)> = None;
            for actor in (0..trace.actors.len()).filter(|&of| acts(trace.actors[of].actor)) {
                for (k, ego) in trace.ego.iter().enumerate() {
                    let Some(own) = at(actor, k) else { continue };
                    let size = (trace.actors[actor].length_m, trace.actors[actor].width_m);
                    let distance_m = body(own, size).distance(&body(ego, relived.ego_size));
                    if nearest.is_none_or(|(least_m, ..)| distance_m < least_m) {
                        nearest = Some((distance_m, actor, k));
                    }
                }
            }
            nearest.map(|(_, actor, k)| (actor, k))?
        }
    };
    let (own, ego) = (at(actor, k)?, &trace.ego[k]);
    let local = Pose { position: ego.position, heading_rad: ego.heading_rad }.to_local(own.position);
    let time_s = record.outcome.contact.map_or(k as f64 * DT_S, |contact| contact.time_s);
    Some(Moment {
        time_s,
        own_mps: own.speed_mps(),
        ego_mps: ego.speed_mps(),
        bearing_deg: num::atan2(local.y, local.x).to_degrees(),
    })
}

/// Says who ran into whom, and since when the ego could see it coming.
fn struck(record: &RolloutRecord) -> Vec<Remark> {
    let Some(contact) = record.outcome.contact else { return Vec::new() };
    let who = match contact.striker {
        Striker::Ego => "ego",
        Striker::Other => "it",
        Striker::Both => "both",
    };
    let seen = (contact.adversary || contact.visible_s.is_some()).then_some(Remark::Seen(contact.visible_s));
    [Remark::Strikes(who)].into_iter().chain(seen).collect()
}

fn late(late_s: f64) -> Option<Remark> {
    (late_s >= DT_S / 2.0).then_some(Remark::Late(late_s))
}

/// When the ego began to brake, and how hard it braked at most.
fn braking(trace: &Trace) -> Option<Remark> {
    let speeds: Vec<f64> = trace.ego.iter().map(Sample::speed_mps).collect();
    let decelerations: Vec<f64> = speeds.windows(2).map(|pair| (pair[0] - pair[1]) / DT_S).collect();
    // The last step may be cut short by a contact.
    let whole = &decelerations[..decelerations.len().saturating_sub(1)];
    let from = whole.iter().position(|hard| *hard > BRAKES_MPS2)?;
    let hardest = whole.iter().copied().fold(0.0, f64::max);
    Some(Remark::Brakes(hardest, from as f64 * DT_S))
}

/// Which candidate won among how many, adversary by adversary.
fn chosen(decision: &Decision) -> Option<Remark> {
    let of: Vec<_> = decision.actors.iter().map(|actor| (actor.chosen + 1, actor.candidates)).collect();
    (!of.is_empty()).then_some(Remark::Took(of))
}

/// When the first law took over.
fn law(relived: &Relived) -> Option<Remark> {
    let trace = &relived.trace;
    let mut lawful = false;
    let mut onset: Option<usize> = None;
    for action in &relived.made.compiled.intervention.actions {
        let Action::FollowThenObey { track, from_step, samples, .. } = action else { continue };
        lawful = true;
        let Some(actor) = trace.actors.iter().find(|of| of.actor == ActorRef::Track(*track)) else { continue };
        let departed = |k: &usize| {
            let planned = (trace.from_step + k).checked_sub(*from_step).and_then(|at| samples.get(at));
            let own = actor.samples.get(*k).and_then(Option::as_ref);
            own.zip(planned).is_some_and(|(own, planned)| own.position.distance(planned.position) > DEPARTED_M)
        };
        let first = (0..trace.ego.len()).find(departed);
        onset = first.into_iter().chain(onset).min();
    }
    lawful.then(|| Remark::Law(onset.map(|k| k as f64 * DT_S)))
}

/// The rows that a question shows, each with what led to its outcome. `rows` are all of the window.
pub fn with_encounters(
    labelling: &Labelling<'_>,
    program: &Program,
    score: &Score,
    rows: Vec<SceneRow>,
    near: &BTreeSet<String>,
) -> Result<Vec<SceneRow>, RunError> {
    let chosen = telling(score, &rows, near);
    let by_scene: BTreeMap<&str, &SceneScore> = score.scenes.iter().map(|of| (of.scene.as_str(), of)).collect();
    let program = Lazy::new(program);
    let study = labelling.study;
    let one = |&at: &usize| -> Result<SceneRow, RunError> {
        let mut row = rows[at].clone();
        let place = study.scenes.iter().position(|entry| entry.scene().id == row.scene);
        let recorded = match by_scene.get(row.scene.as_str()) {
            Some(scene) => labelling.tools.rollouts.recorded(&scene.request)?,
            None => None,
        };
        if let (Some(place), Some((record, _))) = (place, recorded) {
            row.encounter = Some(encounter(labelling, &program, place, &record)?);
        }
        Ok(row)
    };
    labelling.tools.threads.map(&chosen, |_, at| one(at)).into_iter().collect()
}
