//! One picture of a drawing at one moment, with the path of every road user: for papers, reports and terminals.

use serde::{Deserialize, Serialize};
use std::fmt::Write as _;

use super::drawing::{Actor, Contact, Drawing, LineStyle, Role};
use super::lettering::{Label, Letters, Wanted, placed};
use super::player::escaped;
use crate::kernel::{Extent, OrientedBox, Vec2};
use crate::scene::LightState;

/// Colours of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Theme {
    /// For white paper.
    Light,
    /// For dark screens.
    Dark,
}

/// The part of the world that is shown.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Frame {
    /// The whole road and everyone's path.
    Everything,
    /// The paths of the ego, its adversaries and the vehicles marked as interacting, with this many metres around them.
    Around(f64),
    /// A square that stays in its place and keeps its size, whoever is there.
    Square {
        /// Its middle, metres.
        centre: Vec2,
        /// Distance from the middle to its sides, metres.
        half_m: f64,
    },
}

/// How a picture is made.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SvgOptions {
    /// Width of the picture, pixels.
    pub width_px: f64,
    /// Its colours.
    pub theme: Theme,
    /// The part of the world that it shows.
    pub frame: Frame,
    /// Step at which boxes are drawn; `None` is the drawing's current one.
    pub step: Option<usize>,
    /// True if everyone's way is drawn too.
    pub trails: bool,
    /// True if all road users have labels, not only the main ones.
    pub labels: bool,
    /// Title above the picture; may be empty.
    pub title: String,
}

pub(super) struct Palette {
    pub(super) ground: &'static str,
    verge: &'static str,
    surface: &'static str,
    edge: &'static str,
    divider: &'static str,
    opposite: &'static str,
    crosswalk: &'static str,
    pub(super) text: &'static str,
    pub(super) panel: &'static str,
    outline: &'static str,
}

impl Theme {
    pub(super) fn palette(self) -> Palette {
        match self {
            Theme::Light => Palette {
                ground: "#eef1ec",
                verge: "#e1e4e3",
                surface: "#cdd2d8",
                edge: "#5d6672",
                divider: "#ffffff",
                opposite: "#c98a00",
                crosswalk: "#f7f8fa",
                text: "#1c2128",
                panel: "#ffffff",
                outline: "#ffffff",
            },
            Theme::Dark => Palette {
                ground: "#14181d",
                verge: "#232930",
                surface: "#323942",
                edge: "#8c97a5",
                divider: "#aab3bf",
                opposite: "#d9a521",
                crosswalk: "#8e98a5",
                text: "#e8ecf1",
                panel: "#1e242b",
                outline: "#0d1014",
            },
        }
    }
}

/// Returns the colour of a role. People with any colour vision can distinguish them (after Okabe and Ito).
pub(super) fn colour(role: Role, theme: Theme) -> &'static str {
    match (role, theme) {
        (Role::Ego, Theme::Light) => "#0064b0",
        (Role::Ego, Theme::Dark) => "#56b4e9",
        (Role::Adversary, Theme::Light) => "#c8400a",
        (Role::Adversary, Theme::Dark) => "#f0703a",
        (Role::Interacting, Theme::Light) => "#d98200",
        (Role::Interacting, Theme::Dark) => "#f0b040",
        (Role::Traffic, Theme::Light) => "#6b7684",
        (Role::Traffic, Theme::Dark) => "#98a3b1",
        (Role::Cyclist, Theme::Light) => "#00805c",
        (Role::Cyclist, Theme::Dark) => "#2fc79a",
        (Role::Pedestrian, Theme::Light) => "#a8447f",
        (Role::Pedestrian, Theme::Dark) => "#e08cbc",
        (Role::Static, Theme::Light) => "#8a7a66",
        (Role::Static, Theme::Dark) => "#b3a38c",
        (Role::Ghost, _) => "#9aa4b0",
    }
}

