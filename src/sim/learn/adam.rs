//! Adam (Kingma and Ba 2015) as in torch: no weight decay, no clipping.

use crate::kernel::num;

const BETA_1: f64 = 0.9;
const BETA_2: f64 = 0.999;
const EPSILON: f32 = 1e-8;

/// Moments of a list of parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct Adam {
    /// Steps so far.
    pub steps: u32,
    /// Mean of the gradients and of their squares, parameter by parameter.
    pub moments: Vec<[Vec<f32>; 2]>,
}

impl Adam {
    /// For parameters of these lengths.
    pub fn new<'a>(parameters: impl Iterator<Item = &'a Vec<f32>>) -> Adam {
        Adam { steps: 0, moments: parameters.map(|p| [vec![0.0; p.len()], vec![0.0; p.len()]]).collect() }
    }

    /// One step against the gradients.
    pub fn step<'a>(
        &mut self,
        parameters: impl Iterator<Item = &'a mut Vec<f32>>,
        gradients: impl Iterator<Item = &'a Vec<f32>>,
        rate: f64,
    ) {
        self.steps += 1;
        let (left_1, left_2) = (1.0 - num::powu(BETA_1, self.steps), 1.0 - num::powu(BETA_2, self.steps));
        let (step, root) = ((rate / left_1) as f32, left_2.sqrt() as f32);
        let (keep_1, take_1) = (BETA_1 as f32, (1.0 - BETA_1) as f32);
        let (keep_2, take_2) = (BETA_2 as f32, (1.0 - BETA_2) as f32);
        for ((parameter, gradient), [mean, square]) in parameters.zip(gradients).zip(&mut self.moments) {
            for (((p, g), m), s) in parameter.iter_mut().zip(gradient).zip(mean).zip(square) {
                *m = keep_1 * *m + take_1 * g;
                *s = keep_2 * *s + take_2 * g * g;
                *p -= step * (*m / (s.sqrt() / root + EPSILON));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_steps_are_those_of_the_formula() {
        let mut parameters = [vec![1.0_f32, -2.0]];
        let mut adam = Adam::new(parameters.iter());
        // The first step is the rate in the direction of the gradient, whatever its size.
        adam.step(parameters.iter_mut(), [vec![0.5, -300.0]].iter(), 0.01);
        assert!((parameters[0][0] - 0.99).abs() < 1e-6 && (parameters[0][1] + 1.99).abs() < 1e-6, "{parameters:?}");
        adam.step(parameters.iter_mut(), [vec![-0.5, -300.0]].iter(), 0.01);
        // Mean (0.045 - 0.05) / 0.19, root of (0.001 * 0.999 + 0.001) * 0.25 / 0.001999.
        let expected = 0.99 + 0.01 * (0.005 / 0.19) / 0.5;
        assert!((f64::from(parameters[0][0]) - expected).abs() < 1e-6, "{parameters:?}");
    }
}
