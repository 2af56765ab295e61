//! A driver with frozen weights: observation, network, action. It takes the most likely action; nothing is drawn.

use crate::sim::{Control, Driver, Plant, View};

use super::weights::Weights;

/// Drives by a network.
#[derive(Clone, Debug)]
pub struct LearnedDriver {
    weights: Weights,
    values: Vec<f32>,
    spare: Vec<f32>,
}

impl LearnedDriver {
    /// A driver with these weights.
    pub fn new(weights: &Weights) -> LearnedDriver {
        LearnedDriver { weights: weights.clone(), values: Vec::new(), spare: Vec::new() }
    }
}

impl Driver for LearnedDriver {
    fn begin(&mut self, _: &Plant) {}

    fn decide(&mut self, view: &View<'_>) -> Control {
        self.weights.setting.observe(view, &mut self.values);
        let action = self.weights.act(&mut self.values, &mut self.spare);
        self.weights.setting.control(view, action)
    }
}
