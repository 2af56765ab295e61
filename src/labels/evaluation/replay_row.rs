//! Plays the recorded scenes without a program: the do-nothing row that stands first in every table.

use std::sync::Arc;

use super::calibrate::moves;
use super::evaluate::failure;
use super::metrics::{EvaluationOptions, RealismOptions, realism::realism_of};
use super::protocol::safebench::{Runs, safebench_run};
use crate::backend::{Backend, BackendError, DriveContext, NoOutcome};
use crate::ego::Policy;
use crate::kernel::{Seed, Threads, num};
use crate::objects::benchmark::SafebenchRun;
use crate::objects::replay::{ReplayRow, ReplayScene, Replayed, Suite};
use crate::scene::{AgentKind, PreparedScene};
use crate::sim::{ActorRef, AdversaryReport, Intervention, Motion, Outcome, Plant, SimulatorOptions, WithRecording};

/// Rules under which the scenes are played and judged.
#[derive(Clone, Copy)]
pub struct Playing<'a> {
    /// The ego that drives.
    pub ego: &'a Policy,
    /// Rules of the simulator.
    pub simulator: &'a SimulatorOptions,
    /// Backend that simulates.
    pub backend: Backend<'a>,
    /// Seed of every random draw of the simulator.
    pub seed: Seed,
    /// Options of the protocol: MetaDrive's judge the recorded traffic; SafeBench's score the empty program.
    pub evaluation: &'a EvaluationOptions,
}

/// Plays every scene with the empty intervention. `None` if no scene could be played.
///
/// # Errors
/// A backend that cannot go on.
pub fn replay_row(
    scenes: &[Arc<PreparedScene>],
    suite: Suite,
    playing: &Playing<'_>,
    threads: &Threads,
) -> Result<Option<Replayed>, BackendError> {
    let (mut played, mut failures, mut runs) = (Vec::new(), Vec::new(), Runs::default());
    for (scene, found) in scenes.iter().zip(threads.map(scenes, |_, scene| play(scene, playing))) {
        let staging = scene.scene.staging.as_ref().map(|staging| (staging.family, staging.route));
        match found {
            Ok((scene, run)) => {
                played.push(scene);
                run.zip(staging).into_iter().for_each(|(run, group)| runs.add(group, run));
            }
            Err(NoOutcome::Scene(reason)) => {
                failures.push(failure(&scene.scene.id, reason));
            }
            Err(NoOutcome::Stop(error)) => return Err(error),
        }
    }
    let mean =
        |of: &dyn Fn(&ReplayScene) -> Option<f64>| num::mean(&played.iter().filter_map(of).collect::<Vec<f64>>());
    let Some(contact_rate) = mean(&|scene| Some(if scene.contact { 1.0 } else { 0.0 })) else { return Ok(None) };
    let row = ReplayRow {
        ego: playing.ego.name().to_string(),
        suite,
        scenes: played.len(),
        contact_rate,
        realism: mean(&|scene| scene.realism),
        route_completion: mean(&|scene| Some(scene.route_completion)).unwrap_or_default(),
        benchmark: runs.benchmark().map(|benchmark| benchmark.mean),
    };
    Ok(Some(Replayed { row, scenes: played, failures }))
}

fn play(
    prepared: &Arc<PreparedScene>,
    playing: &Playing<'_>,
) -> Result<(ReplayScene, Option<SafebenchRun>), NoOutcome> {
    let scene = prepared.scene.id.clone();
    let plant = Plant::with_options(prepared.clone(), playing.simulator)?;
    let context = DriveContext::plain(playing.seed);
    let outcome = playing.backend.rollout(&plant, &Intervention::default(), playing.ego, context)?;
    let (realism, run) = match playing.evaluation {
        EvaluationOptions::Metadrive(options) => (recorded_realism(&plant, &options.realism), None),
        EvaluationOptions::Safebench { safebench } => (None, safebench_run(&outcome, safebench)),
    };
    let Outcome { contact, route_completion, .. } = outcome;
    Ok((ReplayScene { scene, contact: contact.is_some(), realism, route_completion }, run))
}

/// Mean over a scene's moving vehicles of r_MD as they were recorded; `None` without any. Each is judged alone, as a
/// program's one adversary is.
fn recorded_realism(plant: &Plant, options: &RealismOptions) -> Option<f64> {
    let reports = recorded_reports(plant);
    num::mean(&reports.chunks(1).map(|report| realism_of(report, options).1).collect::<Vec<f64>>())
}

/// Moving vehicles of a scene as if their recorded motion had been generated: nothing of their own excuses them.
pub fn recorded_reports(plant: &Plant) -> Vec<AdversaryReport> {
    let scene = plant.scene();
    let taken = (0..scene.tracks.len()).filter(|track| scene.tracks[*track].kind == AgentKind::Vehicle);
    let report = |track: usize| AdversaryReport {
        actor: ActorRef::Track(track),
        kind: scene.tracks[track].kind,
        acted: false,
        motion: Motion::default(),
        simulated: plant.recorded(track),
        recorded: None,
        initial_overlap: false,
        struck_bystander: false,
        struck_parked: false,
        route_completion: None,
        log_deviation_m_max: Some(0.0),
        of_kind: plant
            .options()
            .of_kind
            .then(|| WithRecording { simulated: plant.recorded_of_kind(track), recorded: None }),
        of_place: plant
            .options()
            .of_place
            .then(|| WithRecording { simulated: plant.recorded_of_place(track), recorded: None }),
    };
    taken.filter(|track| moves(scene, *track)).map(report).collect()
}
