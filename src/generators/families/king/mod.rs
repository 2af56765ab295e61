//! KING, safety-critical scenarios by kinematics gradients (Hanselmann et al. 2022): the steering and throttle of all
//! adversaries over the whole window are moved by Adam down a loss whose slope comes back through the bicycle model,
//! with the ego simulated again at every iteration; a rollout is broken off where an adversary leaves the road or runs into
//! another, and only what a rule expert can solve is used.
//!
//! Kept: bicycle and its constants, the three terms of the loss, 1.25 m cap of the repulsion, Adam, and for two
//! adversaries the weights, decays, iterations and step length; slopes through the adversaries alone ("one path");
//! termination off the road and at contacts among adversaries; the solvability run (`expert`).
//! Declared adaptations: the search goes on for some iterations after the first contact, where KING stops, and the one
//! with the smallest loss and the least implausible motion is used; bystanders, which KING does not have, repel adversaries
//! too; adversaries are recorded vehicles whose first actions follow their record; a full throttle is
//! 3 m/s², for KING's 0.56 cannot follow recorded starts; steps of 0.1 s with actions held for KING's 0.25 s; the
//! smoothed raster of undrivable ground is Φ(−distance/σ) of a signed-distance field.

pub mod actions;
pub mod expert;
pub mod loss;

use std::sync::Arc;

use super::grammar::{self, choice, integer, number, optional, required, slot};
use super::interface::{self, FamilySpec, OwnParameter, own};
use crate::adapters::{Family, OperatorSpec, vocabulary};
use crate::motion::Driven;
use crate::motion::following;
use crate::objects::{OperatorNode, Slot, ValueType};
use crate::scene::TrackIx;
use crate::search::adam::Rates;
use crate::search::descent::{self, Descent, Iterate};
use crate::search::ranking::{self, Ending, Plausibility};
use crate::stage::{Bystanders, Part, Settings, Source, Stage, StageError};
use actions::ActionSpace;
use loss::{Attraction, Loss};

/// The family's name in programs, experiments and tables.
pub const NAME: &str = "king";
/// Motion operator: actions through the bicycle model.
pub const STEERED_ACTIONS: &str = "steered_actions";
/// Search operator: Adam over all adversaries' actions.
pub const KINEMATIC_DESCENT: &str = "kinematic_descent";

const SEARCH_IN_WORDS: &str = "The search walks: Adam moves steering and throttle of 2 vehicles (`group_size`), 120 iterations, 20 after \
     the first contact, with the ego simulated at each; at most 9 iterates, picked by its own loss, become \
     candidates. They score 0 for contacts that an expert could avoid, -1000 for misses, -2000 for other \
     contacts, less a loss squeezed below 400: mean metres to the ego, road, bystanders, 2 x implausibility. \
     `iterate_loss` (smaller is better; added, or replacing the loss) ranks within a step of 1000 and steers \
     nothing; `pursuer_weight` steers. A `reshape` before the search changes nothing. Example: \
     `jerk_added_mps3 / 2` prefers smooth iterates.";

/// The family as it is registered: what it declares, and the code that carries it out.
pub fn source() -> Source {
    Source::new(family(), SEARCH_IN_WORDS).operator(STEERED_ACTIONS, motion).operator(KINEMATIC_DESCENT, search)
}

/// Contract, and the parent: KING for two adversaries, with the adaptations named above.
pub fn family() -> Family {
    let (motion, search) = (motion_parameters(), search_parameters());
    let own = FamilySpec {
        name: NAME,
        title: "KING: safety-critical scenarios by kinematics gradients (Hanselmann et al. 2022)",
        describes:
            "Moves the steering and throttle sequences of several recorded vehicles by gradient descent through \
                    a bicycle model: toward the ego, off undrivable ground, apart from each other and from bystanders. \
                    The ego is simulated again as they change, for some iterations beyond its first contact; of the \
                    iterates that it touches and a rule expert could have avoided, the one with the smallest loss is \
                    used."
                .into(),
        words: vec![STEERED_ACTIONS, KINEMATIC_DESCENT, "pursuer_weight", "iterate_loss", "pursuit_rule"],
        operators: vec![(Slot::Motion, motion_operator(&motion)), (Slot::Search, search_operator(&search))],
        without_shared: &[],
        mechanism_slots: vec![
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
        ],
        graph: parent_graph(&motion, &search),
        parameters: interface::by_name(motion.into_iter().chain(search)),
    };
    interface::with_actor_group(own.family(), 2.0)
}

