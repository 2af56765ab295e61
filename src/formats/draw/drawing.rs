//! A drawing: the data to be drawn, from a scene, a rollout or an adversarial plan. The player reads its
//! JSON.

use serde::{Deserialize, Serialize};

use crate::kernel::{Vec2, num};
use crate::scene::{AgentKind, DT_S, LaneKind, LightState, Sample, Scene, Track};

/// A road with actors that move over it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Drawing {
    /// Seconds between two samples.
    pub dt_s: f64,
    /// Samples of every actor.
    pub steps: usize,
    /// The first simulated step: clocks count from it, so recorded samples before it have negative times.
    #[serde(default)]
    pub start_step: usize,
    /// The current step; samples before it are history.
    pub current_step: usize,
    /// Polygons of sidewalks, shoulders and parking: they lie beside the road and end where a crossing begins.
    #[serde(default)]
    pub verges: Vec<Vec<Vec2>>,
    /// Polygons of road surface.
    pub surfaces: Vec<Vec<Vec2>>,
    /// Lane borders, centre lines and edges.
    pub lines: Vec<RoadLine>,
    /// Outlines. Points in metres.
    pub crosswalks: Vec<Vec<Vec2>>,
    /// Traffic lights over time.
    pub lights: Vec<DrawnLight>,
    /// Places of stop signs, metres.
    pub stop_signs: Vec<Vec2>,
    /// The path that the ego is to drive; may be empty.
    pub route: Vec<Vec2>,
    /// Everyone who is drawn, in drawing order.
    pub actors: Vec<Actor>,
    /// The ego's first contact, if there was one.
    pub contact: Option<Contact>,
}

/// A line of the road.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RoadLine {
    /// Kind of the line.
    pub style: LineStyle,
    /// Points, metres.
    pub points: Vec<Vec2>,
}

/// Kind of a line of the road, which decides how it is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LineStyle {
    /// A curb.
    Edge,
    /// Between lanes of one direction.
    Divider,
    /// Between the directions.
    Opposite,
}

/// A traffic light at its stop line, one state a step.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DrawnLight {
    /// Place at which it is drawn, metres.
    pub point: Vec2,
    /// One state a step. `[steps]`
    pub states: Vec<LightState>,
}

/// A road user, and its role in the drawing.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Actor {
    /// Name that a reader sees.
    pub label: String,
    /// Its role in this drawing, which decides its colour.
    pub role: Role,
    /// Length of the box, metres.
    pub length_m: f64,
    /// Width of the box, metres.
    pub width_m: f64,
    /// `steps` long: `[x, y, heading_rad, speed_mps]`, `None` where absent.
    pub samples: Vec<Option<[f64; 4]>>,
}

/// Role of a road user in a drawing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Role {
    /// The vehicle under test.
    Ego,
    /// Moved by the intervention.
    Adversary,
    /// Marked by the data set as interacting with the ego.
    Interacting,
    /// Any other motor vehicle.
    Traffic,
    /// Someone on a bicycle.
    Cyclist,
    /// Someone on foot.
    Pedestrian,
    /// A barrier, a cone, something parked or unknown.
    Static,
    /// The logged motion of a road user, drawn beside the played one.
    Ghost,
}

impl Role {
    /// All roles, in the order of the legend.
    pub const ALL: [Role; 8] = [
        Role::Ego,
        Role::Adversary,
        Role::Interacting,
        Role::Traffic,
        Role::Cyclist,
        Role::Pedestrian,
        Role::Static,
        Role::Ghost,
    ];

    /// Returns the name in the legend.
    pub fn label(self) -> &'static str {
        match self {
            Role::Ego => "ego",
            Role::Adversary => "adversary",
            Role::Interacting => "interacting",
            Role::Traffic => "traffic",
            Role::Cyclist => "cyclist",
            Role::Pedestrian => "pedestrian",
            Role::Static => "static",
            Role::Ghost => "logged",
        }
    }
}

/// Place and time at which two actors touch.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Contact {
    /// Step of the scene.
    pub step: usize,
    /// Point at which they touch, metres.
    pub point: Vec2,
    /// Such as `ego hit by v12 at 6.3 m/s`.
    pub label: String,
}

