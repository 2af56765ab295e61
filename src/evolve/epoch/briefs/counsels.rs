//! The counsel that was taken so far, by lineage and scene.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::epoch::RunError;
use crate::epoch::setting::study::{LineageSpec, Study};
use crate::objects::{Counsel, Counselled, LineageId};

/// Written once a lineage and scene, before anything reads it there.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Counsels(BTreeMap<LineageId, BTreeMap<String, Counsel>>);

impl Counsels {
    /// Returns the counsel of a recorded run.
    pub fn recorded(events: &[Counselled]) -> Counsels {
        let mut counsels = Counsels::default();
        events.iter().for_each(|event| counsels.keep(event));
        counsels
    }

    /// One counsel alone, for one scene of one lineage.
    pub fn given(lineage: &LineageId, scene: &str, counsel: Option<&Counsel>) -> Counsels {
        let given = |counsel: &Counsel| (lineage.clone(), BTreeMap::from([(scene.to_string(), counsel.clone())]));
        Counsels(counsel.map(given).into_iter().collect())
    }

    pub fn keep(&mut self, event: &Counselled) {
        self.0.entry(event.lineage.clone()).or_default().insert(event.scene.clone(), event.counsel.clone());
    }

    /// Only what one lineage was counselled.
    pub fn of(&self, lineage: &LineageId) -> Counsels {
        Counsels(self.0.get(lineage).map(|own| (lineage.clone(), own.clone())).into_iter().collect())
    }

    /// The counsel for the scene at a place; `None` for families that take none.
    ///
    /// # Errors
    /// None was taken there yet: the scene is not open to the lineage.
    pub fn at(&self, study: &Study, spec: &LineageSpec, place: usize) -> Result<Option<&Counsel>, RunError> {
        if study.source(spec)?.asks.counsel.is_none() {
            return Ok(None);
        }
        let scene = &study.scenes[place].scene().id;
        let counsel = self.0.get(&spec.id).and_then(|own| own.get(scene));
        counsel.map(Some).ok_or_else(|| {
            RunError::Study(format!(
                "lineage {}: no counsel was taken for scene {scene}, so it is not open yet",
                spec.id
            ))
        })
    }
}
