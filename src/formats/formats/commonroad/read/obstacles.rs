//! Reads obstacles: a shape becomes a bounding box, states become samples. Obstacles without states (occupancies,
//! buildings) are left out and named.

use std::collections::{BTreeMap, BTreeSet};

use super::{File, exact_or_middle, named, point, step};
use crate::formats::conventions::{self, Conventions, Given, HEADINGS, ReadAs, VELOCITIES, Wrong};
use crate::formats::derived;
use crate::formats::import_error::{ImportError, shown};
use crate::formats::imported::Imported;
use crate::formats::resample::{State, resample};
use crate::formats::sizes;
use crate::formats::xml_read::Element;
use crate::kernel::{OrientedBox, Vec2, num};
use crate::scene::validate::{SIDE_MAX_M, SIDE_MIN_M};
use crate::scene::{AgentKind, LeftOut, Sample, Track};

/// Everything that moves or stands, in the file's coordinates and time.
pub(super) struct Obstacles {
    obstacles: Vec<Obstacle>,
    /// Boxes of road boundaries.
    walls: Vec<Obstacle>,
    /// Conventions of the file's headings and velocities, as indices in [`HEADINGS`] and [`VELOCITIES`].
    pub conventions: (usize, usize),
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
    /// Vector from the place of a state to the centre of its box, in the obstacle's own axes.
    to_centre: Vec2,
    is_static: bool,
    /// True if the file gives its heading; a point mass heads where it goes.
    is_oriented: bool,
}

impl Obstacle {
    /// Turns its heading to its motion; one that never moves keeps its heading.
    fn look_ahead(&mut self) {
        let times: Vec<f64> = self.states.iter().map(|state| state.time_s).collect();
        let places: Vec<Vec2> = self.states.iter().map(|state| state.position).collect();
        let headings = derived::headings(&times, &places).unwrap_or_default();
        self.states.iter_mut().zip(headings).for_each(|(state, heading_rad)| state.heading_rad = heading_rad);
    }
}

/// An obstacle's states as samples. Its velocity lies along its heading.
struct ObstacleLog {
    times_s: Vec<f64>,
    samples: Vec<Option<Sample>>,
    looks_ahead: bool,
}

impl ObstacleLog {
    fn of(obstacle: &Obstacle) -> ObstacleLog {
        let sample = |state: &State| {
            let velocity = Vec2::from_heading(state.heading_rad) * state.speed_mps.unwrap_or(f64::NAN);
            Some(Sample { position: state.position, heading_rad: state.heading_rad, velocity })
        };
        ObstacleLog {
            times_s: obstacle.states.iter().map(|state| state.time_s).collect(),
            samples: obstacle.states.iter().map(sample).collect(),
            looks_ahead: !matches!(obstacle.kind, AgentKind::Pedestrian | AgentKind::Static),
        }
    }

    fn given(&self) -> Given<'_> {
        Given { times_s: &self.times_s, samples: &self.samples, looks_ahead: self.looks_ahead }
    }
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

/// Why an obstacle is not in the scenes.
enum Lost {
    /// It cannot be read.
    Unread(ImportError),
    /// It is no road user with a box that moves.
    Reason(String),
}

impl From<ImportError> for Lost {
    fn from(error: ImportError) -> Lost {
        Lost::Unread(error)
    }
}

/// Returns the obstacles that can be read; the others are left out in `imported`. Without conventions headings and speeds are
/// taken as they are written.
pub(super) fn read(file: &File<'_>, conventions: Option<Conventions>, imported: &mut Imported) -> Obstacles {
    let mut obstacles = Obstacles { obstacles: vec![], walls: vec![], conventions: (0, 0), edges: vec![] };
    let mut reading = Reading {
        ids: BTreeSet::new(),
        headings: 0,
        velocities: 0,
        unknown: BTreeMap::new(),
        broadside: vec![],
        imported,
    };
    for element in file.root.children() {
        if let Err(lost) = obstacles.add(file, &element, &mut reading) {
            let what = named(&element);
            match lost {
                Lost::Unread(error) => reading.imported.leave_out_for(what, &error, "the other obstacles are kept"),
                Lost::Reason(reason) => reading.imported.leave_out(file.name, || (what, reason)),
            }
        }
    }
    if let Some(conventions) = conventions {
        obstacles.read_as(conventions, file, reading.imported);
    }
    reading.finish(file);
    obstacles.place_boxes();
    obstacles
}

