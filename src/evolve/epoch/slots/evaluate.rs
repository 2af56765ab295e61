//! Real labels of a routed candidate on the window's scenes.

use super::draft::{Draft, Reached};
use crate::epoch::RunError;
use crate::epoch::freeze::Snapshot;
use crate::epoch::labelling::labels::Labelling;
use crate::epoch::setting::desk::Tools;
use crate::epoch::setting::study::Study;
use crate::evaluation::EvaluationError;
use crate::objects::{Gate, Program};

/// Labels a candidate that the router did not reject. One that no scene of the window can label does not compile there: it
/// is invalid, because a label is never invented.
pub fn evaluate(study: &Study, snapshot: &Snapshot<'_>, draft: Draft, tools: &Tools<'_>) -> Result<Draft, RunError> {
    draft.next(|_, reached| match reached {
        Reached::Routed { mut gates, routed } if !routed.is_rejected() => {
            let labelling = Labelling { study, spec: snapshot.spec, counsels: &snapshot.counsels, tools };
            match labelling.score(routed.candidate.hashed(), &snapshot.window) {
                Ok(score) => Ok(Reached::Evaluated { gates, routed, score }),
                Err(RunError::Evaluation(EvaluationError::NoLabel(reason))) => {
                    for verdict in gates.verdicts.iter_mut().filter(|v| v.gate == Gate::Compile) {
                        verdict.problems.push(format!("no scene of the window could be labelled: {reason}"));
                    }
                    Ok(Reached::Invalid { gates })
                }
                Err(error) => Err(error),
            }
        }
        ended => Ok(ended),
    })
}

/// Makes the labels of all routed candidates that [`evaluate`] will ask for one by one. A plan hears of all of them before it
/// stops at the first.
pub fn evaluate_ahead(
    study: &Study,
    snapshot: &Snapshot<'_>,
    drafts: &[Result<Draft, RunError>],
    tools: &Tools<'_>,
) -> Result<(), RunError> {
    let routed: Vec<&Program> = drafts.iter().flatten().filter_map(to_be_labelled).collect();
    let labelling = Labelling { study, spec: snapshot.spec, counsels: &snapshot.counsels, tools };
    labelling.ahead(&routed, &snapshot.window)
}

/// The program of a draft that is routed to the simulator.
fn to_be_labelled(draft: &Draft) -> Option<&Program> {
    match &draft.reached {
        Reached::Routed { routed, .. } if !routed.is_rejected() => Some(&routed.candidate.program),
        _ => None,
    }
}
