//! SafeBench's metrics as the paper reports them: collision rate, overall score, adversarial realism, attack.

use serde::{Deserialize, Serialize};

mod ars;
#[cfg(test)]
mod null_tests;
mod overall;
mod preventable;

pub use ars::{
    Ars, ArsOptions, BoundedOptions, DistanceOptions, InteractionOptions, KinematicsOptions, MapOptions,
    ValidityOptions, WEIGHTS, ars, run_realism,
};
pub use overall::{Criteria, criteria, staged_run};
pub use preventable::{PreventableOptions, StandingOptions};

/// Options of SafeBench's protocol besides its formulas.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SafebenchOptions {
    /// Scenes that balanced selection keeps per group of family and route; at least 1.
    pub selected_per_group: usize,
    /// Options of the realism score.
    pub ars: ArsOptions,
    /// The stricter reading; without it every staged contact counts, as SafeBench counts.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub preventable: Option<PreventableOptions>,
}

impl SafebenchOptions {
    /// The name of the first option that defines no score, and what it must be.
    pub fn fault(&self) -> Option<(&'static str, &'static str)> {
        let count = (self.selected_per_group == 0).then_some(("selected_per_group", "at least 1"));
        count.or_else(|| self.ars.fault()).or_else(|| self.preventable.and_then(|options| options.fault()))
    }
}

/// A_CARLA = CR (1 - OS) (paper eq. app-carla-objectives).
pub fn attack(collision_rate: f64, overall_score: f64) -> f64 {
    collision_rate * (1.0 - overall_score)
}

/// S_trace = 100 A R Valid (paper eq. app-carla-trace-score): for pictures of progress only.
pub fn trace_score(attack: f64, realism: f64, valid_rate: f64) -> f64 {
    100.0 * attack * realism * valid_rate
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_that_define_no_score_are_named() {
        let whole = ars::tests::PUBLISHED;
        assert_eq!(whole.fault(), None);
        assert_eq!(
            SafebenchOptions { selected_per_group: 0, ..whole }.fault(),
            Some(("selected_per_group", "at least 1"))
        );
        for no_number in [0.0, -1.0, f64::INFINITY, f64::NAN] {
            let mut other = whole;
            other.ars.map.off_road_tolerance_m = no_number;
            assert_eq!(other.fault().map(|(name, _)| name), Some("map.off_road_tolerance_m"), "{no_number}");
            if no_number != 0.0 {
                let bounds = PreventableOptions { wrong_way_m_max: no_number, unrolled_m_max: 1.0, standing: None };
                let fault = SafebenchOptions { preventable: Some(bounds), ..whole }.fault();
                assert_eq!(fault.map(|(name, _)| name), Some("preventable.wrong_way_m_max"), "{no_number}");
            }
        }
        for no_bound in [-1.0, f64::INFINITY, f64::NAN] {
            let mut other = whole;
            other.ars.validity.jump_m_max = no_bound;
            assert_eq!(other.fault().map(|(name, _)| name), Some("validity.jump_m_max"), "{no_bound}");
        }
    }

    #[test]
    fn attack_is_worked_by_hand_from_the_paper_s_table() {
        // CR 0.631 and OS 0.589 stand beside an attack of 0.260 in the paper.
        assert!((attack(0.631, 0.589) - 0.259_341).abs() < 1e-9);
        assert!((trace_score(0.25, 0.8, 0.5) - 10.0).abs() < 1e-12);
    }
}
