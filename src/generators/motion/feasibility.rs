//! AT's hard constraint: offsets from a logged path are scaled down together, θ = 1.00, 0.99, .. until the path's
//! speed, acceleration and jerk, along and across, keep their bounds.
//!
//! Derivatives are differences over the interval of the record on which the bounds are maxima (0.5 s in nuScenes), at
//! every step of the path: differences over shorter times show the noise of a record and not how a vehicle moves, and a
//! bound that was measured over half a second says nothing about them. "Along" and "across" refer to the logged
//! direction, so that every bound except the speed's is linear in θ, and the first feasible θ is found without trying
//! each. The log's own share of a bound is computed once for each path. A bound that the log itself exceeds (noise) is
//! widened to the log's value: a path is never held to more than what was recorded. If no θ of the grid is feasible,
//! nothing is changed.

use crate::kernel::Vec2;
use crate::scene::DT_S;

/// Bounds of a perturbed path, SI.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Largest offset from the log, metres.
    pub offset_m_max: f64,
    /// Largest speed, m/s.
    pub speed_mps_max: f64,
    /// Largest acceleration along, m/s².
    pub acceleration_mps2_max: f64,
    /// Largest acceleration across, m/s².
    pub lateral_mps2_max: f64,
    /// Largest jerk along, m/s³.
    pub jerk_mps3_max: f64,
    /// Largest jerk across, m/s³.
    pub lateral_jerk_mps3_max: f64,
    /// Steps between two samples of the record on which these are maxima, 1 to [`INTERVAL_STEPS_MAX`].
    pub interval_steps: usize,
}

/// The longest interval that derivatives are taken over, steps.
pub const INTERVAL_STEPS_MAX: usize = 10;

/// A logged path with the history that its first derivatives need.
#[derive(Clone, Debug)]
pub struct LoggedPath {
    /// History (up to three intervals), then the path.
    points: Vec<Vec2>,
    /// Number of points that are history: their offset is 0.
    history: usize,
    /// Unit direction at every point.
    directions: Vec<Vec2>,
    bounds: Bounds,
    /// The margin that the log leaves for offsets, one entry for each movable point.
    rooms: Vec<Room>,
}

/// How far a path's derivatives at one point may still go: [(down, up); 4] of acceleration along and across and of
/// jerk along and across, each at least 0; infinite where history is too short for that order.
#[derive(Clone, Copy, Debug)]
struct Room {
    direction: Vec2,
    /// The log's velocity, m/s; `None` where there is no point before.
    velocity: Option<Vec2>,
    sides: [(f64, f64); 4],
}

impl LoggedPath {
    /// A path whose first `history` points cannot move; bounds that the log exceeds are widened to the log's values.
    pub fn new(points: Vec<Vec2>, history: usize, directions: Vec<Vec2>, bounds: Bounds) -> LoggedPath {
        let bounds = Bounds { interval_steps: bounds.interval_steps.clamp(1, INTERVAL_STEPS_MAX), ..bounds };
        let mut path = LoggedPath { points, history, directions, bounds, rooms: Vec::new() };
        let own = path.extremes(&[], 0.0);
        path.bounds = Bounds {
            offset_m_max: bounds.offset_m_max,
            interval_steps: bounds.interval_steps,
            speed_mps_max: bounds.speed_mps_max.max(own.speed_mps_max),
            acceleration_mps2_max: bounds.acceleration_mps2_max.max(own.acceleration_mps2_max),
            lateral_mps2_max: bounds.lateral_mps2_max.max(own.lateral_mps2_max),
            jerk_mps3_max: bounds.jerk_mps3_max.max(own.jerk_mps3_max),
            lateral_jerk_mps3_max: bounds.lateral_jerk_mps3_max.max(own.lateral_jerk_mps3_max),
        };
        path.rooms = path.rooms();
        path
    }

    fn rooms(&self) -> Vec<Room> {
        let free = [(f64::INFINITY, f64::INFINITY); 4];
        let movable = self.directions.iter().skip(self.history);
        let mut rooms: Vec<Room> = movable.map(|d| Room { direction: *d, velocity: None, sides: free }).collect();
        let around = |value: f64, bound: f64| ((bound + value).max(0.0), (bound - value).max(0.0));
        self.visit(&[], |place, order, direction, base, _| {
            let room = &mut rooms[place];
            let (first, second) = match order {
                1 => return room.velocity = Some(base),
                2 => (self.bounds.acceleration_mps2_max, self.bounds.lateral_mps2_max),
                _ => (self.bounds.jerk_mps3_max, self.bounds.lateral_jerk_mps3_max),
            };
            room.sides[2 * order - 4] = around(base.dot(direction), first);
            room.sides[2 * order - 3] = around(base.dot(direction.left()), second);
        });
        rooms
    }

