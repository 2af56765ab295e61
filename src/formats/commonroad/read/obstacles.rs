//! Reads obstacles: a shape becomes a bounding box, states become samples. Obstacles without states (occupancies,
//! buildings) are left out and named.

use super::{File, angle, exact_or_middle, point, step};
use crate::formats::import_error::{ImportError, shown};
use crate::formats::resample::{State, resample};
use crate::formats::xml_read::Element;
use crate::kernel::{OrientedBox, Vec2};
use crate::scene::validate::{SIDE_MAX_M, SIDE_MIN_M};
use crate::scene::{AgentKind, LeftOut, Sample, Track};

/// Everything that moves or stands, in the file's coordinates and time.
pub(super) struct Obstacles {
    obstacles: Vec<Obstacle>,
    /// Outlines of road boundaries.
    pub edges: Vec<Vec<Vec2>>,
}

struct Obstacle {
    id: String,
    kind: AgentKind,
    length_m: f64,
    width_m: f64,
    /// Box centres; one for a static obstacle, which stands for all time.
    states: Vec<State>,
    is_static: bool,
}

/// A bounding box in an obstacle's own axes.
struct Extent {
    low: Vec2,
    high: Vec2,
}

impl Extent {
    fn size(&self) -> Vec2 {
        self.high - self.low
    }

    fn centre(&self) -> Vec2 {
        self.low.lerp(self.high, 0.5)
    }
}

pub(super) fn read(file: &File<'_>, left_out: &mut Vec<LeftOut>) -> Result<Obstacles, ImportError> {
    let mut read = Obstacles { obstacles: vec![], edges: vec![] };
    for element in file.root.children() {
        let is_static = match element.name() {
            "dynamicObstacle" => false,
            "staticObstacle" => true,
            "obstacle" => match element.needed_child("role")?.text() {
                "dynamic" => false,
                "static" => true,
                other => return Err(element.refuse(format!("role dynamic or static, found {:?}", shown(other)))),
            },
            "phantomObstacle" | "environmentObstacle" => {
                leave_out(file, &element, left_out, "it is not a road user: it has occupancies or walls but no states");
                continue;
            }
            _ => continue,
        };
        if let Err(reason) = read.add(&element, is_static, file.dt_s)? {
            leave_out(file, &element, left_out, &reason);
        }
    }
    Ok(read)
}

fn leave_out(file: &File<'_>, element: &Element<'_>, left_out: &mut Vec<LeftOut>, reason: &str) {
    let what = format!("{} {}", element.name(), shown(element.attribute("id").unwrap_or("without id")));
    left_out.push(LeftOut { file: file.name.into(), what, reason: reason.into() });
}

impl Obstacles {
    /// Adds one obstacle; the inner error is a reason to leave it out.
    fn add(&mut self, element: &Element<'_>, is_static: bool, dt_s: f64) -> Result<Result<(), String>, ImportError> {
        let id = element.needed_attribute("id")?.to_string();
        let kind_name = element.needed_child("type")?.text();
        if element.child("occupancySet").is_some() {
            return Ok(Err("its future is a set of occupancies, which gives no states".into()));
        }
        let shape = element.needed_child("shape")?;
        let Some(extent) = extent(&shape)? else {
            return Err(shape.refuse("a rectangle, circle or polygon"));
        };
        let size = extent.size();
        let initial = element.needed_child("initialState")?;
        let mut elements = vec![initial];
        elements.extend(element.child("trajectory").iter().flat_map(|t| t.named("state")));
        let mut states: Vec<State> = Vec::with_capacity(elements.len());
        for given in &elements {
            let Some(mut state) = state(given, dt_s)? else {
                return Ok(Err("a state gives lanelets or an interval of time in place of a position".into()));
            };
            state.position = state.position + extent.centre().rotated(state.heading_rad);
            if states.last().is_some_and(|last| last.time_s >= state.time_s) {
                return Err(given.refuse("a time after the state before it"));
            }
            states.push(state);
        }
        if kind_name == "roadBoundary" {
            let box_ = OrientedBox::new(states[0].position, states[0].heading_rad, size.x, size.y);
            let corners = box_.corners();
            self.edges.push(vec![corners[0], corners[1], corners[2], corners[3], corners[0]]);
            return Ok(Ok(()));
        }
        let sides = SIDE_MIN_M..=SIDE_MAX_M;
        if !sides.contains(&size.x) || !sides.contains(&size.y) {
            return Ok(Err(format!("its box is {:.2} m by {:.2} m; sides of 0.05 to 60 m are read", size.x, size.y)));
        }
        let kind = kind(kind_name, is_static);
        self.obstacles.push(Obstacle { id, kind, length_m: size.x, width_m: size.y, states, is_static });
        Ok(Ok(()))
    }

