//! The answer of a worker: the motion of a rollout, or why there is none. One JSON line.

use serde::{Deserialize, Deserializer, Serialize, Serializer, de::Error as _};

use crate::kernel::{Digest, Vec2};
use crate::scene::Sample;
use crate::sim::{ActorRef, End, Pose, ReportedActor, ReportedContact, ReportedRollout, Undriven};

/// The answer to a request.
#[derive(Clone, Debug, PartialEq)]
pub enum Answer {
    ReportedRollout(ReportedRollout),
    /// Why this rollout has no motion.
    Failed(Undriven),
}

impl Answer {
    /// Returns `true` if the same question has the same answer next time: a motion, or a scene that the driver abandoned.
    pub fn is_settled(&self) -> bool {
        matches!(self, Answer::ReportedRollout(_) | Answer::Failed(Undriven::Abandoned(_)))
    }
}

/// An answer as a line holds it. `end`, `ego` and `road_users` are there unless it failed.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct AnswerLine {
    pub request: Digest,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    failure: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    end: Option<End>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    contact: Option<ReportedContact>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    ego: Option<Vec<Numbers>>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    road_users: Option<Vec<UserLine>>,
    /// Decisions of a planner in our own simulator.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    controls: Vec<[f64; 2]>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct UserLine {
    who: ActorRef,
    from_step: usize,
    poses: Vec<Option<Numbers>>,
}

/// `[x, y, heading, vx, vy]`, with the two numbers of the heading's unit vector behind it where it is not exactly the
/// heading's: m, rad, m/s.
struct Numbers(Pose);

impl Serialize for Numbers {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let Pose { sample, axis } = self.0;
        let Sample { position, heading_rad, velocity } = sample;
        let seven = [position.x, position.y, heading_rad, velocity.x, velocity.y, axis.x, axis.y];
        let same = Pose::of(sample).axis == axis;
        serializer.collect_seq(&seven[..if same { 5 } else { 7 }])
    }
}

impl<'de> Deserialize<'de> for Numbers {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Numbers, D::Error> {
        let numbers = Vec::<f64>::deserialize(deserializer)?;
        let sample =
            |x, y, heading_rad, vx, vy| Sample { position: Vec2::new(x, y), heading_rad, velocity: Vec2::new(vx, vy) };
        match numbers[..] {
            [x, y, heading, vx, vy] => Ok(Numbers(Pose::of(sample(x, y, heading, vx, vy)))),
            [x, y, heading, vx, vy, ax, ay] => {
                Ok(Numbers(Pose { sample: sample(x, y, heading, vx, vy), axis: Vec2::new(ax, ay) }))
            }
            _ => Err(D::Error::custom(format!("a pose has 5 or 7 numbers, found {}", numbers.len()))),
        }
    }
}

impl AnswerLine {
    /// Returns the answer. The error says what is missing or too much in a line that holds neither a motion nor a failure.
    pub fn into_answer(self) -> Result<Answer, String> {
        match self {
            AnswerLine {
                failure: Some(reason),
                end: None,
                contact: None,
                ego: None,
                road_users: None,
                controls,
                ..
            } if controls.is_empty() => Ok(Answer::Failed(reason.into())),
            AnswerLine {
                failure: None,
                end: Some(end),
                contact,
                ego: Some(ego),
                road_users: Some(users),
                controls,
                ..
            } => {
                let ego = ego.into_iter().map(|numbers| numbers.0).collect();
                let pose = |numbers: Option<Numbers>| numbers.map(|numbers| numbers.0);
                let actor = |user: UserLine| ReportedActor {
                    who: user.who,
                    from_step: user.from_step,
                    poses: user.poses.into_iter().map(pose).collect(),
                };
                Ok(Answer::ReportedRollout(ReportedRollout {
                    end,
                    contact,
                    ego,
                    actors: users.into_iter().map(actor).collect(),
                    controls,
                }))
            }
            AnswerLine { failure: Some(_), .. } => Err("a motion beside a failure".into()),
            AnswerLine { end, ego, .. } => {
                let missing = if end.is_none() {
                    "end"
                } else if ego.is_none() {
                    "ego"
                } else {
                    "road_users"
                };
                Err(format!("no `{missing}`"))
            }
        }
    }

    pub fn of(request: Digest, answer: &Answer) -> AnswerLine {
        let (failure, end, contact, ego, road_users, controls) = (None, None, None, None, None, Vec::new());
        let nothing = AnswerLine { request, failure, end, contact, ego, road_users, controls };
        match answer {
            Answer::Failed(reason) => AnswerLine { failure: Some(reason.to_string()), ..nothing },
            Answer::ReportedRollout(rollout) => {
                let user = |actor: &ReportedActor| UserLine {
                    who: actor.who,
                    from_step: actor.from_step,
                    poses: actor.poses.iter().map(|pose| pose.map(Numbers)).collect(),
                };
                AnswerLine {
                    end: Some(rollout.end),
                    contact: rollout.contact,
                    ego: Some(rollout.ego.iter().copied().map(Numbers).collect()),
                    road_users: Some(rollout.actors.iter().map(user).collect()),
                    controls: rollout.controls.clone(),
                    ..nothing
                }
            }
        }
    }

    /// The line's bytes, without its end.
    pub fn to_bytes(&self) -> Vec<u8> {
        match serde_json::to_vec(self) {
            Ok(bytes) => bytes,
            Err(error) => unreachable!("texts, lists and numbers under text keys: {error}"),
        }
    }
}
