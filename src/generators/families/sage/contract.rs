//! Defines what a program of the family may contain, and its parent.

use super::experts::Experts;
use super::words::{MIXED_EXPERTS, NAME, PREFERENCE_REWARD, PRIOR};
use crate::adapters::{Family, OperatorSpec};
use crate::families::grammar::{self, choice, integer, number, optional, required, slot};
use crate::families::interface::{self, FamilySpec, OwnParameter, own, word};
use crate::families::prior;
use crate::motion::motion_prior::PriorOptions;
use crate::objects::{OperatorNode, ParameterValue, Slot, ValueType};
use crate::stage::Settings;

/// Contract and parent.
pub fn family() -> Family {
    let parameters = parameters();
    FamilySpec {
        name: NAME,
        title: "SAGE: steerable preference alignment (Nie et al. 2025)",
        describes: "Two experts were trained from one motion prior by preference pairs, feasible before infeasible: \
                    one prefers danger, one realism. Their weights are mixed by one number, 0 realistic to 1 \
                    adversarial; the mixed expert's most probable trajectories are scored by a reward of danger, \
                    dynamics and map violations, and the best is replayed."
            .into(),
        words: vec![MIXED_EXPERTS, PREFERENCE_REWARD, "preference_score"],
        operators: vec![(Slot::Motion, motion_operator()), (Slot::Search, search_operator())],
        without_shared: &[],
        mechanism_slots: vec![slot(
            "preference_score",
            ValueType::Number,
            grammar::candidate_features(),
            "A reward of a candidate; the search operator says whether it is added to SAGE's own (0..10 for danger, \
             -50 off the road) or replaces it.",
        )],
        graph: parent_graph(),
        parameters,
    }
    .family()
}

fn parameters() -> Vec<OwnParameter> {
    let mut parameters = prior::parameters(PRIOR);
    parameters.extend([
        own(
            "preference_weight",
            number(0.0, 1.0, "1"),
            "w: 0 the realistic expert, 1 the adversarial one, between them their weights mixed; 0.5 in SAGE",
            0.5,
        ),
        own(
            "kept_count",
            integer(1, 64, "1"),
            "how many of the mixed expert's most probable trajectories the reward chooses from; 32 in SAGE",
            32.0,
        ),
        own(
            "expert_share",
            number(0.0, 5.0, "1"),
            "weight of the mixed expert's log-probability beside the reward; 0 in SAGE",
            0.0,
        ),
    ]);
    parameters
}

/// The parameter of a name.
fn of(name: &str) -> OwnParameter {
    let parameter = parameters().into_iter().find(|p| p.name == name);
    parameter.unwrap_or_else(|| unreachable!("{name} is declared above"))
}

fn motion_operator() -> OperatorSpec {
    let mut settings: Vec<_> = prior::parameters(PRIOR).iter().map(interface::follows).collect();
    settings.extend([
        interface::follows(&of("preference_weight")),
        interface::follows(&of("kept_count")),
        required("experts", choice(&[Experts::digest()]), "the trained experts, by the digest of their weights"),
    ]);
    interface::operator(
        Slot::Motion,
        MIXED_EXPERTS,
        settings,
        "The most probable trajectories under two preference-trained experts mixed in weight space.",
    )
}

fn search_operator() -> OperatorSpec {
    interface::operator(
        Slot::Search,
        PREFERENCE_REWARD,
        vec![
            required(
                "selection_weight",
                number(0.0, 1.0, "1"),
                "weight of danger in the reward; the rest goes to dynamics; the parent's follows preference_weight",
            ),
            interface::follows(&of("expert_share")),
            optional("score", "preference_score", "a reward of the family's own"),
            required("combine", choice(&["add", "replace"]), "what a given reward does to SAGE's own"),
        ],
        "Scores by danger, less dynamic penalties, less 50 off the road and 10 through a third road user.",
    )
}

fn parent_graph() -> Vec<(String, OperatorNode)> {
    let follow = |name: &str| (name.to_string(), grammar::from_parameter(name));
    let mut motion = interface::from_parameters(&prior::parameters(PRIOR));
    motion.extend([follow("preference_weight"), follow("kept_count"), word("experts", Experts::digest())]);
    let search = vec![
        ("selection_weight".to_string(), grammar::from_parameter("preference_weight")),
        follow("expert_share"),
        word("combine", "add"),
    ];
    let mut graph = interface::one_marked_vehicle();
    graph.extend([
        interface::node("motion", Slot::Motion, MIXED_EXPERTS, &["timing"], motion),
        interface::node("search", Slot::Search, PREFERENCE_REWARD, &["motion"], search),
        interface::best_of_search(),
    ]);
    graph
}

/// The reference prior as the parent sets it: what the experts were trained from.
pub fn prior_options() -> PriorOptions {
    let mut settings = Settings::default();
    for parameter in prior::parameters(PRIOR) {
        if let ParameterValue::Number(value) = parameter.value {
            settings.numbers.insert(parameter.name, value);
        }
    }
    prior::options(&settings, PRIOR).unwrap_or_else(|error| unreachable!("every parameter has a value: {error}"))
}
