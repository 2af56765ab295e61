//! fig:case-evolution-main and its companions: the proposals of lineages step by step, the chain that leads to the generator that is
//! reported, what each of its patches does in words, and what the chain came to on the held-out scenes.

use super::error::FigureError;
use super::legend::{self, LETTERS, source};
use crate::draw::{
    Anchor, Axes, BLACK, BLUE, Figure, GREEN, GREY, Ink, LIGHT, Mark, ORANGE, PURPLE, Rgb, Scale, VERMILION, WHITE,
    Words, in_font, whole_sentences, width, wrapped,
};
use crate::evidence::credit::{Credit, Gain};
use crate::evidence::recorded_run::RecordedRun;
use crate::evidence::report::patch_in_words;
use crate::evidence::tables::{Estimate, called};
use crate::objects::benchmark::BenchmarkRow;
use crate::objects::{Attempt, Exit, LineageId, Objectives, Program, Score, SolutionId};

/// A lineage to show, and what is known of its reported program patch by patch.
#[derive(Clone, Debug)]
pub struct Evolved<'r> {
    pub run: &'r RecordedRun,
    pub lineage: LineageId,
    /// Credit of the reported program; without it, its chain is not drawn on held-out scenes.
    pub credit: Option<&'r Credit>,
    /// The traffic family whose scenes alone the score is of; `None`: of all.
    pub family: Option<&'r str>,
}

/// Outcomes of a proposal, in the order of the rows below the curve.
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

/// Width of the sheet, points: both columns of a page.
const WIDE: f64 = 494.0;
/// Left edge of the plot of proposals, its width beside that of the chain and alone, and its height.
const LEFT: f64 = 62.0;
const BESIDE: f64 = 232.0;
const ALONE: f64 = WIDE - LEFT - 8.0;
const HIGH: f64 = 96.0;
/// Left edge and width of the plot of the chain.
const CHAIN_LEFT: f64 = 346.0;
const CHAIN_WIDE: f64 = WIDE - CHAIN_LEFT - 10.0;
/// Height from the head of a lineage to its plots, and of the rows below them.
const HEAD: f64 = 18.0;
const ROW: f64 = 12.0;
/// Most programs of a chain that are told, and most lines of what a proposer expected, in whole sentences.
const TOLD_MAX: usize = 8;
const LINES_MAX: usize = 4;
/// Most lineages of a sheet.
const LINEAGES_MAX: usize = 6;

/// The proposals of each lineage over its local steps, one lineage below the other.
///
/// # Errors
/// No lineage, more than a sheet holds, or one that its run does not have.
pub fn case_evolution(all: &[Evolved<'_>]) -> Result<Figure, FigureError> {
    let Some(first) = all.first() else { return Err(FigureError::NoPatches) };
    if all.len() > LINEAGES_MAX {
        let known = all.iter().map(|of| of.lineage.to_string()).collect();
        return Err(FigureError::TooManyLineages { most: LINEAGES_MAX, known });
    }
    for Evolved { run, lineage, .. } in all {
        let known: Vec<&LineageId> = run.parents.iter().map(|parent| &parent.lineage).collect();
        if !known.contains(&lineage) {
            let known = known.into_iter().map(|id| id.to_string()).collect();
            return Err(FigureError::NoLineage { wanted: lineage.clone(), known });
        }
    }
    for of in all {
        let Some(wanted) = of.family else { continue };
        let known = families(of.run);
        if !known.contains(&wanted) {
            let (wanted, known) = (wanted.to_string(), known.into_iter().map(String::from).collect());
            return Err(FigureError::NoFamily { wanted, known });
        }
    }
    let name = |of: &Evolved<'_>| match of.family {
        Some(family) => format!("{}, {}", called(of.run, &of.lineage), family.replace('_', " ")),
        None => called(of.run, &of.lineage),
    };
    let names: Vec<String> = all.iter().map(name).collect();
    let mut sheet = Figure::new(WIDE, 2.0, format!("Evolution of {}", names.join("; ")));
    for (of, name) in all.iter().zip(&names) {
        block(&mut sheet, of, name);
        sheet.height += 6.0;
    }
    let safebench = !first.run.rounds.is_empty();
    let score = if !safebench {
        format!("100 times attack times {}", first.run.realism_name())
    } else if first.family.is_some() {
        "100 times attack, CR (1 - OS), times ARS times the share of valid runs, of the family's scenes,".to_string()
    } else {
        "100 times attack, CR (1 - OS), times ARS times the share of valid runs,".to_string()
    };
    let shown = all.iter().any(|of| of.credit.is_some());
    let chain = if shown {
        "Right: each program of the chain minus the parent on the same held-out scenes, with 95 % intervals over scenes. "
    } else {
        ""
    };
    let mut runs: Vec<&RecordedRun> = all.iter().map(|of| of.run).collect();
    runs.dedup_by_key(|run| run.root);
    let note = format!(
        "Score: {score} on the window of each epoch; windows differ, so a step up may be an easier window. Line: best of what was accepted so \
         far, from the parent on. Screened: no usable patch, or a gate refused it. Not routed: the world evaluator gave it no rollout. \
         {chain}{}",
        source(&runs)
    );
    legend::foot(&mut sheet, &note);
    Ok(sheet)
}

