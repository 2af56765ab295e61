//! One planner process as the driver of a rollout: what it is told, and how its answers are read. `docs/EGOS.md` describes
//! the lines.

use std::time::Duration;

use serde::{Deserialize, Serialize};

use super::map_near::MapNear;
use super::workers::{Broken, Line, start_of};
use crate::kernel::{Seed, Vec2};
use crate::scene::{AgentKind, DT_S, Lane, LaneIx, LightState, StopSign};
use crate::sim::bicycle::Car;
use crate::sim::{ActorRef, Control, Driver, End, Plant, Seen, View};

/// How far a planner sees, metres between centres.
const SIGHT_M: f64 = 100.0;
/// Points of a trajectory that are looked at: half a second of them.
const POINTS_AHEAD: usize = 5;

/// What a planner is told.
#[derive(Serialize)]
#[serde(tag = "type", rename_all = "snake_case")]
enum Message<'a> {
    /// A rollout begins.
    Begin {
        scene: &'a str,
        dt_s: f64,
        /// For random numbers: the same in every rollout of a run.
        seed: u64,
        /// Decisions at most.
        steps: usize,
        target_speed_mps: Option<f64>,
        ego: CarLimits,
        route: &'a [Vec2],
        lanes: &'a [Lane],
        edges: &'a [Vec<Vec2>],
        crosswalks: &'a [Vec<Vec2>],
        stop_signs: &'a [StopSign],
        lights: Vec<LightPlace>,
    },
    /// A decision is asked for.
    Step {
        step: usize,
        time_s: f64,
        ego: EgoNow,
        neighbours: Vec<Neighbour>,
        lights: Vec<LightState>,
        /// Where the planner asked for it.
        #[serde(skip_serializing_if = "Option::is_none")]
        map: Option<MapNear>,
    },
    /// The rollout is over.
    End { end: End, steps: usize },
}

/// The ego's box and what the car can do.
#[derive(Serialize)]
struct CarLimits {
    length_m: f64,
    width_m: f64,
    steering_rad_max: f64,
    acceleration_mps2_max: f64,
    brake_mps2_max: f64,
    speed_mps_max: f64,
}

#[derive(Serialize)]
struct LightPlace {
    lane: LaneIx,
    stop_point: Vec2,
}

#[derive(Serialize)]
struct EgoNow {
    position: Vec2,
    heading_rad: f64,
    velocity: Vec2,
    speed_mps: f64,
    acceleration_mps2: f64,
    steering_rad: f64,
    /// Driven along the route, and beside it, positive to the left.
    route_s_m: f64,
    route_offset_m: f64,
}

#[derive(Serialize)]
struct Neighbour {
    who: ActorRef,
    kind: AgentKind,
    position: Vec2,
    heading_rad: f64,
    velocity: Vec2,
    length_m: f64,
    width_m: f64,
}

/// What it answers: controls, or where it wants to be 0.1 s, 0.2 s ... from now.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Answered {
    /// The step that it answers, where the planner says so.
    #[serde(default)]
    step: Option<usize>,
    #[serde(default)]
    acceleration_mps2: Option<f64>,
    #[serde(default)]
    steering_rad: Option<f64>,
    #[serde(default)]
    trajectory: Option<Vec<Vec2>>,
}

/// How long a line is waited for that nobody asked for, behind the last decision of a rollout.
const UNASKED: Duration = Duration::from_millis(20);

/// Why a planner drove no further.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Refusal {
    /// What is recorded: words of ours alone, the same in every folder and for every user.
    pub reason: String,
    /// What the process printed in place of an answer. It is shown, and not recorded.
    pub printed: String,
    /// Whether it took longer than it may.
    pub late: bool,
}

impl Refusal {
    fn of(reason: impl Into<String>, printed: &[u8]) -> Refusal {
        Refusal { reason: reason.into(), printed: start_of(printed), late: false }
    }

    fn broken(broken: &Broken, limit: Duration) -> Refusal {
        Refusal { late: *broken == Broken::Late, ..Refusal::of(why(broken, limit), b"") }
    }
}

