//! Commands that messages propose, written as the user would type them: each must work when it is copied to a shell.

use std::ffi::OsString;
use std::path::Path;

use crate::cli::terminal::exit::Failure;
use crate::cli::terminal::shell::quoted;

/// The command that was typed, with every option, and another command in its place: what records what a `run` lacks, or runs what a
/// `plan` looked at. `cassette` is the file that it takes where none was typed.
pub fn instead(of: &str, command: &str, cassette: Option<&Path>) -> String {
    in_place(std::env::args_os(), of, command, cassette)
}

/// Refuses what is no text before anything is done: names of files are told, kept in records and proposed in commands.
///
/// # Errors
/// An argument, or the folder in which the program was called, whose bytes are no UTF-8.
pub fn in_utf8(words: &[OsString]) -> Result<(), Failure> {
    let odd = |what: String, found: &std::ffi::OsStr| {
        let remedy = "give the file or folder a name in UTF-8 (mv), and repeat the command";
        Err(Failure::bad_input(format!("{what}: expected UTF-8, found {found:?}; {remedy}")))
    };
    if let Some(place) = words.iter().skip(1).position(|word| word.to_str().is_none()) {
        return odd(format!("argument {}", place + 1), &words[place + 1]);
    }
    match here() {
        Some(folder) if folder.to_str().is_none() => odd("the folder of the command".into(), folder.as_os_str()),
        _ => Ok(()),
    }
}

/// The folder in which the program was called, where it can be told.
#[allow(clippy::disallowed_methods)]
fn here() -> Option<std::path::PathBuf> {
    std::env::current_dir().ok()
}

/// How this program was called.
fn program() -> OsString {
    std::env::args_os().next().unwrap_or_else(|| "evodrive".into())
}

/// The command that goes on with an interrupted run.
pub fn resume_command(folder: &Path) -> String {
    let program = program();
    format!("{} resume {}", quoted(&program.to_string_lossy()), quoted(&folder.to_string_lossy()))
}

/// The command that goes on with a recording and writes it into another cassette.
pub fn resume_into(folder: &Path, cassette: &Path) -> String {
    format!("{} --cassette {}", resume_command(folder), quoted(&cassette.to_string_lossy()))
}

/// The command that says what a cell of a table of this run rests on.
pub fn why_command(cell: &str, folder: &Path) -> String {
    let program = program();
    [&program.to_string_lossy(), "why", cell, &folder.to_string_lossy()].map(quoted).join(" ")
}

/// The command that was typed, with one more word at its end, once.
pub fn again_with(word: &str) -> String {
    let mut words: Vec<String> = std::env::args_os().map(|typed| quoted(&typed.to_string_lossy())).collect();
    if !words.iter().any(|typed| typed == word) {
        words.push(word.into());
    }
    words.join(" ")
}

fn in_place(typed: impl Iterator<Item = OsString>, of: &str, command: &str, cassette: Option<&Path>) -> String {
    let mut words: Vec<String> = typed.map(|word| word.to_string_lossy().into_owned()).collect();
    // No option before the command takes a word for its value that could be called so.
    if let Some(word) = words.iter_mut().skip(1).find(|word| *word == of) {
        *word = command.into();
    }
    words.extend(cassette.into_iter().flat_map(|file| ["--cassette".into(), file.to_string_lossy().into_owned()]));
    words.iter().map(|word| quoted(word)).collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(unix)]
    #[test]
    fn an_argument_that_is_no_text_is_refused_with_its_place() {
        use std::os::unix::ffi::OsStringExt;
        let typed = |last: &[u8]| {
            ["evodrive", "run"].iter().map(OsString::from).chain([OsString::from_vec(last.into())]).collect::<Vec<_>>()
        };
        assert!(in_utf8(&typed("\u{e9}.toml".as_bytes())).is_ok());
        let refused = in_utf8(&typed(b"caf\xe9.toml")).unwrap_err();
        assert!(
            refused.message.starts_with("argument 2: expected UTF-8, found \"caf\\xE9.toml\"; "),
            "{}",
            refused.message
        );
    }

    #[test]
    fn the_proposed_command_has_every_word_that_was_typed_and_survives_a_shell() {
        let proposed = |typed: &[&str]| in_place(typed.iter().map(OsString::from), "run", "record", None);
        assert_eq!(proposed(&["evodrive", "run", "mine.toml"]), "evodrive record mine.toml");
        let typed =
            ["target/release/evodrive", "--jobs", "2", "run", "my file.toml", "--set", "name=run", "--no-report"];
        let expected = "target/release/evodrive --jobs 2 record 'my file.toml' --set name=run --no-report";
        assert_eq!(proposed(&typed), expected);
        assert_eq!(
            proposed(&["evodrive", "run", "run", "--scenes", "it's"]),
            "evodrive record run --scenes 'it'\\''s'"
        );
        let planned = ["evodrive", "plan", "mine.toml", "--set", "seed=3"].iter().map(OsString::from);
        let next = in_place(planned, "plan", "record", Some(Path::new("runs/mine-1.jsonl")));
        assert_eq!(next, "evodrive record mine.toml --set seed=3 --cassette runs/mine-1.jsonl");
    }
}
