//! STRIVE's adversarial loss: a soft choice of attackers by nearness, their squared distances, likelihood and way from
//! the record by how little each attacks, and soft contact of everyone with everyone else and with the road's edge.

use crate::kernel::{OrientedBox, num};
use crate::motion::kinematics::Slope;
use crate::motion::separation::{disc_overlap, on_body};
use crate::search::descent::{Asked, Mover, Objective, Slopes, Terms, covered};
use crate::stage::road_field::RoadField;
use crate::stage::{Bystanders, EgoPath};

/// Distances are looked at every half second, as in STRIVE.
const CRASH_STRIDE: usize = 5;
/// Contacts are looked at every this many samples.
const CONTACT_STRIDE: usize = 2;

/// The loss of one scene.
#[derive(Clone, Debug)]
pub struct Loss<'a> {
    /// One a mover, above 0.
    pub attacker_weights: Vec<f64>,
    /// Every mover's latent of its record.
    pub records: Vec<Vec<f64>>,
    /// No crash is sought before this scene step.
    pub from_step: usize,
    pub crash_weight: f64,
    /// Weights for the attacker and for the others.
    pub prior_weights: (f64, f64),
    pub record_weights: (f64, f64),
    pub contact_weight: f64,
    pub road_weight: f64,
    /// `None`: nothing is off the road.
    pub field: Option<&'a RoadField>,
    pub others: &'a Bystanders,
}

/// The soft choice: share of every mover at every half second; all shares together are 1, or 0 if nobody can attack.
pub type Shares = Vec<Vec<(usize, f64)>>;

impl Objective for Loss<'_> {
    /// The soft choice is taken as given. While the ego is being met the crash has no slopes: what is left moves the
    /// adversaries to the most likely motion that still meets it.
    fn loss(&self, asked: &Asked<'_>, slopes: &mut Slopes) -> Terms {
        self.with_shares(asked, &self.shares(asked.movers, asked.ego), slopes)
    }
}

