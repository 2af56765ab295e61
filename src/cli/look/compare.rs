//! `compare`: two runs, lineages or programs beside each other, paired by scene, and what changed in the experiment.

use clap::Args;
use serde::Serialize;
use serde_json::json;
use std::collections::BTreeMap;
use std::path::Path;
use toml::{Table, Value};

use crate::cli::records::{folder::RunFolder, run_name::TwoRuns};
use crate::cli::studies::program;
use crate::cli::terminal::{answer::Answer, exit::Failure, width::table_width};
use crate::evidence::RecordedRun;
use crate::evidence::aligned::Aligned;
use crate::evidence::tables::{Compared, Comparison, Estimate, Paired, STRICT_REALISM, compared};
use crate::experiment::composed;
use crate::objects::SolutionId;
use crate::objects::spelling::nearest;

/// Characters of a value that a line shows.
const SHOWN_CHARS: usize = 60;

/// Below so many scenes a bootstrap over them promises too much.
const FEW_SCENES: usize = 10;

/// What may be compared besides whole runs.
const PARTS: &str = "Two runs, lineages (RUN:cat-idm) or programs (RUN:cat-idm/e0s3, RUN:cat-idm/parent); RUN is a run's folder, its name \
                     below runs/, or the beginning of either";

#[derive(Debug, Args)]
#[command(mut_arg("run", |arg| arg.help(PARTS)))]
pub struct Options {
    #[command(flatten)]
    pub runs: TwoRuns,
}

/// One side: a run, and what of it is meant.
struct Side {
    folder: RunFolder,
    run: RecordedRun,
    /// A lineage or a program; nothing for all lineages.
    part: Option<String>,
}

/// A value of the experiment in both runs.
#[derive(Serialize)]
struct Changed {
    key: String,
    first: Option<String>,
    second: Option<String>,
}

pub fn run(options: &Options) -> Result<Answer, Failure> {
    let [first, second] = options.runs.named()?;
    let (first, second) = (Side::named(&first.to_string_lossy())?, Side::named(&second.to_string_lossy())?);
    let mut rows: Vec<(String, Comparison)> = Vec::new();
    let mut unpaired = Vec::new();
    for (name, one, other) in pairs(&first, &second)? {
        match compared((&first.run, &one), (&second.run, &other)) {
            Some(comparison) => rows.push((name, comparison)),
            None => unpaired.push(format!("{name}: {one} and {other} share no labelled scene")),
        }
    }
    if rows.is_empty() {
        return Err(Failure::bad_input(format!("nothing can be compared: {}", unpaired.join("; "))));
    }
    let changes = changed(&first.folder, &second.folder)?;
    let mut notes = unpaired;
    let [one, other] = [&first.run, &second.run].map(|run| run.opened.attack.clone());
    if one != other {
        // Their difference would look like a number and say nothing.
        rows.iter_mut().for_each(|(_, of)| {
            of.quantities.retain(|row| row.quantity != "attack" && row.quantity != STRICT_REALISM);
        });
        let [one, other] = [one, other].map(|when| when.unwrap_or_else(|| "the protocol's".into()));
        notes.push(format!("attack is left out, because the two runs measure it differently: A's is {one}, B's is {other}; so is strict realism, which rests on \
             the attacks"));
    }
    let few = rows.iter().map(|(_, of)| of.scenes).min().unwrap_or(0);
    if few < FEW_SCENES {
        notes.push(format!(
            "{few} scenes are few: intervals over so few scenes are too narrow, and have no width where all scenes agree"
        ));
    }
    if first.run.opened.pool != second.run.opened.pool {
        notes.push("the pools differ: scenes are paired by their ids, but need not be the same scenes".into());
    }
    let rows_json: Vec<_> = rows.iter().map(|(name, of)| json!({"name": name, "comparison": of})).collect();
    let object = json!({
        "first": first.folder.dir, "second": second.folder.dir, "rows": rows_json, "experiment": changes, "notes": notes,
    });
    Ok(Answer::new(text(&first, &second, &rows, &changes, &notes), object))
}

impl Side {
    fn named(name: &str) -> Result<Side, Failure> {
        let (place, part) = match name.rsplit_once(':') {
            Some((place, part)) if !Path::new(name).is_dir() => (place, Some(part.to_string())),
            _ => (name, None),
        };
        let folder = RunFolder::find(Some(Path::new(place)))?;
        let run = folder.recorded()?;
        Ok(Side { folder, run, part })
    }

    /// Lineages with the program that each is reported by, or the one that is meant.
    fn programs(&self) -> Result<Vec<(String, SolutionId)>, Failure> {
        let finished = || {
            let reason = "is not finished; finish it with `evodrive resume`, or name one of its programs";
            Failure::bad_input(format!("{} {reason}", self.folder.dir.display()))
        };
        let reported = |of: &Self| -> Result<Vec<(String, SolutionId)>, Failure> {
            let result = of.run.result.as_ref().ok_or_else(finished)?;
            Ok(result.lineages.iter().map(|of| (of.lineage.to_string(), of.evolved.solution.clone())).collect())
        };
        let Some(part) = &self.part else { return reported(self) };
        if part.contains('/') {
            let program = program::find(&self.run, part)?;
            return Ok(vec![(part.clone(), program.solution_id.clone())]);
        }
        let all = reported(self)?;
        let known: Vec<&str> = all.iter().map(|(name, _)| name.as_str()).collect();
        let selected = all.iter().find(|(name, _)| name == part).cloned();
        selected.map(|one| vec![one]).ok_or_else(|| {
            let near =
                nearest(part, known.iter().copied()).map_or(String::new(), |near| format!("; did you mean {near}?"));
            let place = self.folder.dir.display();
            Failure::bad_input(format!("{place} has no lineage {part}, expected one of {}{near}", known.join(", ")))
        })
    }
}

