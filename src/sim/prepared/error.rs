//! Why a scene cannot be simulated or an intervention cannot be carried out.

use crate::scene::TrackIx;

/// A refusal: the text names the place, what was expected and what to do.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SimError {
    #[error("scene {scene}: {place}: {rule}; import the scene again or leave it out")]
    Scene { scene: String, place: String, rule: &'static str },
    #[error("action {action}: {rule}, found {found}; compile the intervention for this scene")]
    Action { action: usize, rule: &'static str, found: String },
    #[error("action {action}: track {track} already belongs to action {earlier}; one action a road user")]
    SameTrack { action: usize, track: TrackIx, earlier: usize },
    #[error(
        "scene {scene}: the replay ego needs a recorded motion, but the ego's log has no sample at step {step}; \
         use another ego policy"
    )]
    NoLog { scene: String, step: usize },
    #[error(
        "scene {scene}: the driver asked for {what} at step {step}, which is not finite; this is a fault of the driver"
    )]
    Driver { scene: String, step: usize, what: &'static str },
}
