//! Planners without processes: closures that answer the lines of a rollout.

use std::collections::VecDeque;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use serde_json::{Value, json};

use super::*;
use crate::ego::Policy;
use crate::kernel::{Digest, Seed};
use crate::scene::{PreparedScene, Scene};
use crate::sim::scenes::{crossing, intercept};
use crate::sim::{
    Action, Control, Driver, Intervention, Outcome, Plant, SimulatorOptions, Undriven, View, rollout_assessed,
};

type Said = Result<Vec<u8>, Broken>;
type Answering = fn(&Value, usize) -> Said;

/// Starts planners that answer each decision by a closure of what they are told and of how many lines were sent to them.
struct Fake<F>(F, AtomicUsize, Mutex<String>);

struct Drives<F> {
    said: VecDeque<Said>,
    answer: F,
    lines: usize,
    /// As Python has it: a process's own.
    salt: u64,
}

impl<F: Fn(&Value, usize) -> Said + Clone + Send + Sync + 'static> Start for Fake<F> {
    fn start(&self, _: &[String]) -> Result<Box<dyn Line>, String> {
        Err("a planner is started in its folder".into())
    }

    fn start_in(&self, _: &[String], folder: &Path, variables: &[(&str, &str)]) -> Result<Box<dyn Line>, String> {
        assert_eq!(folder, Path::new("/there"));
        let [("PYTHONHASHSEED", salt)] = variables else { panic!("{variables:?}") };
        self.1.fetch_add(1, Ordering::SeqCst);
        let said = VecDeque::from([Ok(b"{\"evodrive_driver\":1}".to_vec())]);
        Ok(Box::new(Drives { said, answer: self.0.clone(), lines: 0, salt: salt.parse().unwrap() }))
    }

    fn show(&self, about: &str, printed: &str) {
        self.2.lock().unwrap().push_str(&format!("{about}: {printed}"));
    }
}

impl<F: Fn(&Value, usize) -> Said + Send> Line for Drives<F> {
    fn send(&mut self, line: String) {
        let mut question: Value = serde_json::from_str(&line).unwrap();
        question["salt"] = self.salt.into();
        self.lines += 1;
        if question["type"] == "step" {
            match (self.answer)(&question, self.lines) {
                Ok(lines) => self.said.extend(lines.split(|byte| *byte == b'\n').map(|line| Ok(line.to_vec()))),
                broken => self.said.push_back(broken),
            }
        }
    }

    fn early(&mut self) -> Option<Said> {
        self.said.pop_front()
    }

    fn receive(&mut self, _: Duration) -> Said {
        self.said.pop_front().unwrap_or(Err(Broken::Late))
    }

    fn complaint(&mut self) -> String {
        "Traceback: no weights\n".into()
    }
}

fn options(repeat_share: f64) -> DriverOptions {
    DriverOptions {
        command: vec!["python3".into(), "mine.py".into()],
        files: vec!["mine.py".into()],
        cassette: "mine.jsonl".into(),
        timeout_s: 1.0,
        processes: 2,
        repeat_share,
        observe: None,
        blind: true,
        digest: Some(Digest::of_bytes(b"mine")),
        folder: "/there".into(),
    }
}

fn plant(scene: &Scene) -> Plant {
    Plant::with_options(PreparedScene::new(Arc::new(scene.clone())), &SimulatorOptions::SHIPPED).unwrap()
}

/// Accelerates while nobody is near, and steers back to its route: enough to react to adversaries.
#[derive(Clone, Copy)]
struct Plain;

fn law(nearest_m: Option<f64>, offset_m: f64) -> (f64, f64) {
    (if nearest_m.is_some_and(|near| near < 15.0) { -4.0 } else { 0.5 }, -0.02 * offset_m)
}

impl Driver for Plain {
    fn begin(&mut self, _: &Plant) {}

