//! Calibration: bounds and tolerances of the realism diagnostics from recorded traffic.
//!
//! Every recorded road user that moves is measured in the same way as an adversary. A bound is a quantile over the
//! road users of a kind. The tolerance is half the bound, so that one and a half times the bound scores
//! 0, but no smaller than a declared resolution: the smallest difference that tracks and maps of recordings can show.

use super::metrics::limits::{Calibration, Limit, Limits};
use crate::kernel::{Digest, Threads, Vec2, num};
use crate::scene::{AgentKind, Scene};
use crate::sim::{Feasibility, OfKind, Plant};

/// Least number of samples of a road user in a calibration (2 s).
pub const SAMPLES_MIN: usize = 20;
/// A road user that moves less than this stands, metres (MetaDrive's rule for static objects).
pub const MOVED_M_MIN: f64 = 3.0;
/// A kind with fewer road users takes the limits of all kinds together.
pub const ROAD_USERS_MIN: usize = 30;
/// Tolerance as a share of the bound.
pub const TOLERANCE_SHARE: f64 = 0.5;
/// Smallest tolerances.
const RESOLUTION: Feasibility = Feasibility {
    off_road_m: 1.0,
    wrong_way_m: 5.0,
    acceleration_mps2: 2.0,
    jerk_mps3: 4.0,
    slip_mps: 0.5,
    roughness_m: 0.1,
    jump_m: 0.5,
    kink_m: 0.5,
};

/// Least number of road users of a kind that gives it limits of its own in a calibration by kind.
pub const OF_KIND_MIN: usize = 20;
/// Kinds on wheels, which replace each other where few are recorded.
const WHEELED: [AgentKind; 2] = [AgentKind::Vehicle, AgentKind::Cyclist];
/// Smallest tolerance of a displacement that rolling does not explain, metres.
const UNROLLED_RESOLUTION_M: f64 = 0.3;
/// Least bound of a displacement that wheels do not make, metres: about the error of a tracked place. Recordings whose places were
/// smoothed show less, and noisy ones would fail by that bound.
const UNROLLED_FLOOR_M: f64 = 0.05;
/// Smallest tolerance of a speed, m/s.
const SPEED_RESOLUTION_MPS: f64 = 1.0;
/// 130 km/h: the general limit on motorways in most of Europe.
const VEHICLE_MPS: f64 = 36.1;
/// 25 km/h: where the motor of a pedelec stops helping (Regulation (EU) No 168/2013, article 2), above the 15 to 20 km/h of Euro NCAP's
/// cyclist tests.
const CYCLIST_MPS: f64 = 6.94;
/// 8 km/h: the running adult of Euro NCAP's pedestrian tests (AEB VRU protocol, CPFA).
const PEDESTRIAN_MPS: f64 = 2.22;

/// Scenes that give no calibration.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CalibrationError {
    /// A quantile that bounds nothing.
    #[error("quantile is {0}, expected a number above 0.5 and below 1")]
    Quantile(f64),
    /// Too few moving road users for a quantile.
    #[error(
        "{found} recorded road users move {MOVED_M_MIN} m or more within 2 s or longer, expected at least \
         {ROAD_USERS_MIN}; give more recorded scenes"
    )]
    TooFew {
        /// Number of road users of the scenes that move so far.
        found: usize,
    },
}

/// Measurements of a recorded road user.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Observed {
    /// Kind of the road user.
    pub kind: AgentKind,
    /// Quantities that realism judges, over its whole recording.
    pub motion: Feasibility,
    /// Measures of motion that its kind does not show.
    pub of_kind: OfKind,
}

/// Returns the measurements of every moving road user of these scenes, egos aside, in order. Scenes that cannot be simulated are
/// passed over.
pub fn observed(scenes: &[Scene], threads: &Threads) -> Vec<Observed> {
    let of_scene = |_: usize, scene: &Scene| -> Vec<Observed> {
        let Ok(plant) = Plant::new(scene) else { return Vec::new() };
        let moving = (0..scene.tracks.len()).filter(|track| moves(scene, *track));
        let of = |track: usize| Observed {
            kind: scene.tracks[track].kind,
            motion: plant.recorded(track),
            of_kind: plant.recorded_of_kind(track),
        };
        moving.map(of).collect()
    };
    threads.map(scenes, of_scene).into_iter().flatten().collect()
}

/// Returns `true` if a track is seen for long enough and gets away from where it was first seen.
pub fn moves(scene: &Scene, track: usize) -> bool {
    let places: Vec<Vec2> = scene.tracks[track].samples.iter().flatten().map(|sample| sample.position).collect();
    places.len() >= SAMPLES_MIN && places.iter().any(|place| place.distance(places[0]) >= MOVED_M_MIN)
}

/// Returns limits at a quantile of the observed measurements. `pools` and `scenes` name their source.
pub fn calibrate(
    observed: &[Observed],
    quantile: f64,
    pools: Vec<Digest>,
    scenes: usize,
) -> Result<Calibration, CalibrationError> {
    if !(quantile > 0.5 && quantile < 1.0) {
        return Err(CalibrationError::Quantile(quantile));
    }
    if observed.len() < ROAD_USERS_MIN {
        return Err(CalibrationError::TooFew { found: observed.len() });
    }
    let of = |kind: AgentKind| {
        let own: Vec<Feasibility> = observed.iter().filter(|o| o.kind == kind).map(|o| o.motion).collect();
        if own.len() >= ROAD_USERS_MIN {
            limits(&own, quantile, own.len(), false)
        } else {
            let all: Vec<Feasibility> = observed.iter().map(|o| o.motion).collect();
            limits(&all, quantile, own.len(), true)
        }
    };
    Ok(Calibration {
        quantile,
        pools,
        scenes,
        vehicle: of(AgentKind::Vehicle),
        cyclist: of(AgentKind::Cyclist),
        pedestrian: of(AgentKind::Pedestrian),
        fixed: of(AgentKind::Static),
    })
}

