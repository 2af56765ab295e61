//! Records for tests.

use super::SceneScore;
use crate::kernel::Digest;

/// The label of a scene that is acted in, without a contact.
pub fn scene_score(scene: &str, attack: f64, realism: f64) -> SceneScore {
    SceneScore {
        scene: scene.into(),
        attack,
        realism,
        acted: true,
        diagnostics: Default::default(),
        metrics: Default::default(),
        contact: None,
        intervened: true,
        by_ego: Default::default(),
        request: Digest::of_bytes(scene.as_bytes()),
        record: Digest::of_bytes(b"record"),
    }
}
