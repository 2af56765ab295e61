//! Cells of tables that rest on one object of a run: they would differ with another rollout, program, answer or scene.

use serde::Serialize;
use serde_json::json;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;

use super::cell::cell_name;
use super::recorded_run::RecordedRun;
use super::tables::{Derivation, Derivations, Leaf, Repetition, Table};
use crate::kernel::Digest;
use crate::objects::{AttemptId, Exchange, LineageId, SceneScore, SolutionId};

/// Hex digits that a short digest must have.
const DIGITS_MIN: usize = 4;

/// Ending of a scene's name where its parent was drawn anew (docs/OBJECTIVES.md).
const REDRAW: &str = "/redraw";

/// Object that a digest or a name stands for in a run.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum RunObject {
    /// The rollout behind the label of a program in a scene; whether it is held out.
    Rollout { solution: SolutionId, scene: String, held_out: bool },
    /// A program.
    Program(SolutionId),
    /// A proposal, its patch, or a question or an answer in it.
    Attempt(AttemptId),
    /// A question or an answer that a whole lineage rests on: counsel, or a template.
    Lineage(LineageId),
    /// A scene.
    Scene(String),
    /// Something that the whole run is a function of, or its root.
    Whole(&'static str),
}

/// A thing in one of the runs.
pub type Met = (usize, RunObject);

/// Way in which a cell rests on the object.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum How {
    /// The cell's number is computed from it.
    Reads,
    /// A program whose labels the cell reads was made from it.
    MadeFrom,
    /// It may have decided which programs the cell is about.
    Chosen,
}

/// A cell that rests on the object.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Touched {
    /// `TABLE:ROW:COLUMN`.
    pub cell: String,
    /// The number as the table prints it.
    pub printed: String,
    pub how: How,
    /// Object through which the cell rests on it, in words.
    pub through: String,
    /// Numbers of the label that the cell uses, where it is read.
    pub numbers: Vec<&'static str>,
}

/// Everything of these runs that has a digest or a name, by its text. `scenes` are ids by the digest of the scene.
pub fn things(runs: &[RecordedRun], scenes: &[BTreeMap<Digest, String>]) -> BTreeMap<String, BTreeSet<Met>> {
    let mut met: BTreeMap<String, BTreeSet<Met>> = BTreeMap::new();
    for (run, recorded) in runs.iter().enumerate() {
        let mut add = |text: String, thing: RunObject| {
            met.entry(text).or_default().insert((run, thing));
        };
        let opened = &recorded.opened;
        add(opened.experiment.to_hex(), RunObject::Whole("the experiment"));
        add(opened.pool.to_hex(), RunObject::Whole("the pool of scenes"));
        add(recorded.root.to_hex(), RunObject::Whole("the run's root"));
        for (_, solution, suite, score) in recorded.scores() {
            for label in score.scenes.iter().flat_map(SceneScore::each) {
                let (solution, scene, held_out) = (solution.clone(), label.scene.clone(), suite == "held_out");
                for digest in [label.request, label.record] {
                    let (solution, scene) = (solution.clone(), scene.clone());
                    add(digest.to_hex(), RunObject::Rollout { solution, scene, held_out });
                }
            }
        }
        for parent in &recorded.parents {
            let solution = &parent.program.solution_id;
            add(parent.program_hash.to_hex(), RunObject::Program(solution.clone()));
            add(solution.to_string(), RunObject::Program(solution.clone()));
        }
        for attempt in &recorded.attempts {
            let of = || RunObject::Attempt(attempt.id.clone());
            add(attempt.id.to_string(), of());
            if let Some(candidate) = attempt.exit.candidate() {
                add(candidate.patch_hash.to_hex(), of());
                add(candidate.program_hash.to_hex(), RunObject::Program(candidate.program.solution_id.clone()));
            }
            asked(&attempt.proposal.exchanges).for_each(|digest| add(digest, of()));
        }
        for counselled in &recorded.counsels {
            asked(&counselled.exchanges).for_each(|digest| add(digest, RunObject::Lineage(counselled.lineage.clone())));
        }
        for composed in &recorded.composed {
            asked(&composed.exchanges).for_each(|digest| add(digest, RunObject::Lineage(composed.lineage.clone())));
        }
        for turn in &recorded.evolved {
            asked(&turn.exchanges).for_each(|digest| add(digest, RunObject::Whole("a turn of the world evaluator")));
        }
        for id in opened.evolution_scenes.iter().chain(&opened.held_out_scenes) {
            add(id.clone(), RunObject::Scene(id.clone()));
        }
        for (digest, id) in scenes.get(run).into_iter().flatten() {
            add(digest.to_hex(), RunObject::Scene(id.clone()));
        }
    }
    met
}

