//! The egos of SafeBench and ChatScene: actors of their checkpoints as weights of ours. Both act by acceleration, then steering; ours
//! by steering, then pedal.

use super::network::{Dense, Mlp};
use super::observation::{ACTION, Setting};
use super::weights::Weights;
use super::weights_error::WeightsError;
use crate::kernel::linear::transposed;

/// Keys of an actor's dictionary in a checkpoint that holds several: as written by ChatScene's fine-tuning, then by SafeBench's own SAC
/// and PPO. (The published weights are a pair of actor and critic.)
pub const ACTORS: [&str; 3] = ["actor_state_dict", "policy_net", "policy"];

/// Names of an actor's two hidden layers and heads in a training, and the direction of its steering.
struct Layout {
    trainings: &'static str,
    layers: [&'static str; 3],
    /// The logarithm of the standard deviation, where it is a layer.
    spread: Option<&'static str>,
    /// Positive steering turns right, as in CARLA: `safe_rl`'s actors are flipped on their way to CARLA (`rl_agent.py`), SafeBench's own
    /// are not.
    is_right: bool,
}

const LAYOUTS: [Layout; 3] = [
    Layout {
        trainings: "SAC of safe_rl",
        layers: ["net.0", "net.2", "mu_layer"],
        spread: Some("log_std_layer"),
        is_right: false,
    },
    Layout { trainings: "TD3 and DDPG of safe_rl", layers: ["pi.0", "pi.2", "pi.4"], spread: None, is_right: false },
    Layout {
        trainings: "SafeBench's SAC and PPO",
        layers: ["fc1", "fc2", "fc_mu"],
        spread: Some("fc_std"),
        is_right: true,
    },
];

/// Reasons why the tensors of a checkpoint are no ego.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum CheckpointError {
    /// An actor of another training.
    #[error(
        "tensors {found}: expected the actor of {expected}; others are written with evodrive.gym.save_policy (docs/EGOS.md)"
    )]
    Layout {
        /// Names that are there.
        found: String,
        /// Trainings whose actors are read, with their layers.
        expected: String,
    },
    /// A tensor of another shape.
    #[error(
        "tensor {name}: expected {expected}, found {found}; an ego has SafeBench's obs_type 0, two hidden layers, two actions"
    )]
    Shape {
        /// Name of the tensor.
        name: String,
        /// Its shape, or that it is not there.
        found: String,
        /// The shape that fits.
        expected: String,
    },
    /// Weights that break the rules of weight files.
    #[error(transparent)]
    Weights(#[from] WeightsError),
}

/// Returns the file of weights with the actor of a checkpoint; `tensors` are names, shapes and numbers of its dictionary.
///
/// # Errors
/// An actor of another training, of other shapes, with numbers that are not finite.
pub fn weights(tensors: &[(&str, &[usize], &[f32])]) -> Result<Vec<u8>, CheckpointError> {
    let has = |layer: &str| tensors.iter().any(|(name, ..)| name.strip_suffix(".weight") == Some(layer));
    let Some(layout) = LAYOUTS.iter().find(|layout| layout.layers.iter().chain(&layout.spread).all(|name| has(name)))
    else {
        let known = LAYOUTS.iter().map(|of| format!("{} ({})", of.trainings, of.layers.join(", ")));
        let mut names: Vec<&str> = tensors.iter().map(|(name, ..)| *name).take(8).collect();
        if tensors.len() > names.len() {
            names.push("..");
        }
        let expected = known.collect::<Vec<_>>().join(" or of ");
        return Err(CheckpointError::Layout { found: names.join(", "), expected });
    };
    let read = |layer: &str, inputs, outputs: Option<usize>| dense(tensors, layer, inputs, outputs);
    let [first, second, mean] = layout.layers;
    let first = read(first, Setting::Safebench2.length(), None)?;
    let second = read(second, first.outputs, None)?;
    let mean = read(mean, second.outputs, Some(ACTION))?;
    let spread = layout.spread.map(|name| read(name, second.outputs, Some(ACTION))).transpose()?;
    // A policy without a spread drives by its mean all the same.
    let spread = spread.unwrap_or_else(|| Dense::zeros(second.outputs, ACTION));
    let sign = if layout.is_right { -1.0 } else { 1.0 };
    let turned = |mean: &[f32], spread: &[f32]| [sign * mean[1], mean[0], spread[1], spread[0]];
    let rows = mean.weights.chunks_exact(ACTION).zip(spread.weights.chunks_exact(ACTION));
    let heads = Dense {
        inputs: second.outputs,
        outputs: 2 * ACTION,
        weights: rows.flat_map(|(mean, spread)| turned(mean, spread)).collect(),
        bias: turned(&mean.bias, &spread.bias).to_vec(),
    };
    let bytes = Weights::to_bytes(Setting::Safebench2, &Mlp { layers: vec![first, second, heads] })?;
    Weights::from_bytes(&bytes)?;
    Ok(bytes)
}

