//! The changes that a compiled program makes in the simulator: the only way to change a scene. It can move others, never
//! the ego, the road or the metrics.

use serde::{Deserialize, Serialize};

use super::law::Law;
use super::script::Script;
use crate::scene::{AgentKind, Sample, TrackIx};

/// Everything that is done to a scene in one rollout. Empty means plain log replay.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Intervention {
    /// Actions, one a road user; their order is that of the adversaries everywhere.
    pub actions: Vec<Action>,
}

/// One road user's changed behaviour. The road users of an intervention are called its adversaries.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Action {
    /// An existing track follows `samples` from `from_step` on (`samples[0]` lies at `from_step`); when they end
    /// it keeps its last velocity.
    Follow {
        /// The track, by its index in the scene.
        track: TrackIx,
        /// Step of the scene.
        from_step: usize,
        /// Samples, one a decision step, at least one.
        samples: Vec<Sample>,
    },
    /// A new road user appears at `from_step` and follows `samples`; it leaves when they end.
    Insert {
        /// The sort of road user.
        kind: AgentKind,
        /// Length of its box, metres, above 0 and at most 100.
        length_m: f64,
        /// Width of its box, metres, likewise.
        width_m: f64,
        /// Step of the scene.
        from_step: usize,
        /// Samples, one a decision step, at least one.
        samples: Vec<Sample>,
    },
    /// An existing track follows `samples` from `from_step`, then at `handover_step` turns reactive: every second it
    /// takes the motion primitive that brings it nearest to the ego (SEAL's skills).
    FollowThenReact {
        /// The track, by its index in the scene.
        track: TrackIx,
        /// Step of the scene.
        from_step: usize,
        /// Samples, one a decision step, at least one.
        samples: Vec<Sample>,
        /// Step of the scene, from `from_step` to the last.
        handover_step: usize,
    },
    /// An existing track follows `samples` from `from_step` until its law takes over; from then on it obeys the law along
    /// the path of the samples.
    FollowThenObey {
        /// The track, by its index in the scene.
        track: TrackIx,
        /// Step of the scene.
        from_step: usize,
        /// Samples, one a decision step, at least one.
        samples: Vec<Sample>,
        /// The law that it obeys from its onset on.
        law: Law,
    },
    /// A new road user stands somewhere from the first step on and does what its script says once the ego comes near
    /// (SafeBench's actors).
    Triggered(Script),
}

/// A road user of a rollout.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ActorRef {
    /// A track of the scene, by its index.
    Track(TrackIx),
    /// Index among the intervention's inserted road users.
    Inserted(usize),
}
