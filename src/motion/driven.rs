//! A motion as a differentiable function of a decision vector.

use std::fmt::Debug;

use super::bicycle::State;
use super::kinematics::Slope;

/// A motion that a decision vector describes.
pub trait Driven: Debug + Send + Sync {
    /// The decision vector that follows the record.
    fn start(&self) -> &[f64];

    /// The state before the window and after each of its steps.
    fn states(&self, place: &[f64]) -> Vec<State>;

    /// The gradient at the decision vector, given the gradients at the states (chain rule).
    fn pull(&self, place: &[f64], states: &[State], slopes: &[Slope]) -> Vec<f64>;
}
