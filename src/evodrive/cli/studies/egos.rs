//! `egos`: how replay, IDM and learned egos drive the held-out scenes of an experiment, without a program.

use clap::Args;
use serde_json::json;
use std::borrow::Cow;
use std::path::{Path, PathBuf};

use crate::backend::{Answers, DriveContext, NoOutcome};
use crate::cli::evolve::behind::{self, Asked};
use crate::cli::scenes::{files, left_out::listed};
use crate::cli::studies::train::lessons;
use crate::cli::terminal::answer::{Answer, progress};
use crate::cli::terminal::exit::Failure;
use crate::ego::Policy;
use crate::experiment::{Experiment, shipped_weights};
use crate::kernel::{Seed, Threads};
use crate::learn::{Lesson, Trial, figures, trial};
use crate::scene::Pool;
use crate::sim::{SimError, Undriven};
use crate::store;
use crate::text::counted;

/// Bytes that a file of weights may have.
const WEIGHTS_BYTES_MAX: u64 = 64 << 20;

#[derive(Debug, Args)]
pub struct Options {
    /// Experiment file whose held-out scenes are driven, e.g. experiments/metadrive/cat-sac.toml; its learned egos drive too.
    pub experiment: PathBuf,
    /// Weights of a learned ego: a file, or a name of policies/ as evodrive:sac-chatscene; may be repeated.
    #[arg(long)]
    pub policy: Vec<PathBuf>,
    /// Your planner, which drives too: a program, a .py file, or a .toml file with a table [driver]; may be repeated.
    #[arg(long)]
    pub driver: Vec<PathBuf>,
    /// Seconds that a planner may take for a decision; a scene in which it takes longer is counted as too slow, which is neither a crash
    /// nor a success. Without it 10, or what its table [driver] says.
    #[arg(long)]
    pub time_limit: Option<f64>,
}

/// How an ego drove, and the scenes that it did not drive to their end.
struct Driven {
    name: String,
    trial: Trial,
    too_slow: usize,
    abandoned: usize,
    failed: usize,
}

pub fn run(options: &Options, jobs: usize) -> Result<Answer, Failure> {
    let experiment = Experiment::read(&options.experiment)?;
    let threads = files::threads(jobs)?;
    let pool = experiment.scenes(&[], &threads)?;
    let split = experiment.split_of(&pool, &threads)?;
    let held_out = split.held_out.iter().filter_map(|entry| pool.scene(&entry.id).cloned()).collect();
    let held_out = Pool::new(held_out, vec![]).map_err(Failure::internal)?;
    let lessons = lessons(&held_out, &experiment.simulator.rules(), &threads)?;
    let mut egos = vec![
        ("replay".to_string(), Policy::Replay),
        ("idm".to_string(), Policy::Idm),
        ("pdm".to_string(), Policy::Pdm),
        ("frenet".to_string(), Policy::Frenet),
    ];
    let rules = experiment.simulator.rules();
    for lineage in experiment.lineages.iter().filter(|lineage| lineage.policy.is_some()) {
        for policy in lineage.drivers().map_err(Failure::bad_input)? {
            if egos.iter().all(|(_, known)| *known != policy) {
                egos.push((policy.name().to_string(), policy));
            }
        }
    }
    for path in &options.policy {
        egos.push((path.display().to_string(), learned(path)?));
    }
    let mut rows: Vec<Driven> = Vec::new();
    for (name, policy) in egos {
        match trial(&lessons, &policy, &threads) {
            Ok(trial) => rows.push(Driven { name, trial, too_slow: 0, abandoned: 0, failed: 0 }),
            // SafeBench's scenes have no recorded ego; the others drive all the same.
            Err(SimError::NoLog { scene, .. }) if policy == Policy::Replay => {
                progress(format!("replay is left out: scene {scene} has no recorded drive of its ego"));
            }
            Err(error) => return Err(Failure::bad_input(error)),
        }
    }
    // The experiment's own program is asked, too: recorded are rollouts of runs.
    let own = experiment.driver.as_ref().map(|_| options.experiment.clone());
    for path in own.iter().chain(&options.driver) {
        let asked = Asked::named(path, &rules)?.within(options.time_limit)?;
        rows.push(planned(path, &asked, &lessons, experiment.seed, &threads)?);
    }
    let row = |of: &Driven| {
        let Driven { name, trial, too_slow, abandoned, failed } = of;
        json!({"ego": name, "figures": trial, "too_slow": too_slow, "abandoned": abandoned, "failed": failed})
    };
    let object = rows.iter().map(row).collect::<Vec<_>>();
    Ok(Answer::new(table(lessons.len(), &rows), json!({"held_out": held_out.digest(), "egos": object})))
}

