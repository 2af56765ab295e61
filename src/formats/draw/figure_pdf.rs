//! A figure as PDF, one page with its font in it, so that it looks the same everywhere; equal figures are equal bytes. The pdf-writer
//! crate writes the objects; dates and names of programs are left out. The svg2pdf crate (0.13) does not stand here, because it walks its
//! fonts through a map with a random seed, so that a page with plain and bold letters has other bytes each time, and because it needs usvg
//! 0.45 and pdf-writer 0.12, which would be built beside the ones in use.

use pdf_writer::types::{FontFlags, LineCapStyle};
use pdf_writer::{Content, Finish, Name, Pdf, Rect, Ref, Str, TextStr};

use super::arimo::{self, BOLD, Font, REGULAR};
use super::figure::{Anchor, Figure, Ink, Rgb, Shape, Words};

/// Control points of the cubic that is nearest to a quarter of a circle.
const ROUND: f64 = 0.552_285;
/// A letter that would be printed as another one.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "the figure \"{figure}\" says \"{text}\", and its font has no letter {letter:?}; expected letters of Latin 1 and dashes: spell it otherwise"
)]
pub struct PdfError {
    figure: String,
    text: String,
    letter: char,
}

/// Returns the figure as a PDF document of one page.
///
/// # Errors
/// A letter that the font lacks: a question mark in its place would be a wrong figure.
pub fn pdf(figure: &Figure) -> Result<Vec<u8>, PdfError> {
    if let Some((text, letter)) = unmapped(&figure.shapes) {
        return Err(PdfError { figure: figure.title.clone(), text, letter });
    }
    let mut drawn = Content::new();
    drawn.set_line_cap(LineCapStyle::RoundCap);
    draw(&mut drawn, &figure.shapes, figure.height);
    let weights = [false, true].map(|bold| has_words(&figure.shapes, bold));
    Ok(document(figure.width, figure.height, &figure.title, &drawn.finish().into_vec(), weights))
}

/// Returns the first line of text with a letter that the font lacks, and the letter.
fn unmapped(shapes: &[Shape]) -> Option<(String, char)> {
    shapes.iter().find_map(|shape| match shape {
        Shape::Text(words) => {
            words.text.chars().find(|c| code(*c).is_none()).map(|letter| (words.text.clone(), letter))
        }
        Shape::Within(_, shapes) => unmapped(shapes),
        _ => None,
    })
}

/// Returns words from an outside source, such as a model, with a blank for each letter that the font lacks: no figure may depend on them.
pub fn in_font(words: &str) -> String {
    words.chars().map(|c| if code(c).is_some() { c } else { ' ' }).collect()
}

