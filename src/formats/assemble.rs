//! Builds a scene from what all logged formats have in common: tracks with validity, centre lines with widths, ids. The
//! scene is in the ego's local frame at the current step.

use std::collections::BTreeMap;

use super::centreline::{Across, lines, thinned, thinned_line};
use super::resample::{State, resample};
use super::topology::{link_by_ends, link_side_by_side};
use crate::kernel::{Vec2, num};
use crate::scene::validate::{LINKS_MAX, SIDE_MAX_M, SIDE_MIN_M, SPEED_MAX_MPS};
use crate::scene::{
    AgentKind, DT_S, Ego, Lane, LaneIx, LaneKind, LeftOut, Light, LightState, Neighbour, Origin, Road, Sample, Scene,
    StopSign, Track,
};

/// A sample time at most this far from the 0.1 s grid counts as lying on it, seconds.
const ON_GRID_WITHIN_S: f64 = 0.02;
/// Most samples of all road users and states of all lights, after resampling.
const SAMPLES_MAX: usize = 4_000_000;
const LANES_MAX: usize = 50_000;
/// Most road users that a log marks.
const MARKED_MAX: usize = 1000;
/// Points of a logged route lie at least this far apart, metres: a standing car's jitter is no path.
const ROUTE_SPACING_M: f64 = 0.5;

/// A scene as the log holds it, in the log's coordinates.
#[derive(Default)]
pub struct Log {
    /// Id of the scene.
    pub id: String,
    /// Where it came from.
    pub origin: Origin,
    /// Time of each sample, seconds, increasing.
    pub times_s: Vec<f64>,
    /// Index of the current step in `times_s`.
    pub current: usize,
    /// Where the local frame has its origin; `None` takes the ego's place at the current step.
    pub frame: Option<Vec2>,
    /// Everyone, the ego included.
    pub tracks: Vec<LogTrack>,
    /// Index of the ego in `tracks`.
    pub ego: usize,
    /// Ids of tracks.
    pub objects_of_interest: Vec<String>,
    /// The lanes of its map.
    pub lanes: Vec<LogLane>,
    /// Curbs and other edges, each a line.
    pub edges: Vec<Vec<Vec2>>,
    /// Crosswalks, each an outline.
    pub crosswalks: Vec<Vec<Vec2>>,
    /// Place of each stop sign, and ids of the lanes that it holds for.
    pub stop_signs: Vec<(Vec2, Vec<String>)>,
    /// The traffic lights of its map.
    pub lights: Vec<LogLight>,
}

/// Samples at the log's times.
pub struct LogTrack {
    /// Id in the log.
    pub id: String,
    /// What kind of road user it is.
    pub kind: AgentKind,
    /// 0 where the log gives none.
    pub length_m: f64,
    /// 0 where the log gives none.
    pub width_m: f64,
    /// One a time of the log; `None` where it was not observed. `[times]`
    pub samples: Vec<Option<Sample>>,
}

/// A lane with links by id. A link to a lane that the log does not hold leads out of the map.
pub struct LogLane {
    /// Id in the log.
    pub id: String,
    /// What kind of lane it is.
    pub kind: LaneKind,
    /// Points of the centre line, in driving direction.
    pub points: Vec<Across>,
    /// Lanes that lead into it.
    pub entries: Vec<String>,
    /// Lanes that it leads into.
    pub exits: Vec<String>,
    /// Lanes to its left, the one that is beside it for the longest way first.
    pub left: Vec<String>,
    /// Lanes to its right, likewise.
    pub right: Vec<String>,
    /// Speed limit where the log gives one, m/s.
    pub speed_limit_mps: Option<f64>,
}

/// States at the log's times.
pub struct LogLight {
    /// Id of its lane.
    pub lane: String,
    /// Where traffic stops; `None` where the log does not say.
    pub stop_point: Option<Vec2>,
    /// One state a time of the log. `[times]`
    pub states: Vec<LightState>,
}

