//! A table before it is Markdown, CSV or LaTeX: columns, rows of numbers with the paper's beside them, notes.

use serde::Serialize;
use serde_json::{Map, Value as Json, json};

use super::bootstrap::Estimate;
use crate::kernel::num;

/// How a column's numbers are written, as the paper writes them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// `0.345`
    Rate,
    /// `10.66%`
    Percent,
    /// `+0.035`
    RateChange,
    /// `-6.81pp`
    Points,
    /// `+7.4%`
    Gain,
}

impl Form {
    /// The number as text; a zero has no sign.
    pub fn number(self, value: f64) -> String {
        let (digits, signed, unit) = match self {
            Form::Rate => (3, false, ""),
            Form::Percent => (2, false, "%"),
            Form::RateChange => (3, true, ""),
            Form::Points => (2, true, "pp"),
            Form::Gain => (1, true, "%"),
        };
        let value = num::rounded(value, digits);
        let digits = digits as usize;
        if signed && value != 0.0 { format!("{value:+.digits$}{unit}") } else { format!("{value:.digits$}{unit}") }
    }

    /// `[0.150, 0.550]`, without units: they stand at the value.
    pub fn interval(self, [low, high]: [f64; 2]) -> String {
        let bare = |value| self.number(value).trim_end_matches(['%', 'p']).to_string();
        format!("[{}, {}]", bare(low), bare(high))
    }
}

/// A column of numbers.
#[derive(Clone, Debug, PartialEq)]
pub struct Column {
    /// Name in CSV and JSON.
    pub key: &'static str,
    /// Head over several columns.
    pub group: &'static str,
    pub head: &'static str,
    /// Whether more is better; `None` for plain counts.
    pub upward: Option<bool>,
    pub form: Form,
}

/// A number of ours and the paper's.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Value {
    pub ours: Option<Estimate>,
    pub paper: Option<f64>,
}

/// A generator family, in the policy table against one ego.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    pub method: String,
    /// The ego, or the egos that were averaged over.
    pub policy: String,
    /// Lineages that it rests on; none = missing.
    pub lineages: Vec<String>,
    /// One a column.
    pub values: Vec<Value>,
    pub held_out_scenes: usize,
    pub rollouts: usize,
    pub proposals: String,
    /// What stopped those lineages that show no gain.
    pub notes: Vec<String>,
}

impl Row {
    pub fn missing(&self) -> bool {
        self.lineages.is_empty()
    }

    /// Whether the paper has this row.
    pub fn in_paper(&self) -> bool {
        self.values.iter().any(|value| value.paper.is_some())
    }
}

/// What one run contributed.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RunSource {
    pub name: String,
    pub root: String,
    /// Role -> label of its model.
    pub models: std::collections::BTreeMap<String, String>,
    pub scripted_roles: Vec<String>,
    pub evolution_scenes: usize,
    pub held_out_scenes: usize,
    pub epochs: u32,
    pub attempts: usize,
    pub rollouts: usize,
}

/// A whole table.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    pub name: &'static str,
    pub title: &'static str,
    /// Label of the paper's table.
    pub source: &'static str,
    pub columns: Vec<Column>,
    pub rows: Vec<Row>,
    pub runs: Vec<RunSource>,
    pub notes: Vec<String>,
}

/// Heads of the columns after the numbers.
pub const EVIDENCE_HEADS: [&str; 3] = ["Scenes", "Rollouts", "Proposals"];

impl Table {
    /// As one JSON object.
    pub fn json(&self) -> Json {
        let row = |row: &Row| {
            let values: Map<String, Json> =
                self.columns.iter().zip(&row.values).map(|(c, v)| (c.key.to_string(), json!(v))).collect();
            json!({
                "method": row.method,
                "policy": row.policy,
                "missing": row.missing(),
                "lineages": row.lineages,
                "values": values,
                "held_out_scenes": row.held_out_scenes,
                "rollouts": row.rollouts,
                "proposals": row.proposals,
                "notes": row.notes,
            })
        };
        json!({
            "table": self.name,
            "source": self.source,
            "rows": self.rows.iter().map(row).collect::<Vec<_>>(),
            "runs": self.runs,
            "notes": self.notes,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_written_as_the_paper_writes_them() {
        assert_eq!(Form::Rate.number(0.345), "0.345");
        assert_eq!(Form::Percent.number(10.66), "10.66%");
        assert_eq!(Form::Points.number(-6.81), "-6.81pp");
        assert_eq!(Form::Gain.number(7.4), "+7.4%");
        assert_eq!(Form::RateChange.interval([-0.05, 0.1]), "[-0.050, +0.100]");
        assert_eq!(Form::Points.interval([-0.5, 0.25]), "[-0.50, +0.25]");
    }

    #[test]
    fn a_zero_has_no_sign_however_it_came_about() {
        for zero in [0.0, -0.0, 1e-9, -1e-9] {
            assert_eq!(Form::RateChange.number(zero), "0.000");
            assert_eq!(Form::Gain.number(zero), "0.0%");
        }
    }
}
