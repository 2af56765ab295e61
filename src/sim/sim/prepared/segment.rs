//! A piece of a line on the ground with the rectangle around it, to see quickly what cannot meet it.

use crate::kernel::Vec2;
use crate::kernel::geom::segments_cross;

/// A straight piece of a painted line or of a kerb.
#[derive(Clone, Copy, Debug)]
pub struct Segment {
    pub from: Vec2,
    pub to: Vec2,
    low: Vec2,
    high: Vec2,
}

impl Segment {
    pub fn new(from: Vec2, to: Vec2) -> Segment {
        let (low, high) = around([from, to]);
        Segment { from, to, low, high }
    }

    /// Whether the rectangles meet.
    pub fn meets(&self, low: Vec2, high: Vec2) -> bool {
        self.low.x <= high.x && self.high.x >= low.x && self.low.y <= high.y && self.high.y >= low.y
    }

    /// Whether a step crosses it. A place on the line belongs to its right side, so that a line is crossed once.
    pub fn is_crossed(&self, step: &Segment) -> bool {
        self.meets(step.low, step.high) && segments_cross(step.from, step.to, self.from, self.to)
    }
}

/// The lowest and the highest corner of the rectangle around some places.
pub fn around(places: impl IntoIterator<Item = Vec2>) -> (Vec2, Vec2) {
    let nowhere = Vec2::new(f64::INFINITY, f64::INFINITY);
    places.into_iter().fold((nowhere, -nowhere), |(low, high), place| {
        (Vec2::new(low.x.min(place.x), low.y.min(place.y)), Vec2::new(high.x.max(place.x), high.y.max(place.y)))
    })
}
