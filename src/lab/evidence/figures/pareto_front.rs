//! Attack against realism of a run's programs, a panel a lineage: the parent, every evaluated descendant, the front after the last epoch,
//! and the program that is reported.

use super::error::FigureError;
use super::legend::{self, source};
use crate::draw::{Axes, BLACK, BLUE, Figure, GREY, Ink, Mark, ORANGE, SKY, Scale, VERMILION, WHITE};
use crate::evidence::recorded_run::RecordedRun;
use crate::evidence::tables::{called, csv_line};
use crate::objects::{LineageId, Objectives, Score, SolutionId};

/// Most lineages of a sheet.
const PANELS_MAX: usize = 12;
/// Panels side by side, and the room of one, points.
const BESIDE: usize = 2;
const ROOM: [f64; 2] = [230.0, 178.0];

/// A program at its place.
#[derive(Clone, Debug, PartialEq)]
struct Point {
    lineage: LineageId,
    program: SolutionId,
    objectives: Objectives,
    coverage: Option<f64>,
    /// Number of scenes that its labels are of; `None` for those of the front, which are of all windows.
    scenes: Option<usize>,
    is_parent: bool,
    accepted: bool,
    on_front: bool,
    reported: bool,
}

/// The programs of one lineage that act, the parent first, then its descendants in their order. Who stands on the front has the labels of
/// all windows, who was compared at the end those of the whole evolution pool, any other those that decided about it.
fn points(run: &RecordedRun, lineage: &LineageId) -> Vec<Point> {
    let result = run.result.iter().flat_map(|result| &result.lineages).find(|of| of.lineage == *lineage);
    let parent = run.parents.iter().find(|parent| parent.lineage == *lineage).map(|of| &of.program.solution_id);
    let one = |program: &SolutionId, own: Option<&Score>, accepted: bool| -> Option<Point> {
        let front = result.and_then(|of| of.front.iter().find(|point| point.solution == *program));
        let compared = run.finalists.iter().find(|of| of.lineage == *lineage && of.solution == *program);
        let score = compared.map(|of| &of.score).or(own);
        let acts = score.is_none_or(|score| score.coverage > 0.0);
        Some(Point {
            lineage: lineage.clone(),
            program: program.clone(),
            objectives: front.map(|point| point.objectives).or(score.map(|score| score.objectives)).filter(|_| acts)?,
            coverage: score.map(|score| score.coverage),
            scenes: if front.is_some() { None } else { score.map(|score| score.scenes.len()) },
            is_parent: parent == Some(program),
            accepted,
            on_front: front.is_some(),
            reported: result.is_some_and(|of| of.evolved.solution == *program),
        })
    };
    let first = run.frozen.iter().find(|of| of.lineage == *lineage && Some(&of.parent) == parent);
    let start = parent.and_then(|parent| one(parent, first.map(|of| &of.parent_score), false));
    let attempts = run.attempts.iter().filter(|attempt| attempt.lineage == *lineage);
    let descendants = attempts.filter_map(|attempt| {
        let (candidate, decision) = (attempt.exit.candidate()?, attempt.exit.decision()?);
        one(&candidate.program.solution_id, attempt.exit.score(), decision.gates.any())
    });
    start.into_iter().chain(descendants).collect()
}

/// The programs of a lineage, under the name that figures give it.
type Named = (String, Vec<Point>);

/// A panel a lineage, of all or of those that are named, with the points as CSV: one line a program.
pub fn pareto_front(runs: &[RecordedRun], named: &[LineageId]) -> Result<(Figure, String), FigureError> {
    let of = |run: &RecordedRun| -> Vec<LineageId> { run.parents.iter().map(|of| of.lineage.clone()).collect() };
    let known: Vec<LineageId> = runs.iter().flat_map(of).collect();
    if let Some(wanted) = named.iter().find(|wanted| !known.contains(wanted)) {
        let known = known.iter().map(ToString::to_string).collect();
        return Err(FigureError::NoLineage { wanted: wanted.clone(), known });
    }
    let lineages = |run: &RecordedRun| -> Vec<Named> {
        let meant = |id: &&LineageId| named.is_empty() || named.contains(id);
        of(run).iter().filter(meant).map(|id| (called(run, id), points(run, id))).collect()
    };
    let all: Vec<Named> = runs.iter().flat_map(lineages).filter(|(_, points)| !points.is_empty()).collect();
    if all.is_empty() {
        return Err(FigureError::NoLabels);
    }
    if all.len() > PANELS_MAX {
        let known = all.iter().map(|(_, points)| points[0].lineage.to_string()).collect();
        return Err(FigureError::TooManyLineages { most: PANELS_MAX, known });
    }
    let realism =
        runs.iter().find(|run| !run.rounds.is_empty()).or(runs.first()).map_or("realism", |run| run.realism_name());
    let shown: Vec<&RecordedRun> = runs.iter().collect();
    Ok((drawn(&all, realism, &source(&shown)), data(&all)))
}

