//! OpenSCENARIO of scripts that wait for the ego, in place of frozen trajectories: the ego stands at its start with its route and
//! belongs to the user's controller, each scripted road user stands until the ego is near and then goes through its phases, and the
//! road is the town's own where the scene lies in one.
//!
//! One event a phase. The first starts when the ego is near; each further one when the one before has begun and the phase's end has
//! come. Speeds are requested with our plant's throttle and brake; the player decides how exactly they are reached. Parts that
//! OpenSCENARIO cannot express are refused, and parts that it expresses in another way are noted.

use super::entities::{Cast, Member};
use super::story::{after, init, position, within_position};
use super::{Revision, header, road_network};
use crate::formats::export_error::{ExportError, Note, sound};
use crate::formats::opendrive::write;
use crate::formats::xml_write::{Attribute, Xml, decimal};
use crate::kernel::{Polyline, Vec2, num};
use crate::scene::{AgentKind, DT_S, Sample, Scene, Track};
use crate::sim::{Phase, Script, Speed, Until, Way, bicycle::DEFAULT_LIMITS};

/// Length to which a straight way is written, metres.
const STRAIGHT_M: f64 = 300.0;
/// Step at which a straight way's meeting point with the ego's route is looked for, metres.
const LOOK_M: f64 = 0.1;
/// Most waypoints of the ego's route.
const WAYPOINTS_MAX: usize = 20;

/// The files of scripts that wait for the ego.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TriggeredScenario {
    /// The scenario.
    pub xosc: Vec<u8>,
    /// The road network, where it is not a town's own.
    pub xodr: Option<Vec<u8>>,
    /// Notes on parts of the scripts that the file cannot express.
    pub notes: Vec<Note>,
}

/// Returns the scripts in their scene. The road is `town`'s own, which the player has, or a file beside the scenario that is called
/// `road_file`.
///
/// # Errors
/// The scene breaks a rule of a sound scene, has road users of its own, or a script has a way or an end that OpenSCENARIO cannot
/// express.
pub fn triggered(
    scene: &Scene,
    scripts: &[Script],
    town: Option<&str>,
    road_file: &str,
    revision: Revision,
) -> Result<TriggeredScenario, ExportError> {
    sound(scene)?;
    let lacks =
        |missing| ExportError::Missing { scene: scene.id.clone(), format: "OpenSCENARIO with a trigger", missing };
    if scripts.is_empty() || !scene.tracks.is_empty() {
        return Err(lacks("scripts that wait for the ego, alone on its road"));
    }
    let route = Polyline::new(scene.ego.route.clone()).map_err(|_| lacks("route of the ego"))?;
    let mut notes = Vec::new();
    let staged =
        Scene { tracks: scripts.iter().enumerate().map(|(k, script)| standing(k, script)).collect(), ..scene.clone() };
    let xodr = town.is_none().then(|| write::network(scene, &mut notes));
    let cast = Cast::of(&staged);
    let mut teller = Teller { scene: &staged, route, cast: &cast, scripts, revision, notes };
    let mut events = Vec::new();
    for k in 0..scripts.len() {
        events.push(teller.events(k).map_err(lacks)?);
    }
    let mut xml = Xml::new();
    xml.open("OpenSCENARIO", &[]);
    header(&mut xml, scene, revision);
    xml.empty("CatalogLocations", &[]);
    match (town, revision) {
        // ScenarioRunner takes the town by its name from CARLA, where its lights are CARLA's, too.
        (Some(town), Revision::V1_0) => {
            xml.within("RoadNetwork", &[], |xml| xml.empty("LogicFile", &[("filepath", &town)]))
        }
        (Some(town), Revision::V1_2) => {
            xml.within("RoadNetwork", &[], |xml| xml.empty("LogicFile", &[("filepath", &format!("{town}.xodr"))]));
        }
        (None, _) => road_network(&mut xml, scene, road_file),
    }
    if town.is_some() && !scene.lights.is_empty() {
        teller.notes.push(Note::new("lights", "the town's own lights are the player's; the scene's are not written"));
    }
    cast.write(&mut xml, revision);
    teller.storyboard(&mut xml, &events);
    let mut notes = teller.notes;
    notes.push(Note::new("ego", "it is free: give it your controller; its route is in the scenario"));
    notes.push(Note::new(
        "",
        "how exactly asked speeds are reached is the player's: our cars drive by full throttle and full brake",
    ));
    Ok(TriggeredScenario { xosc: xml.finish(), xodr, notes })
}

