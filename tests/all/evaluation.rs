//! Metrics worked by hand, and the protocol's promises about caches, failures and order.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};

use evodrive::ego::Policy;
use evodrive::evaluation::metrics::realism::realism;
use evodrive::evaluation::*;
use evodrive::kernel::{Digest, Seed, Threads};
use evodrive::scene::AgentKind;
use evodrive::sim::{
    ActorRef, AdversaryReport, Contact, ContactClass, End, Feasibility, Motion, Outcome, Side, Striker,
};

/// Limits of every kind.
pub fn limits() -> Limits {
    let limit = |bound, tolerance| Limit { bound, tolerance };
    Limits {
        unrolled_m: None,
        speed_mps: None,
        road_users: 100,
        pooled: false,
        off_road_m: limit(0.5, 2.0),
        wrong_way_m: limit(0.0, 10.0),
        acceleration_mps2: limit(6.0, 4.0),
        jerk_mps3: limit(10.0, 20.0),
        slip_mps: limit(0.5, 1.0),
        jump_m: limit(0.1, 1.0),
        kink_m: limit(0.1, 1.0),
        roughness_m: limit(0.1, 0.4),
    }
}

fn weights(map_validity: f64) -> Weights {
    let weights = serde_json::json!({
        "map_validity": map_validity,
        "lane_direction": 0.1,
        "route_completion": 0.05,
        "initial_non_overlap": 0.1,
        "collision_validity": 0.1,
        "parked_obstacles": 0.05,
        "trajectory_continuity": 0.1,
        "bounded_acceleration": 0.2,
        "bounded_jerk": 0.05,
        "bounded_slip": 0.05,
    });
    serde_json::from_value(weights).unwrap()
}

fn options() -> MetadriveOptions {
    let (vehicle, cyclist, pedestrian, fixed) = (limits(), limits(), limits(), limits());
    MetadriveOptions {
        attack: attack_options(),
        metrics: BTreeMap::new(),
        realism: RealismOptions {
            weights: weights(0.2),
            calibration: Box::new(Calibration {
                quantile: 0.95,
                pools: vec![],
                scenes: 0,
                vehicle,
                cyclist,
                pedestrian,
                fixed,
            }),
            mean: Default::default(),
            excuses_recordings: true,
        },
    }
}

/// Returns the options of the shipped experiments.
fn attack_options() -> AttackOptions {
    use ContactClass::*;
    AttackOptions {
        counts: [EgoStrikes, EgoSideswipes, StationaryHit].into(),
        counts_if_avoidable: [CutIn, Crossing, HeadOn, Sideswipe, RearEndEgoStruck].into(),
        when: None,
        requires: Default::default(),
    }
}

/// An adversary that shows nothing.
pub fn report() -> AdversaryReport {
    AdversaryReport {
        actor: ActorRef::Track(0),
        kind: AgentKind::Vehicle,
        acted: true,
        motion: Motion::default(),
        simulated: Feasibility::default(),
        recorded: Some(Feasibility::default()),
        initial_overlap: false,
        struck_bystander: false,
        struck_parked: false,
        route_completion: None,
        of_kind: None,
        of_place: None,
        log_deviation_m_max: Some(1.0),
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
        ego_side: Side::Front,
        other_side: Side::Rear,
        class: ContactClass::CutIn,
        visible_s: Some(2.0),
        avoidable: Some(true),
        fault: None,
        jury: None,
    }
}

fn realism_of(report: AdversaryReport) -> f64 {
    let options = options().realism;
    realism(&outcome(vec![report], None), &options).1
}

