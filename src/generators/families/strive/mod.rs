//! STRIVE, stress-testing by a learned motion prior (Rempe et al. 2022): the latents of several vehicles are moved by
//! Adam toward a crash with the planner under the prior's likelihood, who attacks being chosen softly by nearness; a
//! scene is kept only if the ego could have avoided the crash, shown by a second search over the ego's own latent.
//!
//! Kept: the terms of the loss and their weights, Adam's step length and iterations, the soft choice of attackers with
//! weights of prior and start that follow it, the exclusion of vehicles that stay behind, five-disc soft contact, the
//! solution pass and its buffer.
//! Declared adaptations: the learned variational prior is the linear-Gaussian latent of `motion::latent`, so the first
//! fit to the record is exact and needs no iterations; weights of the soft choice carry no slope; no model of the ego
//! tracks the planner, for slopes go through the adversaries alone and the true ego is simulated instead. Once the ego is
//! met, the crash term has done its work: for some iterations more the search moves toward likely motions while they meet
//! the ego and toward the ego while they do not, and the most likely and plausible motion that meets it is used. A motion
//! that the simulated ego survives is solvable by that rollout, so the solution pass works on those that end in contact.

pub mod loss;
pub mod solution;

use std::sync::Arc;

use super::grammar::{self, choice, integer, number, optional, required, slot};
use super::interface::{self, FamilySpec, OwnParameter, own};
use crate::adapters::{Family, OperatorSpec, vocabulary};
use crate::kernel::num;
use crate::motion::Driven;
use crate::motion::following;
use crate::motion::latent::{LatentOptions, LatentSpace};
use crate::motion::motion_prior::{self, PriorOptions};
use crate::objects::{OperatorNode, Slot, ValueType};
use crate::scene::{DT_S, TrackIx};
use crate::search::adam::Rates;
use crate::search::descent::{self, Descent, Iterate, Mover};
use crate::search::ranking::{self, Ending, Plausibility};
use crate::stage::{Bystanders, Part, Settings, Situation, Source, Stage, StageError};
use loss::Loss;
use solution::{Solution, Solver};

/// The family's name in programs, experiments and tables.
pub const NAME: &str = "strive";
/// Motion operator: a latent around the record.
pub const LATENT_MOTION: &str = "latent_motion";
/// Search operator: Adam over latents, then the solution pass.
pub const LATENT_DESCENT: &str = "latent_descent";

const SEARCH_IN_WORDS: &str = "The search walks: Adam moves latents (0 is the log) of 3 vehicles (`group_size`), 200 iterations, 30 \
     after the first contact, with the ego simulated at each; at most 9 iterates, picked by its own loss, \
     become candidates. Contacts score 0 less the loss without its crash term, misses -1000 less all of it, \
     each with 2 x implausibility, squeezed below 400; contacts without a way out are dropped. `latent_score` \
     (larger is better; added, or replacing the loss) ranks within a step of 1000 and steers nothing; \
     `attacker_weight` steers. A `reshape` before the search changes nothing. Example: `-jerk_added_mps3 / 5` \
     prefers smooth iterates.";

/// The family as it is registered: what it declares, and the code that carries it out.
pub fn source() -> Source {
    Source::new(family(), SEARCH_IN_WORDS).operator(LATENT_MOTION, motion).operator(LATENT_DESCENT, search)
}

/// Contract, and the parent: STRIVE's rule-based configuration for three vehicles, with the adaptations named above.
pub fn family() -> Family {
    let (motion, search) = (motion_parameters(), search_parameters());
    let own = FamilySpec {
        name: NAME,
        title: "STRIVE: generating scenarios via a learned traffic prior (Rempe et al. 2022)",
        describes: "Moves several recorded vehicles in the latent space of a motion prior, so that some come close to \
                    the ego while their motion stays likely. Attackers are chosen softly by nearness. A crash is kept \
                    only if a search over the ego's own motion finds a way to avoid it."
            .into(),
        words: vec![LATENT_MOTION, LATENT_DESCENT, "attacker_weight", "latent_score"],
        operators: vec![(Slot::Motion, motion_operator(&motion)), (Slot::Search, search_operator(&search))],
        without_shared: &[],
        mechanism_slots: vec![
            slot(
                "attacker_weight",
                ValueType::Number,
                vocabulary::ACTOR.to_vec(),
                "Factor of a vehicle's share in the soft choice of attackers, clamped to 0.05..20; larger attacks rather.",
            ),
            slot(
                "latent_score",
                ValueType::Number,
                grammar::candidate_features(),
                "A score of a motion found on the way, larger is better; the search operator says whether it is added to \
             minus STRIVE's own loss or replaces it when the iterates are ranked.",
            ),
        ],
        graph: parent_graph(&motion, &search),
        parameters: interface::by_name(motion.into_iter().chain(search)),
    };
    interface::with_actor_group(own.family(), 3.0)
}