/// Data gathered over all obstacles of a file.
struct Reading<'r, 'd> {
    ids: BTreeSet<&'d str>,
    /// Number of obstacles whose headings, and of those whose velocities, come from their places.
    headings: usize,
    velocities: usize,
    /// Kinds assumed for obstacles of unknown kinds.
    unknown: BTreeMap<&'d str, Vec<AgentKind>>,
    /// Vehicles whose sides were exchanged, and their sides in the file.
    broadside: Vec<(&'d str, (f64, f64))>,
    imported: &'r mut Imported,
}

impl Reading<'_, '_> {
    fn finish(self, file: &File<'_>) {
        let derived_parts = [
            (self.velocities, LeftOut::VELOCITIES, "derived from their places"),
            (self.headings, LeftOut::HEADINGS, "each looks where it goes"),
        ];
        for (count, what, how) in derived_parts.into_iter().filter(|(count, ..)| *count > 0) {
            self.imported.leave_out(file.name, || (what.into(), format!("{count} obstacles have none; {how}")));
        }
        for (name, taken) in self.unknown {
            self.imported.leave_out(file.name, || (LeftOut::KINDS.into(), derived::kinds_taken(&shown(name), &taken)));
        }
        if let Some(reason) = sizes::sizes_exchanged(&self.broadside) {
            self.imported.leave_out(file.name, || (LeftOut::SIZES.into(), reason));
        }
    }
}

impl Obstacles {
    /// Adds an element if it is an obstacle.
    fn add<'d>(&mut self, file: &File<'d>, element: &Element<'d>, reading: &mut Reading<'_, 'd>) -> Result<(), Lost> {
        let is_static = match element.name() {
            "dynamicObstacle" => false,
            "staticObstacle" => true,
            "obstacle" => match element.needed_child("role")?.text() {
                "dynamic" => false,
                "static" => true,
                other => {
                    return Err(element.refuse(format!("role dynamic or static, found {:?}", shown(other))).into());
                }
            },
            "phantomObstacle" | "environmentObstacle" => {
                let reason = "it is not a road user: it has occupancies or walls but no states";
                return Err(Lost::Reason(reason.into()));
            }
            _ => return Ok(()),
        };
        let id = element.needed_attribute("id")?;
        if reading.ids.contains(id) {
            return Err(element.refuse(format!("an id of its own; {:?} is already taken", shown(id))).into());
        }
        let kind_name = element.needed_child("type")?.text();
        if element.child("occupancySet").is_some() {
            return Err(Lost::Reason("its future is a set of occupancies, which gives no states".into()));
        }
        let shape = element.needed_child("shape")?;
        let extent = extent(&shape)?.ok_or_else(|| shape.refuse("a rectangle, circle or polygon"))?;
        let size = extent.size();
        let (states, is_oriented) = states(file, element, &extent, is_static, reading)?;
        let to_centre = extent.centre();
        if kind_name == "roadBoundary" {
            let (id, kind, length_m, width_m) = (id.to_string(), AgentKind::Static, size.x, size.y);
            self.walls.push(Obstacle { id, kind, length_m, width_m, states, to_centre, is_static, is_oriented });
            return Ok(());
        }
        let sides = SIDE_MIN_M..=SIDE_MAX_M;
        if !sides.contains(&size.x) || !sides.contains(&size.y) {
            let reason = format!("its box is {:.2} m by {:.2} m; sides of 0.05 to 60 m are read", size.x, size.y);
            return Err(Lost::Reason(reason));
        }
        let kind = kind(kind_name, is_static).unwrap_or_else(|| {
            let places: Vec<Vec2> = states.iter().map(|state| state.position).collect();
            let times: Vec<f64> = states.iter().map(|state| state.time_s).collect();
            let fastest = derived::velocities(&times, &places).iter().map(|v| v.norm()).fold(0.0, f64::max);
            let kind = derived::kind_moving(&places, fastest, size.x);
            reading.unknown.entry(kind_name).or_default().push(kind);
            kind
        });
        reading.ids.insert(id);
        let (mut length_m, mut width_m) = (size.x, size.y);
        if sizes::is_broadside(kind, length_m, width_m) {
            reading.broadside.push((id, (length_m, width_m)));
            (length_m, width_m) = (width_m, length_m);
        }
        let id = id.to_string();
        self.obstacles.push(Obstacle { id, kind, length_m, width_m, states, to_centre, is_static, is_oriented });
        Ok(())
    }

