//! The experiment file: everything that reaches a result, in one TOML file, without defaults.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::exit::Failure;
use super::models::{self, ModelOptions};
use crate::archive::{ArchiveOptions, SelectorOptions};
use crate::epoch::{CompositionOptions, CounselOptions};
use crate::evaluation::EvaluationOptions;
use crate::families;
use crate::kernel::Digest;
use crate::llm::SpendCap;
use crate::memory::{CurationOptions, MemoryOptions};
use crate::objects::{FamilyName, LineageId, ParameterValue, Role, WorldConfiguration};
use crate::scene::EvolutionSize;
use crate::store;
use crate::synth::{FamilyOptions, SynthOptions};

/// Bytes that an experiment file may have.
const FILE_BYTES_MAX: u64 = 1 << 20;

/// A whole experiment.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Experiment {
    /// Lower-case letters, digits, `-` and `_`: it names the run folder.
    pub name: String,
    /// One sentence for reports.
    pub describes: String,
    /// Root of every random stream.
    pub seed: u64,
    /// Recorded answers, relative to this file.
    pub cassette: PathBuf,
    pub scenes: SceneSource,
    pub split: SplitOptions,
    pub budget: BudgetOptions,
    #[serde(rename = "lineage")]
    pub lineages: Vec<LineageOptions>,
    /// Models by name.
    pub models: BTreeMap<String, ModelOptions>,
    /// What live models may use; needed where there is one. No part of the digest, so that it can be raised on the way.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub spend: Option<SpendCap>,
    /// What the template agent is asked for, where a lineage's family takes templates; without it the published ones stay.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub composition: Option<CompositionOptions>,
    /// How the attacker agent is asked; needed where a lineage's family takes counsel, and refused elsewhere.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub counsel: Option<CounselOptions>,
    /// Role -> name of its model. Every role is named, so that one can be a real model and another scripted;
    /// `attacker_agent` only where a lineage's family takes counsel.
    pub roles: BTreeMap<Role, String>,
    pub evaluation: EvaluationOptions,
    pub archive: ArchiveOptions,
    pub selector: SelectorOptions,
    pub memory: MemoryOptions,
    pub curation: CurationOptions,
    pub world: WorldConfiguration,
}

/// Where scenes come from.
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
    /// Scenes of the rotating development window.
    pub window: usize,
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
}

#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LineageOptions {
    pub id: LineageId,
    pub family: FamilyName,
    /// `idm` or `replay`.
    pub ego: String,
    /// Parameters in which this lineage's parent differs from its family's, such as SAGE's `preference_weight`.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub parent: BTreeMap<String, ParameterValue>,
}

/// Place of the first number that is NaN or infinite.
fn not_finite(at: &str, value: &toml::Value) -> Option<String> {
    match value {
        toml::Value::Float(x) if !x.is_finite() => Some(at.to_string()),
        toml::Value::Array(items) => items.iter().enumerate().find_map(|(i, v)| not_finite(&format!("{at}[{i}]"), v)),
        toml::Value::Table(table) => table.iter().find_map(|(key, v)| {
            let place = if at.is_empty() { key.clone() } else { format!("{at}.{key}") };
            not_finite(&place, v)
        }),
        _ => None,
    }
}

impl Experiment {
    /// Reads and checks an experiment file.
    pub fn read(path: &Path) -> Result<Experiment, Failure> {
        let bytes = store::read_bounded(path, FILE_BYTES_MAX).map_err(Failure::from)?;
        let shown = path.display();
        let text = String::from_utf8(bytes).map_err(|error| {
            Failure::bad_input(format!(
                "{shown}: byte {} is not UTF-8; an experiment is a text file",
                error.utf8_error().valid_up_to()
            ))
        })?;
        let table: toml::Table = text.parse().map_err(|error: toml::de::Error| {
            Failure::bad_input(format!("{shown}: {}", error.to_string().trim_end()))
        })?;
        if let Some(place) = not_finite("", &toml::Value::Table(table)) {
            return Err(Failure::bad_input(format!("{shown}: {place} is not a finite number; give it a value")));
        }
        let experiment: Experiment = toml::from_str(&text)
            .map_err(|error| Failure::bad_input(format!("{shown}: {}", error.to_string().trim_end())))?;
        experiment.check().map_err(|problem| Failure::bad_input(format!("{shown}: {problem}")))?;
        Ok(experiment)
    }