/// One lineage: its name, its plots and its patches.
fn block(sheet: &mut Figure, of: &Evolved<'_>, name: &str) {
    let Evolved { run, lineage, credit, .. } = of;
    let mut attempts: Vec<&Attempt> = run.attempts.iter().filter(|attempt| attempt.lineage == *lineage).collect();
    attempts.sort_by_key(|attempt| (attempt.epoch, attempt.slot));
    let chain = chain(run, lineage);
    // What was worked out of another program says nothing of this chain.
    let reported = chain.last().map(|program| &program.solution_id);
    let credit = credit.filter(|credit| Some(&credit.program) == reported && chain.len() > 1);
    let top = sheet.height;
    sheet.heading((8.0, top + 10.0), 8.5, name);
    let wide = if credit.is_some() { BESIDE } else { ALONE };
    steps(sheet, of, &attempts, &chain, [LEFT, top + HEAD, wide, HIGH]);
    if let Some(credit) = credit {
        on_held_out(sheet, credit, top + HEAD);
    }
    sheet.height = top + HEAD + HIGH + 22.0 + ROW * ROWS.len() as f64 + 14.0;
    patches(sheet, run, &chain);
}

/// The programs that lead to the reported generator, the parent first.
fn chain<'s>(run: &'s RecordedRun, lineage: &LineageId) -> Vec<&'s Program> {
    let reported = run.result_of(lineage).map(|result| &result.evolved.solution);
    reported.or_else(|| run.active(lineage)).map(|solution| run.chain(solution)).unwrap_or_default()
}

/// Returns the credit that was worked out of the program that a lineage reports.
pub fn credit_of<'c>(run: &RecordedRun, lineage: &LineageId, credits: &'c [Credit]) -> Option<&'c Credit> {
    let reported = &run.result_of(lineage)?.evolved.solution;
    credits.iter().find(|credit| credit.program == *reported)
}

/// The first lineage of a run whose reported generator has patches to tell, or else the first.
pub fn with_a_chain(run: &RecordedRun) -> Option<LineageId> {
    let lineages = || run.parents.iter().map(|parent| &parent.lineage);
    lineages().find(|lineage| chain(run, lineage).len() > 1).or_else(|| lineages().next()).cloned()
}

/// Traffic families that a run's labels tell apart, sorted; none outside SafeBench's protocol.
fn families(run: &RecordedRun) -> Vec<&str> {
    let benchmark = run.frozen.first().and_then(|frozen| frozen.parent_score.benchmark.as_ref());
    benchmark.map_or(Vec::new(), |benchmark| benchmark.families.keys().map(String::as_str).collect())
}

/// The figure's score of labels, of one traffic family's or all (paper eq. app-carla-trace-score); 0 of a family without a run.
fn of_score(score: &Score, family: Option<&str>) -> f64 {
    let traced = |row: &BenchmarkRow| 100.0 * row.attack * row.realism * row.valid_rate;
    match (&score.benchmark, family) {
        (Some(benchmark), Some(family)) => benchmark.families.get(family).map_or(0.0, traced),
        (Some(benchmark), None) => traced(&benchmark.mean),
        (None, _) => product(&score.objectives),
    }
}

fn product(objectives: &Objectives) -> f64 {
    100.0 * objectives.attack * objectives.realism
}

