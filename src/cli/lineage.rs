//! `lineage`: how programs descend from each other.

use clap::Args;
use serde_json::json;
use std::path::PathBuf;

use super::answer::Answer;
use super::exit::Failure;
use super::folder::RunFolder;
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
    let story = RunFolder::find(options.run.as_deref())?.story()?;
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
    let text: Vec<String> = wanted.iter().map(|id| lineage_text::chain(&story, id)).collect();
    let lineages: Vec<_> = wanted
        .iter()
        .map(|id| {
            let programs = story.active(id).map(|active| story.chain(active)).unwrap_or_default();
            let patches: Vec<String> = programs.windows(2).map(|pair| program_diff(pair[0], pair[1])).collect();
            json!({"lineage": id, "chain": programs, "patches": patches})
        })
        .collect();
    Ok(Answer::new(text.join("\n"), json!({"lineages": lineages})))
}
