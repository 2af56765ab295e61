//! One file a metric. All read an [`Outcome`](crate::sim::Outcome) and options of the experiment file, nothing else.

pub mod acceleration;
pub mod attack;
pub mod collision_validity;
pub mod continuity;
pub mod initial_overlap;
pub mod jerk;
pub mod map;
pub mod realism;
pub mod route_progress;
pub mod safebench;

pub use attack::{AttackOptions, AttackTarget};
pub use realism::{BoundedDiagnostic, Diagnostic, OptionsError, RealismOptions};

use serde::{Deserialize, Serialize};

/// Everything that turns outcomes into objectives. Comes from the experiment file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EvaluationOptions {
    pub attack: AttackOptions,
    pub realism: RealismOptions,
    /// SafeBench's protocol instead of the two above: scenes must be staged for its traffic families.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub safebench: Option<safebench::SafebenchOptions>,
}

/// `1 - min(v / ρ, 1)`: a soft diagnostic of a non-negative violation `v` with tolerance scale ρ, same unit (paper eq.
/// app-metadrive-realism-score).
pub fn soft(violation: f64, tolerance: f64) -> f64 {
    1.0 - (violation.max(0.0) / tolerance).min(1.0)
}

#[cfg(test)]
mod tests {
    use super::soft;

    #[test]
    fn a_soft_diagnostic_falls_linearly_to_zero_at_its_tolerance() {
        assert_eq!([soft(0.0, 2.0), soft(0.5, 2.0), soft(2.0, 2.0), soft(9.0, 2.0)], [1.0, 0.75, 0.0, 0.0]);
    }
}
