//! Everything that stays fixed during a run: scenes and their split, lineages, models, options.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use super::options::{CompositionOptions, CounselOptions, ProposalOptions, Without};
use crate::adapters::{Contract, Registry};
use crate::agents::Questions;
use crate::archive::search::{Method, SearchOptions, TuningOptions};
use crate::archive::{ArchiveOptions, SelectorOptions};
use crate::backend::{BackendOptions, DriveContext, PlanAround, ProgramContext};
use crate::candidates::Judging;
use crate::ego::Policy;
use crate::epoch::RunError;
use crate::evaluation::{EvaluationOptions, Group};
use crate::kernel::{Digest, Seed, canon::CanonError};
use crate::llm::ModelSpec;
use crate::memory::{CurationOptions, MemoryOptions};
use crate::objects::{
    Composed, FamilyName, Gate, JudgedOn, LineageId, Origin, OverEgos, ParameterValue, Program, Role, RoutingChoice,
    WorldConfiguration, WorldModel,
};
use crate::scene::{PreparedScene, Scene, SceneFeatures};
use crate::sim::SimulatorOptions;
use crate::stage::{Source, Sources};
use crate::world::{Interaction, WorldAgentOptions};

/// The fixed side of a run: plain data, which nothing changes.
pub struct Study {
    pub name: String,
    /// Digest of the experiment's content, file paths left out.
    pub experiment: Digest,
    pub seed: Seed,
    pub scenes: Vec<SceneEntry>,
    pub pool_digest: Digest,
    /// Digest of where the scenes came from and of what was left out, where the pool has runs seal it.
    pub provenance: Option<Digest>,
    /// Places in `scenes` that evolution may see.
    pub evolution: Vec<usize>,
    /// Places on which finalists are chosen; none where that is done on those of evolution.
    pub selection: Vec<usize>,
    /// Places that stay closed until evolution is over.
    pub held_out: Vec<usize>,
    pub lineages: Vec<LineageSpec>,
    /// Hashes of the programs with which the lineages start. A planner that is not blind is told of those that they are parents.
    pub parents: BTreeSet<Digest>,
    /// Every family that a lineage may be of.
    pub sources: Sources,
    /// Their contracts: what the gates judge patches by.
    pub registry: Registry,
    /// The contracts of the lineages' families as prompts show them.
    pub contract_texts: BTreeMap<FamilyName, String>,
    pub budget: Budget,
    pub models: BTreeMap<Role, ModelSpec>,
    /// Rules under which scenes are simulated.
    pub simulator: SimulatorOptions,
    /// Simulator of the rollouts for labels, and the choice of whose ego families plan around; `None` where our own simulates.
    pub backend: Option<BackendOptions>,
    pub evaluation: EvaluationOptions,
    pub archive: ArchiveOptions,
    /// Method of the search, where it is not the archive's own, and its budget of rollouts.
    pub search: Option<SearchOptions>,
    /// Parts of the system that this run does without.
    pub without: Without,
    /// How a proposal is judged before any rollout.
    pub proposals: ProposalOptions,
    /// True if no patch may bring in a sort of road user that its parent does not insert.
    pub fixed_bodies: bool,
    /// Form of the questions.
    pub questions: Questions,
    pub selector: SelectorOptions,
    pub memory: MemoryOptions,
    pub curation: CurationOptions,
    /// The configuration with which the evaluator begins.
    pub world: WorldConfiguration,
    /// How the world agent may change it; without it the configuration stays.
    pub world_agent: Option<WorldAgentOptions>,
    /// Request to the template agent; without it parents are the published ones.
    pub composition: Option<CompositionOptions>,
    /// How the attacker agent is asked; needed where a lineage's family takes counsel.
    pub counsel: Option<CounselOptions>,
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
    /// The lineage of the experiment file that this one repeats, and which repetition it is, from 0.
    pub group: LineageId,
    pub replica: u32,
    pub family: FamilyName,
    pub ego: Policy,
    /// Rule by which a scene's label follows from those against each driver, where it is played against several.
    pub over_egos: Option<OverEgos>,
    /// The same lineage against each of several drivers alone, `ego` first; empty with one driver.
    pub against: Vec<LineageSpec>,
    /// Parameters in which this lineage's parent differs from its family's.
    pub parent: BTreeMap<String, ParameterValue>,
    /// The program that it starts from in place of its family's parent.
    pub start: Option<Start>,
}

