//! Turns the lane graph into roads and junctions with links that OpenDRIVE allows.

use std::collections::BTreeMap;

use super::curve::{Curve, Station, cut, stations_of};
use super::meeting::{Groups, Met, meet};
use crate::scene::{LaneIx, Road};

/// Length of each following lane that becomes a connection where lanes split or merge without connecting lanes of their own,
/// metres; at most a quarter of the lane.
const HEAD_M: f64 = 2.0;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Link {
    None,
    /// A piece: its end as a predecessor, its start as a successor.
    Road(usize),
    Junction(usize),
}

/// One road of the file: a lane, or the first metres of one.
pub(super) struct Piece {
    pub lane: LaneIx,
    pub curve: Curve,
    pub from: Link,
    pub to: Link,
    /// The junction whose connecting road it is.
    pub junction: Option<usize>,
}

pub(super) struct Connection {
    pub incoming: usize,
    pub connecting: usize,
}

pub(super) struct Network {
    pub pieces: Vec<Piece>,
    pub junctions: Vec<Vec<Connection>>,
    /// Road that is a lane, without its first metres where they connect.
    pub bodies: Vec<Option<usize>>,
    /// Pairs of lanes that follow each other in the scene and do not meet; they are not linked.
    pub apart: Vec<(LaneIx, LaneIx)>,
}

pub(super) fn road_id(piece: usize) -> String {
    (piece + 1).to_string()
}

pub(super) fn junction_id(junction: usize) -> String {
    (100_000 + junction).to_string()
}

/// A place where lanes end and begin.
#[derive(Default)]
struct Node {
    links: Vec<(LaneIx, LaneIx)>,
}

impl Network {
    pub fn of(road: &Road) -> Network {
        let mut stations: Vec<Option<Vec<Station>>> = road.lanes.iter().map(stations_of).collect();
        let links = links(road, &stations);
        let Met { links, apart } = meet(road, &links, &mut stations);
        let beside = Beside::of(road.lanes.len(), &links);
        let connecting = connecting_lanes(&beside);
        let nodes = nodes(road.lanes.len(), &links, &connecting);
        let mut network = Network { pieces: vec![], junctions: vec![], bodies: vec![None; road.lanes.len()], apart };
        // Lanes whose first metres become connecting roads.
        let mut heads: BTreeMap<LaneIx, Vec<Station>> = BTreeMap::new();
        for (lane, stations) in stations.into_iter().enumerate() {
            let Some(mut stations) = stations else { continue };
            let is_cut = nodes.iter().any(|n| n.links.len() > 1 && n.links.iter().any(|(_, to)| *to == lane));
            if is_cut {
                let length = stations.windows(2).map(|w| w[0].point.distance(w[1].point)).fold(0.0, |a, b| a + b);
                let (head, body) = cut(&stations, HEAD_M.min(0.25 * length));
                if head.len() > 1 && body.len() > 1 {
                    heads.insert(lane, head);
                    stations = body;
                }
            }
            network.bodies[lane] = Some(network.pieces.len());
            let curve = Curve::through(&stations);
            network.pieces.push(Piece { lane, curve, from: Link::None, to: Link::None, junction: None });
        }
        network.connect(&connecting, &beside);
        network.join(&nodes, &heads);
        network
    }

    /// Yields the lanes that have no road.
    pub fn skipped(&self) -> impl Iterator<Item = LaneIx> {
        self.bodies.iter().enumerate().filter(|(_, body)| body.is_none()).map(|(lane, _)| lane)
    }

    /// Makes junctions of connecting lanes: those that share an incoming or an outgoing lane belong together.
    fn connect(&mut self, connecting: &[bool], beside: &Beside) {
        let lanes: Vec<LaneIx> = (0..connecting.len()).filter(|&lane| connecting[lane]).collect();
        let ends = |lane: LaneIx| (beside.entries[lane][0], beside.exits[lane][0]);
        let mut groups = Groups::new(2 * connecting.len());
        for &lane in &lanes {
            let (from, to) = ends(lane);
            groups.unite(2 * from + 1, 2 * to);
        }
        let mut numbers: BTreeMap<usize, usize> = BTreeMap::new();
        for &lane in &lanes {
            let (from, to) = ends(lane);
            let (Some(piece), Some(from), Some(to)) = (self.bodies[lane], self.bodies[from], self.bodies[to]) else {
                continue;
            };
            let next = self.junctions.len();
            let number = *numbers.entry(groups.of(2 * ends(lane).0 + 1)).or_insert(next);
            if number == next {
                self.junctions.push(Vec::new());
            }
            self.junctions[number].push(Connection { incoming: from, connecting: piece });
            self.pieces[piece].junction = Some(number);
            (self.pieces[piece].from, self.pieces[piece].to) = (Link::Road(from), Link::Road(to));
            self.pieces[from].to = Link::Junction(number);
            self.pieces[to].from = Link::Junction(number);
        }
    }

