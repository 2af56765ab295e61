//! Untouched recorded traffic keeps its realism. The recordings are not part of the project; the tests say so when they
//! are absent.

use super::{options, played};
use crate::harness::{files, shared};
use evodrive::ego::Policy;
use evodrive::evaluation::calibrate::{calibrate, moves, observed};
use evodrive::evaluation::metrics::realism::{realism, realism_of};
use evodrive::formats::import_files;
use evodrive::kernel::Threads;
use evodrive::scene::Scene;
use evodrive::sim::Action;

/// The paper's order for mild methods, percent.
const PENALTY_PCT_MAX: f64 = 0.3;

fn recorded(folder: &str, part_of_name: &str) -> Vec<Scene> {
    let Some(folder) = shared(&format!("data/{folder}")) else { return vec![] };
    import_files(&files(&folder, part_of_name)).scenes
}

/// Rollouts in which a moving road user that is seen to the end follows its own log, as a program would make it.
fn untouched_penalty_pct(scenes: &[Scene]) -> (f64, usize) {
    let options = options();
    let mut all = Vec::new();
    for scene in scenes {
        let from_step = scene.ego.start_step + 1;
        for track in (0..scene.tracks.len()).filter(|track| moves(scene, *track)) {
            let samples: Vec<_> = (from_step..scene.steps).map_while(|k| scene.tracks[track].at(k).copied()).collect();
            if samples.len() + from_step < scene.steps || scene.tracks[track].at(from_step - 1).is_none() {
                continue;
            }
            let outcome = played(scene, Action::Follow { track, from_step, samples }, &Policy::Idm);
            assert!(!outcome.acted(), "{} track {track}", scene.id);
            all.push(100.0 * (1.0 - realism(&outcome, &options).1));
        }
    }
    (all.iter().sum::<f64>() / all.len().max(1) as f64, all.len())
}

#[test]
fn untouched_recorded_traffic_keeps_its_realism() {
    for (folder, name) in [("commonroad", "USA_"), ("scenarionet_nuscenes", "")] {
        let scenes = recorded(folder, name);
        if scenes.is_empty() {
            continue;
        }
        let (penalty_pct, count) = untouched_penalty_pct(&scenes);
        println!("{folder} {name}: RP {penalty_pct:.4} % of {count} road users that follow their log");
        assert!(count >= 10 && penalty_pct <= PENALTY_PCT_MAX, "{penalty_pct} % of {count}");
    }
}

/// The same without the road user's own recording as an excuse, which is how a motion that was generated from nothing is
/// judged: by the bounds of the other half of the road users.
#[test]
fn recorded_traffic_is_plausible_by_the_bounds_of_other_road_users() {
    let scenes = [recorded("commonroad", "USA_"), recorded("scenarionet_nuscenes", "")].concat();
    if scenes.is_empty() {
        return;
    }
    let all = observed(&scenes, &Threads::new(2).unwrap());
    let reports: Vec<_> = scenes
        .iter()
        .flat_map(|scene| {
            evodrive::evaluation::replay_row::recorded_reports(&evodrive::sim::Plant::new(scene).unwrap())
        })
        .collect();
    let mut penalties_pct = Vec::new();
    for half in 0..2 {
        let every_other: Vec<_> = all.iter().skip(half).step_by(2).copied().collect();
        let mut options = options();
        *options.calibration = calibrate(&every_other, 0.95, vec![], scenes.len()).unwrap();
        let known = |motion| every_other.iter().any(|o| o.motion == motion);
        let judged = reports.iter().filter(|report| !known(report.simulated));
        penalties_pct.extend(judged.map(|r| 100.0 * (1.0 - realism_of(std::slice::from_ref(r), &options).1)));
    }
    let mean_pct = penalties_pct.iter().sum::<f64>() / penalties_pct.len() as f64;
    println!("judged by other road users' bounds: RP {mean_pct:.3} % of {} vehicles", penalties_pct.len());
    assert!(penalties_pct.len() >= 100 && mean_pct <= 3.0, "{mean_pct}");
}
