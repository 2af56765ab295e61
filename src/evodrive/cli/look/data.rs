//! `data`: a recorded run as tables for other programs.

use clap::Args;
use serde_json::json;
use std::path::PathBuf;

use crate::cli::evolve::cost;
use crate::cli::records::folder::{RunFolder, open_store_to_look};
use crate::cli::records::run_name::OneRun;
use crate::cli::terminal::output::Output;
use crate::cli::terminal::{answer::Answer, exit::Failure};
use crate::evidence::data::{Rollout, Sheet, records, sheets};
use crate::kernel::{Digest, Threads};
use crate::store;
use crate::text::counted;

#[derive(Debug, Args)]
pub struct Options {
    #[command(flatten)]
    pub run: OneRun,
    /// Folder for the tables.
    #[arg(long)]
    pub out: PathBuf,
    #[command(flatten)]
    pub output: Output,
}

pub fn run(options: &Options, jobs: usize) -> Result<Answer, Failure> {
    let folder = options.run.folder()?;
    let run = folder.recorded()?;
    let threads = Threads::new(jobs)?;
    let wanted = records(&run);
    let rollouts = rollouts(&folder, &wanted, &threads)?;
    let lacking = wanted.len() - rollouts.len();
    let tables = sheets(&run, &rollouts, cost::kept(&folder).as_ref());
    // Checks come before creation: two runs' tables do not mix.
    tables.iter().flat_map(|table| files(options, table)).try_for_each(|path| options.output.may_be_made(&path))?;
    store::create_dir(&options.out)?;
    let mut text = String::new();
    for table in &tables {
        let [csv, parquet] = files(options, table);
        store::write_atomic(&csv, &table.csv().map_err(Failure::internal)?)?;
        store::write_atomic(&parquet, &table.parquet().map_err(Failure::internal)?)?;
        text.push_str(&format!("{:<11} {:>8} rows: {}\n", table.name, table.rows.len(), table.row));
    }
    if lacking > 0 {
        text.push_str(&format!(
            "no longer in the run's store, and in no table: {}; `evodrive run` simulates again\n",
            counted(lacking, "rollout")
        ));
    }
    text.push_str(&format!(
        "tables as .csv and .parquet in {}; dictionary.csv says what every column means",
        options.out.display()
    ));
    let counts: serde_json::Map<String, serde_json::Value> =
        tables.iter().map(|table| (table.name.to_string(), json!(table.rows.len()))).collect();
    Ok(Answer::new(text, json!({"out": options.out, "rows": counts, "rollouts_lacking": lacking})))
}

fn files(options: &Options, table: &Sheet) -> [PathBuf; 2] {
    ["csv", "parquet"].map(|format| options.out.join(format!("{}.{format}", table.name)))
}

/// The rollout records that the run's store holds.
pub fn rollouts(folder: &RunFolder, wanted: &[Digest], threads: &Threads) -> Result<Vec<(Digest, Rollout)>, Failure> {
    if !folder.store().exists() {
        return Ok(Vec::new());
    }
    let objects = open_store_to_look(&folder.store())?;
    let read = |record: &Digest| -> Result<Option<(Digest, Rollout)>, Failure> {
        if !objects.contains(record) {
            return Ok(None);
        }
        let bytes = objects.get(record)?;
        let damaged = |error| {
            Failure::corruption(format!(
                "rollout record {record}: expected a record, found {error}; `evodrive fsck` says more"
            ))
        };
        Ok(Some((*record, serde_json::from_slice(&bytes).map_err(damaged)?)))
    };
    let records = threads.map(wanted, |_, record| read(record));
    records.into_iter().filter_map(Result::transpose).collect()
}
