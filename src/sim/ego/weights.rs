//! Weights of a learned driver as a file: ONNX, or safetensors, `f32`, named as in Stable-Baselines3's actor (a weight's rows are
//! its outputs), so that they can be read there too. The header says for which [`Setting`] they were trained.

use safetensors::tensor::{Dtype, SafeTensors, TensorView, serialize};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

use super::graph::Graph;
use super::network::{Dense, Mlp, elu, gelu, silu, tanh};
use super::observation::{ACTION, Setting};
use super::onnx;
use super::weights_error::WeightsError;
use crate::kernel::Digest;
use crate::kernel::linear::transposed;

/// The key of our line in a file's header.
const KEY: &str = "evodrive";
/// Largest width of a hidden layer.
const WIDTH_MAX: usize = 1024;

/// Frozen weights.
#[derive(Clone, Debug, PartialEq)]
pub struct Weights {
    /// Meaning of observations and actions.
    pub setting: Setting,
    /// Network from an observation to an action.
    pub actor: Actor,
    /// Digest of the file's bytes.
    pub digest: Digest,
}

/// A network from an observation to an action.
#[derive(Clone, Debug, PartialEq)]
pub enum Actor {
    /// Layers that give means, then logarithms of standard deviations.
    Layers(Arc<Mlp>, Form),
    /// The graph of an ONNX file.
    Graph(Arc<Graph>),
}

/// Functions that turn an actor's numbers into an action. Our own trainings use the default, which a file does not mention.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Form {
    /// Function between the layers.
    pub activation: Activation,
    /// Function from the means to an action.
    pub squash: Squash,
}

/// A function between layers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Activation {
    /// The larger of the number and 0.
    #[default]
    Relu,
    /// The hyperbolic tangent.
    Tanh,
    /// `e^x - 1` below 0.
    Elu,
    /// The number times the normal distribution's share below it.
    Gelu,
    /// The number times its logistic function.
    Silu,
}

/// A function from a mean to an action in [-1, 1].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Squash {
    /// The hyperbolic tangent, as in soft actor-critic.
    #[default]
    Tanh,
    /// Cut off, as in PPO.
    Clip,
}

/// Our line in the header.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Header {
    observation: String,
    #[serde(default, skip_serializing_if = "is_default")]
    activation: Activation,
    #[serde(default, skip_serializing_if = "is_default")]
    squash: Squash,
}

fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

/// Returns the name of a hidden layer, as of the layers of torch's `Sequential`: a function stands between each two.
fn hidden(i: usize) -> String {
    format!("latent_pi.{}", 2 * i)
}

/// Hidden layers that an actor may have.
const HIDDEN_MAX: usize = 8;
/// The two heads are one layer of the network.
const HEADS: [&str; 2] = ["mu", "log_std"];

impl Weights {
    /// Reads the bytes of a file.
    pub fn from_bytes(bytes: &[u8]) -> Result<Weights, WeightsError> {
        if onnx::is_onnx(bytes) {
            let (setting, graph) = onnx::read(bytes)?;
            return Ok(Weights { setting, actor: Actor::Graph(Arc::new(graph)), digest: Digest::of_bytes(bytes) });
        }
        let whole = "a whole safetensors file, or an ONNX file";
        let file = SafeTensors::deserialize(bytes).map_err(|error| WeightsError::new("header", error, whole))?;
        let (setting, form) = header(bytes)?;
        // Stable-Baselines3's whole policy holds the critics, too.
        let whole = if file.names().iter().any(|name| name.starts_with("actor.")) { "actor." } else { "" };
        let has = |i: &usize| file.tensor(&format!("{whole}{}.weight", hidden(*i))).is_ok();
        let trunk = (0..HIDDEN_MAX).take_while(has).count().max(1);
        let names: Vec<String> =
            (0..trunk).map(hidden).chain(HEADS.map(String::from)).map(|name| format!("{whole}{name}")).collect();
        let known: Vec<String> =
            names.iter().flat_map(|layer| [format!("{layer}.bias"), format!("{layer}.weight")]).collect();
        let is_critic = |name: &str| !whole.is_empty() && name.starts_with("critic");
        if let Some(odd) =
            file.names().into_iter().find(|name| !is_critic(name) && !known.iter().any(|known| known == name))
        {
            return Err(WeightsError::new(odd, "a tensor", format!("no other than {}", known.join(", "))));
        }
        let (mut layers, mut inputs) = (Vec::new(), setting.length());
        for name in &names[..trunk] {
            layers.push(layer(&file, name, inputs, width(&file, name)?)?);
            inputs = layers[layers.len() - 1].outputs;
        }
        let [mean, spread] = &names[trunk..] else {
            return Err(WeightsError::new("header", "no heads", HEADS.join(", ")));
        };
        layers.push(beside(&[layer(&file, mean, inputs, ACTION)?, layer(&file, spread, inputs, ACTION)?]));
        let actor = Mlp { layers };
        check(setting, &actor)?;
        Ok(Weights { setting, actor: Actor::Layers(Arc::new(actor), form), digest: Digest::of_bytes(bytes) })
    }

