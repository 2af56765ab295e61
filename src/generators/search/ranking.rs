//! Which iterates of a gradient search become candidates, and what each is worth: first how its rollout ended, then the
//! family's own loss and how implausible its motions are beyond the record's.

use super::descent::{Iterate, Mover};
use crate::kernel::num;
use crate::motion::Candidate;
use crate::scene::TrackIx;
use crate::stage::judged::{Judged, Needs, feature, features};
use crate::stage::operator::{Module, Part};
use crate::stage::situation::Situation;

/// How an iterate's rollout ended, best first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Ending {
    /// The ego touched an adversary and could have avoided it.
    Met,
    /// It touched nobody, or was not simulated.
    Missed,
    /// It touched an adversary, and nothing that it could have done would have helped.
    Unsolvable,
}

/// Difference between the scores of two endings.
const TIER: f64 = 1000.0;
/// Losses are squeezed below this, so that no loss outweighs an ending.
const LOSS_MAX: f64 = 400.0;

/// The score of an iterate: endings in their order, smaller losses first.
pub fn score(ending: Ending, loss: f64) -> f64 {
    let squeezed = if loss.is_finite() { LOSS_MAX * loss / (LOSS_MAX + loss.abs()) } else { LOSS_MAX };
    -TIER * f64::from(ending as u8) - squeezed
}

/// Returns `true` if a score is one of [`Ending::Met`].
pub fn is_met(score: f64) -> bool {
    score > -0.5 * TIER
}

/// Indices of at most `most` iterates, in order: of those that meet the ego and of the others the one with the smallest
/// loss, the last, and an even selection; two thirds of the room for those that meet it. Iterates whose rollout is broken off
/// before the ego is met are left out.
pub fn selection(iterates: &[Iterate], most: usize) -> Vec<usize> {
    let meets = |k: &usize| iterates[*k].contact == Some(true);
    let usable = (0..iterates.len()).filter(|k| meets(k) || iterates[*k].broken_off.is_none());
    let (met, missed): (Vec<usize>, Vec<usize>) = usable.partition(meets);
    let share = if missed.is_empty() { most } else { most * 2 / 3 };
    let mut chosen = spread(iterates, &met, share);
    chosen.extend(spread(iterates, &missed, most - chosen.len()));
    chosen.sort_unstable();
    chosen
}

/// At most `most` of the given indices: the smallest loss, the smallest loss but for the attack, the last, and an even
/// selection.
fn spread(iterates: &[Iterate], among: &[usize], most: usize) -> Vec<usize> {
    let Some(last) = among.last() else { return vec![] };
    let least = |loss: &dyn Fn(&Iterate) -> f64| {
        among.iter().min_by(|a, b| loss(&iterates[**a]).total_cmp(&loss(&iterates[**b]))).copied()
    };
    let even = (0..most).map(|k| among[k * among.len() / most.max(1)]);
    let best = [least(&|i| i.terms.total()), least(&|i| i.terms.rest), Some(*last)];
    let mut chosen: Vec<usize> = Vec::with_capacity(most);
    for index in best.into_iter().flatten().chain(even) {
        if chosen.len() < most && !chosen.contains(&index) {
            chosen.push(index);
        }
    }
    chosen
}

/// Mean over the movers of an expression about a candidate.
pub fn judged(situation: &Situation, iterate: &Iterate, module: &Module, prior: impl Fn(&Mover) -> f64) -> f64 {
    let adversaries: Vec<TrackIx> = iterate.movers.iter().map(|m| m.actor).collect();
    let of = |mover: &Mover| {
        let judged = Judged { situation, actor: mover.actor, from_step: mover.from_step, adversaries: &adversaries };
        module.of_candidate(&Candidate::new(mover.samples(), prior(mover)), &judged)
    };
    num::sum(iterate.movers.iter().map(of)) / iterate.movers.len().max(1) as f64
}

/// Limits of the plausible: a candidate's feature, the value up to which anybody may go, and the excess that costs 1.
const EXCESSES: [(&str, f64, f64); 4] = [
    ("acceleration_mps2_max", 4.0, 2.0),
    ("lateral_acceleration_mps2_max", 4.0, 2.0),
    ("jerk_mps3_max", 10.0, 10.0),
    ("yaw_rate_radps_max", 0.8, 0.4),
];
/// The same for a corner's way off the road, metres.
const OFF_ROAD_M: (f64, f64) = (0.5, 0.5);
/// The road is looked at every this many samples.
const ROAD_STRIDE: usize = 3;
/// Cost of running into a bystander that the recorded motion does not touch.
const BYSTANDER: f64 = 2.0;

/// Measures of the records, with which iterates are compared.
#[derive(Clone, Debug)]
pub struct Plausibility<'a> {
    situation: &'a Situation,
    adversaries: Vec<TrackIx>,
    /// Every mover where it follows its record.
    records: Vec<Measured>,
}

/// Candidate features of a motion, and how far a corner leaves the road, metres.
type Measured = (Vec<f64>, f64);

