//! A small study carried out with the scripted model: on which scenes programs are compared, who leads, who is a finalist,
//! what has no effect, and that a program which does nothing wins nothing.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use super::{Meter, Mode, Rollouts, Study};
use crate::archive::{MeanOverScenes, PromotionRule, Standing, consider, pf_area_pct};
use crate::backend::Backend;
use crate::epoch::briefs::counsels::Counsels;
use crate::epoch::labelling::labels::Labelling;
use crate::epoch::setting::desk::{Desk, Tools};
use crate::evaluation::{AttackOptions, ContactClass, EvaluationOptions};
use crate::experiment::{Experiment, SceneSource};
use crate::families::grammar;
use crate::kernel::{Digest, Threads};
use crate::llm::{Ask, AskError, Cassette, DraftJudge, Model, Record, RecordMode, Replay, Reply, Request};
use crate::objects::event::{Finalist, Frozen, RunResult, Settled, kind};
use crate::objects::{
    Attempt, LineageId, MechanismModule, OperatorNode, ParameterValue, Program, Role, RouteDecision, Score, Setting,
    Slot, SolutionId, ValueType,
};
use crate::scene::EvolutionSize;
use crate::scripted::Scripted;
use crate::store::{Store, Transcript, read_events};

/// The quickstart's CAT lineage on a few scenes.
pub(super) fn experiment(promotion: PromotionRule, seeds: u32) -> Experiment {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../experiments/quickstart.toml");
    let mut experiment = Experiment::read(&file).unwrap();
    let SceneSource::Synth { count, .. } = &mut experiment.scenes else { panic!("generated scenes") };
    *count = 24;
    experiment.split.evolution = EvolutionSize::Count(10);
    (experiment.split.held_out, experiment.split.window) = (4, 4);
    (experiment.budget.epochs, experiment.budget.slots, experiment.budget.finalists) = (3, 6, 1);
    experiment.lineages.truncate(1);
    experiment.archive.promotion = promotion;
    experiment.archive.level = 0.5;
    // Every contact counts, so that a few scenes hold attacks enough to compare programs by.
    if let EvaluationOptions::Metadrive(options) = &mut experiment.evaluation {
        options.attack = AttackOptions {
            counts: ContactClass::ALL.into(),
            counts_if_avoidable: [].into(),
            when: None,
            requires: Default::default(),
        };
    }
    experiment.seeds = seeds;
    experiment
}

pub(super) fn study(experiment: &Experiment, threads: &Threads) -> Study {
    let scenes = experiment.scenes(&[], threads).unwrap();
    experiment.study(scenes, threads).unwrap()
}

/// Result and events that a run left behind.
pub(super) struct Ran {
    pub root: Digest,
    pub result: RunResult,
    pub frozen: Vec<Frozen>,
    pub attempts: Vec<Attempt>,
    pub settled: Vec<Settled>,
    pub finalists: Vec<Finalist>,
}

pub(super) fn carried_out(experiment: &Experiment) -> Ran {
    carried_out_asking(experiment, None, &Patience::default())
}

/// The same with `open` questions at once, of a model that waits before it answers.
pub(super) fn carried_out_asking(experiment: &Experiment, open: Option<usize>, patience: &Patience) -> Ran {
    carried_out_behind(experiment, open, patience, Backend::Own)
}

/// The same with rollouts of a backend.
pub(super) fn carried_out_behind(
    experiment: &Experiment,
    open: Option<usize>,
    patience: &Patience,
    backend: Backend<'_>,
) -> Ran {
    let threads = Threads::new(2).unwrap();
    let study = study(experiment, &threads);
    let folder = tempfile::tempdir().unwrap();
    let (answers, objects) = (folder.path().join("answers"), folder.path().join("objects"));
    let (answers, objects) = (Store::open(&answers).unwrap(), Store::open(&objects).unwrap());
    let models: BTreeMap<String, Box<dyn Model>> = BTreeMap::from([("scripted".to_string(), Box::new(Scripted) as _)]);
    let recorder = Record::new(&answers, Cassette::new("none"), RecordMode::Missing, models);
    let rollouts = Rollouts::new(&objects, Mode::Reuse);
    let path = folder.path().join("transcript.jsonl");
    let ask = Waiting { ask: &recorder, patience };
    let tools = Tools::new(&study, &ask, &threads, &rollouts, Meter::default()).behind(backend);
    let tools = open.into_iter().fold(tools, Tools::asking_at_once);
    let mut desk = Desk { log: Transcript::create(&path).unwrap(), watch: &mut |_| {}, tools };
    let result = super::run(&study, &mut desk).unwrap();
    let root = desk.log.head();
    let events = read_events(&path).unwrap();
    fn of<T: serde::de::DeserializeOwned>(events: &[crate::store::Event], wanted: &str) -> Vec<T> {
        let bodies = events.iter().filter(|event| event.kind == wanted).map(|event| event.body.clone());
        bodies.map(|body| serde_json::from_value(body).unwrap()).collect()
    }
    Ran {
        root,
        result,
        frozen: of(&events, kind::FROZEN),
        attempts: of(&events, kind::ATTEMPT),
        settled: of(&events, kind::SETTLED),
        finalists: of(&events, kind::FINALIST),
    }
}