    /// Reads headings and speeds in a convention; see [`conventions`].
    fn read_as(&mut self, conventions: Conventions, file: &File<'_>, imported: &mut Imported) {
        let mut notes = conventions::said_by_option(conventions);
        let logs: Vec<ObstacleLog> = self.obstacles.iter().map(ObstacleLog::of).collect();
        let given: Vec<Given<'_>> =
            self.obstacles.iter().zip(&logs).filter(|(of, _)| of.is_oriented).map(|(_, log)| log.given()).collect();
        let read = match conventions.headings.named() {
            Some(convention) => conventions::Read { convention, note: None },
            None => conventions::read_headings(&given, "all obstacles", 0),
        };
        notes.extend(read.note);
        self.conventions.0 = read.convention;
        let convention = &HEADINGS[read.convention];
        for of in self.obstacles.iter_mut().chain(&mut self.walls) {
            if conventions.headings == ReadAs::Derived {
                of.look_ahead();
            } else if of.is_oriented && read.convention > 0 {
                of.states.iter_mut().for_each(|state| state.heading_rad = convention.ours(state.heading_rad));
            }
        }
        let logs: Vec<ObstacleLog> = self.obstacles.iter().map(ObstacleLog::of).collect();
        let given: Vec<Given<'_>> = logs.iter().map(ObstacleLog::given).collect();
        let read = match conventions.velocities.named() {
            Some(convention) => conventions::Read { convention, note: None },
            None => conventions::read_velocities(&given, "all obstacles", 0),
        };
        notes.extend(read.note);
        self.conventions.1 = read.convention;
        let convention = &VELOCITIES[read.convention];
        let (mut derived, mut other_pace) = (Vec::new(), Vec::new());
        for (of, log) in self.obstacles.iter_mut().zip(&logs) {
            let mut wrong = None;
            if read.convention > 0 {
                of.states
                    .iter_mut()
                    .for_each(|state| state.speed_mps = state.speed_mps.map(|v| convention.speed_mps(v)));
            } else if conventions.velocities == ReadAs::Judged {
                wrong = conventions::wrong_velocities(&log.given());
            }
            match wrong {
                Some(Wrong::Times(times)) => other_pace.push((of.id.as_str(), times)),
                Some(Wrong::Nothing) => derived.push(of.id.as_str()),
                None => {}
            }
            if conventions.velocities == ReadAs::Derived || matches!(wrong, Some(Wrong::Nothing)) {
                of.states.iter_mut().for_each(|state| state.speed_mps = None);
            }
        }
        notes.extend(conventions::contradicting(&derived).into_iter().chain(conventions::paced(&other_pace)));
        notes.into_iter().for_each(|note| imported.leave_out(file.name, || note));
    }

    /// Moves states to the centres of their boxes, and makes edges of walls.
    fn place_boxes(&mut self) {
        for of in self.obstacles.iter_mut().chain(&mut self.walls) {
            for state in &mut of.states {
                state.heading_rad = num::wrap_angle(state.heading_rad);
                state.position = state.position + of.to_centre.rotated(state.heading_rad);
            }
        }
        for wall in self.walls.drain(..) {
            let State { position, heading_rad, .. } = wall.states[0];
            let corners = OrientedBox::new(position, heading_rad, wall.length_m, wall.width_m).corners();
            self.edges.push(vec![corners[0], corners[1], corners[2], corners[3], corners[0]]);
        }
    }

    pub fn count(&self) -> usize {
        self.obstacles.len()
    }

    pub fn edge_points(&self) -> usize {
        self.edges.iter().map(Vec::len).sum()
    }

    /// Returns the time of the last state of all moving obstacles, seconds.
    pub fn last_s(&self) -> f64 {
        let moving = self.obstacles.iter().filter(|o| !o.is_static);
        moving.flat_map(|o| o.states.last()).map(|s| s.time_s).fold(0.0, f64::max)
    }

