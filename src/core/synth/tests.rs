//! Tests of whole scenes: properties that every generated log must have.

use super::*;
use crate::kernel::{Digest, OrientedBox, Pose, num};
use crate::scene::{AgentKind, DT_S, Lane, LaneGraph, LightState, Neighbour, Sample, Track};
use proptest::prelude::*;

pub(crate) fn options() -> SynthOptions {
    crate::scene::fixture::worlds()
}

/// Traffic that varies from scene to scene.
fn varied() -> SynthOptions {
    let traffic = TrafficOptions {
        users: [10.0, 60.0],
        room: [0.4, 1.0],
        range_m: [60.0, 120.0],
        lanes: [0.0, 3.0],
        limit: [0.6, 1.0],
        pedals_mps2: [0.5, 1.5],
        weave_m: [0.1, 0.6],
        place_m: [0.1, 0.4],
        haste: [0.1, 0.2],
        pace: [0.8, 1.6],
        headway: [0.5, 1.2],
    };
    SynthOptions { traffic: Some(Box::new(traffic)), attempts_max: 200, ..options() }
}

fn plain_scenes() -> Vec<Scene> {
    pool(&options(), Seed(11), 33).unwrap()
}

/// Scenes of either version.
fn few_scenes() -> Vec<Scene> {
    plain_scenes().into_iter().chain(pool(&varied(), Seed(11), 33).unwrap()).collect()
}

fn everyone(scene: &Scene) -> impl Iterator<Item = &Track> {
    scene.tracks.iter().chain([&scene.ego.track])
}

#[test]
fn every_kind_gives_a_scene_with_an_id_of_its_own() {
    let mut ids = std::collections::BTreeSet::new();
    for (i, scene) in plain_scenes().iter().enumerate() {
        let kind = WorldKind::ALL[i % WorldKind::ALL.len()];
        assert_eq!(scene.id, format!("synth/{}/11/{}", kind.name(), i / WorldKind::ALL.len()));
        assert!(ids.insert(scene.id.clone()), "{} twice", scene.id);
        let tracks = scene.tracks.len() + 1;
        assert!((25..=75).contains(&tracks), "{}: {tracks} tracks", scene.id);
    }
}

#[test]
fn no_two_road_users_overlap_in_any_log() {
    for scene in few_scenes() {
        let tracks: Vec<Track> = everyone(&scene).cloned().collect();
        for step in 0..scene.steps {
            assert_eq!(record::overlap_at(&tracks, step), None, "{} step {step}", scene.id);
        }
    }
}

#[test]
fn the_first_attempt_seldom_breaks_the_laws_of_motion() {
    // The filter would hide a simulator that collides; this looks at what it has to filter.
    let options = options();
    let (mut bad, mut all) = (Vec::new(), 0);
    for kind in WorldKind::ALL {
        for index in 0..8 {
            let path = ["test".to_string(), kind.name().to_string(), index.to_string(), "0".to_string()];
            let variation = options.variation(kind, Seed(5), index);
            let net = worlds::lay_world(kind, &options, variation, &mut stream(Seed(5), &path, "world"));
            let mut traffic = Traffic::new(&net, kind, &options, variation, Seed(5), &path);
            let log = record::record(&mut traffic, &options);
            all += 1;
            if let Err(reject) = record::consistent(&log, &options) {
                bad.push((kind, index, reject));
            }
        }
    }
    assert!(bad.len() * 20 <= all, "{bad:?} of {all}");
}

