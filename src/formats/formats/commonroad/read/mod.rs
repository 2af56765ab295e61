//! CommonRoad XML, versions 2018b and 2020a: road, signs and lights, obstacles, and one scene per planning problem.
//! Coordinates become metres from the ego's start; headings keep their axes; steps become 0.1 s.

mod obstacles;
mod problem;
mod road;
mod signs;

use crate::formats::conventions::{Conventions, HEADINGS, Heading, VELOCITIES, Velocity};
use crate::formats::import_error::{ImportError, shown};
use crate::formats::imported::Imported;
use crate::formats::log::SampleTimes;
use crate::formats::xml_read::{Document, Element};
use crate::kernel::{Vec2, num};
use crate::scene::remainder::Remainder;
use crate::scene::validate::COORDINATE_MAX_M;
use crate::scene::{DT_S, Ego, LeftOut, Origin, Scene};

/// Steps of the longest scene made of a planning problem: 20 s.
pub const STEPS_MAX: usize = 200;
/// Most samples, map points and light states of all scenes of a file together: each planning problem gives a scene of
/// its own.
const PARTS_MAX: usize = 8_000_000;
/// Box of the ego where only a planning problem is given: CommonRoad's vehicle 2, a BMW 320i, metres.
pub const EGO_LENGTH_M: f64 = 4.508;
/// Width of the ego where the file gives none, metres.
pub const EGO_WIDTH_M: f64 = 1.610;

/// Data of the file that all parts of this importer share.
struct File<'d> {
    name: &'d str,
    root: Element<'d>,
    /// 2020a: type names for roles, signs, lights. Otherwise 2018b.
    is_2020a: bool,
    /// Seconds between two steps of the file.
    dt_s: f64,
    /// Start of the first planning problem that has one: nothing that belongs to the file lies far from there.
    here: Option<Vec2>,
    /// The conventions of its headings and velocities.
    headings: &'static Heading,
    velocities: &'static Velocity,
}

impl File<'_> {
    /// Reads headings like [`exact_or_middle`]: the middle of the arc that is run through counter-clockwise.
    fn angle(&self, element: &Element<'_>) -> Result<f64, ImportError> {
        exact_or_middle(element).map(|theirs| num::wrap_angle(self.headings.ours(theirs)))
    }

    /// Reads a place on the file's map.
    fn near_point(&self, element: &Element<'_>) -> Result<Vec2, ImportError> {
        let place = point(element)?;
        let beside = self.here.map_or(Vec2::ZERO, |here| place - here);
        if beside.x.abs().max(beside.y.abs()) > COORDINATE_MAX_M {
            return Err(element.refuse("a place within 100 km of the first planning problem"));
        }
        Ok(place)
    }
}

/// Returns the scenes of a CommonRoad file, one per planning problem. Elements that cannot be read are left out.
///
/// # Errors The file is not CommonRoad XML of a known version, is cut off, or holds no lanelet that can be read.
pub fn import(file_name: &str, bytes: &[u8]) -> Result<Imported, ImportError> {
    import_as(file_name, bytes, Conventions::default())
}

