//! SafeBench's eight scenarios as scripts: where the actors stand and what they do, given the numbers that the
//! benchmark calls a scenario's parameters. AdvSim, the AT port and the human-designed grid all start from these.

use crate::kernel::{Pose, num};
use crate::scene::AgentKind;
use crate::scene::safebench::{Stage, TrafficFamily};
use crate::sim::{Action, Phase, Script, Scripts, Trigger, Until};

/// A parameter of a family's scenario.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FamilyParameter {
    /// Name in the benchmark's files.
    pub name: &'static str,
    /// Unit of its value.
    pub unit: &'static str,
    /// SafeBench's standard value.
    pub standard: f64,
    /// The range that SafeBench's random set is drawn from.
    pub sampled: (f64, f64),
}

const fn parameter(name: &'static str, unit: &'static str, standard: f64, low: f64, high: f64) -> FamilyParameter {
    FamilyParameter { name, unit, standard, sampled: (low, high) }
}

/// The parameters of a family, in SafeBench's order.
pub fn parameters(family: TrafficFamily) -> &'static [FamilyParameter] {
    match family {
        TrafficFamily::StraightObstacle => {
            const {
                &[
                    SPEED_ON_FOOT,
                    parameter("trigger_m", "m", 20.0, 16.0, 24.0),
                    parameter("start_m", "m", 45.0, 35.0, 55.0),
                ]
            }
        }
        TrafficFamily::TurningObstacle => {
            const {
                &[
                    parameter("speed_mps", "m/s", 10.0, 8.0, 12.0),
                    parameter("trigger_m", "m", 20.0, 15.0, 19.0),
                    parameter("start_m", "m", 8.0, 6.0, 10.0),
                ]
            }
        }
        TrafficFamily::LaneChanging => {
            const {
                &[
                    parameter("leader_ahead_m", "m", 35.0, 30.0, 40.0),
                    parameter("second_ahead_m", "m", 1.0, 1.0, 1.0),
                    parameter("leader_mps", "m/s", 12.0, 10.0, 20.0),
                    parameter("second_mps", "m/s", 12.0, 10.0, 20.0),
                    parameter("brake_after_m", "m", 5.0, 15.0, 25.0),
                    parameter("braked_mps", "m/s", 2.0, 3.0, 3.0),
                    parameter("trigger_m", "m", 35.0, 30.0, 30.0),
                ]
            }
        }
        TrafficFamily::VehiclePassing => {
            const {
                &[
                    parameter("parked_ahead_m", "m", 50.0, 45.0, 55.0),
                    parameter("oncoming_gap_m", "m", 30.0, 25.0, 35.0),
                    parameter("oncoming_mps", "m/s", 8.0, 6.0, 10.0),
                    parameter("trigger_m", "m", 45.0, 40.0, 50.0),
                ]
            }
        }
        TrafficFamily::RedLightRunning | TrafficFamily::CrossingNegotiation => {
            const { &[parameter("speed_mps", "m/s", 10.0, 7.0, 13.0), parameter("trigger_m", "m", 35.0, 29.0, 41.0)] }
        }
        TrafficFamily::UnprotectedLeftTurn => {
            const { &[parameter("speed_mps", "m/s", 12.0, 9.0, 15.0), parameter("trigger_m", "m", 45.0, 39.0, 51.0)] }
        }
        TrafficFamily::RightTurn => {
            const { &[parameter("speed_mps", "m/s", 12.0, 9.0, 15.0), parameter("trigger_m", "m", 35.0, 29.0, 41.0)] }
        }
    }
}

const SPEED_ON_FOOT: FamilyParameter = parameter("speed_mps", "m/s", 2.5, 2.0, 3.0);

/// A family's standard parameters.
pub fn standard(family: TrafficFamily) -> Vec<f64> {
    parameters(family).iter().map(|p| p.standard).collect()
}

/// The action that a generator perturbs: the scripted actor that meets the ego.
pub fn adversary(family: TrafficFamily) -> usize {
    match family {
        // The first is the parked car, to which the trigger's distance is measured.
        TrafficFamily::VehiclePassing => 1,
        _ => 0,
    }
}

/// Why a family's actors cannot be placed in a scene.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum LayoutError {
    /// The number of parameters is not the family's.
    #[error("{family} takes {expected} parameters, found {found}")]
    Count {
        /// Name of the traffic family.
        family: &'static str,
        /// Number of parameters that it has.
        expected: usize,
        /// Number of parameters that were given.
        found: usize,
    },
    /// A parameter's value cannot be used.
    #[error("{family}: {name} is {found}, expected a number from 0 to 1000")]
    Value {
        /// Name of the traffic family.
        family: &'static str,
        /// Name of the parameter.
        name: &'static str,
        /// Its value.
        found: f64,
    },
    /// The road has no place for the scenario.
    #[error("{scene}: {family} needs {what}, which the scene does not have")]
    Place {
        /// Id of the scene.
        scene: String,
        /// Name of the traffic family.
        family: &'static str,
        /// Part that the road lacks.
        what: &'static str,
    },
}

