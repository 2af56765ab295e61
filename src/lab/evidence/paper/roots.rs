//! The runs behind the paper with their roots, as a table of LaTeX.

use std::fmt::Write as _;

use crate::evidence::tables::escaped;

/// Hex digits of a root and of a cassette's digest that are printed.
const DIGITS: usize = 16;

/// A run that the paper rests on.
pub struct Root {
    pub experiment: String,
    pub root: String,
    /// Digest of the recorded answers, or why none is kept.
    pub cassette: String,
}

/// A long table with a line a run.
pub fn roots(all: &[Root]) -> String {
    let mut out = String::from(
        "% needs \\usepackage{booktabs,longtable}\n\\begin{longtable}{@{}lll@{}}\n\\toprule\n\
         Experiment & Root & Recorded answers \\\\\n\\midrule\n\\endhead\n\\bottomrule\n\\endfoot\n",
    );
    let short = |text: &str| {
        if text.bytes().all(|b| b.is_ascii_hexdigit()) {
            format!("\\texttt{{{}}}", text.chars().take(DIGITS).collect::<String>())
        } else {
            escaped(text)
        }
    };
    for run in all {
        let _ = writeln!(
            out,
            "\\texttt{{{}}} & {} & {} \\\\",
            escaped(name(&run.experiment)),
            short(&run.root),
            short(&run.cassette)
        );
    }
    out.push_str("\\end{longtable}\n");
    out
}

/// A file below the folder of experiments, without its ending.
fn name(experiment: &str) -> &str {
    experiment.trim_start_matches("experiments/").trim_end_matches(".toml")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_run_has_a_line_with_the_beginning_of_its_root() {
        let run = |cassette: &str| Root {
            experiment: "experiments/a_b.toml".into(),
            root: "0123456789abcdef0123".into(),
            cassette: cassette.into(),
        };
        let text = roots(&[run("ffff"), run("none is kept")]);
        let line = "\\texttt{a\\_b} & \\texttt{0123456789abcdef} &";
        assert!(
            text.contains(&format!("{line} \\texttt{{ffff}} \\\\"))
                && text.contains(&format!("{line} none is kept \\\\")),
            "{text}"
        );
    }
}