/// A process that drives one rollout.
pub(super) struct Planner<'p> {
    line: &'p mut dyn Line,
    limit: Duration,
    seed: Seed,
    /// How far around the ego it is told the map, metres, where it asked for it.
    map_m: Option<f64>,
    /// What went wrong, and at which decision.
    broken: Option<Refusal>,
    /// Nobody waits for it any more; of the scene that says nothing.
    stopped: bool,
}

impl<'p> Planner<'p> {
    pub fn new(line: &'p mut dyn Line, limit: Duration, seed: Seed, map_m: Option<f64>) -> Planner<'p> {
        Planner { line, limit, seed, map_m, broken: None, stopped: false }
    }

    /// Whether it drove no further because nobody waits for it any more.
    pub fn was_stopped(&self) -> bool {
        self.stopped
    }

    /// Why it drove no further, if it did not.
    pub fn broken(self) -> Option<Refusal> {
        self.broken
    }

    fn say(&mut self, message: &Message<'_>) {
        match serde_json::to_string(message) {
            Ok(line) => self.line.send(line),
            Err(error) => unreachable!("texts, lists and finite numbers under text keys: {error}"),
        }
    }

    fn ask(&mut self, view: &View<'_>) -> Result<Control, Refusal> {
        // Taken for the answer, it would be one to an earlier question, and so would every later one.
        match self.line.early() {
            None => {}
            Some(Ok(bytes)) => return Err(Refusal::of(BEFORE, &bytes)),
            Some(Err(broken)) => return Err(Refusal::broken(&broken, self.limit)),
        }
        self.say(&observation(view, self.map_m));
        let received = self.line.receive(self.limit);
        self.stopped = received == Err(Broken::Stopped);
        let bytes = received.map_err(|broken| Refusal::broken(&broken, self.limit))?;
        let wrong = |found: &str| Refusal::of(format!("{FORM}, found {found}"), &bytes);
        let answered: Answered = serde_json::from_slice(&bytes).map_err(|error| match error.classify() {
            serde_json::error::Category::Data => wrong("other fields"),
            _ => wrong("a line that is no JSON object"),
        })?;
        if answered.step.is_some_and(|step| step != view.decision()) {
            return Err(wrong("an answer to another step"));
        }
        match answered {
            Answered {
                acceleration_mps2: Some(acceleration_mps2),
                steering_rad: Some(steering_rad),
                trajectory: None,
                ..
            } => Ok(Control::Drive { acceleration_mps2, steering_rad }),
            Answered { acceleration_mps2: None, steering_rad: None, trajectory: Some(points), .. }
                if !points.is_empty() =>
            {
                Ok(along(view, &points))
            }
            _ => Err(wrong("neither of them, or both")),
        }
    }
}

/// What an answer has to be.
const FORM: &str = "expected {\"acceleration_mps2\": .., \"steering_rad\": ..} or {\"trajectory\": [[x, y], ..]}";
/// Said of a line that is there when all were answered.
const AFTER: &str =
    "expected no more lines, found one that nobody asked for; print one line a `step`, and none for `begin` and `end`";
/// Said of a line that nobody asked for.
const BEFORE: &str = "expected one line an answer, found one that came before this question; print one line a `step`, and none for `begin` and `end`";

impl Driver for Planner<'_> {
    fn begin(&mut self, plant: &Plant) {
        let (scene, limits, size) = (plant.scene(), plant.limits(), &plant.scene().ego.track);
        let message = Message::Begin {
            scene: plant.scene_id(),
            dt_s: DT_S,
            seed: self.seed.0,
            steps: plant.steps(),
            target_speed_mps: plant.target_speed_mps(),
            ego: CarLimits {
                length_m: size.length_m,
                width_m: size.width_m,
                steering_rad_max: limits.steering_rad,
                acceleration_mps2_max: limits.engine_mps2,
                brake_mps2_max: limits.brake_mps2,
                speed_mps_max: limits.speed_mps,
            },
            route: plant.route().points(),
            lanes: &scene.road.lanes,
            edges: &scene.road.edges,
            crosswalks: &scene.crosswalks,
            stop_signs: &scene.stop_signs,
            lights: scene.lights.iter().map(|l| LightPlace { lane: l.lane, stop_point: l.stop_point }).collect(),
        };
        self.say(&message);
    }

