//! Material that operators work on: the parts of a decision, the settings of a node, and expressions ready to be asked.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

use super::judged::{Judged, Needs, features};
use super::situation::Situation;
use crate::kernel::{Formula, Seed, Stream};
use crate::motion::offsets::OffsetSpace;
use crate::motion::{Candidate, Driven, Window};
use crate::objects::Counsel;
use crate::objects::expr::Compiled;
use crate::scene::TrackIx;

/// One adversary's part of a decision while it is made.
#[derive(Clone, Debug)]
pub struct Part {
    pub actor: TrackIx,
    pub window: Window,
    pub candidates: Vec<Candidate>,
    /// Continuous space that the motion operator opens instead of listing candidates.
    pub offsets: Option<OffsetSpace>,
    /// Likewise, a motion that is a differentiable function of a decision vector.
    pub driven: Option<Arc<dyn Driven>>,
    /// Number of whole scenarios that were simulated against the ego on the way to these candidates, whatever became of them.
    pub simulated: usize,
}

/// A motion or search operator: works on all adversaries of a scene together.
pub type Operator = fn(&Stage<'_>, &Settings, &mut [Part]) -> Result<(), StageError>;

/// An actor operator of a family's own: who becomes an adversary.
pub type ActorOperator = fn(&Stage<'_>, &Settings) -> Result<Vec<TrackIx>, StageError>;

/// Scene, seed and counsel for which a program is being compiled.
#[derive(Clone, Copy, Debug)]
pub struct Stage<'a> {
    pub situation: &'a Situation,
    pub seed: Seed,
    /// Counsel on who attacks in this scene; only families that take counsel are given one.
    pub counsel: Option<&'a Counsel>,
}

impl Stage<'_> {
    /// The random stream of one purpose for one actor. All programs draw the same numbers in a scene (common random numbers), so
    /// that two of them differ there only by what they decide.
    pub fn stream(&self, purpose: &str, actor: TrackIx) -> Stream {
        self.seed.stream(&["compile", self.situation.scene_id(), purpose, &actor.to_string()])
    }
}

/// An operator could not do its work: the settings are not what its kind declares.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum StageError {
    #[error("setting {0} is missing")]
    Missing(String),
    #[error("setting {setting} is {found}, expected {expected}")]
    Unfit { setting: String, found: String, expected: String },
}

/// A module of H with everything but the features of its slot filled in.
#[derive(Clone, Debug)]
pub struct Module {
    pub code: Arc<Compiled>,
    pub needs: Needs,
    /// Values of scene features and parameters, which follow the slot's features in the scope.
    pub tail: Vec<f64>,
    /// Recorder of its values, if somebody wants to know them.
    pub watched: Option<Arc<Watched>>,
}

/// Values of a module, one for each time that it was asked.
#[derive(Debug, Default)]
pub struct Watched(Mutex<Vec<f64>>);

impl Watched {
    /// The values so far, the smallest first.
    pub fn sorted(&self) -> Vec<f64> {
        let mut values = self.0.lock().unwrap_or_else(PoisonError::into_inner).clone();
        values.sort_by(f64::total_cmp);
        values
    }

    fn note(&self, value: f64) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).push(value);
    }
}

impl Module {
    /// The formula over the slot's features, everything else fixed to its value in this scene.
    pub fn formula(&self, slot_features: usize) -> Formula {
        self.code.formula().with_fixed(slot_features, &self.tail)
    }

    /// The value for these slot features.
    pub fn number(&self, mut slot_values: Vec<f64>) -> f64 {
        slot_values.extend_from_slice(&self.tail);
        let value = self.code.number(&slot_values);
        if let Some(watched) = &self.watched {
            watched.note(value);
        }
        value
    }

    pub fn boolean(&self, slot_values: Vec<f64>) -> bool {
        self.number(slot_values) != 0.0
    }

    /// The value for a candidate: its features, then those of its actor.
    pub fn of_candidate(&self, candidate: &Candidate, judged: &Judged<'_>) -> f64 {
        self.of_rehearsed(candidate, judged, &[])
    }

    /// The same of one that was rolled out: then what came of it, by `vocabulary::REHEARSED`.
    pub fn of_rehearsed(&self, candidate: &Candidate, judged: &Judged<'_>, came: &[f64]) -> f64 {
        let mut values = features(candidate, judged, self.needs);
        values.extend(judged.situation.facts(judged.actor).into_iter().flat_map(|facts| &facts.values));
        values.extend_from_slice(came);
        self.number(values)
    }
}

/// The settings of one node, resolved for one scene.
#[derive(Clone, Debug, Default)]
pub struct Settings {
    pub numbers: BTreeMap<String, f64>,
    pub words: BTreeMap<String, String>,
    pub modules: BTreeMap<String, Module>,
}

impl Settings {
    pub fn number(&self, name: &str) -> Result<f64, StageError> {
        self.numbers.get(name).copied().ok_or_else(|| StageError::Missing(name.into()))
    }

    /// A whole number that is not negative.
    pub fn count(&self, name: &str) -> Result<usize, StageError> {
        let value = self.number(name)?;
        if value.fract() == 0.0 && (0.0..=1e6).contains(&value) {
            return Ok(value as usize);
        }
        let expected = "a whole number".into();
        Err(StageError::Unfit { setting: name.into(), found: value.to_string(), expected })
    }

    pub fn word(&self, name: &str) -> Result<&str, StageError> {
        self.words.get(name).map(String::as_str).ok_or_else(|| StageError::Missing(name.into()))
    }

    pub fn module(&self, name: &str) -> Result<&Module, StageError> {
        self.modules.get(name).ok_or_else(|| StageError::Missing(name.into()))
    }

    /// A mechanism that may be left out.
    pub fn optional(&self, name: &str) -> Option<&Module> {
        self.modules.get(name)
    }
}
