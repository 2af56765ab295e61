//! Checks whether the fields of a road user's recording contradict each other, in a table of one check per row. Importers convert what
//! is surely one known convention before a scene exists; the rest is reported here, for any pool.

pub mod stretch;

use serde::Serialize;

use self::stretch::{JUDGED_MIN, MOVING_MIN_MPS, Stretch, stretches};
use super::LaneGraph;
use super::types::{AgentKind, DT_S, Sample, Scene, Track};
use crate::kernel::{Vec2, num};

/// Angle from which a heading contradicts the motion, degrees. The greatest median of a recorded road user is 7.
pub const HEADING_LIMIT_DEG: f64 = 15.0;
/// Share of the longer way from which velocities contradict places. The greatest median of a recorded road user is 0.17.
pub const VELOCITY_LIMIT: f64 = 0.3;
/// Largest distance of a road user in a lane from its centre line, metres: half a narrow lane.
const IN_LANE_M: f64 = 1.5;
/// Motion within this angle of a lane's opposite direction is against the lane, radians.
const AGAINST_RAD: f64 = num::PI / 6.0;

/// One check: a value of one road user, which contradicts itself above the limit.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Row {
    /// Name of the check.
    pub name: &'static str,
    /// Meaning of the value.
    pub meaning: &'static str,
    /// Unit of value and limit.
    pub unit: &'static str,
    /// Limit above which the fields contradict each other.
    pub limit: f64,
    /// Function for the value; `None` where there is no evidence.
    #[serde(skip)]
    value: fn(&Seen<'_>) -> Option<f64>,
}

/// All checks. The greatest values of 4731 recorded road users of nuScenes, NGSIM and CommonRoad: 0.17, 1.20, 6.8 degrees, 0.7 m,
/// 0.40, 0.78, 0.34.
pub const ROWS: [Row; 7] = [
    Row {
        name: "velocity",
        meaning: "way by velocities against way by places, median",
        unit: "share",
        limit: VELOCITY_LIMIT,
        value: velocity,
    },
    Row {
        name: "time step",
        meaning: "speed by velocities against speed by places, median; other sample times or units",
        unit: "times",
        // 1.20 in NGSIM.
        limit: 1.3,
        value: pace,
    },
    Row {
        name: "heading",
        meaning: "heading against motion, median",
        unit: "degrees",
        limit: HEADING_LIMIT_DEG,
        value: heading,
    },
    Row {
        name: "jump",
        meaning: "one step's way against that of the steps beside it, greatest",
        unit: "m",
        limit: JUMP_LIMIT_M,
        value: jump,
    },
    Row {
        name: "speed",
        meaning: "greatest speed over a second against the most of its kind",
        unit: "times",
        limit: 1.0,
        value: speed,
    },
    Row {
        name: "size",
        meaning: "length and width against the least and most of its kind",
        unit: "times",
        limit: 1.0,
        value: size,
    },
    Row {
        name: "lane",
        meaning: "samples in a lane that go against it",
        unit: "share",
        limit: 0.5,
        value: against_lane,
    },
];

/// Distance from which one step does not fit the others, metres. The greatest of recorded road users is 0.7.
const JUMP_LIMIT_M: f64 = 2.0;

/// A road user as the checks see it.
struct Seen<'s> {
    track: &'s Track,
    lanes: &'s LaneGraph,
    stretches: Vec<Stretch>,
}

impl Seen<'_> {
    fn moving(&self) -> impl Iterator<Item = &Stretch> {
        self.stretches.iter().filter(|stretch| stretch.way_mps() >= MOVING_MIN_MPS)
    }
}

/// Returns the median of the values of enough stretches.
fn typical(values: &[f64]) -> Option<f64> {
    if values.len() < JUDGED_MIN { None } else { num::quantile(values, 0.5) }
}

fn velocity(seen: &Seen<'_>) -> Option<f64> {
    let moving = seen.stretches.iter().filter(|stretch| stretch.moves());
    typical(&moving.map(|stretch| stretch.differs(stretch.by_velocity)).collect::<Vec<_>>())
}

fn pace(seen: &Seen<'_>) -> Option<f64> {
    let one_way = seen.stretches.iter().filter(|s| s.moves() && is_one_way(s.way, s.by_velocity));
    let times = one_way.map(|s| s.by_velocity.norm() / s.way.norm()).map(|times| times.max(1.0 / times));
    typical(&times.collect::<Vec<_>>())
}

/// Returns `true` if two ways lead in one direction.
pub fn is_one_way(a: Vec2, b: Vec2) -> bool {
    a.dot(b) > num::cos(HEADING_LIMIT_DEG * num::PI / 180.0) * a.norm() * b.norm()
}

