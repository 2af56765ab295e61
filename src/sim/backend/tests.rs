//! Backends without processes: workers that are closures, our own simulator behind the protocol, cassettes.

use std::collections::{BTreeMap, VecDeque};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use super::*;
use crate::ego::Policy;
use crate::kernel::{Digest, Seed};
use crate::scene::{PreparedScene, Scene};
use crate::sim::scenes::{crossing, intercept};
use crate::sim::{Action, Intervention, Outcome, Plant, PlantOptions, SimulatorOptions, rollout_assessed};

type Said = Result<Vec<u8>, Broken>;

/// A worker that greets, and then answers each line by a closure.
struct Fake<F>(F, Mutex<usize>);

struct ReportedRollout<F> {
    said: VecDeque<Said>,
    answer: F,
}

impl<F: Fn(&str, usize) -> Vec<Said> + Clone + Send + Sync + 'static> Start for Fake<F> {
    fn start(&self, command: &[String]) -> Result<Box<dyn Line>, String> {
        if command[0] == "nowhere" {
            return Err("`nowhere` cannot be started".into());
        }
        let mut started = self.1.lock().unwrap();
        *started += 1;
        let (answer, times) = (self.0.clone(), *started);
        let said = answer("hello", times).into();
        Ok(Box::new(ReportedRollout { said, answer: move |line: &str| answer(line, times) }))
    }

    fn start_in(&self, command: &[String], _: &std::path::Path, _: &[(&str, &str)]) -> Result<Box<dyn Line>, String> {
        self.start(command)
    }
}

impl<F: Fn(&str) -> Vec<Said> + Send> Line for ReportedRollout<F> {
    fn send(&mut self, line: String) {
        self.said.extend((self.answer)(&line));
    }

    fn receive(&mut self, _: Duration) -> Said {
        self.said.pop_front().unwrap_or(Err(Broken::Late))
    }
}

fn own(law: &str, retries: u32) -> BackendOptions {
    let greeting: serde_json::Value = serde_json::from_slice(&hello()).unwrap();
    let text = |key: &str| greeting[key].as_str().unwrap().to_string();
    BackendOptions {
        name: text("backend"),
        version: text("version"),
        digest: text("digest").parse().unwrap(),
        options: BTreeMap::from([("plant".to_string(), law.into())]),
        plan_around: PlanAround::Backend,
        cassette: "rollouts.jsonl".into(),
        worker: WorkerOptions { command: vec!["own".into()], workers: 2, seconds: 1.0, retries, rollouts: None },
    }
}

/// Our own simulator, as it should be.
fn honest(line: &str) -> Vec<Said> {
    vec![Ok(if line == "hello" { hello() } else { serve(line.as_bytes()).unwrap() })]
}

fn plant(scene: &Scene, law: PlantOptions) -> Plant {
    let options = SimulatorOptions { plant: law, ..SimulatorOptions::SHIPPED };
    Plant::with_options(PreparedScene::new(Arc::new(scene.clone())), &options).unwrap()
}

/// Workers as answers, without a store.
struct Asking<'a>(Workers<'a>);

impl Answers for Asking<'_> {
    fn answer(&self, request: &Request<'_>) -> Result<Answer, BackendError> {
        self.0.ask(request)
    }
}

fn rollout(options: &BackendOptions, start: &dyn Start, scene: &Scene) -> Result<Outcome, NoOutcome> {
    let answers = Asking(Workers::new(options, start));
    let backend = Backend::Other { options, answers: &answers };
    backend.rollout(
        &plant(scene, PlantOptions::PHYSICAL),
        &intercept(scene, 5),
        &Policy::Idm,
        DriveContext::plain(Seed(1)),
    )
}

#[test]
fn our_own_simulator_behind_the_protocol_gives_its_own_outcomes_bit_for_bit() {
    let laws = [("physical", PlantOptions::PHYSICAL), ("metadrive-0.4.3", PlantOptions::METADRIVE_0_4_3)];
    let start = Fake(|line: &str, _| honest(line), Mutex::new(0));
    let mut contacts = 0;
    for seed in 0..60 {
        let scene = crossing(seed, 5 + (seed % 20) as usize, 91);
        let (name, law) = laws[seed as usize % 2];
        let policy = if seed.is_multiple_of(5) { Policy::Replay } else { Policy::Idm };
        let act = if seed.is_multiple_of(7) { Intervention::default() } else { intercept(&scene, seed as usize % 30) };
        let (options, plant) = (own(name, 0), plant(&scene, law));
        let answers = Asking(Workers::new(&options, &start));
        let backend = Backend::Other { options: &options, answers: &answers };
        let behind = backend.rollout(&plant, &act, &policy, DriveContext::plain(Seed(1))).unwrap();
        let before = rollout_assessed(&plant, &act, policy.driver().as_mut()).unwrap();
        assert_eq!(behind, before, "seed {seed}");
        contacts += usize::from(before.contact.is_some());
    }
    assert!(contacts > 15, "{contacts}");
}

