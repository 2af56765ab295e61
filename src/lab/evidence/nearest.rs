//! Nearest approach of the ego and a program's road user in a rollout: the gap between their boxes, when, and at which points. A number
//! for people who look at near misses. No label reads it, so it may be computed by parry rather than by the simulator's own boxes.

use parry2d_f64::math::{Pose, Vector};
use parry2d_f64::query::{self, ClosestPoints};
use parry2d_f64::shape::Cuboid;
use serde::Serialize;

use crate::kernel::Vec2;
use crate::scene::{DT_S, Sample};
use crate::sim::{ActorRef, ActorTrace, Trace};

/// The least gap over the steps that a rollout recorded, every 0.1 s. What lies between two steps is not looked at, so the gap of a
/// fast encounter is an upper bound.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Nearest {
    pub actor: ActorRef,
    /// Seconds after the first simulated step.
    pub time_s: f64,
    /// Metres between the boxes; 0 where they overlap.
    pub gap_m: f64,
    /// The nearest point of the ego's box in the ego's frame, metres: forward of its centre, and left of it. `None` where the boxes
    /// overlap, because no point is the nearest then.
    pub on_ego_m: Option<[f64; 2]>,
}

/// The least gap to every road user that the program moves, in the order of the trace; the earliest of equal ones. Nothing of a road
/// user that is never there together with the ego.
///
/// `ego_m`: length and width of the ego, metres.
pub fn nearest(trace: &Trace, ego_m: [f64; 2]) -> Vec<Nearest> {
    let shape = cuboid(ego_m);
    let of = |actor: &ActorTrace| {
        let other = cuboid([actor.length_m, actor.width_m]);
        let steps = trace.ego.iter().zip(&actor.samples).enumerate();
        let gaps = steps.filter_map(|(step, (ego, sample))| {
            let (gap_m, on_ego_m) = gap((ego, &shape), (sample.as_ref()?, &other))?;
            Some(Nearest { actor: actor.actor, time_s: step as f64 * DT_S, gap_m, on_ego_m })
        });
        gaps.reduce(|least, next| if next.gap_m < least.gap_m { next } else { least })
    };
    trace.actors.iter().filter(|actor| actor.adversary).filter_map(of).collect()
}

type Boxed<'a> = (&'a Sample, &'a Cuboid);

fn gap(ego: Boxed<'_>, other: Boxed<'_>) -> Option<(f64, Option<[f64; 2]>)> {
    match query::closest_points(&pose(ego.0), ego.1, &pose(other.0), other.1, f64::MAX).ok()? {
        ClosestPoints::WithinMargin(a, b) => {
            let from_centre = Vec2::new(a.x, a.y) - ego.0.position;
            let axis = Vec2::from_heading(ego.0.heading_rad);
            Some(((b - a).length(), Some([from_centre.dot(axis), axis.cross(from_centre)])))
        }
        ClosestPoints::Intersecting => Some((0.0, None)),
        ClosestPoints::Disjoint => None,
    }
}

fn pose(sample: &Sample) -> Pose {
    Pose::new(Vector::new(sample.position.x, sample.position.y), sample.heading_rad)
}

fn cuboid([length_m, width_m]: [f64; 2]) -> Cuboid {
    Cuboid::new(Vector::new(length_m / 2.0, width_m / 2.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(x: f64, y: f64, heading_rad: f64) -> Sample {
        Sample { position: Vec2::new(x, y), heading_rad, velocity: Vec2::default() }
    }

    fn user(actor: ActorRef, adversary: bool, samples: Vec<Option<Sample>>) -> ActorTrace {
        ActorTrace { actor, length_m: 4.0, width_m: 2.0, adversary, samples }
    }

    fn trace(ego: Vec<Sample>, actors: Vec<ActorTrace>) -> Trace {
        Trace { from_step: 10, ego, actors }
    }

    /// By hand: an ego of 5 by 2 m that looks north, and a box of 4 by 2 m that looks east, to the ego's right.
    #[test]
    fn the_gap_is_between_the_boxes_not_their_centres_and_its_place_is_in_the_egos_frame() {
        let north = std::f64::consts::FRAC_PI_2;
        let ego = vec![at(0.0, 0.0, north), at(0.0, 1.0, north), at(0.0, 2.0, north)];
        let other = vec![Some(at(9.0, 6.0, 0.0)), Some(at(4.0, 4.5, 0.0)), None];
        let found = nearest(&trace(ego, vec![user(ActorRef::Track(3), true, other)]), [5.0, 2.0]);
        let [one] = found.as_slice() else { panic!("{found:?}") };
        assert_eq!((one.actor, one.time_s), (ActorRef::Track(3), DT_S));
        // Corners: the ego's front right one is (1, 3.5), the other's nearest edge is x = 2 from y = 3.5 to 5.5.
        assert!((one.gap_m - 1.0).abs() < 1e-9, "{one:?}");
        let [forward, left] = one.on_ego_m.unwrap();
        assert!((forward - 2.5).abs() < 1e-9 && (left + 1.0).abs() < 1e-9, "{one:?}");
    }

    #[test]
    fn boxes_that_overlap_have_no_gap_and_only_the_programs_road_users_count() {
        let ego = vec![at(0.0, 0.0, 0.0); 2];
        let hits = user(ActorRef::Inserted(0), true, vec![None, Some(at(3.0, 1.0, 1.0))]);
        let bystander = user(ActorRef::Track(0), false, vec![Some(at(1.0, 0.0, 0.0)); 2]);
        let absent = user(ActorRef::Track(1), true, vec![None, None]);
        let found = nearest(&trace(ego, vec![hits, bystander, absent]), [5.0, 2.0]);
        let wanted = Nearest { actor: ActorRef::Inserted(0), time_s: DT_S, gap_m: 0.0, on_ego_m: None };
        assert_eq!(found, [wanted]);
    }
}