    fn decide(&mut self, view: &View<'_>) -> Control {
        let ego = view.ego();
        let mut nearest = None;
        view.for_each_within(100.0, |seen| {
            let m = seen.position.distance(ego.sample.position);
            nearest = Some(nearest.map_or(m, |known: f64| known.min(m)));
        });
        let (acceleration_mps2, steering_rad) = law(nearest, ego.along.offset_m);
        Control::Drive { acceleration_mps2, steering_rad }
    }
}

/// The same law, from the lines.
fn plain(question: &Value, _: usize) -> Said {
    let at = |of: &Value| crate::kernel::Vec2::new(of[0].as_f64().unwrap(), of[1].as_f64().unwrap());
    let ego = at(&question["ego"]["position"]);
    let nearest = question["neighbours"].as_array().unwrap().first().map(|near| at(&near["position"]).distance(ego));
    let (acceleration_mps2, steering_rad) = law(nearest, question["ego"]["route_offset_m"].as_f64().unwrap());
    Ok(json!({"acceleration_mps2": acceleration_mps2, "steering_rad": steering_rad}).to_string().into_bytes())
}

fn played(options: &DriverOptions, start: &dyn Start, scene: &Scene, act: &Intervention) -> Result<Outcome, NoOutcome> {
    let planners = Planners::new(options, start);
    let backend = options.backend(&SimulatorOptions::SHIPPED).unwrap();
    let behind = Backend::Other { options: &backend, answers: &planners };
    behind.rollout(&plant(scene), act, &options.policy().unwrap(), DriveContext::plain(Seed(1)))
}

#[test]
fn a_planner_behind_the_lines_drives_as_the_same_law_within_also_against_adversaries_that_react() {
    let start = Fake(plain, AtomicUsize::new(0), Mutex::default());
    let (mut contacts, mut reacting) = (0, 0);
    for seed in 0..40 {
        let scene = crossing(seed, 5 + (seed % 12) as usize, 91);
        let mut act =
            if seed.is_multiple_of(5) { Intervention::default() } else { intercept(&scene, seed as usize % 30) };
        if let (true, Some(Action::Follow { track, from_step, samples })) =
            (seed % 2 == 1, act.actions.first().cloned())
        {
            let (short, handover_step) = (samples[..10.min(samples.len())].to_vec(), from_step + 12);
            act.actions = vec![Action::FollowThenReact { track, from_step, samples: short, handover_step }];
            reacting += 1;
        }
        let behind = played(&options(1.0), &start, &scene, &act).unwrap();
        let within = rollout_assessed(&plant(&scene), &act, &mut Plain).unwrap();
        if act.actions.iter().any(|action| matches!(action, Action::FollowThenReact { .. })) {
            // The manoeuvres that would have spared the ego are found from the reported motion.
            let contact = |outcome: &Outcome| outcome.contact.as_ref().map(|contact| (contact.with, contact.time_s));
            assert_eq!((behind.end, behind.steps, contact(&behind)), (within.end, within.steps, contact(&within)));
        } else {
            assert_eq!(behind, within, "seed {seed}");
        }
        contacts += usize::from(within.contact.is_some());
    }
    assert!(contacts > 3 && reacting > 10, "{contacts} {reacting}");
}

#[test]
fn a_trajectory_is_driven_along_and_points_behind_the_car_stop_it() {
    let scene = crossing(3, 1, 91);
    let straight = |question: &Value, _: usize| {
        let ego = &question["ego"];
        let (x, y) = (ego["position"][0].as_f64().unwrap(), ego["position"][1].as_f64().unwrap());
        let points: Vec<[f64; 2]> = (1..=20).map(|k| [x + 0.6 * f64::from(k), y]).collect();
        Ok(json!({"trajectory": points}).to_string().into_bytes())
    };
    let driven =
        played(&options(0.0), &Fake(straight, AtomicUsize::new(0), Mutex::default()), &scene, &Intervention::default())
            .unwrap();
    assert!((driven.ego.speed_mps_mean - 6.0).abs() < 1.5, "0.6 m in 0.1 s: {}", driven.ego.speed_mps_mean);
    let back = |question: &Value, _: usize| {
        let x = question["ego"]["position"][0].as_f64().unwrap();
        Ok(json!({"trajectory": [[x - 1.0, question["ego"]["position"][1]]]}).to_string().into_bytes())
    };
    let stopped =
        played(&options(0.0), &Fake(back, AtomicUsize::new(0), Mutex::default()), &scene, &Intervention::default())
            .unwrap();
    assert!(stopped.route_completion < 0.5 * driven.route_completion, "{}", stopped.route_completion);
}

