//! A driver in scenes, under each program: the path of `evodrive apply`, and the figures of `evodrive egos`.

use pyo3::prelude::*;
use serde_json::{Value, json};

use evodrive::backend::Backend;
use evodrive::ego::Policy;
use evodrive::epoch::{Applied, SceneEntry};
use evodrive::experiment::ProgramFile;
use evodrive::kernel::{Seed, Threads};
use evodrive::learn::{Stopped, figures};
use evodrive::sim::{Driver, Intervention, Outcome, rollout};

use crate::policy::driver;
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
    let stage = if held_out { &source.held_out } else { &source.stage };
    if stage.entries.is_empty() {
        return Err(refused(
            "these scenarios have no held-out scenes; name some: Scenarios(.., held_out=\"closed.pool\")",
        ));
    }
    py.detach(|| {
        let threads = Threads::new(threads).map_err(refused)?;
        // Who stands still is asked what others did around IDM.
        let planned = source.plan(stage, &policy, &threads);
        let mut told = serde_json::Map::new();
        for (named, planned) in source.named.iter().zip(&planned) {
            let mut of = driven(stage, planned, &policy, stands, &threads)?;
            if let (Some(file), false) = (&named.file, stands) {
                labelled(source, named, file, &stage.entries, &policy, &threads, &mut of)?;
            }
            told.insert(named.name.clone(), of);
        }
        Ok(Value::Object(told).to_string())
    })
}

/// How it drives.
fn driven(stage: &Stage, planned: &Planned, policy: &Policy, stands: bool, threads: &Threads) -> PyResult<Value> {
    let places: Vec<usize> = (0..planned.len()).filter(|place| planned[*place].is_ok()).collect();
    let nothing = Intervention::default();
    let outcomes = threads.map(&places, |_, &place| {
        let act = planned[place].as_ref().map_or(&nothing, |act| &**act);
        let mut driver: Box<dyn Driver> = if stands { Box::new(Stopped) } else { policy.driver() };
        rollout(&stage.plants[place], act, driver.as_mut())
    });
    let outcomes = outcomes.into_iter().collect::<Result<Vec<Outcome>, _>>().map_err(broken)?;
    let mut told = serde_json::to_value(figures(&outcomes)).map_err(broken)?;
    told["not_planned"] = json!(planned.len() - places.len());
    Ok(told)
}

/// What the program is worth against it, as `apply` says.
fn labelled(
    source: &Source,
    named: &Named,
    file: &ProgramFile,
    entries: &[SceneEntry],
    policy: &Policy,
    threads: &Threads,
    told: &mut Value,
) -> PyResult<()> {
    let family = source.sources.get(&file.family).ok_or_else(|| broken("a family that was read is gone"))?;
    let carried = |entry: &SceneEntry| {
        let carried = file.counsel.get(&entry.scene().id).filter(|carried| carried.scene == entry.digest)?;
        Some((entry.digest, carried.counsel.clone()))
    };
    let counsels = entries.iter().filter_map(carried).collect();
    let applied = Applied {
        source: family,
        ego: policy,
        seed: Seed(file.conditions.seed),
        simulator: &source.simulator,
        backend: Backend::Own,
        evaluation: &file.conditions.evaluation,
        counsels: &counsels,
    };
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
