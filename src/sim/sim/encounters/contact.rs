//! First contact between road users: a sweep over the physics steps of one decision step, bounding circles before boxes.

use crate::kernel::{OrientedBox, Vec2, num};
use crate::scene::Sample;
use crate::sim::accounts::outcome::Contact;
use crate::sim::prepared::body::{Place, SUBSTEP_S, SUBSTEPS, Size, sample_during};
use crate::sim::prepared::plant::Plant;
use crate::sim::road_users::intervention::ActorRef;
use crate::sim::road_users::others::Others;

use super::class::{Before, Encounter, classify};
use super::hit::{Hit, Mover};
use super::touch::{Side, Striker, contact_normal};

/// Speed of approach below which a road user does not strike, m/s.
const STRIKE_MPS: f64 = 0.5;

/// Returns the first physics step of the k-th step up to `until` at which `mover` touches the road user of a row.
pub(super) fn touches_row(mover: &Mover<'_>, plant: &Plant, k: usize, row: usize, until: usize) -> Option<usize> {
    let rows = &plant.rows;
    let size = &plant.sizes[rows.track[row] as usize];
    let (first, last) = (rows.place(row), rows.next_place(k, row));
    (0..=until).find(|&j| meets(mover, j, size, &first.towards(&last, j as f64 / SUBSTEPS as f64)))
}

/// Returns the first physics step up to `until` at which two movers touch.
pub(in crate::sim) fn touches(a: &Mover<'_>, b: &Mover<'_>, until: usize) -> Option<usize> {
    let reach = a.reach_m + b.reach_m;
    if (a.path[0].position - b.path[0].position).norm_squared() > reach * reach {
        return None;
    }
    (0..=until).find(|&j| meets(a, j, b.size, &b.path[j]))
}

fn meets(mover: &Mover<'_>, j: usize, size: &Size, place: &Place) -> bool {
    let reach = mover.size.radius_m + size.radius_m;
    (mover.path[j].position - place.position).norm_squared() <= reach * reach
        && mover.size.at(mover.path[j]).overlaps(&size.at(*place))
}

/// Calls `f` with the rows of the k-th step that `mover` may touch during it, simulated tracks left out.
pub(super) fn near_rows(plant: &Plant, world: &Others, k: usize, mover: &Mover<'_>, mut f: impl FnMut(usize)) {
    let rows = &plant.rows;
    let center = mover.path[0].position;
    for row in rows.strip(k, center.x, mover.reach_m + rows.reach_max[k]) {
        let (dx, dy) = (rows.x[row] - center.x, rows.y[row] - center.y);
        let reach = mover.reach_m + f64::from(rows.reach[row]);
        if dx * dx + dy * dy <= reach * reach && !world.simulated[rows.track[row] as usize] {
            f(row);
        }
    }
}

/// Returns the ego's first contact in the k-th step; at the same physics step the lowest track first, then simulated road users.
pub(in crate::sim) fn first_contact(
    plant: &Plant,
    world: &Others,
    ghosts: &mut [bool],
    k: usize,
    ego: &Mover<'_>,
    spare_overlaps: bool,
) -> Option<Hit> {
    let mut best: Option<Hit> = None;
    near_rows(plant, world, k, ego, |row| {
        let track = plant.rows.track[row] as usize;
        let until = best.map_or(SUBSTEPS, |b| b.substep);
        let Some(substep) = touches_row(ego, plant, k, row, until) else {
            ghosts[track] = false;
            return;
        };
        let appears = || k == 0 || plant.rows.find(k - 1, track).is_none();
        if spared(&mut ghosts[track], substep, spare_overlaps, appears) || !earlier(best.as_ref(), substep, track) {
            return;
        }
        let (place, sample) = row_during(plant, k, row, substep);
        best = Some(Hit {
            substep,
            with: ActorRef::Track(track),
            adversary: false,
            replayed: true,
            size: plant.sizes[track],
            place,
            velocity: sample.velocity,
        });
    });
    for actor in world.actors.iter().filter(|a| a.now.is_some()) {
        let until = best.map_or(actor.until, |b| b.substep.min(actor.until));
        let Some(substep) = touches(ego, &actor.mover(), until) else { continue };
        if let (ActorRef::Track(track), None) = (actor.who, actor.action)
            && spared(&mut ghosts[track], substep, spare_overlaps, || actor.born() == Some(k))
        {
            continue;
        }
        if best.is_some_and(|b| b.substep <= substep) {
            continue;
        }
        best = Some(Hit {
            substep,
            with: actor.who,
            adversary: actor.action.is_some(),
            replayed: false,
            size: actor.size,
            place: actor.places[substep],
            velocity: actor.during(substep).map_or(Vec2::ZERO, |s| s.velocity),
        });
    }
    best
}