/// Puts somebody on a bicycle in the place of a script's road user.
pub fn mount(script: &mut Script) {
    script.kind = AgentKind::Cyclist;
    (script.length_m, script.width_m) = BICYCLE_M;
}

/// Length and width, metres.
const CAR_M: (f64, f64) = (4.8, 2.0);
const BICYCLE_M: (f64, f64) = (1.8, 0.6);
const WALKER_M: (f64, f64) = (0.6, 0.6);
const VENDING_MACHINE_M: (f64, f64) = (1.1, 0.9);
/// SafeBench's family 5 waits until the ego moves, m/s.
const EGO_MOVES_MPS: f64 = 0.5;
/// How far the crossing cars go before they are to stop, metres (families 5 and 8; 6 and 7).
const CROSSED_M: f64 = 110.0;
const TURNED_M: f64 = 100.0;

/// The actions of a family's scenario. The first is the reference actor to which the trigger's distance is measured.
/// Values stand in the order of [`parameters`].
pub fn actions(stage: &Stage<'_>, values: &[f64], scripts: Scripts) -> Result<Vec<Action>, LayoutError> {
    let family = stage.staging().family;
    let wanted = parameters(family);
    if values.len() != wanted.len() {
        let (expected, found) = (wanted.len(), values.len());
        return Err(LayoutError::Count { family: family.name(), expected, found });
    }
    if let Some((p, v)) = wanted.iter().zip(values).find(|(_, v)| !(0.0..=1000.0).contains(*v)) {
        return Err(LayoutError::Value { family: family.name(), name: p.name, found: *v });
    }
    let missing = |what| LayoutError::Place { scene: stage.scene().id.clone(), family: family.name(), what };
    Ok(match (family, values) {
        (TrafficFamily::StraightObstacle, &[speed_mps, trigger_m, start_m]) => {
            walker_behind_a_machine(stage, [speed_mps, trigger_m, start_m], scripts)
        }
        (TrafficFamily::TurningObstacle, &[speed_mps, trigger_m, start_m]) => {
            let exit_m = stage.turn_exit_m().ok_or_else(|| missing("a route that turns after its trigger"))?;
            let spawn = stage.roadside(exit_m + start_m).pose;
            vec![actor(
                AgentKind::Cyclist,
                BICYCLE_M,
                spawn,
                near(trigger_m),
                vec![Phase::straight(speed_mps, Until::Forever)],
            )]
        }
        (
            TrafficFamily::LaneChanging,
            &[ahead_m, gap_m, leader_mps, second_mps, brake_after_m, braked_mps, trigger_m],
        ) => {
            let beside = stage.left_lane(ahead_m + gap_m).filter(|lane| lane.same_direction);
            let beside = beside.ok_or_else(|| missing("a lane of the same direction on the ego's left"))?;
            let leader = vec![
                Phase::straight(leader_mps, Until::Driven { m: brake_after_m }),
                Phase::straight(braked_mps, Until::Forever),
            ];
            let second = vec![Phase::straight(second_mps, Until::Forever)];
            vec![
                actor(AgentKind::Vehicle, CAR_M, stage.ahead(ahead_m), near(trigger_m), leader),
                actor(AgentKind::Vehicle, CAR_M, beside.pose, near(trigger_m), second),
            ]
        }
        (TrafficFamily::VehiclePassing, &[ahead_m, gap_m, oncoming_mps, trigger_m]) => {
            let oncoming = stage.left_lane(ahead_m + gap_m).filter(|lane| !lane.same_direction);
            let oncoming = oncoming.ok_or_else(|| missing("an oncoming lane on the ego's left"))?;
            let phases = vec![Phase::straight(oncoming_mps, Until::Forever)];
            vec![
                actor(AgentKind::Vehicle, CAR_M, stage.ahead(ahead_m), near(trigger_m), vec![]),
                actor(AgentKind::Vehicle, CAR_M, oncoming.pose, near(trigger_m), phases),
            ]
        }
        (_, &[speed_mps, trigger_m]) => {
            let spawn = stage.spawns().next().ok_or_else(|| missing("a frame for its actor"))?;
            vec![crossing_car(family, spawn, [speed_mps, trigger_m], scripts)]
        }
        _ => return Err(missing("parameters of its own")),
    })
}

fn near(distance_m: f64) -> Trigger {
    Trigger { reference: 0, distance_m, ego_speed_mps_min: 0.0 }
}