/// Names of the plain and the bold font in the page's content.
const NAMES: [Name<'static>; 2] = [Name(b"F1"), Name(b"F2")];

/// Writes a page of this size with its drawing, and the fonts of its words.
fn document(width: f64, height: f64, title: &str, drawn: &[u8], weights: [bool; 2]) -> Vec<u8> {
    let [catalog, pages, page, content, info] = [1, 2, 3, 4, 5].map(Ref::new);
    // Three objects a font: the font, its description for readers, its file.
    let places = [6, 9].map(|first| [first, first + 1, first + 2].map(Ref::new));
    let used: Vec<_> = [(&REGULAR, 0), (&BOLD, 1)].into_iter().filter(|(_, at)| weights[*at]).collect();
    let mut out = Pdf::new();
    // The version that LaTeX writes: it warns of a newer one.
    out.set_version(1, 5);
    out.catalog(catalog).pages(pages);
    out.pages(pages).kids([page]).count(1);
    let mut sheet = out.page(page);
    sheet.media_box(Rect::new(0.0, 0.0, width as f32, height as f32)).parent(pages).contents(content);
    let mut resources = sheet.resources();
    let mut fonts = resources.fonts();
    used.iter().for_each(|(_, at)| {
        fonts.pair(NAMES[*at], places[*at][0]);
    });
    fonts.finish();
    resources.finish();
    sheet.finish();
    out.stream(content, drawn);
    out.document_info(info).title(TextStr(title));
    for (font, at) in used {
        embed(&mut out, font, places[at]);
    }
    out.finish()
}

/// Embeds the font with its file: publishers take no document that depends on the reader's fonts.
fn embed(out: &mut Pdf, font: &Font, [own, descriptor, file]: [Ref; 3]) {
    let mut dict = out.indirect(own).dict();
    dict.pair(Name(b"Type"), Name(b"Font")).pair(Name(b"Subtype"), Name(b"TrueType"));
    dict.pair(Name(b"BaseFont"), Name(font.name)).pair(Name(b"Encoding"), Name(b"WinAnsiEncoding"));
    dict.pair(Name(b"FirstChar"), 32).pair(Name(b"LastChar"), 255).pair(Name(b"FontDescriptor"), descriptor);
    dict.insert(Name(b"Widths")).array().items(font.widths.map(i32::from));
    dict.finish();
    let [left, low, right, high] = font.bounds.map(f32::from);
    let mut known = out.font_descriptor(descriptor);
    known.name(Name(font.name)).flags(FontFlags::NON_SYMBOLIC).bbox(Rect::new(left, low, right, high));
    known.italic_angle(0.0).ascent(f32::from(arimo::ASCENT)).descent(f32::from(arimo::DESCENT));
    known.cap_height(f32::from(arimo::CAPITALS)).stem_v(f32::from(font.stem)).font_file2(file);
    known.finish();
    let mut stream = out.stream(file, font.file);
    stream.pair(Name(b"Length1"), font.file.len() as i32);
}

/// Returns `true` if words of this weight are among the shapes.
fn has_words(shapes: &[Shape], bold: bool) -> bool {
    shapes.iter().any(|shape| match shape {
        Shape::Text(words) => words.bold == bold,
        Shape::Within(_, shapes) => has_words(shapes, bold),
        _ => false,
    })
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
                disc(out, *x, up(*y), *r);
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

fn disc(out: &mut Content, x: f64, y: f64, r: f64) {
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
    let font = if words.bold { &BOLD } else { &REGULAR };
    let wide = thousandths(font, &words.text) * words.size / 1000.0;
    let back = match words.anchor {
        Anchor::Start => 0.0,
        Anchor::Middle => 0.5 * wide,
        Anchor::End => wide,
    };
    let x = words.at.0;
    let matrix = if words.upwards {
        [0.0, 1.0, -1.0, 0.0, short(x), short(y - back)]
    } else {
        [1.0, 0.0, 0.0, 1.0, short(x - back), short(y)]
    };
    let [r, g, b] = unit(words.colour);
    out.begin_text().set_fill_rgb(r, g, b);
    out.set_font(NAMES[usize::from(words.bold)], short(words.size));
    out.set_text_matrix(matrix).show(Str(&latin(&words.text))).end_text();
}

/// Encodes a text in the font's encoding.
fn latin(text: &str) -> Vec<u8> {
    text.chars().filter_map(code).collect()
}

/// Returns the drawn width of a line of text, thousandths of its size.
fn thousandths(font: &Font, text: &str) -> f64 {
    latin(text).iter().map(|code| f64::from(font.widths[usize::from(*code) - 32])).sum()
}

/// Returns the code of a letter; `None` where the font has none.
fn code(c: char) -> Option<u8> {
    match c {
        '\u{2013}' => Some(0x96),
        '\u{2212}' => Some(b'-'),
        '\u{2018}' | '\u{2019}' => Some(b'\''),
        '\u{201c}' | '\u{201d}' => Some(b'"'),
        c if matches!(u32::from(c), 32..=126 | 160..=255) => u8::try_from(u32::from(c)).ok(),
        _ => None,
    }
}

fn unit(colour: Rgb) -> [f32; 3] {
    colour.map(|part| short(f64::from(part) / 255.0))
}

/// Rounds to three decimals at most, so that a file holds no invisible digits.
fn short(value: f64) -> f32 {
    ((value * 1000.0).round() / 1000.0) as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::draw::figure::{BLACK, BLUE};
    use crate::draw::helvetica;

    #[test]
    fn the_page_holds_every_shape_and_the_same_bytes_each_time() {
        let mut figure = Figure::new(100.0, 50.0, "a figure");
        figure.rect([10.0, 5.0, 20.0, 10.0], Ink::fill(BLUE));
        figure.line((0.0, 0.0), (100.0, 50.0), Ink::line(BLACK, 0.5));
        figure.text((50.0, 40.0), 8.0, Anchor::Middle, "Größe (1)");
        let beyond = Shape::Path(vec![(0.0, 0.0), (90.0, 9.0)], Ink::line(BLUE, 1.0));
        figure.shapes.push(Shape::Within([40.0, 5.0, 20.0, 10.0], vec![beyond]));
        let bytes = pdf(&figure).unwrap();
        assert_eq!(bytes, pdf(&figure).unwrap());
        let text: String = bytes.iter().map(|b| char::from(*b)).collect();
        assert!(text.starts_with("%PDF-1.5") && text.contains("10 35 20 10 re") && text.contains("100 0 l"), "{text}");
        // Letters beyond ASCII stand as hex digits, in the font's encoding.
        assert!(
            text.to_uppercase().contains("4772F6DF65") && text.contains("/BaseFont /EVODRI+Arimo-Regular"),
            "{text}"
        );
        assert!(!text.contains("CreationDate"));
        let clip = text.find("40 35 20 10 re").unwrap();
        assert!(text[clip..].starts_with("40 35 20 10 re\nW\nn") && text[clip..].contains("90 41 l"), "{text}");
    }
    /// Returns the text between two words of a document.
    fn between<'t>(text: &'t str, from: &str, to: &str) -> &'t str {
        text.split_once(from).and_then(|(_, rest)| rest.split_once(to)).map_or("", |(found, _)| found).trim()
    }

    #[test]
    fn a_font_travels_with_the_words_that_need_it_and_no_other_is_named() {
        let mut figure = Figure::new(100.0, 50.0, "words");
        let text_of = |figure: &Figure| -> String { pdf(figure).unwrap().iter().map(|b| char::from(*b)).collect() };
        assert!(!text_of(&figure).contains("/FontFile2"), "no words, no font");
        figure.text((50.0, 40.0), 8.0, Anchor::Middle, "plain");
        let plain = text_of(&figure);
        assert_eq!((plain.matches("/FontFile2").count(), plain.contains("Arimo-Bold")), (1, false));
        let mut inner = Figure::new(1.0, 1.0, "");
        inner.heading((50.0, 20.0), 8.0, "bold");
        figure.shapes.push(Shape::Within([0.0, 0.0, 9.0, 9.0], inner.shapes));
        let both = text_of(&figure);
        assert_eq!((both.matches("/FontFile2").count(), both.matches("/Type /Font\n").count()), (2, 2), "{both}");
        for standard in ["Helvetica", "Times", "Courier", "Type1"] {
            assert!(!both.contains(standard), "{standard} is not in the file");
        }
        // The file is there whole: a TrueType file begins so.
        let bytes = pdf(&figure).unwrap();
        for font in [REGULAR, BOLD] {
            assert!(font.file.starts_with(&[0, 1, 0, 0]));
            assert!(bytes.windows(font.file.len()).any(|part| part == font.file));
        }
        assert_eq!(between(&both, "/FirstChar", "/LastChar"), "32");
    }

    #[test]
    fn the_font_is_as_wide_as_text_is_laid_out() {
        for code in 32..127u8 {
            let laid_out = helvetica::width(&char::from(code).to_string(), 1000.0);
            assert_eq!(f64::from(REGULAR.widths[usize::from(code) - 32]), laid_out, "{}", char::from(code));
        }
        // Every letter that the encoding has is drawn.
        let codes = (32..127).chain(160..256).chain([0x96]);
        assert!(codes.into_iter().all(|code: usize| REGULAR.widths[code - 32] > 0 && BOLD.widths[code - 32] > 0));
    }

    #[test]
    fn a_letter_that_the_font_lacks_is_an_error_and_no_question_mark() {
        let mut figure = Figure::new(100.0, 50.0, "arrows");
        figure.text((50.0, 40.0), 8.0, Anchor::Middle, "10–20 m, é, “so”");
        assert!(pdf(&figure).is_ok());
        let mut inner = Figure::new(1.0, 1.0, "");
        inner.text((50.0, 40.0), 8.0, Anchor::Middle, "a → b");
        figure.shapes.push(Shape::Within([0.0, 0.0, 9.0, 9.0], inner.shapes));
        let error = pdf(&figure).unwrap_err().to_string();
        assert!(error.contains("\"arrows\" says \"a → b\"") && error.contains("'→'"), "{error}");
    }
}
