//! Interaction estimates from a scene's logs alone, without a simulation.

use crate::kernel::{Polyline, Vec2};
use crate::scene::{AgentKind, DT_S, Scene};

/// The distance that is reported if no vehicle is observed with the ego, metres.
const NOBODY_M: f64 = 200.0;
/// The time to conflict that is reported if no vehicle approaches, seconds.
const NEVER_S: f64 = 20.0;

/// How close the recorded traffic comes to the ego, after the current step. All finite.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interaction {
    /// Smallest distance of centres at equal times; 200 where nobody is seen.
    pub relative_distance_m_min: f64,
    /// Relative speed at that time.
    pub relative_speed_mps: f64,
    /// Smallest gap over closing speed at any time; 20 where nobody closes in.
    pub time_to_conflict_s_min: f64,
    /// Smallest distance of any vehicle's log to the ego's route; 200 where nobody is seen.
    pub route_deviation_m_min: f64,
}

impl Interaction {
    /// Estimates for a validated scene. The ego follows its log, or, where the log is missing, its route at its first
    /// speed.
    pub fn of(scene: &Scene) -> Interaction {
        let mut interaction = Interaction {
            relative_distance_m_min: NOBODY_M,
            relative_speed_mps: 0.0,
            time_to_conflict_s_min: NEVER_S,
            route_deviation_m_min: NOBODY_M,
        };
        let route = Polyline::new(scene.ego.route.clone()).ok();
        let vehicles = scene.tracks.iter().filter(|track| track.kind == AgentKind::Vehicle);
        let egos: Vec<Option<(Vec2, Vec2)>> =
            (0..scene.steps).map(|step| ego_at(scene, route.as_ref(), step)).collect();
        for track in vehicles {
            for (step, ego) in egos.iter().enumerate().skip(scene.current_step) {
                let Some(sample) = track.at(step) else { continue };
                if let Some(ego) = ego {
                    interaction.meet(sample.position - ego.0, sample.velocity - ego.1);
                }
                if let Some(line) = &route {
                    let offset_m = sample.position.distance(line.at(line.project(sample.position).s_m));
                    interaction.route_deviation_m_min = interaction.route_deviation_m_min.min(offset_m);
                }
            }
        }
        interaction
    }

    fn meet(&mut self, gap: Vec2, relative: Vec2) {
        let distance_m = gap.norm();
        if distance_m < self.relative_distance_m_min {
            self.relative_distance_m_min = distance_m;
            self.relative_speed_mps = relative.norm();
        }
        let closing_mps = -gap.dot(relative) / distance_m.max(1e-6);
        if closing_mps > 0.1 {
            self.time_to_conflict_s_min = self.time_to_conflict_s_min.min(distance_m / closing_mps);
        }
    }
}

/// Place and velocity of the ego at a step.
fn ego_at(scene: &Scene, route: Option<&Polyline>, step: usize) -> Option<(Vec2, Vec2)> {
    if let Some(sample) = scene.ego.track.at(step) {
        return Some((sample.position, sample.velocity));
    }
    let (start, line) = (scene.ego.track.at(scene.ego.start_step)?, route?);
    let speed_mps = start.speed_mps();
    let elapsed_s = (step as f64 - scene.ego.start_step as f64) * DT_S;
    let s_m = line.project(start.position).s_m + speed_mps * elapsed_s;
    Some((line.at(s_m), Vec2::from_heading(line.heading_at(s_m)) * speed_mps))
}
