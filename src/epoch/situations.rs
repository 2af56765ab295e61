//! The study's scenes as compilers see them against its egos. Each is built when it is first asked for, because a replay
//! whose rollouts are all at hand needs none.

use std::collections::BTreeMap;
use std::sync::{Arc, OnceLock};

use super::study::Study;
use crate::ego::Policy;
use crate::scene::PreparedScene;
use crate::sim::SimulatorOptions;
use crate::stage::Situation;

/// By place in the study's scenes, then by ego.
pub struct Situations {
    simulator: SimulatorOptions,
    places: Vec<Place>,
}

struct Place {
    prepared: Arc<PreparedScene>,
    by_ego: BTreeMap<String, OnceLock<Built>>,
}

/// A situation, or why the ego cannot drive the scene.
type Built = Result<Arc<Situation>, String>;

impl Situations {
    /// For the scenes of a study and the drivers of its lineages; nothing is built yet.
    pub fn of(study: &Study) -> Situations {
        let egos = || study.lineages.iter().map(|spec| (spec.ego.name().to_string(), OnceLock::new())).collect();
        let place = |entry: &super::study::SceneEntry| Place { prepared: entry.prepared.clone(), by_ego: egos() };
        Situations { simulator: study.simulator, places: study.scenes.iter().map(place).collect() }
    }

    /// The scene at a place against an ego.
    pub fn at(&self, place: usize, ego: &Policy) -> Built {
        let Place { prepared, by_ego } = &self.places[place];
        let under = || Situation::under(prepared.clone(), ego, &self.simulator);
        let build = || under().map(Arc::new).map_err(|error| error.to_string());
        match by_ego.get(ego.name()) {
            Some(built) => built.get_or_init(build).clone(),
            None => build(),
        }
    }
}
