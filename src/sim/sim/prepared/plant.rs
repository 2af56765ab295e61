//! A scene prepared once for many rollouts. Recorded data stays in the scene, which is shared. The plant holds the rows
//! that say who is where at a step, the route, the road's surface and the vehicles that may turn reactive.

use std::sync::{Arc, OnceLock};

use crate::kernel::{Digest, Vec2};
use crate::scene::{AgentKind, LaneGraph, Light, LightState, PreparedScene, Sample, Scene, Track, TrackIx};
use crate::sim::SimError;
use crate::sim::accounts::feasibility::{self, Feasibility};
use crate::sim::accounts::of_kind::{self, OfKind};
use crate::sim::accounts::of_place::{OfPlace, Places};
use crate::sim::road_users::bicycle::Limits;

use super::body::Size;
use super::course::Course;
use super::drivable::Drivable;
use super::edges::Edges;
use super::options::SimulatorOptions;
use super::path::Path;
use super::plant_options::{EgoBox, EgoCar, METADRIVE_BOX_M, Obstacle};
use super::rows::{NONE, Rows};

/// Coordinates beyond this are refused, metres.
pub const POSITION_M_MAX: f64 = 1e7;
/// Speeds beyond this are refused, m/s.
pub const SPEED_MPS_MAX: f64 = 1e3;
/// Boxes longer than this are refused, metres.
pub const LENGTH_M_MAX: f64 = 100.0;
/// Longer scenes are refused, samples.
pub const STEPS_MAX: usize = 100_000;
/// A light this near to the route is on it, metres.
const LIGHT_OFFSET_M: f64 = 2.0;
/// MetaDrive: a vehicle whose positions spread less than this never becomes reactive, metres (standard deviation).
const MOVING_M: f64 = 3.0;
/// MetaDrive: a reactive vehicle's path is at least this long between its ends, metres.
const PATH_M_MIN: f64 = 5.0;
/// Tolerance for straightening a path that is only used to ask what lies on it, metres.
const PATH_TOLERANCE_M: f64 = 0.05;

/// A vehicle that may turn reactive when it appears: its path from there on.
#[derive(Clone, Debug)]
pub(in crate::sim) struct Candidate {
    /// The row at which it appears.
    pub row: u32,
    pub path: Path,
}

/// A light over the ego's route.
#[derive(Clone, Debug)]
pub(in crate::sim) struct RouteLight {
    pub s_m: f64,
    /// State at each simulated step.
    pub states: Vec<LightState>,
}

/// A scene prepared once for many rollouts. Shared freely between threads.
#[derive(Clone, Debug)]
pub struct Plant {
    prepared: Arc<PreparedScene>,
    options: SimulatorOptions,
    limits: Limits,
    steps: usize,
    pub(in crate::sim) rows: Rows,
    pub(in crate::sim) sizes: Vec<Size>,
    pub(in crate::sim) ego_size: Size,
    pub(in crate::sim) ego_start: Sample,
    pub(in crate::sim) route: Path,
    /// The route straightened a little, which makes the search for obstacles ahead quicker.
    pub(in crate::sim) route_ahead: Path,
    /// The route as a lane of MetaDrive's, for plants that copy its driver exactly.
    lane: Option<Path>,
    pub(in crate::sim) drivable: Drivable,
    /// Road data for scenes of a traffic family, which are run under SafeBench's rules.
    pub(in crate::sim) course: Option<Course>,
    /// Vehicles that may turn reactive, by the simulated step at which they appear.
    pub(in crate::sim) candidates: Vec<Vec<Candidate>>,
    pub(in crate::sim) lights: Vec<RouteLight>,
    /// Feasibility of each track's recording, computed when it is first asked for: every rollout asks again.
    recorded: Vec<OnceLock<Feasibility>>,
    /// The same for motion that a track's kind does not do.
    recorded_of_kind: Vec<OnceLock<OfKind>>,
    /// The same for places where a track's kind does not belong.
    recorded_of_place: Vec<OnceLock<OfPlace>>,
    /// Edges of the road, built when they are first asked for.
    edges: OnceLock<Edges>,
    /// Digest of everything above that a rollout replays.
    pub(in crate::sim) digest: Digest,
}

impl Plant {
    /// Prepares a copy of a scene under the shipped options. Errors name the first thing that cannot be simulated.
    pub fn new(scene: &Scene) -> Result<Plant, SimError> {
        Plant::shared(PreparedScene::new(Arc::new(scene.clone())))
    }

