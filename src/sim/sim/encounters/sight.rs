//! Lengths of an ego's rays: the readings of a lidar and of a detector of the road's edge.

use crate::kernel::{OrientedBox, Vec2};
use crate::sim::prepared::body::Place;
use crate::sim::prepared::drivable::Drivable;
use crate::sim::prepared::ray::Ray;
use crate::sim::road_users::driver::View;

/// Distance between the places along a ray at which the road's edge is looked for, metres: a narrower gap may be missed.
const EDGE_STEP_M: f64 = 1.0;
/// Halvings of that step once the ray has passed the edge: 1/16 m.
const EDGE_HALVINGS: u32 = 4;

impl View<'_> {
    /// Sets each of `out` to the metres from the ego's centre to where the drivable surface ends in that unit direction, at
    /// most `reach_m`; 0 where the centre is beside it already, `reach_m` where the scene does not say where one may drive.
    pub fn road_edges_m(&self, directions: &[Vec2], reach_m: f64, out: &mut [f64]) {
        let (drivable, center) = (&self.plant.drivable, self.ego.sample.position);
        let mut hint = 0;
        let at_center = drivable.holds(center, &mut hint);
        for (direction, edge_m) in directions.iter().zip(out) {
            *edge_m = if at_center { edge_m_from(drivable, center, *direction, reach_m, hint) } else { 0.0 };
        }
    }

    /// Sets each of `out` to the metres from the ego's centre to the box of the nearest other road user on a ray, or to
    /// `reach_m` where the ray meets nobody nearer. The first ray runs along the heading, the others counter-clockwise at
    /// equal angles.
    pub fn lidar_m(&self, directions: &[Vec2], reach_m: f64, out: &mut [f64]) {
        out.fill(reach_m);
        let center = self.ego.sample.position;
        // Larger by more than any box's radius, so that the near end of a far box is seen.
        self.world.for_each_near(self.plant, self.k, center, reach_m + 10.0, |near| {
            let body = near.size.at(Place { position: near.position, axis: near.axis });
            let delta = near.position - center;
            for (direction, nearest) in directions.iter().zip(out.iter_mut()) {
                let (along, across) = (direction.dot(delta), direction.cross(delta));
                if across.abs() <= near.size.radius_m && along > -near.size.radius_m {
                    *nearest = nearest.min(ray_m(center, *direction, &body).unwrap_or(*nearest));
                }
            }
        });
    }
}

/// Returns the distance to the end of the drivable surface on a ray from a place on it; `hint` is a piece near that place.
fn edge_m_from(drivable: &Drivable, from: Vec2, direction: Vec2, reach_m: f64, hint: u32) -> f64 {
    let mut ray = Ray::new(drivable, from, direction, hint);
    edge_by_places_m(|at_m| ray.holds(at_m), reach_m)
}

/// Returns the distance at which a ray that begins on the surface leaves it, metres. `holds` tells if a place is on it.
fn edge_by_places_m(mut holds: impl FnMut(f64) -> bool, reach_m: f64) -> f64 {
    let mut inside_m = 0.0;
    while inside_m < reach_m {
        let mut outside_m = (inside_m + EDGE_STEP_M).min(reach_m);
        if holds(outside_m) {
            inside_m = outside_m;
            continue;
        }
        for _ in 0..EDGE_HALVINGS {
            let middle_m = 0.5 * (inside_m + outside_m);
            if holds(middle_m) { inside_m = middle_m } else { outside_m = middle_m }
        }
        return inside_m;
    }
    reach_m
}

/// Returns the distance at which a ray enters a box, metres from its start; 0 from inside, `None` where it misses.
fn ray_m(from: Vec2, direction: Vec2, body: &OrientedBox) -> Option<f64> {
    let delta = from - body.center;
    let slabs = [
        (delta.dot(body.axis), direction.dot(body.axis), body.half_length_m),
        (body.axis.cross(delta), body.axis.cross(direction), body.half_width_m),
    ];
    let (mut enters_m, mut leaves_m) = (0.0_f64, f64::INFINITY);
    for (place, slope, half) in slabs {
        if slope == 0.0 {
            if place.abs() > half {
                return None;
            }
            continue;
        }
        let (a, b) = ((-half - place) / slope, (half - place) / slope);
        enters_m = enters_m.max(a.min(b));
        leaves_m = leaves_m.min(a.max(b));
    }
    (enters_m <= leaves_m).then_some(enters_m)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::sim::prepared::drivable::samples::surface;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(400))]

        #[test]
        fn what_is_skipped_on_a_ray_changes_no_edge(
            ends in prop::collection::vec((-40..=40, -40..=40), 2..12),
            from in (-80..=80, -80..=80),
            turn in 0..48,
            hint in 0u32..12,
        ) {
            let drivable = surface(&ends);
            let from = Vec2::new(0.25 * f64::from(from.0), 0.25 * f64::from(from.1));
            let direction = Vec2::from_heading(f64::from(turn) * std::f64::consts::TAU / 48.0);
            prop_assert_eq!(drivable.holds(from, &mut hint.clone()), drivable.holds_by_walk(from));
            let plain = edge_by_places_m(|at_m| drivable.holds_by_walk(from + direction * at_m), 30.0);
            prop_assert_eq!(edge_m_from(&drivable, from, direction, 30.0, hint), plain);
        }
    }

    #[test]
    fn a_ray_meets_a_box_where_it_stands() {
        let body = OrientedBox {
            center: Vec2::new(10.0, 1.0),
            axis: Vec2::new(1.0, 0.0),
            half_length_m: 2.0,
            half_width_m: 1.0,
        };
        let east = Vec2::new(1.0, 0.0);
        assert_eq!(ray_m(Vec2::ZERO, east, &body), Some(8.0));
        assert_eq!(ray_m(Vec2::new(10.0, 1.5), east, &body), Some(0.0), "from inside");
        assert_eq!(ray_m(Vec2::new(0.0, -0.5), east, &body), None, "beside");
        assert_eq!(ray_m(Vec2::ZERO, -east, &body), None, "behind");
        let diagonal = OrientedBox { axis: Vec2::from_heading(std::f64::consts::FRAC_PI_4), ..body };
        let found = ray_m(Vec2::new(0.0, 1.0), east, &diagonal).unwrap();
        assert!((found - (10.0 - 2.0_f64.sqrt())).abs() < 1e-12, "{found}");
    }
}
