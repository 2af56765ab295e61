//! ADV-BMT (Liu et al. 2026): a new road user is inserted whose motion is grown backward in time from an imposed
//! collision with the ego, token by token, and rejected where it hardly moves, turns too sharply or leaves the road.
//!
//! The bidirectional transformer is replaced by a closed-form preference over its own token vocabulary (`reverse`):
//! gentle controls that change little from token to token, near a lane and along it, on the road, near half the speed
//! limit, never through another road user. Imposed headings are those of the lanes at the place of the collision, as the
//! authors' notes ask for in the place of any heading. Everyone else is replayed, as under teacher forcing. The collision is imposed on the ego's rollout in the recorded scene.

pub mod contract;
pub mod reverse;
mod words;

pub use contract::family;
pub use words::{INSERTED_ACTOR, NAME, REJECTION, REVERSE_TOKENS};

use self::reverse::{Imposed, Preference, Reverse};
use crate::kernel::{Stream, Vec2, num};
use crate::motion::Candidate;
use crate::motion::Window;
use crate::motion::token_grid::Nucleus;
use crate::scene::{AgentKind, DT_S, Sample, TrackIx};
use crate::stage::judged::Judged;
use crate::stage::{Part, Settings, Situation, Source, Stage, StageError};

/// Shortest way to the collision that is used, steps.
const STEPS_MIN: usize = 10;
/// Directions in which lanes are looked for, against the lane along which the ego drives.
const HEADINGS_RAD: [f64; 4] = [0.0, num::FRAC_PI_2, -num::FRAC_PI_2, num::PI];
/// Within this distance of the collision a lane's heading may be imposed, metres.
const LANE_NEAR_M: f64 = 6.0;
/// Score of a sample that the method rejects, less its distance from the last one.
const REJECTED: f64 = -1000.0;
/// Score of a sample that the method would take but that leaves the road, less the metres.
const OFF_ROAD: f64 = -500.0;

const SEARCH_IN_WORDS: &str = "Nothing is optimised: 8 motions (`sample_count`) of one inserted body are grown backward from a \
     collision imposed on the ego's undisturbed path at the window's end, and scored as drawn: 0, -1, .. -7; \
     below -500 off the road, about -1000 for one that hardly moves or spins. `sample_score` is added (one \
     unit is one place) or replaces the order of those not rejected. A `reshape` before the search is judged, \
     but moves the body off the imposed meeting; no laws act; actor features and `log_way_share` are \
     constants. Example: `-jerk_mps3_max / 2`: one 2 m/s^3 smoother overtakes one drawn a place before.";

/// The family as it is registered: what it declares, and the code that carries it out.
pub fn source() -> Source {
    Source::new(family(), SEARCH_IN_WORDS)
        .actor(INSERTED_ACTOR, actor)
        .operator(REVERSE_TOKENS, motion)
        .operator(REJECTION, search)
}

/// The inserted road user.
pub fn actor(stage: &Stage<'_>, settings: &Settings) -> Result<Vec<TrackIx>, StageError> {
    let kind = match settings.word("shape")? {
        "cyclist" => AgentKind::Cyclist,
        "pedestrian" => AgentKind::Pedestrian,
        _ => AgentKind::Vehicle,
    };
    Ok(vec![stage.situation.guest(kind)])
}