    /// [`Plant::new`] without a copy: the plant reads the recorded samples in the scene itself.
    pub fn shared(prepared: Arc<PreparedScene>) -> Result<Plant, SimError> {
        Plant::with_options(prepared, &SimulatorOptions::SHIPPED)
    }

    /// [`Plant::shared`] under the options of an experiment.
    pub fn with_options(prepared: Arc<PreparedScene>, options: &SimulatorOptions) -> Result<Plant, SimError> {
        let scene = &prepared.scene;
        check(scene)?;
        let first_step = scene.ego.start_step;
        let steps = scene.steps - 1 - first_step;
        let size = |t: &Track| options.plant.traffic_boxes.size(t.kind, t.length_m, t.width_m);
        let sizes: Vec<Size> = scene.tracks.iter().map(size).collect();
        let rows = Rows::new(scene.clone(), &sizes);
        let refuse = |place: &str, rule| error(scene, place.to_string(), rule);
        let start = *scene.ego.track.at(first_step).ok_or_else(|| refuse("ego", "needs a sample at its start step"))?;
        let route = Path::new(&scene.ego.route, start.heading_rad)
            .ok_or_else(|| refuse("ego route", "needs at least one finite point"))?;
        let route_ahead = Path::simplified(&scene.ego.route, start.heading_rad, PATH_TOLERANCE_M)
            .ok_or_else(|| refuse("ego route", "needs at least one finite point"))?;
        let by_lane = options.plant.ego_car == EgoCar::Sprung || options.plant.obstacle == Obstacle::Lane;
        let lane = || {
            Path::lane(&scene.ego.route, start.heading_rad)
                .ok_or_else(|| refuse("ego route", "needs at least one finite point"))
        };
        let lane = by_lane.then(lane).transpose()?;
        let mut plant = Plant {
            steps,
            candidates: candidates_of(scene, &rows, steps),
            lights: scene.lights.iter().filter_map(|l| route_light(l, &route, first_step)).collect(),
            rows,
            recorded: vec![OnceLock::new(); sizes.len()],
            recorded_of_kind: vec![OnceLock::new(); sizes.len()],
            recorded_of_place: vec![OnceLock::new(); sizes.len()],
            edges: OnceLock::new(),
            sizes,
            ego_size: ego_size(&scene.ego.track, options.plant.ego_box),
            ego_start: start,
            course: scene.staging.as_ref().map(|_| Course::new(scene, &route)),
            route,
            route_ahead,
            lane,
            drivable: Drivable::of(prepared.lanes.pieces().clone()),
            digest: Digest::of_bytes(&[]),
            prepared,
            options: *options,
            limits: options.plant.limits(),
        };
        plant.digest = plant.content_digest();
        Ok(plant)
    }

    /// Returns the scene that was prepared.
    pub fn scene(&self) -> &Arc<Scene> {
        &self.prepared.scene
    }

    /// Returns the rules under which it is simulated.
    pub fn options(&self) -> &SimulatorOptions {
        &self.options
    }

    /// Returns the limits of the ego's car and of reactive traffic.
    pub fn limits(&self) -> &Limits {
        &self.limits
    }

    /// Returns the graph of its lanes.
    pub fn lanes(&self) -> &Arc<LaneGraph> {
        &self.prepared.lanes
    }

    /// Returns the scene's name.
    pub fn scene_id(&self) -> &str {
        &self.prepared.scene.id
    }

    /// Returns the scene's step at which the closed loop begins.
    pub fn first_step(&self) -> usize {
        self.prepared.scene.ego.start_step
    }

    /// Returns the most decision steps a rollout can take: up to the scene's last sample.
    pub fn steps(&self) -> usize {
        self.steps
    }

    /// Returns the number of recorded tracks besides the ego.
    pub fn tracks(&self) -> usize {
        self.sizes.len()
    }

    /// Returns the path the ego is to drive.
    pub fn route(&self) -> &Path {
        &self.route
    }

    /// Returns the same as a lane of MetaDrive's, where the plant has one.
    pub fn lane(&self) -> Option<&Path> {
        self.lane.as_ref()
    }

    /// Returns the ego's first sample.
    pub fn ego_start(&self) -> &Sample {
        &self.ego_start
    }

    /// Returns the speed to aim at where the scene gives one, m/s.
    pub fn target_speed_mps(&self) -> Option<f64> {
        self.prepared.scene.ego.target_speed_mps
    }

    /// Returns `true` if the scene belongs to one of SafeBench's traffic families and is run under its rules.
    pub fn is_staged(&self) -> bool {
        self.course.is_some()
    }

