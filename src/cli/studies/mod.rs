//! Commands for studies around the loop: the paper, claims, agreement, programs on other scenes, trained egos.

pub mod agree;
pub mod applied_broken;
pub mod applied_text;
pub mod apply;
pub mod claims;
pub mod downstream;
pub mod downstream_sets;
pub mod downstream_train;
pub mod egos;
pub mod packed;
pub mod paper;
pub mod program;
pub mod program_check;
pub mod program_diff;
pub mod program_edit;
pub mod program_form;
pub mod program_hand;
pub mod train;
pub mod train_text;
