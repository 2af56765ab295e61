//! What a family works on: the situation of a scene against an ego, who can be an adversary there, the parts of a
//! decision while it is made, and what a candidate's features are.

pub mod actors;
pub mod ego_response;
pub mod ego_rollout;
pub mod judged;
pub mod operator;
pub mod road_field;
pub mod scripted;
pub mod situation;

pub use operator::{ActorOperator, Module, Operator, Part, Settings, Stage, StageError};
pub use situation::{EgoPath, Situation, SituationError};
