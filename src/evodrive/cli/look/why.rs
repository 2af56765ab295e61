//! `why`: from a cell of a table down to what it rests on.

use clap::Args;
use serde_json::json;
use std::collections::BTreeMap;

use crate::cli::look::{rollout, table::Which};
use crate::cli::records::{folder::RunFolder, run_name::Runs};
use crate::cli::terminal::answer::Answer;
use crate::cli::terminal::exit::{Exit, Failure};
use crate::evidence::tables::{Derivations, Source, Table};
use crate::evidence::why::{Places, Why};
use crate::evidence::{RecordedRun, cell};
use crate::kernel::Digest;
use crate::objects::{SolutionId, event::kind};
use crate::sim::timeline_text::sentences;
use crate::store::{self, TextFault};

/// Bytes that a cassette may have.
const CASSETTE_BYTES_MAX: u64 = 1 << 30;

#[derive(Debug, Args)]
#[command(after_help = "Example: evodrive why metadrive-main:cat:evolved_attack --scene synth/urban/500/42")]
pub struct Options {
    /// The cell as TABLE:ROW:COLUMN, e.g. metadrive-main:cat:attack; a row is named by its label (cat/idm), a column
    /// by its heading or its key in CSV.
    pub cell: String,
    #[command(flatten)]
    pub runs: Runs,
    /// The labels of one scene: contact and what led to it, diagnostics, digests of its rollout.
    #[arg(long)]
    pub scene: Option<String>,
    /// One program: its patches back to the parent, reviews, questions and answers.
    #[arg(long)]
    pub attempt: Option<String>,
    /// Every scene and every program.
    #[arg(long)]
    pub full: bool,
}

pub fn run(options: &Options, jobs: usize) -> Result<Answer, Failure> {
    let (table, row, column) = split(&options.cell)?;
    let folders = options.runs.folders()?;
    let runs = folders.iter().map(|folder| table.recorded(folder, jobs)).collect::<Result<Vec<_>, _>>()?;
    let table = table.of(&runs).map_err(Failure::bad_input)?;
    let named = cell::find(&table, row, column).map_err(Failure::bad_input)?;
    let (bases, source) = (Derivations::of(&runs), &named.cell.source);
    let Some(basis) = source.derivation(&bases, &named.row.key).filter(|_| named.cell.ours.is_some()) else {
        let name = cell::cell_name(&table, named.row, &named.cell.column);
        if let (Some(ours), Source::Undivided(rests)) = (named.cell.ours, source) {
            let number = named.cell.column.form.number(ours.value);
            return Err(Failure::bad_input(format!(
                "{name} = {number} has no parts that can be listed one by one: {rests}"
            )));
        }
        let why = if named.row.missing() { "its lineages are missing in these runs" } else { "no label counts for it" };
        let ours: Vec<String> =
            table.rows().filter(|row| row.cells.iter().any(|c| c.ours.is_some())).map(cell::row_name).collect();
        return Err(Failure::bad_input(format!(
            "{name} has no number of ours: {why}; rows that have one: {}",
            ours.join(", ")
        )));
    };
    let places = folders.iter().map(places).collect::<Result<Vec<_>, _>>()?;
    let why = Why { table: &table, named: &named, basis: &basis, bases: &bases, recorded_runs: &runs, places: &places };
    let mut text = match (&options.scene, &options.attempt) {
        (Some(scene), _) => why.scene(scene).ok_or_else(|| no_scene(&runs, scene))?,
        (None, Some(id)) => why.attempt(id).ok_or_else(|| no_attempt(&why, id))?,
        _ if options.full => why.full(),
        _ => why.short(),
    };
    let mut json = why.json();
    if let Some(scene) = &options.scene {
        let timelines = led_to(&folders, &why, scene, jobs)?;
        text += &timelines.iter().map(|(line, _)| line.as_str()).collect::<String>();
        json["timelines"] = timelines.into_iter().map(|(_, object)| object).collect();
    }
    if why.agrees() {
        return Ok(Answer::new(text, json));
    }
    text.push_str(&format!(
        "\nthe table says {}, but its parts give another number: run `evodrive check`\n",
        why.printed()
    ));
    Ok(Answer { exit: Exit::Divergence, ..Answer::new(text, json) })
}

