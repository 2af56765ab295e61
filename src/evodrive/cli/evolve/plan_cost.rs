//! Questions and cost of recording the rest. Three numbers rest on different things: questions that are known, what is
//! likely by the occasions that were walked through, and the most that the budget allows.

use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};

use crate::cli::evolve::plan_looked::Seen;
use crate::epoch::{Occasions, occasion_of};
use crate::experiment::Experiment;
use crate::llm::{Cassette, DrawSlot, Recorded};
use crate::objects::Role;

/// Bytes that are taken for a token where no provider counted.
const BYTES_A_TOKEN: u64 = 4;

/// Number and cost of the questions of one role.
#[derive(Clone, Debug, Serialize)]
pub struct RoleCost {
    pub role: &'static str,
    /// Name of the model in the experiment file.
    pub model: String,
    /// Questions that are known to be missing: the first one without an answer on each occasion.
    pub known: u64,
    /// Questions that are likely, by the average of such occasions; `null` where none was walked through.
    pub likely: Option<u64>,
    /// Most questions that the budget allows.
    pub at_most: u64,
    /// Tokens of a question and of an answer, means.
    pub input_tokens: f64,
    pub output_tokens: f64,
    /// `counted` by the provider, `bytes` (a token for four bytes of recorded exchanges), `questions` (the same of known
    /// questions, with the model's limit for the answer), or `none`.
    pub tokens_from: &'static str,
    /// Most tokens of an answer, where the experiment says it.
    pub output_tokens_max: Option<f64>,
    /// Declared prices, US dollars per million tokens; `null` where the model has none.
    pub usd_per_million: Option<[f64; 2]>,
}

impl RoleCost {
    /// US dollars of this many questions; `dear` takes the longest answers.
    pub fn usd(&self, questions: u64, dear: bool) -> f64 {
        let [input, output] = self.usd_per_million.unwrap_or_default();
        let answer = if dear { self.output_tokens_max.unwrap_or(self.output_tokens) } else { self.output_tokens };
        questions as f64 * (self.input_tokens * input + answer * output) / 1e6
    }
}

