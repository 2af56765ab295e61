//! Adam (Kingma and Ba 2015): gradient descent with running means of slope and squared slope.

use crate::kernel::num;

/// Step length and decays.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rates {
    /// Learning rate.
    pub rate: f64,
    /// β₁
    pub first_decay: f64,
    /// β₂
    pub second_decay: f64,
}

/// Avoids a division by zero for a gradient of zero.
const EPSILON: f64 = 1e-8;

/// The running means of one decision vector.
#[derive(Clone, Debug)]
pub struct Adam {
    rates: Rates,
    first: Vec<f64>,
    second: Vec<f64>,
    steps: u32,
}

impl Adam {
    /// A fresh state for a decision vector of this length.
    pub fn new(rates: Rates, dimensions: usize) -> Adam {
        Adam { rates, first: vec![0.0; dimensions], second: vec![0.0; dimensions], steps: 0 }
    }

    /// Moves the place one step down the slope.
    pub fn step(&mut self, place: &mut [f64], slope: &[f64]) {
        self.steps += 1;
        let Rates { rate, first_decay, second_decay } = self.rates;
        let (first_bias, second_bias) =
            (1.0 - num::powu(first_decay, self.steps), 1.0 - num::powu(second_decay, self.steps));
        for (k, g) in slope.iter().enumerate() {
            self.first[k] = first_decay * self.first[k] + (1.0 - first_decay) * g;
            self.second[k] = second_decay * self.second[k] + (1.0 - second_decay) * g * g;
            place[k] -= rate * (self.first[k] / first_bias) / ((self.second[k] / second_bias).sqrt() + EPSILON);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_step_has_the_length_of_the_rate_whatever_the_slope() {
        let mut adam = Adam::new(Rates { rate: 0.1, first_decay: 0.8, second_decay: 0.99 }, 2);
        let mut place = [1.0, 1.0];
        adam.step(&mut place, &[1000.0, -0.001]);
        assert!((place[0] - 0.9).abs() < 1e-6 && (place[1] - 1.1).abs() < 1e-6, "{place:?}");
    }

    #[test]
    fn adam_finds_the_minimum_of_a_narrow_valley() {
        let mut adam = Adam::new(Rates { rate: 0.05, first_decay: 0.9, second_decay: 0.999 }, 2);
        let mut place = [2.0, -1.0];
        for _ in 0..600 {
            let slope = [place[0] - 0.5, 100.0 * (place[1] - 0.25)];
            adam.step(&mut place, &slope);
        }
        assert!((place[0] - 0.5).abs() < 1e-2 && (place[1] - 0.25).abs() < 1e-2, "{place:?}");
    }
}
