//! Scenes of SafeBench's eight traffic families on generated roads: ten routes per family, whose measures are drawn
//! within the ranges measured on the benchmark's own routes (number 4 to 13, Town01 to Town05). They replace the
//! benchmark's routes if CARLA's towns are not available; only the ranges are taken from them.

use serde::{Deserialize, Serialize};

use super::SynthError;
use super::family_site::{Bend, Crossing, Site};
use crate::kernel::{Pose, Seed, Stream, Vec2, num};
use crate::scene::safebench::{STEPS, SpawnFrame, Staging, TrafficFamily, ego_at_rest};
use crate::scene::{Light, LightState, Origin, Scene};

/// Number of the first evaluated route and of the last.
const ROUTES: (u32, u32) = (4, 13);
/// Most scenes of one family and route.
const DRAWS_MAX: u32 = 100;

/// Which scenes of the traffic families are generated.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FamilyOptions {
    /// Families, in the order of the pool.
    pub families: Vec<TrafficFamily>,
    /// Route numbers, 4 to 13 for the ten that SafeBench evaluates.
    pub routes: Vec<u32>,
    /// Scenes of each family and route, 1 to 100. They differ only in their names. A generator draws its random numbers
    /// by the scene's name, so they give several samples of its parameters on one route, as in SafeBench and ChatScene.
    pub draws: u32,
}

impl FamilyOptions {
    /// All eight families on the ten evaluated routes, one scene each.
    pub fn all() -> FamilyOptions {
        FamilyOptions { families: TrafficFamily::ALL.to_vec(), routes: (ROUTES.0..=ROUTES.1).collect(), draws: 1 }
    }

    /// Refuses options from which no scene can be made.
    pub fn check(&self) -> Result<(), SynthError> {
        let bad = |field, found: String, expected| Err(SynthError::Option { field, found, expected });
        let twice = |n: usize, same: &dyn Fn(usize, usize) -> bool| (0..n).any(|a| (0..a).any(|b| same(a, b)));
        if self.families.is_empty() || twice(self.families.len(), &|a, b| self.families[a] == self.families[b]) {
            return bad("families", format!("{:?}", self.families), "one to eight families, each once");
        }
        let legal = self.routes.iter().all(|r| (ROUTES.0..=ROUTES.1).contains(r));
        if self.routes.is_empty() || !legal || twice(self.routes.len(), &|a, b| self.routes[a] == self.routes[b]) {
            return bad("routes", format!("{:?}", self.routes), "route numbers from 4 to 13, each once");
        }
        if !(1..=DRAWS_MAX).contains(&self.draws) {
            return bad("draws", self.draws.to_string(), "1 to 100");
        }
        Ok(())
    }

    /// Number of scenes.
    pub fn count(&self) -> usize {
        self.families.len() * self.routes.len() * self.draws as usize
    }
}

/// The scene at place `i` of the pool: families in turn, each with all its routes, each with all its draws.
pub fn family_member(options: &FamilyOptions, seed: Seed, i: usize) -> Result<Scene, SynthError> {
    options.check()?;
    let (group, draw) = (i / options.draws as usize, i % options.draws as usize);
    let (family, route) = (group / options.routes.len(), group % options.routes.len());
    let family = options.families[family % options.families.len()];
    let mut scene = family_scene(family, options.routes[route], seed);
    // The first draw keeps the plain name, so that a pool with more draws contains the pool with fewer.
    if draw > 0 {
        scene.id = format!("{}/draw{draw:02}", scene.id);
    }
    Ok(scene)
}

/// The scene `safebench/<family>/<route>` on a generated road. Equal arguments give equal bits.
pub fn family_scene(family: TrafficFamily, route: u32, seed: Seed) -> Scene {
    let mut draw = seed.stream(&["synth", "safebench", family.name(), &route.to_string()]);
    let heading = draw.uniform(-num::PI, num::PI);
    let plan = match family {
        TrafficFamily::StraightObstacle => straight_obstacle(route, heading, &mut draw),
        TrafficFamily::TurningObstacle => turning_obstacle(route, heading, &mut draw),
        TrafficFamily::LaneChanging => lane_changing(heading, &mut draw),
        TrafficFamily::VehiclePassing => vehicle_passing(route, heading, &mut draw),
        TrafficFamily::RedLightRunning => crossed(Straight::RedLight, heading, &mut draw),
        TrafficFamily::UnprotectedLeftTurn => left_turn(heading, &mut draw),
        TrafficFamily::RightTurn => right_turn(heading, &mut draw),
        TrafficFamily::CrossingNegotiation if route == 4 => crossed(Straight::Skew, heading, &mut draw),
        TrafficFamily::CrossingNegotiation => crossed(Straight::NoSignal, heading, &mut draw),
    };
    plan.scene(family, route, seed)
}

