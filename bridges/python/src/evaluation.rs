//! A driver in scenes, under each program: the path of `evodrive apply`, and the figures of `evodrive egos`.

use pyo3::prelude::*;
use pyo3::types::PyBytes;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

use evodrive::backend::{Answer, Answers, Backend, BackendError, DriverOptions, Request};
use evodrive::ego::Policy;
use evodrive::epoch::{Applied, SceneEntry};
use evodrive::experiment::ProgramFile;
use evodrive::kernel::{Digest, Seed, Threads};
use evodrive::learn::fleet::{Frames, Seeing};
use evodrive::learn::{Keeps, Reward, Ride, Stopped, figures};
use evodrive::objects::Counsel;
use evodrive::sim::{Control, Driver, Intervention, Outcome, Plant, Repeated, ReportedRollout, rollout, tell};

use crate::fleet::numbers;
use crate::policy::{Observed, driver, seeing};
use crate::scenarios::{Named, Planned, Scenarios, Source, Stage};
use crate::{broken, refused};

/// How a driver fares in the held-out scenes (or, where it is asked for, in those of the training) under each program, planned
/// around it: a JSON object by program.
#[pyfunction]
#[pyo3(signature = (scenarios, name=None, weights=None, held_out=true, threads=0))]
pub fn evaluate(
    py: Python<'_>,
    scenarios: &Scenarios,
    name: Option<String>,
    weights: Option<Vec<u8>>,
    held_out: bool,
    threads: usize,
) -> PyResult<String> {
    let source = &scenarios.source;
    let stands = name.as_deref() == Some("standing");
    let policy = driver(name.as_deref().filter(|_| !stands), weights.as_deref())?;
    let stage = asked(source, held_out)?;
    py.detach(|| {
        let threads = Threads::new(threads).map_err(refused)?;
        // Who stands still is asked what others did around IDM.
        let planned = source.plan(stage, &policy, &threads);
        let mut told = serde_json::Map::new();
        for (named, planned) in source.named.iter().zip(&planned) {
            let outcomes = outcomes(stage, planned, &threads, &|_| {
                if stands { Box::new(Stopped) } else { policy.driver() }
            })?;
            let mut of = driven(&outcomes, planned)?;
            if let (Some(file), false) = (&named.file, stands) {
                let counsels = counsels(file, &stage.entries);
                let applied = applied(source, file, &counsels, (&policy, Backend::Own))?;
                labelled(&applied, (named, file), &stage.entries, &threads, &mut of)?;
            }
            told.insert(named.name.clone(), of);
        }
        Ok(Value::Object(told).to_string())
    })
}

/// The same of a policy within Python: `ask` is given the bytes of the observations of all scenes that still go on, and how many these are,
/// and gives the bytes of their actions. It is planned around as a planner of one's own is: around its drive, with IDM in its place where a
/// program searches what it would do. In scenes that are staged for SafeBench programs are planned around IDM, and there are no labels.
#[pyfunction]
pub fn evaluate_by(
    py: Python<'_>,
    scenarios: &Scenarios,
    ask: &Bound<'_, PyAny>,
    observation: Observed,
    held_out: bool,
    threads: usize,
) -> PyResult<String> {
    let (source, seeing) = (&scenarios.source, seeing(&observation)?);
    let stage = asked(source, held_out)?;
    let threads = Threads::new(threads).map_err(refused)?;
    let policy = Policy::Command(Digest::of_bytes(b"a policy within Python"));
    let options = DriverOptions {
        command: Vec::new(),
        files: Vec::new(),
        cassette: PathBuf::new(),
        timeout_s: 1.0,
        processes: 1,
        repeat_share: 0.0,
        observe: None,
        blind: true,
        digest: None,
        folder: PathBuf::new(),
    };
    let options = options.backend(&source.simulator).map_err(broken)?;
    let plain: Planned = vec![Ok(Arc::default()); stage.entries.len()];
    let drives = drive(py, stage, &plain, &seeing, ask, &threads)?;
    let mut known = Drives::default();
    known.add(stage, &plain, &drives);
    let is_staged = stage.entries.iter().any(|entry| entry.scene().staging.is_some());
    let around_idm = if is_staged { py.detach(|| source.plan(stage, &Policy::Idm, &threads)) } else { Vec::new() };
    let mut told = serde_json::Map::new();
    for (place, named) in source.named.iter().enumerate() {
        let counsels = named.file.as_ref().map(|file| counsels(file, &stage.entries)).unwrap_or_default();
        let planned = match &named.file {
            None => plain.clone(),
            Some(_) if is_staged => around_idm[place].clone(),
            Some(file) => {
                let backend = Backend::Other { options: &options, answers: &known };
                let applied = applied(source, file, &counsels, (&policy, backend))?;
                let of_scenes = py.detach(|| applied.interventions(&[&file.program], &stage.entries, &threads));
                let of_scenes = of_scenes.map_err(|error| refused(format!("program {}: {error}", named.name)))?;
                of_scenes.into_iter().flatten().map(|act| act.map(Arc::new)).collect()
            }
        };
        let drives = match &named.file {
            None => drives.clone(),
            Some(_) => drive(py, stage, &planned, &seeing, ask, &threads)?,
        };
        known.add(stage, &planned, &drives);
        let of: PyResult<Value> = py.detach(|| {
            let outcomes =
                outcomes(stage, &planned, &threads, &|place| Box::new(Repeated::new(&drives[place], false)))?;
            let mut of = driven(&outcomes, &planned)?;
            if let (Some(file), false) = (&named.file, is_staged) {
                let backend = Backend::Other { options: &options, answers: &known };
                let applied = applied(source, file, &counsels, (&policy, backend))?;
                labelled(&applied, (named, file), &stage.entries, &threads, &mut of)?;
            }
            Ok(of)
        });
        told.insert(named.name.clone(), of?);
    }
    Ok(Value::Object(told).to_string())
}

