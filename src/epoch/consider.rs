//! The acceptor's judgement: what the archive says of each labelled candidate, in slot order, and who leads from now on.
//! Works on copies; the state changes in `settle` alone.

use super::{
    RunError,
    draft::{Considered, Draft, Reached, RoutedCandidate},
    freeze::Snapshot,
    state::State,
    study::{LineageSpec, Study},
};
use crate::archive::{Archive, Contender, Selection, promote};
use crate::kernel::Digest;
use crate::objects::entry::diagnostics_mean;
use crate::objects::{
    Attempt, AttemptId, Decision, Entry, Exit, GateReport, Objectives, Program, Score, Slot, WorldLabel,
};
use crate::sim::SIM_VERSION;

/// An epoch's attempts and what they add, not yet part of the state.
pub struct Judged {
    pub attempts: Vec<Attempt>,
    pub archive: Archive,
    pub labels: Vec<WorldLabel>,
    pub promotion: Option<Selection>,
}

impl Judged {
    /// The archive as it stands, and nothing judged yet.
    pub fn before(state: &State, spec: &LineageSpec) -> Judged {
        let archive = state.archives.get(&spec.id).cloned().unwrap_or_default();
        Judged { attempts: Vec::new(), archive, labels: Vec::new(), promotion: None }
    }

    /// Promotes one of the accepted, and writes what the epoch as a whole decided into its attempts, before they are
    /// sealed.
    pub fn decide(&mut self, study: &Study) {
        let accepted: Vec<Contender> = self.attempts.iter().filter_map(contender).collect();
        self.promotion = promote(&accepted, &study.selector);
        for attempt in &mut self.attempts {
            let Exit::Evaluated { candidate, decision, .. } = &mut attempt.exit else { continue };
            let solution = &candidate.program.solution_id;
            decision.on_front = self.archive.on_front(solution);
            decision.promoted = self.promotion.as_ref().is_some_and(|selection| selection.solution == *solution);
        }
    }
}

fn contender(attempt: &Attempt) -> Option<Contender> {
    let (candidate, score, decision) = (attempt.exit.candidate()?, attempt.exit.score()?, attempt.exit.decision()?);
    let solution = candidate.program.solution_id.clone();
    decision.gates.any().then_some(Contender { solution, objectives: score.objectives })
}

/// The exit of a draft. A labelled candidate meets the archive's gates as the slots before it left the front.
pub fn consider(
    study: &Study,
    snapshot: &Snapshot<'_>,
    draft: Draft,
    judged: &mut Judged,
) -> Result<Considered, RunError> {
    let Draft { head, reached } = draft;
    let exit = match reached {
        Reached::Declined { reason } => Exit::Declined { reason },
        Reached::Invalid { gates } => Exit::Invalid { gates },
        Reached::Routed { gates, routed } => {
            Exit::Rejected { gates, candidate: Box::new(routed.candidate), route: routed.route }
        }
        Reached::Evaluated { gates, routed, score } => {
            let id = AttemptId::at(&snapshot.spec.id, snapshot.event.epoch, head.slot);
            accept(study, snapshot, &id, gates, *routed, score, judged)?
        }
        Reached::Proposed { .. } | Reached::Admitted { .. } => {
            unreachable!("a worker hands on what ended or was routed")
        }
    };
    Ok(Considered { head, exit })
}

fn accept(
    study: &Study,
    snapshot: &Snapshot<'_>,
    id: &AttemptId,
    gates: GateReport,
    routed: RoutedCandidate,
    score: Score,
    judged: &mut Judged,
) -> Result<Exit, RunError> {
    judged.labels.extend(world_labels(snapshot, id, &routed, &score));
    let RoutedCandidate { candidate, route, .. } = routed;
    let parent = snapshot.event.parent_score.objectives;
    let acceptance = crate::archive::consider(&judged.archive, score.objectives, parent, &study.archive)?;
    let inserted = judged.archive.insert(Entry {
        attempt: Some(id.clone()),
        gates: Some(acceptance.clone()),
        mechanism_tags: candidate.mechanism_tags.clone(),
        ..entry(snapshot, &candidate.program, candidate.program_hash, &score)?
    })?;
    let decision = Decision { promoted: false, on_front: inserted.on_front, gates: acceptance };
    Ok(Exit::Evaluated { gates, candidate: Box::new(candidate), route, score, decision })
}

/// What the world evaluator will learn from a labelled candidate: one a scene that has a label.
fn world_labels(snapshot: &Snapshot<'_>, id: &AttemptId, routed: &RoutedCandidate, score: &Score) -> Vec<WorldLabel> {
    let label = |pair: &crate::objects::WorldPair| {
        let scene = score.scenes.iter().find(|scene| scene.scene == pair.scene)?;
        Some(WorldLabel {
            attempt: id.clone(),
            solution: routed.candidate.program.solution_id.clone(),
            epoch: snapshot.event.epoch,
            pair: pair.clone(),
            labels: Objectives { attack: scene.attack, realism: scene.realism },
            diagnostics: scene.diagnostics.clone(),
            decision: routed.route.decision,
            predicted: routed.route.predicted,
            monitored: routed.monitored,
        })
    };
    routed.pairs.iter().filter_map(label).collect()
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

/// The entry with which a lineage's archive begins: its parent on the first window.
pub fn parent_entry(snapshot: &Snapshot<'_>) -> Result<Entry, RunError> {
    entry(snapshot, &snapshot.parent, snapshot.event.parent_hash, &snapshot.event.parent_score)
}
