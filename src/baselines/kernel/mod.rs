//! What families stand on: facts of a scene, candidate trajectories, the motion prior, kinematics, searches. Written
//! once; a family adds only its signature.

pub mod actors;
pub mod bicycle;
pub mod candidate;
pub mod feasibility;
pub mod lane_paths;
pub mod motion_prior;
pub mod offsets;
pub mod posterior;
pub mod pso;
pub mod situation;
pub mod speed_profile;
pub mod stage;
pub mod traffic_family;

pub use candidate::Candidate;
pub use situation::{EgoPath, Situation, SituationError};
pub use stage::{Module, Operator, Part, Settings, Stage, StageError, Window};
