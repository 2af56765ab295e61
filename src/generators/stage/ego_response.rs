//! How the ego would answer a candidate: it stays on the path of its rollout, and brakes for whoever is in its way.
//!
//! The stand-in for SEAL's learned predictor (Stoler et al. 2025), which guesses from the ego's earlier rollout and a
//! candidate how critical the meeting is and how far the ego is pushed off its own plan. Here both follow from one
//! longitudinal simulation: no network, and nothing that the ego's rollout on the recorded scene does not tell.

use super::situation::Situation;
use crate::kernel::{OrientedBox, Vec2, num};
use crate::scene::{DT_S, Sample, TrackIx};

/// Samples between two looks of the ego.
const STRIDE: usize = 2;
/// A look's duration, s.
const LOOK_S: f64 = STRIDE as f64 * DT_S;
/// The ego does not look farther along its path, metres.
const SIGHT_M: f64 = 40.0;
/// Room beside the two half widths within which somebody is in the way, metres.
const SIDE_ROOM_M: f64 = 0.3;
/// Gap that the ego aims to stop at, metres.
const STANDOFF_M: f64 = 2.0;
/// Deceleration that is needed before the ego brakes at all, m/s².
const COMFORTABLE_MPS2: f64 = 1.0;
/// Both labels of the method saturate over this distance, metres.
const LABEL_SCALE_M: f64 = 8.0;

/// Effects of one candidate and the answering ego on each other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Response {
    /// Index of the sample at which the boxes first overlap; of the nearest approach where they never do.
    pub meeting: usize,
    pub contact: bool,
    pub gap_m_min: f64,
    /// Σ over decision steps of the distance between the answering ego and its rollout, metres.
    pub deviation_m: f64,
}

impl Response {
    /// sc: 1 on contact, else exp(−gap / 8 m).
    pub fn criticality(&self) -> f64 {
        if self.contact { 1.0 } else { num::exp(-self.gap_m_min / LABEL_SCALE_M).min(1.0) }
    }

    /// diff: 1 − exp(−Σ‖ego − its rollout‖ / 8 m).
    pub fn deviation(&self) -> f64 {
        1.0 - num::exp(-self.deviation_m / LABEL_SCALE_M)
    }
}

/// The ego's rollout from one step on, as a path with the way driven at every step.
#[derive(Clone, Debug)]
pub struct EgoPlan {
    points: Vec<Sample>,
    /// Way driven up to each point, metres.
    lengths: Vec<f64>,
    length_m: f64,
    width_m: f64,
}

impl EgoPlan {
    /// `None` where the ego's rollout has ended before.
    pub fn of(situation: &Situation, from_step: usize) -> Option<EgoPlan> {
        let steps = situation.ego.steps();
        let points: Vec<Sample> = (from_step..steps.end).map_while(|s| situation.ego.at(s).copied()).collect();
        let mut lengths = Vec::with_capacity(points.len());
        let mut way = 0.0;
        for (k, point) in points.iter().enumerate() {
            way += k.checked_sub(1).map_or(0.0, |before| points[before].position.distance(point.position));
            lengths.push(way);
        }
        let (length_m, width_m) = (situation.ego.length_m, situation.ego.width_m);
        (!points.is_empty()).then_some(EgoPlan { points, lengths, length_m, width_m })
    }

    /// Pose after a way along the path; the last one beyond its end.
    fn at(&self, way_m: f64) -> (Vec2, f64) {
        let next = self.lengths.partition_point(|l| *l <= way_m);
        let Some(to) = self.points.get(next) else {
            let last = self.points[self.points.len() - 1];
            return (last.position, last.heading_rad);
        };
        let Some(from) = next.checked_sub(1) else { return (to.position, to.heading_rad) };
        let piece = self.lengths[next] - self.lengths[from];
        let share = (way_m - self.lengths[from]) / piece.max(1e-9);
        (self.points[from].position.lerp(to.position, share), self.points[from].heading_rad)
    }

    /// Deceleration that the ego needs at a place and speed for a body in its way, m/s²; 0 where it is not.
    fn needed_mps2(&self, way_m: f64, speed_mps: f64, other: &OrientedBox, velocity: Vec2) -> f64 {
        let from = self.lengths.partition_point(|l| *l <= way_m).saturating_sub(1);
        let reach = 0.5 * self.width_m + other.radius().min(2.5) + SIDE_ROOM_M;
        let ahead = (from..self.points.len()).take_while(|k| self.lengths[*k] <= way_m + SIGHT_M).step_by(STRIDE);
        for k in ahead {
            let point = &self.points[k];
            if point.position.distance(other.center) > reach {
                continue;
            }
            let forward = Vec2::from_heading(point.heading_rad);
            let gap = self.lengths[k] - way_m - 0.5 * self.length_m - other.radius().min(2.5) - STANDOFF_M;
            let closing = speed_mps - velocity.dot(forward).max(0.0);
            return if closing <= 0.0 { 0.0 } else { 0.5 * closing * closing / gap.max(0.1) };
        }
        0.0
    }

    /// Follows the candidate's samples step by step; the ego brakes with at most `deceleration_mps2_max`.
    pub fn answer(
        &self,
        situation: &Situation,
        actor: TrackIx,
        samples: &[Sample],
        deceleration_mps2_max: f64,
    ) -> Response {
        let mut response = Response { meeting: 0, contact: false, gap_m_min: f64::INFINITY, deviation_m: 0.0 };
        let (mut way_m, mut late) = (0.0, false);
        let mut speed_mps = self.points[0].speed_mps();
        for k in (0..samples.len().min(self.points.len())).step_by(STRIDE) {
            let own = situation.body(actor, &samples[k]);
            let (position, heading_rad) = if late { self.at(way_m) } else { self.pose(k) };
            let ego = OrientedBox::new(position, heading_rad, self.length_m, self.width_m);
            response.deviation_m += position.distance(self.points[k].position) * STRIDE as f64;
            if position.distance(own.center) - own.radius() - ego.radius() < response.gap_m_min {
                let gap = own.distance(&ego);
                if gap < response.gap_m_min {
                    (response.gap_m_min, response.meeting) = (gap, k);
                }
                if gap == 0.0 {
                    response.contact = true;
                    break;
                }
            }
            if !late {
                (way_m, speed_mps) = (self.lengths[k], self.points[k].speed_mps());
            }
            let needed = self.needed_mps2(way_m, speed_mps, &own, samples[k].velocity);
            if needed > COMFORTABLE_MPS2 {
                late = true;
                speed_mps = (speed_mps - needed.min(deceleration_mps2_max) * LOOK_S).max(0.0);
            } else if late {
                // It takes up its old speed again, but not the lost time.
                speed_mps = (speed_mps + COMFORTABLE_MPS2 * LOOK_S).min(self.points[k].speed_mps().max(speed_mps));
            }
            way_m += speed_mps * LOOK_S;
        }
        response.gap_m_min = response.gap_m_min.min(200.0);
        response
    }

    fn pose(&self, k: usize) -> (Vec2, f64) {
        (self.points[k].position, self.points[k].heading_rad)
    }
}
