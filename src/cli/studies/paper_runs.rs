//! The runs that the paper's plan names: carried out again, or read as they were recorded.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use crate::cli::evolve::job_args::{JobArgs, RecordArgs, RunArgs};
use crate::cli::evolve::run::{self, Job};
use crate::cli::look::figure;
use crate::cli::records::folder::RunFolder;
use crate::cli::terminal::answer::{Answer, progress};
use crate::cli::terminal::exit::Failure;
use crate::cli::terminal::timed;
use crate::evidence::RecordedRun;
use crate::evidence::paper::{Piece, Plan};
use crate::experiment::is_scripted;
use crate::store;

/// What stands in the place of a cassette's digest where answers are made anew.
const NOT_KEPT: &str = "none is kept: the scripted model answers again";
/// Where runs lie, whether they are taken as they are, and on how many threads they are made else.
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
    let mut ran = Ran { recorded_runs: BTreeMap::new(), folders: BTreeMap::new(), sources: BTreeMap::new() };
    let needed = plan.runs.iter().filter(|run| all || named.contains(run.name.as_str()));
    for planned in needed {
        let job = JobArgs {
            experiment: PathBuf::from(&planned.experiment),
            out: how.runs.to_path_buf(),
            cassette: None,
            scenes: Vec::new(),
            set: Vec::new(),
        };
        let made = Job::new(&job, how.jobs)?;
        let folder = RunFolder::of(how.runs, &made.experiment.name, made.experiment.digest()?, made.scenes.digest())?;
        let cassette = made.cassette(&job);
        let is_kept = cassette.exists() || !is_scripted(&made.experiment);
        let cassette = if is_kept { store::digest_of_file(&cassette, 1 << 30)?.to_hex() } else { NOT_KEPT.into() };
        if !how.as_recorded {
            progress(format!("paper: run {} of {}", planned.name, planned.experiment));
            let (done, took) = timed::timed(|| match is_kept {
                true => run::run(&RunArgs { job, no_report: true }, how.jobs),
                false => recorded(job, folder.cassette_beside(), how.jobs),
            });
            done?;
            progress(format!("paper: {} took {:.0} s", planned.name, took.as_secs_f64()));
        }
        ran.recorded_runs.insert(planned.name.clone(), folder.recorded()?);
        ran.folders.insert(planned.name.clone(), folder);
        ran.sources.insert(planned.name.clone(), (planned.experiment.clone(), cassette));
    }
    Ok(ran)
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