fn reason(options: &DriverOptions, answer: impl Fn(&Value, usize) -> Said + Clone + Send + Sync + 'static) -> String {
    let start = Fake(answer, AtomicUsize::new(0), Mutex::default());
    match played(options, &start, &crossing(3, 5, 91), &Intervention::default()) {
        Err(NoOutcome::Scene(why)) => why.to_string(),
        Err(NoOutcome::Stop(error)) => format!("STOP {error}"),
        Ok(_) => "driven".into(),
    }
}

/// Words that a planner prints about its machine and its user.
const OUTSIDE: &str = "/home/alice/mine.py sk-123";

#[test]
fn a_crash_a_late_answer_and_nonsense_leave_the_scene_without_a_label_and_with_a_reason_that_is_ours_alone() {
    let cases: [(Answering, &str); 7] = [
        (
            |question, k| if k > 5 { Err(Broken::Ended) } else { plain(question, k) },
            "decision 4 (0.4 s): the process ended",
        ),
        (|_, _| Err(Broken::Late), "decision 0 (0.0 s): no answer within 1 s (driver.timeout_s)"),
        (|_, _| Ok(OUTSIDE.into()), "found a line that is no JSON object"),
        (|_, _| Ok(b"{\"acceleration_mps2\": NaN, \"steering_rad\": 0}".to_vec()), "found a line that is no JSON"),
        (|_, _| Ok(format!("{{\"{OUTSIDE}\": 1}}").into()), "found other fields"),
        (|_, _| Ok(b"{\"acceleration_mps2\": 1}".to_vec()), "found neither of them, or both"),
        (|_, _| Ok(b"{\"trajectory\": []}".to_vec()), "or {\"trajectory\": [[x, y], ..]}"),
    ];
    for (answer, expected) in cases {
        let said = reason(&options(0.0), answer);
        // A late planner is distinguished from one that failed.
        let late = expected.contains("no answer within");
        assert_eq!(matches!(Undriven::from(said.clone()), Undriven::TooSlow(_)), late, "{said}");
        let said = said.strip_prefix("too slow: ").unwrap_or(&said);
        assert!(said.starts_with("planner `python3 mine.py`, decision") && said.contains(expected), "{said}");
        assert!(!said.contains("Traceback") && !said.contains("alice") && !said.contains("sk-"), "{said}");
    }
}

#[test]
fn what_a_failed_planner_printed_is_shown() {
    let start = Fake(|_: &Value, _: usize| Ok(OUTSIDE.into()), AtomicUsize::new(0), Mutex::default());
    played(&options(0.0), &start, &crossing(3, 5, 91), &Intervention::default()).unwrap_err();
    let shown = start.2.into_inner().unwrap();
    assert!(
        shown.contains("decision 0") && shown.contains(OUTSIDE) && shown.contains("Traceback: no weights"),
        "{shown}"
    );
}

