//! Commands as somebody would type them: what a message proposes must work when it is copied.

use std::path::Path;

use super::args::{JobArgs, RUNS};
use super::shell::quoted;

/// The command that records what a run lacks, with the options that decide what it asks.
pub fn record_command(args: &JobArgs) -> String {
    let mut words = vec!["evodrive".to_string(), "record".into(), quoted(&args.experiment.to_string_lossy())];
    words.extend(args.set.iter().flat_map(|set| ["--set".into(), quoted(set)]));
    if let Some(cassette) = &args.cassette {
        words.extend(["--cassette".into(), quoted(&cassette.to_string_lossy())]);
    }
    if args.out != Path::new(RUNS) {
        words.extend(["--out".into(), quoted(&args.out.to_string_lossy())]);
    }
    if !args.scenes.is_empty() {
        words.push("--scenes".into());
        words.extend(args.scenes.iter().map(|path| quoted(&path.to_string_lossy())));
    }
    words.join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_proposed_command_has_every_option_that_was_typed_and_survives_a_shell() {
        let plain =
            JobArgs { experiment: "mine.toml".into(), out: RUNS.into(), cassette: None, scenes: vec![], set: vec![] };
        assert_eq!(record_command(&plain), "evodrive record mine.toml");
        let typed = JobArgs {
            experiment: "my file.toml".into(),
            out: "elsewhere".into(),
            cassette: Some("c.jsonl".into()),
            scenes: vec!["a.pool".into(), "it's".into()],
            set: vec!["budget.slots=8".into()],
        };
        let expected = "evodrive record 'my file.toml' --set budget.slots=8 --cassette c.jsonl --out elsewhere --scenes \
                        a.pool 'it'\\''s'";
        assert_eq!(record_command(&typed), expected);
    }
}
