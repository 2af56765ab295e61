//! What a scene's way through the graph has come to at a node.

use crate::scene::TrackIx;
use crate::stage::Part;

/// What has been decided on the way to a node.
#[derive(Clone, Default)]
pub struct Flow {
    /// Who becomes an adversary, in order of rank.
    pub actors: Vec<TrackIx>,
    pub parts: Vec<Part>,
    /// Why nothing is left here, and the scene alone if this way is the one taken.
    pub stop: Option<String>,
    /// Whether a filter on the way refused everything, and handed the least bad back.
    pub forced: bool,
    /// The choice, one index a part.
    pub chosen: Vec<usize>,
}
