//! Tests on which cards come from an attempt, who may read them, and when.

use std::collections::BTreeMap;

use proptest::prelude::*;

use super::*;
use crate::kernel::Digest;
use crate::objects::*;

fn words(list: &[&str]) -> Vec<String> {
    list.iter().map(|word| word.to_string()).collect()
}

fn program(lineage: &str, family: &str, tags: &[&str]) -> Program {
    let module = MechanismModule {
        slot: "actor_score".into(),
        inputs: Vec::new(),
        output: ValueType::Number,
        expression: "1".into(),
        tags: words(tags),
    };
    Program {
        solution_id: SolutionId::new(format!("{lineage}/parent")),
        lineage_id: LineageId::new(lineage),
        source_family: FamilyName::new(family),
        generation: 0,
        parameters: BTreeMap::new(),
        operator_graph: BTreeMap::new(),
        scenario_conditioned_policy: Vec::new(),
        mechanism_modules: BTreeMap::from([("m".to_string(), module)]),
        compile_contract: CompileContract { backend: "metadrive".into(), constraints: Vec::new() },
        ancestor_chain: Vec::new(),
    }
}

fn card(id: &str, lineage: &str, epoch: u32, shareable: bool) -> Card {
    Card {
        id: CardId::new(id),
        kind: CardKind::Failure,
        lineage: LineageId::new(lineage),
        family: FamilyName::new("cat"),
        epoch,
        attempt: None,
        text: String::new(),
        mechanism_tags: Vec::new(),
        scene_tags: Vec::new(),
        shareable,
    }
}

const WEIGHTS: MemoryOptions = MemoryOptions {
    alpha_lineage: 1.0,
    alpha_family: 0.5,
    alpha_mechanism: 1.0,
    alpha_scene: 0.5,
    alpha_recency: 0.5,
    alpha_future: 100.0,
    top_m: 8,
    taking: Taking::Mixed,
};

const CURATION: CurationOptions = CurationOptions { attack_low: 0.2, realism_low: 0.8, digits: 3, text_chars: 240 };

fn context<'a>(family: &'a FamilyName, scenes: &'a [String], private: &'a [String]) -> CurationContext<'a> {
    CurationContext { family, scene_tags: scenes, private_vocabulary: private, options: &CURATION }
}

fn attempt(slot: u32, exit: Exit) -> Attempt {
    let lineage = LineageId::new("cat-idm");
    Attempt {
        id: AttemptId::at(&lineage, 2, slot),
        parent: SolutionId::new("cat-idm/parent"),
        lineage,
        epoch: 2,
        slot,
        parent_hash: Digest::of_bytes(b"p"),
        target: String::new(),
        memory_shown: Vec::new(),
        proposal: Proposal::default(),
        exit,
    }
}

fn candidate(tags: &[&str]) -> Box<Candidate> {
    Box::new(Candidate {
        program: program("cat-idm", "cat", tags),
        program_hash: Digest::of_bytes(b"c"),
        patch_hash: Digest::of_bytes(b"d"),
        mechanism_tags: words(tags),
    })
}

fn route(decision: RouteDecision, attack: f64) -> Route {
    Route {
        decision,
        reason: String::new().into(),
        snapshot: Digest::of_bytes(b"w"),
        predicted: Objectives { attack, realism: 0.9 },
        uncertainty: 0.123456,
        half_width: Some(Objectives { attack: 0.1, realism: 0.123456 }),
        rank_score: Some(0.0),
        weight: None,
        pilot: None,
    }
}

