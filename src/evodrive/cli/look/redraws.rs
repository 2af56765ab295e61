//! The control of SafeBench's archives, worked out of a sealed run: its parents, drawn as often as its programs were. The run's folder keeps
//! it in redrawn.json.

use std::collections::BTreeSet;
use std::sync::Arc;

use crate::cli::records::folder::RunFolder;
use crate::cli::records::kept::KeptFile;
use crate::cli::scenes::files;
use crate::cli::studies::{apply, packed};
use crate::cli::terminal::answer::progress;
use crate::cli::terminal::exit::{Exit, Failure};
use crate::epoch::{Redraw, Replaced, SceneEntry};
use crate::evaluation::Selecting;
use crate::evidence::RecordedRun;
use crate::experiment::Experiment;
use crate::families;
use crate::kernel::Threads;
use crate::objects::Attempt;
use crate::objects::benchmark::Redrawn;
use crate::objects::event::LineageResult;
use crate::scene::Pool;

fn file(folder: &RunFolder) -> KeptFile {
    KeptFile { path: folder.redrawn(), word: "redrawn", again: "evodrive table safebench-main" }
}

/// The run with the controls that its folder keeps.
///
/// # Errors
/// A file that is damaged or was changed.
pub fn with_kept(folder: &RunFolder, mut run: RecordedRun) -> Result<RecordedRun, Failure> {
    if !run.rounds.is_empty()
        && let Some(kept) = file(folder).read(run.root)?
    {
        run.redrawn = kept;
    }
    Ok(run)
}

/// The run with the controls of all its archives: those that its folder keeps, or rollouts, which the folder keeps then. A run that cannot
/// be played here, such as one of another version, stays without, and says why.
///
/// # Errors
/// A file that is damaged, a run whose labels do not come out again.
pub fn with_all(folder: &RunFolder, run: RecordedRun, jobs: usize) -> Result<RecordedRun, Failure> {
    let mut run = with_kept(folder, run)?;
    let lineages = run.result.as_ref().map_or_else(Vec::new, |result| result.lineages.clone());
    if run.rounds.is_empty() || lineages.is_empty() || !run.redrawn.is_empty() {
        return Ok(run);
    }
    let threads = files::threads(jobs)?;
    match lineages.iter().map(|lineage| redrawn(folder, &run, lineage, &threads)).collect::<Result<Vec<_>, _>>() {
        Ok(redrawn) => run.redrawn = redrawn,
        Err(failure) if failure.exit == Exit::BadInput => {
            progress(format!("{}: its parents cannot be drawn anew: {}", run.opened.name, failure.message));
            return Ok(run);
        }
        Err(failure) => return Err(failure),
    }
    if let Err(failure) = file(folder).write(run.root, &run.redrawn) {
        progress(format!("what was drawn anew is not kept: {}", failure.message));
    }
    Ok(run)
}

/// The folder's finished run with the controls of its archives.
pub fn recorded(folder: &RunFolder, jobs: usize) -> Result<RecordedRun, Failure> {
    with_all(folder, folder.recorded()?, jobs)
}

/// The control of one lineage's archive.
fn redrawn(
    folder: &RunFolder,
    run: &RecordedRun,
    result: &LineageResult,
    threads: &Threads,
) -> Result<Redrawn, Failure> {
    let experiment = folder.read_experiment()?;
    let options = experiment.evaluation.safebench().filter(|_| experiment.simulator.backend.is_none());
    let options = options.ok_or_else(|| Failure::bad_input("another simulator made its labels"))?;
    let file = packed::packed_of(folder, run, result.parent.solution.as_str())?;
    let ego = match packed::own_weights(folder, &file)? {
        Some(learned) => learned,
        None => apply::driver(&file.conditions.ego)?,
    };
    let sources = families::sources_by_hand();
    let evolution = evolution(run, &folder.read_pool()?, threads);
    let counsels = apply::counsels(&file, &evolution);
    let replaced = replaced(&run.attempts, result);
    progress(format!(
        "{}: playing its parent in the place of {} programs, {} scenes each",
        result.lineage,
        replaced.len(),
        evolution.len()
    ));
    let redraw = Redraw {
        lineage: &result.lineage,
        parent: &file.parent,
        applied: apply::as_conditioned(&file, &sources, &ego, &counsels)?,
        evolution: &evolution,
        rounds: run.rounds.iter().map(|round| round.round).max().unwrap_or(0),
        descendants: descendants(run, result),
        selecting: selecting(&experiment, options.selected_per_group),
        archive: &experiment.archive,
        selector: &experiment.selector,
        replaced,
    };
    let (own, redrawn) = redraw.play(threads)?;
    let recorded = run.finalists.iter().filter(|of| of.lineage == result.lineage);
    let recorded = recorded.filter(|of| of.solution == result.parent.solution).flat_map(|of| &of.score.scenes);
    for known in recorded {
        if own.scenes.iter().any(|label| label.scene == known.scene && label.record != known.record) {
            return Err(Failure::divergence(format!(
                "{} in {}: the run recorded another rollout; `evodrive verify` finds where they part",
                result.parent.solution, known.scene
            )));
        }
    }
    Ok(redrawn)
}

fn selecting(experiment: &Experiment, per_group: usize) -> Selecting {
    Selecting { per_group, coverage_floor: experiment.archive.coverage_floor }
}

fn evolution(run: &RecordedRun, pool: &Pool, threads: &Threads) -> Vec<SceneEntry> {
    let scenes = run.opened.evolution_scenes.iter().filter_map(|id| pool.scene(id).cloned().map(Arc::new));
    threads.map(&scenes.collect::<Vec<_>>(), |_, scene| SceneEntry::new(scene.clone()))
}

/// The programs whose runs the archive was put together from.
fn replaced<'r>(attempts: &'r [Attempt], result: &LineageResult) -> Vec<Replaced<'r>> {
    let own = attempts.iter().filter(|attempt| attempt.lineage == result.lineage);
    let labelled = own.filter_map(|attempt| {
        let (candidate, score) = (attempt.exit.candidate()?, attempt.exit.score()?);
        let (labelled, failed) = (score.scenes.iter().map(|of| &of.scene), score.failures.iter().map(|of| &of.scene));
        let scenes: BTreeSet<&str> = labelled.chain(failed).map(String::as_str).collect();
        Some(Replaced { program: &candidate.program, round: attempt.epoch + 1, scenes })
    });
    labelled.collect()
}

/// Returns the number of descendants that span the lineage's frontier.
fn descendants(run: &RecordedRun, result: &LineageResult) -> usize {
    let own = run.held_out.iter().filter(|of| of.lineage == result.lineage);
    own.filter(|of| of.roles.iter().any(|role| role == "descendant")).count()
}
