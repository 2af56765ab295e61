//! The part of the interface that every replay family shares: scene selection, actor ranking, timing, filters and
//! the final choice. A family adds its own motion and search operators; those carry its private vocabulary.
//!
//! A graph runs select -> actor -> timing -> motion, then any chain of search and filter nodes over scored candidate
//! sets, and ends in one diversity node that makes the choice.

use std::collections::BTreeMap;

use crate::adapters::{Domain, Feature, MechanismSlotSpec, OperatorSpec, ParameterSpec, Port, SettingSpec, vocabulary};
use crate::objects::{OperatorNode, ParameterRef, ParameterValue, Setting, Slot, ValueType};

/// A number between two bounds.
pub fn number(low: f64, high: f64, unit: &str) -> Domain {
    Domain::Number { low, high, unit: unit.into() }
}

/// A whole number between two bounds.
pub fn integer(low: i64, high: i64, unit: &str) -> Domain {
    Domain::Integer { low, high, unit: unit.into() }
}

/// One of several words.
pub fn choice(options: &[&str]) -> Domain {
    Domain::Choice { options: options.iter().map(|o| o.to_string()).collect() }
}

/// The name of a module in a slot of H.
pub fn mechanism(slot: &str) -> Domain {
    Domain::Mechanism { slot: slot.into() }
}

/// A setting that every node of its kind must give.
pub fn required(name: &str, domain: Domain, describes: &str) -> (String, SettingSpec) {
    (name.into(), SettingSpec { domain, required: true, describes: describes.into() })
}

/// A setting that may be left out; only mechanisms are optional, so that no number has a hidden default.
pub fn optional(name: &str, slot: &str, describes: &str) -> (String, SettingSpec) {
    (name.into(), SettingSpec { domain: mechanism(slot), required: false, describes: describes.into() })
}

/// An operator kind of a slot's usual port types.
pub fn operator<const N: usize>(
    slot: Slot,
    kind: &str,
    settings: [(String, SettingSpec); N],
    describes: &str,
) -> OperatorSpec {
    let (inputs, output) = ports(slot);
    OperatorSpec {
        kind: kind.into(),
        inputs,
        output,
        settings: settings.into_iter().collect(),
        describes: describes.into(),
    }
}

/// What flows into and out of a slot's operators.
fn ports(slot: Slot) -> (Vec<Port>, Port) {
    match slot {
        Slot::Select => (vec![], Port::Scene),
        Slot::Actor => (vec![Port::Scene], Port::Actors),
        Slot::Timing => (vec![Port::Actors], Port::Window),
        Slot::Motion => (vec![Port::Window], Port::Candidates),
        Slot::Search | Slot::Filter => (vec![Port::Candidates], Port::Candidates),
        Slot::Diversity => (vec![Port::Candidates], Port::Choice),
    }
}

/// Operators of the five slots that do not depend on how a family makes motion.
pub fn shared_operators() -> BTreeMap<Slot, Vec<OperatorSpec>> {
    BTreeMap::from([
        (Slot::Select, select_operators()),
        (Slot::Actor, actor_operators()),
        (Slot::Timing, timing_operators()),
        (Slot::Filter, filter_operators()),
        (Slot::Diversity, diversity_operators()),
    ])
}

fn select_operators() -> Vec<OperatorSpec> {
    vec![
        operator(Slot::Select, "every_scene", [], "The program acts in every scene."),
        operator(
            Slot::Select,
            "gated_scenes",
            [required("gate", mechanism("scene_gate"), "scenes where it is false are left as recorded")],
            "The program acts only where the gate holds.",
        ),
    ]
}

fn actor_operators() -> Vec<OperatorSpec> {
    vec![
        operator(
            Slot::Actor,
            "marked_actor",
            [required(
                "otherwise",
                choice(&["none", "nearest_path", "nearest_gap"]),
                "rule where no vehicle is marked: leave the scene alone, the moving vehicle whose log comes nearest to \
                 the ego's rollout, or the moving vehicle with the smallest gap now",
            )],
            "The vehicle that the data set marks as interacting with the ego.",
        ),
        operator(
            Slot::Actor,
            "ranked_actors",
            [
                required("score", mechanism("actor_score"), "larger is taken first; ties go to the lower track"),
                required("count", integer(1, 3, "1"), "how many vehicles become adversaries"),
                optional("guard", "actor_guard", "vehicles where it is false are not eligible"),
            ],
            "The vehicles with the highest scores.",
        ),
    ]
}

