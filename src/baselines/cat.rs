//! CAT, closed-loop adversarial training (Zhang et al. 2023): one vehicle's future is replaced by the candidate of a
//! motion prior with the largest posterior P(OV) * sum P(AV) P(Coll | AV, OV) over the ego's latest rollouts.
//!
//! The learned prior (DenseTNT) is replaced by a lane-graph goal prior; everything after it follows the method's code.
//! Where no vehicle is marked as interacting, CAT's code attacks nobody in particular; here the moving vehicle whose
//! log comes nearest to the ego's rollout stands in, a declared choice.

use std::collections::BTreeMap;

use super::grammar::{self, choice, node, number, operator, optional, parameter, required, slot, value};
use super::kernel::candidate::Judged;
use super::kernel::{Part, Settings, Stage, StageError, posterior};
use super::{interface, prior};
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
    let own = [
        parameter("contact_discount", number(0.5, 1.0, "1"), "u, discount of a contact per 0.5 s check; 0.99 in CAT"),
        parameter("ego_shift_s", number(0.0, 1.5, "s"), "the ego's rollout is also tried this much earlier and later"),
    ];
    prior::parameters("").into_iter().map(|p| (p.name, p.spec)).chain(own).collect()
}

fn motion_operator() -> OperatorSpec {
    interface::operator(
        Slot::Motion,
        LANE_GRAPH_PRIOR,
        prior::parameters("").iter().map(interface::follows).collect(),
        "Candidate trajectories to goals on reachable lanes and on constant-turn arcs, with their log-probability.",
    )
}

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
    parameters.extend(prior::parameters("").into_iter().map(|p| (p.name, p.value)));
    parameters.extend([value("contact_discount", 0.99), value("ego_shift_s", 0.0)]);
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
    let prior_settings = interface::from_parameters(&prior::parameters(""));
    [
        node("select", Slot::Select, "every_scene", &[], []),
        node("actor", Slot::Actor, "marked_actor", &["select"], [("otherwise", grammar::word("nearest_path"))]),
        node("timing", Slot::Timing, "after_history", &["actor"], [own("duration_s")]),
        interface::node("motion", Slot::Motion, LANE_GRAPH_PRIOR, &["timing"], prior_settings),
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
    prior::propose(stage, &prior::options(settings, "")?, parts);
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
