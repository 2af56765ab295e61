//! Small networks of `f32`: dense layers with ReLU between them, evaluated in a fixed order of additions, so that one
//! observation gives one action on every machine.

use crate::kernel::num;

/// Inputs whose zeros are looked for together.
const INPUTS_AT_ONCE: usize = 64;
/// Outputs whose sums stay in registers, where there are so many.
const OUTPUTS_AT_ONCE: usize = 32;

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
        self.append(input, out);
    }

    /// The same behind what `out` holds.
    pub fn append(&self, input: &[f32], out: &mut Vec<f32>) {
        let from = out.len();
        out.extend_from_slice(&self.bias);
        let rows = self.weights.chunks_exact(self.outputs * INPUTS_AT_ONCE);
        let last = rows.remainder();
        for (input, rows) in input.chunks(INPUTS_AT_ONCE).zip(rows.chain([last])) {
            // As in `kernel::linear`: zeros add nothing. Those that are left are listed first, so that no branch hangs on them later.
            let (mut listed, mut count) = ([0; INPUTS_AT_ONCE], 0);
            for (i, &x) in input.iter().enumerate() {
                listed[count] = i;
                count += usize::from(x != 0.0);
            }
            self.add(input, &listed[..count], rows, &mut out[from..]);
        }
    }

    /// Adds these inputs to the sums, one after the other, for as many outputs side by side as a processor has room for.
    fn add(&self, input: &[f32], listed: &[usize], rows: &[f32], out: &mut [f32]) {
        for (block, sums) in out.chunks_mut(OUTPUTS_AT_ONCE).enumerate() {
            let from = block * OUTPUTS_AT_ONCE;
            let of = |i: usize| &rows[i * self.outputs + from..];
            match sums.first_chunk_mut::<OUTPUTS_AT_ONCE>() {
                Some(sums) => {
                    let mut held = *sums;
                    for &i in listed {
                        let (x, row) = (input[i], of(i));
                        if let Some(row) = row.first_chunk::<OUTPUTS_AT_ONCE>() {
                            for (sum, w) in held.iter_mut().zip(row) {
                                *sum += x * w;
                            }
                        }
                    }
                    *sums = held;
                }
                None => {
                    for &i in listed {
                        for (sum, w) in sums.iter_mut().zip(of(i)) {
                            *sum += input[i] * w;
                        }
                    }
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

/// `e^x - 1` up to 0, and x above.
pub fn elu(x: f32) -> f32 {
    if x > 0.0 { x } else { (num::exp(f64::from(x)) - 1.0) as f32 }
}

/// The logistic function of an `f32`.
pub fn sigmoid(x: f32) -> f32 {
    num::sigmoid(f64::from(x)) as f32
}

/// `x sigmoid(x)`, rounded after each step as an ONNX file spells it.
pub fn silu(x: f32) -> f32 {
    x * sigmoid(x)
}

/// The error function of an `f32`.
pub fn erf(x: f32) -> f32 {
    (1.0 - num::erfc(f64::from(x))) as f32
}

/// `x` times the normal distribution's share below it, rounded after each step as torch exports it.
pub fn gelu(x: f32) -> f32 {
    x * (erf(x / std::f32::consts::SQRT_2) + 1.0) * 0.5
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernel::Seed;

    /// A layer as it is defined: each output the sum of its bias and its weighted inputs, one after the other.
    fn plainly(layer: &Dense, input: &[f32]) -> Vec<f32> {
        let of = |o: usize| {
            let weighted = input.iter().enumerate().filter(|(_, x)| **x != 0.0);
            weighted.fold(layer.bias[o], |sum, (i, x)| sum + x * layer.weights[i * layer.outputs + o])
        };
        (0..layer.outputs).map(of).collect()
    }

    #[test]
    fn layers_of_any_width_add_in_the_order_of_their_inputs() {
        let mut stream = Seed(9).stream(&["layers"]);
        for (inputs, outputs) in [(1, 1), (4, 2), (63, 31), (64, 32), (65, 33), (126, 128), (128, 4), (200, 100)] {
            let mut drawn = |count: usize, zeros: f64| -> Vec<f32> {
                let one = |_| if stream.chance(zeros) { 0.0 } else { stream.normal(0.0, 3.0) as f32 };
                (0..count).map(one).collect()
            };
            let layer = Dense { inputs, outputs, weights: drawn(inputs * outputs, 0.0), bias: drawn(outputs, 0.2) };
            for zeros in [0.0, 0.5, 1.0] {
                let (input, mut out) = (drawn(inputs, zeros), vec![7.0; 3]);
                layer.apply(&input, &mut out);
                assert_eq!(out, plainly(&layer, &input), "{inputs} to {outputs}");
            }
        }
    }

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