#[test]
fn adversaries_that_react_are_commanded_what_they_did_against_our_own_ego() {
    let scene = crossing(4, 12, 91);
    let mut act = intercept(&scene, 5);
    let Some(Action::Follow { track, from_step, samples }) = act.actions.pop() else { panic!("an interception") };
    let short = samples[..10].to_vec();
    act.actions.push(Action::FollowThenReact { track, from_step, samples: short, handover_step: from_step + 12 });
    let plant = plant(&scene, PlantOptions::PHYSICAL);
    let lowered = super::lower::lowered(&plant, &act, &Policy::Idm).unwrap();
    let [Action::Follow { track: same, samples, .. }] = &lowered.actions[..] else { panic!("{lowered:?}") };
    assert!(*same == track && samples.len() > 10, "{} samples", samples.len());
    let (reacting, commanded) =
        [&act, &lowered].map(|act| rollout_assessed(&plant, act, Policy::Idm.driver().as_mut())).into();
    let (reacting, commanded) = (reacting.unwrap(), commanded.unwrap());
    assert_eq!((reacting.end, reacting.steps), (commanded.end, commanded.steps));
}

#[test]
fn a_worker_is_replaced_after_as_many_rollouts_as_declared() {
    let started = |rollouts: Option<u32>| {
        let mut options = own("physical", 0);
        (options.worker.workers, options.worker.rollouts) = (1, rollouts);
        let start = Fake(|line: &str, _| honest(line), Mutex::new(0));
        {
            let answers = Asking(Workers::new(&options, &start));
            let backend = Backend::Other { options: &options, answers: &answers };
            for seed in 0..7 {
                let scene = crossing(seed, 5, 91);
                let plant = plant(&scene, PlantOptions::PHYSICAL);
                let context = DriveContext::plain(Seed(1));
                backend.rollout(&plant, &Intervention::default(), &Policy::Idm, context).unwrap();
            }
        }
        start.1.into_inner().unwrap()
    };
    assert_eq!([None, Some(3), Some(7), Some(1)].map(started), [1, 3, 1, 7]);
}

/// Returns our own worker's answer to a request whose line was changed.
fn served(change: impl FnOnce(&mut serde_json::Value)) -> serde_json::Value {
    let scene = crossing(4, 12, 91);
    let (plant, act, options) = (plant(&scene, PlantOptions::PHYSICAL), intercept(&scene, 5), own("physical", 0));
    let request = Request::new(&options, &plant, &act, &Policy::Idm, DriveContext::plain(Seed(1))).unwrap();
    let mut line = serde_json::from_str(&request.line()).unwrap();
    change(&mut line);
    serde_json::from_slice(&serve(line.to_string().as_bytes()).unwrap()).unwrap()
}

#[test]
fn a_road_user_that_is_away_for_a_while_is_served_as_it_was_commanded() {
    let said = served(|line| {
        for k in 2..4 {
            line["adversaries"][0]["samples"][k] = serde_json::Value::Null;
        }
    });
    assert!(said.get("failure").is_none(), "{said}");
    let there = |k: usize| !said["road_users"][0]["poses"][k].is_null();
    assert_eq!([0, 1, 2, 3, 4].map(there), [true, true, false, false, true]);
}

#[test]
fn a_scene_that_breaks_a_rule_is_served_to_nobody() {
    let said = served(|line| line["scene"]["tracks"][0]["length_m"] = 1e6.into());
    let reason = said["failure"].as_str().unwrap_or_default();
    assert!(reason.contains("breaks a rule of a sound scene") && reason.contains("length"), "{said}");
}

#[test]
fn a_command_beyond_the_map_is_carried_out_for_nobody() {
    let said = served(|line| {
        let samples = &mut line["adversaries"][0]["samples"];
        samples[2] = serde_json::Value::Null;
        samples[3]["position"][0] = 1e300.into();
    });
    let reason = said["failure"].as_str().unwrap_or_default();
    assert!(reason.contains("breaks a rule of a sound scene") && reason.contains("100 km"), "{said}");
}

/// Returns the error message when a worker answers so.
fn refused(answer: impl Fn(&str, usize) -> Vec<Said> + Clone + Send + Sync + 'static) -> String {
    match rollout(&own("physical", 1), &Fake(answer, Mutex::new(0)), &crossing(3, 8, 91)) {
        Err(NoOutcome::Stop(error)) => error.to_string(),
        other => format!("{other:?}"),
    }
}

