//! The features of a candidate as seen from its situation: the values of `vocabulary::CANDIDATE`.

use super::foreseen::{Foreseen, Harm, Whose, foreseen, harm};
use super::situation::Situation;
use crate::adapters::vocabulary;
use crate::kernel::{OrientedBox, num};
use crate::motion::Candidate;
use crate::scene::lanes::OFF_ROAD_MAX_M;
use crate::scene::{DT_S, Sample, TrackIx};
use crate::sim::{Side, Striker};

/// A gap that stands for "nobody comes near", metres.
const FAR_GAP_M: f64 = 50.0;
/// Road and bystander checks look at every this many samples.
const STRIDE: usize = 5;

/// Facts that are needed to judge a candidate besides itself.
#[derive(Clone, Copy, Debug)]
pub struct Judged<'a> {
    pub situation: &'a Situation,
    pub actor: TrackIx,
    /// Scene step of the first sample.
    pub from_step: usize,
    /// Tracks that are adversaries themselves, and so no bystanders.
    pub adversaries: &'a [TrackIx],
}

/// Which features an expression or a filter reads; the others are left 0, for they cost time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Needs {
    pub ego: bool,
    pub kinematics: bool,
    pub road: bool,
    pub log: bool,
    pub bystanders: bool,
    pub contact: bool,
    pub harm: bool,
    pub way: bool,
    /// The contact of a rollout of its own judged: whether it was to be avoided and to be seen.
    pub assessed: bool,
}

impl Needs {
    /// Needs of an expression that reads these names.
    pub fn of<'n>(names: impl IntoIterator<Item = &'n str>) -> Needs {
        let mut needs = Needs::default();
        for name in names {
            match name {
                "ego_distance_m_min" | "closest_approach_s" | "closest_speed_mps" | "collision_likelihood" => {
                    needs.ego = true
                }
                "acceleration_mps2_max"
                | "lateral_acceleration_mps2_max"
                | "jerk_mps3_max"
                | "yaw_rate_radps_max"
                | "speed_mps_max"
                | "heading_change_rad" => needs.kinematics = true,
                "off_road_m_max" | "lane_deviation_m_max" => needs.road = true,
                "log_deviation_m_max" => needs.log = true,
                "bystander_gap_m_min" => needs.bystanders = true,
                "contact_angle_rad" | "meets_ego_front" | "meets_ego_flank" | "meets_ego_rear" | "strikes_ego"
                | "struck_by_ego" | "seen_coming_s" => needs.contact = true,
                "wrong_way_m" | "off_road_added_m" | "acceleration_added_mps2" | "jerk_added_mps3" => needs.harm = true,
                "log_way_share" => needs.way = true,
                "rehearsed_avoidable" | "rehearsed_preventable" | "rehearsed_visible_s" => needs.assessed = true,
                _ => {}
            }
        }
        needs
    }
}

/// Values of `vocabulary::CANDIDATE` in its order.
pub fn features(candidate: &Candidate, judged: &Judged<'_>, needs: Needs) -> Vec<f64> {
    let mut values = Vec::with_capacity(vocabulary::CANDIDATE.len() + vocabulary::ACTOR.len());
    values.push(candidate.prior_log_probability);
    let ego = if needs.ego || needs.way { ego_relation(&candidate.samples, judged) } else { EgoRelation::default() };
    values.extend([ego.distance_m_min, ego.approach_s, ego.speed_mps, ego.likelihood]);
    let motion = if needs.kinematics { kinematics(&candidate.samples, judged) } else { Kinematics::default() };
    values.extend([
        motion.acceleration_mps2_max,
        motion.lateral_mps2_max,
        motion.jerk_mps3_max,
        motion.yaw_rate_radps_max,
        motion.speed_mps_max,
        motion.heading_change_rad,
    ]);
    let (off_road_m, lane_m) = if needs.road { road(&candidate.samples, judged) } else { (0.0, 0.0) };
    values.extend([off_road_m, lane_m]);
    values.push(if needs.log { log_deviation_m(&candidate.samples, judged) } else { 0.0 });
    values.push(if needs.bystanders { bystander_gap_m(&candidate.samples, judged) } else { 0.0 });
    let whose = Whose { situation: judged.situation, actor: judged.actor, from_step: judged.from_step };
    let met = if needs.contact { foreseen(&candidate.samples, whose) } else { Foreseen::default() };
    let flag = |holds: bool| if holds { 1.0 } else { 0.0 };
    values.extend([
        met.angle_rad,
        flag(met.side == Some(Side::Front)),
        flag(matches!(met.side, Some(Side::Left | Side::Right))),
        flag(met.side == Some(Side::Rear)),
        flag(met.striker == Some(Striker::Other)),
        flag(met.striker == Some(Striker::Ego)),
        met.seen_coming_s,
    ]);
    let harm = if needs.harm { harm(&candidate.samples, whose) } else { Harm::default() };
    values.extend([harm.wrong_way_m, harm.off_road_m, harm.acceleration_mps2, harm.jerk_mps3]);
    values.push(if needs.way { log_way_share(until_contact(&candidate.samples, &ego), judged) } else { 0.0 });
    debug_assert_eq!(values.len(), vocabulary::CANDIDATE.len());
    values
}

