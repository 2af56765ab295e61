//! A road user where its kind does not belong loses realism where an experiment weighs that, and recorded traffic is not there.

use super::{PLACE, body_m, options_of_kind, options_of_place, worlds};
use crate::evaluation::{limits, report};
use crate::harness::shared;
use evodrive::ego::Policy;
use evodrive::evaluation::calibrate::moves;
use evodrive::evaluation::metrics::place_of_kind;
use evodrive::evaluation::metrics::realism::realism;
use evodrive::formats::import_files;
use evodrive::kernel::{Polyline, Seed, Vec2, num};
use evodrive::scene::{AgentKind, DT_S, Lane, LaneGraph, LaneKind, PreparedScene, Sample, Scene, Track};
use evodrive::sim::{
    Action, AdversaryReport, Intervention, OfPlace, Outcome, Plant, SimulatorOptions, WithRecording, rollout,
};
use evodrive::synth::WorldKind;
use std::collections::BTreeMap;
use std::sync::{Arc, OnceLock};

/// A motion is caught where its diagnostic loses at least half.
const CAUGHT: f64 = 0.5;
/// Share of scenes in which it must be.
const SHARE: f64 = 0.95;
/// Scenes drawn of each group of worlds.
const SCENES: usize = 160;
/// Samples of a motion.
const STEPS: usize = 40;
/// Nobody comes nearer to a motion's place than this, metres.
const FREE_M: f64 = 14.0;
const MOTORWAYS: [WorldKind; 3] = [WorldKind::Merge, WorldKind::LaneDrop, WorldKind::Highway];
const STREETS: [WorldKind; 2] = [WorldKind::Straight, WorldKind::Curve];

/// A generated scene with a place that nobody comes near, on a lane or beside it, and the lane's heading.
struct Place {
    scene: Scene,
    at: Vec2,
    heading_rad: f64,
    lane: usize,
}

/// The place on the lanes that `takes` names from which everybody stays farthest, where that is far enough.
fn place(scene: Scene, takes: impl Fn(&Scene, &Lane) -> bool) -> Option<Place> {
    let first = scene.ego.start_step;
    let seen = |k: usize| scene.tracks.iter().chain([&scene.ego.track]).filter_map(move |t| t.at(k));
    let others: Vec<Vec2> = (first..(first + STEPS + 1).min(scene.steps)).flat_map(seen).map(|s| s.position).collect();
    let free_m = |at: Vec2| others.iter().map(|other| other.distance(at)).fold(f64::INFINITY, f64::min);
    let lanes = scene.road.lanes.iter().enumerate().filter(|(_, lane)| takes(&scene, lane));
    // Well within the lane, so that a motion does not leave it at its ends.
    let inner = |(ix, lane): (usize, &Lane)| -> Vec<(Vec2, f64, usize)> {
        let line = Polyline::new(lane.centre.clone()).unwrap();
        let places = (0..).map(|k| 35.0 + 2.0 * f64::from(k)).take_while(|s_m| *s_m < line.length_m() - 35.0);
        places.map(|s_m| (line.at(s_m), line.heading_at(s_m), ix)).collect()
    };
    let (at, heading_rad, lane) =
        lanes.flat_map(inner).max_by(|a, b| free_m(a.0).total_cmp(&free_m(b.0))).filter(|of| free_m(of.0) >= FREE_M)?;
    Some(Place { scene, at, heading_rad, lane })
}

/// Places on motorways, or on streets.
fn lanes(kind: LaneKind) -> &'static [Place] {
    static PLACES: OnceLock<[Vec<Place>; 2]> = OnceLock::new();
    let both = PLACES.get_or_init(|| {
        let of = |kinds: &[WorldKind], kind: LaneKind| {
            worlds(kinds, 8, Seed(13), SCENES)
                .into_iter()
                .filter_map(|scene| place(scene, |_, lane| lane.kind == kind))
                .collect()
        };
        [of(&MOTORWAYS, LaneKind::Freeway), of(&STREETS, LaneKind::Street)]
    });
    &both[usize::from(kind == LaneKind::Street)]
}

