//! Trainings end in the same weights, no matter who carries them out and how often they are stopped.

use crate::ego::Setting;
use crate::kernel::{Digest, Threads};
use crate::learn::{CheckpointError, Grounds, Lesson, Reward, SacOptions, Training, TrainingOptions};
use crate::sim::Plant;
use crate::sim::scenes::{car, crossing, sample, straight, straight_road};

fn options() -> TrainingOptions {
    TrainingOptions {
        seed: 4,
        setting: Setting::Metadrive1,
        updates: 60,
        steps_per_update: 20,
        steps_before: 60,
        episodes_per_round: 3,
        // So small that it is overwritten on the way.
        buffer: 1_000,
        evaluate_every: 20,
        crash_rate_max: 0.03,
        route_completion_min: 0.8,
        average: None,
        learning_rate_last: None,
        sac: SacOptions {
            learning_rate: 1e-3,
            gamma: 0.99,
            tau: 0.005,
            batch: 16,
            hidden: 8,
            temperature_first: 1.0,
            target_entropy: -2.0,
        },
        reward: Reward::metadrive(10.0),
    }
}

fn lessons() -> Vec<Lesson> {
    let lead = car("lead", straight(sample(30.0, 0.0, 0.0, 6.0), 61));
    let scenes = [straight_road(61, 8.0, vec![lead]), crossing(4, 8, 61), crossing(5, 8, 61)];
    scenes.iter().map(|scene| Plant::new(scene).unwrap().into()).collect()
}

/// Trains on from a state; a state that is stopped after each evaluation goes through a checkpoint.
fn trained(mut state: Training, jobs: usize, stops: bool) -> Digest {
    let (lessons, threads) = (lessons(), Threads::new(jobs).unwrap());
    let grounds = Grounds { training: &lessons, validation: &lessons[..2], threads: &threads };
    let recipe = Digest::of_bytes(b"recipe");
    while !state.is_over() {
        let news = state.round(&grounds).unwrap();
        if stops && news.evaluated.is_some() {
            let bytes = state.checkpoint(recipe).unwrap();
            let resumed = Training::resumed(state.options, recipe, &bytes).unwrap();
            assert!(resumed == state, "nothing is lost");
            state = resumed;
        }
    }
    assert_eq!((state.updates, state.curve.len()), (60, 3));
    assert_eq!(state.memory.len(), state.options.buffer, "the oldest states were overwritten");
    Digest::of_bytes(&state.weights().unwrap())
}

#[test]
fn weights_depend_neither_on_threads_nor_on_stops() {
    let begin = || Training::new(options()).unwrap();
    let whole = trained(begin(), 1, false);
    assert_eq!(whole, trained(begin(), 2, false), "threads");
    assert_eq!(whole, trained(begin(), 2, true), "stops");
    let mut other = options();
    other.seed = 5;
    assert_ne!(whole, trained(Training::new(other).unwrap(), 1, false), "another seed");
    // The same in debug and release builds and on every CPU.
    assert_eq!(whole.to_hex(), "81c8b8f7f62168b62c9dbabbecfc8fb636a4a1873c6a3bf949152d51fe170bab");
}

#[test]
fn an_average_of_the_actors_is_what_is_kept_and_survives_stops() {
    let mut averaged = options();
    (averaged.average, averaged.learning_rate_last) = (Some(0.02), Some(1e-4));
    let begin = |options| Training::new(options).unwrap();
    let whole = trained(begin(averaged), 1, false);
    assert_eq!(whole, trained(begin(averaged), 2, true), "threads and stops");
    // Everything but what is handed out is the same with and without the average.
    let (lessons, threads) = (lessons(), Threads::new(1).unwrap());
    let mut states = [averaged.average, None].map(|average| begin(TrainingOptions { average, ..averaged }));
    for state in &mut states {
        while !state.is_over() {
            state.advance(&lessons, &threads).unwrap();
        }
    }
    let [with, without] = states;
    assert!(with.sac == without.sac, "the average teaches nothing");
    assert!(with.present() != &with.sac.actor && without.present() == &without.sac.actor);
}

#[test]
fn a_learning_rate_falls_evenly_to_its_last_value() {
    let mut options = options();
    assert_eq!(options.learning_rate(60), 1e-3, "without a last one it stays");
    options.learning_rate_last = Some(1e-4);
    let found = [0, 30, 60].map(|updates| options.learning_rate(updates));
    for (found, expected) in found.into_iter().zip([1e-3, 5.5e-4, 1e-4]) {
        assert!((found - expected).abs() < 1e-12, "{found} for {expected}");
    }
}

#[test]
fn a_checkpoint_of_another_training_or_a_damaged_one_is_refused() {
    let state = Training::new(options()).unwrap();
    let [own, other] = [b"own", b"two"].map(|name| Digest::of_bytes(name));
    let bytes = state.checkpoint(own).unwrap();
    assert!(matches!(Training::resumed(state.options, other, &bytes), Err(CheckpointError::Other { .. })));
    for end in (0..bytes.len()).step_by(997) {
        assert!(Training::resumed(state.options, own, &bytes[..end]).is_err(), "{end}");
    }
    let mut wider = state.options;
    wider.sac.hidden = 9;
    let error = Training::resumed(wider, own, &bytes).unwrap_err().to_string();
    assert!(error.contains("actor.0") && error.contains("expected"), "{error}");
}
