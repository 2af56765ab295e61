//! The false-rejection monitor (paper, appendix on the world evaluator): of the candidates that the evaluator would have
//! turned away, a declared share is simulated all the same. What the archive then accepted was falsely rejected.

use super::finding::{Finding, Gravity};
use crate::evidence::recorded_run::RecordedRun;
use crate::kernel::num;
use crate::objects::{Attempt, AttemptId};
use crate::world::drawn_by_monitor;

/// Findings of the monitor, and the distance of the predictions from the labels.
#[derive(Clone, Debug, PartialEq)]
pub struct Monitored {
    /// Would-be rejections that were simulated.
    pub candidates: usize,
    /// Those of them that some acceptance gate of the archive let in.
    pub false_rejections: Vec<AttemptId>,
    /// Mean of |predicted - labelled| over all evaluated candidates; `None` without one.
    pub attack_error_mean: Option<f64>,
    pub realism_error_mean: Option<f64>,
}

impl Monitored {
    pub fn of(run: &RecordedRun) -> Monitored {
        let evaluated: Vec<&Attempt> = run.attempts.iter().filter(|attempt| attempt.exit.score().is_some()).collect();
        let is_monitored = |attempt: &&&Attempt| attempt.exit.route().is_some_and(drawn_by_monitor);
        let monitored: Vec<&&Attempt> = evaluated.iter().filter(is_monitored).collect();
        let accepted = |attempt: &&&&Attempt| attempt.exit.decision().is_some_and(|decision| decision.gates.any());
        let error = |of: fn(&crate::objects::Objectives) -> f64| {
            let pairs = evaluated.iter().filter_map(|a| Some((a.exit.route()?.predicted, a.exit.score()?.objectives)));
            num::mean(&pairs.map(|(predicted, labelled)| (of(&predicted) - of(&labelled)).abs()).collect::<Vec<_>>())
        };
        Monitored {
            candidates: monitored.len(),
            false_rejections: monitored.iter().filter(accepted).map(|attempt| attempt.id.clone()).collect(),
            attack_error_mean: error(|objectives| objectives.attack),
            realism_error_mean: error(|objectives| objectives.realism),
        }
    }
}

/// A remark where the evaluator would have turned away what the archive accepted.
pub fn remark(run: &RecordedRun) -> Option<Finding> {
    let monitored = Monitored::of(run);
    if monitored.false_rejections.is_empty() {
        return None;
    }
    let names: Vec<&str> = monitored.false_rejections.iter().map(AttemptId::as_str).collect();
    let error = |mean: Option<f64>| mean.map_or("unknown".to_string(), |mean| format!("{mean:.3}"));
    let what = format!(
        "{} of {} candidates that the world evaluator would have turned away were accepted by the archive: {}; its \
         predictions are off by {} in attack and {} in realism on average",
        names.len(),
        monitored.candidates,
        names.join(", "),
        error(monitored.attack_error_mean),
        error(monitored.realism_error_mean)
    );
    Some(Finding { gravity: Gravity::Remark, check: "monitor", place: "world evaluator".into(), what })
}
