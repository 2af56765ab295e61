//! `compare`: two runs, lineages or programs beside each other, paired by scene, and what changed in the experiment.

use clap::Args;
use serde::Serialize;
use serde_json::json;
use std::collections::BTreeMap;
use toml::{Table, Value};

use crate::cli::look::compared_pairs::{Pairs, Side, pairs};
use crate::cli::records::{folder::RunFolder, run_name::TwoRuns};
use crate::cli::terminal::{answer::Answer, exit::Failure, width::table_width};
use crate::evidence::aligned::Aligned;
use crate::evidence::tables::{
    AllAlike, Compared, Comparison, Estimate, Paired, Pooled, STRICT_REALISM, compared, one_seed, pooled,
};
use crate::experiment::composed;
use crate::kernel::num;
use crate::objects::SolutionId;
use crate::text::counted;

/// Characters of a value that a line shows.
const SHOWN_CHARS: usize = 60;

/// Number of scenes below which a bootstrap over them promises too much.
const FEW_SCENES: usize = 10;

/// Wording of what may be compared: whole runs, and parts of them.
const PARTS: &str = "Two runs, lineages (RUN:cat-idm, with all its seeds) or programs (RUN:cat-idm/e0s3, RUN:cat-idm/parent); RUN is a run's \
                     folder, its name below runs/, or the beginning of either";

#[derive(Debug, Args)]
#[command(mut_arg("run", |arg| arg.help(PARTS)))]
pub struct Options {
    #[command(flatten)]
    pub runs: TwoRuns,
}

/// A value of the experiment in both runs.
#[derive(Serialize)]
struct Changed {
    key: String,
    first: Option<String>,
    second: Option<String>,
}

/// A heading of the comparison with its quantities.
pub enum Block {
    /// Two programs.
    Two(Comparison),
    /// The programs of several seeds of both.
    Seeds { seeds: usize, of: Pooled },
}

impl Block {
    pub fn quantities(&self) -> &[Compared] {
        match self {
            Block::Two(of) => &of.quantities,
            Block::Seeds { of, .. } => &of.quantities,
        }
    }

    pub fn scenes(&self) -> usize {
        match self {
            Block::Two(of) => of.scenes,
            Block::Seeds { of, .. } => of.scenes,
        }
    }

    fn json(&self, name: &str) -> serde_json::Value {
        match self {
            Block::Two(of) => json!({"name": name, "comparison": of}),
            Block::Seeds { seeds, of } => json!({"name": name, "seeds": seeds, "pooled": of}),
        }
    }
}

/// All that two sides have in common.
pub struct Blocks {
    /// Each with what can be compared of it.
    pub searches: Vec<Searched>,
    /// The programs behind them.
    pub pairs: Vec<[SolutionId; 2]>,
    /// True if the two measure attack alike; if not, no row has it.
    pub one_attack: bool,
    /// Parts that were left out, and why.
    pub notes: Vec<String>,
}

/// A search of both sides; its blocks by name.
pub struct Searched {
    /// Over its seeds, where there are several.
    pub pooled: Option<(String, Block)>,
    /// Seed by seed.
    pub seeds: Vec<(String, Block)>,
}

impl Searched {
    /// Returns the blocks, the pooled one before the seeds.
    fn rows(self) -> impl Iterator<Item = (String, Block)> {
        self.pooled.into_iter().chain(self.seeds)
    }

    /// Returns the blocks that stand for the search: the pooled one with its number of seeds, or each seed if nothing is pooled.
    pub fn summary(self) -> Vec<(String, Block, usize)> {
        let count = self.seeds.len();
        match self.pooled {
            Some((name, of)) => vec![(name, of, count)],
            None => self.seeds.into_iter().map(|(name, of)| (name, of, 1)).collect(),
        }
    }
}