/// Returns a layer with so many inputs and, where that is given, outputs.
fn dense(
    tensors: &[(&str, &[usize], &[f32])],
    layer: &str,
    inputs: usize,
    outputs: Option<usize>,
) -> Result<Dense, CheckpointError> {
    let tensor = |end: &str, fits: &dyn Fn(&[usize]) -> bool, expected: String| {
        let name = format!("{layer}.{end}");
        let found = tensors.iter().find(|(known, ..)| *known == name);
        match found {
            Some((_, shape, values)) if fits(shape) => Ok((*shape, *values)),
            _ => {
                let found = found.map_or("none".to_string(), |(_, shape, _)| format!("{shape:?}"));
                Err(CheckpointError::Shape { name, found, expected })
            }
        }
    };
    let count = outputs.map_or("any".to_string(), |count| count.to_string());
    let fits =
        |shape: &[usize]| matches!(shape, [rows, columns] if *columns == inputs && outputs.is_none_or(|n| n == *rows));
    let (shape, weights) = tensor("weight", &fits, format!("the shape [{count}, {inputs}]"))?;
    let outputs = shape[0];
    let (_, bias) = tensor("bias", &|shape| shape == [outputs], format!("the shape [{outputs}]"))?;
    Ok(Dense { inputs, outputs, weights: transposed(weights, inputs), bias: bias.to_vec() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ego::Actor;

    type Tensors = Vec<(String, Vec<usize>, Vec<f32>)>;

    /// Makes an actor of these layers, each number another one.
    fn actor(layers: &[(&str, usize, usize)]) -> Tensors {
        let mut next = 0.0;
        let mut numbers = |count: usize| -> Vec<f32> {
            let one = |_| {
                next += 0.01;
                next
            };
            (0..count).map(one).collect()
        };
        let both = |(name, inputs, outputs): &(&str, usize, usize)| {
            let (weights, bias) = (numbers(inputs * outputs), numbers(*outputs));
            [
                (format!("{name}.weight"), vec![*outputs, *inputs], weights),
                (format!("{name}.bias"), vec![*outputs], bias),
            ]
        };
        layers.iter().flat_map(both).collect()
    }

    fn written(tensors: &Tensors) -> Result<Weights, CheckpointError> {
        let borrowed: Vec<_> =
            tensors.iter().map(|(name, shape, values)| (name.as_str(), &shape[..], &values[..])).collect();
        Ok(Weights::from_bytes(&weights(&borrowed)?).unwrap())
    }

    fn applied(weights: &Weights, seen: [f32; 4]) -> Vec<f32> {
        let (mut values, mut spare) = (seen.to_vec(), Vec::new());
        let Actor::Layers(actor, _) = &weights.actor else { panic!("layers") };
        actor.apply(&mut values, &mut spare);
        values
    }

    /// Returns the means as the checkpoint's own network gives them: rows are outputs.
    fn by_hand(tensors: &Tensors, seen: [f32; 4]) -> Vec<f32> {
        let layer = |x: &[f32], k: usize| -> Vec<f32> {
            let (rows, bias) = (&tensors[2 * k].2, &tensors[2 * k + 1].2);
            rows.chunks_exact(x.len())
                .zip(bias)
                .map(|(w, b)| b + w.iter().zip(x).map(|(w, x)| w * x).sum::<f32>())
                .collect()
        };
        let relu = |x: Vec<f32>| -> Vec<f32> { x.into_iter().map(|x| x.max(0.0)).collect() };
        layer(&relu(layer(&relu(layer(&seen, 0)), 1)), 2)
    }

    #[test]
    fn actions_change_places_and_steering_its_side_where_it_turned_right() {
        let seen = [0.5, -0.25, 6.0, 1.0];
        let layouts = [
            (vec![("net.0", 4, 3), ("net.2", 3, 3), ("mu_layer", 3, 2), ("log_std_layer", 3, 2)], 1.0),
            (vec![("pi.0", 4, 3), ("pi.2", 3, 5), ("pi.4", 5, 2)], 1.0),
            (vec![("fc1", 4, 3), ("fc2", 3, 6), ("fc_mu", 6, 2), ("fc_std", 6, 2)], -1.0),
        ];
        for (layers, side) in layouts {
            let tensors = actor(&layers);
            let (read, own) = (written(&tensors).unwrap(), by_hand(&tensors, seen));
            assert_eq!(read.setting, Setting::Safebench2);
            let acted = applied(&read, seen);
            assert!(
                (acted[0] - side * own[1]).abs() < 1e-4 && (acted[1] - own[0]).abs() < 1e-4,
                "{layers:?}: {acted:?}, {own:?}"
            );
        }
    }

    #[test]
    fn other_actors_are_refused_by_name_and_shape() {
        let refused = |layers: &[(&str, usize, usize)]| written(&actor(layers)).unwrap_err().to_string();
        let three = refused(&[("network.network.0", 4, 3), ("network.network.2", 3, 3)]);
        assert!(three.contains("network.network.0.weight") && three.contains("SAC of safe_rl (net.0"), "{three}");
        let eleven = refused(&[("pi.0", 11, 3), ("pi.2", 3, 3), ("pi.4", 3, 2)]);
        assert!(eleven.contains("pi.0.weight") && eleven.contains("[any, 4], found [3, 11]"), "{eleven}");
        let four = refused(&[("pi.0", 4, 3), ("pi.2", 3, 3), ("pi.4", 3, 4)]);
        assert!(four.contains("pi.4.weight") && four.contains("[2, 3], found [4, 3]"), "{four}");
        let mut tensors = actor(&[("pi.0", 4, 3), ("pi.2", 3, 3), ("pi.4", 3, 2)]);
        tensors[0].2[5] = f32::NAN;
        assert!(written(&tensors).unwrap_err().to_string().contains("NaN"));
        tensors.remove(1);
        assert!(written(&tensors).unwrap_err().to_string().contains("pi.0.bias: expected the shape [3], found none"));
    }
}