#[test]
fn nobody_speeds_up_brakes_jerks_or_turns_beyond_what_a_driver_can() {
    for scene in few_scenes() {
        for track in everyone(&scene).filter(|t| t.kind != AgentKind::Pedestrian) {
            let mut last: Option<f64> = None;
            for pair in track.samples.windows(2) {
                let [Some(a), Some(b)] = pair else { continue };
                let place = format!("{} {}", scene.id, track.id);
                let acceleration = (b.speed_mps() - a.speed_mps()) / DT_S;
                assert!((-7.5..=3.5).contains(&acceleration), "{place}: {acceleration} m/s2");
                let yaw_rate = num::wrap_angle(b.heading_rad - a.heading_rad) / DT_S;
                assert!(yaw_rate.abs() <= 1.0, "{place}: {yaw_rate} rad/s");
                let sideways = yaw_rate * a.speed_mps();
                assert!(sideways.abs() <= 5.0, "{place}: {sideways} m/s2 sideways");
                if let Some(before) = last {
                    let jerk = (acceleration - before) / DT_S;
                    // Coming to a stand ends the braking at once, as stops do.
                    assert!(jerk.abs() <= 25.0 || b.speed_mps() < 1.0, "{place}: {jerk} m/s3");
                }
                last = Some(acceleration);
            }
        }
    }
}

#[test]
fn positions_headings_and_velocities_agree() {
    for scene in few_scenes() {
        for track in everyone(&scene) {
            for pair in track.samples.windows(2) {
                let [Some(a), Some(b)] = pair else { continue };
                let moved = b.position - a.position;
                let expected = (a.velocity + b.velocity) * (0.5 * DT_S);
                assert!(
                    (moved - expected).norm() < 0.04,
                    "{} {}: moved {moved:?}, expected {expected:?}",
                    scene.id,
                    track.id
                );
                if a.speed_mps() > 1.0 {
                    let slip = num::wrap_angle(a.velocity.heading() - a.heading_rad);
                    assert!(slip.abs() < 1e-6, "{} {}: {slip}", scene.id, track.id);
                }
            }
        }
    }
}

#[test]
fn the_ego_travels_and_the_marked_vehicle_comes_near_it() {
    for scene in few_scenes() {
        let travel = crate::kernel::Polyline::new(scene.ego.route.clone()).unwrap().length_m();
        assert!(travel >= 9.5, "{}: {travel} m", scene.id);
        let [marked] = scene.objects_of_interest[..] else { panic!("{}: one marked vehicle", scene.id) };
        let (ego, other) = (&scene.ego.track, &scene.tracks[marked]);
        assert_eq!(other.kind, AgentKind::Vehicle);
        assert!(other.at(scene.current_step).is_some() && ego.at(scene.current_step).is_some());
        let shape =
            |t: &Track, k: usize| t.at(k).map(|s| OrientedBox::new(s.position, s.heading_rad, t.length_m, t.width_m));
        let nearest = (scene.current_step..scene.steps)
            .filter_map(|k| Some(shape(ego, k)?.distance(&shape(other, k)?)))
            .fold(f64::INFINITY, f64::min);
        assert!(nearest <= options().interaction_gap_m_max && nearest > 0.0, "{}: {nearest} m", scene.id);
    }
}

#[test]
fn most_marked_vehicles_cross_merge_or_cut_in_rather_than_follow() {
    let scenes = few_scenes();
    let from_elsewhere = |scene: &&Scene| {
        let pair = [scene.ego.track.clone(), scene.tracks[scene.objects_of_interest[0]].clone()];
        interaction::choose(&pair, &options(), false).is_ok()
    };
    let found = scenes.iter().filter(from_elsewhere).count();
    assert!(2 * found > scenes.len(), "{found} of {}", scenes.len());
}