/// CAT, AT and ADV-BMT with a memory that they share.
pub(super) fn three_families() -> Experiment {
    let mut experiment = experiment(PromotionRule::LargestHypervolumeGain, 1);
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../experiments/quickstart.toml");
    experiment.lineages = Experiment::read(&file).unwrap().lineages;
    // Whose card it is counts nothing, and many are shown.
    (experiment.memory.alpha_lineage, experiment.memory.alpha_family, experiment.memory.top_m) = (0.0, 0.0, 30);
    experiment
}

#[test]
fn the_order_of_lineages_in_the_file_changes_nothing_that_a_lineage_sees_and_gets() {
    let experiment = three_families();
    let mut reversed = experiment.clone();
    reversed.lineages.reverse();
    let (ran, other) = (carried_out(&experiment), carried_out(&reversed));
    let cards: BTreeMap<&str, &LineageId> =
        ran.settled.iter().flat_map(|of| &of.cards).map(|card| (card.id.0.as_str(), &card.lineage)).collect();
    let foreign = |frozen: &&Frozen| frozen.memory_shown.iter().any(|card| *cards[card.as_str()] != frozen.lineage);
    assert!(ran.frozen.iter().any(|frozen| foreign(&frozen)), "no lineage was shown another one's cards");
    for result in &ran.result.lineages {
        // The keys of questions hold all that a proposer saw. Predictions are left out: where the evaluator only watches, its fit sums
        // labels in the order of the file.
        let of = |ran: &Ran| -> Vec<_> {
            let own = ran.attempts.iter().filter(|attempt| attempt.lineage == result.lineage).cloned();
            let read = |attempt: Attempt| {
                let (score, decision) = (attempt.exit.score().cloned(), attempt.exit.decision().cloned());
                (attempt.id, attempt.parent, attempt.target, attempt.proposal, score, decision)
            };
            own.map(read).collect()
        };
        assert!(of(&ran) == of(&other), "{}", result.lineage);
        assert!(other.result.lineages.contains(result), "{}", result.lineage);
    }
}

#[test]
fn where_the_evaluator_decides_the_order_of_lineages_changes_no_bit_of_what_it_says_of_one() {
    let mut experiment = three_families();
    (experiment.budget.epochs, experiment.budget.slots) = (4, 10);
    let routing = &mut experiment.world.routing;
    (routing.rollout_budget, routing.audit_share, routing.min_labels) = (5, 0.4, 8);
    let ran = carried_out(&experiment);
    let selected = |attempt: &&Attempt| attempt.exit.route().is_some_and(|of| of.decision == RouteDecision::Select);
    assert!(ran.attempts.iter().filter(selected).count() > 10, "nobody was ranked");
    for turn in [1, 2] {
        let mut other = experiment.clone();
        other.lineages.rotate_left(turn);
        let other = carried_out(&other);
        for result in &ran.result.lineages {
            let of = |ran: &Ran| -> Vec<Attempt> {
                ran.attempts.iter().filter(|attempt| attempt.lineage == result.lineage).cloned().collect()
            };
            // An attempt cites the evaluator's snapshot and its predictions.
            let (own, turned) = (of(&ran), of(&other));
            let differs = own.iter().zip(&turned).find(|(own, turned)| own != turned);
            assert!(differs.is_none() && own.len() == turned.len(), "{turn}: {differs:#?}");
            assert!(other.result.lineages.contains(result), "{turn}: {}", result.lineage);
        }
    }
}