/// Backward rollouts from the imposed collision to the window's first step, in the order in which they were drawn.
pub fn motion(stage: &Stage<'_>, settings: &Settings, parts: &mut [Part]) -> Result<(), StageError> {
    let count = settings.count("sample_count")?;
    let nucleus =
        Nucleus { share: settings.number("nucleus_share")?, temperature: settings.number("token_temperature")? };
    let preference = Preference {
        acceleration_scale_mps2: settings.number("token_acceleration_scale_mps2")?,
        yaw_scale_radps: settings.number("token_yaw_scale_radps")?,
        lane_scale_m: settings.number("token_lane_scale_m")?,
        heading_scale_rad: settings.number("token_heading_scale_rad")?,
        speed_scale_mps: settings.number("token_speed_scale_mps")?,
        road_scale_m: settings.number("token_road_scale_m")?,
        acceleration_change_mps2: settings.number("token_acceleration_change_mps2")?,
        yaw_change_radps: settings.number("token_yaw_change_radps")?,
    };
    let linger = (settings.number("linger_s")? / DT_S).round() as usize;
    let drawn = settings.word("meeting")? == "drawn";
    for part in parts {
        let mut stream = stage.stream("reverse", part.actor);
        let reverse = Reverse::new(stage.situation, part.actor, preference, nucleus);
        // Which of the lanes' headings comes first is chance, for the first sample that is not rejected is used.
        let first = stream.below(HEADINGS_RAD.len());
        let aligned = settings.word("headings")? == "lane_aligned";
        for index in 0..2 * count {
            // Where traffic blocks every way back along a lane, headings are drawn, as in the method.
            let drawn_heading = !aligned || index >= count;
            if index >= count && !(aligned && part.candidates.is_empty()) {
                break;
            }
            let Some(step) = meeting_step(stage.situation, part.window, drawn, &mut stream) else { continue };
            let lane = (!drawn_heading).then_some(first + index);
            let Some(imposed) = impose(stage.situation, step, lane, settings, &mut stream)? else { continue };
            let Some((mut samples, log_p)) = reverse.grow(&imposed, part.window.from_step, &mut stream) else {
                continue;
            };
            let room = part.window.steps - samples.len();
            samples.extend((1..=linger.min(room)).map(|k| coasting(&imposed.state.sample(), k)));
            part.candidates.push(Candidate::new(samples, log_p));
        }
    }
    Ok(())
}

/// k_c: the last step of window and ego rollout, or a multiple of half a second drawn before it.
fn meeting_step(situation: &Situation, window: Window, drawn: bool, stream: &mut Stream) -> Option<usize> {
    let last = situation.ego.steps().end.min(window.from_step + window.steps).checked_sub(1)?;
    let room = last.checked_sub(window.from_step).filter(|room| *room >= STEPS_MIN)?;
    if !drawn {
        return Some(last);
    }
    let choices = (room - STEPS_MIN) / 5 + 1;
    Some(window.from_step + STEPS_MIN + 5 * stream.below(choices))
}

/// The state in which the inserted road user meets the ego: where the ego is, slower, headed as one of the lanes there
/// (`lane`, counted in turn) or as drawn.
fn impose(
    situation: &Situation,
    step: usize,
    lane: Option<usize>,
    settings: &Settings,
    stream: &mut Stream,
) -> Result<Option<Imposed>, StageError> {
    let Some(ego) = situation.ego.at(step) else { return Ok(None) };
    let forward = Vec2::from_heading(ego.heading_rad);
    let offset = forward * settings.number("impact_forward_m")? + forward.left() * settings.number("impact_left_m")?;
    let turn = stream.normal(0.0, settings.number("heading_spread_rad")?);
    let along = situation.lanes.nearest_lane(ego.position, ego.heading_rad, LANE_NEAR_M);
    let along_lane = along.map_or(ego.heading_rad, |lane| lane.heading_rad);
    let heading_rad = match lane {
        Some(index) => lane_heading(situation, ego.position, along_lane, index),
        None => along_lane + turn,
    };
    let spread = stream.normal(0.0, settings.number("impact_speed_spread_mps")?);
    let speed_mps = (settings.number("impact_speed_share")? * ego.speed_mps() + spread).max(0.0);
    Ok(Some(Imposed::new(ego.position + offset, num::wrap_angle(heading_rad), speed_mps, step)))
}

