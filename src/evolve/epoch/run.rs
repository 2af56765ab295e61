//! The whole loop on one page (paper, algorithms evodrive_loop and parallel_epoch): freeze, propose in parallel,
//! judge in slot order, settle once, and open the held-out scenes when it is over. Comments quote the algorithms' lines.

use super::freeze::{Snapshot, freeze};
use super::state::State;
use super::{RunError, open};
use crate::epoch::acceptance::consider::{EpochVerdicts, consider, request_earlier_labels};
use crate::epoch::acceptance::evolve::evolve;
use crate::epoch::acceptance::seal::seal;
use crate::epoch::acceptance::settle::{Refit, settle};
use crate::epoch::acceptance::shuffled::swapped;
use crate::epoch::acceptance::{finale, search};
use crate::epoch::planning::walk::LineageJob;
use crate::epoch::setting::desk::{Desk, Tools};
use crate::epoch::setting::progress::Progress;
use crate::epoch::setting::study::{LineageSpec, Study};
use crate::epoch::slots::admit::admit;
use crate::epoch::slots::evaluate::{evaluate, evaluate_ahead};
use crate::epoch::slots::pilot::pilot;
use crate::epoch::slots::propose::propose;
use crate::epoch::slots::route::{allot, predict};
use crate::epoch::slots::tune::tune;
use crate::objects::event::{RunResult, kind};
use crate::world::Router;

/// Carries a study out.
pub fn run(study: &Study, desk: &mut Desk<'_>) -> Result<RunResult, RunError> {
    desk.log.append(kind::OPENED, &open::opened(study)?)?;
    // "Initialize attempts E_0 and memory Q_0": every lineage begins with its family's parent.
    let mut state = open::adopt_parents(study, desk)?;
    // "for t = 0 to T - 1: select lineage l_t".
    for epoch in 0..study.budget.epochs {
        let due: Vec<&LineageSpec> =
            study.lineages.iter().filter(|spec| !search::is_over(study, &state, spec)).collect();
        let mut wanting = false;
        for together in due.chunks(desk.tools.lineages_together(study)) {
            wanting |= one_epoch(study, &mut state, epoch, together, desk)?;
        }
        if wanting {
            return Err(RunError::Wanting);
        }
        // "W_{phi_{t+1}} <- WorldAgentUpdate(W_{phi_t}, E_{t+1})": one evaluator routes all lineages of an epoch.
        evolve(study, &mut state, epoch, desk)?;
    }
    // "return P_T, L_T, Q_T and the evidence bundle".
    let result = finale::report(study, &mut state, desk)?;
    desk.tools.rollouts.flush()?;
    desk.log.seal(&result)?;
    Ok(result)
}

/// An epoch of lineages that are worked on together, and one update of the state for each, in their order. A snapshot holds what
/// earlier epochs left behind and nothing of the lineages beside it: memory shows cards of earlier epochs alone, and the evaluator is
/// fitted behind an epoch's last lineage. So no result depends on how many go together. Says whether a plan cannot see
/// further.
fn one_epoch(
    study: &Study,
    state: &mut State,
    epoch: u32,
    together: &[&LineageSpec],
    desk: &mut Desk<'_>,
) -> Result<bool, RunError> {
    let all = desk.tools.threads.map_waiting(together, desk.tools.at_once(study, together.len()), |_, spec| {
        desk.tools.go_on().and_then(|()| judge(study, state, epoch, spec, &desk.tools))
    });
    let mut wanting = false;
    for (spec, judged) in together.iter().zip(all) {
        match judged {
            Err(error) if desk.tools.is_wanting(&error) => {
                wanting = true;
                if let Some(wanted) = desk.tools.wanted.filter(|wanted| wanted.is_by_lineage()) {
                    let state = Some(Box::new(state.of_lineage(study, &spec.id)?));
                    wanted.ask_whole(LineageJob { lineage: spec.id.clone(), epoch, state });
                }
            }
            Err(error) => return Err(error),
            // What stands behind a gap is worked out again when that is filled.
            Ok(_) if wanting => {}
            Ok((snapshot, judged)) => close(study, state, &snapshot, judged, desk)?,
        }
    }
    desk.tools.meter.turns(&together.iter().map(|spec| &spec.id).collect::<Vec<_>>());
    Ok(wanting)
}