fn asked(source: &Source, held_out: bool) -> PyResult<&Stage> {
    let stage = if held_out { &source.held_out } else { &source.stage };
    if stage.entries.is_empty() {
        return Err(refused(
            "these scenarios have no held-out scenes; name some: Scenarios(.., held_out=\"closed.pool\")",
        ));
    }
    Ok(stage)
}

/// What a policy within Python decided, by the digest of the scene.
#[derive(Default)]
struct Drives(BTreeMap<Digest, Vec<(Arc<Intervention>, Vec<Control>)>>);

impl Drives {
    fn add(&mut self, stage: &Stage, planned: &Planned, drives: &[Vec<Control>]) {
        for ((plant, act), drive) in stage.plants.iter().zip(planned).zip(drives) {
            let Ok(act) = act else { continue };
            self.0.entry(plant.digest()).or_default().push((act.clone(), drive.clone()));
        }
    }
}

impl Answers for Drives {
    fn answer(&self, request: &Request<'_>) -> Result<Answer, BackendError> {
        let of = self.0.get(&request.plant.digest()).into_iter().flatten();
        let drive = of.rev().find(|(act, _)| **act == *request.intervention).map(|(_, drive)| drive);
        let drive = drive.ok_or_else(|| BackendError::Unplayable("a scene that the policy did not drive".into()))?;
        let told = tell(request.plant, request.intervention, &mut Repeated::new(drive, false));
        let told = told.map_err(|error| BackendError::Unplayable(error.to_string()))?;
        Ok(Answer::ReportedRollout(ReportedRollout { controls: numbers(drive), ..told }))
    }
}

