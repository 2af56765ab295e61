//! Lists the work that a run still lacks and that can be known now: goes through the run from its records up to the first thing that it
//! would have to compute, and then looks at recorded answers for the work after that.

use std::collections::BTreeSet;
use std::path::Path;

use super::prefetch::prefetch;
use super::wanted::{Task, Wanted};
use crate::backend::{Backend, BackendError, NoOutcome};
use crate::epoch::RunError;
use crate::epoch::labelling::labels::{undisturbed, undisturbed_key};
use crate::epoch::run::run;
use crate::epoch::setting::desk::{Desk, Tools};
use crate::epoch::setting::study::Study;
use crate::evaluation::EvaluationError;
use crate::llm::Cassette;
use crate::objects::event::kind;
use crate::store::each_event;

/// Gathers missing work in `wanted`, which the desk's tools know, and says whether the run has everything that it needs.
/// `log` is the file of the desk's transcript; it holds the walk afterwards and no run.
pub fn plan(
    study: &Study,
    desk: &mut Desk<'_>,
    log: &Path,
    recorded: &Cassette,
    wanted: &Wanted,
) -> Result<bool, RunError> {
    want_undisturbed(study, &desk.tools, wanted)?;
    // Every lineage's way rests on these, and several would ask for the same.
    if wanted.is_by_lineage() && !wanted.is_empty() {
        return Ok(false);
    }
    match run(study, desk) {
        // What was asked for beside a way that has come to its end it did not need: a child that one before it surpassed.
        Ok(_) => {
            wanted.nothing();
            return Ok(true);
        }
        Err(RunError::Wanting) => {}
        // The rows without a program, which were asked for above.
        Err(RunError::Evaluation(EvaluationError::Backend(BackendError::Miss(_)))) if !wanted.is_empty() => {}
        Err(error) => return Err(error),
    }
    if wanted.is_by_lineage() {
        return Ok(false);
    }
    desk.log.flush()?;
    let mut begun = Vec::new();
    each_event(log, &mut |event| {
        if matches!(event.kind.as_str(), kind::PARENT | kind::COUNSEL) {
            begun.push(event);
        }
    })?;
    prefetch(study, &begun, recorded, &desk.tools)?;
    Ok(false)
}

/// Every scene without a program in another simulator: all labels ask which road user the ego meets without a program.
fn want_undisturbed(study: &Study, tools: &Tools<'_>, wanted: &Wanted) -> Result<(), RunError> {
    if matches!(tools.backend, Backend::Own) {
        return Ok(());
    }
    let mut egos = BTreeSet::new();
    for spec in study.lineages.iter().filter(|spec| egos.insert(spec.ego.name())) {
        let places: Vec<usize> =
            study.evolution.iter().chain(&study.selection).chain(&study.held_out).copied().collect();
        let failures = tools.threads.map(&places, |_, &place| undisturbed(study, spec, place, tools).err());
        for (&place, why) in places.iter().zip(failures) {
            match why {
                Some(NoOutcome::Stop(BackendError::Miss(_))) => {
                    let (lineage, scene) = (spec.id.clone(), study.scenes[place].scene().id.clone());
                    wanted.ask(undisturbed_key(study, spec, place)?, Task::Undisturbed { lineage, scene }, None);
                }
                Some(NoOutcome::Stop(error)) => return Err(EvaluationError::from(error).into()),
                Some(NoOutcome::Scene(_)) | None => {}
            }
        }
    }
    Ok(())
}