    /// Returns the tracks of a scene that starts at `start_s` with its origin at `origin`. Obstacles that are never observed in it
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

/// Returns the states that can be read, each later than the one before it, and `true` if the file gives headings. A state that
/// cannot be read, or whose time is not later, is left out alone.
fn states<'d>(
    file: &File<'d>,
    element: &Element<'d>,
    extent: &Extent,
    is_static: bool,
    reading: &mut Reading<'_, 'd>,
) -> Result<(Vec<State>, bool), Lost> {
    let initial = element.needed_child("initialState")?;
    let trajectory = element.child("trajectory");
    let given = std::iter::once(initial).chain(trajectory.iter().flat_map(|t| t.named("state")));
    let mut states: Vec<State> = Vec::new();
    let (mut lost, mut first, mut is_oriented) = (0, None, false);
    for given in given {
        let read = state(file, &given).and_then(|state| match states.last() {
            Some(last) if last.time_s >= state.time_s => Err(given.refuse("a time after the state before it")),
            _ => Ok(state),
        });
        match read {
            Ok(state) => {
                is_oriented |= given.child("orientation").is_some();
                states.push(state);
            }
            Err(error) => {
                lost += 1;
                first = first.or(Some(error));
            }
        }
    }
    let Some(at) = states.first() else { return Err(Lost::Unread(first.unwrap_or_else(|| initial.refuse("a state")))) };
    // A circle or a square has no visible heading.
    let square = (extent.size().x - extent.size().y).abs() <= 1e-9 && extent.centre().norm() <= 1e-9;
    let mut turned = false;
    if states.iter().any(|state| !state.heading_rad.is_finite()) {
        turned = true;
        if (is_static || states.iter().all(|state| state.position.distance(at.position) <= 1e-6)) && square {
            states.iter_mut().for_each(|state| state.heading_rad = 0.0);
        } else {
            let times: Vec<f64> = states.iter().map(|state| state.time_s).collect();
            let places: Vec<Vec2> = states.iter().map(|state| state.position).collect();
            let headings = derived::headings(&times, &places);
            let headings = headings
                .ok_or_else(|| Lost::Unread(initial.refuse("an <orientation>, or motion that says where it looks")))?;
            for (state, heading) in states.iter_mut().zip(headings).filter(|(state, _)| !state.heading_rad.is_finite())
            {
                state.heading_rad = heading;
            }
        }
    }
    if !is_static && states.iter().any(|state| state.speed_mps.is_none()) {
        reading.velocities += 1;
    }
    reading.headings += usize::from(turned);
    if let Some(error) = first {
        let what = format!("{lost} states of {}", named(element));
        reading.imported.leave_out_for(what, &error, &format!("its other {} states are kept", states.len()));
    }
    Ok((states, is_oriented))
}

/// Returns the kind of a name; `None` for a name that does not show how it moves.
fn kind(name: &str, is_static: bool) -> Option<AgentKind> {
    match name {
        _ if is_static => Some(AgentKind::Static),
        // To the data sets' makers a motorcycle is a motor vehicle: the format has no riders.
        "motorcycle" => Some(AgentKind::Vehicle),
        name => derived::kind_named(name),
    }
}

/// Returns the bounding box of all parts of a shape, in the axes of its obstacle.
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

/// Returns place, heading, time and speed of a state; of an uncertain place (a region) the middle. The heading is NaN where the state
/// has none.
fn state(file: &File<'_>, element: &Element<'_>) -> Result<State, ImportError> {
    let given = element.needed_child("position")?;
    let position = match given.child("point") {
        Some(point) => file.near_point(&point)?,
        None => place(&given)?.ok_or_else(|| given.refuse("a position, found lanelets"))?,
    };
    let time = element.needed_child("time")?;
    let time = time.child("exact").ok_or_else(|| time.refuse("an exact time, found an interval"))?;
    let orientation = element.child("orientation").map(|o| exact_or_middle(&o)).transpose()?;
    let along = element.child("velocity").map(|v| exact_or_middle(&v)).transpose()?;
    // A point mass has its velocity in the axes of the map.
    let across = element.child("velocityY").map(|v| exact_or_middle(&v)).transpose()?;
    let mass = along.zip(across).map(|(x, y)| Vec2::new(x, y)).filter(|_| orientation.is_none());
    let heading = orientation.or(mass.filter(|v| v.norm() > 0.0).map(|v| num::wrap_angle(v.heading())));
    Ok(State {
        time_s: step(&time)? * file.dt_s,
        position,
        heading_rad: heading.unwrap_or(f64::NAN),
        speed_mps: mass.map(|v| v.norm()).or(along),
    })
}

/// Returns a point, or the middle of a region's bounding box; `None` for lanelets.
pub(super) fn place(position: &Element<'_>) -> Result<Option<Vec2>, ImportError> {
    if let Some(exact) = position.child("point") {
        return point(&exact).map(Some);
    }
    Ok(extent(position)?.map(|extent| extent.centre()))
}
