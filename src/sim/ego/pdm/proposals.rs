//! Fifteen ways to go on: three paths, five speeds, each driven by IDM behind the nearest road user on its path.

use super::centreline::{Centreline, Pose};
use super::forecast::Other;
use super::settings::{STATES, STEP_S, STEPS, STEPS_A_MAP, Settings};
use super::simulated::Car;
use crate::kernel::{OrientedBox, num};

/// Seconds ahead for which a corridor is looked along at the speed that is aimed at.
const CORRIDOR_S: f64 = 8.0;

/// Poses of the rear axle, now and behind each step.
pub type Trajectory = [Pose; STATES];

/// Whom a proposal may meet on its path at a step: a place among the others and the arc length of their centre, metres.
type OnPath = Vec<(usize, f64)>;

/// A path with the road users on it, map by map.
struct Corridor<'a> {
    path: &'a Centreline,
    /// Arc length of the ego's rear axle, metres.
    from_m: f64,
    /// One a map of the forecast.
    on_path: Vec<OnPath>,
}

impl Corridor<'_> {
    fn of<'a>(path: &'a Centreline, from_m: f64, to_m: f64, others: &[Other], half_width_m: f64) -> Corridor<'a> {
        let line = path.between(from_m, to_m);
        // The corridor, piece by piece.
        let pieces: Vec<OrientedBox> = line
            .windows(2)
            .filter(|ends| ends[0] != ends[1])
            .map(|ends| {
                let along = ends[1] - ends[0];
                let length_m = along.norm();
                // Square caps: the first and the last piece reach as far beyond the ends as the corridor is wide.
                let middle = ends[0].lerp(ends[1], 0.5);
                OrientedBox::along(middle, along * (1.0 / length_m), length_m + 2.0 * half_width_m, 2.0 * half_width_m)
            })
            .collect();
        let reach_m = 0.5 * (to_m - from_m) + 2.0 * half_width_m;
        let middle = path.at(0.5 * (from_m + to_m)).position;
        let on_it = |theirs: &OrientedBox| -> Option<f64> {
            let radius_m = theirs.radius();
            if (theirs.center - middle).norm() > reach_m + radius_m {
                return None;
            }
            let (s_m, beside_m) = path.project(theirs.center);
            let is_near = beside_m <= half_width_m + radius_m + 1.0;
            (is_near && pieces.iter().any(|piece| piece.overlaps(theirs))).then_some(s_m)
        };
        let mut on_path = vec![Vec::new(); STEPS / STEPS_A_MAP + 1];
        for (ix, other) in others.iter().enumerate() {
            // Who stands is where they are on every map.
            let standing = (other.speed_mps == 0.0).then(|| on_it(&other.now));
            for (map, on_path) in on_path.iter_mut().enumerate() {
                let place = standing.unwrap_or_else(|| on_it(&other.at_step(map * STEPS_A_MAP)));
                on_path.extend(place.map(|s_m| (ix, s_m)));
            }
        }
        Corridor { path, from_m, on_path }
    }
}

/// Whoever a proposal follows: its rear end along the path, metres, and its speed along the ego's heading, m/s.
#[derive(Clone, Copy, Debug, Default)]
struct Leader {
    s_m: f64,
    speed_mps: f64,
    /// Taken off the gap, metres.
    half_length_m: f64,
}

/// The trajectories, path by path, each from the slowest to the fastest. `limit_mps` is the speed limit.
pub fn proposals(
    paths: &[Centreline; 3],
    car: &Car,
    own: (&Pose, f64),
    others: &[Other],
    limit_mps: f64,
    settings: &Settings,
) -> Vec<Trajectory> {
    let (now, speed_mps) = own;
    let fastest_mps = limit_mps * settings.speed_shares.into_iter().fold(0.0, f64::max);
    let mut all = Vec::with_capacity(paths.len() * settings.speed_shares.len());
    for path in paths {
        let (from_m, _) = path.project(now.position);
        let to_m = from_m + (CORRIDOR_S * fastest_mps).max(1.0);
        let corridor = Corridor::of(path, from_m, to_m, others, car.half_width_m());
        for share in settings.speed_shares {
            all.push(unrolled(&corridor, car, speed_mps, share * limit_mps, others, settings));
        }
    }
    all
}

fn unrolled(
    corridor: &Corridor<'_>,
    car: &Car,
    speed_mps: f64,
    aimed_mps: f64,
    others: &[Other],
    settings: &Settings,
) -> Trajectory {
    let path = corridor.path;
    let (mut s_m, mut speed_mps) = (corridor.from_m, speed_mps);
    let mut trajectory = [path.at(s_m); STATES];
    // As published: the leader is looked for at even steps, and the first step is odd, so there everybody brakes for one
    // that stands at the path's beginning.
    let mut leader = Leader::default();
    for (step, pose) in trajectory.iter_mut().enumerate().skip(1) {
        if step % STEPS_A_MAP == 0 {
            leader = leader_at(corridor, car, s_m, step, others);
        }
        let gap_m = (leader.s_m - s_m - leader.half_length_m).max(settings.gap_min_m);
        let acceleration_mps2 = idm(speed_mps, leader.speed_mps, gap_m, aimed_mps, settings);
        s_m += STEP_S * speed_mps;
        speed_mps += STEP_S * acceleration_mps2;
        *pose = path.at(s_m);
    }
    trajectory
}

fn idm(speed_mps: f64, leader_mps: f64, gap_m: f64, aimed_mps: f64, settings: &Settings) -> f64 {
    let (a, b) = (settings.acceleration_mps2, settings.brake_mps2);
    let wanted_m = settings.gap_min_m
        + speed_mps * settings.headway_s
        + speed_mps * (speed_mps - leader_mps) / (2.0 * (a * b).sqrt());
    let (free, near) = (num::powu(speed_mps / aimed_mps, settings.exponent), wanted_m / gap_m);
    (a * (1.0 - free - near * near)).clamp(-b, a)
}

fn leader_at(corridor: &Corridor<'_>, car: &Car, s_m: f64, step: usize, others: &[Other]) -> Leader {
    let pose = corridor.path.at(s_m);
    let own = car.footprint(pose.position, pose.heading_rad);
    let mut nearest: Option<(f64, &Other)> = None;
    for (ix, centre_m) in &corridor.on_path[step / STEPS_A_MAP] {
        if *centre_m <= s_m {
            continue;
        }
        let distance_m = own.distance(&others[*ix].at_step(step));
        if nearest.is_none_or(|(least_m, _)| distance_m < least_m) {
            nearest = Some((distance_m, &others[*ix]));
        }
    }
    match nearest {
        Some((distance_m, other)) => {
            let along = other.now.axis.dot(own.axis);
            Leader { s_m: s_m + distance_m, speed_mps: other.speed_mps * along, half_length_m: 0.0 }
        }
        // Nobody: the end of the path stands there.
        None => Leader { s_m: corridor.path.length_m(), speed_mps: 0.0, half_length_m: car.half_length_m() },
    }
}