/// Returns no value for people on foot: they go sideways.
fn heading(seen: &Seen<'_>) -> Option<f64> {
    if !matches!(seen.track.kind, AgentKind::Vehicle | AgentKind::Cyclist) {
        return None;
    }
    let askew = |stretch: &Stretch| Some(stretch.askew_rad(seen.track.at(stretch.middle)?.heading_rad));
    let askew: Vec<f64> = seen.moving().filter_map(askew).map(|rad| rad * 180.0 / num::PI).collect();
    typical(&askew)
}

/// A step differs from both the one before it and the one after it where a road user jumps, not where it brakes.
fn jump(seen: &Seen<'_>) -> Option<f64> {
    let places: Vec<Option<Vec2>> = seen.track.samples.iter().map(|s| s.as_ref().map(|s| s.position)).collect();
    let steps: Vec<Option<Vec2>> = places.windows(2).map(|w| Some(w[1]? - w[0]?)).collect();
    let beside = |k: usize| {
        let step = steps[k]?;
        let from = |other: Option<usize>| Some(step.distance((*steps.get(other?)?)?));
        [from(k.checked_sub(1)), from(k.checked_add(1))].into_iter().flatten().reduce(f64::min)
    };
    (0..steps.len()).filter_map(beside).reduce(f64::max)
}

fn speed(seen: &Seen<'_>) -> Option<f64> {
    // m/s. Recorded: 34 on a motorway, 6 on a bicycle, 2.7 on foot. A road user that stands is moved by its label's jitter.
    let most_mps = match seen.track.kind {
        AgentKind::Vehicle => 75.0,
        AgentKind::Cyclist => 30.0,
        AgentKind::Pedestrian => 12.0,
        AgentKind::Static => 3.0,
    };
    seen.stretches.iter().map(|s| s.way_mps() / most_mps).reduce(f64::max)
}

fn size(seen: &Seen<'_>) -> Option<f64> {
    // Metres: least and most length, least and most width, from a moped to a road train, from a scooter to a cargo bicycle.
    let (length_m, width_m) = match seen.track.kind {
        AgentKind::Vehicle => ((1.0, 35.0), (0.4, 4.5)),
        AgentKind::Cyclist => ((0.5, 4.5), (0.2, 2.5)),
        AgentKind::Pedestrian => ((0.15, 2.5), (0.15, 2.5)),
        AgentKind::Static => return None,
    };
    let beyond = |side: f64, (least, most): (f64, f64)| (side / most).max(least / side);
    Some(beyond(seen.track.length_m, length_m).max(beyond(seen.track.width_m, width_m)))
}

fn against_lane(seen: &Seen<'_>) -> Option<f64> {
    if seen.track.kind != AgentKind::Vehicle {
        return None;
    }
    let (mut with, mut against) = (0usize, 0usize);
    for stretch in seen.moving() {
        let Some(Sample { position, .. }) = seen.track.at(stretch.middle).copied() else { continue };
        let goes_rad = stretch.way.heading();
        let Some(lane) = seen.lanes.nearest_lane_any_heading(position, IN_LANE_M) else { continue };
        if seen.lanes.nearest_lane(position, goes_rad, IN_LANE_M).is_some() {
            with += 1;
        } else if num::wrap_angle(lane.heading_rad + num::PI - goes_rad).abs() <= AGAINST_RAD {
            against += 1;
        }
    }
    (with + against >= JUDGED_MIN).then(|| against as f64 / (with + against) as f64)
}

/// The values of one road user, one per row.
#[derive(Clone, Debug, PartialEq)]
pub struct Values {
    /// Id of the scene.
    pub scene: String,
    /// Id of the road user.
    pub track: String,
    /// `[ROWS]`
    pub values: Vec<Option<f64>>,
}

/// The values of each road user of a scene, the ego's first.
pub fn values(scene: &Scene) -> Vec<Values> {
    let lanes = LaneGraph::of(&scene.road);
    let times_s: Vec<f64> = (0..scene.steps).map(|k| k as f64 * DT_S).collect();
    let of = |track: &Track| {
        let stretches = stretches(&times_s, &track.samples, |sample| sample.velocity);
        let seen = Seen { track, lanes: &lanes, stretches };
        let values = ROWS.iter().map(|row| (row.value)(&seen)).collect();
        Values { scene: scene.id.clone(), track: track.id.clone(), values }
    };
    std::iter::once(&scene.ego.track).chain(&scene.tracks).map(of).collect()
}

