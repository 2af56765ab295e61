//! A row a rollout that a label rests on: what the simulator measured.

use super::sheet::{Cell, Columns, Sheet, word};
use crate::evaluation::RolloutRecord;
use crate::kernel::Digest;

/// A rollout's record.
pub type Rollout = RolloutRecord;

type Row = (Digest, Rollout);

macro_rules! of_contact {
    ($field:ident) => {
        |(_, r): &Row| r.outcome.contact.map(|contact| contact.$field)
    };
}

pub fn sheet(rollouts: &[Row]) -> Sheet {
    let columns = Columns::<Row>::new()
        .text("record", "Digest of the record.", |(record, _)| *record)
        .text("scene", "The scene.", |(_, r)| r.scene.clone())
        .text("program", "Hash of the program.", |(_, r)| r.program)
        .text("ego", "The driver under test.", |(_, r)| r.ego.clone())
        .flag("intervened", "Whether the program asked for an intervention.", |(_, r)| r.intervened)
        .flag("acted", "Whether some adversary's motion differs from replay.", |(_, r)| r.outcome.acted())
        .whole("adversaries", "Adversaries of the program.", |(_, r)| r.outcome.adversaries.len())
        .text("end", "contact, off_road, arrived or horizon.", |(_, r)| word(&r.outcome.end))
        .whole("steps", "Decision steps simulated, of 0.1 s.", |(_, r)| r.outcome.steps)
        .number("route_completion", "", "Share of its route that the ego drove.", |(_, r)| r.outcome.route_completion)
        .number(
            "distance_m_min",
            "m",
            "Smallest distance between an adversary and the ego (any road user, if there is no adversary).",
            |(_, r)| r.outcome.distance_m_min,
        )
        .number(
            "ttc_s_min",
            "s",
            "Smallest time to collision with an adversary (any road user, if there is no adversary).",
            |(_, r)| r.outcome.ttc_s_min,
        )
        .number(
            "post_encroachment_s_min",
            "s",
            "Smallest time between one of the two leaving a place and the other entering it.",
            |(_, r)| r.outcome.post_encroachment_s_min,
        )
        .number("ego_lateral_m_max", "m", "Farthest the ego came from its route.", |(_, r)| {
            r.outcome.ego_lateral_m_max
        });
    let columns = columns
        .flag("contact_adversary", "Whether the ego met an adversary; empty without contact.", of_contact!(adversary))
        .number("contact_s", "s", "Time of the contact since the first simulated step; captions and `scenes best` count from the scene's beginning.", of_contact!(time_s))
        .number("contact_relative_speed_mps", "m/s", "Relative speed of the contact.", of_contact!(relative_speed_mps))
        .number(
            "contact_angle_rad",
            "rad",
            "Direction of the other's motion relative to the ego's heading.",
            of_contact!(impact_angle_rad),
        )
        .text("contact_striker", "ego, other or both.", |(_, r)| {
            r.outcome.contact.as_ref().map_or(Cell::Nothing, |c| word(&c.striker))
        })
        .text("contact_ego_side", "The ego's side that was touched.", |(_, r)| {
            r.outcome.contact.as_ref().map_or(Cell::Nothing, |c| word(&c.ego_side))
        })
        .text("contact_other_side", "The other's side that was touched.", |(_, r)| {
            r.outcome.contact.as_ref().map_or(Cell::Nothing, |c| word(&c.other_side))
        })
        .text("contact_class", "Who struck whom, by directions.", |(_, r)| {
            r.outcome.contact.as_ref().map_or(Cell::Nothing, |c| word(&c.class))
        })
        .number("contact_visible_s", "s", "How long before it the ego could see it coming.", |(_, r)| {
            r.outcome.contact.and_then(|contact| contact.visible_s)
        })
        .flag("contact_avoidable", "Whether braking or swerving would have avoided it.", |(_, r)| {
            r.outcome.contact.and_then(|contact| contact.avoidable)
        })
        .number("ego_speed_mps_mean", "m/s", "The ego's mean speed.", |(_, r)| r.outcome.ego.speed_mps_mean)
        .number("ego_speed_mps_max", "m/s", "The ego's largest speed.", |(_, r)| r.outcome.ego.speed_mps_max)
        .number("ego_deceleration_mps2_max", "m/s2", "How hard the ego braked.", |(_, r)| {
            r.outcome.ego.deceleration_mps2_max
        })
        .number("ego_jerk_mps3_max", "m/s3", "The ego's largest jerk.", |(_, r)| r.outcome.ego.jerk_mps3_max)
        .number("ego_distance_m", "m", "How far the ego drove.", |(_, r)| r.outcome.ego.distance_m)
        .text("trace", "Digest of the whole motion.", |(_, r)| r.outcome.trace);
    columns.laid_out("rollouts", "a rollout", rollouts)
}