fn evaluated(tags: &[&str], routed: Route, labels: [f64; 2], accepted: bool) -> Exit {
    Exit::Evaluated {
        gates: GateReport::default(),
        candidate: candidate(tags),
        route: routed,
        score: Score {
            objectives: Objectives { attack: labels[0], realism: labels[1] },
            realism_all: labels[1],
            coverage: 1.0,
            scenes: Vec::new(),
            failures: Vec::new(),
            benchmark: None,
            rules: Default::default(),
        },
        decision: Decision {
            promoted: false,
            on_front: accepted,
            race: None,
            gates: Box::new(AcceptanceGates {
                densification: Densification { holds: accepted, non_dominated: accepted, ..Densification::default() },
                parent_tradeoff: ParentTradeoff {
                    attack_change: 0.1234,
                    realism_change: -0.05,
                    ..ParentTradeoff::default()
                },
                coverage: CoverageFloor { holds: true, coverage: 0.5, parent: 0.5, floor: 0.4 },
                differing_scenes: 3,
                ..AcceptanceGates::default()
            }),
        },
    }
}

fn cards_of(exit: Exit, private: &[&str]) -> Vec<Card> {
    let (family, scenes, private) = (FamilyName::new("cat"), words(&["junction"]), words(private));
    curate(&attempt(5, exit), &context(&family, &scenes, &private))
}

fn invalid(gate: Gate) -> Exit {
    let verdict = GateVerdict { gate, problems: words(&["/parameters/gain: found 9.123456, expected 0..1"]) };
    Exit::Invalid { gates: GateReport { verdicts: vec![verdict] } }
}

#[test]
fn an_invalid_patch_leaves_a_failure_card_that_stays_in_its_lineage() {
    let cards = cards_of(invalid(Gate::Interface), &[]);
    assert_eq!(cards.len(), 1);
    assert_eq!((cards[0].kind, cards[0].shareable), (CardKind::Failure, false));
    assert_eq!(cards[0].text, "Refused by gates; interface: /parameters/gain: found 9.123, expected 0..1");
    assert_eq!(cards[0].id.as_str(), "cat-idm/e2s5#0");
}

#[test]
fn an_accepted_candidate_leaves_its_numbers_at_home_and_a_motif_for_others() {
    let cards = cards_of(evaluated(&["pressure", "merge"], route(RouteDecision::Select, 0.5), [0.6, 0.95], true), &[]);
    let kinds: Vec<_> = cards.iter().map(|c| (c.kind, c.shareable)).collect();
    assert_eq!(kinds, [(CardKind::Success, false), (CardKind::Success, true)]);
    assert_eq!(
        cards[0].text,
        "Accepted by densification: attack 0.600, realism 0.950, change to the parent: attack 0.123, realism -0.050."
    );
    assert_eq!(cards[1].text, "Mechanism merge + pressure was accepted in scenes: junction.");
}

#[test]
fn a_tag_of_the_family_or_with_a_number_in_it_never_crosses() {
    let tags = ["cat_prior", "score_0.97", "pressure"];
    let cards = cards_of(evaluated(&tags, route(RouteDecision::Select, 0.5), [0.6, 0.95], true), &["cat_prior"]);
    let shared: Vec<&Card> = cards.iter().filter(|c| c.shareable).collect();
    assert_eq!(shared.len(), 1);
    assert_eq!(shared[0].mechanism_tags, ["pressure"]);
    let cards =
        cards_of(evaluated(&["cat_prior"], route(RouteDecision::Select, 0.5), [0.6, 0.95], true), &["cat_prior"]);
    assert!(cards.iter().all(|c| !c.shareable), "nothing may cross, so there is no motif");
}

#[test]
fn a_weak_candidate_leaves_the_reason_of_its_weakness() {
    let cards = cards_of(evaluated(&["pressure"], route(RouteDecision::Select, 0.5), [0.1, 0.95], false), &[]);
    assert!(cards[0].text.starts_with("Not accepted, had low attack: "), "{}", cards[0].text);
    assert_eq!(cards[1].text, "Mechanism pressure had low attack in scenes: junction.");
}

#[test]
fn an_accepted_audit_of_a_weak_prediction_is_a_false_rejection() {
    let wrong = |decision, predicted| {
        let cards = cards_of(evaluated(&[], route(decision, predicted), [0.6, 0.95], true), &[]);
        cards.iter().any(|c| c.text.starts_with("World evaluator was wrong"))
    };
    assert!(wrong(RouteDecision::Audit, 0.05));
    assert!(!wrong(RouteDecision::Audit, 0.5));
    assert!(!wrong(RouteDecision::Select, 0.05));
}

