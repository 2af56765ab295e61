//! `lineage`: how programs descend from each other.

use clap::Args;
use serde_json::json;
use std::path::Path;

use crate::cli::records::folder::RunFolder;
use crate::cli::records::run_name::{self, OneRun};
use crate::cli::studies::packed;
use crate::cli::terminal::{
    answer::Answer,
    exit::Failure,
    width::{stdout_width, table_width},
};
use crate::evidence::choice::Choice;
use crate::evidence::{RecordedRun, lineage_text};
use crate::experiment::did_you_mean;
use crate::objects::{LineageId, SolutionId, program_diff};

#[derive(Debug, Args)]
pub struct Options {
    /// Lineage, e.g. cat-idm, or one of its programs, e.g. cat-idm/e1s0, whose ancestors are shown; without it all lineages.
    pub lineage: Option<String>,
    #[command(flatten)]
    pub run: OneRun,
}

/// A lineage, and the program to which its chain is shown.
type Shown = (LineageId, SolutionId);

pub fn run(options: &Options) -> Result<Answer, Failure> {
    let (folder, name) = meant(options)?;
    let run = folder.recorded()?;
    let selector = folder.read_experiment()?.selector;
    // Why a program was chosen is said where the chain ends at the chosen one.
    let choice = |(id, last): &Shown| (run.active(id) == Some(last)).then(|| Choice::of(&run, id, &selector)).flatten();
    let wanted = match name {
        None => all(&run),
        Some(name) => vec![named(&run, name)?],
    };
    let shown = |shown: &Shown| {
        let chosen = choice(shown).map_or(String::new(), |choice| format!("\n{}", choice.text(table_width())));
        format!("{}{chosen}", lineage_text::chain(&run, &shown.0, &shown.1, stdout_width()))
    };
    let text: Vec<String> = wanted.iter().map(shown).collect();
    let lineages: Vec<_> = wanted
        .iter()
        .map(|shown| {
            let programs = run.chain(&shown.1);
            let patches: Vec<String> = programs.windows(2).map(|pair| program_diff(pair[0], pair[1])).collect();
            json!({"lineage": shown.0, "chain": programs, "patches": patches, "choice": choice(shown)})
        })
        .collect();
    Ok(Answer::new(text.join("\n"), json!({"lineages": lineages})))
}

/// The run and what of it is meant. A single word that is a run folder, or the whole name of one, is the run.
fn meant(options: &Options) -> Result<(RunFolder, Option<&str>), Failure> {
    let name = options.lineage.as_deref();
    if let (Some(word), None) = (name, options.run.named())
        && let Some(folder) = run_name::whole(Path::new(word))
    {
        return Ok((folder, None));
    }
    Ok((options.run.folder()?, name))
}

/// Every lineage up to its active program.
fn all(run: &RecordedRun) -> Vec<Shown> {
    let active = |id: &LineageId| Some((id.clone(), run.active(id)?.clone()));
    run.parents.iter().filter_map(|parent| active(&parent.lineage)).collect()
}

/// The lineage of that name up to its active program, or the program of that name.
fn named(run: &RecordedRun, name: &str) -> Result<Shown, Failure> {
    if let Some(shown) = all(run).into_iter().find(|(id, _)| id.as_str().eq_ignore_ascii_case(name)) {
        return Ok(shown);
    }
    let known = || all(run).into_iter().map(|(id, _)| id.to_string()).collect::<Vec<_>>();
    match name.split_once('/') {
        Some((lineage, _)) if known().iter().any(|id| id == lineage) => {
            let program = packed::find(run, name)?;
            Ok((program.lineage_id.clone(), program.solution_id.clone()))
        }
        _ => {
            let (all, near) = (known().join(", "), did_you_mean(name, &known()));
            Err(Failure::bad_input(format!("no lineage `{name}` in this run; there are {all}{near}")))
        }
    }
}