fn motion_parameters() -> Vec<OwnParameter> {
    vec![
        own("latent_modes", integer(2, 6, "1"), "modes of acceleration, and as many of curvature; 4", 4.0),
        own("acceleration_spread_mps2", number(0.1, 3.0, "m/s^2"), "least spread of an acceleration mode; 1.05", 1.05),
        own("curvature_spread_1pm", number(0.001, 0.05, "1/m"), "least spread of a curvature mode", 0.005),
    ]
}

fn search_parameters() -> Vec<OwnParameter> {
    vec![
        own("latent_iterations", integer(10, 200, "1"), "iterations of Adam; 200 in STRIVE", 200.0),
        own(
            "likelihood_iterations",
            integer(0, 80, "1"),
            "iterations after the first contact that look for likelier motions which still meet the ego",
            30.0,
        ),
        own(
            "latent_implausibility_weight",
            number(0.0, 20.0, "1"),
            "what motions beyond plausible acceleration, jerk, road and bystanders cost when iterates are ranked",
            2.0,
        ),
        own("latent_rate", number(0.01, 0.5, "1"), "step length of Adam; 0.05 in STRIVE", 0.05),
        own("planner_replay_every", integer(1, 8, "1"), "iterations between two simulations of the ego; 1", 1.0),
        own("crash_weight", number(0.1, 10.0, "1/m^2"), "weight of the attackers' squared distance; 2", 2.0),
        own("earliest_crash_s", number(0.0, 5.0, "s"), "no crash is sought before this time; 2", 2.0),
        own("attacker_prior_weight", number(0.0, 1.0, "1"), "weight of an attacker's likelihood; 0.005", 0.005),
        own("bystander_prior_weight", number(0.0, 20.0, "1"), "weight of the others' likelihood; 1", 1.0),
        own("attacker_record_weight", number(0.0, 2.0, "1"), "weight of an attacker's way from its record; 0.05", 0.05),
        own("bystander_record_weight", number(0.0, 5.0, "1"), "weight of the others' way from theirs; 0.5", 0.5),
        own(
            "soft_contact_weight",
            number(0.0, 60.0, "1"),
            "weight of contact among all but attacker and ego; 20",
            20.0,
        ),
        own("road_contact_weight", number(0.0, 60.0, "1"), "weight of corners beside the road; 20", 20.0),
        own("solution_iterations", integer(5, 60, "1"), "iterations of each start of the solution pass", 25.0),
        own("solution_rate", number(0.02, 1.0, "1"), "step length of the solution pass", 0.15),
        own("solution_buffer_m", number(0.0, 2.0, "m"), "room that the solution pass strives for; 0.5", 0.5),
    ]
}

fn motion_operator(parameters: &[OwnParameter]) -> OperatorSpec {
    interface::operator(
        Slot::Motion,
        LATENT_MOTION,
        parameters.iter().map(interface::follows).collect(),
        "Cosine modes of acceleration and curvature about the record, as wide as the lane-graph prior's candidates.",
    )
}

fn search_operator(parameters: &[OwnParameter]) -> OperatorSpec {
    let mut settings: Vec<_> = parameters.iter().map(interface::follows).collect();
    settings.extend([
        optional("weight", "attacker_weight", "factors of the soft choice; without it all are 1"),
        optional("score", "latent_score", "a score of the family's own, for ranking the iterates"),
        required("combine", choice(&["add", "replace"]), "what a given score does to STRIVE's own in that ranking"),
    ]);
    interface::operator(
        Slot::Search,
        LATENT_DESCENT,
        settings,
        "Adam over all latents; the likeliest motions that meet the ego, but for what it could not have avoided.",
    )
}

fn parent_graph(motion: &[OwnParameter], search: &[OwnParameter]) -> Vec<(String, OperatorNode)> {
    let mut search = interface::from_parameters(search);
    search.extend([interface::word("combine", "add")]);
    vec![
        interface::node("select", Slot::Select, "every_scene", &[], vec![]),
        interface::actor_group(),
        interface::after_history(),
        interface::node("motion", Slot::Motion, LATENT_MOTION, &["timing"], interface::from_parameters(motion)),
        interface::node("search", Slot::Search, LATENT_DESCENT, &["motion"], search),
        interface::best_of_search(),
    ]
}

/// Candidates of the lane-graph prior from which the spread is taken.
const LIKELY: usize = 16;

