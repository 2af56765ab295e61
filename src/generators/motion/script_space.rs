//! Spaces of scenarios for black-box searches: a cube [0, 1]^n, each point of which describes a scenario.

use super::chat_template::Template;
use crate::kernel::{Vec2, num};
use crate::scene::AgentKind;
use crate::sim::{Action, Phase, Script, Speed, Until, Way};

/// Length of a profile in the SafeBench ports: one number for each tick of 0.1 s from the trigger on.
pub const PROFILE_VALUES: usize = 100;

/// How the numbers change the adversary of the base scenario.
#[derive(Clone, Debug, PartialEq)]
pub enum Perturbation {
    /// AdvSim: the target speed at every tick, `u * mps_max`, after a first phase that does not change.
    Speeds {
        /// Speed asked for at u = 1, m/s.
        mps_max: f64,
        /// Phase before the profile, which stays as it is.
        lead: Option<Phase>,
        /// Width of the moving average over the numbers.
        smoothing: usize,
    },
    /// AT: one point to steer at for every tick, along a straight path of `length_m` from the spawn, moved by
    /// `(2u - 1) * amplitude_m` to the right.
    Lateral {
        /// Offset at u = 1, metres to the right.
        amplitude_m: f64,
        /// Length of the straight path, metres.
        length_m: f64,
        /// Speed along it, m/s.
        mps: f64,
        /// Phase before the profile, which stays as it is.
        lead: Option<Phase>,
        /// Width of the moving average over the numbers.
        smoothing: usize,
    },
    /// ChatScene: the values of a template's ranges.
    Template(Template),
}

/// A scenario with the numbers that may change it.
#[derive(Clone, Debug, PartialEq)]
pub struct ScriptSpace {
    /// The scenario that is changed.
    pub base: Vec<Action>,
    /// The action that is perturbed.
    pub adversary: usize,
    /// How the numbers change it.
    pub perturbation: Perturbation,
}

impl ScriptSpace {
    /// Returns the number of coordinates of a point.
    pub fn dimensions(&self) -> usize {
        match &self.perturbation {
            Perturbation::Template(template) => template.ranges.len(),
            _ => PROFILE_VALUES,
        }
    }

    /// The scenario of a point of the cube.
    pub fn actions(&self, place: &[f64]) -> Vec<Action> {
        let mut actions = self.base.clone();
        if let Perturbation::Template(template) = &self.perturbation {
            shift_what_stands(&mut actions, template.shift(place));
        }
        let Some(Action::Triggered(script)) = actions.get_mut(self.adversary) else { return actions };
        // A profile stands in for the last phase of the script and ends where that one ends.
        let until = script.phases.last().map_or(Until::Forever, |phase| phase.until);
        match &self.perturbation {
            Perturbation::Speeds { mps_max, lead, smoothing } => {
                let mps = smoothed(place, *smoothing).into_iter().map(|u| u * mps_max).collect();
                let driven = Phase { speed: Speed::Profile { mps }, ..Phase::straight(0.0, until) };
                script.phases = lead.iter().cloned().chain([driven]).collect();
            }
            Perturbation::Lateral { amplitude_m, length_m, mps, lead, smoothing } => {
                let points = points(script, &smoothed(place, *smoothing), *amplitude_m, *length_m);
                let steered = Phase { way: Way::Points { points }, ..Phase::straight(*mps, until) };
                script.phases = lead.iter().cloned().chain([steered]).collect();
            }
            Perturbation::Template(template) => template.apply(script, place),
        }
        actions
    }
}

/// Shifts what hides a road user, so that it still hides it.
fn shift_what_stands(actions: &mut [Action], by: Vec2) {
    for action in actions {
        if let Action::Triggered(script) = action
            && script.kind == AgentKind::Static
        {
            script.spawn.position = script.spawn.position + by;
        }
    }
}

fn points(script: &Script, u: &[f64], amplitude_m: f64, length_m: f64) -> Vec<Vec2> {
    let forward = Vec2::from_heading(script.spawn.heading_rad);
    let right = -forward.left();
    let at = |(i, u): (usize, &f64)| {
        let along_m = length_m * i as f64 / PROFILE_VALUES as f64;
        script.spawn.position + forward * along_m + right * ((2.0 * u - 1.0) * amplitude_m)
    };
    u.iter().enumerate().map(at).collect()
}

/// Means over `width` neighbours, fewer at the ends; a width of 1 changes nothing.
fn smoothed(place: &[f64], width: usize) -> Vec<f64> {
    let (before, after) = (width.saturating_sub(1) / 2, width / 2);
    let mean = |i: usize| {
        let window = &place[i.saturating_sub(before)..(i + after + 1).min(place.len())];
        (num::sum(window.iter().copied()) / window.len() as f64).clamp(0.0, 1.0)
    };
    if width <= 1 { place.iter().map(|u| u.clamp(0.0, 1.0)).collect() } else { (0..place.len()).map(mean).collect() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernel::Pose;
    use crate::sim::Trigger;

    fn space(perturbation: Perturbation) -> ScriptSpace {
        let trigger = Trigger { reference: 0, distance_m: 20.0, ego_speed_mps_min: 0.0 };
        let spawn = Pose { position: Vec2::new(10.0, 0.0), heading_rad: 0.0 };
        let phases = vec![Phase::straight(5.0, Until::Forever)];
        let script = Script { kind: AgentKind::Vehicle, length_m: 4.8, width_m: 2.0, spawn, trigger, phases };
        ScriptSpace { base: vec![Action::Triggered(script)], adversary: 0, perturbation }
    }

    fn script(space: &ScriptSpace, place: &[f64]) -> Script {
        match &space.actions(place)[0] {
            Action::Triggered(script) => script.clone(),
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn a_speed_profile_is_a_share_of_the_ceiling_and_leaves_the_path_straight() {
        let space = space(Perturbation::Speeds { mps_max: 20.0, lead: None, smoothing: 1 });
        let place: Vec<f64> = (0..100).map(|i| i as f64 / 99.0).collect();
        let phases = script(&space, &place).phases;
        let [Phase { speed: Speed::Profile { mps }, way: Way::Straight, .. }] = phases.as_slice() else { panic!() };
        assert_eq!((mps.len(), mps[0], mps[99]), (100, 0.0, 20.0));
    }

    #[test]
    fn lateral_points_lie_within_the_amplitude_of_a_straight_path() {
        let lateral = Perturbation::Lateral { amplitude_m: 3.0, length_m: 100.0, mps: 8.0, lead: None, smoothing: 1 };
        let space = space(lateral);
        let found = script(&space, &[1.0; 100]).phases;
        let [Phase { way: Way::Points { points }, .. }] = found.as_slice() else { panic!() };
        assert_eq!(points.len(), 100);
        assert!(points.iter().enumerate().all(|(i, p)| p.distance(Vec2::new(10.0 + i as f64, -3.0)) < 1e-9));
    }

    #[test]
    fn smoothing_keeps_a_constant_and_calms_a_zigzag() {
        assert!(smoothed(&[0.25; 10], 5).iter().all(|u| (u - 0.25).abs() < 1e-12));
        let zigzag: Vec<f64> = (0..10).map(|i| (i % 2) as f64).collect();
        assert!(smoothed(&zigzag, 4)[2..8].iter().all(|u| (u - 0.5).abs() < 1e-12));
    }
}