impl Actor {
    /// Makes an actor of a recorded motion in a role.
    pub fn of_track(track: &Track, label: impl Into<String>, role: Role) -> Actor {
        Actor {
            label: label.into(),
            role,
            length_m: track.length_m,
            width_m: track.width_m,
            samples: track.samples.iter().map(|s| s.as_ref().map(drawn)).collect(),
        }
    }
}

/// Returns numbers rounded to centimetres and hundredths: finer than any screen, and pages stay small.
fn drawn(sample: &Sample) -> [f64; 4] {
    let p = sample.position;
    [
        num::rounded(p.x, 2),
        num::rounded(p.y, 2),
        num::rounded(sample.heading_rad, 3),
        num::rounded(sample.speed_mps(), 2),
    ]
}

fn drawn_line(points: &[Vec2]) -> Vec<Vec2> {
    points.iter().map(|p| Vec2::new(num::rounded(p.x, 2), num::rounded(p.y, 2))).collect()
}

impl Drawing {
    /// Makes a drawing of a scene's road alone: a caller adds its own actors.
    pub fn of_road(scene: &Scene) -> Drawing {
        let mut lines: Vec<RoadLine> = Vec::new();
        let mut add = |style, points: &[Vec2]| lines.push(RoadLine { style, points: drawn_line(points) });
        for edge in &scene.road.edges {
            add(LineStyle::Edge, edge);
        }
        for (ix, lane) in scene.road.lanes.iter().enumerate() {
            if lane.left_neighbours.iter().any(|n| n.same_direction) {
                add(LineStyle::Divider, &lane.left);
            } else if lane.left_neighbours.iter().any(|n| ix < n.lane) {
                // Both lanes name each other as neighbours, but one line is enough.
                add(LineStyle::Opposite, &lane.left);
            }
        }
        let lanes = |beside: bool| scene.road.lanes.iter().filter(move |lane| (lane.kind == LaneKind::Other) == beside);
        let surface = |lane: &crate::scene::Lane| {
            let outline: Vec<Vec2> = lane.left.iter().chain(lane.right.iter().rev()).copied().collect();
            drawn_line(&outline)
        };
        Drawing {
            dt_s: DT_S,
            steps: scene.steps,
            start_step: scene.ego.start_step,
            current_step: scene.current_step,
            verges: lanes(true).map(surface).collect(),
            surfaces: lanes(false).map(surface).collect(),
            lines,
            crosswalks: scene.crosswalks.iter().map(|c| drawn_line(c)).collect(),
            lights: scene
                .lights
                .iter()
                .map(|light| DrawnLight { point: light.stop_point, states: light.states.clone() })
                .collect(),
            stop_signs: scene.stop_signs.iter().map(|sign| sign.position).collect(),
            route: drawn_line(&scene.ego.route),
            actors: Vec::new(),
            contact: None,
        }
    }

    /// Makes a drawing of a scene as it was recorded. The ego comes last, so that it is drawn on top.
    pub fn of_scene(scene: &Scene) -> Drawing {
        let mut drawing = Drawing::of_road(scene);
        for (ix, track) in scene.tracks.iter().enumerate() {
            let marked = scene.objects_of_interest.contains(&ix);
            drawing.actors.push(Actor::of_track(track, track.id.clone(), role_of(track, marked)));
        }
        drawing.actors.push(Actor::of_track(&scene.ego.track, "ego", Role::Ego));
        drawing
    }

    /// Returns the clock's time at a step, s: the same time as in contacts, time lines and results.
    pub fn clock_s(&self, step: usize) -> f64 {
        (step as f64 - self.start_step as f64) * self.dt_s
    }

    /// Returns the roles that occur, in the order of the legend.
    pub fn roles(&self) -> Vec<Role> {
        Role::ALL.into_iter().filter(|role| self.actors.iter().any(|a| a.role == *role)).collect()
    }
}

/// Returns the role of a recorded road user; `marked` is true for an object of interest.
pub fn role_of(track: &Track, marked: bool) -> Role {
    match track.kind {
        _ if marked => Role::Interacting,
        AgentKind::Vehicle => Role::Traffic,
        AgentKind::Pedestrian => Role::Pedestrian,
        AgentKind::Cyclist => Role::Cyclist,
        AgentKind::Static => Role::Static,
    }
}
