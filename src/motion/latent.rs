//! A linear-Gaussian latent space of motions: acceleration and curvature over time are those that follow the record,
//! plus cosine modes. The modes' coefficients are `mean + spread · z` with z standard normal.
//!
//! It replaces a learned variational motion prior. Mean and spread come from the candidates of the lane-graph prior:
//! the mean is what turns the record into the most probable candidate, the spread how far the others lie from it,
//! weighted by their probability. So z = 0 is the most probable motion, z of the record is known in closed form (its
//! coefficients are 0), and −log p(z) is a likelihood under the map, not a distance from the record.

use super::Candidate;
use super::Driven;
use super::bicycle::State;
use super::following;
use super::kinematics::{Controls, Curved, Slope, pull_back, unroll};
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
    mean: Vec<f64>,
    spread: Vec<f64>,
    /// z of the record.
    record: Vec<f64>,
}

impl LatentSpace {
    /// The space around a record, with mean and spread from candidates (without candidates the record is the mean).
    /// Candidates carry normalised log-probabilities, the most probable first.
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
        let found: Vec<Vec<f64>> = likely.iter().map(coefficients).collect();
        let mean = found.first().cloned().unwrap_or_else(|| vec![0.0; 2 * options.modes]);
        let floor = |k: usize| {
            if k < options.modes { options.acceleration_spread_mps2 } else { options.curvature_spread_1pm }
        };
        let spread_of = |k: usize| {
            let away = |(c, candidate): (&Vec<f64>, &Candidate)| {
                num::exp(candidate.prior_log_probability) * (c[k] - mean[k]) * (c[k] - mean[k])
            };
            (floor(k) * floor(k) + num::sum(found.iter().zip(likely).map(away))).sqrt()
        };
        let spread: Vec<f64> = (0..2 * options.modes).map(spread_of).collect();
        let record = mean.iter().zip(&spread).map(|(m, s)| -m / s).collect();
        LatentSpace { start, base, waves, mean, spread, record }
    }

    fn controls(&self, place: &[f64]) -> Vec<Controls> {
        let modes = self.waves.len();
        let mut controls = self.base.clone();
        for (m, wave) in self.waves.iter().enumerate() {
            let coefficient = |k: usize| self.mean[k] + self.spread[k] * place[k];
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

    fn states(&self, place: &[f64]) -> Vec<State> {
        unroll(&Curved::CAR, self.start, &self.controls(place), DT_S)
    }

    fn pull(&self, place: &[f64], states: &[State], slopes: &[Slope]) -> Vec<f64> {
        let pulled = pull_back(&Curved::CAR, states, &self.controls(place), slopes, DT_S);
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
    fn the_records_latent_gives_the_record_and_zero_the_most_probable_candidate() {
        let (start, samples) = record(10.0);
        let faster: Vec<Sample> = (0..80)
            .map(|k| {
                let t = (k + 1) as f64 * DT_S;
                let direction = Vec2::from_heading(0.2);
                let (way, speed) = (10.0 * t + 0.25 * t * t, 10.0 + 0.5 * t);
                Sample { position: direction * way, heading_rad: 0.2, velocity: direction * speed }
            })
            .collect();
        let likely = [Candidate::new(faster.clone(), -0.7), Candidate::new(samples.clone(), -0.7)];
        let space = LatentSpace::new(start, &samples, &likely, &OPTIONS);
        let end = |place: &[f64]| space.states(place)[80].position;
        assert!(end(space.start()).distance(samples[79].position) < 0.05);
        assert!(end(&[0.0; 8]).distance(faster[79].position) < 1.0, "{:?}", end(&[0.0; 8]));
        assert!(space.start()[0] < 0.0, "the record is slower than what is likely");
    }

    #[test]
    fn the_latents_slope_matches_finite_differences() {
        let (start, samples) = record(9.0);
        let space = LatentSpace::new(start, &samples, &[], &OPTIONS);
        let place = [0.3, -0.2, 0.4, 0.1, 0.5, -0.6, 0.2, 0.3];
        let value = |place: &[f64]| num::sum(space.states(place).iter().map(|s| s.position.x * 0.5 - s.position.y));
        let states = space.states(&place);
        let slopes = vec![Slope { position: Vec2::new(0.5, -1.0), ..Slope::default() }; states.len()];
        for (k, found) in space.pull(&place, &states, &slopes).into_iter().enumerate() {
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
