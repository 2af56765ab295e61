//! fig:method-architecture: the loop of an epoch, drawn from the verbs and rooms that docs/ARCHITECTURE.md names. A test holds these to the
//! calls of `epoch/run.rs`.

use super::error::FigureError;
use crate::draw::{Anchor, BLACK, BLUE, Figure, GREEN, GREY, Ink, ORANGE, Rgb, VERMILION, WHITE, Words, wrapped};

const PAGE: &str = include_str!("../../../../docs/ARCHITECTURE.md");

/// A step of a patch's way.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Step {
    /// The verb, as the code calls it.
    pub verb: String,
    /// Room in which it lives.
    pub room: String,
}

/// The steps that the page names in the block below its heading: a line of verbs with arrows between, below it a line of rooms.
pub fn steps(page: &str) -> Vec<Step> {
    let block = page
        .lines()
        .skip_while(|line| !line.starts_with("## A patch's journey"))
        .skip_while(|line| !line.starts_with("```"));
    let mut lines = block.skip(1);
    let verbs = lines.next().unwrap_or_default().split('→').filter_map(|part| part.split_whitespace().next());
    let mut rooms: Vec<String> = Vec::new();
    for word in lines.next().unwrap_or_default().split_whitespace() {
        match rooms.last_mut().filter(|room| room.ends_with(',')) {
            Some(room) => room.push_str(&format!(" {word}")),
            None => rooms.push(word.to_string()),
        }
    }
    verbs.zip(rooms).map(|(verb, room)| Step { verb: verb.to_string(), room }).collect()
}

/// Explains a step in the words of a reader who has not seen the code.
fn explained(verb: &str) -> Option<&'static str> {
    Some(match verb {
        "freeze" => "parent, front, memory, window",
        "propose" => "actor, critics, repair: a patch",
        "admit" => "apply, gates, compile",
        "route" => "who gets a rollout",
        "evaluate" => "closed loop: labels",
        "consider" => "paired gain over the front",
        "seal" => "attempt into the hash chain",
        "settle" => "archive, lineage, memory",
        _ => return None,
    })
}

/// Ends of an attempt before there is a label, in the order of the steps after the first.
const WAYS_OUT: [&str; 3] = ["declined", "invalid", "rejected"];

const WIDE: f64 = 244.0;
const HIGH: f64 = 172.0;
/// Boxes of a row, their size, and the tops of both rows, points.
const IN_A_ROW: usize = 4;
const BOX: [f64; 2] = [52.0, 38.0];
const EDGE: f64 = 4.0;
const TOPS: [f64; 2] = [18.0, 93.0];
/// The bar that every proposal ends in.
const BAR: [f64; 2] = [69.0, 14.0];
const LETTERS: f64 = 7.0;
const ARROW: f64 = 3.0;

/// The loop as a diagram for one column of a page.
pub fn method() -> Result<Figure, FigureError> {
    drawn(&steps(PAGE))
}

fn left(column: usize) -> f64 {
    EDGE + column as f64 * (BOX[0] + (WIDE - 2.0 * EDGE - IN_A_ROW as f64 * BOX[0]) / (IN_A_ROW - 1) as f64)
}

fn middle(column: usize) -> f64 {
    left(column) + 0.5 * BOX[0]
}

