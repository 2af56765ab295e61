//! A worker: one proposal from the frozen snapshot, as far as it goes without touching any shared state.

use std::sync::{Mutex, PoisonError};

use super::{RunError, briefing, labels, rollouts::Rollouts, state::Snapshot, study::Study};
use crate::agents::{self, End, Task};
use crate::candidates;
use crate::kernel::Digest;
use crate::objects::{AttemptId, Candidate, GateReport, Program, ProgramPatch, Proposal, Route, SolutionId, WorldPair};
use crate::world::{Router, candidate_features, features, monitor_stream};

/// What a worker hands to the acceptor.
pub struct Draft {
    pub slot: u32,
    pub target: String,
    pub proposal: Proposal,
    pub reached: Reached,
}

/// How far a proposal came before any rollout.
pub enum Reached {
    Declined { reason: String },
    Invalid { gates: GateReport },
    Routed { gates: GateReport, routed: Box<RoutedCandidate> },
}

/// An admitted candidate with what the world evaluator said of it.
pub struct RoutedCandidate {
    pub candidate: Candidate,
    pub route: Route,
    /// One a scene of the window, in window order: what a label will be learned from.
    pub pairs: Vec<WorldPair>,
    /// Whether it would have been turned away, had the false-rejection monitor not asked for labels.
    pub monitored: bool,
}

/// Proposes, admits and routes. Reads the snapshot only.
pub fn draft(
    study: &Study<'_>,
    snapshot: &Snapshot<'_>,
    router: &Router<'_>,
    slot: u32,
    rollouts: &Rollouts<'_>,
) -> Result<Draft, RunError> {
    let target = briefing::target(study, slot, &snapshot.event.parent_score);
    let task = Task {
        briefing: &snapshot.briefing,
        slot,
        target: &target,
        models: &study.models,
        max_repair_rounds: study.budget.max_repair_rounds,
    };
    let proposed = agents::propose(&task, &study.meter.asking(study.ask, &snapshot.spec.id))?;
    let reached = match proposed.end {
        End::Declined { reason } => Reached::Declined { reason },
        End::Patch(patch) => admit(study, snapshot, router, slot, &patch, rollouts)?,
    };
    Ok(Draft { slot, target: target.text, proposal: proposed.proposal, reached })
}

fn admit(
    study: &Study<'_>,
    snapshot: &Snapshot<'_>,
    router: &Router<'_>,
    slot: u32,
    patch: &ProgramPatch,
    rollouts: &Rollouts<'_>,
) -> Result<Reached, RunError> {
    let contract = &study.family(snapshot.spec)?.contract;
    let child = SolutionId::new(AttemptId::at(&snapshot.spec.id, snapshot.event.epoch, slot).0);
    let trouble: Mutex<Option<RunError>> = Mutex::new(None);
    let compiles = |program: &Program, hash: Digest| {
        labels::trials(study, snapshot, program, hash, rollouts).unwrap_or_else(|error| {
            *trouble.lock().unwrap_or_else(PoisonError::into_inner) = Some(error);
            Vec::new()
        })
    };
    let admission = candidates::admit(&snapshot.parent, patch, child, contract, &study.registry, &compiles);
    if let Some(error) = trouble.into_inner().unwrap_or_else(PoisonError::into_inner) {
        return Err(error);
    }
    Ok(match admission.candidate {
        None => Reached::Invalid { gates: admission.gates },
        Some(candidate) => {
            let routed = Box::new(route(study, snapshot, router, slot, candidate, patch)?);
            Reached::Routed { gates: admission.gates, routed }
        }
    })
}

fn route(
    study: &Study<'_>,
    snapshot: &Snapshot<'_>,
    router: &Router<'_>,
    slot: u32,
    candidate: Candidate,
    patch: &ProgramPatch,
) -> Result<RoutedCandidate, RunError> {
    let schema = &snapshot.world.schema;
    let of_candidate =
        candidate_features(schema, &candidate.program, &snapshot.parent, patch, &candidate.mechanism_tags)?;
    let mut pairs = Vec::with_capacity(snapshot.window.len());
    for &place in &snapshot.window {
        let entry = &study.scenes[place];
        pairs.push(features(schema, &of_candidate, &entry.scene.id, &entry.features, &entry.interaction)?);
    }
    let attempt = AttemptId::at(&snapshot.spec.id, snapshot.event.epoch, slot);
    let routed = router.route(&pairs, &mut monitor_stream(study.seed, &attempt))?;
    Ok(RoutedCandidate { candidate, route: routed.route, pairs, monitored: routed.monitored })
}
