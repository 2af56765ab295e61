//! The outcome of a rollout: events, distances and motion statistics. Metrics are computed from this alone.

use serde::{Deserialize, Serialize};

use super::driving::Driving;
use super::end::End;
use super::feasibility::Feasibility;
use super::of_kind::OfKind;
use super::of_place::OfPlace;
use crate::kernel::Digest;
use crate::scene::{AgentKind, Sample};
use crate::sim::encounters::class::ContactClass;
use crate::sim::encounters::fault::Fault;
use crate::sim::encounters::touch::{Side, Striker};
use crate::sim::encounters::verdict::Jury;
use crate::sim::road_users::intervention::ActorRef;

/// The labels of one closed-loop rollout.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Outcome {
    /// How the rollout ended.
    pub end: End,
    /// Decision steps simulated (0.1 s each).
    pub steps: usize,
    /// The ego's first contact with anyone.
    pub contact: Option<Contact>,
    /// Smallest box-to-box distance of the ego to an adversary (to anyone, if there is none), metres.
    pub distance_m_min: Option<f64>,
    /// Smallest time to collision of the ego with an adversary (to anyone, if there is none) at constant velocity, s.
    pub ttc_s_min: Option<f64>,
    /// Smallest time between the ego leaving and an adversary entering the same place, or the reverse, s.
    pub post_encroachment_s_min: Option<f64>,
    /// Share of the ego's route driven, 0..=1.
    pub route_completion: f64,
    /// Largest lateral distance of the ego from its route, metres.
    pub ego_lateral_m_max: f64,
    /// The ego's motion, over all steps.
    pub ego: Motion,
    /// One report an adversary, in the order of the intervention's actions.
    pub adversaries: Vec<AdversaryReport>,
    /// Digest of the full trace: two rollouts with one trace digest are the same rollout.
    pub trace: Digest,
    /// SafeBench's criteria; only for scenes of its traffic families, so that every other outcome stays as it was.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub driving: Option<Driving>,
}

/// The ego's first contact.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Contact {
    /// The road user that the ego touched.
    pub with: ActorRef,
    /// True if `with` is one of the intervention's adversaries.
    pub adversary: bool,
    /// Time since the first simulated step, s.
    pub time_s: f64,
    /// Norm of the difference of both velocities at the moment of contact, m/s.
    pub relative_speed_mps: f64,
    /// Direction of the other's motion relative to the ego's heading, (-π, π].
    pub impact_angle_rad: f64,
    /// The road user that ran into the other.
    pub striker: Striker,
    /// The side of the ego that was touched, seen from the ego.
    pub ego_side: Side,
    /// The side of the other that was touched, seen from the other.
    pub other_side: Side,
    /// The manner of the collision.
    pub class: ContactClass,
    /// Time before the contact at which the ego could first see it coming, s; `None` if it never could, or was not asked for.
    pub visible_s: Option<f64>,
    /// True if braking or swerving would have avoided it ([`assess`](crate::sim::assess)); `None` where that was not asked
    /// for: contacts with anyone but an adversary, and rollouts of searches.
    pub avoidable: Option<bool>,
    /// Fault by nuPlan's rule; only where `simulator.at_fault` asks for it, so that every other outcome stays as it was.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fault: Option<Fault>,
    /// Verdicts of drivers on avoiding it; only where `simulator.jury` asks for it, likewise.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub jury: Option<Jury>,
}

impl Contact {
    /// Returns `true` if a careful ego would have prevented it: by braking or swerving, and it is no ram from behind. `None` if not assessed.
    pub fn preventable(&self) -> Option<bool> {
        self.avoidable.map(|_| self.class.could_be_prevented(self.avoidable))
    }
}

