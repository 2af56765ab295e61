//! KING's loss: mean over time of the least distance from the ego's corners to an adversary, plus the mean Gaussian
//! off-road cost of all adversaries, minus the least distance between two adversaries, capped.

use crate::kernel::{OrientedBox, Vec2};
use crate::motion::kinematics::Slope;
use crate::motion::separation::{box_to_box, on_body, point_to_box};
use crate::search::descent::{Mover, Slopes, covered};
use crate::stage::EgoPath;
use crate::stage::road_field::{RoadField, gaussian_departure};

/// Whom the ego attracts at each time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Attraction {
    /// The adversary that is nearest, its distance divided by its weight.
    Nearest,
    /// All, by weight.
    Everyone,
}

/// The loss of one scene.
#[derive(Clone, Debug)]
pub struct Loss<'a> {
    pub pursuit: Attraction,
    /// One a mover, above 0.
    pub pursuer_weights: Vec<f64>,
    pub attraction_weight: f64,
    pub departure_weight: f64,
    pub departure_sigma_m: f64,
    pub repulsion_weight: f64,
    pub repulsion_m_max: f64,
    /// `None`: nothing is off the road.
    pub field: Option<&'a RoadField>,
}

/// Points of a vehicle whose ground counts, metres along and across.
const FEET_M: [(f64, f64); 4] = [(2.5, 1.0), (2.5, -1.0), (-2.5, 1.0), (-2.5, -1.0)];
/// KING sums every second pixel of its raster in both directions: a quarter of the Gaussian's mass.
const RASTER_SHARE: f64 = 0.25;

impl Loss<'_> {
    /// The value against an ego's path; its slopes at the movers' states are added to `slopes`.
    pub fn of(&self, movers: &[Mover], ego: &EgoPath, slopes: &mut Slopes) -> f64 {
        self.attraction(movers, ego, slopes) + self.departure(movers, slopes) + self.repulsion(movers, slopes)
    }

    fn attraction(&self, movers: &[Mover], ego: &EgoPath, slopes: &mut Slopes) -> f64 {
        let steps: Vec<usize> = covered(movers).filter(|step| ego.at(*step).is_some()).collect();
        let share = self.attraction_weight / steps.len().max(1) as f64;
        let total_weight: f64 = self.pursuer_weights.iter().sum();
        let mut value = 0.0;
        for step in steps {
            let Some(body) = ego.body(step) else { continue };
            let corners = body.corners();
            let mut least: Option<(f64, usize, usize, f64, Slope)> = None;
            for (which, mover) in movers.iter().enumerate() {
                let Some(index) = mover.index(step) else { continue };
                let (distance, slope) = corners_to_box(&corners, &mover.boxes[index]);
                let weight = self.pursuer_weights[which];
                if self.pursuit == Attraction::Everyone {
                    let part = share * weight / total_weight;
                    value += part * distance;
                    slopes.states[which][index].add(part, &slope);
                } else if least.as_ref().is_none_or(|l| distance / weight < l.0) {
                    least = Some((distance / weight, which, index, distance, slope));
                }
            }
            if let Some((_, which, index, distance, slope)) = least {
                value += share * distance;
                slopes.states[which][index].add(share, &slope);
            }
        }
        value
    }

    fn departure(&self, movers: &[Mover], slopes: &mut Slopes) -> f64 {
        let Some(field) = self.field else { return 0.0 };
        let share = self.departure_weight * RASTER_SHARE / covered(movers).len().max(1) as f64;
        let mut value = 0.0;
        for (mover, slopes) in movers.iter().zip(&mut slopes.states) {
            for (body, slope) in mover.boxes.iter().zip(slopes).skip(1) {
                for (along, across) in FEET_M {
                    let arm = body.axis * along + body.axis.left() * across;
                    let (cost, pull) = gaussian_departure(field, body.center + arm, self.departure_sigma_m);
                    if cost > 0.0 {
                        value += share * cost;
                        slope.add(share, &on_body(pull, arm));
                    }
                }
            }
        }
        value
    }

    fn repulsion(&self, movers: &[Mover], slopes: &mut Slopes) -> f64 {
        let mut least: Option<(f64, [usize; 4], Slope, Slope)> = None;
        for (i, one) in movers.iter().enumerate() {
            for (j, other) in movers.iter().enumerate().skip(i + 1) {
                for step in one.steps() {
                    let (Some(k), Some(l)) = (one.index(step), other.index(step)) else { continue };
                    let (a, b) = (&one.boxes[k], &other.boxes[l]);
                    let bound = least.as_ref().map_or(self.repulsion_m_max, |l| l.0);
                    let reach = a.radius() + b.radius() + bound;
                    if (a.center - b.center).norm_squared() > reach * reach {
                        continue;
                    }
                    let (distance, to_a, to_b) = box_to_box(a, b);
                    if distance < bound {
                        least = Some((distance, [i, k, j, l], to_a, to_b));
                    }
                }
            }
        }
        let Some((distance, [i, k, j, l], to_a, to_b)) = least else {
            return if movers.len() > 1 { -self.repulsion_weight * self.repulsion_m_max } else { 0.0 };
        };
        slopes.states[i][k].add(-self.repulsion_weight, &to_a);
        slopes.states[j][l].add(-self.repulsion_weight, &to_b);
        -self.repulsion_weight * distance
    }
}

