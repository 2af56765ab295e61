//! What the programs that were chosen do on SafeBench's routes that evolution did not see, beside what they do on those that
//! it saw.

use std::collections::BTreeSet;

use super::archives;
use super::error::TableError;
use super::key::Reads;
use super::labels;
use super::layout::{Cell, Column, Form, METHOD, Numbers, POLICY, Part, Table};
use super::notes;
use super::resampled::Resampled;
use super::safebench::{COUNTS, FRONTIERS, REDRAWN, Subject, in_order, main_numbers, told_columns};
use crate::evaluation::Group;
use crate::evidence::recorded_run::RecordedRun;
use crate::kernel::num;
use crate::objects::SolutionId;
use crate::objects::benchmark::{Benchmark, BenchmarkRow};
use crate::objects::event::LineageResult;
use crate::scene::safebench::TrafficFamily;
use crate::statistics::bootstrap::Estimate;

/// The table's name.
pub(super) const NAME: &str = "safebench-held-out";

/// Rows of the parent and of the program that was chosen.
type Both = [BenchmarkRow; 2];
/// A number of both.
type SeenRead = fn(&Both) -> Option<f64>;

const fn seen_column(key: &'static str, head: &'static str, form: Form) -> Column {
    Column { key, group: "Seen routes", head, upward: Some(true), form }
}

/// Columns of the routes that evolution saw.
const SEEN: [(Column, SeenRead); 4] = [
    (seen_column("seen_parent_attack", "Parent Attack", Form::Rate), |[parent, _]| Some(parent.attack)),
    (seen_column("seen_evolved_attack", "Chosen Attack", Form::Rate), |[_, chosen]| Some(chosen.attack)),
    (seen_column("seen_parent_ars", "Parent ARS", Form::Rate), |[parent, _]| Some(parent.realism)),
    (seen_column("seen_evolved_ars", "Chosen ARS", Form::Rate), |[_, chosen]| Some(chosen.realism)),
];

/// The number of a column of the seen routes.
pub(super) fn seen_of(key: &str) -> Option<SeenRead> {
    SEEN.iter().find(|(column, _)| column.key == key).map(|(_, read)| *read)
}

/// What the parent and the chosen program did on all evolution scenes.
pub(super) fn seen(run: &RecordedRun, result: &LineageResult) -> Option<Both> {
    let of = |solution: &SolutionId| {
        let finalist = run.finalists.iter().find(|f| f.lineage == result.lineage && f.solution == *solution)?;
        Some(finalist.score.benchmark.as_ref()?.mean)
    };
    Some([of(&result.parent.solution)?, of(&result.evolved.solution)?])
}

/// A row a generator and ego: its parent and the program that was chosen, on held-out routes and on seen ones.
pub fn safebench_held_out(runs: &[RecordedRun]) -> Result<Table, TableError> {
    let all = archives::held_out(runs)?;
    let columns = columns(&all);
    let row = |of: &Subject<'_>| {
        let numbers: Numbers = seen_numbers(runs, of).into_iter().chain(main_numbers(&of.seeds)).collect();
        of.row(Reads::ByColumn, &[], Cell::row(&columns, &numbers, None))
    };
    let rows = in_order(&all).iter().filter(|of| !of.seeds.is_empty()).map(row).collect();
    let title = "SafeBench: the chosen programs on routes that evolution did not see".to_string();
    Ok(Table {
        name: NAME,
        labels: vec![METHOD, POLICY],
        columns: columns.clone(),
        counts: COUNTS.to_vec(),
        parts: vec![Part { name: NAME.into(), title, source: None, rows }],
        runs: notes::runs(runs)?,
        notes: notes(runs, &all),
    })
}

/// What the chosen programs of a search's repetitions change of attack and of ARS on held-out routes, as the table draws it; `None` where a
/// run has none, or is of another protocol.
pub fn held_out_change(run: &RecordedRun, of: &[&LineageResult]) -> Option<[Estimate; 2]> {
    let all = archives::held_out(std::slice::from_ref(run)).ok()?;
    let own = all.iter().filter(|archive| of.iter().any(|result| result.lineage == archive.lineage));
    let resampled = Resampled::new(&own.map(archives::LineageArchive::archived).collect::<Vec<_>>());
    let change = |rate: fn(&BenchmarkRow) -> f64| {
        let of = |round: Option<&Option<Benchmark>>| Some(rate(&round?.as_ref()?.mean));
        resampled.estimate(|scores| Some(of(scores.rounds.last())? - of(scores.redrawn.last())?))
    };
    Some([change(|row| row.attack)?, change(|row| row.realism)?])
}

/// The seen routes first, then the main table's columns but for the frontier's, which has no held-out reading, and the redrawn parent's:
/// routes that chose nothing need no such control.
fn columns(all: &[archives::LineageArchive]) -> Vec<Column> {
    let group = |group| match group {
        "Parent" => "Held-out: parent",
        "Evolved" => "Held-out: chosen",
        _ => "Held-out: change",
    };
    let held_out = told_columns(all).into_iter();
    let held_out = held_out.filter(|column| column.group != REDRAWN && !FRONTIERS.contains(&column.key));
    let held_out = held_out.map(|column| Column { group: group(column.group), ..column });
    SEEN.map(|(column, _)| column).into_iter().chain(held_out).collect()
}

/// Means over the repetitions of a search; none where one repetition has none.
fn seen_numbers(runs: &[RecordedRun], of: &Subject<'_>) -> Numbers {
    let both = |archive: &&archives::LineageArchive| -> Option<Both> {
        let run = runs.iter().find(|run| labels::run_name(run) == archive.run)?;
        seen(run, run.result_of(&archive.lineage)?)
    };
    let Some(seeds) = of.seeds.iter().map(both).collect::<Option<Vec<Both>>>() else { return Numbers::new() };
    let number = |(column, read): &(Column, SeenRead)| {
        let values: Option<Vec<f64>> = seeds.iter().map(read).collect();
        Some((column.key, Estimate::plain(num::mean(&values?)?)))
    };
    SEEN.iter().filter_map(number).collect()
}

/// What a reader must know beside the numbers.
fn notes(runs: &[RecordedRun], all: &[archives::LineageArchive]) -> Vec<String> {
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
