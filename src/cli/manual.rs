//! `completions` and `man`: what a shell and a manual know of the command line, made from the arguments themselves.

use clap::{Args, Command};
use clap_complete::Shell;
use serde_json::json;
use std::path::PathBuf;

use super::answer::Answer;
use super::exit::Failure;
use crate::store;

const NAME: &str = "evodrive";

#[derive(Debug, Args)]
pub struct CompletionsOptions {
    /// The shell.
    pub shell: Shell,
}

#[derive(Debug, Args)]
pub struct ManOptions {
    /// Folder for the pages, one per command.
    #[arg(long)]
    pub out: PathBuf,
}

/// The completions of a shell, on stdout.
pub fn completions(options: &CompletionsOptions, mut command: Command) -> Answer {
    let mut script = Vec::new();
    clap_complete::generate(options.shell, &mut command, NAME, &mut script);
    let script = String::from_utf8_lossy(&script).into_owned();
    let object = json!({"shell": options.shell.to_string(), "script": script});
    Answer::exact(script, object)
}

/// The manual: `evodrive.1`, `evodrive-run.1` ...
pub fn man(options: &ManOptions, mut root: Command) -> Result<Answer, Failure> {
    root.build();
    store::create_dir(&options.out)?;
    let mut pages = Vec::new();
    write(&root, NAME, options, &mut pages)?;
    let text = format!(
        "{} pages in {}; read one by `man {}/{NAME}.1`\n",
        pages.len(),
        options.out.display(),
        options.out.display()
    );
    Ok(Answer::new(text, json!({"pages": pages})))
}

fn write(command: &Command, name: &str, options: &ManOptions, pages: &mut Vec<PathBuf>) -> Result<(), Failure> {
    let mut page = Vec::new();
    clap_mangen::Man::new(command.clone()).render(&mut page).map_err(Failure::internal)?;
    let path = options.out.join(format!("{name}.1"));
    store::write_atomic(&path, &page)?;
    pages.push(path);
    for sub in command.get_subcommands().filter(|sub| sub.get_name() != "help" && !sub.is_hide_set()) {
        write(sub, &format!("{name}-{}", sub.get_name()), options, pages)?;
    }
    Ok(())
}
