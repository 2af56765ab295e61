//! The extras that a planner may ask for: labels behind a rollout, an observation, the program. Also the fate of a scene that
//! a planner abandons.

use super::*;
use crate::backend::lines::Labelled;
use crate::ego::network::tanh;
use crate::ego::observation::ACTION;
use crate::ego::{Actor, Setting, Weights};
use crate::sim::{Contact, ContactClass};
use crate::store::Store;

/// Starts planners with a greeting of the test's own, and keeps every line that they are told.
struct Watched<F> {
    hello: &'static str,
    answer: F,
    lines: Arc<Mutex<Vec<Value>>>,
    started: AtomicUsize,
}

struct Watching<F> {
    said: VecDeque<Said>,
    answer: F,
    lines: Arc<Mutex<Vec<Value>>>,
    salt: u64,
}

impl<F: Fn(&Value) -> Value + Clone + Send + Sync + 'static> Watched<F> {
    fn new(hello: &'static str, answer: F) -> Watched<F> {
        Watched { hello, answer, lines: Arc::default(), started: AtomicUsize::new(0) }
    }

    /// The lines of this type, in the order in which they came.
    fn heard(&self, kind: &str) -> Vec<Value> {
        self.lines.lock().unwrap().iter().filter(|line| line["type"] == kind).cloned().collect()
    }
}

impl<F: Fn(&Value) -> Value + Clone + Send + Sync + 'static> Start for Watched<F> {
    fn start(&self, _: &[String]) -> Result<Box<dyn Line>, String> {
        Err("a planner is started in its folder".into())
    }

    fn start_in(&self, _: &[String], _: &Path, variables: &[(&str, &str)]) -> Result<Box<dyn Line>, String> {
        self.started.fetch_add(1, Ordering::SeqCst);
        Ok(Box::new(Watching {
            said: VecDeque::from([Ok(self.hello.into())]),
            answer: self.answer.clone(),
            lines: self.lines.clone(),
            salt: variables[0].1.parse().unwrap(),
        }))
    }
}

impl<F: Fn(&Value) -> Value + Send> Line for Watching<F> {
    fn send(&mut self, line: String) {
        let line: Value = serde_json::from_str(&line).unwrap();
        self.lines.lock().unwrap().push(line.clone());
        if line["type"] == "step" {
            let mut question = line;
            question["salt"] = self.salt.into();
            self.said.push_back(Ok((self.answer)(&question).to_string().into_bytes()));
        }
    }

    fn receive(&mut self, _: Duration) -> Said {
        self.said.pop_front().unwrap_or(Err(Broken::Late))
    }
}

const HELLO: &str = "{\"evodrive_driver\":1}";
const LABELS: &str = "{\"evodrive_driver\":1,\"labels\":true}";

fn lawful(question: &Value) -> Value {
    serde_json::from_slice(&plain(question, 0).unwrap()).unwrap()
}

