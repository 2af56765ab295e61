//! News of a run while it works; never part of the result.

use crate::objects::{Attempt, Exit, event::Settled};

/// One line's worth of news.
#[derive(Clone, Debug)]
pub enum Progress {
    Attempt {
        id: String,
        exit: &'static str,
        attack: Option<f64>,
        /// With the name of the protocol's realism.
        realism: Option<(&'static str, f64)>,
        /// Share of the scenes that it acts in, 0..=1; 0 without labels.
        coverage: f64,
        accepted: bool,
        /// The gate that refused it, and the first problem that it names. Of several the first: what stands behind it may fail
        /// because nothing was left to check.
        refused: Option<(&'static str, String)>,
    },
    Settled {
        epoch: u32,
        lineage: String,
        active: String,
        front: usize,
        hypervolume: f64,
    },
    Composed {
        template: String,
        used: bool,
    },
    Counselled {
        lineage: String,
        scenes: usize,
        met: usize,
    },
    Evolved {
        turn: String,
        verdict: &'static str,
    },
    /// So many labels are made of those by which programs are chosen.
    Choosing {
        done: usize,
        all: usize,
    },
    /// So many labels are made of those of the chosen on the held-out scenes.
    Opening {
        done: usize,
        all: usize,
    },
    HeldOut {
        lineage: String,
        programs: usize,
        scenes: usize,
    },
}

impl Progress {
    pub fn attempt(attempt: &Attempt) -> Progress {
        let score = attempt.exit.score();
        Progress::Attempt {
            id: attempt.id.to_string(),
            exit: attempt.exit.name(),
            attack: score.map(|score| score.objectives.attack),
            realism: score.map(|score| (score.realism_name(), score.objectives.realism)),
            coverage: score.map_or(0.0, |score| score.coverage),
            accepted: attempt.exit.decision().is_some_and(|d| d.gates.any()),
            refused: match &attempt.exit {
                Exit::Invalid { gates } => gates
                    .failed()
                    .next()
                    .map(|verdict| (verdict.gate.name(), verdict.problems.first().cloned().unwrap_or_default())),
                _ => None,
            },
        }
    }

    pub fn settled(settled: &Settled) -> Progress {
        Progress::Settled {
            epoch: settled.epoch,
            lineage: settled.lineage.to_string(),
            active: settled.active.to_string(),
            front: settled.front.len(),
            hypervolume: settled.hypervolume,
        }
    }
}
