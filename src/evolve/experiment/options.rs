//! The experiment: everything that reaches a result, without defaults in code.

use serde::{Deserialize, Deserializer, Serialize, de::Error as _};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::ego_weights::{self, EgoWeights};
use super::{ExperimentError, ModelOptions, ParentProgram};
use crate::agents::Questions;
use crate::archive::search::SearchOptions;
use crate::archive::{ArchiveOptions, SelectorOptions};
use crate::backend::{BackendOptions, DriverOptions};
use crate::ego::Policy;
use crate::epoch::{CompositionOptions, CounselOptions, ProposalOptions, Without};
use crate::evaluation::EvaluationOptions;
use crate::kernel::Digest;
use crate::llm::SpendCap;
use crate::memory::{CurationOptions, MemoryOptions};
use crate::objects::{FamilyName, LineageId, OverEgos, ParameterValue, Role, WorldConfiguration};
use crate::scene::EvolutionSize;
use crate::sim::{AvoidanceOptions, PlantOptions, Scripts, SimulatorOptions};
use crate::synth::{FamilyOptions, SynthOptions};
use crate::world::WorldAgentOptions;

/// The ego that is a program of the experimenter's own.
pub const COMMAND: &str = "command";

/// A whole experiment.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Experiment {
    /// Lower-case letters, digits, `-` and `_`: it names the run folder.
    pub name: String,
    /// One sentence for reports.
    pub describes: String,
    /// How a seed of the file was chosen, where it was: tables repeat it. No part of the digest, because no result depends on it.
    #[serde(default, skip_serializing)]
    pub seed_note: Option<String>,
    /// Root of every random stream.
    pub seed: u64,
    /// How often each lineage is repeated, every time with draws of its own: the spread between searches. Repetitions
    /// have the lineage's id with `-s0`, `-s1` ... behind it, and therefore draw slots and scripted streams of their own.
    pub seeds: u32,
    /// Recorded answers, relative to the file.
    pub cassette: PathBuf,
    pub scenes: SceneSource,
    pub split: SplitOptions,
    pub budget: BudgetOptions,
    #[serde(rename = "lineage")]
    pub lineages: Vec<LineageOptions>,
    /// The program behind the ego `command`; needed where a lineage names that ego. The rollouts with it are those of
    /// `simulator.backend`, which follows from it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub driver: Option<DriverOptions>,
    /// Models by name.
    pub models: BTreeMap<String, ModelOptions>,
    /// Limits for live models; needed where there is one. No part of the digest, so that it can be raised on the way.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub spend: Option<SpendCap>,
    /// Request to the template agent, where a lineage's family takes templates; without it the published ones stay.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub composition: Option<CompositionOptions>,
    /// How the attacker agent is asked; needed where a lineage's family takes counsel, and refused elsewhere.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub counsel: Option<CounselOptions>,
    /// Role -> name of its model. Every role is named, so that one can be a real model and another scripted;
    /// `attacker_agent` only where a lineage's family takes counsel.
    pub roles: BTreeMap<Role, String>,
    /// Rules under which scenes are simulated, and the simulator.
    pub simulator: SimulatorTable,
    pub evaluation: EvaluationOptions,
    pub archive: ArchiveOptions,
    pub selector: SelectorOptions,
    pub memory: MemoryOptions,
    pub curation: CurationOptions,
    pub world: WorldConfiguration,
    /// How the world agent may change it; without it the configuration stays as it is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub world_agent: Option<WorldAgentOptions>,
    /// True if the sort of road user that a program inserts stays its parent's.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub fixed_bodies: bool,
    /// How a proposal is judged before any rollout, where that is not our way.
    #[serde(default, skip_serializing_if = "is_default")]
    pub proposals: ProposalOptions,
    /// Form of the questions to the roles that evolve programs; without it the first one, under which old answers are recorded.
    #[serde(default, skip_serializing_if = "Questions::is_plain")]
    pub questions: Questions,
    /// Method of the search, and its budget of rollouts; without it the archive's own, bounded by epochs and slots.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub search: Option<SearchOptions>,
    /// Parts of the system that the run does without.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub without: Option<Without>,
    /// The file that it was read from.
    #[serde(skip)]
    pub file: PathBuf,
    /// A file that means the same and has no base.
    #[serde(skip)]
    pub whole_text: String,
}

fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

/// The table `[simulator]`.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SimulatorTable {
    pub plant: PlantOptions,
    pub avoidance: AvoidanceOptions,
    /// True if outcomes say what in a motion a road user of its kind does not do.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub of_kind: bool,
    /// True if outcomes say where a road user of the motion's kind does not belong.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub of_place: bool,
    /// True if outcomes say who is at fault by nuPlan's rule.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub at_fault: bool,
    /// True if labels say which drivers of UN R157 would have avoided a contact.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub jury: bool,
    /// Form of SafeBench's scripts that traffic families stage.
    #[serde(default, skip_serializing_if = "is_default")]
    pub scripts: Scripts,
    /// `None` stands for our own simulator, whether `evodrive` is written or nothing: then the digest is the same, too.
    #[serde(default, deserialize_with = "written_backend", skip_serializing_if = "Option::is_none")]
    pub backend: Option<BackendOptions>,
}

impl SimulatorTable {
    /// The rules of our own simulator.
    pub fn rules(&self) -> SimulatorOptions {
        SimulatorOptions {
            plant: self.plant,
            avoidance: self.avoidance,
            of_kind: self.of_kind,
            of_place: self.of_place,
            at_fault: self.at_fault,
            jury: self.jury,
            scripts: self.scripts,
        }
    }
}

/// `"evodrive"`, or a table.
fn written_backend<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<BackendOptions>, D::Error> {
    #[derive(Deserialize)]
    #[serde(untagged)]
    enum Written {
        Named(String),
        Table(toml::Table),
    }
    match Written::deserialize(deserializer)? {
        Written::Named(name) if name == "evodrive" => Ok(None),
        Written::Named(name) => Err(D::Error::custom(format!(
            "simulator.backend is {name:?}, expected \"evodrive\" or a table with name, version, digest, options, cassette and worker"
        ))),
        // Through the table, so that the message names the field.
        Written::Table(table) => BackendOptions::deserialize(table)
            .map(Some)
            .map_err(|error| D::Error::custom(format!("simulator.backend: {}", error.message()))),
    }
}

/// Source of scenes.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(tag = "source", rename_all = "snake_case", deny_unknown_fields)]
pub enum SceneSource {
    /// Generated worlds.
    Synth { count: usize, seed: u64, options: SynthOptions },
    /// SafeBench's traffic families on generated roads.
    Safebench { seed: u64, options: FamilyOptions },
    /// Scenario files or folders of them, relative to this file.
    Files { paths: Vec<PathBuf> },
    /// A pool written by `evodrive scenes import`, relative to this file.
    Pool { path: PathBuf },
}

#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SplitOptions {
    /// `{ count = N }` or `{ share = 0.7 }` of the usable scenes that are not held out.
    pub evolution: EvolutionSize,
    /// Scenes that stay closed until evolution is over.
    pub held_out: usize,
    /// Scenes on which finalists are chosen, which no step of the search sees; without it they are chosen on those of evolution.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub selection: Option<usize>,
    /// Scenes of the rotating development window.
    pub window: usize,
    /// Treatment of scenes in which an ego under test meets somebody although no program acts.
    #[serde(default, skip_serializing_if = "PlainContacts::are_kept")]
    pub plain_contacts: PlainContacts,
}

/// Treatment of scenes in which an ego has a contact in the plain recording, without any program. A program can win nothing by that
/// contact, but the scene tells less of it than others.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PlainContacts {
    /// They are as good as others.
    #[default]
    Keep,
    /// They are left out before scenes are drawn: those in which any lineage's ego meets somebody, so that all lineages have the same.
    Drop,
}

impl PlainContacts {
    fn are_kept(&self) -> bool {
        *self == PlainContacts::Keep
    }
}