    /// The bounds that hold on this path.
    pub fn bounds(&self) -> &Bounds {
        &self.bounds
    }

    /// Intervals a second.
    fn rate_hz(&self) -> f64 {
        1.0 / (DT_S * self.bounds.interval_steps as f64)
    }

    /// The largest θ of 1.00, 0.99, .. 0.01 with which `offsets` keep all bounds, else 0.
    pub fn scale(&self, offsets: &[Vec2]) -> f64 {
        let largest = offsets.iter().map(|d| d.norm()).fold(0.0, f64::max);
        let mut theta: f64 = if largest > self.bounds.offset_m_max { self.bounds.offset_m_max / largest } else { 1.0 };
        let speed_squared = self.bounds.speed_mps_max * self.bounds.speed_mps_max;
        let (interval, rate) = (self.bounds.interval_steps, self.rate_hz());
        // Offset, velocity and acceleration an interval ago, by the step's place in the interval.
        let mut ago = [[Vec2::ZERO; 3]; INTERVAL_STEPS_MAX];
        for (k, (room, offset)) in self.rooms.iter().zip(offsets).enumerate() {
            let before = &mut ago[k % interval];
            let velocity = (*offset - before[0]) * rate;
            let acceleration = (velocity - before[1]) * rate;
            let jerk = (acceleration - before[2]) * rate;
            *before = [*offset, velocity, acceleration];
            // It is tried before it is solved for: at most points no bound is active, and a bound that holds at θ holds
            // for every smaller θ.
            if let Some(own) = room.velocity
                && (own + velocity * theta).norm_squared() > speed_squared
            {
                theta = theta.min(within_circle(own, velocity, self.bounds.speed_mps_max));
            }
            let left = room.direction.left();
            let changes =
                [acceleration.dot(room.direction), acceleration.dot(left), jerk.dot(room.direction), jerk.dot(left)];
            for (change, (down, up)) in changes.into_iter().zip(room.sides) {
                let side = if change < 0.0 { down } else { up };
                if change.abs() * theta > side {
                    theta = side / change.abs();
                }
            }
        }
        // A rounding error must not cost a step of the grid.
        ((theta * 100.0 + 1e-9).floor() / 100.0).clamp(0.0, 1.0)
    }

    /// Largest offset, speed, acceleration and jerk of the path with `theta` times the offsets.
    pub fn extremes(&self, offsets: &[Vec2], theta: f64) -> Bounds {
        let mut bounds = Bounds {
            offset_m_max: offsets.iter().map(|d| theta * d.norm()).fold(0.0, f64::max),
            speed_mps_max: 0.0,
            acceleration_mps2_max: 0.0,
            lateral_mps2_max: 0.0,
            jerk_mps3_max: 0.0,
            lateral_jerk_mps3_max: 0.0,
            interval_steps: self.bounds.interval_steps,
        };
        self.visit(offsets, |_, order, direction, base, change| {
            let value = base + change * theta;
            let (along, across) = (value.dot(direction).abs(), value.dot(direction.left()).abs());
            let raise = |most: &mut f64, x: f64| *most = most.max(x);
            match order {
                1 => raise(&mut bounds.speed_mps_max, value.norm()),
                2 => {
                    raise(&mut bounds.acceleration_mps2_max, along);
                    raise(&mut bounds.lateral_mps2_max, across);
                }
                _ => {
                    raise(&mut bounds.jerk_mps3_max, along);
                    raise(&mut bounds.lateral_jerk_mps3_max, across);
                }
            }
        });
        bounds
    }

    /// Every finite difference of order 1, 2, 3 that a movable point takes part in: the point's place behind the
    /// history, order, logged direction, the log's value, and what full offsets add to it.
    fn visit(&self, offsets: &[Vec2], mut each: impl FnMut(usize, usize, Vec2, Vec2, Vec2)) {
        let (interval, rate) = (self.bounds.interval_steps, self.rate_hz());
        // Values of all orders an interval ago, by the step's place in the interval.
        let mut base_ago = [[Vec2::ZERO; 4]; INTERVAL_STEPS_MAX];
        let mut change_ago = [[Vec2::ZERO; 4]; INTERVAL_STEPS_MAX];
        for (k, point) in self.points.iter().enumerate() {
            let (base_before, change_before) = (&mut base_ago[k % interval], &mut change_ago[k % interval]);
            let (mut base, mut change) = ([Vec2::ZERO; 4], [Vec2::ZERO; 4]);
            base[0] = *point;
            change[0] = k.checked_sub(self.history).and_then(|i| offsets.get(i)).copied().unwrap_or_default();
            for order in 1..=3usize.min(k / interval) {
                base[order] = (base[order - 1] - base_before[order - 1]) * rate;
                change[order] = (change[order - 1] - change_before[order - 1]) * rate;
                if k >= self.history {
                    each(k - self.history, order, self.directions[k], base[order], change[order]);
                }
            }
            (*base_before, *change_before) = (base, change);
        }
    }
}