/// Returns the picture as a stand-alone SVG document.
pub fn svg(drawing: &Drawing, options: &SvgOptions) -> String {
    let view = View::of(drawing, options);
    let palette = options.theme.palette();
    let mut out = String::new();
    let (w, h) = (view.width_px, view.height_px);
    let _ = write!(
        out,
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {w:.0} {h:.0}\" width=\"{w:.0}\" height=\"{h:.0}\" \
         font-family=\"system-ui, -apple-system, 'Segoe UI', Helvetica, Arial, sans-serif\" role=\"img\">\n\
         <title>{}</title>\n<rect width=\"100%\" height=\"100%\" fill=\"{}\"/>\n",
        escaped(if options.title.is_empty() { "driving scene" } else { &options.title }),
        palette.ground
    );
    let step = options.step.unwrap_or(drawing.current_step).min(drawing.steps.saturating_sub(1));
    scenery(&mut out, drawing, &view, options, step);
    // A single picture of a scene marks the contact at any step.
    draw_contact(&mut out, drawing, &view);
    let words =
        Drawing { contact: drawing.contact.clone().map(|contact| Contact { step: 0, ..contact }), ..drawing.clone() };
    draw_labels(&mut out, &labels(&words, &view, step, options.labels, LETTERS), &palette);
    draw_legend(&mut out, drawing, &view, options, &palette, step);
    out.push_str("</svg>\n");
    out
}

/// Draws road, lights, ways and road users at a step.
fn scenery(out: &mut String, drawing: &Drawing, view: &View, options: &SvgOptions, step: usize) {
    let palette = options.theme.palette();
    draw_road(out, drawing, view, &palette);
    draw_lights(out, drawing, view, step);
    if options.trails {
        for actor in by_importance(drawing) {
            draw_trail(out, actor, view, step, options.theme);
        }
    }
    for actor in by_importance(drawing) {
        draw_actor(out, actor, view, step, options, &palette);
    }
}

/// Draws one moment without words: the contact is marked from its step on.
pub(super) fn moment(out: &mut String, drawing: &Drawing, view: &View, options: &SvgOptions, step: usize) {
    scenery(out, drawing, view, options, step);
    if drawing.contact.as_ref().is_some_and(|contact| step >= contact.step) {
        draw_contact(out, drawing, view);
    }
}

/// Draws one moment in a strip, with its words and a bar of a round length.
pub(super) fn told_moment(out: &mut String, drawing: &Drawing, view: &View, options: &SvgOptions, step: usize) {
    moment(out, drawing, view, options, step);
    let palette = options.theme.palette();
    draw_labels(out, &labels(drawing, view, step, options.labels, LETTERS), &palette);
    draw_scale(out, view, &palette, 10.0, view.height_px - 10.0, "");
}

/// Returns the roles of the road users that are seen at a step in one of these pictures, in the order of the legend.
pub(super) fn roles_seen<'p>(pictures: impl Iterator<Item = (&'p Drawing, &'p View, usize)>) -> Vec<Role> {
    let mut seen: Vec<Role> = Vec::new();
    for (drawing, view, step) in pictures {
        let is_seen = |actor: &&Actor| {
            let sample = actor.samples.get(step).copied().flatten();
            sample.is_some_and(|[x, y, ..]| view.shows(&[Vec2::new(x, y)]))
        };
        seen.extend(drawing.actors.iter().filter(is_seen).map(|actor| actor.role));
    }
    Role::ALL.into_iter().filter(|role| seen.contains(role)).collect()
}

/// Draws these roles with their colours, in one line from a place on, pixels.
pub(super) fn key_of_roles(out: &mut String, roles: &[Role], theme: Theme, x: f64, y: f64) {
    let mut at = x;
    for role in roles {
        let _ = writeln!(
            out,
            "<rect x=\"{at:.1}\" y=\"{:.1}\" width=\"16\" height=\"10\" rx=\"2\" fill=\"{}\"/>\
             <text x=\"{:.1}\" y=\"{y:.1}\" font-size=\"12\" fill=\"{}\">{}</text>",
            y - 9.5,
            colour(*role, theme),
            at + 22.0,
            theme.palette().text,
            role.label()
        );
        at += 44.0 + 7.0 * role.label().len() as f64;
    }
}

