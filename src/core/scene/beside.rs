//! Motion of one road user beside the ego, as one row of numbers. Pools are compared by these rows, and acted road users are told from
//! recorded ones by them.

use super::lanes::LaneGraph;
use super::types::Sample;
use crate::kernel::{Vec2, num};

/// Numbers of a row with their units and the step to which each is rounded: a viewer sees nothing finer, and a classifier must not tell
/// road users apart by how their samples were computed.
pub const QUANTITIES: [(&str, &str, f64); COLUMNS] = [
    ("speed", "m/s", 0.5),
    ("speed, highest", "m/s", 0.5),
    ("acceleration, highest", "m/s²", 0.25),
    ("braking, hardest", "m/s²", 0.25),
    ("jerk, 95 %", "m/s³", 0.5),
    ("yaw rate, highest", "rad/s", 0.05),
    ("lateral acceleration, highest", "m/s²", 0.5),
    ("slip, highest", "rad", 0.05),
    ("faster than the ego", "m/s", 0.5),
    ("distance at first", "m", 2.0),
    ("ahead at first", "1", 0.2),
    ("nearest", "m", 1.0),
    ("ahead when nearest", "1", 0.2),
    ("beside when nearest", "1", 0.2),
    ("turned when nearest", "rad", 0.1),
    ("closing speed, highest", "m/s", 0.5),
    ("time to conflict, least", "s", 0.5),
    ("close behind, share of time", "1", 0.1),
    ("drift towards the ego, fastest", "m/s", 0.25),
    ("drift away from the ego, fastest", "m/s", 0.25),
    ("beside its lane, farthest", "m", 0.25),
    ("turned from its lane, most", "rad", 0.1),
];
/// Number of columns of a row.
pub const COLUMNS: usize = 22;

/// A road user that never comes nearer than this is not beside the ego, metres.
pub const BESIDE_M: f64 = 40.0;
/// Samples per second.
const A_SECOND: usize = 10;
/// Least number of samples together with the ego that make a motion.
const SAMPLES_MIN: usize = 15;
/// Below this speed a road user has no direction of motion, m/s.
const MOVES_MPS: f64 = 1.0;
/// Drift is measured up to this distance, metres.
const DRIFT_M: f64 = 25.0;
/// Largest distance of close following, metres.
const BEHIND_M: f64 = 15.0;
/// Longest time to a conflict that is told, s.
const CONFLICT_S_MAX: f64 = 10.0;
/// A road user farther than this from every lane of its direction is on none, metres. It also bounds the two numbers of lanes.
const LANE_M: f64 = 5.0;

