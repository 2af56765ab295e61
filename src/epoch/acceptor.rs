//! The serial acceptor: judges an epoch's drafts in slot order, then changes the state exactly once.

use super::{
    RunError,
    draft::{Draft, Reached, RoutedCandidate},
    labels,
    progress::Progress,
    run::Desk,
    state::{Change, Snapshot, State},
    study::Study,
};
use crate::archive::{Archive, Contender, Selection, consider, promote};
use crate::evaluation::EvaluationError;
use crate::kernel::Digest;
use crate::memory::{CurationContext, curate, reflect};
use crate::objects::entry::diagnostics_mean;
use crate::objects::{
    Attempt, AttemptId, Card, Decision, Entry, Exit, Gate, GateReport, Program, RouteDecision, Score, Slot, WorldLabel,
    event::{FrontPoint, Settled},
};
use crate::sim::SIM_VERSION;
use crate::world;

/// An epoch's attempts and what they add, not yet part of the state.
pub struct Judged {
    pub attempts: Vec<Attempt>,
    archive: Archive,
    labels: Vec<WorldLabel>,
    promotion: Option<Selection>,
}

/// Labels, considers and promotes, in slot order: slot k meets the front as slots before it left it.
pub fn judge(
    study: &Study<'_>,
    state: &State,
    snapshot: &Snapshot<'_>,
    drafts: Vec<Result<Draft, RunError>>,
    desk: &mut Desk<'_>,
) -> Result<Judged, RunError> {
    let archive = state.archives.get(&snapshot.spec.id).cloned().unwrap_or_default();
    let mut judged = Judged { attempts: Vec::new(), archive, labels: Vec::new(), promotion: None };
    for draft in drafts {
        let attempt = judge_one(study, snapshot, draft?, &mut judged, desk)?;
        (desk.watch)(Progress::attempt(&attempt));
        judged.attempts.push(attempt);
    }
    let accepted: Vec<Contender> = judged.attempts.iter().filter_map(contender).collect();
    judged.promotion = promote(&accepted, &study.selector);
    mark_outcome(&mut judged);
    Ok(judged)
}

fn judge_one(
    study: &Study<'_>,
    snapshot: &Snapshot<'_>,
    draft: Draft,
    judged: &mut Judged,
    desk: &Desk<'_>,
) -> Result<Attempt, RunError> {
    let id = AttemptId::at(&snapshot.spec.id, snapshot.event.epoch, draft.slot);
    let exit = match draft.reached {
        Reached::Declined { reason } => Exit::Declined { reason },
        Reached::Invalid { gates } => Exit::Invalid { gates },
        Reached::Routed { gates, routed } if routed.route.decision == RouteDecision::Reject => {
            Exit::Rejected { gates, candidate: Box::new(routed.candidate), route: routed.route }
        }
        Reached::Routed { gates, routed } => evaluate(study, snapshot, &id, gates, *routed, judged, desk)?,
    };
    Ok(Attempt {
        id,
        lineage: snapshot.spec.id.clone(),
        epoch: snapshot.event.epoch,
        slot: draft.slot,
        parent: snapshot.parent.solution_id.clone(),
        parent_hash: snapshot.event.parent_hash,
        target: draft.target,
        memory_shown: snapshot.event.memory_shown.iter().map(crate::objects::CardId::new).collect(),
        proposal: draft.proposal,
        exit,
    })
}

/// Real labels, then the archive's gates. A candidate that no scene of the window can label does not compile there:
/// it is invalid, because a label is never invented.
fn evaluate(
    study: &Study<'_>,
    snapshot: &Snapshot<'_>,
    id: &AttemptId,
    mut gates: GateReport,
    routed: RoutedCandidate,
    judged: &mut Judged,
    desk: &Desk<'_>,
) -> Result<Exit, RunError> {
    let RoutedCandidate { candidate, route, pairs, monitored } = routed;
    let subject = (&candidate.program, candidate.program_hash);
    let score = match labels::score(study, snapshot.spec, subject, &snapshot.window, desk.rollouts) {
        Ok(score) => score,
        Err(RunError::Evaluation(EvaluationError::NoLabel(reason))) => {
            for verdict in gates.verdicts.iter_mut().filter(|v| v.gate == Gate::Compile) {
                verdict.problems.push(format!("no scene of the window could be labelled: {reason}"));
            }
            return Ok(Exit::Invalid { gates });
        }
        Err(error) => return Err(error),
    };
    for pair in pairs {
        let Some(scene) = score.scenes.iter().find(|scene| scene.scene == pair.scene) else { continue };
        judged.labels.push(WorldLabel {
            attempt: id.clone(),
            solution: candidate.program.solution_id.clone(),
            epoch: snapshot.event.epoch,
            pair,
            labels: crate::objects::Objectives { attack: scene.attack, realism: scene.realism },
            diagnostics: scene.diagnostics.clone(),
            decision: route.decision,
            predicted: route.predicted,
            monitored,
        });
    }
    let parent = snapshot.event.parent_score.objectives;
    let acceptance = consider(&judged.archive, score.objectives, parent, &study.archive)?;
    let entry = Entry {
        attempt: Some(id.clone()),
        gates: Some(acceptance.clone()),
        ..entry(snapshot, &candidate.program, candidate.program_hash, &score)?
    };
    let entry = Entry { mechanism_tags: candidate.mechanism_tags.clone(), ..entry };
    let inserted = judged.archive.insert(entry)?;
    let decision = Decision { promoted: false, on_front: inserted.on_front, gates: acceptance };
    Ok(Exit::Evaluated { gates, candidate: Box::new(candidate), route, score, decision })
}

