//! SEAL, skill-enabled adversary learning (Stoler et al. 2025): one vehicle follows the prior candidate that promises
//! the most criticality and the largest deviation of the ego from its own plan, and shortly before the predicted
//! contact hands over to reactive skills of one second.
//!
//! The learned objective is replaced by its own labels, computed for an ego that brakes for whoever is in its way
//! (`stage::ego_response`), over the one rollout of the ego that is known instead of five. The learned skill space is
//! replaced by eight primitives of the simulator with a uniform prior, chosen by nearness to the ego, way off the road and
//! effort: a skill that was learned from driving keeps to the road by itself. Both are declared stand-ins.

use super::grammar::{self, choice, number, optional, required, slot};
use super::interface::{self, FamilySpec, OwnParameter, own};
use super::prior;
use crate::adapters::Family;
use crate::motion::Candidate;
use crate::objects::{OperatorNode, Slot, ValueType};
use crate::scene::DT_S;
use crate::stage::ego_response::{EgoPlan, Response};
use crate::stage::judged::Judged;
use crate::stage::{Part, Settings, Source, Stage, StageError};

/// The family's name in programs, experiments and tables.
pub const NAME: &str = "seal";
/// Motion operator: candidates of the lane-graph prior.
pub const OPPONENT_PRIOR: &str = "opponent_prior";
/// Search operator: criticality plus ego deviation, with the hand-over.
pub const CRITICAL_DEVIATION: &str = "critical_deviation";

/// Prefix of the prior's words in this family.
const PRIOR: &str = "opponent_";

const SEARCH_IN_WORDS: &str = "The search compares up to 32 trajectories of one vehicle by 0 to 1: half criticality (1 on contact, else \
     exp(-gap / 8 m)), half deviation of an ego predicted to brake by up to 5 m/s^2. `opponent_score` is added \
     (0.05 to 0.5 is enough) or replaces it. The trajectory is followed only until 1.1 s before the predicted \
     meeting (`handover_lead_s`, or a `skill_lead_s` module in its place); then skills react and no path or \
     shape counts, unless a law replaces them. A `reshape` before the search is judged; behind, score and \
     hand-over stay. Example: `0.2 * log_way_share - jerk_added_mps3 / 50` prefers motion like the log's.";

/// The family as it is registered: what it declares, and the code that carries it out.
pub fn source() -> Source {
    Source::new(family(), SEARCH_IN_WORDS).operator(OPPONENT_PRIOR, motion).operator(CRITICAL_DEVIATION, search)
}

/// Contract and parent.
pub fn family() -> Family {
    let search = search_parameters();
    let motion = prior::parameters(PRIOR);
    let mut settings: Vec<_> = search.iter().map(interface::follows).collect();
    settings.extend([
        optional("lead", "skill_lead_s", "seconds before the predicted meeting, instead of the parameter"),
        optional("score", "opponent_score", "a score of the family's own"),
        required("combine", choice(&["add", "replace"]), "what a given score does to SEAL's own"),
    ]);
    FamilySpec {
        name: NAME,
        title: "SEAL: skill-enabled adversary learning (Stoler et al. 2025)",
        describes: "Follows one of 32 trajectories of a lane-graph motion prior, the one with the largest mean of \
                    predicted criticality and predicted deviation of the ego from its plan. About a second before the \
                    predicted contact the vehicle turns reactive: every second it takes the motion primitive that \
                    brings it nearest to where the ego is heading."
            .into(),
        words: vec![OPPONENT_PRIOR, CRITICAL_DEVIATION, "skill_lead_s", "opponent_score"],
        operators: vec![
            (
                Slot::Motion,
                interface::operator(
                    Slot::Motion,
                    OPPONENT_PRIOR,
                    motion.iter().map(interface::follows).collect(),
                    "Candidate trajectories to goals on reachable lanes and on constant-turn arcs.",
                ),
            ),
            (
                Slot::Search,
                interface::operator(
                    Slot::Search,
                    CRITICAL_DEVIATION,
                    settings,
                    "Scores by predicted criticality and ego deviation, and sets when reactive skills take over.",
                ),
            ),
        ],
        without_shared: &[],
        mechanism_slots: vec![
            slot(
                "opponent_score",
                ValueType::Number,
                grammar::candidate_features(),
                "A score of a candidate on the scale 0..1; the search operator says whether it is added or replaces.",
            ),
            slot(
                "skill_lead_s",
                ValueType::Number,
                grammar::candidate_features(),
                "Seconds before the predicted meeting at which the skills take over, clamped to 0..6.",
            ),
        ],
        graph: parent_graph(&motion, &search),
        parameters: motion.into_iter().chain(search).collect(),
    }
    .family()
}

