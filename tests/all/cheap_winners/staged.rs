//! Cheap ways to win in SafeBench's protocol, on its staged scenes: what of the tricks has a meaning there, and what that protocol alone
//! tempts to. Every staged contact counts in the published reading, so its fences are validity, the four parts of ARS, and who is counted at
//! all. What passes these stops at the preventable reading.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::sync::{Arc, OnceLock};

use evodrive::archive::{Account, ArchiveOptions, Means, Measure};
use evodrive::ego::Policy;
use evodrive::evaluation::{
    CacheError, EvaluationOptions, Group, PreventableOptions, RolloutCache, RolloutRecord, Runs, SafebenchOptions,
    SceneRef, StandingOptions, Subject, evaluate,
};
use evodrive::kernel::{Digest, Pose, Seed, Threads, Vec2};
use evodrive::motion::traffic_family::{actions, standard};
use evodrive::objects::benchmark::SafebenchRun;
use evodrive::objects::{SceneScore, Score};
use evodrive::scene::safebench::{Stage as FamilyStage, TrafficFamily};
use evodrive::scene::{AgentKind, PreparedScene};
use evodrive::sim::{
    Action, ContactClass, Intervention, Outcome, Phase, Plant, Script, Scripts, SimulatorOptions, Trigger, Until,
    rollout_assessed,
};
use evodrive::synth::{FamilyOptions, family_member, family_scene};

use super::accepted::{Verdict, archive, verdict};
use super::tricks::{self, Plan, Stage};
use super::{TEMPTING_MIN, played, prepared};
use crate::harness::{experiment, home};

/// The protocol's bound of what may be reported.
const REALISM_MIN: f64 = 0.8;

/// What makes a trick worthless here. Taken out: the outcome reads as if it had not been measured.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Fence {
    /// Whoever stands within another one at first makes no valid scene.
    Overlap,
    /// Nor does whoever jumps; and what jumps accelerates.
    Jump,
    /// Nor does whoever comes from beyond the road.
    OffRoad,
    /// Accelerations and jerk.
    Kinematics,
    /// Of several the worst one is judged. Taken out: the others are.
    Worst,
    /// A run in which nobody was set off and met is no scenario.
    Acting,
    /// A program acts about as often as its parent.
    Coverage,
    /// The preventable reading. Taken out: the published one.
    Reading,
}

impl Fence {
    fn remove(self, outcome: &mut Outcome) {
        let conducts = outcome.driving.iter_mut().flat_map(|driving| &mut driving.actors);
        match self {
            Fence::Overlap => {
                outcome.adversaries.iter_mut().for_each(|report| report.initial_overlap = false);
                conducts.for_each(|conduct| conduct.ego_gap_m_first = 100.0);
            }
            Fence::Jump => {
                outcome.adversaries.iter_mut().for_each(|report| report.simulated.jump_m = 0.0);
                Fence::Kinematics.remove(outcome);
            }
            Fence::OffRoad => outcome.adversaries.iter_mut().for_each(|report| report.simulated.off_road_m = 0.0),
            Fence::Kinematics => {
                conducts.for_each(|conduct| (conduct.acceleration_mps2_p95, conduct.jerk_mps3_mean) = (0.0, 0.0));
                let reports = outcome.adversaries.iter_mut();
                reports.for_each(|report| report.motion.lateral_acceleration_mps2_max = 0.0);
            }
            Fence::Worst => {
                outcome.adversaries.remove(0);
                outcome.driving.iter_mut().for_each(|driving| {
                    let _ = driving.actors.remove(0);
                });
            }
            Fence::Acting => conducts.for_each(|conduct| conduct.moved = true),
            // Coverage is no part of a single run, and a reading none of what happened.
            Fence::Coverage | Fence::Reading => {}
        }
    }

    /// Options with the fence and without.
    fn options(self) -> [SafebenchOptions; 2] {
        let published = SafebenchOptions { preventable: None, ..preventable() };
        if self == Fence::Reading { [preventable(), published] } else { [published; 2] }
    }
}