#[test]
fn nobody_passes_a_stop_line_at_red() {
    let mut passed_at_green = 0;
    for i in 0..12 {
        for kind in [WorldKind::SignalledCrossing, WorldKind::SignalledTee, WorldKind::Urban] {
            let scene = generate(kind, Seed(21), i, &options()).unwrap();
            for light in &scene.lights {
                let lane = &scene.road.lanes[light.lane];
                let end = lane.centre[lane.centre.len() - 1];
                let along = (end - lane.centre[lane.centre.len() - 2]).heading();
                let line = crate::kernel::Pose { position: light.stop_point, heading_rad: along };
                for track in everyone(&scene).filter(|t| t.kind != AgentKind::Pedestrian) {
                    for k in 1..scene.steps {
                        let (Some(a), Some(b)) = (track.at(k - 1), track.at(k)) else { continue };
                        let front = |s: &crate::scene::Sample| {
                            let tip = crate::kernel::Vec2::from_heading(s.heading_rad) * (0.5 * track.length_m);
                            line.to_local(s.position + tip)
                        };
                        let (from, to) = (front(a), front(b));
                        let along_lane = num::wrap_angle(a.heading_rad - along).abs() < 0.5;
                        if from.x < 0.0 && to.x >= 0.0 && from.y.abs() < 1.7 && along_lane {
                            assert_ne!(light.states[k - 1], LightState::Stop, "{} {} step {k}", scene.id, track.id);
                            passed_at_green += 1;
                        }
                    }
                }
            }
        }
    }
    assert!(passed_at_green > 20, "only {passed_at_green} cars passed a line: the test sees nothing");
}

#[test]
fn every_stop_sign_is_obeyed() {
    let mut passed = 0;
    for i in 0..8 {
        let long = SynthOptions { steps: 300, ..options() };
        let scene = generate(WorldKind::UnsignalledCrossing, Seed(4), i, &long).unwrap();
        for sign in &scene.stop_signs {
            let centre = &scene.road.lanes[sign.lanes[0]].centre;
            let along = (centre[centre.len() - 1] - centre[centre.len() - 2]).heading();
            let line = crate::kernel::Pose { position: sign.position, heading_rad: along };
            for track in everyone(&scene).filter(|t| t.kind != AgentKind::Pedestrian) {
                let place = |k: usize| {
                    let s = track.at(k)?;
                    let aligned = num::wrap_angle(s.heading_rad - along).abs() < 0.5;
                    let local = line.to_local(s.position);
                    (aligned && local.y.abs() < 1.7).then_some((local.x + 0.5 * track.length_m, s.speed_mps()))
                };
                let Some((start, _)) = place(0).filter(|p| p.0 < -12.0) else { continue };
                let crossed = (0..scene.steps).find(|&k| place(k).is_some_and(|p| p.0 > 1.0));
                let Some(crossed) = crossed else { continue };
                let slowest =
                    (0..crossed).filter_map(place).filter(|p| p.0 > -4.0).map(|p| p.1).fold(f64::INFINITY, f64::min);
                assert!(slowest < 0.45, "{} {} from {start}: slowest {slowest}", scene.id, track.id);
                passed += 1;
            }
        }
    }
    assert!(passed > 5, "only {passed} cars passed a sign: the test sees nothing");
}

#[test]
fn topology_and_lines_are_those_of_a_valid_road() {
    for scene in few_scenes() {
        let lanes = &scene.road.lanes;
        for (i, lane) in lanes.iter().enumerate() {
            assert!(lane.centre.len() >= 2);
            assert_eq!((lane.centre.len(), lane.centre.len()), (lane.left.len(), lane.right.len()));
            assert!(lane.centre.iter().chain(&lane.left).chain(&lane.right).all(|p| p.is_finite()));
            for &next in &lane.exits {
                assert!(lanes[next].entries.contains(&i));
                let gap = lane.centre[lane.centre.len() - 1].distance(lanes[next].centre[0]);
                assert!(gap < 1e-6, "{} lane {i} -> {next}: {gap} m apart", scene.id);
            }
            for &before in &lane.entries {
                assert!(lanes[before].exits.contains(&i));
            }
            for (beside, back) in [
                (&lane.left_neighbours, (|l: &Lane| &l.right_neighbours) as fn(&Lane) -> &Vec<Neighbour>),
                (&lane.right_neighbours, |l: &Lane| &l.left_neighbours),
            ] {
                for n in beside.iter().filter(|n| n.same_direction) {
                    assert_eq!(back(&lanes[n.lane]).iter().map(|b| b.lane).collect::<Vec<_>>(), [i]);
                }
            }
        }
        assert!(scene.lights.iter().all(|light| light.states.len() == scene.steps));
        assert!(everyone(&scene).all(|track| track.samples.len() == scene.steps && track.span().is_some()));
    }
}

