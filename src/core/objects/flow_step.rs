//! A step that a program takes with a scene.

use serde::Serialize;

/// One step, in the order in which a scene passes it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct FlowStep {
    /// How deep it stands: a step of one of two ways stands below the node in which they meet.
    pub depth: usize,
    /// Description of the step in words.
    pub says: String,
    /// True if the program to compare with has no such step, or one with other settings.
    pub is_new: bool,
}
