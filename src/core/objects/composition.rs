//! Composition of a template from a description: the choices, what a model chose, and the record of how it did so.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::{attempt::Exchange, ids::LineageId, score::Score};
use crate::kernel::num;

/// A behaviour that a template may show.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct BehaviourForm {
    /// The contract's word for it.
    pub word: &'static str,
    /// Effect of the behaviour, for the prompt.
    pub describes: &'static str,
}

/// A number that a template draws from a range.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct RangeForm {
    /// Name in the answer.
    pub name: &'static str,
    /// Unit of both ends.
    pub unit: &'static str,
    /// Effect of the number, for the prompt.
    pub describes: &'static str,
    /// Smallest value of the lower end, in `unit`.
    pub low_min: f64,
    /// Largest value of the upper end, in `unit`.
    pub high_max: f64,
    /// The range of the published template.
    pub published: [f64; 2],
}

/// The choices of a model for one kind of scenario.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TemplateForm {
    /// Kind of scenario.
    pub kind: &'static str,
    /// The behaviours to choose from.
    pub behaviours: Vec<BehaviourForm>,
    /// Behaviour of the published template.
    pub published: &'static str,
    /// The ranges to fill in.
    pub ranges: Vec<RangeForm>,
}

/// A template as a model composed it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Composition {
    /// Name of the chosen behaviour.
    pub behaviour: String,
    /// Name of a drawn number -> low and high, in its unit; all numbers of the form.
    pub ranges: BTreeMap<String, [f64; 2]>,
    /// Why, in the model's words.
    pub reason: String,
}

impl TemplateForm {
    /// Why a composition cannot be used, and what is expected.
    pub fn fault(&self, template: &Composition) -> Option<String> {
        if !self.behaviours.iter().any(|form| form.word == template.behaviour) {
            let words: Vec<&str> = self.behaviours.iter().map(|form| form.word).collect();
            return Some(format!("behaviour: found `{}`, expected one of {}", template.behaviour, words.join(", ")));
        }
        if let Some(unknown) = template.ranges.keys().find(|name| !self.ranges.iter().any(|form| form.name == *name)) {
            return Some(format!("ranges: `{unknown}` is not drawn by this template"));
        }
        self.ranges.iter().find_map(|form| {
            let (name, low_min, high_max) = (form.name, form.low_min, form.high_max);
            let Some([low, high]) = template.ranges.get(name) else { return Some(format!("ranges: no `{name}`")) };
            let fits = low_min <= *low && low <= high && *high <= high_max;
            (!fits).then(|| {
                let expected = format!("low <= high within {low_min} to {high_max} {}", form.unit);
                format!("ranges/{name}: found {low} to {high}, expected {expected}")
            })
        })
    }
}

/// The simulator's result for a template: the parent with it, in scenes of its kind.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TemplateTrial {
    /// The template that was tried.
    pub template: Composition,
    /// Scenes of its kind that were simulated.
    pub scenes: usize,
    /// Scenes in which the road user acted.
    pub acted: usize,
    /// Scenes in which the ego failed by a contact that counts.
    pub collided: usize,
    /// Mean scene realism where it acted; `None` where it acted nowhere.
    pub realism: Option<f64>,
}

impl TemplateTrial {
    /// Sums a template's labels up.
    pub fn of(template: Composition, score: &Score) -> TemplateTrial {
        let acted: Vec<f64> = score.scenes.iter().filter(|scene| scene.acted).map(|scene| scene.realism).collect();
        TemplateTrial {
            template,
            scenes: score.scenes.len(),
            acted: acted.len(),
            collided: score.scenes.iter().filter(|scene| scene.attack > 0.0).count(),
            realism: num::mean(&acted).map(|realism| num::rounded(realism, 4)),
        }
    }

    /// A template that could be tried in no scene.
    pub fn unseen(template: Composition) -> TemplateTrial {
        TemplateTrial { template, scenes: 0, acted: 0, collided: 0, realism: None }
    }

    /// Returns `true` if another template could make the ego fail more often.
    pub fn leaves_room(&self) -> bool {
        self.collided < self.scenes
    }
}

/// How the template of one kind of scenario of one lineage was found.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Composed {
    /// Whose parent was composed.
    pub lineage: LineageId,
    /// Kind of scenario.
    pub kind: String,
    /// Request of the experiment file.
    pub description: String,
    /// Every question that was asked, in order.
    pub exchanges: Vec<Exchange>,
    /// Every template that could be used, with the simulator's result for it, in order.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub trials: Vec<TemplateTrial>,
    /// The one of them that made the ego fail most often, the earliest among equals; `None`: no answer could be used, and the
    /// published template stays.
    pub template: Option<Composition>,
}

impl Composed {
    /// `<lineage>/<kind>`: its name in commands.
    pub fn name(&self) -> String {
        format!("{}/{}", self.lineage, self.kind)
    }
}