/// Returns the road users with the main ones last, so that they are on top.
fn by_importance(drawing: &Drawing) -> Vec<&Actor> {
    let mut actors: Vec<&Actor> = drawing.actors.iter().collect();
    actors.sort_by_key(|actor| std::cmp::Reverse(actor.role));
    actors
}

fn leading(role: Role) -> bool {
    matches!(role, Role::Ego | Role::Adversary | Role::Interacting)
}

/// A map from metres to pixels, y upwards to y downwards.
pub(super) struct View {
    low: Vec2,
    high: Vec2,
    scale: f64,
    pub(super) width_px: f64,
    pub(super) height_px: f64,
}

/// A margin around everything, metres, and limits of the picture's height by its width.
const MARGIN_M: f64 = 4.0;
const HEIGHT_SHARE: (f64, f64) = (0.42, 1.1);

impl View {
    pub(super) fn of(drawing: &Drawing, options: &SvgOptions) -> View {
        let places =
            |actor: &Actor| -> Vec<Vec2> { actor.samples.iter().flatten().map(|s| Vec2::new(s[0], s[1])).collect() };
        let mut points: Vec<Vec2> = Vec::new();
        let margin = match options.frame {
            Frame::Everything => {
                points.extend(drawing.verges.iter().chain(&drawing.surfaces).flatten());
                points.extend(drawing.actors.iter().flat_map(places));
                MARGIN_M
            }
            Frame::Around(metres) => {
                points.extend(drawing.actors.iter().filter(|a| leading(a.role)).flat_map(places));
                metres
            }
            Frame::Square { centre, half_m } => {
                points.push(centre);
                half_m
            }
        };
        if points.is_empty() {
            points.push(Vec2::ZERO);
        }
        let Extent { low, high } = Extent::around(points).grown(margin);
        View::fitted(low, high, options.width_px.clamp(200.0, 8000.0))
    }

    fn fitted(low: Vec2, high: Vec2, width_px: f64) -> View {
        let size = high - low;
        let share = (size.y / size.x).clamp(HEIGHT_SHARE.0, HEIGHT_SHARE.1);
        // The shorter side is extended.
        let grown = Vec2::new(size.x.max(size.y / share), size.y.max(size.x * share));
        let spare = (grown - size) * 0.5;
        let scale = width_px / grown.x;
        View { low: low - spare, high: high + spare, scale, width_px, height_px: grown.y * scale }
    }

    /// Returns the same panel with another part of the world: `width_m` from its left to its right side around a place.
    pub(super) fn zoomed(&self, centre: Vec2, width_m: f64) -> View {
        let half = Vec2::new(width_m, width_m * self.height_px / self.width_px) * 0.5;
        let (low, high) = (centre - half, centre + half);
        View { low, high, scale: self.width_px / width_m, width_px: self.width_px, height_px: self.height_px }
    }

    /// Returns the point in its middle, metres.
    pub(super) fn middle(&self) -> Vec2 {
        self.low.lerp(self.high, 0.5)
    }

    /// Returns the metres from its left to its right side.
    pub(super) fn width_m(&self) -> f64 {
        self.high.x - self.low.x
    }

    fn at(&self, p: Vec2) -> (f64, f64) {
        ((p.x - self.low.x) * self.scale, (self.high.y - p.y) * self.scale)
    }

    fn path(&self, points: &[Vec2]) -> String {
        let mut text = String::new();
        for (k, p) in points.iter().enumerate() {
            let (x, y) = self.at(*p);
            let _ = write!(text, "{}{x:.1} {y:.1}", if k == 0 { "M" } else { "L" });
        }
        text
    }

    /// Returns `true` if any of the points lies in the picture or near it.
    fn shows(&self, points: &[Vec2]) -> bool {
        Extent::around(points.iter().copied()).meets(&Extent { low: self.low, high: self.high })
    }

