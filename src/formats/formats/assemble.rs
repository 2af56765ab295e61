//! Builds a scene from the data that all logged formats have in common: tracks with validity, centre lines with widths, ids. The
//! scene is in the ego's local frame at the current step.

use std::collections::{BTreeMap, BTreeSet};

use super::conventions;
use super::derived::{self, Derived};
use super::import_error::shown;
use super::levels;
use super::log::{Log, LogLight, LogTrack, ON_GRID_WITHIN_S, Parts};
use super::log_map::{Index, on_the_map, outlines, road, stop_signs};
use super::resample::{State, resample};
use super::sizes;
use crate::kernel::{Vec2, num};
use crate::scene::validate::{SPEED_MAX_MPS, WAY_MAX_M};
use crate::scene::{AgentKind, DT_S, Ego, LeftOut, Light, LightState, Road, Sample, Scene, Track};

/// Most samples of all road users and states of all lights, after resampling.
const SAMPLES_MAX: usize = 4_000_000;
const LANES_MAX: usize = 50_000;
/// Most marked road users of a log.
const MARKED_MAX: usize = 1000;
/// Least distance between points of a logged route, metres: a standing car's jitter is no path.
const ROUTE_SPACING_M: f64 = 0.5;

/// Returns the scene, and a sentence for each part of the log that is missing or changed in it.
pub fn assembled(mut log: Log) -> Result<(Scene, Parts), String> {
    let mut left_out = Vec::new();
    let filled = derived::times_filled(&mut log.times_s).ok_or("its first or last sample has no time")?;
    let start_s = *log.times_s.first().ok_or("it has no samples")?;
    let times: Vec<f64> = log.times_s.iter().map(|t| t - start_s).collect();
    if times.windows(2).any(|w| w[1] <= w[0]) {
        return Err("its sample times do not increase".into());
    }
    let on_grid = times.iter().enumerate().all(|(k, t)| (t - k as f64 * DT_S).abs() <= ON_GRID_WITHIN_S);
    if filled > 0 {
        let reason = format!("{filled} are no numbers; each was put between its neighbours");
        left_out.push((LeftOut::SAMPLE_TIMES.into(), reason));
    }
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
    if let Some(conventions) = log.conventions {
        conventions::read(&mut log.tracks, log.ego, &times, conventions, &mut left_out);
    }
    let derived: Vec<Derived> = log.tracks.iter_mut().map(|t| derived::fill(&mut t.samples, &times)).collect();
    note_derived(&derived, &mut left_out);
    let ego = log.tracks.get(log.ego).ok_or("its ego is not among its tracks")?;
    let here = ego.samples.get(log.current).copied().flatten().filter(sound);
    let origin =
        log.frame.or(here.map(|sample| sample.position)).ok_or("the ego is not observed at the current step")?;
    let dropped: Vec<usize> = log.tracks.iter_mut().map(|track| drop_unsound(&mut track.samples, origin)).collect();
    sizes::in_metres(&mut log.tracks, &mut left_out);
    let kinds = kinds(&log.tracks, &mut left_out);
    sizes::exchange(&mut log.tracks, &kinds, log.ego, &mut left_out);
    if log.tracks.iter().all(|track| track.heights_m.iter().all(|height| !height.is_finite())) {
        left_out.push((LeftOut::HEIGHTS.into(), "there are none; everybody is taken to be on one level".into()));
    }
    let elsewhere = levels::leave_out_others(&mut log.tracks, log.ego, &mut left_out);
    let clock = Clock { times, on_grid, steps };
    let tracks = log.tracks.iter().zip(kinds).map(|(track, kind)| clock.track(track, kind, origin));
    let mut tracks: Vec<Track> = tracks.collect();
    for (track, dropped) in tracks.iter_mut().zip(dropped) {
        let dropped = dropped + drop_unsound(&mut track.samples, Vec2::ZERO);
        if dropped > 0 {
            let reason = format!(
                "not finite, farther than 100 km or faster than {SPEED_MAX_MPS} m/s; the rest of the track is kept"
            );
            left_out.push((format!("{dropped} samples of track {}", track.id), reason));
        }
    }
    let ego = ego_of(tracks.remove(log.ego), current_step)?;
    tracks.retain(|track| !(track.span().is_none() && elsewhere.contains(&track.id)));
    keep_sound(&mut tracks, &ego.track.id, &mut left_out);
    let (road, index) = road(&log, origin, &mut left_out);
    let scene = Scene {
        id: log.id,
        origin: log.origin,
        steps,
        current_step,
        objects_of_interest: interesting(&log.objects_of_interest, &tracks, &ego.track.id, &mut left_out),
        tracks,
        ego,
        lights: lights(&log.lights, &road, &index, &clock, origin, &mut left_out),
        stop_signs: stop_signs(&log.stop_signs, &index, origin, &mut left_out),
        crosswalks: outlines("crosswalk", &log.crosswalks, origin, &mut left_out)
            .into_iter()
            .filter(|c| c.len() >= 3)
            .collect(),
        staging: None,
        road,
    };
    Ok((scene, left_out))
}

/// Notes the values that were derived from places.
fn note_derived(derived: &[Derived], left_out: &mut Parts) {
    let samples: usize = derived.iter().map(|of| of.velocities).sum();
    if samples > 0 {
        let tracks = derived.iter().filter(|of| of.velocities > 0).count();
        let reason = format!("{samples} samples of {tracks} road users have none; derived from their places");
        left_out.push((LeftOut::VELOCITIES.into(), reason));
    }
    let turned = derived.iter().filter(|of| of.headings).count();
    if turned > 0 {
        let reason = format!("{turned} road users have none; each looks where it goes");
        left_out.push((LeftOut::HEADINGS.into(), reason));
    }
}