impl Loss<'_> {
    /// Softmin of the distances to the ego over movers and times; who stays behind the ego all the time has no share.
    pub fn shares(&self, movers: &[Mover], ego: &EgoPath) -> Shares {
        let steps: Vec<usize> =
            covered(movers).step_by(CRASH_STRIDE).filter(|s| *s >= self.from_step && ego.at(*s).is_some()).collect();
        let of_mover = |(mover, weight): (&Mover, &f64)| {
            let mut ahead = false;
            let mut shares = Vec::with_capacity(steps.len());
            for step in &steps {
                let (Some(index), Some(body)) = (mover.index(*step), ego.body(*step)) else { continue };
                let delta = mover.states()[index].position - body.center;
                ahead = ahead || delta.dot(body.axis) >= 0.0;
                shares.push((*step, weight * num::exp(-delta.norm())));
            }
            if ahead { shares } else { vec![] }
        };
        let mut shares: Shares = movers.iter().zip(&self.attacker_weights).map(of_mover).collect();
        let total = num::sum(shares.iter().flatten().map(|(_, w)| *w));
        if total > 0.0 {
            shares.iter_mut().flatten().for_each(|(_, w)| *w /= total);
        }
        shares
    }

    /// The value for a given soft choice; its slopes are added to `slopes`.
    pub fn with_shares(&self, asked: &Asked<'_>, shares: &Shares, slopes: &mut Slopes) -> Terms {
        let (movers, ego) = (asked.movers, asked.ego);
        let passive: Vec<f64> =
            shares.iter().map(|of| (1.0 - num::sum(of.iter().map(|(_, w)| *w))).clamp(0.0, 1.0)).collect();
        Terms {
            attack: self.crash(asked, shares, slopes),
            rest: self.likelihood(movers, &passive, slopes)
                + self.contact(movers, ego, &passive, slopes)
                + self.departure(movers, slopes),
        }
    }

    fn crash(&self, asked: &Asked<'_>, shares: &Shares, slopes: &mut Slopes) -> f64 {
        let (movers, ego) = (asked.movers, asked.ego);
        let mut value = 0.0;
        for (which, (mover, shares)) in movers.iter().zip(shares).enumerate() {
            for (step, share) in shares {
                let (Some(index), Some(body)) = (mover.index(*step), ego.body(*step)) else { continue };
                let delta = mover.states()[index].position - body.center;
                let weight = self.crash_weight * share;
                value += weight * delta.norm_squared();
                let pull = delta * (2.0 * weight);
                if asked.attacks {
                    slopes.states[which][index].add(1.0, &Slope { position: pull, ..Slope::default() });
                }
            }
        }
        value
    }

    /// Minus the log-likelihood, and the way from the record, each weighted by how much the mover attacks.
    fn likelihood(&self, movers: &[Mover], passive: &[f64], slopes: &mut Slopes) -> f64 {
        let between = |(attacks, stands): (f64, f64), passive: f64| passive * stands + (1.0 - passive) * attacks;
        let mut value = 0.0;
        for (which, mover) in movers.iter().enumerate() {
            let prior = between(self.prior_weights, passive[which]) / movers.len() as f64;
            let record = between(self.record_weights, passive[which]);
            for (k, z) in mover.place.iter().enumerate() {
                let away = z - self.records[which][k];
                value += 0.5 * prior * z * z + record * away * away;
                slopes.places[which][k] += prior * z + 2.0 * record * away;
            }
        }
        value
    }

    /// Mean over time of the soft contact between movers, with the others, and with the ego of who does not attack.
    fn contact(&self, movers: &[Mover], ego: &EgoPath, passive: &[f64], slopes: &mut Slopes) -> f64 {
        let steps: Vec<usize> = covered(movers).step_by(CONTACT_STRIDE).collect();
        let weight = self.contact_weight / steps.len().max(1) as f64;
        let mut value = 0.0;
        for step in steps {
            for (i, mover) in movers.iter().enumerate() {
                let Some(k) = mover.index(step) else { continue };
                let body = &mover.boxes[k];
                for (j, other) in movers.iter().enumerate().skip(i + 1) {
                    let Some(l) = other.index(step) else { continue };
                    if let Some((overlap, own, theirs)) = disc_overlap(body, &other.boxes[l], 0.0) {
                        value += weight * overlap;
                        slopes.states[i][k].add(weight, &own);
                        slopes.states[j][l].add(weight, &theirs);
                    }
                }
                let egos = ego.body(step).map(|e| (weight * passive[i], e));
                let fixed = self.others.at(step).iter().map(|(_, other)| (weight, other)).chain(egos);
                for (weight, other) in fixed {
                    if let Some((overlap, own, _)) = disc_overlap(body, other, 0.0) {
                        value += weight * overlap;
                        slopes.states[i][k].add(weight, &own);
                    }
                }
            }
        }
        value
    }

    fn departure(&self, movers: &[Mover], slopes: &mut Slopes) -> f64 {
        let Some(field) = self.field else { return 0.0 };
        let mut value = 0.0;
        for (mover, slopes) in movers.iter().zip(&mut slopes.states) {
            let weight = self.road_weight * CONTACT_STRIDE as f64 / mover.states().len() as f64;
            let places = mover.boxes.iter().zip(slopes).skip(1).step_by(CONTACT_STRIDE);
            for (body, slope) in places {
                value += beside_road(field, body, weight, slope);
            }
        }
        value
    }
}

