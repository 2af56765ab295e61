//! The tables, figures and named numbers of the paper's plan, each from the runs that it names.

use clap::ValueEnum;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::path::Path;

use crate::cli::look::table::Which as WhichTable;
use crate::cli::look::{credit, figure, table_options};
use crate::cli::scenes::files::threads;
use crate::cli::studies::downstream;
use crate::cli::studies::paper_runs::Ran;
use crate::cli::terminal::exit::Failure;
use crate::draw::{Figure, pdf};
use crate::evidence::credit_table::credits as credits_table;
use crate::evidence::downstream as evidence_downstream;
use crate::evidence::evaluator;
use crate::evidence::paper::{Named, Piece, What, quoted};
use crate::evidence::tables::{self, LatexForm, Table};
use crate::kernel::num;
use crate::store;

/// Bytes that a golden may have.
const BYTES_MAX: u64 = 1 << 26;
/// Word in place of a table for the measures of a run's world evaluator.
const EVALUATOR: &str = "evaluator";

/// A piece's table or figure.
pub enum Sheet {
    Table(Table),
    Figure(Figure),
}

/// Makes a piece of the plan from its runs.
pub fn sheet(piece: &Piece, ran: &Ran, jobs: usize) -> Result<Sheet, Failure> {
    Ok(match piece.what() {
        What::Credit => {
            let (Some((folder, run)), threads) = (ran.shown(piece).pop(), threads(jobs)?) else {
                return Err(Failure::internal(format!("piece {}: its run was not carried out", piece.file)));
            };
            let credits = credit::of_reported(&folder, &run, &threads)?;
            Sheet::Table(credits_table(&run, &credits).map_err(Failure::bad_input)?)
        }
        What::Table(name) => {
            let which = WhichTable::named(&name).map_err(Failure::bad_input)?;
            Sheet::Table(which.of(&ran.of(&piece.runs)).map_err(Failure::bad_input)?)
        }
        What::Downstream { is_table } => {
            let study = piece.study.as_deref().map(Path::new).unwrap_or(Path::new(""));
            let record = downstream::as_recorded(study)?;
            if is_table {
                Sheet::Table(evidence_downstream::table(&record))
            } else {
                Sheet::Figure(evidence_downstream::figure(&record))
            }
        }
        What::Figure(name) => {
            let which = figure::Which::from_str(&name, false).map_err(|_| {
                Failure::bad_input(format!(
                    "piece {}: no figure `{name}`; `evodrive figure --help` lists them",
                    piece.file
                ))
            })?;
            Sheet::Figure(which.of(&ran.shown(piece), &piece.lineages, jobs)?)
        }
    })
}

/// The files of a piece.
pub fn files(piece: &Piece, sheet: &Sheet) -> Result<Vec<(String, Vec<u8>)>, Failure> {
    let named = |ending: &str| format!("{}.{ending}", piece.file);
    Ok(match sheet {
        Sheet::Table(table) => vec![
            (named("md"), tables::markdown(table).into_bytes()),
            (named("csv"), tables::csv(table).into_bytes()),
            (named("tex"), latex_of(piece, table)?.into_bytes()),
        ],
        Sheet::Figure(figure) => {
            let pdf = pdf(figure).map_err(Failure::bad_input)?;
            vec![(named("svg"), figure.svg().into_bytes()), (named("pdf"), pdf)]
        }
    })
}

/// A table with the columns and rows that the plan says, or with what fits a page and all of it beside.
fn latex_of(piece: &Piece, table: &Table) -> Result<String, Failure> {
    let place = format!("piece {}", piece.file);
    let table = table_options::rows(&place, &piece.rows, table.clone())?;
    if piece.columns.is_empty() {
        return Ok(tables::latex(&table, LatexForm { whole: true, paper: false }));
    }
    Ok(tables::latex(&table_options::columns(&place, &piece.columns, table)?, LatexForm::default()))
}

/// Numbers of a table that stands elsewhere.
pub enum Numbers {
    Table(Box<Table>),
    /// By their whole names.
    Read(BTreeMap<String, String>),
}

/// Returns the numbers that the text may name of a table that is no piece.
pub fn named_numbers(named: &Named, ran: &Ran, golden: &Path) -> Result<Numbers, Failure> {
    if let Some(file) = &named.golden {
        return Ok(Numbers::Read(read_numbers(&named.name, file, golden)?));
    }
    let (table, runs) = (named.table.as_deref().unwrap_or_default(), ran.of(&named.runs));
    if table == EVALUATOR {
        let measured = runs.first().map(|run| evaluator::report(run, None).pooled);
        return Ok(Numbers::Read(evaluator_numbers(&named.name, &json!(measured))));
    }
    let which = WhichTable::named(table).map_err(Failure::bad_input)?;
    Ok(Numbers::Table(Box::new(which.of(&runs).map_err(Failure::bad_input)?)))
}

/// Numbers of a page of the goldens, by their whole names.
pub fn read_numbers(name: &str, file: &str, golden: &Path) -> Result<BTreeMap<String, String>, Failure> {
    let bytes = store::read_bounded(&golden.join(file), BYTES_MAX)?;
    Ok(quoted(name, &String::from_utf8_lossy(&bytes)))
}

/// The measures of a world evaluator, each under its own name.
fn evaluator_numbers(name: &str, measured: &Value) -> BTreeMap<String, String> {
    let number = |key: &str, value: &Value| match value.as_f64() {
        Some(whole) if value.is_u64() => Some(num::fixed(whole, 0)),
        Some(value) => Some(num::fixed(value, if key.contains("_pct") { 1 } else { 2 })),
        None => None,
    };
    let fields = measured.as_object().into_iter().flatten();
    fields.filter_map(|(key, value)| Some((format!("{name}:{key}"), number(key, value)?))).collect()
}
