//! Derivatives of sampled places by a Savitzky-Golay filter: the cubic that fits a window of samples best (least
//! squares), read off at the window's centre.
//!
//! The window of 13 samples (1.2 s) passes a driver's motion and holds back a tracker's errors: the response of the
//! fitted place falls to 1/√2 at [`CUT_OFF_HZ`], without a shift in phase. The part that the filter removes is not lost: it is
//! measured as roughness (`feasibility.rs`). Savitzky and Golay 1964; for the response Schafer, "What Is a
//! Savitzky-Golay Filter?", 2011.

use crate::kernel::Vec2;
use crate::scene::DT_S;

/// Samples before and after the centre.
pub const HALF_WINDOW: usize = 6;
/// A cubic through fewer samples is no fit.
pub const HALF_WINDOW_MIN: usize = 2;
/// Frequency at which the response of the fitted place is 1/√2, Hz.
pub const CUT_OFF_HZ: f64 = 0.83;

/// The fitted motion at the centre of a window, SI units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Smoothed {
    /// Metres, in the scene's frame.
    pub position: Vec2,
    /// First derivative of the fitted cubic, m/s.
    pub velocity: Vec2,
    /// Its second derivative, m/s².
    pub acceleration: Vec2,
    /// Its third derivative, m/s³.
    pub jerk: Vec2,
}

impl Smoothed {
    /// The fitted place so many seconds from the window's centre, metres.
    pub fn position_at(&self, t_s: f64) -> Vec2 {
        self.position + (self.velocity + (self.acceleration * 0.5 + self.jerk * (t_s / 6.0)) * t_s) * t_s
    }
}

/// Fits an odd number of places, at least five, that lie [`DT_S`] apart.
pub fn cubic(window: &[Vec2]) -> Smoothed {
    let half = window.len() / 2;
    let centre = window[half];
    // Powers of the place in the window, counted from its centre; odd sums are zero.
    let (mut s2, mut s4, mut s6) = (0.0, 0.0, 0.0);
    let mut sums = [Vec2::ZERO; 4];
    for (k, place) in window.iter().enumerate() {
        let i = k as f64 - half as f64;
        let off = *place - centre;
        let square = i * i;
        (s2, s4, s6) = (s2 + square, s4 + square * square, s6 + square * square * square);
        for (sum, power) in sums.iter_mut().zip([1.0, i, square, square * i]) {
            *sum = *sum + off * power;
        }
    }
    let count = window.len() as f64;
    let even = 1.0 / (count * s4 - s2 * s2);
    let odd = 1.0 / (s2 * s6 - s4 * s4);
    let constant = (sums[0] * s4 - sums[2] * s2) * even;
    let linear = (sums[1] * s6 - sums[3] * s4) * odd;
    let quadratic = (sums[2] * count - sums[0] * s2) * even;
    let third = (sums[3] * s2 - sums[1] * s4) * odd;
    Smoothed {
        position: centre + constant,
        velocity: linear * (1.0 / DT_S),
        acceleration: quadratic * (2.0 / (DT_S * DT_S)),
        jerk: third * (6.0 / (DT_S * DT_S * DT_S)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernel::num;

    fn window(of: impl Fn(f64) -> f64) -> Vec<Vec2> {
        let half = HALF_WINDOW as i32;
        (-half..=half).map(|i| Vec2::new(of(f64::from(i) * DT_S), 0.0)).collect()
    }

    #[test]
    fn a_cubic_motion_is_recovered_exactly() {
        let fit = cubic(&window(|t| 3.0 + 2.0 * t - 4.0 * t * t + 1.5 * t * t * t));
        let found = [fit.position.x, fit.velocity.x, fit.acceleration.x, fit.jerk.x];
        for (found, expected) in found.into_iter().zip([3.0, 2.0, -8.0, 9.0]) {
            assert!((found - expected).abs() < 1e-9, "{found} {expected}");
        }
        let at_the_end = fit.position_at(0.6).x;
        assert!((at_the_end - (3.0 + 1.2 - 1.44 + 0.324)).abs() < 1e-9, "{at_the_end}");
    }

    #[test]
    fn the_response_falls_to_its_root_half_at_the_declared_cut_off() {
        let response = |hertz: f64| cubic(&window(|t| num::cos(2.0 * num::PI * hertz * t))).position.x;
        let at_cut_off = response(CUT_OFF_HZ);
        assert!((at_cut_off - 0.5f64.sqrt()).abs() < 0.01, "{at_cut_off}");
        assert!(response(0.4) > 0.97 && response(2.5).abs() < 0.2, "{} {}", response(0.4), response(2.5));
    }
}
