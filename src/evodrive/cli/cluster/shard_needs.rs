//! Files that a shard needs besides the study: those of the user's own planner and of programs that answer as models,
//! by digest. They lie beside the run's experiment, and travel with it.

use std::path::{Component, Path, PathBuf};

use crate::backend::DriverOptions;
use crate::cli::records::folder::RunFolder;
use crate::cli::terminal::exit::Failure;
use crate::experiment::{self, Experiment};
use crate::shard::Need;
use crate::store;

/// Bytes that a file of a planner may have.
const FILE_BYTES_MAX: u64 = 4 << 30;

/// Names what a study's shards need, and copies it into the run folder. With a run folder in place of an experiment file nothing is
/// copied: it is there from before.
pub fn gathered(experiment: &Experiment, folder: &RunFolder, asks: bool) -> Result<Vec<Need>, Failure> {
    let to = folder.planner();
    let mut needs = Vec::new();
    let mut need = |key: &str, file: &Path, from: Option<PathBuf>| {
        let (name, at) = (below(key, file)?, to.join(file));
        if let Some(from) = from {
            store::create_dir(at.parent().unwrap_or(&to))?;
            store::copy_program(&from, &at)?;
        }
        let need = Need { digest: store::digest_of_file(&at, FILE_BYTES_MAX)?, file: name };
        if !needs.contains(&need) {
            needs.push(need);
        }
        Ok::<(), Failure>(())
    };
    if let Some(driver) = &experiment.driver {
        let from = driver.folder();
        for file in &driver.files {
            need("driver.files", file, (!from.as_os_str().is_empty()).then(|| from.join(file)))?;
        }
    }
    let used = experiment::asked(experiment);
    for (name, model) in experiment.models.iter().filter(|(name, _)| asks && used.contains(name.as_str())) {
        for file in model.command.iter().flat_map(|command| command.files.iter().flatten()) {
            let from = experiment.beside(file);
            need(&format!("models.{name}.command.files"), file, from.exists().then_some(from))?;
        }
    }
    Ok(needs)
}

/// A needed file by its name from the experiment's folder; only what lies there or below has the same name elsewhere.
fn below(key: &str, file: &Path) -> Result<String, Failure> {
    let plain = file.components().all(|part| matches!(part, Component::Normal(_)));
    match file.to_str().filter(|_| plain) {
        Some(name) => Ok(name.to_string()),
        None => Err(Failure::bad_input(format!(
            "{key} names {}: expected a file in the experiment file's folder or below, so that it can lie so on other machines; copy it there",
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
            "this machine lacks {file}, which the shard needs: expected {} with digest {digest}, found {found}; copy the run folder's `planner` \
             beside the study, or do the shard elsewhere",
            path.display()
        )));
    }
    Ok(())
}

/// Returns the place of a needed file. Its name came with a shard, and may not lead out of the folder.
fn at(folder: &RunFolder, file: &str) -> Result<PathBuf, Failure> {
    below("the shard", Path::new(file)).map(|name| folder.planner().join(name))
}

/// The planner as it is started from there.
pub fn planner(driver: &DriverOptions, folder: &RunFolder) -> Result<DriverOptions, Failure> {
    let folder = std::path::absolute(folder.planner()).map_err(Failure::internal)?;
    Ok(DriverOptions { folder, ..driver.clone() })
}
