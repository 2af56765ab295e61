//! One function for each kind of world: it draws the dimensions and builds the road.

use super::curve::{Curve, Place};
use super::junction::{Arm, Control, lay_junction};
use super::network::{Gate, LaneEnd, Network, Profile, RoadLanes};
use super::node::{Connector, Signal};
use super::options::{SynthOptions, WorldKind};
use super::variation::Variation;
use crate::kernel::{Stream, Vec2, num};
use crate::scene::LaneKind;

/// Lane metres per road user on a street.
const STREET_M: f64 = 24.0;
/// Lane metres per road user where a junction limits the flow.
const JUNCTION_M: f64 = 44.0;
const MOTORWAY_M: f64 = 38.0;

/// The road of one generated world, long enough for its road users, turned by a random angle.
pub(super) fn lay_world(
    kind: WorldKind,
    options: &SynthOptions,
    variation: Option<Variation<f64>>,
    draw: &mut Stream,
) -> Network {
    let heading = draw.uniform(-num::PI, num::PI);
    let site = Site {
        heading,
        users: variation.map_or(options.tracks_per_scene as f64, |of| of.users),
        room: variation.map_or(1.0, |of| of.room),
        more: variation.map_or(0, |of| of.lanes as usize),
    };
    let mut net = Network::default();
    match kind {
        WorldKind::Straight => site.straight(&mut net, draw),
        WorldKind::Curve => site.curve(&mut net, draw),
        WorldKind::SignalledCrossing => site.crossing(&mut net, draw, 4, true),
        WorldKind::UnsignalledCrossing => site.crossing(&mut net, draw, 4, false),
        WorldKind::SignalledTee => site.crossing(&mut net, draw, 3, true),
        WorldKind::UnsignalledTee => site.crossing(&mut net, draw, 3, false),
        WorldKind::Merge => site.merge(&mut net, draw),
        WorldKind::Roundabout => site.roundabout(&mut net, draw),
        WorldKind::LaneDrop => site.lane_drop(&mut net, draw),
        WorldKind::Urban => site.urban(&mut net, draw),
        WorldKind::Highway => site.highway(&mut net, draw),
    }
    let limit = variation.map_or(1.0, |of| of.limit);
    net.lanes.iter_mut().for_each(|lane| lane.limit_mps *= limit);
    net
}

struct Site {
    heading: f64,
    users: f64,
    /// Factor of a road user's lane metres.
    room: f64,
    /// Further lanes per direction; half as many where roads meet.
    more: usize,
}

fn signal(draw: &mut Stream) -> Signal {
    Signal {
        offset_s: draw.uniform(0.0, 60.0),
        green_s: [draw.uniform(9.0, 16.0), draw.uniform(7.0, 12.0)],
        amber_s: 3.5,
        clearance_s: 2.0,
    }
}

fn street(lanes: usize, limit_mps: f64) -> Profile {
    Profile {
        forward: lanes,
        backward: lanes,
        lane_width_m: 3.5,
        median_m: 0.0,
        limit_mps,
        kind: LaneKind::Street,
        edges: true,
    }
}

fn motorway(lanes: usize, limit_mps: f64) -> Profile {
    Profile {
        forward: lanes,
        backward: 0,
        lane_width_m: 3.7,
        median_m: 0.0,
        limit_mps,
        kind: LaneKind::Freeway,
        edges: true,
    }
}

fn line(start: Vec2, heading: f64, length_m: f64) -> Curve {
    Curve::bend(start, heading, &[(length_m, 0.0, 0.0)])
}

/// A bend to a curvature and back, with clothoids at both ends.
fn swing(length_m: f64, curvature: f64) -> [(f64, f64, f64); 3] {
    let ramp = 0.3 * length_m;
    [(ramp, 0.0, curvature), (length_m - 2.0 * ramp, curvature, curvature), (ramp, curvature, 0.0)]
}