fn data(all: &[Named]) -> String {
    let head = "lineage,program,attack,realism,coverage,scenes,parent,accepted,on_front,reported\n";
    let line = |of: &Point| {
        csv_line(&[
            of.lineage.to_string(),
            of.program.to_string(),
            of.objectives.attack.to_string(),
            of.objectives.realism.to_string(),
            of.coverage.map_or(String::new(), |coverage| coverage.to_string()),
            of.scenes.map_or("all windows".into(), |scenes| scenes.to_string()),
            of.is_parent.to_string(),
            of.accepted.to_string(),
            of.on_front.to_string(),
            of.reported.to_string(),
        ])
    };
    head.to_string() + &all.iter().flat_map(|(_, points)| points).map(line).collect::<String>()
}

fn drawn(all: &[Named], realism: &str, source: &str) -> Figure {
    let columns = all.len().min(BESIDE);
    let (rows, wide) = (all.len().div_ceil(BESIDE), if columns == 1 { 330.0 } else { ROOM[0] * columns as f64 + 10.0 });
    let mut sheet = Figure::new(
        wide,
        40.0 + ROOM[1] * rows as f64,
        format!("Attack and {realism} of programs, with the Pareto front"),
    );
    let signs = [
        (Mark::Disc, Ink::line(GREY, 0.8), "not accepted"),
        (Mark::Disc, Ink::fill(SKY), "accepted"),
        (Mark::Disc, Ink::fill(BLUE), "on the front"),
        (Mark::Diamond, Ink::fill(ORANGE).edged(BLACK, 0.6), "parent"),
    ];
    let end = legend::row(&mut sheet, 10.0, 14.0, &signs);
    let reported = [(Mark::Disc, Ink::line(VERMILION, 1.2), "reported")];
    // On a narrow sheet the last sign has a line of its own.
    let (x, y) = if end + 50.0 < wide { (end, 14.0) } else { (10.0, 25.0) };
    legend::row(&mut sheet, x, y, &reported);
    // One scale for all panels: who stands higher in one is more realistic than who stands lower in another.
    let numbers =
        |of: fn(&Objectives) -> f64| all.iter().flat_map(|(_, points)| points).map(move |point| of(&point.objectives));
    let across = Scale::over(numbers(|of| of.attack).chain([0.0]), 5).widened(0.03);
    let up = Scale::over(numbers(|of| of.realism), 5).widened(0.03);
    for (at, (name, points)) in all.iter().enumerate() {
        let left = ROOM[0] * (at % BESIDE) as f64 + 50.0;
        let top = 46.0 + ROOM[1] * (at / BESIDE) as f64;
        let size = if columns == 1 { 265.0 } else { ROOM[0] - 62.0 };
        let axes = Axes { place: [left, top, size, ROOM[1] - 54.0], across: across.clone(), up: up.clone() };
        panel(&mut sheet, &axes, name, points, realism);
    }
    let note = format!(
        "Upwards more realistic ({realism}), to the right more attack; programs that act nowhere are left out. Front: not dominated after the \
         last epoch, on the scenes of all windows. Parent and reported program: on the whole evolution pool. Any other: on the scenes that \
         decided about it, so it may lie beyond the front. {source}"
    );
    legend::foot(&mut sheet, &note);
    sheet
}