/// The archive's entry of a program labelled on the snapshot's window.
fn entry(snapshot: &Snapshot<'_>, program: &Program, program_hash: Digest, score: &Score) -> Result<Entry, RunError> {
    Ok(Entry {
        solution: program.solution_id.clone(),
        attempt: None,
        program_hash,
        family: program.source_family.clone(),
        ego: snapshot.spec.ego.name().to_string(),
        lineage: snapshot.spec.id.clone(),
        epoch: snapshot.event.epoch,
        objectives: score.objectives,
        diagnostics: diagnostics_mean(score),
        scenes: Digest::of("evodrive/window/1", &snapshot.event.window)?,
        sim_version: SIM_VERSION,
        operators: operators(program),
        mechanism_tags: crate::memory::tags_of(program),
        gates: None,
    })
}

/// Operator kinds in slot order.
fn operators(program: &Program) -> Vec<String> {
    let in_slot = |slot: Slot| program.operator_graph.values().filter(move |node| node.slot == slot);
    Slot::ALL.into_iter().flat_map(in_slot).map(|node| node.kind.clone()).collect()
}

fn contender(attempt: &Attempt) -> Option<Contender> {
    let (candidate, score, decision) = (attempt.exit.candidate()?, attempt.exit.score()?, attempt.exit.decision()?);
    let solution = candidate.program.solution_id.clone();
    decision.gates.any().then_some(Contender { solution, objectives: score.objectives })
}

/// Writes what the epoch as a whole decided into its attempts, before they are sealed.
fn mark_outcome(judged: &mut Judged) {
    for attempt in &mut judged.attempts {
        let Exit::Evaluated { candidate, decision, .. } = &mut attempt.exit else { continue };
        let solution = &candidate.program.solution_id;
        decision.on_front = judged.archive.on_front(solution);
        decision.promoted = judged.promotion.as_ref().is_some_and(|selection| selection.solution == *solution);
    }
}

/// The one place that changes the state: archive, lineage, memory and world, once, behind the barrier.
pub fn settle(
    study: &Study<'_>,
    state: &mut State,
    snapshot: &Snapshot<'_>,
    judged: Judged,
) -> Result<Settled, RunError> {
    let (lineage, epoch) = (&snapshot.spec.id, snapshot.event.epoch);
    for attempt in &judged.attempts {
        state.lineages.attach(attempt)?;
    }
    if let Some(selection) = &judged.promotion {
        state.lineages.promote(lineage, &selection.solution, epoch)?;
    }
    let cards = cards(study, snapshot, &judged)?;
    state.memory.append(cards.clone())?;
    let labels_before = state.calibration.labels().len();
    state.calibration.append(judged.labels, &state.world.schema)?;
    state.world = world::settle(&state.world.schema, &state.world.configuration, &state.calibration)?;
    state.archives.insert(lineage.clone(), judged.archive);
    let world = state.world.digest()?;
    let line = state.lineages.get(lineage)?;
    let change = Change {
        before: state.digest,
        lineage,
        epoch,
        attempts: &line.attempts[line.attempts.len() - judged.attempts.len()..],
        programs: judged.attempts.iter().filter_map(|a| a.exit.candidate()).map(|c| c.program_hash).collect(),
        active: &line.active,
        archive: &state.archives[lineage],
        cards: &cards,
        labels: &state.calibration.labels()[labels_before..],
        world,
    };
    state.digest = Digest::of("evodrive/state/2", &change)?;
    let promoted = judged.attempts.iter().find(|a| a.exit.decision().is_some_and(|d| d.promoted)).map(|a| a.id.clone());
    state.attempts.extend(judged.attempts);
    let archive = &state.archives[lineage];
    let settled = Settled {
        epoch,
        lineage: lineage.clone(),
        active: state.lineages.active(lineage)?.solution_id.clone(),
        promoted,
        front: archive.front().map(|e| FrontPoint { solution: e.solution.clone(), objectives: e.objectives }).collect(),
        hypervolume: archive.hypervolume(study.archive.reference),
        cards,
        world,
        world_labels: state.calibration.labels().len(),
        state: state.digest,
    };
    state.settled.push(settled.clone());
    Ok(settled)
}

/// What memory keeps of the epoch: cards of each attempt, then of the lineage and its way.
fn cards(study: &Study<'_>, snapshot: &Snapshot<'_>, judged: &Judged) -> Result<Vec<Card>, RunError> {
    let family = study.family(snapshot.spec)?;
    let context = CurationContext {
        family: &family.contract.family,
        scene_tags: &snapshot.scene_tags,
        private_vocabulary: &family.contract.private_vocabulary,
        options: &study.curation,
    };
    let mut cards: Vec<Card> = judged.attempts.iter().flat_map(|attempt| curate(attempt, &context)).collect();
    let active = judged.promotion.as_ref().map_or(snapshot.event.parent_score.objectives, |s| s.objectives);
    cards.extend(reflect(&snapshot.spec.id, snapshot.event.epoch, &judged.attempts, active, &context));
    Ok(cards)
}

/// The entry with which a lineage's archive begins: its parent on the first window.
pub fn parent_entry(snapshot: &Snapshot<'_>) -> Result<Entry, RunError> {
    entry(snapshot, &snapshot.parent, snapshot.event.parent_hash, &snapshot.event.parent_score)
}