/// Opens every adversary's latent space around its record.
pub fn motion(stage: &Stage<'_>, settings: &Settings, parts: &mut [Part]) -> Result<(), StageError> {
    let options = LatentOptions {
        modes: settings.count("latent_modes")?,
        acceleration_spread_mps2: settings.number("acceleration_spread_mps2")?,
        curvature_spread_1pm: settings.number("curvature_spread_1pm")?,
    };
    let prior = PriorOptions { count: LIKELY, ..PriorOptions::REFERENCE };
    for part in parts {
        let record = following::record(&stage.situation.scene.tracks[part.actor], part.window);
        let space = record.map(|(start, samples)| -> Arc<dyn Driven> {
            let mut stream = stage.stream("likely", part.actor);
            let anchor = start.sample();
            let lanes = &stage.situation.lanes;
            let likely = motion_prior::candidates(lanes, &anchor, samples.len(), &prior, &mut stream);
            Arc::new(LatentSpace::new(start, &samples, &likely, &options))
        });
        descent::open(part, stage.situation, space);
    }
    Ok(())
}

/// At most this many iterates become candidates.
const CANDIDATES_MAX: usize = 9;
/// Adam's decays, which STRIVE leaves at their usual values.
const DECAYS: (f64, f64) = (0.9, 0.999);

/// Adam over all latents; iterates that are solvable become candidates, scored by minus their loss, where they meet the
/// ego without the crash term, and those above the others.
pub fn search(stage: &Stage<'_>, settings: &Settings, parts: &mut [Part]) -> Result<(), StageError> {
    let (situation, rates) = (stage.situation, |rate| Rates { rate, first_decay: DECAYS.0, second_decay: DECAYS.1 });
    let descent = Descent {
        iterations: settings.count("latent_iterations")?,
        refinements: settings.count("likelihood_iterations")?,
        rates: rates(settings.number("latent_rate")?),
        replay_every: settings.count("planner_replay_every")?,
    };
    let solution = Solution {
        iterations: settings.count("solution_iterations")?,
        rates: rates(settings.number("solution_rate")?),
        buffer_m: settings.number("solution_buffer_m")?,
    };
    let adversaries: Vec<TrackIx> = parts.iter().map(|part| part.actor).collect();
    let others = Bystanders::of(situation, &adversaries, descent::covered(&descent::at_record(situation, parts)));
    let loss = loss(situation, settings, parts, &others)?;
    let iterates = descent::descend(situation, parts, &descent, &loss);
    let mut solver = Solver::new(situation, &others, solution);
    let mut solvable = |iterate: &Iterate| match iterate.contact {
        Some(true) => solver.solves(&iterate.movers),
        simulated => simulated.is_some(),
    };
    let mut chosen = ranking::selection(&iterates, CANDIDATES_MAX);
    chosen.retain(|index| solvable(&iterates[*index]));
    let scored = scored(stage, settings, &iterates, chosen)?;
    ranking::into_candidates(parts, &iterates, &scored, log_prior);
    Ok(())
}

fn loss<'a>(
    situation: &'a Situation,
    settings: &Settings,
    parts: &[Part],
    others: &'a Bystanders,
) -> Result<Loss<'a>, StageError> {
    Ok(Loss {
        attacker_weights: descent::actor_weights(situation, parts, settings.optional("weight")),
        records: parts.iter().filter_map(|p| p.driven.as_ref()).map(|d| d.start().to_vec()).collect(),
        from_step: situation.first_step() + (settings.number("earliest_crash_s")? / DT_S).round() as usize,
        crash_weight: settings.number("crash_weight")?,
        prior_weights: (settings.number("attacker_prior_weight")?, settings.number("bystander_prior_weight")?),
        record_weights: (settings.number("attacker_record_weight")?, settings.number("bystander_record_weight")?),
        contact_weight: settings.number("soft_contact_weight")?,
        road_weight: settings.number("road_contact_weight")?,
        field: situation.road_field(),
        others,
    })
}

/// The chosen iterates with their scores.
fn scored(
    stage: &Stage<'_>,
    settings: &Settings,
    iterates: &[Iterate],
    chosen: Vec<usize>,
) -> Result<Vec<(usize, f64)>, StageError> {
    let situation = stage.situation;
    let (module, replaces) = (settings.optional("score"), settings.word("combine")? == "replace");
    let implausibility_weight = settings.number("latent_implausibility_weight")?;
    let plausibility = iterates.first().map(|record| Plausibility::beyond(situation, record));
    let score = |index: usize| {
        let iterate = &iterates[index];
        let (ending, loss) = match iterate.contact {
            Some(true) => (Ending::Met, iterate.terms.rest),
            _ => (Ending::Missed, iterate.terms.total()),
        };
        let implausible = implausibility_weight * plausibility.as_ref().map_or(0.0, |p| p.lack_of(iterate));
        let own = if replaces && module.is_some() { 0.0 } else { loss + implausible };
        let given = module.map_or(0.0, |module| ranking::judged(situation, iterate, module, log_prior));
        (index, ranking::score(ending, own - given))
    };
    Ok(chosen.into_iter().map(score).collect())
}

/// log N(z; 0, I) but for its constant.
fn log_prior(mover: &Mover) -> f64 {
    -0.5 * num::sum(mover.place.iter().map(|z| z * z))
}
