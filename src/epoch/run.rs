//! The whole loop on one page (paper, algorithms evodrive_loop and parallel_epoch): freeze, propose in parallel,
//! judge serially, settle once, and open the held-out scenes when it is over.

use super::{
    RunError, acceptor,
    draft::draft,
    finale, open,
    progress::Progress,
    rollouts::Rollouts,
    state::{Snapshot, State},
    study::{LineageSpec, Study},
};
use crate::objects::event::{RunResult, kind};
use crate::store::Transcript;
use crate::world::Router;

/// What a run works with besides the study: where events go, where rollouts come from, who watches.
pub struct Desk<'a> {
    /// Compares every event with what an earlier run of the same inputs wrote, and appends where that ends.
    pub log: Transcript,
    pub rollouts: &'a Rollouts<'a>,
    pub watch: &'a mut dyn FnMut(Progress),
}

/// Carries a study out.
pub fn run(study: &Study<'_>, desk: &mut Desk<'_>) -> Result<RunResult, RunError> {
    desk.log.append(kind::OPENED, &open::opened(study)?)?;
    let mut state = open::adopt_parents(study, desk)?;
    for epoch in 0..study.budget.epochs {
        for spec in &study.lineages {
            one_epoch(study, &mut state, epoch, spec, desk)?;
        }
    }
    let result = finale::report(study, &state, desk)?;
    desk.rollouts.flush()?;
    desk.log.seal(&result)?;
    Ok(result)
}

/// K proposals from one frozen snapshot, judged in slot order, and one update of the state behind the barrier.
fn one_epoch(
    study: &Study<'_>,
    state: &mut State,
    epoch: u32,
    spec: &LineageSpec,
    desk: &mut Desk<'_>,
) -> Result<(), RunError> {
    let snapshot = Snapshot::freeze(study, state, epoch, spec, desk.rollouts)?;
    desk.log.append(kind::FROZEN, &snapshot.event)?;
    let slots: Vec<u32> = (0..study.budget.slots).collect();
    let router = Router::new(&snapshot.world)?;
    let drafts = study.pool.map(&slots, |_, slot| draft(study, &snapshot, &router, *slot, desk.rollouts));
    let judged = acceptor::judge(study, state, &snapshot, drafts, desk)?;
    desk.rollouts.flush()?;
    for attempt in &judged.attempts {
        desk.log.append(kind::ATTEMPT, attempt)?;
    }
    let settled = acceptor::settle(study, state, &snapshot, judged)?;
    desk.log.append(kind::SETTLED, &settled)?;
    study.meter.turn(&spec.id);
    (desk.watch)(Progress::settled(&settled));
    Ok(())
}
