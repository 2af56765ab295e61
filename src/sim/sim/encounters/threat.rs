//! When the ego can see that someone is about to meet it.
//!
//! Someone is a *visible threat* at a decision step if a corner or the centre of its box lies in the ego's field of view
//! with nobody's box in between, and
//! - the two boxes overlap at the same time within the horizon, the ego predicted at constant turn rate and speed, the
//!   other at constant velocity or at constant turn rate and speed (the two plainest of the models compared by Schubert,
//!   Richter and Wanielik 2008); or
//! - its box reaches into the ego's envelope: the strip ahead of the ego as long as the safe distance of
//!   responsibility-sensitive safety (Shalev-Shwartz, Shammah and Shashua 2017, definition 1, without speeding up and with
//!   equal brakes), `v ρ + (v² - u²) / 2b` with `u` the other's speed in the ego's direction, at least 0; or
//! - with [`Forecast::Lanes`], the boxes overlap within the horizon, the ego predicted along its route and the other along some way that
//!   its lanes allow, at the speed or the acceleration that each has: a slow turn across is seen before it points at the ego.

use crate::kernel::{OrientedBox, Vec2, num};
use crate::scene::{AgentKind, DT_S};
use crate::sim::prepared::body::{Place, Size};
use crate::sim::prepared::options::{AvoidanceOptions, Forecast};
use crate::sim::road_users::intervention::ActorRef;
use crate::sim::rollouts::closed_loop::ClosedLoop;

use super::ways::ahead;

/// Largest rate at which anybody is expected to gain speed for seconds, m/s².
const GAIN_MPS2_MAX: f64 = 3.0;

/// Watches one road user from step to step.
pub(in crate::sim) struct ThreatWatch<'a> {
    options: &'a AvoidanceOptions,
    /// The road user that it watches.
    who: ActorRef,
    /// Headings of the ego and of the other at the last step, and the other's speed, m/s.
    last: Option<(Vec2, Vec2, f64)>,
    /// Step since which it is visible, and step at which it was seen last.
    visible: Option<usize>,
    seen: usize,
}

/// A body in the plane with a turn rate.
struct Moving<'a> {
    place: Place,
    velocity: Vec2,
    yaw_rate_radps: f64,
    size: &'a Size,
}

impl Moving<'_> {
    /// Returns the box after `seconds` of constant turn rate and speed.
    fn after(&self, seconds: f64) -> OrientedBox {
        let turn = self.yaw_rate_radps * seconds;
        let (sine, cosine) = num::sin_cos(turn);
        let (along_s, aside_s) = if turn.abs() < 1e-6 {
            (seconds, 0.0)
        } else {
            (sine / self.yaw_rate_radps, (1.0 - cosine) / self.yaw_rate_radps)
        };
        let way = self.velocity * along_s + self.velocity.left() * aside_s;
        let axis = self.place.axis * cosine + self.place.axis.left() * sine;
        self.size.at(Place { position: self.place.position + way, axis })
    }

    /// Returns `true` if two bodies overlap at some moment within the horizon.
    fn meets(&self, other: &Moving<'_>, horizon_s: f64) -> bool {
        let reach_m = self.size.radius_m + other.size.radius_m;
        moments(horizon_s).any(|seconds| near_overlap(&self.after(seconds), &other.after(seconds), reach_m))
    }
}

fn moments(horizon_s: f64) -> impl Iterator<Item = f64> {
    (0..=(horizon_s / DT_S) as usize).map(|j| j as f64 * DT_S)
}

fn near_overlap(a: &OrientedBox, b: &OrientedBox, reach_m: f64) -> bool {
    (a.center - b.center).norm_squared() <= reach_m * reach_m && a.overlaps(b)
}

/// The other on its lanes: its box, its speed (m/s) and the growth of its speed (m/s²).
struct OnLanes<'a> {
    place: Place,
    size: &'a Size,
    speed_mps: f64,
    gain_mps2: f64,
}