#[test]
fn every_scene_is_valid_and_usable() {
    for scene in few_scenes() {
        let broken: Vec<String> = scene.validate().iter().take(5).map(|v| v.to_string()).collect();
        assert!(broken.is_empty(), "{}: {broken:#?}", scene.id);
        crate::scene::usable(&scene).unwrap_or_else(|why| panic!("{}: {why}", scene.id));
    }
}

#[test]
fn the_same_seed_gives_the_same_scene_and_another_index_another() {
    let scene = |seed, index| generate(WorldKind::Roundabout, Seed(seed), index, &options()).unwrap();
    assert_eq!(scene(3, 0), scene(3, 0));
    assert_ne!(scene(3, 0).ego, scene(3, 1).ego);
    assert_ne!(scene(3, 0).ego, scene(4, 0).ego);
}

#[test]
fn the_bits_of_a_generated_scene_are_pinned() {
    let scene = generate(WorldKind::Urban, Seed(7), 0, &options()).unwrap();
    assert_eq!(Digest::of("evodrive/test/synth", &scene).unwrap().to_hex(), PINNED);
}

// If this value changes and no field of a scene was renamed, every generated pool changes, and every result on one.
const PINNED: &str = "75f933bd3dd0ed5e7e914ac5074897f90425b42cba21dcbca2f1d8b9081324f2";

#[test]
fn varied_traffic_varies_in_number_and_reach_and_drivers_leave_the_middle_of_their_lanes() {
    let scenes = pool(&varied(), Seed(4), 22).unwrap();
    let numbers: Vec<usize> = scenes.iter().map(|scene| scene.tracks.len()).collect();
    let (least, most) = (numbers.iter().min().unwrap(), numbers.iter().max().unwrap());
    assert!(*most >= 3 * *least, "{numbers:?}");
    let mut aside_m = Vec::new();
    for scene in &scenes {
        let lanes = LaneGraph::of(&scene.road);
        for (at, track) in scene.tracks.iter().enumerate() {
            let away = |step: usize| Some(track.at(step)?.position.distance(scene.ego.track.at(step)?.position));
            let nearest = (0..scene.steps).filter_map(away).fold(f64::INFINITY, f64::min);
            let is_marked = scene.objects_of_interest.contains(&at);
            assert!(nearest <= 120.0 || is_marked, "{} {}: {nearest} m", scene.id, track.id);
            let (Some(sample), AgentKind::Vehicle) = (track.at(scene.current_step), track.kind) else { continue };
            let place = lanes.nearest_lane_any_heading(sample.position, 2.0);
            aside_m.extend(place.map(|place| place.offset_m.abs()));
        }
    }
    let mean = num::mean(&aside_m).unwrap();
    assert!((0.15..0.8).contains(&mean), "{mean} m beside the middle of lanes, on average");
}