/// Adds limits by kind: a kind with at least twenty recorded has its own, and motion that a kind does not show is bounded, too.
/// A speed is bounded by the published value of the kind, or by the observed one where that is faster: recordings of a town show no motorway.
pub fn with_of_kind(calibration: Calibration, observed: &[Observed], quantile: f64) -> Calibration {
    let values = |of: fn(&OfKind) -> f64, kinds: &[AgentKind]| -> Vec<f64> {
        observed.iter().filter(|one| kinds.contains(&one.kind)).map(|one| of(&one.of_kind)).collect()
    };
    let of = |pooled: Limits, kind: AgentKind, published_mps: f64| {
        let motions: Vec<Feasibility> = observed.iter().filter(|o| o.kind == kind).map(|o| o.motion).collect();
        let enough = motions.len() >= OF_KIND_MIN;
        let seen_mps = if enough { bound(&values(|of| of.speed_mps, &[kind]), quantile) } else { 0.0 };
        let kinds: &[AgentKind] = if enough { &[kind] } else { &WHEELED };
        let limits = if enough { self::limits(&motions, quantile, motions.len(), false) } else { pooled };
        Limits {
            unrolled_m: Some(bounded(
                bound(&values(|of| of.unrolled_m, kinds), quantile).max(UNROLLED_FLOOR_M),
                UNROLLED_RESOLUTION_M,
            )),
            speed_mps: Some(bounded(published_mps.max(seen_mps), SPEED_RESOLUTION_MPS)),
            ..limits
        }
    };
    Calibration {
        vehicle: of(calibration.vehicle, AgentKind::Vehicle, VEHICLE_MPS),
        cyclist: of(calibration.cyclist, AgentKind::Cyclist, CYCLIST_MPS),
        pedestrian: of(calibration.pedestrian, AgentKind::Pedestrian, PEDESTRIAN_MPS),
        fixed: of(calibration.fixed, AgentKind::Static, 0.0),
        ..calibration
    }
}

/// Returns the quantile, rounded up to a thousandth, so that the file is readable and the quantile holds.
fn bound(values: &[f64], quantile: f64) -> f64 {
    num::quantile(values, quantile).map_or(0.0, |bound| (bound * 1000.0).ceil() / 1000.0)
}

/// A bound with its tolerance, which is no smaller than the resolution.
fn bounded(bound: f64, resolution: f64) -> Limit {
    Limit { bound, tolerance: (TOLERANCE_SHARE * bound).max(resolution) }
}

fn limits(motions: &[Feasibility], quantile: f64, road_users: usize, pooled: bool) -> Limits {
    let limit = |of: fn(&Feasibility) -> f64| {
        let values: Vec<f64> = motions.iter().map(of).collect();
        bounded(bound(&values, quantile), of(&RESOLUTION))
    };
    Limits {
        road_users,
        pooled,
        off_road_m: limit(|m| m.off_road_m),
        wrong_way_m: limit(|m| m.wrong_way_m),
        acceleration_mps2: limit(|m| m.acceleration_mps2),
        jerk_mps3: limit(|m| m.jerk_mps3),
        slip_mps: limit(|m| m.slip_mps),
        jump_m: limit(|m| m.jump_m),
        kink_m: limit(|m| m.kink_m),
        roughness_m: limit(|m| m.roughness_m),
        unrolled_m: None,
        speed_mps: None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn observed(kind: AgentKind, count: usize) -> Vec<Observed> {
        let motion = |k: usize| Feasibility { acceleration_mps2: 0.1 * k as f64, ..Feasibility::default() };
        (0..count).map(|k| Observed { kind, motion: motion(k), of_kind: OfKind::default() }).collect()
    }

    #[test]
    fn a_bound_is_the_quantile_of_its_kind_and_the_tolerance_no_smaller_than_the_resolution() {
        let all: Vec<Observed> =
            [observed(AgentKind::Vehicle, 101), observed(AgentKind::Pedestrian, 31), observed(AgentKind::Cyclist, 2)]
                .concat();
        let found = calibrate(&all, 0.99, vec![], 1).unwrap();
        assert_eq!(found.vehicle.acceleration_mps2, Limit { bound: 9.9, tolerance: 4.95 });
        assert_eq!(found.pedestrian.acceleration_mps2.bound, 2.97);
        assert_eq!(found.vehicle.jerk_mps3, Limit { bound: 0.0, tolerance: 4.0 });
        assert!(found.cyclist.pooled && found.cyclist.road_users == 2 && !found.vehicle.pooled);
        // Of 134 road users in all the quantile is still the vehicles'.
        assert!(found.cyclist.acceleration_mps2.bound > 9.0);
    }

    #[test]
    fn too_few_road_users_and_a_quantile_that_is_none_are_refused() {
        let few = observed(AgentKind::Vehicle, ROAD_USERS_MIN - 1);
        assert_eq!(calibrate(&few, 0.99, vec![], 1), Err(CalibrationError::TooFew { found: ROAD_USERS_MIN - 1 }));
        let enough = observed(AgentKind::Vehicle, ROAD_USERS_MIN);
        for quantile in [0.5, 1.0, f64::NAN] {
            assert!(matches!(calibrate(&enough, quantile, vec![], 1), Err(CalibrationError::Quantile(_))));
        }
    }
}
