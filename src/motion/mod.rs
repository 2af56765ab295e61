//! What moves: vehicle models, priors over motion, offsets, tokens, laws of a traffic family, and the candidate that any
//! of them gives. Nothing here knows an ego, a program or a search.

pub mod bicycle;
pub mod candidate;
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
pub use driven::Driven;
pub use scripted::Scripted;
pub use window::Window;
