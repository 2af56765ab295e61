//! `lineage`: how programs descend from each other.

use clap::Args;
use serde_json::json;
use std::path::PathBuf;

use super::answer::Answer;
use super::exit::Failure;
use super::folder::RunFolder;
use crate::evidence::choice::Choice;
use crate::evidence::lineage_text;
use crate::experiment::did_you_mean;
use crate::objects::{LineageId, program_diff};

#[derive(Debug, Args)]
pub struct Options {
    /// Lineage, e.g. cat-idm; without it all.
    pub lineage: Option<String>,
    /// Run folder; without it the latest one below runs/.
    #[arg(long)]
    pub run: Option<PathBuf>,
}

pub fn run(options: &Options) -> Result<Answer, Failure> {
    let folder = RunFolder::find(options.run.as_deref())?;
    let story = folder.story()?;
    let selector = folder.read_experiment()?.selector;
    let choice = |id: &LineageId| Choice::of(&story, id, &selector);
    let all: Vec<LineageId> = story.parents.iter().map(|p| p.lineage.clone()).collect();
    let wanted = match &options.lineage {
        None => all,
        Some(name) => match all.iter().find(|id| id.as_str() == name) {
            Some(id) => vec![id.clone()],
            None => {
                let known: Vec<String> = all.iter().map(LineageId::to_string).collect();
                return Err(Failure::bad_input(format!(
                    "no lineage `{name}` in this run; there are {}{}",
                    known.join(", "),
                    did_you_mean(name, &known)
                )));
            }
        },
    };
    let told = |id: &LineageId| {
        let chosen = choice(id).map_or(String::new(), |choice| format!("\n{}", choice.text()));
        format!("{}{chosen}", lineage_text::chain(&story, id))
    };
    let text: Vec<String> = wanted.iter().map(told).collect();
    let lineages: Vec<_> = wanted
        .iter()
        .map(|id| {
            let programs = story.active(id).map(|active| story.chain(active)).unwrap_or_default();
            let patches: Vec<String> = programs.windows(2).map(|pair| program_diff(pair[0], pair[1])).collect();
            json!({"lineage": id, "chain": programs, "patches": patches, "choice": choice(id)})
        })
        .collect();
    Ok(Answer::new(text.join("\n"), json!({"lineages": lineages})))
}
