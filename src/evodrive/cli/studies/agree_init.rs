//! `agree init`: the validity study for scenes of a user's own.

use clap::Args;
use serde_json::json;
use std::path::{Path, PathBuf};

use crate::cli::scenes::files;
use crate::cli::terminal::{answer::Answer, exit::Failure};
use crate::experiment::agreement_study;
use crate::store;
use crate::text::counted;

#[derive(Debug, Args)]
pub struct Options {
    /// Name of the study; its files go into a folder of that name.
    #[arg(default_value = "agreement")]
    pub name: String,
    /// Your scenes: a pool, a scenario file or a folder of them.
    #[arg(long)]
    pub scenes: PathBuf,
    /// Family whose published program is compared; several with commas, or repeated.
    #[arg(long, default_value = "cat,king,strive", value_delimiter = ',')]
    pub family: Vec<String>,
}

/// Reads the scenes, so that what cannot be used is said now and the split fits them.
pub fn run(options: &Options, jobs: usize) -> Result<Answer, Failure> {
    let folder = PathBuf::from(&options.name);
    let exists = || Failure::bad_input(format!("{} exists already; name another study", folder.display()));
    if store::is_taken(&folder) {
        return Err(exists());
    }
    let pool = files::read(std::slice::from_ref(&options.scenes), jobs)?;
    let written =
        agreement_study(&options.name, &options.scenes, &seen_from_within(&options.scenes), &pool, &options.family)?;
    store::create_dir(&folder)?;
    for (file, text) in &written {
        if !store::write_new(&folder.join(file), text.as_bytes())? {
            return Err(exists());
        }
    }
    let name = &options.name;
    let text = format!(
        "{} in {name}/; next:\n\
         evodrive record {name}/evodrive.toml     # our own simulator\n\
         evodrive record {name}/metadrive.toml    # MetaDrive, with bridges/metadrive installed: docs/BACKENDS.md\n\
         evodrive agree runs/{name}-evodrive-<..> runs/{name}-metadrive-<..>\n",
        counted(written.len(), "file")
    );
    let files: Vec<PathBuf> = written.iter().map(|(file, _)| folder.join(file)).collect();
    Ok(Answer::new(text, json!({"files": files, "scenes": pool.scenes.len()})))
}

/// A path as a file one folder below the working directory names it.
fn seen_from_within(path: &Path) -> PathBuf {
    if path.is_absolute() { path.to_path_buf() } else { Path::new("..").join(path) }
}