/// The scene, and a sentence for each part of the log that is not in it as the log has it.
pub fn assembled(mut log: Log) -> Result<(Scene, Vec<(String, String)>), String> {
    let mut left_out = Vec::new();
    let start_s = *log.times_s.first().ok_or("it has no samples")?;
    let times: Vec<f64> = log.times_s.iter().map(|t| t - start_s).collect();
    if times.windows(2).any(|w| w[1] <= w[0]) {
        return Err("its sample times do not increase".into());
    }
    let on_grid = times.iter().enumerate().all(|(k, t)| (t - k as f64 * DT_S).abs() <= ON_GRID_WITHIN_S);
    if !on_grid {
        left_out.push((LeftOut::SAMPLE_TIMES.into(), off_grid(&times)));
    }
    let last_s = times[times.len() - 1];
    let steps = if on_grid { times.len() } else { (last_s / DT_S + 1e-6) as usize + 1 };
    if !(2..=crate::scene::validate::STEPS_MAX).contains(&steps) {
        return Err(format!("it has {steps} steps of 0.1 s; 2 to 1200 are read"));
    }
    if log.tracks.len().max(log.lights.len()).saturating_mul(steps) > SAMPLES_MAX {
        let (tracks, lights) = (log.tracks.len(), log.lights.len());
        return Err(format!("its {tracks} tracks and {lights} lights over {steps} steps are more than {SAMPLES_MAX}"));
    }
    if log.lanes.len() > LANES_MAX || log.objects_of_interest.len() > MARKED_MAX {
        let (lanes, marked) = (log.lanes.len(), log.objects_of_interest.len());
        return Err(format!("it has {lanes} lanes and {marked} objects of interest; 50000 and 1000 are read"));
    }
    let now_s = times.get(log.current).copied().ok_or("its current step lies beyond its end")?;
    let current_step = if on_grid { log.current } else { (now_s / DT_S).round() as usize };
    let clock = Clock { times, on_grid, steps };
    let dropped: Vec<usize> = log.tracks.iter_mut().map(|track| drop_unsound(&mut track.samples)).collect();
    let ego = log.tracks.get(log.ego).ok_or("its ego is not among its tracks")?;
    let here = ego.samples.get(log.current).copied().flatten().map(|sample| sample.position);
    let origin = log.frame.or(here).ok_or("the ego is not observed at the current step")?;
    let mut tracks: Vec<Track> = log.tracks.iter().map(|track| clock.track(track, origin)).collect();
    for (track, dropped) in tracks.iter_mut().zip(dropped) {
        let dropped = dropped + drop_unsound(&mut track.samples);
        if dropped > 0 {
            let reason = format!("not finite, or faster than {SPEED_MAX_MPS} m/s; the rest of the track is kept");
            left_out.push((format!("{dropped} samples of track {}", track.id), reason));
        }
    }
    let ego = ego_of(tracks.remove(log.ego), current_step)?;
    tracks.retain(|track| {
        let seen = track.span().is_some();
        if !seen {
            left_out.push((format!("track {}", track.id), "it is never observed".into()));
        }
        seen
    });
    let (road, index) = road(&log, origin, &mut left_out);
    let wanted = |id: &String| tracks.iter().position(|track| track.id == *id);
    let scene = Scene {
        id: log.id,
        origin: log.origin,
        steps,
        current_step,
        objects_of_interest: log.objects_of_interest.iter().filter_map(wanted).collect(),
        tracks,
        ego,
        lights: lights(&log.lights, &road, &index, &clock, origin, &mut left_out),
        stop_signs: stop_signs(&log.stop_signs, &index, origin),
        crosswalks: log.crosswalks.iter().filter(|c| c.len() >= 3).map(|c| shifted(c, origin)).collect(),
        staging: None,
        road,
    };
    Ok((scene, left_out))
}

/// Removes samples that no scene may hold, and counts them.
fn drop_unsound(samples: &mut [Option<Sample>]) -> usize {
    let sound = |sample: &Sample| {
        let finite = sample.position.is_finite() && sample.heading_rad.is_finite() && sample.velocity.is_finite();
        finite && sample.speed_mps() <= SPEED_MAX_MPS
    };
    let mut dropped = 0;
    for sample in samples {
        if sample.is_some_and(|sample| !sound(&sample)) {
            *sample = None;
            dropped += 1;
        }
    }
    dropped
}