/// K proposals from one frozen snapshot, judged in slot order.
pub fn judge<'s>(
    study: &Study,
    state: &State,
    epoch: u32,
    spec: &'s LineageSpec,
    tools: &Tools<'_>,
) -> Result<(Snapshot<'s>, EpochVerdicts), RunError> {
    // "immutable epoch snapshot z_t = (p_t, h_t, l_t, S_t, W_t, K_t, v_t)", with K_t from RetrieveMemory.
    let snapshot = freeze(study, state, epoch, spec, tools)?;
    let router = Router::new(&snapshot.world)?;
    // "for k = 1 to K in parallel": a worker reads the snapshot and writes to nothing that is shared.
    let drafts = tools.ask_all(&study.slots(), |_, &slot| {
        // "delta_t <- ActorCriticMutation(p_t, K_t, I)".
        let proposed = propose(study, &snapshot, slot, tools)?;
        // "p'_t <- ApplyPatch(p_t, delta_t)", ValidateProgram, "c_t <- CompileCandidate(p'_t)".
        let admitted = admit(study, &snapshot, proposed, tools)?;
        let admitted = tune(study, &snapshot, admitted, tools)?;
        // "W_phi(c_t, S_t)".
        predict(study, &snapshot, &router, admitted, tools)
    });
    // "Wait until all workers reach the epoch barrier. Sort candidate records by deterministic key": the slot.
    // "d_t <- WorldRoute(W_t, c_t, S_t)": who gets the rollouts of the epoch's budget is known when all are there.
    let drafts = pilot(study, &snapshot, &router, drafts, tools)?;
    let drafts = allot(study, &snapshot, &router, drafts);
    let mut judged = EpochVerdicts::before(&snapshot);
    // Labels do not depend on each other: all slots' are made together.
    evaluate_ahead(study, &snapshot, &drafts, tools)?;
    for draft in drafts.iter().flatten() {
        request_earlier_labels(study, &snapshot, draft, &judged, tools)?;
    }
    // "Y_t <- RealSimulatorEvaluate(...)".
    let evaluated = drafts.into_iter().map(|draft| evaluate(study, &snapshot, draft?, tools));
    let evaluated = evaluated.collect::<Result<Vec<_>, RunError>>()?;
    judged.swapped = swapped(study, &snapshot, &evaluated);
    for evaluated in evaluated {
        // "(accept, P_{t+1}) <- ParetoAccept(P_t, a_t)".
        let considered = consider(study, &snapshot, evaluated, &mut judged, tools)?;
        // "a_t <- BuildAttemptRecord(...)".
        judged.attempts.push(seal(&snapshot, considered));
    }
    judged.decide(study, &snapshot, tools)?;
    Ok((snapshot, judged))
}

/// Puts what was judged on record and makes it the state.
fn close(
    study: &Study,
    state: &mut State,
    snapshot: &Snapshot<'_>,
    judged: EpochVerdicts,
    desk: &mut Desk<'_>,
) -> Result<(), RunError> {
    desk.tools.rollouts.flush()?;
    desk.log.append(kind::FROZEN, &snapshot.event)?;
    for attempt in &judged.attempts {
        desk.log.append(kind::ATTEMPT, attempt)?;
        (desk.watch)(Progress::attempt(attempt));
    }
    // "Update archive, lineage, and memory exactly once through the serial acceptor": UpdateLineage, CurateMemory, and a refit of
    // the world evaluator.
    // All lineages of an epoch are routed by one snapshot, which rests on earlier epochs alone.
    let is_last = study.lineages.last().is_some_and(|last| last.id == snapshot.spec.id);
    let refit = if is_last { Refit::Now } else { Refit::Later };
    let settled = settle(study, state, snapshot, judged, refit, &desk.tools)?;
    desk.log.append(kind::SETTLED, &settled)?;
    (desk.watch)(Progress::settled(&settled));
    Ok(())
}