impl LineageSpec {
    /// Its driver under test in events, labels and tables: a name, or what is counted over which names.
    pub fn ego_label(&self) -> String {
        let egos: Vec<&str> = self.against.iter().map(|spec| spec.ego.name()).collect();
        match self.over_egos.filter(|_| !egos.is_empty()) {
            Some(rule) => rule.label(&egos),
            None => self.ego.name().to_string(),
        }
    }

    /// The lineage against each of its drivers alone; itself where it has one.
    pub fn by_ego(&self) -> &[LineageSpec] {
        if self.against.is_empty() { std::slice::from_ref(self) } else { &self.against }
    }

    /// The name of its driver where that is one of several of its lineage.
    pub fn one_of_several(&self) -> Option<String> {
        self.over_egos.filter(|_| self.against.is_empty()).map(|_| self.ego.name().to_string())
    }
}

/// A program of another run with which a lineage starts.
#[derive(Clone, Debug)]
pub struct Start {
    pub program: Program,
    /// The runs that it came out of, the oldest first.
    pub origins: Vec<Origin>,
}

/// A scene with what is derived from it once.
pub struct SceneEntry {
    pub prepared: Arc<PreparedScene>,
    pub digest: Digest,
    /// From the logs alone, for the world evaluator.
    pub interaction: Interaction,
}

impl SceneEntry {
    /// Derives digest, lanes, features and interaction.
    pub fn new(scene: Arc<Scene>) -> SceneEntry {
        let (digest, interaction) = (scene.digest(), Interaction::of(&scene));
        SceneEntry { prepared: PreparedScene::new(scene), digest, interaction }
    }

    pub fn scene(&self) -> &Arc<Scene> {
        &self.prepared.scene
    }

    pub fn features(&self) -> &SceneFeatures {
        &self.prepared.features
    }

    /// Its group in SafeBench's protocol.
    pub fn group(&self) -> Option<Group> {
        self.scene().staging.as_ref().map(|staging| (staging.family, staging.route))
    }
}

impl Study {
    /// The method that searches.
    pub fn method(&self) -> Method {
        self.search.as_ref().map_or(Method::Pareto, |search| search.method)
    }

    /// How free constants of patches are set; `None` where patches may leave none free.
    pub fn tuning(&self) -> Option<TuningOptions> {
        self.search.as_ref()?.tuning
    }

    /// The options of a method that decides in place of the archive's gates.
    pub fn rival(&self) -> Option<&SearchOptions> {
        self.search.as_ref().filter(|search| search.method.replaces_gates())
    }

    /// The critics that review proposals.
    pub fn critics(&self) -> Vec<Role> {
        let asked = !self.without.critics && self.search.as_ref().is_none_or(SearchOptions::has_critics);
        let of = |role: &Role| asked && !(self.without.isolation && *role == Role::IsolationCritic);
        Role::CRITICS.into_iter().filter(of).collect()
    }

    /// Returns `true` if attempts leave memory cards and prompts show some.
    pub fn has_memory(&self) -> bool {
        !self.without.memory && self.method() != Method::OpenEvolve && !self.method().draws_patches()
    }

    /// Gates that this run does not ask.
    fn skipped_gates(&self) -> Vec<Gate> {
        let as_openevolve = self.method() == Method::OpenEvolve;
        let effect = (as_openevolve || !self.proposals.effect_gate).then_some(Gate::Effect);
        let isolation = (self.without.isolation || as_openevolve).then_some(Gate::Isolation);
        isolation.into_iter().chain(effect).collect()
    }

    /// Returns what the gates judge a patch of a lineage by.
    pub fn judging<'a>(&'a self, contract: &'a Contract) -> Judging<'a> {
        Judging {
            contract,
            registry: &self.registry,
            skipped: self.skipped_gates(),
            closed: self.without.closed(),
            fixed_bodies: self.fixed_bodies,
        }
    }

    /// Returns `true` if candidates are simulated here before another simulator labels some of them. Its world evaluator then has
    /// columns from that, which every configuration of its agent may read.
    pub fn simulates_before(&self) -> bool {
        self.world.model == WorldModel::Simulator
    }

    /// Returns the digest of our own simulator for the key of a rollout that only predicts. Where the commands are those of a run
    /// without a backend, the rollout is that run's.
    pub fn predicting(&self) -> Result<Digest, CanonError> {
        if self.plans_around_backend() {
            Digest::of("evodrive/predicting/1", &self.rules()?)
        } else {
            self.simulator.digest()
        }
    }

