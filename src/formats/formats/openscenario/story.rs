//! The start of every road user, the trajectory that it follows, and the end of the scenario.

use std::ops::Range;

use super::super::staging::stretches;
use super::entities::{Cast, Member};
use super::{Revision, seconds};
use crate::formats::xml_write::{Xml, decimal};
use crate::scene::{Sample, Scene, Track};

pub(super) fn write(xml: &mut Xml, scene: &Scene, cast: &Cast<'_>, revision: Revision) {
    xml.within("Storyboard", &[], |xml| {
        xml.within("Init", &[], |xml| {
            xml.within("Actions", &[], |xml| cast.members.iter().for_each(|member| init(xml, member, |_| ())));
        });
        xml.within("Story", &[("name", &"story")], |xml| {
            xml.within("Act", &[("name", &"act")], |xml| {
                cast.members.iter().for_each(|member| part(xml, member, revision));
                xml.within("StartTrigger", &[], |xml| after(xml, "act starts", 0));
            });
        });
        xml.within("StopTrigger", &[], |xml| after(xml, "the scene ends", scene.steps - 1));
    });
}

/// Writes its place and its speed at the start, and further actions of the start.
pub(super) fn init(xml: &mut Xml, member: &Member<'_>, more: impl FnOnce(&mut Xml)) {
    let Some(start) = member.track.at(0) else { return };
    xml.within("Private", &[("entityRef", &member.name)], |xml| {
        xml.within("PrivateAction", &[], |xml| {
            xml.within("TeleportAction", &[], |xml| position(xml, start));
        });
        xml.within("PrivateAction", &[], |xml| {
            xml.within("LongitudinalAction", &[], |xml| {
                xml.within("SpeedAction", &[], |xml| {
                    xml.empty(
                        "SpeedActionDynamics",
                        &[("dynamicsShape", &"step"), ("dynamicsDimension", &"time"), ("value", &0)],
                    );
                    xml.within("SpeedActionTarget", &[], |xml| {
                        xml.empty("AbsoluteTargetSpeed", &[("value", &decimal(start.speed_mps()))]);
                    });
                });
            });
        });
        more(xml);
    });
}

/// Writes a group for every road user. One without an event stays where Init put it.
fn part(xml: &mut Xml, member: &Member<'_>, revision: Revision) {
    let name = &member.name;
    let parts = stretches(member.track, 0);
    let moves = parts.iter().any(|range| range.start > 0 || range.len() > 1 || leaves(member, range));
    xml.within("ManeuverGroup", &[("name", &format!("group_{name}")), ("maximumExecutionCount", &1)], |xml| {
        xml.within("Actors", &[("selectTriggeringEntities", &"false")], |xml| {
            xml.empty("EntityRef", &[("entityRef", name)]);
        });
        if moves {
            xml.within("Maneuver", &[("name", &format!("maneuver_{name}"))], |xml| {
                for (number, range) in parts.iter().enumerate() {
                    stretch(xml, member, number, range, revision);
                }
            });
        }
    });
}

/// Returns `true` if it leaves. The ego stays: after its known motion another controller drives it.
fn leaves(member: &Member<'_>, range: &Range<usize>) -> bool {
    range.end < member.track.samples.len() && !member.is_ego
}

/// Writes a stretch: it comes, follows its trajectory and goes.
fn stretch(xml: &mut Xml, member: &Member<'_>, number: usize, range: &Range<usize>, revision: Revision) {
    let Member { name, track, .. } = member;
    let Some(first) = track.at(range.start) else { return };
    if range.start > 0 {
        event(xml, &format!("add_{name}_{number}"), range.start, |xml| {
            entity_action(xml, name, |xml| xml.within("AddEntityAction", &[], |xml| position(xml, first)));
        });
    }
    if range.len() > 1 {
        event(xml, &format!("follow_{name}_{number}"), range.start, |xml| {
            xml.within("PrivateAction", &[], |xml| {
                xml.within("RoutingAction", &[], |xml| {
                    xml.within("FollowTrajectoryAction", &[], |xml| {
                        let named = format!("trajectory_{name}_{number}");
                        follow(xml, &named, track, range, revision);
                    });
                });
            });
        });
    }
    if leaves(member, range) {
        event(xml, &format!("delete_{name}_{number}"), range.end - 1, |xml| {
            entity_action(xml, name, |xml| xml.empty("DeleteEntityAction", &[]));
        });
    }
}

/// Writes a trajectory. 1.0 has no `TrajectoryRef`. Its times count from the start of the action, because ScenarioRunner reads them so,
/// whatever `TimeReference` says.
fn follow(xml: &mut Xml, name: &str, track: &Track, range: &Range<usize>, revision: Revision) {
    let (from, domain) = match revision {
        Revision::V1_0 => (range.start, "relative"),
        Revision::V1_2 => (0, "absolute"),
    };
    let trajectory = |xml: &mut Xml| {
        xml.within("Trajectory", &[("name", &name), ("closed", &"false")], |xml| {
            xml.within("Shape", &[], |xml| {
                xml.within("Polyline", &[], |xml| {
                    for step in range.clone() {
                        let Some(sample) = track.at(step) else { continue };
                        xml.within("Vertex", &[("time", &seconds(step - from))], |xml| position(xml, sample));
                    }
                });
            });
        });
    };
    match revision {
        Revision::V1_0 => trajectory(xml),
        Revision::V1_2 => xml.within("TrajectoryRef", &[], trajectory),
    }
    xml.within("TimeReference", &[], |xml| {
        xml.empty("Timing", &[("domainAbsoluteRelative", &domain), ("scale", &1), ("offset", &0)]);
    });
    xml.empty("TrajectoryFollowingMode", &[("followingMode", &"position")]);
}

pub(super) fn position(xml: &mut Xml, sample: &Sample) {
    within_position(xml, "Position", sample);
}

/// Writes a position under the name that an action gives it.
pub(super) fn within_position(xml: &mut Xml, name: &'static str, sample: &Sample) {
    let (x, y, h) = (decimal(sample.position.x), decimal(sample.position.y), decimal(sample.heading_rad));
    xml.within(name, &[], |xml| {
        xml.empty("WorldPosition", &[("x", &x), ("y", &y), ("z", &0), ("h", &h), ("p", &0), ("r", &0)]);
    });
}

fn entity_action(xml: &mut Xml, name: &str, inside: impl FnOnce(&mut Xml)) {
    xml.within("GlobalAction", &[], |xml| xml.within("EntityAction", &[("entityRef", &name)], inside));
}

/// Writes an event with one action that happens at a step.
fn event(xml: &mut Xml, name: &str, step: usize, action: impl FnOnce(&mut Xml)) {
    xml.within("Event", &[("name", &name), ("priority", &"parallel"), ("maximumExecutionCount", &1)], |xml| {
        xml.within("Action", &[("name", &format!("{name}_action"))], action);
        xml.within("StartTrigger", &[], |xml| after(xml, &format!("{name}_time"), step));
    });
}

/// Writes a condition that is true once simulation time has passed a step: ScenarioRunner knows `greaterThan`.
pub(super) fn after(xml: &mut Xml, name: &str, step: usize) {
    xml.within("ConditionGroup", &[], |xml| {
        xml.within("Condition", &[("name", &name), ("delay", &0), ("conditionEdge", &"none")], |xml| {
            xml.within("ByValueCondition", &[], |xml| {
                xml.empty("SimulationTimeCondition", &[("value", &seconds(step)), ("rule", &"greaterThan")]);
            });
        });
    });
}
