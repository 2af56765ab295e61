//! The kind of a contact, from both motions: the manner of collision of the US crash records (FARS/CRSS
//! `MAN_COLL`: front-to-rear, front-to-front, angle, sideswipe), told apart by role and by what came before, as the
//! pre-crash scenarios of Najm, Smith and Yanagisawa (2007, DOT HS 810 767) do.

use serde::{Deserialize, Serialize};

use crate::kernel::{OrientedBox, Vec2};
use crate::sim::prepared::body::{Place, Size};
use crate::sim::prepared::path::Along;
use crate::sim::prepared::plant::Plant;
use crate::sim::road_users::actors::CUT_IN_STEPS;
use crate::sim::road_users::intervention::ActorRef;
use crate::sim::road_users::others::Others;

use super::hit::Hit;
use super::touch::{Side, Striker};

/// The ego's path is wider than the ego by this much on either side, metres (the intrusion at which UN Regulation 157,
/// 5.2.5.2, begins to count a cut-in).
pub const PATH_CLEARANCE_M: f64 = 0.3;
/// Time in one place after which a road user counts as standing, decision steps (1 s).
pub const STANDING_STEPS: usize = 10;
/// Distance within [`STANDING_STEPS`] beyond which a road user was not standing, metres.
pub const STANDING_M: f64 = 0.5;
/// Speed below which there is no direction of motion, m/s.
pub const MOVING_MPS: f64 = 0.5;
/// Headings that differ by less than 45 degrees are one direction, by more than 135 degrees opposite ones.
const DIAGONAL: f64 = core::f64::consts::FRAC_1_SQRT_2;

/// The kind of a contact of the ego. Names in brackets: `MAN_COLL`; pre-crash scenario of DOT HS 810 767.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ContactClass {
    /// The ego's front runs into someone who goes its way ahead of it (front-to-rear; lead vehicle moving slower or
    /// decelerating).
    EgoStrikes,
    /// The ego alone moves sideways into someone beside it (sideswipe; changing lanes or drifting, by the ego).
    EgoSideswipes,
    /// The ego runs into someone who has been standing (lead vehicle stopped; parked vehicle).
    StationaryHit,
    /// Someone enters the ego's path ahead of it, and is struck or sideswiped there (vehicle changing lanes, same
    /// direction).
    CutIn,
    /// Directions cross: either side of either one (angle; crossing paths, turning).
    Crossing,
    /// Against each other, fronts first (front-to-front; opposite direction); also someone who reverses into the ego.
    HeadOn,
    /// Flank to flank, where the other or both moved sideways (sideswipe; drifting, same or opposite direction).
    Sideswipe,
    /// Someone who goes the ego's way runs into its rear (front-to-rear, the ego being the one in front).
    RearEndEgoStruck,
}

impl ContactClass {
    /// Every class, in the order of tables.
    pub const ALL: [ContactClass; 8] = [
        ContactClass::EgoStrikes,
        ContactClass::EgoSideswipes,
        ContactClass::StationaryHit,
        ContactClass::CutIn,
        ContactClass::Crossing,
        ContactClass::HeadOn,
        ContactClass::Sideswipe,
        ContactClass::RearEndEgoStruck,
    ];

    /// Returns the name in files and tables.
    pub fn name(self) -> &'static str {
        match self {
            ContactClass::EgoStrikes => "ego_strikes",
            ContactClass::EgoSideswipes => "ego_sideswipes",
            ContactClass::StationaryHit => "stationary_hit",
            ContactClass::CutIn => "cut_in",
            ContactClass::Crossing => "crossing",
            ContactClass::HeadOn => "head_on",
            ContactClass::Sideswipe => "sideswipe",
            ContactClass::RearEndEgoStruck => "rear_end_ego_struck",
        }
    }

    /// Returns `true` if a careful ego would have prevented a contact of this class with this assessment. A ram from behind never
    /// counts, because the road user behind must keep the distance; all other classes are treated alike.
    pub fn could_be_prevented(self, avoidable: Option<bool>) -> bool {
        avoidable == Some(true) && self != ContactClass::RearEndEgoStruck
    }
}

/// Behaviour of the other before the contact, and directions of the road there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::sim) struct Before {
    /// True if it was outside the ego's path, or not there, [`CUT_IN_STEPS`] ago.
    pub entered: bool,
    /// True if it has been in one place for [`STANDING_STEPS`].
    pub stood: bool,
    /// Unit direction of the ego's route beside the ego.
    pub ego_road: Vec2,
    /// The same beside the other.
    pub other_road: Vec2,
}

impl Before {
    /// Describes the road user that was hit in the k-th step. `ego` is the ego's place along its route.
    pub fn of(plant: &Plant, world: &Others, k: usize, hit: &Hit, ego: &Along) -> Before {
        let past = |steps: usize| place_before(plant, world, k, hit.with, steps.min(k));
        Before::from_places(plant, &hit.size, ego, past(CUT_IN_STEPS), past(STANDING_STEPS), &hit.place)
    }