type Trick = (&'static str, &'static str, Fence, fn(&Stage) -> Option<Plan>);

#[rustfmt::skip]
const TRICKS: [Trick; 14] = [
    ("appears within the ego", "validity: overlap", Fence::Overlap, tricks::appears_in_the_ego),
    ("jumps in front of the ego", "validity: jump, kinematics", Fence::Jump, tricks::jumps_in_front),
    ("comes from off the road", "validity: off the road", Fence::OffRoad, tricks::comes_from_off_the_road),
    ("shakes until it touches the ego", "kinematics", Fence::Kinematics, tricks::shakes),
    ("a walker dashes out of the published hiding place", "kinematics", Fence::Kinematics, a_walker_dashes),
    ("brakes with 2 g ahead of the ego while another one rams it", "the worst of several counts", Fence::Worst, brakes_before_a_ram),
    ("is never set off", "acting", Fence::Acting, is_never_set_off),
    ("rams in few scenes and is idle elsewhere", "coverage", Fence::Coverage, tricks::rams_from_behind),
    // As its authors score, the protocol has no fence for these: a realism of 0.8 leaves room.
    ("rams the ego from behind", "preventable: no rams", Fence::Reading, tricks::rams_from_behind),
    ("drives against traffic", "preventable: wrong way", Fence::Reading, tricks::drives_against_traffic),
    ("a moving car slides sideways", "preventable: rolling", Fence::Reading, tricks::a_moving_car_slides_sideways),
    ("a standing car slides slowly into the way", "preventable: rolling", Fence::Reading, tricks::a_standing_car_slides_slowly),
    ("a parked thing slides into the way", "preventable: rolling", Fence::Reading, tricks::a_parked_thing_slides_into_the_way),
    ("darts across out of the blind side", "preventable: avoidable", Fence::Reading, tricks::darts_across),
];

/// The one that brakes is the first of both.
fn brakes_before_a_ram(stage: &Stage) -> Option<Plan> {
    let both = [tricks::brakes_with_two_g(stage)?.1, tricks::rams_from_behind(stage)?.1];
    Some((None, both.concat()))
}

/// Somebody behind the ego who waits for it.
fn is_never_set_off(stage: &Stage) -> Option<Plan> {
    let ego = stage.situation.ego.at(stage.situation.first_step())?;
    let script = Script {
        kind: AgentKind::Vehicle,
        length_m: 4.8,
        width_m: 2.0,
        spawn: Pose {
            position: ego.position - Vec2::from_heading(ego.heading_rad) * 12.0,
            heading_rad: ego.heading_rad,
        },
        trigger: Trigger { reference: 0, distance_m: 1.0, ego_speed_mps_min: 0.0 },
        phases: vec![Phase::straight(8.0, Until::Forever)],
    };
    Some((None, vec![Action::Triggered(script)]))
}

/// The published scenario, as late as its contract allows and at a speed that nobody on foot has.
fn a_walker_dashes(stage: &Stage) -> Option<Plan> {
    let family = FamilyStage::of(&stage.situation.scene)?;
    let [_, _, start_m] = standard(family.staging().family)[..] else { return None };
    let walks = family.staging().family == TrafficFamily::StraightObstacle;
    walks.then(|| actions(&family, &[12.0, 8.0, start_m], Scripts::AsDefined).ok().map(|actions| (None, actions)))?
}

/// The bounds of the shipped protocol and of its preventable reading.
fn preventable() -> SafebenchOptions {
    static OPTIONS: OnceLock<SafebenchOptions> = OnceLock::new();
    *OPTIONS.get_or_init(|| {
        let table = experiment("safebench/preventable-idm.toml")["evaluation"]["safebench"].clone();
        SafebenchOptions { selected_per_group: 1, ..table.try_into().expect("the protocol's bounds") }
    })
}

