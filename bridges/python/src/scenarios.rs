//! Scenes and programs of a training: read, checked against each other, planned around a driver.

use pyo3::prelude::*;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use evodrive::cli::Failure;
use evodrive::compiler::{Prepared, Situation};
use evodrive::ego::Policy;
use evodrive::epoch::SceneEntry;
use evodrive::experiment::{ProgramFile, family_named, read_scenes};
use evodrive::families;
use evodrive::kernel::{Digest, Seed, Threads};
use evodrive::learn::fleet::{Task, TaskSet, Tasks};
use evodrive::objects::{Counsel, FamilyName};
use evodrive::scene::{Scene, usable};
use evodrive::sim::{Intervention, Plant, PlantOptions, SimulatorOptions};
use evodrive::stage::Sources;

use crate::policy::driver;
use crate::refused;

/// Plans of so many drivers are kept.
const KEPT: usize = 4;

/// A program by its name, or the scenes as they are.
#[derive(Clone)]
pub struct Named {
    pub name: String,
    pub file: Option<Arc<ProgramFile>>,
    pub share: f64,
}

/// What a program does in each scene, or why that cannot be said.
pub type Planned = Vec<Result<Arc<Intervention>, String>>;

/// Scenes ready to be driven.
pub struct Stage {
    pub entries: Vec<SceneEntry>,
    pub plants: Vec<Arc<Plant>>,
}

/// All of a training.
pub struct Source {
    pub stage: Arc<Stage>,
    pub held_out: Arc<Stage>,
    pub named: Vec<Named>,
    pub simulator: SimulatorOptions,
    pub sources: Sources,
    /// Of the training scenes, by driver: the last ones that were asked for.
    kept: Arc<Mutex<Vec<(Digest, Arc<Vec<Planned>>)>>>,
}

/// The scenes and programs of a training. `pool` and `held_out` are lists of pools, scenario files or folders; `programs` holds a
/// name, a program file (or the name of a family, or None for the scenes as they are) and a share each.
#[pyclass(frozen)]
pub struct Scenarios {
    pub source: Arc<Source>,
}

fn failed(failure: impl Into<Failure>) -> PyErr {
    refused(failure.into().message)
}

fn stage(scenes: Vec<Arc<Scene>>, simulator: &SimulatorOptions, threads: &Threads) -> PyResult<Stage> {
    let made = threads.map(&scenes, |_, scene| {
        let entry = SceneEntry::new(scene.clone());
        Plant::with_options(entry.prepared.clone(), simulator).map(|plant| (entry, Arc::new(plant)))
    });
    let made = made.into_iter().collect::<Result<Vec<_>, _>>().map_err(refused)?;
    let (entries, plants) = made.into_iter().unzip();
    Ok(Stage { entries, plants })
}

fn program(named: &Path) -> PyResult<Arc<ProgramFile>> {
    let text = named.to_string_lossy();
    let read = if named.extension().is_some() || named.exists() {
        ProgramFile::read(named)
    } else {
        ProgramFile::published(&FamilyName::new(family_named(&text)))
    };
    read.map(Arc::new).map_err(failed)
}

/// Usable scenes of files; the reasons of the others.
fn scenes(paths: &[PathBuf], threads: &Threads) -> PyResult<Vec<Arc<Scene>>> {
    let pool = read_scenes(paths, threads).map_err(failed)?;
    let shown: Vec<String> = paths.iter().map(|path| path.display().to_string()).collect();
    let (mut taken, mut left) = (Vec::new(), Vec::new());
    for scene in pool.scenes {
        match usable(&scene) {
            Ok(()) => taken.push(Arc::new(scene)),
            Err(reason) => left.push(format!("{}: {reason}", scene.id)),
        }
    }
    if taken.is_empty() {
        let shown = shown.join(", ");
        left.extend(pool.left_out.iter().map(|left| format!("{}: {}", left.file, left.reason)));
        left.truncate(5);
        return Err(refused(format!("{shown}: expected usable scenes, found none; {}", left.join("; "))));
    }
    Ok(taken)
}

#[pymethods]
impl Scenarios {
    #[new]
    fn new(
        py: Python<'_>,
        pool: Vec<PathBuf>,
        programs: Vec<(String, Option<PathBuf>, f64)>,
        held_out: Vec<PathBuf>,
        plant: Option<String>,
        threads: usize,
    ) -> PyResult<Scenarios> {
        py.detach(|| {
            let threads = Threads::new(threads).map_err(refused)?;
            let named = programs
                .into_iter()
                .map(|(name, file, share)| Ok(Named { name, file: file.as_deref().map(program).transpose()?, share }));
            let named = named.collect::<PyResult<Vec<Named>>>()?;
            let simulator = rules(&named, plant.as_deref())?;
            let own = scenes(&pool, &threads)?;
            let held = if held_out.is_empty() { Vec::new() } else { scenes(&held_out, &threads)? };
            apart(&own, &held)?;
            own.iter().chain(&held).try_for_each(|scene| fits(scene, &named))?;
            let source = Source {
                stage: Arc::new(stage(own, &simulator, &threads)?),
                held_out: Arc::new(stage(held, &simulator, &threads)?),
                named,
                simulator,
                sources: families::sources(),
                kept: Arc::default(),
            };
            Ok(Scenarios { source: Arc::new(source) })
        })
    }

