//! A figure of plain shapes and text, written as SVG here and as PDF in `figure_pdf`: both from one list, so they show the same. A plotting
//! library would bring its own fonts and layout, which differ by version and machine; five shapes need neither, and equal figures are
//! equal bytes.

use std::fmt::Write as _;

use super::helvetica::width;
use super::player::escaped;

/// A colour as red, green, blue.
pub type Rgb = [u8; 3];

// Okabe and Ito's palette: distinct for any colour vision, and as greys of different lightness in print.
/// `#000000`
pub const BLACK: Rgb = [0, 0, 0];
/// `#0072b2`
pub const BLUE: Rgb = [0, 114, 178];
/// `#56b4e9`
pub const SKY: Rgb = [86, 180, 233];
/// `#009e73`
pub const GREEN: Rgb = [0, 158, 115];
/// `#e69f00`
pub const ORANGE: Rgb = [230, 159, 0];
/// `#d55e00`
pub const VERMILION: Rgb = [213, 94, 0];
/// `#cc79a7`
pub const PURPLE: Rgb = [204, 121, 167];
/// `#f0e442`
pub const YELLOW: Rgb = [240, 228, 66];
/// For things in the background.
pub const GREY: Rgb = [120, 126, 134];
/// For grids and fields.
pub const LIGHT: Rgb = [222, 226, 231];
/// Paper.
pub const WHITE: Rgb = [255, 255, 255];

/// How a shape is painted.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Ink {
    /// Colour of the inside; `None` leaves it open.
    pub fill: Option<Rgb>,
    /// Colour and width of its line; `None` draws none.
    pub stroke: Option<(Rgb, f64)>,
    /// True if the line is dashed.
    pub dashed: bool,
}

impl Ink {
    /// Makes an ink that fills, without a line.
    pub fn fill(colour: Rgb) -> Ink {
        Ink { fill: Some(colour), ..Ink::default() }
    }

    /// Makes an ink for a line of a width.
    pub fn line(colour: Rgb, width: f64) -> Ink {
        Ink { stroke: Some((colour, width)), ..Ink::default() }
    }

    /// Returns the same with a line around it.
    pub fn edged(self, colour: Rgb, width: f64) -> Ink {
        Ink { stroke: Some((colour, width)), ..self }
    }

    /// Returns the same, dashed.
    pub fn dashed(self) -> Ink {
        Ink { dashed: true, ..self }
    }
}

/// The point of a text that lies at its place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Anchor {
    /// Its beginning.
    Start,
    /// Its middle.
    Middle,
    /// Its end.
    End,
}

/// Forms that can be distinguished without colour.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mark {
    /// A disc.
    Disc,
    /// A square.
    Square,
    /// A triangle, upright.
    Triangle,
    /// A diamond.
    Diamond,
    /// A cross of two lines, which only a line's ink paints.
    Cross,
}

/// A line of text.
#[derive(Clone, Debug, PartialEq)]
pub struct Words {
    /// Place of the text: x to the right, y downwards, the baseline.
    pub at: (f64, f64),
    /// Size of the letters.
    pub size: f64,
    /// Point of the text that lies there.
    pub anchor: Anchor,
    /// Bold letters.
    pub bold: bool,
    /// Its colour.
    pub colour: Rgb,
    /// True if it is read upwards.
    pub upwards: bool,
    /// The text itself.
    pub text: String,
}

/// One shape.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// A rectangle by its upper left corner, width and height.
    Rect([f64; 4], Ink),
    /// Points joined by lines; filled where the ink fills.
    Path(Vec<(f64, f64)>, Ink),
    /// A disc by its middle and radius.
    Disc((f64, f64), f64, Ink),
    /// A line of text.
    Text(Words),
    /// Shapes of which only the part within a rectangle (left, top, width, height) is seen.
    Within([f64; 4], Vec<Shape>),
}

/// A figure: its size in points of print (1/72 inch), and its shapes, the later ones on top.
#[derive(Clone, Debug, PartialEq)]
pub struct Figure {
    /// Width, points.
    pub width: f64,
    /// Height, points.
    pub height: f64,
    /// Title for readers of the file.
    pub title: String,
    /// Shapes in the order in which they are painted.
    pub shapes: Vec<Shape>,
}

impl Figure {
    /// Makes an empty sheet.
    pub fn new(width: f64, height: f64, title: impl Into<String>) -> Figure {
        Figure { width, height, title: title.into(), shapes: Vec::new() }
    }