fn actor(kind: AgentKind, size_m: (f64, f64), spawn: Pose, trigger: Trigger, phases: Vec<Phase>) -> Action {
    Action::Triggered(Script { kind, length_m: size_m.0, width_m: size_m.1, spawn, trigger, phases })
}

/// Returns the end of a script that has a stop condition: there, or, as it runs, nowhere.
fn stop(m: f64, scripts: Scripts) -> Until {
    match scripts {
        Scripts::AsDefined => Until::Driven { m },
        Scripts::AsRun => Until::Forever,
    }
}

/// Family 1: the walker is to stop in the road after 0.6 of the way over; the vending machine hides where it comes from.
fn walker_behind_a_machine(
    stage: &Stage<'_>,
    [speed_mps, trigger_m, start_m]: [f64; 3],
    scripts: Scripts,
) -> Vec<Action> {
    let roadside = stage.roadside(start_m);
    let stop_m = 0.6 * roadside.lane_width_m * (1.0 + 1.25 * roadside.lanes_between as f64);
    let phases = vec![Phase::straight(speed_mps, stop(stop_m, scripts))];
    let machine = Pose {
        position: stage.staging().trigger.position.lerp(roadside.pose.position, 0.9),
        heading_rad: num::wrap_angle(roadside.pose.heading_rad + num::PI),
    };
    vec![
        actor(AgentKind::Pedestrian, WALKER_M, roadside.pose, near(trigger_m), phases),
        actor(AgentKind::Static, VENDING_MACHINE_M, machine, near(trigger_m), vec![]),
    ]
}