/// A site with the places of its events.
struct Plan {
    site: Site,
    length_m: f64,
    trigger_m: f64,
    spawn: Option<Pose>,
    /// State of the lights of each arm, the ego's first; empty without lights.
    lights: Vec<LightState>,
}

/// F1: straight, 80 to 109 m, trigger at 20 to 40 m; route 9 is 83 m long and starts with a bend.
fn straight_obstacle(route: u32, heading: f64, draw: &mut Stream) -> Plan {
    let lanes = 1 + draw.below(2);
    let turn_rad = if draw.chance(0.5) { num::FRAC_PI_2 } else { -num::FRAC_PI_2 };
    let bend = (route == 9).then_some(Bend { turn_rad, straight_before_m: 2.0, length_m: 20.0 });
    let length_m = if bend.is_some() { 83.0 } else { draw.uniform(80.0, 109.0) };
    // The walker's place, up to 50 m ahead, lies on the route.
    let trigger_m = if bend.is_some() { 24.0 } else { draw.uniform(20.0, (length_m - 58.0_f64).min(40.0)) };
    let site = Site::road(heading, lanes, draw.uniform(3.4, 3.6), length_m, bend);
    Plan { site, length_m, trigger_m, spawn: None, lights: vec![] }
}

/// F3: straight, 137 to 167 m, trigger at 16 to 46 m, a second lane on the left.
fn lane_changing(heading: f64, draw: &mut Stream) -> Plan {
    let (length_m, trigger_m) = (draw.uniform(137.0, 167.0), draw.uniform(16.0, 46.0));
    let site = Site::road(heading, 2, draw.uniform(3.4, 3.6), length_m, None);
    Plan { site, length_m, trigger_m, spawn: None, lights: vec![] }
}

/// F4: 130 to 134 m on a road of one lane each way, trigger at about 30 m; five routes start with a right angle.
fn vehicle_passing(route: u32, heading: f64, draw: &mut Stream) -> Plan {
    let turn_rad = match route {
        4 | 7 | 9 => Some(-num::FRAC_PI_2),
        10 | 13 => Some(num::FRAC_PI_2),
        _ => None,
    };
    let bend = turn_rad.map(|turn_rad| Bend { turn_rad, straight_before_m: 6.0, length_m: draw.uniform(18.0, 21.0) });
    let (length_m, trigger_m) = (draw.uniform(130.0, 134.0), draw.uniform(29.0, 31.0));
    let site = Site::road(heading, 1, draw.uniform(3.5, 4.0), length_m, bend);
    Plan { site, length_m, trigger_m, spawn: None, lights: vec![] }
}

/// F2: 61 to 89 m with a turn: routes 4, 8 and 10 to the left, the others to the right, 6 by 70 and 11 by 110 degrees;
/// trigger at 20 to 40 m.
fn turning_obstacle(route: u32, heading: f64, draw: &mut Stream) -> Plan {
    let left = matches!(route, 4 | 8 | 10);
    let degrees = match route {
        6 => 70.0,
        11 => 110.0,
        _ => 90.0,
    };
    let reach_m = draw.uniform(10.0, 12.5);
    let trigger_m = draw.uniform(20.0, 30.0);
    let crossing = Crossing {
        own_lanes: 1,
        cross_lanes: 1,
        lane_width_m: 3.5,
        reach_m,
        start_to_centre_m: trigger_m + draw.uniform(6.0, 12.0) + reach_m,
        exit: if left { 3 } else { 1 },
        right_rad: -degrees * num::PI / 180.0,
        left_rad: num::FRAC_PI_2,
    };
    let site = Site::crossing(heading, &crossing);
    let least_m = site.turn_m().map_or(61.0, |(_, end)| end + 16.0).max(61.0);
    let length_m = draw.uniform(least_m, 89.0_f64.max(least_m));
    Plan { site, length_m, trigger_m, spawn: None, lights: vec![] }
}

