//! Small studies under other search methods, and without parts of the system: that each keeps, edits and asks what it should,
//! within its rollouts.

use std::collections::{BTreeMap, BTreeSet};

use super::Without;
use super::tests::{Ran, carried_out, experiment, three_families};
use crate::archive::openevolve::OpenEvolveOptions;
use crate::archive::search::{Method, SearchOptions, TuningOptions};
use crate::archive::{Contender, PromotionRule, SelectorOptions, select_active};
use crate::experiment::Experiment;
use crate::kernel::Digest;
use crate::objects::attempt::Gate;
use crate::objects::{Attempt, Exit, LineageId, Objectives, Role, Score, SolutionId};

/// Rollouts of a lineage: the parent's and five candidates'.
const ROLLOUTS: usize = 60;
const SCENES: usize = 10;

fn searching(method: Method) -> Experiment {
    let mut experiment = experiment(PromotionRule::LargestHypervolumeGain, 1);
    (experiment.split.window, experiment.budget.epochs, experiment.budget.slots) = (SCENES, 8, 4);
    experiment.world.routing.rollout_budget = 4;
    let openevolve = OpenEvolveOptions {
        num_islands: 2,
        archive_size: 4,
        population_size: 20,
        feature_dimensions: vec!["complexity".into(), "diversity".into()],
        feature_bins: 10,
        migration_interval: 2,
        migration_rate: 0.5,
        diversity_reference_size: 20,
        exploration_ratio: 0.2,
        exploitation_ratio: 0.7,
        elite_selection_ratio: 0.1,
    };
    experiment.search = Some(SearchOptions {
        method,
        rollouts: Some(ROLLOUTS),
        attack_weight: Some(0.5).filter(|_| matches!(method, Method::OpenEvolve | Method::HillClimbing)),
        population: Some(3).filter(|_| method == Method::Nsga2),
        edits_max: Some(3).filter(|_| method.draws_patches()),
        tuning: None,
        openevolve: Some(openevolve).filter(|_| method == Method::OpenEvolve),
    });
    experiment
}

fn without(change: impl Fn(&mut Without)) -> Experiment {
    let mut experiment = experiment(PromotionRule::LargestHypervolumeGain, 1);
    let mut parts = Without::default();
    change(&mut parts);
    experiment.without = Some(parts);
    experiment
}

/// Distinct rollouts on evolution scenes that a run's search rested on.
fn rollouts(ran: &Ran) -> usize {
    let parents = ran.frozen.iter().map(|frozen| &frozen.parent_score);
    let scores = parents.chain(ran.attempts.iter().filter_map(|attempt| attempt.exit.score()));
    let requests = |score: &Score| score.scenes.iter().map(|scene| scene.request).collect::<Vec<Digest>>();
    scores.flat_map(requests).collect::<BTreeSet<Digest>>().len()
}

fn roles(ran: &Ran) -> BTreeSet<Role> {
    ran.attempts.iter().flat_map(|attempt| &attempt.proposal.exchanges).map(|exchange| exchange.role).collect()
}

/// Labels of every program of the search.
fn labels(ran: &Ran) -> BTreeMap<SolutionId, Objectives> {
    let parents = ran.frozen.iter().map(|frozen| (frozen.parent.clone(), frozen.parent_score.objectives));
    let child = |attempt: &Attempt| {
        Some((attempt.exit.candidate()?.program.solution_id.clone(), attempt.exit.score()?.objectives))
    };
    parents.chain(ran.attempts.iter().filter_map(child)).collect()
}

/// Checks what holds under every method: the budget is used up and not exceeded, and attempts edit what was frozen for them.
fn holds_everywhere(ran: &Ran, method: Method) {
    let used = rollouts(ran);
    assert!(used <= ROLLOUTS, "{method:?} used {used} rollouts of {ROLLOUTS}");
    assert!(used > ROLLOUTS - SCENES, "{method:?} stopped at {used} rollouts of {ROLLOUTS}");
    let cut = ran
        .attempts
        .iter()
        .filter(|attempt| matches!(&attempt.exit, Exit::Rejected { route, .. } if String::from(route.reason.clone()).contains("is used up")));
    let last = ran.frozen.last().unwrap().epoch;
    assert!(cut.into_iter().all(|attempt| attempt.epoch == last), "{method:?}: only the last epoch runs out");
    for attempt in &ran.attempts {
        let frozen = ran.frozen.iter().find(|frozen| frozen.epoch == attempt.epoch).unwrap();
        let parent = frozen.second_parent(attempt.slot).map_or(&frozen.parent, |second| &second.parent);
        assert_eq!(attempt.parent, *parent, "{method:?}: {}", attempt.id);
        let verdict = attempt.exit.decision().map(|decision| decision.gates.method.as_ref());
        if let Some(verdict) = verdict {
            assert_eq!(verdict.map(|verdict| verdict.method.as_str()), method.replaces_gates().then(|| method.name()));
        }
    }
}

