//! The training loop. A round drives some scenes with the actor as it is, side by side, and then makes the updates that
//! these steps pay for. All random numbers of a round come from streams that bear its number, and its episodes', so that a
//! training that goes on from a checkpoint draws what it would have drawn.

use serde::{Deserialize, Serialize};

use super::episode::{Driven, drive};
use super::lesson::Lesson;
use super::memory::Memory;
use super::options::TrainingOptions;
use super::sac::{Batch, Losses, Room, Sac};
use super::trial::{Trial, trial};
use crate::ego::network::Mlp;
use crate::ego::{Policy, Weights, WeightsError};
use crate::kernel::{Seed, Threads, num};
use crate::sim::{End, SimError};

use super::options::TrainingOptionsError;
use crate::ego::observation::ACTION;

/// Scenes and threads of a training.
pub struct Grounds<'a> {
    /// Scenes that are driven for learning.
    pub training: &'a [Lesson],
    /// Scenes by which actors are compared; never learned from.
    pub validation: &'a [Lesson],
    pub threads: &'a Threads,
}

/// A training that cannot go on.
#[derive(Debug, thiserror::Error)]
pub enum TrainingError {
    #[error(transparent)]
    Options(#[from] TrainingOptionsError),
    #[error(transparent)]
    Scene(#[from] SimError),
    #[error(transparent)]
    Weights(#[from] WeightsError),
    #[error("the pool holds no {0} scene; name a pool with some in the training file")]
    NoScene(&'static str),
    /// Weights that are no longer finite.
    #[error("after {updates} updates the losses are not finite; lower sac.learning_rate")]
    Diverged { updates: u64 },
}

/// An evaluation on the way.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Point {
    pub updates: u64,
    /// Steps driven so far.
    pub steps: u64,
    pub trial: Trial,
}

/// The state of a training between two rounds.
#[derive(Clone, Debug, PartialEq)]
pub struct Training {
    pub options: TrainingOptions,
    pub sac: Sac,
    pub memory: Memory,
    pub rounds: u64,
    pub episodes: u64,
    pub steps: u64,
    pub updates: u64,
    pub curve: Vec<Point>,
    /// Average of the actors so far, where the options ask for one.
    pub average: Option<Mlp>,
    /// The actor that is kept so far, and its index in the curve.
    pub best: Option<(usize, Mlp)>,
}

/// Results of a round.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct News {
    /// Mean sum of rewards of its episodes.
    pub mean_return: f64,
    pub crash_rate: f64,
    pub route_completion: f64,
    /// Losses of its last update.
    pub losses: Losses,
    /// True if an evaluation is due after it.
    pub is_due: bool,
    /// That evaluation, if the round made it.
    pub evaluated: Option<Trial>,
}

impl Training {
    /// Makes a training before its first round.
    pub fn new(options: TrainingOptions) -> Result<Training, TrainingError> {
        options.check()?;
        let width = options.setting.length();
        let sac = Sac::new(options.sac, width, ACTION, &mut Seed(options.seed).stream(&["learn", "weights"]));
        let memory = Memory::new(width, options.buffer);
        let average = options.average.map(|_| sac.actor.clone());
        let (rounds, episodes, steps, updates) = (0, 0, 0, 0);
        Ok(Training { options, sac, memory, rounds, episodes, steps, updates, curve: vec![], average, best: None })
    }

    /// Returns `true` if all updates are made.
    pub fn is_over(&self) -> bool {
        self.updates >= self.options.updates
    }

    /// Does one round, with the evaluation that is due after it.
    pub fn round(&mut self, grounds: &Grounds<'_>) -> Result<News, TrainingError> {
        let mut news = self.advance(grounds.training, grounds.threads)?;
        if news.is_due {
            news.evaluated = Some(self.evaluate(grounds)?);
        }
        Ok(news)
    }

    /// Does one round without an evaluation: for callers that evaluate in another way, or not at all. Only the present actor is kept.
    pub fn advance(&mut self, lessons: &[Lesson], threads: &Threads) -> Result<News, TrainingError> {
        let driven = self.drive(lessons, threads)?;
        self.rounds += 1;
        self.episodes += driven.len() as u64;
        for episode in &driven {
            self.steps += episode.episode.actions.len() as u64;
            self.memory.push(&episode.episode);
        }
        let mean = |of: &dyn Fn(&Driven) -> f64| num::mean(&driven.iter().map(of).collect::<Vec<_>>()).unwrap_or(0.0);
        let mut news = News {
            mean_return: mean(&|d| num::sum(d.episode.rewards.iter().map(|r| f64::from(*r)))),
            crash_rate: mean(&|d| f64::from(d.end == End::Contact)),
            route_completion: mean(&|d| d.completion),
            ..News::default()
        };
        let before = self.updates;
        news.losses = self.learn()?;
        let every = self.options.evaluate_every;
        news.is_due = before / every < self.updates / every || (self.is_over() && before < self.updates);
        Ok(news)
    }

    fn drive(&self, lessons: &[Lesson], threads: &Threads) -> Result<Vec<Driven>, TrainingError> {
        if lessons.is_empty() {
            return Err(TrainingError::NoScene("training"));
        }
        let TrainingOptions { seed, setting, reward, .. } = &self.options;
        let actor = (self.steps >= self.options.steps_before).then_some(&self.sac.actor);
        let numbers: Vec<u64> = (0..self.options.episodes_per_round as u64).map(|i| self.episodes + i).collect();
        let driven = threads.map(&numbers, |_, number| {
            let mut stream = Seed(*seed).stream(&["learn", "episode", &number.to_string()]);
            let lesson = &lessons[stream.below(lessons.len())];
            drive(lesson, *setting, reward, actor, stream)
        });
        Ok(driven.into_iter().collect::<Result<Vec<_>, SimError>>()?)
    }

    /// Makes the updates that the steps so far pay for.
    fn learn(&mut self) -> Result<Losses, TrainingError> {
        let paid = self.steps.saturating_sub(self.options.steps_before) / self.options.steps_per_update;
        let due = paid.min(self.options.updates).saturating_sub(self.updates);
        let mut stream = Seed(self.options.seed).stream(&["learn", "updates", &self.rounds.to_string()]);
        let (mut batch, mut room, mut losses) = (Batch::default(), Room::default(), Losses::default());
        for _ in 0..due {
            self.memory.sample(self.options.sac.batch, &mut stream, &mut batch);
            losses = self.sac.update(&batch, self.options.learning_rate(self.updates), &mut room);
            self.updates += 1;
            self.average_actors();
        }
        if losses.critic.is_finite() && losses.actor.is_finite() {
            Ok(losses)
        } else {
            Err(TrainingError::Diverged { updates: self.updates })
        }
    }

    /// Takes the present actor into the average. The first ones count evenly, so that the beginning does not linger.
    fn average_actors(&mut self) {
        let (Some(share), Some(average)) = (self.options.average, &mut self.average) else { return };
        let take = share_of(share, self.updates);
        for (mean, now) in average.parameters_mut().zip(self.sac.actor.parameters()) {
            mean.iter_mut().zip(now).for_each(|(mean, x)| *mean += take * (x - *mean));
        }
    }

    /// Returns the actor as it would be handed out now.
    pub fn present(&self) -> &Mlp {
        self.average.as_ref().unwrap_or(&self.sac.actor)
    }

    fn evaluate(&mut self, grounds: &Grounds<'_>) -> Result<Trial, TrainingError> {
        if grounds.validation.is_empty() {
            return Err(TrainingError::NoScene("validation"));
        }
        let bytes = Weights::to_bytes(self.options.setting, self.present())?;
        let validated = trial(grounds.validation, &Policy::learned(&bytes)?, grounds.threads)?;
        let place = self.curve.len();
        self.curve.push(Point { updates: self.updates, steps: self.steps, trial: validated });
        let TrainingOptions { crash_rate_max, route_completion_min, .. } = self.options;
        let of = |trial: &Trial| rank(trial, crash_rate_max, route_completion_min);
        let is_better = self.best.as_ref().is_none_or(|(best, _)| of(&validated) > of(&self.curve[*best].trial));
        if is_better {
            self.best = Some((place, self.present().clone()));
        }
        Ok(validated)
    }

    /// Returns the weights that the training gives: those of the best evaluated actor, or of the present one before any evaluation.
    pub fn weights(&self) -> Result<Vec<u8>, WeightsError> {
        Weights::to_bytes(self.options.setting, self.best.as_ref().map_or(self.present(), |(_, actor)| actor))
    }
}

/// Returns the weight in the average of the actor after so many updates: evenly at first, `share` later.
fn share_of(share: f64, updates: u64) -> f32 {
    share.max(1.0 / updates.max(1) as f64) as f32
}

/// Ranks actors. Those that crash no more and drive no less than the options say come first, by route completion; the others
/// by route completion less crash rate. Among equals the earlier one is kept.
fn rank(trial: &Trial, crash_rate_max: f64, route_completion_min: f64) -> (bool, f64) {
    let is_fit = trial.crash_rate <= crash_rate_max && trial.route_completion >= route_completion_min;
    (is_fit, trial.route_completion - if is_fit { 0.0 } else { trial.crash_rate })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(crash_rate: f64, route_completion: f64) -> Trial {
        Trial { scenes: 1, crash_rate, off_road_rate: 0.0, arrival_rate: 0.0, route_completion, speed_mps: 0.0 }
    }

    #[test]
    fn an_average_begins_as_a_mean_and_then_forgets() {
        let mut mean = -7.0;
        let seen: Vec<f32> = (1..=60)
            .map(|n| {
                mean += share_of(0.1, n) * (n as f32 - mean);
                mean
            })
            .collect();
        assert!(
            (seen[3] - 2.5).abs() < 1e-5,
            "the mean of 1, 2, 3 and 4, and nothing of what stood there before: {}",
            seen[3]
        );
        // Behind a steady rise of 1 an update it lags by (1 - share) / share updates.
        assert!((seen[59] - 51.0).abs() < 0.1, "{}", seen[59]);
    }

    #[test]
    fn the_kept_actor_is_safe_and_drives() {
        let better = |a: Trial, b: Trial| rank(&a, 0.03, 0.8) > rank(&b, 0.03, 0.8);
        assert!(better(of(0.03, 0.8), of(0.04, 0.99)), "fit before unfit");
        assert!(better(of(0.02, 0.9), of(0.0, 0.85)), "among fit ones who drives farther");
        assert!(better(of(0.3, 0.9), of(0.0, 0.06)), "who stands still is not fit");
        assert!(better(of(0.1, 0.8), of(0.25, 0.9)), "among unfit ones crashes count against the way");
        assert!(!better(of(0.02, 0.9), of(0.02, 0.9)), "the earlier of equals stays");
    }
}