fn asked(exchanges: &[Exchange]) -> impl Iterator<Item = String> {
    exchanges.iter().flat_map(|asked| [asked.request.to_hex(), asked.response.to_hex()])
}

/// The object of that name or digest, in full or shortened.
///
/// # Errors
/// Nothing has it, or several objects do; the text says which.
pub fn find<'a>(
    known: &'a BTreeMap<String, BTreeSet<Met>>,
    name: &str,
) -> Result<(&'a String, &'a BTreeSet<Met>), String> {
    if let Some(exact) = known.get_key_value(name) {
        return Ok(exact);
    }
    let short = name.to_lowercase();
    let is_digest = short.len() >= DIGITS_MIN && short.chars().all(|c| c.is_ascii_hexdigit());
    let fits = |text: &&String| is_digest && text.len() == 64 && text.starts_with(&short);
    let met: Vec<(&String, &BTreeSet<Met>)> = known.iter().filter(|(text, _)| fits(text)).collect();
    match met.as_slice() {
        [one] => Ok(*one),
        [] => Err(format!(
            "nothing in these runs has the digest or the name `{name}`; expected at least {DIGITS_MIN} hex digits of a rollout's key or \
             record, a program, a patch, a question, an answer, a scene, or the name of an attempt or a scene"
        )),
        several => {
            let first: Vec<String> =
                several.iter().take(5).map(|(text, of)| format!("{} ({})", &text[..16], listed(of))).collect();
            Err(format!(
                "`{name}` is the beginning of {} digests; give more digits: {}",
                several.len(),
                first.join(", ")
            ))
        }
    }
}

/// Describes the objects in words.
pub fn listed(things: &BTreeSet<Met>) -> String {
    let word = |(_, thing): &Met| match thing {
        RunObject::Rollout { solution, scene, held_out } => {
            format!("rollout of {solution} in {} scene {scene}", if *held_out { "held-out" } else { "evolution" })
        }
        RunObject::Program(solution) => format!("program of {solution}"),
        RunObject::Attempt(id) => format!("attempt {id}"),
        RunObject::Lineage(lineage) => format!("an exchange of lineage {lineage}"),
        RunObject::Scene(id) => format!("scene {id}"),
        RunObject::Whole(what) => what.to_string(),
    };
    let words: BTreeSet<String> = things.iter().map(word).collect();
    let more = words.len().saturating_sub(3);
    let shown: Vec<String> = words.into_iter().take(3).collect();
    if more == 0 { shown.join("; ") } else { format!("{} and {more} more", shown.join("; ")) }
}

/// The cells of these tables that rest on the object, each once, by what holds it fastest.
pub fn impact(tables: &[Table], runs: &[RecordedRun], things: &BTreeSet<Met>) -> Vec<Touched> {
    let (mut touched, bases) = (Vec::new(), Derivations::of(runs));
    for table in tables {
        for row in table.rows() {
            for cell in row.cells.iter().filter(|cell| cell.ours.is_some()) {
                let Some(basis) = cell.source.derivation(&bases, &row.key) else { continue };
                let rests = Rests { runs, bases: &bases, basis: &basis };
                if let Some((how, through, numbers)) =
                    things.iter().filter_map(|(run, thing)| rests.on(*run, thing)).min()
                {
                    let printed = cell.ours.map_or(String::new(), |ours| cell.column.form.number(ours.value));
                    touched.push(Touched { cell: cell_name(table, row, &cell.column), printed, how, through, numbers });
                }
            }
        }
    }
    touched
}

