//! Results of the chosen programs on SafeBench's routes that evolution did not see, beside their results on those that
//! it saw.

use std::collections::BTreeSet;

use super::archives::{self, LineageArchive, Scores};
use super::basis::{Combine, Derivation, Leaf, Repetition, Selected};
use super::derivations::{Derivations, Source};
use super::error::TableError;
use super::key::RowKey;
use super::layout::{Cell, Column, Form, METHOD, POLICY, Part, Sourced, Table, heads};
use super::notes;
use super::resampled::Resampled;
use super::safebench::{
    COUNTS, EVOLVED, Kept, Look, Main, PARENT, Subject, archives_of, in_order, scored, told_columns,
};
use crate::evaluation::Group;
use crate::evidence::recorded_run::RecordedRun;
use crate::objects::SolutionId;
use crate::objects::benchmark::{Benchmark, BenchmarkRow, HeldOutRun};
use crate::objects::event::LineageResult;
use crate::scene::safebench::TrafficFamily;
use crate::statistics::bootstrap::Estimate;

/// The table's name.
const NAME: &str = "safebench-held-out";

/// Rows of the parent and of the program that was chosen.
type Both = [BenchmarkRow; 2];
/// A number of both.
type SeenRead = fn(&Both) -> f64;

const fn seen_column(key: &'static str, head: &'static str) -> Column {
    Column { key, group: "Seen routes", head, upward: Some(true), form: Form::Rate }
}

/// Columns of the routes that evolution saw.
const SEEN: [(Column, Look, SeenRead); 4] = [
    (seen_column("seen_parent_attack", "Parent Attack"), PARENT, |[parent, _]| parent.attack),
    (seen_column("seen_evolved_attack", "Chosen Attack"), EVOLVED, |[_, chosen]| chosen.attack),
    (seen_column("seen_parent_ars", "Parent ARS"), PARENT, |[parent, _]| parent.realism),
    (seen_column("seen_evolved_ars", "Chosen ARS"), EVOLVED, |[_, chosen]| chosen.realism),
];

/// Returns the results of the parent and the chosen program on all evolution scenes.
fn seen(run: &RecordedRun, result: &LineageResult) -> Option<Both> {
    let of = |solution: &SolutionId| {
        let finalist = run.finalists.iter().find(|f| f.lineage == result.lineage && f.solution == *solution)?;
        Some(finalist.score.benchmark.as_ref()?.mean)
    };
    Some([of(&result.parent.solution)?, of(&result.evolved.solution)?])
}

/// A row a generator and ego: its parent and the program that was chosen, on held-out routes and on seen ones.
pub fn safebench_held_out(runs: &[RecordedRun]) -> Result<Table, TableError> {
    let bases = Derivations::of(runs);
    let all = bases.held_out()?;
    let (seen, held_out) = (SEEN.map(sourced), columns(all));
    let row = |of: &Subject<'_>| {
        let resampled = of.resampled();
        let on_held_out = held_out.iter().map(|of| cell(*of, resampled.as_ref()));
        of.row(&[], Cell::derived(&bases, &of.key(), &seen, None).into_iter().chain(on_held_out).collect())
    };
    let rows = in_order(all).iter().filter(|of| !of.seeds.is_empty()).map(row).collect();
    let title = "SafeBench: the chosen programs on routes that evolution did not see".to_string();
    Ok(Table {
        name: NAME,
        labels: vec![METHOD, POLICY],
        columns: heads(&seen).into_iter().chain(held_out.iter().map(|of| of.column)).collect(),
        counts: COUNTS.to_vec(),
        parts: vec![Part { name: NAME.into(), title, source: None, rows }],
        runs: notes::runs(runs)?,
        notes: notes(runs, all),
    })
}

/// A number of labels on the routes that evolution saw; none where one repetition has none.
fn sourced((column, look, read): (Column, Look, SeenRead)) -> Sourced {
    let source = Source::of(move |bases, row| {
        Some(derivation(bases, row, look, column.key, "that evolution saw", |_, (run, result), programs| {
            let programs: Vec<SolutionId> = programs.iter().map(|(_, of)| (*of).clone()).collect();
            let leaves = run.opened.evolution_scenes.iter().map(|scene| Leaf::scene(scene, &programs, None));
            (seen(run, result).map(|both| read(&both)), leaves.collect())
        }))
    });
    (column, source)
}

/// A number of one program's runs on held-out routes.
fn cell(of: Main, resampled: Option<&Resampled>) -> Cell {
    let number = move |scores: &Scores| of.number(scores);
    scored(of.column, number, resampled, None, move |bases, row, number| {
        derivation(bases, row, of.look, of.column.key, "held out", |archive, (run, _), programs| {
            let leaf = |round: u32, solution: &SolutionId, one: &HeldOutRun| Leaf {
                selected: one.run.map(|run| Selected { round, run }),
                note: Some(match one.run {
                    Some(_) => one.group.clone(),
                    None => format!("{}: could not be run, counts as invalid", one.group),
                }),
                ..Leaf::scene(&one.scene, std::slice::from_ref(solution), None)
            };
            let leaves = programs.iter().flat_map(|(round, solution)| {
                let of = run.held_out.iter().find(|h| h.lineage == archive.lineage && h.solution == **solution);
                of.into_iter().flat_map(|of| &of.runs).map(move |one| leaf(*round, solution, one))
            });
            (number(&archive.scores()), leaves.collect())
        })
    })
}