fn drawn(steps: &[Step]) -> Result<Figure, FigureError> {
    if steps.len() != 2 * IN_A_ROW || steps.iter().any(|step| explained(&step.verb).is_none()) {
        return Err(FigureError::NoJourney);
    }
    let mut sheet = Figure::new(WIDE, HIGH, "An epoch of the loop");
    band(&mut sheet, 1, 3, [TOPS[0] - 14.0, BOX[1] + 17.0], BLUE, "K slots in parallel, one snapshot");
    for (at, step) in steps.iter().enumerate() {
        // The second row runs back to the left.
        let (row, column) = if at < IN_A_ROW { (0, at) } else { (1, 2 * IN_A_ROW - 1 - at) };
        let colour = match row {
            0 if column == 0 => GREY,
            0 => BLUE,
            _ if column == IN_A_ROW - 1 => GREEN,
            _ => ORANGE,
        };
        step_box(&mut sheet, left(column), TOPS[row], step, colour);
    }
    let line = Ink::line(BLACK, 0.9);
    for column in 0..IN_A_ROW - 1 {
        let (end, next) = (left(column) + BOX[0], left(column + 1));
        arrow(&mut sheet, (end, TOPS[0] + 18.0), (next, TOPS[0] + 18.0), line);
        arrow(&mut sheet, (next, TOPS[1] + 18.0), (end, TOPS[1] + 18.0), line);
    }
    sheet.rect([left(1), BAR[0], left(3) - left(1) - 8.0, BAR[1]], Ink::fill(pale(VERMILION)).edged(VERMILION, 0.6));
    let bar = (0.5 * (left(1) + left(3) - 8.0), BAR[0] + 9.8);
    text(&mut sheet, bar, Anchor::Middle, BLACK, "every proposal is an attempt");
    // Three ways out before there is a label; who has one goes on.
    for (column, exit) in WAYS_OUT.iter().enumerate() {
        // The router's way out begins left of its way on.
        let x = if column + 2 == IN_A_ROW { left(3) - 2.0 } else { middle(column + 1) - 12.0 };
        let from = TOPS[0] + BOX[1];
        let to = if column + 2 == IN_A_ROW { (left(3) - 8.0, BAR[0] + 7.0) } else { (x, BAR[0]) };
        let path =
            if column + 2 == IN_A_ROW { vec![(left(3) + 8.0, from), (left(3) + 8.0, to.1)] } else { vec![(x, from)] };
        let last = path.last().copied().unwrap_or(to);
        sheet.path(path, Ink::line(VERMILION, 0.8));
        arrow(&mut sheet, last, to, Ink::line(VERMILION, 0.8));
        let beside = if column + 2 == IN_A_ROW { left(3) + 10.5 } else { x + 2.5 };
        text(&mut sheet, (beside, from + 9.0), Anchor::Start, VERMILION, exit);
    }
    let down = left(3) + BOX[0] - 5.0;
    arrow(&mut sheet, (down, TOPS[0] + BOX[1]), (down, TOPS[1]), line);
    let up = middle(0);
    arrow(&mut sheet, (up, TOPS[1]), (up, TOPS[0] + BOX[1]), line);
    for (nth, words) in ["next", "epoch"].into_iter().enumerate() {
        text(&mut sheet, (up - 4.0, 0.5 * (TOPS[0] + BOX[1] + TOPS[1]) + 8.0 * nth as f64), Anchor::End, BLACK, words);
    }
    arrow(&mut sheet, (middle(1), BAR[0] + BAR[1]), (middle(1), TOPS[1]), Ink::line(VERMILION, 0.8));
    text(&mut sheet, (middle(2), TOPS[1] - 4.0), Anchor::Middle, ORANGE, "serial");
    let foot = TOPS[1] + BOX[1] + 7.0;
    sheet.rect([EDGE, foot, WIDE - 2.0 * EDGE, HIGH - foot - 4.0], Ink::line(GREY, 0.8).dashed());
    let after = "After the last epoch: finalists are labelled on all evolution scenes, one rule chooses; only then are the held-out \
                 scenes opened.";
    for (nth, line) in wrapped(after, LETTERS, WIDE - 2.0 * EDGE - 10.0, 4).into_iter().enumerate() {
        text(&mut sheet, (EDGE + 5.0, foot + 10.0 + 8.5 * nth as f64), Anchor::Start, BLACK, &line);
    }
    Ok(sheet)
}

fn pale(colour: Rgb) -> Rgb {
    colour.map(|part| 255 - (255 - part) / 6)
}