#[test]
fn who_asks_for_labels_is_told_at_the_end_what_came_of_the_rollout_and_who_does_not_is_told_what_all_are() {
    let (watched, silent) = (Watched::new(LABELS, lawful), Watched::new(HELLO, lawful));
    let (mut contacts, mut preventable) = (0, 0);
    for seed in 0..40 {
        let scene = crossing(seed, 5 + (seed % 12) as usize, 91);
        let act = intercept(&scene, seed as usize % 30);
        let outcome = played(&options(0.0), &watched, &scene, &act).unwrap();
        assert_eq!(played(&options(0.0), &silent, &scene, &act).unwrap(), outcome, "telling changes no rollout");
        let end = watched.heard("end").pop().unwrap();
        assert_eq!(end["end"], serde_json::to_value(outcome.end).unwrap());
        assert_eq!((&end["steps"], &end["outcome"]), (&json!(outcome.steps), &serde_json::to_value(&outcome).unwrap()));
        let contact = outcome.contact;
        let labels = json!({
            "collision": contact.is_some(),
            "contact_class": contact.map(|contact| contact.class.name()),
            "adversary": contact.is_some_and(|contact| contact.adversary),
            "preventable": contact.and_then(|contact| contact.preventable()),
            "route_completion": outcome.route_completion,
        });
        assert_eq!(end["labels"], labels, "seed {seed}");
        contacts += usize::from(contact.is_some());
        if let Some(of) = contact {
            let ram = Contact { class: ContactClass::RearEndEgoStruck, avoidable: Some(true), ..of };
            let told = serde_json::to_value(Labelled::of(&Outcome { contact: Some(ram), ..outcome.clone() })).unwrap();
            assert_eq!(told["labels"]["preventable"], json!(false), "who follows keeps the distance");
        }
        preventable += usize::from(contact.is_some_and(|contact| contact.preventable() == Some(true)));
    }
    assert!(contacts > 3 && preventable > 0 && preventable < contacts, "{contacts} {preventable}");
    for end in silent.heard("end") {
        assert_eq!(end.as_object().unwrap().keys().collect::<Vec<_>>(), ["end", "steps", "type"]);
    }
}

/// Returns the key of the request for a rollout under a program, behind a planner.
fn under(options: &DriverOptions, start: &dyn Start, of: ProgramContext) -> Digest {
    let (scene, backend) = (crossing(3, 5, 91), options.backend(&SimulatorOptions::SHIPPED).unwrap());
    let (plant, act, ego) = (plant(&scene), intercept(&scene, 5), options.policy().unwrap());
    let planners = Planners::new(options, start);
    let behind = Backend::Other { options: &backend, answers: &planners };
    behind.rollout(&plant, &act, &ego, DriveContext { seed: Seed(1), under: of }).unwrap();
    Request::new(&backend, &plant, &act, &ego, DriveContext { seed: Seed(1), under: of }).unwrap().key
}

#[test]
fn a_planner_that_is_not_blind_is_told_the_program_and_its_rollouts_are_kept_apart_by_it() {
    let (a, b) = (Digest::of_bytes(b"a"), Digest::of_bytes(b"b"));
    let all = [
        ProgramContext::Plain,
        ProgramContext::Parent { program: a },
        ProgramContext::Program { program: a },
        ProgramContext::Program { program: b },
    ];
    let keys = |blind: bool| {
        let watched = Watched::new(HELLO, lawful);
        let keys = all.map(|of| under(&DriverOptions { blind, ..options(0.0) }, &watched, of));
        (watched.heard("begin"), keys)
    };
    let (begun, same) = keys(true);
    assert!(begun.iter().all(|begin| begin.get("under").is_none()), "{begun:?}");
    assert_eq!(same, [same[0]; 4], "blind, programs that command the same motion share a rollout");
    let (begun, apart) = keys(false);
    let said: Vec<&Value> = begun.iter().map(|begin| &begin["under"]).collect();
    let (a, b) = (a.to_hex(), b.to_hex());
    assert_eq!(
        said,
        [
            &json!({"kind": "plain"}),
            &json!({"kind": "parent", "program": a}),
            &json!({"kind": "program", "program": a}),
            &json!({"kind": "program", "program": b})
        ]
    );
    let distinct: std::collections::BTreeSet<Digest> = apart.iter().chain(&same).copied().collect();
    assert_eq!(distinct.len(), 5);
    // Another simulator's ego hears of no program, whatever its options are called.
    let backend = options(0.0).backend(&SimulatorOptions::SHIPPED).unwrap();
    let open = [("blind".to_string(), Value::Bool(false))].into();
    assert!(BackendOptions { name: "other".into(), options: open, ..backend }.is_blind());
}