/// A bound of traffic: its name, a kind of world that shows it, its setter, a value for less of its effect and one for more,
/// and the measure of the effect.
type Knob = (&'static str, WorldKind, fn(&mut TrafficOptions, [f64; 2]), [f64; 2], fn(&[Scene]) -> f64);

const KNOBS: [Knob; 11] = [
    ("users", WorldKind::Straight, |of, both| of.users = both, [15.0, 60.0], tracks),
    ("room", WorldKind::Straight, |of, both| of.room = both, [0.4, 1.5], next_ahead_m),
    ("range_m", WorldKind::Straight, |of, both| of.range_m = both, [40.0, 1000.0], tracks),
    (
        "lanes",
        WorldKind::Straight,
        |of, both| of.lanes = both,
        [0.0, 3.0],
        |scenes| mean(scenes.iter().map(|scene| scene.road.lanes.len() as f64)),
    ),
    ("limit", WorldKind::Straight, |of, both| of.limit = both, [0.5, 1.0], |scenes| mean(speeds(scenes))),
    (
        "pedals_mps2",
        WorldKind::Straight,
        |of, both| of.pedals_mps2 = both,
        [0.0, 1.5],
        |scenes| {
            mean(gains(scenes).flat_map(|gains| gains.windows(2).map(|of| (of[1] - of[0]).abs()).collect::<Vec<_>>()))
        },
    ),
    ("weave_m", WorldKind::Straight, |of, both| of.weave_m = both, [0.0, 0.5], aside_m),
    ("place_m", WorldKind::Straight, |of, both| of.place_m = both, [0.0, 0.4], aside_m),
    (
        "haste",
        WorldKind::Straight,
        |of, both| (of.haste, of.room) = (both, [3.0; 2]),
        [0.0, 0.3],
        |scenes| {
            // Limits differ from scene to scene.
            mean(scenes.iter().map(|scene| {
                let middle = mean(speeds(std::slice::from_ref(scene)));
                mean(speeds(std::slice::from_ref(scene)).map(|speed| (speed - middle).abs()))
            }))
        },
    ),
    (
        "pace",
        WorldKind::UnsignalledCrossing,
        |of, both| of.pace = both,
        [0.4, 2.0],
        |scenes| mean(gains(scenes).map(|gains| gains.into_iter().fold(0.0, f64::max))),
    ),
    ("headway", WorldKind::Straight, |of, both| of.headway = both, [0.4, 3.0], next_ahead_m),
];

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    num::mean(&values.collect::<Vec<f64>>()).unwrap()
}

fn tracks(scenes: &[Scene]) -> f64 {
    mean(scenes.iter().map(|scene| scene.tracks.len() as f64))
}

/// Returns the mean distance from each road user to the next one ahead in its strip, where one is within 80 m.
fn next_ahead_m(scenes: &[Scene]) -> f64 {
    mean(scenes.iter().flat_map(|scene| {
        let now: Vec<&Sample> = everyone(scene).filter_map(|track| track.at(scene.current_step)).collect();
        let next = |of: &&Sample| {
            let pose = Pose { position: of.position, heading_rad: of.heading_rad };
            let ahead = now.iter().map(|other| pose.to_local(other.position));
            let ahead = ahead.filter(|at| at.x > 0.5 && at.x < 80.0 && at.y.abs() < 1.5);
            ahead.map(|at| at.x).reduce(f64::min)
        };
        now.iter().filter_map(next).collect::<Vec<f64>>()
    }))
}

fn vehicles(scenes: &[Scene]) -> impl Iterator<Item = (&Scene, Vec<&Sample>)> {
    let of = |scene| everyone(scene).filter(|track| track.kind == AgentKind::Vehicle).map(move |track| (scene, track));
    scenes.iter().flat_map(of).map(|(scene, track)| (scene, track.samples.iter().flatten().collect()))
}

fn aside_m(scenes: &[Scene]) -> f64 {
    mean(vehicles(scenes).filter_map(|(scene, samples)| {
        let place = LaneGraph::of(&scene.road).nearest_lane_any_heading(samples[0].position, 2.0)?;
        Some(place.offset_m.abs())
    }))
}

fn speeds(scenes: &[Scene]) -> impl Iterator<Item = f64> {
    vehicles(scenes).map(|(_, samples)| mean(samples.iter().map(|sample| sample.speed_mps())))
}

/// Returns, for each vehicle, the changes of its speed step by step, m/s.
fn gains(scenes: &[Scene]) -> impl Iterator<Item = Vec<f64>> {
    let gain = |pair: &[&Sample]| pair[1].speed_mps() - pair[0].speed_mps();
    vehicles(scenes).map(move |(_, samples)| samples.windows(2).map(gain).collect())
}

