//! The evaluator before rollout: features, predictor, calibrator, router; and what judges a change of it.

mod audit;
mod boosted;
mod calibration;
mod configuration;
mod features;
mod held;
mod interaction;
mod judge;
pub mod measures;
mod pilot;
mod prediction;
mod ridge;
mod router;
mod slope;
mod table;

pub use audit::audit;
pub use calibration::{CalibrationSet, LabelError, settle};
pub use configuration::{ConfigurationError, validate};
pub use features::{CandidateView, FeatureError, SceneView, row, schema};
pub use held::{Evidence, Held, Judging, WorldAgentOptions, held};
pub use interaction::Interaction;
pub use judge::judge;
pub use pilot::{pilot_order, pilot_places};
pub use router::{Prediction, Router, RouterError, allot, audit_stream, drawn_by_monitor};

#[cfg(test)]
mod evolution_tests;
#[cfg(test)]
mod feature_tests;
#[cfg(test)]
mod numbers_tests;
#[cfg(test)]
mod tests;
