//! Laws: an adversary's behaviour from a step on, as formulas over its observations at that step. Data like everything else of an
//! intervention: the simulator carries them out under the limits of its bicycle.
//!
//! Every formula is total (`kernel::total`): NaN is read as 0, and a value that is too large as the bound. The
//! result is clamped once more: the acceleration to that of brakes and engine, the offset to [`OFFSET_M_MAX`].

use serde::{Deserialize, Serialize};

use crate::kernel::Formula;

/// Largest offset, metres: two lanes. Larger ones are cut.
pub const OFFSET_M_MAX: f64 = 8.0;
/// Largest sideways speed of the line that is steered for, m/s.
pub const OFFSET_MPS_MAX: f64 = 2.0;
/// Time that stands for "never", s.
pub const NEVER_S: f64 = 20.0;
/// Distance that stands for "nobody near", metres.
pub const FAR_M: f64 = 50.0;
/// Distance that stands for "the paths never meet", metres.
pub const NO_CONFLICT_M: f64 = 200.0;

/// An adversary's behaviour from a step on. Places in its formulas are those of [`Observed::ALL`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Law {
    /// The law takes over at the first decision step at which this is not 0, and stays; until then the samples are
    /// followed. Without it: at once.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub onset: Option<Formula>,
    /// Acceleration along its heading, m/s².
    pub acceleration: Formula,
    /// Offset to the left of the path of the samples that it aims at, metres; without it, the path itself.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub offset: Option<Formula>,
}

/// A value that an adversary observes at a decision step.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Observed {
    /// Time since the law took over, s; 0 before.
    SinceOnset,
    /// Its own speed, m/s.
    OwnSpeed,
    /// Distance to the left of the path of its samples, metres.
    OwnPathLeft,
    /// Distance to the left of the centre of the nearest lane of its direction, metres; 0 where none is near.
    OwnLaneOffset,
    /// Distance of its outermost corner off the road, metres.
    OwnOffRoad,
    /// Length of road beside its left flank, metres, in steps of 0.5 and at most 5.
    RoadLeft,
    /// The same beside its right flank.
    RoadRight,
    /// Acceleration that gives it the speed of its samples one step later, m/s².
    PlannedAcceleration,
    /// Distance box to box to the ego, metres.
    SeenGap,
    /// Speed at which the ego's centre comes nearer, m/s.
    SeenClosing,
    /// Time to collision with the ego at constant velocities, s; at most [`NEVER_S`].
    SeenTtc,
    /// The ego's speed, m/s.
    SeenEgoSpeed,
    /// Change of the ego's speed over its last step, m/s².
    SeenEgoAcceleration,
    /// The ego's heading relative to its own, radians, (-π, π].
    SeenEgoHeading,
    /// Distance of the ego's centre ahead of it, metres; negative behind.
    SeenEgoAhead,
    /// Distance of the ego's centre to its left, metres.
    SeenEgoLeft,
    /// The ego's way along its route to where both paths meet, metres; [`NO_CONFLICT_M`] where they never do.
    EgoToConflict,
    /// Its own way along its path to that place, metres; [`NO_CONFLICT_M`] likewise.
    OwnToConflict,
    /// Distance box to box to the nearest of all others but the ego, metres; at most [`FAR_M`].
    OthersGap,
    /// The same among those that are in its way ahead.
    OthersAheadGap,
    /// Index among the adversaries, from 0.
    AdversaryIndex,
    /// Number of adversaries.
    AdversaryCount,
}

impl Observed {
    /// All values, in the order of their places.
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

    /// Returns the word in expressions, which ends with the unit.
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

/// The values that a law reads: the others are left 0, because some cost time.
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
    /// Returns the fault, if it has one: a formula that reads a place at which nothing is observed.
    pub(in crate::sim) fn fault(&self) -> Option<(&'static str, String)> {
        let formulas = [self.onset.as_ref(), Some(&self.acceleration), self.offset.as_ref()];
        let beyond = formulas.into_iter().flatten().flat_map(Formula::loads).find(|p| *p >= Observed::ALL.len());
        beyond.map(|place| ("a law may read places 0 to 21, those of what is observed", place.to_string()))
    }
}