/// Weighted depth of a box's corners beside the road, in half diagonals; its slope is added.
pub fn beside_road(field: &RoadField, body: &OrientedBox, weight: f64, slope: &mut Slope) -> f64 {
    let room = field.distance_m(body.center);
    let radius = body.radius();
    // A raster cell of slack: the field is right to half a diagonal of a cell.
    if room > radius + 1.0 {
        return 0.0;
    }
    let share = weight / radius;
    let mut value = 0.0;
    for corner in body.corners() {
        let distance = field.distance_m(corner);
        if distance < 0.0 {
            let (_, pull) = field.at(corner);
            value -= share * distance;
            slope.add(-share, &on_body(pull, corner - body.center));
        }
    }
    value
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ego::Policy;
    use crate::kernel::Vec2;
    use crate::motion::Driven;
    use crate::motion::Window;
    use crate::motion::following;
    use crate::motion::latent::{LatentOptions, LatentSpace};
    use crate::scene::fixture::{straight, two_lane_scene};
    use crate::search::descent::{open, slope_error};
    use crate::stage::{Part, Situation};
    use std::sync::Arc;

    /// The fixture's two cars, a third that nobody moves, and a fourth behind the ego.
    fn situation() -> Situation {
        let mut scene = two_lane_scene();
        let mut bystander = scene.tracks[0].clone();
        bystander.samples = straight(60, Vec2::new(33.0, 5.0), 0.0, 8.2);
        let mut behind = scene.tracks[0].clone();
        behind.samples = straight(60, Vec2::new(-40.0, 0.0), 0.0, 8.0);
        scene.tracks.extend([bystander, behind]);
        Situation::new(Arc::new(scene), &Policy::Idm).unwrap()
    }

    fn parts(situation: &Situation, actors: &[usize]) -> Vec<Part> {
        let options = LatentOptions { modes: 3, acceleration_spread_mps2: 1.05, curvature_spread_1pm: 0.005 };
        let part = |actor: &usize| {
            let window = Window { from_step: 1, steps: 40 };
            let mut part =
                Part { actor: *actor, window, candidates: vec![], offsets: None, driven: None, simulated: 0 };
            let (start, samples) = following::record(&situation.scene.tracks[*actor], window).unwrap();
            let space: Arc<dyn Driven> = Arc::new(LatentSpace::new(start, &samples, &[], &options));
            open(&mut part, situation, Some(space));
            part
        };
        actors.iter().map(part).collect()
    }

    fn bystanders(situation: &Situation, parts: &[Part]) -> Bystanders {
        let adversaries: Vec<usize> = parts.iter().map(|part| part.actor).collect();
        Bystanders::of(situation, &adversaries, 1..41)
    }

    fn loss<'a>(situation: &'a Situation, parts: &[Part], others: &'a Bystanders) -> Loss<'a> {
        Loss {
            attacker_weights: vec![1.0; parts.len()],
            records: parts.iter().filter_map(|p| p.driven.as_ref()).map(|d| d.start().to_vec()).collect(),
            from_step: 6,
            crash_weight: 2.0,
            prior_weights: (0.005, 1.0),
            record_weights: (0.05, 0.5),
            contact_weight: 20.0,
            road_weight: 20.0,
            field: situation.road_field(),
            others,
        }
    }

    #[test]
    fn the_losss_slope_matches_finite_differences_for_a_given_choice_of_attackers() {
        let situation = situation();
        let parts = parts(&situation, &[0, 1]);
        let others = bystanders(&situation, &parts);
        let loss = loss(&situation, &parts, &others);
        let shares: Shares = vec![vec![(11, 0.3), (21, 0.2)], vec![(16, 0.4), (26, 0.1)]];
        for scale in [0.1, 0.5] {
            let shift = |k: usize| scale * ((k % 5) as f64 - 2.2);
            let error = slope_error(&situation, &parts, shift, |movers, slopes| {
                let asked = Asked { movers, ego: &situation.ego, until: usize::MAX, attacks: true, is_eligible: true };
                loss.with_shares(&asked, &shares, slopes).total()
            });
            assert!(error < 1e-5, "{scale}: {error}");
        }
    }

    #[test]
    fn the_soft_choice_falls_on_who_is_near_and_never_on_who_stays_behind() {
        let situation = situation();
        let parts = parts(&situation, &[0, 1, 3]);
        let others = bystanders(&situation, &parts);
        let loss = loss(&situation, &parts, &others);
        let chosen = std::cell::RefCell::new(Vec::new());
        slope_error(
            &situation,
            &parts,
            |_| 0.0,
            |movers, _| {
                let shares = loss.shares(movers, &situation.ego);
                *chosen.borrow_mut() = shares.iter().map(|of| num::sum(of.iter().map(|(_, w)| *w))).collect();
                0.0
            },
        );
        let chosen = chosen.into_inner();
        assert!((num::sum(chosen.iter().copied()) - 1.0).abs() < 1e-12, "{chosen:?}");
        // The car beside drives along with the ego, 3.5 m away.
        assert!(chosen[1] > 0.9 && chosen[2] == 0.0, "{chosen:?}");
    }
}
