//! The learner: against Stable-Baselines3's own update, and on a task whose optimum is known.

use serde::Deserialize;

use crate::ego::network::{Dense, Mlp};
use crate::kernel::linear::transposed;
use crate::kernel::{Seed, num};
use crate::learn::{Batch, Episode, Memory, Room, Sac, SacOptions, explore};

#[derive(Deserialize)]
struct Layer {
    weight: Vec<f32>,
    bias: Vec<f32>,
}

#[derive(Deserialize)]
struct State {
    actor: Vec<Layer>,
    critics: [Vec<Layer>; 2],
    targets: [Vec<Layer>; 2],
    log_temperature: f32,
}

#[derive(Deserialize)]
struct Given {
    observations: Vec<f32>,
    actions: Vec<f32>,
    rewards: Vec<f32>,
    next_observations: Vec<f32>,
    terminals: Vec<f32>,
    noise: Vec<f32>,
    next_noise: Vec<f32>,
}

#[derive(Deserialize)]
struct Reference {
    learning_rate: f64,
    hidden: usize,
    batches: Vec<Given>,
    before: State,
    after: State,
}

/// torch keeps a row for each output.
fn dense(layer: &Layer) -> Dense {
    let (outputs, inputs) = (layer.bias.len(), layer.weight.len() / layer.bias.len());
    Dense { inputs, outputs, weights: transposed(&layer.weight, inputs), bias: layer.bias.clone() }
}

fn network(layers: &[Layer]) -> Mlp {
    Mlp { layers: layers.iter().map(dense).collect() }
}

/// The actor's heads are one layer of ours.
fn actor(layers: &[Layer]) -> Mlp {
    let [trunk @ .., mean, deviation] = layers else { panic!("an actor has two heads") };
    let head = Layer {
        weight: [&mean.weight[..], &deviation.weight].concat(),
        bias: [&mean.bias[..], &deviation.bias].concat(),
    };
    Mlp { layers: trunk.iter().map(dense).chain([dense(&head)]).collect() }
}

fn distance(found: &Mlp, expected: &Mlp) -> f32 {
    let pairs = found.parameters().flatten().zip(expected.parameters().flatten());
    pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
}

fn options(hidden: usize, learning_rate: f64, batch: usize) -> SacOptions {
    SacOptions { learning_rate, gamma: 0.99, tau: 0.005, batch, hidden, temperature_first: 1.0, target_entropy: -2.0 }
}

#[test]
fn ten_updates_are_those_of_stable_baselines() {
    let reference: Reference = serde_json::from_str(include_str!("../fixtures/sac/reference.json")).unwrap();
    let State { actor: first, critics, targets, log_temperature } = &reference.before;
    let critics = critics.each_ref().map(|layers| network(layers));
    let mut sac = Sac::of(options(reference.hidden, reference.learning_rate, 16), actor(first), critics);
    assert_eq!(sac.targets, targets.each_ref().map(|layers| network(layers)));
    assert_eq!(sac.log_temperature, *log_temperature);
    let (begun, mut room) = (sac.clone(), Room::default());
    assert_eq!(reference.batches.len(), 10);
    for given in reference.batches {
        let Given { observations, actions, rewards, next_observations, terminals, noise, next_noise } = given;
        let batch = Batch { observations, actions, rewards, next_observations, terminals, noise, next_noise };
        sac.update(&batch, sac.options.learning_rate, &mut room);
    }
    let after = reference.after;
    assert!(distance(&sac.actor, &begun.actor) > 5e-3, "ten updates move weights");
    assert!(distance(&sac.actor, &actor(&after.actor)) < 1e-5, "{}", distance(&sac.actor, &actor(&after.actor)));
    for i in 0..2 {
        let [critic, target] = [&after.critics[i], &after.targets[i]].map(|layers| network(layers));
        assert!(distance(&sac.critics[i], &critic) < 1e-5, "critic {i}: {}", distance(&sac.critics[i], &critic));
        assert!(distance(&sac.targets[i], &target) < 1e-5, "target {i}: {}", distance(&sac.targets[i], &target));
    }
    assert!((sac.log_temperature - after.log_temperature).abs() < 1e-5);
}