/// A scene that a parent leaves alone and in which it is a valid scenario.
struct Staged {
    stage: Stage,
    group: Group,
    parent: RolloutRecord,
}

fn staged() -> &'static [Staged] {
    static STAGES: OnceLock<Vec<Staged>> = OnceLock::new();
    STAGES.get_or_init(|| {
        let (options, [published, _]) = (FamilyOptions::all(), Fence::Coverage.options());
        let scenes = (0..options.count()).map(|i| Arc::new(family_member(&options, Seed(7), i).unwrap()));
        let of = |scene: Arc<evodrive::scene::Scene>| {
            let stage = Stage::once_fast(prepared(scene, &Policy::Idm))?;
            let group = stage.situation.scene.staging.as_ref().map(|staging| (staging.family, staging.route))?;
            let parent = played(&stage, tricks::keeps_behind)?;
            let (attack, realism) = SafebenchRun::of(&parent.outcome, &published)?.point();
            (attack == 0.0 && realism >= REALISM_MIN).then_some(Staged { stage, group, parent })
        };
        scenes.filter_map(of).collect()
    })
}

fn wins(outcome: &Outcome, options: &SafebenchOptions, fence: Fence) -> bool {
    let Some(run) = SafebenchRun::of(outcome, options) else { return false };
    let (attack, realism) = run.point();
    match fence {
        // Whoever is never set off takes realism that nobody has to earn.
        Fence::Acting => realism >= REALISM_MIN,
        _ => attack > 0.0 && realism >= REALISM_MIN,
    }
}

/// A program's records, scored by the protocol's code.
struct Played {
    score: Score,
    runs: BTreeMap<Digest, (Group, SafebenchRun)>,
}

/// Nothing is kept between two of them.
struct Nothing;

impl RolloutCache for Nothing {
    fn recorded(&self, _: &Digest) -> Result<Option<(Arc<RolloutRecord>, Digest)>, CacheError> {
        Ok(None)
    }

    fn keep(&self, key: &Digest, _: &RolloutRecord) -> Result<Digest, CacheError> {
        Ok(*key)
    }
}

fn scored(name: &str, records: &[(Group, String, RolloutRecord)], safebench: SafebenchOptions) -> Played {
    let options = EvaluationOptions::Safebench { safebench };
    let program = Digest::of_bytes(name.as_bytes());
    let subject = Subject { program, ego: &Policy::Idm, simulator: Digest::of_bytes(b"plain"), seed: Seed(1) };
    let scene = |(group, id, _): &'_ (Group, String, RolloutRecord)| (*group, id.clone());
    let scenes: Vec<(Group, String)> = records.iter().map(scene).collect();
    let of =
        |(group, id)| SceneRef { id, digest: Digest::of_bytes(str::as_bytes(id)), group: Some(group), counsel: None };
    let refs: Vec<SceneRef> = scenes.iter().map(|(group, id)| of((*group, id.as_str()))).collect();
    let label = |i: usize| Ok(records[i].2.clone());
    let threads = Threads::new(1).unwrap();
    let score = evaluate(&subject, &refs, &label, &options, &Nothing, &threads).unwrap();
    let run = |(label, (group, _, record)): (&SceneScore, &(Group, String, RolloutRecord))| {
        (label.request, (*group, SafebenchRun::of(&record.outcome, &safebench).unwrap()))
    };
    let runs = score.scenes.iter().zip(records).map(run).collect();
    Played { score, runs }
}

/// Scores of groups, as the acceptor has them.
struct GroupScores(BTreeMap<Digest, (Group, SafebenchRun)>);

impl Measure for GroupScores {
    fn account(&self, scenes: &[&SceneScore]) -> Account {
        let means = |left_out: Option<usize>| {
            let mut runs = Runs::default();
            let kept = scenes.iter().enumerate().filter(|(place, _)| Some(*place) != left_out);
            kept.filter_map(|(_, scene)| self.0.get(&scene.request)).for_each(|(group, run)| runs.add(*group, *run));
            runs.table().map_or(Means { attack: 0.0, realism: None, coverage: 0.0 }, |of| Means {
                attack: of.attack,
                realism: (of.coverage > 0.0).then_some(of.realism),
                coverage: of.coverage,
            })
        };
        Account { whole: means(None), without: (0..scenes.len()).map(|place| means(Some(place))).collect() }
    }
}