    pub fn count(&self) -> usize {
        self.obstacles.len()
    }

    pub fn edge_points(&self) -> usize {
        self.edges.iter().map(Vec::len).sum()
    }

    /// Time of the last state of all moving obstacles, seconds.
    pub fn last_s(&self) -> f64 {
        let moving = self.obstacles.iter().filter(|o| !o.is_static);
        moving.flat_map(|o| o.states.last()).map(|s| s.time_s).fold(0.0, f64::max)
    }

    /// Tracks of a scene that starts at `start_s` with its origin at `origin`. Obstacles that are never observed in it
    /// are left out.
    pub fn tracks(&self, start_s: f64, origin: Vec2, steps: usize) -> Vec<Track> {
        let track = |obstacle: &Obstacle| {
            let here = |s: &State| State { time_s: s.time_s - start_s, position: s.position - origin, ..*s };
            let states: Vec<State> = obstacle.states.iter().map(here).collect();
            let samples = if obstacle.is_static {
                let State { position, heading_rad, .. } = states[0];
                vec![Some(Sample { position, heading_rad, velocity: Vec2::ZERO }); steps]
            } else {
                resample(&states, steps)
            };
            Track {
                id: obstacle.id.clone(),
                kind: obstacle.kind,
                length_m: obstacle.length_m,
                width_m: obstacle.width_m,
                samples,
            }
        };
        self.obstacles.iter().map(track).filter(|t| t.span().is_some()).collect()
    }
}

fn kind(name: &str, is_static: bool) -> AgentKind {
    match name {
        _ if is_static => AgentKind::Static,
        "pedestrian" => AgentKind::Pedestrian,
        "bicycle" => AgentKind::Cyclist,
        "constructionZone" | "pillar" | "median_strip" | "building" => AgentKind::Static,
        _ => AgentKind::Vehicle,
    }
}

/// Bounding box of all parts of a shape, in the axes of its obstacle.
fn extent(shape: &Element<'_>) -> Result<Option<Extent>, ImportError> {
    let mut points: Vec<Vec2> = Vec::new();
    for part in shape.children() {
        let centre = part.child("center").map(|c| point(&c)).transpose()?.unwrap_or_default();
        match part.name() {
            "rectangle" => {
                let turn = part.child("orientation").map(|o| o.number()).transpose()?.unwrap_or(0.0);
                let (length, width) = (positive(&part, "length")?, positive(&part, "width")?);
                points.extend(OrientedBox::new(centre, turn, length, width).corners());
            }
            "circle" => {
                let reach = Vec2::new(1.0, 1.0) * positive(&part, "radius")?;
                points.extend([centre - reach, centre + reach]);
            }
            "polygon" => {
                for corner in part.named("point") {
                    points.push(point(&corner)?);
                }
            }
            _ => {}
        }
    }
    let Some(&first) = points.first() else { return Ok(None) };
    let low = points.iter().fold(first, |m, p| Vec2::new(m.x.min(p.x), m.y.min(p.y)));
    let high = points.iter().fold(first, |m, p| Vec2::new(m.x.max(p.x), m.y.max(p.y)));
    Ok(Some(Extent { low, high }))
}

fn positive(part: &Element<'_>, name: &str) -> Result<f64, ImportError> {
    let given = part.needed_child(name)?;
    let value = given.number()?;
    if value <= 0.0 { Err(given.refuse(format!("a length above 0, found {value}"))) } else { Ok(value) }
}

/// Place, heading, time and speed of a state; of an uncertain place (a region) the middle. `None` if the state has no
/// place at an exact time.
fn state(element: &Element<'_>, dt_s: f64) -> Result<Option<State>, ImportError> {
    let Some(position) = place(&element.needed_child("position")?)? else { return Ok(None) };
    let Some(time) = element.needed_child("time")?.child("exact") else { return Ok(None) };
    Ok(Some(State {
        time_s: step(&time)? * dt_s,
        position,
        heading_rad: angle(&element.needed_child("orientation")?)?,
        speed_mps: element.child("velocity").map(|v| exact_or_middle(&v)).transpose()?,
    }))
}

/// A point, or the middle of a region's bounding box; `None` for lanelets.
pub(super) fn place(position: &Element<'_>) -> Result<Option<Vec2>, ImportError> {
    if let Some(exact) = position.child("point") {
        return point(&exact).map(Some);
    }
    Ok(extent(position)?.map(|extent| extent.centre()))
}