/// Motion statistics over the simulated steps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Motion {
    /// Mean over time of the speed, m/s.
    pub speed_mps_mean: f64,
    /// Largest speed, m/s.
    pub speed_mps_max: f64,
    /// Largest increase of speed, m/s²; at least 0.
    pub acceleration_mps2_max: f64,
    /// Largest decrease of speed, m/s², as a positive number.
    pub deceleration_mps2_max: f64,
    /// Largest absolute product of speed and yaw rate, m/s².
    pub lateral_acceleration_mps2_max: f64,
    /// Largest absolute change of the acceleration along the motion, m/s³.
    pub jerk_mps3_max: f64,
    /// Largest absolute rate of turning, rad/s.
    pub yaw_rate_radps_max: f64,
    /// Length of the way, metres.
    pub distance_m: f64,
}

/// Data on one adversary that realism judges, over the steps up to the end of the rollout.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AdversaryReport {
    /// The road user of the rollout.
    pub actor: ActorRef,
    /// The sort of road user.
    pub kind: AgentKind,
    /// True if its motion differs from what replay shows: it was somewhere else by more than [`ACTED_M`] at a step, or
    /// was there when its recording is not.
    pub acted: bool,
    /// Its motion from the first step of the intervention on.
    pub motion: Motion,
    /// Feasibility of its motion from the first step of the intervention on.
    pub simulated: Feasibility,
    /// The same of its whole recording; `None` for inserted ones.
    pub recorded: Option<Feasibility>,
    /// True if it overlapped anyone at the first step of the intervention, where it had been moved.
    pub initial_overlap: bool,
    /// True if it touched a moving road user other than the ego, once it acted and before the rollout ended.
    pub struck_bystander: bool,
    /// True if it touched someone or something parked, likewise.
    pub struck_parked: bool,
    /// Distance along its recorded way at the end, as a share of its recording's distance, 0..=1; `None` where
    /// the recorded way is too short to count, and for inserted ones.
    pub route_completion: Option<f64>,
    /// Largest distance from its own logged position at the same time, metres (`None` for inserted ones).
    pub log_deviation_m_max: Option<f64>,
    /// Motion that its kind does not do; only where `simulator.of_kind` asks for it, so that every other outcome stays as it was.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub of_kind: Option<WithRecording<OfKind>>,
    /// Places where its kind does not belong; only where `simulator.of_place` asks for it, likewise.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub of_place: Option<WithRecording<OfPlace>>,
}

impl AdversaryReport {
    /// Returns the same with nothing known of its recording's faults.
    pub fn without_recording(&self) -> AdversaryReport {
        AdversaryReport {
            recorded: None,
            of_kind: self.of_kind.map(|of| WithRecording { recorded: None, ..of }),
            of_place: self.of_place.map(|of| WithRecording { recorded: None, ..of }),
            ..self.clone()
        }
    }
}

/// One road user's account, and that of its recording where it has one.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WithRecording<T> {
    /// Account from the first step of the intervention on.
    pub simulated: T,
    /// Account of its whole recording.
    pub recorded: Option<T>,
}

/// Distance from its recording up to which an adversary does what replay does, metres: places of recordings are no better.
pub const ACTED_M: f64 = 0.25;

impl Outcome {
    /// Returns `true` if the intervention changed what some adversary did.
    pub fn acted(&self) -> bool {
        self.adversaries.iter().any(|adversary| adversary.acted)
    }
}

/// The motion behind an outcome: one row a decision step, for players, exporters and audits.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Trace {
    /// First simulated step of the scene.
    pub from_step: usize,
    /// The ego, one sample a decision step; where it touched somebody within a step, that moment is the last.
    pub ego: Vec<Sample>,
    /// Everybody else: all tracks of the scene in their order, then those that the intervention added.
    pub actors: Vec<ActorTrace>,
}

/// The motion of one road user beside the ego.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ActorTrace {
    /// The road user.
    pub actor: ActorRef,
    /// Length of its box, metres.
    pub length_m: f64,
    /// Width of its box, metres.
    pub width_m: f64,
    /// True if it is one of the intervention's adversaries.
    pub adversary: bool,
    /// Samples, as many as in `Trace::ego`.
    pub samples: Vec<Option<Sample>>,
}