    /// Returns `true` if anything rests on what the world evaluator is fitted to: who is simulated in a later epoch, or what
    /// its agent makes of it.
    pub fn evaluator_decides(&self) -> bool {
        let ranks = self.world.routing.choice == RoutingChoice::Ranked && !self.simulates_all();
        self.budget.epochs > 1 && (ranks || self.world_agent.is_some())
    }

    /// Returns `true` if every admitted candidate is simulated, whatever the world evaluator says of it.
    pub fn simulates_all(&self) -> bool {
        let routing = &self.world.routing;
        // A predicted loss is never above 1.
        let nobody_is_weak = routing.lambda_a >= 1.0 && routing.lambda_r >= 1.0;
        routing.rollout_budget >= self.budget.slots && (nobody_is_weak || routing.choice == RoutingChoice::Random)
    }

    /// Returns `true` if nothing that one lineage does changes what another one is asked: there is one lineage alone, or neither
    /// shared cards nor an evaluator that turns candidates away.
    pub fn lineages_stand_alone(&self) -> bool {
        self.world_agent.is_none() && (self.lineages.len() == 1 || (!self.has_memory() && self.simulates_all()))
    }

    /// Returns the digest of the simulator for a rollout's key: its options, and the backend where that is another simulator.
    pub fn rules(&self) -> Result<Digest, CanonError> {
        let own = self.simulator.digest()?;
        match &self.backend {
            None => Ok(own),
            Some(backend) if backend.is_blind() => Digest::of("evodrive/simulator-behind/1", &(own, backend.rules()?)),
            Some(backend) => Digest::of("evodrive/simulator-behind/2", &(own, backend.rules()?, &self.parents)),
        }
    }

    /// Returns what a planner that is not blind is told of a program.
    pub fn drive_context(&self, hash: Digest) -> DriveContext {
        DriveContext { seed: self.seed, under: ProgramContext::program(hash, self.parents.contains(&hash)) }
    }

    /// Returns the digest of the simulator for what a program comes to in a scene, before anybody simulates it.
    pub fn planning(&self) -> Result<Digest, CanonError> {
        if self.plans_around_backend() { self.rules() } else { self.simulator.digest() }
    }

    /// Returns `true` if families plan around the ego's drive in another simulator.
    pub fn plans_around_backend(&self) -> bool {
        self.backend.as_ref().is_some_and(|backend| backend.plan_around == PlanAround::Backend)
    }

    /// The family of a lineage, with its code.
    pub fn source(&self, spec: &LineageSpec) -> Result<&Source, RunError> {
        self.sources.get(&spec.family).ok_or_else(|| {
            let known: Vec<&str> = self.sources.iter().map(|of| of.contract.family.as_str()).collect();
            RunError::Study(format!("no family is called `{}`; there are {}", spec.family, known.join(", ")))
        })
    }

    /// The contract of a lineage's family as prompts show it.
    pub fn contract_text(&self, spec: &LineageSpec) -> Result<&str, RunError> {
        let text = self.contract_texts.get(&spec.family).map(String::as_str);
        text.ok_or_else(|| RunError::Study(format!("the contract of `{}` was not written out", spec.family)))
    }

    /// The program with which a lineage starts: its family's parent with the lineage's own parameters, or the program that
    /// came as a file.
    pub fn parent(&self, spec: &LineageSpec) -> Result<Program, RunError> {
        self.composed_parent(spec, &[])
    }

    /// The same with what was composed for it; the lineage's own parameters stand above that.
    pub fn composed_parent(&self, spec: &LineageSpec, composed: &[Composed]) -> Result<Program, RunError> {
        let source = self.source(spec)?;
        let mut parent = spec.start.as_ref().map_or(&source.parent, |start| &start.program).adopted(&spec.id);
        if let Some(asks) = source.asks.templates {
            for (event, template) in composed.iter().filter_map(|event| Some((event, event.template.as_ref()?))) {
                (asks.put)(&mut parent, &event.kind, template);
            }
        }
        parent.parameters.extend(spec.parent.clone());
        match source.contract.check_program(&parent).first() {
            None => Ok(parent),
            Some(problem) => Err(RunError::Study(format!("lineage {}: its parent: {problem}", spec.id))),
        }
    }

    /// Private words of the other families that evolve in this run, sorted: a family that is registered but takes no part
    /// changes no prompt. The isolation gate knows every registered family.
    pub fn foreign_vocabulary(&self, spec: &LineageSpec) -> Vec<String> {
        let takes_part = |of: &&Source| self.lineages.iter().any(|other| other.family == of.contract.family);
        let others = self.sources.iter().filter(|of| of.contract.family != spec.family).filter(takes_part);
        let words: BTreeSet<String> = others.flat_map(|of| of.contract.private_vocabulary.clone()).collect();
        words.into_iter().collect()
    }

