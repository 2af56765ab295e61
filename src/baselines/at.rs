//! AT, adversarial trajectories (Zhang et al. 2022): a vehicle's own path plus offsets of at most 1 m whose derivative
//! bounds hold by global scaling, found by particle swarm on a directional loss.
//!
//! The method perturbs what a trajectory predictor observes. Against a closed-loop ego the perturbed path is the one
//! that is driven: offsets at knots of 0.5 s on the logged future, the first knot 0, loss toward the ego's rollout.
//! This adaptation is ours, declared; the source describes none. Bounds are the method's nuScenes maxima in SI.

use std::collections::BTreeMap;

use super::grammar::{self, choice, integer, node, number, operator, optional, parameter, required, slot, value};
use crate::adapters::{Contract, Family, Feature, Limits, OperatorSpec, ParameterSpec, vocabulary};
use crate::objects::{
    CompileContract, FamilyName, LineageId, OperatorNode, Program, Setting, Slot, SolutionId, ValueType,
};

/// The family's name in programs, experiments and tables.
pub const NAME: &str = "at";
/// Motion operator: the logged path with bounded offsets.
pub const BOUNDED_OFFSETS: &str = "bounded_offsets";
/// Search operator: particle swarm over the offsets.
pub const PARTICLE_SWARM: &str = "particle_swarm";

/// Contract and parent.
pub fn family() -> Family {
    Family { contract: contract(), parent: parent() }
}

fn contract() -> Contract {
    let mut operators = grammar::shared_operators();
    operators.insert(Slot::Motion, vec![motion_operator()]);
    operators.insert(Slot::Search, vec![search_operator()]);
    let mut mechanism_slots = grammar::shared_mechanism_slots();
    mechanism_slots.extend([slot(
        "offset_loss",
        ValueType::Number,
        loss_features(),
        "A loss of a perturbed path, smaller is better; the search operator says whether it is added to AT's own loss \
         or replaces it.",
    )]);
    let mut parameters = grammar::shared_parameters();
    parameters.extend(own_parameters());
    Contract {
        family: FamilyName::new(NAME),
        title: "AT: adversarial trajectories (Zhang et al. 2022)".into(),
        describes:
            "Keeps a recorded vehicle on its own path and shifts it by offsets of at most one metre at knots of \
                    0.5 s. All offsets are scaled down together until speed, acceleration and jerk stay within bounds. \
                    A particle swarm looks for the offsets that bring it toward the ego's rollout."
                .into(),
        backend: "metadrive".into(),
        private_vocabulary: private_vocabulary(),
        parameters,
        operators,
        mechanism_slots,
        scene_features: vocabulary::SCENE.to_vec(),
        constraints: grammar::constraints(),
        limits: Limits::default(),
    }
}

/// Words that another family may not use.
fn private_vocabulary() -> Vec<String> {
    let words = [BOUNDED_OFFSETS, PARTICLE_SWARM, "offset_loss"].into_iter().map(String::from);
    words.chain(own_parameters().into_keys()).collect()
}

/// What a loss may read: it is evaluated a thousand times a scene, so only what is cheap on 0.5 s checks.
fn loss_features() -> Vec<Feature> {
    let cheap = ["ego_distance_m_min", "closest_approach_s", "closest_speed_mps", "log_deviation_m_max"];
    let candidate = vocabulary::CANDIDATE.iter().filter(|f| cheap.contains(&f.name));
    candidate.chain(vocabulary::ACTOR).cloned().collect()
}

fn own_parameters() -> BTreeMap<String, ParameterSpec> {
    [
        parameter("offset_m_max", number(0.05, 1.0, "m"), "largest offset at any time; 1 in AT"),
        parameter("knot_spacing_s", number(0.3, 2.0, "s"), "time between knots; 0.5 in the adaptation"),
        parameter("path_speed_mps_max", number(5.0, 40.0, "m/s"), "speed bound of the perturbed path"),
        parameter("path_acceleration_mps2_max", number(0.5, 9.0, "m/s^2"), "longitudinal acceleration bound"),
        parameter("path_lateral_mps2_max", number(0.3, 6.0, "m/s^2"), "lateral acceleration bound"),
        parameter("path_jerk_mps3_max", number(1.0, 30.0, "m/s^3"), "longitudinal jerk bound"),
        parameter("path_lateral_jerk_mps3_max", number(0.5, 20.0, "m/s^3"), "lateral jerk bound"),
        parameter("particle_count", integer(4, 20, "1"), "particles of the swarm; 10 in AT"),
        parameter("iteration_count", integer(10, 150, "1"), "iterations of the swarm; 100 in AT"),
        parameter("cognitive_pull", number(0.0, 2.5, "1"), "c1; 0.5 in AT"),
        parameter("social_pull", number(0.0, 2.5, "1"), "c2; 0.3 in AT"),
        parameter("inertia", number(0.1, 1.0, "1"), "w; 1 in AT"),
        parameter("toward_weight", number(0.0, 5.0, "1"), "weight of the mean offset toward the ego's rollout"),
        parameter("distance_weight", number(0.0, 5.0, "1/m"), "weight of the smallest distance to the ego's rollout"),
    ]
    .into_iter()
    .collect()
}

