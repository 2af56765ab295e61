//! Plain gradient descent with restarts in the cube [-1, 1]^n, as AT's white-box attacker uses it: restarts drawn from
//! the cube, a fixed step, an end after 20 iterations without gain or at a slope that has nearly vanished.

use super::pso::Found;
use crate::kernel::Stream;

/// How the descent runs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlainDescent {
    /// How often it starts anew.
    pub restarts: usize,
    /// Gradient steps of each start.
    pub iterations: usize,
    /// Step per unit of slope.
    pub step: f64,
}

/// A restart ends after this many iterations without gain.
const IDLE_MAX: usize = 20;
/// A restart ends where the slope's absolute values sum to less.
const SLOPE_MIN: f64 = 0.1;

/// The best of every restart, smallest loss first; equal losses in the order of restarts. `loss` writes its slope.
///
/// The first restart begins at the centre of the cube (no perturbation), so that the result is never worse than it.
pub fn minimise(
    descent: &PlainDescent,
    dimensions: usize,
    stream: &mut Stream,
    mut loss: impl FnMut(&[f64], &mut [f64]) -> f64,
) -> Vec<Found> {
    let mut minima: Vec<Found> = Vec::with_capacity(descent.restarts);
    let mut slope = vec![0.0; dimensions];
    for restart in 0..descent.restarts.max(1) {
        let mut place: Vec<f64> =
            (0..dimensions).map(|_| if restart == 0 { 0.0 } else { stream.uniform(-1.0, 1.0) }).collect();
        let mut best: Option<Found> = None;
        let mut idle = 0;
        for _ in 0..=descent.iterations {
            let value = loss(&place, &mut slope);
            if best.as_ref().is_none_or(|b| value < b.loss) {
                best = Some(Found { place: place.clone(), loss: value });
                idle = 0;
            } else {
                idle += 1;
            }
            if idle > IDLE_MAX || slope.iter().map(|g| g.abs()).sum::<f64>() < SLOPE_MIN {
                break;
            }
            for (x, g) in place.iter_mut().zip(&slope) {
                *x = (*x - descent.step * g).clamp(-1.0, 1.0);
            }
        }
        minima.extend(best);
    }
    minima.sort_by(|a, b| a.loss.total_cmp(&b.loss));
    minima
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernel::Seed;

    const DESCENT: PlainDescent = PlainDescent { restarts: 4, iterations: 100, step: 0.02 };

    #[test]
    fn descent_finds_a_known_minimum_from_every_restart() {
        let goal = [0.3, -0.7, 0.1];
        let loss = |x: &[f64], slope: &mut [f64]| {
            (0..3).for_each(|k| slope[k] = 20.0 * (x[k] - goal[k]));
            (0..3).map(|k| 10.0 * (x[k] - goal[k]) * (x[k] - goal[k])).sum::<f64>()
        };
        let minima = minimise(&DESCENT, 3, &mut Seed(3).stream(&["descent"]), loss);
        assert_eq!(minima.len(), 4);
        assert!(minima.iter().all(|f| f.loss < 1e-2), "{minima:?}");
    }

    #[test]
    fn descent_never_ends_worse_than_no_perturbation_and_stays_in_the_cube() {
        let loss = |x: &[f64], slope: &mut [f64]| {
            assert!(x.iter().all(|v| v.abs() <= 1.0));
            slope.iter_mut().zip(x).for_each(|(g, x)| *g = 3.0 * x.signum());
            x.iter().map(|v| 3.0 * v.abs()).sum::<f64>()
        };
        assert_eq!(minimise(&DESCENT, 8, &mut Seed(4).stream(&["descent"]), loss)[0].loss, 0.0);
    }
}