    /// Returns the action for the observation in `values`; `spare` is room.
    pub fn act(&self, values: &mut Vec<f32>, spare: &mut Vec<f32>) -> [f32; ACTION] {
        let (actor, form) = match &self.actor {
            Actor::Layers(actor, form) => (actor, form),
            Actor::Graph(graph) => return graph.act(values, spare),
        };
        match form.activation {
            Activation::Relu => actor.apply(values, spare),
            Activation::Tanh => actor.apply_with(tanh, values, spare),
            Activation::Elu => actor.apply_with(elu, values, spare),
            Activation::Gelu => actor.apply_with(gelu, values, spare),
            Activation::Silu => actor.apply_with(silu, values, spare),
        }
        [values[0], values[1]].map(|mean| match form.squash {
            Squash::Tanh => tanh(mean),
            Squash::Clip => mean.clamp(-1.0, 1.0),
        })
    }

    /// Returns the bytes of a file with an actor of one to eight hidden layers.
    ///
    /// # Errors
    /// An actor of another form.
    pub fn to_bytes(setting: Setting, actor: &Mlp) -> Result<Vec<u8>, WeightsError> {
        Weights::to_bytes_as(setting, actor, Form::default())
    }

    /// Returns a form by the names of its parts.
    ///
    /// # Errors
    /// A name that no part has.
    pub fn form(activation: &str, squash: &str) -> Result<Form, WeightsError> {
        let wrong = |key: &str, name: &str, expected: &str| WeightsError::new(key, format!("{name:?}"), expected);
        let activation = match activation {
            "relu" => Activation::Relu,
            "tanh" => Activation::Tanh,
            "elu" => Activation::Elu,
            "gelu" => Activation::Gelu,
            "silu" => Activation::Silu,
            other => return Err(wrong("activation", other, "relu, tanh, elu, gelu or silu")),
        };
        let squash = match squash {
            "tanh" => Squash::Tanh,
            "clip" => Squash::Clip,
            other => return Err(wrong("squash", other, "tanh or clip")),
        };
        Ok(Form { activation, squash })
    }

    /// Does the same as [`Weights::to_bytes`] for an actor that was trained elsewhere.
    ///
    /// # Errors
    /// An actor that [`Weights::from_bytes`] would refuse.
    pub fn to_bytes_as(setting: Setting, actor: &Mlp, form: Form) -> Result<Vec<u8>, WeightsError> {
        let (heads, trunk) = check(setting, actor)?;
        let heads = apart(heads);
        let names = (0..trunk.len()).map(hidden).chain(HEADS.map(String::from));
        let layers = names.zip(trunk.iter().chain(&heads));
        let mut tensors: Vec<(String, Vec<usize>, Vec<u8>)> = Vec::new();
        for (name, layer) in layers {
            let turned = transposed(&layer.weights, layer.outputs);
            tensors.push((format!("{name}.weight"), vec![layer.outputs, layer.inputs], bytes_of(&turned)));
            tensors.push((format!("{name}.bias"), vec![layer.outputs], bytes_of(&layer.bias)));
        }
        let failed =
            |error: &dyn std::fmt::Display| WeightsError::new("header", error, "something that can be written");
        let views = tensors
            .iter()
            .map(|(name, shape, data)| Ok((name, TensorView::new(Dtype::F32, shape.clone(), data)?)))
            .collect::<Result<Vec<_>, safetensors::SafeTensorError>>()
            .map_err(|error| failed(&error))?;
        let header = serde_json::to_string(&Header {
            observation: setting.name().to_string(),
            activation: form.activation,
            squash: form.squash,
        });
        let header = [(KEY.to_string(), header.map_err(|error| failed(&error))?)].into_iter().collect();
        serialize(views, Some(header)).map_err(|error| failed(&error))
    }
}

