//! The filter slot: which candidates may not be used.
//!
//! A filter that refuses every candidate of a scene hands back the one that violates it least, and says by how much: a
//! program may not become one that does nothing by asking for what cannot be had. The way to leave a scene alone is the
//! program's policy over its scene gate.

use crate::adapters::vocabulary;
use crate::motion::Candidate;
use crate::scene::TrackIx;
use crate::stage::judged::{Judged, Needs, features};
use crate::stage::{Part, Settings, Situation, StageError};

/// A bound on a candidate feature: its place in the vocabulary, whether it is a lower one, its value.
type Bound = (usize, bool, f64);

/// Removes what the filter refuses from every part. If nothing is left in any of them, one candidate is: that of the
/// least violation, which is returned (the excess over the filter's bounds, each as a share of the bound or, below 1, of
/// one unit; 1 for a guard, which knows no degrees). Of equals it is the one of the higher score, then the earlier one.
pub fn apply(
    situation: &Situation,
    kind: &str,
    settings: &Settings,
    parts: &mut [Part],
) -> Result<Option<f64>, StageError> {
    let bounds: Vec<Bound> = match kind {
        "guard_filter" => vec![],
        "dynamics_filter" => vec![
            at_most("acceleration_mps2_max", settings.number("acceleration_mps2_max")?)?,
            at_most("lateral_acceleration_mps2_max", settings.number("lateral_acceleration_mps2_max")?)?,
            at_most("jerk_mps3_max", settings.number("jerk_mps3_max")?)?,
        ],
        "road_filter" => vec![at_most("off_road_m_max", settings.number("off_road_m_max")?)?],
        "bystander_filter" => {
            let (place, _, bound) = at_most("bystander_gap_m_min", settings.number("gap_m_min")?)?;
            vec![(place, true, bound)]
        }
        other => return Err(StageError::Missing(format!("operator {other}"))),
    };
    let guard = if kind == "guard_filter" { Some(settings.module("guard")?) } else { None };
    let needs = Needs::of(bounds.iter().map(|(place, _, _)| vocabulary::CANDIDATE[*place].name));
    let adversaries: Vec<TrackIx> = parts.iter().map(|part| part.actor).collect();
    let mut least: Option<(f64, usize, Candidate)> = None;
    for (at, part) in parts.iter_mut().enumerate() {
        let judged =
            Judged { situation, actor: part.actor, from_step: part.window.from_step, adversaries: &adversaries };
        let violation = |candidate: &Candidate| match guard {
            Some(guard) if guard.of_candidate(candidate, &judged) != 0.0 => 0.0,
            Some(_) => 1.0,
            None => violation(&features(candidate, &judged, needs), &bounds),
        };
        part.candidates.retain(|candidate| {
            let by = violation(candidate);
            // A value that is no number passes no bound.
            let nearer =
                |(best, _, kept): &(f64, usize, Candidate)| by < *best || (by == *best && candidate.score > kept.score);
            if by > 0.0 && least.as_ref().is_none_or(nearer) {
                least = Some((by, at, candidate.clone()));
            }
            by == 0.0
        });
    }
    match least {
        Some((by, at, candidate)) if parts.iter().all(|part| part.candidates.is_empty()) => {
            parts[at].candidates.push(candidate);
            Ok(Some(by))
        }
        _ => Ok(None),
    }
}

/// How far the values lie beyond the bounds; 0 where they keep them, finite.
fn violation(values: &[f64], bounds: &[Bound]) -> f64 {
    let beyond = |(place, lower, bound): &Bound| {
        let excess = if *lower { bound - values[*place] } else { values[*place] - bound };
        // A value that is not a finite number is worse than all finite ones.
        if excess <= 0.0 { 0.0 } else { (excess / bound.abs().max(1.0)).min(f64::MAX / 8.0) }
    };
    bounds.iter().map(beyond).fold(0.0, |sum, by| sum + by)
}

/// Place of a candidate feature and its upper bound.
fn at_most(feature: &str, bound: f64) -> Result<Bound, StageError> {
    let place = vocabulary::CANDIDATE.iter().position(|f| f.name == feature);
    place.map(|place| (place, false, bound)).ok_or_else(|| StageError::Missing(format!("feature {feature}")))
}