/// Families 5 to 8: the actor drives straight on from its frame; it is to stop when it has left the crossing.
fn crossing_car(family: TrafficFamily, spawn: Pose, [speed_mps, trigger_m]: [f64; 2], scripts: Scripts) -> Action {
    let waits = family == TrafficFamily::RedLightRunning;
    let far_m = match family {
        TrafficFamily::RedLightRunning | TrafficFamily::CrossingNegotiation => CROSSED_M,
        _ => TURNED_M,
    };
    let trigger = Trigger { ego_speed_mps_min: if waits { EGO_MOVES_MPS } else { 0.0 }, ..near(trigger_m) };
    actor(AgentKind::Vehicle, CAR_M, spawn, trigger, vec![Phase::straight(speed_mps, stop(far_m, scripts))])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ego::Policy;
    use crate::kernel::{Seed, Threads};
    use crate::scene::Scene;
    use crate::sim::{End, Intervention, Outcome, Plant, rollout, rollout_traced};
    use crate::synth::{FamilyOptions, family_member, family_scene};

    fn pool() -> Vec<Scene> {
        let options = FamilyOptions::all();
        (0..options.count()).map(|i| family_member(&options, Seed(7), i).unwrap()).collect()
    }

    fn run(scene: &Scene) -> Outcome {
        let stage = Stage::of(scene).unwrap();
        let actions = actions(&stage, &standard(stage.staging().family), Scripts::AsDefined).unwrap();
        rollout(&Plant::new(scene).unwrap(), &Intervention { actions }, &mut *Policy::Idm.driver()).unwrap()
    }

    #[test]
    fn every_family_s_standard_scenario_is_set_off_on_each_of_its_routes() {
        let scenes = pool();
        let outcomes: Vec<Outcome> = scenes.iter().map(run).collect();
        let mut contacts = [0; 8];
        for (scene, outcome) in scenes.iter().zip(&outcomes) {
            let family = scene.staging.as_ref().unwrap().family;
            let driving = outcome.driving.as_ref().unwrap();
            assert!(outcome.adversaries.iter().all(|a| !a.initial_overlap), "{}", scene.id);
            assert!(driving.actors[adversary(family)].moved, "{}: never set off", scene.id);
            assert!(driving.duration_s > 2.0 && outcome.end != End::OffRoad, "{}: {driving:?}", scene.id);
            contacts[family.number() - 1] += usize::from(outcome.contact.is_some());
        }
        println!("contacts with the IDM ego by family, of 10: {contacts:?}");
        let all: usize = contacts.iter().sum();
        assert!(all > 5 && all < 75, "{contacts:?}: neither harmless nor hopeless");
    }

    #[test]
    fn nobody_drives_off_the_end_of_a_straight_road_however_long_the_run_lasts() {
        for scene in pool() {
            let stage = Stage::of(&scene).unwrap();
            let family = stage.staging().family;
            // A cyclist crosses the road and leaves it; half of family 4's routes begin with a bend, which is no end.
            let bends = family == TrafficFamily::VehiclePassing && [4, 7, 9, 10, 13].contains(&stage.staging().route);
            if matches!(family, TrafficFamily::StraightObstacle | TrafficFamily::TurningObstacle) || bends {
                continue;
            }
            let actions = actions(&stage, &standard(family), Scripts::AsDefined).unwrap();
            let plant = Plant::new(&scene).unwrap();
            let (_, trace) = rollout_traced(&plant, &Intervention { actions }, &mut *Policy::Idm.driver()).unwrap();
            let lanes = crate::scene::LaneGraph::of(&scene.road);
            for sample in trace.actors.iter().flat_map(|actor| actor.samples.iter().flatten()) {
                let on_road = [0.0, num::FRAC_PI_2, num::PI, -num::FRAC_PI_2]
                    .iter()
                    .any(|turned| lanes.nearest_lane(sample.position, sample.heading_rad + turned, 3.0).is_some());
                assert!(on_road, "{}: {sample:?}", scene.id);
            }
        }
    }

    #[test]
    fn results_do_not_depend_on_the_number_of_threads() {
        let scenes = pool();
        let digests = |threads: usize| Threads::new(threads).unwrap().map(&scenes, |_, scene| run(scene).trace);
        assert_eq!(digests(1), digests(3));
    }

    #[test]
    fn a_walker_stands_until_the_ego_is_near_and_stops_in_the_road() {
        let scene = family_scene(TrafficFamily::StraightObstacle, 5, Seed(7));
        let stage = Stage::of(&scene).unwrap();
        let actions = actions(&stage, &[2.5, 20.0, 45.0], Scripts::AsDefined).unwrap();
        let plant = Plant::new(&scene).unwrap();
        let (_, trace) = rollout_traced(&plant, &Intervention { actions }, &mut *Policy::Idm.driver()).unwrap();
        let walker: Vec<_> = trace.actors[0].samples.iter().flatten().collect();
        let from = walker.iter().position(|s| s.speed_mps() > 0.0).unwrap();
        assert!(trace.ego[from - 1].position.distance(walker[0].position) < 20.0);
        assert!(trace.ego[from - 2].position.distance(walker[0].position) >= 20.0, "not a step too early");
        assert!(walker[from..].iter().take(5).all(|s| (s.speed_mps() - 2.5).abs() < 1e-9), "at full speed at once");
        let gone = walker[walker.len() - 1].position.distance(walker[0].position);
        let asked = 0.6 * stage.roadside(45.0).lane_width_m;
        assert!(gone >= asked - 1e-9 && gone < asked + 0.25 + 1e-9, "{gone} {asked}");
    }

    #[test]
    fn as_scripts_run_nobody_stops_and_as_they_are_defined_the_walker_stands_in_the_road() {
        for family in TrafficFamily::ALL {
            let scene = family_scene(family, 5, Seed(7));
            let stage = Stage::of(&scene).unwrap();
            let ends = |scripts| -> Vec<Until> {
                let actions = actions(&stage, &standard(family), scripts).unwrap();
                let script = |action: &Action| match action {
                    Action::Triggered(script) => script.phases.last().map(|phase| phase.until),
                    other => panic!("{other:?}"),
                };
                actions.iter().filter_map(script).collect()
            };
            assert!(ends(Scripts::AsRun).iter().all(|until| *until == Until::Forever), "{}", family.name());
            let stops = ends(Scripts::AsDefined).iter().any(|until| matches!(until, Until::Driven { .. }));
            assert_eq!(stops, matches!(family.number(), 1 | 5..=8), "{}", family.name());
        }
        let scene = family_scene(TrafficFamily::StraightObstacle, 5, Seed(7));
        let stage = Stage::of(&scene).unwrap();
        let gone_m = |scripts| {
            let actions = actions(&stage, &[2.5, 24.0, 45.0], scripts).unwrap();
            let plant = Plant::new(&scene).unwrap();
            let (_, trace) = rollout_traced(&plant, &Intervention { actions }, &mut *Policy::Idm.driver()).unwrap();
            let walker: Vec<_> = trace.actors[0].samples.iter().flatten().collect();
            walker[walker.len() - 1].position.distance(walker[0].position)
        };
        assert!(gone_m(Scripts::AsDefined) < 2.6 && gone_m(Scripts::AsRun) > 7.0);
    }

    #[test]
    fn parameters_that_are_none_and_roads_that_do_not_fit_are_told() {
        let mut scene = family_scene(TrafficFamily::VehiclePassing, 5, Seed(7));
        let refusal = |scene: &Scene, values: &[f64]| {
            actions(&Stage::of(scene).unwrap(), values, Scripts::AsDefined).unwrap_err().to_string()
        };
        assert!(refusal(&scene, &[1.0]).contains("4 parameters"));
        assert!(refusal(&scene, &[50.0, f64::NAN, 8.0, 45.0]).contains("oncoming_gap_m"));
        scene.road.lanes.iter_mut().for_each(|lane| lane.left_neighbours.clear());
        assert!(refusal(&scene, &standard(TrafficFamily::VehiclePassing)).contains("an oncoming lane"));
    }
}
