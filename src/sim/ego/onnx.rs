//! Reads a network as ONNX into a [`Graph`]: `f32`, a batch of one, the operators that an exported actor needs. Of each product the sum
//! begins with its bias and goes on in the order of the inputs, as in `network::Dense`; functions are those of `kernel::num`. What a file
//! asks for and is not read here (an operator, an attribute, numbers kept elsewhere) is refused by its name; only what the first output
//! does not need is passed over.

mod lowering;
#[cfg(test)]
mod tests;
mod wire;

use std::collections::{BTreeMap, BTreeSet};

use super::graph::{Cell, Graph};
use super::observation::{ACTION, Setting};
use super::weights_error::WeightsError;
use lowering::{Lowering, Value};
use wire::{COUNT_MAX, Fields, Kind, Node, Tensor, refused};

/// The entry of a file's properties that names its observation.
const KEY: &str = "evodrive.observation";

/// Whether bytes open as an ONNX file does: with its version. A safetensors file has its header's length in eight bytes there.
pub fn is_onnx(bytes: &[u8]) -> bool {
    bytes.first() == Some(&8) && bytes.get(4..8) != Some(&[0; 4])
}

/// What a file computes, and of which observation.
pub fn read(bytes: &[u8]) -> Result<(Setting, Graph), WeightsError> {
    let (mut graph, mut said) = (None, None);
    for field in Fields(bytes) {
        match field? {
            (7, held) => graph = Some(held.bytes()?),
            (14, held) => said = wire::property(held.bytes()?, KEY)?.or(said),
            _ => {}
        }
    }
    let (mut nodes, mut tensors, mut inputs, mut output) = (Vec::new(), BTreeMap::new(), Vec::new(), None);
    for field in Fields(graph.ok_or_else(|| refused("model", "no graph", "a whole ONNX file"))?) {
        match field? {
            (1, held) => nodes.push(Node::read(held.bytes()?)?),
            (5, held) => {
                let tensor = held.bytes()?;
                tensors.insert(wire::name(tensor, 8)?, tensor);
            }
            (11, held) => inputs.push(wire::input(held.bytes()?)?),
            (12, held) if output.is_none() => output = Some(wire::name(held.bytes()?, 1)?),
            _ => {}
        }
        if nodes.len().max(tensors.len()).max(inputs.len()) > COUNT_MAX {
            return Err(refused("graph", "more nodes, tensors or inputs", format!("at most {COUNT_MAX}")));
        }
    }
    let output = output.ok_or_else(|| refused("graph", "no output", "an action as the first one"))?;
    // Nodes stand behind those that they use.
    let mut needed = BTreeSet::from([output]);
    for node in nodes.iter_mut().rev() {
        node.is_needed = node.outputs.iter().any(|name| needed.contains(name));
        if node.is_needed {
            needed.extend(node.inputs.iter().copied());
        }
    }
    let (mut values, mut lowering, mut setting) = (BTreeMap::new(), Lowering::default(), None);
    inputs.retain(|(name, _)| needed.contains(name) && !tensors.contains_key(name));
    for (name, lengths) in inputs {
        let place = format!("input {name:?}");
        if setting.is_some() {
            return Err(refused(place, "a second input", "the observation alone"));
        }
        let of = observed(&place, &lengths, said)?;
        let mut shape = vec![1; lengths.len()];
        shape[lengths.len() - 1] = of.length();
        values.insert(name, lowering.seen(shape)?);
        setting = Some(of);
    }
    let setting = setting.ok_or_else(|| refused("graph", "no input that the first output needs", "the observation"))?;
    for (name, tensor) in tensors.into_iter().filter(|(name, _)| needed.contains(name)) {
        values.insert(name, lowering.kept(&Tensor::read(tensor)?)?);
    }
    for node in nodes.iter().filter(|node| node.is_needed) {
        let used = node.inputs.iter().map(|name| match values.get(name) {
            None if !name.is_empty() => Err(node.refused(format!("the input {name:?}"), "what was computed before")),
            value => Ok(value),
        });
        let used = used.collect::<Result<Vec<Option<&Value>>, _>>()?;
        let results = lowering.lower(node, &used)?;
        values.extend(node.outputs.iter().copied().zip(results));
    }
    let place = format!("output {output:?}");
    let value = values.get(output).ok_or_else(|| refused(&place, "nothing", "what a node computes"))?;
    let action = <[Cell; ACTION]>::try_from(&value.cells[..]).ok().filter(|_| value.kind == Kind::Float);
    let action = action.ok_or_else(|| {
        let expected = "two f32, steering and pedal, which are cut to [-1, 1]";
        refused(&place, format!("{:?} numbers of shape {:?}", value.kind, value.shape), expected)
    })?;
    Ok((setting, Graph { steps: lowering.steps, action }))
}

/// The observation that an input takes: the one that the file names, or the latest of its width. A batch that is left open is of one.
fn observed(place: &str, lengths: &[Option<u64>], said: Option<&str>) -> Result<Setting, WeightsError> {
    let width = |of: &Setting| Some(Some(of.length() as u64));
    let fits = |of: &Setting| width(of) == lengths.last().copied() && said.is_none_or(|said| said == of.name());
    let is_row = lengths.iter().rev().skip(1).all(|length| length.unwrap_or(1) == 1);
    Setting::ALL.into_iter().rev().find(fits).filter(|_| is_row).ok_or_else(|| {
        let known = Setting::ALL.map(|of| format!("{} ({})", of.length(), of.name())).join(" or ");
        let lengths =
            lengths.iter().take(9).map(|length| length.map_or("any".to_string(), |length| length.to_string()));
        let named = said.map_or(String::new(), |said| format!(" as {KEY} = {said:?}"));
        let found = format!("[{}] numbers{named}", lengths.collect::<Vec<_>>().join(", "));
        refused(place, found, format!("one row of an observation: {known}; the property {KEY} tells which"))
    })
}