impl OnLanes<'_> {
    /// Returns `true` if the ego, going along its route at its speed, overlaps it on some way within the horizon.
    fn meets(&self, state: &ClosedLoop<'_>, horizon_s: f64) -> bool {
        let (ego, route) = (&state.ego, &state.plant.route);
        let reach_m = ego.size.radius_m + self.size.radius_m;
        let own: Vec<OrientedBox> = moments(horizon_s)
            .map(|seconds| {
                let s_m = ego.along.s_m + ego.speed_mps * seconds;
                let segment = route.segment_near(s_m, ego.along.segment);
                let axis = route.direction(segment);
                let position = route.at(s_m, segment) + axis.left() * ego.along.offset_m;
                ego.size.at(Place { position, axis })
            })
            .collect();
        let way_m = |gain_mps2: f64, seconds: f64| (self.speed_mps + 0.5 * gain_mps2 * seconds) * seconds;
        let farthest_m = way_m(self.gain_mps2, horizon_s);
        let lanes = ahead(state.plant.lanes(), &self.place, farthest_m);
        let gains: &[f64] = if self.gain_mps2 > 0.0 { &[0.0, self.gain_mps2] } else { &[0.0] };
        lanes.iter().any(|lane| {
            gains.iter().any(|&gain_mps2| {
                moments(horizon_s).zip(&own).any(|(seconds, own)| {
                    let there = lane.after(way_m(gain_mps2, seconds));
                    there.is_some_and(|place| near_overlap(own, &self.size.at(place), reach_m))
                })
            })
        })
    }
}