/// Number of actors' questions of an epoch that must be open before one of them is answered, with what was met.
#[derive(Default)]
pub(super) struct Patience {
    wanted: usize,
    /// Actors' questions of each epoch so far.
    asked: Mutex<BTreeMap<u32, usize>>,
    /// Questions that were answered while some of their epoch were still to come.
    alone: AtomicUsize,
    /// All questions to actors.
    pub heard: Mutex<Vec<Request>>,
}

/// A model that waits for them. It loses patience after some seconds, so that a run whose questions are never open together ends, too.
struct Waiting<'a> {
    ask: &'a dyn Ask,
    patience: &'a Patience,
}

impl Ask for Waiting<'_> {
    fn ask_with(&self, request: &Request, judge: Option<&dyn DraftJudge>) -> Result<Reply, AskError> {
        let Patience { wanted, asked, alone, heard } = self.patience;
        let actors = request.slot.role == Role::Actor.name() && request.slot.round == 0;
        if actors {
            heard.lock().unwrap().push(request.clone());
        }
        if actors && *wanted > 0 {
            let of_epoch = |more: usize| {
                let mut asked = asked.lock().unwrap();
                let count = asked.entry(request.slot.epoch).or_default();
                *count += more;
                *count
            };
            of_epoch(1);
            let together = (0..1000).any(|_| {
                std::thread::sleep(std::time::Duration::from_millis(5));
                of_epoch(0) >= *wanted
            });
            alone.fetch_add(usize::from(!together), Ordering::Relaxed);
        }
        self.ask.ask_with(request, judge)
    }
}

#[test]
fn questions_of_all_lineages_of_an_epoch_are_open_together_and_the_root_stays() {
    let mut experiment = three_families();
    experiment.budget.epochs = 2;
    let wanted = 3 * experiment.budget.slots as usize;
    let root = carried_out(&experiment).root;
    for open in [wanted, 2 * wanted] {
        let patience = Patience { wanted, ..Patience::default() };
        let ran = carried_out_asking(&experiment, Some(open), &patience);
        assert_eq!(patience.alone.into_inner(), 0, "questions were answered before all {wanted} were there");
        assert_eq!(ran.root, root, "{open} questions open");
    }
    // Fewer than one lineage has: one lineage after the other, its slots in turn.
    assert_eq!(carried_out_asking(&experiment, Some(4), &Patience::default()).root, root);
}

#[test]
fn programs_are_compared_on_the_same_scenes_which_grow_from_window_to_window() {
    let ran = carried_out(&experiment(PromotionRule::LargestHypervolumeGain, 1));
    assert_eq!(ran.frozen.iter().map(|f| f.scenes_so_far).collect::<Vec<_>>(), [4, 8, 10]);
    let mut accepted = 0;
    for attempt in &ran.attempts {
        let Some(gates) = attempt.exit.decision().map(|decision| &decision.gates) else { continue };
        let so_far = ran.frozen[attempt.epoch as usize].scenes_so_far;
        assert!(gates.scenes == 4 || gates.scenes == so_far, "{}: {} scenes", attempt.id, gates.scenes);
        if gates.any() {
            accepted += 1;
            assert_eq!(gates.scenes, so_far, "{} was accepted on fewer scenes than were opened", attempt.id);
            assert!(gates.coverage.coverage > 0.0 && gates.differing_scenes > 0, "{}", attempt.id);
        }
    }
    assert!(accepted > 0, "nothing was accepted, so nothing was shown");
    the_finalists_are_front_leaders_and_head(&ran);
}

/// With a budget of one all others are named as cut.
fn the_finalists_are_front_leaders_and_head(ran: &Ran) {
    let lineage = &ran.result.lineages[0];
    let parent = &lineage.parent.solution;
    let promoted = ran.attempts.iter().filter(|a| a.exit.decision().is_some_and(|decision| decision.promoted));
    let promoted = promoted.filter_map(|a| a.exit.candidate()).map(|c| c.program.solution_id.clone());
    let wanted: BTreeSet<SolutionId> = (lineage.front.iter().map(|point| point.solution.clone()))
        .chain(promoted)
        .chain(ran.settled.last().map(|settled| settled.active.clone()))
        .filter(|solution| solution != parent)
        .collect();
    let measured: Vec<SolutionId> = ran.finalists.iter().map(|f| f.solution.clone()).filter(|s| s != parent).collect();
    let solutions: BTreeSet<SolutionId> = measured.iter().chain(&lineage.cut).cloned().collect();
    assert_eq!(solutions, wanted);
    assert_eq!(measured.len(), wanted.len().min(1), "the budget is one");
}

