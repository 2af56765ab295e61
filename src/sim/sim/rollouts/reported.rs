//! The motion of a rollout as a simulator reports it, ours or another one: where everyone was at each step, which road user the ego
//! touched first, and how it ended. `reenacted` judges it.

use serde::{Deserialize, Serialize};

use crate::kernel::Vec2;
use crate::scene::Sample;
use crate::sim::SimError;
use crate::sim::accounts::end::End;
use crate::sim::prepared::body::Place;
use crate::sim::prepared::plant::Plant;
use crate::sim::road_users::actors::scripted;
use crate::sim::road_users::intervention::{Action, ActorRef, Intervention};

/// Place of a road user, with the heading as an angle and as a unit vector: boxes are turned by the vector, and computing one
/// from the other rounds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// Position, heading and velocity.
    pub sample: Sample,
    /// Heading as a vector of length 1.
    pub axis: Vec2,
}

impl Pose {
    /// Makes a pose whose heading is reported as an angle alone.
    pub fn of(sample: Sample) -> Pose {
        Pose { axis: Vec2::from_heading(sample.heading_rad), sample }
    }

    pub(in crate::sim) fn place(&self) -> Place {
        Place { position: self.sample.position, axis: self.axis }
    }
}

/// The motion of one rollout. A row is a decision step; where the ego touched somebody within a step, the last row is that
/// moment.
#[derive(Clone, Debug, PartialEq)]
pub struct ReportedRollout {
    /// How the rollout ended.
    pub end: End,
    /// The ego's first contact; present exactly where `end` says so.
    pub contact: Option<ReportedContact>,
    /// The ego's pose in each row.
    pub ego: Vec<Pose>,
    /// The adversaries, and everyone else who left its recording, in the order in which they left it.
    pub actors: Vec<ReportedActor>,
    /// Decisions in our own simulator, one a step: acceleration (m/s²) and steering angle (rad). Empty where they were not reported.
    pub controls: Vec<[f64; 2]>,
}

/// The road user that the ego touched first. The moment of a contact is the one in which the boxes met, before any impact changed a
/// speed: class, striker and relative speed are those of two road users who are about to collide.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ReportedContact {
    /// The road user that the ego touched.
    pub with: ActorRef,
    /// The decision step in which they touched, from 0.
    pub step: usize,
    /// Number of its five physics steps after which they touched, 0..=5. A simulator without physics steps says 5.
    pub substep: usize,
    /// The boxes that the simulator collided; without them the contact is judged with those of our plant.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub boxes: Option<ContactBoxes>,
}

/// The boxes of a contact, each by length and width, metres.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ContactBoxes {
    /// Box of the ego.
    pub ego: [f64; 2],
    /// Box of the road user that it touched.
    pub other: [f64; 2],
}

/// A road user that does not follow its recording.
#[derive(Clone, Debug, PartialEq)]
pub struct ReportedActor {
    /// The road user.
    pub who: ActorRef,
    /// Its first row; before that it follows its recording. 0 for adversaries.
    pub from_step: usize,
    /// Poses from then on, one a row; `None` while it is not there.
    pub poses: Vec<Option<Pose>>,
}

impl ReportedActor {
    /// Returns its pose in a row.
    pub fn at(&self, row: usize) -> Option<&Pose> {
        self.poses.get(row.checked_sub(self.from_step)?).and_then(Option::as_ref)
    }
}

/// Returns the adversaries of an intervention, in the order of its actions.
pub fn adversaries_of(intervention: &Intervention) -> Vec<ActorRef> {
    let mut inserted = 0..;
    let who = |action: &Action| match action {
        Action::Follow { track, .. } | Action::FollowThenReact { track, .. } | Action::FollowThenObey { track, .. } => {
            ActorRef::Track(*track)
        }
        Action::Insert { .. } | Action::Triggered(_) => ActorRef::Inserted(inserted.next().unwrap_or(0)),
    };
    intervention.actions.iter().map(who).collect()
}

/// Returns the commands of an intervention to each of its adversaries at every simulated step; `None` while one is not there.
/// Adversaries that react have no commands: their actions must be lowered to samples first.
pub fn commands(plant: &Plant, intervention: &Intervention) -> Vec<Vec<Option<Sample>>> {
    let of = |action: &Action| (0..=plant.steps()).map(|k| scripted(plant, action, k)).collect();
    intervention.actions.iter().map(of).collect()
}

/// A reported motion that cannot be that of a rollout of the scene.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ReportedError {
    /// Our own simulator refuses the scene or the intervention.
    #[error(transparent)]
    Sim(#[from] SimError),
    /// Something in the reported motion, at the named place of it, is not what it must be.
    #[error("{place}: expected {expected}, found {found}")]
    Motion {
        /// Part of the reported motion.
        place: String,
        /// The expected value.
        expected: String,
        /// The value found.
        found: String,
    },
}
