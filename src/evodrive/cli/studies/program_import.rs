//! `program import`: SafeBench's and ChatScene's own files of parameters as programs.

use clap::Args;
use serde_json::json;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use crate::cli::studies::program_form::bytes_for;
use crate::cli::studies::program_hand::provenance;
use crate::cli::terminal::output::Output;
use crate::cli::terminal::{answer::Answer, exit::Failure};
use crate::experiment::safebench_files::{Made, Wanted};
use crate::formats::ImportError;
use crate::formats::safebench::parameters::ParameterFile;
use crate::store;

/// Bytes that a file of parameters may have.
const FILE_BYTES_MAX: u64 = 16 << 20;

#[derive(Debug, Args)]
pub struct Options {
    /// A scenario list of SafeBench (scenario_type/human.json, random.json, advsim.json, advtraj.json), control sequences of AdvSim or
    /// AT (many, or one of 100 numbers), or ChatScene's optimised ranges (scenario_1.json to scenario_8.json).
    pub file: PathBuf,
    /// Entry to take from each scenario's entries, or number of the sequence, counted from 0. Without it the whole grid
    /// of a list of parameters, or the first sequence.
    #[arg(long, value_name = "NUMBER")]
    pub take: Option<u32>,
    /// Route whose entries are meant, if those of routes differ; for ChatScene's files 0 without it.
    #[arg(long, value_name = "NUMBER")]
    pub route: Option<u32>,
    /// Method of control sequences: advsim or adv_trajectory.
    #[arg(long)]
    pub method: Option<String>,
    /// Scenario of one sequence, or of ChatScene's file where its name does not say it: 1 to 8.
    #[arg(long, value_name = "NUMBER")]
    pub scenario: Option<usize>,
    /// Folder of the sequences that a list names, a folder a scenario: SafeBench's model_ckpt/advsim.
    #[arg(long, value_name = "FOLDER")]
    pub sequences: Option<PathBuf>,
    /// ChatScene's behaviour, 1 to 5; 1 without it.
    #[arg(long, value_name = "NUMBER")]
    pub behaviour: Option<usize>,
    /// Step of ChatScene's optimisation, 0 to 5; the last without it.
    #[arg(long, value_name = "NUMBER")]
    pub step: Option<usize>,
    /// Program file to write: JSON, or TOML where its name ends in .toml; without it TOML goes to stdout.
    #[arg(long)]
    pub out: Option<PathBuf>,
    #[command(flatten)]
    pub output: Output,
}

pub fn run(options: &Options) -> Result<Answer, Failure> {
    let name = file_name(&options.file);
    let read = parameters(&options.file)?;
    let wanted = Wanted {
        take: options.take,
        route: options.route,
        method: options.method.clone(),
        scenario: options.scenario,
        behaviour: options.behaviour,
        step: options.step,
    };
    let files = |scenario: usize, sequence: &str| sequence_of(options, scenario, sequence);
    let Made { file, notes } = Made::of(&name, read, &wanted, &files).map_err(Failure::bad_input)?;
    let Some(path) = &options.out else {
        let text = file.to_toml().map_err(Failure::bad_input)?;
        return Ok(Answer::exact(text, json!(file)));
    };
    options.output.write(path, &bytes_for(path, &file)?)?;
    let mut text = format!("{}: family {}, {}\n", path.display(), file.family, provenance(&file));
    for note in &notes {
        let _ = writeln!(text, "note: {note}");
    }
    let object = json!({"file": path, "family": file.family, "program_hash": file.program_hash, "digest": file.digest, "notes": notes});
    Ok(Answer::new(text, object))
}

fn file_name(path: &Path) -> String {
    path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned())
}

fn parameters(path: &Path) -> Result<ParameterFile, Failure> {
    let bytes = store::read_bounded(path, FILE_BYTES_MAX)?;
    ParameterFile::read(&file_name(path), &bytes).map_err(Failure::bad_input)
}

/// A sequence that a list names: its own file, `<folder>/<scenario>/<name>`.
fn sequence_of(options: &Options, scenario: usize, name: &str) -> Result<Vec<f64>, ImportError> {
    let list = file_name(&options.file);
    let place = format!("scenario {scenario}");
    let Some(folder) = &options.sequences else {
        let expected = format!("the folder of the sequence files that it names ({name} first)");
        return Err(ImportError::new(
            &list,
            place,
            expected,
            "add --sequences FOLDER, or import the file of sequences itself",
        ));
    };
    // A name that leads out of the folder is none of the benchmark's.
    if file_name(Path::new(name)) != name {
        return Err(ImportError::new(&list, place, "the plain name of a file", "take the benchmark's list"));
    }
    let path = folder.join(scenario.to_string()).join(name);
    let unread = |error: String| {
        ImportError::new(
            &path.display().to_string(),
            "the file",
            format!("a control sequence ({error})"),
            "name another folder with --sequences",
        )
    };
    match parameters(&path).map_err(|failure| unread(failure.message))? {
        ParameterFile::Sequence(values) => Ok(values),
        _ => Err(unread("it holds something else".into())),
    }
}