/// Compares two sides, paired by scene.
///
/// # Errors
/// No search of the same name, or no scene that both have labels of.
pub fn blocks(first: &Side, second: &Side) -> Result<Blocks, Failure> {
    let Pairs { searches, mut notes } = pairs(first, second)?;
    let mut paired: Vec<[SolutionId; 2]> = Vec::new();
    let mut compared_searches: Vec<Searched> = Vec::new();
    for search in &searches {
        let (mut alone, mut together) = (Vec::new(), Vec::new());
        for pair in &search.pairs {
            let (one, other) = ((&first.run, &pair.first), (&second.run, &pair.second));
            match compared(one, other) {
                Some(comparison) => {
                    paired.push([pair.first.clone(), pair.second.clone()]);
                    alone.push((pair.name.clone(), Block::Two(comparison)));
                    together.push((one, other));
                }
                None => {
                    notes.push(format!("{}: {} and {} share no labelled scene", pair.name, pair.first, pair.second))
                }
            }
        }
        let over_seeds = (together.len() > 1).then(|| pooled(&together)).flatten();
        let over_seeds = over_seeds.map(|of| (search.name.clone(), Block::Seeds { seeds: together.len(), of }));
        if !alone.is_empty() {
            compared_searches.push(Searched { pooled: over_seeds, seeds: alone });
        }
    }
    if compared_searches.is_empty() {
        return Err(Failure::bad_input(format!("nothing can be compared: {}", notes.join("; "))));
    }
    let [one, other] = [&first.run, &second.run].map(|run| run.opened.attack.clone());
    let one_attack = one == other;
    if !one_attack {
        // Their difference would look like a number and say nothing.
        let resting = |row: &Compared| row.quantity == "attack" || row.quantity == STRICT_REALISM;
        let all = compared_searches.iter_mut().flat_map(|of| of.pooled.iter_mut().chain(&mut of.seeds));
        all.for_each(|(_, of)| match of {
            Block::Two(of) => of.quantities.retain(|row| !resting(row)),
            Block::Seeds { of, .. } => of.quantities.retain(|row| !resting(row)),
        });
        let [one, other] = [one, other].map(|when| when.unwrap_or_else(|| "the protocol's".into()));
        notes.push(format!("attack is left out, because the two runs measure it differently: A's is {one}, B's is {other}; so is strict realism, which rests on \
             the attacks"));
    }
    Ok(Blocks { searches: compared_searches, pairs: paired, one_attack, notes })
}

pub fn run(options: &Options) -> Result<Answer, Failure> {
    let [first, second] = options.runs.named()?;
    let (first, second) = (Side::named(&first.to_string_lossy())?, Side::named(&second.to_string_lossy())?);
    let Blocks { searches, mut notes, .. } = blocks(&first, &second)?;
    let seeds: Vec<usize> = searches.iter().map(|of| of.seeds.len()).collect();
    let rows: Vec<(String, Block)> = searches.into_iter().flat_map(Searched::rows).collect();
    let changes = changed(&first.folder, &second.folder)?;
    notes.extend(one_seed(&seeds, "scenes"));
    notes.extend(alike(&rows));
    match [&first.run.seed_note, &second.run.seed_note] {
        [Some(a), Some(b)] if a == b => notes.push(format!("A and B: {a}")),
        both => {
            let noted = both.into_iter().zip(["A", "B"]);
            notes.extend(noted.filter_map(|(note, side)| Some(format!("{side}: {}", note.as_ref()?))));
        }
    }
    let few = rows.iter().map(|(_, of)| of.scenes()).min().unwrap_or(0);
    if few < FEW_SCENES {
        notes.push(format!(
            "{few} scenes are few: intervals over so few scenes are too narrow, and have no width where all scenes agree"
        ));
    }
    if first.run.opened.pool != second.run.opened.pool {
        notes.push("the pools differ: scenes are paired by their ids, but need not be the same scenes".into());
    }
    let [a, b] = [&first.folder, &second.folder].map(|folder| folder.read_experiment().map(|of| of.budget.finalists));
    notes.extend(areas_apart(a?, b?));
    let rows_json: Vec<_> = rows.iter().map(|(name, of)| of.json(name)).collect();
    let object = json!({
        "first": first.folder.dir, "second": second.folder.dir, "rows": rows_json, "experiment": changes, "notes": notes,
    });
    Ok(Answer::new(text(&first, &second, &rows, &changes, &notes), object))
}

