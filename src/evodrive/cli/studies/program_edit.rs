//! `program edit`: the readable form of a program in an editor, checked when it closes. A text that does not fit is kept.

use clap::Args;
use serde_json::json;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use crate::cli::cluster::worker_process::in_terminal;
use crate::cli::studies::program_hand::{draft_of, provenance};
use crate::cli::terminal::{answer::Answer, exit::Failure};
use crate::experiment::{ProgramFile, ProgramFileError};
use crate::families;
use crate::store::{self, StoreError};

/// First line of a draft: a file without it is nobody's draft, and is not removed.
const HEAD: &str = "# Draft of `evodrive program edit`, which removes it when it has taken the text over.\n";

/// Variables that name an editor, the first that is set first.
const EDITORS: [&str; 2] = ["VISUAL", "EDITOR"];

#[derive(Debug, Args)]
pub struct Options {
    /// Program file, TOML or JSON.
    pub file: PathBuf,
}

pub fn run(options: &Options) -> Result<Answer, Failure> {
    let (path, draft) = (&options.file, draft_of(&options.file));
    let is_toml = ProgramFile::is_toml(&path.to_string_lossy());
    let before =
        if is_toml { text_of(path)? } else { ProgramFile::read(path)?.to_toml().map_err(Failure::bad_input)? };
    let editor = editor(path)?;
    let is_own = store::write_new(&draft, format!("{HEAD}{before}").as_bytes())?
        || store::is_plain_file(&draft)? && text_of(&draft)?.starts_with(HEAD);
    if !is_own {
        let (expected, found) = ("no file, or a draft of this command", "one that does not begin as its drafts do");
        return Err(StoreError::Foreign { path: draft, expected, found }.into());
    }
    let kept = format!(
        "your text is kept in {}; `evodrive program edit {}` goes on with it, and without that file it begins anew",
        draft.display(),
        path.display()
    );
    let command: Vec<String> = editor.into_iter().chain([draft.to_string_lossy().into_owned()]).collect();
    in_terminal(&command).map_err(|reason| Failure::bad_input(format!("{reason}; {kept}")))?;
    let after =
        text_of(&draft).map_err(|failure| Failure { message: format!("{}; {kept}", failure.message), ..failure })?;
    let with_head = after;
    let after = with_head.strip_prefix(HEAD).unwrap_or(&with_head).to_string();
    if after == before {
        store::remove_file(&draft)?;
        return Ok(Answer::new(format!("{}: nothing changed\n", path.display()), json!({"file": path, "changes": []})));
    }
    let name = path.with_extension("toml");
    // Places are told as the draft has them.
    let edited = match ProgramFile::from_toml(&name.to_string_lossy(), &with_head) {
        Ok(edited) => edited,
        Err(error) => return Err(Failure::bad_input(format!("{}\n{kept}", every(&error)))),
    };
    // A file that could not be read before was being repaired: there is nothing to compare with.
    let old = ProgramFile::from_toml(&name.to_string_lossy(), &before).ok();
    let changes = old.map(|old| {
        let sources = families::sources_by_hand();
        sources
            .get(&edited.family)
            .map_or_else(Vec::new, |source| source.contract.changes(&old.program, &edited.program))
    });
    let bytes = if is_toml { after.into_bytes() } else { edited.to_bytes().map_err(Failure::internal)? };
    store::write_atomic(path, &bytes)?;
    store::remove_file(&draft)?;
    let mut text = String::new();
    for change in changes.iter().flatten() {
        let _ = writeln!(text, "{}", change.says);
    }
    let _ = writeln!(text, "{}: {}", path.display(), provenance(&edited));
    let json =
        json!({"file": path, "changes": changes, "program_hash": edited.program_hash, "origins": edited.origins});
    Ok(Answer::new(text, json))
}

/// Every fault on a line of its own.
fn every(error: &ProgramFileError) -> String {
    match error {
        ProgramFileError::Findings { file, findings } => {
            findings.iter().map(|finding| format!("{file}, {finding}")).collect::<Vec<_>>().join("\n")
        }
        other => other.to_string(),
    }
}

fn text_of(path: &Path) -> Result<String, Failure> {
    let bytes = ProgramFile::bytes_of(path)?;
    String::from_utf8(bytes).map_err(|_| Failure::bad_input(format!("{}: is not UTF-8", path.display())))
}

/// The command of the user's editor.
#[allow(clippy::disallowed_methods)]
fn editor(path: &Path) -> Result<Vec<String>, Failure> {
    let set = EDITORS.iter().filter_map(|name| std::env::var(name).ok());
    let mut commands = set.map(|command| command.split_whitespace().map(String::from).collect::<Vec<_>>());
    commands.find(|words| !words.is_empty()).ok_or_else(|| {
        let shown = path.display();
        let by_other_means = if ProgramFile::is_toml(&path.to_string_lossy()) { format!("change {shown} by other means and run `evodrive program check {shown}`") } else { format!(
                "write it as TOML, `evodrive program export {shown} --out {}`, change that and run `evodrive program check` on it",
                path.with_extension("toml").display()
            ) };
        Failure::bad_input(format!(
            "no editor is named: set VISUAL or EDITOR (EDITOR=nano evodrive program edit {shown}); or change one value by \
             `evodrive program set {shown} PLACE VALUE`; or {by_other_means}"
        ))
    })
}