/// One cell's basis, asked what it rests on.
struct Rests<'a, 's> {
    runs: &'a [RecordedRun],
    bases: &'a Derivations<'s>,
    basis: &'a Derivation,
}

type Found = (How, String, Vec<&'static str>);

impl Rests<'_, '_> {
    fn on(&self, run: usize, thing: &RunObject) -> Option<Found> {
        match thing {
            RunObject::Whole(what) => {
                self.parts().any(|(_, part)| part.run == run).then(|| (How::Reads, what.to_string(), Vec::new()))
            }
            RunObject::Rollout { solution, scene, held_out } => self.reads(run, Some(solution), scene).or_else(|| {
                let lineage = LineageId::new(lineage_of(solution.as_str()));
                (!held_out).then(|| self.chosen(run, Some(&lineage))).flatten()
            }),
            RunObject::Scene(scene) => self.reads(run, None, scene).or_else(|| {
                let open = self.runs[run].opened.evolution_scenes.contains(scene);
                open.then(|| self.chosen(run, None)).flatten()
            }),
            RunObject::Program(solution) => self
                .descends(run, solution)
                .or_else(|| self.chosen(run, Some(&LineageId::new(lineage_of(solution.as_str()))))),
            RunObject::Attempt(id) => self
                .counts(run, id)
                .or_else(|| self.descends(run, &SolutionId::new(id.as_str())))
                .or_else(|| self.chosen(run, Some(&LineageId::new(lineage_of(id.as_str()))))),
            RunObject::Lineage(lineage) => {
                let of = |(_, part): &(&Derivation, &Repetition)| part.run == run && part.lineage == lineage.as_str();
                let met = self.parts().any(|pair| of(&pair));
                met.then(|| (How::MadeFrom, format!("lineage {lineage}"), Vec::new()))
            }
        }
    }

    fn parts(&self) -> impl Iterator<Item = (&Derivation, &Repetition)> {
        self.basis.all().into_iter().flat_map(|basis| basis.parts.iter().map(move |part| (basis, part)))
    }

    /// Finds the label in a scene that the cell reads, of one program or of any.
    fn reads(&self, run: usize, solution: Option<&SolutionId>, scene: &str) -> Option<Found> {
        let mut numbers = BTreeSet::new();
        let mut through = BTreeSet::new();
        for (basis, part) in self.parts().filter(|(_, part)| part.run == run) {
            let redrawn = |leaf: &Leaf| leaf.name.strip_prefix(scene).is_some_and(|ending| ending.starts_with(REDRAW));
            let own = |leaf: &&Leaf| leaf.name == scene || solution.is_none() && redrawn(leaf);
            for leaf in part.leaves.iter().filter(own).filter(|leaf| !of_one_program(leaf)) {
                if solution.is_none() && leaf.programs.is_empty() && leaf.attempt.is_none() {
                    through.insert(format!("the replay of {scene}"));
                }
                for of in leaf.programs.iter().filter(|of| solution.is_none_or(|wanted| wanted == *of)) {
                    let used = self.used(basis, part, leaf, of);
                    if !used.is_empty() {
                        through.insert(format!("the label of {of} in {scene}"));
                        numbers.extend(used);
                    }
                }
            }
        }
        let through: Vec<String> = through.into_iter().collect();
        (!through.is_empty()).then(|| (How::Reads, through.join(" and "), numbers.into_iter().collect()))
    }

    fn used(&self, basis: &Derivation, part: &Repetition, leaf: &Leaf, solution: &SolutionId) -> Vec<&'static str> {
        match (leaf.selected, self.bases.label(part.run, solution, &leaf.name)) {
            (Some(_), _) => vec!["run"],
            (None, Some(label)) => basis.uses(label),
            (None, None) => Vec::new(),
        }
    }

    /// Finds a program whose labels are read and that is this one or descends from it.
    fn descends(&self, run: usize, solution: &SolutionId) -> Option<Found> {
        let recorded = &self.runs[run];
        let read: BTreeSet<&SolutionId> =
            self.parts().filter(|(_, part)| part.run == run).flat_map(|(_, part)| &part.programs).collect();
        if read.contains(solution) {
            return Some((How::Reads, format!("the labels of {solution}"), Vec::new()));
        }
        let descends = |of: &&&SolutionId| recorded.chain(of).iter().any(|program| program.solution_id == *solution);
        let child = read.iter().find(descends)?;
        Some((How::MadeFrom, format!("{child}, which descends from {solution}"), Vec::new()))
    }

    fn counts(&self, run: usize, id: &AttemptId) -> Option<Found> {
        let leaves = self.parts().filter(|(_, part)| part.run == run).flat_map(|(_, part)| &part.leaves);
        let counted = |leaf: &Leaf| leaf.attempt.as_ref() == Some(id) && leaf.value.is_some();
        leaves.into_iter().any(counted).then(|| (How::Reads, format!("the count of {id}"), Vec::new()))
    }

    /// Finds a part about programs that a lineage's evolution chose; without a lineage, that of any lineage of the run.
    fn chosen(&self, run: usize, lineage: Option<&LineageId>) -> Option<Found> {
        let of = |part: &Repetition| part.run == run && lineage.is_none_or(|lineage| part.lineage == lineage.as_str());
        let parent = |solution: &SolutionId| solution.as_str().ends_with("/parent");
        // Proposals are made and counted behind every label; gains by group name no program.
        let open = |part: &Repetition| {
            let counted = part.leaves.iter().any(|leaf| leaf.attempt.is_some());
            let replay = part.lineage.starts_with("replay/");
            !replay && (counted || part.programs.is_empty() || !part.programs.iter().all(parent))
        };
        let (_, part) = self.parts().find(|(_, part)| of(part) && open(part))?;
        Some((How::Chosen, format!("what evolution chose in {}", part.lineage), Vec::new()))
    }
}