/// PF-Area@3 is of the first three finalists: where others are measured it is another quantity.
fn areas_apart(a: usize, b: usize) -> Option<String> {
    (a != b).then(|| {
        format!(
            "PF-Area@3 of A and B does not compare: it is of the first three finalists by the reporting rule, and \
             `budget.finalists` is {a} in A and {b} in B"
        )
    })
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

/// Names of quantities that are shares of scenes.
const SHARES: [&str; 3] = ["attack", "coverage", "any crash"];

/// Returns a sentence if all scenes agree, so that the bootstrap has no spread to show.
fn alike(rows: &[(String, Block)]) -> Option<String> {
    let mut alike = AllAlike::default();
    for (_, of) in rows {
        for row in of.quantities().iter().filter(|row| SHARES.contains(&row.quantity.as_str())) {
            [row.first, row.second].into_iter().for_each(|share| alike.add(of.scenes(), share));
        }
    }
    alike.sentence()
}

fn heading(name: &str, of: &Block) -> String {
    let suite = |on: Paired| match on {
        Paired::HeldOut => "held-out",
        Paired::Evolution => "evolution",
    };
    match of {
        Block::Two(of) => {
            let left_out = match of.left_out {
                [0, 0] => String::new(),
                [a, b] => format!("; {a} more scenes of A and {b} of B have no counterpart and are left out"),
            };
            let on = suite(of.on);
            format!("{name}: A {}, B {}; {} {on} scenes, paired{left_out}", of.first, of.second, of.scenes)
        }
        Block::Seeds { seeds, of } => {
            format!("{name}, pooled: means over {seeds} seeds of both; {} {} scenes, paired", of.scenes, suite(of.on))
        }
    }
}

fn text(first: &Side, second: &Side, rows: &[(String, Block)], changes: &[Changed], notes: &[String]) -> String {
    let mut text = format!("A: {}\nB: {}\n", first.folder.dir.display(), second.folder.dir.display());
    if rows.len() > 1 {
        text += &format!("\nB - A of each; the whole comparison follows\n{}", overview(rows).text(table_width()));
    }
    for (name, of) in rows {
        text += &format!("\n{}\n", heading(name, of));
        text += &quantities(of).text(table_width());
    }
    let pooled = rows.iter().any(|(_, of)| matches!(of, Block::Seeds { .. }));
    text += if pooled {
        "\nin brackets: 95 % bootstrap intervals, of pooled rows over seeds and scenes, of one seed's over scenes alone\n"
    } else {
        "\nin brackets: 95 % bootstrap intervals over scenes\n"
    };
    text += "\
             realism: mean over the scenes that a program acts in; its difference is over the scenes in which both act\n\
             strict realism: the smaller one of that and the mean over the program's successes; the search uses it\n\
             needs: with so many, paired, a difference of this size shows at 5 % with 80 % power (docs/SEEDS.md)\n";
    text +=
        if changes.is_empty() { "\nthe experiments are the same\n" } else { "\nchanged in the experiment, A -> B:\n" };
    for of in changes {
        let [a, b] = [&of.first, &of.second].map(|value| value.as_deref().map_or("nothing".into(), shortened));
        text += &format!("  {}: {a} -> {b}\n", of.key);
    }
    notes.iter().for_each(|note| text += &format!("note: {note}\n"));
    text
}

/// The difference that each block is about, a line a block.
fn overview(rows: &[(String, Block)]) -> Aligned {
    let row = |(name, of): &(String, Block)| {
        let name = if matches!(of, Block::Seeds { .. }) { format!("{name}, pooled") } else { name.clone() };
        let difference = |quantity: &str| {
            let compared = of.quantities().iter().find(|row| row.quantity == quantity);
            compared.map_or("-".into(), |row| estimated(row.difference, true))
        };
        vec![name, difference("attack"), difference(STRICT_REALISM), difference("any crash")]
    };
    let heads = ["", "attack", STRICT_REALISM, "any crash"].map(String::from).to_vec();
    Aligned { indent: 2, labels: 1, words: 1, heads, rows: rows.iter().map(row).collect() }
}

fn quantities(of: &Block) -> Aligned {
    let row = |row: &Compared| {
        let [a, b] = [row.first, row.second].map(|estimate| estimated(estimate, false));
        let fewer = if row.scenes < of.scenes() { format!("({} scenes)", row.scenes) } else { String::new() };
        let count = |of: Option<usize>, what: &str| of.map(|of| counted(of, what));
        let needed = row.needed.map(|of| [count(of.seeds, "seed"), count(of.scenes, "scene")]);
        let needed = needed.into_iter().flatten().flatten().collect::<Vec<_>>().join(", ");
        vec![row.quantity.to_string(), a, b, estimated(row.difference, true), needed, fewer]
    };
    let heads = ["", "A", "B", "B - A", "needs", ""].map(String::from).to_vec();
    Aligned { indent: 2, labels: 1, words: 1, heads, rows: of.quantities().iter().map(row).collect() }
}

fn estimated(of: Estimate, signed: bool) -> String {
    let number = |x: f64| if signed { num::signed(x, 3) } else { num::fixed(x, 3) };
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
