//! A scene with what is derived from it alone: the graph of its lanes and its features. Derived once and shared by
//! whoever works on the scene.

use std::sync::Arc;

use super::{LaneGraph, Scene, SceneFeatures};

/// A scene ready to be worked on.
#[derive(Clone, Debug)]
pub struct PreparedScene {
    pub scene: Arc<Scene>,
    pub lanes: Arc<LaneGraph>,
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
