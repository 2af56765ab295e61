//! The filter slot: which candidates may not be used.

use crate::adapters::vocabulary;
use crate::motion::Candidate;
use crate::scene::TrackIx;
use crate::stage::judged::{Judged, Needs, features};
use crate::stage::{Part, Settings, Situation, StageError};

/// Removes what the filter refuses from every part.
pub fn apply(situation: &Situation, kind: &str, settings: &Settings, parts: &mut [Part]) -> Result<(), StageError> {
    let bounds: Vec<(usize, bool, f64)> = match kind {
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
    for part in parts {
        let judged =
            Judged { situation, actor: part.actor, from_step: part.window.from_step, adversaries: &adversaries };
        let passes = |candidate: &Candidate| match guard {
            Some(guard) => guard.of_candidate(candidate, &judged) != 0.0,
            None => {
                let values = features(candidate, &judged, needs);
                bounds.iter().all(
                    |(place, least, bound)| {
                        if *least { values[*place] >= *bound } else { values[*place] <= *bound }
                    },
                )
            }
        };
        part.candidates.retain(passes);
    }
    Ok(())
}

/// Place of a candidate feature and its upper bound.
fn at_most(feature: &str, bound: f64) -> Result<(usize, bool, f64), StageError> {
    let place = vocabulary::CANDIDATE.iter().position(|f| f.name == feature);
    place.map(|place| (place, false, bound)).ok_or_else(|| StageError::Missing(format!("feature {feature}")))
}
