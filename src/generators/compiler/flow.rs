//! State of a scene's way through the graph at a node.

use crate::scene::TrackIx;
use crate::stage::Part;

/// Decisions on the way to a node.
#[derive(Clone, Default)]
pub struct Flow {
    /// Road users that become adversaries, in order of rank.
    pub actors: Vec<TrackIx>,
    pub parts: Vec<Part>,
    /// Reason why nothing is left here. If this way is the one taken, the scene is replayed without an intervention.
    pub stop: Option<String>,
    /// True if a filter on the way refused everything and handed back the least bad.
    pub forced: bool,
    /// The choice, one index a part.
    pub chosen: Vec<usize>,
    /// Rollouts that the choice itself took.
    pub rehearsed: usize,
}
