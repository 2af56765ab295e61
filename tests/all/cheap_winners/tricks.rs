//! What was tried to win cheaply, as motions around the way that the ego drives undisturbed.

use std::sync::Arc;

use evodrive::compiler::Situation;
use evodrive::ego::Policy;
use evodrive::kernel::{Vec2, num};
use evodrive::scene::{AgentKind, DT_S, LaneKind, Sample, Track};
use evodrive::sim::{Action, ActorRef};

/// Steps from the first one that a program may change to the one in which the ego is to be met.
const UNTIL: usize = 20;
/// Steps that a motion lasts.
const STEPS: usize = 45;
/// The ego is this fast at least where it is met, m/s.
const SPEED_MPS_MIN: f64 = 4.0;
const CAR_M: (f64, f64) = (4.6, 1.9);

/// A scene with the place in which the ego is to be met.
pub struct Stage {
    pub situation: Situation,
    first: usize,
    meets: usize,
}

/// What somebody does: who it is in the scene, perhaps another scene, and the motions.
pub type Plan = (Option<Situation>, Vec<Action>);

impl Stage {
    /// `None` where the ego is too slow to be met.
    pub fn of(situation: Situation) -> Option<Stage> {
        let first = situation.first_step();
        let meets = first + UNTIL;
        let fast = |step| situation.ego.at(step).is_some_and(|sample| sample.speed_mps() >= SPEED_MPS_MIN);
        (fast(first) && fast(meets)).then_some(Stage { situation, first, meets })
    }

    /// The same where the ego sets off from a stand: it is met once it has come to speed.
    pub fn once_fast(situation: Situation) -> Option<Stage> {
        let fast = |step: &usize| situation.ego.at(*step).is_some_and(|sample| sample.speed_mps() >= SPEED_MPS_MIN);
        let first = situation.ego.steps().find(|step| fast(step) && fast(&(step + UNTIL)))?;
        Some(Stage { situation, first, meets: first + UNTIL })
    }

    /// The ego at a step of its undisturbed drive; beyond its end, on at its last velocity.
    fn ego(&self, step: usize) -> Sample {
        let last = self.situation.ego.steps().end - 1;
        let known = *self.situation.ego.at(step.min(last)).expect("a step of the drive");
        let beyond_s = step.saturating_sub(last) as f64 * DT_S;
        Sample { position: known.position + known.velocity * beyond_s, ..known }
    }

    /// A place in the ego's frame at a step, m ahead of its centre and m to its left.
    fn place(&self, step: usize, (ahead_m, left_m): (f64, f64)) -> Vec2 {
        let (ego, axis) = (self.ego(step), Vec2::from_heading(self.ego(step).heading_rad));
        ego.position + axis * ahead_m + axis.left() * left_m
    }

    /// Somebody new. `at` gives place and heading by the seconds since it appears; a heading that is missing is that of the motion.
    fn inserted(&self, kind: AgentKind, from_step: usize, at: impl Fn(f64) -> (Vec2, Option<f64>)) -> Action {
        let (length_m, width_m) = match kind {
            AgentKind::Cyclist => (1.8, 0.6),
            AgentKind::Pedestrian => (0.6, 0.6),
            _ => CAR_M,
        };
        let sample = |k: usize| {
            let t = k as f64 * DT_S;
            let velocity = (at(t + DT_S).0 - at(t).0) * (1.0 / DT_S);
            let (position, heading) = at(t);
            Sample { position, velocity, heading_rad: heading.unwrap_or_else(|| velocity.heading()) }
        };
        Action::Insert { kind, length_m, width_m, from_step, samples: (0..STEPS).map(sample).collect() }
    }

    /// Somebody new who moves in the frame of the undisturbed ego.
    fn beside(&self, kind: AgentKind, from_step: usize, at: impl Fn(f64) -> (f64, f64)) -> Action {
        let place = |t: f64| {
            let (step, part) = (from_step + (t / DT_S) as usize, (t / DT_S).fract());
            let (one, next) = (self.place(step, at(t)), self.place(step + 1, at(t)));
            (one * (1.0 - part) + next * part, None)
        };
        self.inserted(kind, from_step, place)
    }