/// A cart on a line that is to come to rest at the origin: place and speed, pushed for 0.1 s at a time. Its cost is
/// quadratic, so the best push is linear in the state and known (LQR).
mod cart {
    use super::*;

    pub const GAMMA: f64 = 0.95;
    const STEP_S: f64 = 0.2;
    const PUSH_MPS2: f64 = 3.0;
    pub const STEPS: usize = 40;
    const SPEED_COST: f64 = 0.1;
    const PUSH_COST: f64 = 0.05;

    /// The next state, and the reward of the push.
    pub fn step([x, v]: [f64; 2], push: f64) -> ([f64; 2], f64) {
        let cost = x * x + SPEED_COST * v * v + PUSH_COST * push * push;
        let a = PUSH_MPS2 * push;
        ([x + v * STEP_S + 0.5 * a * STEP_S * STEP_S, v + a * STEP_S], -cost)
    }

    /// Gains of the best push -k·state: the discounted Riccati equation, iterated.
    pub fn best_gains() -> [f64; 2] {
        let a = [[1.0, STEP_S], [0.0, 1.0]];
        let b = [0.5 * PUSH_MPS2 * STEP_S * STEP_S, PUSH_MPS2 * STEP_S];
        let mut p = [[0.0; 2]; 2];
        let mut k = [0.0; 2];
        for _ in 0..2_000 {
            let pb = [0, 1].map(|i| p[i][0] * b[0] + p[i][1] * b[1]);
            let bpa = [0, 1].map(|j| pb[0] * a[0][j] + pb[1] * a[1][j]);
            let scale = PUSH_COST + GAMMA * (b[0] * pb[0] + b[1] * pb[1]);
            k = bpa.map(|x| GAMMA * x / scale);
            let pa = [0, 1].map(|i| [0, 1].map(|j| p[i][0] * a[0][j] + p[i][1] * a[1][j]));
            let apa = [0, 1].map(|i| [0, 1].map(|j| a[0][i] * pa[0][j] + a[1][i] * pa[1][j]));
            let cost = [[1.0, 0.0], [0.0, SPEED_COST]];
            p = [0, 1].map(|i| [0, 1].map(|j| cost[i][j] + GAMMA * (apa[i][j] - bpa[i] * k[j])));
        }
        k
    }

    /// Discounted return from a state under a law.
    pub fn discounted(mut state: [f64; 2], mut law: impl FnMut([f64; 2]) -> f64) -> f64 {
        let (mut sum, mut share) = (0.0, 1.0);
        for _ in 0..STEPS {
            let (next, reward) = step(state, law(state).clamp(-1.0, 1.0));
            sum += share * reward;
            (state, share) = (next, share * GAMMA);
        }
        sum
    }

    pub fn starts(count: usize) -> Vec<[f64; 2]> {
        let mut stream = Seed(9).stream(&["cart", "starts"]);
        (0..count).map(|_| [stream.uniform(-0.5, 0.5), stream.uniform(-0.3, 0.3)]).collect()
    }

    /// Mean return over the starts of the learned law, of the best one, and of doing nothing.
    pub fn returns(actor: &Mlp) -> [f64; 3] {
        let k = best_gains();
        let learned = |s: [f64; 2]| {
            let (mut values, mut spare) = (s.map(|x| x as f32).to_vec(), Vec::new());
            actor.apply(&mut values, &mut spare);
            num::tanh(f64::from(values[0]))
        };
        let best = |s: [f64; 2]| -(k[0] * s[0] + k[1] * s[1]);
        let starts = starts(50);
        let mean = |law: &dyn Fn([f64; 2]) -> f64| {
            num::mean(&starts.iter().map(|&start| discounted(start, law)).collect::<Vec<_>>()).unwrap()
        };
        [mean(&learned), mean(&best), mean(&|_| 0.0)]
    }