/// How a program of one's own drives; what it could not drive is named and counts nowhere.
fn planned(path: &Path, asked: &Asked, lessons: &[Lesson], seed: u64, threads: &Threads) -> Result<Driven, Failure> {
    let (ego, planners) = (asked.ego()?, asked.planners());
    let backend = behind::asked(Some(asked), Some(&planners));
    let context = DriveContext::plain(Seed(seed));
    let drive = |_: usize, of: &Lesson| backend.rollout(&of.plant, &of.intervention, &ego, context);
    let (mut outcomes, mut not_driven) = (Vec::new(), Vec::new());
    for (lesson, driven) in lessons.iter().zip(threads.map(lessons, drive)) {
        match driven {
            Ok(outcome) => outcomes.push(outcome),
            Err(NoOutcome::Scene(why)) => not_driven.push((lesson.plant.scene_id().to_string(), why)),
            Err(NoOutcome::Stop(error)) => return Err(error.into()),
        }
    }
    let count = |is: fn(&Undriven) -> bool| not_driven.iter().filter(|(_, why)| is(why)).count();
    let too_slow = count(|why| matches!(why, Undriven::TooSlow(_)));
    let abandoned = count(|why| matches!(why, Undriven::Abandoned(_)));
    let failed = not_driven.len() - too_slow - abandoned;
    listed("not driven", not_driven.into_iter().map(|(scene, why)| (scene, why.to_string())))
        .into_iter()
        .for_each(progress);
    planners.compared().into_iter().for_each(progress);
    if outcomes.is_empty() {
        Err(Failure::bad_input("the ego drove no scene to its end; the reasons are given above"))
    } else {
        let (name, trial) = (path.display().to_string(), figures(&outcomes));
        Ok(Driven { name, trial, too_slow, abandoned, failed })
    }
}

/// Returns `true` if a word names weights: those that the program carries, or a file of them.
pub fn is_weights(word: &str) -> bool {
    [".safetensors", ".onnx"].iter().any(|end| word.ends_with(end)) || shipped_weights("", word).is_some()
}

/// The ego whose weights a file holds, or that the program carries under this name.
pub fn learned(path: &Path) -> Result<Policy, Failure> {
    let name = path.display().to_string();
    let bytes = match shipped_weights("--policy", &name) {
        Some(bytes) => Cow::Borrowed(bytes.map_err(Failure::bad_input)?),
        None => Cow::Owned(store::read_bounded(path, WEIGHTS_BYTES_MAX)?),
    };
    Policy::learned(&bytes).map_err(|error| Failure::bad_input(format!("{name}: {error}")))
}

fn table(count: usize, rows: &[Driven]) -> String {
    let heads = ["route completion", "crash rate", "off road", "arrived", "mean speed"];
    let [route, crash, off, arrived, speed] = heads;
    // A planner alone can be too slow, abandon a scene, or fail.
    let of = |row: &Driven| [("too slow", row.too_slow), ("abandoned", row.abandoned), ("failed", row.failed)];
    let counts = |row: usize| rows.iter().map(|driven| of(driven)[row].1).sum::<usize>();
    let (abandoned, missing) = (counts(1) > 0, (0..3).any(|row| counts(row) > 0));
    let shown = |name: &str| missing && (name != "abandoned" || abandoned);
    let cells = |row: &Driven, cell: fn((&'static str, usize)) -> String| -> String {
        of(row).into_iter().filter(|(name, _)| shown(name)).map(|of| format!(" {:>9}", cell(of))).collect()
    };
    let more = rows.first().map(|row| cells(row, |(name, _)| name.to_string())).unwrap_or_default();
    let mut text = format!(
        "{}, no program; a crash is any contact, whoever caused it\n{route:>16} {crash:>12} {off:>10} {arrived:>9} {speed:>11}{more}  ego\n",
        counted(count, "held-out scene")
    );
    for row in rows {
        let (trial, more) = (&row.trial, cells(row, |(_, count)| count.to_string()));
        text += &format!(
            "{:>14.1} % {:>10.1} % {:>8.1} % {:>7.1} % {:>7.1} m/s{more}  {}\n",
            100.0 * trial.route_completion,
            100.0 * trial.crash_rate,
            100.0 * trial.off_road_rate,
            100.0 * trial.arrival_rate,
            trial.speed_mps,
            row.name
        );
    }
    if missing {
        let left = if abandoned { "too slow and abandoned are" } else { "too slow is" };
        text += &format!(
            "{left} neither a crash nor a success; {} and failed scenes count in no number beside them\n",
            if abandoned { "these" } else { "both that" }
        );
    }
    text
}