/// Drives all scenes side by side, a decision of all of them at once: what was decided in each.
fn drive(
    py: Python<'_>,
    stage: &Stage,
    planned: &Planned,
    seeing: &Seeing,
    ask: &Bound<'_, PyAny>,
    threads: &Threads,
) -> PyResult<Vec<Vec<Control>>> {
    let keeps = Keeps { controls: true, motion: false };
    let begin = |(plant, act): (&Arc<Plant>, &Result<Arc<Intervention>, String>)| -> PyResult<_> {
        let ride = act.as_ref().ok().map(|act| Ride::new(Arc::clone(plant), act.clone(), seeing.setting(), keeps));
        Ok(Mutex::new((ride.transpose().map_err(broken)?, Frames::default())))
    };
    let rides = stage
        .plants
        .iter()
        .zip(planned)
        .map(begin)
        .collect::<PyResult<Vec<Mutex<(Option<Ride<'static>>, Frames)>>>>()?;
    let of = |place: usize| rides[place].lock().unwrap_or_else(PoisonError::into_inner);
    let reward = Reward::metadrive(1.0);
    for decisions in 0.. {
        let goes_on = |place: &usize| of(*place).0.as_ref().is_some_and(|ride| ride.episode().end().is_none());
        let on: Vec<usize> = (0..rides.len()).filter(goes_on).collect();
        if on.is_empty() {
            break;
        }
        let see = |_, place: &usize| {
            let (ride, frames) = &mut *of(*place);
            ride.as_ref().map_or(Vec::new(), |ride| frames.seen(seeing, &ride.view(), decisions).to_vec())
        };
        let seen: Vec<Vec<f32>> = py.detach(|| threads.map(&on, see));
        let bytes: Vec<u8> = seen.iter().flatten().flat_map(|x| x.to_le_bytes()).collect();
        let actions: Vec<u8> = ask.call1((PyBytes::new(py, &bytes), on.len()))?.extract()?;
        let (actions, rest) = actions.as_chunks::<4>();
        let actions: Vec<f32> = actions.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect();
        let (actions, odd) = actions.as_chunks::<2>();
        if actions.len() != on.len() || !rest.is_empty() || !odd.is_empty() {
            return Err(refused(format!(
                "{} actions for {} scenes; expected two float32 each",
                actions.len(),
                on.len()
            )));
        }
        let step = |at: usize, place: &usize| match &mut of(*place).0 {
            Some(ride) => ride.step(actions[at], &reward).map(|_| ()),
            None => Ok(()),
        };
        py.detach(|| threads.map(&on, step)).into_iter().collect::<Result<(), _>>().map_err(broken)?;
    }
    let controls = |place: usize| of(place).0.as_ref().map_or(Vec::new(), |ride| ride.episode().controls().to_vec());
    Ok((0..rides.len()).map(controls).collect())
}

/// What comes of each scene in which the program is planned.
fn outcomes<'d>(
    stage: &Stage,
    planned: &Planned,
    threads: &Threads,
    driver: &(dyn Fn(usize) -> Box<dyn Driver + 'd> + Sync),
) -> PyResult<Vec<Outcome>> {
    let places: Vec<usize> = (0..planned.len()).filter(|place| planned[*place].is_ok()).collect();
    let nothing = Intervention::default();
    let outcomes = threads.map(&places, |_, &place| {
        let act = planned[place].as_ref().map_or(&nothing, |act| &**act);
        rollout(&stage.plants[place], act, driver(place).as_mut())
    });
    outcomes.into_iter().collect::<Result<_, _>>().map_err(broken)
}

/// How it drives.
fn driven(outcomes: &[Outcome], planned: &Planned) -> PyResult<Value> {
    let mut told = serde_json::to_value(figures(outcomes)).map_err(broken)?;
    told["not_planned"] = json!(planned.len() - outcomes.len());
    Ok(told)
}

/// Who is advised to attack, in the scenes for which the program says so.
fn counsels(file: &ProgramFile, entries: &[SceneEntry]) -> BTreeMap<Digest, Counsel> {
    let carried = |entry: &SceneEntry| {
        let carried = file.counsel.get(&entry.scene().id).filter(|carried| carried.scene == entry.digest)?;
        Some((entry.digest, carried.counsel.clone()))
    };
    entries.iter().filter_map(carried).collect()
}

fn applied<'a>(
    source: &'a Source,
    file: &'a ProgramFile,
    counsels: &'a BTreeMap<Digest, Counsel>,
    (ego, backend): (&'a Policy, Backend<'a>),
) -> PyResult<Applied<'a>> {
    Ok(Applied {
        source: source.sources.get(&file.family).ok_or_else(|| broken("a family that was read is gone"))?,
        ego,
        seed: Seed(file.conditions.seed),
        simulator: &source.simulator,
        backend,
        evaluation: &file.conditions.evaluation,
        counsels,
    })
}

/// What the program is worth against it, as `apply` says.
fn labelled(
    applied: &Applied<'_>,
    (named, file): (&Named, &ProgramFile),
    entries: &[SceneEntry],
    threads: &Threads,
    told: &mut Value,
) -> PyResult<()> {
    let labelled = applied.label(&[&file.program], entries, threads);
    let labelled = labelled.map_err(|error| refused(format!("program {}: {error}", named.name)))?;
    if let Some(score) = labelled.first().map(|labelled| &labelled.score) {
        told["attack"] = json!(score.objectives.attack);
        told[score.realism_name().replace(' ', "_")] = json!(score.objectives.realism);
        told["coverage"] = json!(score.coverage);
        told["labelled"] = json!(score.scenes.len());
    }
    Ok(())
}