/// Largest θ >= 0 with ‖base + θ change‖ <= bound, for ‖base‖ <= bound.
fn within_circle(base: Vec2, change: Vec2, bound: f64) -> f64 {
    let a = change.norm_squared();
    if a < 1e-18 {
        return f64::INFINITY;
    }
    let b = base.dot(change);
    let c = base.norm_squared() - bound * bound;
    let root = (b * b - a * c.min(0.0)).max(0.0).sqrt();
    ((root - b) / a).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const BOUNDS: Bounds = Bounds {
        offset_m_max: 1.0,
        speed_mps_max: 17.2,
        acceleration_mps2_max: 5.1,
        lateral_mps2_max: 1.87,
        jerk_mps3_max: 15.7,
        lateral_jerk_mps3_max: 4.3,
        interval_steps: 1,
    };

    fn straight(interval_steps: usize) -> LoggedPath {
        let count = 37 + 3 * interval_steps;
        let points = (0..count).map(|k| Vec2::new(k as f64, 0.0)).collect();
        let bounds = Bounds { interval_steps, ..BOUNDS };
        LoggedPath::new(points, 3 * interval_steps, vec![Vec2::new(1.0, 0.0); count], bounds)
    }

    fn keeps(found: &Bounds, bounds: &Bounds) -> bool {
        let slack = 1.0 + 1e-6;
        found.offset_m_max <= bounds.offset_m_max * slack
            && found.speed_mps_max <= bounds.speed_mps_max * slack
            && found.acceleration_mps2_max <= bounds.acceleration_mps2_max * slack
            && found.lateral_mps2_max <= bounds.lateral_mps2_max * slack
            && found.jerk_mps3_max <= bounds.jerk_mps3_max * slack
            && found.lateral_jerk_mps3_max <= bounds.lateral_jerk_mps3_max * slack
    }

    proptest! {
        #[test]
        fn the_scale_is_the_first_of_the_grid_that_keeps_every_bound(
            offsets in prop::collection::vec((-2.0..2.0f64, -2.0..2.0f64), 37), small in 0.001..1.0f64,
            interval in 1usize..7,
        ) {
            let path = straight(interval);
            let smooth: Vec<Vec2> = offsets.iter().enumerate()
                .map(|(k, (x, y))| Vec2::new(*x, *y) * (small * (k as f64 / 37.0) * 0.02)).collect();
            let theta = path.scale(&smooth);
            prop_assert!(keeps(&path.extremes(&smooth, theta), path.bounds()));
            if theta < 1.0 {
                prop_assert!(!keeps(&path.extremes(&smooth, theta + 0.0101), path.bounds()));
            }
        }
    }

    #[test]
    fn a_lane_change_that_was_recorded_at_two_hertz_is_judged_at_two_hertz() {
        // A metre aside within 2 s, as knots that a record of 2 Hz would have, straight between them: a vehicle can do
        // this, but straight pieces have corners, which at 10 Hz are jerks of tens of m/s³.
        let aside = |k: usize| Vec2::new(0.0, (k as f64 / 20.0).min(1.0));
        let offsets: Vec<Vec2> = (0..37).map(aside).collect();
        assert!(straight(5).scale(&offsets) > 0.9, "{}", straight(5).scale(&offsets));
        assert!(straight(1).scale(&offsets) < 0.2, "{}", straight(1).scale(&offsets));
    }

    #[test]
    fn an_offset_beyond_a_metre_is_scaled_to_it() {
        // Slow enough that only the offset bound counts.
        let points = (0..400).map(|k| Vec2::new(k as f64, 0.0)).collect();
        let path = LoggedPath::new(points, 0, vec![Vec2::new(1.0, 0.0); 400], BOUNDS);
        let offsets: Vec<Vec2> = (0..400).map(|k| Vec2::new(0.0, 2.0 * k as f64 / 399.0)).collect();
        assert_eq!(path.scale(&offsets), 0.5);
    }
}