#[test]
fn each_bound_of_traffic_gives_more_of_what_it_says() {
    let even = TrafficOptions {
        users: [30.0; 2],
        room: [1.0; 2],
        range_m: [1000.0; 2],
        lanes: [0.0; 2],
        limit: [1.0; 2],
        pedals_mps2: [0.0; 2],
        weave_m: [0.0; 2],
        place_m: [0.0; 2],
        haste: [0.1; 2],
        pace: [1.0; 2],
        headway: [1.0; 2],
    };
    for (name, kind, set, ends, measure) in KNOBS {
        let [less, more] = ends.map(|end| {
            let mut traffic = even;
            set(&mut traffic, [end; 2]);
            let options = SynthOptions { kinds: vec![kind], traffic: Some(Box::new(traffic)), ..varied() };
            measure(&pool(&options, Seed(5), 12).unwrap())
        });
        assert!(more > 1.1 * less, "{name}: {less} at {}, {more} at {}", ends[0], ends[1]);
    }
}

#[test]
fn a_kind_that_is_named_twice_comes_twice_a_turn_and_each_scene_once() {
    let kinds = vec![WorldKind::Merge, WorldKind::Straight, WorldKind::Merge];
    let scenes = pool(&SynthOptions { kinds, ..options() }, Seed(1), 6).unwrap();
    let ids: Vec<&str> = scenes.iter().map(|scene| scene.id.as_str()).collect();
    let expected = ["merge/1/0", "straight/1/0", "merge/1/1", "merge/1/2", "straight/1/1", "merge/1/3"];
    assert_eq!(ids, expected.map(|id| format!("synth/{id}")));
}

#[test]
fn bounds_of_traffic_that_are_none_are_refused_by_name() {
    let with = |change: fn(&mut TrafficOptions)| {
        let mut options = varied();
        options.traffic.iter_mut().for_each(|of| change(of));
        options.check().unwrap_err().to_string()
    };
    assert!(with(|of| of.room = [0.9, 0.4]).contains("traffic.room"));
    assert!(with(|of| of.pedals_mps2 = [0.0, f64::NAN]).contains("traffic.pedals_mps2"));
    assert!(with(|of| of.range_m = [1.0, 50.0]).contains("traffic.range_m"));
}

#[test]
fn small_and_large_scenes_have_about_as_many_tracks_as_asked_for() {
    for users in [10, 100, 1000] {
        for kind in [WorldKind::Straight, WorldKind::SignalledCrossing, WorldKind::Highway] {
            let scene = generate(kind, Seed(2), 0, &SynthOptions { tracks_per_scene: users, ..options() }).unwrap();
            let found = scene.tracks.len() + 1;
            assert!(10 * found >= 6 * users && 10 * found <= 20 * users, "{}: {found} of {users}", scene.id);
        }
    }
}

#[test]
fn a_filter_that_nothing_passes_ends_in_an_error_that_says_so() {
    let hard = SynthOptions { ego_travel_m_min: 1e6, attempts_max: 2, ..options() };
    let error = generate(WorldKind::Straight, Seed(1), 0, &hard).unwrap_err();
    assert!(matches!(error, SynthError::Filtered { attempts: 2, last: Reject::NoEgo, .. }), "{error}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    #[test]
    fn no_seed_and_no_size_makes_it_panic(
        seed in any::<u64>(), index in any::<u32>(), kind in 0..WorldKind::ALL.len(),
        users in 4usize..60, steps in 20usize..60, feet in 0.0..0.5f64, wheels in 0.0..0.5f64,
    ) {
        let asked = SynthOptions {
            tracks_per_scene: users, steps, pedestrian_share: feet, cyclist_share: wheels, warm_up_s: 4.0,
            attempts_max: 3, ..options()
        };
        if let Ok(scene) = generate(WorldKind::ALL[kind], Seed(seed), index, &asked) {
            prop_assert!(everyone(&scene).flat_map(|t| t.samples.iter().flatten())
                .all(|s| s.position.is_finite() && s.velocity.is_finite() && s.heading_rad.is_finite()));
        }
    }

    #[test]
    fn absurd_options_are_refused(steps in 1201usize.., users in 2001usize..) {
        let cases = [
            SynthOptions { steps, ..options() },
            SynthOptions { tracks_per_scene: users, ..options() },
            SynthOptions { warm_up_s: f64::NAN, ..options() },
        ];
        for asked in cases {
            prop_assert!(asked.check().is_err());
        }
    }
}
