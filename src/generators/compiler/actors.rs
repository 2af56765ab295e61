//! The actor slot: which vehicles become adversaries.

use crate::scene::TrackIx;
use crate::stage::actors::ActorFacts;
use crate::stage::{Settings, Situation, Source, Stage, StageError};

/// A vehicle whose log moves less than this stands in for nobody, metres (MetaDrive's rule for static objects).
const MOVED_M_MIN: f64 = 3.0;

/// Adversaries in order of rank; empty where nobody is eligible.
pub fn select(source: &Source, stage: &Stage<'_>, kind: &str, settings: &Settings) -> Result<Vec<TrackIx>, StageError> {
    let situation = stage.situation;
    match kind {
        "marked_actor" => {
            let otherwise = settings.word("otherwise")?;
            Ok(situation.marked().next().or_else(|| stand_in(situation, otherwise)).into_iter().collect())
        }
        "ranked_actors" => ranked(situation, settings),
        "actor_group" => Ok(group(situation, settings.count("group_size")?)),
        other => match source.actors.get(other) {
            Some(own) => own(stage, settings),
            None => Err(StageError::Missing(format!("operator {other}"))),
        },
    }
}

fn eligible(situation: &Situation) -> impl Iterator<Item = (TrackIx, &ActorFacts)> {
    situation.actors.iter().enumerate().filter_map(|(ix, facts)| Some((ix, facts.as_ref()?)))
}

fn stand_in(situation: &Situation, rule: &str) -> Option<TrackIx> {
    let feature = match rule {
        "nearest_path" => "path_distance_m_min",
        "nearest_gap" => "gap_m",
        _ => return None,
    };
    moving(situation, feature).min_by(|a, b| a.1.total_cmp(&b.1)).map(|(ix, _)| ix)
}

/// Moving vehicles with a feature's value.
fn moving<'a>(situation: &'a Situation, feature: &'a str) -> impl Iterator<Item = (TrackIx, f64)> {
    let moving = eligible(situation).filter(|(_, f)| f.value("moved_m").is_some_and(|m| m >= MOVED_M_MIN));
    moving.filter_map(move |(ix, facts)| Some((ix, facts.value(feature)?)))
}

/// Marked vehicles, then moving ones by the nearness of their logs to the ego's rollout.
fn group(situation: &Situation, size: usize) -> Vec<TrackIx> {
    let mut near: Vec<(TrackIx, f64)> = moving(situation, "path_distance_m_min").collect();
    near.sort_by(|a, b| a.1.total_cmp(&b.1));
    let mut group: Vec<TrackIx> = Vec::with_capacity(size);
    for ix in situation.marked().chain(near.into_iter().map(|(ix, _)| ix)) {
        if group.len() < size && !group.contains(&ix) {
            group.push(ix);
        }
    }
    group
}

fn ranked(situation: &Situation, settings: &Settings) -> Result<Vec<TrackIx>, StageError> {
    let score = settings.module("score")?;
    let guard = settings.optional("guard");
    let allowed = eligible(situation).filter(|(_, f)| guard.is_none_or(|g| g.boolean(f.values.clone())));
    let mut rank: Vec<(TrackIx, f64)> = allowed.map(|(ix, f)| (ix, score.number(f.values.clone()))).collect();
    rank.sort_by(|a, b| b.1.total_cmp(&a.1));
    rank.truncate(settings.count("count")?);
    Ok(rank.into_iter().map(|(ix, _)| ix).collect())
}
