//! Options of the generator, and its errors.

use serde::{Deserialize, Serialize};

use super::variation::{TrafficOptions, Variation};
use crate::kernel::Seed;

/// The worlds that can be generated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum WorldKind {
    /// Two to four lanes in one direction, one or two in the other.
    Straight,
    /// A two-way road with two bends.
    Curve,
    /// Four arms with traffic lights.
    SignalledCrossing,
    /// Four arms; the minor road has stop signs, or all four arms have.
    UnsignalledCrossing,
    /// Three arms with traffic lights.
    SignalledTee,
    /// Three arms; the minor road has stop signs.
    UnsignalledTee,
    /// An on-ramp whose acceleration lane ends.
    Merge,
    /// One circulating lane, three or four arms.
    Roundabout,
    /// The right-most lane ends.
    LaneDrop,
    /// A signalled crossing and an unsignalled T junction one block apart.
    Urban,
    /// A divided, gently winding motorway with an on-ramp.
    Highway,
}

impl WorldKind {
    /// All kinds, in the order in which a pool takes them.
    pub const ALL: [WorldKind; 11] = [
        WorldKind::Straight,
        WorldKind::Curve,
        WorldKind::SignalledCrossing,
        WorldKind::UnsignalledCrossing,
        WorldKind::SignalledTee,
        WorldKind::UnsignalledTee,
        WorldKind::Merge,
        WorldKind::Roundabout,
        WorldKind::LaneDrop,
        WorldKind::Urban,
        WorldKind::Highway,
    ];

    /// The name in scene ids and experiment files.
    pub fn name(self) -> &'static str {
        match self {
            WorldKind::Straight => "straight",
            WorldKind::Curve => "curve",
            WorldKind::SignalledCrossing => "signalled_crossing",
            WorldKind::UnsignalledCrossing => "unsignalled_crossing",
            WorldKind::SignalledTee => "signalled_tee",
            WorldKind::UnsignalledTee => "unsignalled_tee",
            WorldKind::Merge => "merge",
            WorldKind::Roundabout => "roundabout",
            WorldKind::LaneDrop => "lane_drop",
            WorldKind::Urban => "urban",
            WorldKind::Highway => "highway",
        }
    }

    /// Returns `true` for roads for motor vehicles only: no pedestrians, no cyclists, long lorries.
    pub(super) fn motorway(self) -> bool {
        matches!(self, WorldKind::Merge | WorldKind::LaneDrop | WorldKind::Highway)
    }
}

/// Size of the generated worlds and the filter that a scene must pass.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SynthOptions {
    /// The kinds that a pool takes in turn.
    pub kinds: Vec<WorldKind>,
    /// Samples per scene at 0.1 s, 2..=1200; 91 as in the Waymo Open Motion Dataset.
    pub steps: usize,
    /// Last sample of history, below `steps`; 10 as in the Waymo Open Motion Dataset.
    pub current_step: usize,
    /// Seconds simulated before the first sample, 0..=120, so that queues and platoons have formed.
    pub warm_up_s: f64,
    /// Road users wanted in a scene, ego included, 4..=2000; the real number lies near it.
    pub tracks_per_scene: usize,
    /// Share of them on foot in worlds with crosswalks, 0..=0.5.
    pub pedestrian_share: f64,
    /// Share of them on bicycles in worlds other than motorways, 0..=0.5.
    pub cyclist_share: f64,
    /// Metres that the ego must travel over the scene; 10 in CAT's selection of scenes.
    pub ego_travel_m_min: f64,
    /// Most seconds between the ego and the interacting vehicle using the same place.
    pub interaction_time_s_max: f64,
    /// Largest distance between the two boxes at their nearest, metres.
    pub interaction_gap_m_max: f64,
    /// Share of scenes, 0..=1, in which a vehicle that leads or follows in the ego's own lane may be the interacting
    /// one; the others look for one that crosses, merges or cuts in during the first half of the attempts.
    pub following_share: f64,
    /// Sub-seeds to try before giving up, 1..=1000.
    pub attempts_max: u32,
    /// Ranges of what varies from scene to scene; `tracks_per_scene` is then unused. Absent: nothing varies.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub traffic: Option<Box<TrafficOptions>>,
}

