//! `init`: a short experiment file to begin with.

use clap::Args;
use serde_json::json;
use std::convert::Infallible;
use std::path::{Path, PathBuf};

use crate::cli::scenes::files;
use crate::cli::scenes::recorded_crash::{self, RecordedCrash};
use crate::cli::studies::program_hand::provenance;
use crate::cli::terminal::{answer::Answer, exit::Failure};
use crate::experiment::{PlannerFile, ProgramFile, Started, Starter, family_named, starter};
use crate::store;

#[derive(Debug, Args)]
pub struct Options {
    /// Name of the experiment; its file is NAME.toml in the working directory.
    #[arg(default_value = "experiment")]
    pub name: String,
    /// Your scenes: a pool, a scenario file or a folder of them. Without it scenes are generated.
    #[arg(long)]
    pub scenes: Option<PathBuf>,
    /// Generator family to evolve; several with commas, or repeated. Each becomes a lineage.
    #[arg(long, default_value = "cat", value_delimiter = ',', value_parser = family)]
    pub family: Vec<String>,
    /// Every family of the same protocol: with `--family human` those of SafeBench.
    #[arg(long)]
    pub all: bool,
    /// Program file from which evolution starts, in place of the published parent of a family.
    #[arg(long, conflicts_with_all = ["family", "all"])]
    pub start: Option<PathBuf>,
    /// Epochs; 4 without it.
    #[arg(long)]
    pub epochs: Option<i64>,
    /// Proposals of an epoch; 6 without it.
    #[arg(long)]
    pub slots: Option<i64>,
    /// Number of scenes that stay closed until evolution is over; without it a fifth, and at least 20 if half of the scenes are that many.
    #[arg(long)]
    pub held_out: Option<usize>,
    /// Your planner as the ego under test: a program, or a .py file with the helper evodrive_driver.py beside it.
    /// Without it the ego is IDM.
    #[arg(long)]
    pub driver: Option<PathBuf>,
    /// Ego under test: idm, pdm, frenet, or learned, which is ChatScene's published SAC for SafeBench's families and ours for the others.
    #[arg(long, default_value = "idm", value_parser = ["idm", "pdm", "frenet", "learned"], conflicts_with = "driver")]
    pub ego: String,
}

/// A family as it is typed; whether there is one of that name is asked when the file is written.
fn family(word: &str) -> Result<String, Infallible> {
    Ok(family_named(word))
}

/// Reads the scenes, so that unusable ones are reported now and the split fits them.
pub fn run(options: &Options, jobs: usize) -> Result<Answer, Failure> {
    let path = PathBuf::from(format!("{}.toml", options.name));
    if store::is_taken(&path) {
        return Err(exists(&path));
    }
    let read = |path: &PathBuf| Ok::<_, Failure>((path.clone(), files::read(std::slice::from_ref(path), jobs)?));
    let scenes = options.scenes.as_ref().map(read).transpose()?;
    let driver = options.driver.as_deref().map(PlannerFile::named).transpose()?;
    let start = options.start.as_deref().map(ProgramFile::read).transpose()?;
    let begun = Starter {
        name: options.name.clone(),
        families: start.as_ref().map_or_else(|| options.family.clone(), |start| vec![start.family.to_string()]),
        start: options.start.clone(),
        all: options.all,
        scenes,
        driver,
        ego: options.ego.clone(),
        epochs: options.epochs,
        slots: options.slots,
        held_out: options.held_out,
    };
    let Started { text, shows, few } = starter(&begun)?;
    let crashes = crashes(&begun, jobs)?;
    if !store::write_new(&path, text.as_bytes())? {
        return Err(exists(&path));
    }
    let shown = path.display();
    // The file says it in a comment; who does not open it is to know it all the same.
    let said: String = start
        .iter()
        .map(|start| format!("it starts from {}", provenance(start)))
        .chain([shows])
        .chain(few.clone())
        .chain(crashes.1)
        .map(|line| format!("{line}\n"))
        .collect();
    let next = format!(
        "evodrive record {shown}   # asks the models that it names and writes {}.jsonl\nevodrive run {shown}      # replays it: same root",
        options.name
    );
    let object = json!({"experiment": path, "text": text, "few": few, "recorded_crashes": crashes.0});
    Ok(Answer::new(format!("{text}\n{said}\nwritten to {shown}; next:\n{next}\n"), object))
}

fn exists(path: &Path) -> Failure {
    Failure::bad_input(format!("{} exists already; name another experiment", path.display()))
}

/// Scenes of the user's whose recorded ego itself crashes, and the lines that say so.
fn crashes(begun: &Starter, jobs: usize) -> Result<(Vec<RecordedCrash>, Vec<String>), Failure> {
    let Some((path, pool)) = &begun.scenes else { return Ok(Default::default()) };
    let crashes = recorded_crash::of_pool(&pool.scenes, &files::threads(jobs)?);
    let lines = recorded_crash::lines(&crashes, pool.scenes.len(), std::slice::from_ref(path));
    Ok((crashes, lines))
}
