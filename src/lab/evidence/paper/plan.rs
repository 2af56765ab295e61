//! The plan of the paper: which runs it needs, and which piece is made from which of them.

use serde::Deserialize;
use std::collections::BTreeSet;

/// The table that is no function of recorded events alone.
const CREDIT: &str = "credit";

/// A plan that cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum PlanError {
    #[error("{file}: {reason}; expected tables [[run]] and [[piece]] as in paper/plan.toml")]
    Unreadable { file: String, reason: String },
    #[error("{file}: piece {piece}: {reason}")]
    Piece { file: String, piece: String, reason: String },
}

/// A run that pieces are made from.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlannedRun {
    /// Its name in the plan.
    pub name: String,
    /// Its experiment file.
    pub experiment: String,
    /// True if it belongs to the short form, which a check can wait for.
    #[serde(default)]
    pub short: bool,
    /// Seconds that it took when nothing was stored yet, and on what; a note for readers.
    #[serde(default)]
    pub wall_time: Option<String>,
}

/// Kind of a piece.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum What {
    /// A table by its name.
    Table(String),
    /// The table of what each patch of a run's reported programs accounts for, which takes rollouts.
    Credit,
    /// A figure by its name.
    Figure(String),
    /// Table or figure of a downstream study.
    Downstream {
        /// The table, not the figure.
        is_table: bool,
    },
}

/// A table or figure of the paper.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Piece {
    /// Name of its files, without ending.
    pub file: String,
    /// Label of the paper's table or figure.
    pub label: String,
    #[serde(default)]
    table: Option<String>,
    #[serde(default)]
    figure: Option<String>,
    /// The lineages that a figure shows.
    #[serde(default)]
    pub lineages: Vec<String>,
    /// Runs by their names in the plan.
    #[serde(default)]
    pub runs: Vec<String>,
    /// File of the downstream study whose table or figure it is, in the place of runs.
    #[serde(default)]
    pub study: Option<String>,
    /// Columns of the table as it stands in the text, by their names in CSV; without them those that fit a page.
    #[serde(default)]
    pub columns: Vec<String>,
    /// Its rows there; without them all.
    #[serde(default)]
    pub rows: Vec<String>,
}

impl Piece {
    /// Returns which table or figure it is.
    pub fn what(&self) -> What {
        match (&self.table, &self.figure) {
            _ if self.study.is_some() => What::Downstream { is_table: self.table.is_some() },
            (Some(table), _) if table == CREDIT => What::Credit,
            (Some(table), _) => What::Table(table.clone()),
            (None, figure) => What::Figure(figure.clone().unwrap_or_default()),
        }
    }
}

/// A table that stands elsewhere and whose numbers the text names.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Named {
    /// Beginning of the names of its numbers.
    pub name: String,
    /// A table by its name, made of these runs.
    #[serde(default)]
    pub table: Option<String>,
    #[serde(default)]
    pub runs: Vec<String>,
    /// Or a Markdown file of the goldens, from which its tables are read.
    #[serde(default)]
    pub golden: Option<String>,
}

/// All of it.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plan {
    #[serde(rename = "run")]
    pub runs: Vec<PlannedRun>,
    #[serde(rename = "piece")]
    pub pieces: Vec<Piece>,
    #[serde(default, rename = "numbers")]
    pub named: Vec<Named>,
}

impl Plan {
    /// The run of that name.
    pub fn run(&self, name: &str) -> Option<&PlannedRun> {
        self.runs.iter().find(|run| run.name == name)
    }

    /// Pieces whose runs all belong to the short form, or all pieces.
    pub fn wanted(&self, short: bool) -> Vec<&Piece> {
        let own = |piece: &&Piece| piece.runs.iter().all(|name| self.run(name).is_some_and(|run| run.short));
        self.pieces.iter().filter(|piece| !short || own(piece)).collect()
    }

    /// Numbers that are read from goldens of other checks: their name, and the file.
    pub fn read_elsewhere(&self) -> impl Iterator<Item = (&str, &str)> {
        self.named.iter().filter_map(|named| Some((named.name.as_str(), named.golden.as_deref()?)))
    }
}

fn known_runs(plan: &Plan, runs: &[String]) -> Result<(), String> {
    let Some(unknown) = runs.iter().find(|name| plan.run(name).is_none()) else { return Ok(()) };
    let known: Vec<&str> = plan.runs.iter().map(|run| run.name.as_str()).collect();
    Err(format!("no run `{unknown}`; there are {}", known.join(", ")))
}

