//! fig:case-evolution-main and its companions: the proposals of one lineage step by step, and the chain that leads to the generator
//! that is reported, with its patches.

use super::error::FigureError;
use super::legend::{self, LETTERS, source};
use crate::draw::{
    Anchor, Axes, BLACK, BLUE, Figure, GREEN, GREY, Ink, LIGHT, Mark, ORANGE, Scale, VERMILION, WHITE, wrapped,
};
use crate::evidence::recorded_run::RecordedRun;
use crate::objects::{Attempt, Exit, LineageId, Objectives, Operation, Program, SolutionId, edit_categories};

/// What became of a proposal, in the order of the rows below the curve.
const ROWS: [(&str, Mark, Ink); 5] = [
    ("screened", Mark::Cross, Ink { fill: None, stroke: Some((GREY, 0.8)), dashed: false }),
    ("not routed", Mark::Square, Ink { fill: None, stroke: Some((GREY, 0.8)), dashed: false }),
    ("evaluated", Mark::Disc, Ink { fill: Some(ORANGE), stroke: None, dashed: false }),
    ("accepted", Mark::Triangle, Ink { fill: Some(BLUE), stroke: None, dashed: false }),
    ("promoted", Mark::Diamond, Ink { fill: Some(GREEN), stroke: None, dashed: false }),
];

/// The row of a proposal.
fn row(attempt: &Attempt) -> usize {
    match &attempt.exit {
        Exit::Declined { .. } | Exit::Invalid { .. } => 0,
        Exit::Rejected { .. } => 1,
        Exit::Evaluated { decision, .. } if decision.promoted => 4,
        Exit::Evaluated { decision, .. } if decision.gates.any() => 3,
        Exit::Evaluated { .. } => 2,
    }
}

/// Width and left edge of the plot, points.
const LEFT: f64 = 62.0;
const WIDE: f64 = 395.0;
/// Most programs of a chain that are told, and most lines of each.
const TOLD_MAX: usize = 8;
const LINES_MAX: usize = 4;

/// One lineage's proposals over its local steps.
pub fn case_evolution(run: &RecordedRun, lineage: &LineageId) -> Result<Figure, FigureError> {
    let known: Vec<&LineageId> = run.parents.iter().map(|parent| &parent.lineage).collect();
    if !known.contains(&lineage) {
        let known = known.into_iter().map(|id| id.to_string()).collect();
        return Err(FigureError::NoLineage { wanted: lineage.clone(), known });
    }
    let mut attempts: Vec<&Attempt> = run.attempts.iter().filter(|attempt| attempt.lineage == *lineage).collect();
    attempts.sort_by_key(|attempt| (attempt.epoch, attempt.slot));
    let chain = chain(run, lineage);
    let mut sheet = Figure::new(470.0, 250.0, format!("Evolution of {lineage}"));
    let ego = run.parents.iter().find(|parent| parent.lineage == *lineage).map_or("", |parent| parent.ego.as_str());
    sheet.heading((10.0, 14.0), 9.0, format!("{lineage}, against {ego}: proposals step by step"));
    steps(&mut sheet, run, lineage, &attempts, &chain);
    caption(&mut sheet, run, &chain);
    let safebench = !run.rounds.is_empty();
    let score = if safebench { "100 CR (1-OS) ARS Valid" } else { "100 A R" };
    let note = format!(
        "Score: {score} as labelled on the window of each epoch; windows differ, so a step up may be an easier window. Curve: best of \
         what was accepted so far, from the parent on. Screened: no usable patch, or a gate refused it. Not routed: the world evaluator \
         gave it no rollout. {}",
        source(&[run])
    );
    legend::foot(&mut sheet, &note);
    Ok(sheet)
}

/// The programs that lead to the reported generator, the parent first.
fn chain<'s>(run: &'s RecordedRun, lineage: &LineageId) -> Vec<&'s Program> {
    let results = run.result.iter().flat_map(|result| &result.lineages);
    let reported = results.into_iter().find(|result| result.lineage == *lineage).map(|result| &result.evolved.solution);
    reported.or_else(|| run.active(lineage)).map(|solution| run.chain(solution)).unwrap_or_default()
}

/// The first lineage of a run whose reported generator has patches to tell, or else the first.
pub fn with_a_chain(run: &RecordedRun) -> Option<LineageId> {
    let lineages = || run.parents.iter().map(|parent| &parent.lineage);
    lineages().find(|lineage| chain(run, lineage).len() > 1).or_else(|| lineages().next()).cloned()
}

/// The figure's score of a proposal; `None` without labels.
fn score(attempt: &Attempt) -> Option<f64> {
    attempt.exit.score().map(of_score)
}

fn of_score(score: &crate::objects::Score) -> f64 {
    match &score.benchmark {
        Some(benchmark) => 100.0 * benchmark.mean.attack * benchmark.mean.realism * benchmark.mean.valid_rate,
        None => product(&score.objectives),
    }
}

fn product(objectives: &Objectives) -> f64 {
    100.0 * objectives.attack * objectives.realism
}