#[test]
fn a_line_that_came_before_its_question_is_refused_with_the_questions_number() {
    let two = |question: &Value, k: usize| {
        let line = plain(question, k)?;
        Ok(if question["step"] == 2 { [line.clone(), b"\n".to_vec(), line].concat() } else { line })
    };
    let said = reason(&options(0.0), two);
    assert!(said.contains("decision 3 (0.3 s): expected one line an answer"), "{said}");
    let other = |question: &Value, k: usize| {
        let mut said: Value = serde_json::from_slice(&plain(question, k)?).unwrap();
        said["step"] = json!(question["step"].as_u64().unwrap().min(4));
        Ok(said.to_string().into_bytes())
    };
    assert!(reason(&options(0.0), other).contains("decision 5 (0.5 s): expected"), "an answer to another step");
}

#[test]
fn a_line_that_nobody_asked_for_behind_the_last_decision_is_refused() {
    let last = Arc::new(AtomicUsize::new(0));
    let seen = last.clone();
    let counting = move |question: &Value, k: usize| {
        seen.store(question["step"].as_u64().unwrap() as usize, Ordering::SeqCst);
        plain(question, k)
    };
    assert_eq!(reason(&options(0.0), counting), "driven");
    let last = last.load(Ordering::SeqCst);
    let said = reason(&options(0.0), move |question, k| {
        let line = plain(question, k)?;
        Ok(if question["step"] == last { [line.clone(), b"\n".to_vec(), line].concat() } else { line })
    });
    assert!(said.contains("found one that nobody asked for"), "{said}");
}

#[test]
fn a_planner_that_keeps_something_from_one_rollout_to_the_next_is_found_where_rollouts_are_played_twice() {
    let forgetful = |question: &Value, lines: usize| {
        let mut said: Value = serde_json::from_slice(&plain(question, lines)?).unwrap();
        said["acceleration_mps2"] = json!(0.3 + 0.001 * lines as f64);
        Ok(said.to_string().into_bytes())
    };
    assert_eq!(reason(&options(0.0), forgetful), "driven", "nobody looked");
    let refusal = reason(&options(1.0), forgetful);
    assert!(
        refusal.starts_with("STOP worker `python3 mine.py`, scene") && refusal.contains("played twice in one process"),
        "{refusal}"
    );
    assert!(
        refusal.contains("after 1 decisions") && refusal.contains("seed its random numbers at `begin`"),
        "{refusal}"
    );
}

#[test]
fn a_planner_that_is_the_same_within_a_process_alone_is_refused_in_the_first_rollout_whatever_is_drawn() {
    let salted = |question: &Value, lines: usize| {
        let mut said: Value = serde_json::from_slice(&plain(question, lines)?).unwrap();
        said["acceleration_mps2"] = json!(0.3 + 0.001 * question["salt"].as_f64().unwrap());
        Ok(said.to_string().into_bytes())
    };
    assert_eq!(reason(&options(0.0), salted), "driven", "nobody looked");
    // A share that draws hardly anything.
    for share in [1e-9, 1.0] {
        let refusal = reason(&options(share), salted);
        assert!(
            refusal.contains("played again in another process") && refusal.contains("after 1 decisions"),
            "{refusal}"
        );
        assert!(refusal.contains("PYTHONHASHSEED was 1 and 2") && refusal.contains("hashlib"), "{refusal}");
    }
}

#[test]
fn who_drives_again_is_another_process_that_is_kept() {
    let (start, options) = (Fake(plain, AtomicUsize::new(0), Mutex::default()), options(1.0));
    let planners = Planners::new(&options, &start);
    let backend = options.backend(&SimulatorOptions::SHIPPED).unwrap();
    let behind = Backend::Other { options: &backend, answers: &planners };
    for seed in 0..3 {
        let scene = crossing(seed, 3, 91);
        behind
            .rollout(&plant(&scene), &Intervention::default(), &options.policy().unwrap(), DriveContext::plain(Seed(1)))
            .unwrap();
    }
    assert_eq!(start.1.load(Ordering::SeqCst), 2);
}

