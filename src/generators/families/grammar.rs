//! The part of the interface that every replay family shares: scene selection, actor ranking, timing, filters and
//! the final choice. A family adds its own motion and search operators; those carry its private vocabulary.
//!
//! A graph runs select -> actor -> timing -> motion, then any chain of search and filter nodes over scored candidate
//! sets, and ends in one diversity node that makes the choice.

use std::collections::BTreeMap;

use crate::adapters::graph::UNITES;
use crate::adapters::{Domain, Feature, MechanismSlotSpec, OperatorSpec, ParameterSpec, Port, SettingSpec, vocabulary};
use crate::objects::expr::Expr;
use crate::objects::{MechanismModule, OperatorNode, ParameterRef, ParameterValue, Program, Setting, Slot, ValueType};

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

/// Returns the ports into and out of a slot's operators.
fn ports(slot: Slot) -> (Vec<Port>, Port) {
    match slot {
        Slot::Select => (vec![], Port::Scene),
        Slot::Actor => (vec![Port::Scene], Port::Actors),
        Slot::Timing => (vec![Port::Actors], Port::Window),
        Slot::Motion => (vec![Port::Window], Port::Candidates),
        Slot::Search | Slot::Filter | Slot::Law => (vec![Port::Candidates], Port::Candidates),
        Slot::Diversity => (vec![Port::Candidates], Port::Choice),
    }
}

/// Operators of the six slots that do not depend on how a family makes motion.
pub fn shared_operators() -> BTreeMap<Slot, Vec<OperatorSpec>> {
    BTreeMap::from([
        (Slot::Select, select_operators()),
        (Slot::Actor, actor_operators()),
        (Slot::Timing, timing_operators()),
        (Slot::Filter, filter_operators()),
        (Slot::Law, law_operators()),
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
                "where none is marked: nobody, the moving vehicle whose log comes nearest to the ego's rollout, or the nearest now",
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
        operator(
            Slot::Filter,
            "reshape",
            [
                optional("speed", "shape_speed_share", "the way is driven at this share of the candidate's speed"),
                optional("offset", "shape_offset_m", "metres to the left of the candidate's way"),
            ],
            "Retimes and shifts every candidate along its way, and removes none. Before the search, the search judges what \
             it makes.",
        ),
        of_two(
            "first_of",
            [required(
                "until",
                choice(&["candidate", "meeting"]),
                "what the first must have: a candidate that no filter refused, or one that is predicted to touch the ego's rollout",
            )],
            "Fallback: the first input where it serves, else the second.",
        ),
        of_two(
            "either",
            [required("gate", mechanism("scene_gate"), "the first input where it holds, else the second")],
            "One way in some scenes, another in the rest.",
        ),
        of_two(
            UNITES,
            [],
            "The candidates of both, with their scores; both behind one timing node, and behind their searches where a motion opens \
             a space of offsets.",
        ),
    ]
}

/// A filter kind in which two ways meet.
fn of_two<const N: usize>(kind: &str, settings: [(String, SettingSpec); N], describes: &str) -> OperatorSpec {
    let mut spec = operator(Slot::Filter, kind, settings, describes);
    spec.inputs = vec![Port::Candidates; 2];
    spec
}

fn law_operators() -> Vec<OperatorSpec> {
    vec![operator(
        Slot::Law,
        "obey_law",
        [
            required("acceleration", mechanism("law_acceleration_mps2"), "at every step of 0.1 s"),
            optional("onset", "law_onset", "without it at once"),
            optional("offset", "law_offset_m", "without it on the path"),
        ],
        "Until the onset the adversary follows the chosen candidate, then it drives by the law along the candidate's path as a \
         car can (brakes 8.8, engine 2.8 m/s^2, sideways 2 m/s). Only recorded vehicles obey. Filters and searches judge the \
         candidate, not what the law makes of it.",
    )]
}

/// The mechanism slots of laws.
pub const LAW_SLOTS: [&str; 3] = ["law_onset", "law_acceleration_mps2", "law_offset_m"];

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

/// The choice that a study offers where it has a budget for it (`budget.rehearsals`), and its mechanism slot.
pub const REHEARSED_CHOICE: &str = "rehearsed_choice";
pub const REHEARSAL_SLOT: &str = "rehearsal_value";

/// Most candidates of a scene that any program may roll out before it chooses.
pub const REHEARSALS_MAX: u32 = 16;

/// The operator by which a program rolls at most so many candidates out before it chooses.
pub fn rehearsed_choice(most: u32) -> OperatorSpec {
    operator(
        Slot::Diversity,
        REHEARSED_CHOICE,
        [
            required(
                "count",
                integer(1, i64::from(most), "1"),
                "how many candidates are rolled out, the best by score",
            ),
            required("value", mechanism(REHEARSAL_SLOT), "of a candidate and its rollout; the largest is chosen"),
        ],
        "Rolls the best candidates out against the ego, each by itself, and chooses by what came of them. Each rollout counts.",
    )
}

/// The mechanism slot of that choice's value.
pub fn rehearsal_slot() -> (String, MechanismSlotSpec) {
    let features = vocabulary::CANDIDATE.iter().chain(vocabulary::ACTOR).chain(vocabulary::REHEARSED);
    slot(
        REHEARSAL_SLOT,
        ValueType::Number,
        features.cloned().collect(),
        "Worth of a candidate that was rolled out against the ego; the rehearsed_ features tell what came of it.",
    )
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
            vocabulary::ACTOR.iter().chain(vocabulary::GROUP).cloned().collect(),
            "Seconds after the current step at which the changed motion begins; by adversary_index one after the other.",
        ),
        slot(
            "candidate_guard",
            ValueType::Boolean,
            candidate_features(),
            "Whether a candidate trajectory may be used.",
        ),
        slot(
            "shape_speed_share",
            ValueType::Number,
            vocabulary::SHAPE.to_vec(),
            "Share of the candidate's speed at a moment of it, clamped to 0..2; 1 keeps it.",
        ),
        slot(
            "shape_offset_m",
            ValueType::Number,
            vocabulary::SHAPE.to_vec(),
            "Metres to the left of the candidate's way at a moment of it, clamped to -8..8, changing by 2 m/s at most.",
        ),
        slot(
            "law_onset",
            ValueType::Boolean,
            vocabulary::LAW.to_vec(),
            "Whether the law takes over now; asked at every step of 0.1 s until it holds.",
        ),
        slot(
            "law_acceleration_mps2",
            ValueType::Number,
            vocabulary::LAW.to_vec(),
            "Acceleration at this step, m/s^2, clamped to -8.8..2.8; planned_acceleration_mps2 keeps to the candidate.",
        ),
        slot(
            "law_offset_m",
            ValueType::Number,
            vocabulary::LAW.to_vec(),
            "Metres to the left of the candidate's path at this step, clamped to -8..8; 0 keeps to the path.",
        ),
    ]
    .into_iter()
    .collect()
}