fn steps(
    sheet: &mut Figure,
    Evolved { run, lineage, family, .. }: &Evolved<'_>,
    attempts: &[&Attempt],
    chain: &[&Program],
    place: [f64; 4],
) {
    let score = |attempt: &Attempt| attempt.exit.score().map(|score| of_score(score, *family));
    let first = run.frozen.iter().find(|frozen| frozen.lineage == *lineage).map(|f| of_score(&f.parent_score, *family));
    let scores = || attempts.iter().filter_map(|attempt| score(attempt)).chain(first);
    let last = attempts.len().max(1) as f64;
    let [left, top, wide, high] = place;
    let rows_top = top + high + 22.0;
    let axes = Axes {
        place,
        across: Scale::fixed(0.0, last + 1.0, step_ticks(attempts.len())),
        up: Scale::over(scores().chain([0.0]), 4),
    };
    axes.draw(sheet, "", "Score on windows");
    for (at, pair) in attempts.windows(2).enumerate() {
        if pair[0].epoch != pair[1].epoch {
            let x = axes.x(at as f64 + 1.5);
            sheet.line((x, top), (x, rows_top + ROW * ROWS.len() as f64), Ink::line(LIGHT, 0.5).dashed());
        }
    }
    let (mut best, mut curve) = (first.unwrap_or(0.0), vec![axes.at(0.0, first.unwrap_or(0.0))]);
    let (mut numbers, mut names) = (Vec::new(), Vec::new());
    for (at, attempt) in attempts.iter().enumerate() {
        let step = at as f64 + 1.0;
        let of_row = row(attempt);
        let Some(value) = score(attempt) else { continue };
        if of_row >= 3 && value > best {
            curve.push(axes.at(step, best));
            best = value;
            curve.push(axes.at(step, best));
        }
        let (_, mark, ink) = ROWS[of_row];
        sheet.mark(mark, axes.at(step, value), if of_row >= 3 { 2.6 } else { 1.5 }, ink);
        let own = attempt.exit.candidate().map(|candidate| &candidate.program.solution_id);
        if let Some(nth) = chain.iter().position(|program| Some(&program.solution_id) == own) {
            sheet.mark(Mark::Disc, axes.at(step, value), 5.0, Ink::line(VERMILION, 1.1));
            let (x, y) = axes.at(step, value);
            // At the top of the plot, and beside another number, it stands below its sign.
            let above = (x, y - 7.0);
            let taken = numbers.iter().any(|(a, b): &(f64, f64)| (a - x).abs() < 12.0 && (b - above.1).abs() < 9.0);
            let at = if above.1 - LETTERS < top || taken { (x, y + 13.0) } else { above };
            numbers.push(at);
            names.push((at, format!("p{nth}")));
        }
    }
    curve.push(axes.at(last + 1.0, best));
    sheet.path(curve, Ink::line(BLACK, 1.2));
    for (at, name) in names {
        let wide = width(&name, LETTERS);
        sheet.rect([at.0 - 0.5 * wide - 0.5, at.1 - 0.78 * LETTERS, wide + 1.0, LETTERS], Ink::fill(WHITE));
        sheet.text(at, LETTERS, Anchor::Middle, name);
    }
    sheet.mark(Mark::Disc, axes.at(0.0, first.unwrap_or(0.0)), 2.6, Ink::fill(WHITE).edged(BLACK, 1.2));
    for (nth, (name, mark, ink)) in ROWS.into_iter().enumerate() {
        let y = rows_top + ROW * (nth as f64 + 0.5);
        let own: Vec<usize> = (0..attempts.len()).filter(|at| row(attempts[*at]) == nth).collect();
        sheet.line((left, y), (left + wide, y), Ink::line(LIGHT, 0.5));
        sheet.text((left - 5.0, y + 2.5), LETTERS, Anchor::End, format!("{name} {}", own.len()));
        for at in own {
            sheet.mark(mark, (axes.x(at as f64 + 1.0), y), 2.2, ink);
        }
    }
    let below = (left + 0.5 * wide, rows_top + ROW * ROWS.len() as f64 + 7.0);
    sheet.text(below, LETTERS, Anchor::Middle, "Proposal");
}

