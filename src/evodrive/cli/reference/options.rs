//! `options`: the reference of experiment files, as `docs/EXPERIMENT.md` and `docs/experiment.schema.json` hold it.

use clap::Args;
use serde_json::json;

use crate::cli::terminal::{answer::Answer, exit::Failure, width::stdout_width};
use crate::experiment;

#[derive(Debug, Args)]
pub struct Options {
    /// Print a JSON Schema of experiment files instead, for editors that complete and check TOML (docs/EXPERIMENT.md).
    #[arg(long)]
    pub schema: bool,
}

pub fn run(options: &Options) -> Result<Answer, Failure> {
    if options.schema {
        let schema = experiment::schema();
        let text = serde_json::to_string_pretty(&schema).map_err(Failure::internal)? + "\n";
        return Ok(Answer::new(text, schema));
    }
    let page = experiment::page();
    // The page is Markdown, whose tables are wider than any terminal.
    let text = if stdout_width().is_some() { experiment::listing() } else { page.clone() };
    Ok(Answer::new(text, json!({"page": page})))
}

#[cfg(test)]
mod tests {
    use crate::cli::terminal::width::wrapped;
    use crate::experiment;

    #[test]
    fn the_keys_fit_a_terminal_of_80_columns_and_none_is_lost() {
        let shown = wrapped(&experiment::listing(), 80);
        let wide: Vec<&str> = shown.lines().filter(|line| line.chars().count() > 80).collect();
        assert!(wide.is_empty(), "{wide:#?}");
        let keys = experiment::page().lines().filter(|line| line.starts_with("|`")).count();
        let heads = shown.lines().filter(|line| line.starts_with("  ") && !line.starts_with("   "));
        assert_eq!(heads.count(), keys);
    }
}
