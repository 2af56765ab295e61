//! The simulation of a generated world: the state of all road users, and one step of 0.1 s.

use super::car::{Car, SIGHT_M};
use super::driver::{Body, Driver};
use super::network::{LaneEnd, Network};
use super::options::{SynthOptions, WorldKind};
use super::variation::{Pedals, Variation, Weave};
use super::walkers::Walkers;
use crate::kernel::{Seed, Stream, num};
use crate::scene::{DT_S, LaneIx};

/// Above this density, vehicles per metre, a lane counts as jammed and no new vehicle enters it.
const QUEUE_PER_M: f64 = 1.0 / 14.0;

pub(super) struct Traffic<'a> {
    pub net: &'a Network,
    pub kind: WorldKind,
    pub cars: Vec<Car>,
    pub walkers: Walkers,
    pub time_s: f64,
    /// Cars in each lane by `s`, rear first: `(s, index in cars)`.
    pub lanes: Vec<Vec<(f64, usize)>>,
    pub turns: u64,
    target: usize,
    variation: Option<Variation<f64>>,
    cyclist_share: f64,
    seed: Seed,
    path: [String; 4],
    born: usize,
    sources: Vec<LaneIx>,
    arrivals: Stream,
}

impl<'a> Traffic<'a> {
    /// An initial population spread over the lanes; `path` names the random streams.
    pub fn new(
        net: &'a Network,
        kind: WorldKind,
        options: &SynthOptions,
        variation: Option<Variation<f64>>,
        seed: Seed,
        path: &[String; 4],
    ) -> Traffic<'a> {
        let on_foot = if net.crosswalks.is_empty() { 0.0 } else { options.pedestrian_share };
        let users = variation.map_or(options.tracks_per_scene as f64, |of| of.users);
        let walkers = (users * on_foot).round() as usize;
        // Some vehicles leave during the recording and as many arrive; they count too.
        let target = ((users - walkers as f64) * 0.88).round().max(2.0) as usize;
        let named = |purpose: &str| stream(seed, path, purpose);
        let mut traffic = Traffic {
            net,
            kind,
            cars: Vec::new(),
            walkers: Walkers::new(net, walkers, &mut named("walkers")),
            time_s: 0.0,
            lanes: vec![Vec::new(); net.lanes.len()],
            turns: 0,
            target,
            variation,
            cyclist_share: if kind.motorway() { 0.0 } else { options.cyclist_share },
            seed,
            arrivals: named("arrivals"),
            path: path.clone(),
            born: 0,
            sources: net.sources(),
        };
        let mut places = named("places");
        traffic.populate(&mut places);
        traffic.index();
        traffic
    }

    fn new_driver(&mut self, lane: LaneIx) -> Car {
        let number = self.born;
        self.born += 1;
        let mut draw = stream(self.seed, &self.path, &format!("driver {number}"));
        let rightmost = !matches!(self.net.lanes[lane].right, Some((_, true)));
        let kinds = draw.unit();
        let body = if kinds < self.cyclist_share && rightmost {
            Body::Bicycle
        } else if draw.chance(0.12) {
            Body::Van
        } else if self.kind.motorway() && draw.chance(0.13) {
            Body::Lorry
        } else {
            Body::Car
        };
        let mut driver = Driver::draw(body, &mut draw);
        let (mut pedals, mut weave) = (None, None);
        if let Some(variation) = self.variation {
            let mut own = stream(self.seed, &self.path, &format!("driver {number}, own ways"));
            // A car that keeps to a lane stays within it, so that two abreast pass each other.
            let of = &self.net.lanes[lane];
            let spare_m = (0.5 * (of.width_m - driver.width_m) - 0.1).max(0.0);
            driver.differ(&variation, 0.5 * spare_m, &mut own);
            let left_m = (spare_m - driver.bias_m.abs()).max(0.0);
            weave = Some(Weave::draw(variation.weave_m, left_m, of.limit_mps, &mut own));
            pedals = Some(Pedals::new(variation.pedals_mps2, own));
        }
        Car {
            number,
            driver,
            path: vec![lane],
            s: 0.0,
            speed: 0.0,
            acceleration: 0.0,
            odo: 0.0,
            shift: None,
            pedals,
            weave,
            passes: Vec::new(),
            stood_at: None,
            change_after: draw.uniform(0.0, 4.0),
            choice: draw,
            gone: false,
        }
    }

    /// Returns the factor of the metres between road users.
    fn room(&self) -> f64 {
        self.variation.map_or(1.0, |of| of.room)
    }

    fn populate(&mut self, draw: &mut Stream) {
        let lanes: Vec<LaneIx> = (0..self.net.lanes.len())
            .filter(|&l| self.net.lanes[l].connector.is_none() && self.net.lanes[l].curve.length_m() > 40.0)
            .collect();
        let total = num::sum(lanes.iter().map(|&l| self.net.lanes[l].curve.length_m()));
        let mut taken: Vec<(LaneIx, f64)> = Vec::new();
        for _ in 0..self.target * 12 {
            if self.cars.len() >= self.target {
                break;
            }
            let mut at = draw.uniform(0.0, total);
            let Some(&lane) = lanes.iter().find(|&&l| {
                at -= self.net.lanes[l].curve.length_m();
                at < 0.0
            }) else {
                continue;
            };
            let length = self.net.lanes[lane].curve.length_m();
            let s = length + at;
            let limit = self.net.lanes[lane].limit_mps;
            let room = (16.0 + 0.5 * limit) * self.room();
            let free = taken.iter().all(|&(l, other)| l != lane || (other - s).abs() > room);
            if !free || s < 8.0 || s > length - 25.0 {
                continue;
            }
            taken.push((lane, s));
            let mut car = self.new_driver(lane);
            car.s = s;
            car.speed =
                (0.6 * limit).min((2.0 * 1.2 * (length - 20.0 - s).max(1.0)).sqrt()).min(car.driver.speed_mps_max);
            car.extend(self.net);
            self.cars.push(car);
        }
    }

    pub fn index(&mut self) {
        for lane in &mut self.lanes {
            lane.clear();
        }
        for (i, car) in self.cars.iter().enumerate() {
            if car.gone {
                continue;
            }
            self.lanes[car.lane()].push((car.s, i));
            if let Some(old) = car.also_in() {
                let s = self.net.lanes[old].curve.abreast(car.s, &self.net.lanes[car.lane()].curve);
                self.lanes[old].push((s, i));
            }
        }
        for lane in &mut self.lanes {
            lane.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        }
    }

    /// Enters a car into a lane's list at once, so that later decisions of the same step see it.
    pub fn register(&mut self, lane: LaneIx, s: f64, car: usize) {
        let at = self.lanes[lane].partition_point(|entry| entry.0 <= s);
        self.lanes[lane].insert(at, (s, car));
    }

    /// Bumper-to-bumper gap and speed of the next one on a path that starts at `s` of its first lane.
    pub fn leader(&self, me: usize, path: &[LaneIx], s: f64, half: f64) -> Option<(f64, f64)> {
        let mut base = 0.0;
        for (k, &lane) in path.iter().enumerate() {
            let list = &self.lanes[lane];
            let from = if k == 0 { list.partition_point(|entry| entry.0 <= s) } else { 0 };
            if let Some(&(at, other)) = list[from..].iter().find(|entry| entry.1 != me) {
                let gap = base + at - s - half - self.cars[other].half();
                return Some((gap, self.cars[other].speed));
            }
            base += self.net.lanes[lane].curve.length_m();
            if base - s > SIGHT_M {
                break;
            }
        }
        None
    }

    /// One step of 0.1 s.
    pub fn step(&mut self) {
        self.arrive();
        self.walkers.step(self.net, &self.cars, self.time_s);
        self.grant_passes();
        self.change_lanes();
        let wanted: Vec<f64> = (0..self.cars.len()).map(|i| self.acceleration(i)).collect();
        for (i, wanted) in wanted.into_iter().enumerate() {
            self.advance(i, wanted);
        }
        self.time_s += DT_S;
        self.index();
    }

    fn acceleration(&self, i: usize) -> f64 {
        let car = &self.cars[i];
        let driver = &car.driver;
        let mut least = driver.free(car.speed, self.wanted_speed(car));
        if let Some((gap, ahead)) = self.leader(i, &car.path, car.s, car.half()) {
            least = least.min(driver.follow(car.speed, gap, ahead));
        }
        if let Some(old) = car.also_in() {
            let s = self.net.lanes[old].curve.abreast(car.s, &self.net.lanes[car.lane()].curve);
            if let Some((gap, ahead)) = self.leader(i, &[old], s, car.half()) {
                least = least.min(driver.follow(car.speed, gap, ahead));
            }
        }
        if self.net.lanes[car.lane()].end == LaneEnd::Closed {
            // Where the road narrows there must be room left to change lanes at walking pace.
            let room = self.net.lanes[car.lane()].curve.length_m() - 22.0 - car.s - car.half();
            least = least.min(driver.halt(car.speed, room));
        }
        if let Some(distance) = self.node_halt_m(i) {
            least = least.min(driver.halt(car.speed, distance));
        }
        if let Some(follow) = self.node_follow(i) {
            least = least.min(follow);
        }
        if let Some(distance) = self.walkers.halt_m(self.net, car) {
            least = least.min(driver.halt(car.speed, distance));
        }
        least.min(self.courtesy(i))
    }

    /// Speed limit, own taste, and bends ahead.
    pub fn wanted_speed(&self, car: &Car) -> f64 {
        let driver = &car.driver;
        let mut wanted = (self.net.lanes[car.lane()].limit_mps * driver.haste).min(driver.speed_mps_max);
        let horizon = 15.0 + car.speed * car.speed / (2.0 * 1.2);
        let mut base = -car.s;
        for &lane in &car.path {
            if base > horizon {
                break;
            }
            let lane = &self.net.lanes[lane];
            let slow = |speed: f64, distance: f64| (speed * speed + 2.0 * 1.1 * distance.max(0.0)).sqrt();
            wanted = wanted.min(slow(lane.limit_mps * driver.haste, base));
            for &(from, to, curvature) in &lane.bends {
                if base + to >= -0.5 * driver.length_m {
                    let speed = (driver.sideways_mps2 / curvature).sqrt();
                    wanted = wanted.min(slow(speed, base + from - car.half()));
                }
            }
            base += lane.curve.length_m();
        }
        wanted
    }

    fn advance(&mut self, i: usize, wanted: f64) {
        let car = &mut self.cars[i];
        // Pedals move at a limited rate, faster in an emergency.
        let down = if wanted < -2.0 { 1.3 } else { 0.6 };
        // A driver who brakes hard or stands does not keep an even speed.
        let added = car.pedals.as_mut().map_or(0.0, Pedals::step);
        let steady = car.pedals.is_none() || wanted < -2.0 || car.speed < 0.5;
        let wanted = if steady { wanted } else { (wanted + added).clamp(-5.0, 3.3) };
        let mut a = wanted.clamp(car.acceleration - down, car.acceleration + 0.4);
        if car.speed + a * DT_S < 0.0 {
            a = -car.speed / DT_S;
        }
        let next = (car.speed + a * DT_S).max(0.0);
        let moved = 0.5 * (car.speed + next) * DT_S;
        (car.acceleration, car.speed) = (a, next);
        car.s += moved;
        car.odo += moved;
        if car.shift.is_some_and(|shift| shift.at(car.odo).2 >= 1.0) {
            car.shift = None;
        }
        let length = self.net.lanes[car.path[0]].curve.length_m();
        if car.s > length {
            if car.path.len() < 2 {
                car.gone = true;
                return;
            }
            car.s -= length;
            car.path.remove(0);
        }
        car.extend(self.net);
        car.release(self.net);
    }

    /// Keeps the number of cars up through the lanes that lead into the world.
    fn arrive(&mut self) {
        let present = self.cars.iter().filter(|car| !car.gone).count();
        if present >= self.target || self.sources.is_empty() {
            return;
        }
        let fill = |lane: LaneIx| self.lanes[lane].len() as f64 / self.net.lanes[lane].curve.length_m();
        let (a, b) = (self.arrivals.below(self.sources.len()), self.arrivals.below(self.sources.len()));
        // Drivers avoid known queues, so the emptier of two roads is taken.
        let (a, b) = (self.sources[a], self.sources[b]);
        let lane = if fill(b) < fill(a) { b } else { a };
        if fill(lane) > QUEUE_PER_M {
            return;
        }
        let limit = self.net.lanes[lane].limit_mps;
        let first = self.lanes[lane].first().map(|&(s, other)| (s - self.cars[other].half(), self.cars[other].speed));
        if first.is_some_and(|(rear, speed)| {
            rear < (22.0 + 0.5 * limit) * self.room().min(1.0) + 0.8 * (limit - speed).max(0.0)
        }) {
            return;
        }
        let mut car = self.new_driver(lane);
        car.s = car.half();
        car.speed = (0.85 * limit).min(first.map_or(limit, |f| f.1 + 2.0)).min(0.9 * car.driver.speed_mps_max);
        car.extend(self.net);
        car.speed = car.speed.min(self.wanted_speed(&car));
        let s = car.s;
        self.cars.push(car);
        self.register(lane, s, self.cars.len() - 1);
    }
}

/// The stream of one purpose within one attempt at one scene.
pub(super) fn stream(seed: Seed, path: &[String; 4], purpose: &str) -> Stream {
    seed.stream(&[&path[0], &path[1], &path[2], &path[3], purpose])
}
