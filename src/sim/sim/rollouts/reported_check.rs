//! Checks of a reported motion before it is judged: they name the first thing that cannot belong to a rollout of the scene.

use crate::kernel::num;
use crate::scene::{DT_S, Sample};
use crate::sim::accounts::end::End;
use crate::sim::prepared::body::SUBSTEPS;
use crate::sim::prepared::plant::{LENGTH_M_MAX, Plant, sample_is_sound, size_is_sound};
use crate::sim::road_users::actors::scripted;
use crate::sim::road_users::bicycle::Car;
use crate::sim::road_users::intervention::{ActorRef, Intervention};

use super::closed_loop::seconds_after;
use super::reported::{Pose, ReportedActor, ReportedError, ReportedRollout};

/// Largest distance of a road user from its commanded place, or from the scene's start, metres. Simulators in single
/// precision round by millimetres.
pub const OFF_COMMAND_M: f64 = 0.1;
/// Largest distance from its recording of an ego that repeats it, metres: a physics step behind at 50 m/s.
const OFF_LOG_M: f64 = 1.0;
/// Largest difference of velocity and heading of the first row from the scene's start, m/s and rad.
const START_MPS: f64 = 1.0;
const START_RAD: f64 = 0.1;
/// Allowance for another simulator's car beyond twice the plant's throttle, brake and bend in a step: m/s, rad, metres. MetaDrive's
/// worst of 292 000 steps are 0.31 m/s more, 1.75 m/s less in 0.1 s, and 0.1 rad of turn.
const SPEED_SLACK_MPS: f64 = 0.15;
const TURN_SLACK_RAD: f64 = 0.05;
const WAY_SLACK_M: f64 = 0.15;
/// Largest share of its way that a car may slip to the side in a bend. MetaDrive's slips 0.44.
const SIDE_SHARE: f64 = 0.7;
/// Largest delay of places behind velocities, s: MetaDrive shows bodies a physics step late.
const LATE_S: f64 = 0.025;
/// Allowances for traffic: way beyond its velocities in a step, metres; distance from its recording where it leaves that or comes back,
/// metres; top speed, m/s. MetaDrive's worst of a million steps goes 0.11 m beyond, at 38 m/s, and one is 16 m further after 0.2 s away.
const TRAFFIC_SLACK_M: f64 = 0.5;
const JOINS_M: f64 = 10.0;
const TRAFFIC_MPS: f64 = 70.0;
/// Largest difference between the two forms of a heading, radians, and of a unit vector's length from 1.
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
    replays: bool,
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
    if replays {
        check_log(plant, reported)?;
    } else {
        check_drive(plant, reported)?;
    }
    check_ways(plant, intervention, reported)?;
    check_boxes(reported)?;
    check_partner(plant, reported)
}

/// Checks that the boxes are possible.
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

/// Checks that there are as many rows as the end of the rollout needs.
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

/// Returns the seconds between a row and the one before it: within the step of a contact fewer than elsewhere.
fn seconds_to(reported: &ReportedRollout, row: usize) -> f64 {
    match reported.contact {
        Some(contact) if contact.step + 1 == row => seconds_after(contact.substep),
        _ => DT_S,
    }
}