    /// Makes direct links, and junctions out of the first metres of lanes.
    fn join(&mut self, nodes: &[Node], heads: &BTreeMap<LaneIx, Vec<Station>>) {
        for node in nodes {
            let bodies = |(from, to): (LaneIx, LaneIx)| Some((self.bodies[from]?, self.bodies[to]?, to));
            let links: Vec<(usize, usize, LaneIx)> = node.links.iter().copied().filter_map(bodies).collect();
            if let [(from, to, _)] = links[..] {
                self.pieces[from].to = Link::Road(to);
                self.pieces[to].from = Link::Road(from);
                continue;
            }
            let number = self.junctions.len();
            let mut connections = Vec::new();
            for &(from, to, lane) in &links {
                let Some(head) = heads.get(&lane) else { continue };
                let curve = Curve::through(head);
                let piece = Piece { lane, curve, from: Link::Road(from), to: Link::Road(to), junction: Some(number) };
                connections.push(Connection { incoming: from, connecting: self.pieces.len() });
                self.pieces.push(piece);
                self.pieces[from].to = Link::Junction(number);
                self.pieces[to].from = Link::Junction(number);
            }
            if !connections.is_empty() {
                self.junctions.push(connections);
            }
        }
    }
}

/// Returns pairs of lanes that follow each other, both with roads.
fn links(road: &Road, stations: &[Option<Vec<Station>>]) -> Vec<(LaneIx, LaneIx)> {
    let mut links = Vec::new();
    for (from, lane) in road.lanes.iter().enumerate() {
        for &to in &lane.exits {
            if stations[from].is_some() && stations[to].is_some() && !links.contains(&(from, to)) {
                links.push((from, to));
            }
        }
    }
    links
}

/// Lanes that lead into a lane and lanes that it leads to, among lanes that meet.
struct Beside {
    entries: Vec<Vec<LaneIx>>,
    exits: Vec<Vec<LaneIx>>,
}

impl Beside {
    fn of(lanes: usize, links: &[(LaneIx, LaneIx)]) -> Beside {
        let mut beside = Beside { entries: vec![vec![]; lanes], exits: vec![vec![]; lanes] };
        for &(from, to) in links {
            beside.exits[from].push(to);
            beside.entries[to].push(from);
        }
        beside
    }
}

/// Returns lanes that lead from one lane to one other across a split or merge, if only such lanes leave the first or reach the
/// second. They can be the connecting roads of a junction as they are.
fn connecting_lanes(Beside { entries, exits }: &Beside) -> Vec<bool> {
    let simple = |lane: LaneIx| {
        let one = entries[lane].len() == 1 && exits[lane].len() == 1 && entries[lane] != exits[lane];
        one && (exits[entries[lane][0]].len() > 1 || entries[exits[lane][0]].len() > 1)
    };
    let mut connecting: Vec<bool> = (0..entries.len()).map(simple).collect();
    loop {
        let stays = |lane: LaneIx| {
            let (from, to) = (entries[lane][0], exits[lane][0]);
            !connecting[from]
                && !connecting[to]
                && exits[from].iter().all(|&l| connecting[l])
                && entries[to].iter().all(|&l| connecting[l])
        };
        let next: Vec<bool> = (0..entries.len()).map(|lane| connecting[lane] && stays(lane)).collect();
        if next == connecting {
            return connecting;
        }
        connecting = next;
    }
}

/// Returns all other links, grouped by the lane end or start that they share.
fn nodes(lanes: usize, links: &[(LaneIx, LaneIx)], connecting: &[bool]) -> Vec<Node> {
    let open: Vec<(LaneIx, LaneIx)> =
        links.iter().copied().filter(|(from, to)| !connecting[*from] && !connecting[*to]).collect();
    let mut groups = Groups::new(2 * lanes);
    for (from, to) in &open {
        groups.unite(2 * from + 1, 2 * to);
    }
    let mut nodes: BTreeMap<usize, Node> = BTreeMap::new();
    for (from, to) in open {
        nodes.entry(groups.of(2 * from + 1)).or_default().links.push((from, to));
    }
    nodes.into_values().collect()
}
