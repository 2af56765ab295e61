//! Laws: what an adversary does from a step on, as formulas over what it observes then. Data like everything else of an
//! intervention: the simulator carries them out under the limits of its bicycle.
//!
//! Every formula is total (`kernel::total`): a value that is no number is read as 0, one that is too large as the bound. What
//! comes out is clamped once more: the acceleration to what brakes and engine give, the offset to [`OFFSET_M_MAX`].

use serde::{Deserialize, Serialize};

use crate::kernel::Formula;

/// An offset beyond this is cut, metres: two lanes.
pub const OFFSET_M_MAX: f64 = 8.0;
/// The line that is steered for moves sideways no faster than this, m/s.
pub const OFFSET_MPS_MAX: f64 = 2.0;
/// Time that stands for "never", s.
pub const NEVER_S: f64 = 20.0;
/// Distance that stands for "nobody near", metres.
pub const FAR_M: f64 = 50.0;
/// Distance that stands for "the paths never meet", metres.
pub const NO_CONFLICT_M: f64 = 200.0;

/// What an adversary does from a step on. Places in its formulas are those of [`Observed::ALL`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Law {
    /// The law takes over at the first decision step at which this is not 0, and stays; until then the samples are
    /// followed. Without it: at once.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub onset: Option<Formula>,
    /// Along its heading, m/s².
    pub acceleration: Formula,
    /// How far to the left of the path of the samples it aims to drive, metres; without it on that path.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub offset: Option<Formula>,
}

/// What an adversary observes at a decision step.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Observed {
    /// Time since the law took over, s; 0 before.
    SinceOnset,
    /// Its own speed, m/s.
    OwnSpeed,
    /// Left of the path of its samples, metres.
    OwnPathLeft,
    /// To the left of the centre of the nearest lane of its direction, metres; 0 where none is near.
    OwnLaneOffset,
    /// How far its outermost corner is off the road, metres.
    OwnOffRoad,
    /// How far the road goes on beside its left flank, metres, in steps of 0.5 and at most 5.
    RoadLeft,
    /// The same beside its right flank.
    RoadRight,
    /// What it takes to have the speed of its samples one step later, m/s².
    PlannedAcceleration,
    /// Distance box to box to the ego, metres.
    SeenGap,
    /// How fast the ego's centre comes nearer, m/s.
    SeenClosing,
    /// Time to collision with the ego at constant velocities, s; at most [`NEVER_S`].
    SeenTtc,
    /// The ego's speed, m/s.
    SeenEgoSpeed,
    /// Change of the ego's speed over its last step, m/s².
    SeenEgoAcceleration,
    /// The ego's heading relative to its own, radians, (-π, π].
    SeenEgoHeading,
    /// How far ahead of it the ego's centre is, metres; negative behind.
    SeenEgoAhead,
    /// How far to its left the ego's centre is, metres.
    SeenEgoLeft,
    /// The ego's way along its route to where both paths meet, metres; [`NO_CONFLICT_M`] where they never do.
    EgoToConflict,
    /// Its own way along its path to that place, metres; [`NO_CONFLICT_M`] likewise.
    OwnToConflict,
    /// Distance box to box to the nearest of all others but the ego, metres; at most [`FAR_M`].
    OthersGap,
    /// The same among those that are in its way ahead.
    OthersAheadGap,
    /// Which of the adversaries it is, from 0.
    AdversaryIndex,
    /// How many adversaries there are.
    AdversaryCount,
}

impl Observed {
    /// In the order of their places.
    pub const ALL: [Observed; 22] = [
        Observed::SinceOnset,
        Observed::OwnSpeed,
        Observed::OwnPathLeft,
        Observed::OwnLaneOffset,
        Observed::OwnOffRoad,
        Observed::RoadLeft,
        Observed::RoadRight,
        Observed::PlannedAcceleration,
        Observed::SeenGap,
        Observed::SeenClosing,
        Observed::SeenTtc,
        Observed::SeenEgoSpeed,
        Observed::SeenEgoAcceleration,
        Observed::SeenEgoHeading,
        Observed::SeenEgoAhead,
        Observed::SeenEgoLeft,
        Observed::EgoToConflict,
        Observed::OwnToConflict,
        Observed::OthersGap,
        Observed::OthersAheadGap,
        Observed::AdversaryIndex,
        Observed::AdversaryCount,
    ];

    /// The word in expressions; the unit stands last in it.
    pub fn name(self) -> &'static str {
        match self {
            Observed::SinceOnset => "since_onset_s",
            Observed::OwnSpeed => "own_speed_mps",
            Observed::OwnPathLeft => "own_path_left_m",
            Observed::OwnLaneOffset => "own_lane_offset_m",
            Observed::OwnOffRoad => "own_off_road_m",
            Observed::RoadLeft => "road_left_m",
            Observed::RoadRight => "road_right_m",
            Observed::PlannedAcceleration => "planned_acceleration_mps2",
            Observed::SeenGap => "seen_gap_m",
            Observed::SeenClosing => "seen_closing_mps",
            Observed::SeenTtc => "seen_ttc_s",
            Observed::SeenEgoSpeed => "seen_ego_speed_mps",
            Observed::SeenEgoAcceleration => "seen_ego_acceleration_mps2",
            Observed::SeenEgoHeading => "seen_ego_heading_rad",
            Observed::SeenEgoAhead => "seen_ego_ahead_m",
            Observed::SeenEgoLeft => "seen_ego_left_m",
            Observed::EgoToConflict => "ego_to_conflict_m",
            Observed::OwnToConflict => "own_to_conflict_m",
            Observed::OthersGap => "others_gap_m",
            Observed::OthersAheadGap => "others_ahead_gap_m",
            Observed::AdversaryIndex => "adversary_index",
            Observed::AdversaryCount => "adversary_count",
        }
    }
}

/// The values of [`Observed::ALL`].
pub type Observation = [f64; Observed::ALL.len()];

/// Which of them a law reads: the others are left 0, for some cost time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(in crate::sim) struct Reads(u32);

impl Reads {
    pub fn of(law: &Law) -> Reads {
        let formulas = [law.onset.as_ref(), Some(&law.acceleration), law.offset.as_ref()];
        let places = formulas.into_iter().flatten().flat_map(Formula::loads);
        Reads(places.filter(|place| *place < Observed::ALL.len()).fold(0, |reads, place| reads | 1 << place))
    }

    pub fn any(self, of: &[Observed]) -> bool {
        of.iter().any(|observed| self.0 & (1 << *observed as u32) != 0)
    }
}

impl Law {
    /// What is wrong with it: a formula that reads a place which nothing is observed at.
    pub(in crate::sim) fn fault(&self) -> Option<(&'static str, String)> {
        let formulas = [self.onset.as_ref(), Some(&self.acceleration), self.offset.as_ref()];
        let beyond = formulas.into_iter().flatten().flat_map(Formula::loads).find(|p| *p >= Observed::ALL.len());
        beyond.map(|place| ("a law may read places 0 to 21, those of what is observed", place.to_string()))
    }
}
