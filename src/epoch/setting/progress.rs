//! What a run tells while it works; never part of the result.

use crate::objects::{Attempt, event::Settled};

/// One line's worth of news.
#[derive(Clone, Debug)]
pub enum Progress {
    Attempt {
        id: String,
        exit: &'static str,
        attack: Option<f64>,
        /// With the name of the protocol's realism.
        realism: Option<(&'static str, f64)>,
        accepted: bool,
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
            accepted: attempt.exit.decision().is_some_and(|d| d.gates.any()),
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
