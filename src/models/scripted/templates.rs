//! The template agent: it takes the behaviour that shares most words with the description, and the published ranges,
//! narrowed by the description's words about speed and distance, and halved after each template that did not suffice.

use serde::Deserialize;
use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet};

use super::{
    Draws,
    errors::Rates,
    names::words,
    reader::{blocks, take},
};
use crate::{
    kernel::num,
    llm::{ModelError, Request},
};

pub const ROLE: &str = "template_agent";

#[derive(Debug, Deserialize)]
struct Task {
    response_id: String,
}

#[derive(Debug, Deserialize)]
struct Description {
    text: String,
}

#[derive(Debug, Deserialize)]
struct Behaviours {
    behaviours: Vec<Behaviour>,
    published_behaviour: String,
}

#[derive(Debug, Deserialize)]
struct Behaviour {
    word: String,
    describes: String,
}

#[derive(Debug, Deserialize)]
struct Range {
    name: String,
    high_max: f64,
    published: [f64; 2],
}

/// Words by which a description speaks of a number, and the part of its published range that they mean: shares of its width.
const SAID: [(&str, &[&str], [f64; 2]); 5] = [
    ("speed_mps", &["fast", "speeding", "hurries", "races", "quickly"], [0.5, 1.0]),
    ("speed_mps", &["slow", "slowly", "creeps", "walks", "steady"], [0.0, 0.6]),
    ("trigger_m", &["close", "near", "late", "sudden", "suddenly"], [0.0, 0.6]),
    ("trigger_m", &["far", "early", "distant"], [0.4, 1.0]),
    ("act_within_m", &["abrupt", "abruptly", "sudden", "suddenly"], [0.0, 0.5]),
];

/// Words without meaning for a behaviour.
const COMMON: [&str; 22] = [
    "a", "an", "and", "as", "at", "by", "in", "is", "it", "its", "of", "on", "out", "so", "that", "the", "their",
    "then", "to", "when", "where", "with",
];

/// The reply object.
pub fn answer(request: &Request, rates: Rates, draws: &Draws) -> Result<Value, ModelError> {
    let shown: BTreeMap<String, Value> =
        request.messages.iter().filter(|m| m.role == "user").flat_map(|m| blocks(&m.text)).collect();
    let (task, description): (Task, Description) = (take(&shown, "Task")?, take(&shown, "Description")?);
    let (known, ranges): (Behaviours, Vec<Range>) = (take(&shown, "Behaviours")?, take(&shown, "Ranges")?);
    let said = telling(&description.text);
    let (behaviour, shared) = fitting(&known, &said);
    let tried = shown.get("Tried").and_then(Value::as_array).map_or(0, Vec::len);
    let mut chosen: BTreeMap<&str, [f64; 2]> =
        ranges.iter().map(|range| (range.name.as_str(), halved(narrowed(range, &said), tried))).collect();
    if draws.stream("errors").chance(rates.out_of_range_rate)
        && let Some(range) = ranges.first()
    {
        chosen.insert(&range.name, [range.published[0], range.high_max + 1.0]);
    }
    let reason = if shared.is_empty() {
        format!("nothing in the description names a behaviour; `{behaviour}` is the published one")
    } else {
        format!("`{behaviour}` shares with the description: {}", shared.join(", "))
    };
    let template = json!({"behaviour": behaviour, "ranges": chosen, "reason": reason});
    Ok(json!({"response_id": task.response_id, "scenario_template": template}))
}

/// The meaningful words of a text, in lower case.
fn telling(text: &str) -> BTreeSet<String> {
    let text = text.to_ascii_lowercase();
    words(&text).filter(|word| !COMMON.contains(word)).map(String::from).collect()
}

/// The behaviour that shares the most words with the description, the published one if none shares any; among equals
/// the first.
fn fitting<'a>(known: &'a Behaviours, said: &BTreeSet<String>) -> (&'a str, Vec<String>) {
    let mut best: (&str, Vec<String>) = (&known.published_behaviour, vec![]);
    for behaviour in &known.behaviours {
        let shared: Vec<String> = telling(&behaviour.describes).intersection(said).cloned().collect();
        if shared.len() > best.1.len() {
            best = (&behaviour.word, shared);
        }
    }
    best
}