    /// Returns the width in pixels of a line of this width in metres, but never too thin to see.
    fn stroke(&self, metres: f64, least_px: f64) -> f64 {
        (metres * self.scale).max(least_px)
    }
}

fn draw_road(out: &mut String, drawing: &Drawing, view: &View, palette: &Palette) {
    for (surfaces, colour) in [(&drawing.verges, palette.verge), (&drawing.surfaces, palette.surface)] {
        if surfaces.is_empty() {
            continue;
        }
        let width = view.stroke(0.3, 0.8);
        let _ = writeln!(
            out,
            "<g fill=\"{colour}\" stroke=\"{colour}\" stroke-width=\"{width:.1}\" stroke-linejoin=\"round\">"
        );
        for surface in surfaces.iter().filter(|s| view.shows(s)) {
            let _ = writeln!(out, "<path d=\"{}Z\"/>", view.path(surface));
        }
        out.push_str("</g>\n");
    }
    for crosswalk in drawing.crosswalks.iter().filter(|c| view.shows(c)) {
        draw_crosswalk(out, crosswalk, view, palette);
    }
    for line in drawing.lines.iter().filter(|l| view.shows(&l.points)) {
        let (stroke, width, dash) = match line.style {
            LineStyle::Edge => (palette.edge, view.stroke(0.22, 1.2), String::new()),
            LineStyle::Opposite => (palette.opposite, view.stroke(0.15, 1.0), String::new()),
            LineStyle::Divider => {
                let dash = format!(" stroke-dasharray=\"{:.1} {:.1}\"", 3.0 * view.scale, 4.5 * view.scale);
                (palette.divider, view.stroke(0.15, 1.0), dash)
            }
        };
        let path = view.path(&line.points);
        let _ =
            writeln!(out, "<path d=\"{path}\" fill=\"none\" stroke=\"{stroke}\" stroke-width=\"{width:.1}\"{dash}/>");
    }
    for sign in drawing.stop_signs.iter().filter(|s| view.shows(&[**s])) {
        let (x, y) = view.at(*sign);
        let r = view.stroke(0.9, 4.0);
        let corner = |k: i32| {
            let p = Vec2::from_heading((f64::from(k) + 0.5) * crate::kernel::num::FRAC_PI_2 * 0.5) * r;
            format!("{:.1},{:.1}", x + p.x, y + p.y)
        };
        let corners: Vec<String> = (0..8).map(corner).collect();
        let _ = writeln!(
            out,
            "<polygon points=\"{}\" fill=\"#b3261e\" stroke=\"#fff\" stroke-width=\"1\"/>",
            corners.join(" ")
        );
    }
}

/// Draws stripes along the road, one every metre of the crosswalk's longer side.
fn draw_crosswalk(out: &mut String, outline: &[Vec2], view: &View, palette: &Palette) {
    let [a, b, c, d] = outline[..] else {
        let path = view.path(outline);
        let _ = writeln!(out, "<path d=\"{path}Z\" fill=\"{}\" fill-opacity=\"0.5\"/>", palette.crosswalk);
        return;
    };
    // Pairs of corners at both ends of the longer side.
    let ((a, b), (c, d)) = if a.distance(b) < b.distance(c) { ((a, b), (d, c)) } else { ((b, c), (a, d)) };
    let count = (0.5 * (a.distance(c) + b.distance(d))).floor().clamp(1.0, 200.0) as usize;
    let stripe = |k: usize, share: f64| (k as f64 + share) / count as f64;
    for k in 0..count {
        let (from, to) = (stripe(k, 0.25), stripe(k, 0.75));
        let corners = [a.lerp(c, from), b.lerp(d, from), b.lerp(d, to), a.lerp(c, to)];
        let path = view.path(&corners);
        let _ = writeln!(out, "<path d=\"{path}Z\" fill=\"{}\" fill-opacity=\"0.85\"/>", palette.crosswalk);
    }
}