/// Returns `true` if a difference is that of a program from itself, where no descendant was chosen: nought, whatever the label.
fn of_one_program(leaf: &Leaf) -> bool {
    matches!(leaf.programs.as_slice(), [one, other] if one == other)
}

/// `cat-idm` of `cat-idm/e2s5`.
fn lineage_of(id: &str) -> &str {
    id.rsplit_once('/').map_or(id, |(lineage, _)| lineage)
}

/// Returns the result as text: cells that read it first; those that rest on a choice are counted, and listed in the full form.
pub fn text(name: &str, what: &str, touched: &[Touched], full: bool, folders: &str) -> String {
    let mut out = format!("{name}: {what}\n");
    let of = |how: How| touched.iter().filter(move |cell| cell.how == how);
    let mut list = |heading: &str, how: How, shown: bool| {
        let count = of(how).count();
        if count == 0 {
            return;
        }
        let _ = writeln!(out, "{count} cells {heading}{}", if shown { ":" } else { " (--full lists them)" });
        for cell in of(how).filter(|_| shown) {
            let numbers =
                if cell.numbers.is_empty() { String::new() } else { format!(" ({})", cell.numbers.join(", ")) };
            let _ = writeln!(out, "  {} = {}  through {}{numbers}", cell.cell, cell.printed, cell.through);
        }
    };
    list("are computed from it", How::Reads, true);
    list("are about a program that was made from it", How::MadeFrom, true);
    list("are about programs in whose choice it took part", How::Chosen, full);
    match touched.first() {
        None => out.push_str("no cell of these runs' tables depends on it\n"),
        Some(first) => {
            let _ = writeln!(out, "more: evodrive why {} {folders}", first.cell);
        }
    }
    out
}

/// Returns the result as one object.
pub fn json(name: &str, what: &str, touched: &[Touched]) -> serde_json::Value {
    json!({"object": name, "is": what, "cells": touched})
}
