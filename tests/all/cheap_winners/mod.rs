//! Every cheap way to win that was thought of, beside the fence that makes it worthless: what it gets with the fence and with the fence
//! taken out. A trick that gets nothing without its fence shows nothing, and fails as well as one that gets through.

mod accepted;
mod staged;
mod tricks;

use std::collections::BTreeSet;
use std::fmt::Write;
use std::sync::{Arc, OnceLock};

use evodrive::ego::Policy;
use evodrive::evaluation::metrics::attack::AttackOptions;
use evodrive::evaluation::metrics::place_of_kind;
use evodrive::evaluation::{MetadriveOptions, RolloutRecord, Written, scene_score};
use evodrive::formats::import_files;
use evodrive::kernel::Digest;
use evodrive::objects::SceneScore;
use evodrive::scene::{PreparedScene, Scene};
use evodrive::sim::{ContactClass, Intervention, SimulatorOptions, rollout_assessed};

use crate::harness::{files, shared};
use crate::realism::{options_of_kind, options_of_place};
use crate::worlds;
use evodrive::compiler::Situation;
use tricks::{Plan, Stage};

/// Scenes looked at; in about one of thirteen the ego runs into somebody without any program.
const SCENES: usize = 400;
/// Of those in which it does not, so many are enough.
const QUIET: usize = 80;
/// Successes that a trick gets without its fence, at least: fewer show nothing.
const TEMPTING_MIN: usize = 4;
/// The paper's rule of what may be reported (section Experiments): realism of at least this.
const REALISM_MIN: f64 = 0.95;

/// What makes a trick worthless.
#[derive(Clone, Copy)]
enum Fence {
    /// These diagnostics of realism. Taken out: their weights go to the others.
    Diagnostics(&'static [&'static str]),
    /// Contacts of these classes count only if the ego could have avoided them. Taken out: all of them count.
    Avoidable(&'static [ContactClass]),
    /// Rams from behind never count. Taken out: they do.
    NoRams,
    /// A road user that does what was recorded does not act. Taken out: whom a program names, it has moved.
    Acting,
    /// What happens in plain replay is no success. Taken out: nobody knows of plain replay.
    PlainReplay,
    /// The ego has to meet a road user that the program moved. Taken out: any contact counts.
    Moved,
}

type Trick = (&'static str, &'static str, Fence, fn(&Stage) -> Option<Plan>);

#[rustfmt::skip]
const TRICKS: [Trick; 24] = [
    ("names whom the ego hits anyway and leaves it alone", "acting", Fence::Acting, tricks::copies_the_log),
    ("nudges whom the ego hits anyway by 0.3 m", "plain replay", Fence::PlainReplay, tricks::nudges_whom_the_ego_hits_anyway),
    ("nudges a bystander where the ego hits somebody anyway", "the one that is met has moved", Fence::Moved, tricks::nudges_a_bystander),
    ("stands up close ahead of the ego", "avoidable", Fence::Avoidable(&[ContactClass::StationaryHit, ContactClass::CutIn, ContactClass::EgoStrikes]), tricks::stands_up_close_ahead),
    ("appears close ahead, slow", "avoidable", Fence::Avoidable(&[ContactClass::CutIn, ContactClass::EgoStrikes]), tricks::appears_slow_close_ahead),
    ("darts across out of the blind side", "avoidable", Fence::Avoidable(&[ContactClass::Crossing]), tricks::darts_across),
    ("rams the ego from behind", "no rams", Fence::NoRams, tricks::rams_from_behind),
    ("a standing car slides slowly into the way", "rolling", Fence::Diagnostics(&["rolling"]), tricks::a_standing_car_slides_slowly),
    ("a standing car turns on the spot into the way", "rolling", Fence::Diagnostics(&["rolling"]), tricks::a_standing_car_turns_on_the_spot),
    ("a moving car slides sideways", "bounded_slip, rolling", Fence::Diagnostics(&["bounded_slip", "rolling"]), tricks::a_moving_car_slides_sideways),
    ("a cyclist keeps pace with cars and cuts in", "speed_of_kind", Fence::Diagnostics(&["speed_of_kind"]), tricks::a_cyclist_keeps_pace_with_cars),
    ("a pedestrian keeps pace with cars and cuts in", "speed_of_kind", Fence::Diagnostics(&["speed_of_kind"]), tricks::a_pedestrian_keeps_pace_with_cars),
    ("a pedestrian sprints into the way", "speed_of_kind", Fence::Diagnostics(&["speed_of_kind"]), tricks::a_pedestrian_sprints_into_the_way),
    ("a pedestrian walks across a motorway", "place_of_kind", Fence::Diagnostics(&["place_of_kind"]), tricks::a_pedestrian_walks_across_a_motorway),
    ("a cyclist rides across a motorway", "place_of_kind", Fence::Diagnostics(&["place_of_kind"]), tricks::a_cyclist_rides_across_a_motorway),
    ("brakes with 2 g", "bounded_acceleration, bounded_jerk", Fence::Diagnostics(&["bounded_acceleration", "bounded_jerk"]), tricks::brakes_with_two_g),
    ("jumps in front of the ego", "trajectory_continuity, bounds of motion", Fence::Diagnostics(&["trajectory_continuity", "bounded_acceleration", "bounded_jerk", "bounded_slip", "rolling", "speed_of_kind"]), tricks::jumps_in_front),
    ("shakes until it touches the ego", "bounds of motion", Fence::Diagnostics(&["bounded_acceleration", "bounded_jerk", "bounded_slip", "rolling"]), tricks::shakes),
    ("drives against traffic", "lane_direction", Fence::Diagnostics(&["lane_direction"]), tricks::drives_against_traffic),
    ("comes from off the road", "map_validity", Fence::Diagnostics(&["map_validity"]), tricks::comes_from_off_the_road),
    ("drives through a parked car", "parked_obstacles, collision_validity", Fence::Diagnostics(&["parked_obstacles", "collision_validity"]), tricks::drives_through_a_parked_car),
    ("drives through another car", "collision_validity", Fence::Diagnostics(&["collision_validity"]), tricks::drives_through_another_car),
    ("appears within another car", "initial_non_overlap, collision_validity", Fence::Diagnostics(&["initial_non_overlap", "collision_validity"]), tricks::appears_in_another_car),
    ("appears within the ego", "initial_non_overlap", Fence::Diagnostics(&["initial_non_overlap"]), tricks::appears_in_the_ego),
];

