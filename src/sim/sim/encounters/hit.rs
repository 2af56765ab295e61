//! A road user during one decision step, and the ego's first contact in it.

use crate::kernel::Vec2;
use crate::sim::prepared::body::{Place, SUBSTEPS, Size};
use crate::sim::road_users::intervention::ActorRef;

/// The places of a road user through one decision step, the first at its beginning.
pub(in crate::sim) type Swept = [Place; SUBSTEPS + 1];

/// A road user during one decision step.
#[derive(Clone, Copy)]
pub(in crate::sim) struct Mover<'a> {
    pub size: &'a Size,
    pub path: &'a Swept,
    /// Radius of the box plus the length of its way, metres.
    pub reach_m: f64,
}

/// The first contact of the ego in a step.
#[derive(Clone, Copy, Debug)]
pub(in crate::sim) struct Hit {
    pub substep: usize,
    pub with: ActorRef,
    pub adversary: bool,
    /// True if it follows its recording.
    pub replayed: bool,
    pub size: Size,
    pub place: Place,
    pub velocity: Vec2,
}