impl<'a> ThreatWatch<'a> {
    pub fn new(options: &'a AvoidanceOptions, who: ActorRef) -> ThreatWatch<'a> {
        ThreatWatch { options, who, last: None, visible: None, seen: 0 }
    }

    /// Returns the step since which the threat is visible at the k-th: the first of the last run of steps in which it is seen. The ego keeps it
    /// in mind for the reaction time, so shorter interruptions do not end a run. Called once a step, in order.
    pub fn visible_since(&mut self, state: &ClosedLoop<'_>, k: usize) -> Option<usize> {
        let sees = self.sees(state, k);
        if k - self.seen > in_steps(self.options.reaction_s) {
            self.visible = None;
        }
        if sees {
            self.visible = self.visible.or(Some(k));
            self.seen = k;
        }
        self.visible
    }

    /// Returns `true` if it is a visible threat at the k-th step.
    fn sees(&mut self, state: &ClosedLoop<'_>, k: usize) -> bool {
        let Some((place, velocity, size)) = place_of(state, k, self.who) else {
            self.last = None;
            return false;
        };
        let (ego, rate) =
            (&state.ego, |before: Vec2, axis: Vec2| num::atan2(before.cross(axis), before.dot(axis)) / DT_S);
        let speed_mps = velocity.norm();
        let (own_radps, other_radps, gain_mps2) = self.last.map_or((0.0, 0.0, 0.0), |(own, other, before_mps)| {
            (rate(own, ego.axis), rate(other, place.axis), (speed_mps - before_mps) / DT_S)
        });
        self.last = Some((ego.axis, place.axis, speed_mps));
        let own = Moving {
            place: Place { position: ego.sample.position, axis: ego.axis },
            velocity: ego.sample.velocity,
            yaw_rate_radps: own_radps,
            size: &ego.size,
        };
        let other = |yaw_rate_radps| Moving { place, velocity, yaw_rate_radps, size: &size };
        let horizon_s = self.options.horizon_s;
        let threatens = self.is_in_envelope(&own, &size.at(place), velocity)
            || own.meets(&other(0.0), horizon_s)
            || own.meets(&other(other_radps), horizon_s)
            || self.options.forecast == Forecast::Lanes
                && size.kind != AgentKind::Pedestrian
                && OnLanes { place, size: &size, speed_mps, gain_mps2: gain_mps2.clamp(0.0, GAIN_MPS2_MAX) }
                    .meets(state, horizon_s);
        threatens && self.is_in_view(state, k, &size.at(place))
    }

    fn is_in_envelope(&self, ego: &Moving<'_>, other: &OrientedBox, velocity: Vec2) -> bool {
        let (speed, axis) = (ego.velocity.norm(), ego.place.axis);
        let away = velocity.dot(axis).max(0.0);
        let braking_m = (speed * speed - away * away) / (2.0 * self.options.brake_mps2);
        let length_m = speed * self.options.reaction_s + braking_m;
        if length_m <= 0.0 {
            return false;
        }
        let center = ego.place.position + axis * (ego.size.half_length_m + 0.5 * length_m);
        let half_width_m = ego.size.half_width_m;
        OrientedBox { center, axis, half_length_m: 0.5 * length_m, half_width_m }.overlaps(other)
    }

    /// Returns `true` if a corner or the centre of the box lies in the field of view with nobody in between.
    fn is_in_view(&self, state: &ClosedLoop<'_>, k: usize, shape: &OrientedBox) -> bool {
        let (eye, axis) = (state.ego.sample.position, state.ego.axis);
        let half_view_rad = 0.5 * self.options.field_of_view_deg * num::PI / 180.0;
        let mut places = shape.corners().to_vec();
        places.push(shape.center);
        places.retain(|&place| {
            let to = place - eye;
            num::atan2(axis.cross(to), axis.dot(to)).abs() <= half_view_rad
        });
        let farthest_m = places.iter().map(|place| place.distance(eye)).fold(0.0, f64::max);
        state.world.for_each_near(&state.plant, k, eye, farthest_m, |near| {
            let hides = matches!(near.size.kind, AgentKind::Vehicle | AgentKind::Static) && near.who != self.who;
            if hides {
                let cover = near.size.at(Place { position: near.position, axis: near.axis });
                places.retain(|&place| !crosses(eye, place, &cover));
            }
        });
        !places.is_empty()
    }
}

/// Returns the number of whole decision steps that hold a time.
pub(super) fn in_steps(seconds: f64) -> usize {
    // A hair less, so that 0.3 s are three steps and not four.
    (seconds / DT_S - 1e-9).ceil().max(0.0) as usize
}

/// Returns place, velocity and box of a road user at the k-th step; `None` while it is not there.
pub(super) fn place_of(state: &ClosedLoop<'_>, k: usize, who: ActorRef) -> Option<(Place, Vec2, Size)> {
    if let Some(actor) = state.world.actors.iter().find(|actor| actor.who == who) {
        let now = actor.now.as_ref()?;
        return Some((Place { position: now.position, axis: actor.axis }, now.velocity, actor.size));
    }
    let ActorRef::Track(track) = who else { return None };
    let plant = &*state.plant;
    let row = plant.rows.find(k, track)?;
    Some((plant.rows.place(row), plant.rows.sample(k, row).velocity, plant.sizes[track]))
}

/// Returns `true` if the straight line between two points passes through a box (clipped against its slabs).
fn crosses(from: Vec2, to: Vec2, cover: &OrientedBox) -> bool {
    let (start, way) = (from - cover.center, to - from);
    let (mut enter, mut leave) = (0.0f64, 1.0f64);
    for (axis, half_m) in [(cover.axis, cover.half_length_m), (cover.axis.left(), cover.half_width_m)] {
        let (at, speed) = (start.dot(axis), way.dot(axis));
        if speed.abs() < 1e-12 {
            if at.abs() > half_m {
                return false;
            }
            continue;
        }
        let (one, two) = ((-half_m - at) / speed, (half_m - at) / speed);
        (enter, leave) = (enter.max(one.min(two)), leave.min(one.max(two)));
    }
    enter <= leave
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_box_between_two_points_hides_one_from_the_other_and_one_beside_or_behind_does_not() {
        let (eye, far) = (Vec2::ZERO, Vec2::new(20.0, 0.0));
        let cover = |x, y| OrientedBox::new(Vec2::new(x, y), 0.4, 4.0, 2.0);
        assert!(crosses(eye, far, &cover(10.0, 0.5)));
        assert!(!crosses(eye, far, &cover(10.0, 3.0)));
        assert!(!crosses(eye, far, &cover(25.0, 0.0)));
    }

    #[test]
    fn a_turning_body_is_predicted_along_its_circle() {
        let size = Size::new(AgentKind::Vehicle, 4.0, 2.0);
        let place = Place { position: Vec2::ZERO, axis: Vec2::new(1.0, 0.0) };
        let body = Moving { place, velocity: Vec2::new(10.0, 0.0), yaw_rate_radps: 0.5, size: &size };
        // Radius v / ω = 20 m: a quarter circle after π/2 / 0.5 s ends at (20, 20), heading +y.
        let quarter = body.after(num::PI);
        assert!(quarter.center.distance(Vec2::new(20.0, 20.0)) < 1e-9, "{quarter:?}");
        assert!(quarter.axis.distance(Vec2::new(0.0, 1.0)) < 1e-9);
    }
}
