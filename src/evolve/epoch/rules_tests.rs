//! Rules of ours that the paper does not have: each one that is switched changes what a run comes to.

use std::collections::{BTreeMap, BTreeSet};

use serde_json::{Value, json};

use super::tests::{Ran, carried_out, experiment};
use crate::archive::PromotionRule;
use crate::evaluation::{EvaluationOptions, MetadriveOptions};
use crate::experiment::Experiment;
use crate::objects::{
    ChallengeVerdict, Exit, FrontOf, GatesAsked, JudgedOn, PairOptions, RealismMean, Route, SolutionId, Taking,
    WorldModel,
};

/// Returns the outcome of every proposal, who leads, who is on the front and which cards were shown, but nothing of the questions' wording.
fn came_of(ran: &Ran) -> Value {
    let exit = |exit: &Exit| match exit {
        Exit::Declined { .. } => json!("declined"),
        Exit::Invalid { gates } => json!(gates.failed().map(|verdict| verdict.gate).collect::<Vec<_>>()),
        Exit::Rejected { .. } => json!("rejected"),
        Exit::Evaluated { score, decision, .. } => json!([score.objectives, decision.gates.any(), decision.on_front]),
    };
    let attempts = ran.attempts.iter().map(|attempt| json!([attempt.parent, exit(&attempt.exit)]));
    let settled = ran.settled.iter().map(|settled| json!([settled.active, settled.front]));
    let shown = ran.frozen.iter().map(|frozen| json!(frozen.memory_shown));
    attempts.chain(settled).chain(shown).collect()
}

fn metadrive(experiment: &mut Experiment) -> &mut MetadriveOptions {
    match &mut experiment.evaluation {
        EvaluationOptions::Metadrive(options) => options,
        EvaluationOptions::Safebench { .. } => panic!("not MetaDrive's protocol"),
    }
}

