//! The attacker agent: it ranks the vehicles of the table by a sum of terms, and follows the feedback on the sets that
//! were tried: after "late" a vehicle farther ahead, after "early" one farther behind, and if the ego yielded a vehicle
//! on another side.

use serde::Deserialize;
use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet};

use super::{
    Draws,
    errors::Rates,
    reader::{blocks, take},
};
use crate::{
    kernel::num,
    llm::{ModelError, Request},
};

pub const ROLE: &str = "attacker_agent";

/// The parsed question.
#[derive(Debug)]
struct Question {
    response_id: String,
    attackers_max: usize,
    vehicles: Vec<Vehicle>,
    tried: Vec<Tried>,
}

#[derive(Debug, Deserialize)]
struct Task {
    response_id: String,
}

#[derive(Debug, Deserialize)]
struct Scene {
    attackers_max: usize,
}

#[derive(Debug, Deserialize)]
struct Table {
    columns: Vec<String>,
    rows: Vec<Vec<Value>>,
}

/// A row of the table by its columns' names.
#[derive(Debug, Deserialize)]
struct Vehicle {
    id: String,
    ahead_m: f64,
    left_m: f64,
    gap_m: f64,
    lane: String,
    time_to_collision_s: Option<f64>,
    conflict: bool,
    reach: bool,
}

#[derive(Debug, Deserialize)]
struct Tried {
    attackers: Vec<String>,
    outcome: String,
}

/// The reply object.
pub fn answer(request: &Request, rates: Rates, draws: &Draws) -> Result<Value, ModelError> {
    let question = Question::read(request)?;
    let (mut attackers, reason) = question.choice(draws.stream("oversight").chance(rates.oversight_rate));
    if draws.stream("errors").chance(rates.out_of_range_rate)
        && let Some(leader) = attackers.first_mut()
    {
        // A vehicle that the table does not have.
        leader.push_str("-2");
    }
    let choice = json!({"attackers": attackers, "reason": reason});
    Ok(json!({"response_id": question.response_id, "attacker_choice": choice}))
}

impl Question {
    fn read(request: &Request) -> Result<Question, ModelError> {
        let blocks: BTreeMap<String, Value> =
            request.messages.iter().filter(|m| m.role == "user").flat_map(|m| blocks(&m.text)).collect();
        let Table { columns, rows } = take(&blocks, "Vehicles")?;
        let named = |row: Vec<Value>| Value::Object(columns.iter().cloned().zip(row).collect());
        let rows = BTreeMap::from([("Vehicles".to_string(), rows.into_iter().map(named).collect())]);
        let tried = if blocks.contains_key("Tried") { take(&blocks, "Tried")? } else { vec![] };
        let (task, scene): (Task, Scene) = (take(&blocks, "Task")?, take(&blocks, "Scene")?);
        let (response_id, attackers_max) = (task.response_id, scene.attackers_max);
        Ok(Question { response_id, attackers_max, vehicles: take(&rows, "Vehicles")?, tried })
    }

    /// Returns who attacks next and why. If it overlooks the feedback, it takes the next best vehicle.
    fn choice(&self, overlooks: bool) -> (Vec<String>, String) {
        let last = self.tried.last().filter(|_| !overlooks);
        let leader = last.and_then(|last| self.vehicle(last.attackers.first()?));
        let feedback = last.zip(leader).and_then(|(last, leader)| self.answered(last, leader));
        let next = feedback.or_else(|| {
            let vehicle = self.best(|_| true, &[])?;
            Some((vec![vehicle.id.clone()], format!("`{}` promises most of those not tried", vehicle.id)))
        });
        // All sets were tried, so any answer will do: the rules continue.
        next.unwrap_or_else(|| (self.vehicles.iter().take(1).map(|v| v.id.clone()).collect(), "nobody is left".into()))
    }