/// The three kinds of crossing that the ego goes straight over.
#[derive(Clone, Copy, PartialEq)]
enum Straight {
    RedLight,
    NoSignal,
    /// The crossing road comes in at 72 degrees (family 8, route 4).
    Skew,
}

/// F5 and F8: straight over a crossing, a car from the left. F5: 70 to 102 m, the car 20 to 33 m ahead and 19 to 22 m
/// to the left; F8: 76 to 91 m, 21 to 34 m ahead, 19.5 m to the left (route 4: 27.8 m, at 72 degrees).
fn crossed(kind: Straight, heading: f64, draw: &mut Stream) -> Plan {
    let lanes = 1 + draw.below(2);
    let lane_width_m = 3.5;
    let red = kind == Straight::RedLight;
    let (fwd_m, aside_m) = match kind {
        Straight::RedLight => (draw.uniform(20.0, 33.0), draw.uniform(19.0, 22.0)),
        Straight::NoSignal => (draw.uniform(21.0, 30.0), draw.uniform(19.3, 19.7)),
        Straight::Skew => (draw.uniform(24.0, 28.0), 27.8),
    };
    let lane = draw.below(lanes);
    let reach_m = draw.uniform(10.0, 12.5);
    let trigger_m = draw.uniform(15.0, 20.0);
    let left_rad = if kind == Straight::Skew { num::PI - 72.0 * num::PI / 180.0 } else { num::FRAC_PI_2 };
    // Traffic from the left drives on the near side of the crossing road's middle.
    let trigger_to_centre_m = fwd_m + (lane as f64 + 0.5) * lane_width_m;
    let crossing = Crossing {
        own_lanes: lanes,
        cross_lanes: lanes,
        lane_width_m,
        reach_m,
        start_to_centre_m: trigger_m + trigger_to_centre_m,
        exit: 2,
        right_rad: left_rad - num::PI,
        left_rad,
    };
    let site = Site::crossing(heading, &crossing);
    let (shortest_m, longest_m) = if red { (70.0, 102.0) } else { (76.0, 91.0) };
    let least_m = (crossing.start_to_centre_m + reach_m + 8.0).max(shortest_m);
    let length_m = draw.uniform(least_m, least_m.max(longest_m));
    let spawn = aside_of(&site, trigger_m, site.inbound[3][lane], aside_m);
    let lights = if red { vec![LightState::Go, LightState::Stop, LightState::Go, LightState::Stop] } else { vec![] };
    Plan { site, length_m, trigger_m, spawn, lights }
}

/// F6: 53 to 77 m with a left turn, both directions green; the oncoming car 41 to 52 m ahead in the next lane.
fn left_turn(heading: f64, draw: &mut Stream) -> Plan {
    let (reach_m, trigger_m) = (draw.uniform(10.0, 12.0), draw.uniform(8.0, 16.0));
    let trigger_to_centre_m = draw.uniform(24.0, 28.0);
    let crossing = Crossing {
        own_lanes: 1,
        cross_lanes: 1,
        lane_width_m: draw.uniform(3.2, 4.0),
        reach_m,
        start_to_centre_m: trigger_m + trigger_to_centre_m,
        exit: 3,
        right_rad: -num::FRAC_PI_2,
        left_rad: num::FRAC_PI_2,
    };
    let site = Site::crossing(heading, &crossing);
    let least_m = site.turn_m().map_or(53.0, |(_, end)| end + 6.0).max(53.0);
    let length_m = draw.uniform(least_m, 77.0_f64.max(least_m));
    let fwd_m = draw.uniform((trigger_to_centre_m + reach_m + 2.0).max(41.0), 52.0);
    let spawn = ahead_of(&site, trigger_m, site.inbound[2][0], fwd_m);
    let lights = vec![LightState::Go, LightState::Stop, LightState::Go, LightState::Stop];
    Plan { site, length_m, trigger_m, spawn, lights }
}

