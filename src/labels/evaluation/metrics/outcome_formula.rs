//! An experiment's own attack: an expression over the outcome of a rollout, in the language of mechanisms
//! (`docs/LANGUAGE.md`). It decides in place of the lists of contact classes.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use crate::objects::ValueType;
use crate::objects::expr::{Compiled, Expr, Scope};
use crate::sim::{Contact, End, Fault, Outcome, Striker};

/// The field that says who is at fault.
const AT_FAULT: &str = "contact_at_fault";

/// Value where there was nothing to measure, metres or seconds: beyond any distance or time of interest.
const NOTHING_M: f64 = 200.0;
const NOTHING_S: f64 = 20.0;

/// A quantity of an outcome: its name, true for a truth value, its description, and its reader.
struct Field {
    name: &'static str,
    boolean: bool,
    describes: &'static str,
    read: fn(&Outcome) -> f64,
}

const fn number(name: &'static str, describes: &'static str, read: fn(&Outcome) -> f64) -> Field {
    Field { name, boolean: false, describes, read }
}

const fn truth(name: &'static str, describes: &'static str, read: fn(&Outcome) -> f64) -> Field {
    Field { name, boolean: true, describes, read }
}

fn of_contact(outcome: &Outcome, nothing: f64, read: impl Fn(&Contact) -> f64) -> f64 {
    outcome.contact.as_ref().map_or(nothing, read)
}

fn share(holds: bool) -> f64 {
    f64::from(u8::from(holds))
}

/// Quantities that an expression may read, in the order of its scope.
const FIELDS: [Field; 23] = [
    truth("contact", "the ego met somebody", |o| share(o.contact.is_some())),
    truth("contact_adversary", "it met an adversary", |o| of_contact(o, 0.0, |c| share(c.adversary))),
    truth("contact_avoidable", "braking or swerving would have avoided it", |o| {
        of_contact(o, 0.0, |c| share(c.avoidable == Some(true)))
    }),
    truth(AT_FAULT, "the ego is at fault for it by nuPlan's rule; needs simulator.at_fault = true", |o| {
        of_contact(o, 0.0, |c| share(c.fault.is_some_and(Fault::is_egos)))
    }),
    truth("contact_by_ego", "the ego drove into the other, alone or both into each other", |o| {
        of_contact(o, 0.0, |c| share(c.striker != Striker::Other))
    }),
    truth("contact_by_other", "the other drove into the ego, alone or both into each other", |o| {
        of_contact(o, 0.0, |c| share(c.striker != Striker::Ego))
    }),
    number("contact_speed_mps", "relative speed at the contact; 0 without", |o| {
        of_contact(o, 0.0, |c| c.relative_speed_mps)
    }),
    number("contact_time_s", "when, from the first simulated step; 20 without", |o| {
        of_contact(o, NOTHING_S, |c| c.time_s)
    }),
    number("contact_angle_rad", "the other's course against the ego's heading, -pi..pi; 0 without", |o| {
        of_contact(o, 0.0, |c| c.impact_angle_rad)
    }),
    number("contact_visible_s", "how long before it the ego could see it coming; 0 without", |o| {
        of_contact(o, 0.0, |c| c.visible_s.unwrap_or(0.0))
    }),
    truth("off_road", "the ego left its route", |o| share(o.end == End::OffRoad)),
    truth("arrived", "the ego arrived", |o| share(o.end == End::Arrived)),
    number("distance_m_min", "smallest distance of the boxes of ego and adversary; 200 if there was none", |o| {
        o.distance_m_min.unwrap_or(NOTHING_M)
    }),
    number("ttc_s_min", "smallest time to collision with an adversary; 20 if there was none", |o| {
        o.ttc_s_min.unwrap_or(NOTHING_S)
    }),
    number(
        "post_encroachment_s_min",
        "smallest time between one leaving and the other entering a place; 20 if never",
        |o| o.post_encroachment_s_min.unwrap_or(NOTHING_S),
    ),
    number("route_completion", "share of the ego's route driven, 0..1", |o| o.route_completion),
    number("ego_lateral_m_max", "largest distance of the ego from its route", |o| o.ego_lateral_m_max),
    number("ego_speed_mps_mean", "mean speed of the ego", |o| o.ego.speed_mps_mean),
    number("ego_speed_mps_max", "largest speed of the ego", |o| o.ego.speed_mps_max),
    number("ego_deceleration_mps2_max", "hardest braking of the ego", |o| o.ego.deceleration_mps2_max),
    number("ego_lateral_acceleration_mps2_max", "largest lateral acceleration of the ego", |o| {
        o.ego.lateral_acceleration_mps2_max
    }),
    number("ego_jerk_mps3_max", "largest jerk of the ego", |o| o.ego.jerk_mps3_max),
    number("adversary_count", "adversaries of the scene", |o| o.adversaries.len() as f64),
];

/// Name, `boolean` or `number`, and meaning of everything that an expression over outcomes may read.
pub fn outcome_fields() -> impl Iterator<Item = (&'static str, &'static str, &'static str)> {
    FIELDS.iter().map(|field| (field.name, if field.boolean { "boolean" } else { "number" }, field.describes))
}

/// An expression over an outcome, ready to evaluate. Formulas are equal if their texts are.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct OutcomeFormula {
    text: String,
    code: Arc<Compiled>,
}

impl PartialEq for OutcomeFormula {
    fn eq(&self, other: &OutcomeFormula) -> bool {
        self.text == other.text
    }
}

impl Eq for OutcomeFormula {}

/// A text that is no expression over outcomes.
#[derive(Debug, thiserror::Error)]
#[error("{text:?} is not a valid expression over an outcome: {reason}; `evodrive features` lists what it may read")]
pub struct OutcomeFormulaError {
    text: String,
    reason: String,
}

impl TryFrom<String> for OutcomeFormula {
    type Error = OutcomeFormulaError;

    fn try_from(text: String) -> Result<OutcomeFormula, OutcomeFormulaError> {
        let kind = |field: &Field| if field.boolean { ValueType::Boolean } else { ValueType::Number };
        let scope = Scope::new(FIELDS.iter().map(|field| (field.name, kind(field))));
        let read = Expr::parse(&text).and_then(|expr| Ok((expr.compile(&scope)?, expr)));
        let reason = match read {
            Ok((_, expr)) if expr.names().is_empty() => {
                "it reads nothing of it, so all scenes would have one value".into()
            }
            Ok((code, expr)) => return Ok(OutcomeFormula { text: expr.to_string(), code: Arc::new(code) }),
            Err(error) => error.to_string(),
        };
        Err(OutcomeFormulaError { text, reason })
    }
}

impl From<OutcomeFormula> for String {
    fn from(formula: OutcomeFormula) -> String {
        formula.text
    }
}

impl OutcomeFormula {
    /// Returns the canonical text.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// Returns `true` if it asks who is at fault, which outcomes say only where `simulator.at_fault` is true.
    pub fn asks_at_fault(&self) -> bool {
        // No other field's name holds this one's.
        self.text.contains(AT_FAULT)
    }

    /// Its value; a truth value is 0 or 1.
    pub fn value(&self, outcome: &Outcome) -> f64 {
        let values = FIELDS.each_ref().map(|field| (field.read)(outcome));
        self.code.number(&values)
    }

    /// Its value between 0 and 1.
    pub fn share(&self, outcome: &Outcome) -> f64 {
        self.value(outcome).clamp(0.0, 1.0)
    }
}
