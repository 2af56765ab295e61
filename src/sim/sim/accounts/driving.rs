//! The account of SafeBench's criteria over a rollout of a staged scene: the data, beyond that of every outcome, from which
//! its overall score and the adversaries' realism are computed.

use serde::{Deserialize, Serialize};

use crate::kernel::{Vec2, num};
use crate::scene::{AgentKind, DT_S, LightState, Sample};
use crate::sim::prepared::body::Place;
use crate::sim::prepared::course::Course;
use crate::sim::prepared::plant::Plant;
use crate::sim::road_users::actors::Actor;
use crate::sim::road_users::driver::EgoState;

/// Length before a stop sign's line in which the ego must stand, metres (about a CARLA trigger volume).
pub const STOP_ZONE_M: f64 = 5.0;
/// Speed up to which the ego stands still, m/s (leaderboard's `RunningStopTest`).
pub const STANDING_MPS: f64 = 0.1;

/// SafeBench's criteria of one run, unscaled.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Driving {
    /// Simulated time, s.
    pub duration_s: f64,
    /// True if the route was completed: more than 99 % of it and less than 10 m from its end.
    pub completed: bool,
    /// Stop lines passed on red.
    pub red_lights: u32,
    /// Stop signs passed without standing still.
    pub stop_signs: u32,
    /// Distance driven with the centre off all driving lanes, metres: steps whose end or beginning is off the road.
    pub off_road_m: f64,
    /// Mean over time of the distance to the route, metres.
    pub route_distance_m_mean: f64,
    /// Mean over time of the norm of the acceleration, m/s².
    pub acceleration_mps2_mean: f64,
    /// Sum of the absolute changes of heading, radians, not unwrapped (as SafeBench): passing +-pi counts a full turn.
    pub yaw_change_rad: f64,
    /// Steps in which a corner of the ego crossed a painted line (CARLA's lane invasion sensor).
    pub lane_invasions: u32,
    /// The adversaries, in the order of the actions.
    pub actors: Vec<ActorConduct>,
}

/// Data on one adversary for realism in SafeBench, beside its [`AdversaryReport`](crate::sim::AdversaryReport).
///
/// Both are taken up to [`AFTER_S`] after the moment at which the adversary was nearest to the ego (the end of their
/// encounter): SafeBench's scripts drive straight on for ever, through bends and fields, and that part is ignored.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ActorConduct {
    /// The sort of road user.
    pub kind: AgentKind,
    /// True if it ever moved.
    pub moved: bool,
    /// 95th percentile over the steps of its motion of the absolute longitudinal acceleration, m/s².
    pub acceleration_mps2_p95: f64,
    /// Mean over the time of its motion of the absolute longitudinal jerk, m/s³.
    pub jerk_mps3_mean: f64,
    /// Distance box to box to the ego at the first step, metres.
    pub ego_gap_m_first: f64,
    /// Smallest distance box to box to another adversary, metres; `None` where it is the only one.
    pub other_gap_m_min: Option<f64>,
}

/// Time after its nearest moment at which an encounter is over, s.
pub const AFTER_S: f64 = 1.0;
/// Least change of distance that counts as coming nearer, metres.
const NEARER_M: f64 = 0.01;

/// The account under way.
pub(in crate::sim) struct DrivingMeter {
    so_far: Driving,
    last: Option<(EgoState, [Vec2; 4])>,
    was_off_road: bool,
    hint: u32,
    /// Sums of value times seconds.
    route_distance: f64,
    speed_change_mps: f64,
    /// Lowest speed within the zone of each stop line.
    slowest_mps: Vec<f64>,
    actors: Vec<ActorMeter>,
    /// Distance driven far beside the route, metres.
    astray_m: f64,
}

/// InRouteTest: distance beside the route at which the run is over, metres.
const LEFT_ROUTE_M: f64 = 30.0;
/// InRouteTest: share of the route that, driven more than [`ASTRAY_M`] beside it, ends the run too.
const ASTRAY_SHARE: f64 = 0.3;
const ASTRAY_M: f64 = 15.0;
/// RouteCompletionTest.
const COMPLETED_SHARE: f64 = 0.99;
const COMPLETED_M: f64 = 10.0;

struct ActorMeter {
    conduct: ActorConduct,
    /// Speed and acceleration of the last step.
    last: Option<(f64, Option<f64>)>,
    /// Absolute values while it moves, with room for every step.
    accelerations_mps2: Vec<f64>,
    jerk_mps2_sum: f64,
    moving_s: f64,
    encounter: Encounter,
    /// State at the end of the encounter, while it is over: number of accelerations, sum of jerk, time, smallest gap.
    judged: Option<(usize, f64, f64, Option<f64>)>,
}

