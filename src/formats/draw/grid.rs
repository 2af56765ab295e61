//! Many scenes on one sheet, a panel each: a rollout in one frame, with earlier places of ego and adversaries as outlines.

use super::drawing::{Actor, Drawing, Role};
use super::figure::{Anchor, Figure, GREY, Ink, Mark, Words};
use super::helvetica::{width, wrapped};
use super::panel::{Panel, colour, panel};
use crate::kernel::Vec2;

/// How a grid is made.
#[derive(Clone, Debug, PartialEq)]
pub struct GridOptions {
    /// Panels side by side.
    pub columns: usize,
    /// Width of a panel, points.
    pub panel_pt: f64,
    /// Margin around ego and adversaries, metres.
    pub around_m: f64,
    /// Title below the panels; may be empty.
    pub title: String,
}

/// A scene of the grid.
#[derive(Clone, Debug, PartialEq)]
pub struct Cell {
    /// Name of the scene.
    pub name: String,
    /// Its end, in words.
    pub caption: String,
    /// Its road, and everybody's motion up to the end.
    pub drawing: Drawing,
}

const GAP_PT: f64 = 6.0;
const LETTERS_PT: f64 = 7.0;
/// Height of a panel by its width, and of the lines below it.
const HIGH: f64 = 0.62;
const LINES_PT: f64 = 22.0;
/// Head of the sheet, with the roles.
const HEAD_PT: f64 = 16.0;
/// Seconds from one outline to the next, and the most outlines: earlier ones cover the road and add little.
const GHOST_S: f64 = 0.5;
const GHOSTS_MAX: usize = 6;
/// Least and largest width of the part of the world in a panel, metres.
const WIDTH_M: (f64, f64) = (30.0, 120.0);

/// Returns the grid as a sheet of shapes. The same cells and options give the same sheet.
pub fn grid(cells: &[Cell], options: &GridOptions) -> Figure {
    let columns = options.columns.clamp(1, cells.len().max(1));
    let (wide, high) = (options.panel_pt, options.panel_pt * HIGH);
    let rows = cells.len().div_ceil(columns);
    let row_pt = high + LINES_PT + GAP_PT;
    let across = columns as f64 * (wide + GAP_PT) - GAP_PT;
    let title = if options.title.is_empty() { "driving scenes" } else { &options.title };
    let mut sheet = Figure::new(across, HEAD_PT + rows as f64 * row_pt, title);
    key(&mut sheet, cells);
    for (at, cell) in cells.iter().enumerate() {
        let left = (at % columns) as f64 * (wide + GAP_PT);
        let top = HEAD_PT + (at / columns) as f64 * row_pt;
        let moment = moment(&cell.drawing);
        let ghosts = ghosts(&cell.drawing, moment);
        let (middle, width_m) = frame(&cell.drawing, moment, &ghosts, options.around_m);
        panel(
            &mut sheet,
            &cell.drawing,
            &Panel { place: [left, top, wide, high], middle, width_m, step: moment, ghosts },
        );
        let said = [(&cell.name, crate::draw::BLACK), (&cell.caption, GREY)];
        for (line, (text, ink)) in said.into_iter().enumerate() {
            let text = wrapped(text, LETTERS_PT, wide, 1).pop().unwrap_or_default();
            let at = (left, top + high + 8.5 + 9.0 * line as f64);
            let (size, anchor, bold, upwards) = (LETTERS_PT, Anchor::Start, false, false);
            sheet.words(Words { at, size, anchor, bold, colour: ink, upwards, text });
        }
    }
    for line in wrapped(&options.title, LETTERS_PT, across, 3) {
        sheet.text((0.0, sheet.height + LETTERS_PT), LETTERS_PT, Anchor::Start, line);
        sheet.height += LETTERS_PT + 2.0;
    }
    sheet.height += 2.0;
    sheet
}

/// Draws the roles that occur, in the colours of the panels.
fn key(sheet: &mut Figure, cells: &[Cell]) {
    let occurs = |role: Role| cells.iter().any(|cell| cell.drawing.actors.iter().any(|actor| actor.role == role));
    let named = [Role::Ego, Role::Adversary, Role::Cyclist, Role::Pedestrian, Role::Traffic];
    let mut x = 0.0;
    for role in named.into_iter().filter(|role| occurs(*role)) {
        sheet.mark(Mark::Square, (x + 3.0, 6.0), 3.0, Ink::fill(colour(role)));
        sheet.text((x + 9.0, 8.6), LETTERS_PT, Anchor::Start, role.label());
        x += 20.0 + width(role.label(), LETTERS_PT);
    }
}

