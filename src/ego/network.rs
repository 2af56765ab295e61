//! Small networks of `f32`: dense layers with ReLU between them, evaluated in a fixed order of additions, so that one
//! observation gives one action on every machine.

use crate::kernel::num;

/// A dense layer. `weights` holds a row of outputs for each input, so that the sums of all outputs run side by side.
#[derive(Clone, Debug, PartialEq)]
pub struct Dense {
    /// Numbers in its input.
    pub inputs: usize,
    /// Numbers in its output.
    pub outputs: usize,
    /// `weights[i * outputs + o]`.
    pub weights: Vec<f32>,
    /// One an output.
    pub bias: Vec<f32>,
}

impl Dense {
    /// A layer of zeros.
    pub fn zeros(inputs: usize, outputs: usize) -> Dense {
        Dense { inputs, outputs, weights: vec![0.0; inputs * outputs], bias: vec![0.0; outputs] }
    }

    /// The layer applied to one input; `out` is set to it.
    pub fn apply(&self, input: &[f32], out: &mut Vec<f32>) {
        out.clear();
        out.extend_from_slice(&self.bias);
        for (&x, row) in input.iter().zip(self.weights.chunks_exact(self.outputs)) {
            // As in `kernel::linear`: zeros add nothing.
            if x != 0.0 {
                for (sum, w) in out.iter_mut().zip(row) {
                    *sum += x * w;
                }
            }
        }
    }
}

/// Layers with ReLU between them; the last one ends without.
#[derive(Clone, Debug, PartialEq)]
pub struct Mlp {
    /// From input to output.
    pub layers: Vec<Dense>,
}

impl Mlp {
    /// A network of zeros with these widths, from input to output.
    pub fn zeros(widths: &[usize]) -> Mlp {
        Mlp { layers: widths.windows(2).map(|w| Dense::zeros(w[0], w[1])).collect() }
    }

    /// Numbers in its input.
    pub fn inputs(&self) -> usize {
        self.layers.first().map_or(0, |layer| layer.inputs)
    }

    /// Numbers in its output.
    pub fn outputs(&self) -> usize {
        self.layers.last().map_or(0, |layer| layer.outputs)
    }

    /// Evaluates one input; the result lies in `values`, and `spare` is room for the layers between.
    pub fn apply(&self, values: &mut Vec<f32>, spare: &mut Vec<f32>) {
        self.apply_with(|x| x.max(0.0), values, spare);
    }

    /// The same with another function between the layers.
    pub fn apply_with(&self, between: impl Fn(f32) -> f32, values: &mut Vec<f32>, spare: &mut Vec<f32>) {
        for (i, layer) in self.layers.iter().enumerate() {
            layer.apply(values, spare);
            if i + 1 < self.layers.len() {
                spare.iter_mut().for_each(|x| *x = between(*x));
            }
            std::mem::swap(values, spare);
        }
    }

    /// All parameters, layer by layer, weights before bias.
    pub fn parameters(&self) -> impl Iterator<Item = &Vec<f32>> {
        self.layers.iter().flat_map(|layer| [&layer.weights, &layer.bias])
    }

    /// [`Mlp::parameters`], to be changed.
    pub fn parameters_mut(&mut self) -> impl Iterator<Item = &mut Vec<f32>> {
        self.layers.iter_mut().flat_map(|layer| [&mut layer.weights, &mut layer.bias])
    }
}

/// The hyperbolic tangent of an `f32`: taken in `f64` and rounded once.
pub fn tanh(x: f32) -> f32 {
    num::tanh(f64::from(x)) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_network_computes_what_its_layers_say() {
        let first =
            Dense { inputs: 2, outputs: 3, weights: vec![1.0, 0.0, 1.0, 0.0, 1.0, -1.0], bias: vec![0.0, 0.5, 0.0] };
        let last = Dense { inputs: 3, outputs: 1, weights: vec![1.0, 2.0, 4.0], bias: vec![-0.25] };
        let network = Mlp { layers: vec![first, last] };
        let (mut values, mut spare) = (vec![0.25, -1.0], Vec::new());
        network.apply(&mut values, &mut spare);
        // Hidden: 0.25; relu(0.5 - 1); 0.25 + 1.
        assert_eq!(values, [0.25 + 4.0 * 1.25 - 0.25]);
    }
}
