//! The lines between a rollout and a planner: what it is told, and what it may answer. `docs/EGOS.md` describes them.

use serde::{Deserialize, Serialize};

use super::map_near::MapNear;
use super::under::ProgramContext;
use crate::ego::Setting;
use crate::ego::observation::ACTION;
use crate::kernel::{Seed, Vec2};
use crate::scene::{AgentKind, DT_S, Lane, LaneIx, LightState, StopSign};
use crate::sim::{ActorRef, Contact, ContactClass, Control, End, Outcome, Plant, Seen, View};

/// How far a planner sees, metres between centres.
const SIGHT_M: f64 = 100.0;

/// A line to a planner.
#[derive(Serialize)]
#[serde(tag = "type", rename_all = "snake_case")]
pub(super) enum Message<'a> {
    /// A rollout begins.
    Begin {
        scene: &'a str,
        dt_s: f64,
        /// For random numbers: the same in every rollout of a run.
        seed: u64,
        /// Most decisions.
        steps: usize,
        target_speed_mps: Option<f64>,
        ego: CarLimits,
        /// The program under which it drives, where the planner is not blind.
        #[serde(skip_serializing_if = "Option::is_none")]
        under: Option<ProgramContext>,
        /// The observation that each step also holds, where [driver] asks for one.
        #[serde(skip_serializing_if = "Option::is_none")]
        observe: Option<Setting>,
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
        /// The map near the ego, if the planner asked for it.
        #[serde(skip_serializing_if = "Option::is_none")]
        map: Option<MapNear>,
        /// The observation, if [driver] asks for it.
        #[serde(skip_serializing_if = "Option::is_none")]
        observation: Option<Vec<f32>>,
    },
    /// The rollout is over.
    End {
        end: Ending,
        steps: usize,
        /// The labels of the rollout, if the planner asked for them.
        #[serde(flatten, skip_serializing_if = "Option::is_none")]
        labels: Option<Labelled<'a>>,
    },
}

/// How a planner's rollout ends.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Ending {
    Abandoned,
    #[serde(untagged)]
    Driven(End),
}

/// The result of a rollout: its labels under the names of the Python environments, and all that a record holds.
#[derive(Serialize)]
pub(super) struct Labelled<'a> {
    labels: Labels,
    outcome: &'a Outcome,
}

#[derive(Serialize)]
pub(super) struct Labels {
    collision: bool,
    contact_class: Option<ContactClass>,
    /// True if the contact is with a road user that the program moves.
    adversary: bool,
    /// True if braking or swerving would have avoided it and it is no ram from behind; null where it was not assessed.
    preventable: Option<bool>,
    route_completion: f64,
}

impl Labelled<'_> {
    pub fn of(outcome: &Outcome) -> Labelled<'_> {
        let contact = outcome.contact.as_ref();
        let labels = Labels {
            collision: contact.is_some(),
            contact_class: contact.map(|contact| contact.class),
            adversary: contact.is_some_and(|contact| contact.adversary),
            preventable: contact.and_then(Contact::preventable),
            route_completion: outcome.route_completion,
        };
        Labelled { labels, outcome }
    }
}

/// The ego's box and what the car can do.
#[derive(Serialize)]
pub(super) struct CarLimits {
    length_m: f64,
    width_m: f64,
    steering_rad_max: f64,
    acceleration_mps2_max: f64,
    brake_mps2_max: f64,
    speed_mps_max: f64,
}

#[derive(Serialize)]
pub(super) struct LightPlace {
    lane: LaneIx,
    stop_point: Vec2,
}

#[derive(Serialize)]
pub(super) struct EgoNow {
    position: Vec2,
    heading_rad: f64,
    velocity: Vec2,
    speed_mps: f64,
    acceleration_mps2: f64,
    steering_rad: f64,
    /// Distance driven along the route, and distance beside it, positive to the left.
    route_s_m: f64,
    route_offset_m: f64,
}

#[derive(Serialize)]
pub(super) struct Neighbour {
    who: ActorRef,
    kind: AgentKind,
    position: Vec2,
    heading_rad: f64,
    velocity: Vec2,
    length_m: f64,
    width_m: f64,
}

/// A planner's answer: controls, its wanted places 0.1 s, 0.2 s ... from now, or that it drives no further.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Answered {
    /// The step that it answers, where the planner says so.
    #[serde(default)]
    pub step: Option<usize>,
    #[serde(default)]
    pub acceleration_mps2: Option<f64>,
    #[serde(default)]
    pub steering_rad: Option<f64>,
    #[serde(default)]
    pub trajectory: Option<Vec<Vec2>>,
    /// Steering and pedal, as an ego with weights of the same observation answers.
    #[serde(default)]
    pub action: Option<[f32; ACTION]>,
    /// Why it abandons the scene, as one word.
    #[serde(default)]
    pub abandon: Option<String>,
}

/// Meaning of an answer.
pub(super) enum Wish {
    Drive(Control),
    Abandon(String),
}

/// Most characters of the word with which a planner abandons a scene. It is recorded, so it has no room for a sentence or a path.
const WORD_CHARS: usize = 40;

pub(super) fn is_word(text: &str) -> bool {
    (1..=WORD_CHARS).contains(&text.len())
        && text.bytes().all(|byte| byte.is_ascii_alphanumeric() || b"-_".contains(&byte))
}

/// The extras that a planner is told beyond what all are. Its greeting and the table `[driver]` ask for them.
#[derive(Clone, Copy, Default)]
pub(super) struct Asked {
    /// Radius around the ego within which it is told the map, metres.
    pub map_m: Option<f64>,
    pub observe: Option<Setting>,
    pub under: Option<ProgramContext>,
    /// True if it is told the result of a rollout.
    pub labels: bool,
}

/// Returns the line that tells a planner that a rollout begins.
pub(super) fn begun<'a>(plant: &'a Plant, seed: Seed, asked: &Asked) -> Message<'a> {
    let (scene, limits, size) = (plant.scene(), plant.limits(), &plant.scene().ego.track);
    Message::Begin {
        scene: plant.scene_id(),
        dt_s: DT_S,
        seed: seed.0,
        steps: plant.steps(),
        target_speed_mps: plant.target_speed_mps(),
        under: asked.under,
        observe: asked.observe,
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
    }
}

/// Returns everything that a planner is told at one decision: nothing of the future.
pub(super) fn observation(view: &View<'_>, asked: &Asked) -> Message<'static> {
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
        map: asked.map_m.map(around),
        observation: asked.observe.map(|setting| {
            let mut numbers = Vec::with_capacity(setting.length());
            setting.observe(view, &mut numbers);
            numbers
        }),
    }
}
