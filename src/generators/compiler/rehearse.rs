//! The choice that tries before it decides: the best candidates are rolled out against the ego, and what came of each decides.

use super::actions::actions;
use crate::adapters::vocabulary;
use crate::kernel::num;
use crate::motion::Candidate;
use crate::sim::{self, AdversaryReport, ContactClass, Feasibility, Intervention, Outcome};
use crate::stage::judged::Judged;
use crate::stage::{Part, Settings, Stage, StageError};

/// Distance that stands for "no adversary", metres.
const FAR_M: f64 = 200.0;

/// A choice and the number of rollouts that it took.
pub struct Rehearsed {
    /// The candidate of every part, by index.
    pub chosen: Vec<usize>,
    pub rollouts: usize,
}

/// Rolls the first `count` choices out, each with a candidate of every part, and takes the one of the largest value, the mean over
/// parts; of equals the earlier one. A choice that the simulator refuses is none, and where it refuses all the first one stays.
pub fn choose(
    stage: &Stage<'_>,
    settings: &Settings,
    parts: &[Part],
    choices: Vec<Vec<usize>>,
) -> Result<Rehearsed, StageError> {
    let (count, value) = (settings.count("count")?, settings.module("value")?);
    let situation = stage.situation;
    let adversaries: Vec<_> = parts.iter().map(|part| part.actor).collect();
    let mut best: Option<(f64, Vec<usize>)> = None;
    let (mut rollouts, mut first) = (0, None);
    for chosen in choices.into_iter().take(count.max(1)) {
        first.get_or_insert_with(|| chosen.clone());
        let intervention = Intervention { actions: actions(situation, parts, &chosen) };
        let mut driver = situation.policy.driver();
        let rolled = if value.needs.assessed { sim::rollout_assessed } else { sim::rollout };
        let Ok(outcome) = rolled(&situation.plant, &intervention, driver.as_mut()) else { continue };
        rollouts += 1;
        let came = features(&outcome, situation.ego_meets);
        let of = |(part, candidate): (&Part, &Candidate)| {
            let from_step = part.window.from_step;
            let judged = Judged { situation, actor: part.actor, from_step, adversaries: &adversaries };
            value.of_rehearsed(candidate, &judged, &came)
        };
        let candidates = parts.iter().zip(&chosen).map(|(part, place)| (part, &part.candidates[*place]));
        let worth = num::mean(&candidates.map(of).collect::<Vec<f64>>()).unwrap_or(0.0);
        if best.as_ref().is_none_or(|(most, _)| worth > *most) {
            best = Some((worth, chosen));
        }
    }
    Ok(Rehearsed { chosen: best.map(|(_, chosen)| chosen).or(first).unwrap_or_default(), rollouts })
}

/// Values of `vocabulary::REHEARSED` in its order.
fn features(outcome: &Outcome, meets_anyway: Option<sim::ActorRef>) -> Vec<f64> {
    let flag = |holds: bool| if holds { 1.0 } else { 0.0 };
    let contact = outcome.contact.filter(|contact| contact.adversary);
    let is = |class: ContactClass| flag(contact.is_some_and(|contact| contact.class == class));
    let most = |of: &dyn Fn(&Feasibility) -> f64| {
        let added = |report: &AdversaryReport| of(&report.simulated) - report.recorded.as_ref().map_or(0.0, of);
        outcome.adversaries.iter().map(added).fold(0.0, f64::max)
    };
    let struck = |of: &AdversaryReport| of.initial_overlap || of.struck_bystander || of.struck_parked;
    let values = vec![
        flag(contact.is_some()),
        flag(contact.and_then(|contact| contact.avoidable) == Some(true)),
        flag(contact.and_then(|contact| contact.preventable()) == Some(true)),
        is(ContactClass::RearEndEgoStruck),
        is(ContactClass::StationaryHit),
        flag(contact.is_some_and(|contact| meets_anyway == Some(contact.with))),
        flag(outcome.acted()),
        flag(outcome.adversaries.iter().any(struck)),
        contact.and_then(|contact| contact.visible_s).unwrap_or(0.0),
        contact.map_or(outcome.steps as f64 * crate::scene::DT_S, |contact| contact.time_s),
        contact.map_or(0.0, |contact| contact.relative_speed_mps),
        outcome.distance_m_min.filter(|_| !outcome.adversaries.is_empty()).unwrap_or(FAR_M),
        outcome.route_completion,
        outcome.adversaries.iter().filter_map(|report| report.route_completion).fold(1.0, f64::min),
        most(&|of| of.off_road_m),
        most(&|of| of.wrong_way_m),
        most(&|of| of.acceleration_mps2),
        most(&|of| of.jerk_mps3),
        most(&|of| of.slip_mps),
    ];
    debug_assert_eq!(values.len(), vocabulary::REHEARSED.len());
    values
}