/// Returns the step of the contact, or of the end.
fn moment(drawing: &Drawing) -> usize {
    let last = drawing.steps.saturating_sub(1);
    drawing.contact.as_ref().map_or(last, |contact| contact.step.min(last))
}

/// Returns the steps before the moment whose outlines are drawn, the latest first.
fn ghosts(drawing: &Drawing, moment: usize) -> Vec<usize> {
    let apart = ((GHOST_S / drawing.dt_s.max(1e-3)).round() as usize).max(1);
    let back = (1..=GHOSTS_MAX).map_while(|nth| moment.checked_sub(nth * apart));
    back.take_while(|step| *step >= drawing.current_step).collect()
}

/// Returns middle and width of the panel: ego and adversaries now and at their outlines, the ego's place in the middle of all.
fn frame(drawing: &Drawing, moment: usize, ghosts: &[usize], around_m: f64) -> (Vec2, f64) {
    let leading = drawing.actors.iter().filter(|actor| matches!(actor.role, Role::Ego | Role::Adversary));
    let places: Vec<Vec2> =
        leading.flat_map(|actor| ghosts.iter().chain([&moment]).filter_map(|step| place_at(actor, *step))).collect();
    let ends = |of: fn(&Vec2) -> f64| {
        places.iter().map(of).fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)))
    };
    let ((left, right), (low, high)) = (ends(|p| p.x), ends(|p| p.y));
    if places.is_empty() {
        return (Vec2::ZERO, WIDTH_M.1);
    }
    let wide = (right - left + 2.0 * around_m).max((high - low + 2.0 * around_m) / HIGH);
    (Vec2::new(0.5 * (left + right), 0.5 * (low + high)), wide.clamp(WIDTH_M.0, WIDTH_M.1))
}

fn place_at(actor: &Actor, step: usize) -> Option<Vec2> {
    let [x, y, ..] = (*actor.samples.get(step)?)?;
    Some(Vec2::new(x, y))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::draw::{Contact, Shape};

    fn cell(contact: Option<usize>) -> Cell {
        let moving = |role, x: f64| Actor {
            label: "a".into(),
            role,
            length_m: 4.0,
            width_m: 2.0,
            samples: (0..40).map(|k| Some([x + f64::from(k), 0.0, 0.0, 10.0])).collect(),
        };
        let contact = contact.map(|step| Contact { step, point: Vec2::new(step as f64, 0.0), label: "met".into() });
        let actors = vec![moving(Role::Ego, 0.0), moving(Role::Adversary, 8.0), moving(Role::Traffic, 15.0)];
        let drawing = Drawing { dt_s: 0.1, steps: 40, actors, contact, ..Drawing::default() };
        Cell { name: "a scene".into(), caption: "as it ended".into(), drawing }
    }

    fn boxes(sheet: &Figure) -> Vec<usize> {
        let closed = |shapes: &Vec<Shape>| {
            shapes.iter().filter(|s| matches!(s, Shape::Path(points, _) if points.len() == 5)).count()
        };
        let of = |shape: &Shape| if let Shape::Within(_, shapes) = shape { Some(closed(shapes)) } else { None };
        sheet.shapes.iter().filter_map(of).collect()
    }

    #[test]
    fn a_panel_ends_at_the_contact_and_shows_where_both_were_before() {
        let options = GridOptions { columns: 2, panel_pt: 120.0, around_m: 8.0, title: String::new() };
        let sheet = grid(&[cell(Some(12)), cell(None), cell(Some(1))], &options);
        // Three boxes with their windscreens now; outlines of two at 0.7 s and 0.2 s, at six places, at none.
        assert_eq!(boxes(&sheet), [10, 18, 6]);
        assert_eq!(grid(&[cell(Some(12))], &options).width, 120.0, "no empty columns");
        assert!(super::super::pdf(&sheet).is_ok());
    }

    #[test]
    fn nobody_who_matters_leaves_the_frame() {
        let of = cell(None).drawing;
        let steps = ghosts(&of, 39);
        let (middle, width_m) = frame(&of, 39, &steps, 5.0);
        for actor in &of.actors[..2] {
            for step in steps.iter().chain([&39]) {
                let place = place_at(actor, *step).unwrap();
                assert!((place.x - middle.x).abs() + 5.0 <= 0.5 * width_m + 1e-9, "{place:?} of {width_m}");
            }
        }
    }
}