    /// Adds a rectangle by its upper left corner, width and height.
    pub fn rect(&mut self, at: [f64; 4], ink: Ink) {
        self.shapes.push(Shape::Rect(at, ink));
    }

    /// Adds a line between two points.
    pub fn line(&mut self, from: (f64, f64), to: (f64, f64), ink: Ink) {
        self.path(vec![from, to], ink);
    }

    /// Adds points joined by lines.
    pub fn path(&mut self, points: Vec<(f64, f64)>, ink: Ink) {
        self.shapes.push(Shape::Path(points, ink));
    }

    /// Adds a mark around a point, `r` its half size.
    pub fn mark(&mut self, mark: Mark, at: (f64, f64), r: f64, ink: Ink) {
        let (x, y) = at;
        let closed = |points: [(f64, f64); 4]| points.map(|(dx, dy)| (x + r * dx, y + r * dy)).to_vec();
        match mark {
            Mark::Disc => self.shapes.push(Shape::Disc((x, y), r, ink)),
            Mark::Square => self.rect([x - 0.9 * r, y - 0.9 * r, 1.8 * r, 1.8 * r], ink),
            Mark::Triangle => self.path(closed([(-1.1, 0.8), (1.1, 0.8), (0.0, -1.1), (-1.1, 0.8)]), ink),
            Mark::Diamond => {
                let corners = [(0.0, -1.2), (1.2, 0.0), (0.0, 1.2), (-1.2, 0.0), (0.0, -1.2)];
                self.path(corners.map(|(dx, dy)| (x + r * dx, y + r * dy)).to_vec(), ink);
            }
            Mark::Cross => {
                self.line((x - r, y - r), (x + r, y + r), ink);
                self.line((x - r, y + r), (x + r, y - r), ink);
            }
        }
    }

    /// Adds a line of black text.
    pub fn text(&mut self, at: (f64, f64), size: f64, anchor: Anchor, text: impl Into<String>) {
        self.words(Words { at, size, anchor, bold: false, colour: BLACK, upwards: false, text: text.into() });
    }

    /// Adds a line of black text in bold.
    pub fn heading(&mut self, at: (f64, f64), size: f64, text: impl Into<String>) {
        let (anchor, colour) = (Anchor::Start, BLACK);
        self.words(Words { at, size, anchor, bold: true, colour, upwards: false, text: text.into() });
    }

    /// Adds a line of text with all its options.
    pub fn words(&mut self, words: Words) {
        self.shapes.push(Shape::Text(words));
    }

    /// Returns the figure as a stand-alone SVG document.
    pub fn svg(&self) -> String {
        self.written(false)
    }

    /// Does the same for a page whose reader's fonts are unknown: each line of text is as wide as it was measured, in any font, so none
    /// runs out of the figure or into another.
    pub fn svg_in_any_font(&self) -> String {
        self.written(true)
    }

    fn written(&self, fitted: bool) -> String {
        let (w, h) = (number(self.width), number(self.height));
        let title = escaped(&self.title);
        let mut out = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {w} {h}\" width=\"{w}pt\" height=\"{h}pt\" \
             font-family=\"Helvetica, Arial, 'Liberation Sans', sans-serif\" role=\"img\">\n<title>{title}</title>\n\
             <rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n"
        );
        svg_shapes(&mut out, &self.shapes, fitted);
        out.push_str("</svg>\n");
        out
    }
}

fn svg_shapes(out: &mut String, shapes: &[Shape], fitted: bool) {
    for shape in shapes {
        match shape {
            Shape::Rect([x, y, w, h], ink) => {
                let [x, y, w, h] = [x, y, w, h].map(|v| number(*v));
                let _ = writeln!(out, "<rect x=\"{x}\" y=\"{y}\" width=\"{w}\" height=\"{h}\"{}/>", painted(ink));
            }
            Shape::Path(points, ink) => {
                let points: Vec<String> =
                    points.iter().map(|(x, y)| format!("{},{}", number(*x), number(*y))).collect();
                let _ = writeln!(out, "<polyline points=\"{}\"{}/>", points.join(" "), painted(ink));
            }
            Shape::Disc((x, y), r, ink) => {
                let [x, y, r] = [x, y, r].map(|v| number(*v));
                let _ = writeln!(out, "<circle cx=\"{x}\" cy=\"{y}\" r=\"{r}\"{}/>", painted(ink));
            }
            Shape::Text(words) => svg_text(out, words, fitted),
            // A picture within the picture, in the same coordinates: it cuts off what lies outside without a name to refer to.
            Shape::Within([x, y, w, h], shapes) => {
                let [x, y, w, h] = [x, y, w, h].map(|v| number(*v));
                let _ = writeln!(
                    out,
                    "<svg x=\"{x}\" y=\"{y}\" width=\"{w}\" height=\"{h}\" viewBox=\"{x} {y} {w} {h}\" overflow=\"hidden\">"
                );
                svg_shapes(out, shapes, fitted);
                out.push_str("</svg>\n");
            }
        }
    }
}

