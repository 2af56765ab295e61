//! Scenes built by hand or by a few draws, for tests and benchmarks of the simulator.

use super::{Action, Intervention};
use crate::kernel::{Seed, Stream, Vec2, num};
use crate::scene::{AgentKind, Ego, Lane, LaneKind, Origin, Road, Sample, Scene, Track};

/// A sample at a place with a heading and a speed along it.
pub fn sample(x: f64, y: f64, heading_rad: f64, speed_mps: f64) -> Sample {
    Sample { position: Vec2::new(x, y), heading_rad, velocity: Vec2::from_heading(heading_rad) * speed_mps }
}

/// Straight at constant speed from a sample on, one sample a decision step.
pub fn straight(start: Sample, steps: usize) -> Vec<Option<Sample>> {
    let at = |k: usize| Sample { position: start.position + start.velocity * (0.1 * k as f64), ..start };
    (0..steps).map(|k| Some(at(k))).collect()
}

/// A car with given samples.
pub fn car(id: &str, samples: Vec<Option<Sample>>) -> Track {
    Track { id: id.into(), kind: AgentKind::Vehicle, length_m: 4.5, width_m: 1.9, samples }
}

/// A straight lane of 4 m width.
pub fn lane(from: Vec2, to: Vec2) -> Lane {
    let left = (to - from).left() * (2.0 / from.distance(to));
    Lane {
        id: "lane".into(),
        kind: LaneKind::Street,
        centre: vec![from, to],
        left: vec![from + left, to + left],
        right: vec![from - left, to - left],
        entries: vec![],
        exits: vec![],
        left_neighbours: vec![],
        right_neighbours: vec![],
        speed_limit_mps: None,
    }
}

/// An ego that drives straight along +x from the origin at a speed, on a lane of 300 m, among some tracks.
pub fn straight_road(steps: usize, speed_mps: f64, tracks: Vec<Track>) -> Scene {
    let track = car("ego", straight(sample(0.0, 0.0, 0.0, speed_mps), steps));
    let end = (speed_mps * 0.1 * (steps - 1) as f64).max(1.0);
    Scene {
        id: "straight".into(),
        origin: Origin::default(),
        steps,
        current_step: 0,
        road: Road { lanes: vec![lane(Vec2::new(-50.0, 0.0), Vec2::new(250.0, 0.0))], edges: vec![] },
        tracks,
        ego: Ego { track, start_step: 0, route: vec![Vec2::ZERO, Vec2::new(end, 0.0)], target_speed_mps: None },
        objects_of_interest: vec![],
        lights: vec![],
        stop_signs: vec![],
        crosswalks: vec![],
        staging: None,
    }
}

/// Two roads that cross at the origin, two lanes a direction, and `count` road users on them at constant speeds: cars,
/// some parked, some cyclists and pedestrians. The ego drives in along +x. Drawn, so that a pool is easily had.
pub fn crossing(seed: u64, count: usize, steps: usize) -> Scene {
    let mut stream = Seed(seed).stream(&["crossing"]);
    let reach = (3.0 * count as f64).max(120.0);
    let centres: Vec<(Vec2, f64)> = (0..4)
        .flat_map(|arm| {
            let heading = num::FRAC_PI_2 * f64::from(arm);
            [1.75, 5.25].map(|side| (Vec2::from_heading(heading).left() * -side, heading))
        })
        .collect();
    let lanes = centres.iter().enumerate().map(|(ix, (at, heading))| {
        let ahead = Vec2::from_heading(*heading) * reach;
        Lane { id: format!("lane{ix}"), ..narrow_lane(*at - ahead, *at + ahead) }
    });
    let speed = stream.uniform(5.0, 11.0);
    let start = sample(-45.0, -1.75, 0.0, speed);
    let mut tracks: Vec<Track> = (0..count).map(|i| drawn_track(&mut stream, i, &centres, reach, steps)).collect();
    // The ego's own lane is kept clear around its start.
    for track in &mut tracks {
        let at = track.samples.iter().flatten().next().map_or(Vec2::ZERO, |s| s.position);
        if (at - start.position).norm() < 12.0 {
            for sample in track.samples.iter_mut().flatten() {
                sample.position.y += 30.0;
            }
        }
    }
    let route: Vec<Vec2> = (0..=100).map(|k| Vec2::new(-45.0 + 1.5 * f64::from(k), -1.75)).collect();
    Scene {
        id: format!("crossing-{seed}"),
        road: Road { lanes: lanes.collect(), edges: vec![] },
        tracks,
        ego: Ego { track: car("ego", straight(start, steps)), start_step: 0, route, target_speed_mps: None },
        ..straight_road(steps, speed, vec![])
    }
}

fn narrow_lane(from: Vec2, to: Vec2) -> Lane {
    let pieces = (from.distance(to) / 5.0) as usize + 1;
    let left = (to - from).left() * (1.75 / from.distance(to));
    let line = |shift: Vec2| (0..=pieces).map(|k| from.lerp(to, k as f64 / pieces as f64) + shift).collect();
    Lane { centre: line(Vec2::ZERO), left: line(left), right: line(-left), ..lane(from, to) }
}

fn drawn_track(stream: &mut Stream, i: usize, centres: &[(Vec2, f64)], reach: f64, steps: usize) -> Track {
    let (at, heading) = centres[stream.below(centres.len())];
    let along = Vec2::from_heading(heading) * stream.uniform(-0.8 * reach, 0.6 * reach);
    let kind = match stream.below(10) {
        0 => AgentKind::Pedestrian,
        1 => AgentKind::Cyclist,
        2 => AgentKind::Static,
        _ => AgentKind::Vehicle,
    };
    let (length_m, width_m, speed) = match kind {
        AgentKind::Pedestrian => (0.6, 0.6, 1.4),
        AgentKind::Cyclist => (1.8, 0.7, 4.0),
        AgentKind::Static => (4.6, 1.8, 0.0),
        AgentKind::Vehicle => (stream.uniform(3.8, 5.4), stream.uniform(1.7, 2.1), stream.uniform(2.0, 14.0)),
    };
    let aside = if kind == AgentKind::Static { Vec2::from_heading(heading).left() * -4.0 } else { Vec2::ZERO };
    let place = at + along + aside;
    let mut samples = straight(sample(place.x, place.y, heading, speed), steps);
    if stream.chance(0.2) {
        let seen = stream.below(steps / 2);
        samples[..seen].fill(None);
    }
    Track { id: i.to_string(), kind, length_m, width_m, samples }
}

/// The first vehicle leaves its recording at `from_step` and drives towards the ego's route ahead of the ego, first
/// along a slant, then along the route.
pub fn intercept(scene: &Scene, from_step: usize) -> Intervention {
    let Some(track) = scene.tracks.iter().position(|t| t.kind == AgentKind::Vehicle && t.at(from_step).is_some())
    else {
        return Intervention::default();
    };
    let Some(&start) = scene.tracks[track].at(from_step) else { return Intervention::default() };
    let goal = Vec2::new(30.0, -1.75);
    let count = scene.steps - from_step;
    let at = |k: usize| start.position.lerp(goal, (k as f64 / count as f64).min(1.0));
    let samples = (1..count)
        .map(|k| {
            let velocity = (at(k + 1) - at(k)) * 10.0;
            Sample { position: at(k), heading_rad: velocity.heading(), velocity }
        })
        .collect();
    Intervention { actions: vec![Action::Follow { track, from_step: from_step + 1, samples }] }
}
