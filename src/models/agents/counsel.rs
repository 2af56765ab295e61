//! The attacker agent: it proposes which vehicles attack in a scene, learns the result, and proposes again
//! (LLM-Attacker's initialisation, reflection and modification).
//!
//! An unusable answer is recorded with its reason, and a proposal by rules is tried instead: the next vehicle of the
//! table, or, if the ego yielded, the last set with one more vehicle.

use std::collections::BTreeSet;

use super::{
    AgentError,
    reply::{self, Choice, Refusal},
    scene_prompt::{SceneText, counsel_request},
};
use crate::{
    llm::{Ask, ModelSpec},
    objects::{
        Counsel, Exchange, LineageId, Role,
        counsel::{CounselRound, EgoPlace, Failure, Proposer, Trial, Vehicle},
    },
};

/// One scene's question.
#[derive(Clone, Copy, Debug)]
pub struct Case<'a> {
    /// Lineage that gets the counsel.
    pub lineage: &'a LineageId,
    /// Id of the scene.
    pub scene: &'a str,
    /// Index of the scene in the study: the draw slot of its questions.
    pub slot: u32,
    /// The fixed driver, in a sentence.
    pub ego: &'a str,
    /// Its undisturbed drive, second by second.
    pub drive: &'a [EgoPlace],
    /// Vehicles that may attack, in the order in which the rules propose them.
    pub vehicles: &'a [Vehicle],
    /// Most vehicles of a set.
    pub attackers_max: usize,
    /// Most sets that are tried.
    pub rounds: u32,
    /// Model that is asked.
    pub model: &'a ModelSpec,
}

/// The agent's result.
#[derive(Clone, Debug, PartialEq)]
pub struct Advice {
    /// Every question and answer, in order.
    pub exchanges: Vec<Exchange>,
    /// Every set that was tried, in order.
    pub rounds: Vec<CounselRound>,
    /// The set that met the ego, or else came nearest to it; among equals the earliest. Empty if no set could attack.
    pub counsel: Counsel,
}

/// A set of attackers as rows of the table, the leader first.
type Set = Vec<usize>;

/// Proposes, tries and reflects until a set meets the ego, no set is left, or the rounds are used up. `tried` runs a
/// set in the simulator.
///
/// # Errors The errors of asking and of `tried`. A useless answer of a model is not an error.
pub fn counsel<E: From<AgentError>>(
    case: &Case<'_>,
    ask: &dyn Ask,
    tried: &dyn Fn(&Counsel) -> Result<Trial, E>,
) -> Result<Advice, E> {
    let text = SceneText::of(case).map_err(AgentError::from)?;
    let mut talk = Talk { case, ask, text, sets: vec![], rounds: vec![], exchanges: vec![] };
    for round in 0..case.rounds {
        let Some((set, reason, proposed_by)) = talk.proposal(round)? else { break };
        let trial = tried(&talk.counsel(&set))?;
        let (attackers, met) = (talk.ids(&set), trial == Trial::Contact);
        talk.rounds.push(CounselRound { attackers, reason, proposed_by, trial });
        talk.sets.push(set);
        if met {
            break;
        }
    }
    let distance_m = |place: &usize| talk.rounds[*place].trial.distance_m();
    let measured = (0..talk.sets.len()).filter(|place| distance_m(place).is_finite());
    let best = measured.min_by(|a, b| distance_m(a).total_cmp(&distance_m(b)));
    let counsel = best.map(|place| talk.counsel(&talk.sets[place])).unwrap_or_default();
    Ok(Advice { exchanges: talk.exchanges, rounds: talk.rounds, counsel })
}

/// The conversation about one scene.
struct Talk<'a> {
    case: &'a Case<'a>,
    ask: &'a dyn Ask,
    text: SceneText,
    /// Exchanges of the rounds, in their order.
    sets: Vec<Set>,
    rounds: Vec<CounselRound>,
    exchanges: Vec<Exchange>,
}

