//! A table before it is Markdown, CSV or LaTeX: columns, rows of numbers with the paper's beside them, notes.

use serde::Serialize;
use serde_json::{Map, Value as Json, json};
use std::collections::BTreeMap;

use super::basis::{Derivation, estimates};
use super::derivations::{Derivations, Source};
pub use super::form::Form;
use super::key::RowKey;
use super::paper::Figures;
use crate::evidence::recorded_run::Setting;
use crate::statistics::bootstrap::Estimate;

/// A column of numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Column {
    /// Name in CSV and JSON.
    pub key: &'static str,
    /// Head over several columns.
    pub group: &'static str,
    pub head: &'static str,
    /// True if more is better; `None` where neither is, as in plain counts.
    pub upward: Option<bool>,
    pub form: Form,
}

/// A column with what its cells are computed from: their numbers, and what `why` says of them.
pub(super) type Sourced = (Column, Source);

/// The columns themselves.
pub(super) fn heads(columns: &[Sourced]) -> Vec<Column> {
    columns.iter().map(|(column, _)| *column).collect()
}

/// A number of ours and the paper's, in the column that they belong to.
#[derive(Clone, Debug, Serialize)]
pub struct Cell {
    #[serde(skip)]
    pub column: Column,
    #[serde(skip)]
    pub source: Source,
    pub ours: Option<Estimate>,
    pub paper: Option<f64>,
}

/// Numbers of ours by the key of their column; a number that cannot be given is absent.
pub type Numbers = BTreeMap<&'static str, Estimate>;

impl Cell {
    /// A cell for each column of a row: the number that its derivation gives, with the interval that is drawn from it.
    pub(super) fn derived(
        bases: &Derivations<'_>,
        row: &RowKey,
        columns: &[Sourced],
        paper: Option<&Figures>,
    ) -> Vec<Cell> {
        let derivations: Vec<_> = columns.iter().map(|(_, source)| source.derivation(bases, row)).collect();
        let cell = |((column, source), ours): (&Sourced, _)| Cell::new(*column, source, ours, paper);
        columns.iter().zip(estimates(&derivations)).map(cell).collect()
    }

    /// A cell for each column: what these numbers have under its key, of records that are not those of a run.
    pub fn row(columns: &[Column], ours: &Numbers) -> Vec<Cell> {
        columns.iter().map(|of| Cell::new(*of, &Source::ELSEWHERE, ours.get(of.key).copied(), None)).collect()
    }

    pub(super) fn new(column: Column, source: &Source, ours: Option<Estimate>, paper: Option<&Figures>) -> Cell {
        let paper = paper.and_then(|figures| figures.under(column.key));
        Cell { column, source: source.clone(), ours: ours.map(|own| column.form.bounded(own)), paper }
    }
}

/// A column of text or of counts, beside the numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Head {
    /// Name in CSV and JSON.
    pub key: &'static str,
    pub head: &'static str,
}

/// The generator family of a row.
pub const METHOD: Head = Head { key: "method", head: "Method" };
/// The ego, or the egos that were averaged over.
pub const POLICY: Head = Head { key: "policy", head: "Policy" };
/// Distinct rollouts behind a row.
pub const ROLLOUTS: Head = Head { key: "rollouts", head: "Rollouts" };
/// Kinds of the models that proposals came from.
pub const PROPOSALS: Head = Head { key: "proposals", head: "Proposals" };

/// The method of the first row: the recorded scenes without a program.
pub const REPLAY: &str = "Replay (no program)";

/// Numbers of a generator family.
#[derive(Clone, Debug)]
pub struct Row {
    /// Subject of the row.
    pub key: RowKey,
    /// One a label of the table.
    pub labels: Vec<String>,
    /// Lineages that it rests on; none = missing.
    pub lineages: Vec<String>,
    /// One a column of the table, in their order.
    pub cells: Vec<Cell>,
    /// One a count of the table.
    pub counts: Vec<usize>,
    pub proposals: String,
    /// Reasons that stopped the lineages without gain.
    pub notes: Vec<String>,
}

impl Row {
    pub fn missing(&self) -> bool {
        self.lineages.is_empty()
    }

    /// Returns what the number of the column with this key rests on; `None` where there is no number, or no parts of it.
    pub fn derivation(&self, key: &str, bases: &Derivations<'_>) -> Option<Derivation> {
        self.cells.iter().find(|cell| cell.column.key == key)?.source.derivation(bases, &self.key)
    }

    /// Puts a number that no derivation gives under the column with this key.
    pub(super) fn put(&mut self, key: &str, ours: Option<Estimate>) {
        for cell in self.cells.iter_mut().filter(|cell| cell.column.key == key) {
            cell.ours = ours.map(|own| cell.column.form.bounded(own));
        }
    }

    /// The cell of the column with this key.
    #[cfg(test)]
    pub fn cell(&self, key: &str) -> &Cell {
        self.cells.iter().find(|cell| cell.column.key == key).unwrap()
    }

