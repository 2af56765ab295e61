//! A lesson for learning, and for comparing: a scene with what others do to the ego there.

use std::sync::Arc;

use crate::sim::{Intervention, Plant};

/// One scene as it is driven. Plants are shared: several sets may hold one scene with different interventions.
#[derive(Clone, Debug)]
pub struct Lesson {
    pub plant: Arc<Plant>,
    /// Fixed beforehand: nothing that an ego learns changes it. Empty leaves the scene as it is.
    pub intervention: Intervention,
}

impl Lesson {
    /// Makes a lesson of a scene as it is.
    pub fn plain(plant: Arc<Plant>) -> Lesson {
        Lesson { plant, intervention: Intervention::default() }
    }
}

impl From<Plant> for Lesson {
    fn from(plant: Plant) -> Lesson {
        Lesson::plain(Arc::new(plant))
    }
}