    /// Somebody new whose place and heading are drawn from where the ego is to be met.
    fn around_meeting(&self, kind: AgentKind, from_step: usize, at: impl Fn(f64) -> ((f64, f64), f64)) -> Action {
        let heading = self.ego(self.meets).heading_rad;
        self.inserted(kind, from_step, |t| {
            let (place, turned_rad) = at(t);
            (self.place(self.meets, place), Some(heading + turned_rad))
        })
    }

    fn car(&self, from_step: usize, at: impl Fn(f64) -> (f64, f64)) -> Action {
        self.beside(AgentKind::Vehicle, from_step, at)
    }

    fn log(&self, track: usize, shift: impl Fn(f64) -> f64) -> Action {
        let recorded = &self.situation.scene.tracks[track];
        let samples = (self.first..self.situation.scene.steps).map_while(|step| recorded.at(step)).enumerate();
        let aside = |(k, s): (usize, &Sample)| {
            let left = Vec2::from_heading(s.heading_rad).left();
            Sample { position: s.position + left * shift(k as f64 * DT_S), ..*s }
        };
        Action::Follow { track, from_step: self.first, samples: samples.map(aside).collect() }
    }

    /// The vehicle that the undisturbed ego runs into.
    fn met(&self) -> Option<usize> {
        match self.situation.ego_meets {
            Some(ActorRef::Track(track)) => Some(track),
            _ => None,
        }
    }
}

/// From one value to another between two times, eased in and out.
fn eased(t: f64, (from_s, to_s): (f64, f64), (from, to): (f64, f64)) -> f64 {
    let part = ((t - from_s) / (to_s - from_s)).clamp(0.0, 1.0);
    from + (to - from) * (0.5 - 0.5 * num::cos(num::PI * part))
}

fn alone(action: Action) -> Option<Plan> {
    Some((None, vec![action]))
}

/// No trick: somebody keeps well behind the ego and does nothing to it.
pub fn keeps_behind(stage: &Stage) -> Option<Plan> {
    alone(stage.car(stage.first, |_| (-25.0, 0.0)))
}

/// No trick either: of those who drive somebody far from the ego keeps a little more to the side.
pub fn keeps_aside(stage: &Stage) -> Option<Plan> {
    let ego = stage.ego(stage.first).position;
    let last = stage.situation.scene.steps - 1;
    let drives = |track: &Track| {
        let there = [stage.first, last].map(|step| track.at(step));
        track.kind == AgentKind::Vehicle && there.into_iter().all(|s| s.is_some_and(|s| s.speed_mps() > SPEED_MPS_MIN))
    };
    let others = stage.situation.scene.tracks.iter().enumerate();
    let others = others.filter(|(track, of)| Some(*track) != stage.met() && drives(of));
    let far = others.filter_map(|(ix, track)| Some((ix, track.at(stage.first)?.position.distance(ego))));
    let (far, _) = far.max_by(|a, b| a.1.total_cmp(&b.1))?;
    alone(stage.log(far, |t| eased(t, (0.0, 4.0), (0.0, 0.3))))
}

pub fn copies_the_log(stage: &Stage) -> Option<Plan> {
    alone(stage.log(stage.met()?, |_| 0.0))
}

pub fn nudges_whom_the_ego_hits_anyway(stage: &Stage) -> Option<Plan> {
    alone(stage.log(stage.met()?, |t| 0.3 * (t / 3.0).min(1.0)))
}

/// The nearest to the ego of those that it does not run into.
pub fn nudges_a_bystander(stage: &Stage) -> Option<Plan> {
    let (met, ego) = (stage.met()?, stage.ego(stage.first).position);
    let tracks = stage.situation.scene.tracks.iter().enumerate();
    let others = tracks.filter(|(ix, track)| *ix != met && track.kind == AgentKind::Vehicle);
    let near = others.filter_map(|(ix, track)| Some((ix, track.at(stage.first)?.position.distance(ego))));
    let (other, _) = near.min_by(|a, b| a.1.total_cmp(&b.1))?;
    alone(stage.log(other, |t| 0.3 * (t / 3.0).min(1.0)))
}

pub fn stands_up_close_ahead(stage: &Stage) -> Option<Plan> {
    alone(stage.around_meeting(AgentKind::Vehicle, stage.meets, |_| ((7.5, 0.0), 0.0)))
}

