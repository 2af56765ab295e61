//! The two realisms of a program, each under its one name: *realism* is the mean over the scenes that the program acts in,
//! *strict realism* the smaller one of that and the mean over its successes, which the search works with.

use serde::Serialize;

use super::recorded_run::RecordedRun;
use crate::kernel::num;
use crate::objects::event::LineageResult;
use crate::objects::{RealismMean, RealismSums, Score, SolutionId};

/// Both, from the same labels.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Realisms {
    /// Mean over the labelled scenes that the program acts in, 0..=1; `None` where it acts in none.
    pub realism_acted: Option<f64>,
    /// The smaller one of that and the mean over successes, 0..=1: the realism among the objectives but under the plain mean; `None` in
    /// SafeBench's protocol, whose objective is ARS.
    pub strict_realism: Option<f64>,
    /// Share of the scenes acted in where some diagnostic fails outright (d < .5), 0..=1: what a mean hides. `None` where it acts in none, and
    /// in SafeBench's protocol.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub failing_share: Option<f64>,
}

impl Realisms {
    /// Reads both off a score.
    pub fn of(score: &Score) -> Realisms {
        let (sums, own) = (RealismSums::of(&score.scenes), score.benchmark.is_none());
        Realisms {
            realism_acted: sums.acted_mean(),
            strict_realism: own.then(|| match score.rules.mean {
                RealismMean::Strict => score.objectives.realism,
                RealismMean::Plain | RealismMean::Sound => sums.realism(RealismMean::Strict).unwrap_or(0.0),
            }),
            failing_share: sums.failing_share().filter(|_| own),
        }
    }
}

/// A realism as texts print it: `-` for a program that acts nowhere, of whose motion there is nothing to say. The search works with 0
/// there, and JSON and CSV have it beside the coverage.
pub fn realism_text(realism: f64, coverage: f64) -> String {
    if coverage > 0.0 { num::fixed(realism, 4) } else { "-".to_string() }
}

/// One program of a lineage on the held-out scenes.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ProgramRealisms {
    pub solution: SolutionId,
    #[serde(flatten)]
    pub realisms: Realisms,
}

/// Parent and reported program of a lineage on the held-out scenes.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LineageRealisms {
    pub lineage: String,
    pub parent: ProgramRealisms,
    pub evolved: ProgramRealisms,
}

impl LineageRealisms {
    /// `None` where the record lacks the labels of one of the two.
    pub fn of(run: &RecordedRun, result: &LineageResult) -> Option<LineageRealisms> {
        let program = |solution: &SolutionId| {
            let score = run.held_out_score(&result.lineage, solution)?;
            Some(ProgramRealisms { solution: solution.clone(), realisms: Realisms::of(score) })
        };
        Some(LineageRealisms {
            lineage: result.lineage.to_string(),
            parent: program(&result.parent.solution)?,
            evolved: program(&result.evolved.solution)?,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_acts_nowhere_has_no_realism_to_print() {
        assert_eq!(
            [realism_text(0.0, 0.0), realism_text(0.0, 0.5), realism_text(0.94275, 1.0)],
            ["-", "0.0000", "0.9428"]
        );
    }
}