impl Site {
    /// Length at which all road users have room on `lanes` lanes.
    fn length_m(&self, lanes: usize, room_m: f64, least_m: f64) -> f64 {
        (self.users * room_m * self.room / lanes as f64).max(least_m)
    }

    /// Returns `true` for road users too few to meet each other on a wide road.
    fn few(&self) -> bool {
        self.users < 20.0
    }

    fn straight(&self, net: &mut Network, draw: &mut Stream) {
        let (mut forward, mut backward) = (2 + draw.below(3) + self.more, 1 + draw.below(2));
        let mut limit = *draw.pick(&[13.9, 16.7, 19.4, 22.2]).unwrap_or(&16.7);
        if self.few() {
            (forward, backward, limit) = (2, 1, 11.1);
        }
        let length = self.length_m(forward + backward, STREET_M + 0.5 * limit, 10.5 * limit);
        let profile = Profile { backward, ..street(forward, limit) };
        net.add_road(line(Vec2::from_heading(self.heading) * (-0.5 * length), self.heading, length), profile);
    }

    fn curve(&self, net: &mut Network, draw: &mut Stream) {
        let lanes = 1 + draw.below(2) + self.more;
        let limit = *draw.pick(&[13.9, 16.7]).unwrap_or(&13.9);
        let length = self.length_m(2 * lanes, STREET_M + 0.5 * limit, 260.0);
        let side = if draw.chance(0.5) { 1.0 } else { -1.0 };
        // Each bend turns by 30 to 80 degrees; its mean curvature is 0.7 of the largest.
        let mut bend = |share: f64| {
            let turn = draw.uniform(0.5, 1.4);
            swing(share * length, turn / (0.7 * share * length))
        };
        let (first, second) = (bend(0.32), bend(0.28));
        let mut pieces = vec![(0.15 * length, 0.0, 0.0)];
        pieces.extend(first.map(|(l, a, b)| (l, a * side, b * side)));
        pieces.push((0.1 * length, 0.0, 0.0));
        pieces.extend(second.map(|(l, a, b)| (l, -a * side, -b * side)));
        pieces.push((0.15 * length, 0.0, 0.0));
        let start = Vec2::from_heading(self.heading) * (-0.5 * length);
        net.add_road(Curve::bend(start, self.heading, &pieces), street(lanes, limit));
    }

    /// Lanes each way and limit of the main and of the side road.
    fn ranks(&self, draw: &mut Stream) -> [(usize, f64); 2] {
        let main = if self.few() { 1 } else { 1 + draw.below(2) };
        let side = if main == 1 { 1 } else { 1 + draw.below(2) };
        let (main, side) = (main + self.more.div_ceil(2), (side + self.more / 2).min(2));
        [(main, *draw.pick(&[13.9, 16.7]).unwrap_or(&13.9)), (side, *draw.pick(&[11.1, 13.9]).unwrap_or(&13.9))]
    }

    fn crossing(&self, net: &mut Network, draw: &mut Stream, arms: usize, signals: bool) {
        let [main, side] = self.ranks(draw);
        let lanes = 4 * main.0 + 2 * (arms - 2) * side.0;
        let length = self.length_m(lanes, JUNCTION_M, 90.0);
        let kinds: Vec<_> = [(0.0, true), (0.5, false), (1.0, true), (1.5, false)].into_iter().take(arms).collect();
        let roads = self.arms(net, draw, Vec2::ZERO, &kinds, [main, side], length);
        let control = if signals {
            Control::Signals(signal(draw))
        } else if arms == 4 && draw.chance(0.4) {
            Control::AllWayStop
        } else {
            Control::Priority
        };
        lay_junction(net, &roads, control, true);
    }