/// Returns what led to each contact in a scene that the cell rests on, as a line and as an object.
fn led_to(
    folders: &[RunFolder],
    why: &Why<'_, '_>,
    scene: &str,
    jobs: usize,
) -> Result<Vec<(String, serde_json::Value)>, Failure> {
    let (contacts, mut lines) = (why.contacts(scene), Vec::new());
    for (at, folder) in folders.iter().enumerate() {
        let own: Vec<(&SolutionId, Digest)> =
            contacts.iter().filter(|(run, ..)| *run == at).map(|(_, solution, record)| (solution, *record)).collect();
        if own.is_empty() {
            continue;
        }
        for ((solution, _), timeline) in own.iter().zip(rollout::timelines(folder, &own, scene, jobs)?) {
            let (said, timeline, reason) = match timeline {
                Ok(Some(timeline)) => (sentences(&timeline), Some(timeline), None),
                Ok(None) => continue,
                Err(reason) => (format!("cannot be told: {reason}"), None, Some(reason)),
            };
            let object = json!({"run": folder.dir, "program": solution, "timeline": timeline, "reason": reason});
            lines.push((format!("  {solution}: what led to the contact: {said}\n"), object));
        }
    }
    Ok(lines)
}

/// Table, row and column of `TABLE:ROW:COLUMN`.
fn split(cell: &str) -> Result<(Which, &str, &str), Failure> {
    let parts = cell.split_once(':').and_then(|(table, rest)| Some((table, rest.rsplit_once(':')?)));
    let Some((table, (row, column))) = parts else {
        return Err(Failure::bad_input(format!("`{cell}`: expected TABLE:ROW:COLUMN, as metadrive-main:cat:attack")));
    };
    Ok((Which::named(table).map_err(Failure::bad_input)?, row, column))
}

fn no_scene(runs: &[RecordedRun], scene: &str) -> Failure {
    let all = runs.iter().flat_map(|run| run.opened.held_out_scenes.iter().chain(&run.opened.evolution_scenes));
    let all: Vec<String> = all.cloned().collect();
    if all.iter().any(|known| known == scene) {
        return Failure::bad_input(format!(
            "the run has the scene `{scene}`, and the cell rests on others: most cells rest on held-out scenes or on evolution \
             scenes alone (--full lists those of this cell)"
        ));
    }
    let hint = cell::near(scene, &all);
    Failure::bad_input(format!(
        "the cell does not rest on a scene `{scene}`{hint} (--full lists those that it rests on)"
    ))
}

fn no_attempt(why: &Why<'_, '_>, id: &str) -> Failure {
    let known = why.attempts();
    let hint = cell::near(id, &known);
    Failure::bad_input(format!("the cell does not rest on a program `{id}`{hint}; it rests on {}", known.join(", ")))
}

/// Finds where attempts and exchanges stand in the files of a run.
fn places(folder: &RunFolder) -> Result<Places, Failure> {
    let mut events = BTreeMap::new();
    store::each_event(&folder.transcript(), &mut |event| {
        if let (kind::ATTEMPT, Some(id)) = (event.kind.as_str(), event.body["id"].as_str()) {
            events.insert(id.to_string(), event.seq);
        }
    })?;
    Ok(Places { events, lines: lines(folder)?, folder: folder.dir.display().to_string() })
}

/// The line of every exchange of a cassette that is there.
fn lines(folder: &RunFolder) -> Result<BTreeMap<Digest, usize>, Failure> {
    let path = folder.cassette();
    if !path.exists() {
        return Ok(BTreeMap::new());
    }
    let damaged = |(expected, found): (String, String)| {
        Failure::corruption(format!("{}: expected {expected}, found {found}; restore the file", path.display()))
    };
    let mut lines = store::text_lines(&path, CASSETTE_BYTES_MAX)?;
    let (mut found, mut at) = (BTreeMap::new(), 0);
    loop {
        at += 1;
        match lines.next_line() {
            Ok(None) => return Ok(found),
            Ok(Some(line)) => found.extend(key_in(&line.bytes).map(|key| (key, at))),
            Err(TextFault::Store(error)) => return Err(error.into()),
            Err(TextFault::Wrong(expected, found)) => return Err(damaged((expected, found))),
        }
    }
}

/// The key of the exchange that stands on a line.
fn key_in(line: &[u8]) -> Option<Digest> {
    let start = line.windows(OPENS.len()).take(1 << 12).position(|w| w == OPENS)? + OPENS.len();
    let hex = std::str::from_utf8(line.get(start..start + 64)?).ok()?;
    serde_json::from_value(hex.into()).ok()
}

/// Text before the key of an exchange.
const OPENS: &[u8] = b"\"exchange\":\"";

/// Every table that these runs give.
pub fn tables(runs: &[RecordedRun]) -> Vec<Table> {
    Which::all().iter().filter_map(|which| which.of(runs).ok()).collect()
}
