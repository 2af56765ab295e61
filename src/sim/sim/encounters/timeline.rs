//! The time line of a contact: when the threat was visible, when the ego began to react, and the last moment at which each evasive manoeuvre
//! would have avoided it. Collision avoidance calls the time from there to the contact time to brake and time to steer, and the
//! least of them time to react (Hillenbrand, Spieker and Kroschel 2006).

use serde::{Deserialize, Serialize};

use crate::scene::DT_S;
use crate::sim::SimError;
use crate::sim::accounts::outcome::Contact;
use crate::sim::prepared::path::{Along, Path};
use crate::sim::prepared::plant::Plant;
use crate::sim::road_users::actors::CUT_IN_STEPS;
use crate::sim::road_users::driver::Driver;
use crate::sim::road_users::intervention::Intervention;
use crate::sim::rollouts::closed_loop::ClosedLoop;

use super::avoidance::{Driven, Relived, helps, is_late, relive};
use super::class::ContactClass;
use super::evasion::Manoeuvre;
use super::threat::{ThreatWatch, in_steps, place_of};
use super::touch::Side;

/// Deceleration above which the ego reacts, m/s²: more than rolling and letting go of the pedal cause.
const BRAKES_MPS2: f64 = 1.5;
/// Offset from its place in the lane at which the ego reacts, and offset up to which it had not begun to, metres.
const STEERS_M: f64 = 0.3;
const HARDLY_M: f64 = 0.05;
/// Length of route whose chord cuts a bend as much as steering towards a point ahead (pure pursuit, Coulter 1992) does, metres. Such a
/// cut is no reaction.
const CHORD_M: f64 = 12.0;

/// Times of the events that led to a contact, since the first simulated step, s.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Timeline {
    /// The contact.
    pub contact_s: f64,
    /// Time from which on the ego could see it coming; `None` if it never could.
    pub visible_s: Option<f64>,
    /// The ego's first reaction from then on; where it saw nothing, within the last four seconds.
    pub reaction: Option<Reaction>,
    /// Its hardest braking from then on, m/s².
    pub braked_mps2_max: f64,
    /// Side of the ego from which the other came.
    pub from: Side,
    /// The last chance of every manoeuvre, in the order in which they are tried.
    pub chances: Vec<Chance>,
}

/// The ego's first reaction.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Reaction {
    /// The decision with which it began, s.
    pub at_s: f64,
    /// Kind of the reaction.
    pub by: Reacted,
}

/// A way to react.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Reacted {
    /// It slowed down.
    Braked,
    /// It left its place in the lane to the left.
    SteeredLeft,
    /// The same to the right.
    SteeredRight,
}

/// A manoeuvre, and the time until which it would have helped.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Chance {
    /// The manoeuvre.
    pub by: Manoeuvre,
    /// The last decision with which it could begin and avoid the contact, s; `None` where none of the last four seconds could.
    pub last_s: Option<f64>,
}

impl Timeline {
    /// Returns the manoeuvre that would have helped the longest; of equal ones the plainest. `None` where none would have.
    pub fn last_chance(&self) -> Option<Chance> {
        let with = self.chances.iter().copied().filter(|chance| chance.last_s.is_some());
        with.reduce(|best, other| if other.last_s > best.last_s { other } else { best })
    }
}

/// Returns the time line of a contact, which must be that of the rollout of the same plant, intervention and driver.
///
/// # Errors
/// The same as those of the rollout itself.
pub fn timeline(
    plant: &Plant,
    intervention: &Intervention,
    driver: &mut dyn Driver,
    contact: &Contact,
) -> Result<Timeline, SimError> {
    timeline_relived(&mut Driven::begun(plant, intervention, driver)?, contact)
}

/// The part of the ego's state at a step that shows reactions.
#[derive(Clone, Copy)]
struct Moment {
    speed_mps: f64,
    /// Distance to the left of its route and of the line that cuts its bends, metres.
    aside_m: f64,
    /// Distance of the other to the left of the ego, metres.
    other_left_m: Option<f64>,
}

