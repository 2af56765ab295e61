//! A moment of a drawing as shapes of a figure: figures of papers that show scenes are made of such panels.

use super::drawing::{Actor, Drawing, LineStyle, Role};
use super::figure::{BLACK, BLUE, Figure, GREEN, Ink, Mark, ORANGE, PURPLE, Rgb, Shape, VERMILION, WHITE};
use super::svg::windscreen;
use crate::kernel::{OrientedBox, Vec2};

/// Colour beside the road.
const GROUND: Rgb = [240, 242, 238];
const VERGE: Rgb = [226, 229, 228];
const SURFACE: Rgb = [207, 212, 218];
const EDGE: Rgb = [110, 118, 128];
const TRAFFIC: Rgb = [128, 136, 146];

/// The part of a drawing that is shown, and its place on the sheet.
#[derive(Clone, Debug, PartialEq)]
pub struct Panel {
    /// Left, top, width, height, points.
    pub place: [f64; 4],
    /// Point in its middle, metres.
    pub middle: Vec2,
    /// Metres from its left to its right side.
    pub width_m: f64,
    /// Step of the scene; ways are drawn up to it.
    pub step: usize,
    /// Earlier steps at which ego and adversaries are drawn as outlines.
    pub ghosts: Vec<usize>,
}

impl Panel {
    fn scale(&self) -> f64 {
        self.place[2] / self.width_m
    }

    fn at(&self, point: Vec2) -> (f64, f64) {
        let [x, y, w, h] = self.place;
        let away = point - self.middle;
        (x + 0.5 * w + away.x * self.scale(), y + 0.5 * h - away.y * self.scale())
    }

    /// Returns `true` if the rectangle around these points reaches into the panel.
    fn shows(&self, points: &[Vec2]) -> bool {
        let half = Vec2::new(0.5 * self.width_m, 0.5 * self.place[3] / self.scale());
        let spans = |of: fn(&Vec2) -> f64, middle: f64, half: f64| {
            let (low, high) =
                points.iter().map(of).fold((f64::INFINITY, -f64::INFINITY), |(l, h), v| (l.min(v), h.max(v)));
            low <= middle + half && high >= middle - half
        };
        spans(|p| p.x, self.middle.x, half.x) && spans(|p| p.y, self.middle.y, half.y)
    }

    fn path(&self, points: &[Vec2], ink: Ink) -> Shape {
        Shape::Path(points.iter().map(|p| self.at(*p)).collect(), ink)
    }

    fn closed(&self, points: &[Vec2], ink: Ink) -> Shape {
        Shape::Path(points.iter().chain(points.first()).map(|p| self.at(*p)).collect(), ink)
    }
}

/// Draws the moment on the sheet: road, everyone's box, the ways of ego and adversaries so far, and a cross where they touch.
pub fn panel(figure: &mut Figure, drawing: &Drawing, panel: &Panel) {
    let mut shapes = vec![Shape::Rect(panel.place, Ink::fill(GROUND))];
    for (surfaces, colour) in [(&drawing.verges, VERGE), (&drawing.surfaces, SURFACE)] {
        let seen = surfaces.iter().filter(|points| panel.shows(points));
        shapes.extend(seen.map(|surface| panel.closed(surface, Ink::fill(colour).edged(colour, 0.3))));
    }
    for line in drawing.lines.iter().filter(|line| panel.shows(&line.points)) {
        let ink = match line.style {
            LineStyle::Edge => Ink::line(EDGE, 0.5),
            LineStyle::Opposite => Ink::line(ORANGE, 0.4),
            LineStyle::Divider => Ink::line(WHITE, 0.4).dashed(),
        };
        shapes.push(panel.path(&line.points, ink));
    }
    for actor in drawing.actors.iter().filter(|actor| matches!(actor.role, Role::Ego | Role::Adversary)) {
        let way = actor.samples.iter().take(panel.step + 1).flatten().map(|s| Vec2::new(s[0], s[1]));
        let way: Vec<Vec2> = way.collect();
        if way.len() > 1 && panel.shows(&way) {
            shapes.push(panel.path(&way, Ink::line(colour(actor.role), 0.8)));
        }
    }
    let leading = || drawing.actors.iter().filter(|actor| matches!(actor.role, Role::Ego | Role::Adversary));
    let outlines = panel.ghosts.iter().flat_map(|step| leading().filter_map(|actor| outline(panel, actor, *step)));
    shapes.extend(outlines);
    shapes.extend(drawing.actors.iter().flat_map(|actor| boxed(panel, actor)));
    if let Some(contact) = drawing.contact.as_ref().filter(|contact| contact.step <= panel.step) {
        let mut cross = Figure::new(0.0, 0.0, "");
        cross.mark(Mark::Cross, panel.at(contact.point), 4.0, Ink::line(WHITE, 2.4));
        cross.mark(Mark::Cross, panel.at(contact.point), 4.0, Ink::line(BLACK, 1.2));
        shapes.extend(cross.shapes);
    }
    figure.shapes.push(Shape::Within(panel.place, shapes));
    figure.rect(panel.place, Ink::line(EDGE, 0.4));
}

