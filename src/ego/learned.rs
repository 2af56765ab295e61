//! A driver with frozen weights: observation, network, action. It takes the most likely action; nothing is drawn.

use std::sync::Arc;

use crate::sim::{Control, Driver, Plant, View};

use super::network::{Mlp, tanh};
use super::observation::Setting;

/// Drives by a network.
#[derive(Clone, Debug)]
pub struct LearnedDriver {
    setting: Setting,
    /// Means first; what stands behind them is for training.
    actor: Arc<Mlp>,
    values: Vec<f32>,
    spare: Vec<f32>,
}

impl LearnedDriver {
    /// A driver with these weights.
    pub fn new(setting: Setting, actor: Arc<Mlp>) -> LearnedDriver {
        LearnedDriver { setting, actor, values: Vec::new(), spare: Vec::new() }
    }
}

impl Driver for LearnedDriver {
    fn begin(&mut self, _: &Plant) {}

    fn decide(&mut self, view: &View<'_>) -> Control {
        self.setting.observe(view, &mut self.values);
        self.actor.apply(&mut self.values, &mut self.spare);
        self.setting.control(view, [tanh(self.values[0]), tanh(self.values[1])])
    }
}
