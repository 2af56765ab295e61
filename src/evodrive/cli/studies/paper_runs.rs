//! The runs that the paper's plan names: carried out again, or read as they were recorded.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use crate::cli::evolve::job_args::{JobArgs, RecordArgs, RunArgs};
use crate::cli::evolve::run;
use crate::cli::look::{figure, redraws};
use crate::cli::records::folder::RunFolder;
use crate::cli::scenes::files::threads;
use crate::cli::terminal::answer::{Answer, progress};
use crate::cli::terminal::exit::Failure;
use crate::cli::terminal::timed;
use crate::evidence::RecordedRun;
use crate::evidence::paper::{Piece, Plan, PlannedRun};
use crate::experiment::{Experiment, SceneSource, is_scripted};
use crate::kernel::{Digest, Threads};
use crate::store;

/// Text in place of a cassette's digest if answers are made anew.
const NOT_KEPT: &str = "none is kept: the scripted model answers again";
/// Folder of the runs, whether they are taken as they are, and the number of threads on which they are made otherwise.
pub struct How<'a> {
    pub runs: &'a Path,
    pub as_recorded: bool,
    pub jobs: usize,
}

/// The runs that are needed, and what they rest on.
pub struct Ran {
    pub recorded_runs: BTreeMap<String, RecordedRun>,
    folders: BTreeMap<String, RunFolder>,
    /// Experiment file, and digest of its cassette, or that none is kept.
    pub sources: BTreeMap<String, (String, String)>,
}

/// The runs of these pieces, or of the whole plan.
pub fn carry_out(plan: &Plan, wanted: &[&Piece], all: bool, how: &How<'_>) -> Result<Ran, Failure> {
    let named: BTreeSet<&str> = wanted.iter().flat_map(|piece| &piece.runs).map(String::as_str).collect();
    let needed: Vec<&PlannedRun> = plan.runs.iter().filter(|run| all || named.contains(run.name.as_str())).collect();
    let threads = threads(how.jobs)?;
    let (mut folders, mut sources, mut pools) = (BTreeMap::new(), BTreeMap::new(), Pools::default());
    for planned in needed {
        let experiment = Experiment::read_under(Path::new(&planned.experiment), &[])?;
        let scenes = pools.digest_of(&experiment, &threads)?;
        let folder = RunFolder::of(how.runs, &experiment.name, experiment.digest()?, scenes)?;
        let cassette = experiment.beside(&experiment.cassette);
        let is_kept = cassette.exists() || !is_scripted(&experiment);
        let cassette = if is_kept { store::digest_of_file(&cassette, 1 << 30)?.to_hex() } else { NOT_KEPT.into() };
        if !how.as_recorded {
            progress(format!("paper: run {} of {}", planned.name, planned.experiment));
            let (done, took) = timed::timed(|| again(planned, is_kept, &folder, how));
            done?;
            progress(format!("paper: {} took {:.0} s", planned.name, took.as_secs_f64()));
        }
        folders.insert(planned.name.clone(), folder);
        sources.insert(planned.name.clone(), (planned.experiment.clone(), cassette));
    }
    let read = threads.map(&folders.iter().collect::<Vec<_>>(), |_, (name, folder)| {
        folder.recorded().map(|recorded| (String::clone(name), recorded))
    });
    let mut recorded_runs = read.into_iter().collect::<Result<BTreeMap<_, _>, _>>()?;
    for (name, run) in &mut recorded_runs {
        if let Some(folder) = folders.get(name) {
            *run = redraws::with_all(folder, run.clone(), how.jobs)?;
        }
    }
    Ok(Ran { recorded_runs, folders, sources })
}

/// Digests of the scenes of experiments, of which many share theirs.
#[derive(Default)]
struct Pools(BTreeMap<String, Digest>);

impl Pools {
    fn digest_of(&mut self, experiment: &Experiment, threads: &Threads) -> Result<Digest, Failure> {
        let made = || Ok::<_, Failure>(experiment.scenes(&[], threads)?.digest());
        match &experiment.scenes {
            // Files are named relative to the experiment, so that their names do not say which they are.
            SceneSource::Files { .. } | SceneSource::Pool { .. } => made(),
            source @ (SceneSource::Synth { .. } | SceneSource::Safebench { .. }) => {
                let source = serde_json::to_string(source).map_err(Failure::internal)?;
                if let Some(known) = self.0.get(&source) {
                    return Ok(*known);
                }
                let digest = made()?;
                self.0.insert(source, digest);
                Ok(digest)
            }
        }
    }
}

/// Carries a run out from its recorded answers and rollouts, or from answers that the scripted model gives again.
fn again(planned: &PlannedRun, is_kept: bool, folder: &RunFolder, how: &How<'_>) -> Result<Answer, Failure> {
    let job = JobArgs {
        experiment: PathBuf::from(&planned.experiment),
        out: how.runs.to_path_buf(),
        cassette: None,
        scenes: Vec::new(),
        set: Vec::new(),
    };
    if is_kept {
        run::run(&RunArgs { job, no_report: true }, how.jobs)
    } else {
        recorded(job, folder.cassette_beside(), how.jobs)
    }
}

/// Carries a run out whose answers nobody keeps, because the scripted model gives them again.
fn recorded(job: JobArgs, cassette: PathBuf, jobs: usize) -> Result<Answer, Failure> {
    let job = JobArgs { cassette: Some(cassette), ..job };
    let args = RecordArgs { run: RunArgs { job, no_report: true }, fresh: false, overwrite: true, open: None };
    run::record(&args, jobs)
}

impl Ran {
    /// The runs of these names.
    pub fn of(&self, names: &[String]) -> Vec<RecordedRun> {
        names.iter().filter_map(|name| self.recorded_runs.get(name)).cloned().collect()
    }

    /// A piece's runs, and where they lie.
    pub fn shown(&self, piece: &Piece) -> Vec<figure::FolderAndRun> {
        let shown = |name: &String| Some((self.folders.get(name)?.clone(), self.recorded_runs.get(name)?.clone()));
        piece.runs.iter().filter_map(shown).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_scenes_of_each_experiment_are_its_own_whoever_was_looked_at_before() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("experiments/quickstart.toml");
        let under = |count: usize, seed: u32| {
            let set = [format!("scenes.count={count}"), format!("scenes.seed={seed}")];
            Experiment::read_under(&path, &[set.to_vec(), SMALL.map(String::from).to_vec()].concat()).unwrap()
        };
        const SMALL: [&str; 3] = ["split.evolution.count=2", "split.held_out=1", "split.window=2"];
        let (threads, mut pools) = (threads(1).unwrap(), Pools::default());
        for of in [under(4, 1), under(4, 2), under(5, 1), under(4, 1)] {
            let own = of.scenes(&[], &threads).unwrap().digest();
            assert_eq!(pools.digest_of(&of, &threads).unwrap(), own);
        }
        assert_eq!(pools.0.len(), 3, "the first and the last share theirs");
    }
}
