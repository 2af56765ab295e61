//! Content of a suite: scenes, actions of others in each, the outcome of the driver that was planned around, and the sources.

use serde::{Deserialize, Serialize};

use super::mark::DriverMark;
use super::thresholds::Thresholds;
use crate::kernel::Digest;
use crate::objects::{FamilyName, Origin, SolutionId};
use crate::scene::Pool;
use crate::sim::{ContactClass, Intervention, Outcome, SimulatorOptions};

/// A suite without its scenes' bodies.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Suite {
    /// Name in reports.
    pub name: String,
    /// Driver that the programs planned around, to which the labels belong.
    pub planned_around: DriverMark,
    /// Drivers that the programs planned around, scene by scene in turn, where there are several; empty with one.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub around: Vec<DriverMark>,
    /// Version of the simulator's meaning that the labels were made under.
    pub simulator: u32,
    /// Seed for a planner's random numbers.
    pub seed: u64,
    /// Rules under which scenes are simulated; a case names one of them.
    pub rules: Vec<SimulatorOptions>,
    /// The programs that moved others.
    pub programs: Vec<Member>,
    pub sizes: Sizes,
    /// Thresholds that hold where no others are asked for.
    pub thresholds: Thresholds,
    /// Terms under which the scenes may be passed on.
    pub licences: Vec<Licence>,
    pub cases: Vec<Case>,
    /// The scenes of all cases.
    #[serde(skip)]
    pub pool: Pool,
}

/// A program of a suite.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Member {
    pub name: SolutionId,
    pub family: FamilyName,
    /// Hash of its content.
    pub program: Digest,
    /// Root of its random streams.
    pub seed: u64,
    /// Runs that it came from, with its proposers; empty for a family's own parent.
    pub origins: Vec<Origin>,
}

/// Sizes and filters that were asked for.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sizes {
    /// Scenes of each family, at most.
    pub per_family: usize,
    /// Share of scenes in which nobody is moved.
    pub plain_share: f64,
    /// True if only contacts were taken that a careful ego avoids.
    pub preventable_only: bool,
    /// Least realism of the program's motion, 0 to 1; `None` where any was taken.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub min_realism: Option<f64>,
    /// Classes of contact that were taken; empty where all were.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub classes: Vec<ContactClass>,
}

/// Source of scenes, and terms under which they may be passed on.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Licence {
    /// Format of the scenes' source.
    pub source: String,
    pub scenes: usize,
    pub terms: String,
}

/// One scene with the actions of others in it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Case {
    /// `family:scene`, unique in the suite.
    pub id: String,
    /// Id of the scene.
    pub scene: String,
    /// Family of the program, or `plain`.
    pub family: String,
    /// Place in [`Suite::programs`]; `None` where nobody is moved.
    pub program: Option<usize>,
    /// Place in [`Suite::rules`].
    pub rules: usize,
    /// The kind of place.
    pub cluster: String,
    /// Actions of others. They are stored whole, so that a road user that reacts to the ego reacts to the planner under test.
    pub intervention: Intervention,
    /// Outcome of the driver that was planned around.
    pub label: Outcome,
    /// Place of that driver in [`Suite::around`], where there are several.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub around: Option<usize>,
}

impl Member {
    /// Returns `true` if it is its family's own parent.
    pub fn is_parent(&self) -> bool {
        self.origins.is_empty()
    }
}

impl Case {
    /// The class of the frozen contact.
    pub fn class(&self) -> &'static str {
        class_of(&self.label)
    }
}

/// The class of an outcome's contact, or `none`.
pub fn class_of(outcome: &Outcome) -> &'static str {
    outcome.contact.map_or("none", |contact| contact.class.name())
}

impl Suite {
    /// Returns the program of a case; `None` where nobody is moved.
    pub fn program(&self, case: &Case) -> Option<&Member> {
        self.programs.get(case.program?)
    }

    /// Returns the driver that a case was planned around.
    pub fn planned_around(&self, case: &Case) -> &DriverMark {
        case.around.and_then(|place| self.around.get(place)).unwrap_or(&self.planned_around)
    }

    /// Returns the first contradiction in the suite, as its place and what was expected.
    pub fn fault(&self) -> Option<(String, String)> {
        let mut ids = std::collections::BTreeSet::new();
        let of_case = |case: &Case| -> Option<(&'static str, String)> {
            if self.pool.scene(&case.scene).is_none() {
                return Some(("scene", format!("a scene of the suite, found {:?}", case.scene)));
            }
            if case.rules >= self.rules.len() {
                return Some(("rules", format!("a place among {} rules, found {}", self.rules.len(), case.rules)));
            }
            if let Some(found) = case.around.filter(|around| *around >= self.around.len()) {
                return Some(("around", format!("a place among {} drivers, found {found}", self.around.len())));
            }
            let program = case.program.filter(|program| *program >= self.programs.len());
            program.map(|found| ("program", format!("a place among {} programs, found {found}", self.programs.len())))
        };
        for case in &self.cases {
            if !ids.insert(case.id.as_str()) {
                return Some((format!("cases, {:?}", case.id), "each id once".into()));
            }
            if let Some((field, expected)) = of_case(case) {
                return Some((format!("cases, {:?}, {field}", case.id), expected));
            }
        }
        let rules = self.rules.iter().find_map(|rules| rules.check().err());
        if let Some(error) = rules {
            return Some(("rules".into(), error.to_string()));
        }
        self.thresholds.fault().map(|(name, found)| (format!("thresholds, {name}"), format!("0 to 1, found {found}")))
    }

    pub fn case(&self, id: &str) -> Option<&Case> {
        self.cases.iter().find(|case| case.id == id)
    }
}