/// The published range, or the part of it that the description asks for.
fn narrowed(range: &Range, said: &BTreeSet<String>) -> [f64; 2] {
    let meant =
        SAID.iter().find(|(name, words, _)| *name == range.name && words.iter().any(|word| said.contains(*word)));
    let ([low, high], [from, to]) = (range.published, meant.map_or([0.0, 1.0], |(_, _, part)| *part));
    let at = |share: f64| num::rounded(low + (high - low) * share, 2);
    [at(from), at(to)]
}

/// After a template that was tried, the upper half of a range, after two of them the lower half, and so on.
fn halved([low, high]: [f64; 2], tried: usize) -> [f64; 2] {
    let middle = num::rounded(f64::midpoint(low, high), 2);
    match tried {
        0 => [low, high],
        odd if odd % 2 == 1 => [middle, high],
        _ => [low, middle],
    }
}

#[cfg(test)]
mod tests {
    use super::super::attackers::tests::{Live, model};
    use std::sync::Mutex;

    use crate::agents::AgentError;
    use crate::agents::compose::{Order, compose};
    use crate::families::{chatscene, registry};
    use crate::llm::{Ask, AskError, DraftJudge, ModelSpec, Reply, Request};
    use crate::objects::composition::TemplateTrial;
    use crate::objects::{Composed, Composition, FamilyName, LineageId, ParameterValue, Setting};

    fn composed(kind: &str, description: &str, model: &ModelSpec, slot: u32, rounds: u32) -> Composed {
        let lineage = LineageId::new("chatscene-idm");
        let form = chatscene::forms().into_iter().find(|form| form.kind == kind).unwrap();
        let order = Order { lineage: &lineage, slot, form: &form, description, rounds, model };
        compose(&order, &Live, &|template| tried(template, 4)).unwrap()
    }

    /// Four scenes, of which so many end in a collision.
    fn tried(template: &Composition, collided: usize) -> Result<TemplateTrial, AgentError> {
        Ok(TemplateTrial { template: template.clone(), scenes: 4, acted: 4, collided, realism: Some(0.875) })
    }

    #[test]
    fn a_template_that_spares_the_ego_is_asked_for_again_and_the_one_that_hits_most_is_taken() {
        let (lineage, exact) = (LineageId::new("chatscene-idm"), model(0.0, 0.0, 0.0));
        let form = chatscene::forms().into_iter().find(|form| form.kind == "crossing").unwrap();
        let (description, asked) = ("It crosses.", Recorded::default());
        let order = Order { lineage: &lineage, slot: 0, form: &form, description, rounds: 4, model: &exact };
        let outcomes = [1, 3, 3, 2];
        let turn = Mutex::new(0);
        let simulated = |template: &Composition| {
            let mut turn = turn.lock().unwrap();
            *turn += 1;
            tried(template, outcomes[*turn - 1])
        };
        let event = compose(&order, &asked, &simulated).unwrap();
        assert_eq!(event.exchanges.len(), 4, "as often as the order says");
        let collided: Vec<usize> = event.trials.iter().map(|trial| trial.collided).collect();
        assert_eq!(collided[..2], [1, 3]);
        assert_eq!(event.template.as_ref(), Some(&event.trials[1].template), "the first of the best");
        let texts = asked.0.into_inner().unwrap();
        assert!(!texts[0].contains("\"collided\"") && texts[1].contains("\"collided\": 1"), "{}", texts[1]);
        assert!(texts[2].contains("\"collided\": 3") && texts[2].contains("0.875"), "every earlier one is shown");
    }

    /// The stand-in, with the last message of every question kept.
    #[derive(Default)]
    struct Recorded(Mutex<Vec<String>>);

    impl Ask for Recorded {
        fn ask_with(&self, request: &Request, _: Option<&dyn DraftJudge>) -> Result<Reply, AskError> {
            self.0.lock().unwrap().push(request.messages.last().unwrap().text.to_string());
            Live.ask(request)
        }
    }

