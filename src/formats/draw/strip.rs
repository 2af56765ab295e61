//! A strip of moments side by side, as a figure of a paper shows a rollout: one SVG document, every panel a picture of the
//! same part of the world.

use std::fmt::Write as _;

use super::drawing::{Actor, Contact, Drawing, Role};
use super::figure::{Anchor, Figure};
use super::helvetica::wrapped;
use super::panel::{Panel, panel};
use super::player::escaped;
use super::svg::{Frame, SvgOptions, Theme, View, key_of_roles, roles_seen, told_moment};
use crate::kernel::{Extent, Vec2};

/// How a strip is made.
#[derive(Clone, Debug, PartialEq)]
pub struct StripOptions {
    /// Width of one panel, pixels.
    pub panel_px: f64,
    /// Colours.
    pub theme: Theme,
    /// The part of the world that all panels show.
    pub frame: Frame,
    /// Steps of the scene, one a panel.
    pub steps: Vec<usize>,
    /// Title below the panels; may be empty.
    pub title: String,
}

/// Room between panels, and below them for the title and the key of colours, pixels.
const GAP_PX: f64 = 8.0;
const CAPTION_PX: f64 = 22.0;
const FOOT_PX: f64 = 44.0;

/// Returns `count` steps from `first` to `last`, both among them, as even as possible; fewer where there are not so many.
pub fn even_steps(first: usize, last: usize, count: usize) -> Vec<usize> {
    let (count, span) = (count.max(1), last.saturating_sub(first));
    let mut steps: Vec<usize> = (0..count)
        .map(|k| first + if count == 1 { span } else { (2 * span * k + count - 1) / (2 * (count - 1)) })
        .collect();
    steps.dedup();
    steps
}

/// The last panels show the contact closely: their number, their width and the margin around its two road users, metres.
const CLOSE_PANELS: usize = 2;
const CLOSE_M: (f64, f64) = (36.0, 90.0);
const CLOSE_AROUND_M: f64 = 8.0;

/// Margin around the ways of ego and striker in the first panels, and their least width, wider than the close ones, metres.
const AROUND_WAYS_M: f64 = 10.0;
const WAYS_M: f64 = 54.0;

/// Returns the road user that meets the ego: the one nearest to the contact when it happens.
fn striker<'d>(drawing: &'d Drawing, contact: &Contact) -> Option<&'d Actor> {
    let away = |actor: &Actor| {
        let [x, y, ..] = (*actor.samples.get(contact.step)?)?;
        Some(Vec2::new(x, y).distance(contact.point))
    };
    let others = drawing.actors.iter().filter(|actor| !matches!(actor.role, Role::Ego | Role::Ghost));
    let placed = others.filter_map(|actor| Some((away(actor)?, actor)));
    placed.min_by(|(a, _), (b, _)| a.total_cmp(b)).map(|(_, actor)| actor)
}

/// Returns the part of the world in which ego and striker move until they meet: road users far away would make both too small to see.
fn meeting(drawing: &Drawing, steps: &[usize], contact: &Contact, whole: &View) -> View {
    let first = steps.first().copied().unwrap_or(0);
    let egos = drawing.actors.iter().filter(|actor| actor.role == Role::Ego);
    let ways = egos.chain(striker(drawing, contact)).flat_map(|actor| {
        let shown = actor.samples.iter().take(contact.step + 1).skip(first);
        shown.flatten().map(|sample| Vec2::new(sample[0], sample[1]))
    });
    let Extent { low, high } = Extent::around(ways.chain([contact.point]));
    let size = high - low;
    let wide = size.x.max(size.y * whole.width_px / whole.height_px) + 2.0 * AROUND_WAYS_M;
    whole.zoomed(low.lerp(high, 0.5), wide.max(WAYS_M).min(whole.width_m()))
}

