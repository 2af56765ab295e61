//! Networks over whole batches: forward passes that remember their layers, and the gradients behind them.

use crate::ego::network::{Dense, Mlp};
use crate::kernel::linear::{Product, transposed};

/// Data of a forward pass for the way back: the input of every layer, and the output of the last. Reused.
#[derive(Clone, Debug, Default)]
pub struct Pass {
    /// `activations[l]` is the input of layer `l`, rows of the batch one behind the other; the last is the output.
    activations: Vec<Vec<f32>>,
    product: Product,
}

impl Pass {
    /// Returns the network's output for a batch of inputs (rows one behind the other).
    pub fn forward(&mut self, network: &Mlp, input: &[f32]) -> &[f32] {
        let count = input.len() / network.inputs().max(1);
        self.activations.resize(network.layers.len() + 1, Vec::new());
        self.activations[0].clear();
        self.activations[0].extend_from_slice(input);
        for (l, layer) in network.layers.iter().enumerate() {
            let (before, after) = self.activations.split_at_mut(l + 1);
            let out = &mut after[0];
            out.clear();
            (0..count).for_each(|_| out.extend_from_slice(&layer.bias));
            self.product.of_rows(&before[l], layer.inputs).add_to(&layer.weights, layer.outputs, out);
            if l + 1 < network.layers.len() {
                out.iter_mut().for_each(|x| *x = x.max(0.0));
            }
        }
        &self.activations[network.layers.len()]
    }

    /// Adds the gradients of all parameters to `into`, given the loss's gradient by the output of the last forward pass.
    pub fn backward(&mut self, network: &Mlp, by_output: &[f32], into: &mut Mlp) {
        let mut by_output = by_output.to_vec();
        for l in (0..network.layers.len()).rev() {
            let (layer, gradient) = (&network.layers[l], &mut into.layers[l]);
            let input = &self.activations[l];
            self.product.of_columns(input, layer.inputs).add_to(&by_output, layer.outputs, &mut gradient.weights);
            for row in by_output.chunks_exact(layer.outputs) {
                gradient.bias.iter_mut().zip(row).for_each(|(sum, x)| *sum += x);
            }
            if l > 0 {
                by_output = self.through(layer, l, &by_output);
            }
        }
    }

    /// Returns the loss's gradient by the last `count` numbers of the input, given that by the output.
    pub fn backward_to_input(&mut self, network: &Mlp, by_output: &[f32], count: usize) -> Vec<f32> {
        let mut by_output = by_output.to_vec();
        for l in (1..network.layers.len()).rev() {
            by_output = self.through(&network.layers[l], l, &by_output);
        }
        let Some(first) = network.layers.first() else { return by_output };
        let wanted = &first.weights[(first.inputs - count) * first.outputs..];
        let mut by_input = vec![0.0; by_output.len() / first.outputs * count];
        let turned = transposed(wanted, first.outputs);
        self.product.of_rows(&by_output, first.outputs).add_to(&turned, count, &mut by_input);
        by_input
    }

    /// Returns the gradient by the input of a layer, zero where its ReLU was shut.
    fn through(&mut self, layer: &Dense, l: usize, by_output: &[f32]) -> Vec<f32> {
        let input = &self.activations[l];
        let mut by_input = vec![0.0; input.len()];
        let turned = transposed(&layer.weights, layer.outputs);
        self.product.of_rows(by_output, layer.outputs).add_to(&turned, layer.inputs, &mut by_input);
        by_input.iter_mut().zip(input).for_each(|(slope, x)| {
            if *x <= 0.0 {
                *slope = 0.0;
            }
        });
        by_input
    }
}

/// Returns a network of zeros in the shape of another, for its gradients.
pub fn zeros_like(network: &Mlp) -> Mlp {
    Mlp { layers: network.layers.iter().map(|layer| Dense::zeros(layer.inputs, layer.outputs)).collect() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernel::{Seed, num};
    use crate::learn::init::drawn;

    /// Returns a loss that depends on every output: the mean of weighted outputs and their squares.
    fn loss(output: &[f32]) -> f64 {
        num::sum(output.iter().enumerate().map(|(i, &x)| {
            let x = f64::from(x);
            (0.3 + 0.1 * i as f64) * x + 0.5 * x * x
        }))
    }

    fn slope(output: &[f32]) -> Vec<f32> {
        output.iter().enumerate().map(|(i, &x)| 0.3 + 0.1 * i as f32 + x).collect()
    }

    fn close(found: f32, expected: f64) -> bool {
        (f64::from(found) - expected).abs() < 2e-3 * (1.0 + expected.abs())
    }

    #[test]
    fn every_gradient_of_a_network_is_its_finite_difference() {
        let mut stream = Seed(5).stream(&["batch"]);
        let network = drawn(&[3, 6, 5, 2], &mut stream);
        let input: Vec<f32> = (0..4 * 3).map(|_| stream.uniform(-1.0, 1.0) as f32).collect();
        let mut pass = Pass::default();
        let by_output = slope(pass.forward(&network, &input));
        let mut gradient = zeros_like(&network);
        pass.backward(&network, &by_output, &mut gradient);
        let by_input = pass.backward_to_input(&network, &by_output, 2);
        let step = 1.0 / 512.0;
        let of = |network: &Mlp, input: &[f32]| loss(Pass::default().forward(network, input));
        for (l, layer) in gradient.layers.iter().enumerate() {
            let parts = [(&layer.weights, true), (&layer.bias, false)];
            for (found, i, is_weight) in
                parts.iter().flat_map(|(v, w)| v.iter().enumerate().map(move |(i, x)| (*x, i, *w)))
            {
                let moved = |by: f32| {
                    let mut moved = network.clone();
                    let layer = &mut moved.layers[l];
                    let values = if is_weight { &mut layer.weights } else { &mut layer.bias };
                    values[i] += by;
                    of(&moved, &input)
                };
                let expected = (moved(step) - moved(-step)) / (2.0 * f64::from(step));
                assert!(close(found, expected), "layer {l}, {i}: {found} for {expected}");
            }
        }
        for (place, &found) in by_input.iter().enumerate() {
            let moved = |by: f32| {
                let mut moved = input.clone();
                moved[place / 2 * 3 + 1 + place % 2] += by;
                of(&network, &moved)
            };
            let expected = (moved(step) - moved(-step)) / (2.0 * f64::from(step));
            assert!(close(found, expected), "input {place}: {found} for {expected}");
        }
    }
}