/// Returns the layers of an actor that a file can hold and that can drive a car: the rules for reading hold for writing, too.
fn check(setting: Setting, actor: &Mlp) -> Result<(&Dense, &[Dense]), WeightsError> {
    let Some((heads, trunk)) = actor.layers.split_last().filter(|(_, trunk)| (1..=HIDDEN_MAX).contains(&trunk.len()))
    else {
        let expected = format!("2 to {} layers", HIDDEN_MAX + 1);
        return Err(WeightsError::new("actor", format!("{} layers", actor.layers.len()), expected));
    };
    let mut inputs = setting.length();
    for (i, layer) in actor.layers.iter().enumerate() {
        let is_hidden = i < trunk.len();
        let name = if is_hidden { hidden(i) } else { HEADS[0].to_string() };
        let outputs = if is_hidden { check_width(&name, layer.outputs)? } else { 2 * ACTION };
        let numbers = (layer.inputs, layer.outputs, layer.weights.len(), layer.bias.len());
        if numbers != (inputs, outputs, inputs * outputs, outputs) {
            let found = format!(
                "{} inputs and {} outputs by {} weights and {} biases",
                numbers.0, numbers.1, numbers.2, numbers.3
            );
            let expected = format!("{inputs} inputs and {outputs} outputs, with their numbers");
            return Err(WeightsError::new(&name, found, expected));
        }
        if let Some(bad) = layer.weights.iter().chain(&layer.bias).find(|x| !x.is_finite()) {
            return Err(WeightsError::new(&name, format!("{bad} as a number"), "finite numbers"));
        }
        inputs = outputs;
    }
    Ok((heads, trunk))
}

/// Returns the outputs of a hidden layer, if it may have so many.
fn check_width(layer: &str, hidden: usize) -> Result<usize, WeightsError> {
    if (1..=WIDTH_MAX).contains(&hidden) {
        Ok(hidden)
    } else {
        Err(WeightsError::new(&format!("{layer}.bias"), format!("{hidden} numbers"), format!("1 to {WIDTH_MAX}")))
    }
}

/// Returns numbers as they lie in a file.
pub fn bytes_of(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|x| x.to_le_bytes()).collect()
}

/// Returns the numbers of a tensor of this shape; all must be finite.
pub fn floats(file: &SafeTensors<'_>, name: &str, shape: &[usize]) -> Result<Vec<f32>, WeightsError> {
    let expected = format!("f32 numbers of shape {shape:?}");
    let view = file.tensor(name).map_err(|_| WeightsError::new(name, "nothing", &expected))?;
    if view.dtype() != Dtype::F32 || view.shape() != shape {
        return Err(WeightsError::new(name, format!("{:?} of shape {:?}", view.dtype(), view.shape()), &expected));
    }
    let (chunks, _) = view.data().as_chunks::<4>();
    let values: Vec<f32> = chunks.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect();
    match values.iter().position(|x| !x.is_finite()) {
        Some(place) => Err(WeightsError::new(name, format!("{} as number {place}", values[place]), "finite numbers")),
        None => Ok(values),
    }
}

fn header(bytes: &[u8]) -> Result<(Setting, Form), WeightsError> {
    let known: Vec<&str> = Setting::ALL.iter().map(|setting| setting.name()).collect();
    let expected = format!("an observation of this version: {}", known.join(" or "));
    let refuse = |found: String| WeightsError::new("header", found, &expected);
    let (_, header) = SafeTensors::read_metadata(bytes).map_err(|error| refuse(error.to_string()))?;
    let line = header.metadata().as_ref().and_then(|lines| lines.get(KEY));
    let line = line.ok_or_else(|| refuse(format!("no line {KEY:?}")))?;
    let read: Header = serde_json::from_str(line).map_err(|error| refuse(error.to_string()))?;
    let setting = Setting::ALL.into_iter().find(|setting| setting.name() == read.observation);
    let setting = setting.ok_or_else(|| refuse(format!("observation {:?}", read.observation)))?;
    Ok((setting, Form { activation: read.activation, squash: read.squash }))
}

