//! Small scenes built by hand, for tests.

use crate::kernel::Vec2;
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
        left_neighbour: None,
        right_neighbour: None,
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
    }
}
