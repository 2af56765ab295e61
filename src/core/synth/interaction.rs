//! Chooses the ego and the vehicle that interacts with it, as CAT selects its scenes.

use super::options::{Reject, SynthOptions};
use crate::kernel::{OrientedBox, num};
use crate::scene::{AgentKind, DT_S, Sample, Track};

/// Number of candidates for the ego that are tried.
const CANDIDATES: usize = 48;
/// Step between the samples that are compared.
const STRIDE: usize = 3;
/// Two paths use the same place if their centres come this close, metres.
const SAME_PLACE_M: f64 = 2.5;
/// Crossing or merging at the same time gap is worth this much more than following, seconds.
const CROSSING_BONUS_S: f64 = 2.5;

/// Indices into the tracks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Pair {
    pub ego: usize,
    pub other: usize,
    /// Seconds between the two at the same place, minus the bonus for a crossing.
    pub score_s: f64,
}

/// The pair with the closest interaction, with or without pairs that only follow each other.
pub(super) fn choose(tracks: &[Track], options: &SynthOptions, following: bool) -> Result<Pair, Reject> {
    let candidates: Vec<usize> = (0..tracks.len()).filter(|&i| may_be_ego(&tracks[i], options)).collect();
    if candidates.is_empty() {
        return Err(Reject::NoEgo);
    }
    // The candidates are spread over all road users, so that early and late arrivals have the same chance.
    let skip = candidates.len().div_ceil(CANDIDATES);
    let mut best: Option<Pair> = None;
    for &ego in candidates.iter().step_by(skip) {
        for other in 0..tracks.len() {
            if other == ego || !may_interact(&tracks[other], options) {
                continue;
            }
            if !following && !came_from_elsewhere(&tracks[ego], &tracks[other], options) {
                continue;
            }
            if let Some(score_s) = interaction(&tracks[ego], &tracks[other], options)
                && best.is_none_or(|b| score_s < b.score_s)
            {
                best = Some(Pair { ego, other, score_s });
            }
        }
    }
    best.ok_or(Reject::NoInteraction)
}

fn travel_m(track: &Track) -> f64 {
    let seen: Vec<&Sample> = track.samples.iter().flatten().collect();
    num::sum(seen.windows(2).map(|pair| pair[0].position.distance(pair[1].position)))
}

/// Returns `true` for a motor vehicle that is seen over the whole scene and moves.
fn may_be_ego(track: &Track, options: &SynthOptions) -> bool {
    track.kind == AgentKind::Vehicle
        && track.length_m < 7.0
        && track.samples.iter().all(Option::is_some)
        && travel_m(track) >= options.ego_travel_m_min
}

/// Returns `true` for a motor vehicle that is there now and for most of the future, and that moves.
fn may_interact(track: &Track, options: &SynthOptions) -> bool {
    let future = &track.samples[options.current_step..];
    let seen = future.iter().flatten().count();
    track.kind == AgentKind::Vehicle
        && future.first().is_some_and(Option::is_some)
        && 10 * seen >= 7 * future.len()
        && travel_m(track) >= 0.5 * options.ego_travel_m_min
}

/// Returns how closely two tracks interact after now; lower is closer, `None` not at all.
fn interaction(ego: &Track, other: &Track, options: &SynthOptions) -> Option<f64> {
    let future = |track: &Track| -> Vec<(usize, Sample)> {
        let seen = track.samples.iter().enumerate().skip(options.current_step).step_by(STRIDE);
        seen.filter_map(|(k, s)| Some((k, (*s)?))).collect()
    };
    let (mine, theirs) = (future(ego), future(other));
    let mut best: Option<f64> = None;
    for (i, a) in &mine {
        for (j, b) in &theirs {
            if (a.position - b.position).norm_squared() > SAME_PLACE_M * SAME_PLACE_M {
                continue;
            }
            let apart = i.abs_diff(*j) as f64 * DT_S;
            let turn = num::wrap_angle(a.heading_rad - b.heading_rad).abs();
            let opposite = turn > 2.9;
            if opposite || apart > options.interaction_time_s_max {
                continue;
            }
            let score = apart - if came_from_elsewhere(ego, other, options) { CROSSING_BONUS_S } else { 0.0 };
            best = Some(best.map_or(score, |s: f64| s.min(score)));
        }
    }
    best.filter(|_| gap_m_min(ego, other, options) <= options.interaction_gap_m_max)
}

/// Returns `true` if the two were on different ways at the start: not in one lane behind each other.
fn came_from_elsewhere(ego: &Track, other: &Track, options: &SynthOptions) -> bool {
    let (Some(a), Some(b)) = (ego.at(options.current_step), other.at(options.current_step)) else { return false };
    let ahead = crate::kernel::Pose { position: a.position, heading_rad: a.heading_rad }.to_local(b.position);
    num::wrap_angle(a.heading_rad - b.heading_rad).abs() > 0.35 || ahead.y.abs() > 2.0
}

/// Smallest distance of the boxes at the same time, metres, from now on.
pub(super) fn gap_m_min(ego: &Track, other: &Track, options: &SynthOptions) -> f64 {
    let shape = |t: &Track, s: &Sample| OrientedBox::new(s.position, s.heading_rad, t.length_m, t.width_m);
    (options.current_step..options.steps)
        .filter_map(|k| Some(shape(ego, ego.at(k)?).distance(&shape(other, other.at(k)?))))
        .fold(f64::INFINITY, f64::min)
}