/// Prepared as an experiment with stricter rules does.
fn prepared(scene: Arc<Scene>, ego: &Policy) -> Situation {
    let simulator = SimulatorOptions { of_kind: true, of_place: true, ..SimulatorOptions::SHIPPED };
    Situation::under(PreparedScene::new(scene), ego, &simulator).expect("an undisturbed rollout")
}

fn attack(counts: &[ContactClass], counts_if_avoidable: &[ContactClass]) -> AttackOptions {
    let set = |classes: &[ContactClass]| classes.iter().copied().collect::<BTreeSet<_>>();
    AttackOptions {
        counts: set(counts),
        counts_if_avoidable: set(counts_if_avoidable),
        when: None,
        requires: Default::default(),
    }
}

/// The classes but rams from behind.
fn no_rams() -> Vec<ContactClass> {
    ContactClass::ALL.into_iter().filter(|class| *class != ContactClass::RearEndEgoStruck).collect()
}

impl Fence {
    /// Rules with the fence. A trick of motion is read as published work reads, where every contact counts: what is left is realism.
    fn rules(self) -> MetadriveOptions {
        let attack = match self {
            Fence::Avoidable(_) | Fence::NoRams => attack(&[], &no_rams()),
            _ => attack(&ContactClass::ALL, &[]),
        };
        // What is out of place on a motorway is also too fast there: each is held by its own fence alone.
        let realism = match self {
            Fence::Diagnostics(names) if names.contains(&place_of_kind::NAME) => options_of_place(),
            _ => options_of_kind(),
        };
        MetadriveOptions { attack, realism, metrics: Default::default() }
    }

    /// Takes the fence out of the rules, or of what they read.
    fn remove(self, rules: &mut MetadriveOptions, record: &mut RolloutRecord) {
        match self {
            Fence::Diagnostics(names) => {
                let mut weights = serde_json::to_value(rules.realism.weights).unwrap();
                let left: f64 =
                    rules.realism.weights().iter().filter(|(name, _)| !names.contains(name)).map(|(_, w)| w).sum();
                for (name, weight) in weights.as_object_mut().unwrap() {
                    let of = if names.contains(&name.as_str()) { 0.0 } else { weight.as_f64().unwrap() / left };
                    *weight = of.into();
                }
                rules.realism.weights = serde_json::from_value(weights).unwrap();
            }
            Fence::Avoidable(classes) => rules.attack = attack(classes, &no_rams()),
            Fence::NoRams => rules.attack = attack(&[ContactClass::RearEndEgoStruck], &no_rams()),
            Fence::Acting => {
                record.meets_anyway = None;
                record.outcome.adversaries.iter_mut().for_each(|adversary| adversary.acted = true);
            }
            Fence::PlainReplay => record.meets_anyway = None,
            Fence::Moved => {
                record.meets_anyway = None;
                if let (Some(contact), Some(first)) =
                    (record.outcome.contact.as_mut(), record.outcome.adversaries.first())
                {
                    (contact.with, contact.adversary) = (first.actor, true);
                }
            }
        }
    }
}