/// Says that motion was read at other times than the log's.
fn off_grid(times: &[f64]) -> String {
    let beside_s = |time: &f64| (time - (time / DT_S).round() * DT_S).abs();
    let most_s = times.iter().map(beside_s).fold(0.0, f64::max);
    let (count, last_s) = (times.len(), times[times.len() - 1]);
    if most_s > ON_GRID_WITHIN_S {
        return format!("they lie up to {most_s:.3} s off the grid of 0.1 s; all motion was resampled to the grid");
    }
    format!("{count} samples over {last_s:.1} s are not one every 0.1 s; all motion was resampled to steps of 0.1 s")
}

struct Clock {
    times: Vec<f64>,
    on_grid: bool,
    steps: usize,
}

impl Clock {
    fn track(&self, log: &LogTrack, origin: Vec2) -> Track {
        let here = |s: &Sample| Sample {
            position: s.position - origin,
            heading_rad: num::wrap_angle(s.heading_rad),
            velocity: s.velocity,
        };
        let samples = if self.on_grid {
            (0..self.steps).map(|k| log.samples.get(k).copied().flatten().as_ref().map(here)).collect()
        } else {
            let observed = log.samples.iter().flatten().count();
            let states: Vec<State> = log
                .samples
                .iter()
                .zip(&self.times)
                .filter_map(|(sample, &time_s)| {
                    let Sample { position, heading_rad, velocity } = here(sample.as_ref()?);
                    // One place alone says nothing of speed.
                    let along = velocity.dot(Vec2::from_heading(heading_rad));
                    Some(State { time_s, position, heading_rad, speed_mps: (observed == 1).then_some(along) })
                })
                .collect();
            resample(&states, self.steps)
        };
        let (length_m, width_m) = sides(log);
        Track { id: log.id.clone(), kind: log.kind, length_m, width_m, samples }
    }

    /// Index of the last log sample at or before a step.
    fn sample_at(&self, step: usize) -> usize {
        if self.on_grid {
            return step;
        }
        self.times.partition_point(|t| *t <= step as f64 * DT_S + 1e-6).saturating_sub(1)
    }
}

/// A plausible box: as in the log, or else the usual size of its kind.
fn sides(log: &LogTrack) -> (f64, f64) {
    let usual = match log.kind {
        AgentKind::Vehicle => (4.5, 1.9),
        AgentKind::Pedestrian => (0.6, 0.6),
        AgentKind::Cyclist => (1.8, 0.7),
        AgentKind::Static => (0.5, 0.5),
    };
    let side = |given: f64, usual: f64| {
        if given.is_finite() && given > 0.0 { given.clamp(SIDE_MIN_M, SIDE_MAX_M) } else { usual }
    };
    (side(log.length_m, usual.0), side(log.width_m, usual.1))
}

/// The closed loop begins where the ego is first observed, as MetaDrive's replay does; the route is its logged path.
fn ego_of(track: Track, current_step: usize) -> Result<Ego, String> {
    let start_step = track.span().map_or(current_step, |(first, _)| first.min(current_step));
    let mut route: Vec<Vec2> = Vec::new();
    for sample in track.samples.iter().skip(start_step).flatten() {
        if route.last().is_none_or(|last| last.distance(sample.position) >= ROUTE_SPACING_M) {
            route.push(sample.position);
        }
    }
    // The exact end: arrival is measured against it. In place of the last point, so that a standing car's jitter gives the
    // route no direction.
    if let (Some(end), [.., before, last]) = (track.samples.iter().flatten().next_back(), &mut route[..])
        && before.distance(end.position) >= ROUTE_SPACING_M
    {
        *last = end.position;
    }
    let start = track.at(start_step).ok_or("the ego is not observed at its start")?;
    if route.len() < 2 {
        // It never moved: a route of half a metre says where it looks.
        route.push(start.position + Vec2::from_heading(start.heading_rad) * ROUTE_SPACING_M);
    }
    Ok(Ego { track, start_step, route, target_speed_mps: None })
}