/// Returns the error message about an honest worker whose lines are changed.
fn spoilt(change: impl Fn(String) -> String + Clone + Send + Sync + 'static) -> String {
    refused(move |line, _| {
        let said = honest(line).remove(0).unwrap();
        let text = String::from_utf8(said).unwrap();
        vec![Ok(if line == "hello" { text } else { change(text) }.into_bytes())]
    })
}

#[test]
fn whatever_no_worker_may_say_is_refused_with_place_and_remedy() {
    let greeting = |change: fn(String) -> String| {
        refused(move |line, _| {
            let said = honest(line).remove(0).unwrap();
            let text = String::from_utf8(said).unwrap();
            vec![Ok(if line == "hello" { change(text) } else { text }.into_bytes())]
        })
    };
    let cases: Vec<(String, &str)> = vec![
        (spoilt(|_| "Loading assets ...".into()), "its answer to request"),
        (spoilt(|line| line[..line.len() / 2].to_string()), "expected one JSON object"),
        (spoilt(|line| line.replacen("\"ego\":[[", "\"ego\":[[NaN,", 1)), "expected one JSON object"),
        (spoilt(|line| line.replacen("\"ego\":[[", "\"ego\":[[1,2,3],[", 1)), "5 or 7 numbers, found 3"),
        (spoilt(|line| line.replacen("\"request\":\"", "\"request\":\"00", 1)), "expected one JSON object"),
        (
            spoilt(|line| {
                let key: String = line.chars().skip(12).take(64).collect();
                line.replace(&key, &Digest::of_bytes(b"another").to_hex())
            }),
            "expected request",
        ),
        (spoilt(|line| line.replacen("\"ego\":[[", "\"ego\":[[1e9,0,0,0,0],[", 1)), "expected a motion of the scene"),
        (spoilt(|line| line.replacen("\"end\"", "\"failure\":\"no\",\"end\"", 1)), "a motion beside a failure"),
        (greeting(|line| line.replace("\"version\":\"", "\"version\":\"9")), "expected version"),
        (greeting(|line| line.replace("evodrive-worker", "carla")), "expected backend evodrive-worker"),
        (
            greeting(|line| line.replace("\"evodrive_worker\":1", "\"evodrive_worker\":2")),
            "expected protocol 1, found 2",
        ),
        (
            greeting(|_| {
                "{\"evodrive_worker\":1,\"backend\":\"evodrive-worker\",\"failure\":\"No package; install it\"}".into()
            }),
            "found No package; install it; do what it says",
        ),
        (greeting(|line| line.replace("\"idm\",", "")), "expected the ego idm, found only idm-lights, replay"),
        (refused(|_, _| vec![Err(Broken::HalfLine(17))]), "found 17 bytes and the end of the process"),
        (refused(|_, _| vec![Err(Broken::TooLong(99))]), "a line of at most 99 bytes"),
        (refused(|_, _| vec![Err(Broken::Ended)]), "its greeting: expected a line, found the end of the process"),
        (
            refused(|line, _| if line == "hello" { honest(line) } else { vec![] }),
            "expected a line within 1 s, found nothing",
        ),
    ];
    for (said, expected) in cases {
        assert!(said.contains(expected), "{said:?} instead of {expected:?}");
        assert!(said.contains("none of its answers was recorded"), "{said}");
    }
}

#[test]
fn a_command_that_does_not_exist_is_refused() {
    let mut options = own("physical", 0);
    options.worker.command = vec!["nowhere".into()];
    let said = rollout(&options, &Fake(|line: &str, _| honest(line), Mutex::new(0)), &crossing(3, 8, 91));
    let Err(NoOutcome::Stop(error)) = said else { panic!("{said:?}") };
    assert!(error.to_string().contains("worker `nowhere`, its start: expected a process"), "{error}");
}

#[test]
fn a_crash_is_repaired_by_a_new_worker_and_fails_the_scene_in_the_end() {
    let crashes = |first: usize| {
        move |line: &str, times: usize| match line {
            "hello" => honest(line),
            _ if times <= first => vec![Err(Broken::Ended)],
            _ => honest(line),
        }
    };
    let scene = crossing(3, 8, 91);
    let mended = rollout(&own("physical", 2), &Fake(crashes(2), Mutex::new(0)), &scene).unwrap();
    let plant = plant(&scene, PlantOptions::PHYSICAL);
    assert_eq!(mended, rollout_assessed(&plant, &intercept(&scene, 5), Policy::Idm.driver().as_mut()).unwrap());
    let failed = rollout(&own("physical", 2), &Fake(crashes(3), Mutex::new(0)), &scene);
    let Err(NoOutcome::Scene(reason)) = failed else { panic!("{failed:?}") };
    assert!(reason.to_string().contains("ended without an answer, 3 times"), "{reason}");
}

