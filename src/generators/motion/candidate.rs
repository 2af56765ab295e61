//! A candidate trajectory of an adversary.

use std::sync::Arc;

use super::Scripted;
use crate::kernel::num;
use crate::scene::Sample;
use crate::sim::Law;

/// One possible future of an actor.
#[derive(Clone, Debug, PartialEq)]
pub struct Candidate {
    /// The motion from the window's first step on, one sample a step of 0.1 s. `[steps]`
    pub samples: Vec<Sample>,
    /// Log-probability under the family's prior; 0 where a family has none.
    pub prior_log_probability: f64,
    /// The score from the search; larger is better.
    pub score: f64,
    /// Scene step from which the actor no longer follows the samples but reacts to the ego; `None`: never.
    pub handover_step: Option<usize>,
    /// Law that the actor obeys once its onset holds; then `handover_step` has no effect.
    pub law: Option<Arc<Law>>,
    /// Iterate of a search that moves several actors at once: candidates of one iterate belong together.
    pub iterate: Option<usize>,
    /// Whole scenario in which road users wait for the ego; `samples` are then the adversary's simulated motion in it.
    pub scripted: Option<Arc<Scripted>>,
}

impl Candidate {
    /// A motion with its log-probability; its score is set by the search.
    pub fn new(samples: Vec<Sample>, prior_log_probability: f64) -> Candidate {
        let score = prior_log_probability;
        Candidate {
            samples,
            prior_log_probability,
            score,
            handover_step: None,
            law: None,
            iterate: None,
            scripted: None,
        }
    }

    /// Mean distance to another candidate at equal times, metres.
    pub fn mean_distance_m(&self, other: &Candidate) -> f64 {
        let pairs = self.samples.iter().zip(&other.samples);
        let count = self.samples.len().min(other.samples.len()).max(1) as f64;
        num::sum(pairs.map(|(a, b)| a.position.distance(b.position))) / count
    }
}