#[test]
fn a_declared_method_of_the_archives_own_changes_nothing() {
    let mut plain = experiment(PromotionRule::LargestHypervolumeGain, 1);
    let before = carried_out(&plain);
    plain.search = Some(SearchOptions {
        method: Method::Pareto,
        rollouts: None,
        attack_weight: None,
        population: None,
        edits_max: None,
        tuning: None,
        openevolve: None,
    });
    plain.without = Some(Without::default());
    let after = carried_out(&plain);
    assert_eq!((after.settled, after.attempts), (before.settled, before.attempts));
}

#[test]
fn the_archive_itself_keeps_to_its_rollouts() {
    holds_everywhere(&carried_out(&searching(Method::Pareto)), Method::Pareto);
}

#[test]
fn attack_alone_accepts_more_attack_whatever_becomes_of_realism() {
    let ran = carried_out(&searching(Method::AttackOnly));
    holds_everywhere(&ran, Method::AttackOnly);
    let mut accepted = 0;
    for decision in ran.attempts.iter().filter_map(|attempt| attempt.exit.decision()) {
        let trade = &decision.gates.parent_tradeoff;
        // At a level of one half every measured gain counts.
        assert_eq!(decision.gates.method.as_ref().unwrap().holds, trade.attack_change > 1e-12, "{trade:?}");
        accepted += usize::from(decision.gates.any());
    }
    let all = labels(&ran);
    let led: Vec<f64> = ran.settled.iter().map(|settled| all[&settled.active].attack).collect();
    assert!(led.windows(2).all(|pair| pair[1] >= pair[0]), "{led:?}");
    assert!(accepted > 0, "nothing was accepted, so nothing was shown");
}

/// Under rotating windows, as the search that a null search is compared with.
fn null(method: Method) -> Experiment {
    let mut experiment = experiment(PromotionRule::LargestHypervolumeGain, 1);
    experiment.search = Some(SearchOptions { rollouts: None, ..searching(method).search.unwrap() });
    experiment
}

#[test]
fn random_proposals_ask_nobody_and_may_lead() {
    let ran = carried_out(&null(Method::RandomProposals));
    assert!(roles(&ran).is_empty());
    let labelled = ran.attempts.iter().filter(|attempt| attempt.exit.score().is_some()).count();
    assert!(labelled > 0, "nothing was labelled, so nothing was shown");
    for attempt in &ran.attempts {
        let frozen = ran.frozen.iter().find(|frozen| frozen.epoch == attempt.epoch).unwrap();
        let parent = frozen.second_parent(attempt.slot).map_or(&frozen.parent, |second| &second.parent);
        assert_eq!(attempt.parent, *parent, "{}", attempt.id);
        assert!(attempt.exit.decision().is_none_or(|decision| decision.gates.method.is_none()), "the gates decide");
    }
}