#[test]
fn finalists_are_chosen_on_scenes_that_no_step_of_the_search_sees() {
    let mut experiment = experiment(PromotionRule::LargestHypervolumeGain, 1);
    let searched = carried_out(&experiment);
    experiment.split.selection = Some(6);
    let ran = carried_out(&experiment);
    let study = study(&experiment, &Threads::new(2).unwrap());
    let ids = |places: &[usize]| -> BTreeSet<String> {
        places.iter().map(|place| study.scenes[*place].scene().id.clone()).collect()
    };
    let (open, chosen_on, closed) = (ids(&study.evolution), ids(&study.selection), ids(&study.held_out));
    assert_eq!((open.len(), chosen_on.len(), closed.len()), (10, 6, 4));
    assert!(chosen_on.is_disjoint(&open) && chosen_on.is_disjoint(&closed));
    let scenes = |score: &Score| score.scenes.iter().map(|label| label.scene.clone()).collect::<BTreeSet<String>>();
    assert!(ran.finalists.len() > 1 && ran.finalists.iter().all(|of| scenes(&of.score) == chosen_on));
    let seen = ran.attempts.iter().filter_map(|of| of.exit.score()).chain(ran.frozen.iter().map(|of| &of.parent_score));
    assert!(seen.map(scenes).all(|of| of.is_subset(&open)));
    // The search is the same one, and the scenes that stay closed are.
    assert_eq!(
        ran.attempts.iter().map(|of| &of.id).collect::<Vec<_>>(),
        searched.attempts.iter().map(|of| &of.id).collect::<Vec<_>>()
    );
    assert!(searched.finalists.iter().all(|of| scenes(&of.score) == open));
}

#[test]
fn two_anchors_take_turns_by_slot() {
    let mut experiment = experiment(PromotionRule::TwoAnchors, 1);
    (experiment.budget.epochs, experiment.budget.slots, experiment.split.window) = (4, 16, 8);
    experiment.world.routing.rollout_budget = 16;
    let ran = carried_out(&experiment);
    let mut both = 0;
    for attempt in ran.attempts.iter().filter(|attempt| attempt.epoch > 0) {
        let settled = &ran.settled[attempt.epoch as usize - 1];
        let anchor = settled.realism_anchor.as_ref().unwrap();
        let expected = if attempt.slot % 2 == 0 { &settled.active } else { anchor };
        assert_eq!(attempt.parent, *expected, "{}", attempt.id);
        both += usize::from(settled.active != *anchor);
    }
    assert!(both > 0, "the anchors were never two programs");
}

#[test]
fn an_epoch_simulates_its_budget_by_the_snapshot_that_it_was_frozen_with() {
    let mut experiment = experiment(PromotionRule::LargestHypervolumeGain, 1);
    let routing = &mut experiment.world.routing;
    (routing.rollout_budget, routing.audit_share, routing.min_labels) = (2, 0.5, 2);
    let ran = carried_out(&experiment);
    let (mut turned_away, mut ranked) = (0, 0);
    for frozen in &ran.frozen {
        let routes: Vec<_> = ran.attempts.iter().filter(|a| a.epoch == frozen.epoch).map(|a| a.exit.route()).collect();
        let routes: Vec<_> = routes.into_iter().flatten().collect();
        assert!(routes.iter().all(|route| route.snapshot == frozen.world), "epoch {}", frozen.epoch);
        let simulated = routes.iter().filter(|route| route.decision != RouteDecision::Reject).count();
        assert_eq!(simulated, routes.len().min(2), "epoch {}", frozen.epoch);
        turned_away += routes.len() - simulated;
        ranked += routes.iter().filter(|route| route.decision == RouteDecision::Select).count();
        let audits = routes.iter().filter(|route| route.decision == RouteDecision::Audit);
        assert!(audits.clone().all(|route| route.weight.is_some_and(|weight| weight >= 1.0)));
    }
    assert!(turned_away > 0 && ranked > 0, "{turned_away} turned away, {ranked} selected: nothing was shown");
}

