//! Causes of a disagreement of two simulators about a contact: what their rollouts show, and which change of our plant mends it.

use serde::Serialize;

use super::pair::{Meeting, Pair, Tried};

/// A rollout without contact that came nearer than this just missed it, metres.
const NEAR_M: f64 = 0.3;
/// Egos or followers farther apart than this drove differently, metres.
const APART_M: f64 = 1.0;
/// A contact so soon after the start was there before anybody drove, s.
const START_S: f64 = 0.1;

/// Cause that the motion shows; the first that holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Cause {
    /// The contact happens within the first decision step: the boxes overlapped already.
    Start,
    /// The road user that the ego met is not on the road in the other rollout at that time.
    PartnerAbsent,
    /// The other rollout ended before the time of the contact: by arrival, or off the road.
    EndedBefore,
    /// The egos were more than 1 m apart.
    EgoElsewhere,
    /// The ego met traffic that stood more than 1 m away from there in the other rollout: it follows by IDM in one of them or in both.
    Follower,
    /// The other rollout came nearer than 0.3 m: boxes, or centimetres of motion.
    NearMiss,
    /// None of these.
    Untold,
}

/// A rollout about which the simulators disagree.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Disagreement {
    pub program: String,
    pub scene: String,
    pub ego: String,
    /// `first` or `second`: who says contact.
    pub contact_in: &'static str,
    pub with: Meeting,
    /// End of the other rollout, and how near it came, m.
    pub other_end: String,
    pub other_distance_m_min: Option<f64>,
    /// Distance of the egos at the time of the contact, m.
    pub ego_apart_m: Option<f64>,
    pub cause: Cause,
    /// The changes of our plant under which both say the same, by name.
    pub mended_by: Vec<String>,
}

/// The class of a disagreement.
pub fn cause(pair: &Pair) -> Option<Cause> {
    let (met, other) = match (&pair.a.contact, &pair.b.contact) {
        (Some(met), None) => (met, &pair.b),
        (None, Some(met)) => (met, &pair.a),
        _ => return None,
    };
    let apart = apart_m(pair, met);
    Some(match (pair.partner_apart_m, apart) {
        _ if met.time_s() <= START_S => Cause::Start,
        (_, None) if other.ego.len() as f64 <= 10.0 * met.time_s() => Cause::EndedBefore,
        (None, _) => Cause::PartnerAbsent,
        (Some(_), Some(apart)) if apart > APART_M => Cause::EgoElsewhere,
        (Some(apart), _) if apart > APART_M && !met.adversary => Cause::Follower,
        _ if other.distance_m_min.is_some_and(|distance| distance < NEAR_M) => Cause::NearMiss,
        _ => Cause::Untold,
    })
}

fn mended_by(pair: &Pair, tried: &Tried) -> Vec<String> {
    let other = if tried.own == 0 { &pair.b } else { &pair.a };
    let mends = |contact: &bool| *contact == other.contact.is_some();
    let named = pair.changed.iter().zip(&tried.changes);
    named.filter(|(contact, _)| mends(contact)).map(|(_, change)| change.clone()).collect()
}

/// Distance of the egos at the last whole step before a contact: the rollout with the contact may end within the step.
fn apart_m(pair: &Pair, met: &Meeting) -> Option<f64> {
    pair.ego_apart_m(f64::from(met.at_cs / 10) / 10.0)
}

/// The disagreement of a pair, if it is one.
pub(super) fn of(pair: &Pair, tried: &Tried) -> Option<Disagreement> {
    let cause = cause(pair)?;
    let (contact_in, met, other) = match &pair.a.contact {
        Some(met) => ("first", met, &pair.b),
        None => ("second", pair.b.contact.as_ref()?, &pair.a),
    };
    Some(Disagreement {
        scene: pair.scene.clone(),
        ego: pair.ego.clone(),
        program: pair.program.clone(),
        contact_in,
        with: met.clone(),
        other_end: other.end.clone(),
        other_distance_m_min: other.distance_m_min,
        ego_apart_m: apart_m(pair, met),
        cause,
        mended_by: mended_by(pair, tried),
    })
}