/// The nearest moment of an adversary and the ego, and the time since.
#[derive(Clone, Copy)]
struct Encounter {
    /// Smallest distance between centres so far.
    distance_m_min: f64,
    since_s: f64,
}

impl Encounter {
    fn new() -> Encounter {
        Encounter { distance_m_min: f64::INFINITY, since_s: 0.0 }
    }

    fn see(&mut self, distance_m: f64, seconds: f64) {
        self.since_s += seconds;
        if distance_m < self.distance_m_min - NEARER_M {
            (self.distance_m_min, self.since_s) = (distance_m, 0.0);
        }
    }

    fn is_over(&self) -> bool {
        // Half a step of slack: ten steps of 0.1 s are one second.
        self.since_s + 0.5 * DT_S > AFTER_S
    }
}

impl DrivingMeter {
    pub fn new(course: &Course, actors: &[Actor], steps: usize) -> DrivingMeter {
        let meter = |actor: &Actor| ActorMeter {
            conduct: ActorConduct {
                kind: actor.size.kind,
                moved: false,
                acceleration_mps2_p95: 0.0,
                jerk_mps3_mean: 0.0,
                ego_gap_m_first: 0.0,
                other_gap_m_min: None,
            },
            last: None,
            accelerations_mps2: Vec::with_capacity(steps + 1),
            jerk_mps2_sum: 0.0,
            moving_s: 0.0,
            encounter: Encounter::new(),
            judged: None,
        };
        DrivingMeter {
            so_far: Driving::default(),
            last: None,
            was_off_road: false,
            hint: 0,
            route_distance: 0.0,
            speed_change_mps: 0.0,
            slowest_mps: vec![f64::INFINITY; course.stop_lines_s_m.len()],
            actors: actors.iter().map(meter).collect(),
            astray_m: 0.0,
        }
    }

    /// Takes the state at simulated step `k`, `seconds` after the last one.
    pub fn observe(
        &mut self,
        plant: &Plant,
        course: &Course,
        ego: &EgoState,
        others: &[Actor],
        k: usize,
        seconds: f64,
    ) {
        let corners = ego.size.at(Place { position: ego.sample.position, axis: ego.axis }).corners();
        let off_road = course.driving.distance_m(ego.sample.position, 0.0, &mut self.hint) > 0.0;
        self.observe_others(ego, others, seconds);
        let Some((last, last_corners)) = self.last.replace((*ego, corners)) else {
            self.was_off_road = off_road;
            return;
        };
        let way_m = last.sample.position.distance(ego.sample.position);
        let offset_m = ego.along.offset_m.abs();
        self.so_far.duration_s += seconds;
        self.route_distance += offset_m * seconds;
        self.speed_change_mps += (ego.sample.velocity - last.sample.velocity).norm();
        self.so_far.yaw_change_rad += (ego.sample.heading_rad - last.sample.heading_rad).abs();
        if off_road || self.was_off_road {
            self.so_far.off_road_m += way_m;
        }
        self.was_off_road = off_road;
        if offset_m > ASTRAY_M {
            self.astray_m += way_m;
        }
        let invades = corners.iter().zip(&last_corners).any(|(now, before)| course.crosses_mark(*before, *now));
        self.so_far.lane_invasions += u32::from(invades);
        self.so_far.red_lights += u32::from(runs_red(plant, &last, ego, k));
        self.so_far.stop_signs += self.runs_signs(course, &last, ego);
    }

    /// Returns the number of signs whose line is passed without standing before it.
    fn runs_signs(&mut self, course: &Course, last: &EgoState, ego: &EgoState) -> u32 {
        let (before, now) = (front_s_m(last), front_s_m(ego));
        let mut run = 0;
        for (line_s_m, slowest) in course.stop_lines_s_m.iter().zip(&mut self.slowest_mps) {
            if before <= *line_s_m && before >= line_s_m - STOP_ZONE_M {
                *slowest = slowest.min(last.speed_mps);
            }
            run += u32::from(before <= *line_s_m && now > *line_s_m && *slowest > STANDING_MPS);
        }
        run
    }

