//! Briefs that tell and ask the agents: the snapshot in words, a slot's target, counsel and templates.

pub(super) mod aims;
pub(super) mod briefing;
pub(super) mod composition;
pub(super) mod conflicts;
pub(super) mod counsel;
pub(super) mod counsels;
pub(super) mod encounters;
pub(super) mod handbook;
pub(super) mod history;
pub(super) mod in_effect;
mod searching;
pub(super) mod target;
pub(super) mod window_rows;