    /// Returns the ego as recorded at the k-th simulated step.
    pub(in crate::sim) fn ego_log(&self, k: usize) -> Option<&Sample> {
        self.prepared.scene.ego.track.at(self.first_step() + k)
    }

    /// Returns the feasibility of a track as it was recorded.
    pub fn recorded(&self, track: TrackIx) -> Feasibility {
        *self.recorded[track].get_or_init(|| {
            feasibility::of_recording(&self.drivable, &self.scene().tracks[track].samples, &self.sizes[track])
        })
    }

    /// Returns the account of motion in a track's recording that its kind does not do.
    pub fn recorded_of_kind(&self, track: TrackIx) -> OfKind {
        let samples = || of_kind::of_recording(&self.scene().tracks[track].samples, &self.sizes[track]);
        *self.recorded_of_kind[track].get_or_init(samples)
    }

    /// Returns the account of a track's recording in places where its kind does not belong.
    pub fn recorded_of_place(&self, track: TrackIx) -> OfPlace {
        let track_of = &self.scene().tracks[track];
        let account = || self.places().of_recording(&track_of.samples, track_of.kind);
        *self.recorded_of_place[track].get_or_init(account)
    }

    /// Returns lanes and edges, to say where a kind does not belong.
    pub(in crate::sim) fn places(&self) -> Places<'_> {
        let edges = self.edges.get_or_init(|| Edges::of(&self.scene().road.edges));
        Places { lanes: self.lanes().pieces(), edges }
    }

    /// Returns the feasibility of a motion of a road user of this size, one sample a step.
    pub fn feasibility_of(&self, kind: AgentKind, length_m: f64, width_m: f64, samples: &[Sample]) -> Feasibility {
        let samples: Vec<Option<Sample>> = samples.iter().copied().map(Some).collect();
        feasibility::of_recording(&self.drivable, &samples, &self.size_of(kind, length_m, width_m))
    }

    /// Returns the box under these rules of a road user of this kind, length and width, metres.
    pub(in crate::sim) fn size_of(&self, kind: AgentKind, length_m: f64, width_m: f64) -> Size {
        self.options.plant.traffic_boxes.size(kind, length_m, width_m)
    }

    /// Returns the digest of everything that a rollout replays from this scene.
    pub fn digest(&self) -> Digest {
        self.digest
    }

    fn content_digest(&self) -> Digest {
        let mut hasher = blake3::Hasher::new_derive_key("evodrive/sim/1 plant");
        let mut put = |x: f64| {
            hasher.update(&x.to_bits().to_le_bytes());
        };
        let rows = &self.rows;
        for size in self.sizes.iter().chain([&self.ego_size]) {
            put(f64::from(size.kind as u8));
            put(size.half_length_m);
            put(size.half_width_m);
        }
        for &start in &rows.starts {
            put(f64::from(start));
        }
        for k in 0..=self.steps {
            for row in rows.of_step(k) {
                put(f64::from(rows.track[row]));
                put_sample(&mut put, rows.sample(k, row));
            }
        }
        put_sample(&mut put, &self.ego_start);
        for point in self.route.points() {
            put(point.x);
            put(point.y);
        }
        Digest::from_array(*hasher.finalize().as_bytes())
    }
}

fn ego_size(track: &Track, ego_box: EgoBox) -> Size {
    let (length_m, width_m) = match ego_box {
        EgoBox::Recorded => (track.length_m, track.width_m),
        EgoBox::MetadriveDefault => METADRIVE_BOX_M,
    };
    Size::new(track.kind, length_m, width_m)
}

fn put_sample(put: &mut impl FnMut(f64), sample: &Sample) {
    for x in [sample.position.x, sample.position.y, sample.heading_rad, sample.velocity.x, sample.velocity.y] {
        put(x);
    }
}

fn error(scene: &Scene, place: String, rule: &'static str) -> SimError {
    SimError::Scene { scene: scene.id.clone(), place, rule }
}

fn check(scene: &Scene) -> Result<(), SimError> {
    let first = scene.ego.start_step;
    if first + 1 >= scene.steps {
        return Err(error(scene, format!("ego start step {first}"), "needs at least one step after it"));
    }
    if scene.steps > STEPS_MAX {
        return Err(error(scene, format!("{} steps", scene.steps), "needs at most 100000 steps"));
    }
    for (name, track) in scene.tracks.iter().map(|t| (t.id.as_str(), t)).chain([("ego", &scene.ego.track)]) {
        check_track(scene, name, track)?;
    }
    if scene.tracks.len() >= NONE as usize || scene.tracks.len().saturating_mul(scene.steps) >= NONE as usize {
        return Err(error(scene, "tracks".into(), "needs fewer than 2^32 samples in all"));
    }
    let bad = |p: &Vec2| !in_range(*p);
    if scene.ego.route.iter().any(bad) {
        return Err(error(scene, "ego route".into(), "needs finite points within 1e7 m"));
    }
    for (i, lane) in scene.road.lanes.iter().enumerate() {
        if lane.centre.iter().chain(&lane.left).chain(&lane.right).any(bad) {
            return Err(error(scene, format!("lane {i}"), "needs finite points within 1e7 m"));
        }
    }
    Ok(())
}