#[test]
fn a_process_that_failed_is_replaced_and_one_that_drove_is_kept() {
    let planner = |question: &Value, k: usize| match question["ego"]["speed_mps"].as_f64() {
        Some(speed) if speed > 1e3 => Err(Broken::Ended),
        _ => plain(question, k),
    };
    let (start, options) = (Fake(planner, AtomicUsize::new(0), Mutex::default()), options(0.0));
    let planners = Planners::new(&options, &start);
    let backend = options.backend(&SimulatorOptions::SHIPPED).unwrap();
    let behind = Backend::Other { options: &backend, answers: &planners };
    let drive = |seed| {
        behind.rollout(
            &plant(&crossing(seed, 3, 91)),
            &Intervention::default(),
            &options.policy().unwrap(),
            DriveContext::plain(Seed(1)),
        )
    };
    (0..3).for_each(|seed| drop(drive(seed).unwrap()));
    assert_eq!(start.1.load(Ordering::SeqCst), 1);
    let broken = Fake(|_: &Value, _: usize| Err(Broken::Ended), AtomicUsize::new(0), Mutex::default());
    let planners = Planners::new(&options, &broken);
    let behind = Backend::Other { options: &backend, answers: &planners };
    for seed in 0..3 {
        let scene = crossing(seed, 3, 91);
        let failed = behind.rollout(
            &plant(&scene),
            &Intervention::default(),
            &options.policy().unwrap(),
            DriveContext::plain(Seed(1)),
        );
        assert!(matches!(failed, Err(NoOutcome::Scene(_))));
    }
    assert_eq!(broken.1.load(Ordering::SeqCst), 3);
}

#[test]
fn no_label_comes_from_whoever_stands_in_for_a_planner() {
    let scene = crossing(3, 5, 91);
    let ego = Policy::Command(Digest::of_bytes(b"mine"));
    let own = Backend::Own.rollout(&plant(&scene), &Intervention::default(), &ego, DriveContext::plain(Seed(1)));
    assert!(matches!(own, Err(NoOutcome::Stop(BackendError::Unplayable(_)))), "{own:?}");
    // Beside a planner, other egos drive as usual, and no planner is asked.
    let options = options(0.0);
    let nobody = Fake(|_: &Value, _: usize| Err(Broken::Ended), AtomicUsize::new(0), Mutex::default());
    let (planners, backend) = (Planners::new(&options, &nobody), options.backend(&SimulatorOptions::SHIPPED).unwrap());
    let behind = Backend::Other { options: &backend, answers: &planners };
    let idm =
        behind.rollout(&plant(&scene), &intercept(&scene, 5), &Policy::Idm, DriveContext::plain(Seed(1))).unwrap();
    let plainly = rollout_assessed(&plant(&scene), &intercept(&scene, 5), Policy::Idm.driver().as_mut()).unwrap();
    assert_eq!((idm, nobody.1.load(Ordering::SeqCst)), (plainly, 0));
}