/// Two-way streets with a barrier between the directions, and places on the lanes farthest from it.
fn divided() -> &'static [Place] {
    static PLACES: OnceLock<Vec<Place>> = OnceLock::new();
    PLACES.get_or_init(|| {
        let outer = |scene: &Scene, lane: &Lane| lane.right_neighbours.is_empty() && opposite(scene, lane).is_some();
        let places = worlds(&STREETS, 8, Seed(13), SCENES).into_iter().filter_map(|scene| place(scene, outer));
        // Narrower than a car turns.
        let wide = places.filter(|place| half_across_m(place) >= 3.0);
        wide.map(|mut place| {
            let middle = |lane: &&Lane| lane.left_neighbours.iter().any(|other| !other.same_direction);
            let lines = place.scene.road.lanes.iter().filter(middle).map(|lane| lane.left.clone());
            let lines: Vec<_> = lines.collect();
            place.scene.road.edges.extend(lines);
            place
        })
        .collect()
    })
}

/// The outermost lane of the other direction.
fn opposite<'s>(scene: &'s Scene, lane: &'s Lane) -> Option<&'s Lane> {
    let beside = |lane: &'s Lane, same: bool| {
        let found = lane.left_neighbours.iter().find(|other| other.same_direction == same)?;
        Some(&scene.road.lanes[found.lane])
    };
    let mut inner = lane;
    while let Some(next) = beside(inner, true) {
        inner = next;
    }
    let mut outer = beside(inner, false)?;
    while let Some(next) = outer.right_neighbours.first() {
        outer = &scene.road.lanes[next.lane];
    }
    Some(outer)
}

fn asked() -> SimulatorOptions {
    SimulatorOptions { of_kind: true, of_place: true, ..SimulatorOptions::SHIPPED }
}

fn prepared(scene: &Scene) -> Plant {
    Plant::with_options(PreparedScene::new(Arc::new(scene.clone())), &asked()).unwrap()
}

/// Plays a new road user: `at` gives its place `t` seconds after it appears. Its heading is that of its motion, or the lane's while it stands.
fn played(place: &Place, kind: AgentKind, at: impl Fn(f64) -> Vec2) -> Outcome {
    let (length_m, width_m) = body_m(kind);
    let sample = |k: usize| {
        let (t, dt) = (k as f64 * DT_S, 0.5 * DT_S);
        let velocity = (at(t + dt) - at(t - dt)) * (1.0 / (2.0 * dt));
        let heading_rad = if velocity.norm() > 0.01 { velocity.heading() } else { place.heading_rad };
        Sample { position: at(t), heading_rad, velocity }
    };
    let from_step = place.scene.ego.start_step + 1;
    let samples = (0..STEPS).map(sample).collect();
    let actions = vec![Action::Insert { kind, length_m, width_m, from_step, samples }];
    rollout(&prepared(&place.scene), &Intervention { actions }, Policy::Replay.driver().as_mut()).unwrap()
}

/// Returns, for each diagnostic, the share of the places in which it catches a motion of this kind.
fn shares<'p>(
    places: &'p [Place],
    kind: AgentKind,
    motion: impl Fn(&'p Place) -> Box<dyn Fn(f64) -> Vec2 + 'p>,
) -> BTreeMap<String, f64> {
    let options = options_of_place();
    assert!(places.len() >= 20, "{} places", places.len());
    let mut shares: BTreeMap<String, f64> = BTreeMap::new();
    for place in places {
        let outcome = played(place, kind, motion(place));
        for (name, d) in realism(&outcome, &options).0 {
            *shares.entry(name).or_default() += f64::from(u8::from(d <= CAUGHT)) / places.len() as f64;
        }
    }
    shares
}

/// Place of kind catches a motion nearly everywhere, and no other diagnostic does.
fn is_caught_by_its_place(shares: &BTreeMap<String, f64>) {
    println!("{shares:?}");
    assert!(shares[PLACE] >= SHARE, "{shares:?}");
    for (name, share) in shares.iter().filter(|(name, _)| *name != PLACE) {
        assert!(*share <= 1.0 - SHARE, "{name}: {shares:?}");
    }
}

fn ahead(place: &Place) -> Vec2 {
    Vec2::from_heading(place.heading_rad)
}

fn stands(place: &Place) -> Way<'_> {
    Box::new(|_| place.at)
}

fn walks_across(place: &Place) -> Way<'_> {
    Box::new(|t| place.at + ahead(place).left() * (1.4 * (t - 1.0)))
}

fn rides_along(place: &Place) -> Way<'_> {
    Box::new(|t| place.at + ahead(place) * (4.0 * (t - 2.0)))
}

