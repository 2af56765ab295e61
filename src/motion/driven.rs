//! A motion as a differentiable function of a decision vector.

use std::fmt::Debug;

use super::bicycle::State;
use super::kinematics::{Controls, Slope};

/// A motion with what led to it.
#[derive(Clone, Debug, PartialEq)]
pub struct Drive {
    /// One a step of the window.
    pub controls: Vec<Controls>,
    /// The state before the window and after each of its steps.
    pub states: Vec<State>,
}

/// A motion that a decision vector describes.
pub trait Driven: Debug + Send + Sync {
    /// The decision vector that follows the record.
    fn start(&self) -> &[f64];

    /// The motion of a decision vector.
    fn drive(&self, place: &[f64]) -> Drive;

    /// The gradient at the decision vector, given the gradients at the states (chain rule).
    fn pull(&self, drive: &Drive, slopes: &[Slope]) -> Vec<f64>;
}