/// A rule by its key, and the switch.
type Rule = (&'static str, fn(&mut Experiment));

/// Rules that the test switches. Those of labels (`evaluation.attack.requires`, `excuses_recordings`) are covered by the labels' own tests.
const RULES: [Rule; 5] = [
    ("evaluation.realism.mean", |of| metadrive(of).realism.mean = RealismMean::Plain),
    ("archive.front", |of| of.archive.front = FrontOf::Evaluated),
    ("memory.taking", |of| of.memory.taking = Taking::TopM),
    ("proposals.effect_gate", |of| of.proposals.effect_gate = false),
    ("proposals.gates", |of| of.proposals.gates = GatesAsked::AfterCritics),
];

#[test]
fn each_rule_that_is_switched_to_the_papers_changes_what_a_run_comes_to() {
    let ours = experiment(PromotionRule::LargestHypervolumeGain, 1);
    // A front of all that was evaluated asks for these.
    let mut base = ours.clone();
    (base.archive.judged_on, base.archive.coverage_floor) = (JudgedOn::Window, 0.0);
    let [ours, by_window] = [&ours, &base].map(|experiment| came_of(&carried_out(experiment)));
    assert!(ours != by_window, "archive.judged_on changes nothing");
    for (key, switch) in RULES {
        let mut switched = base.clone();
        switch(&mut switched);
        assert!(came_of(&carried_out(&switched)) != by_window, "{key} changes nothing");
    }
    // A front of more than the leader offers another parent.
    base.archive.front = FrontOf::Evaluated;
    let with_portfolio = came_of(&carried_out(&base));
    base.archive.portfolio = false;
    assert!(came_of(&carried_out(&base)) != with_portfolio, "archive.portfolio changes nothing");
}

#[test]
fn the_evaluator_of_pairs_decides_who_is_simulated_by_value_and_uncertainty() {
    let mut ours = experiment(PromotionRule::LargestHypervolumeGain, 1);
    ours.budget.epochs = 4;
    let routing = &mut ours.world.routing;
    (routing.rollout_budget, routing.min_labels, routing.audit_share) = (3, 3, 0.0);
    (routing.lambda_a, routing.lambda_r, routing.lambda_u) = (0.05, 0.05, 0.3);
    let mut pairs = ours.clone();
    (pairs.world.model, pairs.world.ridge_lambda, pairs.world.group_labels_min) = (WorldModel::Ridge, 100.0, 1);
    pairs.world.pairs = Some(PairOptions { aggregate: 0.9, abstain_above: 1.0 });
    let [ours, of_pairs] = [&ours, &pairs].map(carried_out);
    assert!(came_of(&ours) != came_of(&of_pairs), "[world.pairs] changes nothing");
    let routes: Vec<_> = of_pairs.attempts.iter().filter_map(|attempt| attempt.exit.route()).collect();
    let words = |route: &Route| String::from(route.reason.clone());
    let known: Vec<_> = routes.iter().filter(|route| !words(route).contains("needed before anybody")).collect();
    let by_value = ["promising and certain", "uncertain or in a sparse region", "low and certain"];
    assert!(!known.is_empty(), "nobody was ever ranked");
    for route in &known {
        assert!(by_value.iter().any(|of| words(route).contains(of)), "{}", words(route));
        assert!(route.uncertainty > 0.0 && route.uncertainty < 1.0, "{}", route.uncertainty);
    }
    let uncertain: BTreeSet<u64> = known.iter().map(|route| route.uncertainty.to_bits()).collect();
    assert!(uncertain.len() > 1, "every candidate is as uncertain as any other");
    // Without the table nobody is told so.
    let routes = ours.attempts.iter().filter_map(|attempt| attempt.exit.route());
    assert!(routes.into_iter().all(|route| !by_value[..2].iter().any(|of| words(route).contains(of))));
}

#[test]
fn whoever_had_a_gain_that_was_not_shown_is_measured_on_until_it_is_or_nothing_is_left() {
    let mut challenged = experiment(PromotionRule::LargestHypervolumeGain, 1);
    (challenged.split.window, challenged.archive.level) = (4, 0.99);
    (challenged.budget.epochs, challenged.budget.slots) = (4, 12);
    challenged.world.routing.rollout_budget = 12;
    assert!(carried_out(&challenged).settled.iter().all(|settled| settled.challenges.is_empty()));
    challenged.archive.challengers = 4;
    let ran = carried_out(&challenged);
    let own = |solution: &SolutionId| {
        ran.attempts.iter().find(|of| of.exit.candidate().is_some_and(|child| child.program.solution_id == *solution))
    };
    let mut seen: BTreeMap<&SolutionId, (u32, ChallengeVerdict)> = BTreeMap::new();
    for settled in &ran.settled {
        assert!(settled.challenges.len() <= 4);
        for challenge in &settled.challenges {
            let attempt = own(&challenge.solution).unwrap();
            let gates = &attempt.exit.decision().unwrap().gates;
            assert!(attempt.epoch < settled.epoch && !gates.any() && gates.coverage.holds);
            assert!(challenge.gates.scenes > gates.scenes, "later looks are on more scenes");
            // Nobody is looked at again whose course is over, and nobody is forgotten between two looks.
            let before = seen.insert(&challenge.solution, (challenge.looks, challenge.verdict));
            let (looks, verdict) = before.unwrap_or((0, ChallengeVerdict::Stays));
            assert_eq!((challenge.looks, verdict), (looks + 1, ChallengeVerdict::Stays));
            let on_front = settled.front.iter().any(|of| of.solution == challenge.solution);
            assert_eq!(challenge.gates.any(), challenge.verdict == ChallengeVerdict::Accepted);
            assert!(challenge.verdict == ChallengeVerdict::Accepted || !on_front);
        }
    }
    let ended = seen.values().filter(|(_, last)| *last != ChallengeVerdict::Stays).count();
    assert!(seen.len() > 2 && ended > 0, "{seen:?}");
}
