//! Training of learned egos: soft actor-critic in our own simulator, the same bits on every machine.

mod adam;
mod batch;
mod checkpoint;
mod episode;
pub mod fleet;
mod init;
mod lesson;
mod memory;
mod options;
mod reward;
mod ride;
mod sac;
mod training;
mod trial;

pub use batch::{Pass, zeros_like};
pub use checkpoint::CheckpointError;
pub use fleet::{Fleet, FleetError, FleetOptions};
pub use lesson::Lesson;
pub use memory::{Episode, Memory};
pub use options::{TrainingOptions, TrainingOptionsError};
pub use reward::{Reward, Step};
pub use ride::{Keeps, Ride, step_to};
pub use sac::{Batch, Losses, Room, Sac, SacOptions, explore};
pub use training::{Grounds, News, Point, Training, TrainingError};
pub use trial::{Stopped, Trial, driven, driven_by, figures, trial};