#[test]
fn someone_on_foot_or_on_a_bicycle_on_a_motorway_is_caught_by_its_place_alone() {
    for (kind, motion) in [
        (AgentKind::Pedestrian, stands as fn(&Place) -> Way<'_>),
        (AgentKind::Pedestrian, walks_across),
        (AgentKind::Cyclist, stands),
        (AgentKind::Cyclist, rides_along),
    ] {
        is_caught_by_its_place(&shares(lanes(LaneKind::Freeway), kind, motion));
    }
}

#[test]
fn on_a_street_or_beside_a_motorway_everybody_may_be_and_a_car_on_both() {
    let at_the_kerb = |place: &'static Place| -> Box<dyn Fn(f64) -> Vec2 + 'static> {
        let plant = prepared(&place.scene);
        let right = -ahead(place).left();
        let beside = (1..400).map(|k| place.at + right * (0.1 * f64::from(k)));
        let beside = beside.into_iter().find(|at| plant.lanes().off_road_m(*at) > 0.2).unwrap();
        Box::new(move |_| beside)
    };
    let never = |shares: BTreeMap<String, f64>| assert_eq!(shares[PLACE], 0.0, "{shares:?}");
    never(shares(lanes(LaneKind::Freeway), AgentKind::Pedestrian, at_the_kerb));
    never(shares(lanes(LaneKind::Freeway), AgentKind::Vehicle, stands));
    never(shares(lanes(LaneKind::Freeway), AgentKind::Vehicle, rides_along));
    for (kind, motion) in [
        (AgentKind::Pedestrian, stands as fn(&Place) -> Way<'_>),
        (AgentKind::Pedestrian, walks_across),
        (AgentKind::Cyclist, rides_along),
    ] {
        never(shares(lanes(LaneKind::Street), kind, motion));
    }
}

/// Half the way to the outermost lane of the other direction, metres.
fn half_across_m(place: &Place) -> f64 {
    let other = opposite(&place.scene, &place.scene.road.lanes[place.lane]).unwrap();
    let line = Polyline::new(other.centre.clone()).unwrap();
    0.5 * line.project(place.at).offset_m.abs()
}

/// Position of a road user by the seconds since it appeared.
type Way<'p> = Box<dyn Fn(f64) -> Vec2 + 'p>;

/// Half a circle to the left into the outermost lane of the other direction, as slow as comfort asks, then on.
fn turns_round(place: &Place) -> Way<'_> {
    let radius_m = half_across_m(place);
    let mps = (2.5 * radius_m).sqrt();
    let centre = place.at + ahead(place).left() * radius_m;
    Box::new(move |t| {
        let turned = (mps * t / radius_m).clamp(0.0, num::PI);
        let on = ahead(place) * (mps * (t.min(0.0) - (t - num::PI * radius_m / mps).max(0.0)));
        centre + (place.at - centre).rotated(turned) + on
    })
}

/// Along its lane and within 3.5 s into the next one of its direction.
fn changes_lane(place: &Place) -> Way<'_> {
    let line = Polyline::new(place.scene.road.lanes[place.lane].centre.clone()).unwrap();
    let from_m = line.project(place.at).s_m;
    let left_m = |t: f64| 3.5 * (0.5 - 0.5 * num::cos(num::PI * (t / 3.5).clamp(0.0, 1.0)));
    Box::new(move |t| {
        let s_m = from_m + 8.0 * (t - 2.0);
        line.at(s_m) + Vec2::from_heading(line.heading_at(s_m)).left() * left_m(t)
    })
}

#[test]
fn a_car_that_turns_round_over_a_barrier_is_caught_by_its_place_alone_and_where_none_stands_it_is_not() {
    is_caught_by_its_place(&shares(divided(), AgentKind::Vehicle, turns_round));
    is_caught_by_its_place(&shares(divided(), AgentKind::Cyclist, turns_round));
    let open = |place: &Place| Place {
        scene: Scene {
            road: evodrive::scene::Road { edges: vec![], ..place.scene.road.clone() },
            ..place.scene.clone()
        },
        ..*place
    };
    let open: Vec<Place> = divided().iter().map(open).collect();
    let shares = |places, motion: fn(&Place) -> Way<'_>| shares(places, AgentKind::Vehicle, motion)[PLACE];
    assert_eq!(shares(&open, turns_round), 0.0);
    assert_eq!(shares(divided(), changes_lane), 0.0, "beside the barrier");
}