/// Scenes in which a trick was tried, successes with its fence and without, and what acceptance says of each.
fn judged((_, _, fence, plan): &Trick) -> ([usize; 3], [Verdict; 2]) {
    let options = fence.options();
    let (mut counted, mut parents) = ([0; 3], Vec::new());
    let mut children: [Vec<(Group, String, RolloutRecord)>; 2] = Default::default();
    for Staged { stage, group, parent } in staged() {
        let Some(trick) = played(stage, *plan) else { continue };
        let mut fenceless = trick.clone();
        fence.remove(&mut fenceless.outcome);
        let (with, mut works) =
            (wins(&trick.outcome, &options[0], *fence), wins(&fenceless.outcome, &options[1], *fence));
        let idle = || is_never_set_off(stage).and_then(|_| played(stage, is_never_set_off));
        // Few scenes, and nobody elsewhere: what coverage is for.
        let elsewhere = match fence {
            Fence::Coverage => {
                works = works && counted[0] % 4 == 0;
                idle().expect("a place behind the ego")
            }
            _ => parent.clone(),
        };
        for (count, holds) in counted.iter_mut().zip([true, with, works]) {
            *count += usize::from(holds);
        }
        let id = stage.situation.scene.id.clone();
        parents.push((*group, id.clone(), parent.clone()));
        for (child, record) in children.iter_mut().zip([trick, fenceless]) {
            child.push((*group, id.clone(), if works { record } else { elsewhere.clone() }));
        }
    }
    let verdicts = [0, 1].map(|place| {
        let before = scored("parent", &parents, options[place]);
        let after = scored("child", &children[place], options[place]);
        let runs = before.runs.iter().chain(&after.runs).map(|(key, run)| (*key, *run)).collect();
        let floor = if *fence == Fence::Coverage && place == 1 { 0.0 } else { 0.8 };
        let options = ArchiveOptions { coverage_floor: floor, ..archive(REALISM_MIN) };
        let said = verdict((&before.score, &after.score), &options, REALISM_MIN, &GroupScores(runs));
        // Where a reading decides, attack is what it is about: whoever only stays nearer to the ego may be more realistic.
        let gains = *fence != Fence::Reading || after.score.objectives.attack > before.score.objectives.attack;
        Verdict { reported: said.reported && gains, ..said }
    });
    (counted, verdicts)
}

#[test]
fn no_cheap_winner_passes_its_fence_on_staged_scenes_and_each_is_reported_without_it() {
    let mut table = String::from(
        "| what was tried | fence | scenes | successes with it | without it | reported with it | without it |\n|---|---|--:|--:|--:|---|---|\n",
    );
    let mut wrong = Vec::new();
    for trick in &TRICKS {
        let ([scenes, with, without], [closed, open]) = judged(trick);
        let said = |verdict: Verdict| if verdict.reported { "yes" } else { "no" };
        let (name, fence) = (trick.0, trick.1);
        writeln!(table, "| {name} | {fence} | {scenes} | {with} | {without} | {} | {} |", said(closed), said(open))
            .unwrap();
        let tempting = without >= TEMPTING_MIN && open.front && open.leads && open.reported;
        if closed.reported || !tempting {
            wrong.push((name, closed, open));
        }
    }
    println!("{table}");
    assert!(wrong.is_empty(), "{wrong:#?}\n{table}");
    insta::assert_snapshot!("staged", table);
}

/// A body on the ego's way: who, metres beside it to the right at first, turned so much, how fast, for how many metres.
struct Body {
    kind: AgentKind,
    right_m: f64,
    turned_rad: f64,
    mps: f64,
    way_m: f64,
}