/// Actor operator of families that move several vehicles at once.
pub fn group_operator() -> OperatorSpec {
    operator(
        Slot::Actor,
        "actor_group",
        [required("group_size", integer(1, 4, "1"), "how many vehicles become adversaries")],
        "The marked vehicle first, then the moving vehicles whose logs come nearest to the ego's rollout.",
    )
}

/// The parameter that a group's size follows.
pub fn group_parameter() -> (String, ParameterSpec) {
    parameter("group_size", integer(1, 4, "1"), "how many vehicles become adversaries")
}

fn timing_operators() -> Vec<OperatorSpec> {
    let duration =
        || required("duration_s", number(1.0, 8.0, "s"), "length of the changed motion; then its velocity is kept");
    vec![
        operator(
            Slot::Timing,
            "after_history",
            [duration()],
            "The window opens at the first step after the recorded history.",
        ),
        operator(
            Slot::Timing,
            "conflict_window",
            [required("lead_s", number(0.5, 6.0, "s"), "time before the logged closest approach"), duration()],
            "The window opens some time before the actor's logged closest approach to the ego's rollout.",
        ),
        operator(
            Slot::Timing,
            "timed_window",
            [
                required("start", mechanism("window_start_s"), "seconds after the current step, clamped to the scene"),
                duration(),
            ],
            "The window opens where an expression over actor features says.",
        ),
    ]
}

fn filter_operators() -> Vec<OperatorSpec> {
    vec![
        operator(
            Slot::Filter,
            "guard_filter",
            [required("guard", mechanism("candidate_guard"), "candidates where it is false are removed")],
            "Removes what a guard expression refuses.",
        ),
        operator(
            Slot::Filter,
            "dynamics_filter",
            [
                required("acceleration_mps2_max", number(1.0, 12.0, "m/s^2"), "longitudinal, either sign"),
                required("lateral_acceleration_mps2_max", number(1.0, 10.0, "m/s^2"), "v times yaw rate"),
                required("jerk_mps3_max", number(2.0, 60.0, "m/s^3"), "longitudinal"),
            ],
            "Removes candidates beyond dynamic bounds.",
        ),
        operator(
            Slot::Filter,
            "road_filter",
            [required("off_road_m_max", number(0.0, 3.0, "m"), "how far a corner may leave the drivable area")],
            "Removes candidates that leave the road.",
        ),
        operator(
            Slot::Filter,
            "bystander_filter",
            [required("gap_m_min", number(0.0, 5.0, "m"), "smallest gap to any third road user's log")],
            "Removes candidates that come too near to someone who is neither ego nor adversary.",
        ),
    ]
}

fn diversity_operators() -> Vec<OperatorSpec> {
    let temperature = || required("temperature", number(0.05, 5.0, "1"), "of the softmax over scores");
    vec![
        operator(Slot::Diversity, "best_choice", [], "The highest score; ties go to the earlier candidate."),
        operator(
            Slot::Diversity,
            "soft_choice",
            [temperature()],
            "One candidate drawn with softmax probability of its score.",
        ),
        operator(
            Slot::Diversity,
            "spread_choice",
            [
                required("count", integer(2, 8, "1"), "how many candidates are kept before the draw"),
                required("apart_m", number(0.0, 10.0, "m"), "smallest mean distance between two that are kept"),
                temperature(),
            ],
            "The best candidates that differ from each other by a distance; one is drawn by softmax.",
        ),
    ]
}

/// Mechanism slots that do not depend on how a family makes motion.
pub fn shared_mechanism_slots() -> BTreeMap<String, MechanismSlotSpec> {
    [
        slot("scene_gate", ValueType::Boolean, vec![], "Whether the program acts in a scene."),
        slot("actor_score", ValueType::Number, vocabulary::ACTOR.to_vec(), "Rank of a vehicle; larger comes first."),
        slot("actor_guard", ValueType::Boolean, vocabulary::ACTOR.to_vec(), "Whether a vehicle may be an adversary."),
        slot(
            "window_start_s",
            ValueType::Number,
            vocabulary::ACTOR.to_vec(),
            "Seconds after the current step at which the changed motion begins.",
        ),
        slot(
            "candidate_guard",
            ValueType::Boolean,
            candidate_features(),
            "Whether a candidate trajectory may be used.",
        ),
    ]
    .into_iter()
    .collect()
}

