//! Fault for the contact of a rollout, from its motion: for labels that do not hold it.

use crate::kernel::OrientedBox;
use crate::sim::accounts::outcome::{Outcome, Trace};
use crate::sim::encounters::fault::Fault;
use crate::sim::prepared::plant::Plant;
use crate::sim::road_users::intervention::ActorRef;

/// Returns the fault for a rollout's contact by nuPlan's rule: as the outcome has it, else from the motion that led to it. `None` where
/// there is no contact, or the motion does not hold the road user that the ego met.
pub fn fault_of(plant: &Plant, outcome: &Outcome, motion: &Trace) -> Option<Fault> {
    let contact = outcome.contact.as_ref()?;
    if contact.fault.is_some() {
        return contact.fault;
    }
    let ego = motion.ego.last()?;
    let met = motion.actors.iter().find(|actor| actor.actor == contact.with)?;
    let other = (*met.samples.last()?)?;
    let kind = match contact.with {
        ActorRef::Track(track) => plant.sizes.get(track)?.kind,
        inserted => outcome.adversaries.iter().find(|report| report.actor == inserted)?.kind,
    };
    let (length_m, width_m) = (2.0 * plant.ego_size.half_length_m, 2.0 * plant.ego_size.half_width_m);
    let own = OrientedBox::new(ego.position, ego.heading_rad, length_m, width_m);
    let theirs = OrientedBox::new(other.position, other.heading_rad, met.length_m, met.width_m);
    Some(Fault::of(plant, &own, ego.velocity, &theirs, other.velocity, kind))
}