/// Least distance of the ego's corners from an adversary's box: zero exactly when one touches it.
fn corners_to_box(corners: &[Vec2; 4], body: &OrientedBox) -> (f64, Slope) {
    let mut best = (f64::INFINITY, Slope::default());
    for corner in corners {
        let found = point_to_box(*corner, body);
        if found.0 < best.0 {
            best = found;
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::super::actions::ActionSpace;
    use super::*;
    use crate::ego::Policy;
    use crate::motion::Driven;
    use crate::motion::{Window, following};
    use crate::scene::fixture::two_lane_scene;
    use crate::search::descent::{open, slope_error};
    use crate::stage::{Part, Situation};
    use std::sync::Arc;

    fn situation() -> Situation {
        Situation::new(Arc::new(two_lane_scene()), &Policy::Idm).unwrap()
    }

    fn parts(situation: &Situation) -> Vec<Part> {
        let part = |actor: usize| {
            let window = Window { from_step: 1, steps: 30 };
            let mut part = Part { actor, window, candidates: vec![], offsets: None, driven: None };
            let (start, samples) = following::record(&situation.scene.tracks[actor], window).unwrap();
            let space: Arc<dyn Driven> = Arc::new(ActionSpace::following(start, &samples, 0.25, 3.0, 4.952399));
            open(&mut part, situation, Some(space));
            part
        };
        vec![part(0), part(1)]
    }

    fn loss(situation: &Situation, pursuit: Attraction) -> Loss<'_> {
        Loss {
            pursuit,
            pursuer_weights: vec![1.0, 1.3],
            attraction_weight: 1.0,
            departure_weight: 23.0,
            departure_sigma_m: 1.0,
            repulsion_weight: 5.0,
            repulsion_m_max: 30.0,
            field: situation.road_field(),
        }
    }

    #[test]
    fn the_whole_losss_slope_matches_finite_differences_through_the_bicycle() {
        let (situation, shift) = (situation(), |k: usize| 0.02 * ((k % 7) as f64 - 2.5));
        let parts = parts(&situation);
        for pursuit in [Attraction::Nearest, Attraction::Everyone] {
            let loss = loss(&situation, pursuit);
            let error = slope_error(&situation, &parts, shift, |m, slopes| loss.of(m, &situation.ego, slopes));
            assert!(error < 1e-5, "{pursuit:?}: {error}");
        }
    }

    #[test]
    fn the_terms_by_hand() {
        let (body, corner) = (OrientedBox::new(Vec2::ZERO, 0.0, 4.0, 2.0), Vec2::new(5.0, 5.0));
        let corners = [corner, corner + Vec2::new(2.0, 0.0), Vec2::new(9.0, 9.0), Vec2::new(-9.0, 9.0)];
        // From (2, 1): 3 and 4.
        assert_eq!(corners_to_box(&corners, &body).0, 5.0);
        assert_eq!(corners_to_box(&[Vec2::new(1.0, 0.5), corner, corner, corner], &body).0, 0.0);
    }
}
