//! The sets of a downstream study: which scenes, and what the two generators do in them, fixed before any ego learns.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::cli::studies::apply;
use crate::cli::terminal::{answer::progress, exit::Failure};
use crate::epoch::{Applied, SceneEntry};
use crate::experiment::{DownstreamFile, ProgramFile};
use crate::families;
use crate::kernel::{Digest, Threads};
use crate::learn::Lesson;
use crate::objects::downstream::{FixedSet, FixedSets, SetName};
use crate::scene::safebench::TrafficFamily;
use crate::scene::{Pool, Scene, usable};
use crate::sim::{Intervention, Plant};

/// Scenes that are planned for at once: what is planned is dropped once enough have been found.
const AT_ONCE: usize = 64;

/// Sets with what is driven in them, in the order in which they were fixed.
pub struct Sets {
    pub training: Vec<Vec<Lesson>>,
    pub evaluation: Vec<Vec<Lesson>>,
    pub fixed: FixedSets,
}

/// The scenes of a set that belong to a traffic family, or all.
pub fn of_family(set: &FixedSet, lessons: &[Lesson], family: Option<&str>) -> Vec<Lesson> {
    let own = |place: usize| family.is_none_or(|family| set.groups.get(place).is_some_and(|group| group == family));
    lessons.iter().enumerate().filter(|(place, _)| own(*place)).map(|(_, lesson)| lesson.clone()).collect()
}

impl Sets {
    /// Returns what an arm is trained on: the scenes of these sets that belong to a traffic family, or all.
    pub fn lessons(&self, names: &[SetName], family: Option<&str>) -> Vec<Lesson> {
        let of = |name: &SetName| {
            let both = self.fixed.training.iter().zip(&self.training).find(|(set, _)| set.name == *name);
            both.map(|(set, lessons)| of_family(set, lessons, family)).unwrap_or_default()
        };
        names.iter().flat_map(of).collect()
    }

    /// Digests of all sets, those for training first.
    pub fn digests(&self) -> Vec<Digest> {
        self.fixed.training.iter().chain(&self.fixed.evaluation).map(|set| set.digest).collect()
    }
}

/// A scene in which both generators act.
struct Played {
    entry: SceneEntry,
    plant: Arc<Plant>,
    original: Intervention,
    evolved: Intervention,
}

/// Fixes the sets of a study.
pub fn fixed(file: &DownstreamFile, program: &ProgramFile, threads: &Threads) -> Result<Sets, Failure> {
    let ego = apply::driver(&program.conditions.ego)?;
    let sources = families::sources_by_hand();
    let counsels = BTreeMap::new();
    let applied = apply::as_conditioned(program, &sources, &ego, &counsels)?;
    let [training, evaluation] = file.pools(program, threads)?;
    let wants_benign = file.arms.iter().any(|arm| arm.trains_on.contains(&SetName::Benign));
    let count = file.sets.training;
    let wanted = if wants_benign { 2 * count } else { count };
    let (mut played, mut benign, mut seen) = (Vec::new(), Vec::new(), Vec::new());
    for part in parts(file, training)? {
        let mut programs = acting(file, "scenes", &applied, program, part, wanted, threads)?;
        benign.extend(programs.split_off(count));
        played.extend(programs);
    }
    for part in parts(file, evaluation)? {
        seen.extend(acting(file, "evaluation", &applied, program, part, file.sets.evaluation, threads)?);
    }
    let mut sets = Sets {
        training: Vec::new(),
        evaluation: Vec::new(),
        fixed: FixedSets { training: Vec::new(), evaluation: Vec::new() },
    };
    let mut all = three(&played);
    if wants_benign {
        all.insert(1, (SetName::Benign, &benign, |_| Intervention::default()));
    }
    for (name, of, intervention) in all {
        sets.fixed.training.push(mark(file, name, of, intervention)?);
        sets.training.push(of.iter().map(|played| played.lesson(intervention)).collect());
    }
    for (name, of, intervention) in three(&seen) {
        sets.fixed.evaluation.push(mark(file, name, of, intervention)?);
        sets.evaluation.push(of.iter().map(|played| played.lesson(intervention)).collect());
    }
    Ok(sets)
}