/// Returns the row of a road user beside the ego, whose samples begin at the same step; `None` for one that moves nowhere near it.
pub fn row(ego: &[Sample], other: &[Option<Sample>], lanes: &LaneGraph) -> Option<[f64; COLUMNS]> {
    let both: Vec<(&Sample, &Sample)> =
        ego.iter().zip(other).filter_map(|(ego, other)| Some((ego, other.as_ref()?))).collect();
    let distance_m = |(ego, other): &(&Sample, &Sample)| ego.position.distance(other.position);
    let (nearest_at, nearest_m) =
        both.iter().map(distance_m).enumerate().reduce(|best, next| if next.1 < best.1 { next } else { best })?;
    let speeds: Vec<f64> = both.iter().map(|(_, other)| other.speed_mps()).collect();
    let top_mps = highest(speeds.iter().copied());
    if both.len() < SAMPLES_MIN || nearest_m > BESIDE_M || top_mps < MOVES_MPS {
        return None;
    }
    let gains = over_a_second(&speeds, |from, to| to - from);
    let mut jerks: Vec<f64> = over_a_second(&gains, |from, to| (to - from).abs());
    jerks.sort_by(f64::total_cmp);
    let headings: Vec<f64> = both.iter().map(|(_, other)| other.heading_rad).collect();
    let turns = over_a_second(&headings, |from, to| num::wrap_angle(to - from));
    let slip = |other: &Sample| {
        let moves = other.speed_mps() > MOVES_MPS;
        if moves { num::wrap_angle(other.velocity.heading() - other.heading_rad).abs() } else { 0.0 }
    };
    let at = both[nearest_at];
    let apart: Vec<(f64, f64)> = both.iter().map(|(ego, other)| apart(ego, other)).collect();
    let conflict_s = apart.iter().filter(|(_, closing)| *closing > 0.1).map(|(gap_m, closing)| gap_m / closing);
    let behind = both.iter().filter(|(ego, other)| is_close_behind(ego, other)).count();
    let drifts: Vec<f64> =
        both.iter().filter(|both| distance_m(both) < DRIFT_M).map(|(ego, other)| drift(ego, other)).collect();
    let on_lanes: Vec<(f64, f64)> = both
        .iter()
        .step_by(A_SECOND / 2)
        .map(|(_, other)| {
            let place = lanes.nearest_lane_any_heading(other.position, LANE_M);
            place.map_or((LANE_M, 0.0), |of| {
                (of.offset_m.abs().min(LANE_M), num::wrap_angle(of.heading_rad - other.heading_rad).abs())
            })
        })
        .collect();
    let pairs = speeds.iter().zip(&turns).map(|(speed, turn)| (speed * turn).abs());
    let faster: Vec<f64> = both.iter().map(|(ego, other)| other.speed_mps() - ego.speed_mps()).collect();
    let exact = [
        num::mean(&speeds)?,
        top_mps,
        highest(gains.iter().copied()),
        highest(gains.iter().map(|gain| -gain)),
        jerks.get(jerks.len() * 95 / 100).copied().unwrap_or(0.0),
        highest(turns.iter().map(|turn| turn.abs())),
        highest(pairs),
        highest(both.iter().map(|(_, other)| slip(other))),
        num::mean(&faster)?,
        distance_m(&both[0]),
        bearing(both[0].0, both[0].1).x,
        nearest_m,
        bearing(at.0, at.1).x,
        bearing(at.0, at.1).y.abs(),
        num::wrap_angle(at.1.heading_rad - at.0.heading_rad).abs(),
        highest(apart.iter().map(|(_, closing)| *closing)),
        conflict_s.fold(CONFLICT_S_MAX, f64::min),
        behind as f64 / both.len() as f64,
        highest(drifts.iter().copied()),
        highest(drifts.iter().map(|drift| -drift)),
        highest(on_lanes.iter().map(|of| of.0)),
        highest(on_lanes.iter().map(|of| of.1)),
    ];
    Some(std::array::from_fn(|place| (exact[place] / QUANTITIES[place].2).round() * QUANTITIES[place].2))
}

/// Returns changes over a second from each sample on, per second. Over single samples they would be a recording's noise.
fn over_a_second(values: &[f64], change: impl Fn(f64, f64) -> f64) -> Vec<f64> {
    values.windows(A_SECOND + 1).map(|window| change(window[0], window[A_SECOND])).collect()
}

fn highest(values: impl Iterator<Item = f64>) -> f64 {
    values.fold(0.0, f64::max)
}

/// Unit vector to the other in the ego's frame: x ahead, y to the left.
fn bearing(ego: &Sample, other: &Sample) -> Vec2 {
    let (to, axis) = (other.position - ego.position, Vec2::from_heading(ego.heading_rad));
    let far = to.norm();
    if far > 0.0 { Vec2::new(axis.dot(to) / far, axis.cross(to) / far) } else { Vec2::new(1.0, 0.0) }
}

/// Returns the distance, metres, and how fast it shrinks, m/s.
fn apart(ego: &Sample, other: &Sample) -> (f64, f64) {
    let (to, by) = (other.position - ego.position, other.velocity - ego.velocity);
    let far = to.norm();
    (far, if far > 0.0 { -by.dot(to) / far } else { 0.0 })
}

