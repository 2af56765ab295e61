//! The world evaluator's turn: after an epoch of all lineages its agent may propose a change of its configuration, and a judge
//! decides whether the next epoch is routed by it (paper, algorithm world_agent_update).

use std::collections::BTreeMap;

use crate::agents::{
    AgentError,
    evolve::{Turn, evolve as ask_agent},
};
use crate::epoch::RunError;
use crate::epoch::setting::desk::Desk;
use crate::epoch::setting::progress::Progress;
use crate::epoch::setting::study::Study;
use crate::epoch::state::State;
use crate::kernel::Digest;
use crate::objects::{
    Attempt, AttemptId, LineageId, Role, WorldConfiguration, WorldEvolved, WorldLabel, WorldPatch, WorldSnapshot,
    event::kind, update_surface, world_audit::WORLD_LINE,
};
use crate::world::{self, Evidence, Judging, WorldAgentOptions, audit, held, judge};

/// One turn, where the experiment has a world agent, enough is known, and an epoch is left that a change could route.
pub fn evolve(study: &Study, state: &mut State, epoch: u32, desk: &mut Desk<'_>) -> Result<(), RunError> {
    let Some(options) = study.world_agent.as_ref().filter(|_| epoch + 1 < study.budget.epochs) else { return Ok(()) };
    let taken = turn(study, state, options, epoch, desk)?;
    desk.tools.meter.turn(&LineageId::new(WORLD_LINE));
    let Some((event, snapshot)) = taken else { return Ok(()) };
    desk.log.append(kind::WORLD, &event)?;
    (desk.watch)(Progress::Evolved { turn: event.name(), verdict: event.verdict() });
    state.world = snapshot;
    state.digest = Digest::of("evodrive/state-evolved/1", &(state.digest, &event))?;
    state.evolved.push(event);
    Ok(())
}

/// Returns the outcome of the turn; `None` where the evidence does not suffice. It changes nothing.
fn turn(
    study: &Study,
    state: &State,
    options: &WorldAgentOptions,
    epoch: u32,
    desk: &Desk<'_>,
) -> Result<Option<(WorldEvolved, WorldSnapshot)>, RunError> {
    let (schema, active) = (&state.world.schema, &state.world.configuration);
    let judging = Judging { schema, founding: &study.world, options, before: epoch + 1 };
    // "D^W <- BuildCalibrationSet(E^real, E^W)".
    let evidence = evidence(study, state);
    let threads = desk.tools.threads;
    let incumbent = held(&judging, active, &evidence, threads)?;
    // "a_W <- AuditWorld(W_phi, D^W)", SufficientEvidence.
    if incumbent.len() < options.held_labels_min as usize {
        return Ok(None);
    }
    let audit = audit(&judging, active, &evidence, &incumbent);
    // "dphi <- WorldAgent(T_W)", refused where it is not in U_W.
    let surface = update_surface(options.audit_share, schema);
    let model = study.models.get(&Role::WorldAgent).ok_or(AgentError::NoModel { role: Role::WorldAgent.name() })?;
    let (earlier, rounds) = (&state.evolved, options.rounds);
    let asked = Turn { epoch, active, schema, surface: &surface, audit: &audit, earlier, rounds, model };
    let usable = |patch: &WorldPatch| {
        let changed = patch.applied(active, schema, &surface).map_err(|refusal| refusal.to_string())?;
        world::validate(&changed, schema).map_err(|error| error.to_string())?;
        rejected_before(&changed, earlier).map(|()| changed)
    };
    let line = LineageId::new(WORLD_LINE);
    let (exchanges, evolved) = ask_agent(&asked, &desk.tools.asking(&line), &usable)?;
    // "W_phi~ <- MaterializeSnapshot(W_phi, dphi)", "j <- WorldJudge(W_phi~, W_phi, D^W, a_W)".
    let (patch, proposed) = evolved.unzip();
    let judgement = match &proposed {
        Some(proposed) => Some(judge(&judging, &incumbent, &held(&judging, proposed, &evidence, threads)?)),
        None => None,
    };
    let promoted = judgement.as_ref().is_some_and(|judgement| judgement.is_accepted());
    let challenger = proposed.as_ref().map(WorldConfiguration::digest).transpose()?;
    let next = proposed.filter(|_| promoted).unwrap_or_else(|| active.clone());
    // The active configuration was fitted when the epoch was settled.
    let snapshot = if promoted {
        world::settle(schema, &next, &state.labels(study), epoch + 1, threads)?
    } else {
        state.world.clone()
    };
    let event = WorldEvolved {
        epoch,
        audit,
        exchanges,
        incumbent: active.digest()?,
        patch,
        challenger,
        judgement,
        active_digest: next.digest()?,
        snapshot: snapshot.digest()?,
        active: next,
    };
    Ok(Some((event, snapshot)))
}

/// Every label with its lineage and for how many candidates it stands: the weight that its route recorded.
fn evidence<'s>(study: &Study, state: &'s State) -> Vec<Evidence<'s>> {
    let attempts: BTreeMap<&AttemptId, &Attempt> = state.attempts.iter().map(|of| (&of.id, of)).collect();
    let of = |label: &'s WorldLabel| {
        let attempt = attempts.get(&label.attempt)?;
        let weight = attempt.exit.route()?.weight.unwrap_or(1.0);
        Some(Evidence { label, lineage: &attempt.lineage, weight })
    };
    state.labels(study).into_iter().filter_map(of).collect()
}

/// Rejected snapshots stay in the lineage as negative evidence: one is not judged twice.
fn rejected_before(changed: &WorldConfiguration, earlier: &[WorldEvolved]) -> Result<(), String> {
    let digest = changed.digest().map_err(|error| error.to_string())?;
    let rejected = |turn: &&WorldEvolved| turn.challenger == Some(digest) && turn.verdict() == "rejected";
    match earlier.iter().find(rejected) {
        Some(turn) => Err(format!("this configuration was rejected after epoch {}; expected another one", turn.epoch)),
        None => Ok(()),
    }
}
