//! What the reader of a format gives.

use crate::scene::{LeftOut, Scene};

/// What one file gave.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Imported {
    /// In the order of the file.
    pub scenes: Vec<Scene>,
    /// What was left out, with its reason.
    pub left_out: Vec<LeftOut>,
}
