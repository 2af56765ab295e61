//! `train`: a learned ego from a training file: progress, checkpoints, weights and their card.

use clap::Args;
use std::cell::Cell;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::cli::scenes::files;
use crate::cli::studies::train_text::{self, Pace, Trained};
use crate::cli::terminal::answer::{Answer, progress};
use crate::cli::terminal::output::Output;
use crate::cli::terminal::{exit::Failure, interrupt::Interrupt, typed::again_with};
use crate::ego::Policy;
use crate::experiment::TrainingFile;
use crate::kernel::{Digest, Threads};
use crate::learn::{CheckpointError, Grounds, Lesson, Training, TrainingError, trial};
use crate::scene::{Pool, PreparedScene};
use crate::sim::{Plant, SimulatorOptions};
use crate::store;
use crate::text::counted;

/// Bytes that a checkpoint may have.
const CHECKPOINT_BYTES_MAX: u64 = 8 << 30;

#[derive(Debug, Args)]
pub struct Options {
    /// Training file, e.g. experiments/train/sac-metadrive.toml.
    pub file: PathBuf,
    /// Folder for the weights and their card.
    #[arg(long, default_value = "policies")]
    pub out: PathBuf,
    /// Folder for checkpoints; one is written after each evaluation.
    #[arg(long, default_value = "runs/train")]
    pub checkpoints: PathBuf,
    /// Continue from the checkpoint of a training that was stopped.
    #[arg(long)]
    pub resume: bool,
    /// Root of the random streams, instead of the file's; the name of the weights then ends in -s<seed>.
    #[arg(long)]
    pub seed: Option<u64>,
    /// Stop with a checkpoint after this many evaluations; --resume goes on from there.
    #[arg(long)]
    pub evaluations: Option<usize>,
    #[command(flatten)]
    pub output: Output,
}

pub fn run(options: &Options, jobs: usize) -> Result<Answer, Failure> {
    let mut file = TrainingFile::read(&options.file)?;
    if let Some(seed) = options.seed.filter(|seed| *seed != file.training.seed) {
        file.training.seed = seed;
        file.name = format!("{}-s{seed}", file.name);
    }
    let checkpoint = options.checkpoints.join(format!("{}.checkpoint", file.name));
    // Before the scenes are made: a missing checkpoint is said at once.
    let stopped = options.resume.then(|| store::read_bounded(&checkpoint, CHECKPOINT_BYTES_MAX)).transpose()?;
    let threads = files::threads(jobs)?;
    let pools = file.pools(&threads)?;
    let recipe = file.recipe(&pools)?;
    let [training, validation] = pools.each_ref().map(|pool| lessons(pool, &file.simulator, &threads));
    let (training, validation) = (training?, validation?);
    progress(format!(
        "{}: {} to learn on, {} to compare by",
        file.name,
        counted(training.len(), "scene"),
        validation.len()
    ));
    let grounds = Grounds { training: &training, validation: &validation, threads: &threads };
    let mut state = begin(stopped.as_deref(), &file, recipe)?;
    if !options.resume && !is_of(&checkpoint, &file, recipe) {
        // Its name was derived: it may be another training's, which could still be gone on with, or no checkpoint at all.
        options.output.may_be_made(&checkpoint)?;
    }
    let interrupt = Interrupt::listen()?;
    // The file may be there of an earlier training.
    let kept = Cell::new(options.resume);
    let is_over = learn(&mut state, &grounds, options.evaluations, &interrupt, |state| {
        store::write_atomic(&checkpoint, &state.checkpoint(recipe)?)?;
        kept.set(true);
        Ok(())
    })?;
    if !is_over && interrupt.is_asked() {
        return Err(Failure::interrupted(if kept.get() {
            format!(
                "interrupted; {} holds the training as of its last evaluation\n  to go on: {}",
                checkpoint.display(),
                again_with("--resume")
            )
        } else {
            "interrupted before the first evaluation, so there is no checkpoint to continue from".to_string()
        }));
    }
    if !is_over {
        let text = format!("stopped after {} of {} updates; go on with --resume", state.updates, state.options.updates);
        return Ok(Answer::new(text, serde_json::json!({"updates": state.updates, "checkpoint": checkpoint})));
    }
    let weights = state.weights().map_err(Failure::internal)?;
    let kept = Policy::learned(&weights).map_err(Failure::internal)?;
    let idm = trial(&validation, &Policy::Idm, &threads).map_err(Failure::bad_input)?;
    let kept = trial(&validation, &kept, &threads).map_err(Failure::bad_input)?;
    let trained = Trained { file: &file, recipe, pools: pools.each_ref().map(Pool::digest), state: &state, kept, idm };
    let (card, digest) = (trained.card(&weights), Digest::of_bytes(&weights));
    let [weights_path, card_path] = ["safetensors", "json"].map(|end| options.out.join(format!("{}.{end}", file.name)));
    options.output.write(&weights_path, &weights)?;
    options.output.write(&card_path, format!("{card:#}\n").as_bytes())?;
    Ok(Answer::new(trained.text(&weights_path, digest), card))
}