/// A mechanism slot with its name.
pub fn slot(name: &str, output: ValueType, features: Vec<Feature>, describes: &str) -> (String, MechanismSlotSpec) {
    (name.into(), MechanismSlotSpec { output, features, describes: describes.into() })
}

/// What expressions about a candidate read: the candidate itself and the actor whose candidate it is.
pub fn candidate_features() -> Vec<Feature> {
    vocabulary::CANDIDATE.iter().chain(vocabulary::ACTOR).cloned().collect()
}

/// Parameters that shared operators and expressions of any family may refer to.
pub fn shared_parameters() -> BTreeMap<String, ParameterSpec> {
    [
        parameter("duration_s", number(1.0, 8.0, "s"), "length of the changed motion"),
        parameter("temperature", number(0.05, 5.0, "1"), "softmax temperature of a drawn choice"),
        parameter(
            "actor_gap_m_max",
            number(5.0, 120.0, "m"),
            "how near a vehicle must be to be eligible; for expressions",
        ),
        parameter("pressure_horizon_s", number(0.5, 8.0, "s"), "time scale of conflict pressure; for expressions"),
        parameter("acceleration_limit_mps2", number(1.0, 12.0, "m/s^2"), "acceleration bound for guards and filters"),
        parameter(
            "lateral_limit_mps2",
            number(1.0, 10.0, "m/s^2"),
            "lateral acceleration bound for guards and filters",
        ),
        parameter("jerk_limit_mps3", number(2.0, 60.0, "m/s^3"), "jerk bound for guards and filters"),
        parameter("off_road_limit_m", number(0.0, 3.0, "m"), "road departure bound for guards and filters"),
        parameter("bystander_limit_m", number(0.0, 5.0, "m"), "bystander gap bound for guards and filters"),
    ]
    .into_iter()
    .collect()
}

/// Values of the shared parameters in a parent program; none is used by a parent's graph except the duration.
pub fn shared_values() -> BTreeMap<String, ParameterValue> {
    [
        value("duration_s", 8.0),
        value("temperature", 0.5),
        value("actor_gap_m_max", 60.0),
        value("pressure_horizon_s", 3.0),
        value("acceleration_limit_mps2", 6.0),
        value("lateral_limit_mps2", 5.0),
        value("jerk_limit_mps3", 20.0),
        value("off_road_limit_m", 0.3),
        value("bystander_limit_m", 0.2),
    ]
    .into_iter()
    .collect()
}

/// A declared parameter with its name.
pub fn parameter(name: &str, domain: Domain, describes: &str) -> (String, ParameterSpec) {
    (name.into(), ParameterSpec { domain, describes: describes.into() })
}

/// A numeric value of θ with its name.
pub fn value(name: &str, number: f64) -> (String, ParameterValue) {
    (name.into(), ParameterValue::Number(number))
}

/// A node of a graph with its name.
pub fn node<const N: usize>(
    name: &str,
    slot: Slot,
    kind: &str,
    inputs: &[&str],
    settings: [(&str, Setting); N],
) -> (String, OperatorNode) {
    let node = OperatorNode {
        slot,
        kind: kind.into(),
        settings: settings.into_iter().map(|(name, setting)| (name.to_string(), setting)).collect(),
        inputs: inputs.iter().map(|i| i.to_string()).collect(),
    };
    (name.into(), node)
}

/// A setting that follows a parameter.
pub fn from_parameter(name: &str) -> Setting {
    Setting::Parameter(ParameterRef { parameter: name.into() })
}

/// A setting that names a module.
pub fn from_mechanism(name: &str) -> Setting {
    Setting::Mechanism(crate::objects::MechanismRef { mechanism: name.into() })
}

/// A setting that is a word.
pub fn word(word: &str) -> Setting {
    Setting::Choice(word.into())
}

/// Names of the constraints that every compiled decision is held to.
pub fn constraints() -> Vec<String> {
    ["map", "dynamics", "interface"].map(String::from).to_vec()
}