    /// The same scenes under other shares and further programs. Each has a name, its file, a share, and whether the file is read; a program
    /// that is here already needs not be.
    fn with_programs(
        &self,
        py: Python<'_>,
        programs: Vec<(String, Option<PathBuf>, f64, bool)>,
        plant: Option<String>,
    ) -> PyResult<Scenarios> {
        py.detach(|| {
            let of = &self.source;
            let reads = programs.iter().any(|(.., is_read)| *is_read);
            let one = |(name, file, share, is_read): (String, Option<PathBuf>, f64, bool)| {
                let known = of.named.iter().find(|known| known.name == name && !is_read);
                let file = match known {
                    Some(known) => known.file.clone(),
                    None => file.as_deref().map(program).transpose()?,
                };
                Ok(Named { name, file, share })
            };
            let named = programs.into_iter().map(one).collect::<PyResult<Vec<Named>>>()?;
            if rules(&named, plant.as_deref())? != of.simulator {
                return Err(refused(
                    "the new programs were labelled under other rules of the simulator than these scenes are driven under; expected the same \
                     rules: make new Scenarios of them",
                ));
            }
            let scenes = of.stage.entries.iter().chain(&of.held_out.entries);
            scenes.map(SceneEntry::scene).try_for_each(|scene| fits(scene, &named))?;
            let source = Source {
                stage: of.stage.clone(),
                held_out: of.held_out.clone(),
                named,
                simulator: of.simulator,
                sources: families::sources(),
                kept: if reads { Arc::default() } else { of.kept.clone() },
            };
            Ok(Scenarios { source: Arc::new(source) })
        })
    }

    /// Ids of the scenes, in the order of their numbers.
    #[getter]
    fn scenes(&self) -> Vec<String> {
        ids(&self.source.stage)
    }

    /// Ids of the held-out scenes.
    #[getter]
    fn held_out(&self) -> Vec<String> {
        ids(&self.source.held_out)
    }

    /// Names of the programs, in the order of their numbers.
    #[getter]
    fn programs(&self) -> Vec<String> {
        self.source.named.iter().map(|named| named.name.clone()).collect()
    }

    /// Whether the scenes are staged for SafeBench's traffic families.
    #[getter]
    fn staged(&self) -> bool {
        self.source.stage.entries.iter().all(|entry| entry.scene().staging.is_some())
    }

    /// Of each program, planned around a driver: in how many scenes it is planned, in how many of these it changes anything, and why
    /// not in the others.
    fn coverage(
        &self,
        py: Python<'_>,
        name: Option<String>,
        weights: Option<Vec<u8>>,
        threads: usize,
    ) -> PyResult<Vec<(usize, usize, Vec<String>)>> {
        let policy = driver(name.as_deref(), weights.as_deref())?;
        py.detach(|| {
            let planned = self.source.planned(&policy, &Threads::new(threads).map_err(refused)?);
            let of = |planned: &Planned| {
                let acts = planned.iter().flatten().filter(|act| !act.actions.is_empty()).count();
                let why = planned.iter().filter_map(|act| act.as_ref().err().cloned());
                (planned.iter().flatten().count(), acts, why.collect())
            };
            Ok(planned.iter().map(of).collect())
        })
    }
}

fn ids(stage: &Stage) -> Vec<String> {
    stage.entries.iter().map(|entry| entry.scene().id.clone()).collect()
}

/// The rules that all programs were labelled under.
fn rules(named: &[Named], plant: Option<&str>) -> PyResult<SimulatorOptions> {
    let mut rules: Option<(&str, SimulatorOptions)> = None;
    for Named { name, file, .. } in named {
        let Some(file) = file else { continue };
        match &rules {
            Some((first, rules)) if *rules != file.conditions.simulator => {
                return Err(refused(format!(
                    "programs {first} and {name} were labelled under different rules of the simulator; expected one set of rules, \
                     train on them apart"
                )));
            }
            Some(_) => {}
            None => rules = Some((name, file.conditions.simulator)),
        }
    }
    let mut rules = rules.map_or(SimulatorOptions::SHIPPED, |(_, rules)| rules);
    match plant {
        None => {}
        Some("physical") => rules.plant = PlantOptions::PHYSICAL,
        Some("metadrive-0.4.3") => rules.plant = PlantOptions::METADRIVE_0_4_3,
        Some(other) => return Err(refused(format!("plant is {other:?}; expected physical or metadrive-0.4.3"))),
    }
    Ok(rules)
}

