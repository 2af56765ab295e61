//! Everything that stays fixed during a run: scenes and their split, lineages, models, options.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, OnceLock};

use super::RunError;
use super::composition::CompositionOptions;
use super::cost::Meter;
use super::counsel::{CounselOptions, Counsels};
use super::state::Probe;
use crate::adapters::{Family, Registry};
use crate::archive::{ArchiveOptions, SelectorOptions};
use crate::compiler::Situation;
use crate::ego::Policy;
use crate::evaluation::{EvaluationOptions, Group};
use crate::families::chatscene;
use crate::kernel::{Digest, Seed, Threads};
use crate::llm::{Ask, ModelSpec};
use crate::memory::{CurationOptions, MemoryOptions};
use crate::objects::{Composed, FamilyName, LineageId, ParameterValue, Program, Role, WorldConfiguration};
use crate::scene::Scene;
use crate::scene::features::SceneFeatures;
use crate::scene::lanes::LaneGraph;
use crate::world::Interaction;

/// The fixed side of a run.
pub struct Study<'a> {
    pub name: String,
    /// Digest of the experiment's content, file paths left out.
    pub experiment: Digest,
    pub seed: Seed,
    pub scenes: Vec<SceneEntry>,
    pub pool_digest: Digest,
    /// Places in `scenes` that evolution may see.
    pub evolution: Vec<usize>,
    /// Places that stay closed until evolution is over.
    pub held_out: Vec<usize>,
    pub lineages: Vec<LineageSpec>,
    pub registry: Registry,
    /// The contracts of the lineages' families as prompts show them.
    pub contract_texts: BTreeMap<FamilyName, String>,
    pub budget: Budget,
    pub models: BTreeMap<Role, ModelSpec>,
    pub evaluation: EvaluationOptions,
    pub archive: ArchiveOptions,
    pub selector: SelectorOptions,
    pub memory: MemoryOptions,
    pub curation: CurationOptions,
    pub world: WorldConfiguration,
    /// What the template agent is asked for; without it parents are the published ones.
    pub composition: Option<CompositionOptions>,
    /// How the attacker agent is asked; needed where a lineage's family takes counsel.
    pub counsel: Option<CounselOptions>,
    /// What it said so far.
    pub counsels: Counsels,
    pub ask: &'a dyn Ask,
    pub pool: &'a Threads,
    /// What the work costs; no result depends on it.
    pub meter: Meter<'a>,
}

/// How much is tried.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Budget {
    pub epochs: u32,
    /// K, parallel proposals an epoch.
    pub slots: u32,
    /// Scenes of the rotating development window.
    pub window: usize,
    pub max_repair_rounds: u32,
    /// Scenes on which the compile gate tries a program.
    pub probe_scenes: usize,
    /// Accepted descendants that are measured on the whole evolution pool before one is chosen.
    pub finalists: usize,
}

/// A family evolved against one fixed ego.
#[derive(Clone, Debug)]
pub struct LineageSpec {
    pub id: LineageId,
    pub family: FamilyName,
    pub ego: Policy,
    /// Parameters in which this lineage's parent differs from its family's.
    pub parent: BTreeMap<String, ParameterValue>,
}

/// A scene with what is derived from it once.
pub struct SceneEntry {
    pub scene: Arc<Scene>,
    pub digest: Digest,
    pub features: SceneFeatures,
    /// From the logs alone, for the world evaluator.
    pub interaction: Interaction,
    /// By ego name: built on first use, because a replay whose rollouts are all at hand needs none.
    situations: BTreeMap<String, OnceLock<Result<Arc<Situation>, String>>>,
}

impl SceneEntry {
    /// Derives digest and features; `egos` are the drivers that the run's lineages use.
    pub fn new(scene: Arc<Scene>, egos: &[Policy]) -> SceneEntry {
        let digest = scene.digest();
        let interaction = Interaction::of(&scene);
        let features = SceneFeatures::of(&scene, &LaneGraph::of(&scene.road));
        let situations = egos.iter().map(|ego| (ego.name().to_string(), OnceLock::new())).collect();
        SceneEntry { scene, digest, features, interaction, situations }
    }