#[test]
fn who_follows_a_recording_that_goes_across_is_excused_as_far_as_the_recording_goes() {
    let place = &divided()[0];
    let (mut scene, way, from_step) = (place.scene.clone(), turns_round(place), place.scene.ego.start_step + 1);
    let at = |k: usize, share: f64| {
        let t = (k as f64 - from_step as f64) * DT_S;
        let (now, next) = (way(t), way(t + DT_S));
        let heading_rad = (next - now).heading();
        // Of the way across only a share, the rest along the lane.
        let aside = (now - place.at).dot(ahead(place).left());
        let position = now - ahead(place).left() * ((1.0 - share) * aside);
        Sample { position, heading_rad, velocity: (next - now) * (1.0 / DT_S) }
    };
    let samples = |share: f64| (0..scene.steps).map(|k| at(k, share)).collect::<Vec<Sample>>();
    let (recorded, farther) = (samples(0.75), samples(1.0));
    let track = scene.tracks.len();
    let motion = |samples: &[Sample]| samples[from_step..].to_vec();
    let recorded_too = recorded.iter().copied().map(Some).collect();
    let (kind, id) = (AgentKind::Vehicle, "turns".to_string());
    scene.tracks.push(Track { id, kind, length_m: 4.6, width_m: 1.9, samples: recorded_too });
    let plant = prepared(&scene);
    let found = |samples: Vec<Sample>, follows: bool| {
        let action = if follows {
            Action::Follow { track, from_step, samples }
        } else {
            Action::Insert { kind, length_m: 4.6, width_m: 1.9, from_step, samples }
        };
        let act = Intervention { actions: vec![action] };
        let outcome = rollout(&plant, &act, Policy::Replay.driver().as_mut()).unwrap();
        realism(&outcome, &options_of_place()).0[PLACE]
    };
    assert_eq!(found(motion(&recorded), false), 0.0, "nothing excuses somebody new");
    assert_eq!(found(motion(&recorded), true), 1.0);
    assert!(found(motion(&farther), true) < 1.0, "farther than its recording");
}

#[test]
fn a_car_that_crosses_the_median_of_a_generated_motorway_is_caught() {
    // Straight across to the lanes of the other carriageway, over a median of 6 m.
    let beside_it = |_: &Scene, lane: &Lane| lane.left_neighbours.is_empty() && !lane.right_neighbours.is_empty();
    let highways = worlds(&[WorldKind::Highway], 8, Seed(13), SCENES);
    let places: Vec<Place> = highways.into_iter().filter_map(|scene| place(scene, beside_it)).collect();
    let goes =
        |place: &Place| played(place, AgentKind::Vehicle, |t| place.at + ahead(place).left() * (7.0 * t.max(0.0)));
    let options = options_of_place();
    let found = places.iter().map(|place| realism(&goes(place), &options).0[PLACE]);
    let found: Vec<f64> = found.collect();
    let caught = found.iter().filter(|d| **d <= CAUGHT).count();
    println!("{caught} of {}", found.len());
    assert!(found.len() >= 15 && caught as f64 >= SHARE * found.len() as f64, "{found:?}");
}

#[test]
fn an_outcome_that_was_not_asked_says_nothing_of_places() {
    let place = &lanes(LaneKind::Freeway)[0];
    let stands = Sample { position: place.at, heading_rad: place.heading_rad, velocity: Vec2::ZERO };
    let from_step = place.scene.ego.start_step + 1;
    let kind = AgentKind::Pedestrian;
    let action = Action::Insert { kind, length_m: 0.6, width_m: 0.6, from_step, samples: vec![stands; STEPS] };
    let act = Intervention { actions: vec![action] };
    for of_kind in [false, true] {
        let options = SimulatorOptions { of_kind, ..SimulatorOptions::SHIPPED };
        let plant = Plant::with_options(PreparedScene::new(Arc::new(place.scene.clone())), &options).unwrap();
        let plain = rollout(&plant, &act, Policy::Idm.driver().as_mut()).unwrap();
        assert!(!serde_json::to_string(&plain).unwrap().contains("of_place"), "so its digest is what it always was");
        assert_eq!(realism(&plain, &options_of_kind()).0.get(PLACE), None);
        assert!(!serde_json::to_string(&options).unwrap().contains("of_place"), "and so is the rollout's key");
    }
}

fn of_account(of_place: Option<WithRecording<OfPlace>>) -> f64 {
    place_of_kind::ROW.value(&AdversaryReport { of_place, ..report() }, &limits())
}

fn d(simulated: OfPlace, recorded: Option<OfPlace>) -> f64 {
    of_account(Some(WithRecording { simulated, recorded }))
}