    /// Straight arms around a centre at multiples of pi, `(direction, whether of the main road)`.
    fn arms(
        &self,
        net: &mut Network,
        draw: &mut Stream,
        centre: Vec2,
        kinds: &[(f64, bool)],
        ranks: [(usize, f64); 2],
        length_m: f64,
    ) -> Vec<Arm> {
        let corner = draw.uniform(7.0, 10.0);
        let reach = |major: bool| {
            let crossing_lanes = if major { ranks[1].0 } else { ranks[0].0 };
            corner + 3.5 * crossing_lanes as f64
        };
        let arm = |&(turn, major): &(f64, bool)| {
            let heading = self.heading + turn * num::PI;
            let (lanes, limit) = if major { ranks[0] } else { ranks[1] };
            let start = centre + Vec2::from_heading(heading) * reach(major);
            let road = net.add_road(line(start, heading, length_m), street(lanes, limit));
            Arm::starting(&road, major)
        };
        kinds.iter().map(arm).collect()
    }

    fn urban(&self, net: &mut Network, draw: &mut Stream) {
        let [main, side] = self.ranks(draw);
        let lanes = 6 * main.0 + 6 * side.0;
        let length = self.length_m(lanes, JUNCTION_M, 80.0);
        let block = length.clamp(80.0, 160.0);
        let corner = 9.0;
        let reach = corner + 3.5 * side.0 as f64;
        let along = Vec2::from_heading(self.heading);
        // Main road: west arm, block between the junctions, east arm.
        let shared = net.add_road(line(along * reach, self.heading, block), street(main.0, main.1));
        let mut first = vec![Arm::starting(&shared, true)];
        let around = [(0.5, false), (1.0, true), (1.5, false)];
        first.extend(
            around.iter().map(|&(turn, major)| self.block_arm(net, Vec2::ZERO, turn, major, [main, side], length)),
        );
        lay_junction(net, &first, Control::Signals(signal(draw)), true);
        let centre = along * (2.0 * reach + block);
        let mut second = vec![self.block_arm(net, centre, 0.0, true, [main, side], length)];
        let above = draw.chance(0.5);
        let tee = |net: &mut Network, turn| self.block_arm(net, centre, turn, false, [main, side], length);
        if above {
            second.push(tee(net, 0.5));
        }
        second.push(Arm::ending(&shared, true));
        if !above {
            second.push(tee(net, 1.5));
        }
        lay_junction(net, &second, Control::Priority, true);
    }

    fn block_arm(
        &self,
        net: &mut Network,
        centre: Vec2,
        turn: f64,
        major: bool,
        ranks: [(usize, f64); 2],
        length_m: f64,
    ) -> Arm {
        let heading = self.heading + turn * num::PI;
        let (own, other) = if major { (ranks[0], ranks[1]) } else { (ranks[1], ranks[0]) };
        let start = centre + Vec2::from_heading(heading) * (9.0 + 3.5 * other.0 as f64);
        let road = net.add_road(line(start, heading, length_m), street(own.0, own.1));
        Arm::starting(&road, major)
    }

    fn merge(&self, net: &mut Network, draw: &mut Stream) {
        let lanes = 2 + draw.below(2) + self.more;
        let limit = *draw.pick(&[22.2, 25.0, 27.8]).unwrap_or(&25.0);
        let length = self.length_m(lanes, MOTORWAY_M, 420.0);
        let start = Vec2::from_heading(self.heading) * (-0.4 * length);
        let before = line(start, self.heading, 0.4 * length);
        self.on_ramp(net, draw, &before, lanes, limit, 0.6 * length);
    }