    /// Its group in SafeBench's protocol.
    pub fn group(&self) -> Option<Group> {
        self.scene.staging.as_ref().map(|staging| (staging.family, staging.route))
    }

    /// The scene as a compiler sees it against an ego.
    pub fn situation(&self, ego: &Policy) -> Result<Arc<Situation>, String> {
        let build = || Situation::new(self.scene.clone(), ego).map(Arc::new).map_err(|error| error.to_string());
        match self.situations.get(ego.name()) {
            Some(slot) => slot.get_or_init(build).clone(),
            None => build(),
        }
    }
}

impl Study<'_> {
    pub fn family(&self, spec: &LineageSpec) -> Result<&Family, RunError> {
        self.registry.get(&spec.family).ok_or_else(|| {
            let known: Vec<&str> = self.registry.iter().map(|f| f.contract.family.as_str()).collect();
            RunError::Study(format!("no family is called `{}`; there are {}", spec.family, known.join(", ")))
        })
    }

    /// The contract of a lineage's family as prompts show it.
    pub fn contract_text(&self, spec: &LineageSpec) -> Result<&str, RunError> {
        let text = self.contract_texts.get(&spec.family).map(String::as_str);
        text.ok_or_else(|| RunError::Study(format!("the contract of `{}` was not written out", spec.family)))
    }

    /// The program with which a lineage starts: its family's parent with the lineage's own parameters.
    pub fn parent(&self, spec: &LineageSpec) -> Result<Program, RunError> {
        self.composed_parent(spec, &[])
    }

    /// The same with what was composed for it; the lineage's own parameters stand above that.
    pub fn composed_parent(&self, spec: &LineageSpec, composed: &[Composed]) -> Result<Program, RunError> {
        let family = self.family(spec)?;
        let mut parent = family.parent.adopted(&spec.id);
        for (event, template) in composed.iter().filter_map(|event| Some((event, event.template.as_ref()?))) {
            chatscene::put(&mut parent, &event.kind, template);
        }
        parent.parameters.extend(spec.parent.clone());
        match family.contract.check_program(&parent).first() {
            None => Ok(parent),
            Some(problem) => Err(RunError::Study(format!("lineage {}: its parent: {problem}", spec.id))),
        }
    }

    /// Private words of the other families that evolve in this run, sorted: a family that is registered but takes no part
    /// changes no prompt. The isolation gate knows every registered family.
    pub fn foreign_vocabulary(&self, spec: &LineageSpec) -> Vec<String> {
        let takes_part = |family: &&Family| self.lineages.iter().any(|other| other.family == family.contract.family);
        let others = self.registry.iter().filter(|family| family.contract.family != spec.family).filter(takes_part);
        let words: BTreeSet<String> = others.flat_map(|family| family.contract.private_vocabulary.clone()).collect();
        words.into_iter().collect()
    }

    /// Tags of the scenes at these places, sorted, without repeats.
    pub fn tags(&self, places: &[usize]) -> Vec<String> {
        let tags: BTreeSet<&str> =
            places.iter().flat_map(|&place| self.scenes[place].features.tags.iter().copied()).collect();
        tags.into_iter().map(String::from).collect()
    }

    /// Places of the development window of an epoch: `window` scenes on, each epoch, around the evolution pool.
    pub fn window(&self, epoch: u32) -> Vec<usize> {
        let n = self.evolution.len();
        let size = self.budget.window.min(n);
        let start = (epoch as usize * size) % n.max(1);
        (0..size).map(|k| self.evolution[(start + k) % n]).collect()
    }

    /// Scenes on which the compile gate tries programs: the first of the window that can be prepared.
    pub fn probes(&self, epoch: u32, spec: &LineageSpec) -> Result<Vec<Probe>, RunError> {
        let places: Vec<usize> = self.window(epoch).into_iter().take(self.budget.probe_scenes).collect();
        let situations = self.pool.map(&places, |_, &place| {
            self.scenes[place].situation(&spec.ego).map(|situation| Probe { place, situation })
        });
        situations.into_iter().collect::<Result<Vec<_>, String>>().map_err(RunError::Study)
    }
}