fn motion_parameters() -> Vec<OwnParameter> {
    vec![
        own("action_spacing_s", number(0.1, 1.0, "s"), "time for which an action is held; 0.25 in KING", 0.25),
        own("throttle_mps2_max", number(0.5, 4.0, "m/s^2"), "acceleration at full throttle; 0.56 in KING", 3.0),
        own("brake_mps2_max", number(1.0, 8.0, "m/s^2"), "deceleration at full brake; 4.95 in KING", 4.952399),
    ]
}

fn search_parameters() -> Vec<OwnParameter> {
    vec![
        own("descent_iterations", integer(10, 150, "1"), "iterations of Adam; 100 to 150 in KING", 120.0),
        own(
            "refinement_iterations",
            integer(0, 60, "1"),
            "iterations after the first contact, of which the best contact is used; 0 in KING",
            20.0,
        ),
        own(
            "implausibility_weight",
            number(0.0, 20.0, "1"),
            "what motions beyond plausible acceleration, jerk, road and bystanders cost when iterates are ranked",
            2.0,
        ),
        own("descent_rate", number(0.001, 0.2, "1"), "step length of Adam; 0.005 in KING", 0.005),
        own("first_moment_decay", number(0.5, 0.95, "1"), "beta 1; 0.8 in KING", 0.8),
        own("second_moment_decay", number(0.9, 0.9999, "1"), "beta 2; 0.999, 0.99, 0.99 in KING", 0.99),
        own("ego_replay_every", integer(1, 8, "1"), "iterations between two simulations of the ego; 1 in KING", 1.0),
        own("attraction_weight", number(0.1, 5.0, "1/m"), "weight of the mean distance to the ego; 1 in KING", 1.0),
        own("departure_weight", number(0.0, 60.0, "1"), "weight of the off-road cost; 20 to 23 in KING", 23.0),
        own("departure_sigma_m", number(0.3, 3.0, "m"), "width of the off-road Gaussian; 1 in KING", 1.0),
        own("repulsion_weight", number(0.0, 20.0, "1/m"), "weight of the adversaries' distance; 5 in KING", 5.0),
        own("repulsion_m_max", number(0.5, 6.0, "m"), "no repulsion beyond this distance; 1.25 in KING", 1.25),
        own(
            "bystander_weight",
            number(0.0, 20.0, "1"),
            "weight of each adversary's deepest approach to a recorded road user; 5 as for the adversaries' distance",
            5.0,
        ),
    ]
}

fn motion_operator(parameters: &[OwnParameter]) -> OperatorSpec {
    interface::operator(
        Slot::Motion,
        STEERED_ACTIONS,
        parameters.iter().map(interface::follows).collect(),
        "Steering and throttle of every adversary through a bicycle model, at first those that follow its record.",
    )
}

fn search_operator(parameters: &[OwnParameter]) -> OperatorSpec {
    let mut settings: Vec<_> = parameters.iter().map(interface::follows).collect();
    settings.extend([
        required(
            "pursuit_rule",
            choice(&["nearest", "everyone"]),
            "whom the ego attracts at each time; nearest in KING",
        ),
        optional("weight", "pursuer_weight", "weights of the vehicles; without it all weigh 1"),
        optional("loss", "iterate_loss", "a loss of the family's own, for ranking the iterates"),
        required("combine", choice(&["add", "replace"]), "what a given loss does to KING's own in that ranking"),
    ]);
    interface::operator(
        Slot::Search,
        KINEMATIC_DESCENT,
        settings,
        "Adam over all adversaries' actions until the ego touches one and some iterations more; iterates become candidates.",
    )
}