/// A mechanism slot with its name.
pub fn slot(name: &str, output: ValueType, features: Vec<Feature>, describes: &str) -> (String, MechanismSlotSpec) {
    (name.into(), MechanismSlotSpec { output, features, describes: describes.into() })
}

/// Returns the features that expressions about a candidate read: those of the candidate and of the actor whose candidate it is.
pub fn candidate_features() -> Vec<Feature> {
    vocabulary::CANDIDATE.iter().chain(vocabulary::ACTOR).cloned().collect()
}

/// Parameters of every parent that changes a recorded motion. There are no others that all share: a parameter that a
/// parent does not use would be an edit without effect, and expressions may hold numbers.
pub fn shared_parameters() -> BTreeMap<String, ParameterSpec> {
    [parameter("duration_s", number(1.0, 8.0, "s"), "length of the changed motion")].into_iter().collect()
}

/// Their values in a parent program.
pub fn shared_values() -> BTreeMap<String, ParameterValue> {
    [value("duration_s", 8.0)].into_iter().collect()
}

/// The parameter that a drawn choice's temperature follows, for parents that draw.
pub fn temperature_parameter() -> (String, ParameterSpec) {
    parameter("temperature", number(0.05, 5.0, "1"), "softmax temperature of a drawn choice")
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

/// The program with a law before its choice: the node `law`, and a module for each of its settings (`acceleration`, `onset`,
/// `offset`) that is given with an expression. What cannot be parsed is left to the contract's check.
pub fn with_law<const N: usize>(program: &Program, settings: [(&str, &str); N]) -> Program {
    let mut program = program.clone();
    let mut node = node("law", Slot::Law, "obey_law", &[], []).1;
    for (setting, expression) in settings {
        let slot = LAW_SLOTS.into_iter().find(|slot| slot.contains(setting)).unwrap_or(setting);
        let output = if setting == "onset" { ValueType::Boolean } else { ValueType::Number };
        let inputs = Expr::parse(expression).map(|expr| expr.names().into_iter().collect()).unwrap_or_default();
        let module = MechanismModule {
            slot: slot.into(),
            inputs,
            output,
            expression: expression.into(),
            tags: vec!["law".into()],
        };
        program.mechanism_modules.insert(slot.into(), module);
        node.settings.insert(setting.into(), from_mechanism(slot));
    }
    for choice in program.operator_graph.values_mut().filter(|node| node.slot == Slot::Diversity) {
        node.inputs = std::mem::replace(&mut choice.inputs, vec!["law".into()]);
    }
    program.operator_graph.insert("law".into(), node);
    program
}

/// Names of the constraints that every compiled decision is held to.
pub fn constraints() -> Vec<String> {
    ["map", "dynamics", "interface"].map(String::from).to_vec()
}