#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BudgetOptions {
    pub epochs: u32,
    /// K, parallel proposals an epoch.
    pub slots: u32,
    pub max_repair_rounds: u32,
    /// Scenes on which the compile gate tries a program.
    pub probe_scenes: usize,
    /// Accepted descendants that are measured on the whole evolution pool before one is chosen.
    pub finalists: usize,
    /// Most candidates of a scene that a program may roll out against the ego before it chooses; 0 where that is not offered.
    #[serde(default, skip_serializing_if = "crate::objects::is_unsaid")]
    pub rehearsals: u32,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LineageOptions {
    pub id: LineageId,
    pub family: FamilyName,
    /// `idm`, `idm-lights`, `pdm`, `frenet`, `replay`, `learned` or `command`.
    pub ego: String,
    /// Several drivers, `ego` first; empty with one.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub egos: Vec<String>,
    /// How a scene's label follows from those against several drivers.
    #[serde(default, skip_serializing_if = "is_default")]
    pub over_egos: OverEgos,
    /// The weights of a learned ego.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub policy: Option<EgoWeights>,
    /// Parameters in which this lineage's parent differs from its family's, such as SAGE's `preference_weight`.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub parent: BTreeMap<String, ParameterValue>,
    /// The program of another run that it starts from in place of its family's parent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub parent_program: Option<ParentProgram>,
    /// True if its parent is the one with the numbers that its family's authors published.
    #[serde(default, skip_serializing_if = "is_default")]
    pub published: bool,
    /// The program of the ego `command`, as the experiment's `[driver]` identifies it.
    #[serde(skip)]
    pub command: Option<Digest>,
}

impl LineageOptions {
    /// Its driver under test.
    ///
    /// # Errors
    /// An unknown name, a learned ego without weights, a file that does not hold weights.
    pub fn driver(&self) -> Result<Policy, String> {
        match (self.command, &self.policy) {
            (Some(digest), None) if self.ego == COMMAND => Ok(Policy::Command(digest)),
            (_, policy) => ego_weights::policy(&self.ego, policy.as_ref().filter(|_| self.takes_weights(&self.ego))),
        }
    }

    /// Returns `true` if the lineage's weights are this driver's: of several drivers, only the learned one has them.
    fn takes_weights(&self, ego: &str) -> bool {
        self.egos.is_empty() || ego == ego_weights::LEARNED
    }

    /// All its drivers under test, the first first.
    ///
    /// # Errors
    /// As [`LineageOptions::driver`].
    pub fn drivers(&self) -> Result<Vec<Policy>, String> {
        if self.egos.is_empty() {
            return Ok(vec![self.driver()?]);
        }
        let of = |ego: &String| ego_weights::policy(ego, self.policy.as_ref().filter(|_| self.takes_weights(ego)));
        self.egos.iter().map(of).collect()
    }
}

impl Experiment {
    /// A path that the file names, which lies relative to the file.
    pub fn beside(&self, path: &Path) -> PathBuf {
        self.file.parent().unwrap_or(Path::new(".")).join(path)
    }

    /// An error of this file.
    pub(super) fn problem(&self, problem: impl std::fmt::Display) -> ExperimentError {
        ExperimentError::File { file: self.file.display().to_string(), problem: problem.to_string() }
    }

    /// Digest of the content. Where files lie does not count; scenes and answers have digests of their own. Nor does how a live
    /// model is reached and what it may cost.
    pub fn digest(&self) -> Result<Digest, ExperimentError> {
        let mut content = self.clone();
        content.cassette = PathBuf::new();
        content.spend = None;
        // Its identity is that of the backend which follows from it.
        content.driver = None;
        if let Some(backend) = &mut content.simulator.backend {
            *backend = backend.content();
        }
        for model in content.models.values_mut() {
            (model.client, model.provenance, model.command) = (None, None, None);
        }
        match &mut content.scenes {
            SceneSource::Synth { .. } | SceneSource::Safebench { .. } => {}
            SceneSource::Files { paths } => paths.clear(),
            SceneSource::Pool { path } => *path = PathBuf::new(),
        }
        Digest::of("evodrive/experiment/1", &content).map_err(|error| self.problem(error))
    }
}