/// Returns the view of the panel at an index of the strip. If there is a contact, the last panels show it, with ego and adversaries, and
/// the earlier ones show the ways of the two that meet.
fn view_of(drawing: &Drawing, options: &StripOptions, whole: &View, place: usize) -> View {
    let close = options.steps.len() > CLOSE_PANELS && place + CLOSE_PANELS >= options.steps.len();
    let Some(contact) = drawing.contact.as_ref() else {
        return whole.zoomed(whole.middle(), whole.width_m());
    };
    if !close {
        return meeting(drawing, &options.steps, contact, whole);
    }
    let step = options.steps[options.steps.len() - CLOSE_PANELS];
    let shape = whole.width_px / whole.height_px;
    let reach =
        drawing.actors.iter().filter(|actor| matches!(actor.role, Role::Ego | Role::Adversary)).filter_map(|actor| {
            let [x, y, ..] = (*actor.samples.get(step)?)?;
            let away = Vec2::new(x, y) - contact.point;
            Some(away.x.abs().max(away.y.abs() * shape) + CLOSE_AROUND_M)
        });
    let wide = 2.0 * reach.fold(0.0, f64::max);
    whole.zoomed(contact.point, wide.clamp(CLOSE_M.0, CLOSE_M.1).min(whole.width_m()))
}

/// Sizes of a strip on paper, points: of letters, between panels, and of the line below them.
const LETTERS_PT: f64 = 7.5;
const GAP_PT: f64 = 5.0;
const CAPTION_PT: f64 = 12.0;

/// Returns the strips as a sheet of shapes, for PDF: `panel_px` are points there, and it has light colours. Several strips lie below each
/// other, each under its line, as in [`strips`].
pub fn strip_figure(rows: &[(String, &Drawing)], options: &StripOptions) -> Figure {
    // The part of the world and its shape are those of the SVG.
    let all = together(rows);
    let view = View::of(&all, &SvgOptions { width_px: PANEL_OF_VIEW_PX, ..panel_options(options) });
    let wide = options.panel_px;
    let high = wide * view.height_px / view.width_px;
    let count = options.steps.len().max(1) as f64;
    let title = if options.title.is_empty() { "driving scene" } else { &options.title };
    let across = count * (wide + GAP_PT) - GAP_PT;
    let mut sheet = Figure::new(across, 0.0, title);
    for (line, drawing) in rows {
        for line in wrapped(line, LETTERS_PT, across, 2) {
            sheet.text((0.0, sheet.height + LETTERS_PT), LETTERS_PT, Anchor::Start, line);
            sheet.height += LETTERS_PT + 2.0;
        }
        let top = sheet.height;
        for (k, step) in options.steps.iter().enumerate() {
            let left = k as f64 * (wide + GAP_PT);
            let view = view_of(&all, options, &view, k);
            let place = [left, top, wide, high];
            let ghosts = Vec::new();
            let of = Panel { place, middle: view.middle(), width_m: view.width_m(), step: *step, ghosts };
            panel(&mut sheet, drawing, &of);
        }
        sheet.height = top + high + GAP_PT;
    }
    sheet.height -= GAP_PT;
    for (k, step) in options.steps.iter().enumerate() {
        let left = k as f64 * (wide + GAP_PT);
        let at = (left + 0.5 * wide, sheet.height + 9.0);
        sheet.text(at, LETTERS_PT, Anchor::Middle, format!("t = {:.1} s", all.clock_s(*step)));
    }
    sheet.height += CAPTION_PT;
    for line in wrapped(&options.title, LETTERS_PT, sheet.width, 3) {
        sheet.text((0.0, sheet.height + LETTERS_PT), LETTERS_PT, Anchor::Start, line);
        sheet.height += LETTERS_PT + 2.0;
    }
    sheet.height += 2.0;
    sheet
}

/// The view is the same at any width.
const PANEL_OF_VIEW_PX: f64 = 400.0;

fn panel_options(options: &StripOptions) -> SvgOptions {
    SvgOptions {
        width_px: options.panel_px,
        theme: options.theme,
        frame: options.frame,
        step: None,
        trails: true,
        labels: false,
        title: String::new(),
    }
}

/// Returns the strip as a stand-alone SVG document. The same drawing and options give the same bytes.
pub fn strip(drawing: &Drawing, options: &StripOptions) -> String {
    strips(&[(String::new(), drawing)], options)
}

