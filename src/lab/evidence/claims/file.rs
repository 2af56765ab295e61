//! The file of claims.

use serde::Deserialize;
use std::collections::{BTreeMap, BTreeSet};

use super::measure;
use crate::evidence::tables;

/// The table of a downstream study.
const DOWNSTREAM: &str = "downstream";

/// A file of claims that cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum ClaimsError {
    #[error("{file}: {reason}; expected `level`, a table [runs] and tables [[claim]] as in paper/claims.toml")]
    Unreadable { file: String, reason: String },
    #[error("{file}: claim {id}: {reason}")]
    Claim { file: String, id: String, reason: String },
    #[error("{0}")]
    Table(#[from] tables::TableError),
}

/// Side of its threshold on which a statistic is claimed to lie.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Direction {
    /// Larger than the threshold.
    Above,
    /// Smaller.
    Below,
}

/// One claim of the paper.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Claim {
    /// Its name here.
    pub id: String,
    /// Label of the place where the paper says it.
    pub label: String,
    /// Text of the claim, in our words.
    pub text: String,
    /// Name of the file's run that it is asked of.
    #[serde(default)]
    pub run: Option<String>,
    /// Or name of the file's downstream study, whose table is `downstream`.
    #[serde(default)]
    pub study: Option<String>,
    /// A table of ours and the key of its column.
    #[serde(default)]
    pub table: Option<String>,
    #[serde(default)]
    pub column: Option<String>,
    /// Rows by their first label, or by both, `CAT / RL`; none named: all that the paper has.
    #[serde(default)]
    pub rows: Vec<String>,
    /// A count over lineages, in the place of a table.
    #[serde(default)]
    pub measure: Option<String>,
    /// Source families that the measure counts; none named: all.
    #[serde(default)]
    pub families: Vec<String>,
    #[serde(default)]
    pub direction: Option<Direction>,
    #[serde(default)]
    pub threshold: Option<f64>,
    /// Reason why it cannot be asked, where nothing here could answer it.
    #[serde(default)]
    pub not_testable: Option<String>,
}

/// Experiments that a name of the file stands for.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(untagged)]
pub enum Named {
    One(String),
    /// Such as one an ego, over which the paper's tables average.
    Several(Vec<String>),
}

impl Named {
    /// Names of the experiments.
    pub fn experiments(&self) -> &[String] {
        match self {
            Named::One(name) => std::slice::from_ref(name),
            Named::Several(names) => names,
        }
    }
}

/// A file of claims.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Claims {
    /// Level of the tests together.
    pub level: f64,
    /// Name in this file -> name of the experiment whose run is meant, or of several that answer together.
    pub runs: BTreeMap<String, Named>,
    /// Protocol -> the runs that are meant under it, by the same names: claims are told side by side under these.
    #[serde(default)]
    pub protocols: BTreeMap<String, BTreeMap<String, Named>>,
    /// Name in this file -> file of the downstream study that is meant.
    #[serde(default)]
    pub studies: BTreeMap<String, String>,
    #[serde(rename = "claim")]
    pub claims: Vec<Claim>,
}

/// The claims of a file's text; `file` is its name for errors.
pub fn read(file: &str, text: &str) -> Result<Claims, ClaimsError> {
    let unreadable = |reason: String| ClaimsError::Unreadable { file: file.to_string(), reason };
    let read: Claims = toml::from_str(text).map_err(|error| unreadable(error.to_string()))?;
    if !(read.level > 0.0 && read.level < 1.0) {
        return Err(unreadable(format!("level is {}, expected more than 0 and less than 1", read.level)));
    }
    if let Some((name, _)) = read.runs.iter().find(|(_, named)| named.experiments().is_empty()) {
        return Err(unreadable(format!("runs.{name} names no experiment")));
    }
    for (protocol, named) in &read.protocols {
        if let Some(unknown) = named.keys().find(|name| !read.runs.contains_key(*name)) {
            return Err(unreadable(format!("protocols.{protocol:?}.{unknown}: [runs] has no `{unknown}`")));
        }
    }
    let mut seen = BTreeSet::new();
    for claim in &read.claims {
        let refuse = |reason: String| ClaimsError::Claim { file: file.to_string(), id: claim.id.clone(), reason };
        if !seen.insert(&claim.id) {
            return Err(refuse("its id is there twice".into()));
        }
        check(claim).map_err(refuse)?;
    }
    Ok(read)
}

fn check(claim: &Claim) -> Result<(), String> {
    let asked = claim.table.is_some() || claim.measure.is_some();
    if claim.not_testable.is_some() {
        return if asked { Err("expected either not_testable or a table or measure".into()) } else { Ok(()) };
    }
    match (&claim.table, &claim.column, &claim.measure) {
        (Some(table), Some(_), None) if claim.study.is_some() => {
            if table != DOWNSTREAM {
                return Err(format!("a study has no table `{table}`; expected {DOWNSTREAM}"));
            }
        }
        (Some(table), Some(_), None) => {
            let known: Vec<&str> = tables::NAMED.iter().map(|(name, _)| *name).collect();
            if !known.contains(&table.as_str()) {
                return Err(format!("no table `{table}`; there are {}", known.join(", ")));
            }
        }
        (None, None, Some(name)) if measure::known(name) => {}
        (None, None, Some(name)) => return Err(format!("no measure `{name}`; there are {}", measure::names())),
        _ => return Err("expected table and column, or measure, or not_testable".into()),
    }
    let whole = claim.run.is_some() != claim.study.is_some()
        && claim.direction.is_some()
        && claim.threshold.is_some_and(f64::is_finite);
    if whole { Ok(()) } else { Err("expected run or study, direction and a finite threshold".into()) }
}