#[test]
fn numbers_are_set_by_search_and_the_best_of_the_last_look_is_taken() {
    let mut experiment = searching(Method::Numbers);
    let search = experiment.search.as_mut().unwrap();
    (search.rollouts, search.tuning) = (None, Some(TuningOptions { draws: 6, scenes: 2 }));
    (experiment.split.window, experiment.budget.epochs) = (2, 2);
    let ran = carried_out(&experiment);
    assert!(roles(&ran).is_empty());
    let (mut tried, mut moved) = (0, 0);
    for attempt in &ran.attempts {
        let Some(tuned) = &attempt.proposal.tuned else { continue };
        let open = attempt.proposal.rounds[0].patch.as_ref().unwrap();
        let taken = &tuned.draws[tuned.taken];
        assert_eq!(tuned.patch, open.bound(&taken.values), "{}", attempt.id);
        assert_eq!(tuned.draws[0].values, open.free.iter().map(|(name, free)| (name.clone(), free.start)).collect());
        assert_eq!(attempt.proposal.patch(), Some(&tuned.patch));
        assert_eq!(attempt.exit.candidate().unwrap().patch_hash, tuned.patch.hash().unwrap());
        // Looks double, and whoever was taken was best in the longest.
        assert!(tuned.scenes.starts_with(&[2, 4]), "{:?}", tuned.scenes);
        let longest = tuned.draws.iter().map(|draw| draw.looks.len()).max().unwrap();
        assert_eq!(taken.looks.len(), longest);
        let last = tuned.draws.iter().filter(|draw| draw.looks.len() == longest).filter_map(|draw| draw.looks.last());
        let best = taken.looks.last().unwrap();
        let beats = |of: &Objectives| of.realism >= 0.95 && (best.realism < 0.95 || of.attack > best.attack);
        assert!(best.realism >= 0.95 || !last.into_iter().any(beats), "{tuned:?}");
        tried += 1;
        moved += usize::from(tuned.taken > 0);
    }
    assert!(tried > 3 && moved > 0, "{tried} searches, {moved} of them took another setting than the first");
}

#[test]
fn rollouts_that_set_numbers_are_part_of_the_budget() {
    let allowed = 2 * ROLLOUTS;
    let with = |method, tuning| {
        let mut experiment = searching(method);
        let search = experiment.search.as_mut().unwrap();
        (search.rollouts, search.tuning) = (Some(allowed), tuning);
        carried_out(&experiment)
    };
    let ran = with(Method::Numbers, Some(TuningOptions { draws: 4, scenes: 2 }));
    let tuning: usize = ran.attempts.iter().filter_map(|of| of.proposal.tuned.as_ref()).map(|of| of.rollouts).sum();
    assert!(tuning > 0, "no search was paid for");
    assert!(rollouts(&ran) <= allowed);
    let alone = with(Method::RandomProposals, None);
    let labelled = |ran: &Ran| ran.attempts.iter().filter(|of| of.exit.score().is_some()).count();
    assert!(labelled(&ran) < labelled(&alone), "{} {}", labelled(&ran), labelled(&alone));
}

#[test]
fn the_stand_in_leaves_numbers_free_where_a_search_sets_them_and_nowhere_else() {
    let open = |ran: &Ran| {
        let patches = ran.attempts.iter().flat_map(|of| &of.proposal.rounds).filter_map(|round| round.patch.as_ref());
        patches.filter(|patch| !patch.free.is_empty()).count()
    };
    let mut tuned = experiment(PromotionRule::LargestHypervolumeGain, 1);
    assert_eq!(open(&carried_out(&tuned)), 0);
    let tuning = Some(TuningOptions { draws: 4, scenes: 2 });
    let search = searching(Method::Pareto).search.unwrap();
    tuned.search = Some(SearchOptions { rollouts: None, tuning, ..search });
    let ran = carried_out(&tuned);
    assert!(open(&ran) > 0);
    assert!(ran.attempts.iter().any(|of| of.proposal.tuned.is_some()), "no number was set");
}

#[test]
fn shuffled_labels_are_another_candidates_and_decide_in_place_of_its_own() {
    let ran = carried_out(&null(Method::ShuffledLabels));
    let all = labels(&ran);
    let mut swapped = 0;
    for attempt in &ran.attempts {
        let Some(decision) = attempt.exit.decision() else { continue };
        let own = &attempt.exit.candidate().unwrap().program.solution_id;
        let of = decision.gates.labels_of.as_ref().unwrap();
        assert_ne!(of, own, "{}", attempt.id);
        assert!(decision.race.is_none());
        let frozen = ran.frozen.iter().find(|frozen| frozen.epoch == attempt.epoch).unwrap();
        let beside = frozen.second_parent(attempt.slot).map_or(&frozen.parent_score, |second| &second.parent_score);
        let attack = |of: &SolutionId| all.get(of).map(|labels| labels.attack);
        let Some(theirs) = attack(of).filter(|_| decision.gates.scenes == frozen.window.len()) else { continue };
        let change = decision.gates.parent_tradeoff.attack_change;
        assert!((change - (theirs - beside.objectives.attack)).abs() < 1e-9, "{}: {change}", attempt.id);
        swapped += usize::from(attack(own) != attack(of));
    }
    assert!(swapped > 0, "no candidate was judged by other labels than its own");
}

