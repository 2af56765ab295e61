//! The options of a training, besides its scenes.

use serde::{Deserialize, Serialize};

use super::reward::Reward;
use super::sac::SacOptions;
use crate::ego::Setting;

/// The table `[training]` of a training file.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrainingOptions {
    /// Root of every random stream.
    pub seed: u64,
    /// Observation and action.
    pub setting: Setting,
    /// Number of updates in all.
    pub updates: u64,
    /// Simulator steps for each update.
    pub steps_per_update: u64,
    /// Number of steps driven by actions drawn evenly, before the first update.
    pub steps_before: u64,
    /// Number of rollouts that are driven by one actor before it is updated, side by side.
    pub episodes_per_round: usize,
    /// Number of states that the replay buffer holds.
    pub buffer: usize,
    /// Number of updates between two evaluations on the validation scenes.
    pub evaluate_every: u64,
    /// Highest crash rate of an actor that is kept. Among those not above it and with a route completion of at least `route_completion_min`,
    /// the one that completes most of its routes is kept: an ego that stands still hardly crashes, and drives nowhere.
    pub crash_rate_max: f64,
    pub route_completion_min: f64,
    /// Share of the actor in its average an update: the average is evaluated and kept, the actor itself explores (Polyak and
    /// Juditsky 1992). Actors of one training differ from evaluation to evaluation by more than their averages do. Without it
    /// the actor itself is evaluated.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub average: Option<f64>,
    /// The learning rate falls evenly from `sac.learning_rate` to this one over all updates. Without it, it stays.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub learning_rate_last: Option<f64>,
    pub sac: SacOptions,
    pub reward: Reward,
}

/// An option with which nothing can be trained.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("training.{place} is {found}, expected {expected}; correct the training file")]
pub struct TrainingOptionsError {
    pub place: String,
    pub found: String,
    pub expected: String,
}

impl TrainingOptions {
    /// Returns the learning rate of the update after so many others.
    pub fn learning_rate(&self, updates: u64) -> f64 {
        let first = self.sac.learning_rate;
        let share = updates as f64 / self.updates.max(1) as f64;
        self.learning_rate_last.map_or(first, |last| first + (last - first) * share)
    }

    /// Checks the options, and fails with the first one with which nothing can be trained.
    pub fn check(&self) -> Result<(), TrainingOptionsError> {
        let refuse = |place: &str, found: String, expected: String| {
            Err(TrainingOptionsError { place: place.to_string(), found, expected })
        };
        let sac = &self.sac;
        let whole = [
            ("updates", self.updates, 1, 100_000_000),
            ("steps_per_update", self.steps_per_update, 1, 1_000),
            ("steps_before", self.steps_before, 1, 10_000_000),
            ("episodes_per_round", self.episodes_per_round as u64, 1, 1_000),
            ("buffer", self.buffer as u64, 1_000, 5_000_000),
            ("evaluate_every", self.evaluate_every, 1, 100_000_000),
            ("sac.batch", sac.batch as u64, 1, 65_536),
            ("sac.hidden", sac.hidden as u64, 1, 1_024),
        ];
        for (place, found, low, high) in whole {
            if !(low..=high).contains(&found) {
                return refuse(place, found.to_string(), format!("{low} to {high}"));
            }
        }
        let real = [
            ("crash_rate_max", self.crash_rate_max, 0.0, 1.0),
            ("route_completion_min", self.route_completion_min, 0.0, 1.0),
            ("average", self.average.unwrap_or(1.0), 1e-9, 1.0),
            ("learning_rate_last", self.learning_rate_last.unwrap_or(sac.learning_rate), 1e-8, 1.0),
            ("sac.learning_rate", sac.learning_rate, 1e-8, 1.0),
            ("sac.gamma", sac.gamma, 0.0, 1.0),
            ("sac.tau", sac.tau, 0.0, 1.0),
            ("sac.temperature_first", sac.temperature_first, 1e-6, 100.0),
            ("sac.target_entropy", sac.target_entropy, -100.0, 100.0),
        ];
        // NaN lies in no range.
        for (place, found, low, high) in real {
            if !(low..=high).contains(&found) {
                return refuse(place, found.to_string(), format!("{low} to {high}"));
            }
        }
        for (name, found) in self.reward.constants() {
            if !(0.0..=1e6).contains(&found) {
                return refuse(&format!("reward.{name}"), found.to_string(), "0 to 1e6".into());
            }
        }
        Ok(())
    }
}
