//! The diversity slot: which of the scored candidates is used.

use std::collections::BTreeSet;

use super::ActorDecision;
use crate::kernel::{Stream, num};
use crate::motion::Candidate;
use crate::stage::{Part, Settings, Situation, Stage, StageError};

/// The chosen candidate of every part, by index. Where actors were moved together and some iterate is left for all of
/// them, the first part's choice among those iterates is everybody's.
pub fn choose(stage: &Stage<'_>, kind: &str, settings: &Settings, parts: &[Part]) -> Result<Vec<usize>, StageError> {
    let choose_one = |part: &Part, allowed: &dyn Fn(&Candidate) -> bool| {
        let ranked = ranked(&part.candidates, allowed);
        let mut stream = stage.stream("choice", part.actor);
        Ok(match kind {
            "best_choice" => ranked[0],
            "soft_choice" => softly(&part.candidates, &ranked, settings.number("temperature")?, &mut stream),
            "spread_choice" => {
                let (count, apart_m) = (settings.count("count")?, settings.number("apart_m")?);
                let kept = spread(&part.candidates, &ranked, count, apart_m);
                softly(&part.candidates, &kept, settings.number("temperature")?, &mut stream)
            }
            other => return Err(StageError::Missing(format!("operator {other}"))),
        })
    };
    let joint = joint(parts);
    let Some(first) = parts.first().filter(|_| !joint.is_empty()) else {
        return parts.iter().map(|part| choose_one(part, &|_| true)).collect();
    };
    let leader = choose_one(first, &|candidate| candidate.iterate.is_some_and(|i| joint.contains(&i)))?;
    Ok(together(parts, first.candidates[leader].iterate))
}

/// Choices from the best score on: the parts' candidates of one iterate where they were moved together, else the next one of every part,
/// of whose candidates the last stays.
pub fn by_score(parts: &[Part]) -> Vec<Vec<usize>> {
    let joint = joint(parts);
    if let Some(first) = parts.first().filter(|_| !joint.is_empty()) {
        let allowed = |candidate: &Candidate| candidate.iterate.is_some_and(|i| joint.contains(&i));
        let of = |leader: usize| together(parts, first.candidates[leader].iterate);
        return ranked(&first.candidates, &allowed).into_iter().map(of).collect();
    }
    let orders: Vec<Vec<usize>> = parts.iter().map(|part| ranked(&part.candidates, &|_| true)).collect();
    let most = orders.iter().map(Vec::len).max().unwrap_or(0);
    (0..most).map(|k| orders.iter().map(|order| order[k.min(order.len() - 1)]).collect()).collect()
}

/// Every part's candidate of an iterate.
fn together(parts: &[Part], iterate: Option<usize>) -> Vec<usize> {
    parts.iter().map(|part| part.candidates.iter().position(|c| c.iterate == iterate).unwrap_or(0)).collect()
}

/// Iterates that every part still has a candidate of; empty for a single part.
fn joint(parts: &[Part]) -> BTreeSet<usize> {
    let of = |part: &Part| part.candidates.iter().filter_map(|c| c.iterate).collect::<BTreeSet<usize>>();
    match parts {
        [first, others @ ..] if !others.is_empty() => {
            others.iter().fold(of(first), |kept, part| kept.intersection(&of(part)).copied().collect())
        }
        _ => BTreeSet::new(),
    }
}

/// Indices of the allowed by score, best first; equals in candidate order.
fn ranked(candidates: &[Candidate], allowed: &dyn Fn(&Candidate) -> bool) -> Vec<usize> {
    let mut order: Vec<usize> = (0..candidates.len()).filter(|i| allowed(&candidates[*i])).collect();
    order.sort_by(|a, b| candidates[*b].score.total_cmp(&candidates[*a].score));
    order
}

/// One of `among` (not empty, best first) with softmax probability.
fn softly(candidates: &[Candidate], among: &[usize], temperature: f64, stream: &mut Stream) -> usize {
    let best = candidates[among[0]].score;
    let weights: Vec<f64> =
        among.iter().map(|i| num::exp((candidates[*i].score - best) / temperature.max(1e-6))).collect();
    let mut left = stream.unit() * num::sum(weights.iter().copied());
    for (index, weight) in among.iter().zip(&weights) {
        left -= weight;
        if left < 0.0 {
            return *index;
        }
    }
    among[0]
}

/// The best, then the next that lies apart from all kept, up to `count`.
fn spread(candidates: &[Candidate], ranked: &[usize], count: usize, apart_m: f64) -> Vec<usize> {
    let mut kept: Vec<usize> = Vec::with_capacity(count);
    for index in ranked {
        let apart = |k: &usize| candidates[*k].mean_distance_m(&candidates[*index]) >= apart_m;
        if kept.len() < count.max(1) && kept.iter().all(apart) {
            kept.push(*index);
        }
    }
    kept
}

/// Returns the record of a choice.
pub fn report(situation: &Situation, part: &Part, chosen: usize) -> ActorDecision {
    let candidate = &part.candidates[chosen];
    let steps = candidate.samples.windows(2).map(|pair| pair[0].position.distance(pair[1].position));
    ActorDecision {
        track: part.actor,
        inserted: situation.as_guest(part.actor).map(|guest| guest.kind),
        window: part.window,
        candidates: part.candidates.len(),
        chosen,
        score: candidate.score,
        prior_log_probability: candidate.prior_log_probability,
        path_m: num::sum(steps),
        end_speed_mps: candidate.samples.last().map_or(0.0, |s| s.speed_mps()),
        lawful: candidate.law.is_some(),
        handover_step: candidate.handover_step.filter(|_| candidate.law.is_none()),
    }
}
