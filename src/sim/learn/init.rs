//! The first weights of a network.

use crate::ego::network::Mlp;
use crate::kernel::Stream;

/// A network with weights and biases uniform within ±1/√inputs of their layer, as torch's linear layers begin.
pub fn drawn(widths: &[usize], stream: &mut Stream) -> Mlp {
    let mut network = Mlp::zeros(widths);
    for layer in &mut network.layers {
        let bound = 1.0 / (layer.inputs.max(1) as f64).sqrt();
        layer.weights.iter_mut().chain(&mut layer.bias).for_each(|x| *x = stream.uniform(-bound, bound) as f32);
    }
    network
}
