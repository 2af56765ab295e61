//! A scene prepared once for many rollouts: everything recorded lies step by step in flat arrays, with unit heading
//! vectors and the bound on how far each road user reaches until the next step.

use crate::kernel::{Digest, Vec2};
use crate::scene::{AgentKind, DT_S, Light, LightState, Sample, Scene, Track, TrackIx};

use super::SimError;
use super::body::{Place, Size, coasting};
use super::course::Course;
use super::drivable::Drivable;
use super::route::Route;

/// No next sample.
pub(super) const NONE: u32 = u32::MAX;
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
/// How far a path may be straightened where only what lies on it is asked, metres.
const PATH_TOLERANCE_M: f64 = 0.05;

/// All recorded samples of a scene from the first simulated step on, ordered by step, then x, then track: who is near
/// a place is found by a search instead of a walk through everyone.
#[derive(Clone, Debug, Default)]
pub(super) struct Rows {
    /// `starts[k]..starts[k + 1]` are the rows of the k-th simulated step.
    pub starts: Vec<u32>,
    pub x: Vec<f64>,
    pub y: Vec<f64>,
    /// Radius of the box plus the way to the next sample, rounded up.
    pub reach: Vec<f32>,
    pub axis: Vec<Vec2>,
    pub velocity: Vec<Vec2>,
    pub heading: Vec<f64>,
    pub track: Vec<u32>,
    /// Row of the same track one step later, or [`NONE`].
    pub next: Vec<u32>,
    /// Largest reach of a step, metres.
    pub reach_max: Vec<f64>,
    /// Row of a track at a step, or [`NONE`]: `row_of[k * tracks + track]`.
    pub row_of: Vec<u32>,
    pub tracks: usize,
}

impl Rows {
    pub fn place(&self, row: usize) -> Place {
        Place { position: Vec2::new(self.x[row], self.y[row]), axis: self.axis[row] }
    }

    pub fn sample(&self, row: usize) -> Sample {
        Sample {
            position: Vec2::new(self.x[row], self.y[row]),
            heading_rad: self.heading[row],
            velocity: self.velocity[row],
        }
    }

    pub fn of_step(&self, k: usize) -> std::ops::Range<usize> {
        match (self.starts.get(k), self.starts.get(k + 1)) {
            (Some(&from), Some(&to)) => from as usize..to as usize,
            _ => 0..0,
        }
    }

    /// Rows of the k-th simulated step whose x lies within `radius_m` of `x`, in order.
    pub fn strip(&self, k: usize, x: f64, radius_m: f64) -> std::ops::Range<usize> {
        let all = self.of_step(k);
        let xs = &self.x[all.clone()];
        let from = xs.partition_point(|&at| at < x - radius_m);
        let count = xs[from..].iter().take_while(|&&at| at <= x + radius_m).count();
        all.start + from..all.start + from + count
    }

    /// The row of a track at the k-th simulated step.
    pub fn find(&self, k: usize, track: TrackIx) -> Option<usize> {
        match self.row_of.get(k * self.tracks + track) {
            Some(&row) if track < self.tracks && row != NONE => Some(row as usize),
            _ => None,
        }
    }

    /// Where the recorded road user of a row is at the end of the step: its next sample, or coasting if it has none.
    pub fn next_place(&self, row: usize) -> Place {
        match self.next[row] {
            NONE => Place { position: coasting(&self.sample(row), DT_S).position, axis: self.axis[row] },
            next => self.place(next as usize),
        }
    }
}

/// A vehicle that may turn reactive when it appears: its path from there on.
#[derive(Clone, Debug)]
pub(super) struct Candidate {
    /// The row at which it appears.
    pub row: u32,
    pub path: Route,
}

/// A light over the ego's route.
#[derive(Clone, Debug)]
pub(super) struct RouteLight {
    pub s_m: f64,
    /// One state a simulated step.
    pub states: Vec<LightState>,
}

