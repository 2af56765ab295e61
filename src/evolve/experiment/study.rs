//! From an experiment and its scenes to the study that a run carries out.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use super::{Experiment, ExperimentError, LineageOptions, PlainContacts, models};
use crate::agents::{Questions, compact_contract_text, contract_text};
use crate::ego::Policy;
use crate::epoch::{Budget, LineageSpec, SceneEntry, Start, Study, Without};
use crate::families;
use crate::kernel::{Seed, Threads};
use crate::objects::LineageId;
use crate::scene::{Pool, PoolError, PreparedScene, Scene, Split};
use crate::sim::{Intervention, Plant, ending};
use crate::stage::Source;
use crate::text::counted;

impl Experiment {
    /// Which scenes of a pool evolution sees and which stay closed.
    ///
    /// # Errors
    /// Too few usable scenes; a group that the split would cut; scenes that the protocol cannot label; plain contacts to be left out
    /// that nobody here can tell.
    pub fn split_of(&self, pool: &Pool, threads: &Threads) -> Result<Split, ExperimentError> {
        self.split_without(pool, &self.with_plain_contacts(pool, threads)?)
    }

    /// The same where it is known which scenes are left out.
    ///
    /// # Errors
    /// As [`Experiment::split_of`].
    pub fn split_without(&self, pool: &Pool, dropped: &BTreeSet<String>) -> Result<Split, ExperimentError> {
        let refused = |error: PoolError| {
            match dropped.len() {
            0 => self.problem(format!("[split]: {error}")),
            count => self.problem(format!(
                "[split]: {error}; {} left out, because an ego meets somebody there without a program (split.plain_contacts = \"drop\")",
                counted(count, "scene")
            )),
        }
        };
        let split = pool
            .split_among(
                Seed(self.seed),
                self.split.evolution,
                self.split.selection.unwrap_or(0),
                self.split.held_out,
                |id| !dropped.contains(id),
            )
            .map_err(refused)?;
        if self.split.window > split.evolution.len() {
            return Err(self.problem(format!(
                "split.window is {}, expected at most the {} evolution scenes that [split] takes of the pool's {}; make the window \
                 smaller or give more scenes",
                self.split.window,
                split.evolution.len(),
                pool.scenes.len()
            )));
        }
        let rival = self.search.as_ref().filter(|search| search.method.replaces_gates());
        if let Some(rival) = rival.filter(|_| self.split.window != split.evolution.len()) {
            return Err(self.problem(format!(
                "split.window is {}, expected all {} evolution scenes, because search.method is {:?}: its programs are compared across \
                 epochs by labels on the same scenes",
                self.split.window,
                split.evolution.len(),
                rival.method.name()
            )));
        }
        let chosen = split.all().filter_map(|entry| pool.scene(&entry.id));
        let unstaged = chosen.into_iter().find(|scene| scene.staging.is_none());
        match unstaged {
            Some(scene) if self.evaluation.safebench().is_some() => Err(self.problem(format!(
                "scene {} belongs to no traffic family of SafeBench; [evaluation.safebench] needs [scenes] source = \"safebench\"",
                scene.id
            ))),
            _ => Ok(split),
        }
    }

    /// Ids of the scenes that are left out because an ego under test meets somebody there although no program acts.
    ///
    /// # Errors
    /// The experiment leaves them out and has an ego or a simulator that only a recording asks.
    pub fn with_plain_contacts(&self, pool: &Pool, threads: &Threads) -> Result<BTreeSet<String>, ExperimentError> {
        if self.split.plain_contacts == PlainContacts::Keep {
            return Ok(BTreeSet::new());
        }
        let elsewhere = match (&self.simulator.backend, &self.driver, self.evaluation.safebench()) {
            (Some(_), ..) => Some("[simulator.backend] is another simulator"),
            (_, Some(_), _) => Some("the ego is a program of your own, [driver]"),
            (.., Some(_)) => Some("SafeBench stages every scene for a contact"),
            (None, None, None) => None,
        };
        if let Some(why) = elsewhere {
            return Err(self.problem(format!(
                "split.plain_contacts is \"drop\", expected \"keep\": {why}; drop them from a pool of your own with `evodrive scenes filter \
                 --without ID`"
            )));
        }
        let mut egos: Vec<Policy> = Vec::new();
        for lineage in &self.lineages {
            let drivers =
                lineage.drivers().map_err(|error| self.problem(format!("lineage {}: {error}", lineage.id)))?;
            for ego in drivers {
                if !egos.contains(&ego) {
                    egos.push(ego);
                }
            }
        }
        let rules = self.simulator.rules();
        let meets = threads.map(&pool.scenes, |_, scene| {
            // Of what cannot be simulated others complain.
            let plant = Plant::with_options(PreparedScene::new(Arc::new(scene.clone())), &rules).ok()?;
            let alone = Intervention::default();
            let contact = |ego: &Policy| Some(ending(&plant, &alone, ego.driver().as_mut()).ok()?.1.is_some());
            egos.iter().any(|ego| contact(ego) == Some(true)).then(|| scene.id.clone())
        });
        Ok(meets.into_iter().flatten().collect())
    }