/// The plan of a file's text; `file` is its name for errors.
pub fn plan(file: &str, text: &str) -> Result<Plan, PlanError> {
    let unreadable = |reason: String| PlanError::Unreadable { file: file.to_string(), reason };
    let read: Plan = toml::from_str(text).map_err(|error| unreadable(error.to_string()))?;
    let mut seen = BTreeSet::new();
    if let Some(twice) = read.runs.iter().find(|run| !seen.insert(run.name.as_str())) {
        return Err(unreadable(format!("the run {} is there twice", twice.name)));
    }
    let mut files = BTreeSet::new();
    for piece in &read.pieces {
        let refuse = |reason: String| PlanError::Piece { file: file.to_string(), piece: piece.file.clone(), reason };
        let plain = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-';
        if piece.file.is_empty() || !piece.file.chars().all(plain) {
            return Err(refuse("expected a file name of lower-case letters, digits and `-`".into()));
        }
        if !files.insert(&piece.file) {
            return Err(refuse("its file is there twice".into()));
        }
        if piece.table.is_some() == piece.figure.is_some() {
            return Err(refuse("expected either table or figure".into()));
        }
        if piece.study.is_some() && !piece.runs.is_empty() {
            return Err(refuse("expected either study or runs".into()));
        }
        if piece.what() == What::Credit && piece.runs.len() != 1 {
            return Err(refuse(format!("a table of credit is of one run, found {}", piece.runs.len())));
        }
        known_runs(&read, &piece.runs).map_err(refuse)?;
    }
    for named in &read.named {
        let refuse = |reason: String| PlanError::Piece { file: file.to_string(), piece: named.name.clone(), reason };
        if named.table.is_some() == named.golden.is_some() || named.golden.is_some() != named.runs.is_empty() {
            return Err(refuse("expected either table and runs, or golden".into()));
        }
        if !files.insert(&named.name) {
            return Err(refuse("its name is that of a piece, or there twice".into()));
        }
        known_runs(&read, &named.runs).map_err(refuse)?;
    }
    Ok(read)
}

#[cfg(test)]
mod tests {
    use super::*;

    const FILE: &str = "[[run]]\nname = \"a\"\nexperiment = \"a.toml\"\nshort = true\n[[run]]\nname = \"b\"\nexperiment = \"b.toml\"\n\
                        [[piece]]\nfile = \"one\"\nlabel = \"fig:one\"\nfigure = \"patch-surface\"\nruns = [\"a\"]\n\
                        [[piece]]\nfile = \"two\"\nlabel = \"tab:two\"\ntable = \"proposals\"\nruns = [\"a\", \"b\"]\n\
                        [[numbers]]\nname = \"three\"\ngolden = \"llm/a.md\"\n";

    #[test]
    fn the_short_form_has_the_pieces_whose_runs_are_all_short() {
        let read = plan("plan.toml", FILE).unwrap();
        assert_eq!(read.wanted(true).iter().map(|piece| piece.file.as_str()).collect::<Vec<_>>(), ["one"]);
        assert_eq!(read.wanted(false).len(), 2);
        assert_eq!(read.pieces[1].what(), What::Table("proposals".into()));
    }

    #[test]
    fn what_cannot_be_used_is_refused() {
        for (from, to, expected) in [
            ("runs = [\"a\"]", "runs = [\"c\"]", "no run `c`; there are a, b"),
            ("file = \"two\"", "file = \"one\"", "twice"),
            ("file = \"two\"", "file = \"../two\"", "lower-case"),
            ("table = \"proposals\"\n", "", "either table or figure"),
            ("table = \"proposals\"", "table = \"credit\"", "of one run, found 2"),
            ("short = true", "short = 1", "plan.toml"),
            ("name = \"three\"", "name = \"two\"", "that of a piece"),
            ("golden = \"llm/a.md\"", "table = \"proposals\"", "either table and runs, or golden"),
            ("golden = \"llm/a.md\"", "table = \"proposals\"\nruns = [\"c\"]", "no run `c`"),
        ] {
            let error = plan("plan.toml", &FILE.replacen(from, to, 1)).unwrap_err().to_string();
            assert!(error.contains(expected), "{error}");
        }
    }

    #[test]
    fn the_shipped_plan_can_be_read() {
        assert!(plan("paper/plan.toml", include_str!("../../../../paper/plan.toml")).unwrap().pieces.len() > 8);
    }
}
