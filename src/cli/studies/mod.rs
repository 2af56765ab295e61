//! Commands for studies around the loop: the paper, claims, agreement, programs on other scenes, trained egos.

pub mod agree;
pub mod applied_text;
pub mod apply;
pub mod claims;
pub mod downstream;
pub mod downstream_sets;
pub mod downstream_train;
pub mod egos;
pub mod paper;
pub mod program;
pub mod train;
pub mod train_text;