pub fn appears_slow_close_ahead(stage: &Stage) -> Option<Plan> {
    let mps = 0.3 * stage.ego(stage.meets).speed_mps();
    alone(stage.around_meeting(AgentKind::Vehicle, stage.meets, |t| ((6.0 + mps * t, 0.0), 0.0)))
}

pub fn rams_from_behind(stage: &Stage) -> Option<Plan> {
    alone(stage.car(stage.first, |t| (-9.0 + 4.0 * t, 0.0)))
}

/// Out of the blind side into the ego's flank, faster than anybody could evade.
pub fn darts_across(stage: &Stage) -> Option<Plan> {
    let turned = -0.5 * num::PI;
    alone(stage.around_meeting(AgentKind::Vehicle, stage.meets - 5, |t| ((1.0, 12.5 - 25.0 * t), turned)))
}

pub fn a_standing_car_slides_slowly(stage: &Stage) -> Option<Plan> {
    alone(stage.around_meeting(AgentKind::Vehicle, stage.first, |t| ((1.0, 2.6 - 0.45 * t), 0.0)))
}

/// The same of a thing that no driver moves.
pub fn a_parked_thing_slides_into_the_way(stage: &Stage) -> Option<Plan> {
    alone(stage.around_meeting(AgentKind::Static, stage.first, |t| ((1.0, 2.6 - 0.45 * t), 0.0)))
}

pub fn a_standing_car_turns_on_the_spot(stage: &Stage) -> Option<Plan> {
    alone(stage.around_meeting(AgentKind::Vehicle, stage.first, |t| ((1.0, 2.3), -0.25 * t)))
}

/// Somebody beside the ego who moves without turning.
fn crabs(stage: &Stage, left_m: impl Fn(f64) -> f64) -> Option<Plan> {
    let at = |t: f64| (2.0, left_m(t));
    let Action::Insert { kind, length_m, width_m, from_step, samples } = stage.car(stage.first, at) else {
        return None;
    };
    let straight = |(k, s): (usize, Sample)| Sample { heading_rad: stage.ego(from_step + k).heading_rad, ..s };
    let samples = samples.into_iter().enumerate().map(straight).collect();
    alone(Action::Insert { kind, length_m, width_m, from_step, samples })
}

pub fn a_moving_car_slides_sideways(stage: &Stage) -> Option<Plan> {
    crabs(stage, |t| 4.5 - 2.2 * t)
}

fn cuts_in(stage: &Stage, kind: AgentKind) -> Option<Plan> {
    let fast = stage.ego(stage.first).speed_mps() >= 10.0;
    let plan = alone(stage.beside(kind, stage.first, |t| (2.5, eased(t, (0.3, 2.3), (3.3, 0.5)))));
    plan.filter(|_| fast)
}

pub fn a_cyclist_keeps_pace_with_cars(stage: &Stage) -> Option<Plan> {
    cuts_in(stage, AgentKind::Cyclist)
}

pub fn a_pedestrian_keeps_pace_with_cars(stage: &Stage) -> Option<Plan> {
    cuts_in(stage, AgentKind::Pedestrian)
}

pub fn a_pedestrian_sprints_into_the_way(stage: &Stage) -> Option<Plan> {
    let turned = -0.5 * num::PI;
    alone(stage.around_meeting(AgentKind::Pedestrian, stage.meets - 10, |t| ((1.5, 6.0 - 6.0 * t), turned)))
}

/// Somebody crosses the way of an ego on a motorway, no faster than its kind is.
fn crosses_a_motorway(stage: &Stage, kind: AgentKind, mps: f64) -> Option<Plan> {
    let ego = stage.ego(stage.meets);
    let lane = stage.situation.plant.lanes().nearest_lane(ego.position, ego.heading_rad, 2.0)?.lane;
    let motorway = stage.situation.scene.road.lanes[lane].kind == LaneKind::Freeway;
    // A little along with traffic, so that nobody goes against a lane.
    let (along_mps, s) = (0.1 * mps, UNTIL as f64 * DT_S);
    let at = |t: f64| ((1.5 + along_mps * (t - s), mps * (s - t)), num::atan2(-mps, along_mps));
    alone(stage.around_meeting(kind, stage.first, at)).filter(|_| motorway)
}

pub fn a_pedestrian_walks_across_a_motorway(stage: &Stage) -> Option<Plan> {
    crosses_a_motorway(stage, AgentKind::Pedestrian, 1.8)
}

