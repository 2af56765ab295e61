//! The evaluator before rollout: features, predictor, calibrator, router; and what judges a change of it.

mod audit;
mod by_value;
mod calibration;
mod configuration;
mod features;
mod groups;
mod held;
mod interaction;
mod judge;
pub mod measures;
mod pair_features;
mod pairs;
mod pilot;
mod prediction;
mod ridge;
mod router;
mod slope;
mod verdict;

pub use audit::audit;
pub use calibration::{CalibrationSet, LabelError, settle};
pub use configuration::{ConfigurationError, validate};
pub use features::{CandidateView, FeatureError, SceneView, row, schema};
pub use held::{Evidence, Held, Judging, WorldAgentOptions, held};
pub use interaction::Interaction;
pub use judge::judge;
pub use pair_features::{pair_row, pair_schema, schema_of};
pub use pilot::{pilot_order, pilot_places};
pub use router::{Router, RouterError, allot, audit_stream, drawn_by_monitor};
pub use verdict::{OfPairs, Prediction};

#[cfg(test)]
mod evolution_tests;
#[cfg(test)]
mod feature_tests;
#[cfg(test)]
mod numbers_tests;
#[cfg(test)]
mod pair_tests;
#[cfg(test)]
mod tests;
