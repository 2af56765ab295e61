//! A lineage as text: the chain of programs with their patches as diffs, and what became of every attempt.

use std::fmt::Write as _;

use super::realism::realism_text;
use super::recorded_run::RecordedRun;
use crate::kernel::num;
use crate::objects::{Attempt, LineageId, Objectives, Program, Score, SolutionId, program_diff};
use crate::text::counted;

/// The chain from the parent to a program, each step with its hypothesis, labels and diff. `width` are the characters of a
/// terminal's line, where it is one: an attempt's hypothesis then stands below it.
pub fn chain(run: &RecordedRun, lineage: &LineageId, last: &SolutionId, width: Option<usize>) -> String {
    let programs = run.chain(last);
    let mut out = format!("lineage {lineage}: {} from the parent to {last}\n", counted(programs.len(), "program"));
    for (i, program) in programs.iter().enumerate() {
        let _ = writeln!(out, "\n[{i}] {}  generation {}", program.solution_id, program.generation);
        if let Some(attempt) = attempt_of(run, program) {
            describe_step(&mut out, attempt);
        }
        origins(&mut out, run, program);
        if let Some(before) = i.checked_sub(1).map(|k| programs[k]) {
            out.push_str(&program_diff(before, program));
        }
    }
    let _ = writeln!(out, "\nattempts of {lineage}:");
    for attempt in run.attempts.iter().filter(|a| a.lineage == *lineage) {
        let _ = write!(out, "  {}", one_line(attempt));
        if let Some(patch) = attempt.proposal.patch() {
            let _ = match width {
                None => write!(out, "  {}", shortened(&patch.hypothesis, 90)),
                Some(width) => write!(out, "\n      {}", shortened(&patch.hypothesis, width.saturating_sub(6))),
            };
        }
        out.push('\n');
    }
    out
}

/// Says what became of an attempt, in one line.
fn one_line(attempt: &Attempt) -> String {
    let mut line = format!("{:<16} {:<9}", attempt.id.as_str(), attempt.exit.name());
    if let Some(score) = attempt.exit.score() {
        let _ = write!(line, " {}", objectives(score));
    }
    match attempt.exit.decision() {
        Some(decision) if decision.promoted => line.push_str(" promoted"),
        Some(decision) if decision.gates.any() => line.push_str(" accepted"),
        _ => {}
    }
    line
}

/// Attack and realism in a line, the realism under the name that it has in the protocol.
pub fn objectives(score: &Score) -> String {
    let Objectives { attack, realism } = score.objectives;
    let realism = realism_text(realism, score.coverage);
    format!("attack {}  {} {realism}", num::fixed(attack, 3), score.realism_name())
}

/// Cuts a text to at most `most` characters, between characters.
pub fn shortened(text: &str, most: usize) -> String {
    let flat = text.split_whitespace().collect::<Vec<_>>().join(" ");
    if flat.chars().count() <= most {
        return flat;
    }
    flat.chars().take(most.saturating_sub(1)).chain(['…']).collect()
}

/// The runs that a lineage's parent came out of, where the experiment names a program file.
pub fn origins(out: &mut String, run: &RecordedRun, program: &Program) {
    let adopted = run.parents.iter().find(|parent| parent.program.solution_id == program.solution_id);
    for origin in adopted.iter().flat_map(|parent| &parent.origins) {
        let _ = writeln!(out, "    from {origin}");
    }
}

fn attempt_of<'a>(run: &'a RecordedRun, program: &Program) -> Option<&'a Attempt> {
    run.attempts.iter().find(|a| a.exit.candidate().is_some_and(|c| c.program.solution_id == program.solution_id))
}

fn describe_step(out: &mut String, attempt: &Attempt) {
    if let Some(patch) = attempt.proposal.patch() {
        let _ = writeln!(out, "    hypothesis: {}", shortened(&patch.hypothesis, 300));
    }
    if let Some(score) = attempt.exit.score() {
        let _ = writeln!(out, "    labels: {} on {}", objectives(score), counted(score.scenes.len(), "scene"));
    }
}
