//! CAT, closed-loop adversarial training (Zhang et al. 2023): one vehicle's future is replaced by the candidate of a
//! motion prior with the largest posterior P(OV) * sum P(AV) P(Coll | AV, OV) over the ego's latest rollouts.
//!
//! The learned prior (DenseTNT) is replaced by a lane-graph goal prior; everything after it follows the method's code.
//! If no vehicle is marked as interacting, CAT's code attacks nobody in particular; here the moving vehicle whose
//! log comes nearest to the ego's rollout stands in, a declared choice.

use super::grammar::{self, choice, number, optional, required, slot};
use super::interface::{self, FamilySpec, OwnParameter, own};
use super::prior;
use crate::adapters::{Family, OperatorSpec};
use crate::objects::{OperatorNode, Slot, ValueType};
use crate::search::posterior;
use crate::stage::judged::Judged;
use crate::stage::{Part, Settings, Source, Stage, StageError};

/// The family's name in programs, experiments and tables.
pub const NAME: &str = "cat";
/// Motion operator: candidates from the lane-graph prior.
pub const LANE_GRAPH_PRIOR: &str = "lane_graph_prior";
/// Search operator: posterior over ego rollouts.
pub const COLLISION_POSTERIOR: &str = "collision_posterior";

const SEARCH_IN_WORDS: &str = "The search compares up to 32 likely trajectories of one vehicle by log prior plus log contact: one unit \
     is a factor e. The prior part mostly lies between -5 and -1.5 (equal from the seventh on, \
     `flatten_rank`); a predicted contact loses 0.01 per half second before it; without one the score is -1000 \
     less the nearest metres. `candidate_score` is added (0.1 to 3 reorders contacts, and lifts no miss above \
     one) or, with `combine` = replace, is all, without the -1000. A `reshape` or filter before the search \
     counts in it. Example: `if(struck_by_ego, 2, 0) - jerk_added_mps3 / 10` prefers gentle contacts that the \
     ego runs into.";

/// The family as it is registered: what it declares, and the code that carries it out.
pub fn source() -> Source {
    Source::new(family(), SEARCH_IN_WORDS).operator(LANE_GRAPH_PRIOR, motion).operator(COLLISION_POSTERIOR, search)
}

/// Contract, and the parent: CAT as published.
pub fn family() -> Family {
    let (motion, search) = (prior::parameters(""), search_parameters());
    FamilySpec {
        name: NAME,
        title: "CAT: closed-loop adversarial training (Zhang et al. 2023)",
        describes: "Replaces the future of a recorded vehicle by one of 32 trajectories of a lane-graph motion prior. \
                    Each is weighed by its prior probability times the discounted probability that it meets the ego's \
                    latest rollout; the largest posterior is replayed."
            .into(),
        words: vec![LANE_GRAPH_PRIOR, COLLISION_POSTERIOR, "candidate_score"],
        operators: vec![(Slot::Motion, motion_operator(&motion)), (Slot::Search, search_operator())],
        without_shared: &[],
        mechanism_slots: vec![slot(
            "candidate_score",
            ValueType::Number,
            grammar::candidate_features(),
            "A log-score of a candidate; the search operator says whether it is added to the posterior or replaces it.",
        )],
        graph: parent_graph(&motion, &search),
        parameters: interface::by_name(motion.into_iter().chain(search)),
    }
    .family()
}

fn search_parameters() -> Vec<OwnParameter> {
    vec![
        own("contact_discount", number(0.5, 1.0, "1"), "u, discount of a contact per 0.5 s check; 0.99 in CAT", 0.99),
        own("ego_shift_s", number(0.0, 1.5, "s"), "the ego's rollout is also tried this much earlier and later", 0.0),
    ]
}

fn motion_operator(parameters: &[OwnParameter]) -> OperatorSpec {
    interface::operator(
        Slot::Motion,
        LANE_GRAPH_PRIOR,
        parameters.iter().map(interface::follows).collect(),
        "Candidate trajectories to goals on reachable lanes and on constant-turn arcs, with their log-probability.",
    )
}

fn search_operator() -> OperatorSpec {
    grammar::operator(
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

fn parent_graph(motion: &[OwnParameter], search: &[OwnParameter]) -> Vec<(String, OperatorNode)> {
    let mut search = interface::from_parameters(search);
    search.push(interface::word("combine", "add"));
    let motion = interface::from_parameters(motion);
    let mut graph = interface::one_marked_vehicle();
    graph.extend([
        interface::node("motion", Slot::Motion, LANE_GRAPH_PRIOR, &["timing"], motion),
        interface::node("search", Slot::Search, COLLISION_POSTERIOR, &["motion"], search),
        interface::best_of_search(),
    ]);
    graph
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
