//! CAT, closed-loop adversarial training (Zhang et al. 2023): one vehicle's future is replaced by the candidate of a
//! motion prior with the largest posterior P(OV) * sum P(AV) P(Coll | AV, OV) over the ego's latest rollouts.
//!
//! The learned prior (DenseTNT) is replaced by a lane-graph goal prior; everything after it follows the method's code.
//! Where no vehicle is marked as interacting, CAT's code attacks nobody in particular; here the moving vehicle whose
//! log comes nearest to the ego's rollout stands in, a declared choice.

use std::collections::BTreeMap;

use super::grammar::{self, choice, integer, node, number, operator, optional, parameter, required, slot, value};
use super::kernel::candidate::Judged;
use super::kernel::motion_prior::{self, PriorOptions};
use super::kernel::{Part, Settings, Stage, StageError, posterior};
use crate::adapters::{Contract, Family, Limits, OperatorSpec, ParameterSpec, vocabulary};
use crate::objects::{
    CompileContract, FamilyName, LineageId, OperatorNode, Program, Setting, Slot, SolutionId, ValueType,
};

/// The family's name in programs, experiments and tables.
pub const NAME: &str = "cat";
/// Motion operator: candidates from the lane-graph prior.
pub const LANE_GRAPH_PRIOR: &str = "lane_graph_prior";
/// Search operator: posterior over ego rollouts.
pub const COLLISION_POSTERIOR: &str = "collision_posterior";

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
        "candidate_score",
        ValueType::Number,
        grammar::candidate_features(),
        "A log-score of a candidate; the search operator says whether it is added to the posterior or replaces it.",
    )]);
    let mut parameters = grammar::shared_parameters();
    parameters.extend(prior_parameters());
    Contract {
        family: FamilyName::new(NAME),
        title: "CAT: closed-loop adversarial training (Zhang et al. 2023)".into(),
        describes: "Replaces the future of a recorded vehicle by one of 32 trajectories of a lane-graph motion prior. \
                    Each is weighed by its prior probability times the discounted probability that it meets the ego's \
                    latest rollout; the largest posterior is replayed."
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
    let words = [LANE_GRAPH_PRIOR, COLLISION_POSTERIOR, "candidate_score"].into_iter().map(String::from);
    words.chain(prior_parameters().into_keys()).collect()
}

fn prior_parameters() -> BTreeMap<String, ParameterSpec> {
    [
        parameter("candidate_count", integer(4, 64, "1"), "M, trajectories kept; 32 in CAT"),
        parameter("nms_radius_m", number(1.0, 15.0, "m"), "goal suppression radius at full speed; 7.2 in CAT"),
        parameter("goal_spacing_m", number(1.0, 8.0, "m"), "distance of goals along a centre line; 2 in the stand-in"),
        parameter("profile_step_mps2", number(0.5, 3.0, "m/s^2"), "step between constant-acceleration profiles"),
        parameter(
            "profile_levels",
            integer(1, 4, "1"),
            "profiles on each side of keeping the speed; 3 = +-1, +-2, +-3",
        ),
        parameter("speed_change_scale_mps", number(0.5, 8.0, "m/s"), "scale of the mean-speed term of the log-prior"),
        parameter("acceleration_scale_mps2", number(0.5, 8.0, "m/s^2"), "scale of the acceleration term"),
        parameter("lateral_scale_mps2", number(0.5, 8.0, "m/s^2"), "scale of the lateral acceleration term"),
        parameter("lane_offset_scale_m", number(0.3, 6.0, "m"), "scale of the deviation from the own lane"),
        parameter("lane_change_cost", number(0.0, 4.0, "1"), "log-prior cost of each lane change"),
        parameter("flatten_rank", integer(0, 63, "1"), "from this rank on all candidates weigh alike; 6 in CAT"),
        parameter("contact_discount", number(0.5, 1.0, "1"), "u, discount of a contact per 0.5 s check; 0.99 in CAT"),
        parameter("ego_shift_s", number(0.0, 1.5, "s"), "the ego's rollout is also tried this much earlier and later"),
    ]
    .into_iter()
    .collect()
}

fn motion_operator() -> OperatorSpec {
    let follows = |name: &str| {
        let spec = prior_parameters().remove(name).unwrap_or_else(|| unreachable!("{name} is declared above"));
        required(name, spec.domain, &spec.describes)
    };
    operator(
        Slot::Motion,
        LANE_GRAPH_PRIOR,
        MOTION_SETTINGS.map(follows),
        "Candidate trajectories to goals on reachable lanes and on constant-turn arcs, with their log-probability.",
    )
}

