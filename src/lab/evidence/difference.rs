//! Differences of the scenes of two pools: quantity by quantity, and as a whole by whether a classifier tells them apart.

use serde::Serialize;

use crate::kernel::{Digest, Pose, Threads, num};
use crate::scene::beside::{self, QUANTITIES};
use crate::scene::stats::Summary;
use crate::scene::{AgentKind, LaneGraph, Sample, Scene, SceneFeatures, Track};
use crate::statistics::Estimate;
use crate::statistics::two_samples::{Member, in_deviations, told_apart, wasserstein};

/// Features of a scene: name, the feature, unit, and whether it is of the road and not of who is on it.
const OF_SCENES: [(&str, &str, &str, bool); 14] = [
    ("vehicles", "vehicle_count", "", false),
    ("pedestrians", "pedestrian_count", "", false),
    ("cyclists", "cyclist_count", "", false),
    ("the ego's speed", "ego_speed_mps", "m/s", false),
    ("the ego's way", "ego_route_length_m", "m", false),
    ("traffic's speed", "traffic_speed_mps", "m/s", false),
    ("nearest vehicle", "nearest_vehicle_gap_m", "m", false),
    ("nearest way to the ego's", "log_distance_m_min", "m", false),
    ("ways that cross the ego's", "conflict_count", "", false),
    ("curvature, sharpest", "route_curvature_max_1pm", "1/m", true),
    ("speed limit", "speed_limit_mps", "m/s", true),
    ("lanes abreast", "lane_count", "", true),
    ("light on the way", "has_light", "", true),
    ("junction on the way", "is_junction", "", true),
];
/// Vehicles around the ego's start, by where they are.
const AROUND: [&str; 3] = ["vehicles ahead within 30 m", "vehicles beside within 30 m", "vehicles behind within 30 m"];
const AROUND_M: f64 = 30.0;
/// A vehicle no farther along the ego's heading than this is beside it, metres.
const BESIDE_M: f64 = 4.0;

/// An ego with fewer samples has no recording to look from.
const RECORDED_MIN: usize = 20;
/// Speed that a vehicle must exceed at some time to count as moving, m/s.
const MOVES_MPS: f64 = 1.0;

/// One quantity in both pools.
#[derive(Clone, Debug, Serialize)]
pub struct Quantity {
    /// `road users`, `scenes` or `roads`: of whom it is a number.
    pub of: &'static str,
    pub name: &'static str,
    /// Empty for counts and shares.
    pub unit: &'static str,
    pub first: Summary,
    pub second: Summary,
    /// Wasserstein's distance of first order, in the unit.
    pub distance: f64,
    /// The distance in standard deviations of both pools together; 0 where they do not vary.
    pub in_deviations: f64,
}

/// Success of a classifier that tells the pools apart by a group of quantities; cross-validated, by scene.
#[derive(Clone, Debug, Serialize)]
pub struct ToldApart {
    pub by: &'static str,
    /// Area under the curve, 0.5 where nothing is told, with its 95 % interval over scenes.
    pub auc: Estimate,
}

/// The difference of two pools.
#[derive(Clone, Debug, Serialize)]
pub struct Difference {
    pub scenes: [usize; 2],
    /// Samples that are looked at of each scene: the median of the pool with the shorter scenes, since extremes grow with the time looked at.
    pub samples: usize,
    pub quantities: Vec<Quantity>,
    pub told_apart: Vec<ToldApart>,
}

/// Values of one scene.
struct Rows {
    /// Values in the order of [`OF_SCENES`], then [`AROUND`].
    scene: Vec<f64>,
    /// Rows in the order of [`QUANTITIES`].
    beside: Vec<Vec<f64>>,
}