fn label(record: &RolloutRecord, rules: &MetadriveOptions) -> SceneScore {
    scene_score(record, Digest::of_bytes(b"request"), Digest::of_bytes(b"stored"), rules)
}

/// Whether a scene counts as a success of a program that may be reported.
fn wins(label: &SceneScore, fence: Fence) -> bool {
    // Which contacts count is one question, how plausible a motion is another.
    let plausible = label.realism >= REALISM_MIN || !matches!(fence, Fence::Diagnostics(_));
    label.attack > 0.0 && plausible
}

/// What comes of a plan; `None` where a stage has no place for it.
fn played(stage: &Stage, plan: fn(&Stage) -> Option<Plan>) -> Option<RolloutRecord> {
    let (other, actions) = plan(stage)?;
    let situation = other.as_ref().unwrap_or(&stage.situation);
    let driver = &mut *Policy::Idm.driver();
    let outcome = rollout_assessed(&situation.plant, &Intervention { actions }, driver).ok()?;
    Some(RolloutRecord {
        scene: situation.scene.id.clone(),
        scene_digest: situation.digest(),
        program: Digest::of_bytes(b"trick"),
        ego: "idm".into(),
        intervened: true,
        meets_anyway: situation.ego_meets,
        decision: Written::of(&()).unwrap(),
        outcome,
    })
}

/// Scenes in which a trick was tried, and successes with its fence and without.
fn tried(stages: &[Stage], (_, _, fence, plan): &Trick) -> [usize; 3] {
    let mut counted = [0; 3];
    for stage in stages {
        let Some(mut record) = played(stage, *plan) else { continue };
        let mut rules = fence.rules();
        let with = wins(&label(&record, &rules), *fence);
        fence.remove(&mut rules, &mut record);
        let without = wins(&label(&record, &rules), *fence);
        for (count, holds) in counted.iter_mut().zip([true, with, without]) {
            *count += usize::from(holds);
        }
    }
    counted
}

/// Generated scenes with the places in which the ego is to be met.
fn stages() -> &'static [Stage] {
    static STAGES: OnceLock<Vec<Stage>> = OnceLock::new();
    STAGES.get_or_init(|| {
        let options = worlds::options();
        let mut quiet = 0..QUIET;
        let wanted = |of: &Situation| of.ego_meets.is_some() || quiet.next().is_some();
        let scenes = worlds::prepared(&options, 500).take(SCENES).filter(wanted);
        scenes.filter_map(|of| Stage::of(prepared(of.scene, &Policy::Idm))).collect()
    })
}

#[test]
fn no_cheap_winner_passes_its_fence_and_each_wins_without_it() {
    let mut table =
        String::from("| what was tried | fence | scenes | successes with it | without it |\n|---|---|--:|--:|--:|\n");
    let mut wrong = Vec::new();
    for trick in &TRICKS {
        let [scenes, with, without] = tried(stages(), trick);
        writeln!(table, "| {} | {} | {scenes} | {with} | {without} |", trick.0, trick.1).unwrap();
        if without < TEMPTING_MIN || with * 20 > without {
            wrong.push(trick.0);
        }
    }
    println!("{table}");
    assert!(wrong.is_empty(), "{wrong:?}\n{table}");
    insta::assert_snapshot!("cheap_winners", table);
}

/// The recordings are not part of the project; the test says so where they are absent.
#[test]
fn no_cheap_winner_passes_its_fence_on_recorded_scenes_either() {
    let (Some(commonroad), Some(nuscenes)) = (shared("data/commonroad"), shared("data/scenarionet_nuscenes")) else {
        return;
    };
    let paths = [files(&commonroad, ".xml"), files(&nuscenes, "")].concat();
    let scenes = import_files(&paths).scenes.into_iter().map(Arc::new);
    let stages: Vec<Stage> = scenes.filter_map(|scene| Stage::of(prepared(scene, &Policy::Idm))).collect();
    let (mut all, mut wrong) = ([0; 3], Vec::new());
    for trick in &TRICKS {
        let counted = tried(&stages, trick);
        println!("{}: {counted:?}", trick.0);
        all.iter_mut().zip(counted).for_each(|(sum, count)| *sum += count);
        // Recorded scenes are few: one that gets through is luck where many would win without the fence.
        if counted[1] > 1 {
            wrong.push(trick.0);
        }
    }
    let [scenes, with, without] = all;
    println!("all: {with} of {scenes} with a fence, {without} without");
    assert!(wrong.is_empty() && with * 20 <= without && without > 0, "{wrong:?}: {all:?}");
}