#[test]
fn steps_hold_the_observation_that_is_asked_for_and_an_action_by_it_drives_as_the_network_within() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../policies");
    for (name, setting) in [("sac-metadrive", Setting::Metadrive1), ("sac-metadrive-2", Setting::Metadrive1)] {
        let bytes = std::fs::read(file.join(name).with_extension("safetensors")).unwrap();
        let weights = Weights::from_bytes(&bytes).unwrap();
        let Actor::Layers(actor, _) = weights.actor.clone() else { panic!("layers") };
        let watched = Watched::new(HELLO, move |question: &Value| {
            let numbers = question["observation"].as_array().unwrap();
            let mut values: Vec<f32> = numbers.iter().map(|number| number.as_f64().unwrap() as f32).collect();
            actor.apply(&mut values, &mut Vec::new());
            let action: [f32; ACTION] = [tanh(values[0]), tanh(values[1])];
            json!({"action": action})
        });
        let asking = DriverOptions { observe: Some(setting), ..options(0.0) };
        let mut contacts = 0;
        for seed in 0..12 {
            let scene = crossing(seed, 5 + (seed % 12) as usize, 91);
            let act = intercept(&scene, seed as usize % 30);
            let behind = played(&asking, &watched, &scene, &act).unwrap();
            let mut within = Policy::Learned(weights.clone()).driver();
            assert_eq!(behind, rollout_assessed(&plant(&scene), &act, within.as_mut()).unwrap(), "seed {seed}");
            contacts += usize::from(behind.contact.is_some());
        }
        assert!(contacts > 0);
        assert!(watched.heard("begin").iter().all(|begin| begin["observe"] == setting.name()));
        let steps = watched.heard("step");
        assert!(steps.iter().all(|step| step["observation"].as_array().unwrap().len() == setting.length()));
    }
    // A planner that asks for four numbers gets those.
    let watched = Watched::new(HELLO, |_: &Value| json!({"action": [0.0, 1.0]}));
    let asking = DriverOptions { observe: Some(Setting::Safebench1), ..options(0.0) };
    played(&asking, &watched, &crossing(3, 5, 91), &Intervention::default()).unwrap();
    let steps = watched.heard("step");
    let speed = |step: &Value| (step["observation"][2].as_f64().unwrap(), step["ego"]["speed_mps"].as_f64().unwrap());
    assert!(steps.iter().map(speed).all(|(seen, is)| (seen - is).abs() < 1e-5), "{steps:?}");
    // Without it there is none, and an action means nothing.
    let said = reason(&options(0.0), |question, _| {
        assert!(question.get("observation").is_none());
        Ok(b"{\"action\": [0.0, 1.0]}".to_vec())
    });
    assert!(said.contains("an action, which only driver.observe"), "{said}");
}

/// Abandons scenes with an odd number in their id at this decision, with this word.
fn picky(question: &Value) -> Value {
    if question["step"] == 4 { json!({"abandon": "no-lane"}) } else { lawful(question) }
}

#[test]
fn a_scene_that_a_planner_abandons_has_no_label_and_the_process_goes_on() {
    let watched = Watched::new(LABELS, picky);
    let (options, scene) = (options(1.0), crossing(3, 5, 91));
    let (planners, backend) = (Planners::new(&options, &watched), options.backend(&SimulatorOptions::SHIPPED).unwrap());
    let behind = Backend::Other { options: &backend, answers: &planners };
    let drive = || {
        let context = DriveContext::plain(Seed(1));
        match behind.rollout(&plant(&scene), &Intervention::default(), &options.policy().unwrap(), context) {
            Err(NoOutcome::Scene(why)) => why,
            other => panic!("{other:?}"),
        }
    };
    assert_eq!(drive().to_string(), "abandoned: planner `python3 mine.py`, decision 4 (0.4 s): no-lane");
    assert_eq!(drive(), drive());
    assert!([drive(), drive()].iter().all(|why| matches!(why, Undriven::Abandoned(_))));
    // One that drives and one that drives again; both are told that it is over, and nothing more.
    assert_eq!(watched.started.load(Ordering::SeqCst), 2);
    let ends = watched.heard("end");
    assert!(ends.len() >= 10 && ends.iter().all(|end| *end == json!({"type": "end", "end": "abandoned", "steps": 4})));
    for bad in [json!(""), json!("no lane"), json!("x".repeat(41)), json!("/home/alice"), json!(3)] {
        let said = reason(&super::options(0.0), move |_, _| Ok(json!({"abandon": bad}).to_string().into_bytes()));
        assert!(said.contains("{\"abandon\": \"word\"}") || said.contains("found other fields"), "{said}");
        assert!(!matches!(Undriven::from(said.clone()), Undriven::Abandoned(_)) && !said.contains("alice"), "{said}");
    }
    let both = reason(&super::options(0.0), |question, _| {
        let mut said = lawful(question);
        said["abandon"] = "no-lane".into();
        Ok(said.to_string().into_bytes())
    });
    assert!(both.contains("neither of them, or both"), "{both}");
}