/// Does the same as [`import`] with fields read in these conventions. An export of this project is read as it is.
///
/// # Errors
/// As [`import`].
pub fn import_as(file_name: &str, bytes: &[u8], conventions: Conventions) -> Result<Imported, ImportError> {
    let document = Document::parse(file_name, bytes)?;
    let mut file = opened(file_name, document.root())?;
    if let SampleTimes::Every(step_s) = conventions.times {
        file.dt_s = step_s;
    }
    let mut imported = Imported::default();
    let network = road::read(&file, &mut imported)?;
    if let Some(text) = document.instruction("evodrive") {
        let mut own = imported.clone();
        let obstacles = obstacles::read(&file, None, &mut own);
        match exported(&file, text, &network, &obstacles) {
            Some(scene) => {
                own.scenes.push(scene);
                // Notes on derived values do not hold for the exact scene.
                own.left_out.retain(|left| !left.is_kept());
                return Ok(own);
            }
            None => imported.leave_out(file_name, || {
                let reason = "the file was edited after its export, or exported by another version; what its CommonRoad \
                              elements say was read, without the ego's log and route";
                ("<?evodrive?>".into(), reason.into())
            }),
        }
    }
    let obstacles = obstacles::read(&file, Some(conventions), &mut imported);
    let (headings, velocities) = obstacles.conventions;
    (file.headings, file.velocities) = (&HEADINGS[headings], &VELOCITIES[velocities]);
    let elements: Vec<Element<'_>> = file.root.named("planningProblem").collect();
    if elements.is_empty() {
        let reason = "it holds no planning problem, so nothing says where the ego starts";
        imported.leave_out(file_name, || (String::new(), reason.into()));
    }
    let parts = network.size() + obstacles.edge_points() + STEPS_MAX * (obstacles.count() + network.light_count());
    if elements.len().saturating_mul(parts) > PARTS_MAX {
        let expected =
            format!("at most {PARTS_MAX} samples, points of the map and light states in the scenes of all problems");
        let remedy = "split the file by planning problems";
        return Err(ImportError::new(file_name, file.root.place(), expected, remedy));
    }
    let benchmark = file.root.attribute("benchmarkID").map_or_else(
        || {
            let stem = file_name.split('.').next().unwrap_or(file_name).to_string();
            let reason = format!("there is no benchmarkID; {:?} was taken", shown(&stem));
            imported.leave_out(file_name, || (LeftOut::SCENE_ID.into(), reason));
            stem
        },
        str::to_string,
    );
    for element in &elements {
        let read = problem::read(&file, element, &network, &mut imported);
        let kept = "the ego's start is lost, and with it the scene";
        let Some(problem) = imported.read(&named(element), read, kept) else { continue };
        let id = match elements.len() {
            1 => benchmark.clone(),
            _ => format!("{benchmark}#{}", problem.id),
        };
        match scene(&file, id.clone(), &problem, &network, &obstacles) {
            Ok(scene) => match scene.validate().first() {
                None => imported.scenes.push(scene),
                Some(broken) => {
                    imported.leave_out(file_name, || (id, format!("it breaks a rule of a sound scene: {broken}")));
                }
            },
            Err(reason) => imported.leave_out(file_name, || (id, reason)),
        }
    }
    document.was_read_whole()?;
    Ok(imported)
}

/// Returns the scene that the CommonRoad elements of one of our exports give, without the private data in its processing
/// instruction.
pub(crate) fn read_plainly(file_name: &str, bytes: &[u8]) -> Result<Scene, ImportError> {
    let document = Document::parse(file_name, bytes)?;
    let file = opened(file_name, document.root())?;
    let network = road::read(&file, &mut Imported::default())?;
    let obstacles = obstacles::read(&file, None, &mut Imported::default());
    unplanned(&file, &network, &obstacles)
}

/// Returns the exact scene that was exported; `None` if the file was changed since.
fn exported(file: &File<'_>, text: &str, network: &road::Network, obstacles: &obstacles::Obstacles) -> Option<Scene> {
    let remainder = Remainder::from_text(text)?;
    let read = unplanned(file, network, obstacles).ok()?;
    remainder.laid_over(&read, &origin(file))
}

/// Returns the scene in the file's own coordinates and time, for its first planning problem; without a route.
fn unplanned(file: &File<'_>, network: &road::Network, obstacles: &obstacles::Obstacles) -> Result<Scene, ImportError> {
    let element = file.root.needed_child("planningProblem")?;
    let problem = problem::read(file, &element, network, &mut Imported::default())?;
    let id = file.root.needed_attribute("benchmarkID")?.to_string();
    let last_s = obstacles.last_s().max(problem.goal_step.map_or(0.0, |step| step * file.dt_s));
    let ego = problem::unplanned_ego(&problem);
    Ok(assembled(file, id, Zero { time_s: 0.0, place: Vec2::ZERO }, last_s, ego, network, obstacles))
}

