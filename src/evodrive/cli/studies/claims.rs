//! `claims`: the paper's claims against recorded runs.

use clap::{Args, ValueEnum};
use serde_json::json;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use crate::archive::SelectorOptions;
use crate::cli::look::redraws;
use crate::cli::records::{folder::RunFolder, run_name::Runs};
use crate::cli::scenes::files::threads;
use crate::cli::studies::downstream;
use crate::cli::terminal::{answer::Answer, exit::Failure};
use crate::evidence::RecordedRun;
use crate::evidence::claims::{self, Claims, Judgement};
use crate::kernel::Threads;
use crate::store;

/// The paper's claims, in a clone of this repository.
const CLAIMS: &str = "paper/claims.toml";
/// Bytes that a file of claims may have.
const BYTES_MAX: u64 = 1 << 20;

#[derive(Debug, Args)]
pub struct Options {
    /// File of claims (.toml); a name that ends otherwise is a run.
    #[arg(default_value = CLAIMS)]
    pub file: PathBuf,
    #[command(flatten)]
    pub runs: Runs,
    /// How to write it.
    #[arg(long, default_value = "markdown")]
    pub format: Format,
    /// Tell the claims whose runs each protocol of the file names side by side under these.
    #[arg(long)]
    pub protocols: bool,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum Format {
    Markdown,
    /// One line for each claim and row, numbers unrounded.
    Csv,
}

pub fn run(options: &Options, jobs: usize) -> Result<Answer, Failure> {
    let (file, runs) = match options.file.extension() {
        Some(ending) if ending == "toml" => (options.file.as_path(), options.runs.clone()),
        _ => (Path::new(CLAIMS), options.runs.clone().behind(&options.file)),
    };
    let threads = threads(jobs)?;
    let folders = runs.folders()?;
    let recorded_runs = threads.map(&folders, |_, folder| folder.recorded());
    let with_controls =
        |(folder, run): (&RunFolder, Result<RecordedRun, Failure>)| redraws::with_all(folder, run?, jobs);
    let recorded_runs = folders.iter().zip(recorded_runs).map(with_controls).collect::<Result<Vec<_>, _>>()?;
    if options.protocols {
        let selector = |(folder, run): (&RunFolder, &RecordedRun)| -> Result<(String, SelectorOptions), Failure> {
            Ok((run.opened.name.clone(), folder.read_experiment()?.selector))
        };
        let selectors = folders.iter().zip(&recorded_runs).map(selector).collect::<Result<BTreeMap<_, _>, _>>()?;
        let read = read(file)?;
        if read.protocols.len() < 2 {
            let expected = "[protocols.\"name\"] twice, each with the runs that are meant under it";
            return Err(Failure::bad_input(format!(
                "{}: {} protocols; expected {expected}",
                file.display(),
                read.protocols.len()
            )));
        }
        let all = claims::under_protocols(&read, &recorded_runs, &selectors, &threads).map_err(Failure::bad_input)?;
        return Ok(Answer::new(claims::side_by_side(&all), json!(all)));
    }
    let verdicts = judged(file, &recorded_runs, &threads)?;
    let text = match options.format {
        Format::Markdown => claims::markdown(&verdicts),
        Format::Csv => return Ok(Answer::exact(claims::csv(&verdicts), json!(verdicts))),
    };
    Ok(Answer::new(text, json!(verdicts)))
}

/// The claims of a file.
fn read(file: &Path) -> Result<Claims, Failure> {
    if !file.exists() {
        let expected = "a file of claims; the paper's is paper/claims.toml of a clone of this repository";
        return Err(Failure::bad_input(format!("{}: no such file, expected {expected}", file.display())));
    }
    let bytes = store::read_bounded(file, BYTES_MAX)?;
    let name = file.display().to_string();
    let text = String::from_utf8(bytes)
        .map_err(|_| Failure::bad_input(format!("{name} is not UTF-8 text; expected a TOML file of claims")))?;
    claims::read(&name, &text).map_err(Failure::bad_input)
}

/// The claims of a file, judged by these runs.
pub fn judged(file: &Path, recorded_runs: &[RecordedRun], threads: &Threads) -> Result<Judgement, Failure> {
    let read = read(file)?;
    let mut studies = BTreeMap::new();
    for (name, path) in &read.studies {
        // A study that is not there leaves its claims untested.
        if Path::new(path).exists() {
            studies.insert(name.clone(), downstream::as_recorded(Path::new(path))?);
        }
    }
    claims::judge(&read, recorded_runs, &studies, threads).map_err(Failure::bad_input)
}
