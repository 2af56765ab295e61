//! Published results of the SafeBench ports' searches: the control sequences of AdvSim and AT (`model_ckpt/{advsim,advtraj}`
//! of ChatScene, MIT, see `LICENSE-ChatScene`), ten of 100 numbers a traffic family. SafeBench runs all ten on each of its
//! ten routes (`scenario_type/advsim.json`); here a scene draws one of them, as it draws a member of Human's grid.

use crate::kernel::Stream;
use crate::motion::script_space::PROFILE_VALUES;
use crate::scene::safebench::TrafficFamily;

/// Sequences of a port for each traffic family.
const SEQUENCES: usize = 10;
/// Numbers by port, family, sequence and tick: 32-bit floats, the least significant byte first.
const NUMBERS: &[u8] = include_bytes!("control_sequences.f32");

/// Whose sequences.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Port {
    /// Speeds, as shares of twice the standard speed.
    AdvSim,
    /// Moves sideways: 0 is the bound to the left, 1 the bound to the right.
    Trajectory,
}

/// One of a port's sequences, `number` from 0 to 9.
pub fn sequence(port: Port, family: TrafficFamily, number: usize) -> Vec<f64> {
    let place =
        ((port as usize * TrafficFamily::ALL.len() + family.number() - 1) * SEQUENCES + number) * PROFILE_VALUES;
    let numbers = NUMBERS.chunks_exact(4).skip(place).take(PROFILE_VALUES);
    numbers.map(|bytes| f64::from(bytes.try_into().map_or(0.5, f32::from_le_bytes))).collect()
}

/// The one that a stream draws.
pub fn drawn(port: Port, family: TrafficFamily, stream: &mut Stream) -> Vec<f64> {
    let number = (stream.unit() * SEQUENCES as f64) as usize;
    sequence(port, family, number.min(SEQUENCES - 1))
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use crate::kernel::Seed;

    #[test]
    fn the_sequences_are_those_of_the_ports() {
        let first = |port, number: usize| sequence(port, TrafficFamily::ALL[number - 1], 0)[0];
        // The first number of numpy's stream of seed 1, with which AdvSim's search begins.
        assert!((first(Port::AdvSim, 1) - 0.417_022_004_702_574).abs() < 1e-7);
        assert!((first(Port::AdvSim, 3) - 0.537_007_116_840_540_7).abs() < 1e-7);
        assert!((first(Port::Trajectory, 1) - 0.648_987_834_433_03).abs() < 1e-7);
        assert!((first(Port::Trajectory, 8) - 0.017_115_501_050_406_823).abs() < 1e-7);
        // A first try that met the ego was kept, so families share what numpy drew: of 80 sequences a port this many differ.
        for (port, distinct) in [(Port::AdvSim, 51), (Port::Trajectory, 68)] {
            let places = TrafficFamily::ALL.into_iter().flat_map(|family| (0..SEQUENCES).map(move |k| (family, k)));
            let all: Vec<Vec<f64>> = places.map(|(family, number)| sequence(port, family, number)).collect();
            assert!(all.iter().all(|of| of.len() == PROFILE_VALUES && of.iter().all(|u| (0.0..=1.0).contains(u))));
            let bits = |of: &Vec<f64>| of.iter().map(|u| u.to_bits()).collect::<Vec<u64>>();
            assert_eq!(all.iter().map(bits).collect::<BTreeSet<_>>().len(), distinct, "{port:?}");
        }
        assert_eq!(NUMBERS.len(), 2 * 8 * SEQUENCES * PROFILE_VALUES * 4);
    }

    #[test]
    fn a_stream_draws_all_of_them() {
        let mut stream = Seed(1).stream(&["published"]);
        let known: Vec<_> = (0..SEQUENCES).map(|k| sequence(Port::Trajectory, TrafficFamily::RightTurn, k)).collect();
        let mut seen = [false; SEQUENCES];
        for _ in 0..200 {
            let found = drawn(Port::Trajectory, TrafficFamily::RightTurn, &mut stream);
            known.iter().zip(&mut seen).filter(|(known, _)| **known == found).for_each(|(_, seen)| *seen = true);
        }
        assert_eq!(seen, [true; SEQUENCES]);
    }
}