/// Returns the number of outputs of a hidden layer in a file.
fn width(file: &SafeTensors<'_>, layer: &str) -> Result<usize, WeightsError> {
    let bias = file.tensor(&format!("{layer}.bias"));
    check_width(layer, bias.map_or(0, |view| view.shape().first().copied().unwrap_or(0)))
}

fn layer(file: &SafeTensors<'_>, name: &str, inputs: usize, outputs: usize) -> Result<Dense, WeightsError> {
    let weights = floats(file, &format!("{name}.weight"), &[outputs, inputs])?;
    let bias = floats(file, &format!("{name}.bias"), &[outputs])?;
    Ok(Dense { inputs, outputs, weights: transposed(&weights, inputs), bias })
}

/// Joins two layers over the same inputs into one.
fn beside([first, second]: &[Dense; 2]) -> Dense {
    let rows = first.weights.chunks_exact(first.outputs).zip(second.weights.chunks_exact(second.outputs));
    Dense {
        inputs: first.inputs,
        outputs: first.outputs + second.outputs,
        weights: rows.flat_map(|(a, b)| [a, b].concat()).collect(),
        bias: [&first.bias[..], &second.bias].concat(),
    }
}

/// Splits a layer into halves by its outputs.
fn apart(both: &Dense) -> [Dense; 2] {
    let half = both.outputs / 2;
    [0, half].map(|from| Dense {
        inputs: both.inputs,
        outputs: half,
        weights: both.weights.chunks_exact(both.outputs).flat_map(|row| row[from..from + half].to_vec()).collect(),
        bias: both.bias[from..from + half].to_vec(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn actor() -> Mlp {
        let mut actor = Mlp::zeros(&[4, 3, 3, 2 * ACTION]);
        let mut next = 0.0;
        actor.parameters_mut().flatten().for_each(|x| {
            next += 0.125;
            *x = next;
        });
        actor
    }

    #[test]
    fn weights_read_back_as_they_were() {
        let bytes = Weights::to_bytes(Setting::Safebench1, &actor()).unwrap();
        let read = Weights::from_bytes(&bytes).unwrap();
        let Actor::Layers(read_actor, form) = &read.actor else { panic!("layers") };
        assert_eq!((read.setting, &**read_actor), (Setting::Safebench1, &actor()));
        assert_eq!(Weights::to_bytes_as(read.setting, read_actor, *form).unwrap(), bytes);
    }

    #[test]
    fn a_form_of_another_training_is_written_and_read_and_drives_otherwise() {
        let ppo = Weights::form("tanh", "clip").unwrap();
        let bytes = Weights::to_bytes_as(Setting::Safebench1, &actor(), ppo).unwrap();
        assert!(matches!(Weights::from_bytes(&bytes).unwrap().actor, Actor::Layers(_, form) if form == ppo));
        let plain = Weights::to_bytes(Setting::Safebench1, &actor()).unwrap();
        let is_said = |bytes: &[u8]| bytes.windows(10).any(|w| w == b"activation");
        assert!(is_said(&bytes) && !is_said(&plain), "files of our own trainings stay what they were");
        let refused = [Weights::form("swish", "clip"), Weights::form("relu", "none")];
        assert!(refused.iter().all(|form| form.as_ref().is_err_and(|error| error.to_string().contains("expected"))));
    }

    #[test]
    fn an_actor_of_three_hidden_layers_acts_by_all_of_them_also_beside_its_critics() {
        let mut actor = Mlp::zeros(&[4, 3, 2, 3, 2 * ACTION]);
        for (i, x) in actor.parameters_mut().flatten().enumerate() {
            *x = (i * 7 % 11) as f32 / 16.0 - 0.25;
        }
        let mut expected = vec![0.5, -0.25, 1.5, 1.0];
        for (i, layer) in actor.layers.iter().enumerate() {
            let sum = |o: usize| {
                expected
                    .iter()
                    .enumerate()
                    .fold(layer.bias[o], |sum, (i, x)| sum + x * layer.weights[i * layer.outputs + o])
            };
            let sums: Vec<f32> = (0..layer.outputs).map(sum).collect();
            expected = if i < 3 { sums.into_iter().map(|x| x.max(0.0)).collect() } else { sums };
        }
        let bytes = Weights::to_bytes(Setting::Safebench2, &actor).unwrap();
        let act = |bytes: &[u8]| {
            let seen = &mut vec![0.5, -0.25, 1.5, 1.0];
            Weights::from_bytes(bytes).map(|weights| weights.act(seen, &mut Vec::new()))
        };
        assert_eq!(act(&bytes).unwrap(), [tanh(expected[0]), tanh(expected[1])]);
        // Stable-Baselines3's whole policy, by the names of its tensors; without the prefix a critic is no tensor of ours.
        let file = SafeTensors::deserialize(&bytes).unwrap();
        let header = [(KEY.to_string(), "{\"observation\":\"safebench-2\"}".to_string())];
        let whole = |prefix: &str, left_out: &str| {
            let own = file.tensors().into_iter().filter(|(name, _)| name != left_out);
            let all = own.clone().map(|(name, of)| (format!("{prefix}{name}"), of));
            let critics = own.take(1).map(|(name, of)| (format!("critic.{name}"), of));
            serialize(all.chain(critics), Some(header.clone().into())).unwrap()
        };
        assert_eq!(act(&whole("actor.", "")).unwrap(), act(&bytes).unwrap());
        assert!(act(&whole("", "")).unwrap_err().to_string().contains("critic."));
        let gap = act(&whole("actor.", "latent_pi.2.weight")).unwrap_err().to_string();
        assert!(gap.contains("actor.latent_pi.") && gap.contains("a tensor"), "{gap}");
    }

    #[test]
    fn damaged_weights_are_refused_with_layer_found_and_expected() {
        let bytes = Weights::to_bytes(Setting::Safebench1, &actor()).unwrap();
        for end in 0..bytes.len() {
            assert!(Weights::from_bytes(&bytes[..end]).is_err(), "{end}");
        }
        let refused = |bytes: &[u8]| Weights::from_bytes(bytes).unwrap_err().to_string();
        let mut nan = bytes.clone();
        let last = nan.len() - 4;
        nan[last..].copy_from_slice(&f32::NAN.to_le_bytes());
        assert!(refused(&nan).contains("NaN as number") && refused(&nan).contains("finite"), "{}", refused(&nan));
        let renamed = |from: &str, to: &str| {
            let at = bytes.windows(from.len()).position(|w| w == from.as_bytes()).unwrap();
            let mut bytes = bytes.clone();
            bytes[at..at + to.len()].copy_from_slice(to.as_bytes());
            refused(&bytes)
        };
        let older = renamed("safebench-1", "safebench-9");
        assert!(older.contains("\"safebench-9\"") && older.contains("metadrive-1 or safebench-1"), "{older}");
        let other = renamed("latent_pi.2.bias", "latent_pi.7.bias");
        assert!(other.contains("latent_pi.7.bias"), "{other}");
        // A file of the other observation, whose header says this one.
        let inputs = Setting::Metadrive1.length();
        let wide = Weights::to_bytes(Setting::Metadrive1, &Mlp::zeros(&[inputs, 3, 3, 4])).unwrap();
        let at = wide.windows(11).position(|w| w == b"metadrive-1").unwrap();
        let mut wide = [&wide[..at], b"safebench-1", &wide[at + 11..]].concat();
        let shape = refused(&wide);
        assert!(
            shape.contains("latent_pi.0.weight")
                && shape.contains(&format!("[3, {inputs}]"))
                && shape.contains("[3, 4]"),
            "{shape}"
        );
        wide.push(0);
        assert!(refused(&wide).contains("header"));
    }

    #[test]
    fn nothing_is_written_that_the_reader_refuses() {
        let refused = |actor: Mlp| Weights::to_bytes(Setting::Safebench1, &actor).unwrap_err().to_string();
        for widths in [&[4, 4][..], &[4; 11], &[5, 3, 3, 4], &[4, 3, 3, 2], &[4, 0, 0, 4], &[4, 1025, 1025, 4], &[]] {
            assert!(refused(Mlp::zeros(widths)).contains("expected"), "{widths:?}");
        }
        let changed = |change: fn(&mut Dense)| {
            let mut actor = actor();
            change(&mut actor.layers[1]);
            refused(actor)
        };
        assert!(changed(|layer| layer.weights[4] = f32::INFINITY).contains("latent_pi.2: found inf"));
        assert!(changed(|layer| layer.bias.clear()).contains("9 weights and 0 biases"));
        assert!(changed(|layer| layer.weights.push(0.0)).contains("10 weights"));
    }
}