/// A scene prepared once for many rollouts. Shared freely between threads.
#[derive(Clone, Debug)]
pub struct Plant {
    scene_id: String,
    first_step: usize,
    steps: usize,
    pub(super) rows: Rows,
    pub(super) sizes: Vec<Size>,
    pub(super) ego_size: Size,
    pub(super) ego_start: Sample,
    /// The ego's recorded motion from the first simulated step on.
    pub(super) ego_log: Vec<Option<Sample>>,
    pub(super) target_speed_mps: Option<f64>,
    pub(super) route: Route,
    /// The route straightened a little: quicker to search for what is ahead.
    pub(super) route_ahead: Route,
    pub(super) drivable: Drivable,
    /// For scenes of a traffic family: they are run under SafeBench's rules.
    pub(super) course: Option<Course>,
    /// Vehicles that may turn reactive, by the simulated step at which they appear.
    pub(super) candidates: Vec<Vec<Candidate>>,
    pub(super) lights: Vec<RouteLight>,
    /// Digest of everything above that a rollout replays.
    pub(super) digest: Digest,
}

impl Plant {
    /// Prepares a scene. Errors name the first thing that cannot be simulated.
    pub fn new(scene: &Scene) -> Result<Plant, SimError> {
        check(scene)?;
        let first_step = scene.ego.start_step;
        let steps = scene.steps - 1 - first_step;
        let size = |t: &Track| Size::new(t.kind, t.length_m, t.width_m);
        let sizes: Vec<Size> = scene.tracks.iter().map(size).collect();
        let rows = rows_of(scene, &sizes);
        let refuse = |place: &str, rule| error(scene, place.to_string(), rule);
        let start = *scene.ego.track.at(first_step).ok_or_else(|| refuse("ego", "needs a sample at its start step"))?;
        let route = Route::new(&scene.ego.route, start.heading_rad)
            .ok_or_else(|| refuse("ego route", "needs at least one finite point"))?;
        let route_ahead = Route::simplified(&scene.ego.route, start.heading_rad, PATH_TOLERANCE_M)
            .ok_or_else(|| refuse("ego route", "needs at least one finite point"))?;
        let ego_log = (first_step..scene.steps).map(|k| scene.ego.track.at(k).copied()).collect();
        let mut plant = Plant {
            scene_id: scene.id.clone(),
            first_step,
            steps,
            candidates: candidates_of(scene, &rows, steps),
            lights: scene.lights.iter().filter_map(|l| route_light(l, &route, first_step)).collect(),
            rows,
            sizes,
            ego_size: size(&scene.ego.track),
            ego_start: start,
            ego_log,
            target_speed_mps: scene.ego.target_speed_mps,
            course: scene.staging.as_ref().map(|_| Course::new(scene, &route)),
            route,
            route_ahead,
            drivable: Drivable::new(&scene.road),
            digest: Digest::of_bytes(&[]),
        };
        plant.digest = plant.content_digest();
        Ok(plant)
    }

    pub fn scene_id(&self) -> &str {
        &self.scene_id
    }

    /// The scene's step at which the closed loop begins.
    pub fn first_step(&self) -> usize {
        self.first_step
    }

    /// The most decision steps a rollout can take: up to the scene's last sample.
    pub fn steps(&self) -> usize {
        self.steps
    }

    /// Number of recorded tracks besides the ego.
    pub fn tracks(&self) -> usize {
        self.sizes.len()
    }

    /// The path the ego is to drive.
    pub fn route(&self) -> &Route {
        &self.route
    }

    /// Where the ego begins.
    pub fn ego_start(&self) -> &Sample {
        &self.ego_start
    }

    /// Speed to aim at where the scene gives one, m/s.
    pub fn target_speed_mps(&self) -> Option<f64> {
        self.target_speed_mps
    }

    /// Whether the scene belongs to one of SafeBench's traffic families and is run under its rules.
    pub fn is_staged(&self) -> bool {
        self.course.is_some()
    }

    /// Whether the ego's recorded motion goes on after its start.
    pub fn has_ego_log(&self) -> bool {
        self.ego_log.get(1).is_some_and(Option::is_some)
    }

    /// Digest of what a rollout replays from this scene.
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
        for row in 0..rows.x.len() {
            let sample = rows.sample(row);
            put(f64::from(rows.track[row]));
            put_sample(&mut put, &sample);
        }
        put_sample(&mut put, &self.ego_start);
        for point in self.route.points() {
            put(point.x);
            put(point.y);
        }
        Digest::from_array(*hasher.finalize().as_bytes())
    }
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

/// Whether coordinates can be simulated; NaN can not.
pub(super) fn in_range(p: Vec2) -> bool {
    // NaN compares false.
    p.x.abs() <= POSITION_M_MAX && p.y.abs() <= POSITION_M_MAX
}

