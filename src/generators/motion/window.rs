//! The steps of a scene at which a motion is changed.

/// The steps at which an actor's motion is changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Window {
    /// Scene step of the first changed sample.
    pub from_step: usize,
    /// Number of samples that are changed.
    pub steps: usize,
}