fn check_track(scene: &Scene, name: &str, track: &Track) -> Result<(), SimError> {
    if !size_is_sound(track.length_m, track.width_m) {
        return Err(error(scene, format!("track {name}"), "needs length and width above 0 and at most 100 m"));
    }
    if track.samples.len() > scene.steps {
        return Err(error(scene, format!("track {name}"), "has more samples than the scene has steps"));
    }
    match track.samples.iter().position(|s| s.as_ref().is_some_and(|s| !sample_is_sound(s))) {
        Some(step) => Err(error(
            scene,
            format!("track {name}, step {step}"),
            "needs finite numbers, positions within 1e7 m and speeds within 1000 m/s",
        )),
        None => Ok(()),
    }
}

/// Returns `true` if coordinates can be simulated; NaN can not.
pub(in crate::sim) fn in_range(p: Vec2) -> bool {
    // NaN compares false.
    p.x.abs() <= POSITION_M_MAX && p.y.abs() <= POSITION_M_MAX
}

/// Returns `true` if a sample can be simulated.
pub(in crate::sim) fn sample_is_sound(sample: &Sample) -> bool {
    in_range(sample.position)
        && sample.heading_rad.abs() <= 1e6
        && sample.velocity.x.abs() <= SPEED_MPS_MAX
        && sample.velocity.y.abs() <= SPEED_MPS_MAX
}

/// Returns `true` if a box can be simulated.
pub(in crate::sim) fn size_is_sound(length_m: f64, width_m: f64) -> bool {
    length_m > 0.0 && length_m <= LENGTH_M_MAX && width_m > 0.0 && width_m <= LENGTH_M_MAX
}

/// Returns vehicles that move (MetaDrive's rules for reactive traffic that do not depend on the ego), by step of appearance.
fn candidates_of(scene: &Scene, rows: &Rows, steps: usize) -> Vec<Vec<Candidate>> {
    let mut candidates: Vec<Vec<Candidate>> = vec![Vec::new(); steps + 1];
    for (i, track) in scene.tracks.iter().enumerate() {
        if track.kind != AgentKind::Vehicle || !moves(track) {
            continue;
        }
        let mut present = false;
        for (k, appearing) in candidates.iter_mut().enumerate() {
            let row = rows.find(k, i);
            if let (Some(row), false) = (row, present) {
                appearing.extend(candidate(rows, k, row));
            }
            present = row.is_some();
        }
    }
    candidates
}

fn moves(track: &Track) -> bool {
    let spread = |of: fn(&Sample) -> f64| {
        let values: Vec<f64> = track.samples.iter().flatten().map(of).collect();
        let mean = crate::kernel::num::mean(&values).unwrap_or(0.0);
        let squares = crate::kernel::num::sum(values.iter().map(|v| (v - mean) * (v - mean)));
        (squares / values.len().max(1) as f64).sqrt()
    };
    spread(|s| s.position.x).max(spread(|s| s.position.y)) > MOVING_M
}

fn candidate(rows: &Rows, born: usize, row: usize) -> Option<Candidate> {
    let track = rows.track[row] as usize;
    let places = (born..).map_while(|k| rows.find(k, track)).map(|row| rows.place(row).position);
    let points: Vec<Vec2> = places.collect();
    if points[0].distance(points[points.len() - 1]) <= PATH_M_MIN {
        return None;
    }
    let path = Path::simplified(&points, rows.sample(born, row).heading_rad, PATH_TOLERANCE_M)?;
    Some(Candidate { row: row as u32, path })
}

fn route_light(light: &Light, route: &Path, first_step: usize) -> Option<RouteLight> {
    let at = route.project(light.stop_point);
    let on_route = at.offset_m.abs() <= LIGHT_OFFSET_M && at.s_m >= 0.0 && at.s_m <= route.length_m();
    on_route.then(|| RouteLight { s_m: at.s_m, states: light.states.iter().skip(first_step).copied().collect() })
}