/// F7: 60 to 106 m with a right turn on red; the car from the left 28 to 31 m ahead, 19 to 21 m to the left.
fn right_turn(heading: f64, draw: &mut Stream) -> Plan {
    let (reach_m, trigger_m) = (draw.uniform(10.0, 12.5), draw.uniform(20.0, 44.0));
    let (fwd_m, aside_m) = (draw.uniform(28.0, 31.0), draw.uniform(19.0, 21.0));
    let crossing = Crossing {
        own_lanes: 1,
        cross_lanes: 1,
        lane_width_m: 3.5,
        reach_m,
        start_to_centre_m: trigger_m + fwd_m + 1.75,
        exit: 1,
        right_rad: -num::FRAC_PI_2,
        left_rad: num::FRAC_PI_2,
    };
    let site = Site::crossing(heading, &crossing);
    let least_m = site.turn_m().map_or(60.0, |(_, end)| end + 10.0).max(60.0);
    let length_m = draw.uniform(least_m, 106.0_f64.max(least_m));
    let spawn = aside_of(&site, trigger_m, site.inbound[3][0], aside_m);
    let lights = vec![LightState::Stop, LightState::Go, LightState::Stop, LightState::Go];
    Plan { site, length_m, trigger_m, spawn, lights }
}

/// The pose on an inbound lane that lies `aside_m` to the left of the trigger; lanes of a crossing are straight.
fn aside_of(site: &Site, trigger_m: f64, lane: usize, aside_m: f64) -> Option<Pose> {
    on_lane(site, trigger_m, lane, |local| local.y - aside_m)
}

/// The pose on an inbound lane that lies `fwd_m` ahead of the trigger.
fn ahead_of(site: &Site, trigger_m: f64, lane: usize, fwd_m: f64) -> Option<Pose> {
    on_lane(site, trigger_m, lane, |local| local.x - fwd_m)
}

/// Returns the pose where a straight lane meets the zero of a linear function of the trigger's frame.
fn on_lane(site: &Site, trigger_m: f64, lane: usize, value: impl Fn(Vec2) -> f64) -> Option<Pose> {
    let (position, heading_rad) = site.on_way(trigger_m);
    let trigger = Pose { position, heading_rad };
    let curve = &site.net.lanes.get(lane)?.curve;
    let at = |s_m: f64| value(trigger.to_local(curve.at(s_m).position));
    let (a, b) = (at(0.0), at(curve.length_m()));
    let s_m = curve.length_m() * a / (a - b);
    let place = curve.at(s_m);
    s_m.is_finite().then_some(Pose { position: place.position, heading_rad: num::wrap_angle(place.heading_rad) })
}

impl Plan {
    fn scene(self, family: TrafficFamily, route: u32, seed: Seed) -> Scene {
        let (start, start_heading) = self.site.on_way(0.0);
        let (trigger, trigger_heading) = self.site.on_way(self.trigger_m);
        let mut staging = Staging {
            family,
            route,
            trigger: Pose { position: trigger, heading_rad: trigger_heading },
            spawns: vec![],
        };
        let frames: Vec<SpawnFrame> = self.spawn.iter().map(|pose| staging.frame(*pose)).collect();
        staging.spawns = frames;
        let states = |state: LightState| vec![state; STEPS];
        let over = |(arm, state): (&Vec<usize>, &LightState)| {
            arm.iter()
                .map(|&lane| Light { lane, stop_point: self.site.stop_point(lane), states: states(*state) })
                .collect::<Vec<_>>()
        };
        let lights = self.site.inbound.iter().zip(&self.lights).flat_map(over).collect();
        Scene {
            id: format!("safebench/{}/{route:02}", family.name()),
            origin: Origin { format: "synth/safebench".into(), name: format!("{}/{}/{route}", seed.0, family.name()) },
            steps: STEPS,
            current_step: 0,
            road: super::road::road(&self.site.net),
            tracks: vec![],
            ego: ego_at_rest(start, start_heading, self.site.route(self.length_m)),
            objects_of_interest: vec![],
            lights,
            stop_signs: vec![],
            crosswalks: vec![],
            staging: Some(staging),
        }
    }
}

#[cfg(test)]
#[path = "families_tests.rs"]
mod tests;