/// The heading of one of the lanes at a place, in turn; the given one where there is no lane.
fn lane_heading(situation: &Situation, place: Vec2, along_lane: f64, index: usize) -> f64 {
    let lanes = HEADINGS_RAD.iter().filter_map(|turn| {
        let heading_rad = num::wrap_angle(along_lane + turn);
        situation.lanes.nearest_lane(place, heading_rad, LANE_NEAR_M).map(|lane| lane.heading_rad)
    });
    let lanes_near: Vec<f64> = lanes.collect();
    if lanes_near.is_empty() { along_lane } else { lanes_near[index % lanes_near.len()] }
}

fn coasting(last: &Sample, steps: usize) -> Sample {
    Sample { position: last.position + last.velocity * (steps as f64 * DT_S), ..*last }
}

/// The first sample that is not rejected scores highest; where all are, the one that leaves the road least, and where the
/// method itself rejects all, the last one, as in the method.
pub fn search(stage: &Stage<'_>, settings: &Settings, parts: &mut [Part]) -> Result<(), StageError> {
    let mean_speed_mps_min = settings.number("mean_speed_mps_min")?;
    let curvature_1pm_max = settings.number("curvature_1pm_max")?;
    let road_departure_m_max = settings.number("road_departure_m_max")?;
    let replaces = settings.word("combine")? == "replace";
    let adversaries: Vec<usize> = parts.iter().map(|part| part.actor).collect();
    for part in parts {
        let from_step = part.window.from_step;
        let judged = Judged { situation: stage.situation, actor: part.actor, from_step, adversaries: &adversaries };
        for (index, candidate) in part.candidates.iter_mut().enumerate() {
            let plausible = displacement_mps(&candidate.samples) >= mean_speed_mps_min
                && curvature_1pm(&candidate.samples) < curvature_1pm_max
                && !starts_in_the_ego(&judged, &candidate.samples);
            let departure_m = road_departure_m(&judged, &candidate.samples);
            let order = match (plausible, departure_m <= road_departure_m_max) {
                (true, true) => -(index as f64),
                (true, false) => OFF_ROAD - departure_m.min(100.0),
                (false, _) => REJECTED + index as f64,
            };
            let plausible = plausible && order > OFF_ROAD;
            let own = settings.optional("score").map(|module| module.of_candidate(candidate, &judged));
            candidate.score = match own {
                None => order,
                // An own score ranks what is plausible; the rest stays below.
                Some(own) if plausible => own + if replaces { 0.0 } else { order },
                Some(own) => own + order,
            };
        }
    }
    Ok(())
}

/// Net displacement over time, m/s: the method asks for 1 (k_c / 10 metres at 10 Hz).
fn displacement_mps(samples: &[Sample]) -> f64 {
    let (Some(first), Some(last)) = (samples.first(), samples.last()) else { return 0.0 };
    first.position.distance(last.position) / (samples.len() as f64 * DT_S)
}

/// Largest |Δθ| / (|Δs| + 1e-6), 1/m.
fn curvature_1pm(samples: &[Sample]) -> f64 {
    let bend = |pair: &[Sample]| {
        let turn = num::wrap_angle(pair[1].heading_rad - pair[0].heading_rad).abs();
        turn / (pair[0].position.distance(pair[1].position) + 1e-6)
    };
    samples.windows(2).map(bend).fold(0.0, f64::max)
}

/// How far a corner leaves the road, metres, looked at every third step.
fn road_departure_m(judged: &Judged<'_>, samples: &[Sample]) -> f64 {
    let Some(field) = judged.situation.road_field() else { return 0.0 };
    let bodies = samples.iter().step_by(3).map(|sample| judged.situation.body(judged.actor, sample));
    bodies.map(|body| field.departure_m(&body)).fold(0.0, f64::max)
}

fn starts_in_the_ego(judged: &Judged<'_>, samples: &[Sample]) -> bool {
    let ego = judged.situation.ego.body(judged.from_step);
    samples.first().zip(ego).is_some_and(|(first, ego)| judged.situation.body(judged.actor, first).overlaps(ego))
}

#[cfg(test)]
mod tests;