/// Quantity that is drawn along the chain, and how.
struct Quantity {
    name: &'static str,
    mark: Mark,
    colour: Rgb,
    /// Shift to the side of its program, so that bars do not hide each other.
    aside: f64,
    of: fn(&Gain) -> Option<Estimate>,
}

/// Draws what the programs of the chain gain over the parent, on the same held-out scenes.
fn on_held_out(sheet: &mut Figure, credit: &Credit, top: f64) {
    let steps: Vec<(f64, Option<&Gain>)> = credit
        .edits
        .iter()
        .zip(1_u32..)
        .map(|(edit, nth)| (f64::from(nth), edit.so_far.as_ref().and_then(|of| of.as_ref().ok())))
        .collect();
    let quantities = [
        Quantity { name: "attack", mark: Mark::Disc, colour: VERMILION, aside: -0.09, of: |gain| Some(gain.attack) },
        Quantity { name: "realism", mark: Mark::Square, colour: PURPLE, aside: 0.09, of: |gain| gain.realism },
    ];
    let ends = |of: &(f64, Option<&Gain>)| -> Vec<f64> {
        let both = of.1.iter().flat_map(|gain| [Some(gain.attack), gain.realism]).flatten();
        both.flat_map(|of| of.interval.unwrap_or([of.value; 2])).collect()
    };
    let last = steps.len() as f64;
    let axes = Axes {
        place: [CHAIN_LEFT, top, CHAIN_WIDE, HIGH],
        across: Scale::fixed(-0.4, last + 0.4, Vec::new()),
        up: Scale::over(steps.iter().flat_map(ends).chain([0.0]), 4),
    };
    axes.draw(sheet, "", "Change on held-out scenes");
    let zero = axes.y(0.0);
    sheet.line((CHAIN_LEFT, zero), (CHAIN_LEFT + CHAIN_WIDE, zero), Ink::line(GREY, 0.8));
    for (nth, _) in [(0.0, None)].iter().chain(&steps) {
        sheet.text((axes.x(*nth), top + HIGH + 11.0), LETTERS, Anchor::Middle, format!("p{nth:.0}"));
    }
    for Quantity { mark, colour, aside, of, .. } in &quantities {
        let mut way = vec![axes.at(*aside, 0.0)];
        for (nth, gain) in &steps {
            let Some(of) = gain.and_then(of) else { continue };
            let (x, y) = axes.at(nth + aside, of.value);
            if let Some([low, high]) = of.interval {
                sheet.line((x, axes.y(low)), (x, axes.y(high)), Ink::line(*colour, 1.0));
            }
            sheet.mark(*mark, (x, y), 2.4, Ink::fill(*colour));
            way.push((x, y));
        }
        sheet.path(way, Ink::line(*colour, 0.7));
    }
    let entries = quantities.map(|of| (of.mark, Ink::fill(of.colour), of.name));
    legend::row(sheet, CHAIN_LEFT, top + HIGH + 26.0, &entries);
    let said = ["p0 is the parent, the last is reported.", "Bars: 95 % over scenes."];
    for (line, y) in said.into_iter().zip([39.0, 49.0]) {
        let (size, anchor, bold, upwards) = (7.0, Anchor::Start, false, false);
        let at = (CHAIN_LEFT, top + HIGH + y);
        sheet.words(Words { at, size, anchor, bold, colour: GREY, upwards, text: line.into() });
    }
}

fn step_ticks(count: usize) -> Vec<f64> {
    let scale = Scale::over([0.0, count as f64], 8);
    scale.ticks.into_iter().filter(|tick| *tick <= count as f64 + 0.5).collect()
}