#[test]
fn whoever_leads_has_shown_its_gain_on_as_many_scenes_as_that_took() {
    let mut raced = experiment(PromotionRule::LargestHypervolumeGain, 1);
    let plain = carried_out(&raced);
    let led = |ran: &Ran| ran.attempts.iter().filter(|a| a.exit.decision().is_some_and(|d| d.promoted)).count();
    raced.archive.race = Some(0.95);
    let ran = carried_out(&raced);
    let decisions = || ran.attempts.iter().filter_map(|attempt| attempt.exit.decision());
    let races: Vec<_> =
        decisions().filter_map(|decision| decision.race.as_ref().map(|race| (decision, race))).collect();
    for (decision, race) in &races {
        assert_eq!(race.shown, decision.promoted);
        let (last, before) = race.looks.split_last().unwrap();
        assert_eq!(last.gates.any(), race.shown);
        assert!(before.iter().all(|look| !look.gates.any()), "a race goes on only while nothing is shown");
        assert!(race.looks.windows(2).all(|pair| pair[0].gates.scenes < pair[1].gates.scenes));
        // Each look has its part of 1 - 0.95.
        assert!(race.looks.iter().all(|look| look.level >= 0.95));
    }
    assert!(decisions().all(|decision| !decision.promoted || decision.race.is_some()));
    assert!(races.iter().any(|(_, race)| !race.shown), "luck was not tried");
    assert!(led(&ran) < led(&plain), "{} lead, without a race {}", led(&ran), led(&plain));
}

#[test]
fn at_every_floor_of_realism_the_rule_chooses_again_among_the_same_finalists() {
    let mut experiment = three_families();
    experiment.selector.also_at = Some([0.5, 0.995]);
    let selector = experiment.selector.clone();
    let ran = carried_out(&experiment);
    let mut chosen = BTreeSet::new();
    for lineage in &ran.result.lineages {
        let own = ran.finalists.iter().filter(|of| of.lineage == lineage.lineage);
        let contenders: Vec<Contender> = own
            .map(|of| {
                let (objectives, coverage) = (of.score.objectives, of.score.coverage);
                Contender { solution: of.solution.clone(), objectives, coverage }
            })
            .collect();
        let floors: Vec<f64> = lineage.at_realism.iter().map(|of| of.realism_min).collect();
        assert_eq!(floors, [0.5, selector.realism_min, 0.995]);
        for of in &lineage.at_realism {
            let options = SelectorOptions { realism_min: of.realism_min, ..selector.clone() };
            let wanted = select_active(&contenders, &options).unwrap();
            assert_eq!(of.chosen.solution, wanted.solution, "{} at {}", lineage.lineage, of.realism_min);
            assert_eq!(of.reached, wanted.eligible > 0, "{} at {}", lineage.lineage, of.realism_min);
            chosen.insert((lineage.lineage.clone(), of.chosen.solution.clone()));
        }
        let rule = lineage.at_realism.iter().find(|of| of.realism_min == selector.realism_min).unwrap();
        assert_eq!(rule.chosen, lineage.evolved, "at the rule's own floor it is the active generator");
    }
    assert!(chosen.len() > ran.result.lineages.len(), "no floor chose another program, so nothing was shown");
}

#[test]
fn hill_climbing_edits_the_best_score_so_far() {
    let ran = carried_out(&searching(Method::HillClimbing));
    holds_everywhere(&ran, Method::HillClimbing);
    let score = |of: &Objectives| 0.5 * (of.attack + of.realism);
    let all = labels(&ran);
    for frozen in &ran.frozen {
        let earlier = ran.attempts.iter().filter(|attempt| attempt.epoch < frozen.epoch);
        let scores = earlier.filter_map(|attempt| {
            let acts = attempt.exit.score()?.coverage > 0.0;
            Some(score(&attempt.exit.score()?.objectives)).filter(|_| acts)
        });
        let parent = &ran.frozen[0].parent;
        let best = scores.fold(score(&all[parent]), f64::max);
        assert_eq!(score(&all[&frozen.parent]), best, "epoch {}", frozen.epoch);
    }
}

