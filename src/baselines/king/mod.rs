//! KING, safety-critical scenarios by kinematics gradients (Hanselmann et al. 2022): the steering and throttle of all
//! adversaries over the whole window are moved by Adam down a loss whose slope comes back through the bicycle model,
//! with the ego simulated again at every iteration and the search ended by its first contact.
//!
//! Kept: bicycle and its constants, the three terms of the loss, 1.25 m cap of the repulsion, Adam, and for two
//! adversaries the weights, decays, iterations and step length; slopes through the adversaries alone ("one path").
//! Declared adaptations: adversaries are recorded vehicles whose first actions follow their record; a full throttle is
//! 3 m/s², for KING's 0.56 cannot follow recorded starts; steps of 0.1 s with actions held for KING's 0.25 s; the
//! smoothed raster of undrivable ground is Φ(−distance/σ) of a signed-distance field.

pub mod actions;
pub mod loss;

use std::collections::BTreeMap;
use std::sync::Arc;

use super::grammar::{self, choice, integer, node, number, operator, optional, parameter, required, slot, value};
use super::kernel::adam::Rates;
use super::kernel::driven::{self, Descent, Driven, Iterate};
use super::kernel::{Part, Settings, Stage, StageError, following};
use crate::adapters::{Contract, Family, Limits, OperatorSpec, ParameterSpec, SettingSpec, vocabulary};
use crate::objects::{
    CompileContract, FamilyName, LineageId, OperatorNode, Program, Setting, Slot, SolutionId, ValueType,
};
use actions::ActionSpace;
use loss::{Attraction, Loss};

/// The family's name in programs, experiments and tables.
pub const NAME: &str = "king";
/// Motion operator: actions through the bicycle model.
pub const STEERED_ACTIONS: &str = "steered_actions";
/// Search operator: Adam over all adversaries' actions.
pub const KINEMATIC_DESCENT: &str = "kinematic_descent";

/// Contract and parent.
pub fn family() -> Family {
    Family { contract: contract(), parent: parent() }
}

