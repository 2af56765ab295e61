//! A motion as a differentiable function of a decision vector.

use std::fmt::Debug;

use super::bicycle::State;
use super::kinematics::{Controls, Slope, Turn};
use crate::kernel::Vec2;

/// A motion with what led to it.
#[derive(Clone, Debug, PartialEq)]
pub struct Drive {
    /// One a step of the window.
    pub controls: Vec<Controls>,
    /// The state before the window and after each of its steps.
    pub states: Vec<State>,
    /// Intermediate values of each step, for its chain rule.
    pub turns: Vec<Turn>,
}

/// A motion that a decision vector describes.
pub trait Driven: Debug + Send + Sync {
    /// The decision vector that follows the record.
    fn start(&self) -> &[f64];

    /// The motion of a decision vector.
    fn drive(&self, place: &[f64]) -> Drive;

    /// Unit vector of a state's heading, where the model worked it out.
    fn axis(&self, _drive: &Drive, _state: usize) -> Option<Vec2> {
        None
    }

    /// The gradient at the decision vector, given the gradients at the states (chain rule).
    fn pull(&self, drive: &Drive, slopes: &[Slope]) -> Vec<f64>;
}
