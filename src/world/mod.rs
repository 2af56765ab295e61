//! The evaluator before rollout: features, predictor, calibrator, router.

mod calibration;
mod configuration;
mod features;
mod interaction;
mod ridge;
mod router;

pub use calibration::{CalibrationSet, LabelError, group_key, settle};
pub use configuration::{ConfigurationError, validate};
pub use features::{CandidateFeatures, FeatureError, candidate_features, features, schema};
pub use interaction::Interaction;
pub use ridge::fit_ridge;
pub use router::{PairPrediction, Routed, Router, RouterError, drawn_by_monitor, monitor_stream};

#[cfg(test)]
mod tests;
