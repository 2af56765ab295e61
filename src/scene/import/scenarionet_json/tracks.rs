//! Road users: state arrays to samples, and the path that the ego drove.

use super::keys::{Column, TrackIn};
use super::point;
use crate::kernel::{Vec2, num};
use crate::scene::validate::{SIDE_MAX_M, SIDE_MIN_M};
use crate::scene::{AgentKind, DT_S, Sample, Track};

/// Points of a driven path nearer than this are one, metres.
const SAME_PLACE_M: f64 = 0.05;

pub(super) fn track(id: &str, given: &TrackIn, steps: usize) -> Result<Track, String> {
    let state = &given.state;
    let whole = state.position.len() == steps
        && state.heading.len() == steps
        && state.velocity.as_ref().is_none_or(|v| v.len() == steps)
        && state.valid.as_ref().is_none_or(|v| v.len() == steps);
    if !whole {
        return Err(format!("its state has other than {steps} entries"));
    }
    let seen = |step: usize| match &state.valid {
        None => true,
        Some(valid) => valid[step].number().is_some_and(|v| v != 0.0),
    };
    let place = |step: usize| point(&state.position[step]);
    let sample = |step: usize| {
        let velocity = match &state.velocity {
            Some(given) => point(&given[step])?,
            None => {
                let (from, to) = (step.saturating_sub(1), (step + 1).min(steps - 1));
                (place(to)? - place(from)?) * (1.0 / ((to - from) as f64 * DT_S))
            }
        };
        let heading_rad = state.heading[step].number().filter(|h| h.is_finite())?;
        Some(Sample { position: place(step)?, heading_rad: num::wrap_angle(heading_rad), velocity })
    };
    let kind = match given.r#type.as_str() {
        "VEHICLE" => AgentKind::Vehicle,
        "PEDESTRIAN" => AgentKind::Pedestrian,
        "CYCLIST" => AgentKind::Cyclist,
        _ => AgentKind::Static,
    };
    let usual = match kind {
        AgentKind::Vehicle => (4.5, 1.9),
        AgentKind::Cyclist => (1.8, 0.7),
        AgentKind::Pedestrian | AgentKind::Static => (0.6, 0.6),
    };
    let side = |column: &Option<Column>, usual: f64| match column {
        None => Some(usual),
        Some(Column::One(one)) => Some(*one),
        Some(Column::Many(cells)) => {
            let while_seen = cells.iter().take(steps).enumerate().filter(|(step, _)| seen(*step));
            let values: Vec<f64> = while_seen.filter_map(|(_, cell)| cell.number()).collect();
            num::quantile(&values, 0.5)
        }
    };
    let (length_m, width_m) = (side(&state.length, usual.0), side(&state.width, usual.1));
    let sound = |side: &f64| (SIDE_MIN_M..=SIDE_MAX_M).contains(side);
    let (Some(length_m), Some(width_m)) = (length_m.filter(sound), width_m.filter(sound)) else {
        return Err("its box has no sides of 0.05 to 60 m".into());
    };
    let samples = (0..steps).map(|step| if seen(step) { sample(step) } else { None }).collect();
    Ok(Track { id: id.into(), kind, length_m, width_m, samples })
}

/// The path that the ego drove from its start on; straight ahead where it stood.
pub(super) fn driven(ego: &Track, start: usize) -> Vec<Vec2> {
    let mut route: Vec<Vec2> = Vec::new();
    for sample in ego.samples.iter().skip(start).flatten() {
        if route.last().is_none_or(|last| last.distance(sample.position) > SAME_PLACE_M) {
            route.push(sample.position);
        }
    }
    if let (1, Some(sample)) = (route.len(), ego.at(start)) {
        route.push(sample.position + Vec2::from_heading(sample.heading_rad) * 10.0);
    }
    route
}
