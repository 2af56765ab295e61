//! Why a fleet cannot be made, or does not drive.

use crate::sim::SimError;

/// A refusal.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FleetError {
    #[error("a fleet has {found} places; expected 1 to {most}")]
    Places { found: usize, most: usize },
    #[error("the share of program {set} is {found}; expected a number of at least 0")]
    Share { set: usize, found: f64 },
    #[error(
        "by_failure is {found}; expected 1 to {most}, which is how often a scene that fails comes up beside one that does not"
    )]
    ByFailure { found: f64, most: f64 },
    #[error("program {set} comes up and has no scene; give it the share 0, or a pool in which it can be planned")]
    NoTask { set: usize },
    #[error("no program has a share above 0; expected at least one")]
    NoShare,
    #[error("scene {scene} has no step to drive; leave it out")]
    NoStep { scene: String },
    #[error("place {place}: action[{which}] is {found}; expected a number from -1 to 1")]
    Action { place: usize, which: usize, found: f32 },
    #[error("a step before the first reset; call reset first")]
    NotBegun,
    #[error("place {place}: its episode is over; reset it before the next step")]
    Over { place: usize },
    #[error("place {place}: {source}")]
    Scene { place: usize, source: SimError },
    #[error("{what} {found} does not exist; expected a number below {below}")]
    Place { what: &'static str, found: usize, below: usize },
}
