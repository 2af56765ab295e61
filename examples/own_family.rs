//! A family of one's own: CAT's candidates for one marked vehicle, ranked by an expression that prefers smooth contact.
//! Its contract is printed as checked, its parent is compiled for generated scenes and attacks the IDM driver there.
//!
//! The family composes operators that exist. An operator kind with code of its own is one more `.operator(kind, function)`;
//! see `docs/EXTENDING.md`.
//!
//! `cargo run --example own_family`

use std::error::Error;
use std::sync::Arc;

use evodrive::adapters::Family;
use evodrive::compiler::{Situation, compile};
use evodrive::ego::Policy;
use evodrive::families::interface::{self, FamilySpec, OwnParameter, own};
use evodrive::families::{cat, grammar, prior, registry};
use evodrive::kernel::Seed;
use evodrive::objects::{FamilyName, MechanismModule, Slot, ValueType};
use evodrive::scene::Scene;
use evodrive::sim::rollout;
use evodrive::stage::Source;
use evodrive::synth::{SynthError, SynthOptions, WorldKind, pool_member};

/// A candidate is the better the likelier it meets the ego and the less it jerks; `jerk_weight` is a parameter.
const SMOOTH_CONTACT: &str = "collision_likelihood - jerk_weight * jerk_mps3_max / 10";

/// Contract and parent.
fn family() -> Result<Family, Box<dyn Error>> {
    let jerk_weight = own("jerk_weight", grammar::number(0.0, 2.0, "1"), "price of 10 m/s^3 of jerk", 0.5);
    let candidates = prior::parameters("");
    let mut search = vec![
        own("contact_discount", grammar::number(0.5, 1.0, "1"), "discount per 0.5 s", 0.99),
        own("ego_shift_s", grammar::number(0.0, 1.5, "s"), "the ego earlier and later", 0.0),
    ];
    let graph = graph(&candidates, &search);
    search.push(jerk_weight);
    let mut family = FamilySpec {
        name: "smooth_contact",
        title: "Smooth contact: CAT's candidates ranked by contact and jerk (example)",
        describes: "Replaces the future of one vehicle by the candidate that meets the ego most smoothly.".into(),
        words: vec!["candidate_score"],
        operators: cats_operators()?,
        without_shared: &[],
        mechanism_slots: vec![grammar::slot(
            "candidate_score",
            ValueType::Number,
            grammar::candidate_features(),
            "Rank of a candidate; larger is better.",
        )],
        graph,
        parameters: interface::by_name(candidates.into_iter().chain(search)),
    }
    .family();
    let module = MechanismModule {
        slot: "candidate_score".into(),
        inputs: ["collision_likelihood", "jerk_mps3_max", "jerk_weight"].map(String::from).to_vec(),
        output: ValueType::Number,
        expression: SMOOTH_CONTACT.into(),
        tags: vec![],
    };
    family.parent.mechanism_modules.insert("smooth_contact".into(), module);
    Ok(family)
}

/// The motion and the search kind that this family takes from CAT, with their declared settings.
fn cats_operators() -> Result<Vec<(Slot, evodrive::adapters::OperatorSpec)>, Box<dyn Error>> {
    let families = registry();
    let cat = families.get(&FamilyName::new(cat::NAME)).ok_or("no family is called cat")?;
    let kinds = [(Slot::Motion, cat::LANE_GRAPH_PRIOR), (Slot::Search, cat::COLLISION_POSTERIOR)];
    let found = kinds.map(|(slot, kind)| Some((slot, cat.contract.operator(slot, kind)?.clone())));
    found.into_iter().collect::<Option<Vec<_>>>().ok_or_else(|| "cat lacks an operator kind".into())
}

/// The parent's graph: select, actor, timing, motion, search, choice.
fn graph(candidates: &[OwnParameter], search: &[OwnParameter]) -> Vec<(String, evodrive::objects::OperatorNode)> {
    let mut settings = interface::from_parameters(search);
    settings.push(("score".into(), grammar::from_mechanism("smooth_contact")));
    settings.push(interface::word("combine", "replace"));
    let mut graph = interface::one_marked_vehicle();
    graph.extend([
        interface::node(
            "motion",
            Slot::Motion,
            cat::LANE_GRAPH_PRIOR,
            &["timing"],
            interface::from_parameters(candidates),
        ),
        interface::node("search", Slot::Search, cat::COLLISION_POSTERIOR, &["motion"], settings),
        interface::best_of_search(),
    ]);
    graph
}

/// Two generated scenes of each of three kinds.
fn scenes() -> Result<Vec<Scene>, SynthError> {
    let worlds = SynthOptions {
        kinds: vec![WorldKind::SignalledCrossing, WorldKind::Merge, WorldKind::Roundabout],
        steps: 91,
        current_step: 10,
        warm_up_s: 12.0,
        tracks_per_scene: 20,
        pedestrian_share: 0.0,
        cyclist_share: 0.0,
        ego_travel_m_min: 10.0,
        interaction_time_s_max: 4.0,
        interaction_gap_m_max: 12.0,
        following_share: 0.2,
        attempts_max: 40,
        traffic: None,
    };
    (0..6).map(|index| pool_member(&worlds, Seed(11), index)).collect()
}

fn main() -> Result<(), Box<dyn Error>> {
    // The code behind the two kinds; a function of your own would stand here just the same.
    let family = Source::new(family()?, "CAT's candidates, ranked by `smooth_contact` alone.")
        .operator(cat::LANE_GRAPH_PRIOR, cat::motion)
        .operator(cat::COLLISION_POSTERIOR, cat::search);
    let problems = family.contract.check_program(&family.parent);
    println!("{}: {} problems in the parent", family.contract.family, problems.len());
    if let Some(first) = problems.first() {
        return Err(first.to_string().into());
    }
    for scene in scenes()? {
        let situation = Situation::new(Arc::new(scene), &Policy::Idm)?;
        let compiled = compile(&family.parent, &family, &situation, Seed(1))?;
        let outcome = rollout(&situation.plant, &compiled.intervention, &mut *Policy::Idm.driver())?;
        let chosen = compiled.decision.actors.first().map(|actor| (actor.track, actor.score));
        println!("{:32} track and score {chosen:?}, {:?}", situation.scene_id(), outcome.end);
    }
    Ok(())
}