fn draw_lights(out: &mut String, drawing: &Drawing, view: &View, step: usize) {
    for light in drawing.lights.iter().filter(|l| view.shows(&[l.point])) {
        let (x, y) = view.at(light.point);
        let fill = match light.states.get(step) {
            Some(LightState::Go) => "#1a9850",
            Some(LightState::Caution) => "#e6a700",
            Some(LightState::Stop) => "#d73027",
            Some(LightState::Unknown) | None => "#888888",
        };
        let r = view.stroke(0.8, 3.5);
        let _ = writeln!(
            out,
            "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{r:.1}\" fill=\"{fill}\" stroke=\"#111\" stroke-width=\"1\"/>"
        );
    }
}

/// Draws the path so far as a solid line, and the path to come as a dotted one.
fn draw_trail(out: &mut String, actor: &Actor, view: &View, step: usize, theme: Theme) {
    let (opacity, width) = if leading(actor.role) { (0.9, 0.45) } else { (0.3, 0.25) };
    let stroke = colour(actor.role, theme);
    let width = view.stroke(width, 1.2);
    let dots = format!(" stroke-dasharray=\"0.1 {:.1}\" stroke-linecap=\"round\"", 2.2 * width);
    for (from, to, dash) in [(0, step, ""), (step, actor.samples.len().saturating_sub(1), dots.as_str())] {
        let part = actor.samples.iter().skip(from).take(to.saturating_sub(from) + 1);
        let points: Vec<Vec2> = part.flatten().map(|s| Vec2::new(s[0], s[1])).collect();
        if points.len() > 1 && view.shows(&points) {
            let path = view.path(&points);
            let _ = writeln!(
                out,
                "<path d=\"{path}\" fill=\"none\" stroke=\"{stroke}\" stroke-width=\"{width:.1}\" stroke-opacity=\"{opacity}\"{dash}/>"
            );
        }
    }
}

fn draw_actor(out: &mut String, actor: &Actor, view: &View, step: usize, options: &SvgOptions, palette: &Palette) {
    let Some(Some([x, y, heading, _])) = actor.samples.get(step) else { return };
    let centre = Vec2::new(*x, *y);
    if !view.shows(&[centre]) {
        return;
    }
    let grown = grown(actor, view);
    let shape = OrientedBox::new(centre, *heading, grown * actor.length_m, grown * actor.width_m);
    let (on_foot, two_wheels) =
        (actor.length_m < ON_FOOT_M, actor.length_m >= ON_FOOT_M && actor.width_m < TWO_WHEELS_M);
    let corners = shape.corners();
    let fill = colour(actor.role, options.theme);
    let lead = leading(actor.role);
    let ghost = actor.role == Role::Ghost;
    let (x, y) = view.at(centre);
    let (l, w) = (shape.half_length_m * view.scale, shape.half_width_m * view.scale);
    let outline = match (on_foot, two_wheels) {
        (true, _) => format!("<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{w:.1}\""),
        (_, true) => format!(
            "<ellipse cx=\"{x:.1}\" cy=\"{y:.1}\" rx=\"{l:.1}\" ry=\"{w:.1}\" transform=\"rotate({:.1} {x:.1} {y:.1})\"",
            -heading.to_degrees()
        ),
        _ => format!("<path d=\"{}Z\"", view.path(&corners)),
    };
    let _ = writeln!(
        out,
        "{outline} fill=\"{fill}\" fill-opacity=\"{}\" stroke=\"{}\" stroke-width=\"{:.1}\" stroke-linejoin=\"round\"/>",
        if ghost { 0.35 } else { 1.0 },
        palette.outline,
        if lead { 1.6 } else { 0.8 }
    );
    // A windscreen shows the direction of a car; a rider sits in the middle.
    if two_wheels {
        let (x, y) = view.at(centre);
        let r = 0.55 * shape.half_width_m * view.scale;
        let _ = writeln!(out, "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{r:.1}\" fill=\"{}\"/>", palette.outline);
    } else if actor.length_m > 1.4 {
        let pane = view.path(&windscreen(&shape));
        let _ = writeln!(out, "<path d=\"{pane}Z\" fill=\"{}\" fill-opacity=\"0.75\"/>", palette.outline);
    }
}