/// Returns `true` if a contact comes before the best so far: at an earlier physics step, or with a lower track at the same.
fn earlier(best: Option<&Hit>, substep: usize, track: usize) -> bool {
    best.is_none_or(|b| (substep, ActorRef::Track(track)) < (b.substep, b.with))
}

/// Returns `true` if an overlap was there when the other appeared: it is no contact until the two have once been apart.
fn spared(ghost: &mut bool, substep: usize, spare_overlaps: bool, appears: impl Fn() -> bool) -> bool {
    if substep > 0 {
        *ghost = false;
        return false;
    }
    if spare_overlaps && appears() {
        *ghost = true;
    }
    *ghost
}

/// Returns place and sample of a recorded road user after a physics step of the k-th step, which begins at a row.
pub(in crate::sim) fn row_during(plant: &Plant, k: usize, row: usize, substep: usize) -> (Place, Sample) {
    let rows = &plant.rows;
    let place = rows.place(row).towards(&rows.next_place(k, row), substep as f64 / SUBSTEPS as f64);
    let next = rows.next(k, row).map(|next| rows.sample(k + 1, next));
    (place, sample_during(rows.sample(k, row), next, &place, substep))
}

/// Describes a contact. `k` counts from the first simulated step; `ego_velocity` is the ego's at the contact.
pub(in crate::sim) fn describe(hit: &Hit, k: usize, ego: &OrientedBox, ego_velocity: Vec2, before: &Before) -> Contact {
    let other = hit.size.at(hit.place);
    let normal = contact_normal(ego, &other, hit.velocity - ego_velocity);
    let (ego_side, other_side) = (Side::facing(ego.axis, normal), Side::facing(other.axis, -normal));
    // A flank that is dragged along the other has no speed across itself. Flank to flank, the one that leaves the road's direction
    // towards the other strikes.
    let (ego_approach, other_approach) = match (ego_side, other_side) {
        (Side::Left | Side::Right, Side::Left | Side::Right) => {
            let to_left = if ego_side == Side::Left { 1.0 } else { -1.0 };
            (to_left * before.ego_road.cross(ego_velocity), -to_left * before.other_road.cross(hit.velocity))
        }
        _ => (ego_velocity.dot(normal), -hit.velocity.dot(normal)),
    };
    let course = if hit.velocity.norm() > 0.1 { hit.velocity } else { other.axis };
    let striker = striker(ego_approach, other_approach);
    let encounter = Encounter { ego, other: &other, other_velocity: hit.velocity, side: ego_side, striker, before };
    Contact {
        with: hit.with,
        adversary: hit.adversary,
        time_s: (k * SUBSTEPS + hit.substep) as f64 * SUBSTEP_S,
        relative_speed_mps: (hit.velocity - ego_velocity).norm(),
        impact_angle_rad: num::wrap_angle(course.heading() - ego.axis.heading()),
        striker,
        ego_side,
        other_side,
        class: classify(&encounter),
        visible_s: None,
        avoidable: None,
        fault: None,
        jury: None,
    }
}

fn striker(ego_approach_mps: f64, other_approach_mps: f64) -> Striker {
    match (ego_approach_mps > STRIKE_MPS, other_approach_mps > STRIKE_MPS) {
        (true, false) => Striker::Ego,
        (false, true) => Striker::Other,
        _ => Striker::Both,
    }
}

/// Returns which side of the ego touches another box, and who strikes whom, from overlapping boxes and their velocities alone. The
/// road's direction, which decides between flanks, is left out.
pub fn meeting(ego: &OrientedBox, ego_velocity: Vec2, other: &OrientedBox, other_velocity: Vec2) -> (Side, Striker) {
    let normal = contact_normal(ego, other, other_velocity - ego_velocity);
    (Side::facing(ego.axis, normal), striker(ego_velocity.dot(normal), -other_velocity.dot(normal)))
}
