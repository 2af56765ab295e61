//! Place and size of a road user: the small values that the rollout moves about.

use crate::kernel::{OrientedBox, Vec2};
use crate::scene::{AgentKind, Sample};

/// Seconds between two physics steps.
pub const SUBSTEP_S: f64 = 0.02;
/// Physics steps in one decision step (0.1 s).
pub const SUBSTEPS: usize = 5;

/// Kind and footprint of a road user.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Size {
    /// The sort of road user.
    pub kind: AgentKind,
    /// Half of the box along its heading, metres.
    pub half_length_m: f64,
    /// Half of the box across it, metres.
    pub half_width_m: f64,
    /// Radius of the circle that holds the box, metres.
    pub radius_m: f64,
}

impl Size {
    /// Takes the whole length and width, metres.
    pub fn new(kind: AgentKind, length_m: f64, width_m: f64) -> Size {
        let (half_length_m, half_width_m) = (0.5 * length_m, 0.5 * width_m);
        let radius_m = (half_length_m * half_length_m + half_width_m * half_width_m).sqrt();
        Size { kind, half_length_m, half_width_m, radius_m }
    }

    /// Returns the footprint at a place.
    pub fn at(&self, place: Place) -> OrientedBox {
        OrientedBox {
            center: place.position,
            axis: place.axis,
            half_length_m: self.half_length_m,
            half_width_m: self.half_width_m,
        }
    }
}

/// Position and unit heading vector.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Place {
    /// The centre of the box, metres.
    pub position: Vec2,
    /// Heading as a vector of length 1.
    pub axis: Vec2,
}

impl Place {
    /// Returns the place of a sample.
    pub fn of(sample: &Sample) -> Place {
        Place { position: sample.position, axis: Vec2::from_heading(sample.heading_rad) }
    }

    /// Returns the place a share of the way to another: position on the chord, axis turned along the shorter arc
    /// (normalised chord; the start's axis if the two are opposite).
    pub fn towards(&self, next: &Place, share: f64) -> Place {
        let axis = self.axis.lerp(next.axis, share);
        let norm = axis.norm();
        Place {
            position: self.position.lerp(next.position, share),
            axis: if norm > 1e-6 { axis * (1.0 / norm) } else { self.axis },
        }
    }
}

/// Returns the sample after a physics step of the way between two samples: at the given place, with the velocity in between.
/// Without a next sample the velocity stays.
pub fn sample_during(now: &Sample, next: Option<&Sample>, place: &Place, substep: usize) -> Sample {
    match next {
        _ if substep == 0 => *now,
        Some(next) if substep == SUBSTEPS => *next,
        next => Sample {
            position: place.position,
            heading_rad: place.axis.heading(),
            velocity: next
                .map_or(now.velocity, |next| now.velocity.lerp(next.velocity, substep as f64 / SUBSTEPS as f64)),
        },
    }
}

/// Returns the sample after `seconds` of unchanged velocity and heading.
pub fn coasting(sample: &Sample, seconds: f64) -> Sample {
    Sample { position: sample.position + sample.velocity * seconds, ..*sample }
}