pub fn a_cyclist_rides_across_a_motorway(stage: &Stage) -> Option<Plan> {
    crosses_a_motorway(stage, AgentKind::Cyclist, 4.0)
}

pub fn brakes_with_two_g(stage: &Stage) -> Option<Plan> {
    let mps = stage.ego(stage.first).speed_mps();
    let (start, axis) = (stage.place(stage.first, (6.5, 0.0)), Vec2::from_heading(stage.ego(stage.first).heading_rad));
    let heading = stage.ego(stage.first).heading_rad;
    let brakes_s = 0.5;
    let way_m = |t: f64| {
        let braked_s = (t - brakes_s).clamp(0.0, mps / 19.62);
        mps * t.min(brakes_s) + mps * braked_s - 9.81 * braked_s * braked_s
    };
    alone(stage.inserted(AgentKind::Vehicle, stage.first, |t| (start + axis * way_m(t), Some(heading))))
}

pub fn jumps_in_front(stage: &Stage) -> Option<Plan> {
    alone(stage.car(stage.first, |t| if t < 1.05 { (4.0, 7.0) } else { (4.0, 0.0) }))
}

pub fn shakes(stage: &Stage) -> Option<Plan> {
    crabs(stage, |t| 2.4 + 0.65 * num::sin(2.0 * num::PI * 0.8 * t))
}

pub fn drives_against_traffic(stage: &Stage) -> Option<Plan> {
    let back = |t: f64| {
        let step = (2 * stage.meets - stage.first).saturating_sub((t / DT_S).round() as usize);
        let ego = stage.ego(step.max(stage.first));
        (ego.position, Some(num::wrap_angle(ego.heading_rad + num::PI)))
    };
    alone(stage.inserted(AgentKind::Vehicle, stage.first, back))
}

pub fn comes_from_off_the_road(stage: &Stage) -> Option<Plan> {
    let away_m = |side: f64| stage.situation.lanes.off_road_m(stage.place(stage.meets, (1.0, 16.0 * side)));
    let side = if away_m(1.0) >= away_m(-1.0) { 1.0 } else { -1.0 };
    let at = |t: f64| ((1.0, side * (16.0 - 8.0 * t)), -side * 0.5 * num::PI);
    alone(stage.around_meeting(AgentKind::Vehicle, stage.first, at)).filter(|_| away_m(side) > 8.0)
}

/// Through a car that stands beside the ego's way, then into the ego.
pub fn drives_through_a_parked_car(stage: &Stage) -> Option<Plan> {
    let mut scene = (*stage.situation.scene).clone();
    let (position, heading_rad) = (stage.place(stage.first + 8, (2.0, 3.4)), stage.ego(stage.first + 8).heading_rad);
    let samples = vec![Some(Sample { position, heading_rad, velocity: Vec2::ZERO }); scene.steps];
    let (length_m, width_m) = CAR_M;
    scene.tracks.push(Track { id: "parked".into(), kind: AgentKind::Vehicle, length_m, width_m, samples });
    let other = super::prepared(Arc::new(scene), &Policy::Idm);
    let way = stage.car(stage.first, |t| (2.0, eased(t, (1.4, 3.0), (3.4, 0.5))));
    Some((Some(other), vec![way]))
}

/// Through a car that drives beside the ego, then into the ego.
pub fn drives_through_another_car(stage: &Stage) -> Option<Plan> {
    let beside = stage.car(stage.first, |_| (2.0, 3.4));
    let through = stage.car(stage.first, |t| (2.0, eased(t, (0.0, 2.5), (9.0, 0.5))));
    Some((None, vec![through, beside]))
}

/// Somebody new appears within a car that drives beside the ego, and turns into the ego.
pub fn appears_in_another_car(stage: &Stage) -> Option<Plan> {
    let beside = stage.car(stage.first, |_| (2.0, 3.4));
    let out = stage.car(stage.first + 5, |t| (2.0, eased(t, (0.0, 2.0), (3.2, 0.5))));
    Some((None, vec![out, beside]))
}

/// Somebody new appears within the ego.
pub fn appears_in_the_ego(stage: &Stage) -> Option<Plan> {
    alone(stage.car(stage.meets, |_| (2.0, 0.5)))
}