impl<'a> Plausibility<'a> {
    /// `record` is the iterate that follows the records.
    pub fn beyond(situation: &'a Situation, record: &Iterate) -> Plausibility<'a> {
        let adversaries: Vec<TrackIx> = record.movers.iter().map(|m| m.actor).collect();
        let mut plausibility = Plausibility { situation, adversaries, records: vec![] };
        plausibility.records = record.movers.iter().map(|m| plausibility.measured(m, usize::MAX)).collect();
        plausibility
    }

    /// A mover's motion up to a scene step.
    fn measured(&self, mover: &Mover, end_step: usize) -> Measured {
        let (situation, actor, from_step) = (self.situation, mover.actor, mover.from_step);
        let judged = Judged { situation, actor, from_step, adversaries: &self.adversaries };
        let mut samples = mover.samples();
        samples.truncate(end_step.saturating_sub(from_step).max(1));
        let needs = Needs { kinematics: true, bystanders: true, ..Needs::default() };
        let bodies = mover.boxes.iter().skip(1).take(samples.len()).step_by(ROAD_STRIDE);
        let off_road_m = situation.road_field().map_or(0.0, |f| bodies.map(|b| f.departure_m(b)).fold(0.0, f64::max));
        (features(&Candidate::new(samples, 0.0), &judged, needs), off_road_m)
    }

    /// Mean over the movers of how far their motions, up to the rollout's end, go beyond what anybody may do and beyond
    /// what their records do, summed over `EXCESSES`, and a price for bystanders.
    pub fn lack_of(&self, iterate: &Iterate) -> f64 {
        let of = |(mover, (log, log_off_road_m)): (&Mover, &Measured)| {
            let (own, off_road_m) = self.measured(mover, iterate.end_step);
            let both = |name: &str| Some((feature(&own, name)?, feature(log, name)?));
            let beyond = |own: f64, log: f64, bound: f64, scale: f64| (own - log.max(bound)).max(0.0) / scale;
            let excess = |(name, bound, scale): &(&str, f64, f64)| {
                both(name).map_or(0.0, |(own, log)| beyond(own, log, *bound, *scale))
            };
            let departs = beyond(off_road_m, *log_off_road_m, OFF_ROAD_M.0, OFF_ROAD_M.1);
            let struck = both("bystander_gap_m_min").is_some_and(|(own, log)| own == 0.0 && log > 0.0);
            departs + num::sum(EXCESSES.iter().map(excess)) + if struck { BYSTANDER } else { 0.0 }
        };
        num::sum(iterate.movers.iter().zip(&self.records).map(of)) / iterate.movers.len().max(1) as f64
    }
}

/// Puts iterates into the parts as candidates that belong together: `chosen` are their indices and scores, `prior`
/// gives the log-probability of a motion.
pub fn into_candidates(
    parts: &mut [Part],
    iterates: &[Iterate],
    chosen: &[(usize, f64)],
    prior: impl Fn(&Mover) -> f64,
) {
    let with_space = parts.iter_mut().filter(|p| p.driven.is_some());
    for (which, part) in with_space.enumerate() {
        let candidate = |(index, score): &(usize, f64)| {
            let mover = &iterates[*index].movers[which];
            let candidate = Candidate::new(mover.samples(), prior(mover));
            Candidate { score: *score, iterate: Some(*index), ..candidate }
        };
        part.candidates = chosen.iter().map(candidate).collect();
    }
}

#[cfg(test)]
mod tests {
    use super::super::descent::Terms;
    use super::*;

    fn iterate(attack: f64, rest: f64, contact: bool) -> Iterate {
        let terms = Terms { attack, rest };
        Iterate { movers: vec![], terms, contact: Some(contact), broken_off: None, end_step: 90 }
    }

    #[test]
    fn no_loss_outweighs_an_ending() {
        let endings = [Ending::Met, Ending::Missed, Ending::Unsolvable];
        for pair in endings.windows(2) {
            assert!(score(pair[0], f64::INFINITY) > score(pair[1], -1e9), "{pair:?}");
        }
        assert!(score(Ending::Met, 1.0) > score(Ending::Met, 2.0));
        assert!(is_met(score(Ending::Met, 1e9)) && !is_met(score(Ending::Missed, -1e9)));
    }

    #[test]
    fn the_selection_holds_the_best_that_meet_the_ego_and_some_that_do_not() {
        let mut iterates: Vec<Iterate> = (0..30).map(|k| iterate(30.0 - f64::from(k), 1.0, false)).collect();
        iterates.extend((0..20).map(|k| iterate(0.1 * f64::from(20 - k), 0.1 * f64::from((k - 7) * (k - 7)), true)));
        let chosen = selection(&iterates, 9);
        assert_eq!(chosen.len(), 9);
        assert_eq!(chosen.iter().filter(|k| **k >= 30).count(), 6);
        // The last of each kind, and the one that is most plausible among those that meet the ego.
        assert!([29, 37, 49].iter().all(|k| chosen.contains(k)), "{chosen:?}");
        iterates[29].broken_off = Some(40);
        assert!(!selection(&iterates, 9).contains(&29), "{chosen:?}");
        assert_eq!(selection(&iterates[..30], 3).len(), 3);
        assert!(selection(&[], 3).is_empty());
    }
}
