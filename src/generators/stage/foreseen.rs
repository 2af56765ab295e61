//! Effect that a candidate would have on the ego of the known rollout, and the harm that it adds to the actor's own recording.

use super::situation::Situation;
use crate::kernel::{Vec2, num};
use crate::scene::{DT_S, Sample, TrackIx};
use crate::sim::{Side, Striker, meeting};

/// Road users within this much beside the ego's way are in it, metres.
const SIDE_ROOM_M: f64 = 0.3;
/// The ego sees so far, metres, and to either side by this cosine (100 degrees off its heading).
const SIGHT_M: f64 = 60.0;
const SIGHT_COSINE: f64 = -0.173_648_177_666_930_33;
/// The ego's way is looked at this many steps ahead (4 s).
const AHEAD_STEPS: usize = 40;

/// Whose candidate it is, and the scene step of its first sample.
#[derive(Clone, Copy, Debug)]
pub struct Whose<'a> {
    pub situation: &'a Situation,
    pub actor: TrackIx,
    pub from_step: usize,
}

/// The predicted contact, or the closest approach where there is none.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Foreseen {
    /// Course of the candidate against the ego's heading then, 0..π.
    pub angle_rad: f64,
    /// Which side of the ego is touched; none where nothing is.
    pub side: Option<Side>,
    pub striker: Option<Striker>,
    /// Time before it that the candidate has been in the ego's way and in its sight, without a break.
    pub seen_coming_s: f64,
}

/// Returns how a candidate meets the ego's rollout.
pub fn foreseen(samples: &[Sample], whose: Whose<'_>) -> Foreseen {
    let Some((at, touches)) = nearest(samples, whose) else { return Foreseen::default() };
    let situation = whose.situation;
    let step = whose.from_step + at;
    let (Some(ego), Some(body)) = (situation.ego.at(step), situation.ego.body(step)) else {
        return Foreseen::default();
    };
    let sample = &samples[at];
    let course_rad = if sample.speed_mps() > 0.1 { sample.velocity.heading() } else { sample.heading_rad };
    let met = touches.then(|| meeting(body, ego.velocity, &situation.body(whose.actor, sample), sample.velocity));
    let visible = (0..=at).rev().take_while(|k| is_threat(&samples[*k], whose, whose.from_step + k, step)).count();
    Foreseen {
        angle_rad: num::wrap_angle(course_rad - ego.heading_rad).abs(),
        side: met.map(|(side, _)| side),
        striker: met.map(|(_, striker)| striker),
        seen_coming_s: visible.saturating_sub(1) as f64 * DT_S,
    }
}

/// Index of the first touching sample, or of the nearest one, and whether it touches.
fn nearest(samples: &[Sample], whose: Whose<'_>) -> Option<(usize, bool)> {
    let situation = whose.situation;
    let mut best: Option<(usize, f64)> = None;
    for (k, sample) in samples.iter().enumerate() {
        let Some(body) = situation.ego.body(whose.from_step + k) else { break };
        let own = situation.body(whose.actor, sample);
        let apart_m = sample.position.distance(body.center) - own.radius() - body.radius();
        if best.is_some_and(|(_, least_m)| apart_m >= least_m) {
            continue;
        }
        let distance_m = own.distance(body);
        if distance_m == 0.0 {
            return Some((k, true));
        }
        if best.is_none_or(|(_, least_m)| distance_m < least_m) {
            best = Some((k, distance_m));
        }
    }
    best.map(|(k, _)| (k, false))
}

/// Returns `true` if a sample is in the ego's sight at that step, and within [`SIDE_ROOM_M`] of the way that it drives until `until`.
fn is_threat(sample: &Sample, whose: Whose<'_>, step: usize, until: usize) -> bool {
    let situation = whose.situation;
    let Some(ego) = situation.ego.at(step) else { return false };
    let delta = sample.position - ego.position;
    let apart_m = delta.norm();
    let axis = Vec2::from_heading(ego.heading_rad);
    if apart_m > SIGHT_M || delta.dot(axis) < SIGHT_COSINE * apart_m {
        return false;
    }
    let own = situation.body(whose.actor, sample);
    (step..=until.min(step + AHEAD_STEPS)).any(|later| {
        situation.ego.body(later).is_some_and(|body| {
            let near = own.center.distance(body.center) <= own.radius() + body.radius() + SIDE_ROOM_M;
            near && own.distance(body) <= SIDE_ROOM_M
        })
    })
}

/// Harm that a candidate adds to the worst of the actor's own recording: metres off the road, m/s², m/s³; and its
/// metres against the direction of lanes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Harm {
    pub wrong_way_m: f64,
    pub off_road_m: f64,
    pub acceleration_mps2: f64,
    pub jerk_mps3: f64,
}

/// The harm of a candidate, as realism measures it on the motion that was simulated.
pub fn harm(samples: &[Sample], whose: Whose<'_>) -> Harm {
    let situation = whose.situation;
    let track = situation.track(whose.actor);
    let would = situation.plant.feasibility_of(track.kind, track.length_m, track.width_m, samples);
    let is_recorded = situation.as_guest(whose.actor).is_none();
    let did = if is_recorded { situation.plant.recorded(whose.actor) } else { Default::default() };
    Harm {
        wrong_way_m: would.wrong_way_m,
        off_road_m: (would.off_road_m - did.off_road_m).max(0.0),
        acceleration_mps2: (would.acceleration_mps2 - did.acceleration_mps2).max(0.0),
        jerk_mps3: (would.jerk_mps3 - did.jerk_mps3).max(0.0),
    }
}