#[test]
fn a_turned_away_candidate_teaches_nothing() {
    let exit = || Exit::Rejected {
        gates: GateReport::default(),
        candidate: candidate(&["pressure"]),
        route: route(RouteDecision::Reject, 0.05),
    };
    assert!(cards_of(exit(), &[]).is_empty());
    assert_eq!(hint(&[attempt(0, exit()), attempt(1, exit())]), None, "nor does an epoch of them");
}

#[test]
fn an_accepted_candidate_that_the_front_dominates_is_no_success() {
    let mut exit = evaluated(&["pressure"], route(RouteDecision::Select, 0.5), [0.6, 0.95], true);
    if let Exit::Evaluated { decision, .. } = &mut exit {
        decision.on_front = false;
    }
    let cards = cards_of(exit, &[]);
    assert!(cards.iter().all(|card| card.kind == CardKind::Failure), "{cards:?}");
    assert!(cards[0].text.starts_with("A step from its parent, but dominated"), "{}", cards[0].text);
}

fn of_attempt(id: &str, kind: CardKind, slot: u32) -> Card {
    let attempt = Some(AttemptId::at(&LineageId::new("cat-idm"), 1, slot));
    Card { kind, attempt, ..card(id, "cat-idm", 1, false) }
}

fn shown(cards: Vec<Card>, front: &[AttemptId], top_m: usize) -> Vec<String> {
    let (mut memory, parent) = (Memory::default(), program("cat-idm", "cat", &[]));
    memory.append(cards).unwrap();
    let query = Query { parent: &parent, epoch: 2, scene_tags: &[], front };
    let retrieved = retrieve(&memory, &query, &MemoryOptions { top_m, ..WEIGHTS });
    retrieved.into_iter().map(|(card, _)| card.id.to_string()).collect()
}

#[test]
fn front_members_always_have_their_card_and_what_the_front_left_behind_is_no_success() {
    let successes = || (0..4).map(|slot| of_attempt(&format!("s{slot}"), CardKind::Success, slot)).collect::<Vec<_>>();
    let front: Vec<AttemptId> = [1, 2, 3].map(|slot| AttemptId::at(&LineageId::new("cat-idm"), 1, slot)).into();
    let mut cards = successes();
    cards.push(of_attempt("f", CardKind::Failure, 7));
    assert_eq!(shown(cards.clone(), &front, 2), ["s1", "s2", "s3"], "more than M, and not s0");
    assert_eq!(shown(cards.clone(), &front, 4), ["s1", "s2", "s3", "f"]);
    assert_eq!(shown(cards, &[], 4), ["f"]);
}

#[test]
fn an_attempt_and_a_kind_have_a_cap() {
    let failures = (0..6).map(|slot| of_attempt(&format!("f{slot}"), CardKind::Failure, slot));
    let critic = of_attempt("z", CardKind::Critic, 0);
    let mut other = of_attempt("y", CardKind::Critic, 9);
    other.id = CardId::new("y");
    let cards: Vec<Card> = failures.chain([critic, other]).collect();
    assert_eq!(shown(cards, &[], 6), ["f0", "f1", "f2", "y"], "z is a second card of f0's attempt");
}

#[test]
fn objections_of_critics_become_one_card() {
    let review = |role, decision, blockers: &[&str]| Review {
        role,
        decision,
        blockers: words(blockers),
        repair_hints: Vec::new(),
        risk_tags: Vec::new(),
        scope: "pre_simulation".into(),
    };
    let mut declined = attempt(1, Exit::Declined { reason: "not JSON".into() });
    declined.proposal.rounds.push(Round {
        patch: None,
        reviews: vec![
            review(Role::AttackCritic, Advice::Approve, &[]),
            review(Role::RealismCritic, Advice::Reject, &["needs a guard"]),
        ],
    });
    let (family, none) = (FamilyName::new("cat"), Vec::new());
    let cards = curate(&declined, &context(&family, &none, &none));
    assert_eq!(cards.len(), 2);
    assert_eq!(cards[1].kind, CardKind::Critic);
    assert_eq!(cards[1].text, "realism_critic: needs a guard");
}

