//! Places on a ray over the drivable surface, asked for one after the other outward. Most of them lie on the same piece as
//! an earlier place, so most need no search.

use crate::kernel::Vec2;

use super::drivable::Drivable;

/// Distance between the places looked at beside a vehicle, metres, and their number.
const PROBE_M: f64 = 0.5;
const PROBES: usize = 10;

/// A ray from a place on the surface.
pub(in crate::sim) struct Ray<'a> {
    road: &'a Drivable,
    from: Vec2,
    direction: Vec2,
    /// The piece that held the last place.
    hint: u32,
    /// Distance up to which the surface surely goes on, metres.
    sure_m: f64,
}

impl<'a> Ray<'a> {
    /// Starts in a unit direction; `hint` is a piece near the first place.
    pub fn new(road: &'a Drivable, from: Vec2, direction: Vec2, hint: u32) -> Ray<'a> {
        Ray { road, from, direction, hint, sure_m: road.surely_holds_for_m(from, direction, hint) }
    }

    /// Returns `true` if the surface holds the place this far along.
    pub fn holds(&mut self, at_m: f64) -> bool {
        if at_m <= self.sure_m {
            return true;
        }
        let place = self.from + self.direction * at_m;
        let held_m = self.road.holds_for_m(place, self.direction, &mut self.hint);
        self.sure_m = held_m.map_or(self.sure_m, |further_m| at_m + further_m);
        held_m.is_some()
    }
}

/// Returns how far the road goes on from a place in a unit direction, metres, in steps of [`PROBE_M`]; 0 where the place is off the road.
/// `hint` is a piece near the place, and becomes one that holds it.
pub(in crate::sim) fn room_m(road: &Drivable, from: Vec2, side: Vec2, hint: &mut u32) -> f64 {
    let Some(sure_m) = road.holds_for_m(from, side, hint) else { return 0.0 };
    let mut ray = Ray { road, from, direction: side, hint: *hint, sure_m };
    room_by_places_m(|at_m| ray.holds(at_m))
}

/// Computes [`room_m`] for a place on the road. `holds` tells if a place beside it is on the road.
fn room_by_places_m(mut holds: impl FnMut(f64) -> bool) -> f64 {
    (1..=PROBES).take_while(|probe| holds(*probe as f64 * PROBE_M)).count() as f64 * PROBE_M
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::sim::prepared::drivable::samples::surface;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(400))]

        #[test]
        fn what_is_skipped_beside_a_vehicle_changes_no_room(
            ends in prop::collection::vec((-20..=20, -20..=20), 2..12),
            from in (-40..=40, -40..=40),
            turn in 0..48,
            hint in 0u32..12,
        ) {
            let road = surface(&ends);
            let from = Vec2::new(0.25 * f64::from(from.0), 0.25 * f64::from(from.1));
            let side = Vec2::from_heading(f64::from(turn) * std::f64::consts::TAU / 48.0);
            let plain = if road.holds_by_walk(from) { room_by_places_m(|at_m| road.holds_by_walk(from + side * at_m)) } else { 0.0 };
            let (mut fast_hint, mut slow_hint) = (hint, hint);
            prop_assert_eq!(room_m(&road, from, side, &mut fast_hint), plain);
            road.holds(from, &mut slow_hint);
            prop_assert_eq!(fast_hint, slow_hint, "the next question begins at the same piece");
        }
    }
}
