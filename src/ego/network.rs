//! A small multi-layer perceptron with frozen weights, read from bytes and evaluated in a fixed order of additions, so
//! that one observation gives one action on every machine.
//!
//! Format (all little-endian): the 8 bytes `EVOMLP\0\x01`; `u32` number of layers n; n + 1 `u32` widths from input to
//! output; then for each layer its weights as `f64`, one output's row after the other, and its biases as `f64`.
//! Nothing follows. Every layer ends in tanh, the last one too.

use std::sync::Arc;

use crate::kernel::{Digest, num};

const MAGIC: &[u8; 8] = b"EVOMLP\0\x01";
const LAYERS_MAX: usize = 8;
const WIDTH_MAX: usize = 1024;

/// Why bytes cannot be read as a network.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("weights, byte {at}: {rule}; train or export the network again")]
pub struct NetworkError {
    /// Byte offset of the first fault.
    pub at: usize,
    /// What was expected there.
    pub rule: &'static str,
}

/// Frozen weights.
#[derive(Clone, Debug, PartialEq)]
pub struct Network {
    widths: Vec<usize>,
    /// Per layer: rows of weights, then biases. Shared: every rollout and every situation holds a copy of its driver.
    layers: Arc<[Vec<f64>]>,
    digest: Digest,
}

struct Reader<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl Reader<'_> {
    fn take<const N: usize>(&mut self) -> Result<[u8; N], NetworkError> {
        let end = NetworkError { at: self.at, rule: "the file ends too early" };
        let found = self.bytes.get(self.at..).and_then(|rest| rest.first_chunk::<N>()).ok_or(end)?;
        self.at += N;
        Ok(*found)
    }

    fn number(&mut self, low: usize, high: usize, rule: &'static str) -> Result<usize, NetworkError> {
        let at = self.at;
        let found = u32::from_le_bytes(self.take()?) as usize;
        if (low..=high).contains(&found) { Ok(found) } else { Err(NetworkError { at, rule }) }
    }

    fn floats(&mut self, count: usize) -> Result<Vec<f64>, NetworkError> {
        // The count is compared with the bytes that are left before memory is allocated.
        if count > (self.bytes.len() - self.at) / 8 {
            return Err(NetworkError { at: self.at, rule: "the file ends too early" });
        }
        (0..count)
            .map(|_| {
                let at = self.at;
                let x = f64::from_le_bytes(self.take()?);
                if x.is_finite() { Ok(x) } else { Err(NetworkError { at, rule: "every weight must be finite" }) }
            })
            .collect()
    }
}

impl Network {
    /// Reads a network that takes `inputs` numbers and gives `outputs`.
    pub fn from_bytes(bytes: &[u8], inputs: usize, outputs: usize) -> Result<Network, NetworkError> {
        let mut reader = Reader { bytes, at: 0 };
        if reader.take::<8>()? != *MAGIC {
            return Err(NetworkError { at: 0, rule: "must begin with EVOMLP, 0, 1" });
        }
        let count = reader.number(1, LAYERS_MAX, "needs 1 to 8 layers")?;
        let widths = (0..=count)
            .map(|i| match i {
                0 => reader.number(inputs, inputs, "the first width must be that of the observation"),
                i if i == count => reader.number(outputs, outputs, "the last width must be that of the action"),
                _ => reader.number(1, WIDTH_MAX, "needs widths of 1 to 1024"),
            })
            .collect::<Result<Vec<usize>, NetworkError>>()?;
        let layers = widths
            .windows(2)
            .map(|w| reader.floats(w[1] * w[0] + w[1]))
            .collect::<Result<Vec<Vec<f64>>, NetworkError>>()?;
        if reader.at != bytes.len() {
            return Err(NetworkError { at: reader.at, rule: "nothing may follow the last bias" });
        }
        Ok(Network { widths, layers: layers.into(), digest: Digest::of_bytes(bytes) })
    }

    /// The bytes of a network with the given widths and layers (rows of weights, then biases).
    pub fn to_bytes(widths: &[usize], layers: &[Vec<f64>]) -> Vec<u8> {
        let mut bytes = MAGIC.to_vec();
        bytes.extend((layers.len() as u32).to_le_bytes());
        widths.iter().for_each(|&w| bytes.extend((w as u32).to_le_bytes()));
        layers.iter().flatten().for_each(|x| bytes.extend(x.to_le_bytes()));
        bytes
    }

    /// Digest of the bytes it was read from.
    pub fn digest(&self) -> Digest {
        self.digest
    }

    /// The widest layer: buffers of this size serve [`Network::evaluate`].
    pub fn width_max(&self) -> usize {
        self.widths.iter().copied().max().unwrap_or(0)
    }

    /// Evaluates in place: `values` holds the input at its front and the output afterwards; `spare` is scratch. Both
    /// must be [`Network::width_max`] long.
    pub fn evaluate(&self, values: &mut [f64], spare: &mut [f64]) {
        for (widths, layer) in self.widths.windows(2).zip(self.layers.iter()) {
            let (inputs, outputs) = (widths[0], widths[1]);
            let (weights, biases) = layer.split_at(inputs * outputs);
            for (out, (row, bias)) in spare.iter_mut().zip(weights.chunks_exact(inputs).zip(biases)) {
                let sum = row.iter().zip(values.iter()).fold(*bias, |sum, (w, x)| sum + w * x);
                *out = num::tanh(sum);
            }
            values[..outputs].copy_from_slice(&spare[..outputs]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_network_reads_back_and_computes_what_it_says() {
        let bytes = Network::to_bytes(
            &[2, 3, 1],
            &[vec![1.0, 0.0, 0.0, 1.0, 1.0, -1.0, 0.0, 0.5, 0.0], vec![1.0, 1.0, 1.0, -0.25]],
        );
        let network = Network::from_bytes(&bytes, 2, 1).unwrap();
        let (mut values, mut spare) = (vec![0.3, -0.2, 0.0], vec![0.0; 3]);
        network.evaluate(&mut values, &mut spare);
        let hidden = num::tanh(0.3) + num::tanh(0.5 - 0.2) + num::tanh(0.3 + 0.2);
        assert!((values[0] - num::tanh(hidden - 0.25)).abs() < 1e-15);
    }

    #[test]
    fn damaged_bytes_are_refused_wherever_they_are_damaged() {
        let bytes = Network::to_bytes(&[2, 2], &[vec![1.0; 6]]);
        assert!(Network::from_bytes(&bytes, 2, 2).is_ok());
        for end in 0..bytes.len() {
            assert!(Network::from_bytes(&bytes[..end], 2, 2).is_err(), "{end}");
        }
        let mut longer = bytes.clone();
        longer.push(0);
        assert!(Network::from_bytes(&longer, 2, 2).is_err());
        let mut huge = bytes.clone();
        huge[8..12].copy_from_slice(&u32::MAX.to_le_bytes());
        assert!(Network::from_bytes(&huge, 2, 2).is_err());
        let mut nan = bytes.clone();
        nan[20..28].copy_from_slice(&f64::NAN.to_le_bytes());
        assert_eq!(Network::from_bytes(&nan, 2, 2), Err(NetworkError { at: 20, rule: "every weight must be finite" }));
        assert!(Network::from_bytes(&bytes, 3, 2).is_err());
    }
}