fn parent_graph(motion: &[OwnParameter], search: &[OwnParameter]) -> Vec<(String, OperatorNode)> {
    let mut search = interface::from_parameters(search);
    search.extend([interface::word("pursuit_rule", "nearest"), interface::word("combine", "add")]);
    vec![
        interface::node("select", Slot::Select, "every_scene", &[], vec![]),
        interface::actor_group(),
        interface::after_history(),
        interface::node("motion", Slot::Motion, STEERED_ACTIONS, &["timing"], interface::from_parameters(motion)),
        interface::node("search", Slot::Search, KINEMATIC_DESCENT, &["motion"], search),
        interface::best_of_search(),
    ]
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
        descent::open(part, stage.situation, space);
    }
    Ok(())
}

/// At most this many iterates become candidates.
const CANDIDATES_MAX: usize = 9;

/// Adam over all actions; iterates become candidates, scored by minus their loss: solvable contacts first, then misses.
pub fn search(stage: &Stage<'_>, settings: &Settings, parts: &mut [Part]) -> Result<(), StageError> {
    let situation = stage.situation;
    let descent = Descent {
        iterations: settings.count("descent_iterations")?,
        refinements: settings.count("refinement_iterations")?,
        rates: Rates {
            rate: settings.number("descent_rate")?,
            first_decay: settings.number("first_moment_decay")?,
            second_decay: settings.number("second_moment_decay")?,
        },
        replay_every: settings.count("ego_replay_every")?,
    };
    let pursuit = if settings.word("pursuit_rule")? == "nearest" { Attraction::Nearest } else { Attraction::Everyone };
    let at_record = descent::at_record(situation, parts);
    let adversaries: Vec<TrackIx> = parts.iter().map(|part| part.actor).collect();
    let bystanders = Bystanders::of(situation, &adversaries, descent::covered(&at_record));
    let loss = Loss {
        pursuit,
        pursuer_weights: descent::actor_weights(situation, parts, settings.optional("weight")),
        attraction_weight: settings.number("attraction_weight")?,
        departure_weight: settings.number("departure_weight")?,
        departure_sigma_m: settings.number("departure_sigma_m")?,
        repulsion_weight: settings.number("repulsion_weight")?,
        repulsion_m_max: settings.number("repulsion_m_max")?,
        bystander_weight: settings.number("bystander_weight")?,
        bystanders: &bystanders,
        field: situation.road_field(),
        off_road_m_max: loss::departures_allowed_m(situation.road_field(), &at_record),
        overlapping_at_record: loss::overlap(&at_record),
    };
    let iterates = descent::descend(situation, parts, &descent, &loss);
    let scored = ranked(stage, settings, &iterates, &bystanders)?;
    ranking::into_candidates(parts, &iterates, &scored, |_| 0.0);
    Ok(())
}

/// The iterates that become candidates, with their scores.
fn ranked(
    stage: &Stage<'_>,
    settings: &Settings,
    iterates: &[Iterate],
    bystanders: &Bystanders,
) -> Result<Vec<(usize, f64)>, StageError> {
    let situation = stage.situation;
    let (module, replaces) = (settings.optional("loss"), settings.word("combine")? == "replace");
    let implausibility_weight = settings.number("implausibility_weight")?;
    let ending = |iterate: &Iterate| match iterate.contact {
        Some(true) if expert::solves(situation, &iterate.movers, bystanders) => Ending::Met,
        Some(true) => Ending::Unsolvable,
        _ => Ending::Missed,
    };
    let plausibility = iterates.first().map(|record| Plausibility::beyond(situation, record));
    let score = |index: usize| {
        let iterate = &iterates[index];
        let implausible = implausibility_weight * plausibility.as_ref().map_or(0.0, |p| p.lack_of(iterate));
        let own = if replaces && module.is_some() { 0.0 } else { iterate.terms.total() + implausible };
        let given = module.map_or(0.0, |module| ranking::judged(situation, iterate, module, |_| 0.0));
        (index, ranking::score(ending(iterate), own + given))
    };
    Ok(ranking::selection(iterates, CANDIDATES_MAX).into_iter().map(score).collect())
}