    /// A carriageway along `before`, then an acceleration lane beside it, then `rest_m` straight on.
    fn on_ramp(&self, net: &mut Network, draw: &mut Stream, before: &Curve, lanes: usize, limit: f64, rest_m: f64) {
        let joint = before.end();
        let accel_m = draw.uniform(190.0, 240.0).min(0.7 * rest_m);
        let profile = motorway(lanes, limit);
        let first = net.add_road(before.clone(), profile);
        let beside = line(joint.position, joint.heading_rad, accel_m);
        let second = net.add_road(beside.clone(), Profile { forward: lanes + 1, ..profile });
        let third = Profile { edges: false, ..profile };
        let third = net.add_road(line(beside.end().position, joint.heading_rad, rest_m - accel_m), third);
        taper(net, &second, &third);
        continue_lanes(net, &first, &second);
        continue_lanes(net, &second, &third);
        let accelerating = second.forward[lanes];
        net.lanes[accelerating].end = LaneEnd::Closed;
        let target = net.lanes[accelerating].curve.start();
        let turn = draw.uniform(0.2, 0.35);
        let back = Vec2::from_heading(target.heading_rad + turn) * -110.0;
        let from = Place { position: target.position + back, heading_rad: target.heading_rad + turn, curvature: 0.0 };
        let bend = Curve::between(from, target);
        let mut inside = bend.line(1.85);
        inside.truncate(inside.len() / 2);
        net.edges.extend([inside, bend.line(-1.85)]);
        let straight = line(from.position - Vec2::from_heading(from.heading_rad) * 120.0, from.heading_rad, 120.0);
        net.edges.extend([straight.line(1.85), straight.line(-1.85)]);
        let ramp = net.add_lane(straight, 3.7, 0.75 * limit, LaneKind::Freeway);
        let slip = net.add_lane(bend, 3.7, 0.85 * limit, LaneKind::Freeway);
        net.connect(ramp, slip);
        net.connect(slip, accelerating);
    }

    fn lane_drop(&self, net: &mut Network, draw: &mut Stream) {
        let lanes = 2 + draw.below(3) + self.more;
        let limit = *draw.pick(&[16.7, 22.2, 25.0]).unwrap_or(&22.2);
        let length = self.length_m(lanes, MOTORWAY_M, 420.0);
        let start = Vec2::from_heading(self.heading) * (-0.6 * length);
        let profile = motorway(lanes, limit);
        let wide = net.add_road(line(start, self.heading, 0.6 * length), profile);
        let end = wide.reference.end();
        let rest = Profile { forward: lanes - 1, edges: false, ..profile };
        let narrow = net.add_road(line(end.position, end.heading_rad, 0.4 * length), rest);
        taper(net, &wide, &narrow);
        continue_lanes(net, &wide, &narrow);
        net.lanes[wide.forward[lanes - 1]].end = LaneEnd::Closed;
    }

    fn highway(&self, net: &mut Network, draw: &mut Stream) {
        let lanes = if self.few() { 2 } else { 3 + draw.below(2) } + self.more;
        let limit = *draw.pick(&[27.8, 30.6, 33.3]).unwrap_or(&30.6);
        let length = self.length_m(2 * lanes, MOTORWAY_M, if self.few() { 400.0 } else { 480.0 });
        let curvature = draw.uniform(-1.0, 1.0) / 700.0;
        let straight = 0.5 * length;
        let mut pieces = swing(0.5 * length, curvature.clamp(-1.2 / length, 1.2 / length)).to_vec();
        let start = Vec2::from_heading(self.heading) * (-0.5 * length);
        let before = Curve::bend(start, self.heading, &pieces);
        self.on_ramp(net, draw, &before, lanes, limit, straight);
        // The other carriageway runs back beside it, 6 m away.
        pieces.push((straight, 0.0, 0.0));
        let back = Curve::bend(start, self.heading, &pieces).offset(6.0).reversed();
        net.add_road(back, motorway(lanes, limit));
    }

    fn roundabout(&self, net: &mut Network, draw: &mut Stream) {
        let arms = 3 + draw.below(2);
        let length = self.length_m(2 * arms, JUNCTION_M, 90.0);
        let ring = Ring { radius_m: draw.uniform(17.0, 22.0), opening_rad: 0.44 };
        ring.lay(net, self.heading, arms, length);
    }
}

/// Joins lanes of successive roads from the left.
fn continue_lanes(net: &mut Network, from: &RoadLanes, to: &RoadLanes) {
    for (&a, &b) in from.forward.iter().zip(&to.forward) {
        net.connect(a, b);
    }
}

