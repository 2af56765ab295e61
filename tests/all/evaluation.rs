//! Metrics worked by hand, and the protocol's promises about caches, failures and order.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};

use evodrive::ego::Policy;
use evodrive::evaluation::metrics::realism::{BinaryDiagnostic, realism};
use evodrive::evaluation::*;
use evodrive::kernel::{Digest, Seed, Threads};
use evodrive::sim::{ActorRef, AdversaryReport, Contact, End, Motion, Outcome, Striker};

fn options() -> MetadriveOptions {
    let soft = |weight, tolerance| Diagnostic { weight, tolerance };
    MetadriveOptions {
        attack: AttackOptions { target: AttackTarget::AdversaryContact },
        realism: RealismOptions {
            map_validity: soft(0.2, 2.0),
            initial_non_overlap: BinaryDiagnostic { weight: 0.1 },
            collision_validity: BinaryDiagnostic { weight: 0.1 },
            route_progress: soft(0.1, 10.0),
            trajectory_continuity: soft(0.1, 1.0),
            bounded_acceleration: BoundedDiagnostic { weight: 0.2, bound: 6.0, tolerance: 4.0 },
            bounded_jerk: BoundedDiagnostic { weight: 0.2, bound: 10.0, tolerance: 20.0 },
        },
    }
}

fn report() -> AdversaryReport {
    AdversaryReport {
        actor: ActorRef::Track(0),
        motion: Motion::default(),
        off_road_m_max: 0.0,
        wrong_way_m: 0.0,
        initial_overlap: false,
        struck_bystander: false,
        jump_m_max: 0.0,
        log_deviation_m_max: Some(0.0),
    }
}

fn outcome(adversaries: Vec<AdversaryReport>, contact: Option<Contact>) -> Outcome {
    Outcome {
        end: if contact.is_some() { End::Contact } else { End::Horizon },
        steps: 80,
        contact,
        distance_m_min: Some(1.0),
        ttc_s_min: None,
        post_encroachment_s_min: None,
        route_completion: 0.5,
        ego_lateral_m_max: 0.1,
        ego: Motion::default(),
        adversaries,
        trace: Digest::of_bytes(b"trace"),
        driving: None,
    }
}

fn contact(adversary: bool) -> Contact {
    Contact {
        with: ActorRef::Track(0),
        adversary,
        time_s: 3.0,
        relative_speed_mps: 4.0,
        impact_angle_rad: 0.0,
        striker: Striker::Other,
    }
}

fn realism_of(report: AdversaryReport) -> f64 {
    let options = options().realism;
    realism(&outcome(vec![report], None), &options).1
}

#[test]
fn realism_is_the_weighted_sum_worked_by_hand() {
    // 0.5 m of 2 m off the road: d = 0.75, weight 0.2. Deceleration 8 of bound 6 and tolerance 4: d = 0.5, weight 0.2.
    // A struck bystander: d = 0, weight 0.1. Everything else 1: 1 - 0.2*0.25 - 0.2*0.5 - 0.1 = 0.75.
    let mut bad = report();
    bad.off_road_m_max = 0.5;
    bad.motion.deceleration_mps2_max = 8.0;
    bad.struck_bystander = true;
    assert!((realism_of(bad) - 0.75).abs() < 1e-12);
    assert_eq!(realism_of(report()), 1.0);
}

#[test]
fn the_worst_adversary_counts_for_each_diagnostic() {
    let (mut one, mut two) = (report(), report());
    one.jump_m_max = 0.5;
    two.wrong_way_m = 5.0;
    let options = options().realism;
    let (all, score) = realism(&outcome(vec![one, two], None), &options);
    assert!(all.keys().eq(options.weights().map(|(name, _)| name).iter()), "by name, in one order");
    assert_eq!((all["trajectory_continuity"], all["route_progress"]), (0.5, 0.5));
    assert!((score - 0.9).abs() < 1e-12);
}

#[test]
fn a_rollout_in_which_nothing_was_changed_is_fully_realistic() {
    let options = options().realism;
    assert_eq!(realism(&outcome(vec![], None), &options).1, 1.0);
}

#[test]
fn contact_with_a_bystander_is_a_target_failure_only_where_the_experiment_says_so() {
    use evodrive::evaluation::metrics::attack::attack;
    let struck = outcome(vec![], Some(contact(false)));
    assert_eq!(attack(&struck, &AttackOptions { target: AttackTarget::AdversaryContact }), 0.0);
    assert_eq!(attack(&struck, &AttackOptions { target: AttackTarget::AnyContact }), 1.0);
}