impl Difference {
    /// Compares two lists of scenes.
    pub fn of(pools: [&[Scene]; 2], threads: &Threads) -> Difference {
        let samples = pools.iter().filter_map(|scenes| median_samples(scenes)).min().unwrap_or(0);
        let rows = pools.map(|scenes| threads.map(scenes, |_, scene| rows(&cut(scene, samples))));
        let names = OF_SCENES.iter().map(|(name, _, unit, of_road)| (*name, *unit, *of_road));
        let names: Vec<(&str, &str, bool)> = names.chain(AROUND.map(|name| (name, "", false))).collect();
        let users = QUANTITIES.iter().enumerate().filter_map(|(place, (name, unit, _))| {
            let values = |rows: &[Rows]| rows.iter().flat_map(|of| &of.beside).map(|row| row[place]).collect();
            quantity("road users", name, unit, [values(&rows[0]), values(&rows[1])])
        });
        let scenes = names.iter().enumerate().filter_map(|(place, (name, unit, of_road))| {
            let values = |rows: &[Rows]| rows.iter().map(|of| of.scene[place]).collect();
            let of = if *of_road { "roads" } else { "scenes" };
            quantity(of, name, unit, [values(&rows[0]), values(&rows[1])])
        });
        let suite = Digest::of_bytes(format!("pools {} {}", pools[0].len(), pools[1].len()).as_bytes());
        let apart = |by: &'static str, of: &dyn Fn(&Rows) -> Vec<Vec<f64>>| {
            let members = members(&rows, of);
            Some(ToldApart { by, auc: told_apart(&members, suite)? })
        };
        let picked = |row: &Rows, of_roads: bool| {
            let kept = names.iter().zip(&row.scene).filter(|((.., of_road), _)| *of_road == of_roads);
            vec![kept.map(|(_, value)| *value).collect()]
        };
        let told_apart = [
            apart("road users beside the ego", &|row| row.beside.clone()),
            apart("traffic of the scene", &|row| picked(row, false)),
            apart("road", &|row| picked(row, true)),
        ];
        Difference {
            scenes: pools.map(<[Scene]>::len),
            samples,
            quantities: users.chain(scenes).collect(),
            told_apart: told_apart.into_iter().flatten().collect(),
        }
    }
}

/// Returns the samples of both pools that a classifier is shown, a scene a group.
fn members(rows: &[Vec<Rows>; 2], of: &dyn Fn(&Rows) -> Vec<Vec<f64>>) -> Vec<Member> {
    let scenes =
        [false, true].into_iter().zip(rows).flat_map(|(second, rows)| rows.iter().map(move |row| (second, row)));
    let of_scene = |(group, (second, row)): (usize, (bool, &Rows))| {
        of(row).into_iter().map(move |values| Member { group, second, values }).collect::<Vec<Member>>()
    };
    scenes.enumerate().flat_map(of_scene).collect()
}

fn quantity(
    of: &'static str,
    name: &'static str,
    unit: &'static str,
    [first, second]: [Vec<f64>; 2],
) -> Option<Quantity> {
    let (distance, in_deviations) = (wasserstein(&first, &second)?, in_deviations(&first, &second)?);
    Some(Quantity { of, name, unit, first: Summary::of(first)?, second: Summary::of(second)?, distance, in_deviations })
}

/// Samples from where a scene is looked at on, in the median.
fn median_samples(scenes: &[Scene]) -> Option<usize> {
    let mut all: Vec<usize> = scenes.iter().map(|scene| scene.steps.saturating_sub(reference(scene).1)).collect();
    all.sort_unstable();
    all.get(all.len() / 2).copied()
}

/// The scene without what follows so many samples.
fn cut(scene: &Scene, samples: usize) -> Scene {
    let mut scene = scene.clone();
    let steps = (reference(&scene).1 + samples).min(scene.steps);
    let tracks = scene.tracks.iter_mut().chain([&mut scene.ego.track]);
    tracks.for_each(|track| track.samples.truncate(steps));
    // Places among the tracks, of which some go.
    scene.objects_of_interest.clear();
    scene.tracks.retain(|track| track.samples.iter().any(Option::is_some));
    scene.lights.iter_mut().for_each(|light| light.states.truncate(steps));
    scene.steps = steps;
    scene
}

fn rows(scene: &Scene) -> Rows {
    let lanes = LaneGraph::of(&scene.road);
    let features = SceneFeatures::of(scene, &lanes);
    let mut of_scene: Vec<f64> =
        OF_SCENES.iter().map(|(_, feature, ..)| features.value(feature).unwrap_or(0.0)).collect();
    of_scene.extend(around(scene));
    let (seen_from, from) = reference(scene);
    let ego: Vec<Sample> = seen_from.samples.iter().skip(from).map_while(|sample| *sample).collect();
    let row = |samples: &[Option<Sample>]| beside::row(&ego, samples.get(from..)?, &lanes);
    let others = scene.tracks.iter().filter(|track| track.id != seen_from.id);
    let beside = others.filter_map(|track| row(&track.samples)).map(Vec::from).collect();
    Rows { scene: of_scene, beside }
}