#[test]
fn realism_is_the_weighted_sum_worked_by_hand() {
    // The example of docs/OBJECTIVES.md. 1.0 m off the road, bound 0.5, tolerance 2: d = 0.75, weight 0.2. Acceleration 8,
    // bound 6, tolerance 4: d = 0.5, weight 0.2. A struck bystander: d = 0, weight 0.1. Everything else 1:
    // 1 - 0.2*0.25 - 0.2*0.5 - 0.1 = 0.75.
    let mut bad = report();
    bad.simulated.off_road_m = 1.0;
    bad.simulated.acceleration_mps2 = 8.0;
    bad.struck_bystander = true;
    assert!((realism_of(bad) - 0.75).abs() < 1e-12);
    assert_eq!(realism_of(report()), 1.0);
}

/// Name and value of every diagnostic that is not 1.
fn missed(change: impl Fn(&mut AdversaryReport)) -> Vec<(String, f64)> {
    let mut changed = report();
    change(&mut changed);
    let all = realism(&outcome(vec![changed], None), &options().realism).0;
    all.into_iter().filter(|(_, d)| *d < 1.0).collect()
}

#[test]
fn each_diagnostic_is_worked_by_hand_and_no_other_answers_for_it() {
    let one = |name: &str, value: f64| vec![(name.to_string(), value)];
    // Excess over bound (limits()), over tolerance.
    assert_eq!(missed(|r| r.simulated.off_road_m = 1.5), one("map_validity", 0.5));
    assert_eq!(missed(|r| r.simulated.wrong_way_m = 2.5), one("lane_direction", 0.75));
    assert_eq!(missed(|r| r.route_completion = Some(0.25)), one("route_completion", 0.25));
    assert_eq!(missed(|r| r.initial_overlap = true), one("initial_non_overlap", 0.0));
    assert_eq!(missed(|r| r.struck_bystander = true), one("collision_validity", 0.0));
    assert_eq!(missed(|r| r.struck_parked = true), one("parked_obstacles", 0.0));
    assert_eq!(missed(|r| r.simulated.acceleration_mps2 = 7.0), one("bounded_acceleration", 0.75));
    assert_eq!(missed(|r| r.simulated.jerk_mps3 = 25.0), one("bounded_jerk", 0.25));
    assert_eq!(missed(|r| r.simulated.slip_mps = 0.75), one("bounded_slip", 0.75));
    assert_eq!(missed(|r| r.simulated.roughness_m = 0.5), one("trajectory_continuity", 0.0));
    for found in [missed(|r| r.simulated.jump_m = 0.6), missed(|r| r.simulated.kink_m = 0.6)] {
        assert!(found.len() == 1 && found[0].0 == "trajectory_continuity" && (found[0].1 - 0.5).abs() < 1e-12);
    }
}

#[test]
fn only_the_excess_over_the_adversary_s_own_recording_counts() {
    let with_own = |own: f64| {
        missed(|r| {
            r.simulated.acceleration_mps2 = 8.0;
            r.recorded = Some(Feasibility { acceleration_mps2: own, ..Feasibility::default() });
        })
    };
    assert_eq!(with_own(8.0), vec![]);
    assert_eq!(with_own(7.0), [("bounded_acceleration".to_string(), 0.75)]);
    assert_eq!(with_own(3.0), [("bounded_acceleration".to_string(), 0.5)], "the bound of its kind stands beside it");
}

#[test]
fn the_worst_adversary_counts_for_each_diagnostic() {
    let (mut one, mut two) = (report(), report());
    one.simulated.jump_m = 0.6;
    two.simulated.wrong_way_m = 5.0;
    let options = options().realism;
    let (all, score) = realism(&outcome(vec![one, two], None), &options);
    assert!(all.keys().eq(options.weights().iter().map(|(name, _)| name)), "by name, in one order");
    assert!((all["trajectory_continuity"] - 0.5).abs() < 1e-12 && all["lane_direction"] == 0.5);
    assert!((score - 0.9).abs() < 1e-12);
}

#[test]
fn a_rollout_in_which_nothing_was_changed_is_fully_realistic() {
    let options = options().realism;
    assert_eq!(realism(&outcome(vec![], None), &options).1, 1.0);
}

