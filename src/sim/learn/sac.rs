//! Soft actor-critic (Haarnoja et al. 2018): twin critics, a squashed Gaussian actor, automatic temperature, averaged
//! targets. The order of an update and its constants are those of Stable-Baselines3; `tests/all/sac.rs` steps both.

use serde::{Deserialize, Serialize};

use super::adam::Adam;
use super::batch::{Pass, zeros_like};
use super::init;
use crate::ego::network::{Mlp, tanh};
use crate::kernel::{Stream, num};

/// The bounds of the logarithm of a standard deviation.
const LOG_STD: (f32, f32) = (-20.0, 2.0);

/// The constants of an update.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SacOptions {
    /// Learning rate of Adam for actor, critics and temperature. Stable-Baselines3: 3e-4.
    pub learning_rate: f64,
    /// Discount of a step. 0.99.
    pub gamma: f64,
    /// Share of the critics in their averages an update. 0.005.
    pub tau: f64,
    /// Number of transitions in an update. 256.
    pub batch: usize,
    /// Widths of the two hidden layers of actor and critics. Stable-Baselines3: 256.
    pub hidden: usize,
    /// The temperature at the beginning. 1.
    pub temperature_first: f64,
    /// Entropy to which the temperature is steered. -(numbers of an action).
    pub target_entropy: f64,
}

/// Networks, optimisers and temperature: all that an update changes.
#[derive(Clone, Debug, PartialEq)]
pub struct Sac {
    pub options: SacOptions,
    /// Means, then logarithms of standard deviations.
    pub actor: Mlp,
    pub critics: [Mlp; 2],
    pub targets: [Mlp; 2],
    pub actor_adam: Adam,
    /// Adam of both critics together.
    pub critics_adam: Adam,
    pub log_temperature: f32,
    pub temperature_adam: Adam,
}

/// Transitions, row after row, with the noise that an update needs.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Batch {
    pub observations: Vec<f32>,
    /// In [-1, 1].
    pub actions: Vec<f32>,
    pub rewards: Vec<f32>,
    pub next_observations: Vec<f32>,
    /// 1 where nothing follows, else 0. A time limit is no end.
    pub terminals: Vec<f32>,
    /// Standard normal numbers, shaped as the actions: for the actor at the observations and at the next ones.
    pub noise: Vec<f32>,
    pub next_noise: Vec<f32>,
}

/// Results of an update.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Losses {
    pub critic: f64,
    pub actor: f64,
    pub temperature: f64,
    /// Mean of -ln π(a|s).
    pub entropy: f64,
}

/// Room for the passes of an update.
#[derive(Clone, Debug, Default)]
pub struct Room {
    actor: Pass,
    critics: [Pass; 2],
    other: Pass,
}

/// Actions drawn from the actor, with what their gradient needs.
struct Drawn {
    actions: Vec<f32>,
    /// ln π of each row.
    log_probability: Vec<f32>,
    /// σ of each number, and true if its logarithm lies within the bounds.
    deviation: Vec<f32>,
    is_free: Vec<bool>,
}

impl Sac {
    /// Makes a learner for observations and actions of these lengths.
    pub fn new(options: SacOptions, observation: usize, action: usize, stream: &mut Stream) -> Sac {
        let hidden = options.hidden;
        let actor = init::drawn(&[observation, hidden, hidden, 2 * action], stream);
        let critics = [0, 1].map(|_| init::drawn(&[observation + action, hidden, hidden, 1], stream));
        Sac::of(options, actor, critics)
    }

    /// Makes a learner that begins with these networks.
    pub fn of(options: SacOptions, actor: Mlp, critics: [Mlp; 2]) -> Sac {
        let temperature = vec![num::ln(options.temperature_first) as f32];
        Sac {
            actor_adam: Adam::new(actor.parameters()),
            critics_adam: Adam::new(critics.iter().flat_map(Mlp::parameters)),
            temperature_adam: Adam::new([&temperature].into_iter()),
            log_temperature: temperature[0],
            targets: critics.clone(),
            options,
            actor,
            critics,
        }
    }

    /// Makes one update at this learning rate.
    pub fn update(&mut self, batch: &Batch, rate: f64, room: &mut Room) -> Losses {
        let count = batch.rewards.len().max(1) as f32;
        let drawn = draw(self.actor.outputs() / 2, room.actor.forward(&self.actor, &batch.observations), &batch.noise);
        // Before its own step, as the reference does.
        let temperature = num::exp(f64::from(self.log_temperature)) as f32;
        let mean_log = sum(&drawn.log_probability) / count;
        self.step_temperature(mean_log, rate);
        let wanted = self.wanted(batch, temperature, &mut room.other);
        let critic = self.step_critics(batch, &wanted, rate, room);
        let actor = self.step_actor(batch, &drawn, temperature, rate, room);
        self.average_targets();
        Losses { critic, actor, temperature: f64::from(temperature), entropy: -f64::from(mean_log) }
    }