    #[test]
    fn the_behaviour_that_shares_most_words_with_the_description_is_taken_and_its_words_narrow_the_ranges() {
        let exact = model(0.0, 0.0, 0.0);
        let of = |text| composed("crossing", text, &exact, 0, 1).template.unwrap();
        let (intercept, steady) = (
            of("Times its speed so that it meets the ego where their ways cross"),
            of("It crosses, slowly and steady."),
        );
        assert_eq!((intercept.behaviour.as_str(), steady.behaviour.as_str()), ("intercept", "steady"));
        assert_eq!((intercept.ranges["speed_mps"], steady.ranges["speed_mps"]), ([5.0, 15.0], [5.0, 11.0]));
        let unnamed = of("Something happens.");
        assert_eq!(unnamed.behaviour, "rush_and_stop", "the published one");
        assert_eq!(unnamed.ranges["trigger_m"], [15.0, 45.0], "as published");
    }

    #[test]
    fn a_composed_template_is_the_parents_and_keeps_its_contract() {
        let exact = model(0.0, 0.0, 0.0);
        let family = registry().get(&FamilyName::new(chatscene::NAME)).unwrap().clone();
        let mut parent = family.parent.clone();
        let event = composed("lane_change", "A car beside the ego matches its speed and blocks the lane", &exact, 2, 1);
        chatscene::put(&mut parent, "lane_change", event.template.as_ref().unwrap());
        assert!(family.contract.check_program(&parent).is_empty());
        let word = parent.operator_graph["motion"].settings["lane_change_behaviour"].clone();
        assert_eq!(word, Setting::Choice("match_ego".into()));
        assert_eq!(parent.parameters["lane_change_speed_mps_high"], ParameterValue::Number(10.0));
        assert_ne!(parent.hash().unwrap(), family.parent.hash().unwrap());
        let others = |name: &&String| !name.starts_with("lane_change_");
        assert!(parent.parameters.keys().filter(others).all(|n| parent.parameters[n] == family.parent.parameters[n]));
    }

    #[test]
    fn an_answer_that_cannot_be_used_is_told_and_asked_for_again_and_the_published_template_stays_in_the_end() {
        let often = model(0.3, 0.3, 0.0);
        let events: Vec<Composed> =
            (0..80).map(|slot| composed("roadside", "A steady walker", &often, slot, 2)).collect();
        for event in &events {
            let refusals: Vec<bool> = event.exchanges.iter().map(|exchange| exchange.refusal.is_some()).collect();
            match (&event.template, &refusals[..]) {
                (Some(_), [false] | [true, false]) | (None, [true, true]) => {}
                found => panic!("{found:?}"),
            }
        }
        let refusals: Vec<&String> =
            events.iter().flat_map(|e| &e.exchanges).filter_map(|e| e.refusal.as_ref()).collect();
        assert!(
            refusals
                .iter()
                .any(|why| why.contains("ranges/ahead_m: found -25 to 21, expected low <= high within -45 to 20 m"))
        );
        assert!(refusals.iter().any(|why| why.contains("JSON")));
        assert!(events.iter().any(|event| event.template.is_none()), "some are never answered");
        assert!(events.iter().any(|event| event.exchanges.len() == 2 && event.template.is_some()), "some are mended");
    }

    #[test]
    fn a_template_with_a_foreign_word_or_number_or_without_one_of_its_own_is_refused() {
        let event = composed("turning", "It stops", &model(0.0, 0.0, 0.0), 0, 1);
        let (form, whole) = (chatscene::forms().remove(1), event.template.unwrap());
        assert_eq!(form.fault(&whole), None);
        let mut changed = whole.clone();
        changed.behaviour = "fly".into();
        assert!(form.fault(&changed).unwrap().contains("expected one of intercept_and_stop"));
        let mut changed = whole.clone();
        changed.ranges.remove("speed_mps");
        assert!(form.fault(&changed).unwrap().contains("no `speed_mps`"));
        let mut changed = whole.clone();
        changed.ranges.insert("mass_kg".into(), [1.0, 2.0]);
        assert!(form.fault(&changed).unwrap().contains("`mass_kg` is not drawn"));
        let mut changed = whole;
        changed.ranges.insert("speed_mps".into(), [f64::NAN, 2.0]);
        assert!(form.fault(&changed).is_some());
    }
}
