//! Parts that the families of the SafeBench protocol share. Their adversary is no recorded vehicle but a road user that
//! a traffic family brings along and that waits for the ego. So the actor operator names that road user, the timing
//! operator leaves the moment to its trigger, and motion and search operators work on whole scenarios, each simulated
//! against the ego when it is proposed. Where a scene belongs to no traffic family, nobody is eligible.

use super::interface::{self, FamilySpec};
use crate::adapters::{Family, OperatorSpec};
use crate::motion::traffic_family::{FamilyParameter, parameters};
use crate::objects::{OperatorNode, Slot};
use crate::scene::safebench::TrafficFamily;
use crate::scene::{AgentKind, TrackIx};
use crate::stage::scripted::EGO_TRIGGER;
use crate::stage::{Settings, Stage, StageError};

/// Actor operator: the road user that meets the ego in the scene's traffic family.
pub const SCRIPTED_ACTOR: &str = "scripted_actor";
/// Name of the benchmark in compile contracts.
pub const BACKEND: &str = "safebench";

/// Slots whose shared kinds rank recorded vehicles and cut windows out of logs.
pub const WITHOUT_SHARED: &[Slot] = &[Slot::Actor, Slot::Timing, Slot::Law];
/// Their mechanism slots and parameters.
const LOG_SLOTS: [&str; 5] = ["actor_score", "actor_guard", "window_start_s", "shape_speed_share", "shape_offset_m"];
const LOG_PARAMETERS: [&str; 1] = ["duration_s"];

/// Contract and parent of a family of the SafeBench protocol.
pub fn family(mut own: FamilySpec) -> Family {
    own.operators.extend(operators());
    let mut family = own.family();
    family.contract.backend = BACKEND.into();
    family.parent.compile_contract.backend = BACKEND.into();
    family.contract.operators.entry(Slot::Filter).or_default().retain(|spec| spec.kind != "reshape");
    family.contract.mechanism_slots.retain(|slot, _| !LOG_SLOTS.contains(&slot.as_str()));
    family.contract.parameters.retain(|name, _| !LOG_PARAMETERS.contains(&name.as_str()));
    family.parent.parameters.retain(|name, _| !LOG_PARAMETERS.contains(&name.as_str()));
    family
}

fn operators() -> [(Slot, OperatorSpec); 2] {
    let actor = "The road user that meets the ego in the scene's traffic family.";
    let timing = "The whole run: the adversary stands still until the ego is as near as its trigger says.";
    [
        (Slot::Actor, interface::operator(Slot::Actor, SCRIPTED_ACTOR, vec![], actor)),
        (Slot::Timing, interface::operator(Slot::Timing, EGO_TRIGGER, vec![], timing)),
    ]
}

/// The start of a parent's graph.
pub fn graph_start() -> Vec<(String, OperatorNode)> {
    vec![
        interface::node("select", Slot::Select, "every_scene", &[], vec![]),
        interface::node("actor", Slot::Actor, SCRIPTED_ACTOR, &["select"], vec![]),
        interface::node("timing", Slot::Timing, EGO_TRIGGER, &["actor"], vec![]),
    ]
}

/// The road user that a family's scenario brings along, as one that may be inserted.
pub fn actor(stage: &Stage<'_>, _: &Settings) -> Result<Vec<TrackIx>, StageError> {
    let staging = stage.situation.scene.staging.as_ref();
    Ok(staging.map(|staging| stage.situation.guest(kind(staging.family))).into_iter().collect())
}

fn kind(family: TrafficFamily) -> AgentKind {
    match family {
        TrafficFamily::StraightObstacle => AgentKind::Pedestrian,
        TrafficFamily::TurningObstacle => AgentKind::Cyclist,
        _ => AgentKind::Vehicle,
    }
}

/// Every parameter of every traffic family's scenario, in the families' order.
pub fn scenario_parameters() -> impl Iterator<Item = (TrafficFamily, usize, &'static FamilyParameter)> {
    let of = |family| parameters(family).iter().enumerate().map(move |(place, p)| (family, place, p));
    TrafficFamily::ALL.into_iter().flat_map(of)
}

