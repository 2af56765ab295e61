//! The evaluator before rollout: features, predictor, calibrator, router.

mod boosted;
mod calibration;
mod configuration;
mod features;
mod interaction;
mod prediction;
mod ridge;
mod router;
mod table;

pub use calibration::{CalibrationSet, LabelError, settle};
pub use configuration::{ConfigurationError, validate};
pub use features::{CandidateView, FeatureError, SceneView, row, schema};
pub use interaction::Interaction;
pub use router::{Prediction, Router, RouterError, allot, audit_stream, drawn_by_monitor};

#[cfg(test)]
mod tests;
