//! A driver with frozen weights: observation, network, action. It takes the most likely action; nothing is drawn.

use std::sync::Arc;

use crate::sim::{Control, Driver, Plant, View};

use super::network::{Mlp, tanh};
use super::observation::Setting;
use super::weights::{Activation, Form, Squash, Weights};

/// Drives by a network.
#[derive(Clone, Debug)]
pub struct LearnedDriver {
    setting: Setting,
    form: Form,
    /// Means first; what stands behind them is for training.
    actor: Arc<Mlp>,
    values: Vec<f32>,
    spare: Vec<f32>,
}

impl LearnedDriver {
    /// A driver with these weights.
    pub fn new(weights: &Weights) -> LearnedDriver {
        let Weights { setting, form, ref actor, .. } = *weights;
        LearnedDriver { setting, form, actor: actor.clone(), values: Vec::new(), spare: Vec::new() }
    }
}

impl Driver for LearnedDriver {
    fn begin(&mut self, _: &Plant) {}

    fn decide(&mut self, view: &View<'_>) -> Control {
        self.setting.observe(view, &mut self.values);
        match self.form.activation {
            Activation::Relu => self.actor.apply(&mut self.values, &mut self.spare),
            Activation::Tanh => self.actor.apply_with(tanh, &mut self.values, &mut self.spare),
        }
        let action = [self.values[0], self.values[1]].map(|mean| match self.form.squash {
            Squash::Tanh => tanh(mean),
            Squash::Clip => mean.clamp(-1.0, 1.0),
        });
        self.setting.control(view, action)
    }
}
