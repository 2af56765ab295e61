//! Small studies whose labels another simulator makes and whose candidates ours ranks: what is predicted, by what, and who is
//! asked.

use std::collections::BTreeSet;
use std::sync::Mutex;

use super::tests::{Patience, Ran, carried_out, carried_out_behind, experiment};
use crate::archive::PromotionRule;
use crate::backend::{Answer, Answers, Backend, BackendError, BackendOptions, PlanAround, Request, WorkerOptions};
use crate::ego::Policy;
use crate::experiment::Experiment;
use crate::kernel::Digest;
use crate::objects::{Attempt, Objectives, Route, RouteDecision, RoutingChoice, WorldModel};
use crate::sim::tell;

/// Another simulator. In it the ego drives by IDM as in ours, or repeats its recording.
struct Theirs {
    repeats: bool,
    asked: Mutex<BTreeSet<Digest>>,
}

impl Answers for Theirs {
    fn answer(&self, request: &Request<'_>) -> Result<Answer, BackendError> {
        let ego = if self.repeats { Policy::Replay } else { Policy::Idm };
        self.asked.lock().unwrap().insert(request.key);
        let reported = tell(request.plant, request.intervention, ego.driver().as_mut());
        Ok(Answer::ReportedRollout(reported.expect("a rollout")))
    }
}

fn backend(plan_around: PlanAround) -> BackendOptions {
    BackendOptions {
        name: "theirs".into(),
        version: "1".into(),
        digest: Digest::of_bytes(b"theirs"),
        options: Default::default(),
        plan_around,
        cassette: "none".into(),
        worker: WorkerOptions { command: vec!["none".into()], workers: 1, seconds: 1.0, retries: 0, rollouts: None },
    }
}

/// Two of six proposals get labels; nobody is drawn.
fn ranked(options: &BackendOptions) -> Experiment {
    let mut experiment = experiment(PromotionRule::LargestHypervolumeGain, 1);
    experiment.split.window = 8;
    experiment.simulator.backend = Some(options.clone());
    (experiment.world.model, experiment.world.ridge_lambda) = (WorldModel::Simulator, 4.0);
    let routing = &mut experiment.world.routing;
    (routing.rollout_budget, routing.choice, routing.audit_share, routing.min_labels) =
        (2, RoutingChoice::Ranked, 0.0, 1000);
    experiment
}

/// The run, and how many distinct rollouts were asked of the other simulator.
fn ran(experiment: &Experiment, options: &BackendOptions, repeats: bool) -> (Ran, usize) {
    let theirs = Theirs { repeats, asked: Mutex::default() };
    let backend = Backend::Other { options, answers: &theirs };
    let ran = carried_out_behind(experiment, None, &Patience::default(), backend);
    let asked = theirs.asked.lock().unwrap().len();
    (ran, asked)
}

/// Returns the route of an attempt that has labels, and its predicted and labelled differences from its parent on its window.
fn compared<'r>(ran: &'r Ran, attempt: &'r Attempt) -> Option<(&'r Route, Objectives, Objectives)> {
    let (route, score) = (attempt.exit.route()?, attempt.exit.score()?);
    let frozen = ran.frozen.iter().find(|frozen| frozen.epoch == attempt.epoch)?;
    let second = frozen.second_parent(attempt.slot);
    let parent = second.map_or(&frozen.parent_score, |second| &second.parent_score).objectives;
    Some((route, route.predicted.less(&parent), score.objectives.less(&parent)))
}

#[test]
fn a_simulator_that_is_like_ours_is_predicted_to_the_bit_and_asked_only_of_those_with_rollouts() {
    let options = backend(PlanAround::Evodrive);
    let (few, asked) = ran(&ranked(&options), &options, false);
    let mut moved = 0;
    for attempt in &few.attempts {
        let Some((route, predicted, label)) = compared(&few, attempt) else { continue };
        let error = label.less(&predicted);
        assert!(error.attack.abs() < 1e-12 && error.realism.abs() < 1e-12, "{}: {error:?}", attempt.id);
        assert_eq!(route.decision, RouteDecision::Select, "{}: nobody waits for labels", attempt.id);
        moved += usize::from(label.attack != 0.0);
    }
    assert!(moved > 0, "no label differs from its parent's, so nothing was shown");
    let mut all = ranked(&options);
    all.world.routing.rollout_budget = 6;
    let (all, asked_of_all) = ran(&all, &options, false);
    assert!(2 * asked < asked_of_all, "{asked} of {asked_of_all} rollouts");
    // Of the first epoch, which both searches begin alike: who has labels gained most of all six.
    let first = |ran: &'static str, of: &Ran| -> Vec<(u32, f64)> {
        let gain = |label: &Objectives| label.attack + label.realism;
        let own = of.attempts.iter().filter(|attempt| attempt.epoch == 0);
        let own: Vec<(u32, f64)> = own.filter_map(|a| Some((a.slot, gain(&compared(of, a)?.2)))).collect();
        assert!(!own.is_empty(), "{ran}");
        own
    };
    let (few, all) = (first("few", &few), first("all", &all));
    let least = few.iter().map(|(_, gain)| *gain).fold(f64::INFINITY, f64::min);
    let others = all.iter().filter(|(slot, _)| !few.iter().any(|(own, _)| own == slot));
    assert!(others.clone().count() > 0 && others.clone().all(|(_, gain)| *gain <= least + 1e-12), "{few:?} of {all:?}");
}

#[test]
fn the_slope_moves_with_labels_of_a_simulator_that_is_not_like_ours() {
    for plan_around in [PlanAround::Evodrive, PlanAround::Backend] {
        let options = backend(plan_around);
        let (other, _) = ran(&ranked(&options), &options, true);
        let off = |attempt: &&Attempt| {
            compared(&other, attempt).is_some_and(|(_, predicted, label)| predicted.attack != label.attack)
        };
        assert!(other.attempts.iter().filter(off).count() > 0, "{plan_around:?}: both simulators agree here");
        let snapshots: BTreeSet<Digest> =
            other.attempts.iter().filter_map(|attempt| Some(attempt.exit.route()?.snapshot)).collect();
        assert!(snapshots.len() > 1, "{plan_around:?}: nothing was learned");
    }
}

#[test]
fn predictions_of_our_own_change_no_label() {
    let options = backend(PlanAround::Evodrive);
    let mut everybody = ranked(&options);
    let routing = &mut everybody.world.routing;
    (routing.rollout_budget, routing.lambda_a, routing.lambda_r) = (6, 1.0, 1.0);
    let (predicted, _) = ran(&everybody, &options, false);
    everybody.world.model = WorldModel::Ridge;
    let (plain, _) = ran(&everybody, &options, false);
    everybody.simulator.backend = None;
    let own = carried_out(&everybody);
    let labels = |ran: &Ran| -> Vec<_> {
        ran.attempts.iter().map(|attempt| attempt.exit.score().map(|score| score.objectives)).collect()
    };
    assert_eq!(labels(&predicted), labels(&plain));
    assert_eq!(labels(&predicted), labels(&own), "what predicts is what labels where both are ours");
    assert_eq!(predicted.result.rollouts, plain.result.rollouts, "rollouts that only predict are none of these");
}