#[test]
fn the_exits_of_an_epoch_give_the_hint() {
    let good = || evaluated(&["a"], route(RouteDecision::Select, 0.5), [0.6, 0.95], true);
    let weak = |tag: &str| evaluated(&[tag], route(RouteDecision::Select, 0.5), [0.1, 0.95], false);
    let of = |exits: Vec<Exit>| hint(&(0..).zip(exits).map(|(slot, exit)| attempt(slot, exit)).collect::<Vec<_>>());
    assert_eq!(of(Vec::new()), None);
    assert_eq!(of(vec![invalid(Gate::Schema), good()]), Some(Hint::Repair));
    assert_eq!(of(vec![weak("a"), weak("b"), good()]), Some(Hint::Reuse));
    assert_eq!(of(vec![weak("a"), weak("a")]), Some(Hint::Diversify));
    assert_eq!(of(vec![weak("a"), weak("b")]), Some(Hint::Pivot));
}

#[test]
fn an_epoch_leaves_a_lineage_card_and_a_reflection_card() {
    let (family, none) = (FamilyName::new("cat"), Vec::new());
    let attempts =
        [attempt(0, invalid(Gate::Schema)), attempt(1, invalid(Gate::Compile)), attempt(2, invalid(Gate::Compile))];
    let active = Objectives { attack: 0.25, realism: 0.9 };
    let cards = reflect(&LineageId::new("cat-idm"), 2, &attempts, active, &context(&family, &none, &none));
    assert_eq!(cards[0].id.as_str(), "cat-idm/e2#lineage");
    assert!(cards[0].text.starts_with("3 proposals: 0 declined, 3 invalid, 0 rejected"), "{}", cards[0].text);
    assert_eq!(cards[1].text, "repair: most proposals never ran; the compile gate refuses most often.");
}

#[test]
fn memory_takes_no_card_twice_and_none_into_the_past() {
    let mut memory = Memory::default();
    memory.append(vec![card("a", "cat-idm", 3, false)]).unwrap();
    assert_eq!(memory.append(vec![card("a", "cat-idm", 3, false)]), Err(MemoryError::Twice(CardId::new("a"))));
    let both = vec![card("b", "cat-idm", 4, false), card("c", "cat-idm", 2, false)];
    assert!(matches!(memory.append(both), Err(MemoryError::Backdated { epoch: 2, last: 4, .. })));
    assert_eq!(memory.cards().len(), 1, "all or nothing");
    memory.append(vec![card("d", "at-idm", 1, false)]).unwrap();
}

#[test]
fn the_score_is_the_weighted_sum_of_the_equation() {
    let parent = program("cat-idm", "cat", &["a", "b"]);
    let scenes = words(&["junction"]);
    let query = Query { parent: &parent, epoch: 6, scene_tags: &scenes, front: &[] };
    let mut one = card("x", "cat-idm", 3, false);
    one.mechanism_tags = words(&["b", "c"]);
    one.scene_tags = words(&["junction", "dense"]);
    let expected = 1.0 + 0.5 + 1.0 / 3.0 + 0.5 * 0.5 + 0.5 / 3.0;
    assert!((score(&one, &query, &WEIGHTS) - expected).abs() < 1e-12);
    one.epoch = 6;
    assert!(score(&one, &query, &WEIGHTS) < -90.0, "the future is penalised");
}

