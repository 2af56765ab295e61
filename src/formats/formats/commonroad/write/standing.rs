//! Decides which tracks are static obstacles, and how many obstacles a track becomes.

use crate::formats::staging::stretches;
use crate::kernel::Vec2;
use crate::scene::{AgentKind, Track};

/// Returns the number of obstacles of a track: one if it never moves, else one for each stretch from `start` on.
pub(super) fn count(track: &Track, start: usize) -> usize {
    if stands(track) { 1 } else { stretches(track, start).len() }
}

/// Returns `true` if a thing is in one place for the whole scene.
pub(super) fn stands(track: &Track) -> bool {
    let first = track.at(0).filter(|first| first.velocity == Vec2::ZERO);
    track.kind == AgentKind::Static && first.is_some() && track.samples.iter().all(|s| s.as_ref() == first)
}