/// Why there is no scene.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SynthError {
    /// An option is out of its range.
    #[error("synth option `{field}` is {found}, expected {expected}; change it in the experiment file")]
    Option {
        /// Name of the option.
        field: &'static str,
        /// Its value.
        found: String,
        /// Values that it may have.
        expected: &'static str,
    },
    /// No simulated scene passed the filter.
    #[error(
        "{id}: no scene passed the filter in {attempts} attempts (the last: {last}); \
         raise `attempts_max` or relax the interaction limits"
    )]
    Filtered {
        /// Id of the scene that was wanted.
        id: String,
        /// Number of attempts.
        attempts: u32,
        /// Why the last one was not taken.
        last: Reject,
    },
}

/// Why a simulated scene was not taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Reject {
    /// Two road users overlap.
    #[error("the log is not consistent: two road users overlap")]
    Overlap,
    /// An acceleration or a yaw rate is out of bounds.
    #[error("the log is not consistent: an acceleration or yaw rate is out of bounds")]
    Motion,
    /// No road user could be the ego.
    #[error("no vehicle stayed in the scene and moved far enough to be the ego")]
    NoEgo,
    /// No road user interacted with the ego.
    #[error("nobody interacted with the ego")]
    NoInteraction,
}

impl SynthOptions {
    /// Refuses options that cannot give a scene, or that would take unbounded time or memory.
    pub fn check(&self) -> Result<(), SynthError> {
        let bad = |field, found: String, expected| Err(SynthError::Option { field, found, expected });
        let share = |x: f64| (0.0..=0.5).contains(&x);
        let positive = |x: f64| x.is_finite() && x > 0.0;
        if self.kinds.is_empty() {
            return bad("kinds", "empty".into(), "at least one kind of world");
        }
        if !(2..=1200).contains(&self.steps) {
            return bad("steps", self.steps.to_string(), "2..=1200");
        }
        if self.current_step + 1 >= self.steps {
            return bad("current_step", self.current_step.to_string(), "a step before the last one");
        }
        if !(0.0..=120.0).contains(&self.warm_up_s) {
            return bad("warm_up_s", self.warm_up_s.to_string(), "0..=120 s");
        }
        if !(4..=2000).contains(&self.tracks_per_scene) {
            return bad("tracks_per_scene", self.tracks_per_scene.to_string(), "4..=2000");
        }
        if !share(self.pedestrian_share) {
            return bad("pedestrian_share", self.pedestrian_share.to_string(), "0..=0.5");
        }
        if !share(self.cyclist_share) {
            return bad("cyclist_share", self.cyclist_share.to_string(), "0..=0.5");
        }
        if !self.ego_travel_m_min.is_finite() || self.ego_travel_m_min < 0.0 {
            return bad("ego_travel_m_min", self.ego_travel_m_min.to_string(), "a length of 0 m or more");
        }
        if !positive(self.interaction_time_s_max) {
            return bad("interaction_time_s_max", self.interaction_time_s_max.to_string(), "a time above 0 s");
        }
        if !positive(self.interaction_gap_m_max) {
            return bad("interaction_gap_m_max", self.interaction_gap_m_max.to_string(), "a length above 0 m");
        }
        if !(0.0..=1.0).contains(&self.following_share) {
            return bad("following_share", self.following_share.to_string(), "0..=1");
        }
        if !(1..=1000).contains(&self.attempts_max) {
            return bad("attempts_max", self.attempts_max.to_string(), "1..=1000");
        }
        match self.traffic.as_deref().and_then(TrafficOptions::fault) {
            Some((field, found)) => {
                bad(field, found, "two numbers in ascending order, within the key's range (`evodrive options`)")
            }
            None => Ok(()),
        }
    }

    /// Returns the traffic of one scene; `None` where it does not vary.
    pub(super) fn variation(&self, kind: WorldKind, seed: Seed, index: u32) -> Option<Variation<f64>> {
        self.traffic.as_deref().map(|traffic| traffic.drawn(seed, kind.name(), index))
    }
}
