//! What the families of the SafeBench protocol share. Their adversary is no recorded vehicle but a road user that a
//! traffic family brings along and that waits for the ego. So the actor operator names that road user, the timing
//! operator leaves the moment to its trigger, and motion and search operators work on whole scenarios, each simulated
//! against the ego when it is proposed. Where a scene belongs to no traffic family, nobody is eligible.

use super::interface::{self, Own};
use super::kernel::traffic_family::{FamilyParameter, parameters};
use super::kernel::{Settings, Situation, StageError};
use crate::adapters::{Family, OperatorSpec};
use crate::objects::{OperatorNode, Slot};
use crate::scene::safebench::TrafficFamily;
use crate::scene::{AgentKind, TrackIx};

/// Actor operator: the road user that meets the ego in the scene's traffic family.
pub const SCRIPTED_ACTOR: &str = "scripted_actor";
/// Timing operator: the whole run; the scenario's trigger decides.
pub const EGO_TRIGGER: &str = "ego_trigger";
/// Name of the benchmark in compile contracts.
pub const BACKEND: &str = "safebench";

/// Slots whose shared kinds rank recorded vehicles and cut windows out of logs.
pub const WITHOUT_SHARED: &[Slot] = &[Slot::Actor, Slot::Timing];
/// Their mechanism slots and parameters.
const LOG_SLOTS: [&str; 3] = ["actor_score", "actor_guard", "window_start_s"];
const LOG_PARAMETERS: [&str; 3] = ["duration_s", "actor_gap_m_max", "pressure_horizon_s"];

/// Contract and parent of a family of the SafeBench protocol.
pub fn family(mut own: Own) -> Family {
    own.operators.extend(operators());
    let mut family = own.family();
    family.contract.backend = BACKEND.into();
    family.parent.compile_contract.backend = BACKEND.into();
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
pub fn actor(situation: &Situation, _: &Settings) -> Result<Vec<TrackIx>, StageError> {
    let staging = situation.scene.staging.as_ref();
    Ok(staging.map(|staging| situation.guest(kind(staging.family))).into_iter().collect())
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