/// Returns `true` if the other follows close behind.
fn is_close_behind(ego: &Sample, other: &Sample) -> bool {
    let to = bearing(ego, other);
    to.x < -0.9 && ego.position.distance(other.position) < BEHIND_M
}

/// Returns how fast the other comes nearer across the ego's heading, m/s; negative where it goes away.
fn drift(ego: &Sample, other: &Sample) -> f64 {
    let axis = Vec2::from_heading(ego.heading_rad);
    let aside_m = axis.cross(other.position - ego.position);
    let aside_mps = axis.cross(other.velocity - ego.velocity);
    if aside_m > 0.0 { -aside_mps } else { aside_mps }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::DT_S;
    use crate::scene::fixture::two_lane_scene;

    fn moving(from: Vec2, velocity: Vec2, count: usize) -> Vec<Sample> {
        let at = |k: usize| Sample {
            position: from + velocity * (k as f64 * DT_S),
            heading_rad: velocity.heading(),
            velocity,
        };
        (0..count).map(at).collect()
    }

    fn number(row: &[f64; COLUMNS], name: &str) -> f64 {
        row[QUANTITIES.iter().position(|(of, ..)| *of == name).unwrap()]
    }

    fn row_of(ego: &[Sample], other: &[Sample]) -> Option<[f64; COLUMNS]> {
        let lanes = LaneGraph::of(&two_lane_scene().road);
        row(ego, &other.iter().copied().map(Some).collect::<Vec<_>>(), &lanes)
    }

    #[test]
    fn one_that_comes_from_behind_is_close_behind_and_closes() {
        let ego = moving(Vec2::new(0.0, 0.0), Vec2::new(10.0, 0.0), 30);
        let row = row_of(&ego, &moving(Vec2::new(-20.25, 0.0), Vec2::new(15.0, 0.0), 30)).unwrap();
        // 20.25 m behind at 5 m/s more: below 15 m from 1.1 s on, 5.75 m at the end.
        assert!((number(&row, "close behind, share of time") - 0.6).abs() < 1e-9, "{row:?}");
        assert!((number(&row, "nearest") - 6.0).abs() < 1e-9 && number(&row, "ahead at first") == -1.0);
        assert!((number(&row, "closing speed, highest") - 5.0).abs() < 1e-9);
        assert!((number(&row, "time to conflict, least") - 1.0).abs() < 1e-9);
        assert_eq!(number(&row, "drift towards the ego, fastest"), 0.0);
    }

    #[test]
    fn one_that_swings_away_first_drifts_both_ways() {
        let ego = moving(Vec2::new(0.0, 0.0), Vec2::new(10.0, 0.0), 40);
        let mut other = moving(Vec2::new(0.0, 4.0), Vec2::new(10.0, 1.0), 20);
        other.extend(moving(Vec2::new(20.0, 6.0), Vec2::new(10.0, -2.0), 20));
        let row = row_of(&ego, &other).unwrap();
        assert!((number(&row, "drift away from the ego, fastest") - 1.0).abs() < 1e-9);
        assert!((number(&row, "drift towards the ego, fastest") - 2.0).abs() < 1e-9);
    }

    #[test]
    fn who_stands_or_stays_far_away_has_no_row() {
        let ego = moving(Vec2::new(0.0, 0.0), Vec2::new(10.0, 0.0), 30);
        assert_eq!(row_of(&ego, &moving(Vec2::new(10.0, 4.0), Vec2::new(0.0, 0.0), 30)), None);
        assert_eq!(row_of(&ego, &moving(Vec2::new(90.0, 0.0), Vec2::new(10.0, 0.0), 30)), None);
        assert_eq!(row_of(&ego, &moving(Vec2::new(10.0, 4.0), Vec2::new(9.0, 0.0), 5)), None);
    }
}