    /// Tags that say something about the scenes at these places, sorted: one that nearly every scene has tells none from
    /// another.
    pub fn telling_tags(&self, places: &[usize]) -> Vec<String> {
        telling(&places.iter().map(|&place| self.scenes[place].features().tags.as_slice()).collect::<Vec<_>>())
    }

    /// The scene of this id.
    pub fn scene(&self, id: &str) -> Option<&SceneEntry> {
        self.scenes.iter().find(|entry| entry.scene().id == id)
    }

    /// Places on which finalists are chosen.
    pub fn choosing(&self) -> &[usize] {
        if self.selection.is_empty() { &self.evolution } else { &self.selection }
    }

    /// Places of the development window of an epoch: `window` scenes on, each epoch, around the evolution pool.
    pub fn window(&self, epoch: u32) -> Vec<usize> {
        window(&self.evolution, epoch, self.budget.window)
    }

    /// Places of all windows up to an epoch's, each once, in the order in which they were opened.
    pub fn windows_up_to(&self, epoch: u32) -> Vec<usize> {
        let mut places: Vec<usize> = Vec::new();
        for place in (0..=epoch).flat_map(|epoch| self.window(epoch)) {
            if !places.contains(&place) {
                places.push(place);
            }
        }
        places
    }

    /// Places of the scenes on which the programs of an epoch are compared at last.
    pub fn judged_on(&self, epoch: u32) -> Vec<usize> {
        match self.archive.judged_on {
            JudgedOn::WindowThenAll => self.windows_up_to(epoch),
            JudgedOn::Window => self.window(epoch),
        }
    }

    /// Places of all evolution scenes in the order in which windows open them: those up to an epoch's window first.
    pub fn opening_order(&self, epoch: u32) -> Vec<usize> {
        let mut places = self.windows_up_to(epoch);
        let rest = self.evolution.iter().filter(|place| !places.contains(place)).copied().collect::<Vec<_>>();
        places.extend(rest);
        places
    }

    /// Ids of the scenes at these places.
    pub fn scene_ids(&self, places: &[usize]) -> Vec<String> {
        places.iter().map(|&place| self.scenes[place].scene().id.clone()).collect()
    }

    /// Returns the digest of a list of scenes on which programs were labelled.
    pub fn scenes_digest(&self, places: &[usize]) -> Result<Digest, RunError> {
        Ok(Digest::of("evodrive/window/1", &self.scene_ids(places))?)
    }

    /// The slots of an epoch, in order.
    pub fn slots(&self) -> Vec<u32> {
        (0..self.budget.slots).collect()
    }
}

/// Share of scenes from which on a tag names nearly all of them.
const COMMON_SHARE: f64 = 0.8;

/// The tags that fewer than four in five of the scenes have.
fn telling(scenes: &[&[&str]]) -> Vec<String> {
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    scenes.iter().flat_map(|tags| tags.iter()).for_each(|tag| *counts.entry(tag).or_default() += 1);
    let most = COMMON_SHARE * scenes.len() as f64;
    counts.into_iter().filter(|(_, count)| (*count as f64) < most).map(|(tag, _)| tag.to_string()).collect()
}

/// The places of an epoch: the next `size` in turn, starting again at the end; all of them, once, where there are fewer.
fn window(evolution: &[usize], epoch: u32, size: usize) -> Vec<usize> {
    let n = evolution.len();
    let size = size.min(n);
    let start = (epoch as usize * size) % n.max(1);
    (0..size).map(|k| evolution[(start + k) % n]).collect()
}

#[cfg(test)]
mod tests {
    use super::{telling, window};

    #[test]
    fn a_tag_that_nearly_every_scene_has_says_nothing() {
        let scenes: [&[&str]; 5] = [&["dense", "light"], &["dense"], &["dense"], &["dense", "light"], &["curved"]];
        assert_eq!(telling(&scenes), ["curved", "light"]);
        assert_eq!(telling(&scenes[..2]), ["light"]);
    }

    #[test]
    fn the_window_passes_over_every_scene_in_turn() {
        let evolution = [3, 1, 4, 15, 9];
        let seen: Vec<usize> = (0..5).flat_map(|epoch| window(&evolution, epoch, 2)).collect();
        for place in evolution {
            assert_eq!(seen.iter().filter(|other| **other == place).count(), 2);
        }
        assert_eq!((window(&evolution, 3, 9).len(), window(&[], 1, 4).len()), (5, 0));
    }
}