fn panel(sheet: &mut Figure, axes: &Axes, name: &str, points: &[Point], realism: &str) {
    let [left, top, ..] = axes.place;
    sheet.heading((left, top - 6.0), 8.0, name);
    axes.draw(sheet, "Attack", realism);
    let at = |of: &Point| axes.at(of.objectives.attack, of.objectives.realism);
    let marked = |sheet: &mut Figure, which: &dyn Fn(&Point) -> bool, mark: Mark, r: f64, ink: Ink| {
        points.iter().filter(|point| which(point)).for_each(|point| sheet.mark(mark, at(point), r, ink));
    };
    marked(sheet, &|of| !of.is_parent && !of.accepted && !of.on_front, Mark::Disc, 1.6, Ink::line(GREY, 0.6));
    marked(sheet, &|of| !of.is_parent && of.accepted && !of.on_front, Mark::Disc, 1.9, Ink::fill(SKY));
    sheet.path(steps(axes, points), Ink::line(BLUE, 1.0));
    marked(sheet, &|of| of.on_front && !of.is_parent, Mark::Disc, 2.4, Ink::fill(BLUE).edged(WHITE, 0.4));
    marked(sheet, &|of| of.is_parent, Mark::Diamond, 2.8, Ink::fill(ORANGE).edged(BLACK, 0.6));
    marked(sheet, &|of| of.reported, Mark::Disc, 5.0, Ink::line(VERMILION, 1.2));
}

/// The edge of what the front dominates: level from each of its points to the left, down to the next.
fn steps(axes: &Axes, points: &[Point]) -> Vec<(f64, f64)> {
    let mut front: Vec<Objectives> = points.iter().filter(|of| of.on_front).map(|of| of.objectives).collect();
    front.sort_by(|a, b| a.attack.total_cmp(&b.attack).then(b.realism.total_cmp(&a.realism)));
    let [left, top, _, high] = axes.place;
    let mut path: Vec<(f64, f64)> = Vec::new();
    for of in &front {
        let (x, y) = axes.at(of.attack, of.realism);
        path.push((path.last().map_or(left, |last| last.0), y));
        path.push((x, y));
    }
    path.extend(path.last().map(|last| (last.0, top + high)));
    path
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::draw::{Shape, pdf};

    fn point(program: &str, attack: f64, realism: f64) -> Point {
        Point {
            lineage: LineageId::new("cat-idm"),
            program: SolutionId::new(program),
            objectives: Objectives { attack, realism },
            coverage: Some(1.0),
            scenes: Some(16),
            is_parent: program == "parent",
            accepted: program != "parent",
            on_front: program.starts_with('f'),
            reported: program == "f2",
        }
    }

    fn points() -> Vec<Point> {
        let all = [("parent", 0.1, 0.9), ("a", 0.15, 0.91), ("f1", 0.2, 0.95), ("f2", 0.3, 0.93), ("f3", 0.4, 0.9)];
        all.map(|(name, attack, realism)| point(name, attack, realism)).to_vec()
    }

    fn named() -> Named {
        ("CAT against IDM".into(), points())
    }

    #[test]
    fn the_front_is_a_stair_that_falls_to_the_right() {
        let axes = Axes {
            place: [0.0, 0.0, 100.0, 100.0],
            across: Scale::fixed(0.0, 1.0, vec![]),
            up: Scale::fixed(0.0, 1.0, vec![]),
        };
        let mut shuffled = points();
        shuffled.reverse();
        let path: Vec<(i64, i64)> =
            steps(&axes, &shuffled).iter().map(|(x, y)| (x.round() as i64, y.round() as i64)).collect();
        assert_eq!(path, [(0, 5), (20, 5), (20, 7), (30, 7), (30, 10), (40, 10), (40, 100)]);
    }

    #[test]
    fn every_program_is_marked_once_in_its_kind_and_the_reported_one_has_a_ring() {
        let one = drawn(&[named()], "strict realism", "Recorded: none.");
        let discs = |ink: Ink, r: f64| {
            let is = |shape: &&Shape| matches!(shape, Shape::Disc(_, of, with) if *with == ink && *of == r);
            one.shapes.iter().filter(is).count()
        };
        assert_eq!(discs(Ink::fill(BLUE).edged(WHITE, 0.4), 2.4), 3, "on the front");
        assert_eq!(discs(Ink::fill(SKY), 1.9), 1, "accepted");
        assert_eq!(discs(Ink::line(VERMILION, 1.2), 5.0), 1, "reported");
        let bytes = pdf(&one).unwrap();
        assert!(
            bytes == pdf(&drawn(&[named()], "strict realism", "Recorded: none.")).unwrap(),
            "the same bytes each time"
        );
        let csv = data(&[named()]);
        assert_eq!(csv.lines().count(), 6);
        assert!(csv.contains("cat-idm,f2,0.3,0.93,1,16,false,true,true,true\n"), "{csv}");
    }
}