/// The scenes of a pool as they are, prepared; one that cannot be simulated is an error.
pub fn lessons(pool: &Pool, simulator: &SimulatorOptions, threads: &Threads) -> Result<Vec<Lesson>, Failure> {
    let scenes: Vec<_> = pool.scenes.iter().collect();
    let prepared =
        threads.map(&scenes, |_, scene| Plant::with_options(PreparedScene::new(Arc::new((*scene).clone())), simulator));
    prepared.into_iter().map(|plant| plant.map(Lesson::from).map_err(Failure::bad_input)).collect()
}

/// Returns `true` if a file is a checkpoint of this training.
fn is_of(path: &Path, file: &TrainingFile, recipe: Digest) -> bool {
    let read = store::read_bounded(path, CHECKPOINT_BYTES_MAX);
    read.is_ok_and(|bytes| Training::resumed(file.training, recipe, &bytes).is_ok())
}

/// A training from its beginning, or from the bytes of a checkpoint.
fn begin(stopped: Option<&[u8]>, file: &TrainingFile, recipe: Digest) -> Result<Training, Failure> {
    let Some(bytes) = stopped else {
        return Training::new(file.training).map_err(Failure::from);
    };
    let state = Training::resumed(file.training, recipe, bytes)?;
    progress(format!("goes on after {} of {} updates", state.updates, state.options.updates));
    Ok(state)
}

/// Trains to the end, or until so many evaluations were made or Ctrl-C was pressed. Says whether it is over.
fn learn(
    state: &mut Training,
    grounds: &Grounds<'_>,
    evaluations: Option<usize>,
    interrupt: &Interrupt,
    keep: impl Fn(&Training) -> Result<(), Failure>,
) -> Result<bool, Failure> {
    let mut pace = Pace::new(state);
    let mut made = 0;
    while !state.is_over() && !interrupt.is_asked() {
        let news = state.round(grounds)?;
        if let Some(line) = pace.line(state, &news) {
            progress(line);
        }
        if let Some(found) = &news.evaluated {
            progress(format!("after {} updates, validation: {}", state.updates, train_text::figures(found)));
            keep(state)?;
            made += 1;
            if evaluations.is_some_and(|most| made >= most) {
                break;
            }
        }
    }
    Ok(state.is_over())
}

impl From<TrainingError> for Failure {
    fn from(error: TrainingError) -> Failure {
        Failure::bad_input(error)
    }
}

impl From<CheckpointError> for Failure {
    fn from(error: CheckpointError) -> Failure {
        match error {
            CheckpointError::Tensor(_) | CheckpointError::Header(_) => Failure::corruption(error),
            CheckpointError::Other { .. } | CheckpointError::Training(_) => Failure::bad_input(error),
        }
    }
}
