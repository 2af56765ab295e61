//! A figure as PDF, one page with Helvetica, which every reader of PDF has: no font travels with the file, and equal figures are equal
//! bytes. The pdf-writer crate writes the objects; dates and names of programs are left out.

use pdf_writer::types::LineCapStyle;
use pdf_writer::{Content, Finish, Name, Pdf, Rect, Ref, Str, TextStr};

use super::figure::{Anchor, Figure, Ink, Rgb, Shape, Words};
use super::helvetica;

/// Control points of the cubic that is nearest to a quarter of a circle.
const ROUND: f64 = 0.552_285;
/// Bold letters are wider by about this much.
const BOLD: f64 = 1.06;

/// The figure as a PDF document of one page.
pub fn pdf(figure: &Figure) -> Vec<u8> {
    let [catalog, pages, page, plain, bold, drawn, info] = [1, 2, 3, 4, 5, 6, 7].map(Ref::new);
    let mut out = Pdf::new();
    out.catalog(catalog).pages(pages);
    out.pages(pages).kids([page]).count(1);
    let mut sheet = out.page(page);
    sheet.media_box(Rect::new(0.0, 0.0, figure.width as f32, figure.height as f32)).parent(pages).contents(drawn);
    sheet.resources().fonts().pair(Name(b"F1"), plain).pair(Name(b"F2"), bold);
    sheet.finish();
    for (font, name) in [(plain, b"Helvetica".as_slice()), (bold, b"Helvetica-Bold".as_slice())] {
        out.type1_font(font).base_font(Name(name)).encoding_predefined(Name(b"WinAnsiEncoding"));
    }
    out.stream(drawn, &content(figure));
    out.document_info(info).title(TextStr(&figure.title));
    out.finish()
}

fn content(figure: &Figure) -> Vec<u8> {
    let mut out = Content::new();
    out.set_line_cap(LineCapStyle::RoundCap);
    draw(&mut out, &figure.shapes, figure.height);
    out.finish().into_vec()
}

fn draw(out: &mut Content, shapes: &[Shape], height: f64) {
    let up = |y: f64| height - y;
    for shape in shapes {
        match shape {
            Shape::Rect([x, y, w, h], ink) => {
                begin(out, ink);
                out.rect(short(*x), short(up(y + h)), short(*w), short(*h));
                paint(out, ink);
            }
            Shape::Path(points, ink) => {
                begin(out, ink);
                for (place, (x, y)) in points.iter().enumerate() {
                    match place {
                        0 => out.move_to(short(*x), short(up(*y))),
                        _ => out.line_to(short(*x), short(up(*y))),
                    };
                }
                paint(out, ink);
            }
            Shape::Disc((x, y), r, ink) => {
                begin(out, ink);
                disc(out, (*x, up(*y)), *r);
                paint(out, ink);
            }
            Shape::Text(words) => text(out, words, up(words.at.1)),
            Shape::Within([x, y, w, h], shapes) => {
                out.save_state().rect(short(*x), short(up(y + h)), short(*w), short(*h)).clip_nonzero().end_path();
                draw(out, shapes, height);
                out.restore_state();
            }
        }
    }
}

fn begin(out: &mut Content, ink: &Ink) {
    if let Some(fill) = ink.fill {
        let [r, g, b] = unit(fill);
        out.set_fill_rgb(r, g, b);
    }
    if let Some((colour, width)) = ink.stroke {
        let [r, g, b] = unit(colour);
        out.set_stroke_rgb(r, g, b).set_line_width(short(width));
        out.set_dash_pattern(if ink.dashed { vec![3.0, 2.0] } else { vec![] }, 0.0);
    }
}

fn paint(out: &mut Content, ink: &Ink) {
    match (ink.fill.is_some(), ink.stroke.is_some()) {
        (true, true) => out.fill_nonzero_and_stroke(),
        (true, false) => out.fill_nonzero(),
        (false, true) => out.stroke(),
        (false, false) => out.end_path(),
    };
}

fn disc(out: &mut Content, (x, y): (f64, f64), r: f64) {
    let k = ROUND * r;
    out.move_to(short(x + r), short(y));
    for [a, b, c] in [
        [(r, k), (k, r), (0.0, r)],
        [(-k, r), (-r, k), (-r, 0.0)],
        [(-r, -k), (-k, -r), (0.0, -r)],
        [(k, -r), (r, -k), (r, 0.0)],
    ] {
        let [a, b, c] = [a, b, c].map(|(dx, dy)| [short(x + dx), short(y + dy)]);
        out.cubic_to(a[0], a[1], b[0], b[1], c[0], c[1]);
    }
}

fn text(out: &mut Content, words: &Words, y: f64) {
    let wide = helvetica::width(&words.text, words.size) * if words.bold { BOLD } else { 1.0 };
    let back = match words.anchor {
        Anchor::Start => 0.0,
        Anchor::Middle => 0.5 * wide,
        Anchor::End => wide,
    };
    let x = words.at.0;
    let matrix = match words.upwards {
        false => [1.0, 0.0, 0.0, 1.0, short(x - back), short(y)],
        true => [0.0, 1.0, -1.0, 0.0, short(x), short(y - back)],
    };
    let [r, g, b] = unit(words.colour);
    out.begin_text().set_fill_rgb(r, g, b);
    out.set_font(Name(if words.bold { b"F2" } else { b"F1" }), short(words.size));
    out.set_text_matrix(matrix).show(Str(&latin(&words.text))).end_text();
}

/// In the font's encoding; what it lacks becomes a question mark.
fn latin(text: &str) -> Vec<u8> {
    let byte = |c: char| match c {
        '\u{2013}' => 0x96,
        '\u{2212}' => b'-',
        c if matches!(u32::from(c), 32..=126 | 160..=255) => u32::from(c) as u8,
        _ => b'?',
    };
    text.chars().map(byte).collect()
}

fn unit(colour: Rgb) -> [f32; 3] {
    colour.map(|part| short(f64::from(part) / 255.0))
}

/// With three decimals at most, so that a file holds no digits that nobody sees.
fn short(value: f64) -> f32 {
    ((value * 1000.0).round() / 1000.0) as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::draw::figure::{BLACK, BLUE};

    #[test]
    fn the_page_holds_every_shape_and_the_same_bytes_each_time() {
        let mut figure = Figure::new(100.0, 50.0, "a figure");
        figure.rect([10.0, 5.0, 20.0, 10.0], Ink::fill(BLUE));
        figure.line((0.0, 0.0), (100.0, 50.0), Ink::line(BLACK, 0.5));
        figure.text((50.0, 40.0), 8.0, Anchor::Middle, "Größe (1)");
        let beyond = Shape::Path(vec![(0.0, 0.0), (90.0, 9.0)], Ink::line(BLUE, 1.0));
        figure.shapes.push(Shape::Within([40.0, 5.0, 20.0, 10.0], vec![beyond]));
        let bytes = pdf(&figure);
        assert_eq!(bytes, pdf(&figure));
        let text: String = bytes.iter().map(|b| char::from(*b)).collect();
        assert!(text.starts_with("%PDF-") && text.contains("10 35 20 10 re") && text.contains("100 0 l"), "{text}");
        // Letters beyond ASCII stand as hex digits, in the font's encoding.
        assert!(text.to_uppercase().contains("4772F6DF65") && text.contains("/Helvetica"), "{text}");
        assert!(!text.contains("CreationDate"));
        let clip = text.find("40 35 20 10 re").unwrap();
        assert!(text[clip..].starts_with("40 35 20 10 re\nW\nn") && text[clip..].contains("90 41 l"), "{text}");
    }
}