/// Returns the track from which road users are seen, and the first step: the ego's, or where it has no recording, as in a planning problem,
/// that of the vehicle that is recorded longest. Of equals the first.
fn reference(scene: &Scene) -> (&Track, usize) {
    let own = (&scene.ego.track, scene.ego.start_step);
    let observed = |(track, from): (&Track, usize)| track.samples.iter().skip(from).map_while(Option::as_ref).count();
    let moves = |track: &&Track| {
        track.kind == AgentKind::Vehicle && track.samples.iter().flatten().any(|sample| sample.speed_mps() > MOVES_MPS)
    };
    let begun = |track| Some((track, Track::span(track)?.0));
    if observed(own) >= RECORDED_MIN {
        return own;
    }
    let others = scene.tracks.iter().filter(moves).filter_map(begun);
    others.reduce(|best, next| if observed(next) > observed(best) { next } else { best }).unwrap_or(own)
}

/// Vehicles ahead, beside and behind at the ego's start.
fn around(scene: &Scene) -> [f64; 3] {
    let mut counts = [0.0; 3];
    let Some(ego) = scene.ego.track.at(scene.ego.start_step) else { return counts };
    let here = Pose { position: ego.position, heading_rad: ego.heading_rad };
    let others = scene.tracks.iter().filter(|track| track.kind == AgentKind::Vehicle);
    for other in others.filter_map(|track| track.at(scene.ego.start_step)) {
        let there = here.to_local(other.position);
        if num::hypot(there.x, there.y) < AROUND_M {
            let place = if there.x > BESIDE_M { 0 } else { 1 + usize::from(there.x < -BESIDE_M) };
            counts[place] += 1.0;
        }
    }
    counts
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernel::Seed;
    use crate::scene::fixture::worlds;
    use evodrive_core::synth::{self, SynthOptions, WorldKind};

    fn pool(kind: WorldKind, seed: u64) -> Vec<Scene> {
        let options = SynthOptions { kinds: vec![kind], ..worlds() };
        synth::pool(&options, Seed(seed), 30).unwrap()
    }

    #[test]
    fn scenes_of_other_lengths_are_looked_at_as_long_as_the_shorter_ones() {
        let threads = Threads::new(2).unwrap();
        let long = pool(WorldKind::SignalledCrossing, 1);
        let short: Vec<Scene> = long.iter().map(|scene| cut(scene, 40)).collect();
        let difference = Difference::of([&long, &short], &threads);
        assert_eq!(difference.samples, 40);
        assert!(difference.quantities.iter().all(|of| of.distance == 0.0), "{difference:?}");
    }

    #[test]
    fn pools_of_one_kind_are_not_told_apart_and_a_motorway_is_told_from_a_crossing() {
        let threads = Threads::new(2).unwrap();
        let auc = |a: &[Scene], b: &[Scene], by: &str| {
            let difference = Difference::of([a, b], &threads);
            difference.told_apart.iter().find(|of| of.by == by).unwrap().auc
        };
        let crossings = pool(WorldKind::SignalledCrossing, 1);
        let same = auc(&crossings, &pool(WorldKind::SignalledCrossing, 2), "road users beside the ego");
        let [low, high] = same.interval.unwrap();
        assert!(low < 0.5 && 0.5 < high, "{same:?}");
        let motorways = pool(WorldKind::Highway, 1);
        assert!(auc(&crossings, &motorways, "road users beside the ego").value > 0.8);
        assert!(auc(&crossings, &motorways, "road").value > 0.9);
        let difference = Difference::of([&crossings, &motorways], &threads);
        let speed = difference.quantities.iter().find(|of| of.name == "traffic's speed").unwrap();
        assert!(speed.second.mean > speed.first.mean && speed.in_deviations > 1.0, "{speed:?}");
        assert!(Difference::of([&crossings, &crossings], &threads).quantities.iter().all(|of| of.distance == 0.0));
    }
}