#[test]
fn random_patches_ask_nobody_lead_nowhere_and_are_legal() {
    let ran = carried_out(&searching(Method::Random));
    holds_everywhere(&ran, Method::Random);
    assert!(roles(&ran).is_empty());
    let parent = ran.frozen[0].parent.clone();
    assert!(ran.settled.iter().all(|settled| settled.active == parent));
    let patches: BTreeSet<String> =
        ran.attempts.iter().map(|attempt| format!("{:?}", attempt.proposal.patch().unwrap().operations)).collect();
    assert!(patches.len() * 10 >= ran.attempts.len() * 9, "{} of {}", patches.len(), ran.attempts.len());
    // What may refuse them is whether the whole can be compiled and does something, not the form of an edit.
    for attempt in &ran.attempts {
        if let Exit::Invalid { gates } = &attempt.exit {
            let failed: BTreeSet<Gate> = gates.failed().map(|verdict| verdict.gate).collect();
            let form = [Gate::Schema, Gate::Parent, Gate::Isolation, Gate::Protected];
            assert!(form.iter().all(|gate| !failed.contains(gate)), "{}: {gates:?}", attempt.id);
        }
    }
    let kept = ran.attempts.iter().filter(|attempt| attempt.exit.decision().is_some_and(|d| d.gates.any())).count();
    assert!(kept > 0 && !ran.settled.last().unwrap().front.is_empty(), "the best of them can be reported");
}

#[test]
fn nsga2_draws_parents_from_a_population_that_it_keeps_small() {
    let ran = carried_out(&searching(Method::Nsga2));
    holds_everywhere(&ran, Method::Nsga2);
    assert!(ran.frozen.iter().all(|frozen| frozen.drawn.len() == 4));
    assert!(roles(&ran).contains(&Role::AttackCritic), "its proposals are the system's");
    let drawn: BTreeSet<&SolutionId> =
        ran.frozen.iter().flat_map(|frozen| &frozen.drawn).map(|drawn| &drawn.parent).collect();
    assert!(drawn.len() > 1, "a population has more than one parent: {drawn:?}");
    // Whoever is drawn was kept when it was labelled.
    for attempt in &ran.attempts {
        let Some(candidate) = attempt.exit.candidate() else { continue };
        let kept = attempt.exit.decision().is_some_and(|d| d.gates.method.as_ref().unwrap().holds);
        assert!(kept || !drawn.contains(&candidate.program.solution_id), "{} was not kept", attempt.id);
    }
}

#[test]
fn openevolve_draws_from_islands_and_asks_no_critic() {
    let ran = carried_out(&searching(Method::OpenEvolve));
    holds_everywhere(&ran, Method::OpenEvolve);
    assert!(roles(&ran).is_subset(&BTreeSet::from([Role::Actor, Role::Repair])), "{:?}", roles(&ran));
    assert!(ran.settled.iter().all(|settled| settled.cards.is_empty()));
    assert!(ran.frozen.iter().all(|frozen| frozen.drawn.len() == 4 && frozen.memory_shown.is_empty()));
    let judged = ran.attempts.iter().filter_map(|attempt| attempt.exit.gates());
    assert!(judged.flat_map(|gates| gates.failed()).all(|v| v.gate != Gate::Effect && v.gate != Gate::Isolation));
    // A worse child is a parent of a later one, which no acceptor by improvement would allow.
    let all = labels(&ran);
    let score = |of: &Objectives| 0.5 * (of.attack + of.realism);
    let first = score(&all[&ran.frozen[0].parent]);
    let drawn: Vec<f64> =
        ran.frozen.iter().flat_map(|f| &f.drawn).map(|drawn| score(&drawn.parent_score.objectives)).collect();
    assert!(drawn.iter().any(|value| *value != first), "only the parent was ever drawn");
    let kept = ran.attempts.iter().filter_map(|a| a.exit.decision()).filter(|d| d.gates.method.as_ref().unwrap().holds);
    assert!(kept.count() > 0);
}

#[test]
fn a_run_under_a_method_is_the_same_twice() {
    for method in [Method::OpenEvolve, Method::Nsga2] {
        let states = |ran: Ran| ran.settled.into_iter().map(|settled| settled.state).collect::<Vec<Digest>>();
        assert_eq!(states(carried_out(&searching(method))), states(carried_out(&searching(method))), "{method:?}");
    }
}