    fn step_temperature(&mut self, mean_log: f32, rate: f64) {
        let mut value = [vec![self.log_temperature]];
        let gradient = [vec![-(mean_log + self.options.target_entropy as f32)]];
        self.temperature_adam.step(value.iter_mut(), gradient.iter(), rate);
        self.log_temperature = value[0][0];
    }

    /// Returns the critics' targets: reward, and the discounted value of the next state.
    fn wanted(&self, batch: &Batch, temperature: f32, pass: &mut Pass) -> Vec<f32> {
        let heads = pass.forward(&self.actor, &batch.next_observations);
        let next = draw(self.actor.outputs() / 2, heads, &batch.next_noise);
        let rows = joined(&batch.next_observations, &next.actions, batch.rewards.len());
        let mut least = pass.forward(&self.targets[0], &rows).to_vec();
        let other = pass.forward(&self.targets[1], &rows);
        least.iter_mut().zip(other).for_each(|(q, other)| *q = q.min(*other));
        let gamma = self.options.gamma as f32;
        let value = |i: usize| least[i] - temperature * next.log_probability[i];
        (0..least.len()).map(|i| batch.rewards[i] + (1.0 - batch.terminals[i]) * gamma * value(i)).collect()
    }

    /// Returns half the sum of both critics' mean squared errors, and makes a step against it.
    fn step_critics(&mut self, batch: &Batch, wanted: &[f32], rate: f64, room: &mut Room) -> f64 {
        let rows = joined(&batch.observations, &batch.actions, wanted.len());
        let count = wanted.len().max(1) as f32;
        let mut gradients = self.critics.each_ref().map(zeros_like);
        let mut loss = 0.0;
        for ((critic, gradient), pass) in self.critics.iter().zip(&mut gradients).zip(&mut room.critics) {
            let errors: Vec<f32> = pass.forward(critic, &rows).iter().zip(wanted).map(|(q, y)| q - y).collect();
            loss += 0.5 * num::sum(errors.iter().map(|e| f64::from(*e) * f64::from(*e))) / f64::from(count);
            let by_output: Vec<f32> = errors.iter().map(|e| e / count).collect();
            pass.backward(critic, &by_output, gradient);
        }
        let parameters = self.critics.iter_mut().flat_map(Mlp::parameters_mut);
        self.critics_adam.step(parameters, gradients.iter().flat_map(Mlp::parameters), rate);
        loss
    }

    /// Returns the mean of α ln π - min Q at the actor's own actions, and makes a step against it.
    fn step_actor(&mut self, batch: &Batch, drawn: &Drawn, temperature: f32, rate: f64, room: &mut Room) -> f64 {
        let rows = joined(&batch.observations, &drawn.actions, batch.rewards.len());
        let count = batch.rewards.len().max(1) as f32;
        let [first, second] = [0, 1].map(|i| room.critics[i].forward(&self.critics[i], &rows).to_vec());
        let least = first.iter().zip(&second).map(|(a, b)| f64::from(a.min(*b)));
        let logs = drawn.log_probability.iter().map(|l| f64::from(temperature) * f64::from(*l));
        let loss = num::sum(logs.zip(least).map(|(l, q)| l - q)) / f64::from(count);
        let numbers = self.actor.outputs() / 2;
        // Each row's gradient runs through the critic with the lower value.
        let mut by_action = vec![0.0; drawn.actions.len()];
        for (i, chosen) in [0, 1].into_iter().zip([true, false]) {
            let mark = |(a, b): (&f32, &f32)| if (a <= b) == chosen { -1.0 / count } else { 0.0 };
            let by_output: Vec<f32> = first.iter().zip(&second).map(mark).collect();
            let slopes = room.critics[i].backward_to_input(&self.critics[i], &by_output, numbers);
            by_action.iter_mut().zip(slopes).for_each(|(sum, x)| *sum += x);
        }
        let by_heads = drawn.by_heads(&by_action, &batch.noise, temperature / count, numbers);
        let mut gradient = zeros_like(&self.actor);
        room.actor.backward(&self.actor, &by_heads, &mut gradient);
        self.actor_adam.step(self.actor.parameters_mut(), gradient.parameters(), rate);
        loss
    }

    fn average_targets(&mut self) {
        let (keep, take) = ((1.0 - self.options.tau) as f32, self.options.tau as f32);
        let targets = self.targets.iter_mut().flat_map(Mlp::parameters_mut);
        for (target, critic) in targets.zip(self.critics.iter().flat_map(Mlp::parameters)) {
            target.iter_mut().zip(critic).for_each(|(t, q)| *t = keep * *t + take * q);
        }
    }
}

impl Drawn {
    /// Returns the loss's gradient by the actor's heads, given that by the actions and the share of ln π in the loss.
    fn by_heads(&self, by_action: &[f32], noise: &[f32], log_share: f32, numbers: usize) -> Vec<f32> {
        let mut heads = vec![0.0; 2 * self.actions.len()];
        for (i, (&a, &slope)) in self.actions.iter().zip(by_action).enumerate() {
            let (row, j) = (i / numbers, i % numbers);
            // Through the squash, and through its correction of the density.
            let by_u = slope * (1.0 - a * a) + log_share * 2.0 * a;
            heads[row * 2 * numbers + j] = by_u;
            if self.is_free[i] {
                heads[row * 2 * numbers + numbers + j] = by_u * self.deviation[i] * noise[i] - log_share;
            }
        }
        heads
    }
}