/// Place of a parameter in a traffic family's scenario.
pub fn place_of(family: TrafficFamily, name: &str) -> Option<usize> {
    parameters(family).iter().position(|p| p.name == name)
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::super::published::{self, Port};
    use super::super::{adv_traj, advsim, chatscene, human, sources};
    use crate::compiler::{Compiled, compile};
    use crate::ego::Policy;
    use crate::kernel::{Seed, Vec2};
    use crate::objects::FamilyName;
    use crate::scene::fixture::two_lane_scene;
    use crate::scene::safebench::TrafficFamily;
    use crate::scene::{AgentKind, PreparedScene, Scene};
    use crate::sim::{self, Action, Script, Speed, Way};
    use crate::stage::{Situation, Source};
    use crate::synth::family_scene;

    const NAMES: [&str; 4] = [human::NAME, advsim::NAME, adv_traj::NAME, chatscene::NAME];

    fn situation(scene: Scene) -> Situation {
        Situation::new(Arc::new(scene), &Policy::Idm).unwrap()
    }

    fn compiled(name: &str, situation: &Situation, seed: u64) -> Compiled {
        let family = sources().get(&FamilyName::new(name)).unwrap().clone();
        compile(&family.parent, &family, situation, Seed(seed)).unwrap()
    }

    fn adversary(name: &str, family: TrafficFamily, route: u32) -> Script {
        let compiled = compiled(name, &situation(family_scene(family, route, Seed(7))), 1);
        match &compiled.intervention.actions[crate::motion::traffic_family::adversary(family)] {
            Action::Triggered(script) => script.clone(),
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn every_source_acts_in_every_traffic_family_and_says_what_will_happen() {
        let mut contacts = [0; 4];
        for family in TrafficFamily::ALL {
            let situation = situation(family_scene(family, 5, Seed(7)));
            for (which, name) in NAMES.into_iter().enumerate() {
                let compiled = compiled(name, &situation, 1);
                let expected = format!("{name} in {}: {}", family.name(), compiled.decision.reason);
                assert!(compiled.decision.applies, "{expected}");
                let mut driver = Policy::Idm.driver();
                let outcome = sim::rollout(&situation.plant, &compiled.intervention, driver.as_mut()).unwrap();
                contacts[which] += usize::from(outcome.contact.is_some());
            }
        }
        println!("contacts of 8 by human, advsim, adv_traj, chatscene: {contacts:?}");
        assert!(contacts.iter().sum::<usize>() > 0, "{contacts:?}");
    }

    #[test]
    fn a_scene_of_no_traffic_family_is_left_alone() {
        let situation = situation(two_lane_scene());
        for name in NAMES {
            let compiled = compiled(name, &situation, 1);
            assert!(!compiled.decision.applies && compiled.intervention.actions.is_empty(), "{name}");
        }
    }

    #[test]
    fn advsim_changes_speeds_only_and_keeps_to_twice_the_standard() {
        let script = adversary(advsim::NAME, TrafficFamily::RightTurn, 5);
        let [phase] = script.phases.as_slice() else { panic!("{:?}", script.phases) };
        let Speed::Profile { mps } = &phase.speed else { panic!("{:?}", phase.speed) };
        assert!(mps.len() == 100 && mps.iter().all(|v| (0.0..=24.0).contains(v)));
        assert_eq!(phase.way, Way::Straight);
    }

    #[test]
    fn the_at_port_stays_within_its_bound_beside_a_straight_path() {
        for family in TrafficFamily::ALL {
            let script = adversary(adv_traj::NAME, family, 6);
            let (bound_m, length_m) = adv_traj::bounds_m(family);
            let Some(Way::Points { points }) = script.phases.last().map(|p| &p.way) else { panic!("no points") };
            assert_eq!(points.len(), 100);
            let forward = Vec2::from_heading(script.spawn.heading_rad);
            for (i, point) in points.iter().enumerate() {
                let delta = *point - script.spawn.position;
                assert!((delta.dot(forward) - length_m * i as f64 / 100.0).abs() < 1e-6);
                assert!(delta.dot(forward.left()).abs() <= bound_m + 1e-9);
            }
        }
    }

    /// A situation of SafeBench's scripts as they run.
    fn as_run(family: TrafficFamily) -> Situation {
        let scene = PreparedScene::new(Arc::new(family_scene(family, 5, Seed(7))));
        let options = sim::SimulatorOptions { scripts: sim::Scripts::AsRun, ..sim::SimulatorOptions::SHIPPED };
        Situation::under(scene, &Policy::Idm, &options).unwrap()
    }

    #[test]
    fn as_scripts_run_at_s_adversary_of_the_first_family_rides_a_bicycle_and_nobody_else_does() {
        for name in NAMES {
            let kinds = TrafficFamily::ALL.map(|family| {
                let compiled = compiled(name, &as_run(family), 1);
                let Some(Action::Triggered(script)) = compiled.intervention.actions.first() else {
                    panic!("{name}: {}", compiled.decision.reason)
                };
                assert_eq!(compiled.decision.actors[0].inserted, Some(script.kind), "{name} in {}", family.name());
                (script.kind, script.length_m)
            });
            let first = if name == adv_traj::NAME { (AgentKind::Cyclist, 1.8) } else { (AgentKind::Pedestrian, 0.6) };
            assert_eq!((kinds[0], kinds[1]), (first, (AgentKind::Cyclist, 1.8)), "{name}");
        }
        assert_eq!(adversary(adv_traj::NAME, TrafficFamily::StraightObstacle, 5).kind, AgentKind::Pedestrian);
    }

    #[test]
    fn a_decision_tells_how_many_scenarios_were_simulated_before_it_as_scripts_run() {
        let decided = |name: &str, family| compiled(name, &as_run(family), 1).decision;
        for (name, samples) in [(human::NAME, 9), (chatscene::NAME, 13)] {
            assert_eq!(decided(name, TrafficFamily::RightTurn).search_rollouts, Some(samples), "{name}");
        }
        // One in the middle and as many queries as were asked: the first that meets the ego is the last.
        for name in [advsim::NAME, adv_traj::NAME] {
            let told = TrafficFamily::ALL.map(|family| {
                let decision = decided(name, family);
                assert_eq!(
                    decision.search_rollouts,
                    Some(1 + decision.actors[0].candidates),
                    "{name}: {}",
                    family.name()
                );
                decision.search_rollouts
            });
            assert!(told.contains(&Some(9)) && told.iter().any(|told| *told < Some(9)), "{name}: {told:?}");
        }
        let defined = compiled(human::NAME, &situation(family_scene(TrafficFamily::RightTurn, 5, Seed(7))), 1);
        assert_eq!(defined.decision.search_rollouts, None);
    }

    #[test]
    fn published_parents_play_their_ports_sequences_and_the_optimised_ranges_once_or_as_often_as_is_least() {
        let situation = as_run(TrafficFamily::UnprotectedLeftTurn);
        let plays = |name: &str, seed: u64| {
            let source = sources().get(&FamilyName::new(name)).unwrap().clone();
            let program = source.published.clone().unwrap().program;
            compile(&program, &source, &situation, Seed(seed)).unwrap()
        };
        for seed in 0..4 {
            let played = plays(advsim::NAME, seed);
            assert_eq!(played.decision.search_rollouts, Some(2), "the middle and the sequence");
            let Action::Triggered(script) = &played.intervention.actions[0] else { panic!("no script") };
            let Speed::Profile { mps } = &script.phases[0].speed else { panic!("{script:?}") };
            let shares: Vec<f64> = mps.iter().map(|v| v / 24.0).collect();
            let known = (0..10).map(|k| published::sequence(Port::AdvSim, TrafficFamily::UnprotectedLeftTurn, k));
            let alike = |own: &Vec<f64>| own.iter().zip(&shares).all(|(a, b)| (a - b).abs() < 1e-9);
            assert!(known.into_iter().any(|own| alike(&own)), "seed {seed}");
        }
        assert_eq!(plays(chatscene::NAME, 1).decision.search_rollouts, Some(5), "the middle and four samples");
        assert!(sources().get(&FamilyName::new(human::NAME)).unwrap().published.is_none());
    }

    #[test]
    fn a_contract_offers_a_ports_sequences_only_where_a_program_has_them() {
        for name in [advsim::NAME, adv_traj::NAME] {
            let source = sources().get(&FamilyName::new(name)).unwrap().clone();
            let (program, kind) = source.published.clone().map(|of| (of.program, of.kind.unwrap())).unwrap();
            let offers = |source: &Source| source.contract.names().contains(&format!("operator search/{kind}"));
            let without = source.clone().offering_for([&source.parent]);
            assert!(offers(&source.clone().offering_for([&program])) && !offers(&without), "{name}");
            assert!(without.contract.check_program(&source.parent).is_empty());
            assert!(!without.contract.check_program(&program).is_empty());
        }
    }

    #[test]
    fn human_draws_members_of_its_grid() {
        let speeds: Vec<f64> = (0..6)
            .map(|seed| {
                let situation = situation(family_scene(TrafficFamily::RightTurn, 5, Seed(7)));
                match &compiled(human::NAME, &situation, seed).intervention.actions[0] {
                    Action::Triggered(script) => match script.phases[0].speed {
                        Speed::Constant { mps } => mps,
                        ref other => panic!("{other:?}"),
                    },
                    other => panic!("{other:?}"),
                }
            })
            .collect();
        assert!(speeds.iter().all(|mps| [10.0, 12.0, 14.0].contains(mps)), "{speeds:?}");
        assert!(speeds.iter().any(|mps| *mps != speeds[0]), "{speeds:?}");
    }
}
