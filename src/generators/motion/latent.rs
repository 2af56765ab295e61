//! A linear-Gaussian latent space of motions: acceleration and curvature over time are those that follow the record,
//! plus cosine modes. The modes' coefficients are `spread · z` with z standard normal.
//!
//! It replaces a learned variational motion prior, which was trained on recorded futures and so finds them likely: its
//! mean is the record. Its spread comes from the candidates of the lane-graph prior: how far they lie from the record,
//! weighted by their probability. So z = 0 is the record, −log p(z) grows more slowly the more the map leaves open, and
//! a motion that departs from its record faster than the map's other ways do is unlikely.

use super::bicycle::State;
use super::following;
use super::kinematics::{Controls, Curved, Slope, pull_back, unroll};
use super::{Candidate, Drive, Driven};
use crate::kernel::num;
use crate::scene::{DT_S, Sample};

/// Smallest spread of a coefficient, and how many modes there are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LatentOptions {
    /// Cosine modes of acceleration, and as many of curvature.
    pub modes: usize,
    /// Standard deviation of an acceleration, m/s².
    pub acceleration_spread_mps2: f64,
    /// Standard deviation of a curvature, 1/m.
    pub curvature_spread_1pm: f64,
}

/// Motions of one vehicle by latent.
#[derive(Clone, Debug)]
pub struct LatentSpace {
    start: State,
    base: Vec<Controls>,
    /// `waves[m][k] = cos(π m (k + ½) / n)`
    waves: Vec<Vec<f64>>,
    /// Acceleration modes, then curvature modes.
    spread: Vec<f64>,
    /// z of the record.
    record: Vec<f64>,
}

impl LatentSpace {
    /// The space around a record, with the spread of candidates, which carry normalised log-probabilities; without
    /// candidates it has the least spread.
    pub fn new(start: State, samples: &[Sample], likely: &[Candidate], options: &LatentOptions) -> LatentSpace {
        let base = following::controls(&Curved::CAR, start, samples);
        let n = base.len();
        let wave = |m: usize| (0..n).map(|k| num::cos(num::PI * m as f64 * (k as f64 + 0.5) / n as f64)).collect();
        let waves: Vec<Vec<f64>> = (0..options.modes).map(wave).collect();
        let coefficients = |candidate: &Candidate| {
            let samples = &candidate.samples[..n.min(candidate.samples.len())];
            let controls = following::controls(&Curved::CAR, start, samples);
            project(&waves, &base, &controls)
        };
        let latents: Vec<Vec<f64>> = likely.iter().map(coefficients).collect();
        let floor = |k: usize| {
            if k < options.modes { options.acceleration_spread_mps2 } else { options.curvature_spread_1pm }
        };
        let spread_of = |k: usize| {
            let away =
                |(c, candidate): (&Vec<f64>, &Candidate)| num::exp(candidate.prior_log_probability) * c[k] * c[k];
            (floor(k) * floor(k) + num::sum(latents.iter().zip(likely).map(away))).sqrt()
        };
        let spread: Vec<f64> = (0..2 * options.modes).map(spread_of).collect();
        let record = vec![0.0; 2 * options.modes];
        LatentSpace { start, base, waves, spread, record }
    }

    fn controls(&self, place: &[f64]) -> Vec<Controls> {
        let modes = self.waves.len();
        let mut controls = self.base.clone();
        for (m, wave) in self.waves.iter().enumerate() {
            let coefficient = |k: usize| self.spread[k] * place[k];
            let (acceleration, curvature) = (coefficient(m), coefficient(modes + m));
            for (control, w) in controls.iter_mut().zip(wave) {
                control[0] += acceleration * w;
                control[1] += curvature * w;
            }
        }
        controls
    }
}

/// Cosine coefficients of the difference of two controls.
fn project(waves: &[Vec<f64>], base: &[Controls], controls: &[Controls]) -> Vec<f64> {
    let count = base.len().min(controls.len()).max(1) as f64;
    let one = |which: usize, m: usize| {
        let share = if m == 0 { 1.0 } else { 2.0 } / count;
        let pairs = controls.iter().zip(base).zip(&waves[m]);
        share * num::sum(pairs.map(|((c, b), w)| (c[which] - b[which]) * w))
    };
    (0..2).flat_map(|which| (0..waves.len()).map(move |m| (which, m))).map(|(which, m)| one(which, m)).collect()
}