fn search_parameters() -> Vec<OwnParameter> {
    vec![
        own(
            "criticality_share",
            number(0.0, 1.0, "1"),
            "weight of criticality against ego deviation; 0.5 in SEAL",
            0.5,
        ),
        own(
            "prior_share",
            number(0.0, 0.5, "1"),
            "weight of the log-probability under the prior, per unit; 0 in SEAL",
            0.0,
        ),
        own(
            "handover_lead_s",
            number(0.0, 5.0, "s"),
            "time before the predicted meeting at which the skills take over; 1.1 in SEAL",
            1.1,
        ),
        own(
            "expected_braking_mps2",
            number(1.0, 9.0, "m/s^2"),
            "how hard the ego is expected to brake at most; 5 in the stand-in, MetaDrive's DEACC_FACTOR",
            5.0,
        ),
    ]
}

fn parent_graph(motion: &[OwnParameter], search: &[OwnParameter]) -> Vec<(String, OperatorNode)> {
    let mut graph = interface::one_marked_vehicle();
    let mut settings = interface::from_parameters(search);
    settings.push(interface::word("combine", "add"));
    graph.extend([
        interface::node("motion", Slot::Motion, OPPONENT_PRIOR, &["timing"], interface::from_parameters(motion)),
        interface::node("search", Slot::Search, CRITICAL_DEVIATION, &["motion"], settings),
        interface::best_of_search(),
    ]);
    graph
}

/// Candidates of the lane-graph prior from the actor's sample before its window.
pub fn motion(stage: &Stage<'_>, settings: &Settings, parts: &mut [Part]) -> Result<(), StageError> {
    prior::propose(stage, &prior::options(settings, PRIOR)?, parts);
    Ok(())
}

/// Scores candidates by the ego's predicted answer, and sets the hand-over.
pub fn search(stage: &Stage<'_>, settings: &Settings, parts: &mut [Part]) -> Result<(), StageError> {
    let share = settings.number("criticality_share")?;
    let prior_share = settings.number("prior_share")?;
    let lead_s = settings.number("handover_lead_s")?;
    let braking_mps2 = settings.number("expected_braking_mps2")?;
    let replaces = settings.word("combine")? == "replace";
    let adversaries: Vec<usize> = parts.iter().map(|part| part.actor).collect();
    for part in parts {
        let from_step = part.window.from_step;
        let Some(plan) = EgoPlan::of(stage.situation, from_step) else { continue };
        let judged = Judged { situation: stage.situation, actor: part.actor, from_step, adversaries: &adversaries };
        for candidate in &mut part.candidates {
            let response = plan.answer(stage.situation, part.actor, &candidate.samples, braking_mps2);
            candidate.score = share * response.criticality()
                + (1.0 - share) * response.deviation()
                + prior_share * candidate.prior_log_probability;
            if let Some(module) = settings.optional("score") {
                let own = module.of_candidate(candidate, &judged);
                candidate.score = if replaces { own } else { candidate.score + own };
            }
            let lead_s = settings.optional("lead").map_or(lead_s, |module| module.of_candidate(candidate, &judged));
            candidate.handover_step = Some(handover_step(candidate, from_step, &response, lead_s));
        }
    }
    Ok(())
}

/// Some time before the predicted meeting, but not before the window opens.
fn handover_step(candidate: &Candidate, from_step: usize, response: &Response, lead_s: f64) -> usize {
    let lead = (lead_s.clamp(0.0, 6.0) / DT_S).round() as usize;
    from_step + response.meeting.saturating_sub(lead).min(candidate.samples.len().saturating_sub(1))
}

#[cfg(test)]
mod tests {
    use super::super::tests::{compiled, worlds};
    use super::*;
    use crate::compiler::Compiled;
    use crate::kernel::Vec2;
    use crate::scene::Sample;
    use crate::scene::fixture::two_lane_scene;
    use crate::sim::{self, Action, ActorRef, Control, Driver, Plant, View};
    use crate::stage::Situation;

    /// Keeps its speed until a step, then brakes.
    struct BrakesFrom(usize);