#[test]
fn a_planner_that_abandons_a_scene_in_one_process_alone_is_no_function() {
    let fickle = |question: &Value| {
        if question["salt"] == 2 && question["step"] == 4 { json!({"abandon": "tired"}) } else { lawful(question) }
    };
    let watched = Watched::new(HELLO, fickle);
    let refused = played(&options(1.0), &watched, &crossing(3, 5, 91), &Intervention::default());
    let Err(NoOutcome::Stop(error)) = refused else { panic!("{refused:?}") };
    let said = error.to_string();
    assert!(said.contains("expected a drive of ") && said.contains("decision 4 (0.4 s): tired"), "{said}");
}

#[test]
fn a_recording_keeps_that_a_scene_was_abandoned_and_does_not_ask_again_as_it_does_of_one_that_failed() {
    let asked = |answer: fn(&Value) -> Value| {
        let (watched, folder) = (Watched::new(HELLO, answer), tempfile::tempdir().unwrap());
        let options = options(0.0);
        let backend = options.backend(&SimulatorOptions::SHIPPED).unwrap();
        let store = Store::open(folder.path()).unwrap();
        let mut before = RolloutCassette::new("file", Header::of(&backend));
        let mut said = Vec::new();
        // The second recording has the first one's cassette, the third one its store alone.
        for has in ["nothing", "cassette", "store"] {
            if has == "store" {
                before = RolloutCassette::new("file", Header::of(&backend));
            }
            let recorder =
                Recorder::new(&store, before.clone(), Box::new(Planners::new(&options, &watched)), String::new());
            let behind = Backend::Other { options: &backend, answers: &recorder };
            let context = DriveContext::plain(Seed(1));
            let scene = plant(&crossing(3, 5, 91));
            let out = behind.rollout(&scene, &Intervention::default(), &options.policy().unwrap(), context);
            let Err(NoOutcome::Scene(reason)) = out else { panic!("{out:?}") };
            said.push(reason);
            let (cassette, failed) = recorder.cassette();
            let abandoned = usize::from(matches!(said[0], Undriven::Abandoned(_)));
            assert_eq!((cassette.abandoned(), failed), (abandoned, 1 - abandoned));
            before = RolloutCassette::parse(&cassette.to_bytes("mine"), "file").unwrap();
        }
        assert!(said.iter().all(|reason| *reason == said[0]), "{said:?}");
        // From the cassette alone, without a planner.
        let replay = Replay::new(before, "record");
        let behind = Backend::Other { options: &backend, answers: &replay };
        let context = DriveContext::plain(Seed(1));
        let scene = plant(&crossing(3, 5, 91));
        let again = behind.rollout(&scene, &Intervention::default(), &options.policy().unwrap(), context);
        assert!(matches!(again, Err(NoOutcome::Scene(reason)) if reason == said[0]));
        watched.started.load(Ordering::SeqCst)
    };
    assert_eq!(asked(picky), 1);
    assert_eq!(asked(|_| json!({"nonsense": 1})), 3);
}