fn svg_text(out: &mut String, words: &Words, fitted: bool) {
    let (x, y, size) = (number(words.at.0), number(words.at.1), number(words.size));
    let anchor = match words.anchor {
        Anchor::Start => "",
        Anchor::Middle => " text-anchor=\"middle\"",
        Anchor::End => " text-anchor=\"end\"",
    };
    let bold = if words.bold { " font-weight=\"bold\"" } else { "" };
    let turned = if words.upwards { format!(" transform=\"rotate(-90 {x} {y})\"") } else { String::new() };
    // The widths of bold letters are not known.
    let length = if fitted && !words.bold && !words.text.is_empty() {
        format!(" textLength=\"{}\" lengthAdjust=\"spacingAndGlyphs\"", number(width(&words.text, words.size).round()))
    } else {
        String::new()
    };
    let (colour, text) = (hex(words.colour), escaped(&words.text));
    let _ = writeln!(
        out,
        "<text x=\"{x}\" y=\"{y}\" font-size=\"{size}\" fill=\"{colour}\"{anchor}{bold}{turned}{length}>{text}</text>"
    );
}

fn painted(ink: &Ink) -> String {
    let fill = ink.fill.map_or("none".to_string(), hex);
    let mut out = format!(" fill=\"{fill}\"");
    if let Some((colour, width)) = ink.stroke {
        let _ = write!(out, " stroke=\"{}\" stroke-width=\"{}\"", hex(colour), number(width));
        if ink.dashed {
            out.push_str(" stroke-dasharray=\"3 2\"");
        }
    }
    out
}

fn hex([r, g, b]: Rgb) -> String {
    format!("#{r:02x}{g:02x}{b:02x}")
}

/// Writes a number with two decimals at most, a hundredth of a point; never `-0`.
fn number(value: f64) -> String {
    let text = format!("{value:.2}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".into() } else { text.to_string() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_from_programs_cannot_become_markup() {
        let mut figure = Figure::new(10.0, 10.0, "<b>");
        figure.text((1.0, 2.0), 8.0, Anchor::Start, "a < b & \"c\"");
        let svg = figure.svg();
        assert!(svg.contains("a &lt; b &amp; &quot;c&quot;") && !svg.contains("<b>"), "{svg}");
    }

    #[test]
    fn a_line_for_any_font_is_as_wide_as_it_was_measured() {
        let mut figure = Figure::new(10.0, 10.0, "");
        figure.text((1.0, 2.0), 8.0, Anchor::Start, "wide");
        let wanted = format!("textLength=\"{}\"", number(width("wide", 8.0).round()));
        assert!(figure.svg_in_any_font().contains(&wanted) && !figure.svg().contains("textLength"));
    }

    #[test]
    fn numbers_have_one_spelling() {
        assert_eq!([0.0, -0.001, 2.0, 1.25, 1.236].map(number), ["0", "0", "2", "1.25", "1.24"]);
    }

    #[test]
    fn every_mark_is_drawn_around_its_place() {
        for mark in [Mark::Disc, Mark::Square, Mark::Triangle, Mark::Diamond, Mark::Cross] {
            let mut figure = Figure::new(10.0, 10.0, "");
            figure.mark(mark, (5.0, 5.0), 2.0, Ink::line(BLACK, 1.0));
            let within = |(x, y): (f64, f64)| (x - 5.0).abs() <= 2.5 && (y - 5.0).abs() <= 2.5;
            for shape in &figure.shapes {
                match shape {
                    Shape::Path(points, _) => assert!(points.iter().copied().all(within), "{mark:?}"),
                    Shape::Rect([x, y, w, h], _) => assert!(within((*x, *y)) && within((x + w, y + h))),
                    Shape::Disc(at, ..) => assert!(within(*at)),
                    Shape::Text(_) | Shape::Within(..) => unreachable!("a mark is neither text nor a cutting"),
                }
            }
        }
    }
}