/// A run with a lineage's result.
type Recorded<'a> = (&'a RecordedRun, &'a LineageResult);

/// Derives a repetition's number and leaves from the programs looked at: each with the place of its round; both where it is a change.
fn derivation(
    bases: &Derivations<'_>,
    row: &RowKey,
    look: Look,
    key: &str,
    where_: &str,
    number: impl Fn(&LineageArchive, Recorded<'_>, &[(u32, &SolutionId)]) -> (Option<f64>, Vec<Leaf>),
) -> Derivation {
    let part = |archive: &LineageArchive| -> Option<Repetition> {
        let (run, result) = bases.result(archive.place, &archive.lineage)?;
        let [parent, chosen] = [(0, &result.parent.solution), (1, &result.evolved.solution)];
        let programs = match look {
            PARENT => vec![parent],
            EVOLVED => vec![chosen],
            _ => vec![parent, chosen],
        };
        let (value, leaves) = number(archive, (run, result), &programs);
        let programs = programs.into_iter().map(|(_, of)| of.clone()).collect();
        Some(Repetition { programs, ..archive.part(value, leaves) })
    };
    let parts = archives_of(bases.held_out(), row).filter_map(part).collect();
    let formula = format!(
        "mean over repetitions of {key} of all runs on the routes {where_}, families weighing alike (docs/OBJECTIVES.md)"
    );
    Derivation::of(formula, Combine::MeansOfAll, parts)
}

/// Returns the change of attack and of ARS by the chosen programs of a search's repetitions on held-out routes, as the table draws it;
/// `None` where a run has none, or is of another protocol.
pub fn held_out_change(run: &RecordedRun, of: &[&LineageResult]) -> Option<[Estimate; 2]> {
    let all = archives::held_out(std::slice::from_ref(run)).ok()?;
    let own = all.iter().filter(|archive| of.iter().any(|result| result.lineage == archive.lineage));
    let resampled = Resampled::new(&own.map(LineageArchive::archived).collect::<Vec<_>>());
    let change = |rate: fn(&BenchmarkRow) -> f64| {
        let of = |round: Option<&Option<Benchmark>>| Some(rate(&round?.as_ref()?.mean));
        resampled.estimate(|scores| Some(of(scores.rounds.last())? - of(scores.redrawn.last())?))
    };
    Some([change(|row| row.attack)?, change(|row| row.realism)?])
}

/// The main table's columns but for the frontier's, which has no held-out reading, and the redrawn parent's: routes that chose nothing need no
/// such control.
fn columns(all: &[LineageArchive]) -> Vec<Main> {
    let group = |look| match look {
        PARENT => "Held-out: parent",
        EVOLVED => "Held-out: chosen",
        _ => "Held-out: change",
    };
    let held_out = told_columns(all).into_iter();
    let held_out = held_out.filter(|of| !of.is_gain() && of.look.kept != Kept::Redrawn);
    held_out.map(|of| Main { column: Column { group: group(of.look), ..of.column }, ..of }).collect()
}

/// Returns the notes that a reader needs beside the numbers.
fn notes(runs: &[RecordedRun], all: &[LineageArchive]) -> Vec<String> {
    let held_out = "One program a row here, and no archive: the parent, and the one that was chosen on evolution labels alone. Held-out routes \
                    were opened after that choice, so the change there needs no redraw of the parent. The seen routes made the choice: of \
                    them no change is shown, because the best of many is ahead there whatever it does. safebench-main shows what the archive keeps of many programs on the routes that \
                    evolution saw, as the paper does; the paper has no such routes, so no figures of it stand here.";
    let mut notes = vec![
        held_out.to_string(),
        "Attack = CR (1 - OS) of the means over traffic families. ARS is of the runs that the program acts in. Groups, Scenes: \
         those held out."
            .to_string(),
        notes::intervals("held-out groups, drawn within their traffic family")
            + " Differences are paired by group. A family has few of them, so intervals are wide; a rate that some draw leaves undefined has none.",
    ];
    notes.extend(notes::one_seed(&notes::repeats(all.iter()), "held-out groups"));
    let groups: BTreeSet<Group> = all.iter().flat_map(|archive| archive.groups()).collect();
    let by_family = TrafficFamily::ALL.map(|family| {
        let count = groups.iter().filter(|(of, _)| *of == family).count();
        format!("{} {count}", family.name())
    });
    notes.push(format!(
        "Held-out groups by traffic family: {}. A family without one counts nowhere.",
        by_family.join(", ")
    ));
    notes.extend(notes::of_runs(runs));
    notes.extend(notes::different_versions(runs));
    notes
}
