//! CAT's collision posterior: log of P(OV) * sum_i P(AV_i) P(Coll | AV_i, OV), with checks every 0.5 s and a discount
//! that shrinks with the time of contact.

use crate::kernel::{OrientedBox, num};
use crate::motion::Candidate;
use crate::scene::{DT_S, TrackIx};
use crate::stage::situation::Situation;

/// Steps between two checks.
pub const CHECK_STEPS: usize = 5;
/// Log-score of a candidate without contact, less one per metre of nearest centre distance: below any contact, and
/// among themselves the nearest first, which is CAT's fallback when no candidate meets the ego.
pub const NO_CONTACT: f64 = -1000.0;

/// Scores every candidate; a rollout of the ego is also tried `shift_steps` earlier and later, with equal weights,
/// unless that is 0.
pub fn score(
    situation: &Situation,
    actor: TrackIx,
    from_step: usize,
    discount: f64,
    shift_steps: usize,
    candidates: &mut [Candidate],
) {
    let shifts: Vec<i64> = if shift_steps == 0 { vec![0] } else { vec![0, -(shift_steps as i64), shift_steps as i64] };
    let weight = 1.0 / shifts.len() as f64;
    for candidate in candidates {
        let (mut likelihood, mut nearest_m) = (0.0, f64::INFINITY);
        for shift in &shifts {
            let ego = |k: usize| {
                let step = (from_step + k) as i64 + shift;
                usize::try_from(step).ok().and_then(|step| situation.ego.body(step)).copied()
            };
            let own = |k: usize| situation.body(actor, &candidate.samples[k]);
            let met = contact(candidate.samples.len(), discount, own, ego);
            likelihood += weight * met.likelihood;
            nearest_m = f64::min(nearest_m, met.centre_distance_m_min);
        }
        candidate.score = if likelihood > 0.0 {
            candidate.prior_log_probability + num::ln(likelihood)
        } else {
            NO_CONTACT - nearest_m.min(500.0)
        };
    }
}

/// How one candidate and one ego rollout meet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Met {
    /// u^(k+1) at the first check k where the boxes overlap; 0 if they never do.
    pub likelihood: f64,
    /// Smallest distance between the two centres, metres.
    pub centre_distance_m_min: f64,
}

/// Walks the checks. Boxes come from functions of the sample index, `None` where the ego's rollout has ended.
pub fn contact(
    samples: usize,
    discount: f64,
    own: impl Fn(usize) -> OrientedBox,
    ego: impl Fn(usize) -> Option<OrientedBox>,
) -> Met {
    let mut met = Met { likelihood: 0.0, centre_distance_m_min: f64::INFINITY };
    let mut certainty = 1.0;
    for k in (0..samples).step_by(CHECK_STEPS) {
        certainty *= discount;
        let Some(ego) = ego(k) else { continue };
        let own = own(k);
        let distance = own.center.distance(ego.center);
        met.centre_distance_m_min = met.centre_distance_m_min.min(distance);
        if distance < own.radius() + ego.radius() && own.overlaps(&ego) {
            met.likelihood = certainty;
            break;
        }
    }
    met
}

/// A shift in seconds as whole steps.
pub fn shift_steps(shift_s: f64) -> usize {
    (shift_s / DT_S).round().clamp(0.0, 100.0) as usize
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernel::Vec2;

    fn car(x: f64) -> OrientedBox {
        OrientedBox::new(Vec2::new(x, 0.0), 0.0, 4.0, 2.0)
    }

    #[test]
    fn the_posterior_by_hand() {
        // Ego stands at 0; the other comes from 20 m at 5 m/s: gap 20 - 0.5 k, contact at |x| <= 4, k >= 32, check 35.
        let met = contact(80, 0.99, |k| car(20.0 - 0.5 * k as f64), |_| Some(car(0.0)));
        let by_hand: f64 = [0.99; 8].iter().product();
        assert!((met.likelihood - by_hand).abs() < 1e-15, "{met:?}");
        assert_eq!(met.centre_distance_m_min, 2.5);
    }

    #[test]
    fn no_contact_gives_zero_and_the_nearest_distance() {
        let met = contact(80, 0.99, |k| car(20.0 - 0.1 * k as f64), |_| Some(car(0.0)));
        assert_eq!(met.likelihood, 0.0);
        assert!((met.centre_distance_m_min - 12.5).abs() < 1e-12);
    }

    #[test]
    fn checks_after_the_egos_rollout_ended_do_not_count() {
        let met = contact(80, 0.99, |k| car(20.0 - 0.5 * k as f64), |k| (k < 10).then(|| car(0.0)));
        assert_eq!(met.likelihood, 0.0);
        assert!((met.centre_distance_m_min - 17.5).abs() < 1e-12);
    }
}