/// What is compared with what: the two that are named, or lineages of one name.
fn pairs(first: &Side, second: &Side) -> Result<Vec<(String, SolutionId, SolutionId)>, Failure> {
    let (ours, theirs) = (first.programs()?, second.programs()?);
    if let ([(one, a)], [(other, b)]) = (&ours[..], &theirs[..]) {
        let name = if one == other { one.clone() } else { format!("{one} and {other}") };
        return Ok(vec![(name, a.clone(), b.clone())]);
    }
    let theirs: BTreeMap<String, SolutionId> = theirs.into_iter().collect();
    let names: Vec<String> = theirs.keys().cloned().collect();
    let shared: Vec<_> = ours
        .iter()
        .filter_map(|(name, solution)| Some((name.clone(), solution.clone(), theirs.get(name)?.clone())))
        .collect();
    if shared.is_empty() {
        let ours: Vec<&str> = ours.iter().map(|(name, _)| name.as_str()).collect();
        return Err(Failure::bad_input(format!(
            "no lineage has the same name in both runs: {} in the first, {} in the second; name one of each, RUN:LINEAGE",
            ours.join(", "),
            names.join(", ")
        )));
    }
    Ok(shared)
}

/// Keys of the experiment that differ.
fn changed(first: &RunFolder, second: &RunFolder) -> Result<Vec<Changed>, Failure> {
    let read = |folder: &RunFolder| -> Result<BTreeMap<String, String>, Failure> {
        let mut flat = BTreeMap::new();
        flatten(&composed(&folder.experiment())?.table, "", &mut flat);
        Ok(flat)
    };
    let (old, new) = (read(first)?, read(second)?);
    let keys: std::collections::BTreeSet<&String> = old.keys().chain(new.keys()).collect();
    let row = |key: &String| Changed { key: key.clone(), first: old.get(key).cloned(), second: new.get(key).cloned() };
    Ok(keys.into_iter().map(row).filter(|row| row.first != row.second).collect())
}

fn flatten(table: &Table, above: &str, found: &mut BTreeMap<String, String>) {
    for (key, value) in table {
        let own = if above.is_empty() { key.clone() } else { format!("{above}.{key}") };
        below(value, own, found);
    }
}

fn below(value: &Value, place: String, found: &mut BTreeMap<String, String>) {
    match value {
        Value::Table(table) => flatten(table, &place, found),
        Value::Array(items) if items.iter().any(Value::is_table) => {
            items.iter().enumerate().for_each(|(i, item)| below(item, format!("{place}[{i}]"), found));
        }
        value => drop(found.insert(place, value.to_string())),
    }
}

fn text(first: &Side, second: &Side, rows: &[(String, Comparison)], changes: &[Changed], notes: &[String]) -> String {
    let mut text = format!("A: {}\nB: {}\n", first.folder.dir.display(), second.folder.dir.display());
    for (name, of) in rows {
        let suite = match of.on {
            Paired::HeldOut => "held-out",
            Paired::Evolution => "evolution",
        };
        let left_out = match of.left_out {
            [0, 0] => String::new(),
            [a, b] => format!("; {a} more scenes of A and {b} of B have no counterpart and are left out"),
        };
        text += &format!("\n{name}: A {}, B {}; {} {suite} scenes, paired{left_out}\n", of.first, of.second, of.scenes);
        text += &quantities(of).text(table_width());
    }
    text += "\nin brackets: 95 % bootstrap intervals over scenes\n\
             realism: mean over the scenes that a program acts in; its difference is over the scenes in which both act\n\
             strict realism: the smaller one of that and the mean over the program's successes; the search uses it\n";
    text += match changes.is_empty() {
        true => "\nthe experiments are the same\n",
        false => "\nchanged in the experiment, A -> B:\n",
    };
    for of in changes {
        let [a, b] = [&of.first, &of.second].map(|value| value.as_deref().map_or("nothing".into(), shortened));
        text += &format!("  {}: {a} -> {b}\n", of.key);
    }
    notes.iter().for_each(|note| text += &format!("note: {note}\n"));
    text
}

fn quantities(of: &Comparison) -> Aligned {
    let row = |row: &Compared| {
        let [a, b] = [row.first, row.second].map(|estimate| estimated(estimate, false));
        let fewer = if row.scenes < of.scenes { format!("({} scenes)", row.scenes) } else { String::new() };
        vec![row.quantity.to_string(), a, b, estimated(row.difference, true), fewer]
    };
    let heads = ["", "A", "B", "B - A", ""].map(String::from).to_vec();
    Aligned { indent: 2, labels: 1, words: 1, heads, rows: of.quantities.iter().map(row).collect() }
}

fn estimated(of: Estimate, signed: bool) -> String {
    let number = |x: f64| if signed { format!("{x:+.3}") } else { format!("{x:.3}") };
    match of.interval {
        Some([low, high]) => format!("{} [{}, {}]", number(of.value), number(low), number(high)),
        None => number(of.value),
    }
}

fn shortened(value: &str) -> String {
    match value.char_indices().nth(SHOWN_CHARS) {
        Some((at, _)) => format!("{}...", &value[..at]),
        None => value.to_string(),
    }
}