/// Curbs of a straight road with a lane less on the right than the one before: the right one closes in.
fn taper(net: &mut Network, wide: &RoadLanes, narrow: &RoadLanes) {
    let at = |s: f64, left: f64| {
        let place = narrow.reference.at(s);
        place.position + Vec2::from_heading(place.heading_rad).left() * left
    };
    let length = narrow.reference.length_m();
    let right = -narrow.half_forward_m();
    net.edges.push(vec![at(0.0, -wide.half_forward_m()), at((0.5 * length).min(35.0), right), at(length, right)]);
    net.edges.push(vec![at(0.0, 0.0), at(length, 0.0)]);
}

/// One lane around a centre, counter-clockwise.
struct Ring {
    radius_m: f64,
    /// Angle between an arm's axis and the places where its exit leaves and its entry joins the ring.
    opening_rad: f64,
}

const RING_LIMIT_MPS: f64 = 8.3;

impl Ring {
    fn arc(&self, from_rad: f64, to_rad: f64) -> Curve {
        let k = 1.0 / self.radius_m;
        let start = Vec2::from_heading(from_rad) * self.radius_m;
        Curve::bend(start, from_rad + num::FRAC_PI_2, &[((to_rad - from_rad) * self.radius_m, k, k)])
    }

    fn lay(&self, net: &mut Network, heading: f64, arms: usize, length_m: f64) {
        let step = num::TAU / arms as f64;
        let angle = |i: usize| heading + step * i as f64;
        let open = self.opening_rad;
        let add = |net: &mut Network, curve| net.add_lane(curve, 4.0, RING_LIMIT_MPS, LaneKind::Street);
        // Inside each opening, and from there to the next one.
        let inner: Vec<_> = (0..arms).map(|i| add(net, self.arc(angle(i) - open, angle(i) + open))).collect();
        let outer: Vec<_> = (0..arms).map(|i| add(net, self.arc(angle(i) + open, angle(i) + step - open))).collect();
        for i in 0..arms {
            net.connect(inner[i], outer[i]);
            net.connect(outer[i], inner[(i + 1) % arms]);
        }
        for i in 0..arms {
            let out = angle(i);
            let start = Vec2::from_heading(out) * (self.radius_m + 15.0);
            let profile = Profile { lane_width_m: 4.0, median_m: 4.0, ..street(1, 11.1) };
            let road = net.add_road(line(start, out, length_m), profile);
            let arm = Arm::starting(&road, false);
            let before = outer[(i + arms - 1) % arms];
            let entry = Curve::between(net.lanes[arm.inbound[0]].curve.end(), net.lanes[outer[i]].curve.start());
            let leaving = Curve::between(net.lanes[before].curve.end(), net.lanes[arm.outbound[0]].curve.start());
            let (entry, leaving) = (add(net, entry), add(net, leaving));
            net.connect(arm.inbound[0], entry);
            net.connect(entry, outer[i]);
            net.connect(before, leaving);
            net.connect(leaving, arm.outbound[0]);
            let movement = |lane, origin, rank| Connector { lane, origin, rank, group: 0, stop_sign: false };
            let connectors =
                vec![movement(inner[i], before, 0), movement(leaving, before, 0), movement(entry, arm.inbound[0], 1)];
            let node = net.add_node(connectors, None);
            for origin in [before, arm.inbound[0]] {
                let stop_s = net.lanes[origin].curve.length_m() - 1.0;
                net.lanes[origin].gate = Some(Gate { node, stop_s });
            }
            let edges = [net.lanes[entry].curve.line(-2.0), net.lanes[leaving].curve.line(-2.0)];
            net.edges.extend(edges);
        }
        let island = self.arc(heading, heading + num::TAU).line(2.0);
        net.edges.push(island);
        for &lane in &outer {
            let rim = net.lanes[lane].curve.line(-2.0);
            net.edges.push(rim);
        }
    }
}