/// One rollout's contact worked by hand: class, whether it could be avoided, what our label and published work make of it.
#[test]
fn the_attack_label_counts_what_the_ego_caused_or_could_have_avoided() {
    use ContactClass::*;
    use evodrive::evaluation::metrics::attack::{attack, published};
    let label = |class, avoidable, adversary| {
        let struck = outcome(vec![], Some(Contact { class, avoidable, ..contact(adversary) }));
        let published = published(&struck);
        (attack(&struck, &attack_options()), published.adversary_contact, published.any_contact)
    };
    assert_eq!(label(EgoStrikes, Some(false), true), (1.0, true, true), "its own fault");
    assert_eq!(label(CutIn, Some(true), true), (1.0, true, true), "there was room to brake");
    assert_eq!(label(CutIn, Some(false), true), (0.0, true, true), "there was none; published work counts it");
    assert_eq!(label(RearEndEgoStruck, Some(false), true), (0.0, true, true), "rammed from behind");
    assert_eq!(label(EgoStrikes, None, false), (0.0, false, true), "a bystander, not an adversary");
    assert_eq!(label(CutIn, None, true), (0.0, true, true), "nobody asked whether it could be avoided");
    assert_eq!(attack(&outcome(vec![], None), &attack_options()), 0.0);
}

#[test]
fn attack_options_that_name_a_class_twice_or_none_at_all_are_refused() {
    let read = |text: &str| toml::from_str::<AttackOptions>(text);
    let good = read("counts = [\"ego_strikes\"]\ncounts_if_avoidable = [\"cut_in\"]").unwrap();
    assert!(good.counts.contains(&ContactClass::EgoStrikes) && good.counts.len() == 1);
    let twice = read("counts = [\"cut_in\"]\ncounts_if_avoidable = [\"cut_in\"]").unwrap_err();
    assert!(twice.to_string().contains("names cut_in twice"), "{twice}");
    let none = read("counts = []\ncounts_if_avoidable = []").unwrap_err();
    assert!(none.to_string().contains("counts no class"), "{none}");
    assert!(read("counts = [\"bump\"]\ncounts_if_avoidable = []").is_err());
}

#[test]
fn weights_that_do_not_sum_to_one_and_tolerances_that_hide_or_forbid_everything_are_refused() {
    let mut wrong = options().realism;
    wrong.weights = weights(0.3);
    assert!(wrong.check().unwrap_err().to_string().contains("sum"));
    for tolerance in [0.0, -1.0, f64::INFINITY, f64::NAN] {
        let mut wrong = options().realism;
        wrong.calibration.cyclist.jerk_mps3.tolerance = tolerance;
        assert!(wrong.check().unwrap_err().to_string().contains("calibration.cyclist.jerk_mps3.tolerance"));
    }
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
        meets_anyway: None,
        decision: Written::of(&serde_json::json!({})).unwrap(),
        outcome: outcome(vec![report()], hit.then(|| contact(true))),
    }
}

const SCENES: [&str; 4] = ["a", "b", "c", "d"];

fn evaluate_with(
    label: &Labeller<'_>,
    cache: &Notebook,
    threads: usize,
) -> Result<evodrive::objects::Score, EvaluationError> {
    let subject = Subject {
        program: Digest::of_bytes(b"program"),
        ego: &Policy::Idm,
        simulator: Digest::of_bytes(b"options"),
        seed: Seed(1),
    };
    let scenes: Vec<SceneRef<'_>> = SCENES
        .iter()
        .map(|id| SceneRef { id, digest: Digest::of_bytes(id.as_bytes()), group: None, counsel: None })
        .collect();
    evaluate(&subject, &scenes, label, &EvaluationOptions::Metadrive(options()), cache, &Threads::new(threads).unwrap())
}

