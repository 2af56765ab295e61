//! What a told motion must be before it is judged: the first thing that cannot be one of a rollout of the scene is named.

use crate::kernel::num;
use crate::sim::accounts::end::End;
use crate::sim::prepared::body::SUBSTEPS;
use crate::sim::prepared::plant::{LENGTH_M_MAX, Plant, sample_is_sound, size_is_sound};
use crate::sim::road_users::actors::scripted;
use crate::sim::road_users::intervention::{ActorRef, Intervention};

use super::reported::{Pose, ReportedActor, ReportedError, ReportedRollout};

/// How far from where it was commanded to be, or from the scene's start, somebody may be, metres. Simulators in single
/// precision round by millimetres.
pub const OFF_COMMAND_M: f64 = 0.1;
/// How far the two forms of a heading may be apart, radians, and a unit vector's length from 1.
const AXIS_TOLERANCE: f64 = 1e-6;

fn wrong<T>(
    place: impl Into<String>,
    expected: impl Into<String>,
    found: impl Into<String>,
) -> Result<T, ReportedError> {
    Err(ReportedError::Motion { place: place.into(), expected: expected.into(), found: found.into() })
}

/// Refuses a motion that cannot be judged.
pub(in crate::sim) fn check(
    plant: &Plant,
    intervention: &Intervention,
    reported: &ReportedRollout,
) -> Result<(), ReportedError> {
    if plant.is_staged() {
        return wrong(
            "the scene",
            "one without SafeBench's staging, whose rules only our own simulator has",
            "a staged one",
        );
    }
    check_rows(plant, reported)?;
    for (row, pose) in reported.ego.iter().enumerate() {
        check_pose(&format!("ego, row {row}"), pose)?;
    }
    let off_m = reported.ego[0].sample.position.distance(plant.ego_start.position);
    if off_m > OFF_COMMAND_M {
        return wrong("ego, row 0", format!("the scene's start within {OFF_COMMAND_M} m"), format!("{off_m:.3} m off"));
    }
    for (i, actor) in reported.actors.iter().enumerate() {
        check_actor(plant, reported, i, actor)?;
    }
    check_commands(plant, intervention, reported)?;
    check_boxes(reported)?;
    check_partner(plant, reported)
}

/// Boxes that somebody can have.
fn check_boxes(reported: &ReportedRollout) -> Result<(), ReportedError> {
    let Some(boxes) = reported.contact.and_then(|contact| contact.boxes) else { return Ok(()) };
    for (place, [length_m, width_m]) in [("contact.boxes.ego", boxes.ego), ("contact.boxes.other", boxes.other)] {
        if !size_is_sound(length_m, width_m) {
            let expected = format!("length and width above 0 and at most {LENGTH_M_MAX} m");
            return wrong(place, expected, format!("{length_m} x {width_m}"));
        }
    }
    Ok(())
}

/// As many rows as the end of the rollout needs.
fn check_rows(plant: &Plant, reported: &ReportedRollout) -> Result<(), ReportedError> {
    let rows = reported.ego.len();
    match (reported.end, reported.contact) {
        (End::Contact, Some(contact)) => {
            if contact.substep > SUBSTEPS || contact.step >= plant.steps() {
                let expected = format!("a step below {} and 0 to {SUBSTEPS} physics steps", plant.steps());
                return wrong("contact", expected, format!("step {}, substep {}", contact.step, contact.substep));
            }
            let wanted = contact.step + 1 + usize::from(contact.substep > 0);
            if rows != wanted {
                return wrong("ego", format!("{wanted} rows up to the contact"), rows.to_string());
            }
            Ok(())
        }
        (End::Contact, None) => {
            wrong("contact", "the road user that the ego touched, because the rollout ended in a contact", "none")
        }
        (end, Some(_)) => wrong("contact", format!("none, since the end is {end:?}"), "one"),
        (_, None) if rows == 0 || rows > plant.steps() + 1 => {
            wrong("ego", format!("1 to {} rows", plant.steps() + 1), rows.to_string())
        }
        // A replayed ego ends with its recording.
        (End::Horizon, None) if rows <= plant.steps() && plant.ego_log(rows).is_some() => {
            wrong("ego", format!("{} rows up to the horizon", plant.steps() + 1), rows.to_string())
        }
        _ => Ok(()),
    }
}