/// Does the same as [`timeline`] for a rollout that is driven again from its first state.
pub(in crate::sim) fn timeline_relived<'a>(
    rollout: &mut dyn Relived<'a>,
    contact: &Contact,
) -> Result<Timeline, SimError> {
    let options = &{ rollout.state().plant.options().avoidance };
    let mut watch = ThreatWatch::new(options, contact.with);
    let mut moments: Vec<Moment> = Vec::new();
    let mut states: Vec<(usize, ClosedLoop<'a>)> = Vec::new();
    let mut visible = None;
    let last = relive(rollout, |rollout, k| {
        visible = watch.visible_since(rollout.state(), k);
        moments.push(moment(rollout.state(), k, contact));
        states.extend(is_late(contact, k).then(|| (k, rollout.fork(k))));
    })?;
    let until = last + in_steps(options.horizon_s);
    let last_helpful =
        |by: Manoeuvre| states.iter().rev().find(|(k, state)| helps(state, *k, until, by, options)).map(|of| of.0);
    let chance = |by: Manoeuvre| Chance { by, last_s: last_helpful(by).map(in_seconds) };
    let from = visible.or(states.first().map(|of| of.0)).unwrap_or(last);
    Ok(Timeline {
        contact_s: contact.time_s,
        visible_s: visible.map(in_seconds),
        reaction: reaction(&moments, from),
        braked_mps2_max: decelerations(&moments, from).map(|(_, hard)| hard).fold(0.0, f64::max),
        from: whence(contact, &moments),
        chances: Manoeuvre::ALL.map(chance).to_vec(),
    })
}

fn in_seconds(step: usize) -> f64 {
    step as f64 * DT_S
}

fn moment(state: &ClosedLoop<'_>, k: usize, contact: &Contact) -> Moment {
    let ego = &state.ego;
    let left_m = |at: crate::kernel::Vec2| ego.axis.cross(at - ego.sample.position);
    let other_left_m = place_of(state, k, contact.with).map(|(place, ..)| left_m(place.position));
    Moment { speed_mps: ego.speed_mps, aside_m: beside_own_line_m(&state.plant.route, &ego.along), other_left_m }
}

/// Returns how far a place is to the left of a route and of the line that cuts its bends, metres: 0 between the two.
fn beside_own_line_m(route: &Path, along: &Along) -> f64 {
    let at = |s_m: f64| route.at(s_m, along.segment);
    let chord = at(along.s_m - 0.5 * CHORD_M).lerp(at(along.s_m + 0.5 * CHORD_M), 0.5);
    let cut_m = route.project_near(chord, along, CHORD_M, CHORD_M).offset_m;
    along.offset_m - along.offset_m.clamp(cut_m.min(0.0), cut_m.max(0.0))
}

/// Yields each decision from a step on, with the deceleration that it caused, m/s².
fn decelerations(moments: &[Moment], from: usize) -> impl Iterator<Item = (usize, f64)> {
    let pairs = moments.windows(2).enumerate().skip(from);
    pairs.map(|(k, pair)| (k, (pair[0].speed_mps - pair[1].speed_mps) / DT_S))
}

/// Returns the ego's first reaction from a step on.
fn reaction(moments: &[Moment], from: usize) -> Option<Reaction> {
    let braked = decelerations(moments, from).find(|(_, hard)| *hard > BRAKES_MPS2).map(|(k, _)| (k, Reacted::Braked));
    let start_m = moments.get(from)?.aside_m;
    let aside_m = |k: usize| moments[k].aside_m - start_m;
    let steered = (from..moments.len()).find(|k| aside_m(*k).abs() >= STEERS_M).map(|far| {
        let began = (from..far).rev().find(|k| aside_m(*k).abs() < HARDLY_M).unwrap_or(from);
        (began, if aside_m(far) > 0.0 { Reacted::SteeredLeft } else { Reacted::SteeredRight })
    });
    let first = match (braked, steered) {
        (Some(braked), Some(steered)) if steered.0 < braked.0 => steered,
        (braked, steered) => braked.or(steered)?,
    };
    Some(Reaction { at_s: in_seconds(first.0), by: first.1 })
}

/// Returns the side from which the other came. One that crosses came from the side that its motion leads away from; one that cuts in
/// or brushes along came from the side on which it was two seconds before.
fn whence(contact: &Contact, moments: &[Moment]) -> Side {
    let side = |left: bool| if left { Side::Left } else { Side::Right };
    match contact.class {
        ContactClass::Crossing => side(contact.impact_angle_rad < 0.0),
        ContactClass::CutIn | ContactClass::Sideswipe | ContactClass::EgoSideswipes => {
            let lately = moments.iter().rev().take(CUT_IN_STEPS + 1);
            lately
                .filter_map(|moment| moment.other_left_m)
                .next_back()
                .map_or(contact.ego_side, |left_m| side(left_m > 0.0))
        }
        ContactClass::EgoStrikes | ContactClass::StationaryHit | ContactClass::HeadOn => Side::Front,
        ContactClass::RearEndEgoStruck => Side::Rear,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernel::{Vec2, num};

    /// A quarter of a circle to the left with this radius, 10 m straight before and behind it.
    fn bend(radius_m: f64) -> Path {
        let arc = (0..=40).map(|k| {
            let turned = 0.5 * num::PI * f64::from(k) / 40.0;
            Vec2::new(10.0 + radius_m * num::sin(turned), radius_m * (1.0 - num::cos(turned)))
        });
        let end = Vec2::new(10.0 + radius_m, radius_m);
        let points: Vec<Vec2> = std::iter::once(Vec2::ZERO).chain(arc).chain([end + Vec2::new(0.0, 10.0)]).collect();
        Path::new(&points, 0.0).unwrap()
    }

    fn aside_m(route: &Path, s_m: f64, offset_m: f64) -> f64 {
        beside_own_line_m(route, &Along { s_m, offset_m, segment: route.segment_near(s_m, 0) })
    }

    #[test]
    fn a_cut_bend_is_no_way_aside_and_whatever_goes_beyond_it_is() {
        let route = bend(20.0);
        let middle_m = 0.5 * route.length_m();
        // The chord of 12 m lies 0.9 m inside a circle of 20 m.
        assert_eq!(aside_m(&route, middle_m, 0.3), 0.0);
        assert_eq!(aside_m(&route, middle_m, 0.85), 0.0);
        assert!((aside_m(&route, middle_m, 1.5) - 0.6).abs() < 0.03, "{}", aside_m(&route, middle_m, 1.5));
        assert_eq!(aside_m(&route, middle_m, -0.3), -0.3, "outwards nobody cuts");
        for offset_m in [-0.4, 0.3, 2.0] {
            let found_m = aside_m(&bend(1e6), 400.0, offset_m);
            assert!((found_m - offset_m).abs() < 1e-6, "a straight way is its own line: {found_m}");
        }
    }

    #[test]
    fn the_first_that_brakes_hard_or_leaves_its_line_is_the_reaction() {
        let moments = |speeds: [f64; 6], aside: [f64; 6]| -> Vec<Moment> {
            let both = speeds.into_iter().zip(aside);
            both.map(|(speed_mps, aside_m)| Moment { speed_mps, aside_m, other_left_m: None }).collect()
        };
        let (even, straight) = ([8.0; 6], [0.0; 6]);
        let by = |speeds, aside| reaction(&moments(speeds, aside), 0);
        assert_eq!(by(even, straight), None);
        assert_eq!(by(even, [0.0, 0.1, 0.2, 0.29, 0.29, 0.29]), None);
        let left = by(even, [0.0, 0.0, 0.1, 0.2, 0.3, 0.4]);
        assert_eq!(left, Some(Reaction { at_s: 0.1, by: Reacted::SteeredLeft }));
        let braked = by([8.0, 8.0, 7.9, 7.7, 7.0, 6.0], [0.0, 0.0, 0.0, 0.0, -0.1, -0.5]);
        assert_eq!(braked, Some(Reaction { at_s: 0.2, by: Reacted::Braked }));
    }
}