fn contract() -> Contract {
    let mut operators = grammar::shared_operators();
    operators.entry(Slot::Actor).or_default().push(grammar::group_operator());
    operators.insert(Slot::Motion, vec![motion_operator()]);
    operators.insert(Slot::Search, vec![search_operator()]);
    let mut mechanism_slots = grammar::shared_mechanism_slots();
    mechanism_slots.extend([
        slot(
            "pursuer_weight",
            ValueType::Number,
            vocabulary::ACTOR.to_vec(),
            "How strongly a vehicle is drawn to the ego, clamped to 0.05..20; of two equally near, the larger goes.",
        ),
        slot(
            "iterate_loss",
            ValueType::Number,
            grammar::candidate_features(),
            "A loss of a motion found on the way, smaller is better; the search operator says whether it is added to \
             KING's own loss or replaces it when the iterates are ranked.",
        ),
    ]);
    let mut parameters = grammar::shared_parameters();
    parameters.extend([grammar::group_parameter()]);
    parameters.extend(own_parameters());
    Contract {
        family: FamilyName::new(NAME),
        title: "KING: safety-critical scenarios by kinematics gradients (Hanselmann et al. 2022)".into(),
        describes: "Moves the steering and throttle sequences of several recorded vehicles by gradient descent through \
                    a bicycle model: toward the ego, off undrivable ground, apart from each other. The ego is simulated \
                    again as they change; the first iterate that it touches is used."
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
    let words = [STEERED_ACTIONS, KINEMATIC_DESCENT, "pursuer_weight", "iterate_loss", "pursuit_rule"];
    words.into_iter().map(String::from).chain(own_parameters().into_keys()).collect()
}

fn own_parameters() -> BTreeMap<String, ParameterSpec> {
    [
        parameter("action_spacing_s", number(0.1, 1.0, "s"), "time for which an action is held; 0.25 in KING"),
        parameter("throttle_mps2_max", number(0.5, 4.0, "m/s^2"), "acceleration at full throttle; 0.56 in KING"),
        parameter("brake_mps2_max", number(1.0, 8.0, "m/s^2"), "deceleration at full brake; 4.95 in KING"),
        parameter("descent_iterations", integer(10, 150, "1"), "iterations of Adam; 100 to 150 in KING"),
        parameter("descent_rate", number(0.001, 0.2, "1"), "step length of Adam; 0.005 in KING"),
        parameter("first_moment_decay", number(0.5, 0.95, "1"), "beta 1; 0.8 in KING"),
        parameter("second_moment_decay", number(0.9, 0.9999, "1"), "beta 2; 0.999, 0.99, 0.99 in KING"),
        parameter("ego_replay_every", integer(1, 8, "1"), "iterations between two simulations of the ego; 1 in KING"),
        parameter("attraction_weight", number(0.1, 5.0, "1/m"), "weight of the mean distance to the ego; 1 in KING"),
        parameter("departure_weight", number(0.0, 60.0, "1"), "weight of the off-road cost; 20 to 23 in KING"),
        parameter("departure_sigma_m", number(0.3, 3.0, "m"), "width of the off-road Gaussian; 1 in KING"),
        parameter("repulsion_weight", number(0.0, 20.0, "1/m"), "weight of the adversaries' distance; 5 in KING"),
        parameter("repulsion_m_max", number(0.5, 6.0, "m"), "no repulsion beyond this distance; 1.25 in KING"),
    ]
    .into_iter()
    .collect()
}

const MOTION_SETTINGS: [&str; 3] = ["action_spacing_s", "throttle_mps2_max", "brake_mps2_max"];

const SEARCH_SETTINGS: [&str; 10] = [
    "descent_iterations",
    "descent_rate",
    "first_moment_decay",
    "second_moment_decay",
    "ego_replay_every",
    "attraction_weight",
    "departure_weight",
    "departure_sigma_m",
    "repulsion_weight",
    "repulsion_m_max",
];

/// A required setting with the domain of the parameter of the same name.
fn follows(name: &str) -> (String, SettingSpec) {
    let spec = own_parameters().remove(name).unwrap_or_else(|| unreachable!("{name} is declared above"));
    required(name, spec.domain, &spec.describes)
}

fn motion_operator() -> OperatorSpec {
    operator(
        Slot::Motion,
        STEERED_ACTIONS,
        MOTION_SETTINGS.map(follows),
        "Steering and throttle of every adversary through a bicycle model, at first those that follow its record.",
    )
}

fn search_operator() -> OperatorSpec {
    let mut spec = operator(
        Slot::Search,
        KINEMATIC_DESCENT,
        SEARCH_SETTINGS.map(follows),
        "Adam over all adversaries' actions until the ego touches one; iterates on the way become the candidates.",
    );
    spec.settings.extend([
        required(
            "pursuit_rule",
            choice(&["nearest", "everyone"]),
            "whom the ego attracts at each time; nearest in KING",
        ),
        optional("weight", "pursuer_weight", "weights of the vehicles; without it all weigh 1"),
        optional("loss", "iterate_loss", "a loss of the family's own, for ranking the iterates"),
        required("combine", choice(&["add", "replace"]), "what a given loss does to KING's own in that ranking"),
    ]);
    spec
}

/// KING for two adversaries, with the adaptations named above.
fn parent() -> Program {
    let mut parameters = grammar::shared_values();
    parameters.extend([
        value("group_size", 2.0),
        value("action_spacing_s", 0.25),
        value("throttle_mps2_max", 3.0),
        value("brake_mps2_max", 4.952399),
        value("descent_iterations", 120.0),
        value("descent_rate", 0.005),
        value("first_moment_decay", 0.8),
        value("second_moment_decay", 0.99),
        value("ego_replay_every", 1.0),
        value("attraction_weight", 1.0),
        value("departure_weight", 23.0),
        value("departure_sigma_m", 1.0),
        value("repulsion_weight", 5.0),
        value("repulsion_m_max", 1.25),
    ]);
    Program {
        solution_id: SolutionId::new("king/parent"),
        lineage_id: LineageId::new("king"),
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
        node("actor", Slot::Actor, "actor_group", &["select"], [own("group_size")]),
        node("timing", Slot::Timing, "after_history", &["actor"], [own("duration_s")]),
        node("motion", Slot::Motion, STEERED_ACTIONS, &["timing"], MOTION_SETTINGS.map(own)),
        node("search", Slot::Search, KINEMATIC_DESCENT, &["motion"], SEARCH_SETTINGS.map(own)),
        node("choice", Slot::Diversity, "best_choice", &["search"], []),
    ]
    .into_iter()
    .collect();
    for (setting, word) in [("pursuit_rule", "nearest"), ("combine", "add")] {
        if let Some(node) = graph.get_mut("search") {
            node.settings.insert(setting.into(), grammar::word(word));
        }
    }
    graph
}

/// Opens every adversary's action space, starting from the actions that follow its record.
pub fn motion(stage: &Stage<'_>, settings: &Settings, parts: &mut [Part]) -> Result<(), StageError> {
    let spacing_s = settings.number("action_spacing_s")?;
    let (throttle, brake) = (settings.number("throttle_mps2_max")?, settings.number("brake_mps2_max")?);
    for part in parts {
        let record = following::record(&stage.situation.scene.tracks[part.actor], part.window);
        let space = record.map(|(start, samples)| -> Arc<dyn Driven> {
            Arc::new(ActionSpace::following(start, &samples, spacing_s, throttle, brake))
        });
        driven::open(part, stage.situation, space);
    }
    Ok(())
}

/// At most this many iterates become candidates.
const CANDIDATES_MAX: usize = 8;

/// Adam over all actions; iterates become candidates, scored by minus their loss and below those that make contact.
pub fn search(stage: &Stage<'_>, settings: &Settings, parts: &mut [Part]) -> Result<(), StageError> {
    let descent = Descent {
        iterations: settings.count("descent_iterations")?,
        rates: Rates {
            rate: settings.number("descent_rate")?,
            first_decay: settings.number("first_moment_decay")?,
            second_decay: settings.number("second_moment_decay")?,
        },
        replay_every: settings.count("ego_replay_every")?,
    };
    let pursuit = if settings.word("pursuit_rule")? == "nearest" { Attraction::Nearest } else { Attraction::Everyone };
    let loss = Loss {
        pursuit,
        pursuer_weights: driven::actor_weights(stage.situation, parts, settings.optional("weight")),
        attraction_weight: settings.number("attraction_weight")?,
        departure_weight: settings.number("departure_weight")?,
        departure_sigma_m: settings.number("departure_sigma_m")?,
        repulsion_weight: settings.number("repulsion_weight")?,
        repulsion_m_max: settings.number("repulsion_m_max")?,
        field: stage.situation.road_field(),
    };
    let iterates =
        driven::descend(stage.situation, parts, &descent, |movers, ego, slopes| loss.of(movers, ego, slopes));
    let scored = ranked(stage, settings, &iterates)?;
    driven::into_candidates(parts, &iterates, &scored, |_| 0.0);
    Ok(())
}

/// The last iterate, the best, and an even selection of those between, with their scores.
fn ranked(stage: &Stage<'_>, settings: &Settings, iterates: &[Iterate]) -> Result<Vec<(usize, f64)>, StageError> {
    let (module, replaces) = (settings.optional("loss"), settings.word("combine")? == "replace");
    let score = |index: usize| {
        let iterate = &iterates[index];
        let own = if replaces && module.is_some() { 0.0 } else { iterate.loss };
        let given = module.map_or(0.0, |module| driven::judged(stage.situation, iterate, module, |_| 0.0));
        (index, driven::score(iterate.contact, own + given))
    };
    Ok(driven::selection(iterates, CANDIDATES_MAX).into_iter().map(score).collect())
}