    impl Driver for BrakesFrom {
        fn begin(&mut self, _: &Plant) {}

        fn decide(&mut self, view: &View<'_>) -> Control {
            let acceleration_mps2 = if view.step() >= self.0 { -5.0 } else { 0.0 };
            Control::Drive { acceleration_mps2, steering_rad: 0.0 }
        }
    }

    /// Returns where the first adversary goes in a compiled scene against an ego that brakes from a step on.
    fn track_of_adversary(situation: &Situation, compiled: &Compiled, brakes_from: usize) -> Vec<Sample> {
        let mut driver = BrakesFrom(brakes_from);
        let (_, trace) = sim::rollout_traced(&situation.plant, &compiled.intervention, &mut driver).unwrap();
        let track = compiled.decision.actors[0].track;
        let mut actor = trace.actors.into_iter().find(|a| a.actor == ActorRef::Track(track)).unwrap();
        // A contact breaks the last step off somewhere within it.
        actor.samples.pop();
        actor.samples.into_iter().flatten().collect()
    }

    /// The scene step from which on the adversary moves otherwise because the ego brakes, whenever it begins to.
    fn first_difference(situation: &Situation, compiled: &Compiled) -> Option<usize> {
        let steady = track_of_adversary(situation, compiled, 1000);
        let first = situation.plant.first_step();
        [2, 10, 20, 30].into_iter().find_map(|brakes_after| {
            let braking = track_of_adversary(situation, compiled, first + brakes_after);
            steady.iter().zip(&braking).position(|(a, b)| a != b).map(|k| first + k)
        })
    }

    #[test]
    fn seal_reacts_after_the_hand_over_when_the_ego_brakes_and_cat_does_not() {
        let mut reacted = 0;
        for scene in worlds(8) {
            let (situation, cat) = compiled("cat", scene.clone());
            assert_eq!(first_difference(&situation, &cat), None);
            let (situation, seal) = compiled("seal", scene);
            let [Action::FollowThenReact { handover_step, .. }] = seal.intervention.actions.as_slice() else {
                panic!("{:?}", seal.intervention)
            };
            if let Some(step) = first_difference(&situation, &seal) {
                assert!(step > *handover_step, "{step}, hand-over at {handover_step}");
                reacted += 1;
            }
        }
        assert!(reacted >= 2, "{reacted} of 8");
    }

    #[test]
    fn the_skills_take_over_a_lead_before_the_predicted_meeting() {
        let response = |meeting| Response { meeting, contact: true, gap_m_min: 0.0, deviation_m: 0.0 };
        let candidate = Candidate::new(vec![Sample::default(); 80], 0.0);
        assert_eq!(handover_step(&candidate, 11, &response(40), 1.1), 40);
        assert_eq!(handover_step(&candidate, 11, &response(5), 1.1), 11);
        assert_eq!(handover_step(&candidate, 11, &response(79), 0.0), 90);
    }

    #[test]
    fn a_candidate_in_the_way_is_critical_and_one_that_stays_away_is_not() {
        let (situation, _) = compiled("seal", two_lane_scene());
        let plan = EgoPlan::of(&situation, 1).unwrap();
        let stands_at = |x: f64, y: f64| {
            let sample = Sample { position: Vec2::new(x, y), ..Sample::default() };
            plan.answer(&situation, 0, &vec![sample; 59], 5.0)
        };
        let (blocks, away) = (stands_at(30.0, 0.0), stands_at(30.0, 40.0));
        assert!(blocks.criticality() > 0.5 && blocks.deviation() > 0.9, "{blocks:?}");
        assert!(away.criticality() < 0.05 && away.deviation() == 0.0, "{away:?}");
        // Nobody can brake from 10 m/s within 3 m.
        assert!(stands_at(17.0, 0.0).contact);
    }

    #[test]
    fn the_parent_follows_the_candidate_with_the_largest_mean_of_both_labels() {
        let (situation, compiled) = compiled(NAME, two_lane_scene());
        let chosen = &compiled.decision.actors[0];
        let plan = EgoPlan::of(&situation, 1).unwrap();
        let [Action::FollowThenReact { samples, .. }] = compiled.intervention.actions.as_slice() else { panic!() };
        let response = plan.answer(&situation, 0, samples, 5.0);
        assert!((chosen.score - 0.5 * (response.criticality() + response.deviation())).abs() < 1e-12);
    }
}