fn shifted(line: &[Vec2], origin: Vec2) -> Vec<Vec2> {
    line.iter().map(|p| *p - origin).collect()
}

type Index = BTreeMap<String, LaneIx>;

fn road(log: &Log, origin: Vec2, left_out: &mut Vec<(String, String)>) -> (Road, Index) {
    let mut road = Road::default();
    let mut index = Index::new();
    let mut links = Vec::new();
    for lane in &log.lanes {
        let thin = thinned(&lane.points);
        if thin.len() < 2 {
            let reason = format!("its centre line needs 2 points that differ, found {}", lane.points.len());
            left_out.push((format!("lane {}", lane.id), reason));
            continue;
        }
        let (centre, left, right) = lines(&thin);
        index.insert(lane.id.clone(), road.lanes.len());
        links.push(lane);
        road.lanes.push(Lane {
            id: lane.id.clone(),
            kind: lane.kind,
            centre: shifted(&centre, origin),
            left: shifted(&left, origin),
            right: shifted(&right, origin),
            entries: vec![],
            exits: vec![],
            left_neighbours: vec![],
            right_neighbours: vec![],
            speed_limit_mps: lane.speed_limit_mps.filter(|v| *v > 0.0),
        });
    }
    let known = |id: &String| index.get(id).copied();
    for (ix, lane) in links.iter().enumerate() {
        let out = lane.exits.iter().filter_map(known).map(|to| (ix, to));
        let into = lane.entries.iter().filter_map(known).map(|from| (from, ix));
        for (from, to) in out.chain(into) {
            let room = road.lanes[from].exits.len() < LINKS_MAX && road.lanes[to].entries.len() < LINKS_MAX;
            if room && !road.lanes[from].exits.contains(&to) {
                road.lanes[from].exits.push(to);
                road.lanes[to].entries.push(from);
            }
        }
        road.lanes[ix].left_neighbours = beside(&lane.left, &index);
        road.lanes[ix].right_neighbours = beside(&lane.right, &index);
    }
    if road.lanes.iter().all(|lane| lane.exits.is_empty()) {
        link_by_ends(&mut road);
    }
    if road.lanes.iter().all(|lane| lane.left_neighbours.is_empty() && lane.right_neighbours.is_empty()) {
        link_side_by_side(&mut road);
    }
    road.edges = log.edges.iter().map(|edge| thinned_line(&shifted(edge, origin))).filter(|e| e.len() >= 2).collect();
    (road, index)
}

/// The lanes of a side that the map holds, each once.
fn beside(ids: &[String], index: &Index) -> Vec<Neighbour> {
    let mut side: Vec<Neighbour> = Vec::new();
    for &lane in ids.iter().filter_map(|id| index.get(id)) {
        if side.iter().all(|n| n.lane != lane) {
            side.push(Neighbour { lane, same_direction: true });
        }
    }
    side
}

fn lights(
    given: &[LogLight],
    road: &Road,
    index: &Index,
    clock: &Clock,
    origin: Vec2,
    left_out: &mut Vec<(String, String)>,
) -> Vec<Light> {
    let mut lights = Vec::new();
    for light in given {
        let Some(&lane) = index.get(&light.lane) else {
            left_out.push((format!("light of lane {}", light.lane), "the map holds no such lane".into()));
            continue;
        };
        let state = |step| light.states.get(clock.sample_at(step)).copied().unwrap_or(LightState::Unknown);
        let stop_point = light.stop_point.map(|p| p - origin).unwrap_or(road.lanes[lane].centre[0]);
        lights.push(Light { lane, stop_point, states: (0..clock.steps).map(state).collect() });
    }
    lights
}

fn stop_signs(given: &[(Vec2, Vec<String>)], index: &Index, origin: Vec2) -> Vec<StopSign> {
    let lanes = |ids: &Vec<String>| ids.iter().filter_map(|id| index.get(id).copied()).collect();
    given.iter().map(|(position, ids)| StopSign { position: *position - origin, lanes: lanes(ids) }).collect()
}