/// Held-out scenes are never driven for learning.
fn apart(own: &[Arc<Scene>], held: &[Arc<Scene>]) -> PyResult<()> {
    let digests: BTreeSet<Digest> = own.iter().map(|scene| scene.digest()).collect();
    let ids: BTreeSet<&str> = own.iter().map(|scene| scene.id.as_str()).collect();
    match held.iter().find(|scene| ids.contains(scene.id.as_str()) || digests.contains(&scene.digest())) {
        None => Ok(()),
        Some(scene) => Err(refused(format!(
            "scene {} stands in both pools; expected held-out scenes that nobody learns on: leave it out of one of them \
             (evodrive scenes filter --without {})",
            scene.id, scene.id
        ))),
    }
}

/// A program of recorded traffic moves logged vehicles, one of SafeBench's families what a traffic family stages.
fn fits(scene: &Scene, named: &[Named]) -> PyResult<()> {
    for Named { name, file, .. } in named {
        let Some(file) = file else { continue };
        let (wants, is) = (file.conditions.evaluation.safebench().is_some(), scene.staging.is_some());
        if wants != is {
            let say = |staged: bool| if staged { "staged for SafeBench's traffic families" } else { "traffic" };
            return Err(refused(format!(
                "program {name} (family {}) plays scenes that are {}, found {}, which is {}",
                file.family,
                say(wants),
                scene.id,
                say(is)
            )));
        }
    }
    Ok(())
}

impl Source {
    /// What every program does in every training scene around a driver, in the order of both.
    pub fn planned(&self, policy: &Policy, threads: &Threads) -> Arc<Vec<Planned>> {
        let key = policy.digest();
        let known = |kept: &[(Digest, Arc<Vec<Planned>>)]| {
            kept.iter().find(|(of, _)| *of == key).map(|(_, planned)| planned.clone())
        };
        if let Some(planned) = known(&self.kept.lock().unwrap_or_else(PoisonError::into_inner)) {
            return planned;
        }
        let planned = Arc::new(self.plan(&self.stage, policy, threads));
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        kept.push((key, planned.clone()));
        let over = kept.len().saturating_sub(KEPT);
        kept.drain(..over);
        planned
    }

    /// The same of any scenes, kept nowhere.
    pub fn plan(&self, stage: &Stage, policy: &Policy, threads: &Threads) -> Vec<Planned> {
        type Ready<'p> = Result<Option<(Prepared<'p>, Seed, BTreeMap<Digest, Counsel>)>, String>;
        let ready: Vec<Ready<'_>> = self.named.iter().map(|named| self.prepared(named)).collect();
        let of_scenes = threads.map(&stage.entries, |_, entry| {
            let situation = Situation::under(entry.prepared.clone(), policy, &self.simulator);
            let one = |ready: &Ready<'_>| -> Result<Arc<Intervention>, String> {
                let Some((prepared, seed, counsels)) = ready.as_ref().map_err(Clone::clone)? else {
                    return Ok(Arc::default());
                };
                let situation = situation.as_ref().map_err(ToString::to_string)?;
                let compiled = prepared.compile_counselled(situation, *seed, counsels.get(&entry.digest));
                compiled.map(|compiled| Arc::new(compiled.intervention)).map_err(|failure| failure.to_string())
            };
            ready.iter().map(one).collect::<Vec<_>>()
        });
        let mut planned: Vec<Planned> = vec![Vec::with_capacity(of_scenes.len()); self.named.len()];
        for of_scene in of_scenes {
            planned.iter_mut().zip(of_scene).for_each(|(planned, act)| planned.push(act));
        }
        planned
    }

    #[allow(clippy::type_complexity)]
    fn prepared<'p>(
        &'p self,
        named: &'p Named,
    ) -> Result<Option<(Prepared<'p>, Seed, BTreeMap<Digest, Counsel>)>, String> {
        let Some(file) = &named.file else { return Ok(None) };
        let source = self.sources.get(&file.family).ok_or_else(|| format!("no family is called {}", file.family))?;
        let prepared = Prepared::new(&file.program, source).map_err(|failure| failure.to_string())?;
        let counsels = file.counsel.values().map(|carried| (carried.scene, carried.counsel.clone())).collect();
        Ok(Some((prepared, Seed(file.conditions.seed), counsels)))
    }

    /// All that a fleet drives, planned around a driver.
    pub fn tasks(&self, policy: &Policy, threads: &Threads) -> PyResult<Arc<Tasks>> {
        let planned = self.planned(policy, threads);
        let mut sets = Vec::new();
        for (named, planned) in self.named.iter().zip(planned.iter()) {
            let task = |(scene, act): (usize, &Result<Arc<Intervention>, String>)| {
                let intervention = act.as_ref().ok()?.clone();
                Some(Task { scene, plant: self.stage.plants[scene].clone(), intervention })
            };
            let tasks: Vec<Task> = planned.iter().enumerate().filter_map(task).collect();
            if let (true, Some(Err(reason))) = (tasks.is_empty(), planned.first()) {
                return Err(refused(format!(
                    "program {} cannot be planned in any of {} scenes; the first says: {reason}",
                    named.name,
                    planned.len()
                )));
            }
            sets.push(TaskSet { share: named.share, tasks });
        }
        Tasks::new(sets).map(Arc::new).map_err(refused)
    }
}
