//! One file per metric. All read an [`Outcome`](crate::sim::Outcome) and options of the experiment file, nothing else.

mod acceleration;
pub mod attack;
mod collision_validity;
mod continuity;
pub mod diagnostic;
mod initial_overlap;
mod jerk;
pub mod limits;
mod map;
pub mod outcome_formula;
mod parked;
pub mod place_of_kind;
pub mod realism;
pub mod rolling;
mod route_completion;
pub mod safebench;
mod slip;
pub mod soft;
mod speed_of_kind;
mod wrong_way;

pub use attack::{AT_FAULT, AttackOptions, AttackOptionsError, PublishedReadings};
pub use diagnostic::{Counts, Diagnostic, Measure, Quantity};
pub use limits::{Calibration, Limit, Limits};
pub use outcome_formula::{OutcomeFormula, outcome_fields};
pub use realism::{DIAGNOSTICS, OptionsError, RealismOptions, Weights};

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

use crate::objects::{LabelRules, RealismMean, realism_name};

/// Everything that turns outcomes into objectives: one of the two protocols. Comes from the experiment file, where
/// `[evaluation.attack]` and `[evaluation.realism]` stand for MetaDrive's and `[evaluation.safebench]` for the other.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged, try_from = "WrittenOptions")]
pub enum EvaluationOptions {
    /// The MetaDrive protocol: success and realism, scene by scene.
    Metadrive(MetadriveOptions),
    /// Scenes must be staged for SafeBench's traffic families.
    Safebench {
        /// The table `[evaluation.safebench]`.
        safebench: safebench::SafebenchOptions,
    },
}

/// Rules by which the MetaDrive protocol labels a scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MetadriveOptions {
    /// Which contacts are a success.
    pub attack: AttackOptions,
    /// Rules for a plausible motion.
    pub realism: RealismOptions,
    /// Quantities of the experiment's own, measured in every scene beside the objectives: name -> expression over the outcome. They are
    /// shown to agents and readers and decide nothing.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub metrics: BTreeMap<String, OutcomeFormula>,
}

impl MetadriveOptions {
    /// Returns the rules by which labels are summed up.
    pub fn rules(&self) -> LabelRules {
        LabelRules { mean: self.realism.mean, attack: self.attack.requires.clone(), over_egos: None }
    }
}

/// Own metrics that an experiment may declare: each is a column of every prompt's window.
const METRICS_MAX: usize = 8;
/// Longest name of an own metric.
const METRIC_NAME_CHARS: usize = 40;

impl EvaluationOptions {
    /// Returns the rules by which labels are summed up; SafeBench's have one form.
    pub fn rules(&self) -> LabelRules {
        match self {
            EvaluationOptions::Safebench { .. } => LabelRules::default(),
            EvaluationOptions::Metadrive(options) => options.rules(),
        }
    }

    /// Returns the mean that gives the objective's realism; SafeBench's has one form.
    pub fn realism_mean(&self) -> RealismMean {
        match self {
            EvaluationOptions::Safebench { .. } => RealismMean::default(),
            EvaluationOptions::Metadrive(options) => options.realism.mean,
        }
    }

    /// Returns the realism's name for people.
    pub fn realism_name(&self) -> &'static str {
        realism_name(self.safebench().is_some(), self.realism_mean())
    }

    /// Options of SafeBench's protocol, if this is it.
    pub fn safebench(&self) -> Option<&safebench::SafebenchOptions> {
        match self {
            EvaluationOptions::Safebench { safebench } => Some(safebench),
            EvaluationOptions::Metadrive(_) => None,
        }
    }
}

/// The tables below `[evaluation]` as a file may hold them.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct WrittenOptions {
    attack: Option<AttackOptions>,
    realism: Option<RealismOptions>,
    safebench: Option<safebench::SafebenchOptions>,
    #[serde(default)]
    metrics: BTreeMap<String, OutcomeFormula>,
}

/// `[evaluation]` that names no protocol, or two.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ProtocolError {
    /// A table of the MetaDrive protocol beside that of SafeBench.
    #[error(
        "[evaluation.{0}] is read by the MetaDrive protocol only, and [evaluation.safebench] asks for SafeBench's; \
         remove one of the two"
    )]
    Unread(&'static str),
    /// A table that the MetaDrive protocol needs.
    #[error(
        "[evaluation.{0}] is missing; the MetaDrive protocol needs [evaluation.attack] and [evaluation.realism], \
         SafeBench's needs [evaluation.safebench] alone"
    )]
    Missing(&'static str),
    /// An own metric whose name cannot head a column.
    #[error(
        "evaluation.metrics.{0} is not a valid name of a metric; expected lower-case letters, digits and _, a letter first, at most 40 characters"
    )]
    MetricName(String),
    /// More own metrics than a prompt has room for.
    #[error("[evaluation.metrics] has {0} metrics; expected at most 8, because each adds a column to every prompt")]
    Metrics(usize),
}

/// Refuses names and numbers of own metrics that cannot be columns.
fn named_metrics(metrics: &BTreeMap<String, OutcomeFormula>) -> Result<(), ProtocolError> {
    let fits = |name: &str| {
        let plain = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_';
        name.starts_with(|c: char| c.is_ascii_lowercase()) && name.chars().all(plain) && name.len() <= METRIC_NAME_CHARS
    };
    match metrics.keys().find(|name| !fits(name)) {
        Some(name) => Err(ProtocolError::MetricName(name.clone())),
        None if metrics.len() > METRICS_MAX => Err(ProtocolError::Metrics(metrics.len())),
        None => Ok(()),
    }
}

impl TryFrom<WrittenOptions> for EvaluationOptions {
    type Error = ProtocolError;

    fn try_from(written: WrittenOptions) -> Result<EvaluationOptions, ProtocolError> {
        let metrics = written.metrics;
        named_metrics(&metrics)?;
        match (written.safebench, written.attack, written.realism) {
            (Some(_), None, None) if !metrics.is_empty() => Err(ProtocolError::Unread("metrics")),
            (Some(safebench), None, None) => Ok(EvaluationOptions::Safebench { safebench }),
            (Some(_), Some(_), _) => Err(ProtocolError::Unread("attack")),
            (Some(_), None, Some(_)) => Err(ProtocolError::Unread("realism")),
            (None, Some(attack), Some(realism)) => {
                Ok(EvaluationOptions::Metadrive(MetadriveOptions { attack, realism, metrics }))
            }
            (None, None, _) => Err(ProtocolError::Missing("attack")),
            (None, Some(_), None) => Err(ProtocolError::Missing("realism")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_own_metrics_are_lower_case_words_and_there_are_eight_at_most() {
        let named = |names: &[&str]| {
            let one =
                |name: &&str| (name.to_string(), OutcomeFormula::try_from("contact_speed_mps".to_string()).unwrap());
            named_metrics(&names.iter().map(one).collect())
        };
        let longest = "a".repeat(METRIC_NAME_CHARS);
        assert!(named(&["near_miss_2", "b", &longest]).is_ok());
        for bad in ["2nd", "_a", "Near", "nEar", "a-b", "a b", "", &format!("{longest}a")] {
            let name = bad.to_string();
            assert!(matches!(named(&["fine", bad]), Err(ProtocolError::MetricName(found)) if found == name), "{bad}");
        }
        let nine: Vec<String> = (0..=METRICS_MAX).map(|k| format!("m{k}")).collect();
        let nine: Vec<&str> = nine.iter().map(String::as_str).collect();
        assert!(matches!(named(&nine), Err(ProtocolError::Metrics(9))) && named(&nine[1..]).is_ok());
    }
}
