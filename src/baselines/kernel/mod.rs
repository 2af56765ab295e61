//! What families stand on: facts of a scene, candidate trajectories, the motion prior, kinematics, searches. Written
//! once; a family adds only its signature.

pub mod actors;
pub mod adam;
pub mod bicycle;
pub mod candidate;
pub mod chat_template;
pub mod driven;
pub mod ego_response;
pub mod ego_rollout;
pub mod feasibility;
pub mod following;
pub mod gradient;
pub mod kinematics;
pub mod lane_paths;
pub mod latent;
pub mod motion_prior;
pub mod offsets;
pub mod posterior;
pub mod pso;
pub mod query_search;
pub mod road_field;
pub mod script_space;
pub mod scripted;
pub mod separation;
pub mod situation;
pub mod speed_profile;
pub mod stage;
pub mod token_grid;
pub mod traffic_family;

pub use candidate::Candidate;
pub use situation::{EgoPath, Situation, SituationError};
pub use stage::{ActorOperator, Module, Operator, Part, Settings, Stage, StageError, Window};