/// The chain in words: what each patch of it does, what its proposer expected, and where that began.
fn patches(sheet: &mut Figure, run: &RecordedRun, chain: &[&Program]) {
    let mut y = sheet.height + 6.0;
    if chain.len() <= 1 {
        let text = "The parent itself is reported: no descendant was chosen, so there is no patch to tell.";
        sheet.text((8.0, y), LETTERS, Anchor::Start, text);
        sheet.height = y + 4.0;
        return;
    }
    let left_out = chain.len().saturating_sub(1 + TOLD_MAX);
    for (nth, pair) in chain.windows(2).enumerate().skip(left_out) {
        let [before, after] = pair else { continue };
        let Some(patch) = made(run, &after.solution_id).and_then(|attempt| attempt.proposal.patch()) else { continue };
        sheet.heading((8.0, y), LETTERS, format!("p{}", nth + 1));
        let room = WIDE - 36.0;
        for line in wrapped(&patch_in_words(before, after), LETTERS, room, usize::MAX) {
            sheet.text((28.0, y), LETTERS, Anchor::Start, line);
            y += 9.5;
        }
        // A stand-in expects nothing, and a draw neither: their words repeat the patch.
        let by_rule = matches!(run.proposer().as_str(), "scripted" | "random");
        let expected = format!("Its proposer expected: {}", in_font(patch.hypothesis.trim()));
        let lines = if by_rule { Vec::new() } else { whole_sentences(&expected, 7.0, room, LINES_MAX) };
        for line in lines {
            let (size, anchor, bold, upwards) = (7.0, Anchor::Start, false, false);
            sheet.words(Words { at: (28.0, y), size, anchor, bold, colour: GREY, upwards, text: line });
            y += 8.5;
        }
        y += 3.0;
    }
    if left_out > 0 {
        let text = format!("{left_out} earlier patches of the chain are left out.");
        sheet.text((8.0, y), LETTERS, Anchor::Start, text);
        y += 9.5;
    }
    sheet.height = y - 4.0;
}

fn made<'s>(run: &'s RecordedRun, solution: &SolutionId) -> Option<&'s Attempt> {
    run.attempts
        .iter()
        .find(|attempt| attempt.exit.candidate().is_some_and(|candidate| candidate.program.solution_id == *solution))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::draw::Shape;
    use crate::evidence::credit::EditCredit;

    fn gain(attack: f64, realism: f64) -> Gain {
        let estimate = |value: f64| Estimate { interval: Some([value - 0.01, value + 0.01]), ..Estimate::plain(value) };
        Gain { attack: estimate(attack), realism: Some(estimate(realism)), differing: 1 }
    }

    /// Heights of the marks of attack, and of realism, from the left.
    fn heights(so_far: [Option<Gain>; 3]) -> [Vec<f64>; 2] {
        let alone = || Ok(gain(0.9, 0.9));
        let edit = |of: Option<Gain>| EditCredit {
            name: "a/e0s0".into(),
            what: Vec::new(),
            so_far: of.map(Ok),
            taken_out: alone(),
            alone: alone(),
        };
        let (program, parent) = (SolutionId("a/e0s2".into()), SolutionId("a/parent".into()));
        let credit = Credit {
            program,
            parent,
            scenes: 9,
            whole: gain(0.3, 0.02),
            edits: so_far.map(edit).into_iter().collect(),
        };
        let mut sheet = Figure::new(WIDE, 2.0, String::new());
        on_held_out(&mut sheet, &credit, 0.0);
        // The legend's marks stand below the plot.
        let plot = |y: &f64| *y < HIGH;
        let disc = |shape: &Shape| match shape {
            Shape::Disc((_, y), _, _) => Some(*y),
            _ => None,
        };
        let square = |shape: &Shape| match shape {
            Shape::Rect([_, y, wide, high], ink) if wide == high && ink.fill == Some(PURPLE) => Some(y + 0.5 * high),
            _ => None,
        };
        [
            sheet.shapes.iter().filter_map(disc).filter(plot).collect(),
            sheet.shapes.iter().filter_map(square).filter(plot).collect(),
        ]
    }

    #[test]
    fn marks_stand_as_high_as_what_the_chain_came_to_so_far() {
        let way = [Some(gain(-0.1, 0.0)), Some(gain(0.1, 0.1)), Some(gain(0.3, -0.1))];
        let [attack, realism] = heights(way.clone());
        let [first, second, third] = attack[..] else { panic!("{attack:?}") };
        // Equal steps of attack are equal steps of the axis, upwards.
        assert!(first > second && (first - second - (second - third)).abs() < 1e-9, "{attack:?}");
        let [flat, up, down] = realism[..] else { panic!("{realism:?}") };
        assert!((up - second).abs() < 1e-9 && (down - first).abs() < 1e-9 && flat > up && flat < down, "{realism:?}");
        // Where nothing is known, nothing stands.
        let [attack, _] = heights([way[0].clone(), None, way[2].clone()]);
        assert_eq!(attack.len(), 2);
    }
}