#[test]
fn weights_that_do_not_sum_to_one_and_zero_tolerances_are_refused() {
    let mut wrong = options().realism;
    wrong.map_validity.weight = 0.3;
    assert!(wrong.check().unwrap_err().to_string().contains("sum"));
    let mut wrong = options().realism;
    wrong.bounded_jerk.tolerance = 0.0;
    assert!(wrong.check().unwrap_err().to_string().contains("bounded_jerk.tolerance"));
    assert_eq!(options().realism.check(), Ok(()));
}

#[derive(Default)]
struct Notebook(Mutex<BTreeMap<Digest, RolloutRecord>>);

impl RolloutCache for Notebook {
    fn recorded(&self, key: &Digest) -> Result<Option<(Arc<RolloutRecord>, Digest)>, CacheError> {
        Ok(self.0.lock().unwrap().get(key).map(|record| (Arc::new(record.clone()), Digest::of_bytes(b"stored"))))
    }

    fn keep(&self, key: &Digest, record: &RolloutRecord) -> Result<Digest, CacheError> {
        self.0.lock().unwrap().insert(*key, record.clone());
        Ok(Digest::of_bytes(b"stored"))
    }
}

fn labelled(scene: &str, hit: bool) -> RolloutRecord {
    RolloutRecord {
        scene: scene.into(),
        scene_digest: Digest::of_bytes(scene.as_bytes()),
        program: Digest::of_bytes(b"program"),
        ego: "idm".into(),
        intervened: true,
        decision: serde_json::json!({}),
        outcome: outcome(vec![report()], hit.then(|| contact(true))),
    }
}

const SCENES: [&str; 4] = ["a", "b", "c", "d"];

fn evaluate_with(
    label: &Labeller<'_>,
    cache: &Notebook,
    threads: usize,
) -> Result<evodrive::objects::Score, EvaluationError> {
    let subject = Subject { program: Digest::of_bytes(b"program"), ego: &Policy::Idm, seed: Seed(1) };
    let scenes: Vec<SceneRef<'_>> = SCENES
        .iter()
        .map(|id| SceneRef { id, digest: Digest::of_bytes(id.as_bytes()), group: None, counsel: None })
        .collect();
    evaluate(&subject, &scenes, label, &EvaluationOptions::Metadrive(options()), cache, &Threads::new(threads).unwrap())
}

#[test]
fn objectives_are_means_over_labelled_scenes_and_failures_are_listed() {
    let label = |i: usize| match i {
        3 => Err("the adversary is missing".to_string()),
        _ => Ok(labelled(SCENES[i], i == 0)),
    };
    let score = evaluate_with(&label, &Notebook::default(), 3).unwrap();
    assert!((score.objectives.attack - 1.0 / 3.0).abs() < 1e-12);
    assert_eq!(score.objectives.realism, 1.0);
    assert_eq!(score.scenes.iter().map(|s| s.scene.as_str()).collect::<Vec<_>>(), ["a", "b", "c"]);
    assert_eq!(
        (score.failures[0].scene.as_str(), score.failures[0].reason.as_str()),
        ("d", "the adversary is missing")
    );
}

#[test]
fn a_candidate_without_any_label_has_no_score() {
    let error = evaluate_with(&|_| Err("no road".into()), &Notebook::default(), 2).unwrap_err();
    assert!(error.to_string().contains("a: no road"), "{error}");
}

#[test]
fn a_recorded_rollout_is_not_simulated_again() {
    let cache = Notebook::default();
    let first = evaluate_with(&|i| Ok(labelled(SCENES[i], true)), &cache, 2).unwrap();
    let again = evaluate_with(&|_| panic!("simulated again"), &cache, 1).unwrap();
    assert_eq!(first, again);
}

#[test]
fn every_part_of_a_rollout_request_is_in_its_key() {
    let d = |text: &str| Digest::of_bytes(text.as_bytes());
    let key = request_key(d("p"), d("s"), d("e"), Seed(1), None).unwrap();
    for other in [
        request_key(d("q"), d("s"), d("e"), Seed(1), None),
        request_key(d("p"), d("t"), d("e"), Seed(1), None),
        request_key(d("p"), d("s"), d("f"), Seed(1), None),
        request_key(d("p"), d("s"), d("e"), Seed(2), None),
        request_key(d("p"), d("s"), d("e"), Seed(1), Some(d("c"))),
    ] {
        assert_ne!(key, other.unwrap());
    }
}