    /// Describes it from its places [`CUT_IN_STEPS`] and [`STANDING_STEPS`] ago (or when the rollout began) and at the contact.
    pub fn from_places(
        plant: &Plant,
        size: &Size,
        ego: &Along,
        long_ago: Option<Place>,
        lately: Option<Place>,
        now: &Place,
    ) -> Before {
        Before {
            entered: long_ago.is_none_or(|place| !is_in_path(plant, ego.offset_m, &place, size)),
            stood: lately.is_some_and(|place| place.position.distance(now.position) < STANDING_M),
            ego_road: plant.route.direction(ego.segment),
            other_road: plant.route.direction(plant.route.project(now.position).segment),
        }
    }
}

/// Returns the place of a road user some steps before the k-th.
fn place_before(plant: &Plant, world: &Others, k: usize, who: ActorRef, steps: usize) -> Option<Place> {
    match world.actors.iter().find(|actor| actor.who == who) {
        Some(actor) => actor.place_before(steps),
        None => match who {
            ActorRef::Track(track) => plant.rows.find(k - steps, track).map(|row| plant.rows.place(row)),
            ActorRef::Inserted(_) => None,
        },
    }
}

/// Returns `true` if a box reaches into the strip that the ego drives along its route at its present offset.
fn is_in_path(plant: &Plant, ego_offset_m: f64, place: &Place, size: &Size) -> bool {
    let along = plant.route.project(place.position);
    let direction = plant.route.direction(along.segment);
    let across = direction.cross(place.axis).abs();
    let reach_m = size.half_length_m * across + size.half_width_m * direction.dot(place.axis).abs();
    (along.offset_m - ego_offset_m).abs() - reach_m < plant.ego_size.half_width_m + PATH_CLEARANCE_M
}

/// Both road users at the moment of contact.
#[derive(Clone, Copy, Debug)]
pub(in crate::sim) struct Encounter<'a> {
    pub ego: &'a OrientedBox,
    pub other: &'a OrientedBox,
    pub other_velocity: Vec2,
    /// The side of the ego that was touched.
    pub side: Side,
    pub striker: Striker,
    pub before: &'a Before,
}

/// Returns the class of a contact. A road user that was standing was run into, whatever the angle; then directions decide, then the
/// ego's side.
pub(super) fn classify(it: &Encounter<'_>) -> ContactClass {
    let speed = it.other_velocity.norm();
    let course = if speed > MOVING_MPS { it.other_velocity * (1.0 / speed) } else { it.other.axis };
    let alike = it.ego.axis.dot(course);
    let is_ahead = (it.other.center - it.ego.center).dot(it.ego.axis) > it.ego.half_length_m;
    if it.before.stood && speed <= MOVING_MPS {
        return ContactClass::StationaryHit;
    }
    if alike.abs() < DIAGONAL {
        return ContactClass::Crossing;
    }
    match it.side {
        Side::Left | Side::Right if alike > 0.0 && it.before.entered && is_ahead => ContactClass::CutIn,
        Side::Left | Side::Right if it.striker == Striker::Ego => ContactClass::EgoSideswipes,
        Side::Left | Side::Right => ContactClass::Sideswipe,
        Side::Front if alike < 0.0 => ContactClass::HeadOn,
        Side::Front if it.before.entered => ContactClass::CutIn,
        Side::Front => ContactClass::EgoStrikes,
        // Only an ego that reverses, as a recording may, meets someone coming towards its rear.
        Side::Rear if alike < 0.0 => ContactClass::EgoStrikes,
        Side::Rear => ContactClass::RearEndEgoStruck,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two boxes of 4 x 2 m in one place of contact: the other touches the ego's front, heading along it.
    fn class(velocity: Vec2, entered: bool, stood: bool) -> ContactClass {
        let ego = OrientedBox::new(Vec2::ZERO, 0.0, 4.0, 2.0);
        let other = OrientedBox::new(Vec2::new(3.99, 0.5), 0.0, 4.0, 2.0);
        let road = Vec2::new(1.0, 0.0);
        let before = Before { entered, stood, ego_road: road, other_road: road };
        let (side, striker) = (Side::Front, Striker::Both);
        classify(&Encounter { ego: &ego, other: &other, other_velocity: velocity, side, striker, before: &before })
    }

    #[test]
    fn one_place_of_contact_has_as_many_classes_as_motions_lead_to_it() {
        assert_eq!(class(Vec2::new(5.0, 0.0), false, false), ContactClass::EgoStrikes);
        assert_eq!(class(Vec2::new(5.0, 0.0), true, false), ContactClass::CutIn);
        assert_eq!(class(Vec2::new(-5.0, 0.0), false, false), ContactClass::HeadOn, "it reverses");
        assert_eq!(class(Vec2::new(0.0, 5.0), false, false), ContactClass::Crossing, "it slides across");
        assert_eq!(class(Vec2::ZERO, false, true), ContactClass::StationaryHit);
        assert_eq!(class(Vec2::ZERO, false, false), ContactClass::EgoStrikes, "it braked to a stop just now");
    }

    #[test]
    fn directions_part_at_45_and_at_135_degrees() {
        let towards = |degrees: f64| class(Vec2::from_heading(degrees.to_radians()) * 5.0, false, false);
        let classes = [44.0, 46.0, 134.0, 136.0].map(towards);
        use ContactClass::*;
        assert_eq!(classes, [EgoStrikes, Crossing, Crossing, HeadOn]);
    }
}