    /// What serde cannot see.
    fn check(&self) -> Result<(), String> {
        let legal = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-' || c == '_';
        let named = |what: &str, name: &str| match !name.is_empty() && name.len() <= 64 && name.chars().all(legal) {
            true => Ok(()),
            false => Err(format!("{what} `{name}` must be 1 to 64 lower-case letters, digits, `-` or `_`")),
        };
        named("name", &self.name)?;
        if self.lineages.is_empty() {
            return Err("no [[lineage]]: name at least one family and its ego".into());
        }
        let mut seen = std::collections::BTreeSet::new();
        for lineage in &self.lineages {
            named("lineage id", lineage.id.as_str())?;
            if !seen.insert(&lineage.id) {
                return Err(format!("two lineages are called `{}`; give each an id of its own", lineage.id));
            }
        }
        let counselled = self.check_counsel()?;
        let roles = Role::CRITICS.into_iter().chain([Role::Actor, Role::Repair]);
        let composes = self.check_composition()?;
        let asides = [(Role::AttackerAgent, counselled), (Role::TemplateAgent, composes)];
        for role in roles.chain(asides.into_iter().filter_map(|(role, asked)| asked.then_some(role))) {
            let name = self.roles.get(&role).ok_or(format!("[roles] names no model for `{}`", role.name()))?;
            if !self.models.contains_key(name) {
                let known: Vec<&str> = self.models.keys().map(String::as_str).collect();
                let role = role.name();
                return Err(format!("[roles] {role} = \"{name}\", but the models are: {}", known.join(", ")));
            }
        }
        models::check(self)?;
        let counts = [
            ("budget.epochs", u64::from(self.budget.epochs), 1000),
            ("budget.slots", u64::from(self.budget.slots), 1000),
            ("budget.probe_scenes", self.budget.probe_scenes as u64, 1000),
            ("budget.finalists", self.budget.finalists as u64, 1000),
            ("split.held_out", self.split.held_out as u64, 100_000),
            ("split.window", self.split.window as u64, 100_000),
        ];
        for (what, value, most) in counts {
            if value == 0 || value > most {
                return Err(format!("{what} is {value}, expected 1 to {most}"));
            }
        }
        if self.budget.max_repair_rounds > 8 {
            return Err(format!("budget.max_repair_rounds is {}, expected 0 to 8", self.budget.max_repair_rounds));
        }
        self.archive.validate().map_err(|error| format!("[archive] {error}"))?;
        Ok(())
    }

    /// Whether templates are composed: where the file describes some and a lineage's family takes them.
    fn check_composition(&self) -> Result<bool, String> {
        let sources = families::sources();
        let used = sources.iter().filter(|of| self.lineages.iter().any(|lineage| lineage.family == of.contract.family));
        let forms = used.filter_map(|of| of.asks.templates).flat_map(|asks| (asks.forms)());
        let kinds: Vec<&str> = forms.map(|form| form.kind).collect();
        let role = Role::TemplateAgent.name();
        match &self.composition {
            Some(_) if kinds.is_empty() => Err("no lineage's family takes templates; take [composition] out".into()),
            None if self.roles.contains_key(&Role::TemplateAgent) => {
                Err(format!("nothing is composed without [composition]; take {role} out of [roles]"))
            }
            Some(options) => match options.fault(&kinds) {
                Some((field, expected)) => Err(format!("composition.{field}: expected {expected}")),
                None => Ok(true),
            },
            None => Ok(false),
        }
    }

    /// Whether a lineage's family takes counsel: then, and only then, the file says how and of whom.
    fn check_counsel(&self) -> Result<bool, String> {
        let sources = families::sources();
        let asks = |family| sources.get(family).and_then(|source| source.asks.counsel);
        let takes = self.lineages.iter().find(|lineage| asks(&lineage.family).is_some());
        let role = Role::AttackerAgent.name();
        match (takes, &self.counsel) {
            (Some(lineage), None) => {
                let id = &lineage.id;
                Err(format!(
                    "lineage {id} takes counsel: give [counsel] rounds and vehicles, and a model for [roles] {role}"
                ))
            }
            (None, Some(_)) => Err("no lineage's family takes counsel; take [counsel] out".into()),
            (None, None) if self.roles.contains_key(&Role::AttackerAgent) => {
                Err(format!("no lineage's family takes counsel; take {role} out of [roles]"))
            }
            (_, Some(options)) => match options.fault() {
                Some((field, expected)) => Err(format!("counsel.{field}: expected {expected}")),
                None => Ok(true),
            },
            (None, None) => Ok(false),
        }
    }

    /// Digest of the content. Where files lie does not count; scenes and answers have digests of their own. Nor does how a live
    /// model is reached and what it may cost.
    pub fn digest(&self) -> Result<Digest, Failure> {
        let mut content = self.clone();
        content.cassette = PathBuf::new();
        content.spend = None;
        content.models.values_mut().for_each(|model| model.client = None);
        match &mut content.scenes {
            SceneSource::Synth { .. } | SceneSource::Safebench { .. } => {}
            SceneSource::Files { paths } => paths.clear(),
            SceneSource::Pool { path } => *path = PathBuf::new(),
        }
        Digest::of("evodrive/experiment/1", &content)
            .map_err(|error| Failure::bad_input(format!("experiment: {error}")))
    }
}
