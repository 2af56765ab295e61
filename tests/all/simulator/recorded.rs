//! The car's law of motion and the replay of logs against traffic that was really recorded. The recordings are not part
//! of the project; the tests say so when they are absent.

use crate::harness::{files, shared};
use crate::kernel::num;
use crate::scene::{AgentKind, DT_S, Sample, Scene, Track};
use crate::sim::bicycle::{Car, CorneringLoss, DEFAULT_LIMITS, Limits};
use crate::sim::body::SUBSTEPS;
use evodrive::formats::import_files;

/// The accelerations of a recording are what is left after all losses.
const LOSSLESS: Limits = Limits { cornering_loss: CorneringLoss::Steering { share: 0.0 }, ..DEFAULT_LIMITS };

/// Steps of a window.
const STEPS: usize = 20;
/// The car steers at the recording this many samples ahead, and makes errors along the way up in this time.
const LEAD_STEPS: usize = 5;
const CATCH_UP_S: f64 = 0.5;

fn recorded(folder: &str, part_of_name: &str) -> Vec<Scene> {
    let Some(path) = shared(&format!("data/{folder}")) else { return vec![] };
    let files = files(&path, part_of_name);
    let scenes = import_files(&files).scenes;
    assert!(!scenes.is_empty(), "no scene in the files *{part_of_name}* of data/{folder}");
    scenes
}

/// Returns `true` if a vehicle's samples move as a car's can: forward, along its heading, within the limits of speed.
fn drives(samples: &[Sample]) -> bool {
    samples.iter().all(|s| {
        let along = s.velocity.dot(crate::kernel::Vec2::from_heading(s.heading_rad));
        (2.0..DEFAULT_LIMITS.speed_mps).contains(&along)
    })
}

/// Windows of a track in which it drives: `STEPS` steps and the samples that are steered at beyond them.
fn windows(track: &Track) -> Vec<Vec<Sample>> {
    let whole = STEPS + LEAD_STEPS + 1;
    let from = (0..track.samples.len()).step_by(STEPS);
    let windows = from.map(|from| (from..from + whole).map_while(|k| track.at(k).copied()).collect::<Vec<_>>());
    windows.filter(|window| window.len() == whole && drives(window)).collect()
}

/// The recorded accelerations and yaw rates as throttle and steering, without another look at the recording: how far
/// the car is from it at the end of the window.
fn open_loop_m(length_m: f64, window: &[Sample]) -> f64 {
    let mut car = Car::new(&window[0], length_m);
    car.speed_mps = window[0].speed_mps();
    for pair in window[..=STEPS].windows(2) {
        let acceleration = (pair[1].speed_mps() - pair[0].speed_mps()) / DT_S;
        let way_m = 0.5 * (pair[0].speed_mps() + pair[1].speed_mps()) * DT_S;
        let curvature_1pm = num::wrap_angle(pair[1].heading_rad - pair[0].heading_rad) / way_m;
        car = car.drive(acceleration, car.steering_for(curvature_1pm), &LOSSLESS)[SUBSTEPS - 1];
    }
    car.position.distance(window[STEPS].position)
}

/// Throttle and steering worked out anew at each step from where the car is: how far it is from the recording at most.
fn followed_m(length_m: f64, window: &[Sample]) -> f64 {
    let mut car = Car::new(&window[0], length_m);
    let mut worst = 0.0f64;
    for k in 0..STEPS {
        let next = &window[k + 1];
        let missing_m = (next.position - car.position).dot(car.axis) - 0.5 * (car.speed_mps + next.speed_mps()) * DT_S;
        let acceleration = (next.speed_mps() + missing_m / CATCH_UP_S - car.speed_mps) / DT_S;
        let ahead = window[k + 1 + LEAD_STEPS].position - car.position;
        let curvature_1pm = 2.0 * car.axis.cross(ahead) / ahead.norm_squared().max(0.01);
        car = car.drive(acceleration, car.steering_for(curvature_1pm), &LOSSLESS)[SUBSTEPS - 1];
        worst = worst.max(car.position.distance(next.position));
    }
    worst
}

/// Median and 95th percentile over all windows of all vehicles.
fn errors_m(scenes: &[Scene], error_m: fn(f64, &[Sample]) -> f64) -> (usize, [f64; 2]) {
    let tracks = scenes.iter().flat_map(|s| s.tracks.iter().chain([&s.ego.track]));
    let vehicles = tracks.filter(|t| t.kind == AgentKind::Vehicle);
    let errors: Vec<f64> =
        vehicles.flat_map(|t| windows(t).into_iter().map(move |window| error_m(t.length_m, &window))).collect();
    (errors.len(), [0.5, 0.95].map(|q| num::quantile(&errors, q).unwrap()))
}

#[test]
fn recorded_vehicles_are_recovered_by_the_inverse_bicycle_driven_forward() {
    // NGSIM's US 101: velocities and headings fit the places. Two seconds without a look at the recording.
    let highway = recorded("commonroad", "US101");
    if !highway.is_empty() {
        let (count, [half, most]) = errors_m(&highway, open_loop_m);
        println!("US 101: {count} windows of 2 s driven blindly end {half:.2} m (median), {most:.2} m (95 %) off");
        assert!(count > 20 && half < 0.2 && most < 1.0);
    }
    // nuScenes' headings and velocities come from boxes drawn twice a second: blindly driven they lead elsewhere, but
    // the car can do what was done.
    for (folder, name) in [("commonroad", "USA_"), ("scenarionet_nuscenes", "")] {
        let scenes = recorded(folder, name);
        if scenes.is_empty() {
            continue;
        }
        let (count, [half, most]) = errors_m(&scenes, followed_m);
        println!("{folder}: {count} windows of 2 s followed within {half:.2} m (median), {most:.2} m (95 %)");
        assert!(count > 20 && half < 0.15 && most < 1.2);
    }
}

#[test]
fn a_recorded_scene_replays_to_its_log_and_to_no_contact_that_the_log_has_not() {
    for scene in recorded("scenarionet_nuscenes", "") {
        let touches = super::world::replays_to_itself(&scene);
        println!(
            "{}: {} steps replayed, the log {} a contact",
            scene.id,
            scene.steps,
            if touches { "has" } else { "has not" }
        );
        let plant = crate::sim::Plant::new(&scene).unwrap();
        let outcome =
            crate::sim::rollout(&plant, &Default::default(), &mut *crate::ego::Policy::Replay.driver()).unwrap();
        assert_eq!(outcome.contact.is_some(), touches, "{}: {:?}", scene.id, outcome.contact);
    }
}