#[test]
fn equal_scores_come_in_order_of_their_ids_and_no_more_than_m() {
    let mut memory = Memory::default();
    memory.append(["c", "a", "b"].map(|id| card(id, "cat-idm", 1, false)).to_vec()).unwrap();
    let parent = program("cat-idm", "cat", &[]);
    let options = MemoryOptions { top_m: 4, ..WEIGHTS };
    let retrieved = retrieve(&memory, &Query { parent: &parent, epoch: 2, scene_tags: &[], front: &[] }, &options);
    assert_eq!(retrieved.iter().map(|(c, _)| c.id.as_str()).collect::<Vec<_>>(), ["a", "b"]);
}

#[test]
fn as_the_paper_has_it_the_best_scores_are_shown_whatever_their_kind_and_attempt() {
    let of = |id: &str, slot| Card { text: id.into(), ..of_attempt(id, CardKind::Success, slot) };
    let (mut memory, parent) = (Memory::default(), program("cat-idm", "cat", &[]));
    memory.append(vec![of("a", 1), of("b", 1), of("c", 2), of_attempt("f", CardKind::Failure, 3)]).unwrap();
    let query = Query { parent: &parent, epoch: 2, scene_tags: &[], front: &[] };
    let shown = |taking| {
        let cards = retrieve(&memory, &query, &MemoryOptions { top_m: 3, taking, ..WEIGHTS });
        cards.into_iter().map(|(card, _)| card.id.to_string()).collect::<Vec<_>>()
    };
    assert_eq!(shown(Taking::TopM), ["a", "b", "c"]);
    assert_eq!(shown(Taking::Mixed), ["f"], "successes that the front left behind are none");
}

#[test]
fn weights_that_are_no_weights_are_named() {
    let bad = MemoryOptions { alpha_scene: f64::NAN, ..WEIGHTS };
    assert_eq!(bad.validate().unwrap_err().option, "alpha_scene");
    assert_eq!(WEIGHTS.validate(), Ok(()));
}

proptest! {
    #[test]
    fn no_later_card_and_no_private_card_of_others_can_be_read(
        drawn in prop::collection::vec((0u32..10, 0usize..3, any::<bool>(), prop::collection::vec("[a-c]", 0..3)), 0..40),
        epoch in 0u32..12,
        weights in prop::collection::vec(0.0..5.0f64, 6),
        top_m in 0usize..50,
    ) {
        let lineages = ["cat-idm", "cat-rl", "at-idm"];
        let mut drawn = drawn;
        drawn.sort();
        let mut memory = Memory::default();
        for (i, (written, line, shareable, tags)) in drawn.iter().enumerate() {
            let mut one = card(&format!("c{i}"), lineages[*line], *written, *shareable);
            one.mechanism_tags = tags.clone();
            memory.append(vec![one]).unwrap();
        }
        let options = MemoryOptions {
            alpha_lineage: weights[0],
            alpha_family: weights[1],
            alpha_mechanism: weights[2],
            alpha_scene: weights[3],
            alpha_recency: weights[4],
            alpha_future: weights[5],
            top_m,
            taking: Taking::Mixed,
        };
        let parent = program("cat-idm", "cat", &["a"]);
        let query = Query { parent: &parent, epoch, scene_tags: &[], front: &[] };
        let retrieved = retrieve(&memory, &query, &options);
        let legal = |c: &Card| c.epoch < epoch && (c.lineage.as_str() == "cat-idm" || c.shareable);
        prop_assert!(retrieved.iter().all(|(c, _)| legal(c)));
        // All are of one kind.
        let most = top_m.div_ceil(2).min(top_m);
        prop_assert_eq!(retrieved.len(), memory.cards().iter().filter(|c| legal(c)).count().min(most));
        prop_assert!(retrieved.windows(2).all(|pair| pair[0].1 >= pair[1].1));

        // What is written later changes nothing that was read.
        let before: Vec<(Card, f64)> = retrieved.into_iter().map(|(c, s)| (c.clone(), s)).collect();
        memory.append(vec![card("later", "cat-idm", 20, true)]).unwrap();
        let after: Vec<(Card, f64)> =
            retrieve(&memory, &query, &options).into_iter().map(|(c, s)| (c.clone(), s)).collect();
        prop_assert_eq!(before, after);
    }
}