    /// Puts the study together. Its pool digest names all scenes; the study holds those of the split.
    ///
    /// # Errors
    /// Those of [`Experiment::split_of`], and a parent that its family's contract does not allow.
    pub fn study(&self, pool: Pool, threads: &Threads) -> Result<Study, ExperimentError> {
        let split = self.split_of(&pool, threads)?;
        let (pool_digest, provenance) = (pool.digest(), pool.sealed_provenance());
        let mut lineages = Vec::new();
        for lineage in &self.lineages {
            let refused = |error| self.problem(format!("lineage {}: {error}", lineage.id));
            let drivers = lineage.drivers().map_err(refused)?;
            for replica in 0..self.seeds {
                let (group, family, parent) = (lineage.id.clone(), lineage.family.clone(), lineage.parent.clone());
                let id = match self.seeds {
                    1 => group.clone(),
                    _ => LineageId::new(format!("{group}-s{replica}")),
                };
                let start = lineage.parent_program.clone();
                let start = start.map(|of| Start { program: of.program, origins: of.origins });
                let start = start.or_else(|| published_start(lineage));
                let over_egos = (drivers.len() > 1).then_some(lineage.over_egos);
                let against = |ego: &Policy| LineageSpec {
                    id: id.clone(),
                    group: group.clone(),
                    replica,
                    family: family.clone(),
                    ego: ego.clone(),
                    over_egos,
                    against: Vec::new(),
                    parent: parent.clone(),
                    start: start.clone(),
                };
                let mut alone: Vec<LineageSpec> = drivers.iter().map(against).collect();
                lineages.push(match over_egos {
                    None => alone.remove(0),
                    Some(_) => LineageSpec { against: alone.clone(), ..alone.remove(0) },
                });
            }
        }
        let wanted: Vec<&str> = split.all().map(|s| s.id.as_str()).collect();
        let mut by_id: BTreeMap<String, Arc<Scene>> =
            pool.scenes.into_iter().map(|s| (s.id.clone(), Arc::new(s))).collect();
        let chosen: Vec<Arc<Scene>> = wanted.iter().filter_map(|id| by_id.remove(*id)).collect();
        let entries = threads.map(&chosen, |_, scene| SceneEntry::new(scene.clone()));
        let closed = split.evolution.len() + split.selection.len();
        let without = self.without.unwrap_or_default();
        let starts = || lineages.iter().filter_map(|spec| spec.start.as_ref()).map(|start| &start.program);
        let offered = |source: Source| {
            let family = source.contract.family.clone();
            let own = || starts().filter(|program| program.source_family == family);
            let most = own().map(families::rehearsals_of).fold(self.budget.rehearsals, u32::max);
            families::rehearsing(source.offering_for(own()), most)
        };
        let sources = families::sources().map(|source| limited(offered(source), &without, self.questions));
        let mut world = self.world.clone();
        if without.audit {
            world.routing.audit_share = 0.0;
        }
        let text = |f: &Source| {
            let written = match self.questions {
                Questions::Compact => compact_contract_text(&f.contract, &f.parent),
                Questions::Plain | Questions::Detailed => contract_text(&f.contract),
            };
            (f.contract.family.clone(), written)
        };
        let used = |f: &&Source| lineages.iter().any(|spec| spec.family == f.contract.family);
        let contract_texts = sources.iter().filter(used).map(text).collect();
        let mut study = Study {
            name: self.name.clone(),
            experiment: self.digest()?,
            seed: Seed(self.seed),
            evolution: (0..split.evolution.len()).collect(),
            selection: (split.evolution.len()..closed).collect(),
            held_out: (closed..entries.len()).collect(),
            scenes: entries,
            pool_digest,
            provenance,
            lineages,
            parents: BTreeSet::new(),
            contract_texts,
            registry: sources.registry(),
            sources,
            budget: Budget {
                epochs: self.budget.epochs,
                slots: self.budget.slots,
                window: self.split.window,
                max_repair_rounds: self.budget.max_repair_rounds,
                probe_scenes: self.budget.probe_scenes,
                finalists: self.budget.finalists,
            },
            models: models::by_role(self),
            simulator: self.simulator.rules(),
            backend: self.simulator.backend.clone(),
            evaluation: self.evaluation.clone(),
            archive: self.archive.clone(),
            search: self.search.clone(),
            without,
            proposals: self.proposals,
            fixed_bodies: self.fixed_bodies,
            questions: self.questions,
            selector: self.selector.clone(),
            memory: self.memory.clone(),
            curation: self.curation.clone(),
            world,
            world_agent: self.world_agent,
            composition: self.composition.clone(),
            counsel: self.counsel,
        };
        let hash = |lineage: &LineageSpec| {
            let parent = study.parent(lineage).map_err(|error| self.problem(error))?;
            parent.hash().map_err(|error| self.problem(error))
        };
        study.parents = study.lineages.iter().map(hash).collect::<Result<_, _>>()?;
        Ok(study)
    }
}

/// The published program that a lineage starts from, where it asks for it.
fn published_start(lineage: &LineageOptions) -> Option<Start> {
    let program = families::sources().get(&lineage.family)?.published.as_ref()?.program.clone();
    lineage.published.then_some(Start { program, origins: Vec::new() })
}

/// A source whose contract allows no more rules or modules than its parent has, where the run does without them.
fn limited(mut source: Source, without: &Without, questions: Questions) -> Source {
    source.contract.limits.chains_are_one_level = !questions.is_plain();
    if without.conditions {
        source.contract.limits.rules = source.parent.scenario_conditioned_policy.len();
    }
    if without.mechanisms {
        source.contract.limits.modules = source.parent.mechanism_modules.len();
    }
    source
}
