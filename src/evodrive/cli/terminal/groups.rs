//! The commands in the groups in which `--help` lists them. clap has no groups of subcommands: the list is a part of its template.

use clap::Command;

use crate::evidence::aligned::{LongWord, broken};

/// Each group's title and its commands, in the order in which one comes to need them.
pub const GROUPS: &[(&str, &[&str])] = &[
    ("Evolve", &["init", "plan", "record", "exchange", "ask", "run", "resume", "watch", "check", "verify"]),
    (
        "Look at a run",
        &["report", "show", "lineage", "table", "figure", "why", "credit", "impact", "compare", "diff", "world"],
    ),
    ("Scenes", &["scenes", "calibrate", "program", "apply"]),
    ("Planners", &["suite", "leaderboard", "egos", "transfer", "harden", "policy"]),
    ("Records", &["data", "bundle", "fsck"]),
    ("Studies", &["paper", "claims", "agree", "train", "downstream"]),
    ("Cluster", &["shard", "worker", "bench"]),
    ("Reference", &["options", "families", "formats", "features", "completions", "man", "help"]),
];

/// Column at which a command's words begin in a line.
const INDENT: usize = 15;

/// The command line whose help lists its commands in groups, in lines of at most `width` characters.
pub fn grouped(command: Command, width: usize) -> Command {
    let list = list(&command, width);
    command.help_template(format!(
        "{{about-with-newline}}\n{{usage-heading}} {{usage}}\n\n{list}Options:\n{{options}}{{after-help}}"
    ))
}

fn list(command: &Command, width: usize) -> String {
    let mut out = String::new();
    for (title, names) in GROUPS {
        out.push_str(&format!("{title}:\n"));
        for name in *names {
            let words = broken(&words(command, name), width.saturating_sub(INDENT), LongWord::Whole)
                .join(&format!("\n{:INDENT$}", ""));
            out.push_str(&format!("{:INDENT$}{words}\n", format!("  {name}")));
        }
        out.push('\n');
    }
    out
}

/// Returns what a command does, up to the first pause: the rest stands in its own help.
fn words(command: &Command, name: &str) -> String {
    // clap adds `help` when it reads the arguments.
    let about = match command.find_subcommand(name).and_then(Command::get_about) {
        Some(about) => about.to_string(),
        None => "Print the help of a command".into(),
    };
    let end = about.find([':', ';', '(']).unwrap_or(about.len());
    about[..end].trim_end().to_string()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::args::Arguments;
    use clap::CommandFactory;

    fn help(width: usize) -> String {
        grouped(Arguments::command().term_width(width), width).render_long_help().to_string()
    }

    #[test]
    fn every_command_that_is_shown_stands_in_exactly_one_group() {
        let grouped: Vec<&str> = GROUPS.iter().flat_map(|(_, names)| names.iter().copied()).collect();
        let mut command = Arguments::command();
        command.build();
        let shown: Vec<&str> =
            command.get_subcommands().filter(|sub| !sub.is_hide_set()).map(|sub| sub.get_name()).collect();
        for name in &shown {
            assert_eq!(grouped.iter().filter(|of| *of == name).count(), 1, "{name}");
        }
        assert_eq!(grouped.len(), shown.len(), "a group names what is no command: {grouped:?}");
    }

    #[test]
    fn the_help_lists_the_groups_and_keeps_to_the_width() {
        for width in [60, 80, 100] {
            let text = help(width);
            for (title, names) in GROUPS {
                assert!(text.contains(&format!("\n{title}:\n")), "{title}: {text}");
                assert!(names.iter().all(|name| text.contains(&format!("\n  {name} "))), "{title}: {text}");
            }
            assert!(text.contains("Usage: evodrive") && text.contains("--jobs"), "{text}");
            let wide: Vec<&str> = text.lines().filter(|line| line.chars().count() > width).collect();
            assert!(wide.is_empty(), "{width}: {wide:?}");
        }
    }

    #[test]
    fn a_commands_words_end_at_their_first_pause() {
        let command = Command::new("x").subcommand(Command::new("y").about("Do this, and that; no more (docs/Y.md)."));
        assert_eq!(words(&command, "y"), "Do this, and that");
    }
}