/// Intervention in a scene of a set.
type Done = fn(&Played) -> Intervention;

/// The sets that hold the same scenes.
fn three(of: &[Played]) -> Vec<(SetName, &[Played], Done)> {
    vec![
        (SetName::Plain, of, |_| Intervention::default()),
        (SetName::Original, of, |played| played.original.clone()),
        (SetName::Evolved, of, |played| played.evolved.clone()),
    ]
}

impl Played {
    fn lesson(&self, done: Done) -> Lesson {
        Lesson { plant: self.plant.clone(), intervention: done(self) }
    }
}

fn mark(file: &DownstreamFile, name: SetName, of: &[Played], done: Done) -> Result<FixedSet, Failure> {
    let content: Vec<(Digest, Intervention)> = of.iter().map(|played| (played.entry.digest, done(played))).collect();
    let digest = Digest::of("evodrive/downstream-set/1", &content).map_err(Failure::internal)?;
    let group = |played: &Played| played.entry.group().map(|(family, _)| family.name().to_string());
    let groups = if file.by_family { of.iter().filter_map(group).collect() } else { Vec::new() };
    Ok(FixedSet { name, digest, scenes: of.iter().map(|played| played.entry.scene().id.clone()).collect(), groups })
}

/// The pool as it is, or in a study by family the scenes of each traffic family by themselves.
fn parts(file: &DownstreamFile, pool: Pool) -> Result<Vec<Pool>, Failure> {
    if !file.by_family {
        return Ok(vec![pool]);
    }
    let mut parts = Vec::new();
    for family in TrafficFamily::ALL {
        let own = |scene: &&Scene| scene.staging.as_ref().is_some_and(|staging| staging.family == family);
        let scenes: Vec<Scene> = pool.scenes.iter().filter(own).cloned().collect();
        if !scenes.is_empty() {
            parts.push(Pool::new(scenes, Vec::new()).map_err(Failure::internal)?);
        }
    }
    if parts.is_empty() {
        Err(Failure::bad_input(format!(
            "{}: by_family is true, but no scene belongs to a SafeBench traffic family; name scenes with source = \"safebench\"",
            file.file.display()
        )))
    } else {
        Ok(parts)
    }
}

/// The first `count` usable scenes of a pool in which both generators act.
fn acting(
    file: &DownstreamFile,
    table: &str,
    applied: &Applied<'_>,
    program: &ProgramFile,
    pool: Pool,
    count: usize,
    threads: &Threads,
) -> Result<Vec<Played>, Failure> {
    let whole = pool.scenes.len();
    let scenes: Vec<Arc<Scene>> = pool.scenes.into_iter().filter(|scene| usable(scene).is_ok()).map(Arc::new).collect();
    let (mut found, mut looked) = (Vec::with_capacity(count), 0);
    for some in scenes.chunks(AT_ONCE) {
        if found.len() == count {
            break;
        }
        let entries = threads.map(some, |_, scene| SceneEntry::new(scene.clone()));
        let planned = applied.interventions(&[&program.parent, &program.program], &entries, threads)?;
        for (entry, planned) in entries.into_iter().zip(planned) {
            if found.len() == count {
                break;
            }
            looked += 1;
            let Ok([original, evolved]) = <[_; 2]>::try_from(planned) else { continue };
            let (Ok(original), Ok(evolved)) = (original, evolved) else { continue };
            if original.actions.is_empty() || evolved.actions.is_empty() {
                continue;
            }
            let plant = Plant::with_options(entry.prepared.clone(), applied.simulator).map_err(Failure::bad_input)?;
            found.push(Played { plant: Arc::new(plant), entry, original, evolved });
        }
    }
    progress(format!("[{table}]: both generators act in {} of the first {looked} scenes", found.len()));
    if found.len() == count {
        Ok(found)
    } else {
        Err(Failure::bad_input(format!(
            "{}: [{table}] gives {} scenes in which both generators act, out of {whole}; expected {count}: name more scenes \
             or smaller sets",
            file.file.display(),
            found.len()
        )))
    }
}