    /// Returns `true` if the paper has this row.
    pub fn in_paper(&self) -> bool {
        self.cells.iter().any(|cell| cell.paper.is_some())
    }
}

/// Contribution of one run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RunSource {
    pub name: String,
    pub root: String,
    /// Role -> label of its model.
    pub models: BTreeMap<String, String>,
    pub scripted_roles: Vec<String>,
    /// The egos of its lineages, each once.
    pub egos: Vec<String>,
    pub setting: Setting,
    /// Number of times that each of its searches was made.
    pub seeds: usize,
    pub evolution_scenes: usize,
    pub held_out_scenes: usize,
    pub epochs: u32,
    pub attempts: usize,
    pub rollouts: usize,
}

/// Rows under one caption.
#[derive(Clone, Debug)]
pub struct Part {
    /// Ending of its LaTeX label.
    pub name: String,
    pub title: String,
    /// Label of the paper's table, where it has one.
    pub source: Option<&'static str>,
    pub rows: Vec<Row>,
}

impl Part {
    /// The rows that are printed: a row of the paper's without one of ours beside it says nothing. A note and the JSON form name them.
    pub fn printed(&self) -> impl Iterator<Item = &Row> {
        self.rows.iter().filter(|row| !row.missing())
    }
}

/// A whole table.
#[derive(Clone, Debug)]
pub struct Table {
    pub name: &'static str,
    /// Text columns before the numbers.
    pub labels: Vec<Head>,
    pub columns: Vec<Column>,
    /// Heads of the counts that the numbers rest on; they follow the numbers.
    pub counts: Vec<Head>,
    pub parts: Vec<Part>,
    pub runs: Vec<RunSource>,
    pub notes: Vec<String>,
}

impl Table {
    /// The parts that are printed: those with a row that is.
    pub fn printed(&self) -> Vec<&Part> {
        self.parts.iter().filter(|part| part.printed().next().is_some()).collect()
    }

    /// Names of the columns of numbers and counts, as CSV has them.
    pub fn keys(&self) -> Vec<&'static str> {
        self.columns.iter().map(|column| column.key).chain(self.counts.iter().map(|count| count.key)).collect()
    }

    /// The same with these columns and counts alone, in the table's order.
    pub fn with(&self, keys: &[&str]) -> Table {
        let mut table = self.clone();
        let is_kept: Vec<bool> = self.counts.iter().map(|count| keys.contains(&count.key)).collect();
        table.columns.retain(|column| keys.contains(&column.key));
        table.counts.retain(|count| keys.contains(&count.key));
        for row in table.parts.iter_mut().flat_map(|part| &mut part.rows) {
            row.cells.retain(|cell| keys.contains(&cell.column.key));
            let mut kept = is_kept.iter();
            row.counts.retain(|_| kept.next().copied().unwrap_or(false));
        }
        table
    }

    /// Returns the names that rows are chosen by: the first label, which several rows may share, and all labels with `/` between.
    pub fn row_names(&self) -> Vec<String> {
        let mut names: Vec<String> = Vec::new();
        for row in self.rows().filter(|row| !row.missing()) {
            names.extend([row.labels[0].clone(), row.labels.join("/")]);
        }
        let mut seen = std::collections::BTreeSet::new();
        names.retain(|name| seen.insert(name.clone()));
        names
    }

    /// The same with these rows alone, in the order of the names.
    pub fn with_rows(&self, names: &[&str]) -> Table {
        let mut table = self.clone();
        let place = |row: &Row| {
            let all = row.labels.join("/");
            names.iter().position(|name| *name == row.labels[0] || *name == all)
        };
        for part in &mut table.parts {
            part.rows.retain(|row| place(row).is_some());
            part.rows.sort_by_key(|row| place(row));
        }
        table
    }

    /// All rows, part after part.
    pub fn rows(&self) -> impl Iterator<Item = &Row> {
        self.parts.iter().flat_map(|part| &part.rows)
    }

    /// Returns the table as one JSON object.
    pub fn json(&self) -> Json {
        let row = |part: &Part, row: &Row| {
            let values: Map<String, Json> =
                row.cells.iter().map(|cell| (cell.column.key.to_string(), json!(cell))).collect();
            let mut object = Map::new();
            object.extend(self.labels.iter().zip(&row.labels).map(|(head, text)| (head.key.to_string(), json!(text))));
            object.extend(self.counts.iter().zip(&row.counts).map(|(head, n)| (head.key.to_string(), json!(n))));
            object.extend([
                ("source".to_string(), json!(part.source)),
                ("missing".to_string(), json!(row.missing())),
                ("lineages".to_string(), json!(row.lineages)),
                ("values".to_string(), Json::Object(values)),
                (PROPOSALS.key.to_string(), json!(row.proposals)),
                ("notes".to_string(), json!(row.notes)),
            ]);
            Json::Object(object)
        };
        let rows: Vec<Json> = self.parts.iter().flat_map(|part| part.rows.iter().map(|r| row(part, r))).collect();
        json!({"table": self.name, "rows": rows, "runs": self.runs, "notes": self.notes})
    }
}