/// Returns a scripted road user as a track that stands.
fn standing(k: usize, script: &Script) -> Track {
    let heading_rad = num::wrap_angle(script.spawn.heading_rad);
    let sample = Sample { position: script.spawn.position, heading_rad, velocity: Vec2::ZERO };
    let Script { kind, length_m, width_m, .. } = *script;
    Track { id: format!("scripted_{k}"), kind, length_m, width_m, samples: vec![Some(sample)] }
}

/// Action of one event.
enum Does {
    /// Toward a speed, m/s, from another one.
    Speed { from_mps: f64, to_mps: f64 },
    /// Matches the ego's speed.
    EgoSpeed,
    /// Meets the ego where their ways cross.
    Meets { at: Vec2, ego_at: Vec2 },
    /// Along points, at the speed of another event; about this fast, m/s, for players that need times on a way.
    Along { points: Vec<Vec2>, about_mps: f64 },
    /// To an offset from the middle of its lane, metres to the left, over a way.
    Aside { left_m: f64, over_m: f64 },
}

/// Start of an event.
enum When {
    /// At the script's trigger.
    SetOff,
    /// After the event before, once this holds.
    Behind(Until),
}

struct Told {
    when: When,
    does: Vec<Does>,
}

struct Teller<'s> {
    scene: &'s Scene,
    route: Polyline,
    cast: &'s Cast<'s>,
    scripts: &'s [Script],
    revision: Revision,
    notes: Vec<Note>,
}

