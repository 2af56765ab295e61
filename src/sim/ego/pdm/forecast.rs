//! Forecast of the others: everybody keeps speed and heading.

use std::collections::BTreeSet;

use super::settings::{STEP_S, STEPS_A_MAP, Settings};
use crate::kernel::{OrientedBox, Vec2};
use crate::scene::AgentKind;
use crate::sim::fault::{ContactKind, OTHER_STANDS_MPS};
use crate::sim::{ActorRef, View};

/// Half the extent of a red light along the route, metres: its stop line is a wall.
const WALL_HALF_M: f64 = 0.05;
/// Half its extent across, metres.
const WALL_HALF_WIDTH_M: f64 = 2.0;

/// Another road user or thing as PDM sees it.
#[derive(Clone, Copy, Debug)]
pub struct Other {
    /// Its box now.
    pub now: OrientedBox,
    /// Unit vector of the box's motion: along its axis, or against it where it rolls back.
    pub course: Vec2,
    /// Speed, at least 0, m/s.
    pub speed_mps: f64,
    /// True if it is a road user. Barriers, parked things and red lights are none.
    pub is_agent: bool,
    /// True if it is a red light: nobody is struck by one.
    pub is_light: bool,
}

impl Other {
    /// Returns its box so many seconds from now; a thing stays.
    pub fn in_s(&self, seconds: f64) -> OrientedBox {
        OrientedBox { center: self.now.center + self.course * (self.speed_mps * seconds), ..self.now }
    }

    /// Returns its box in the map that holds at a step of a proposal.
    pub fn at_step(&self, step: usize) -> OrientedBox {
        self.in_s((step / STEPS_A_MAP * STEPS_A_MAP) as f64 * STEP_S)
    }

    /// Returns `true` if it stands (nuPlan's stopped track).
    pub fn stands(&self) -> bool {
        !self.is_agent || self.speed_mps <= OTHER_STANDS_MPS
    }
}

/// Returns everybody within reach, nearest first, without those whom the ego overlaps or has overlapped: nothing that it does now
/// would undo that. `own` is the ego's box, `light` the stop point of a red light ahead with the route's heading there.
pub fn others(
    view: &View<'_>,
    own: &OrientedBox,
    light: Option<(Vec2, f64)>,
    settings: &Settings,
    passed_over: &mut BTreeSet<ActorRef>,
) -> Vec<Other> {
    let mut near: Vec<(f64, AgentKind, Other)> = Vec::new();
    view.for_each_within(settings.radius_m, |seen| {
        let size = seen.size;
        let now = OrientedBox::along(seen.position, seen.axis, 2.0 * size.half_length_m, 2.0 * size.half_width_m);
        if now.overlaps(own) {
            passed_over.insert(seen.actor);
        }
        if passed_over.contains(&seen.actor) {
            return;
        }
        let is_agent = size.kind != AgentKind::Static;
        let speed_mps = if is_agent { seen.velocity.norm() } else { 0.0 };
        let course = if seen.velocity.dot(seen.axis) < 0.0 { seen.axis * -1.0 } else { seen.axis };
        let distance_m = (seen.position - own.center).norm();
        near.push((distance_m, size.kind, Other { now, course, speed_mps, is_agent, is_light: false }));
    });
    near.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut left = settings.kept;
    near.retain(|(_, kind, _)| {
        let of = match kind {
            AgentKind::Vehicle => 0,
            AgentKind::Pedestrian => 1,
            AgentKind::Cyclist => 2,
            AgentKind::Static => 3,
        };
        let is_kept = left[of] > 0;
        left[of] -= usize::from(is_kept);
        is_kept
    });
    let mut kept: Vec<Other> = near.into_iter().map(|(_, _, other)| other).collect();
    kept.extend(light.map(|(point, heading_rad)| wall(point, heading_rad)).filter(|wall| !wall.now.overlaps(own)));
    kept
}

fn wall(point: Vec2, heading_rad: f64) -> Other {
    let axis = Vec2::from_heading(heading_rad);
    let now = OrientedBox::along(point, axis, 2.0 * WALL_HALF_M, 2.0 * WALL_HALF_WIDTH_M);
    Other { now, course: axis, speed_mps: 0.0, is_agent: false, is_light: true }
}

/// Returns the kind of a contact of the ego's box at a speed, with its rear axle there.
pub fn contact_kind(
    own: &OrientedBox,
    rear_axle: Vec2,
    speed_mps: f64,
    other: &Other,
    theirs: &OrientedBox,
) -> ContactKind {
    ContactKind::of(own, rear_axle, speed_mps, theirs, other.stands())
}
