//! A piece of a line on the ground with the rectangle around it, which quickly excludes pieces that cannot meet it.

use crate::kernel::geom::segments_cross;
use crate::kernel::{Extent, Vec2};

/// A straight piece of a painted line or of a kerb.
#[derive(Clone, Copy, Debug)]
pub struct Segment {
    pub from: Vec2,
    pub to: Vec2,
    extent: Extent,
}

impl Segment {
    pub fn new(from: Vec2, to: Vec2) -> Segment {
        Segment { from, to, extent: Extent::around([from, to]) }
    }

    /// Returns `true` if the rectangle around it meets another.
    pub fn meets(&self, other: &Extent) -> bool {
        self.extent.meets(other)
    }

    /// Returns `true` if a step crosses it. A place on the line belongs to its right side, so that a line is crossed once.
    pub fn is_crossed(&self, step: &Segment) -> bool {
        self.meets(&step.extent) && segments_cross(step.from, step.to, self.from, self.to)
    }
}