/// Returns the corners of the pane that shows the direction of a box.
pub(super) fn windscreen(shape: &OrientedBox) -> [Vec2; 4] {
    let (l, w) = (shape.half_length_m, 0.78 * shape.half_width_m);
    let ahead = |along: f64, aside: f64| shape.center + shape.axis * along + shape.axis.left() * aside;
    [ahead(0.5 * l, w), ahead(0.5 * l, -w), ahead(0.2 * l, -w), ahead(0.2 * l, w)]
}

/// Returns the factor by which a small road user is enlarged, so that it is seen from afar.
fn grown(actor: &Actor, view: &View) -> f64 {
    let least_px = if actor.length_m < ON_FOOT_M { ON_FOOT_PX } else { TWO_WHEELS_PX };
    if actor.length_m < SMALL_M { (least_px / (actor.width_m * view.scale).max(0.1)).max(1.0) } else { 1.0 }
}

/// Lengths below which boxes are those of people on foot, and of anybody small; width below which they have two wheels.
const ON_FOOT_M: f64 = 1.2;
const SMALL_M: f64 = 2.5;
const TWO_WHEELS_M: f64 = 1.2;
/// Least widths of a person and of a two-wheeler in a picture.
const ON_FOOT_PX: f64 = 7.0;
const TWO_WHEELS_PX: f64 = 6.0;

/// Returns the label and speed of a road user, beside its place at a step; `None` where it is not in sight.
fn named(actor: &Actor, view: &View, step: usize) -> Option<Wanted> {
    let [x, y, _, speed] = (*actor.samples.get(step)?)?;
    let at = view.at(Vec2::new(x, y));
    let inside = (0.0..view.width_px).contains(&at.0) && (0.0..view.height_px).contains(&at.1);
    let reach_px = 0.6 * view.stroke(actor.width_m, 6.0) + 2.0;
    let needed = leading(actor.role);
    inside.then(|| Wanted { at, reach_px, text: format!("{} {speed:.1} m/s", actor.label), needed })
}

/// Returns the words in a picture of a step: of the main road users in sight, or of all, and of the contact from its step on.
pub(super) fn labels(drawing: &Drawing, view: &View, step: usize, all: bool, letters: Letters) -> Vec<Label> {
    let mut wanted: Vec<Wanted> = drawing
        .actors
        .iter()
        .filter(|actor| leading(actor.role))
        .filter_map(|actor| named(actor, view, step))
        .collect();
    let mut kept_free = Vec::new();
    if let Some(contact) = drawing.contact.as_ref().filter(|contact| step >= contact.step) {
        let (x, y) = view.at(contact.point);
        if (0.0..view.width_px).contains(&x) && (0.0..view.height_px).contains(&y) {
            kept_free.push([x - CONTACT_PX, y - CONTACT_PX, x + CONTACT_PX, y + CONTACT_PX]);
            wanted.push(Wanted { at: (x, y), reach_px: CONTACT_PX, text: contact.label.clone(), needed: true });
        }
    }
    if all {
        let others = drawing.actors.iter().filter(|actor| !leading(actor.role));
        wanted.extend(others.filter_map(|actor| named(actor, view, step)));
    }
    kept_free.push([0.0, view.height_px - 30.0, SCALE_SHARE * view.width_px + 60.0, view.height_px]);
    placed(&wanted, (view.width_px, view.height_px), letters, &kept_free)
}

/// Letters of a picture's words, and the extent of the mark of a contact.
pub(super) const LETTERS: Letters = Letters { advance_px: 8.2, line_px: 16.0 };
const CONTACT_PX: f64 = 22.0;