const MOTION_SETTINGS: [&str; 7] = [
    "offset_m_max",
    "knot_spacing_s",
    "path_speed_mps_max",
    "path_acceleration_mps2_max",
    "path_lateral_mps2_max",
    "path_jerk_mps3_max",
    "path_lateral_jerk_mps3_max",
];

const SEARCH_SETTINGS: [&str; 7] = [
    "particle_count",
    "iteration_count",
    "cognitive_pull",
    "social_pull",
    "inertia",
    "toward_weight",
    "distance_weight",
];

/// A required setting with the domain of the parameter of the same name.
fn follows(name: &str) -> (String, crate::adapters::SettingSpec) {
    let spec = own_parameters().remove(name).unwrap_or_else(|| unreachable!("{name} is declared above"));
    required(name, spec.domain, &spec.describes)
}

fn motion_operator() -> OperatorSpec {
    let mut spec = operator(
        Slot::Motion,
        BOUNDED_OFFSETS,
        MOTION_SETTINGS.map(follows),
        "The actor's own logged path and the offsets that may be added to it.",
    );
    spec.settings.extend([required(
        "interpolation",
        choice(&["linear", "cubic"]),
        "how offsets run between knots; cubic is smooth in velocity",
    )]);
    spec
}

fn search_operator() -> OperatorSpec {
    let mut spec = operator(
        Slot::Search,
        PARTICLE_SWARM,
        SEARCH_SETTINGS.map(follows),
        "Moves a swarm of offsets to smaller loss; the best of every particle become the candidates.",
    );
    spec.settings.extend([
        optional("loss", "offset_loss", "a loss of the family's own"),
        required("combine", choice(&["add", "replace"]), "what a given loss does to AT's own"),
    ]);
    spec
}

/// AT as published, on the logged future.
fn parent() -> Program {
    let mut parameters = grammar::shared_values();
    parameters.extend([
        value("offset_m_max", 1.0),
        value("knot_spacing_s", 0.5),
        value("path_speed_mps_max", 17.2),
        value("path_acceleration_mps2_max", 5.1),
        value("path_lateral_mps2_max", 1.87),
        value("path_jerk_mps3_max", 15.7),
        value("path_lateral_jerk_mps3_max", 4.3),
        value("particle_count", 10.0),
        value("iteration_count", 100.0),
        value("cognitive_pull", 0.5),
        value("social_pull", 0.3),
        value("inertia", 1.0),
        value("toward_weight", 1.0),
        value("distance_weight", 1.0),
    ]);
    Program {
        solution_id: SolutionId::new("at/parent"),
        lineage_id: LineageId::new("at"),
        source_family: FamilyName::new(NAME),
        generation: 0,
        parameters,
        operator_graph: parent_graph(),
        scenario_conditioned_policy: vec![],
        mechanism_modules: BTreeMap::new(),
        compile_contract: CompileContract { backend: "metadrive".into(), constraints: grammar::constraints() },
        ancestor_chain: vec![],
    }
}

fn parent_graph() -> BTreeMap<String, OperatorNode> {
    let own = |name: &'static str| -> (&'static str, Setting) { (name, grammar::from_parameter(name)) };
    let mut graph: BTreeMap<String, OperatorNode> = [
        node("select", Slot::Select, "every_scene", &[], []),
        node("actor", Slot::Actor, "marked_actor", &["select"], [("otherwise", grammar::word("nearest_path"))]),
        node("timing", Slot::Timing, "after_history", &["actor"], [own("duration_s")]),
        node("motion", Slot::Motion, BOUNDED_OFFSETS, &["timing"], MOTION_SETTINGS.map(own)),
        node("search", Slot::Search, PARTICLE_SWARM, &["motion"], SEARCH_SETTINGS.map(own)),
        node("choice", Slot::Diversity, "best_choice", &["search"], []),
    ]
    .into_iter()
    .collect();
    let extra = [("motion", "interpolation", "cubic"), ("search", "combine", "add")];
    for (name, setting, word) in extra {
        if let Some(node) = graph.get_mut(name) {
            node.settings.insert(setting.into(), grammar::word(word));
        }
    }
    graph
}