fn opened<'d>(name: &'d str, root: Element<'d>) -> Result<File<'d>, ImportError> {
    if root.name() != "commonRoad" {
        return Err(root.refuse(format!("a root element <commonRoad>, found <{}>", shown(root.name()))));
    }
    let version = root.needed_attribute("commonRoadVersion")?;
    let is_2020a = match version {
        "2020a" => true,
        "2018b" => false,
        other => {
            let expected = format!("commonRoadVersion 2018b or 2020a, found {:?}", shown(other));
            let remedy = "convert it with commonroad-io's file reader and writer";
            return Err(ImportError::new(name, root.place(), expected, remedy));
        }
    };
    let dt_s = root.number_attribute("timeStepSize")?;
    if !(0.01..=1.0).contains(&dt_s) {
        return Err(root.refuse(format!("timeStepSize from 0.01 to 1 s, found {dt_s}")));
    }
    let starts = root.named("planningProblem").filter_map(|problem| {
        let position = problem.child("initialState")?.child("position")?.child("point")?;
        point(&position).ok()
    });
    let here = starts.into_iter().next();
    Ok(File { name, root, is_2020a, dt_s, here, headings: &HEADINGS[0], velocities: &VELOCITIES[0] })
}

fn scene(
    file: &File<'_>,
    id: String,
    problem: &problem::Problem,
    network: &road::Network,
    obstacles: &obstacles::Obstacles,
) -> Result<Scene, String> {
    let ego = problem::ego(problem, network)?;
    let start_s = problem.start_step * file.dt_s;
    let last_seen_s = obstacles.last_s() - start_s;
    let goal_s = problem.goal_step.map_or(0.0, |step| step * file.dt_s - start_s);
    let needed_s = last_seen_s.max(goal_s).max(problem::driving_time_s(&ego));
    let zero = Zero { time_s: start_s, place: problem.position };
    Ok(assembled(file, id, zero, needed_s, ego, network, obstacles))
}

/// Time and place of a file at which a scene has its own zero.
struct Zero {
    time_s: f64,
    place: Vec2,
}

/// Returns the scene that begins there.
fn assembled(
    file: &File<'_>,
    id: String,
    Zero { time_s: start_s, place: here }: Zero,
    needed_s: f64,
    ego: Ego,
    network: &road::Network,
    obstacles: &obstacles::Obstacles,
) -> Scene {
    let steps = ((needed_s / DT_S + 1e-6).floor().max(0.0) as usize + 1).clamp(2, STEPS_MAX);
    let mut scene = Scene {
        id,
        origin: origin(file),
        steps,
        current_step: 0,
        road: network.shifted(here),
        tracks: obstacles.tracks(start_s, here, steps),
        ego,
        objects_of_interest: vec![],
        lights: network.lights_over(steps, start_s, file.dt_s, here),
        stop_signs: network.stop_signs_from(here),
        crosswalks: network.crosswalks.iter().map(|line| shifted(line, here)).collect(),
        staging: None,
    };
    scene.road.edges = obstacles.edges.iter().map(|line| shifted(line, here)).collect();
    scene.ego.track.samples.resize(steps, None);
    scene
}

fn origin(file: &File<'_>) -> Origin {
    let format = if file.is_2020a { "commonroad-2020a" } else { "commonroad-2018b" };
    Origin { format: format.into(), name: file.name.into() }
}

fn shifted(line: &[Vec2], origin: Vec2) -> Vec<Vec2> {
    line.iter().map(|p| *p - origin).collect()
}

/// Names an element by its name and id.
fn named(element: &Element<'_>) -> String {
    format!("{} {}", element.name(), shown(element.attribute("id").unwrap_or("without id")))
}

/// Reads `<point><x/><y/></point>`; a height is not read.
fn point(element: &Element<'_>) -> Result<Vec2, ImportError> {
    Ok(Vec2::new(element.needed_child("x")?.number()?, element.needed_child("y")?.number()?))
}

/// Reads `<exact>`, or the middle of `<intervalStart>` and `<intervalEnd>`.
fn exact_or_middle(element: &Element<'_>) -> Result<f64, ImportError> {
    match element.child("exact") {
        Some(exact) => exact.number(),
        None => {
            let from = element.needed_child("intervalStart")?.number()?;
            let to = element.needed_child("intervalEnd")?.number()?;
            Ok(from + 0.5 * (to - from))
        }
    }
}

/// Reads a time as a step of the file, from 0 to 1 million.
fn step(element: &Element<'_>) -> Result<f64, ImportError> {
    let step = element.integer()?;
    if !(0..=1_000_000).contains(&step) {
        return Err(element.refuse(format!("a step from 0 to 1000000, found {step}")));
    }
    Ok(step as f64)
}