fn draw_labels(out: &mut String, labels: &[Label], palette: &Palette) {
    for Label { x, y, text } in labels {
        let _ = writeln!(
            out,
            "<text x=\"{x:.1}\" y=\"{y:.1}\" font-size=\"13\" font-weight=\"600\" fill=\"{}\" stroke=\"{}\" \
             stroke-width=\"3\" paint-order=\"stroke\">{}</text>",
            palette.text,
            palette.ground,
            escaped(text)
        );
    }
}

fn draw_contact(out: &mut String, drawing: &Drawing, view: &View) {
    let Some(contact) = &drawing.contact else { return };
    let (x, y) = view.at(contact.point);
    let _ = writeln!(
        out,
        "<g stroke=\"#d7191c\" stroke-width=\"2.5\" fill=\"none\"><circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"13\"/>\
         <path d=\"M{0:.1} {y:.1}h12M{1:.1} {y:.1}h12M{x:.1} {2:.1}v12M{x:.1} {3:.1}v12\"/></g>",
        x - 22.0,
        x + 10.0,
        y - 22.0,
        y + 10.0,
    );
}

fn draw_legend(out: &mut String, drawing: &Drawing, view: &View, options: &SvgOptions, palette: &Palette, step: usize) {
    let text = |x: f64, y: f64, size: f64, weight: u32, content: &str| {
        format!(
            "<text x=\"{x:.1}\" y=\"{y:.1}\" font-size=\"{size}\" font-weight=\"{weight}\" fill=\"{}\">{}</text>\n",
            palette.text,
            escaped(content)
        )
    };
    let roles = drawing.roles();
    let height = 34.0 + 19.0 * roles.len() as f64;
    let _ = writeln!(
        out,
        "<rect x=\"12\" y=\"12\" width=\"{}\" height=\"{height}\" rx=\"6\" fill=\"{}\" fill-opacity=\"0.92\"/>",
        (24.0 + 7.4 * options.title.chars().count() as f64).max(150.0),
        palette.panel
    );
    let seconds = drawing.clock_s(step);
    let heading = if options.title.is_empty() { "driving scene" } else { &options.title };
    out.push_str(&text(22.0, 31.0, 13.0, 600, heading));
    for (k, role) in roles.iter().enumerate() {
        let y = 43.0 + 19.0 * k as f64;
        let count = drawing.actors.iter().filter(|a| a.role == *role).count();
        let _ = writeln!(
            out,
            "<rect x=\"22\" y=\"{y:.1}\" width=\"16\" height=\"10\" rx=\"2\" fill=\"{}\"/>",
            colour(*role, options.theme)
        );
        let label = if count > 1 { format!("{} ({count})", role.label()) } else { role.label().to_string() };
        out.push_str(&text(46.0, y + 9.5, 12.0, 400, &label));
    }
    draw_scale(out, view, palette, 22.0, view.height_px - 22.0, &format!(", t = {seconds:.1} s"));
}

/// Largest share of the picture's width for the bar of its scale.
const SCALE_SHARE: f64 = 0.2;

/// Draws a bar of a round length with its words from a place on.
fn draw_scale(out: &mut String, view: &View, palette: &Palette, x: f64, y: f64, behind: &str) {
    let reach = SCALE_SHARE * view.width_px / view.scale;
    let length =
        [500.0, 200.0, 100.0, 50.0, 20.0, 10.0, 5.0, 2.0, 1.0].into_iter().find(|l| *l <= reach).unwrap_or(1.0);
    let px = length * view.scale;
    let _ = writeln!(
        out,
        "<path d=\"M{x} {0}v6h{px:.1}v-6\" fill=\"none\" stroke=\"{1}\" stroke-width=\"2\"/>\
         <text x=\"{2:.1}\" y=\"{3:.1}\" font-size=\"12\" fill=\"{1}\">{length:.0} m{behind}</text>",
        y - 6.0,
        palette.text,
        x + px + 8.0,
        y + 2.0,
    );
}
