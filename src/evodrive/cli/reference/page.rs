//! The page docs/CLI.md: every command with its arguments, in the groups of `--help`, made from the arguments themselves.

use clap::{Arg, Command};
use std::fmt::Write;

use crate::cli::terminal::groups::GROUPS;

const HEAD: &str = "# Commands

Look up here what a command takes. This page is made from the program's arguments by `evodrive man --markdown`; \
`evodrive COMMAND --help` says the same.

Every command takes `--json` (the answer as JSON) and `--jobs N` (threads; results do not depend on it).
";

/// Arguments that every command takes, and clap's own.
const COMMON: [&str; 4] = ["json", "jobs", "help", "version"];

/// The page in Markdown.
pub fn page(root: &Command) -> String {
    let mut root = root.clone();
    root.build();
    let mut out = HEAD.to_string();
    for (title, names) in GROUPS {
        let _ = write!(out, "\n## {title}\n");
        for command in names.iter().filter_map(|name| root.find_subcommand(name)) {
            if command.get_name() != "help" {
                section(&mut out, command, "evodrive", "###");
            }
        }
    }
    out
}

fn section(out: &mut String, command: &Command, above: &str, level: &str) {
    let name = format!("{above} {}", command.get_name());
    let _ = write!(out, "\n{level} {}\n", name.trim_start_matches("evodrive "));
    if let Some(about) = command.get_about() {
        let _ = write!(out, "\n{}\n", sentence(&about.to_string()));
    }
    let positional: String = command.get_positionals().map(|arg| format!(" {}", operand(arg))).collect();
    let subcommand = if command.has_subcommands() { " COMMAND" } else { "" };
    let _ = write!(out, "\n`{name}{positional}{subcommand}`\n");
    let rows: Vec<String> = command
        .get_arguments()
        .filter(|arg| !arg.is_hide_set() && !COMMON.contains(&arg.get_id().as_str()))
        .map(row)
        .collect();
    if !rows.is_empty() {
        let _ = write!(out, "\n| argument | what it says |\n|---|---|\n{}", rows.concat());
    }
    for sub in command.get_subcommands().filter(|sub| sub.get_name() != "help" && !sub.is_hide_set()) {
        section(out, sub, &name, "####");
    }
}

fn row(arg: &Arg) -> String {
    let mut help = arg.get_help().map(|help| sentence(&help.to_string())).unwrap_or_default();
    let known: Vec<String> = arg
        .get_possible_values()
        .iter()
        .filter(|value| !value.is_hide_set())
        .map(|value| format!("`{}`", value.get_name()))
        .collect();
    if takes_value(arg) && !known.is_empty() && known.len() <= 16 {
        let _ = write!(help, " One of {}.", known.join(", "));
    }
    let default: Vec<String> = arg.get_default_values().iter().map(|value| value.to_string_lossy().into()).collect();
    if takes_value(arg) && !default.is_empty() {
        let _ = write!(help, " Default: `{}`.", default.join(" "));
    }
    format!("| `{}` | {} |\n", spelled(arg), help.replace('|', "\\|"))
}

/// An argument as one types it.
fn spelled(arg: &Arg) -> String {
    let value = if takes_value(arg) { format!(" {}", value(arg)) } else { String::new() };
    match (arg.get_short(), arg.get_long()) {
        (Some(short), Some(long)) => format!("-{short}{value}, --{long}{value}"),
        (None, Some(long)) => format!("--{long}{value}"),
        (Some(short), None) => format!("-{short}{value}"),
        (None, None) => operand(arg),
    }
    // A bar would end the cell of the table.
    .replace('|', "\\|")
}

fn operand(arg: &Arg) -> String {
    let more = if arg.get_action().takes_values() && arg.get_num_args().is_some_and(|n| n.max_values() > 1) {
        "..."
    } else {
        ""
    };
    let name = format!("{}{more}", value(arg));
    if arg.is_required_set() { name } else { format!("[{name}]") }
}

fn value(arg: &Arg) -> String {
    let names: Vec<&str> = arg.get_value_names().unwrap_or_default().iter().map(|name| name.as_str()).collect();
    if names.is_empty() { arg.get_id().as_str().to_uppercase() } else { names.join(" ") }
}

fn takes_value(arg: &Arg) -> bool {
    arg.get_action().takes_values()
}

/// A text of the arguments, which end without a full stop.
fn sentence(text: &str) -> String {
    let text = text.split_whitespace().collect::<Vec<_>>().join(" ");
    if text.is_empty() || text.ends_with(['.', ':', '!', '?']) { text } else { format!("{text}.") }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::args::Arguments;
    use clap::CommandFactory;

    #[test]
    fn the_page_of_commands_is_that_of_this_program() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/docs/CLI.md");
        let written = std::fs::read_to_string(path).unwrap_or_default();
        let made = page(&Arguments::command());
        assert!(written == made, "make docs/CLI.md anew: cargo run -- man --markdown > docs/CLI.md");
    }

    #[test]
    fn every_command_and_every_argument_that_is_shown_stands_on_the_page() {
        let (root, page) = (Arguments::command(), page(&Arguments::command()));
        for command in root.get_subcommands().filter(|command| !command.is_hide_set()) {
            assert!(page.contains(&format!("\n### {}\n", command.get_name())), "{}", command.get_name());
            for long in command.get_arguments().filter(|arg| !arg.is_hide_set()).filter_map(Arg::get_long) {
                assert!(page.contains(&format!("--{long}")), "{} --{long}", command.get_name());
            }
        }
    }
}