/// One of the values by its feature's name; `None` for a name that is no candidate feature.
pub fn feature(values: &[f64], name: &str) -> Option<f64> {
    vocabulary::CANDIDATE.iter().position(|feature| feature.name == name).and_then(|place| values.get(place).copied())
}

/// Closest approach to the ego's rollout.
#[derive(Clone, Copy, Debug, Default)]
struct EgoRelation {
    distance_m_min: f64,
    approach_s: f64,
    speed_mps: f64,
    likelihood: f64,
    /// Samples up to the first overlap and with it; all where there is none.
    samples: usize,
}

fn ego_relation(samples: &[Sample], judged: &Judged<'_>) -> EgoRelation {
    let situation = judged.situation;
    let now = situation.scene.current_step;
    let track = situation.track(judged.actor);
    let own_reach = 0.5 * num::hypot(track.length_m, track.width_m);
    let mut measured =
        EgoRelation { distance_m_min: 200.0, approach_s: 20.0, samples: samples.len(), ..EgoRelation::default() };
    for (k, sample) in samples.iter().enumerate() {
        let step = judged.from_step + k;
        let (Some(ego), Some(body)) = (situation.ego.at(step), situation.ego.body(step)) else { break };
        let reach = body.radius() + own_reach;
        if sample.position.distance(body.center) - reach >= measured.distance_m_min {
            continue;
        }
        let distance = situation.body(judged.actor, sample).distance(body);
        if distance < measured.distance_m_min {
            measured.distance_m_min = distance;
            measured.approach_s = step.saturating_sub(now) as f64 * DT_S;
            measured.speed_mps = (sample.velocity - ego.velocity).norm();
        }
        if distance == 0.0 {
            // First overlap: CAT's discount per 0.5 s.
            measured.likelihood = num::pow(0.99, (k / 5 + 1) as f64);
            measured.samples = k + 1;
            break;
        }
    }
    measured
}

/// Motion extremes from finite differences, the anchor before the first sample included.
#[derive(Clone, Copy, Debug, Default)]
pub struct Kinematics {
    pub acceleration_mps2_max: f64,
    pub lateral_mps2_max: f64,
    pub jerk_mps3_max: f64,
    pub yaw_rate_radps_max: f64,
    pub speed_mps_max: f64,
    pub heading_change_rad: f64,
}

fn kinematics(samples: &[Sample], judged: &Judged<'_>) -> Kinematics {
    let anchor = judged.from_step.checked_sub(1).and_then(|k| judged.situation.track(judged.actor).at(k));
    let all: Vec<&Sample> = anchor.into_iter().chain(samples).collect();
    let mut measured = Kinematics::default();
    let mut last_acceleration: Option<f64> = None;
    for pair in all.windows(2) {
        let (speed, next) = (pair[0].speed_mps(), pair[1].speed_mps());
        let turn = num::wrap_angle(pair[1].heading_rad - pair[0].heading_rad);
        let acceleration = (next - speed) / DT_S;
        let yaw_rate = turn / DT_S;
        measured.acceleration_mps2_max = measured.acceleration_mps2_max.max(acceleration.abs());
        measured.lateral_mps2_max = measured.lateral_mps2_max.max((0.5 * (speed + next) * yaw_rate).abs());
        measured.yaw_rate_radps_max = measured.yaw_rate_radps_max.max(yaw_rate.abs());
        measured.speed_mps_max = measured.speed_mps_max.max(next);
        measured.heading_change_rad += turn.abs();
        if let Some(last) = last_acceleration {
            measured.jerk_mps3_max = measured.jerk_mps3_max.max((acceleration - last).abs() / DT_S);
        }
        last_acceleration = Some(acceleration);
    }
    measured
}