/// A cassette with one recorded rollout, and its request's key.
fn recorded(options: &BackendOptions, scene: &Scene) -> (RolloutCassette, Digest) {
    let (plant, act) = (plant(scene, PlantOptions::PHYSICAL), intercept(scene, 5));
    let request = Request::new(options, &plant, &act, &Policy::Idm, DriveContext::plain(Seed(1))).unwrap();
    let start = Fake(|line: &str, _| honest(line), Mutex::new(0));
    let answer = Workers::new(options, &start).ask(&request).unwrap();
    let mut cassette = RolloutCassette::new("file", Header::of(options));
    cassette.insert(request.key, Recorded { scene: scene.id.clone(), ego: "idm".into(), answer });
    (cassette, request.key)
}

#[test]
fn a_cassette_comes_back_as_it_was_and_any_damage_is_seen() {
    let (options, scene) = (own("physical", 0), crossing(3, 8, 91));
    let (cassette, key) = recorded(&options, &scene);
    let text = cassette.to_bytes("test");
    let read = RolloutCassette::parse(&text, "file").unwrap();
    assert_eq!(read, cassette);
    assert_eq!(read.to_bytes("test"), text);
    let text = String::from_utf8(text).unwrap();
    let spoilt = |from: &str, to: &str| {
        let changed = text.replacen(from, to, 1);
        assert!(changed != text, "{from} is not there");
        RolloutCassette::parse(changed.as_bytes(), "file").unwrap_err().to_string()
    };
    assert!(spoilt("\"from_step\":0", "\"from_step\":1").contains("line 2: expected digest of the answer"));
    assert!(spoilt(&key.to_hex(), &Digest::of_bytes(b"x").to_hex()).contains("line 2: expected an answer to"));
    assert!(spoilt("\"version\":\"1.0\"", "\"version\":\"2.0\"").contains("format 2.0, this build reads 1.x"));
    assert!(spoilt("evodrive-rollout-cassette", "evodrive-cassette").contains("line 1: expected format"));
    let half = RolloutCassette::parse(&text.as_bytes()[..text.len() / 2], "file").unwrap_err().to_string();
    assert!(half.contains("line 2: expected a recorded rollout"), "{half}");
    let other = BackendOptions { version: "another".into(), ..options };
    assert!(cassette.check(&other).unwrap_err().to_string().contains("version is"));
}

#[test]
fn a_replay_asks_nobody_and_a_miss_says_what_would_record_it() {
    let (options, scene) = (own("physical", 0), crossing(3, 8, 91));
    let (cassette, _) = recorded(&options, &scene);
    let replay = Replay::new(cassette, "evodrive record mine.toml");
    let backend = Backend::Other { options: &options, answers: &replay };
    let (plant, act) = (plant(&scene, PlantOptions::PHYSICAL), intercept(&scene, 5));
    let replayed = backend.rollout(&plant, &act, &Policy::Idm, DriveContext::plain(Seed(1))).unwrap();
    assert_eq!(replayed, rollout_assessed(&plant, &act, Policy::Idm.driver().as_mut()).unwrap());
    let missed = backend.rollout(&plant, &intercept(&scene, 6), &Policy::Idm, DriveContext::plain(Seed(1)));
    let Err(NoOutcome::Stop(error)) = missed else { panic!("{missed:?}") };
    for part in [scene.id.as_str(), "ego idm", "1 adversaries", "1 of them of this scene", "evodrive record mine.toml"]
    {
        assert!(error.to_string().contains(part), "{error} has no {part}");
    }
}

#[test]
fn the_key_holds_what_can_change_an_answer_and_nothing_else() {
    let scene = crossing(3, 8, 91);
    let (plant, act) = (plant(&scene, PlantOptions::PHYSICAL), intercept(&scene, 5));
    let key = |options: &BackendOptions, seed: u64| {
        Request::new(options, &plant, &act, &Policy::Idm, DriveContext::plain(Seed(seed))).unwrap().key
    };
    let options = own("physical", 0);
    let changed = |change: &dyn Fn(&mut BackendOptions)| {
        let mut other = options.clone();
        change(&mut other);
        key(&other, 1) != key(&options, 1)
    };
    assert!(changed(&|o| o.name.push('x')) && changed(&|o| o.version.push('x')));
    assert!(changed(&|o| o.digest = Digest::of_bytes(b"x")));
    assert!(changed(&|o| drop(o.options.insert("more".into(), true.into()))));
    assert!(!changed(&|o| o.worker.command.push("x".into())) && !changed(&|o| o.worker.workers = 9));
    assert!(!changed(&|o| o.cassette = "elsewhere".into()));
    assert_ne!(key(&options, 1), key(&options, 2));
}
