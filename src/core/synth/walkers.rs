//! People on foot: they walk up to a crosswalk, wait for a safe moment or a red light, and cross; drivers stop for
//! people on the crosswalk who have not passed their lane yet.

use super::car::Car;
use super::network::{Crossing, Crosswalk, Network};
use crate::kernel::{Stream, Vec2};
use crate::scene::{DT_S, LaneIx, LightState, Sample};

/// Metres walked before and after the road itself.
const SIDEWALK_M: f64 = 7.0;
/// Distance before the curb at which people wait, metres.
const WAIT_M: f64 = 1.2;

#[derive(Clone, Debug)]
pub(super) struct Walker {
    pub number: usize,
    pub size_m: f64,
    crosswalk: usize,
    /// True if the walker goes from the crosswalk's end to its start.
    backwards: bool,
    /// Offset from the crosswalk's middle line.
    offset_m: f64,
    wait_m: f64,
    pace_mps: f64,
    /// Progress along the way, sidewalks included.
    at_m: f64,
    speed: f64,
    crossing: bool,
    pub gone: bool,
}

impl Walker {
    fn way_m(&self, crosswalk: &Crosswalk) -> f64 {
        crosswalk.start.distance(crosswalk.end) + 2.0 * SIDEWALK_M
    }

    pub fn sample(&self, net: &Network) -> Sample {
        let crosswalk = &net.crosswalks[self.crosswalk];
        let (from, to) =
            if self.backwards { (crosswalk.end, crosswalk.start) } else { (crosswalk.start, crosswalk.end) };
        let direction = (to - from) * (1.0 / from.distance(to));
        let position = from + direction * (self.at_m - SIDEWALK_M) + direction.left() * self.offset_m;
        Sample { position, heading_rad: direction.heading(), velocity: direction * self.speed }
    }

    /// Returns `true` if somebody on the road has not passed a lane yet.
    fn closes(&self, crosswalk: &Crosswalk, crossing: &Crossing) -> bool {
        let across = crosswalk.start.distance(crosswalk.end);
        let on_road = self.at_m - SIDEWALK_M;
        let far = if self.backwards { across - crossing.from_c } else { crossing.to_c };
        self.crossing && on_road < far + 0.7
    }
}

#[derive(Clone, Debug)]
pub(super) struct Walkers {
    pub list: Vec<Walker>,
    wanted: usize,
    born: usize,
    draw: Stream,
}

impl Walkers {
    /// Places `wanted` people somewhere on their way.
    pub fn new(net: &Network, wanted: usize, draw: &mut Stream) -> Walkers {
        let mut walkers = Walkers { list: Vec::new(), wanted, born: 0, draw: draw.clone() };
        for _ in 0..wanted {
            walkers.add(net);
            if let Some(last) = walkers.list.last_mut() {
                last.at_m = walkers.draw.uniform(0.0, last.wait_m);
            }
        }
        walkers
    }

    fn add(&mut self, net: &Network) {
        if net.crosswalks.is_empty() {
            return;
        }
        let draw = &mut self.draw;
        let pace_mps = draw.normal(1.35, 0.2).clamp(0.8, 2.0);
        self.list.push(Walker {
            number: self.born,
            size_m: draw.uniform(0.5, 0.75),
            crosswalk: draw.below(net.crosswalks.len()),
            backwards: draw.chance(0.5),
            offset_m: draw.uniform(-1.0, 1.0),
            wait_m: SIDEWALK_M - WAIT_M - draw.uniform(0.0, 1.5),
            pace_mps,
            at_m: 0.0,
            speed: pace_mps,
            crossing: false,
            gone: false,
        });
        self.born += 1;
    }

    pub fn step(&mut self, net: &Network, cars: &[Car], time_s: f64) {
        let present = self.list.iter().filter(|w| !w.gone).count();
        if present < self.wanted && self.draw.chance(0.05) {
            self.add(net);
        }
        for i in 0..self.list.len() {
            if self.list[i].gone {
                continue;
            }
            if !self.list[i].crossing && self.list[i].at_m + 1.0 >= self.list[i].wait_m {
                self.list[i].crossing = may_cross(net, cars, &self.list[i], time_s);
            }
            let walker = &mut self.list[i];
            let wanted = if walker.crossing || walker.at_m + 0.5 < walker.wait_m { walker.pace_mps } else { 0.0 };
            let change = (wanted - walker.speed).clamp(-2.0 * DT_S, 1.2 * DT_S);
            let next = walker.speed + change;
            walker.at_m += 0.5 * (walker.speed + next) * DT_S;
            walker.speed = next;
            if walker.at_m >= walker.way_m(&net.crosswalks[walker.crosswalk]) {
                walker.gone = true;
            }
        }
    }

    /// Metres from a car's front to where it must stop for people on a crosswalk ahead.
    pub fn halt_m(&self, net: &Network, car: &Car) -> Option<f64> {
        let mut base = -car.s;
        for &lane in &car.path {
            if base > 60.0 {
                break;
            }
            for crossing in &net.lanes[lane].crossings {
                let distance = base + crossing.from_s - car.half() - 0.8;
                let closed = |w: &Walker| {
                    !w.gone && w.crosswalk == crossing.crosswalk && w.closes(&net.crosswalks[w.crosswalk], crossing)
                };
                if distance > -1.0 && self.list.iter().any(closed) {
                    return Some(distance);
                }
            }
            base += net.lanes[lane].curve.length_m();
        }
        None
    }
}

/// Returns `true` if the road has a red light for long enough, and no car is on the crosswalk or unable to stop before it.
fn may_cross(net: &Network, cars: &[Car], walker: &Walker, time_s: f64) -> bool {
    let crosswalk = &net.crosswalks[walker.crosswalk];
    let seconds = (crosswalk.start.distance(crosswalk.end) + 2.0 * WAIT_M) / walker.pace_mps;
    let signals_allow = crosswalk.lanes.iter().filter_map(|&lane| net.signal_of(lane)).all(|(signal, group)| {
        let (state, left) = signal.state(group, time_s);
        state == LightState::Stop && left > 0.7 * seconds
    });
    signals_allow && cars.iter().filter(|car| !car.gone).all(|car| lets_pass(net, car, walker.crosswalk))
}

fn lets_pass(net: &Network, car: &Car, crosswalk: usize) -> bool {
    let mut base = -car.s;
    let near = |lane: LaneIx, base: f64| {
        net.lanes[lane].crossings.iter().filter(move |c| c.crosswalk == crosswalk).all(move |crossing| {
            let distance = base + crossing.from_s - car.half() - 0.8;
            let cleared = base + crossing.to_s + car.half() + 0.5 < 0.0;
            let stopping = car.speed * car.speed / (2.0 * 1.8) + 0.7 * car.speed + 1.0;
            cleared || distance > stopping || (distance >= -0.4 && car.speed < 0.3)
        })
    };
    for &lane in &car.path {
        if base > 60.0 {
            break;
        }
        if !near(lane, base) {
            return false;
        }
        base += net.lanes[lane].curve.length_m();
    }
    true
}

/// The box that stands for a person on foot is about as long as wide.
pub(super) fn walker_box_m(walker: &Walker) -> (f64, f64) {
    (0.8 * walker.size_m, walker.size_m)
}

/// Returns the outlines of the crosswalks; empty where nobody walks.
pub(super) fn polygons(net: &Network) -> Vec<Vec<Vec2>> {
    net.crosswalks.iter().map(Crosswalk::polygon).collect()
}