fn band(sheet: &mut Figure, first: usize, last: usize, [top, high]: [f64; 2], colour: Rgb, words: &str) {
    sheet.rect([left(first) - 3.0, top, left(last) + BOX[0] - left(first) + 6.0, high], Ink::fill(pale(colour)));
    text(sheet, (left(first), top + 9.5), Anchor::Start, colour, words);
}

fn step_box(sheet: &mut Figure, x: f64, y: f64, step: &Step, colour: Rgb) {
    sheet.rect([x, y, BOX[0], BOX[1]], Ink::fill(WHITE).edged(colour, 1.0));
    sheet.heading((x + 3.0, y + 9.5), 8.0, step.verb.as_str());
    for (nth, line) in
        wrapped(explained(&step.verb).unwrap_or_default(), LETTERS, BOX[0] - 5.0, 4).into_iter().enumerate()
    {
        text(sheet, (x + 3.0, y + 18.5 + 8.0 * nth as f64), Anchor::Start, BLACK, &line);
    }
}

fn text(sheet: &mut Figure, at: (f64, f64), anchor: Anchor, colour: Rgb, text: &str) {
    sheet.words(Words { at, size: LETTERS, anchor, bold: false, colour, upwards: false, text: text.into() });
}

/// A line with a head at its end.
fn arrow(sheet: &mut Figure, from: (f64, f64), to: (f64, f64), ink: Ink) {
    let (dx, dy) = (to.0 - from.0, to.1 - from.1);
    let far = dx.abs().max(dy.abs()).max(1e-9);
    let (dx, dy) = (ARROW * dx / far, ARROW * dy / far);
    sheet.line(from, (to.0 - dx, to.1 - dy), ink);
    let colour = ink.stroke.map_or(BLACK, |(colour, _)| colour);
    let corner = |side: f64| (to.0 - dx - 0.6 * side * dy, to.1 - dy + 0.6 * side * dx);
    sheet.path(vec![corner(1.0), to, corner(-1.0), corner(1.0)], Ink::fill(colour));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::draw::{Shape, pdf, width};

    #[test]
    fn the_steps_are_those_of_the_page_and_the_code_calls_each() {
        let all = steps(PAGE);
        let verbs: Vec<&str> = all.iter().map(|step| step.verb.as_str()).collect();
        assert_eq!(verbs, ["freeze", "propose", "admit", "route", "evaluate", "consider", "seal", "settle"]);
        assert_eq!(all[7].room, "lineage, memory, world");
        let code = include_str!("../../../evolve/epoch/run.rs");
        for verb in verbs {
            // The router's part is a folder of two calls, all others are one.
            let call = if verb == "route" { "slots::route::".to_string() } else { format!("{verb}(") };
            assert!(code.contains(&call), "{call}");
        }
        assert!(WAYS_OUT.iter().all(|way| PAGE.contains(&format!("*{way}* ("))), "the ways out are those of the page");
    }

    #[test]
    fn a_page_without_a_journey_or_with_a_step_that_nobody_explains_gives_no_figure() {
        assert!(drawn(&steps("no page")).is_err());
        let mut all = steps(PAGE);
        all[2].verb = "wave".into();
        assert!(drawn(&all).is_err());
    }

    #[test]
    fn it_is_legible_at_the_width_of_a_column() {
        let figure = method().unwrap();
        assert!(figure.width <= 246.0 && pdf(&figure).is_ok());
        for shape in &figure.shapes {
            let Shape::Text(words) = shape else { continue };
            assert!(words.size >= LETTERS, "{words:?}");
            let room = width(&words.text, words.size);
            let from = match words.anchor {
                Anchor::Start => words.at.0,
                Anchor::Middle => words.at.0 - 0.5 * room,
                Anchor::End => words.at.0 - room,
            };
            assert!(from >= 0.0 && from + room <= figure.width && words.at.1 <= figure.height, "{words:?}");
        }
    }
}