/// Returns the kind of each road user; unknown kinds are noted once a name.
fn kinds(tracks: &[LogTrack], left_out: &mut Parts) -> Vec<AgentKind> {
    let mut unknown: BTreeMap<&str, Vec<AgentKind>> = BTreeMap::new();
    let kind = |track: &LogTrack| {
        let places: Vec<Vec2> = track.samples.iter().flatten().map(|sample| sample.position).collect();
        derived::kind_moving(&places, derived::fastest_mps(&track.samples), track.length_m)
    };
    let mut kinds = Vec::with_capacity(tracks.len());
    for track in tracks {
        kinds.push(match &track.kind {
            Ok(kind) => *kind,
            Err(name) => {
                let kind = kind(track);
                unknown.entry(name).or_default().push(kind);
                kind
            }
        });
    }
    left_out.extend(
        unknown.into_iter().map(|(name, taken)| (LeftOut::KINDS.into(), derived::kinds_taken(&shown(name), &taken))),
    );
    kinds
}

/// Leaves out road users that are never observed, that have another's id, or that no way can lead so far.
fn keep_sound(tracks: &mut Vec<Track>, ego: &str, left_out: &mut Parts) {
    let mut ids: BTreeSet<String> = BTreeSet::from([ego.to_string()]);
    tracks.retain(|track| {
        let mut places = track.samples.iter().flatten().map(|sample| sample.position);
        let first = places.next();
        let (_, way_m) = places.fold((first.unwrap_or_default(), 0.0), |(last, m), p| (p, m + last.distance(p)));
        let fault = if first.is_none() {
            "it is never observed"
        } else if way_m > WAY_MAX_M {
            "its way is longer than 20 km"
        } else if !ids.insert(track.id.clone()) {
            "its id is already taken; the first of that id is kept"
        } else {
            return true;
        };
        left_out.push((format!("track {}", shown(&track.id)), fault.into()));
        false
    });
}

/// Returns the indices of the marked road users among the tracks. The ego may be marked, too.
fn interesting(marked: &[String], tracks: &[Track], ego: &str, left_out: &mut Parts) -> Vec<usize> {
    let places: BTreeMap<&str, usize> = tracks.iter().enumerate().map(|(ix, track)| (track.id.as_str(), ix)).collect();
    let mut places_of_marked = Vec::new();
    for id in marked {
        match places.get(id.as_str()) {
            Some(&ix) => places_of_marked.push(ix),
            None if id == ego => {}
            None => left_out.push((format!("mark of interest {}", shown(id)), "no track of that id is read".into())),
        }
    }
    places_of_marked
}

/// Returns `true` if a scene may hold a sample, at any place.
fn sound(sample: &Sample) -> bool {
    let finite = sample.position.is_finite() && sample.heading_rad.is_finite() && sample.velocity.is_finite();
    finite && sample.speed_mps() <= SPEED_MAX_MPS
}

/// Removes samples that no scene may hold, and counts them.
fn drop_unsound(samples: &mut [Option<Sample>], origin: Vec2) -> usize {
    let mut dropped = 0;
    for sample in samples {
        if sample.is_some_and(|sample| !(sound(&sample) && on_the_map(sample.position - origin))) {
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
    fn track(&self, log: &LogTrack, kind: AgentKind, origin: Vec2) -> Track {
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
                    // A single place says nothing about speed.
                    let along = velocity.dot(Vec2::from_heading(heading_rad));
                    Some(State { time_s, position, heading_rad, speed_mps: (observed == 1).then_some(along) })
                })
                .collect();
            resample(&states, self.steps)
        };
        let (length_m, width_m) = sizes::sides(log, kind);
        Track { id: log.id.clone(), kind, length_m, width_m, samples }
    }

    /// Returns the index of the last log sample at or before a step.
    fn sample_at(&self, step: usize) -> usize {
        if self.on_grid {
            return step;
        }
        self.times.partition_point(|t| *t <= step as f64 * DT_S + 1e-6).saturating_sub(1)
    }
}

/// Makes the ego: the closed loop begins where it is first observed, as MetaDrive's replay does; the route is its logged path.
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
        // It never moved: a route of half a metre shows its heading.
        route.push(start.position + Vec2::from_heading(start.heading_rad) * ROUTE_SPACING_M);
    }
    Ok(Ego { track, start_step, route, target_speed_mps: None })
}

fn lights(
    given: &[LogLight],
    road: &Road,
    index: &Index,
    clock: &Clock,
    origin: Vec2,
    left_out: &mut Parts,
) -> Vec<Light> {
    let mut lights = Vec::new();
    for light in given {
        let Some(&lane) = index.get(&light.lane) else {
            left_out.push((format!("light of lane {}", shown(&light.lane)), "the map holds no such lane".into()));
            continue;
        };
        let state = |step| light.states.get(clock.sample_at(step)).copied().unwrap_or(LightState::Unknown);
        let stop_point = light.stop_point.map(|p| p - origin).filter(|p| on_the_map(*p));
        let stop_point = stop_point.unwrap_or(road.lanes[lane].centre[0]);
        lights.push(Light { lane, stop_point, states: (0..clock.steps).map(state).collect() });
    }
    lights
}