    fn decide(&mut self, view: &View<'_>) -> Control {
        self.ask(view).unwrap_or_else(|Refusal { reason, printed, late }| {
            let k = view.decision();
            let reason = format!("decision {k} ({:.1} s): {reason}", k as f64 * DT_S);
            self.broken = Some(Refusal { reason, printed, late });
            // The simulator refuses this, which ends the rollout.
            Control::Drive { acceleration_mps2: f64::NAN, steering_rad: f64::NAN }
        })
    }

    fn finish(&mut self, view: &View<'_>, end: End) {
        self.say(&Message::End { end, steps: view.decision() });
        if let (None, Ok(bytes)) = (&self.broken, self.line.receive(UNASKED)) {
            let reason = format!("behind decision {}: {AFTER}", view.decision());
            self.broken = Some(Refusal::of(reason, &bytes));
        }
    }
}

/// Everything that a planner is told at one decision: nothing of the future.
fn observation(view: &View<'_>, map_m: Option<f64>) -> Message<'static> {
    let ego = view.ego();
    let mut near: Vec<(f64, Neighbour)> = Vec::new();
    view.for_each_within(SIGHT_M, |seen: &Seen| {
        let neighbour = Neighbour {
            who: seen.actor,
            kind: seen.size.kind,
            position: seen.position,
            heading_rad: seen.axis.heading(),
            velocity: seen.velocity,
            length_m: 2.0 * seen.size.half_length_m,
            width_m: 2.0 * seen.size.half_width_m,
        };
        near.push((seen.position.distance(ego.sample.position), neighbour));
    });
    near.sort_by(|a, b| a.0.total_cmp(&b.0));
    let lights = view.plant().scene().lights.iter();
    let around = |reach_m| MapNear::around(&view.plant().scene().road, ego.sample.position, reach_m);
    Message::Step {
        step: view.decision(),
        time_s: view.decision() as f64 * DT_S,
        ego: EgoNow {
            position: ego.sample.position,
            heading_rad: ego.sample.heading_rad,
            velocity: ego.sample.velocity,
            speed_mps: ego.speed_mps,
            acceleration_mps2: ego.acceleration_mps2,
            steering_rad: ego.steering_rad,
            route_s_m: ego.along.s_m,
            route_offset_m: ego.along.offset_m,
        },
        neighbours: near.into_iter().map(|(_, neighbour)| neighbour).collect(),
        lights: lights.map(|l| l.states.get(view.step()).copied().unwrap_or(LightState::Unknown)).collect(),
        map: map_m.map(around),
    }
}

/// Drives along points that lie 0.1 s apart: on the arc through the last point looked at, with the constant acceleration that
/// covers the way there in its time. Points behind the car stop it.
fn along(view: &View<'_>, points: &[Vec2]) -> Control {
    let ego = view.ego();
    let ahead = &points[..points.len().min(POINTS_AHEAD)];
    let last = ahead[ahead.len() - 1];
    let from = ego.sample.position;
    let mut way_m = from.distance(ahead[0]);
    way_m += ahead.windows(2).map(|pair| pair[0].distance(pair[1])).fold(0.0, |sum, x| sum + x);
    if (last - from).dot(ego.axis) <= 0.0 {
        way_m = 0.0;
    }
    let seconds = DT_S * ahead.len() as f64;
    Control::Drive {
        acceleration_mps2: 2.0 * (way_m - ego.speed_mps * seconds) / (seconds * seconds),
        steering_rad: Car::new(&ego.sample, 2.0 * ego.size.half_length_m).steering_towards(last),
    }
}

/// Why a process gave no line.
pub(super) fn why(broken: &Broken, limit: Duration) -> String {
    match broken {
        Broken::Ended => "the process ended".into(),
        Broken::HalfLine(bytes) => format!("the process ended {bytes} bytes into a line"),
        Broken::Late => format!("no answer within {} s (driver.timeout_s)", limit.as_secs_f64()),
        Broken::TooLong(most) => format!("a line of more than {most} bytes"),
        Broken::Stopped => "it is not waited for any more: the command is being stopped".into(),
    }
}
