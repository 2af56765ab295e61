//! Motion of road users: vehicle models, motion priors, offsets, tokens, the scripts of traffic families, and the
//! candidates that they give. Nothing here knows an ego, a program or a search.

pub mod bicycle;
pub mod candidate;
pub mod chat_behaviour;
pub mod chat_template;
pub mod driven;
pub mod feasibility;
pub mod following;
pub mod kinematics;
pub mod lane_paths;
pub mod latent;
pub mod motion_prior;
pub mod offsets;
pub mod script_space;
pub mod scripted;
pub mod separation;
pub mod speed_profile;
pub mod token_grid;
pub mod traffic_family;
pub mod window;

pub use candidate::Candidate;
pub use driven::{Drive, Driven};
pub use scripted::Scripted;
pub use window::Window;