impl Teller<'_> {
    /// Returns the events of a script, or the word that is missing.
    fn events(&mut self, k: usize) -> Result<Vec<Told>, &'static str> {
        let script = &self.scripts[k];
        let shifts = script.phases.iter().any(|phase| matches!(phase.way, Way::Shift { .. }));
        let (mut told, mut when, mut mps): (Vec<Told>, When, f64) = (vec![], When::SetOff, 0.0);
        let mut driven_m = 0.0;
        for (i, phase) in script.phases.iter().enumerate() {
            let mut does = Vec::new();
            let about_mps = about_mps(&phase.speed);
            match &phase.way {
                // Once on its way it stays there; a road user that moves sideways later keeps to its lane until then.
                Way::Straight if i > 0 || (shifts && script.kind == AgentKind::Vehicle) => {}
                Way::Straight => does.push(Does::Along { points: straight(script, 0.0), about_mps }),
                Way::Turn { left_rad, .. } if i == 0 && script.kind == AgentKind::Pedestrian => {
                    does.push(Does::Along { points: straight(script, *left_rad), about_mps });
                }
                Way::Points { points } | Way::Path { points } => {
                    let forward = Vec2::from_heading(script.spawn.heading_rad);
                    // Points that lie behind it by then are left out.
                    let ahead = |point: &&Vec2| (**point - script.spawn.position).dot(forward) > driven_m + 0.5;
                    let begins = script.spawn.position + forward * driven_m;
                    let points = std::iter::once(&begins).chain(points.iter().filter(ahead)).copied().collect();
                    does.push(Does::Along { points, about_mps });
                }
                Way::Shift { left_m, over_m } => does.push(Does::Aside { left_m: *left_m, over_m: *over_m }),
                Way::Turn { .. } => return Err("word for a turn that begins where the ego comes near"),
                Way::Wheel { .. } => return Err("word for angles of wheels"),
            }
            let mut ticks = vec![];
            match &phase.speed {
                Speed::Constant { mps: to } => {
                    does.push(Does::Speed { from_mps: mps, to_mps: *to });
                    mps = *to;
                }
                Speed::Profile { mps: asked } => {
                    for to in asked {
                        ticks.push(Does::Speed { from_mps: mps, to_mps: *to });
                        mps = *to;
                    }
                    does.push(ticks.remove(0));
                }
                Speed::MatchEgo { mps_max } => {
                    self.note(k, format!("it takes the ego's speed, also above {} m/s", decimal(*mps_max)));
                    does.push(Does::EgoSpeed);
                }
                Speed::Intercept { mps_min, mps_max } => {
                    mps = *mps_max;
                    match self.crossing(script, 0.0) {
                        Some((along_m, ego_at)) => {
                            let (low, high) = (decimal(*mps_min), decimal(*mps_max));
                            self.note(
                                k,
                                format!(
                                    "it meets the ego where their ways cross, also below {low} and above {high} m/s"
                                ),
                            );
                            let at = script.spawn.position + Vec2::from_heading(script.spawn.heading_rad) * along_m;
                            does.push(Does::Meets { at, ego_at });
                        }
                        None => does.push(Does::Speed { from_mps: 0.0, to_mps: *mps_max }),
                    }
                }
            }
            told.push(Told { when, does });
            told.extend(
                ticks.into_iter().map(|tick| Told { when: When::Behind(Until::Lasted { s: DT_S }), does: vec![tick] }),
            );
            when = match phase.until {
                Until::Forever => return Ok(told),
                Until::NearRoute { m } => match self.crossing(script, m) {
                    Some((along_m, _)) => {
                        self.note(
                            k,
                            "the end of a phase near the ego's route is told by the way that it has driven".into(),
                        );
                        When::Behind(Until::Driven { m: along_m })
                    }
                    None => return Ok(told),
                },
                until => When::Behind(until),
            };
            if let Until::Driven { m } = phase.until {
                driven_m = m;
            }
        }
        // After its last phase it brakes and stays.
        if !script.phases.is_empty() {
            told.push(Told { when, does: vec![Does::Speed { from_mps: mps, to_mps: 0.0 }] });
        }
        Ok(told)
    }

    fn note(&mut self, k: usize, reason: String) {
        let note = Note::new(format!("scripted_{k}"), reason);
        if !self.notes.contains(&note) {
            self.notes.push(note);
        }
    }

    /// Returns how far along its straight way a script comes within `within_m` of the ego's route (0: nearest), and the place there.
    fn crossing(&self, script: &Script, within_m: f64) -> Option<(f64, Vec2)> {
        let forward = Vec2::from_heading(script.spawn.heading_rad);
        let within_m = within_m.max(LOOK_M);
        let steps = (STRAIGHT_M / LOOK_M) as usize;
        (0..steps).map(|i| i as f64 * LOOK_M).find_map(|along_m| {
            let place = script.spawn.position + forward * along_m;
            let on = self.route.at(self.route.project(place).s_m);
            (on.distance(place) < within_m).then_some((along_m, on))
        })
    }

    fn storyboard(&self, xml: &mut Xml, events: &[Vec<Told>]) {
        xml.within("Storyboard", &[], |xml| {
            xml.within("Init", &[], |xml| {
                xml.within("Actions", &[], |xml| {
                    for member in &self.cast.members {
                        init(xml, member, |xml| {
                            if member.is_ego {
                                self.free(xml);
                            }
                        });
                    }
                });
            });
            xml.within("Story", &[("name", &"story")], |xml| {
                xml.within("Act", &[("name", &"act")], |xml| {
                    let actors = self.cast.members.iter().filter(|member| !member.is_ego);
                    for ((k, member), told) in actors.enumerate().zip(events).filter(|(_, told)| !told.is_empty()) {
                        self.group(xml, k, member, told);
                    }
                    xml.within("StartTrigger", &[], |xml| after(xml, "act starts", 0));
                });
            });
            xml.within("StopTrigger", &[], |xml| after(xml, "the scene ends", self.scene.steps - 1));
        });
    }

    /// Writes the ego's controller and route.
    fn free(&self, xml: &mut Xml) {
        xml.within("PrivateAction", &[], |xml| {
            xml.within("ControllerAction", &[], |xml| {
                xml.within("AssignControllerAction", &[], |xml| {
                    xml.within("Controller", &[("name", &"users_controller")], |xml| {
                        xml.within("Properties", &[], |xml| {
                            xml.empty("Property", &[("name", &"module"), ("value", &"external_control")]);
                        });
                    });
                });
                if self.revision == Revision::V1_0 {
                    xml.within("OverrideControllerValueAction", &[], |xml| {
                        for pedal in ["Throttle", "Brake", "Clutch", "ParkingBrake", "SteeringWheel"] {
                            xml.empty(pedal, &[("value", &0), ("active", &"false")]);
                        }
                        xml.empty("Gear", &[("number", &0), ("active", &"false")]);
                    });
                }
            });
        });
        let every_m = self.route.length_m() / (WAYPOINTS_MAX - 1) as f64;
        xml.within("PrivateAction", &[], |xml| {
            xml.within("RoutingAction", &[], |xml| {
                xml.within("AssignRouteAction", &[], |xml| {
                    xml.within("Route", &[("name", &"route"), ("closed", &"false")], |xml| {
                        for k in 0..WAYPOINTS_MAX {
                            let s_m = (k as f64 * every_m).min(self.route.length_m());
                            let place = Sample {
                                position: self.route.at(s_m),
                                heading_rad: self.route.heading_at(s_m),
                                velocity: Vec2::ZERO,
                            };
                            xml.within("Waypoint", &[("routeStrategy", &"shortest")], |xml| position(xml, &place));
                        }
                    });
                });
            });
        });
    }

    fn group(&self, xml: &mut Xml, k: usize, member: &Member<'_>, told: &[Told]) {
        let name = &member.name;
        xml.within("ManeuverGroup", &[("name", &format!("group_{name}")), ("maximumExecutionCount", &1)], |xml| {
            xml.within("Actors", &[("selectTriggeringEntities", &"false")], |xml| {
                xml.empty("EntityRef", &[("entityRef", name)]);
            });
            xml.within("Maneuver", &[("name", &format!("maneuver_{name}"))], |xml| {
                for (i, event) in told.iter().enumerate() {
                    let own = format!("{name}_{i}");
                    // An event for a speed alone leaves the way as it is.
                    let attributes: [Attribute<'_>; 3] =
                        [("name", &own), ("priority", &"parallel"), ("maximumExecutionCount", &1)];
                    xml.within("Event", &attributes, |xml| {
                        for (a, does) in event.does.iter().enumerate() {
                            xml.within("Action", &[("name", &format!("{own}_action_{a}"))], |xml| {
                                xml.within("PrivateAction", &[], |xml| self.act(xml, &own, k, does));
                            });
                        }
                        xml.within("StartTrigger", &[], |xml| match &event.when {
                            When::SetOff => self.set_off(xml, k),
                            When::Behind(until) => self.behind(xml, name, i, until),
                        });
                    });
                }
            });
        });
    }

    fn act(&self, xml: &mut Xml, own: &str, k: usize, does: &Does) {
        match does {
            Does::Speed { from_mps, to_mps } => self.speed(xml, k, *to_mps >= *from_mps, |xml| {
                xml.empty("AbsoluteTargetSpeed", &[("value", &decimal(*to_mps))]);
            }),
            Does::EgoSpeed => self.speed(xml, k, true, |xml| {
                xml.empty(
                    "RelativeTargetSpeed",
                    &[
                        ("entityRef", &self.cast.members[0].name),
                        ("value", &0),
                        ("speedTargetValueType", &"delta"),
                        ("continuous", &"true"),
                    ],
                );
            }),
            Does::Meets { at, ego_at } => {
                let still = |position| Sample { position, heading_rad: 0.0, velocity: Vec2::ZERO };
                xml.within("SynchronizeAction", &[("masterEntityRef", &self.cast.members[0].name)], |xml| {
                    within_position(xml, "TargetPositionMaster", &still(*ego_at));
                    within_position(xml, "TargetPosition", &still(*at));
                });
            }
            Does::Along { points, about_mps } => xml.within("RoutingAction", &[], |xml| {
                xml.within("FollowTrajectoryAction", &[], |xml| self.along(xml, own, points, *about_mps));
            }),
            Does::Aside { left_m, over_m } => {
                let attributes: [Attribute<'_>; 1] = [("continuous", &"false")];
                xml.within("LateralAction", &[], |xml| {
                    xml.within("LaneOffsetAction", &attributes, |xml| {
                        // A smooth step over that way at 10 m/s needs this much acceleration across.
                        let across_mps2 = 6.0 * left_m.abs() * 100.0 / (over_m * over_m);
                        xml.empty(
                            "LaneOffsetActionDynamics",
                            &[("dynamicsShape", &"sinusoidal"), ("maxLateralAcc", &decimal(across_mps2.max(0.1)))],
                        );
                        xml.within("LaneOffsetTarget", &[], |xml| {
                            xml.empty("AbsoluteTargetLaneOffset", &[("value", &decimal(*left_m))]);
                        });
                    });
                });
            }
        }
    }

    fn speed(&self, xml: &mut Xml, k: usize, faster: bool, target: impl FnOnce(&mut Xml)) {
        let script = &self.scripts[k];
        let pedals = script.phases.first().map_or((1.0, 1.0), |phase: &Phase| (phase.throttle, phase.brake));
        let rate_mps2 =
            if faster { pedals.0 * DEFAULT_LIMITS.engine_mps2 } else { pedals.1 * DEFAULT_LIMITS.brake_mps2 };
        let at_once = script.kind == AgentKind::Pedestrian || rate_mps2 <= 0.0;
        let (shape, dimension, value) =
            if at_once { ("step", "time", "0".to_string()) } else { ("linear", "rate", decimal(rate_mps2)) };
        xml.within("LongitudinalAction", &[], |xml| {
            xml.within("SpeedAction", &[], |xml| {
                xml.empty(
                    "SpeedActionDynamics",
                    &[("dynamicsShape", &shape), ("dynamicsDimension", &dimension), ("value", &value)],
                );
                xml.within("SpeedActionTarget", &[], target);
            });
        });
    }

    /// Writes a way without times: other events request the speeds. ScenarioRunner still reads times.
    fn along(&self, xml: &mut Xml, own: &str, points: &[Vec2], about_mps: f64) {
        let trajectory = |xml: &mut Xml| {
            xml.within("Trajectory", &[("name", &format!("way_{own}")), ("closed", &"false")], |xml| {
                xml.within("Shape", &[], |xml| {
                    xml.within("Polyline", &[], |xml| {
                        let mut gone_m = 0.0;
                        for (i, point) in points.iter().enumerate() {
                            gone_m += points[i.saturating_sub(1)].distance(*point);
                            let time = decimal(num::rounded(gone_m / about_mps, 3));
                            let next =
                                points.get(i + 1).map_or(*point - points[i.saturating_sub(1)], |next| *next - *point);
                            let sample = Sample { position: *point, heading_rad: next.heading(), velocity: Vec2::ZERO };
                            xml.within("Vertex", &[("time", &time)], |xml| position(xml, &sample));
                        }
                    });
                });
            });
        };
        match self.revision {
            Revision::V1_0 => trajectory(xml),
            Revision::V1_2 => xml.within("TrajectoryRef", &[], trajectory),
        }
        xml.within("TimeReference", &[], |xml| xml.empty("None", &[]));
        xml.empty("TrajectoryFollowingMode", &[("followingMode", &"follow")]);
    }

    /// Writes the trigger: the ego is near the script's reference, and moves where that is required.
    fn set_off(&self, xml: &mut Xml, k: usize) {
        let trigger = &self.scripts[k].trigger;
        let reference = &self.cast.members[1 + trigger.reference.min(self.scripts.len() - 1)].name;
        let ego = &self.cast.members[0].name;
        xml.within("ConditionGroup", &[], |xml| {
            self.near(xml, &format!("ego_near_{k}"), ego, reference, trigger.distance_m);
            if trigger.ego_speed_mps_min > 0.0 {
                condition(xml, &format!("ego_moves_{k}"), 0.0, |xml| {
                    by_entity(xml, ego, |xml| {
                        let value = decimal(trigger.ego_speed_mps_min);
                        xml.empty("SpeedCondition", &[("value", &value), ("rule", &"greaterThan")]);
                    });
                });
            }
        });
    }

    /// Writes the condition that two road users are nearer than this, centre to centre.
    fn near(&self, xml: &mut Xml, name: &str, of: &str, to: &str, m: f64) {
        let kind = if self.revision == Revision::V1_0 { "cartesianDistance" } else { "euclidianDistance" };
        condition(xml, name, 0.0, |xml| {
            by_entity(xml, of, |xml| {
                xml.empty(
                    "RelativeDistanceCondition",
                    &[
                        ("entityRef", &to),
                        ("relativeDistanceType", &kind),
                        ("value", &decimal(m)),
                        ("freespace", &"false"),
                        ("rule", &"lessThan"),
                    ],
                );
            });
        });
    }

    /// Writes the condition that the event before has begun and a phase's end has come.
    fn behind(&self, xml: &mut Xml, name: &str, i: usize, until: &Until) {
        let before = format!("{name}_{}", i - 1);
        let begun = |xml: &mut Xml, state: &str, delay_s: f64| {
            condition(xml, &format!("{before}_{state}_for_{i}"), delay_s, |xml| {
                xml.within("ByValueCondition", &[], |xml| {
                    xml.empty(
                        "StoryboardElementStateCondition",
                        &[("storyboardElementType", &"event"), ("storyboardElementRef", &before), ("state", &state)],
                    );
                });
            });
        };
        if let Until::Lasted { s } = until {
            xml.within("ConditionGroup", &[], |xml| begun(xml, "startTransition", *s));
            return;
        }
        // ScenarioRunner remembers that an event has begun; elsewhere it runs, or is over.
        let states: &[&str] = match self.revision {
            Revision::V1_0 => &["startTransition"],
            Revision::V1_2 => &["runningState", "completeState"],
        };
        for state in states {
            xml.within("ConditionGroup", &[], |xml| {
                begun(xml, state, 0.0);
                let own = format!("{name}_{i}_{state}");
                match until {
                    Until::EgoWithin { m } => self.near(xml, &own, name, &self.cast.members[0].name, *m),
                    Until::Driven { m } => condition(xml, &own, 0.0, |xml| {
                        by_entity(xml, name, |xml| xml.empty("TraveledDistanceCondition", &[("value", &decimal(*m))]));
                    }),
                    // The others were expressed before in other ways.
                    Until::Forever | Until::NearRoute { .. } | Until::Lasted { .. } => {}
                }
            });
        }
    }
}

/// Returns the approximate speed of a road user for a requested speed, m/s.
fn about_mps(speed: &Speed) -> f64 {
    let mps = match speed {
        Speed::Constant { mps } | Speed::MatchEgo { mps_max: mps } | Speed::Intercept { mps_max: mps, .. } => *mps,
        Speed::Profile { mps } => num::mean(mps).unwrap_or(0.0),
    };
    mps.max(0.5)
}

/// Returns the straight way of a script, turned by an angle.
fn straight(script: &Script, left_rad: f64) -> Vec<Vec2> {
    let axis = Vec2::from_heading(script.spawn.heading_rad + left_rad);
    vec![script.spawn.position, script.spawn.position + axis * STRAIGHT_M]
}

fn condition(xml: &mut Xml, name: &str, delay_s: f64, inside: impl FnOnce(&mut Xml)) {
    xml.within("Condition", &[("name", &name), ("delay", &decimal(delay_s)), ("conditionEdge", &"none")], inside);
}

fn by_entity(xml: &mut Xml, name: &str, inside: impl FnOnce(&mut Xml)) {
    xml.within("ByEntityCondition", &[], |xml| {
        xml.within("TriggeringEntities", &[("triggeringEntitiesRule", &"any")], |xml| {
            xml.empty("EntityRef", &[("entityRef", &name)]);
        });
        xml.within("EntityCondition", &[], inside);
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::formats::xml_read::{Document, Element};
    use crate::kernel::Pose;
    use crate::scene::fixture::two_lane_scene;
    use crate::sim::Trigger;

    fn scene() -> Scene {
        let mut scene = two_lane_scene();
        scene.tracks.clear();
        scene.objects_of_interest.clear();
        scene
    }

    fn script(kind: AgentKind, phases: Vec<Phase>) -> Script {
        let start = scene().ego.route[0];
        let spawn = Pose { position: start + Vec2::new(30.0, -8.0), heading_rad: num::FRAC_PI_2 };
        let trigger = Trigger { reference: 0, distance_m: 22.5, ego_speed_mps_min: 0.5 };
        Script { kind, length_m: 4.8, width_m: 2.0, spawn, trigger, phases }
    }

    fn text(scripts: &[Script], town: Option<&str>, revision: Revision) -> String {
        String::from_utf8(triggered(&scene(), scripts, town, "road.xodr", revision).unwrap().xosc).unwrap()
    }

    /// Finds all elements of a name, in document order, each with its contents.
    fn all<'d>(element: Element<'d>, name: &str, found: &mut Vec<Element<'d>>) {
        for child in element.children() {
            if child.name() == name {
                found.push(child);
            }
            all(child, name, found);
        }
    }

    fn named<'d>(document: &'d Document, name: &str) -> Vec<Element<'d>> {
        let mut found = vec![];
        all(document.root(), name, &mut found);
        found
    }

    fn value<'d>(of: &Element<'d>, name: &str) -> &'d str {
        of.attribute(name).unwrap_or_else(|| panic!("{name}"))
    }

    #[test]
    fn the_adversary_waits_for_the_ego_which_is_free_on_the_towns_own_road() {
        let phases = vec![Phase::straight(5.0, Until::Driven { m: 12.5 }), Phase::straight(2.0, Until::Forever)];
        for revision in [Revision::V1_0, Revision::V1_2] {
            let made =
                triggered(&scene(), &[script(AgentKind::Vehicle, phases.clone())], Some("Town01"), "r.xodr", revision)
                    .unwrap();
            assert_eq!(made.xodr, None, "the player has the town");
            let text = String::from_utf8(made.xosc).unwrap();
            let document = Document::parse("t.xosc", text.as_bytes()).unwrap();
            let road = if revision == Revision::V1_0 { "Town01" } else { "Town01.xodr" };
            assert_eq!(value(&named(&document, "LogicFile")[0], "filepath"), road);
            let events = named(&document, "Event");
            assert_eq!(events.len(), 2);
            let inside = |event: Element<'_>, name: &str| {
                let mut found = vec![];
                all(event, name, &mut found);
                found.iter().map(|of| of.attribute("value").unwrap_or_default().to_string()).collect::<Vec<_>>()
            };
            assert_eq!(
                inside(events[0], "RelativeDistanceCondition"),
                ["22.5"],
                "nothing but the ego's distance sets it off"
            );
            assert_eq!(inside(events[0], "SpeedCondition"), ["0.5"]);
            assert!(inside(events[0], "SimulationTimeCondition").is_empty(), "no time does");
            assert_eq!(inside(events[0], "AbsoluteTargetSpeed"), ["5"]);
            let behind = inside(events[1], "TraveledDistanceCondition");
            assert!(!behind.is_empty() && behind.iter().all(|m| m == "12.5"), "{behind:?}");
            assert_eq!(inside(events[1], "AbsoluteTargetSpeed"), ["2"]);
            assert_eq!(
                named(&document, "StoryboardElementStateCondition").len(),
                behind.len(),
                "and only behind the first"
            );
            // Nobody follows a frozen motion: the ego has no way but its route, and no way has times.
            assert_eq!(named(&document, "FollowTrajectoryAction").len(), 1);
            assert_eq!((named(&document, "Timing").len(), named(&document, "AssignControllerAction").len()), (0, 1));
            assert_eq!(named(&document, "Waypoint").len(), WAYPOINTS_MAX);
            let groups = named(&document, "ManeuverGroup");
            assert!(groups.iter().all(|group| !value(group, "name").contains("ego")), "nothing drives the ego");
        }
    }

    #[test]
    fn a_generated_road_goes_along_and_a_sequence_is_an_event_a_tick() {
        let mps = vec![1.0, 2.5, 0.5];
        let profile = Phase { speed: Speed::Profile { mps }, ..Phase::straight(0.0, Until::Driven { m: 40.0 }) };
        let scripts = [script(AgentKind::Pedestrian, vec![profile])];
        let made = triggered(&scene(), &scripts, None, "road.xodr", Revision::V1_2).unwrap();
        assert!(made.xodr.is_some());
        let text = text(&scripts, None, Revision::V1_2);
        let document = Document::parse("t.xosc", text.as_bytes()).unwrap();
        let asked: Vec<&str> = named(&document, "AbsoluteTargetSpeed").iter().map(|of| value(of, "value")).collect();
        // Init lets both stand or roll; behind its way the walker stops.
        assert_eq!(asked[asked.len() - 4..], ["1", "2.5", "0.5", "0"]);
        let delays: Vec<&str> =
            named(&document, "Condition").iter().map(|of| value(of, "delay")).filter(|d| *d != "0").collect();
        assert_eq!(delays, ["0.1", "0.1"]);
    }

    #[test]
    fn who_reacts_to_the_ego_does_so_by_the_formats_own_actions() {
        let near = Phase::straight(6.0, Until::EgoWithin { m: 12.0 });
        let shift = Phase { way: Way::Shift { left_m: 3.5, over_m: 20.0 }, ..Phase::straight(6.0, Until::Forever) };
        let cut_in = text(&[script(AgentKind::Vehicle, vec![near, shift])], Some("Town01"), Revision::V1_2);
        assert!(
            cut_in.contains("<AbsoluteTargetLaneOffset value=\"3.5\"/>") && cut_in.contains("value=\"12\""),
            "{cut_in}"
        );
        assert!(!cut_in.contains("FollowTrajectoryAction"), "until then it keeps to its lane");
        let meets = Phase {
            speed: Speed::Intercept { mps_min: 1.0, mps_max: 5.0 },
            ..Phase::straight(0.0, Until::NearRoute { m: 1.0 })
        };
        let meets = text(
            &[script(AgentKind::Pedestrian, vec![meets, Phase::straight(0.0, Until::Forever)])],
            None,
            Revision::V1_0,
        );
        assert!(meets.contains("SynchronizeAction") && meets.contains("TraveledDistanceCondition"), "{meets}");
    }

    #[test]
    fn what_the_format_has_no_word_for_is_refused() {
        let refused = |phases| {
            let made = triggered(&scene(), &[script(AgentKind::Vehicle, phases)], None, "r.xodr", Revision::V1_2);
            made.unwrap_err().to_string()
        };
        let turn = Phase { way: Way::Turn { left_rad: 1.0, radius_m: 8.0 }, ..Phase::straight(5.0, Until::Forever) };
        assert!(refused(vec![turn]).contains("turn that begins where the ego comes near"));
        let wheel = Phase { way: Way::Wheel { rad: vec![0.1] }, ..Phase::straight(5.0, Until::Forever) };
        assert!(refused(vec![wheel]).contains("angles of wheels"));
        let none = triggered(&scene(), &[], None, "r.xodr", Revision::V1_2).unwrap_err().to_string();
        assert!(none.contains("scripts that wait for the ego"), "{none}");
    }
}
