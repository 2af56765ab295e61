//! Right of way: which cars may enter a node (lights, stop signs, gap acceptance), and which wait inside it for another car.
//!
//! A node permits drivers to enter one after another. Where two paths are in conflict, the later driver waits before
//! the conflict zone until the earlier one has left it. So no two drivers with permission can collide.

use super::car::{Car, Pass};
use super::node::{Connector, Meeting};
use super::traffic::Traffic;
use crate::scene::{LaneIx, LightState};

/// Distance from the front to the stop line ahead, the lane that it closes, and the start of the connector.
struct Ahead {
    lane: LaneIx,
    stop_m: f64,
    start_m: f64,
    node: usize,
    connector: usize,
}

impl Traffic<'_> {
    /// The next gate that the car has no permission for yet.
    fn gate_ahead(&self, car: &Car) -> Option<Ahead> {
        let mut base = -car.s;
        for pair in car.path.windows(2) {
            let lane = &self.net.lanes[pair[0]];
            let end = base + lane.curve.length_m();
            if let (Some(gate), Some((node, connector))) = (lane.gate, self.net.lanes[pair[1]].connector) {
                let held = car.passes.iter().any(|p| p.node == node && p.connector == connector);
                if !held {
                    let stop_m = base + gate.stop_s - car.half();
                    return Some(Ahead { lane: pair[0], stop_m, start_m: end, node, connector });
                }
            }
            base = end;
        }
        None
    }

    /// Gives and withdraws permissions, the nearest car first.
    pub(super) fn grant_passes(&mut self) {
        self.withdraw_at_red();
        let mut asking: Vec<(f64, usize)> = Vec::new();
        for (i, car) in self.cars.iter().enumerate().filter(|(_, car)| !car.gone) {
            let Some(ahead) = self.gate_ahead(car) else { continue };
            let reach = car.speed * car.speed / 3.0 + 1.2 * car.speed + 6.0;
            if ahead.stop_m < reach {
                asking.push((ahead.stop_m, i));
            }
        }
        asking.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        for (_, i) in asking {
            self.ask(i);
        }
    }

    fn ask(&mut self, i: usize) {
        let Some(ahead) = self.gate_ahead(&self.cars[i]) else { return };
        let node = &self.net.nodes[ahead.node];
        let connector = &node.connectors[ahead.connector];
        if connector.stop_sign {
            if ahead.stop_m < 3.0 && self.cars[i].speed < 0.4 {
                self.cars[i].stood_at = Some(ahead.lane);
            }
            if self.cars[i].stood_at != Some(ahead.lane) {
                return;
            }
        }
        let may = self.light_allows(i, &ahead)
            && self.first_in_lane(i, &ahead)
            && self.exit_is_free(i, &ahead)
            && (connector.rank == 0 && !connector.stop_sign || self.gap_is_enough(i, &ahead));
        if may {
            let car = &mut self.cars[i];
            let start_odo = car.odo + ahead.start_m;
            car.passes.push(Pass { node: ahead.node, connector: ahead.connector, turn: self.turns, start_odo });
            car.stood_at = None;
            self.turns += 1;
        }
    }

    fn light_allows(&self, i: usize, ahead: &Ahead) -> bool {
        let Some(signal) = &self.net.nodes[ahead.node].signal else { return true };
        let group = self.net.nodes[ahead.node].connectors[ahead.connector].group;
        match signal.state(group, self.time_s).0 {
            LightState::Go => true,
            LightState::Caution => ahead.stop_m > 0.0 && too_late_to_stop(&self.cars[i], ahead.stop_m),
            LightState::Stop | LightState::Unknown => false,
        }
    }

    /// A permission ends when the light changes and the car can still stop.
    fn withdraw_at_red(&mut self) {
        for i in 0..self.cars.len() {
            let car = &self.cars[i];
            let Some(&pass) = car.passes.last() else { continue };
            let node = &self.net.nodes[pass.node];
            let Some(signal) = &node.signal else { continue };
            let connector = &node.connectors[pass.connector];
            let origin = &self.net.lanes[connector.origin];
            let Some(gate) = origin.gate else { continue };
            let stop_m = pass.start_odo - (origin.curve.length_m() - gate.stop_s) - car.odo - car.half();
            let changing = signal.state(connector.group, self.time_s).0 != LightState::Go;
            if changing && stop_m > 0.0 && !too_late_to_stop(car, stop_m) {
                self.cars[i].passes.pop();
            }
        }
    }

    /// Returns `true` if no car without permission stands between the car and the line.
    fn first_in_lane(&self, i: usize, ahead: &Ahead) -> bool {
        let car = &self.cars[i];
        let s = if car.lane() == ahead.lane { car.s } else { f64::NEG_INFINITY };
        self.lanes[ahead.lane].iter().all(|&(at, other)| {
            let other_car = &self.cars[other];
            other == i || at <= s || other_car.passes.iter().any(|p| p.node == ahead.node)
        })
    }

    /// Returns `true` if the last car in the lane behind the node leaves room for the car.
    fn exit_is_free(&self, i: usize, ahead: &Ahead) -> bool {
        let connector = self.net.nodes[ahead.node].connectors[ahead.connector].lane;
        let Some(&exit) = self.net.lanes[connector].exits.first() else { return true };
        let Some(&(s, other)) = self.lanes[exit].first() else { return true };
        let last = &self.cars[other];
        let crossing = self.net.lanes[exit].crossings.first().map_or(0.0, |c| c.to_s);
        last.speed > 2.0 || s - last.half() > self.cars[i].driver.length_m + 3.0 + crossing
    }

    fn gap_is_enough(&self, i: usize, ahead: &Ahead) -> bool {
        let car = &self.cars[i];
        let node = &self.net.nodes[ahead.node];
        let own = &node.connectors[ahead.connector];
        let pace = self.net.lanes[own.lane].limit_mps.min(9.0);
        node.connectors.iter().enumerate().all(|(k, other)| {
            let (Some(zone), Some(theirs)) = (node.zones[ahead.connector][k], node.zones[k][ahead.connector]) else {
                return true;
            };
            if zone.meeting == Meeting::Part {
                return true;
            }
            let start = ahead.start_m - car.half();
            let arrive = car.driver.travel_s(start + zone.from_s, car.speed, pace);
            let leave = car.driver.travel_s(start + zone.to_s + car.driver.length_m, car.speed, pace);
            let inside = self.inside(ahead.node, k, |c, s| {
                let left = theirs.to_s + c.half() - s;
                left <= 0.0 || arrive > left / c.speed.max(1.5) + 0.2
            });
            inside
                && (other.rank >= own.rank
                    || self.none_arrives(ahead.node, other, theirs.from_s, leave + car.driver.margin_s))
        })
    }

    /// Returns `true` if all cars with permission for connector `k` satisfy `fine(car, place along the connector)`.
    fn inside(&self, node: usize, k: usize, fine: impl Fn(&Car, f64) -> bool) -> bool {
        let lane = self.net.nodes[node].connectors[k].lane;
        let origin = self.net.nodes[node].connectors[k].origin;
        let exit = self.net.lanes[lane].exits.first().copied();
        [Some(origin), Some(lane), exit].into_iter().flatten().all(|l| {
            self.lanes[l].iter().all(|&(_, i)| {
                let car = &self.cars[i];
                car.passes.iter().all(|p| p.node != node || p.connector != k || fine(car, car.odo - p.start_odo))
            })
        })
    }

    /// Returns `true` if no car that goes first and may go gets to `from_s` of its connector before `time_s`.
    fn none_arrives(&self, node: usize, other: &Connector, from_s: f64, time_s: f64) -> bool {
        if let Some(signal) = &self.net.nodes[node].signal
            && signal.state(other.group, self.time_s).0 == LightState::Stop
        {
            return true;
        }
        let length = self.net.lanes[other.origin].curve.length_m();
        self.lanes[other.origin].iter().all(|&(s, i)| {
            let car = &self.cars[i];
            let coming = car.lane() == other.origin && car.path.get(1) == Some(&other.lane);
            let distance = length - s - car.half() + from_s;
            !coming || car.passes.iter().any(|p| p.node == node) || distance / car.speed.max(3.0) > time_s
        })
    }

    /// Returns the metres to where the car must stop for a gate or for a car that goes first inside a node.
    pub(super) fn node_halt_m(&self, i: usize) -> Option<f64> {
        let car = &self.cars[i];
        let mut nearest: Option<f64> = None;
        let mut stop = |distance: f64| nearest = Some(nearest.map_or(distance, |n: f64| n.min(distance)));
        if let Some(ahead) = self.gate_ahead(car) {
            let reach = car.speed * car.speed / 3.0 + 1.2 * car.speed + 6.0;
            if ahead.stop_m < reach {
                stop(ahead.stop_m);
            }
        }
        self.conflicts(i, |zone, start_m, other, other_s, their_to| {
            let front = zone.from_s - start_m;
            let left = their_to + other.half() - other_s;
            // A car does not brake for a driver who will be gone by then, as long as it could still brake later.
            let early = front > car.speed * car.speed / 5.0 + 2.0
                && other.speed > 2.0
                && front / car.speed.max(1.0) > left / other.speed + 0.5;
            if zone.meeting != Meeting::Part && left > 0.0 && !early {
                stop(front - 0.7);
            }
        });
        nearest
    }

    /// Acceleration behind a car that left the same lane for another exit.
    pub(super) fn node_follow(&self, i: usize) -> Option<f64> {
        let car = &self.cars[i];
        let mut least: Option<f64> = None;
        self.conflicts(i, |zone, start_m, other, other_s, their_to| {
            let rear = other_s - other.half();
            if zone.meeting == Meeting::Part && rear < their_to {
                let wanted = car.driver.follow(car.speed, rear - start_m, other.speed);
                least = Some(least.map_or(wanted, |l: f64| l.min(wanted)));
            }
        });
        least
    }

    /// Calls `see(zone, own front along the connector, other, other's place on its own, end of its stretch)` for
    /// everyone who goes before the car in a node ahead.
    fn conflicts(&self, i: usize, mut see: impl FnMut(&super::node::Zone, f64, &Car, f64, f64)) {
        let car = &self.cars[i];
        for pass in &car.passes {
            let node = &self.net.nodes[pass.node];
            let front = car.odo + car.half() - pass.start_odo;
            for other in self.cars.iter().filter(|c| !c.gone) {
                for theirs in other.passes.iter().filter(|p| p.node == pass.node && p.turn < pass.turn) {
                    let (Some(zone), Some(back)) =
                        (&node.zones[pass.connector][theirs.connector], node.zones[theirs.connector][pass.connector])
                    else {
                        continue;
                    };
                    // Its rear has left the stretch, so nobody waits for it.
                    if front - car.driver.length_m < zone.to_s {
                        see(zone, front, other, other.odo - theirs.start_odo, back.to_s);
                    }
                }
            }
        }
    }
}

fn too_late_to_stop(car: &Car, stop_m: f64) -> bool {
    car.speed * car.speed > 2.0 * 3.0 * (stop_m - 0.3).max(0.05)
}