#[test]
fn only_what_goes_beyond_bound_and_own_recording_counts_and_the_worse_of_both() {
    let of = |motorway_s, across_m| OfPlace { motorway_s, across_m };
    assert_eq!(d(of(0.0, 0.5), None), 1.0);
    assert!((d(of(0.1, 0.0), None) - 2.0 / 3.0).abs() < 1e-9);
    assert!((d(of(0.1, 1.25), None) - 0.25).abs() < 1e-9, "0.75 m beyond the bound is the worse");
    assert!((d(of(0.0, 1.25), Some(of(0.0, 1.0))) - 0.75).abs() < 1e-9, "its recording goes across by 1 m");
    assert_eq!(of_account(None), 1.0);
}

/// Returns what recorded road users lose by their place, judged as if they had been generated: by kind their number, how many lose
/// anything, the largest of both quantities, and the mean penalty in percent.
fn lost(scenes: &[Scene]) -> BTreeMap<AgentKind, (usize, usize, f64, f64, f64)> {
    let weight = BTreeMap::from_iter(options_of_place().weights())[PLACE];
    let mut all: BTreeMap<AgentKind, (usize, usize, f64, f64, f64)> = BTreeMap::new();
    for scene in scenes {
        let plant = prepared(scene);
        for track in (0..scene.tracks.len()).filter(|track| moves(scene, *track)) {
            let found = plant.recorded_of_place(track);
            let row = all.entry(scene.tracks[track].kind).or_default();
            let lost = 1.0 - d(found, None);
            *row = (
                row.0 + 1,
                row.1 + usize::from(lost > 0.0),
                row.2.max(found.motorway_s),
                row.3.max(found.across_m),
                row.4 + 100.0 * weight * lost,
            );
        }
    }
    all.into_iter().map(|(kind, row)| (kind, (row.0, row.1, row.2, row.3, row.4 / row.0 as f64))).collect()
}

/// A scene with an edge along every border of its carriageways, outside junctions, so that recordings whose maps have none are measured,
/// too.
fn with_kerbs(scene: &Scene) -> Scene {
    let (mut scene, graph) = (scene.clone(), LaneGraph::of(&scene.road));
    let road = &mut scene.road;
    let single = |of: &[usize], links: fn(&Lane) -> &[usize]| {
        of.len() <= 1 && of.iter().all(|ix| links(&road.lanes[*ix]).len() <= 1)
    };
    let outside = |lane: &&Lane| single(&lane.exits, |l| &l.entries) && single(&lane.entries, |l| &l.exits);
    let mut edges = Vec::new();
    for lane in road.lanes.iter().filter(outside) {
        for (line, side) in [(&lane.left, 1.0), (&lane.right, -1.0)] {
            let is_border = |two: &[Vec2]| {
                let out = (two[1] - two[0]).left() * (side * 0.3 / two[1].distance(two[0]).max(1e-9));
                graph.off_road_m(two[0].lerp(two[1], 0.5) + out) > 0.0
            };
            let pieces = line.windows(2).filter(|two| is_border(two));
            edges.extend(pieces.map(|two| two.to_vec()));
        }
    }
    road.edges.extend(edges);
    scene
}

#[test]
fn recorded_traffic_is_where_it_belongs() {
    let mut seen = BTreeMap::<AgentKind, usize>::new();
    for (folder, name) in [("commonroad", ".xml"), ("ngsim_commonroad", ".xml"), ("scenarionet_nuscenes", "")] {
        let Some(folder) = shared(&format!("data/{folder}")) else { continue };
        let scenes = import_files(&crate::harness::files(&folder, name)).scenes;
        let kerbs: Vec<Scene> = scenes.iter().map(with_kerbs).collect();
        for (which, scenes) in [("as recorded", &scenes), ("with kerbs", &kerbs)] {
            let edges: usize = scenes.iter().map(|scene| scene.road.edges.len()).sum();
            for (kind, row) in lost(scenes) {
                println!("{} {which}, {edges} edges: {kind:?} {row:?}", folder.display());
                assert!(row.4 <= 0.5, "{kind:?}: {row:?}");
                *seen.entry(kind).or_default() += row.0;
            }
        }
    }
    assert!(seen.is_empty() || seen[&AgentKind::Vehicle] > 50, "{seen:?}");
}

#[test]
fn generated_traffic_of_every_world_is_where_it_belongs() {
    let kinds = WorldKind::ALL;
    let rows = lost(&worlds(&kinds, 8, Seed(13), SCENES));
    println!("{rows:?}");
    let row = rows[&AgentKind::Vehicle];
    assert!(row.0 > 100 && row.1 == 0, "they turn at junctions, merge and change lanes: {row:?}");
}