/// Returns several drawings of one scene below each other, each under its line. All panels of a column show one moment and one part of
/// the world, to compare a program with its parent.
pub fn strips(rows: &[(String, &Drawing)], options: &StripOptions) -> String {
    let panel = panel_options(options);
    let all = together(rows);
    let view = View::of(&all, &panel);
    let colours = options.theme.palette();
    let (w, h) = (view.width_px, view.height_px);
    let count = options.steps.len().max(1) as f64;
    let head = if rows.iter().any(|(line, _)| !line.is_empty()) { CAPTION_PX } else { 0.0 };
    let row_px = head + h + GAP_PX;
    let below = rows.len() as f64 * row_px - GAP_PX;
    let (width, height) = (count * (w + GAP_PX) - GAP_PX, below + CAPTION_PX + FOOT_PX);
    let mut out = String::new();
    let _ = write!(
        out,
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width:.0} {height:.0}\" width=\"{width:.0}\" height=\"{height:.0}\" \
         font-family=\"system-ui, -apple-system, 'Segoe UI', Helvetica, Arial, sans-serif\" role=\"img\">\n\
         <title>{}</title>\n<rect width=\"100%\" height=\"100%\" fill=\"{}\"/>\n",
        escaped(if options.title.is_empty() { "driving scene" } else { &options.title }),
        colours.panel
    );
    for (nth, (line, drawing)) in rows.iter().enumerate() {
        let top = nth as f64 * row_px + head;
        if !line.is_empty() {
            text(&mut out, 2.0, top - 7.0, "start", colours.text, line);
        }
        for (k, step) in options.steps.iter().enumerate() {
            let _ = write!(
                out,
                "<svg x=\"{:.0}\" y=\"{top:.0}\" width=\"{w:.0}\" height=\"{h:.0}\" viewBox=\"0 0 {w:.0} {h:.0}\" overflow=\"hidden\">\n\
                 <rect width=\"100%\" height=\"100%\" fill=\"{}\"/>\n",
                k as f64 * (w + GAP_PX),
                colours.ground
            );
            told_moment(&mut out, drawing, &view_of(&all, options, &view, k), &panel, *step);
            out.push_str("</svg>\n");
        }
    }
    for (k, step) in options.steps.iter().enumerate() {
        let middle = k as f64 * (w + GAP_PX) + 0.5 * w;
        let said = format!("t = {:.1} s", all.clock_s(*step));
        text(&mut out, middle, below + 16.0, "middle", colours.text, &said);
    }
    text(&mut out, 2.0, below + CAPTION_PX + 16.0, "start", colours.text, &options.title);
    let views: Vec<(View, usize)> =
        options.steps.iter().enumerate().map(|(k, step)| (view_of(&all, options, &view, k), *step)).collect();
    let pictures = rows.iter().flat_map(|(_, drawing)| views.iter().map(|(view, step)| (*drawing, view, *step)));
    key_of_roles(&mut out, &roles_seen(pictures), options.theme, 2.0, below + CAPTION_PX + 34.0);
    out.push_str("</svg>\n");
    out
}

fn text(out: &mut String, x: f64, y: f64, anchor: &str, fill: &str, words: &str) {
    let anchor = if anchor == "start" { String::new() } else { format!(" text-anchor=\"{anchor}\"") };
    let words = escaped(words);
    let _ = writeln!(out, "<text x=\"{x:.1}\" y=\"{y:.1}\" font-size=\"13\"{anchor} fill=\"{fill}\">{words}</text>");
}

/// Returns everybody of all rows, and the first contact of any: they decide the part of the world that is shown.
fn together(rows: &[(String, &Drawing)]) -> Drawing {
    let Some((_, first)) = rows.first() else { return Drawing::default() };
    let actors = rows.iter().flat_map(|(_, drawing)| drawing.actors.iter().cloned()).collect();
    let contact = rows.iter().find_map(|(_, drawing)| drawing.contact.clone());
    Drawing { actors, contact, ..(*first).clone() }
}