/// Draws actions tanh(μ + σ ε) with their log densities. The squash's correction is taken as 2 (ln 2 - u - softplus(-2 u)),
/// which stays finite where 1 - tanh² is rounded to zero; Stable-Baselines3 adds 1e-6 there instead.
fn draw(numbers: usize, heads: &[f32], noise: &[f32]) -> Drawn {
    let mut drawn = Drawn { actions: vec![], log_probability: vec![], deviation: vec![], is_free: vec![] };
    for (head, noise) in heads.chunks_exact(2 * numbers).zip(noise.chunks_exact(numbers)) {
        let (means, logs) = head.split_at(numbers);
        let mut log_probability = 0.0;
        for ((mean, log), e) in means.iter().zip(logs).zip(noise) {
            let clamped = log.clamp(LOG_STD.0, LOG_STD.1);
            let deviation = num::exp(f64::from(clamped)) as f32;
            let (u, e) = (mean + deviation * e, f64::from(*e));
            let gaussian = -0.5 * e * e - f64::from(clamped) - 0.5 * num::ln(num::TAU);
            log_probability += gaussian - squash_correction(f64::from(u));
            drawn.actions.push(tanh(u));
            drawn.deviation.push(deviation);
            drawn.is_free.push(clamped == *log);
        }
        drawn.log_probability.push(log_probability as f32);
    }
    drawn
}

/// Returns ln(1 - tanh²(u)).
fn squash_correction(u: f64) -> f64 {
    let softplus = (-2.0 * u).max(0.0) + num::ln(1.0 + num::exp(-2.0 * u.abs()));
    2.0 * (num::ln(2.0) - u - softplus)
}

/// Returns rows of observations with rows of actions behind them.
fn joined(observations: &[f32], actions: &[f32], count: usize) -> Vec<f32> {
    let (long, short) = (observations.len() / count.max(1), actions.len() / count.max(1));
    let mut rows = Vec::with_capacity(observations.len() + actions.len());
    for (observation, action) in observations.chunks_exact(long.max(1)).zip(actions.chunks_exact(short.max(1))) {
        rows.extend_from_slice(observation);
        rows.extend_from_slice(action);
    }
    rows
}

fn sum(values: &[f32]) -> f32 {
    num::sum(values.iter().map(|x| f64::from(*x))) as f32
}

/// Draws an action for one observation: tanh of the Gaussian, as training explores.
pub fn explore(actor: &Mlp, values: &mut Vec<f32>, spare: &mut Vec<f32>, stream: &mut Stream) {
    actor.apply(values, spare);
    let numbers = actor.outputs() / 2;
    let noise: Vec<f32> = (0..numbers).map(|_| stream.normal(0.0, 1.0) as f32).collect();
    let drawn = draw(numbers, values, &noise);
    values.clear();
    values.extend(drawn.actions);
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the actor's loss of one row, where the critics' minimum is a plain function of the action.
    fn loss(heads: &[f32], noise: &[f32], temperature: f64) -> f64 {
        let drawn = draw(2, heads, noise);
        let q: f64 = drawn.actions.iter().map(|a| f64::from(*a)).map(|a| a - 0.5 * a * a).sum();
        temperature * f64::from(drawn.log_probability[0]) - q
    }

    #[test]
    fn the_gradient_by_the_heads_is_its_finite_difference() {
        let noise = [0.7, -1.1];
        // The last deviation lies beyond its bound, where nothing may pull at it.
        for heads in [[0.2, -0.4, -0.5, 0.3], [-1.0, 0.8, -1.5, 2.5]] {
            let drawn = draw(2, &heads, &noise);
            let by_action: Vec<f32> = drawn.actions.iter().map(|a| a - 1.0).collect();
            let found = drawn.by_heads(&by_action, &noise, 0.3, 2);
            for (i, slope) in found.iter().enumerate() {
                let moved = |by: f32| {
                    let mut moved = heads;
                    moved[i] += by;
                    loss(&moved, &noise, 0.3)
                };
                let expected = (moved(1.0 / 256.0) - moved(-1.0 / 256.0)) * 128.0;
                assert!((f64::from(*slope) - expected).abs() < 2e-3, "head {i}: {slope} for {expected}");
            }
        }
    }

    #[test]
    fn the_squash_is_corrected_also_where_it_saturates() {
        for u in [0.0, 0.3, -1.7, 4.0] {
            let plain = num::ln(1.0 - num::tanh(u) * num::tanh(u));
            assert!((squash_correction(u) - plain).abs() < 1e-9, "{u}");
        }
        assert!((squash_correction(50.0) - (2.0 * num::ln(2.0) - 100.0)).abs() < 1e-9);
    }
}
