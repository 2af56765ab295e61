//! Why a scene cannot be simulated or an intervention cannot be carried out.

use crate::scene::TrackIx;

/// A refusal: the text names the place, what was expected and what to do.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SimError {
    /// The scene breaks a rule that the simulator relies on, at the named place of it.
    #[error("scene {scene}: {place}: {rule}; import the scene again or leave it out")]
    Scene {
        /// The scene's name.
        scene: String,
        /// Which part of the scene.
        place: String,
        /// The rule that it breaks.
        rule: &'static str,
    },
    /// An action of the intervention, counted from 0, cannot be carried out in this scene.
    #[error("action {action}: {rule}, found {found}; compile the intervention for this scene")]
    Action {
        /// Its place in the intervention, from 0.
        action: usize,
        /// The rule that it breaks.
        rule: &'static str,
        /// The value found instead.
        found: String,
    },
    /// Two actions move the same track.
    #[error("action {action}: track {track} already belongs to action {earlier}; one action a road user")]
    SameTrack {
        /// The second of the two, from 0.
        action: usize,
        /// The track that both move.
        track: TrackIx,
        /// The first of the two.
        earlier: usize,
    },
    /// The ego is to repeat a recording that has no sample at this step of the scene.
    #[error(
        "scene {scene}: the replay ego needs a recorded motion, but the ego's log has no sample at step {step}; \
         use another ego policy"
    )]
    NoLog {
        /// The scene's name.
        scene: String,
        /// The step of the scene without a sample.
        step: usize,
    },
    /// The driver under test answered with a number that is not finite.
    #[error(
        "scene {scene}: the driver asked for {what} at step {step}, which is not finite; this is a fault of the driver"
    )]
    Driver {
        /// The scene's name.
        scene: String,
        /// The step of the scene at which it was asked.
        step: usize,
        /// Which number: an acceleration or a steering.
        what: &'static str,
    },
}