/// A value above its limit.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Contradiction {
    /// Id of the scene.
    pub scene: String,
    /// Id of the road user.
    pub track: String,
    /// Value in the row's unit.
    pub value: f64,
}

/// Result of a check over all scenes.
#[derive(Clone, Debug, Serialize)]
pub struct Checked {
    /// The check.
    #[serde(flatten)]
    pub row: Row,
    /// Number of road users that it judges.
    pub judged: usize,
    /// The greatest value; `None` where nobody is judged.
    pub greatest: Option<f64>,
    /// Those above the limit, in the order of scenes.
    pub contradictions: Vec<Contradiction>,
}

/// Returns the result of each check for these road users.
pub fn checked(all: &[Values]) -> Vec<Checked> {
    let of = |(ix, row): (usize, &Row)| {
        let judged = all.iter().filter_map(|of| Some((of, of.values.get(ix).copied().flatten()?)));
        let above = judged.clone().filter(|(_, value)| *value > row.limit);
        let contradiction =
            |(of, value): (&Values, f64)| Contradiction { scene: of.scene.clone(), track: of.track.clone(), value };
        Checked {
            row: *row,
            judged: judged.clone().count(),
            greatest: judged.map(|(_, value)| value).reduce(f64::max),
            contradictions: above.map(contradiction).collect(),
        }
    };
    ROWS.iter().enumerate().map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::fixture::{straight, two_lane_scene};

    /// Names of the checks that the first other road user contradicts after a change.
    fn contradicted(change: impl FnOnce(&mut Scene)) -> Vec<&'static str> {
        let mut scene = two_lane_scene();
        change(&mut scene);
        let of_it = &values(&scene)[1..2];
        let found = checked(of_it).into_iter().filter(|of| of.contradictions.len() == 1);
        found.map(|of| of.row.name).collect()
    }

    fn each(scene: &mut Scene, change: impl Fn(usize, &mut Sample)) {
        scene.tracks[0].samples.iter_mut().flatten().enumerate().for_each(|(k, sample)| change(k, sample));
    }

    #[test]
    fn each_check_finds_what_it_is_for_and_nothing_else() {
        assert_eq!(contradicted(|_| ()), Vec::<&str>::new());
        let turned = contradicted(|s| each(s, |_, sample| sample.velocity = sample.velocity.rotated(1.5)));
        assert_eq!(turned, ["velocity"]);
        let kmh = contradicted(|s| each(s, |_, sample| sample.velocity = sample.velocity * 3.6));
        assert_eq!(kmh, ["velocity", "time step"]);
        assert_eq!(contradicted(|s| each(s, |_, sample| sample.heading_rad = 1.5)), ["heading"]);
        let apart = |k: usize| Vec2::new(0.0, if k < 30 { 0.0 } else { 50.0 });
        assert_eq!(contradicted(|s| each(s, |k, sample| sample.position = sample.position + apart(k))), ["jump"]);
        let runs = contradicted(|s| {
            s.tracks[0].kind = AgentKind::Pedestrian;
            (s.tracks[0].length_m, s.tracks[0].width_m) = (0.6, 0.6);
            s.tracks[0].samples = straight(60, Vec2::ZERO, 0.0, 20.0);
        });
        assert_eq!(runs, ["speed"]);
        assert_eq!(contradicted(|s| s.tracks[0].length_m = 45.0), ["size"]);
        let backwards = contradicted(|s| s.road.lanes.iter_mut().for_each(|lane| lane.centre.reverse()));
        assert_eq!(backwards, ["lane"]);
    }

    #[test]
    fn who_stands_walks_sideways_or_drives_back_slowly_contradicts_nothing() {
        let slides = contradicted(|s| {
            s.tracks[0].kind = AgentKind::Pedestrian;
            (s.tracks[0].length_m, s.tracks[0].width_m) = (0.6, 0.6);
            s.tracks[0].samples = straight(60, Vec2::ZERO, 0.0, 4.0);
            each(s, |_, sample| sample.heading_rad = 1.5);
        });
        assert_eq!(slides, Vec::<&str>::new());
        let reverses = contradicted(|s| {
            s.tracks[0].samples = straight(60, Vec2::ZERO, 0.0, 2.0);
            each(s, |_, sample| sample.heading_rad = num::PI);
        });
        assert_eq!(reverses, Vec::<&str>::new());
        let parked = contradicted(|s| {
            s.tracks[0].samples = straight(60, Vec2::ZERO, 0.0, 0.0);
            each(s, |k, sample| sample.position.y += if k % 2 == 0 { 0.2 } else { -0.2 });
        });
        assert_eq!(parked, Vec::<&str>::new());
    }
}