/// Settings of the motion operator; the parent lets each follow the parameter of its name.
const MOTION_SETTINGS: [&str; 11] = [
    "candidate_count",
    "nms_radius_m",
    "goal_spacing_m",
    "profile_step_mps2",
    "profile_levels",
    "speed_change_scale_mps",
    "acceleration_scale_mps2",
    "lateral_scale_mps2",
    "lane_offset_scale_m",
    "lane_change_cost",
    "flatten_rank",
];

fn search_operator() -> OperatorSpec {
    operator(
        Slot::Search,
        COLLISION_POSTERIOR,
        [
            required("contact_discount", number(0.5, 1.0, "1"), "u per 0.5 s check"),
            required("ego_shift_s", number(0.0, 1.5, "s"), "0: only the ego's rollout as it was"),
            optional("score", "candidate_score", "a log-score of the family's own"),
            required("combine", choice(&["add", "replace"]), "what a given score does to the log-posterior"),
        ],
        "Scores by log of prior times discounted contact with the ego's rollout; if no candidate meets it, by nearness.",
    )
}

/// CAT as published.
fn parent() -> Program {
    let mut parameters = grammar::shared_values();
    parameters.extend([
        value("candidate_count", 32.0),
        value("nms_radius_m", 7.2),
        value("goal_spacing_m", 2.0),
        value("profile_step_mps2", 1.0),
        value("profile_levels", 3.0),
        value("speed_change_scale_mps", 2.0),
        value("acceleration_scale_mps2", 3.0),
        value("lateral_scale_mps2", 3.0),
        value("lane_offset_scale_m", 1.5),
        value("lane_change_cost", 0.5),
        value("flatten_rank", 6.0),
        value("contact_discount", 0.99),
        value("ego_shift_s", 0.0),
    ]);
    Program {
        solution_id: SolutionId::new("cat/parent"),
        lineage_id: LineageId::new("cat"),
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
    [
        node("select", Slot::Select, "every_scene", &[], []),
        node("actor", Slot::Actor, "marked_actor", &["select"], [("otherwise", grammar::word("nearest_path"))]),
        node("timing", Slot::Timing, "after_history", &["actor"], [own("duration_s")]),
        node("motion", Slot::Motion, LANE_GRAPH_PRIOR, &["timing"], MOTION_SETTINGS.map(own)),
        node(
            "search",
            Slot::Search,
            COLLISION_POSTERIOR,
            &["motion"],
            [own("contact_discount"), own("ego_shift_s"), ("combine", grammar::word("add"))],
        ),
        node("choice", Slot::Diversity, "best_choice", &["search"], []),
    ]
    .into_iter()
    .collect()
}

/// Candidates of the lane-graph prior from the actor's sample before its window.
pub fn motion(stage: &Stage<'_>, settings: &Settings, parts: &mut [Part]) -> Result<(), StageError> {
    let options = PriorOptions {
        count: settings.count("candidate_count")?,
        nms_radius_m: settings.number("nms_radius_m")?,
        goal_spacing_m: settings.number("goal_spacing_m")?,
        profile_step_mps2: settings.number("profile_step_mps2")?,
        profile_levels: settings.count("profile_levels")?,
        speed_change_scale_mps: settings.number("speed_change_scale_mps")?,
        acceleration_scale_mps2: settings.number("acceleration_scale_mps2")?,
        lateral_scale_mps2: settings.number("lateral_scale_mps2")?,
        lane_offset_scale_m: settings.number("lane_offset_scale_m")?,
        lane_change_cost: settings.number("lane_change_cost")?,
        flatten_rank: settings.count("flatten_rank")?,
    };
    for part in parts {
        let track = &stage.situation.scene.tracks[part.actor];
        let Some(anchor) = part.window.from_step.checked_sub(1).and_then(|step| track.at(step)) else { continue };
        let mut stream = stage.stream("prior", part.actor);
        part.candidates =
            motion_prior::candidates(&stage.situation.lanes, anchor, part.window.steps, &options, &mut stream);
    }
    Ok(())
}

/// Scores candidates by the collision posterior, and by a score expression where one is given.
pub fn search(stage: &Stage<'_>, settings: &Settings, parts: &mut [Part]) -> Result<(), StageError> {
    let discount = settings.number("contact_discount")?;
    let shift = posterior::shift_steps(settings.number("ego_shift_s")?);
    let replaces = settings.word("combine")? == "replace";
    let adversaries: Vec<usize> = parts.iter().map(|part| part.actor).collect();
    for part in parts {
        let from_step = part.window.from_step;
        posterior::score(stage.situation, part.actor, from_step, discount, shift, &mut part.candidates);
        let Some(module) = settings.optional("score") else { continue };
        let judged = Judged { situation: stage.situation, actor: part.actor, from_step, adversaries: &adversaries };
        for candidate in &mut part.candidates {
            let own = module.of_candidate(candidate, &judged);
            candidate.score = if replaces { own } else { candidate.score + own };
        }
    }
    Ok(())
}