    /// The set that the last outcome suggests, if a vehicle fits.
    fn answered(&self, last: &Tried, leader: &Vehicle) -> Option<(Vec<String>, String)> {
        let alone = |vehicle: &Vehicle| vec![vehicle.id.clone()];
        match last.outcome.as_str() {
            "ego_yielded" if last.attackers.len() < self.attackers_max => {
                let beside = |v: &Vehicle| v.ahead_m * leader.ahead_m < 0.0 || v.left_m * leader.left_m < 0.0;
                let second = self.best(beside, &last.attackers).or_else(|| self.best(|_| true, &last.attackers))?;
                let set = last.attackers.iter().chain([&second.id]).cloned().collect();
                Some((set, format!("the ego yielded to `{}`; `{}` closes the way out", leader.id, second.id)))
            }
            "late" => {
                let ahead = self.best(|v| v.ahead_m > leader.ahead_m + 2.0, &[])?;
                Some((alone(ahead), format!("`{}` came late; `{}` is farther ahead", leader.id, ahead.id)))
            }
            "early" => {
                let behind = self.best(|v| v.ahead_m < leader.ahead_m - 2.0, &[])?;
                Some((alone(behind), format!("`{}` came early; `{}` is farther behind", leader.id, behind.id)))
            }
            "blocked" => {
                let elsewhere = self.best(|v| v.lane != leader.lane, &[])?;
                let reason = format!("`{}` was blocked; `{}` comes another way", leader.id, elsewhere.id);
                Some((alone(elsewhere), reason))
            }
            _ => None,
        }
    }

    fn vehicle(&self, id: &String) -> Option<&Vehicle> {
        self.vehicles.iter().find(|vehicle| vehicle.id == *id)
    }

    /// The most promising vehicle that fits and makes a new set together with the others; among equals the first.
    fn best(&self, fits: impl Fn(&Vehicle) -> bool, beside: &[String]) -> Option<&Vehicle> {
        let new = |vehicle: &&Vehicle| {
            let set: BTreeSet<&String> = beside.iter().chain([&vehicle.id]).collect();
            let tried = self.tried.iter().any(|tried| tried.attackers.iter().collect::<BTreeSet<_>>() == set);
            set.len() == beside.len() + 1 && !tried
        };
        let fitting = self.vehicles.iter().filter(|vehicle| fits(vehicle)).filter(new);
        fitting.fold(None, |best: Option<&Vehicle>, vehicle| match best {
            Some(best) if best.promise() >= vehicle.promise() => Some(best),
            _ => Some(vehicle),
        })
    }
}