/// Returns the roles of the road users in the panel, in the order of the legend.
pub fn roles_in(drawing: &Drawing, panel: &Panel) -> Vec<Role> {
    let seen = |actor: &Actor| shape(actor, panel.step).is_some_and(|shape| panel.shows(&shape.corners()));
    Role::ALL.into_iter().filter(|role| drawing.actors.iter().any(|of| of.role == *role && seen(of))).collect()
}

fn shape(actor: &Actor, step: usize) -> Option<OrientedBox> {
    let [x, y, heading_rad, _] = (*actor.samples.get(step)?)?;
    Some(OrientedBox::new(Vec2::new(x, y), heading_rad, actor.length_m, actor.width_m))
}

fn outline(panel: &Panel, actor: &Actor, step: usize) -> Option<Shape> {
    let corners = shape(actor, step)?.corners();
    panel.shows(&corners).then(|| panel.closed(&corners, Ink::line(colour(actor.role), 0.5)))
}

/// The shortest box that has a windscreen, metres: people on foot have none.
const WITH_A_WINDSCREEN_M: f64 = 1.4;

/// Returns the shapes of a road user's box, with a pane that shows its heading.
fn boxed(panel: &Panel, actor: &Actor) -> Vec<Shape> {
    let Some(shape) = shape(actor, panel.step).filter(|shape| panel.shows(&shape.corners())) else { return Vec::new() };
    let corners = shape.corners();
    if actor.role == Role::Ghost {
        return vec![panel.closed(&corners, Ink::line(TRAFFIC, 0.4).dashed())];
    }
    let mut shapes = vec![panel.closed(&corners, Ink::fill(colour(actor.role)).edged(WHITE, 0.3))];
    if actor.length_m > WITH_A_WINDSCREEN_M {
        shapes.push(panel.closed(&windscreen(&shape), Ink::fill(WHITE)));
    }
    shapes
}

/// Returns the colour of a role: from the Okabe and Ito palette for the main roles.
pub fn colour(role: Role) -> Rgb {
    match role {
        Role::Ego => BLUE,
        Role::Adversary => VERMILION,
        Role::Cyclist => GREEN,
        Role::Pedestrian => PURPLE,
        Role::Interacting | Role::Traffic | Role::Static | Role::Ghost => TRAFFIC,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::draw::{Contact, RoadLine};

    fn shapes(step: usize) -> Vec<Shape> {
        let moving = |role, x: f64| Actor {
            label: "a".into(),
            role,
            length_m: 4.0,
            width_m: 2.0,
            samples: (0..5).map(|k| Some([x + f64::from(k), 0.0, 0.0, 10.0])).collect(),
        };
        let drawing = Drawing {
            dt_s: 0.1,
            steps: 5,
            lines: vec![RoadLine {
                style: LineStyle::Edge,
                points: vec![Vec2::new(500.0, 0.0), Vec2::new(600.0, 0.0)],
            }],
            actors: vec![moving(Role::Ego, 0.0), moving(Role::Adversary, 3.0), moving(Role::Traffic, 900.0)],
            contact: Some(Contact { step: 3, point: Vec2::new(5.0, 0.0), label: "met".into() }),
            ..Drawing::default()
        };
        let mut figure = Figure::new(100.0, 100.0, "");
        panel(
            &mut figure,
            &drawing,
            &Panel { place: [10.0, 10.0, 80.0, 40.0], middle: Vec2::ZERO, width_m: 40.0, step, ghosts: Vec::new() },
        );
        let Shape::Within(place, shapes) = figure.shapes.swap_remove(0) else { panic!("{:?}", figure.shapes) };
        assert_eq!(place, [10.0, 10.0, 80.0, 40.0]);
        shapes
    }

    #[test]
    fn a_panel_has_who_is_in_sight_and_the_contact_from_when_it_happens() {
        // Ground, two ways, two boxes with their windscreens; the road's edge and a third vehicle are far away.
        let before = shapes(2);
        assert_eq!(before.len(), 7, "{before:?}");
        // Two crosses of two lines each, one as the other's rim.
        assert_eq!(shapes(3).len(), 11);
        let Shape::Path(corners, _) = &before[3] else { panic!("{before:?}") };
        // The ego's middle is 2 m right of the panel's, which is 4 points there.
        let middle = corners[..4].iter().fold((0.0, 0.0), |sum, p| (sum.0 + 0.25 * p.0, sum.1 + 0.25 * p.1));
        assert!((middle.0 - 54.0).abs() < 1e-9 && (middle.1 - 30.0).abs() < 1e-9, "{middle:?}");
        // It heads to the right, so its windscreen lies right of its middle.
        let Shape::Path(pane, _) = &before[4] else { panic!("{before:?}") };
        assert!(pane.iter().all(|(x, _)| *x > middle.0 && *x < 58.0), "{pane:?}");
    }
}
