//! Lane changes by MOBIL (Kesting, Treiber and Helbing 2007): they must be safe for the follower and useful for the
//! driver.

use super::car::Shift;
use super::network::LaneEnd;
use super::traffic::Traffic;
use crate::scene::LaneIx;

/// Braking that a change may force on oneself or on the new follower, m/s².
const SAFE_MPS2: f64 = 2.0;
const SAFE_WHEN_FORCED_MPS2: f64 = 2.8;
/// Least advantage for which a driver changes lanes, m/s².
const THRESHOLD_MPS2: f64 = 0.25;

impl Traffic<'_> {
    pub(super) fn change_lanes(&mut self) {
        for i in 0..self.cars.len() {
            let car = &self.cars[i];
            if car.gone || car.shift.is_some() || !car.passes.is_empty() || self.time_s < car.change_after {
                continue;
            }
            let lane = &self.net.lanes[car.lane()];
            let forced = lane.end == LaneEnd::Closed;
            let sides = [lane.left, lane.right];
            let best = sides
                .into_iter()
                .flatten()
                .filter(|&(_, same)| same)
                .filter_map(|(target, _)| Some((self.gain(i, target, forced)?, target)))
                .reduce(|a, b| if b.0 > a.0 { b } else { a });
            match best {
                Some((gain, target)) if forced || gain > THRESHOLD_MPS2 => self.begin_change(i, target),
                _ => self.cars[i].change_after = self.time_s + if forced { 0.2 } else { 0.6 },
            }
        }
    }

    /// Distance over which a change is made at a speed.
    fn change_length_m(speed: f64, forced: bool) -> f64 {
        let seconds = if forced { 3.2 } else { 4.0 };
        (speed * seconds).max(20.0)
    }

    /// MOBIL's advantage of a change; `None` where it is not possible or not safe.
    fn gain(&self, i: usize, target: LaneIx, forced: bool) -> Option<f64> {
        let car = &self.cars[i];
        let (own, new) = (&self.net.lanes[car.lane()], &self.net.lanes[target]);
        let room = own.curve.length_m() - car.s;
        let needed = Self::change_length_m(car.speed, forced).min(if forced { room - 1.0 } else { f64::INFINITY });
        if needed < 18.0 || new.end == LaneEnd::Closed || room < needed + if own.gate.is_some() { 45.0 } else { 0.0 } {
            return None;
        }
        if !forced && (car.speed < 4.0 || own.curve.at(car.s + 0.5 * needed).curvature.abs() > 0.006) {
            return None;
        }
        if car.driver.body == super::driver::Body::Bicycle {
            return None;
        }
        let safe = if forced { SAFE_WHEN_FORCED_MPS2 } else { SAFE_MPS2 };
        let s = new.curve.abreast(car.s, &own.curve);
        let mut path = vec![target];
        path.extend(new.exits.first());
        let wanted = self.wanted_speed(car);
        let free = car.driver.free(car.speed, wanted);
        let ahead = |path: &[LaneIx], s: f64| match self.leader(i, path, s, car.half()) {
            Some((gap, _)) if gap < car.driver.gap_m => None,
            Some((gap, speed)) => Some(free.min(car.driver.follow(car.speed, gap, speed))),
            None => Some(free),
        };
        let after = ahead(&path, s)?;
        if after < -safe {
            return None;
        }
        let follower = self.follower(i, target, s);
        let loss = match follower {
            None => 0.0,
            Some((behind, gap)) => {
                let other = &self.cars[behind];
                let braking = other.driver.follow(other.speed, gap, car.speed);
                let closing = (other.speed - car.speed).max(0.0);
                if gap < 1.5 + 0.35 * other.speed.min(car.speed) + 0.9 * closing || braking < -safe {
                    return None;
                }
                (other.acceleration - braking).max(0.0)
            }
        };
        let before = ahead(&car.path, car.s).unwrap_or(-SAFE_MPS2);
        Some(after - before - car.driver.politeness * loss)
    }

    /// Returns the next car behind a place in a lane or in those that lead into it, and the gap to the car's rear.
    fn follower(&self, i: usize, lane: LaneIx, s: f64) -> Option<(usize, f64)> {
        let half = self.cars[i].half();
        let list = &self.lanes[lane];
        let at = list.partition_point(|entry| entry.0 <= s);
        if let Some(&(place, other)) = list[..at].iter().rev().find(|entry| entry.1 != i) {
            return Some((other, s - place - half - self.cars[other].half()));
        }
        let behind = |&entry: &LaneIx| {
            let length = self.net.lanes[entry].curve.length_m();
            let &(place, other) = self.lanes[entry].iter().rev().find(|e| e.1 != i)?;
            Some((other, s + length - place - half - self.cars[other].half()))
        };
        self.net.lanes[lane].entries.iter().filter_map(behind).reduce(|a, b| if b.1 < a.1 { b } else { a })
    }

    fn begin_change(&mut self, i: usize, target: LaneIx) {
        let old = self.cars[i].lane();
        let (from, to) = (&self.net.lanes[old], &self.net.lanes[target]);
        let mut car = self.cars[i].clone();
        let forced = from.end == LaneEnd::Closed;
        let room = from.curve.length_m() - car.s;
        let here = from.curve.at(car.s);
        let s = to.curve.abreast(car.s, &from.curve);
        let side = if from.left == Some((target, true)) { -1.0 } else { 1.0 };
        let offset = side * here.position.distance(to.curve.at(s).position);
        // The same true speed, measured along the new centre line.
        let there = to.curve.at(s);
        let bias = car.aside().0;
        car.speed *= (1.0 - here.curvature * bias) / (1.0 - there.curvature * (offset + bias));
        let length_m = Self::change_length_m(car.speed, forced).min(room - 0.5).max(10.0);
        car.shift = Some(Shift { from_lane: old, offset_m: offset, start_odo: car.odo, length_m });
        car.change_after = self.time_s + 4.0 + 3.0 * car.choice.unit();
        car.s = s;
        car.reroute(self.net, target);
        self.cars[i] = car;
        self.register(target, s, i);
    }

    /// Drivers beside a lane that ends slow down for a driver who must leave that lane.
    pub(super) fn courtesy(&self, i: usize) -> f64 {
        let car = &self.cars[i];
        let lane = &self.net.lanes[car.lane()];
        let closing = [lane.left, lane.right]
            .into_iter()
            .flatten()
            .find(|&(n, same)| same && self.net.lanes[n].end == LaneEnd::Closed);
        let Some((beside, _)) = closing else { return f64::INFINITY };
        let s = self.net.lanes[beside].curve.abreast(car.s, &lane.curve);
        match self.leader(i, &[beside], s + car.half(), 0.0) {
            Some((gap, speed)) if gap < 40.0 => {
                car.driver.follow(car.speed, gap + 0.5 * car.driver.gap_m, speed).max(-1.2)
            }
            _ => f64::INFINITY,
        }
    }
}