#[test]
fn repetitions_of_a_lineage_search_on_their_own_and_name_their_group() {
    let mut experiment = experiment(PromotionRule::LargestHypervolumeGain, 2);
    experiment.budget.epochs = 1;
    let ran = carried_out(&experiment);
    let named: Vec<(&str, &str, u32)> =
        ran.result.lineages.iter().map(|l| (l.lineage.as_str(), l.group.as_str(), l.replica)).collect();
    assert_eq!(named, [("cat-idm-s0", "cat-idm", 0), ("cat-idm-s1", "cat-idm", 1)]);
    let patches = |lineage: &str| -> Vec<String> {
        let own = ran.attempts.iter().filter(|attempt| attempt.lineage.as_str() == lineage);
        own.filter_map(|a| a.proposal.patch()).map(|patch| format!("{:?}", patch.operations)).collect()
    };
    assert_ne!(patches("cat-idm-s0"), patches("cat-idm-s1"));
}

/// Does something with a study's labels.
fn labelled<T>(work: impl FnOnce(&Labelling<'_>, &Program) -> T) -> T {
    let threads = Threads::new(2).unwrap();
    let study = study(&experiment(PromotionRule::LargestHypervolumeGain, 1), &threads);
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path()).unwrap();
    let rollouts = Rollouts::new(&store, Mode::Reuse);
    let nobody = Replay::new(Cassette::new("nobody is asked"), "");
    let tools = Tools::new(&study, &nobody, &threads, &rollouts, Meter::default());
    let (spec, counsels) = (&study.lineages[0], Counsels::default());
    let parent = study.parent(spec).unwrap();
    work(&Labelling { study: &study, spec, counsels: &counsels, tools: &tools }, &parent)
}

#[test]
fn an_edit_of_what_nothing_uses_has_no_effect_although_the_program_draws_at_random() {
    labelled(|labelling, parent| {
        let mut parent = parent.clone();
        let choice = parent.operator_graph.get_mut("choice").unwrap();
        choice.kind = "soft_choice".into();
        choice.settings = [("temperature".to_string(), Setting::Number(5.0))].into();
        let window = labelling.study.window(0);
        let trials = |edit: &dyn Fn(&mut Program)| {
            let mut child = parent.clone();
            edit(&mut child);
            labelling.trials(&window, child.hashed().unwrap(), parent.hashed().unwrap()).unwrap()
        };
        let idle = trials(&|child| {
            let gate = null(child).mechanism_modules.remove("nowhere").unwrap();
            child.mechanism_modules.insert("nowhere".into(), gate);
        });
        assert_eq!((idle.problems.len(), idle.compared, idle.differing), (0, 4, 0));
        let shorter = trials(&|child| drop(child.parameters.insert("duration_s".into(), ParameterValue::Number(2.0))));
        assert!(shorter.compared == 3 && shorter.differing > 0, "three are enough once one differs: {shorter:?}");
    });
}

/// The program that leaves every scene alone.
fn null(parent: &Program) -> Program {
    let mut null = parent.clone();
    let gate = MechanismModule {
        slot: "scene_gate".into(),
        inputs: vec!["vehicle_count".into()],
        output: ValueType::Boolean,
        expression: "vehicle_count > 1000".into(),
        tags: vec![],
    };
    null.mechanism_modules.insert("nowhere".into(), gate);
    let (kind, settings) = ("gated_scenes".into(), [("gate".into(), grammar::from_mechanism("nowhere"))].into());
    null.operator_graph.insert("select".into(), OperatorNode { slot: Slot::Select, kind, settings, inputs: vec![] });
    null
}

#[test]
fn a_program_that_does_nothing_adds_no_frontier_area_and_is_never_accepted() {
    labelled(|labelling, parent| {
        let null = null(parent);
        let places = &labelling.study.evolution;
        let before = labelling.score(parent.hashed().unwrap(), places).unwrap();
        let after = labelling.score(null.hashed().unwrap(), places).unwrap();
        assert!(before.coverage > 0.0 && after.coverage == 0.0);
        let options = &labelling.study.archive;
        let gates = consider(
            &Standing { child: &after, parent: &before, front: &[&before] },
            options,
            &MeanOverScenes::default(),
        )
        .unwrap();
        assert!(!gates.any() && !gates.densification.holds && gates.densification.hypervolume_gain == 0.0, "{gates:?}");
        let eligible: Vec<_> = [&after].into_iter().filter(|s| s.coverage > 0.0).map(|s| s.objectives).collect();
        assert_eq!(pf_area_pct(&[before.objectives], &eligible, 3, options), 0.0);
    });
}