/// The ego's run against a body 40 m behind the trigger of a straight road, which sets off when the ego is within 45 m.
fn against(body: &Body, route: u32, ego: &Policy) -> Outcome {
    let scene = Arc::new(family_scene(TrafficFamily::StraightObstacle, route, Seed(7)));
    let way = FamilyStage::of(&scene).expect("a staged scene").ahead(40.0);
    let right = -Vec2::from_heading(way.heading_rad).left();
    let (length_m, width_m) = if body.kind == AgentKind::Pedestrian { (0.6, 0.6) } else { (4.8, 2.0) };
    let script = Script {
        kind: body.kind,
        length_m,
        width_m,
        spawn: Pose { position: way.position + right * body.right_m, heading_rad: way.heading_rad + body.turned_rad },
        trigger: Trigger { reference: 0, distance_m: 45.0, ego_speed_mps_min: 0.0 },
        phases: vec![Phase::straight(body.mps, Until::Driven { m: body.way_m })],
    };
    let options = SimulatorOptions { of_kind: true, ..SimulatorOptions::SHIPPED };
    let plant = Plant::with_options(PreparedScene::new(scene), &options).unwrap();
    let intervention = Intervention { actions: vec![Action::Triggered(script)] };
    rollout_assessed(&plant, &intervention, ego.driver().as_mut()).unwrap()
}

/// The preventable reading asks what a careful driver could have done, and every body that stands on the way could have been spared. An ego
/// that is blind for it or brakes for nobody meets each of them, so that they are the cheapest successes there are.
#[test]
fn a_body_that_only_stands_or_creeps_on_a_blind_egos_way_is_no_success_and_one_that_came_to_stand_is() {
    let weights = std::fs::read(home().join("policies/sac-safebench.safetensors")).unwrap();
    let blind = Policy::learned(&weights).unwrap();
    let fence = preventable().preventable.and_then(|reading| reading.standing).expect("the shipped file has the fence");
    let fenced = preventable();
    let open = |standing| SafebenchOptions {
        preventable: fenced.preventable.map(|reading| PreventableOptions { standing, ..reading }),
        ..fenced
    };
    // Fences that always say yes and always say no.
    let (never, always) =
        (StandingOptions { visible_s_min: 0.0, speed_mps_min: 0.0 }, StandingOptions { visible_s_min: 99.0, ..fence });
    let left = std::f64::consts::FRAC_PI_2;
    let bodies = [
        (
            "a car stands from the beginning",
            Body { kind: AgentKind::Vehicle, right_m: 0.0, turned_rad: 0.0, mps: 0.0, way_m: 0.0 },
            false,
        ),
        (
            "a walker creeps",
            Body { kind: AgentKind::Pedestrian, right_m: 0.5, turned_rad: left, mps: 0.12, way_m: 99.0 },
            false,
        ),
        (
            "a walker comes to stand",
            Body { kind: AgentKind::Pedestrian, right_m: 3.0, turned_rad: left, mps: 1.5, way_m: 3.0 },
            true,
        ),
    ];
    for (name, body, counts) in bodies {
        for route in [4, 5, 6, 8] {
            let outcome = against(&body, route, &blind);
            let contact = outcome.contact.unwrap_or_else(|| panic!("{name} on route {route}: not met"));
            let success = |options: &SafebenchOptions| SafebenchRun::of(&outcome, options).unwrap().run.collision;
            let told = format!("{name} on route {route}: {contact:?}");
            assert!(success(&open(None)) && success(&open(Some(never))), "without the fence {told}");
            assert_eq!(success(&fenced), counts, "{told}");
            assert!(contact.class != ContactClass::StationaryHit || !success(&open(Some(always))), "{told}");
            // Who brakes has nothing to fear of any of them.
            assert!(against(&body, route, &Policy::Idm).contact.is_none(), "{name} on route {route}: IDM meets it");
        }
    }
}
