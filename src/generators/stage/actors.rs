//! Features of a vehicle relative to the ego at the current step: the values of `vocabulary::ACTOR`.

use super::ego_path::EgoPath;
use crate::adapters::vocabulary;
use crate::kernel::geom::segments_cross;
use crate::kernel::{OrientedBox, Pose, Vec2, num};
use crate::scene::{AgentKind, DT_S, LaneGraph, LaneIx, Sample, Scene, Track, TrackIx};

/// Time that stands for "never", seconds.
const NEVER_S: f64 = 20.0;
/// Distance that stands for "nobody near", metres.
const FAR_M: f64 = 200.0;
/// A place farther than this from every lane belongs to none, metres.
const LANE_WITHIN_M: f64 = 4.0;
/// Log and route are compared at every this many samples for crossing.
const CROSSING_STRIDE: usize = 3;

/// Facts about a possible adversary.
#[derive(Clone, Debug, PartialEq)]
pub struct ActorFacts {
    /// In the order of `vocabulary::ACTOR`; booleans as 0 and 1.
    pub values: Vec<f64>,
}

impl ActorFacts {
    /// Returns the facts of a road user that is not there yet: far away, never near, everything else 0 and false.
    pub fn of_guest() -> ActorFacts {
        let value = |name: &str| match name {
            "gap_m" | "path_distance_m_min" => FAR_M,
            "time_to_conflict_s" | "arrival_difference_s" => NEVER_S,
            _ => 0.0,
        };
        ActorFacts { values: vocabulary::ACTOR.iter().map(|feature| value(feature.name)).collect() }
    }

    /// A value by its vocabulary name.
    pub fn value(&self, name: &str) -> Option<f64> {
        let place = vocabulary::ACTOR.iter().position(|f| f.name == name)?;
        self.values.get(place).copied()
    }
}

/// Facts of a track; `None` where it is no vehicle or is not observed at the current step.
pub fn facts(scene: &Scene, lanes: &LaneGraph, ego: &EgoPath, ix: TrackIx) -> Option<ActorFacts> {
    let track = scene.tracks.get(ix).filter(|t| t.kind == AgentKind::Vehicle)?;
    let now = scene.current_step;
    let own = track.at(now)?;
    let start = scene.ego.track.at(now).or_else(|| scene.ego.track.at(scene.ego.start_step))?;
    let delta = own.position - start.position;
    let apart = delta.norm();
    let rate = if apart > 1e-9 { delta.dot(own.velocity - start.velocity) / apart } else { 0.0 };
    let body = |s: &Sample, t: &Track| OrientedBox::new(s.position, s.heading_rad, t.length_m, t.width_m);
    let local = Pose { position: start.position, heading_rad: start.heading_rad }.to_local(own.position);
    let (nearest_m, nearest_s) = closest(scene, ego, track);
    let relation = lane_relation(lanes, start, own);
    let flag = |holds: bool| if holds { 1.0 } else { 0.0 };
    let values = vec![
        body(own, track).distance(&body(start, &scene.ego.track)),
        -rate,
        nearest_s,
        arrivals(scene, ego, track).map_or(NEVER_S, |(own, ego)| (own as f64 - ego as f64) * DT_S),
        nearest_m,
        own.speed_mps(),
        num::wrap_angle(own.heading_rad - start.heading_rad).abs(),
        local.x,
        local.y,
        moved_m(track, now),
        observed_share(track, now, scene.steps),
        flag(crosses_route(track, now, &scene.ego.route)),
        flag(relation == Relation::Same),
        flag(relation == Relation::Beside),
        flag(local.x < 0.0),
        flag(scene.objects_of_interest.contains(&ix)),
    ];
    debug_assert_eq!(values.len(), vocabulary::ACTOR.len());
    Some(ActorFacts { values: values.into_iter().map(|x| num::stored(x).unwrap_or(0.0)).collect() })
}

/// Smallest box distance of log and ego rollout at equal times, and when, seconds after the current step.
fn closest(scene: &Scene, ego: &EgoPath, track: &Track) -> (f64, f64) {
    let (mut best_m, mut best_s) = (FAR_M, NEVER_S);
    for step in scene.current_step..scene.steps {
        let (Some(sample), Some(body)) = (track.at(step), ego.body(step)) else { continue };
        let reach = body.radius() + 0.5 * num::hypot(track.length_m, track.width_m);
        // Boxes are never nearer than their circles.
        if sample.position.distance(body.center) - reach >= best_m {
            continue;
        }
        let own = OrientedBox::new(sample.position, sample.heading_rad, track.length_m, track.width_m);
        let gap_m = own.distance(body);
        if gap_m < best_m {
            (best_m, best_s) = (gap_m, (step - scene.current_step) as f64 * DT_S);
        }
    }
    (best_m, best_s)
}

/// When the actor and the ego arrive at the first place that both paths touch, seconds after the current step.
pub fn arrivals_s(scene: &Scene, ego: &EgoPath, track: &Track) -> Option<[f64; 2]> {
    let since = |step: usize| (step as f64 - scene.current_step as f64) * DT_S;
    arrivals(scene, ego, track).map(|(own, other)| [since(own), since(other)])
}

/// The same as steps of the scene.
fn arrivals(scene: &Scene, ego: &EgoPath, track: &Track) -> Option<(usize, usize)> {
    let near = 0.5 * (track.width_m + ego.width_m);
    let near_squared = near * near;
    let mut best: Option<(usize, usize)> = None;
    for own in scene.current_step..scene.steps {
        let Some(sample) = track.at(own) else { continue };
        for other in ego.steps().skip_while(|&s| s < scene.current_step) {
            if best.is_some_and(|(a, b)| own + other >= a + b) {
                break;
            }
            if ego.at(other).is_some_and(|e| (e.position - sample.position).norm_squared() <= near_squared) {
                best = Some((own, other));
                break;
            }
        }
    }
    best
}

fn moved_m(track: &Track, now: usize) -> f64 {
    let mut last: Option<Vec2> = None;
    let mut moved = 0.0;
    for sample in track.samples.iter().skip(now).flatten() {
        moved += last.map_or(0.0, |p| p.distance(sample.position));
        last = Some(sample.position);
    }
    moved
}

fn observed_share(track: &Track, now: usize, steps: usize) -> f64 {
    let after = steps.saturating_sub(now + 1);
    let seen = track.samples.iter().skip(now + 1).flatten().count();
    if after == 0 { 0.0 } else { seen as f64 / after as f64 }
}

fn crosses_route(track: &Track, now: usize, route: &[Vec2]) -> bool {
    let path: Vec<Vec2> =
        track.samples.iter().skip(now).step_by(CROSSING_STRIDE).flatten().map(|s| s.position).collect();
    path.windows(2).any(|own| route.windows(2).any(|way| segments_cross(own[0], own[1], way[0], way[1])))
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Relation {
    Same,
    Beside,
    Other,
}

fn lane_relation(lanes: &LaneGraph, ego: &Sample, own: &Sample) -> Relation {
    let lane = |s: &Sample| lanes.nearest_lane(s.position, s.heading_rad, LANE_WITHIN_M).map(|place| place.lane);
    let (Some(theirs), Some(ours)) = (lane(ego), lane(own)) else { return Relation::Other };
    let linked = |a: LaneIx, b: LaneIx| lanes.exits(a).contains(&b) || lanes.entries(a).contains(&b);
    if theirs == ours || linked(theirs, ours) {
        Relation::Same
    } else if lanes.beside(theirs).any(|lane| lane == ours) {
        Relation::Beside
    } else {
        Relation::Other
    }
}