impl Vehicle {
    /// Its rank value: high if it can meet the ego, soon, from close by, on a crossing path.
    fn promise(&self) -> f64 {
        let flag = |holds: bool, weight: f64| if holds { weight } else { 0.0 };
        let urgency = self.time_to_collision_s.map_or(0.0, |s| num::exp(-s / 3.0));
        flag(self.reach, 2.0) + flag(self.conflict, 0.8) + urgency + 0.7 * num::exp(-self.gap_m / 20.0)
            - flag(self.ahead_m < 0.0, 0.5)
            + flag(self.lane == "adjacent", 0.4)
            + flag(self.lane == "same", 0.2)
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::{KIND, Scripted};
    use crate::agents::counsel::{Advice, Case, counsel};
    use crate::agents::{AgentError, reply};
    use crate::kernel::Digest;
    use crate::llm::{Ask, AskError, DraftJudge, Model, ModelSpec, Reply, Request};
    use crate::objects::counsel::{Failure, LaneRelation, Proposer, Trial, Vehicle};
    use crate::objects::{Counsel, LineageId};
    use std::collections::BTreeMap;
    use std::sync::Mutex;

    /// Asks the scripted model, twice.
    pub struct Live;

    impl Ask for Live {
        fn ask_with(&self, request: &Request, _: Option<&dyn DraftJudge>) -> Result<Reply, AskError> {
            let bytes = Scripted.complete(request).unwrap().bytes;
            assert_eq!(bytes, Scripted.complete(request).unwrap().bytes, "equal requests get equal bytes");
            Ok(Reply {
                request: request.key().unwrap(),
                response: Digest::of_bytes(&bytes),
                bytes,
                metadata: None,
                sealed_metadata: None,
            })
        }
    }

    pub fn model(malformed: f64, out_of_range: f64, oversight: f64) -> ModelSpec {
        let rates = [
            ("malformed_json_rate", malformed),
            ("out_of_range_rate", out_of_range),
            ("oversight_rate", oversight),
            ("foreign_mechanism_rate", 0.0),
            ("stale_hash_rate", 0.0),
            ("seed", 1.0),
        ];
        ModelSpec {
            name: KIND.into(),
            kind: KIND.into(),
            model: "rules-1".into(),
            sampling: rates.into_iter().map(|(name, rate)| (name.to_string(), rate)).collect::<BTreeMap<_, _>>(),
            response_format: None,
            body: BTreeMap::new(),
            here: Default::default(),
        }
    }

    /// Four vehicles: ahead in the ego's lane and reaching it; ahead left; behind right; far ahead.
    fn vehicles() -> Vec<Vehicle> {
        let vehicle = |track, id: &str, ahead_m: f64, left_m, lane, reach| Vehicle {
            track,
            id: id.into(),
            length_m: 4.5,
            ahead_m,
            left_m,
            gap_m: ahead_m.abs(),
            speed_mps: 7.0,
            heading_difference_rad: 0.1,
            lane,
            time_to_collision_s: None,
            conflict: false,
            reach,
            arrivals_s: None,
        };
        vec![
            vehicle(0, "lead", 15.0, 0.5, LaneRelation::Same, true),
            vehicle(1, "left", 25.0, 3.5, LaneRelation::Adjacent, false),
            vehicle(2, "back", -12.0, -3.5, LaneRelation::Adjacent, false),
            vehicle(3, "far", 60.0, 0.5, LaneRelation::Same, false),
        ]
    }

    fn advised(spec: &ModelSpec, slot: u32, rounds: u32, ends: Failure) -> Advice {
        let (vehicles, lineage) = (vehicles(), LineageId::new("x-idm"));
        let (vehicles, model) = (vehicles.as_slice(), spec);
        let (scene, ego) = ("s", "replay");
        let case = Case { lineage: &lineage, scene, slot, ego, drive: &[], vehicles, attackers_max: 2, rounds, model };
        let distance_m = Mutex::new(9.0);
        let tried = |_: &Counsel| {
            let mut distance_m = distance_m.lock().unwrap();
            *distance_m -= 1.0;
            Ok::<Trial, AgentError>(Trial::Missed { failure: ends, distance_m_min: Some(*distance_m) })
        };
        counsel(&case, &Live, &tried).unwrap()
    }

    fn sets(advice: &Advice) -> Vec<Vec<&str>> {
        advice.rounds.iter().map(|round| round.attackers.iter().map(String::as_str).collect()).collect()
    }

    #[test]
    fn the_first_proposal_is_who_can_reach_the_ego_and_the_next_follows_the_feedback() {
        let exact = model(0.0, 0.0, 0.0);
        for (failure, second) in [
            (Failure::NeverClose, vec!["left"]),
            (Failure::Late, vec!["left"]),
            (Failure::Early, vec!["back"]),
            (Failure::EgoYielded, vec!["lead", "back"]),
            (Failure::Blocked, vec!["left"]),
        ] {
            let advice = advised(&exact, 0, 2, failure);
            assert_eq!(sets(&advice), [vec!["lead"], second], "{failure:?}");
            assert!(advice.rounds.iter().all(|round| round.proposed_by == Proposer::Model));
        }
    }

    #[test]
    fn answers_satisfy_the_schema_and_err_at_the_declared_rates() {
        let asked = 300;
        let refusals = |spec: &ModelSpec| -> Vec<String> {
            let of = |slot| advised(spec, slot, 1, Failure::Late).exchanges[0].refusal.clone();
            (0..asked).filter_map(of).collect()
        };
        assert!(refusals(&model(0.0, 0.0, 0.0)).is_empty());
        let garbled = refusals(&model(0.2, 0.0, 0.0));
        assert!((30..=90).contains(&garbled.len()), "{}", garbled.len());
        let unknown = refusals(&model(0.0, 0.2, 0.0));
        assert!((30..=90).contains(&unknown.len()) && unknown.iter().all(|why| why.contains("no vehicle `lead-2`")));
    }

    #[test]
    fn whoever_overlooks_the_feedback_takes_the_next_best() {
        let advice = advised(&model(0.0, 0.0, 1.0), 0, 2, Failure::EgoYielded);
        assert_eq!(sets(&advice), [vec!["lead"], vec!["left"]]);
    }

    #[test]
    fn a_damaged_scene_is_refused_and_never_a_panic() {
        let (vehicles, lineage, model) = (vehicles(), LineageId::new("x-idm"), model(0.0, 0.0, 0.0));
        let (vehicles, model) = (vehicles.as_slice(), &model);
        let (scene, ego) = ("s", "replay");
        let case =
            Case { lineage: &lineage, scene, slot: 0, ego, drive: &[], vehicles, attackers_max: 2, rounds: 1, model };
        let text = crate::agents::scene_prompt::SceneText::of(&case).unwrap();
        let whole = crate::agents::scene_prompt::counsel_request(&case, &text, 0, &[]).unwrap();
        reply::attackers(&Scripted.complete(&whole).unwrap().bytes).unwrap();
        let scene = whole.messages[1].text.to_string();
        let end = scene.rfind("```").unwrap();
        for cut in (0..end).step_by(13).filter(|cut| scene.is_char_boundary(*cut)) {
            let mut damaged = whole.clone();
            damaged.messages[1].text = scene[..cut].into();
            assert!(Scripted.complete(&damaged).is_err());
        }
    }
}