/// How far a corner leaves the drivable area, and the distance from the nearest centre line; largest of each.
fn road(samples: &[Sample], judged: &Judged<'_>) -> (f64, f64) {
    road_within(samples, judged, [f64::INFINITY, LANE_M_MAX])
}

/// Lanes farther away than this do not count, metres.
const LANE_M_MAX: f64 = 10.0;

/// Largest distances of the body's corners from the road and of its centre from a lane, each at most what is asked for,
/// metres. What lies farther is not looked for, which saves most of the time beside the road.
pub fn road_within(samples: &[Sample], judged: &Judged<'_>, [off_max_m, lane_max_m]: [f64; 2]) -> (f64, f64) {
    let lanes = &judged.situation.lanes;
    let (mut off_m, mut lane_m) = (0.0f64, 0.0f64);
    // No piece yet.
    let (mut near_road, mut near_lane) = (u32::MAX, u32::MAX);
    let off_max_m = off_max_m.min(OFF_ROAD_MAX_M);
    for sample in samples.iter().step_by(STRIDE).chain(samples.last()) {
        if off_m < off_max_m {
            for corner in judged.situation.body(judged.actor, sample).corners() {
                off_m = lanes.off_road_beyond_m(corner, off_m, off_max_m, &mut near_road);
            }
        }
        if lane_m < lane_max_m {
            lane_m = lanes.lane_distance_beyond_m(sample.position, lane_m, lane_max_m, &mut near_lane);
        }
    }
    (off_m, if lanes.lane_count() == 0 { 0.0 } else { lane_m })
}

fn log_deviation_m(samples: &[Sample], judged: &Judged<'_>) -> f64 {
    let track = judged.situation.track(judged.actor);
    let steps = samples.iter().enumerate().filter_map(|(k, s)| Some((s, track.at(judged.from_step + k)?)));
    steps.map(|(own, log)| own.position.distance(log.position)).fold(0.0, f64::max)
}

fn until_contact<'s>(samples: &'s [Sample], ego: &EgoRelation) -> &'s [Sample] {
    &samples[..ego.samples.min(samples.len())]
}

/// Shortest logged way of which a share is given, metres; the same as realism's.
const LOGGED_WAY_M_MIN: f64 = 5.0;

/// Arc length of the last sample's place along the logged way over that of the log at the same time: what the diagnostic
/// `route_completion` measures of the simulated motion. 1 where the log has no such way.
fn log_way_share(samples: &[Sample], judged: &Judged<'_>) -> f64 {
    let Some(last) = samples.last() else { return 1.0 };
    let track = judged.situation.track(judged.actor);
    let from = judged.from_step.saturating_sub(1);
    let logged = (from..judged.from_step + samples.len()).map_while(|k| track.at(k)).map(|sample| sample.position);
    let way: Vec<_> = logged.collect();
    let (mut way_m, mut driven_m, mut nearest_m) = (0.0, 0.0, f64::INFINITY);
    for pair in way.windows(2) {
        let step = pair[1] - pair[0];
        let share = ((last.position - pair[0]).dot(step) / step.norm_squared().max(1e-12)).clamp(0.0, 1.0);
        let off_m = last.position.distance(pair[0].lerp(pair[1], share));
        if off_m <= nearest_m {
            (nearest_m, driven_m) = (off_m, way_m + share * step.norm());
        }
        way_m += step.norm();
    }
    if way_m < LOGGED_WAY_M_MIN { 1.0 } else { driven_m / way_m }
}

fn bystander_gap_m(samples: &[Sample], judged: &Judged<'_>) -> f64 {
    let scene = &judged.situation.scene;
    let mut gap_m = FAR_GAP_M;
    for (k, sample) in samples.iter().enumerate().step_by(STRIDE) {
        let body = judged.situation.body(judged.actor, sample);
        for (ix, track) in scene.tracks.iter().enumerate() {
            if ix == judged.actor || judged.adversaries.contains(&ix) {
                continue;
            }
            let Some(other) = track.at(judged.from_step + k) else { continue };
            let reach = body.radius() + 0.5 * (track.length_m + track.width_m);
            if sample.position.distance(other.position) - reach < gap_m {
                let theirs = OrientedBox::new(other.position, other.heading_rad, track.length_m, track.width_m);
                gap_m = gap_m.min(body.distance(&theirs));
            }
        }
    }
    gap_m
}