fn steps(sheet: &mut Figure, run: &RecordedRun, lineage: &LineageId, attempts: &[&Attempt], chain: &[&Program]) {
    let first = run.frozen.iter().find(|frozen| frozen.lineage == *lineage).map(|f| of_score(&f.parent_score));
    let scores = || attempts.iter().filter_map(|attempt| score(attempt)).chain(first);
    let last = attempts.len().max(1) as f64;
    let axes = Axes {
        place: [LEFT, 26.0, WIDE, 120.0],
        across: Scale::fixed(0.0, last + 1.0, step_ticks(attempts.len())),
        up: Scale::over(scores().chain([0.0]), 4),
    };
    axes.draw(sheet, "", "Score");
    for (at, pair) in attempts.windows(2).enumerate() {
        if pair[0].epoch != pair[1].epoch {
            let x = axes.x(at as f64 + 1.5);
            sheet.line((x, 26.0), (x, 226.0), Ink::line(LIGHT, 0.5).dashed());
        }
    }
    let (mut best, mut curve) = (first.unwrap_or(0.0), vec![axes.at(0.0, first.unwrap_or(0.0))]);
    for (at, attempt) in attempts.iter().enumerate() {
        let step = at as f64 + 1.0;
        let place = row(attempt);
        let Some(value) = score(attempt) else { continue };
        if place >= 3 && value > best {
            curve.push(axes.at(step, best));
            best = value;
            curve.push(axes.at(step, best));
        }
        let (_, mark, ink) = ROWS[place];
        sheet.mark(mark, axes.at(step, value), if place >= 3 { 2.6 } else { 1.5 }, ink);
        let own = attempt.exit.candidate().map(|candidate| &candidate.program.solution_id);
        if let Some(nth) = chain.iter().position(|program| Some(&program.solution_id) == own) {
            sheet.mark(Mark::Disc, axes.at(step, value), 5.0, Ink::line(VERMILION, 1.1));
            let (x, y) = axes.at(step, value);
            sheet.text((x, y - 7.0), 7.0, Anchor::Middle, format!("p{nth}"));
        }
    }
    curve.push(axes.at(last + 1.0, best));
    sheet.path(curve, Ink::line(BLACK, 1.2));
    sheet.mark(Mark::Disc, axes.at(0.0, first.unwrap_or(0.0)), 2.6, Ink::fill(WHITE).edged(BLACK, 1.0));
    rows(sheet, &axes, attempts);
}

/// A row of marks a kind of end.
fn rows(sheet: &mut Figure, axes: &Axes, attempts: &[&Attempt]) {
    for (place, (name, mark, ink)) in ROWS.iter().enumerate() {
        let y = 170.0 + 12.0 * place as f64;
        let of = attempts.iter().enumerate().filter(|(_, attempt)| row(attempt) == place);
        sheet.line((LEFT, y), (LEFT + WIDE, y), Ink::line(LIGHT, 0.4));
        let mut count = 0;
        for (at, _) in of {
            sheet.mark(*mark, (axes.x(at as f64 + 1.0), y), 2.0, *ink);
            count += 1;
        }
        sheet.text((LEFT - 4.0, y + 2.6), LETTERS - 0.5, Anchor::End, format!("{name} {count}"));
    }
    sheet.text((LEFT + 0.5 * WIDE, 238.0), LETTERS + 0.5, Anchor::Middle, "Local step (proposal)");
}

fn step_ticks(count: usize) -> Vec<f64> {
    let scale = Scale::over([0.0, count as f64], 8);
    scale.ticks.into_iter().filter(|tick| *tick <= count as f64 + 0.5).collect()
}

/// The chain in words: what each patch of it changes, and what it was labelled.
fn caption(sheet: &mut Figure, run: &RecordedRun, chain: &[&Program]) {
    let mut y = sheet.height + 8.0;
    sheet.heading((10.0, y), 8.5, "The chain to the reported generator");
    y += 12.0;
    if chain.len() <= 1 {
        let text = "The parent itself is reported: no descendant was chosen, so there is no patch to tell.";
        sheet.text((10.0, y), LETTERS, Anchor::Start, text);
        sheet.height = y + 8.0;
        return;
    }
    let left_out = chain.len().saturating_sub(1 + TOLD_MAX);
    for (nth, program) in chain.iter().enumerate().skip(1 + left_out) {
        let Some(attempt) = made(run, &program.solution_id) else { continue };
        let Some(patch) = attempt.proposal.patch() else { continue };
        let parts: Vec<&str> = edit_categories(patch).into_iter().map(|part| part.name()).collect();
        let labels = attempt.exit.score().map_or(String::new(), |score| {
            format!("; A {:.3}, R {:.4}", score.objectives.attack, score.objectives.realism)
        });
        sheet.heading((10.0, y), LETTERS, format!("p{nth}  {}  ({}{labels})", attempt.id, parts.join(", ")));
        y += 9.5;
        let operations: Vec<String> = patch.operations.iter().map(Operation::in_words).collect();
        for line in wrapped(&operations.join("; "), LETTERS - 0.5, sheet.width - 30.0, LINES_MAX) {
            sheet.text((20.0, y), LETTERS - 0.5, Anchor::Start, line);
            y += 8.5;
        }
        y += 3.0;
    }
    if left_out > 0 {
        sheet.text(
            (10.0, y),
            LETTERS,
            Anchor::Start,
            format!("{left_out} earlier programs of the chain are left out."),
        );
        y += 9.5;
    }
    sheet.height = y;
}

fn made<'s>(run: &'s RecordedRun, solution: &SolutionId) -> Option<&'s Attempt> {
    run.attempts
        .iter()
        .find(|attempt| attempt.exit.candidate().is_some_and(|candidate| candidate.program.solution_id == *solution))
}