/// Starts planners that greet with a line of the test's, and keeps what they are asked.
struct Greeting(&'static str, Arc<Mutex<Vec<Value>>>);

impl Start for Greeting {
    fn start(&self, _: &[String]) -> Result<Box<dyn Line>, String> {
        Err("a planner is started in its folder".into())
    }

    fn start_in(&self, _: &[String], _: &Path, _: &[(&str, &str)]) -> Result<Box<dyn Line>, String> {
        let asked = self.1.clone();
        let answer = move |question: &Value, lines: usize| {
            asked.lock().unwrap().push(question.clone());
            plain(question, lines)
        };
        Ok(Box::new(Drives { said: VecDeque::from([Ok(self.0.into())]), answer, lines: 0, salt: 1 }))
    }

    fn show(&self, _: &str, _: &str) {}
}

#[test]
fn the_map_around_the_ego_is_told_to_who_asks_for_it_and_changes_no_rollout() {
    let scene = crossing(3, 5, 91);
    let asked = |hello: &'static str| {
        let questions = Arc::new(Mutex::new(Vec::new()));
        let start = Greeting(hello, questions.clone());
        let outcome = played(&options(0.0), &start, &scene, &Intervention::default());
        let questions = questions.lock().unwrap().clone();
        (outcome, questions)
    };
    let (plainly, without) = asked("{\"evodrive_driver\":1}");
    assert!(!without.is_empty() && without.iter().all(|question| question.get("map").is_none()));
    let (near, short) = asked("{\"evodrive_driver\":1,\"map_m\":10}");
    let (far, long) = asked("{\"evodrive_driver\":1,\"map_m\":150.5}");
    let plainly = plainly.unwrap();
    assert_eq!((near.unwrap(), far.unwrap()), (plainly.clone(), plainly));
    let lanes = |questions: &[Value], at: usize| questions[at]["map"]["lanes"].as_array().unwrap().len();
    assert!((1..=lanes(&long, 0)).contains(&lanes(&short, 0)));
    // It goes along with the ego.
    let last = short.len() - 1;
    assert_ne!(short[0]["map"], short[last]["map"]);
    let at = |of: &Value| crate::kernel::Vec2::new(of[0].as_f64().unwrap(), of[1].as_f64().unwrap());
    for question in [&short[0], &short[last]] {
        let ego = at(&question["ego"]["position"]);
        let lanes = question["map"]["lanes"].as_array().unwrap();
        let ways = lanes.iter().flat_map(|lane| lane["centre"].as_array().unwrap());
        let points = ways.flat_map(|way| way.as_array().unwrap()).map(|point| at(point).distance(ego));
        assert!(points.fold(f64::INFINITY, f64::min) < 10.0, "{}", question["map"]);
    }
    for bad in [
        "{\"evodrive_driver\":1,\"map_m\":0}",
        "{\"evodrive_driver\":1,\"map_m\":1e9}",
        "{\"evodrive_driver\":1,\"map\":true}",
    ] {
        let Err(NoOutcome::Stop(error)) = asked(bad).0 else { panic!("{bad}") };
        assert!(error.to_string().contains("\"map_m\" from 1 to 200"), "{error}");
    }
}

#[test]
fn several_processes_drive_at_once_and_no_more_than_may() {
    let drives = |processes: usize, together: usize| {
        let inside = Arc::new((Mutex::new((0, 0)), std::sync::Condvar::new()));
        let meet = inside.clone();
        let answer = move |question: &Value, lines: usize| {
            if question["step"] == 0 {
                let (counts, changed) = &*meet;
                let mut now = counts.lock().unwrap();
                *now = (now.0 + 1, now.1.max(now.0 + 1));
                changed.notify_all();
                // Whoever comes first waits for the others; the limit is only met where they cannot come.
                let (mut now, _) =
                    changed.wait_timeout_while(now, Duration::from_secs(20), |now| now.1 < together).unwrap();
                now.0 -= 1;
            }
            plain(question, lines)
        };
        let (start, options) =
            (Fake(answer, AtomicUsize::new(0), Mutex::default()), DriverOptions { processes, ..options(0.0) });
        let planners = Planners::new(&options, &start);
        let backend = options.backend(&SimulatorOptions::SHIPPED).unwrap();
        let behind = Backend::Other { options: &backend, answers: &planners };
        let seeds: Vec<u64> = (0..6).collect();
        let outcomes = crate::kernel::Threads::new(3).unwrap().map(&seeds, |_, seed| {
            behind
                .rollout(
                    &plant(&crossing(*seed, 3, 91)),
                    &Intervention::default(),
                    &options.policy().unwrap(),
                    DriveContext::plain(Seed(1)),
                )
                .unwrap()
        });
        let most = inside.0.lock().unwrap().1;
        (outcomes, most, start.1.load(Ordering::SeqCst))
    };
    let (one, alone, started) = drives(1, 1);
    assert_eq!((alone, started), (1, 1));
    let (three, most, started) = drives(3, 3);
    assert_eq!((three, most, started), (one, 3, 3));
}

mod asked;