/// Whether a sample can be simulated.
pub(super) fn sample_is_sound(sample: &Sample) -> bool {
    in_range(sample.position)
        && sample.heading_rad.abs() <= 1e6
        && sample.velocity.x.abs() <= SPEED_MPS_MAX
        && sample.velocity.y.abs() <= SPEED_MPS_MAX
}

/// Whether a box can be simulated.
pub(super) fn size_is_sound(length_m: f64, width_m: f64) -> bool {
    length_m > 0.0 && length_m <= LENGTH_M_MAX && width_m > 0.0 && width_m <= LENGTH_M_MAX
}

fn rows_of(scene: &Scene, sizes: &[Size]) -> Rows {
    let tracks = scene.tracks.len();
    let mut rows = Rows { starts: vec![0], tracks, ..Rows::default() };
    let mut present: Vec<(usize, &Sample)> = Vec::with_capacity(tracks);
    for step in scene.ego.start_step..scene.steps {
        present.clear();
        present.extend(scene.tracks.iter().enumerate().filter_map(|(i, track)| Some((i, track.at(step)?))));
        present.sort_by(|a, b| a.1.position.x.total_cmp(&b.1.position.x).then(a.0.cmp(&b.0)));
        let now = rows.row_of.len();
        rows.row_of.resize(now + tracks, NONE);
        for &(track, sample) in &present {
            let row = rows.x.len() as u32;
            rows.row_of[now + track] = row;
            if now >= tracks && rows.row_of[now - tracks + track] != NONE {
                rows.next[rows.row_of[now - tracks + track] as usize] = row;
            }
            rows.push(track, sample);
        }
        rows.starts.push(rows.x.len() as u32);
    }
    rows.measure_reach(sizes);
    rows
}

impl Rows {
    fn push(&mut self, track: usize, sample: &Sample) {
        self.x.push(sample.position.x);
        self.y.push(sample.position.y);
        self.axis.push(Vec2::from_heading(sample.heading_rad));
        self.velocity.push(sample.velocity);
        self.heading.push(sample.heading_rad);
        self.track.push(track as u32);
        self.next.push(NONE);
    }

    fn measure_reach(&mut self, sizes: &[Size]) {
        let reach_of = |row: usize| {
            let way = self.next_place(row).position.distance(self.place(row).position);
            // A little more than the exact bound, so that rounding to f32 can never cut a contact off.
            ((sizes[self.track[row] as usize].radius_m + way) * 1.000_001) as f32
        };
        self.reach = (0..self.x.len()).map(reach_of).collect();
        self.reach_max = (0..self.starts.len() - 1)
            .map(|k| self.of_step(k).map(|row| f64::from(self.reach[row])).fold(0.0, f64::max))
            .collect();
    }
}

/// Vehicles that move (MetaDrive's rules for reactive traffic that do not depend on the ego), by step of appearance.
fn candidates_of(scene: &Scene, rows: &Rows, steps: usize) -> Vec<Vec<Candidate>> {
    let mut found: Vec<Vec<Candidate>> = vec![Vec::new(); steps + 1];
    for (i, track) in scene.tracks.iter().enumerate() {
        if track.kind != AgentKind::Vehicle || !moves(track) {
            continue;
        }
        let mut present = false;
        for (k, appearing) in found.iter_mut().enumerate() {
            let row = rows.find(k, i);
            if let (Some(row), false) = (row, present) {
                appearing.extend(candidate(rows, row));
            }
            present = row.is_some();
        }
    }
    found
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

fn candidate(rows: &Rows, row: usize) -> Option<Candidate> {
    let mut points = vec![rows.place(row).position];
    let mut at = row;
    while rows.next[at] != NONE {
        at = rows.next[at] as usize;
        points.push(rows.place(at).position);
    }
    if points[0].distance(points[points.len() - 1]) <= PATH_M_MIN {
        return None;
    }
    let path = Route::simplified(&points, rows.heading[row], PATH_TOLERANCE_M)?;
    Some(Candidate { row: row as u32, path })
}

fn route_light(light: &Light, route: &Route, first_step: usize) -> Option<RouteLight> {
    let at = route.project(light.stop_point);
    let on_route = at.offset_m.abs() <= LIGHT_OFFSET_M && at.s_m >= 0.0 && at.s_m <= route.length_m();
    on_route.then(|| RouteLight { s_m: at.s_m, states: light.states.iter().skip(first_step).copied().collect() })
}
