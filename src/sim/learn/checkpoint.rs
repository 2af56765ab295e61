//! A training as bytes between two rounds: safetensors with every network, moment and remembered state, and one line of
//! JSON with the rest. A training that was read back goes on as if it had not been interrupted.

use safetensors::tensor::{Dtype, SafeTensors, TensorView, serialize};
use serde::{Deserialize, Serialize};

use super::options::TrainingOptions;
use super::training::{Point, Training, TrainingError};
use crate::ego::WeightsError;
use crate::ego::weights::{bytes_of, floats};
use crate::kernel::Digest;

const KEY: &str = "evodrive-training";

/// Why bytes are no checkpoint of a training.
#[derive(Debug, thiserror::Error)]
pub enum CheckpointError {
    #[error("checkpoint, {}: found {}, expected {}; remove it and train from the beginning", .0.layer, .0.found, .0.expected)]
    Tensor(WeightsError),
    #[error("checkpoint, header: {0}; remove it and train from the beginning")]
    Header(String),
    #[error(
        "the checkpoint belongs to another training, with other options or scenes (expected {expected}, found {found}); remove it"
    )]
    Other { found: Digest, expected: Digest },
    #[error(transparent)]
    Training(#[from] TrainingError),
}

/// Everything of a training that is no list of `f32`.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Header {
    /// Digest of options and scenes.
    recipe: Digest,
    rounds: u64,
    episodes: u64,
    steps: u64,
    updates: u64,
    curve: Vec<Point>,
    best: Option<usize>,
    next: usize,
    rows: usize,
    log_temperature: f32,
    /// Steps of the optimisers: actor, critics, temperature.
    adam_steps: [u32; 3],
}

impl Training {
    /// The bytes of a checkpoint; `recipe` is the digest of options and scenes.
    pub fn checkpoint(&self, recipe: Digest) -> Result<Vec<u8>, CheckpointError> {
        let header = Header {
            recipe,
            rounds: self.rounds,
            episodes: self.episodes,
            steps: self.steps,
            updates: self.updates,
            curve: self.curve.clone(),
            best: self.best.as_ref().map(|(place, _)| *place),
            next: self.memory.next,
            rows: self.memory.len(),
            log_temperature: self.sac.log_temperature,
            adam_steps: [&self.sac.actor_adam, &self.sac.critics_adam, &self.sac.temperature_adam]
                .map(|adam| adam.steps),
        };
        let failed = |error: &dyn std::fmt::Display| CheckpointError::Header(error.to_string());
        let line = serde_json::to_string(&header).map_err(|error| failed(&error))?;
        let mut copy = self.clone();
        let tensors: Vec<(String, usize, Vec<u8>)> =
            copy.lists().into_iter().map(|(name, list)| (name, list.len(), bytes_of(list))).collect();
        let views = tensors
            .iter()
            .map(|(name, count, data)| Ok((name, TensorView::new(Dtype::F32, vec![*count], data)?)))
            .collect::<Result<Vec<_>, safetensors::SafeTensorError>>()
            .map_err(|error| failed(&error))?;
        serialize(views, Some([(KEY.to_string(), line)].into_iter().collect())).map_err(|error| failed(&error))
    }

    /// The training that a checkpoint holds; it must be one of these options and scenes.
    pub fn resumed(options: TrainingOptions, recipe: Digest, bytes: &[u8]) -> Result<Training, CheckpointError> {
        let failed = |error: &dyn std::fmt::Display| CheckpointError::Header(error.to_string());
        let file = SafeTensors::deserialize(bytes).map_err(|error| failed(&error))?;
        let (_, metadata) = SafeTensors::read_metadata(bytes).map_err(|error| failed(&error))?;
        let line = metadata.metadata().as_ref().and_then(|lines| lines.get(KEY));
        let line = line.ok_or_else(|| failed(&format!("no line {KEY:?}")))?;
        let header: Header = serde_json::from_str(line).map_err(|error| failed(&error))?;
        if header.recipe != recipe {
            return Err(CheckpointError::Other { found: header.recipe, expected: recipe });
        }
        let mut training = Training::new(options)?;
        let Header { rounds, episodes, steps, updates, curve, best, next, rows, log_temperature, adam_steps, .. } =
            header;
        if rows > options.buffer || next >= options.buffer || best.is_some_and(|best| best >= curve.len()) {
            return Err(failed(&"counts that no training of these options has"));
        }
        (training.rounds, training.episodes, training.steps, training.updates) = (rounds, episodes, steps, updates);
        training.curve = curve;
        training.best = best.map(|place| (place, training.sac.actor.clone()));
        training.memory.make_room(rows, next);
        let sac = &mut training.sac;
        let adams = [&mut sac.actor_adam, &mut sac.critics_adam, &mut sac.temperature_adam];
        adams.into_iter().zip(adam_steps).for_each(|(adam, steps)| adam.steps = steps);
        sac.log_temperature = log_temperature;
        for (name, list) in training.lists() {
            *list = floats(&file, &name, &[list.len()]).map_err(CheckpointError::Tensor)?;
        }
        Ok(training)
    }

    /// Every list of numbers by name.
    fn lists(&mut self) -> Vec<(String, &mut Vec<f32>)> {
        let Training { sac, memory, best, average, .. } = self;
        let [first, second] = &mut sac.critics;
        let [first_target, second_target] = &mut sac.targets;
        let networks = [
            ("actor", &mut sac.actor),
            ("critic_0", first),
            ("critic_1", second),
            ("target_0", first_target),
            ("target_1", second_target),
        ];
        let average = average.as_mut().map(|actor| ("average", actor));
        let kept = best.as_mut().map(|(_, actor)| ("kept", actor));
        let adams = [
            ("actor_adam", &mut sac.actor_adam),
            ("critics_adam", &mut sac.critics_adam),
            ("temperature_adam", &mut sac.temperature_adam),
        ];
        let mut lists = Vec::new();
        for (name, network) in networks.into_iter().chain(average).chain(kept) {
            let named = |(i, list)| (format!("{name}.{i}"), list);
            lists.extend(network.parameters_mut().enumerate().map(named));
        }
        for (name, adam) in adams {
            for (i, [mean, square]) in adam.moments.iter_mut().enumerate() {
                lists.extend([(format!("{name}.{i}.mean"), mean), (format!("{name}.{i}.square"), square)]);
            }
        }
        lists.extend([
            ("memory.observations".to_string(), &mut memory.observations),
            ("memory.actions".to_string(), &mut memory.actions),
            ("memory.rewards".to_string(), &mut memory.rewards),
            ("memory.terminals".to_string(), &mut memory.terminals),
            ("memory.lasts".to_string(), &mut memory.lasts),
        ]);
        lists
    }
}
