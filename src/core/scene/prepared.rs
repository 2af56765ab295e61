//! A scene with the data derived from it alone: the graph of its lanes and its features. Derived once and shared by
//! all work on the scene.

use std::sync::Arc;

use super::{LaneGraph, Scene, SceneFeatures};

/// A scene ready to be worked on.
#[derive(Clone, Debug)]
pub struct PreparedScene {
    /// The scene as validated.
    pub scene: Arc<Scene>,
    /// Its lanes with their links, and queries by place.
    pub lanes: Arc<LaneGraph>,
    /// The numbers and tags that conditions and expressions may read.
    pub features: SceneFeatures,
}

impl PreparedScene {
    /// Derives the graph and the features of a scene.
    pub fn new(scene: Arc<Scene>) -> Arc<PreparedScene> {
        let lanes = Arc::new(LaneGraph::of(&scene.road));
        let features = SceneFeatures::of(&scene, &lanes);
        Arc::new(PreparedScene { scene, lanes, features })
    }
}
