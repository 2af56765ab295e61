//! Labels of programs on scenes, from records or from the simulator, and what a set of them amounts to.

pub(super) mod applied;
pub(super) mod labels;
pub(super) mod made;
pub(super) mod measure;
pub(super) mod play;
pub(super) mod probe;
pub(super) mod replayed;
pub(super) mod rollouts;
pub(super) mod standings;
