//! Counsel: which vehicles are advised to attack in a scene, and how that was found: a model proposes, the simulator
//! tries, the model reflects.

use serde::{Deserialize, Serialize};

use super::{attempt::Exchange, ids::LineageId};
use crate::kernel::{Digest, canon::CanonError};
use crate::scene::TrackIx;

/// The counsel as the compiler reads it, an input beside program, scene and ego.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Counsel {
    /// Vehicles that should attack together, the leader first. Empty if nobody is advised.
    pub attackers: Vec<TrackIx>,
    /// Numbers from 0 to 1 that a searched profile takes in place of its search, as a file of SafeBench gives them. Empty: it
    /// searches.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub profile: Vec<f64>,
}

impl Counsel {
    /// Returns the digest that is part of the keys of rollouts and trials that use the counsel.
    pub fn digest(&self) -> Result<Digest, CanonError> {
        Digest::of("evodrive/counsel/1", self)
    }

    /// Returns the rank of a vehicle among the advised attackers, from 1; `None` if it is not one of them.
    pub fn rank(&self, track: TrackIx) -> Option<usize> {
        self.attackers.iter().position(|attacker| *attacker == track).map(|place| place + 1)
    }
}

/// A vehicle that may attack, as a model sees it: its state at the last step of the history.
#[derive(Clone, Debug, PartialEq)]
pub struct Vehicle {
    /// Which track of the scene.
    pub track: TrackIx,
    /// The track's id in its scene, by which the model names it.
    pub id: String,
    /// Length of its box, metres.
    pub length_m: f64,
    /// Place along the ego's heading, positive ahead, and across it, positive to the left.
    pub ahead_m: f64,
    /// Place across the ego's heading, metres; positive to the left.
    pub left_m: f64,
    /// Gap between the two boxes, metres.
    pub gap_m: f64,
    /// Speed now, m/s.
    pub speed_mps: f64,
    /// Absolute difference to the ego's heading, 0..pi.
    pub heading_difference_rad: f64,
    /// Its lane as seen from the ego's.
    pub lane: LaneRelation,
    /// Gap over closing speed; `None` where the distance does not shrink.
    pub time_to_collision_s: Option<f64>,
    /// Its log crosses the ego's route.
    pub conflict: bool,
    /// One of its likely trajectories meets the ego's undisturbed rollout within a second.
    pub reach: bool,
    /// When it and the ego arrive at the first place that its log and the ego's undisturbed drive both touch, seconds after
    /// the history; `None` where they touch no such place.
    pub arrivals_s: Option<[f64; 2]>,
}

/// A place on the ego's undisturbed drive, seen from where it stands at the last step of the history.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EgoPlace {
    /// Seconds after the history.
    pub at_s: f64,
    /// Place along its first heading, metres.
    pub ahead_m: f64,
    /// Place across its first heading, metres; positive to the left.
    pub left_m: f64,
    /// Speed there, m/s.
    pub speed_mps: f64,
}

/// Whose lane a vehicle drives in, seen from the ego.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LaneRelation {
    /// The ego's, or one that leads into or out of it.
    Same,
    /// Beside it, in the same direction.
    Adjacent,
    /// Any other lane, or none.
    Other,
}

/// Why an attack failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Failure {
    /// Nobody came within ten metres of the ego.
    NeverClose,
    /// An attacker ran into a third road user.
    Blocked,
    /// The ego braked and let it pass.
    EgoYielded,
    /// The attacker reaches the place where the paths meet after the ego.
    Late,
    /// The attacker reaches that place before the ego.
    Early,
}

/// Result of a set of attackers in the simulator.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", tag = "ended")]
pub enum Trial {
    /// An attacker met the ego.
    Contact,
    /// It came near, or tried to, without contact.
    Missed {
        /// Why there was no contact.
        failure: Failure,
        /// Smallest distance of the ego to an attacker, metres; `None` where none was measured.
        distance_m_min: Option<f64>,
    },
    /// The program cannot attack with this set in this scene.
    Refused {
        /// Why the set could not be tried.
        reason: String,
    },
}

impl Trial {
    /// Returns 0 at contact, the smallest distance otherwise. Smaller is better.
    pub fn distance_m(&self) -> f64 {
        match self {
            Trial::Contact => 0.0,
            Trial::Missed { distance_m_min, .. } => distance_m_min.unwrap_or(f64::INFINITY),
            Trial::Refused { .. } => f64::INFINITY,
        }
    }

    /// Returns the result in one word; the next round is chosen by it.
    pub fn code(&self) -> &'static str {
        match self {
            Trial::Contact => "contact",
            Trial::Refused { .. } => "refused",
            Trial::Missed { failure, .. } => match failure {
                Failure::NeverClose => "never_close",
                Failure::Blocked => "blocked",
                Failure::EgoYielded => "ego_yielded",
                Failure::Late => "late",
                Failure::Early => "early",
            },
        }
    }
}

/// Source of a set of attackers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Proposer {
    /// The model named the set.
    Model,
    /// The family's own order, because the model's answer could not be used.
    Rules,
}

/// One round: a set of attackers and its result.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CounselRound {
    /// Ids of the tracks, the leader first.
    pub attackers: Vec<String>,
    /// Why, in the proposer's words.
    pub reason: String,
    /// Source of the set.
    pub proposed_by: Proposer,
    /// The simulator's result for it.
    pub trial: Trial,
}

/// How the counsel for one scene of one lineage was found.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Counselled {
    /// Lineage that it is for.
    pub lineage: LineageId,
    /// Scene that it is for.
    pub scene: String,
    /// Hash of the program that carried the proposals out: the lineage's parent without a search of its own.
    pub program: Digest,
    /// Every question that was asked, in order.
    pub exchanges: Vec<Exchange>,
    /// None where the scene has no vehicle that could attack.
    pub rounds: Vec<CounselRound>,
    /// Final advice.
    pub counsel: Counsel,
    /// Digest of the counsel, as it is used in keys.
    pub digest: Digest,
}

impl Counselled {
    /// `<lineage>/<scene>`: its name in commands.
    pub fn name(&self) -> String {
        format!("{}/{}", self.lineage, self.scene)
    }

    /// The round whose set became the counsel: the nearest, and among equals the earliest; `None` if no set could
    /// attack.
    pub fn chosen(&self) -> Option<&CounselRound> {
        let measured = self.rounds.iter().filter(|round| round.trial.distance_m().is_finite());
        measured.min_by(|a, b| a.trial.distance_m().total_cmp(&b.trial.distance_m()))
    }
}
