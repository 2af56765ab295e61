//! Results of a driver in the scenes of a suite.

use serde::{Deserialize, Serialize};

use super::fault::FaultKind;
use super::mark::{DriverMark, Selected, SuiteMark};
use crate::kernel::Digest;
use crate::sim::timeline_text::{manner, sentences};
use crate::sim::{ContactClass, End, Fault, Jury, Outcome, Timeline, avoided_in_words};

/// A driver in a suite.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SuiteResult {
    pub format: String,
    pub suite: SuiteMark,
    pub driver: DriverMark,
    /// Version of the simulator's meaning.
    pub simulator: u32,
    /// Cases that were asked for; results of format 1 do not say.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub selection: Option<Selected>,
    /// Files with the answers of a planner, beside this one.
    pub recordings: Vec<Recording>,
    /// Digest of all the rest, as it was written; `None` in results of format 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seal: Option<Digest>,
    /// Cases, in the order of the suite.
    pub cases: Vec<Played>,
}

/// Answers of a planner under rules of the suite.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Recording {
    /// Place of the rules in the suite.
    pub rules: usize,
    /// Name of the rollout cassette, which lies beside the result.
    pub file: String,
    /// Digest of its text, unpacked; results of format 1 do not say.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub digest: Option<Digest>,
}

/// One scene of the suite, and its outcome.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Played {
    pub case: String,
    pub scene: String,
    pub family: String,
    pub cluster: String,
    /// Class of the contact of the driver that was planned around.
    pub class: String,
    pub came: CaseOutcome,
    /// Realism of others' motion, 0 to 1, under the shipped MetaDrive protocol; `None` where nobody is moved, and in older results.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub realism: Option<f64>,
    /// Events that led to the contact; `None` where there is none, and in older results.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub timeline: Option<Timeline>,
}

/// Outcome of a scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum CaseOutcome {
    /// It was driven to an end.
    Driven(Drive),
    /// The planner gave no drive.
    Fault { kind: FaultKind, reason: String },
    /// The scene cannot be played with this driver.
    Unplayable { reason: String },
}

/// A drive to its end.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Drive {
    pub end: End,
    /// Share of the route, 0 to 1.
    pub completion: f64,
    /// Decisions of 0.1 s.
    pub steps: usize,
    pub contact: Option<Met>,
    /// Two drives with one trace are the same.
    pub trace: Digest,
}

/// The first contact.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Met {
    pub class: ContactClass,
    /// True if the road user is one that the program moves.
    pub adversary: bool,
    /// True if a careful ego would have avoided it; assessed for adversaries alone.
    pub avoidable: Option<bool>,
    /// Party at fault by nuPlan's rule; results of older releases do not say.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fault: Option<Fault>,
    /// Drivers that would have avoided it; results of older releases do not say.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub jury: Option<Jury>,
    /// Time from the first simulated step, s.
    pub time_s: f64,
    pub relative_speed_mps: f64,
}

impl Drive {
    /// Returns the drive of an outcome, with further knowledge of its contact.
    pub fn of(outcome: &Outcome, fault: Option<Fault>, jury: Option<Jury>) -> Drive {
        let met = |contact: &crate::sim::Contact| Met {
            class: contact.class,
            adversary: contact.adversary,
            avoidable: contact.avoidable,
            fault,
            jury,
            time_s: contact.time_s,
            relative_speed_mps: contact.relative_speed_mps,
        };
        Drive {
            end: outcome.end,
            completion: outcome.route_completion,
            steps: outcome.steps,
            contact: outcome.contact.as_ref().map(met),
            trace: outcome.trace,
        }
    }

    /// Returns `true` if a careful driver would have prevented its contact.
    pub fn is_preventable(&self) -> bool {
        self.contact.is_some_and(|met| met.class.could_be_prevented(met.avoidable))
    }

    /// Returns `true` if it is at fault for its contact by nuPlan's rule; `None` where the result does not say.
    pub fn is_at_fault(&self) -> Option<bool> {
        self.contact.map_or(Some(false), |met| met.fault.map(Fault::is_egos))
    }

    /// Returns the drive in a few words.
    pub fn in_words(&self) -> String {
        let completed = format!("{:.0} % of the route", 100.0 * self.completion);
        match (self.end, &self.contact) {
            (End::Contact, Some(met)) => {
                let whom = if met.adversary { "with the adversary" } else { "with a bystander" };
                let how = if self.is_preventable() { ", preventable" } else { "" };
                let how = format!("{how}{}", if self.is_at_fault() == Some(true) { ", at fault" } else { "" });
                let jury = met.jury.map(|of| format!(", {}", avoided_in_words([of.avoid(), of.of()])));
                let how = format!("{how}{}", jury.unwrap_or_default());
                format!(
                    "contact {whom} after {:.1} s at {:.1} m/s: {}{how}; {completed}",
                    met.time_s,
                    met.relative_speed_mps,
                    manner(met.class, None)
                )
            }
            (End::Contact, None) => format!("contact; {completed}"),
            (End::OffRoad, _) => format!("left its route; {completed}"),
            (End::Arrived, _) => format!("arrived; {completed}"),
            (End::Horizon, _) => format!("no contact up to the end; {completed}"),
        }
    }
}

impl CaseOutcome {
    /// Returns `true` if it equals what was said before; a result of an older release says nothing of faults.
    pub fn is_as_said(&self, said: &CaseOutcome) -> bool {
        match (self, said) {
            (CaseOutcome::Driven(drive), CaseOutcome::Driven(before)) => {
                let mut own = drive.clone();
                if let (Some(met), Some(said)) = (&mut own.contact, &before.contact) {
                    met.fault = met.fault.filter(|_| said.fault.is_some());
                    met.jury = met.jury.filter(|_| said.jury.is_some());
                }
                own == *before
            }
            _ => self == said,
        }
    }
}

impl Played {
    pub fn drive(&self) -> Option<&Drive> {
        match &self.came {
            CaseOutcome::Driven(drive) => Some(drive),
            CaseOutcome::Fault { .. } | CaseOutcome::Unplayable { .. } => None,
        }
    }

    /// Returns `true` for a contact with anyone.
    pub fn crashed(&self) -> bool {
        self.drive().is_some_and(|drive| drive.contact.is_some())
    }

    /// Returns `true` if it was driven without a contact and without leaving the route, however far it came.
    pub fn passed(&self) -> bool {
        self.drive().is_some_and(|drive| drive.contact.is_none() && drive.end != End::OffRoad)
    }

    /// Returns the events that led to the contact, in words.
    pub fn why(&self) -> Option<String> {
        self.timeline.as_ref().map(sentences)
    }

    pub fn in_words(&self) -> String {
        match &self.came {
            CaseOutcome::Driven(drive) => drive.in_words(),
            CaseOutcome::Fault { kind, reason } => format!("{}: {reason}", kind.name()),
            CaseOutcome::Unplayable { reason } => format!("cannot be played: {reason}"),
        }
    }
}

impl SuiteResult {
    pub fn case(&self, id: &str) -> Option<&Played> {
        self.cases.iter().find(|played| played.case == id)
    }
}
