//! Small scenes for the tests of this room: built by hand, every number readable.

use super::{Ego, Lane, LaneKind, Neighbour, Origin, Road, Sample, Scene, Track};
use crate::kernel::Vec2;
use crate::scene::AgentKind;
use crate::synth::{SynthOptions, WorldKind};

/// Samples of something that drives straight at constant speed.
pub fn straight(steps: usize, from: Vec2, heading_rad: f64, speed_mps: f64) -> Vec<Option<Sample>> {
    let velocity = Vec2::from_heading(heading_rad) * speed_mps;
    (0..steps).map(|k| Some(Sample { position: from + velocity * (k as f64 * 0.1), heading_rad, velocity })).collect()
}

/// A lane along a centre line, 3.5 m wide, without links.
pub fn lane(id: &str, centre: Vec<Vec2>) -> Lane {
    let side = |sign: f64| {
        let last = centre.len() - 1;
        let along = |k: usize| centre[(k + 1).min(last)] - centre[k.saturating_sub(1)];
        (0..centre.len()).map(|k| centre[k] + along(k).left() * (sign * 1.75 / along(k).norm())).collect()
    };
    let (left, right) = (side(1.0), side(-1.0));
    Lane {
        id: id.into(),
        kind: LaneKind::Street,
        centre,
        left,
        right,
        entries: vec![],
        exits: vec![],
        left_neighbours: vec![],
        right_neighbours: vec![],
        speed_limit_mps: Some(15.0),
    }
}

/// Eastbound: lane 0 at y = 0 and lane 1 to its left, 0..100 m; lane 2 continues lane 0 to 160 m; lane 3 leaves
/// lane 0 to the north. The ego drives along lane 0 at 10 m/s, one car 20 m ahead, one in lane 1.
pub fn two_lane_scene() -> Scene {
    let along = |y: f64, from: f64, to: f64| {
        let pieces = ((to - from) / 10.0) as usize;
        (0..=pieces).map(|k| Vec2::new(from + 10.0 * k as f64, y)).collect::<Vec<_>>()
    };
    let north = vec![Vec2::new(100.0, 0.0), Vec2::new(110.0, 4.0), Vec2::new(114.0, 14.0), Vec2::new(114.0, 60.0)];
    let mut lanes = vec![
        lane("a", along(0.0, 0.0, 100.0)),
        lane("b", along(3.5, 0.0, 100.0)),
        lane("c", along(0.0, 100.0, 160.0)),
        lane("d", north),
    ];
    lanes[0].exits = vec![2, 3];
    lanes[2].entries = vec![0];
    lanes[3].entries = vec![0];
    lanes[0].left_neighbours = vec![Neighbour { lane: 1, same_direction: true }];
    lanes[1].right_neighbours = vec![Neighbour { lane: 0, same_direction: true }];
    let steps = 60;
    let car = |id: &str, x: f64, y: f64, speed: f64| Track {
        id: id.into(),
        kind: AgentKind::Vehicle,
        length_m: 4.5,
        width_m: 1.8,
        samples: straight(steps, Vec2::new(x, y), 0.0, speed),
    };
    Scene {
        id: "fixture".into(),
        origin: Origin { format: "by hand".into(), name: "two_lane_scene".into() },
        steps,
        current_step: 0,
        road: Road { lanes, edges: vec![] },
        tracks: vec![car("ahead", 30.0, 0.0, 8.0), car("beside", 10.0, 3.5, 12.0)],
        ego: Ego {
            track: car("ego", 10.0, 0.0, 10.0),
            start_step: 0,
            route: vec![Vec2::new(10.0, 0.0), Vec2::new(150.0, 0.0)],
            target_speed_mps: None,
        },
        objects_of_interest: vec![0],
        lights: vec![],
        stop_signs: vec![],
        crosswalks: vec![],
        staging: None,
    }
}

/// Generated worlds of every kind, as most tests want them.
pub fn worlds() -> SynthOptions {
    SynthOptions {
        kinds: WorldKind::ALL.to_vec(),
        steps: 91,
        current_step: 10,
        warm_up_s: 18.0,
        traffic: None,
        tracks_per_scene: 40,
        pedestrian_share: 0.1,
        cyclist_share: 0.06,
        ego_travel_m_min: 10.0,
        interaction_time_s_max: 4.0,
        interaction_gap_m_max: 12.0,
        following_share: 0.2,
        attempts_max: 40,
    }
}