impl Driven for LatentSpace {
    fn start(&self) -> &[f64] {
        &self.record
    }

    fn drive(&self, place: &[f64]) -> Drive {
        let controls = self.controls(place);
        let (states, turns) = unroll(&Curved::CAR, self.start, &controls, DT_S);
        Drive { states, turns, controls }
    }

    fn pull(&self, drive: &Drive, slopes: &[Slope]) -> Vec<f64> {
        let pulled = pull_back(&Curved::CAR, &drive.states, &drive.turns, &drive.controls, slopes, DT_S);
        let modes = self.waves.len();
        let one = |k: usize| {
            let (which, wave) = (k / modes, &self.waves[k % modes]);
            self.spread[k] * num::sum(pulled.iter().zip(wave).map(|(p, w)| p[which] * w))
        };
        (0..2 * modes).map(one).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernel::Vec2;
    use crate::scene::fixture::straight;

    const OPTIONS: LatentOptions =
        LatentOptions { modes: 4, acceleration_spread_mps2: 1.05, curvature_spread_1pm: 0.01 };

    fn record(speed: f64) -> (State, Vec<Sample>) {
        let samples: Vec<Sample> = straight(81, Vec2::ZERO, 0.2, speed).into_iter().flatten().collect();
        (State::of(&samples[0]), samples[1..].to_vec())
    }

    #[test]
    fn zero_gives_the_record_and_what_the_map_leaves_open_is_likelier_than_what_it_does_not() {
        let (start, samples) = record(10.0);
        let faster: Vec<Sample> = (0..80)
            .map(|k| {
                let t = (k + 1) as f64 * DT_S;
                let direction = Vec2::from_heading(0.2);
                let (way, speed) = (10.0 * t + 0.5 * t * t, 10.0 + t);
                Sample { position: direction * way, heading_rad: 0.2, velocity: direction * speed }
            })
            .collect();
        let likely = [Candidate::new(faster, -0.7), Candidate::new(samples.clone(), -0.7)];
        let end = |space: &LatentSpace, place: &[f64]| space.drive(place).states[80].position;
        let narrow = LatentSpace::new(start, &samples, &[], &OPTIONS);
        let wide = LatentSpace::new(start, &samples, &likely, &OPTIONS);
        for space in [&narrow, &wide] {
            assert!(end(space, space.start()).distance(samples[79].position) < 0.05);
            assert_eq!(space.start(), [0.0; 8]);
        }
        // One spread of mean acceleration leads farther where somebody is expected to accelerate.
        let mut one = [0.0; 8];
        one[0] = 1.0;
        let far = |space: &LatentSpace| end(space, &one).distance(samples[79].position);
        assert!(far(&wide) > 1.1 * far(&narrow), "{} {}", far(&wide), far(&narrow));
    }

    #[test]
    fn the_latents_slope_matches_finite_differences() {
        let (start, samples) = record(9.0);
        let space = LatentSpace::new(start, &samples, &[], &OPTIONS);
        let place = [0.3, -0.2, 0.4, 0.1, 0.5, -0.6, 0.2, 0.3];
        let value =
            |place: &[f64]| num::sum(space.drive(place).states.iter().map(|s| s.position.x * 0.5 - s.position.y));
        let drive = space.drive(&place);
        let slopes = vec![Slope { position: Vec2::new(0.5, -1.0), ..Slope::default() }; drive.states.len()];
        for (k, found) in space.pull(&drive, &slopes).into_iter().enumerate() {
            let at = |step: f64| {
                let mut moved = place;
                moved[k] += step;
                value(&moved)
            };
            let difference = (at(1e-5) - at(-1e-5)) / 2e-5;
            assert!((difference - found).abs() < 1e-6 * (1.0 + difference.abs()), "{k}: {found} {difference}");
        }
    }
}