/// Place of a question on an occasion, without role and round.
type Place = (&'static str, String, u32, u32);

/// The rest of a study, role by role.
pub fn rest(
    experiment: &Experiment,
    occasions: &[Occasions],
    cassette: &Cassette,
    seen: &Seen,
    walked_to_miss: bool,
) -> Vec<RoleCost> {
    let place = |role: Role, slot: &DrawSlot| (occasion_of(role), slot.lineage.clone(), slot.epoch, slot.slot);
    let roles: BTreeMap<&str, Role> = experiment.roles.keys().map(|role| (role.name(), *role)).collect();
    let places = |slots: &mut dyn Iterator<Item = &DrawSlot>| -> BTreeSet<Place> {
        slots.filter_map(|slot| Some(place(*roles.get(slot.role.as_str())?, slot))).collect()
    };
    let open = places(&mut seen.missing.keys().map(|(slot, _)| slot));
    let mut done = places(&mut seen.answered.iter().map(|(slot, _)| slot));
    done.retain(|place| walked_to_miss && !open.contains(place));
    let mut costs = Vec::new();
    for occasion in occasions {
        let finished = done.iter().filter(|place| place.0 == occasion.kind).count() as u64;
        let left = occasion.count.saturating_sub(finished);
        for (&role, &each) in &occasion.each {
            let of_role = |slot: &&DrawSlot| slot.role == role.name();
            let answered = seen.answered.iter().map(|(slot, _)| slot).filter(of_role);
            let (ended, begun): (Vec<&DrawSlot>, Vec<&DrawSlot>) =
                answered.partition(|slot| done.contains(&place(role, slot)));
            let (ended, begun) = (ended.len() as u64, begun.len() as u64);
            let known = seen.missing.keys().map(|(slot, _)| slot).filter(of_role).count() as u64;
            let at_most = (left * each).saturating_sub(begun).max(known);
            let likely =
                (finished > 0).then(|| (ended * left).div_ceil(finished).saturating_sub(begun).clamp(known, at_most));
            costs.push(of_role_with(experiment, role, cassette, seen, [known, at_most], likely));
        }
    }
    costs
}

fn of_role_with(
    experiment: &Experiment,
    role: Role,
    cassette: &Cassette,
    seen: &Seen,
    [known, at_most]: [u64; 2],
    likely: Option<u64>,
) -> RoleCost {
    let model = experiment.roles.get(&role).cloned().unwrap_or_default();
    let options = experiment.models.get(&model);
    let limit = |name: &str| options.and_then(|options| options.sampling.get(name)).copied();
    let output_tokens_max = limit("max_tokens").or_else(|| limit("max_completion_tokens"));
    let ([input_tokens, output_tokens], tokens_from) = tokens(role, cassette, seen, output_tokens_max);
    RoleCost {
        role: role.name(),
        known,
        likely,
        at_most,
        input_tokens,
        output_tokens,
        tokens_from,
        output_tokens_max,
        usd_per_million: prices(experiment, &model),
        model,
    }
}

/// Declared prices of a model; of several that are drawn the mean over those who answer, where one that is not paid for costs nothing.
fn prices(experiment: &Experiment, model: &str) -> Option<[f64; 2]> {
    let of = |name: &str| {
        let client = experiment.models.get(name)?.client.as_ref()?;
        Some([client.input_usd_per_million, client.output_usd_per_million])
    };
    let shares = &experiment.models.get(model)?.shares;
    let all: f64 = shares.values().sum();
    let weighed = |sum: [f64; 2], (name, share): (&String, &f64)| {
        let price = of(name).unwrap_or_default();
        [sum[0] + share / all * price[0], sum[1] + share / all * price[1]]
    };
    if shares.is_empty() { of(model) } else { Some(shares.iter().fold([0.0; 2], weighed)) }
}

/// Mean tokens of a role's questions and answers, and what they rest on.
fn tokens(role: Role, cassette: &Cassette, seen: &Seen, output_max: Option<f64>) -> ([f64; 2], &'static str) {
    let recorded: Vec<&Recorded> = cassette.exchanges().iter().filter(|of| of.slot.role == role.name()).collect();
    let counted: Vec<[u64; 2]> = recorded.iter().filter_map(|of| counted(of)).collect();
    if !counted.is_empty() {
        return (mean(&counted), "counted");
    }
    if !recorded.is_empty() {
        let by_bytes = |of: &&Recorded| {
            let question: u64 = of.messages.iter().map(|(_, text)| text.len() as u64).sum();
            [question.div_ceil(BYTES_A_TOKEN), (of.bytes.len() as u64).div_ceil(BYTES_A_TOKEN)]
        };
        return (mean(&recorded.iter().map(by_bytes).collect::<Vec<_>>()), "bytes");
    }
    let asked = seen.missing.values().filter(|question| question.slot.role == role.name());
    let asked: Vec<[u64; 2]> = asked.map(|question| [question.bytes.div_ceil(BYTES_A_TOKEN), 0]).collect();
    if asked.is_empty() {
        ([0.0, output_max.unwrap_or(0.0)], "none")
    } else {
        ([mean(&asked)[0], output_max.unwrap_or(0.0)], "questions")
    }
}

fn counted(recorded: &Recorded) -> Option<[u64; 2]> {
    let metadata = recorded.metadata.as_ref()?;
    Some([metadata.input_tokens?, metadata.output_tokens?])
}

fn mean(pairs: &[[u64; 2]]) -> [f64; 2] {
    let sum = pairs.iter().fold([0u64; 2], |sum, pair| [sum[0] + pair[0], sum[1] + pair[1]]);
    sum.map(|sum| sum as f64 / pairs.len().max(1) as f64)
}