#[test]
fn objectives_are_means_over_labelled_scenes_and_failures_are_listed() {
    let label = |i: usize| match i {
        3 => Err("the adversary is missing".to_string().into()),
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

/// Returns the record of a program that never changes anything, though the ego runs into someone.
fn idle(scene: &str) -> RolloutRecord {
    let mut record = labelled(scene, true);
    record.outcome.adversaries[0].acted = false;
    record
}

#[test]
fn a_contact_is_a_success_only_where_the_program_brought_it_about() {
    let met = contact(true).with;
    let other = ActorRef::Track(99);
    let label = |meets_anyway: Option<ActorRef>, struck_acts: bool| {
        let mut record = labelled("a", true);
        // A second adversary acts in any case.
        record.outcome.adversaries[0].acted = struck_acts;
        record.outcome.adversaries.push(AdversaryReport { actor: other, ..report() });
        record.meets_anyway = meets_anyway;
        let score = scene_score(&record, Digest::of_bytes(b"request"), Digest::of_bytes(b"stored"), &options());
        (score.attack, score.contact.unwrap().anyway)
    };
    assert_eq!(label(None, true), (1.0, false));
    assert_eq!(label(Some(other), true), (1.0, false), "in plain replay the ego runs into somebody else");
    assert_eq!(label(Some(met), true), (0.0, true), "in plain replay the ego runs into the same one");
    assert_eq!(label(None, false), (0.0, false), "whom the ego meets does what it did anyway");
}

#[test]
fn each_thing_that_a_contact_needs_can_be_left_unasked_and_then_counts_nothing() {
    use evodrive::objects::{AttackRequirement::*, Required};
    let met = contact(true).with;
    let label = |(adversary, acted, anyway), requires| {
        let mut record = labelled("a", true);
        record.outcome.adversaries[0].acted = acted;
        record.outcome.contact = Some(contact(adversary));
        record.meets_anyway = Some(met).filter(|_| anyway);
        let mut options = options();
        options.attack.requires = requires;
        scene_score(&record, Digest::of_bytes(b"request"), Digest::of_bytes(b"stored"), &options).attack
    };
    let cases = [((false, true, false), Adversary), ((true, false, false), Acts), ((true, true, true), NotMetAnyway)];
    for (case, missing) in cases {
        let others = [Adversary, Acts, NotMetAnyway].into_iter().filter(|of| *of != missing);
        assert_eq!(label(case, Required::default()), 0.0, "{missing:?} is asked for");
        assert_eq!(label(case, Required::only([missing])), 0.0, "{missing:?}");
        assert_eq!(label(case, Required::only(others)), 1.0, "{missing:?} is not");
    }
    assert_eq!(label((false, false, true), Required::only([])), 1.0, "any crash of the ego");
}

#[test]
fn a_poor_recording_excuses_only_where_the_options_say_so() {
    let mut record = labelled("a", true);
    let own = Feasibility { off_road_m: 50.0, ..Feasibility::default() };
    (record.outcome.adversaries[0].simulated, record.outcome.adversaries[0].recorded) = (own, Some(own));
    let realism = |excuses_recordings| {
        let mut options = options();
        options.realism.excuses_recordings = excuses_recordings;
        scene_score(&record, Digest::of_bytes(b"request"), Digest::of_bytes(b"stored"), &options).realism
    };
    assert_eq!(realism(true), 1.0);
    assert!((realism(false) - 0.8).abs() < 1e-12, "the weight of map_validity is lost: {}", realism(false));
}

#[test]
fn realism_is_of_the_scenes_acted_in_and_the_plain_mean_stands_beside_it() {
    // Example of docs/OBJECTIVES.md: of four scenes two are acted in, with realism 1 and 0.9; one of the two is a success.
    // In a third the ego runs into the adversary that does what it did anyway.
    let label = |i: usize| {
        let mut record = labelled(SCENES[i], i == 0);
        record.outcome.adversaries[0].struck_bystander = i == 1;
        Ok(if i >= 2 { idle(SCENES[i]) } else { record })
    };
    let score = evaluate_with(&label, &Notebook::default(), 2).unwrap();
    assert_eq!(score.scenes.iter().map(|s| s.acted).collect::<Vec<_>>(), [true, true, false, false]);
    assert_eq!((score.objectives.attack, score.coverage), (0.25, 0.5));
    assert!((score.objectives.realism - 0.95).abs() < 1e-12 && (score.realism_all - 0.975).abs() < 1e-12);
    assert!((score.objectives.realism_penalty_pct() - 5.0).abs() < 1e-9);
    // Were the success the less realistic one, realism would be its own.
    let label = |i: usize| {
        let mut record = labelled(SCENES[i], i == 0);
        record.outcome.adversaries[0].struck_bystander = i == 0;
        Ok(if i >= 2 { idle(SCENES[i]) } else { record })
    };
    let score = evaluate_with(&label, &Notebook::default(), 2).unwrap();
    assert!((score.objectives.realism - 0.9).abs() < 1e-12 && (score.realism_all - 0.975).abs() < 1e-12);
    // The paper's plain mean as the objective.
    let mut plain = options();
    plain.realism.mean = evodrive::objects::RealismMean::Plain;
    let by_mean = score_of(score.scenes.clone(), Vec::new(), plain.rules()).unwrap();
    assert!((by_mean.objectives.realism - 0.975).abs() < 1e-12);
    assert_eq!((by_mean.realism_name(), score.realism_name()), ("plain realism", "strict realism"));
}

#[test]
fn a_program_that_acts_nowhere_has_neither_attack_nor_realism_and_adds_no_area() {
    use evodrive::archive::{ArchiveOptions, pf_area_pct};
    let score = evaluate_with(&|i| Ok(idle(SCENES[i])), &Notebook::default(), 2).unwrap();
    assert_eq!((score.objectives.attack, score.objectives.realism, score.coverage), (0.0, 0.0, 0.0));
    assert_eq!(score.realism_all, 1.0, "what the paper's plain mean would have said");
    let options = ArchiveOptions {
        reference: [0.0; 2],
        r0: 0.95,
        a0: 0.3,
        epsilon_r: 0.01,
        epsilon_a: 0.02,
        epsilon_pf: 1e-6,
        level: 0.8,
        coverage_floor: 0.8,
        ..ArchiveOptions::default()
    };
    let parent = evodrive::objects::Objectives { attack: 0.3, realism: 0.6 };
    assert_eq!(pf_area_pct(&[parent], &[score.objectives], 3, &options), 0.0);
    assert!(parent.dominates(&score.objectives));
}

#[test]
fn a_candidate_without_any_label_has_no_score() {
    let error = evaluate_with(&|_| Err("no road".to_string().into()), &Notebook::default(), 2).unwrap_err();
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
    let key = request_key(d("p"), d("s"), d("e"), d("o"), Seed(1), None).unwrap();
    for other in [
        request_key(d("q"), d("s"), d("e"), d("o"), Seed(1), None),
        request_key(d("p"), d("t"), d("e"), d("o"), Seed(1), None),
        request_key(d("p"), d("s"), d("f"), d("o"), Seed(1), None),
        request_key(d("p"), d("s"), d("e"), d("o"), Seed(2), None),
        request_key(d("p"), d("s"), d("e"), d("n"), Seed(1), None),
        request_key(d("p"), d("s"), d("e"), d("o"), Seed(1), Some(d("c"))),
    ] {
        assert_ne!(key, other.unwrap());
    }
}

#[test]
fn the_reading_at_fault_counts_what_nuplans_rule_blames_the_ego_for_and_is_an_expression_like_any() {
    use evodrive::sim::Fault;
    let read = |text: &str| serde_json::from_str::<AttackOptions>(text);
    let attack = read("{\"reading\": \"at_fault\", \"counts\": [], \"counts_if_avoidable\": []}").unwrap();
    assert!(attack.when.as_ref().is_some_and(|when| when.text() == AT_FAULT && when.asks_at_fault()));
    let options = MetadriveOptions { attack, ..options() };
    let score = |fault: Option<Fault>, meets_anyway: Option<ActorRef>| {
        let outcome = outcome(vec![report()], Some(Contact { fault, ..contact(true) }));
        let met = RolloutRecord { meets_anyway, outcome, ..labelled("a", true) };
        scene_score(&met, Digest::of_bytes(b"q"), Digest::of_bytes(b"r"), &options)
    };
    let counted = Fault::ALL.map(|fault| score(Some(fault), None).attack);
    assert_eq!(counted, [0.0, 1.0, 0.0, 1.0, 0.0, 1.0]);
    assert_eq!(score(None, None).attack, 0.0, "who was not asked blames nobody");
    assert_eq!(score(Some(Fault::ActiveFront), Some(ActorRef::Track(0))).attack, 0.0, "plain replay has it, too");
    let clause = score(Some(Fault::ActiveRear), None).contact.and_then(|met| met.fault);
    assert_eq!(clause.as_deref(), Some("active_rear"));
    let both = "{\"reading\": \"at_fault\", \"when\": \"contact\", \"counts\": [], \"counts_if_avoidable\": []}";
    assert!(read(both).unwrap_err().to_string().contains("leave one of them out"));
}

#[test]
fn an_attack_of_ones_own_counts_what_its_expression_says_and_only_what_the_program_did() {
    let formula = |text: &str| OutcomeFormula::try_from(text.to_string());
    let own = |text: &str| {
        let attack = AttackOptions { when: Some(formula(text).unwrap()), ..attack_options() };
        MetadriveOptions { attack, ..options() }
    };
    let score = |outcome: Outcome, meets_anyway: Option<ActorRef>, text: &str| {
        let met = RolloutRecord { meets_anyway, outcome, ..labelled("a", true) };
        scene_score(&met, Digest::of_bytes(b"q"), Digest::of_bytes(b"r"), &own(text)).attack
    };
    let fast = "contact_adversary and contact_speed_mps > 2";
    let met = || outcome(vec![report()], Some(contact(true)));
    assert_eq!(score(met(), None, fast), 1.0);
    assert_eq!(score(met(), None, "contact_adversary and contact_speed_mps > 5"), 0.0, "4 m/s");
    assert_eq!(score(met(), Some(ActorRef::Track(0)), fast), 0.0, "the ego runs into the same one anyway");
    // A near miss has no contact: a severity between 0 and 1, where the program acts.
    let near = "if(contact, 1, (3 - ttc_s_min) / 3)";
    let missed = |acted| {
        let adversary = AdversaryReport { acted, ..report() };
        Outcome { ttc_s_min: Some(0.75), ..outcome(vec![adversary], None) }
    };
    assert_eq!(score(missed(true), None, near), 0.75);
    assert_eq!(score(missed(false), None, near), 0.0);
    assert_eq!(score(Outcome { ttc_s_min: None, ..missed(true) }, None, near), 0.0, "held at 0");
    for (bad, expected) in [
        ("contact and", "end"),
        ("contact_sped_mps > 2", "contact_speed_mps"),
        ("contact > 2", "number"),
        ("2", "reads nothing of it"),
    ] {
        let error = formula(bad).unwrap_err().to_string();
        assert!(error.contains(expected) && error.contains("evodrive features"), "{error}");
    }
    // Its text is part of what an experiment's digest is made of, and nothing is where none is declared.
    assert!(!serde_json::to_string(&attack_options()).unwrap().contains("when"));
    let written = serde_json::to_string(&own("contact_speed_mps>2").attack).unwrap();
    assert!(written.contains("\"contact_speed_mps > 2\""), "{written}");
    let read: AttackOptions = serde_json::from_str(&written).unwrap();
    assert_eq!(read, own("contact_speed_mps > 2").attack);
}