fn check_pose(place: &str, pose: &Pose) -> Result<(), ReportedError> {
    if !sample_is_sound(&pose.sample) {
        return wrong(
            place,
            "finite numbers, positions within 1e7 m, speeds within 1000 m/s",
            format!("{:?}", pose.sample),
        );
    }
    let turn = num::wrap_angle(pose.axis.heading() - pose.sample.heading_rad).abs();
    // NaN is in no range.
    if !((pose.axis.norm() - 1.0).abs() <= AXIS_TOLERANCE && turn <= AXIS_TOLERANCE) {
        return wrong(
            place,
            "a unit vector along the heading",
            format!("{:?} at {} rad", pose.axis, pose.sample.heading_rad),
        );
    }
    Ok(())
}

fn check_actor(
    plant: &Plant,
    reported: &ReportedRollout,
    i: usize,
    actor: &ReportedActor,
) -> Result<(), ReportedError> {
    let place = format!("road_users[{i}]");
    if reported.actors[..i].iter().any(|other| other.who == actor.who) {
        return wrong(place, "each road user once", format!("{:?} again", actor.who));
    }
    if let ActorRef::Track(track) = actor.who
        && track >= plant.tracks()
    {
        return wrong(place, format!("a track below {}", plant.tracks()), track.to_string());
    }
    let rows = reported.ego.len();
    if actor.from_step >= rows || actor.poses.len() != rows - actor.from_step {
        let found = format!("from_step {} with {} poses", actor.from_step, actor.poses.len());
        return wrong(place, format!("one pose a row from from_step to row {}", rows - 1), found);
    }
    for (row, pose) in actor.poses.iter().enumerate().filter_map(|(row, pose)| Some((row, pose.as_ref()?))) {
        check_pose(&format!("{place}, row {}", row + actor.from_step), pose)?;
    }
    Ok(())
}

/// Every adversary is reported where it was commanded to be, and no road user is reported that the rollout does not have.
fn check_commands(plant: &Plant, intervention: &Intervention, reported: &ReportedRollout) -> Result<(), ReportedError> {
    let commanded = super::reported::adversaries_of(intervention);
    for (action, who) in intervention.actions.iter().zip(&commanded) {
        let place = format!("{who:?}");
        let Some(actor) = reported.actors.iter().find(|actor| actor.who == *who && actor.from_step == 0) else {
            return wrong(place, "every adversary's motion from row 0 on", "none");
        };
        let whole = reported.ego.len() - usize::from(reported.contact.is_some_and(|contact| contact.substep > 0));
        for row in 0..whole {
            let (wanted, is) = (scripted(plant, action, row), actor.at(row));
            let off_m = match (wanted, is) {
                (Some(wanted), Some(is)) => wanted.position.distance(is.sample.position),
                (None, None) => 0.0,
                _ => f64::INFINITY,
            };
            if off_m > OFF_COMMAND_M {
                let expected = format!("where it was commanded to be, within {OFF_COMMAND_M} m");
                return wrong(format!("{place}, row {row}"), expected, format!("{off_m:.3} m off"));
            }
        }
    }
    let stranger = |who: &ActorRef| matches!(who, ActorRef::Inserted(_)) && !commanded.contains(who);
    match reported.actors.iter().find(|actor| stranger(&actor.who)) {
        Some(actor) => {
            wrong("road_users", "only road users of the scene and of the request", format!("{:?}", actor.who))
        }
        None => Ok(()),
    }
}

/// The road user that the ego touched must be there.
fn check_partner(plant: &Plant, reported: &ReportedRollout) -> Result<(), ReportedError> {
    let Some(contact) = reported.contact else { return Ok(()) };
    let row = reported.ego.len() - 1;
    let there = match reported.actors.iter().find(|actor| actor.who == contact.with && actor.from_step <= contact.step)
    {
        Some(actor) => actor.at(row).is_some(),
        None => matches!(contact.with, ActorRef::Track(track) if plant.rows.find(contact.step, track).is_some()),
    };
    if there { Ok(()) } else { wrong("contact", "somebody who is there at that step", format!("{:?}", contact.with)) }
}