/// Checks that a car drives, as far as another simulator allows it: its speed, throttle, brakes and bends are held to the limits
/// of the experiment's plant, which planners are told. The added allowances are measured: see docs/BACKENDS.md.
fn check_drive(plant: &Plant, reported: &ReportedRollout) -> Result<(), ReportedError> {
    let (limits, start) = (plant.limits(), &plant.ego_start);
    let car = Car::new(start, 2.0 * plant.ego_size.half_length_m);
    let first = &reported.ego[0].sample;
    let (off_mps, off_rad) =
        ((first.velocity - start.velocity).norm(), num::wrap_angle(first.heading_rad - start.heading_rad).abs());
    if off_mps > START_MPS || off_rad > START_RAD {
        let expected = format!("the scene's start, within {START_MPS} m/s and {START_RAD} rad");
        return wrong("ego, row 0", expected, format!("{off_mps:.2} m/s and {off_rad:.2} rad off"));
    }
    let top_mps = limits.speed_mps.max(first.speed_mps()) + 1.0;
    let bend_1pm = 2.0 * car.curvature_max_1pm(limits);
    let brake_mps2 = limits.settling.map_or(limits.brake_mps2, |of| limits.brake_mps2.max(of.full_brake_mps2));
    for (row, pair) in reported.ego.windows(2).enumerate() {
        let (from, to, seconds) = (&pair[0].sample, &pair[1].sample, seconds_to(reported, row + 1));
        let (before, after) = (from.speed_mps(), to.speed_mps());
        let moved = to.position - from.position;
        let (way_m, side_m) = (moved.norm(), pair[0].axis.cross(moved).abs());
        let explained_m = (moved - (from.velocity + to.velocity) * (0.5 * seconds)).norm();
        let turn_rad = num::wrap_angle(to.heading_rad - from.heading_rad).abs();
        let gripped_rad = 2.0 * limits.grip_mps2 * seconds / before.max(after).max(1e-9);
        let numbers = [
            ("m/s of speed", after, top_mps),
            ("m/s more", after - before, 2.0 * limits.engine_mps2 * seconds + SPEED_SLACK_MPS),
            ("m/s less", before - after, 2.0 * brake_mps2 * seconds + SPEED_SLACK_MPS),
            ("rad of turn", turn_rad, (bend_1pm * way_m).min(gripped_rad) + TURN_SLACK_RAD),
            ("m to the side", side_m, SIDE_SHARE * way_m + WAY_SLACK_M),
            ("m beside what its velocities say", explained_m, WAY_SLACK_M + LATE_S * before.max(after)),
        ];
        if let Some((what, found, most)) = numbers.into_iter().find(|(_, found, most)| is_beyond(*found, *most)) {
            let expected = format!("a car within its limits: at most {most:.2} {what} in {seconds:.2} s");
            return wrong(format!("ego, row {}", row + 1), expected, format!("{found:.2}"));
        }
    }
    Ok(())
}

/// Returns `true` if a number is above another, or if either is NaN.
fn is_beyond(found: f64, most: f64) -> bool {
    found.is_nan() || most.is_nan() || found > most
}

/// Checks that an ego that repeats its recording is where the recording has it.
fn check_log(plant: &Plant, reported: &ReportedRollout) -> Result<(), ReportedError> {
    let within = usize::from(reported.contact.is_some_and(|contact| contact.substep < SUBSTEPS));
    for (row, pose) in reported.ego.iter().enumerate().take(reported.ego.len() - within) {
        let off_m = plant.ego_log(row).map_or(0.0, |log| log.position.distance(pose.sample.position));
        if off_m > OFF_LOG_M {
            let expected = format!("where the ego was recorded, within {OFF_LOG_M} m");
            return wrong(format!("ego, row {row}"), expected, format!("{off_m:.2} m off"));
        }
    }
    Ok(())
}

/// Checks that road users without commands do not jump: they leave their recording where it is, and go on from there.
fn check_ways(plant: &Plant, intervention: &Intervention, reported: &ReportedRollout) -> Result<(), ReportedError> {
    let commanded = super::reported::adversaries_of(intervention);
    for (i, actor) in reported.actors.iter().enumerate().filter(|(_, actor)| !commanded.contains(&actor.who)) {
        let there = actor.poses.iter().enumerate();
        let there = there.filter_map(|(row, pose)| Some((row + actor.from_step, pose.as_ref()?.sample)));
        let ActorRef::Track(track) = actor.who else { continue };
        let mut last: Option<(usize, Sample)> = None;
        for (row, sample) in there {
            let recorded = || plant.scene().tracks[track].at(plant.first_step() + row);
            if let Some((since, from)) = last.or_else(|| Some((row, *recorded()?))) {
                let seconds =
                    if since == row { 0.0 } else { (row - since - 1) as f64 * DT_S + seconds_to(reported, row) };
                let reported_mps = from.speed_mps().max(sample.speed_mps()).min(TRAFFIC_MPS);
                let most_m = match row - since {
                    0 => JOINS_M,
                    1 => TRAFFIC_SLACK_M + seconds * reported_mps,
                    // MetaDrive takes some away and puts them elsewhere.
                    _ => JOINS_M + seconds * TRAFFIC_MPS,
                };
                let way_m = from.position.distance(sample.position);
                if is_beyond(way_m, most_m) {
                    let expected = format!("at most {most_m:.2} m of way since row {since}");
                    return wrong(format!("road_users[{i}], row {row}"), expected, format!("{way_m:.2} m"));
                }
            }
            last = Some((row, sample));
        }
    }
    Ok(())
}

/// Checks that every adversary is reported where it was commanded to be, and that no unknown road user is reported.
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

/// Checks that the road user that the ego touched is there.
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
