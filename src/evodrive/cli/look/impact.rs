//! `impact`: which cells of which tables rest on an object.

use clap::Args;
use std::collections::BTreeMap;

use crate::cli::look::{redraws, why};
use crate::cli::records::{folder::RunFolder, run_name::Runs};
use crate::cli::terminal::{answer::Answer, exit::Failure};
use crate::evidence::impact;
use crate::kernel::Digest;

#[derive(Debug, Args)]
#[command(after_help = "Example: evodrive impact 3f9a12c4")]
pub struct Options {
    /// Digest of a rollout (key or record), program, patch, question, answer or scene, in full or its first digits; or the name of
    /// an attempt or a scene.
    pub object: String,
    #[command(flatten)]
    pub runs: Runs,
    /// Also list the cells that depend on it only because evolution chose something by it.
    #[arg(long)]
    pub full: bool,
}

pub fn run(options: &Options) -> Result<Answer, Failure> {
    let folders = options.runs.folders()?;
    let recorded = |folder: &RunFolder| redraws::with_kept(folder, folder.recorded()?);
    let runs = folders.iter().map(recorded).collect::<Result<Vec<_>, _>>()?;
    let scenes = folders.iter().map(scenes).collect::<Result<Vec<_>, _>>()?;
    let known = impact::things(&runs, &scenes);
    let (name, things) = impact::find(&known, &options.object).map_err(Failure::bad_input)?;
    let tables = why::tables(&runs);
    if tables.is_empty() {
        let dir = folders[0].dir.display();
        return Err(Failure::bad_input(format!(
            "{dir}: no table can be made from these runs; finish them with `evodrive resume`"
        )));
    }
    let touched = impact::impact(&tables, &runs, things);
    let named: Vec<String> = folders.iter().map(|folder| folder.dir.display().to_string()).collect();
    let what = impact::listed(things);
    let text = impact::text(name, &what, &touched, options.full, &named.join(" "));
    Ok(Answer::new(text, impact::json(name, &what, &touched)))
}

/// Ids of a run's scenes by their digests; none where the pool is not there.
fn scenes(folder: &RunFolder) -> Result<BTreeMap<Digest, String>, Failure> {
    if !folder.pool().exists() {
        return Ok(BTreeMap::new());
    }
    let pool = folder.read_pool()?;
    Ok(pool.scenes.iter().map(|scene| (scene.digest(), scene.id.clone())).collect())
}
