//! Decides whether adversarial traffic can be evolved on a scene, and says in plain words why not.

use super::{AgentKind, Scene, Track};
use crate::kernel::Polyline;

/// Least length of the ego's route, metres. Waymo's interactive selection asks the ego to move 10 m.
pub const ROUTE_MIN_M: f64 = 10.0;
/// Least number of samples after the current step: an adversary needs two seconds to act.
pub const STEPS_AFTER_MIN: usize = 20;
/// A vehicle that never comes this near to the ego's route cannot interact, metres.
pub const ROUTE_WITHIN_M: f64 = 40.0;

/// Why a scene is not used for evolution.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Unusable {
    /// It breaks rules that every scene keeps.
    #[error("it breaks {count} validation rules, the first is: {first}")]
    Unsound {
        /// Number of rules that it breaks.
        count: usize,
        /// The first of them.
        first: String,
    },
    /// The ego's route is too short.
    #[error("the ego's route is {length_m:.1} m long; 10 m are needed")]
    RouteTooShort {
        /// Length of the route, metres.
        length_m: f64,
    },
    /// Too little time is left after the current step.
    #[error("it ends {steps} steps after its current step; 20 are needed")]
    TooShort {
        /// Samples after the current step.
        steps: usize,
    },
    /// There is no vehicle besides the ego.
    #[error("there is no vehicle besides the ego")]
    NoVehicle,
    /// No vehicle stays long enough.
    #[error("none of its {vehicles} vehicles is observed for 20 steps after the current one")]
    NoLastingVehicle {
        /// Vehicles of the scene.
        vehicles: usize,
    },
    /// No vehicle comes near to the ego's route.
    #[error("none of its {vehicles} lasting vehicles comes within 40 m of the ego's route")]
    NoVehicleNear {
        /// Vehicles that stay long enough.
        vehicles: usize,
    },
}

/// Checks that adversarial traffic can be evolved on a scene; the error says why not.
pub fn usable(scene: &Scene) -> Result<(), Unusable> {
    let violations = scene.validate();
    if let Some(first) = violations.first() {
        return Err(Unusable::Unsound { count: violations.len(), first: first.to_string() });
    }
    let route = Polyline::new(scene.ego.route.clone()).map_err(|_| Unusable::RouteTooShort { length_m: 0.0 })?;
    if route.length_m() < ROUTE_MIN_M {
        return Err(Unusable::RouteTooShort { length_m: route.length_m() });
    }
    let after = scene.steps - 1 - scene.current_step;
    if after < STEPS_AFTER_MIN {
        return Err(Unusable::TooShort { steps: after });
    }
    if scene.staging.is_some() {
        // A traffic family adds its own actors.
        return Ok(());
    }
    let vehicles: Vec<&Track> = scene.tracks.iter().filter(|t| t.kind == AgentKind::Vehicle).collect();
    if vehicles.is_empty() {
        return Err(Unusable::NoVehicle);
    }
    let later = |track: &'_ &Track| track.samples.iter().skip(scene.current_step + 1).flatten().count();
    let lasting: Vec<&Track> = vehicles.iter().filter(|t| later(t) >= STEPS_AFTER_MIN).copied().collect();
    if lasting.is_empty() {
        return Err(Unusable::NoLastingVehicle { vehicles: vehicles.len() });
    }
    let near = |track: &&Track| {
        let mut places = track.samples.iter().skip(scene.current_step).flatten();
        places.any(|s| route.project(s.position).offset_m.abs() <= ROUTE_WITHIN_M)
    };
    if !lasting.iter().any(near) {
        return Err(Unusable::NoVehicleNear { vehicles: lasting.len() });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernel::Vec2;
    use crate::scene::fixture::{straight, two_lane_scene};

    fn with(change: impl FnOnce(&mut Scene)) -> Result<(), Unusable> {
        let mut scene = two_lane_scene();
        change(&mut scene);
        usable(&scene)
    }

    #[test]
    fn each_reason_against_a_scene_is_told() {
        assert_eq!(with(|_| ()), Ok(()));
        let short = with(|s| s.ego.route = vec![Vec2::ZERO, Vec2::new(4.0, 0.0)]);
        assert_eq!(short, Err(Unusable::RouteTooShort { length_m: 4.0 }));
        assert_eq!(with(|s| s.current_step = 50), Err(Unusable::TooShort { steps: 9 }));
        let none = with(|s| (s.tracks, s.objects_of_interest) = (vec![], vec![]));
        assert_eq!(none, Err(Unusable::NoVehicle));
        let brief = with(|s| s.tracks.iter_mut().for_each(|t| t.samples[15..].fill(None)));
        assert_eq!(brief, Err(Unusable::NoLastingVehicle { vehicles: 2 }));
        let far = with(|s| s.tracks.iter_mut().for_each(|t| t.samples = straight(60, Vec2::new(0.0, 90.0), 0.0, 5.0)));
        assert_eq!(far, Err(Unusable::NoVehicleNear { vehicles: 2 }));
        assert!(matches!(with(|s| s.id.clear()), Err(Unusable::Unsound { count: 1, .. })));
    }
}
