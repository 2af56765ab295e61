//! `completions` and `man`: what a shell and a manual know of the command line, made from the arguments themselves.

use clap::{Args, Command};
use clap_complete::Shell;
use serde_json::json;
use std::path::{Path, PathBuf};

use crate::cli::reference::page;
use crate::cli::terminal::output::Output;
use crate::cli::terminal::{answer::Answer, exit::Failure};
use crate::store;

const NAME: &str = "evodrive";

#[derive(Debug, Args)]
pub struct CompletionsOptions {
    /// The shell
    pub shell: Shell,
}

#[derive(Debug, Args)]
pub struct ManOptions {
    /// Folder for the pages, one per command
    #[arg(long, required_unless_present = "markdown")]
    pub out: Option<PathBuf>,
    /// Print one Markdown page with every command: docs/CLI.md
    #[arg(long, conflicts_with = "out")]
    pub markdown: bool,
    #[command(flatten)]
    pub output: Output,
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
    let Some(out) = &options.out else {
        let page = page::page(&root);
        return Ok(Answer::exact(page.clone(), json!({"page": page})));
    };
    root.build();
    store::create_dir(out)?;
    let mut pages = Vec::new();
    write(&root, NAME, out, options.output, &mut pages)?;
    let text = format!("{} pages in {1}; read one by `man {1}/{NAME}.1`\n", pages.len(), out.display());
    Ok(Answer::new(text, json!({"pages": pages})))
}

fn write(command: &Command, name: &str, out: &Path, output: Output, pages: &mut Vec<PathBuf>) -> Result<(), Failure> {
    let mut page = Vec::new();
    clap_mangen::Man::new(command.clone()).render(&mut page).map_err(Failure::internal)?;
    let path = out.join(format!("{name}.1"));
    output.write(&path, &page)?;
    pages.push(path);
    for sub in command.get_subcommands().filter(|sub| sub.get_name() != "help" && !sub.is_hide_set()) {
        write(sub, &format!("{name}-{}", sub.get_name()), out, output, pages)?;
    }
    Ok(())
}
