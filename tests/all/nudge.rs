//! The cheapest way to win attack: the ego runs into somebody in plain replay anyway, and a program pushes that very vehicle
//! a little aside. It acts, its motion is perfectly realistic, and the contact is as it was.

use evodrive::ego::Policy;
use evodrive::evaluation::metrics::attack::attack;
use evodrive::evaluation::{EvaluationOptions, MetadriveOptions, RolloutRecord, Written, scene_score};
use evodrive::kernel::{Digest, Vec2};
use evodrive::scene::Sample;
use evodrive::sim::{Action, ActorRef, Intervention, rollout_assessed};

use crate::worlds;

/// Most scenes looked at: the ego runs into somebody in about one of thirteen, and one in five of those would be credited.
const SCENES_MAX: usize = 400;
/// Enough that would be credited.
const TEMPTING: usize = 3;

fn options() -> MetadriveOptions {
    let mut evaluation = worlds::protocol()["evaluation"].as_table().expect("a table").clone();
    let calibration = include_str!("../../experiments/calibration/recorded.toml").parse().expect("TOML");
    let realism = evaluation.get_mut("realism").and_then(toml::Value::as_table_mut).expect("a table");
    realism.insert("calibration".into(), toml::Value::Table(calibration));
    let EvaluationOptions::Metadrive(options) = toml::Value::Table(evaluation).try_into().expect("options") else {
        unreachable!("the protocol is MetaDrive's")
    };
    options
}

/// The recording of a track from a step on, moved 0.3 m to its left within three seconds.
fn nudged(recorded: impl Iterator<Item = Sample>) -> Vec<Sample> {
    let aside = |(k, sample): (usize, Sample)| {
        let left = Vec2::from_heading(sample.heading_rad).left();
        Sample { position: sample.position + left * (0.3 * (k as f64 / 30.0).min(1.0)), ..sample }
    };
    recorded.enumerate().map(aside).collect()
}

#[test]
fn who_nudges_whom_the_ego_hits_anyway_gains_no_attack() {
    let options = options();
    let (mut tried, mut tempting) = (0, 0);
    for situation in worlds::prepared(&worlds::options(), 500).take(SCENES_MAX) {
        if tempting >= TEMPTING {
            break;
        }
        let Some(ActorRef::Track(track)) = situation.ego_meets else { continue };
        let from_step = situation.first_step();
        let recorded = &situation.scene.tracks[track];
        let samples = nudged((from_step..situation.scene.steps).map_while(|step| recorded.at(step).copied()));
        if samples.len() < 10 {
            continue;
        }
        let intervention = Intervention { actions: vec![Action::Follow { track, from_step, samples }] };
        let outcome = rollout_assessed(&situation.plant, &intervention, &mut *Policy::Idm.driver()).unwrap();
        let mut record = RolloutRecord {
            scene: situation.scene.id.clone(),
            scene_digest: situation.digest(),
            program: Digest::of_bytes(b"nudge"),
            ego: "idm".into(),
            intervened: true,
            meets_anyway: situation.ego_meets,
            decision: Written::of(&()).unwrap(),
            outcome,
        };
        let label = |record: &RolloutRecord| {
            scene_score(record, Digest::of_bytes(b"request"), Digest::of_bytes(b"stored"), &options)
        };
        tried += 1;
        assert_eq!(label(&record).attack, 0.0, "{}", record.scene);
        // What the label would be if it did not know of plain replay.
        record.meets_anyway = None;
        tempting += usize::from(label(&record).acted && label(&record).attack > 0.0);
        assert!(label(&record).attack <= attack(&record.outcome, &options.attack));
    }
    assert!(tempting >= TEMPTING, "tried {tried}, tempting {tempting}: these scenes show nothing");
}