    fn observe_others(&mut self, ego: &EgoState, others: &[Actor], seconds: f64) {
        let first = self.last.is_none();
        let own = ego.size.at(Place { position: ego.sample.position, axis: ego.axis });
        let shape = |actor: &Actor, now: &Sample| actor.size.at(Place { position: now.position, axis: actor.axis });
        let count = self.actors.len();
        for (i, (meter, actor)) in self.actors.iter_mut().zip(others).enumerate() {
            let Some(now) = &actor.now else { continue };
            if first {
                meter.conduct.ego_gap_m_first = own.distance(&shape(actor, now));
            }
            meter.push(now.speed_mps(), seconds);
            meter.encounter.see(ego.sample.position.distance(now.position), seconds);
            // Adversaries come first among the simulated ones.
            for (j, other) in others.iter().take(count).enumerate() {
                if let (true, Some(there)) = (i != j, &other.now) {
                    let gap_m = shape(actor, now).distance(&shape(other, there));
                    let least = meter.conduct.other_gap_m_min.map_or(gap_m, |g| g.min(gap_m));
                    meter.conduct.other_gap_m_min = Some(least);
                }
            }
            meter.judge();
        }
    }

    /// Returns `true` if the nearest moment of an adversary and the ego lies so far back that the adversary is no longer judged.
    pub fn encounter_is_over(&self, adversary: usize) -> bool {
        self.actors.get(adversary).is_some_and(|meter| meter.encounter.is_over())
    }

    /// Implements SafeBench's InRouteTest: returns `true` if the run is over because the ego left its route.
    pub fn has_left_route(&self, ego: &EgoState, route_m: f64) -> bool {
        ego.along.offset_m.abs() > LEFT_ROUTE_M || self.astray_m > ASTRAY_SHARE * route_m
    }

    /// Implements SafeBench's RouteCompletionTest: returns `true` if the route is completed.
    pub fn has_arrived(&mut self, ego: &EgoState, completion: f64, end: Vec2) -> bool {
        self.so_far.completed = completion > COMPLETED_SHARE && ego.sample.position.distance(end) < COMPLETED_M;
        self.so_far.completed
    }

    pub fn finish(&self) -> Driving {
        let mut driving = self.so_far.clone();
        if driving.duration_s > 0.0 {
            driving.route_distance_m_mean = self.route_distance / driving.duration_s;
            driving.acceleration_mps2_mean = self.speed_change_mps / driving.duration_s;
        }
        driving.actors = self.actors.iter().map(ActorMeter::finish).collect();
        driving
    }
}

impl ActorMeter {
    fn push(&mut self, speed_mps: f64, seconds: f64) {
        let Some((last_mps, last_mps2)) = self.last else {
            self.last = Some((speed_mps, None));
            return;
        };
        let acceleration = (speed_mps - last_mps) / seconds;
        if speed_mps > 0.0 || last_mps > 0.0 {
            self.conduct.moved = true;
            self.moving_s += seconds;
            self.accelerations_mps2.push(acceleration.abs());
            if let Some(before) = last_mps2 {
                self.jerk_mps2_sum += (acceleration - before).abs();
            }
        }
        self.last = Some((speed_mps, Some(acceleration)));
    }

    /// Stores the state at the end of the encounter; one that begins again is judged as a whole.
    fn judge(&mut self) {
        if !self.encounter.is_over() {
            self.judged = None;
        } else if self.judged.is_none() {
            self.judged = Some(self.so_far());
        }
    }

    fn so_far(&self) -> (usize, f64, f64, Option<f64>) {
        (self.accelerations_mps2.len(), self.jerk_mps2_sum, self.moving_s, self.conduct.other_gap_m_min)
    }

    fn finish(&self) -> ActorConduct {
        let (count, jerk_mps2_sum, moving_s, other_gap_m_min) = self.judged.unwrap_or_else(|| self.so_far());
        let mean = if moving_s > 0.0 { jerk_mps2_sum / moving_s } else { 0.0 };
        let p95 = num::quantile(&self.accelerations_mps2[..count], 0.95).unwrap_or(0.0);
        ActorConduct { acceleration_mps2_p95: p95, jerk_mps3_mean: mean, other_gap_m_min, ..self.conduct }
    }
}

/// Returns the arc length of the ego's front bumper, metres.
fn front_s_m(ego: &EgoState) -> f64 {
    ego.along.s_m + ego.size.half_length_m
}

/// Returns `true` if the front passed a stop line in this step while its light was red.
fn runs_red(plant: &Plant, last: &EgoState, ego: &EgoState, k: usize) -> bool {
    let (before, now) = (front_s_m(last), front_s_m(ego));
    let mut lights = plant.lights.iter().filter(|light| before <= light.s_m && now > light.s_m);
    lights.any(|light| light.states.get(k.saturating_sub(1)) == Some(&LightState::Stop))
}