    /// An episode; the second number of an action pushes nothing.
    fn drive(sac: &Sac, even: bool, number: u64) -> Episode {
        let mut stream = Seed(9).stream(&["cart", "episode", &number.to_string()]);
        let mut state = [stream.uniform(-0.5, 0.5), stream.uniform(-0.3, 0.3)];
        let mut episode = Episode::default();
        let (mut values, mut spare) = (Vec::new(), Vec::new());
        for i in 0..=STEPS {
            let seen = state.map(|x| x as f32);
            episode.observations.extend(seen);
            if i == STEPS {
                break;
            }
            values.clear();
            values.extend(seen);
            if even {
                values = vec![stream.uniform(-1.0, 1.0) as f32, stream.uniform(-1.0, 1.0) as f32];
            } else {
                explore(&sac.actor, &mut values, &mut spare, &mut stream);
            }
            let (next, reward) = step(state, f64::from(values[0]));
            episode.actions.push([values[0], values[1]]);
            episode.rewards.push(reward as f32);
            state = next;
        }
        episode
    }

    /// Learns with so many updates, one a step.
    pub fn learned(updates: usize, hidden: usize, batch: usize, rate: f64) -> Sac {
        let mut options = options(hidden, rate, batch);
        options.gamma = GAMMA;
        options.temperature_first = 0.1;
        let mut sac = Sac::new(options, 2, 2, &mut Seed(9).stream(&["cart", "weights"]));
        let mut memory = Memory::new(2, 100_000);
        let (mut given, mut room) = (Batch::default(), Room::default());
        (0..10).for_each(|number| memory.push(&drive(&sac, true, number)));
        for number in 10..10 + (updates / STEPS) as u64 {
            memory.push(&drive(&sac, false, number));
            let mut stream = Seed(9).stream(&["cart", "updates", &number.to_string()]);
            for _ in 0..STEPS {
                memory.sample(batch, &mut stream, &mut given);
                sac.update(&given, sac.options.learning_rate, &mut room);
            }
        }
        sac
    }

    #[test]
    fn the_gains_of_the_known_law_are_the_best_ones() {
        let k = best_gains();
        let of = |k: [f64; 2]| {
            let law = |s: [f64; 2]| -(k[0] * s[0] + k[1] * s[1]);
            starts(50).into_iter().map(|start| discounted(start, law)).sum::<f64>()
        };
        for (i, by) in [(0, 0.1), (0, -0.1), (1, 0.1), (1, -0.1)] {
            let mut other = k;
            other[i] += by * k[i].abs();
            assert!(of(k) >= of(other) - 1e-6, "{k:?} against {other:?}");
        }
    }
}

/// Returns the share of the way from doing nothing to the best law that was learned.
fn share([learned, best, nothing]: [f64; 3]) -> f64 {
    (learned - nothing) / (best - nothing)
}

#[test]
fn a_cart_is_brought_to_rest_nearly_as_well_as_can_be() {
    let returns = cart::returns(&cart::learned(6_000, 16, 32, 3e-3).actor);
    assert!(share(returns) > 0.9, "{:.3} of the way: {returns:?}", share(returns));
    assert!(returns[0] <= returns[1] + 1e-6, "nobody beats the best law: {returns:?}");
}

/// The full form: `cargo test --release --test all sac::full -- --ignored`.
#[test]
#[ignore = "takes minutes; see CONTRIBUTING.md"]
fn full_training_comes_within_two_percent_of_the_best_law() {
    let returns = cart::returns(&cart::learned(12_000, 64, 256, 1e-3).actor);
    assert!(share(returns) > 0.98, "{:.3} of the way: {returns:?}", share(returns));
}
