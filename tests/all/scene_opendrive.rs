//! OpenDRIVE import on the town and example networks where they are at hand.

use crate::harness::shared;
use evodrive::formats::Imported;
use evodrive::formats::opendrive::read as opendrive;
use evodrive::kernel::num;
use evodrive::scene::{LaneGraph, Road};

/// A network beside the repository, if it is there.
fn network(path: &str) -> Option<Vec<u8>> {
    Some(std::fs::read(shared(&format!("data/{path}"))?).unwrap())
}

/// Share of the through lanes that lead on; largest gap and turn where one lane leads into the next.
fn joints(road: &Road) -> (f64, f64, f64) {
    let graph = LaneGraph::of(road);
    let through: Vec<usize> = (0..graph.lane_count()).filter(|&ix| graph.is_through(ix)).collect();
    let leading = through.iter().filter(|&&ix| !graph.exits(ix).is_empty()).count();
    let (mut gap, mut turn) = (0.0f64, 0.0f64);
    for &from in &through {
        for &to in graph.exits(from) {
            let end = graph.pose_at(from, graph.length_m(from)).unwrap();
            let start = graph.pose_at(to, 0.0).unwrap();
            gap = gap.max(end.position.distance(start.position));
            turn = turn.max(num::wrap_angle(start.heading_rad - end.heading_rad).abs());
        }
    }
    (leading as f64 / through.len() as f64, gap, turn)
}

#[test]
fn the_towns_lanes_lead_into_each_other_without_gaps() {
    for town in ["Town01", "Town02", "Town_Safebench_Light"] {
        let Some(bytes) = network(&format!("opendrive_carla/{town}.xodr")) else { return };
        let road = opendrive::road(town, &bytes, &mut Imported::default()).unwrap();
        let (leading, gap, turn) = joints(&road);
        println!("{town}: {} lanes, {leading:.3} lead on, gap {gap:.3} m, turn {turn:.3} rad", road.lanes.len());
        assert!(leading > 0.95, "{town}: {leading}");
        assert!(gap < 0.3 && turn < 0.2, "{town}: gap {gap} m, turn {turn} rad");
    }
}

#[test]
fn spirals_and_cubics_of_the_examples_join_up() {
    for name in ["e6mini", "fabriksgatan", "jolengatan"] {
        let Some(bytes) = network(&format!("openscenario/esmini/xodr/{name}.xodr")) else { return };
        let road = opendrive::road(name, &bytes, &mut Imported::default()).unwrap();
        let (leading, gap, turn) = joints(&road);
        println!("{name}: {} lanes, {leading:.3} lead on, gap {gap:.3} m, turn {turn:.3} rad", road.lanes.len());
        assert!(!road.lanes.is_empty());
        assert!(gap < 0.5 && turn < 0.3, "{name}: gap {gap} m, turn {turn} rad");
    }
}
