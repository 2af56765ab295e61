//! What a shard needs besides the study: the files of a planner of one's own, by digest. They lie beside the run's experiment, and travel
//! with it.

use std::path::{Component, Path, PathBuf};

use crate::backend::DriverOptions;
use crate::cli::records::folder::RunFolder;
use crate::cli::terminal::exit::Failure;
use crate::experiment::Experiment;
use crate::shard::Need;
use crate::store;

/// Bytes that a file of a planner may have.
const FILE_BYTES_MAX: u64 = 4 << 30;

/// Names what a study's shards need, and copies it into the run folder. With a run folder in place of an experiment file nothing is
/// copied: it is there from before.
pub fn gathered(experiment: &Experiment, folder: &RunFolder) -> Result<Vec<Need>, Failure> {
    let Some(driver) = &experiment.driver else { return Ok(Vec::new()) };
    let (from, to) = (driver.folder(), folder.planner());
    let mut needs = Vec::new();
    for file in &driver.files {
        let name = below(file)?;
        let at = to.join(file);
        if !from.as_os_str().is_empty() {
            store::create_dir(at.parent().unwrap_or(&to))?;
            store::copy(&from.join(file), &at)?;
        }
        needs.push(Need { digest: store::digest_of_file(&at, FILE_BYTES_MAX)?, file: name });
    }
    Ok(needs)
}

/// A planner's file by its name from the experiment's folder; only what lies there or below has the same name elsewhere.
fn below(file: &Path) -> Result<String, Failure> {
    let plain = file.components().all(|part| matches!(part, Component::Normal(_)));
    match file.to_str().filter(|_| plain) {
        Some(name) => Ok(name.to_string()),
        None => Err(Failure::bad_input(format!(
            "driver.files names {}: expected a file in the experiment file's folder or below, so that it can lie so on other machines; copy it there",
            file.display()
        ))),
    }
}

/// Refuses a shard of whose needs something is not beside the study here.
pub fn hold(needs: &[Need], folder: &RunFolder) -> Result<(), Failure> {
    for Need { file, digest } in needs {
        let path = at(folder, file)?;
        let found = match store::digest_of_file(&path, FILE_BYTES_MAX) {
            Ok(found) if found == *digest => continue,
            Ok(found) => found.to_hex(),
            Err(_) => "none".into(),
        };
        return Err(Failure::lacking(format!(
            "this machine lacks {file} of the planner: expected {} with digest {digest}, found {found}; copy the run folder's `planner` \
             beside the study, or do the shard elsewhere",
            path.display()
        )));
    }
    Ok(())
}

/// Where a needed file lies. Its name came with a shard, and may not lead out of the folder.
fn at(folder: &RunFolder, file: &str) -> Result<PathBuf, Failure> {
    below(Path::new(file)).map(|name| folder.planner().join(name))
}

/// The planner as it is started from there.
pub fn planner(driver: &DriverOptions, folder: &RunFolder) -> Result<DriverOptions, Failure> {
    let folder = std::path::absolute(folder.planner()).map_err(Failure::internal)?;
    Ok(DriverOptions { folder, ..driver.clone() })
}
