//! Defines what a program of the family may contain, and its parent.

use super::words::{ATTACKER_POOL, ATTACKER_PRIOR, COUNSEL_RANK, COUNSEL_WEIGHT, DELIBERATION, NAME, PRIOR};
use crate::adapters::{Family, Feature, OperatorSpec, vocabulary};
use crate::families::grammar::{self, choice, from_parameter, integer, number, optional, required, slot};
use crate::families::interface::{self, FamilySpec, OwnParameter, own, word};
use crate::families::prior;
use crate::objects::{OperatorNode, Slot, ValueType};

/// Contract and parent.
pub fn family() -> Family {
    let (pool, motion, search) = (pool_parameters(), prior::parameters(PRIOR), search_parameters());
    FamilySpec {
        name: NAME,
        title: "LLM-Attacker: attackers chosen with feedback (Mei et al. 2025)",
        describes: "Searches who attacks. The most promising vehicles form a pool, each with CAT's candidate \
                    trajectories and posterior. One attacker is proposed and tried against the driver; from why the \
                    attack failed (never close, late, early, ego yielded, blocked) the next round takes another \
                    attacker, another pace, a second attacker or another way. The best attack of all rounds is used. \
                    For every scene an attacker agent has named attackers after trying some; counsel_weight says how \
                    far that counsel is trusted, and counsel_rank who was named."
            .into(),
        words: vec![
            ATTACKER_POOL,
            ATTACKER_PRIOR,
            DELIBERATION,
            COUNSEL_RANK,
            "attacker_score",
            "attacker_guard",
            "attack_score",
        ],
        operators: vec![
            (Slot::Actor, pool_operator(&pool)),
            (
                Slot::Motion,
                interface::operator(
                    Slot::Motion,
                    ATTACKER_PRIOR,
                    motion.iter().map(interface::follows).collect(),
                    "Candidate trajectories of the lane-graph prior for every vehicle of the pool.",
                ),
            ),
            (Slot::Search, search_operator(&search)),
        ],
        without_shared: &[Slot::Actor],
        mechanism_slots: vec![
            slot(
                "attacker_score",
                ValueType::Number,
                attacker_features(),
                "How promising a vehicle is as an attacker; added to the pool's own score (0..2.5) or in its place.",
            ),
            slot("attacker_guard", ValueType::Boolean, attacker_features(), "Whether a vehicle may be an attacker."),
            slot(
                "attack_score",
                ValueType::Number,
                grammar::candidate_features(),
                "A log-score of an attacker's candidate; added to CAT's posterior or in its place.",
            ),
        ],
        graph: parent_graph(&pool, &motion, &search),
        parameters: pool.into_iter().chain(motion).chain(search).collect(),
    }
    .family()
}

fn pool_parameters() -> Vec<OwnParameter> {
    let weight = |name, describes, value| own(name, number(0.0, 4.0, "1"), describes, value);
    vec![
        own("pool_size", integer(1, 5, "1"), "vehicles that may attack", 3.0),
        trust(),
        weight("urgency_weight", "weight of exp(-time to collision / 3 s)", 1.0),
        weight("nearness_weight", "weight of exp(-gap / 20 m)", 0.7),
        weight("conflict_weight", "weight of a log that crosses the ego's route", 0.5),
        weight("lane_relation_weight", "weight of driving in the ego's lane or beside it", 0.3),
        weight("behind_weight", "what a vehicle behind the ego loses", 0.5),
    ]
}

/// The parameter that pool and search share. The parent's 4 outweighs what else the parent's weights can sum up to.
fn trust() -> OwnParameter {
    own(
        COUNSEL_WEIGHT,
        number(0.0, super::counsel::TRUST_MAX, "1"),
        "added to the score of a vehicle that the attacker agent named for the scene; 0 ignores the counsel",
        4.0,
    )
}

/// Returns the features that expressions about an attacker read.
fn attacker_features() -> Vec<Feature> {
    let mut features = vocabulary::ACTOR.to_vec();
    features.push(Feature {
        name: COUNSEL_RANK,
        value: ValueType::Number,
        unit: "1",
        describes: "place among the attackers that the attacker agent named for the scene, from 1; 0 if not named",
    });
    features
}

fn search_parameters() -> Vec<OwnParameter> {
    vec![
        own("attacker_count", integer(1, 3, "1"), "most vehicles that attack together", 2.0),
        own("reflection_rounds", integer(0, 4, "1"), "rounds after the first proposal; 0 tries nothing", 3.0),
        own("attack_discount", number(0.5, 1.0, "1"), "u, discount of a contact per 0.5 s; 0.99 in CAT", 0.99),
        own("reach_weight", number(0.0, 4.0, "1"), "weight of being able to reach the ego within a second", 2.0),
    ]
}

fn pool_operator(parameters: &[OwnParameter]) -> OperatorSpec {
    let mut settings: Vec<_> = parameters.iter().map(interface::follows).collect();
    settings.extend([
        optional("score", "attacker_score", "a score of the family's own"),
        optional("guard", "attacker_guard", "vehicles where it is false are not eligible"),
        required("combine", choice(&["add", "replace"]), "what a given score does to the pool's own"),
    ]);
    interface::operator(Slot::Actor, ATTACKER_POOL, settings, "The most promising vehicles, most promising first.")
}

fn search_operator(parameters: &[OwnParameter]) -> OperatorSpec {
    let mut settings: Vec<_> = parameters.iter().map(interface::follows).collect();
    settings.push(interface::follows(&trust()));
    settings.extend([
        optional("score", "attack_score", "a log-score of the family's own"),
        required("combine", choice(&["add", "replace"]), "what a given score does to the log-posterior"),
    ]);
    interface::operator(
        Slot::Search,
        DELIBERATION,
        settings,
        "Tries sets of attackers against the driver and modifies them by why they failed.",
    )
}

fn parent_graph(
    pool: &[OwnParameter],
    motion: &[OwnParameter],
    search: &[OwnParameter],
) -> Vec<(String, OperatorNode)> {
    let combined = |parameters: &[OwnParameter]| {
        let mut settings = interface::from_parameters(parameters);
        settings.push(word("combine", "add"));
        settings
    };
    let prior = interface::from_parameters(motion);
    let mut deliberation = combined(search);
    deliberation.push((COUNSEL_WEIGHT.into(), from_parameter(COUNSEL_WEIGHT)));
    vec![
        interface::node("select", Slot::Select, "every_scene", &[], vec![]),
        interface::node("actor", Slot::Actor, ATTACKER_POOL, &["select"], combined(pool)),
        interface::after_history(),
        interface::node("motion", Slot::Motion, ATTACKER_PRIOR, &["timing"], prior),
        interface::node("search", Slot::Search, DELIBERATION, &["motion"], deliberation),
        interface::best_of_search(),
    ]
}