impl Talk<'_> {
    /// The next set: the model's, or the rules' if the model's answer is unusable. `None` if no set is left to try.
    fn proposal(&mut self, round: u32) -> Result<Option<(Set, String, Proposer)>, AgentError> {
        let Some(by_rule) = self.by_rule() else { return Ok(None) };
        let request = counsel_request(self.case, &self.text, round, &self.rounds)?;
        let reply = self.ask.ask(&request)?;
        let (bytes, unwrapped) = request.model.opened(&reply.bytes);
        let answer = reply::attackers(bytes).and_then(|choice| Ok((self.set(&choice)?, choice.reason)));
        self.exchanges.push(Exchange {
            role: Role::AttackerAgent,
            round,
            request: reply.request,
            response: reply.response,
            model: request.model.name.clone(),
            metadata: reply.sealed_metadata,
            unwrapped,
            refusal: answer.as_ref().err().map(ToString::to_string),
        });
        Ok(Some(match answer {
            Ok((set, reason)) => (set, reason, Proposer::Model),
            Err(_) => (by_rule, "the next proposal of the rules".into(), Proposer::Rules),
        }))
    }

    /// The set that an answer names, if it may be tried.
    fn set(&self, choice: &Choice) -> Result<Set, Refusal> {
        let case = self.case;
        if choice.attackers.len() > case.attackers_max {
            let (count, most) = (choice.attackers.len(), case.attackers_max);
            return Err(Refusal(format!("attackers: found {count} vehicles, expected at most {most}")));
        }
        let mut set = Set::new();
        for id in &choice.attackers {
            let place = case.vehicles.iter().position(|vehicle| vehicle.id == *id);
            let place = place.ok_or_else(|| Refusal(format!("attackers: no vehicle `{id}` in the table")))?;
            if set.contains(&place) {
                return Err(Refusal(format!("attackers: `{id}` twice")));
            }
            set.push(place);
        }
        if self.is_tried(&set) {
            return Err(Refusal(format!("attackers: {} was tried before", choice.attackers.join(", "))));
        }
        Ok(set)
    }

    /// Returns `true` if the same vehicles attacked together before, with any leader.
    fn is_tried(&self, set: &Set) -> bool {
        let members = |set: &Set| set.iter().copied().collect::<BTreeSet<usize>>();
        self.sets.iter().any(|before| members(before) == members(set))
    }

    /// The rules' next proposal; `None` if all were tried.
    fn by_rule(&self) -> Option<Set> {
        let vehicles = 0..self.case.vehicles.len();
        let last = self.sets.last().zip(self.rounds.last());
        let yielded = last.filter(|(set, round)| {
            let yielded = matches!(round.trial, Trial::Missed { failure: Failure::EgoYielded, .. });
            yielded && set.len() < self.case.attackers_max
        });
        let joined = yielded.into_iter().flat_map(|(set, _)| {
            let others = vehicles.clone().filter(|place| !set.contains(place));
            others.map(|place| [&set[..], &[place]].concat())
        });
        joined.chain(vehicles.clone().map(|place| vec![place])).find(|set| !self.is_tried(set))
    }

    fn ids(&self, set: &Set) -> Vec<String> {
        set.iter().map(|place| self.case.vehicles[*place].id.clone()).collect()
    }

    fn counsel(&self, set: &Set) -> Counsel {
        Counsel { attackers: set.iter().map(|place| self.case.vehicles[*place].track).collect(), ..Counsel::default() }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;
    use std::sync::Mutex;

    use super::*;
    use crate::kernel::Digest;
    use crate::llm::{AskError, DraftJudge, Reply, Request};
    use crate::objects::counsel::LaneRelation;

    /// Answers in turn; keeps what was asked.
    struct Answers(Mutex<(Vec<String>, Vec<Request>)>);

    impl Answers {
        fn new(texts: &[String]) -> Answers {
            Answers(Mutex::new((texts.to_vec(), vec![])))
        }

        fn asked(self) -> Vec<Request> {
            self.0.into_inner().unwrap().1
        }
    }

    impl Ask for Answers {
        fn ask_with(&self, request: &Request, _: Option<&dyn DraftJudge>) -> Result<Reply, AskError> {
            let mut desk = self.0.lock().unwrap();
            let text = desk.0.get(desk.1.len()).cloned().unwrap_or_default();
            desk.1.push(request.clone());
            let response = Digest::of_bytes(text.as_bytes());
            Ok(Reply {
                request: request.key().unwrap(),
                response,
                bytes: text.into_bytes(),
                metadata: None,
                sealed_metadata: None,
            })
        }
    }

    const DRIVE: [EgoPlace; 2] = [
        EgoPlace { at_s: 0.0, ahead_m: 0.0, left_m: 0.0, speed_mps: 8.125 },
        EgoPlace { at_s: 1.0, ahead_m: 8.0, left_m: -0.515, speed_mps: 7.5 },
    ];

    pub fn vehicle(track: usize, id: &str) -> Vehicle {
        Vehicle {
            track,
            id: id.into(),
            length_m: 4.5,
            ahead_m: 10.0 + track as f64,
            left_m: -3.5,
            gap_m: 8.123_456,
            speed_mps: 7.0,
            heading_difference_rad: 0.1,
            lane: LaneRelation::Adjacent,
            time_to_collision_s: None,
            conflict: true,
            reach: false,
            arrivals_s: Some([2.512, 3.25]),
        }
    }

    fn choice(attackers: &[&str]) -> String {
        let attackers = serde_json::json!({"attackers": attackers, "reason": "they are near"});
        serde_json::json!({"response_id": "r", "attacker_choice": attackers}).to_string()
    }

    fn missed(failure: Failure, distance_m: f64) -> Trial {
        Trial::Missed { failure, distance_m_min: Some(distance_m) }
    }

    /// Advice where three vehicles may attack, by twos; `trials` says what becomes of the sets in turn.
    fn advised(answers: &[String], rounds: u32, trials: &[Trial]) -> (Advice, Vec<Request>) {
        let (vehicles, lineage) = ([vehicle(4, "a"), vehicle(2, "b"), vehicle(9, "c")], LineageId::new("x-idm"));
        let (name, kind, model) = ("table".to_string(), "table".to_string(), "table".to_string());
        let spec = ModelSpec {
            name,
            kind,
            model,
            sampling: BTreeMap::new(),
            response_format: None,
            body: BTreeMap::new(),
            here: Default::default(),
        };
        let (vehicles, model) = (&vehicles, &spec);
        let case = Case {
            lineage: &lineage,
            scene: "s",
            slot: 17,
            ego: "replay",
            drive: &DRIVE,
            vehicles,
            attackers_max: 2,
            rounds,
            model,
        };
        let (ask, turn) = (Answers::new(answers), Mutex::new(0));
        let tried = |_: &Counsel| {
            let mut turn = turn.lock().unwrap();
            *turn += 1;
            Ok::<Trial, AgentError>(trials[*turn - 1].clone())
        };
        (counsel(&case, &ask, &tried).unwrap(), ask.asked())
    }

    #[test]
    fn feedback_leads_to_another_set_and_the_best_becomes_the_counsel() {
        let answers = [choice(&["b"]), choice(&["c", "a"]), choice(&["c"])];
        let trials = [missed(Failure::Late, 6.0), missed(Failure::EgoYielded, 1.5), missed(Failure::NeverClose, 20.0)];
        let (advice, asked) = advised(&answers, 3, &trials);
        assert_eq!(advice.counsel.attackers, [9, 4]);
        assert_eq!(advice.rounds[1].attackers, ["c", "a"]);
        assert!(advice.rounds.iter().all(|round| round.proposed_by == Proposer::Model));
        let says_late: Vec<bool> = asked.iter().map(|request| request.messages[2].text.contains("\"late\"")).collect();
        assert_eq!(says_late, [false, true, true], "the agent is told why its set failed");
        assert!(asked.iter().all(|request| request.messages[1] == asked[0].messages[1]), "one text a scene");
        let slots: Vec<(u32, u32)> = asked.iter().map(|request| (request.slot.slot, request.slot.round)).collect();
        assert_eq!(slots, [(17, 0), (17, 1), (17, 2)]);
        assert!(asked.iter().all(|request| request.slot.role == "attacker_agent"));
    }

    #[test]
    fn a_set_that_meets_the_ego_ends_the_search() {
        let (advice, asked) = advised(&[choice(&["b"])], 3, &[Trial::Contact]);
        assert_eq!((advice.counsel.attackers, asked.len(), advice.rounds.len()), (vec![2], 1, 1));
    }

    #[test]
    fn an_answer_that_cannot_be_used_is_recorded_and_the_rules_go_on() {
        for (bad, why) in [
            ("Sure! a".to_string(), "JSON"),
            (choice(&["z"]), "no vehicle `z`"),
            (choice(&["a", "a"]), "twice"),
            (choice(&["a", "b", "c"]), "at most 2"),
            (choice(&[]), "attackers"),
            (r#"{"response_id": "r", "attackers": ["a"], "reason": "x"}"#.to_string(), "schema"),
        ] {
            let (advice, _) = advised(std::slice::from_ref(&bad), 1, &[missed(Failure::Early, 3.0)]);
            assert_eq!(advice.counsel.attackers, [4], "the first of the table");
            assert_eq!(advice.rounds[0].proposed_by, Proposer::Rules);
            let refusal = advice.exchanges[0].refusal.as_deref().unwrap();
            assert!(refusal.contains(why), "{bad}: {refusal}");
        }
    }

    #[test]
    fn no_set_is_tried_twice_whoever_leads_it() {
        let answers = [choice(&["a", "b"]), choice(&["b", "a"])];
        let (advice, _) = advised(&answers, 2, &[missed(Failure::Late, 2.0), missed(Failure::Late, 3.0)]);
        assert!(advice.exchanges[1].refusal.as_ref().unwrap().contains("tried before"));
        assert_eq!(advice.rounds[1].attackers, ["a"]);
    }

    #[test]
    fn the_rules_add_a_second_attacker_where_the_ego_yielded_and_end_when_nothing_is_left() {
        let trials = vec![missed(Failure::EgoYielded, 2.0); 8];
        let (advice, asked) = advised(&[], 8, &trials);
        let sets: Vec<Vec<&str>> =
            advice.rounds.iter().map(|round| round.attackers.iter().map(String::as_str).collect()).collect();
        assert_eq!(sets, [vec!["a"], vec!["a", "b"], vec!["b"], vec!["b", "c"], vec!["c"], vec!["c", "a"]]);
        assert_eq!(asked.len(), 6, "nothing is asked when all is tried");
        let refused = Trial::Refused { reason: "no window".into() };
        let (advice, _) = advised(&[choice(&["b"])], 2, &[refused.clone(), refused]);
        assert_eq!((advice.rounds.len(), advice.counsel.attackers), (2, vec![]), "who could not attack is not advised");
        let (advice, _) = advised(&[choice(&["b"])], 2, &vec![missed(Failure::Late, 2.0); 2]);
        assert_eq!(advice.counsel.attackers, [2], "of equals the earliest");
    }
}
