//! The do-nothing row: the recorded scenes played without a program. It is the first row of tables, so that contacts that happen
//! anyway are not taken for a program's merit.

use serde::{Deserialize, Serialize};

use super::benchmark::BenchmarkRow;
use super::rules::LabelRules;
use super::score::SceneFailure;

/// Which of a study's scenes were played.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Suite {
    /// Those that evolution sees.
    Evolution,
    /// Those that stay closed until selection is over.
    HeldOut,
}

/// A scene without a program.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ReplayScene {
    /// Id of the scene.
    pub scene: String,
    /// True if the ego meets anyone.
    pub contact: bool,
    /// Mean r_MD of the vehicles that a program could take, as they were recorded: each judged alone, against what
    /// traffic of its kind shows and without its own recording as an excuse. `None` where no vehicle moves.
    pub realism: Option<f64>,
    /// Share of the ego's route driven, 0..=1.
    pub route_completion: f64,
}

impl ReplayScene {
    /// Attack of a program that does nothing, 0 or 1, with every class of contact counting.
    pub fn attack(&self, rules: &LabelRules) -> f64 {
        f64::from(self.contact && rules.counts_any_contact())
    }
}

/// The row.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ReplayRow {
    /// The ego that drove.
    pub ego: String,
    /// Which scenes.
    pub suite: Suite,
    /// Number of scenes that could be played.
    pub scenes: usize,
    /// Share of scenes in which the ego meets anyone: the score of a program that does nothing if any contact counted. Its
    /// actual score is [`ReplayRow::attack`].
    pub contact_rate: f64,
    /// Realism of the recorded traffic itself: mean over the scenes that have one, 0..=1.
    pub realism: Option<f64>,
    /// Mean share of the ego's route driven, 0..=1.
    pub route_completion: f64,
    /// Score of the empty program in SafeBench's protocol; `None` in MetaDrive's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub benchmark: Option<BenchmarkRow>,
}

impl ReplayRow {
    /// Attack of a program that does nothing, 0..=1, with every class of contact counting.
    pub fn attack(&self, rules: &LabelRules) -> f64 {
        if rules.counts_any_contact() { self.contact_rate } else { 0.0 }
    }
}

/// The row with its scenes, in their order.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Replayed {
    /// Means over the scenes.
    pub row: ReplayRow,
    /// The scenes that could be played.
    pub scenes: Vec<ReplayScene>,
    /// The scenes that could not be played, and why.
    pub failures: Vec<SceneFailure>,
}