#[test]
fn without_critics_and_repair_nobody_of_them_is_asked() {
    let with = roles(&carried_out(&without(|_| {})));
    assert!(with.contains(&Role::Repair) && with.contains(&Role::IsolationCritic));
    let none = roles(&carried_out(&without(|parts| parts.critics = true)));
    assert!(Role::CRITICS.iter().all(|critic| !none.contains(critic)) && none.contains(&Role::Repair), "{none:?}");
    let none = roles(&carried_out(&without(|parts| parts.repair = true)));
    assert!(!none.contains(&Role::Repair) && none.contains(&Role::AttackCritic), "{none:?}");
}

#[test]
fn without_memory_no_card_is_written_or_shown() {
    let cards = |ran: &Ran| ran.settled.iter().map(|settled| settled.cards.len()).sum::<usize>();
    assert!(cards(&carried_out(&without(|_| {}))) > 0);
    let ran = carried_out(&without(|parts| parts.memory = true));
    assert_eq!(cards(&ran), 0);
    assert!(ran.frozen.iter().all(|frozen| frozen.memory_shown.is_empty()));
}

#[test]
fn without_conditions_or_mechanisms_no_admitted_child_touches_them() {
    let wide = |change: &dyn Fn(&mut Without)| {
        let mut experiment = without(change);
        (experiment.budget.slots, experiment.world.routing.rollout_budget) = (12, 12);
        carried_out(&experiment)
    };
    let touching = |ran: &Ran, part: &str, admitted: bool| {
        let attempts = ran.attempts.iter().filter(|attempt| !admitted || attempt.exit.candidate().is_some());
        let patches = attempts.filter_map(|attempt| attempt.proposal.patch());
        patches.flat_map(|patch| &patch.operations).filter(|operation| operation.path.starts_with(part)).count()
    };
    let whole = wide(&|_| {});
    for (part, open, closed) in [
        ("/scenario_conditioned_policy", &whole, wide(&|parts| parts.conditions = true)),
        ("/mechanism_modules", &whole, wide(&|parts| parts.mechanisms = true)),
    ] {
        assert!(touching(open, part, false) > 0, "{part} is used where it is open");
        assert_eq!(touching(&closed, part, true), 0, "{part}");
        assert!(closed.attempts.iter().any(|attempt| attempt.exit.candidate().is_some()), "{part}: others go on");
    }
}

#[test]
fn without_isolation_neither_its_gate_nor_its_critic_speaks() {
    let ran = carried_out(&without(|parts| parts.isolation = true));
    assert!(!roles(&ran).contains(&Role::IsolationCritic) && roles(&ran).contains(&Role::StructuralCritic));
    let mut failed = ran.attempts.iter().filter_map(|attempt| attempt.exit.gates()).flat_map(|gates| gates.failed());
    assert!(failed.all(|verdict| verdict.gate != Gate::Isolation));
    assert!(ran.attempts.iter().any(|attempt| attempt.exit.candidate().is_some()), "the other gates let some through");
}

#[test]
fn without_the_trade_off_gate_nobody_is_accepted_by_it_alone() {
    let alone = |ran: &Ran| {
        let gates = ran.attempts.iter().filter_map(|attempt| Some(&attempt.exit.decision()?.gates));
        let by_trade = gates.filter(|gates| gates.any() && !gates.densification.holds && !gates.local_push.holds);
        by_trade.count()
    };
    let held = |ran: &Ran| ran.attempts.iter().filter_map(|a| a.exit.decision()).any(|d| d.gates.parent_tradeoff.holds);
    assert!(held(&carried_out(&without(|_| {}))), "the gate holds somewhere in the whole system");
    let ran = carried_out(&without(|parts| parts.tradeoff = true));
    assert!(alone(&ran) == 0 && !held(&ran));
}

#[test]
fn without_audit_the_router_draws_nobody() {
    let mut experiment = without(|parts| parts.audit = true);
    experiment.world.routing.audit_share = 0.5;
    let study = super::tests::study(&experiment, &crate::kernel::Threads::new(1).unwrap());
    assert_eq!(study.world.routing.audit_share, 0.0);
    experiment.without = None;
    let study = super::tests::study(&experiment, &crate::kernel::Threads::new(1).unwrap());
    assert_eq!(study.world.routing.audit_share, 0.5);
    assert_eq!(study.lineages[0].id, LineageId::new("cat-idm"));
}
