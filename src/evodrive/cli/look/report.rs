//! `report`: the HTML file of a run.

use clap::Args;
use serde_json::json;
use std::path::PathBuf;

use crate::backend::Answers;
use crate::cli::evolve::behind;
use crate::cli::look::compared_pairs::Side;
use crate::cli::look::page::{self, Asked};
use crate::cli::look::{credit, others};
use crate::cli::records::run_name::OneRun;
use crate::cli::studies::agree;
use crate::cli::terminal::{answer::Answer, exit::Failure};
use crate::kernel::Threads;

#[derive(Debug, Args)]
pub struct Options {
    #[command(flatten)]
    pub run: OneRun,
    /// Run of the same study in another simulator: adds a section on how far the two agree, as `agree` prints it.
    #[arg(long)]
    pub against: Option<PathBuf>,
    /// Another run to compare with, e.g. a null search or another model's; may be given again. What it reports stands in the front of the
    /// lineage that it is compared with, and a table has the differences, as `compare` says them.
    #[arg(long, value_name = "RUN")]
    pub beside: Vec<PathBuf>,
    /// Add what `credit` says of each patch; plays what the folder does not keep yet.
    #[arg(long)]
    pub credit: bool,
}

/// Simulates the played rollouts again (they are deterministic), so a report needs no stored motion.
pub fn run(options: &Options, jobs: usize) -> Result<Answer, Failure> {
    let folder = options.run.folder()?;
    let threads = Threads::new(jobs)?;
    let experiment = folder.read_experiment()?;
    let study = experiment.study(folder.read_pool()?, &threads)?;
    let replay = behind::replay_of(&experiment, &folder)?;
    let answers = replay.as_ref().map(|replay| replay as &dyn Answers);
    let against = options.against.as_deref();
    let agreement = against.map(|other| agree::agreement(&folder.dir, other, &threads)).transpose()?;
    let run = folder.recorded_on(Some(&threads))?;
    let own = Side { folder: folder.clone(), run, part: None };
    let others = options.beside.iter().map(|place| others::other(&own, place)).collect::<Result<Vec<_>, _>>()?;
    let run = own.run;
    if options.credit {
        credit::of_reported(&folder, &run, &threads)?;
    }
    page::write(
        &study,
        &folder,
        &run,
        behind::backend(&experiment, answers),
        Asked { agreement: agreement.as_ref(), others: &others },
        &threads,
    )?;
    let path = folder.report();
    Ok(Answer::new(format!("report: {}", path.display()), json!({"report": path})))
}
