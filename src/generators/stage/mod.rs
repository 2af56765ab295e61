//! Material that a family works on: the situation of a scene against an ego, who can be an adversary there, the parts
//! of a decision while it is made, a candidate's features, and the form in which a family itself is used.

pub mod actors;
pub mod bystanders;
pub mod ego_path;
pub mod ego_response;
pub mod ego_rollout;
pub mod foreseen;
pub mod judged;
pub mod operator;
pub mod road_field;
pub mod scripted;
pub mod situation;
pub mod source;

pub use bystanders::Bystanders;
pub use ego_path::EgoPath;
pub use operator::{ActorOperator, Module, Operator, Part, Settings, Stage, StageError, Watched};
pub use situation::{Situation, SituationError, scene_values};
pub use source::{AskCounsel, AskTemplates, Asks, LeaderWay, Published, Source, Sources};
