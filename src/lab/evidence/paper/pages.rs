//! Checks of whether the pages of a built document can be read, by LaTeX's log, the list of fonts, the places of words and small pictures
//! of the pages. Programs beside LaTeX make all four; this file reads what they print.

/// Points that a line may stand out of its column.
const OVERFULL_PT: f64 = 5.0;
/// Smallest letters of a figure as it is printed, points.
pub const FIGURE_TEXT_PT: f64 = 6.0;
/// Share of a page's height, in the mean of its left and right half, that must hold something.
const FILLED_MIN: f64 = 0.5;
/// Bands that a page is cut into, and margins above and below that are left out, as shares of its height.
const BANDS: usize = 24;
const MARGIN: f64 = 0.07;
/// Grey below which a point is ink.
const INK: u8 = 200;
/// Letters of a word whose shape says how it is read.
const LETTERS_MIN: usize = 4;

/// A page as words and as a picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Page {
    /// True if it is wider than high, as it is or as it is shown: a file may turn a page when it is shown.
    pub is_wide: bool,
    /// Width and height of its longer words, points.
    words: Vec<[f64; 2]>,
    /// Share of its height that holds ink, the mean of both halves; `None` without a picture.
    filled: Option<f64>,
}

/// Lines and pages that stand out of their place by more than 5 pt, from LaTeX's log.
pub fn overfull(log: &str) -> Vec<String> {
    let too_much = |line: &&str| {
        let points = line.split_once('(').and_then(|(_, rest)| rest.split_once("pt too "));
        line.starts_with("Overfull ")
            && points.is_some_and(|(points, _)| points.parse().is_ok_and(|pt: f64| pt > OVERFULL_PT))
    };
    log.lines().filter(too_much).map(str::to_string).collect()
}

/// Returns the faults in a list of `pdffonts`: a font that is not in the document, or one of dots.
pub fn unsound_fonts(listing: &str) -> Vec<String> {
    let lines: Vec<&str> = listing.lines().collect();
    let Some(rules) = lines.iter().position(|line| line.starts_with("---")) else {
        return vec!["pdffonts printed no table of fonts".into()];
    };
    // Columns are as wide as their rules; names with blanks would shift what is cut at blanks.
    let mut columns = Vec::new();
    let mut at = 0;
    for rule in lines[rules].split(' ') {
        columns.push(at..at + rule.len());
        at += rule.len() + 1;
    }
    let heads: Vec<&str> =
        columns.iter().map(|of| lines[rules - 1].get(of.clone()).unwrap_or_default().trim()).collect();
    let of = |line: &str, head: &str| -> String {
        let column = heads.iter().position(|own| *own == head).map(|at| columns[at].clone());
        column.and_then(|column| line.get(column)).unwrap_or_default().trim().to_string()
    };
    let mut wrong = Vec::new();
    for line in &lines[rules + 1..] {
        let name = of(line, "name");
        if of(line, "emb") != "yes" {
            wrong.push(format!("the font {name} is not embedded"));
        } else if of(line, "type").starts_with("Type 3") {
            wrong.push(format!("the font {name} is of dots (Type 3)"));
        }
    }
    wrong
}

/// An attribute of a tag that `pdftotext -bbox` writes.
fn attribute(tag: &str, name: &str) -> Option<f64> {
    let (_, rest) = tag.split_once(&format!("{name}=\""))?;
    rest.split('"').next()?.parse().ok()
}

/// The pages of what `pdftotext -bbox` writes, with the pictures that `pdftoppm -gray` makes of them, in their order.
pub fn pages_of(bbox: &str, pictures: &[Vec<u8>]) -> Vec<Page> {
    let mut pages: Vec<Page> = Vec::new();
    for line in bbox.lines().map(str::trim) {
        if line.starts_with("<page ") {
            let [wide, high] = ["width", "height"].map(|name| attribute(line, name).unwrap_or(0.0));
            let picture = pictures.get(pages.len()).and_then(|picture| read(picture));
            let is_wide = wide > high || picture.as_ref().is_some_and(|of| of.wide > of.high);
            pages.push(Page { is_wide, words: Vec::new(), filled: picture.as_ref().map(filled) });
        } else if let (true, Some(page)) = (line.starts_with("<word "), pages.last_mut()) {
            let word = line.split_once('>').map_or("", |(_, rest)| rest.trim_end_matches("</word>"));
            let [left, top, right, low] =
                ["xMin", "yMin", "xMax", "yMax"].map(|name| attribute(line, name).unwrap_or(0.0));
            if word.chars().count() >= LETTERS_MIN {
                page.words.push([right - left, low - top]);
            }
        }
    }
    pages
}

/// A picture of a page in greys.
struct Picture<'p> {
    wide: usize,
    high: usize,
    points: &'p [u8],
}

/// A picture in PGM; `None` of anything else.
fn read(picture: &[u8]) -> Option<Picture<'_>> {
    let mut fields = Vec::new();
    let mut at = 0;
    while fields.len() < 4 {
        let start = at + picture[at..].iter().position(|b| !b.is_ascii_whitespace())?;
        let end = start + picture[start..].iter().position(u8::is_ascii_whitespace)?;
        fields.push(std::str::from_utf8(&picture[start..end]).ok()?);
        at = end;
    }
    let [magic, wide, high, most] = fields[..] else { return None };
    let (wide, high): (usize, usize) = (wide.parse().ok()?, high.parse().ok()?);
    let points = picture.get(at + 1..).filter(|points| points.len() >= wide * high)?;
    (magic == "P5" && most == "255").then_some(Picture { wide, high, points })
}

/// Share of a page's height with ink, the mean of its left and its right half.
fn filled(of: &Picture<'_>) -> f64 {
    let (first, last) = ((MARGIN * of.high as f64) as usize, ((1.0 - MARGIN) * of.high as f64) as usize);
    let is_inked = |rows: std::ops::Range<usize>, columns: std::ops::Range<usize>| {
        rows.clone().any(|y| columns.clone().any(|x| of.points[y * of.wide + x] < INK))
    };
    let band = |k: usize| first + k * (last - first) / BANDS..first + (k + 1) * (last - first) / BANDS;
    let half = |columns: std::ops::Range<usize>| (0..BANDS).filter(|k| is_inked(band(*k), columns.clone())).count();
    (half(0..of.wide / 2) + half(of.wide / 2..of.wide)) as f64 / (2 * BANDS) as f64
}

/// Returns the faults of pages: one that lies on its side, one whose words do, one that is half empty. The last page may end where it does.
pub fn unsound_pages(pages: &[Page]) -> Vec<String> {
    let mut wrong = Vec::new();
    for (at, page) in pages.iter().enumerate() {
        let number = at + 1;
        let turned = page.words.iter().filter(|[wide, high]| high > wide).count();
        if page.is_wide || 2 * turned > page.words.len() {
            wrong.push(format!("page {number} prints sideways"));
        }
        if let Some(filled) = page.filled.filter(|filled| *filled < FILLED_MIN && number < pages.len()) {
            wrong.push(format!("page {number} is half empty: {:.0} % of its height holds something", 100.0 * filled));
        }
    }
    wrong
}

/// A figure's file as a document includes it.
#[derive(Clone, Debug, PartialEq)]
pub struct FigureUse {
    pub name: String,
    /// Printed width, points.
    pub width_pt: f64,
}

/// The figures that a document says of in its log, in lines `evofigure: NAME WIDTHpt`.
pub fn figures_of(log: &str) -> Vec<FigureUse> {
    let of = |line: &str| {
        let (name, width) = line.strip_prefix("evofigure: ")?.split_once(' ')?;
        // TeX's point is a little smaller than that of the file.
        let width_pt = width.strip_suffix("pt")?.parse::<f64>().ok()? * 72.0 / 72.27;
        Some(FigureUse { name: name.to_string(), width_pt })
    };
    log.lines().filter_map(of).collect()
}

/// The smallest letters of a figure's file as it is printed at a width, points; `None` where it has no words or is none of ours.
pub fn smallest_text_pt(pdf: &[u8], width_pt: f64) -> Option<f64> {
    let text = String::from_utf8_lossy(pdf);
    let own = text.split_once("/MediaBox [")?.1.split(']').next()?;
    let own: Vec<f64> = own.split_whitespace().filter_map(|number| number.parse().ok()).collect();
    let [left, _, right, _] = own[..] else { return None };
    let sizes = text.split(" Tf\n").filter_map(|before| before.rsplit([' ', '\n']).next()?.parse::<f64>().ok());
    let smallest = sizes.fold(f64::INFINITY, f64::min);
    smallest.is_finite().then_some(smallest * width_pt / (right - left))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::draw::{Anchor, Figure, pdf};

    #[test]
    fn a_line_that_stands_out_by_more_than_five_points_is_told() {
        let log = "Overfull \\hbox (4.9pt too wide) in paragraph at lines 1--2\nOverfull \\hbox (12.25pt too wide) in alignment at lines 3--4\n\
                   Overfull \\vbox (30.0pt too high) has occurred\nUnderfull \\hbox (badness 10000)\n";
        let wrong = overfull(log);
        assert_eq!(wrong.len(), 2);
        assert!(wrong[0].contains("12.25pt") && wrong[1].contains("too high"), "{wrong:?}");
    }

    #[test]
    fn a_font_that_is_not_embedded_or_of_dots_is_named() {
        let listing = "name                    type              encoding         emb sub uni object ID\n\
                       ----------------------- ----------------- ---------------- --- --- --- ---------\n\
                       AAAAAA+NimbusRomNo9L    Type 1            Custom           yes yes no       5  0\n\
                       Helvetica               Type 1            Standard         no  no  no       6  0\n\
                       T3Font_0                Type 3            Custom           yes no  no       7  0\n";
        assert_eq!(
            unsound_fonts(listing),
            ["the font Helvetica is not embedded", "the font T3Font_0 is of dots (Type 3)"]
        );
        assert_eq!(unsound_fonts("no table").len(), 1);
    }

    /// A picture of 20 x 100 points with ink in these columns down to a row.
    fn picture(columns: std::ops::Range<usize>, rows: usize) -> Vec<u8> {
        let point = |at: usize| if columns.contains(&(at % 20)) && at / 20 < rows { 0 } else { 255 };
        b"P5\n20 100\n255\n".iter().copied().chain((0..2000).map(point)).collect()
    }

    fn bbox(words: &[[f64; 4]]) -> String {
        let word = |[left, top, right, low]: &[f64; 4]| {
            format!("    <word xMin=\"{left}\" yMin=\"{top}\" xMax=\"{right}\" yMax=\"{low}\">words</word>\n")
        };
        format!("  <page width=\"595.0\" height=\"842.0\">\n{}  </page>\n", words.iter().map(word).collect::<String>())
    }

    #[test]
    fn a_page_that_lies_on_its_side_or_is_half_empty_is_told_and_the_last_may_end_early() {
        let (level, upright) = ([10.0, 10.0, 40.0, 20.0], [10.0, 10.0, 20.0, 40.0]);
        let text = format!(
            "{}{}{}{}",
            bbox(&[level, level, upright]),
            bbox(&[upright, upright, level]),
            bbox(&[level]),
            bbox(&[level])
        );
        let pictures = [picture(0..20, 100), picture(0..20, 90), picture(0..10, 80), picture(0..20, 20)];
        let wrong = unsound_pages(&pages_of(&text, &pictures));
        assert_eq!(wrong, ["page 2 prints sideways", "page 3 is half empty: 44 % of its height holds something"]);
        let wide = text.replacen("width=\"595.0\" height=\"842.0\"", "width=\"842.0\" height=\"595.0\"", 1);
        assert_eq!(unsound_pages(&pages_of(&wide, &pictures))[0], "page 1 prints sideways");
        // A page that the file turns has a wide picture and a size that is not turned.
        let turned = [b"P5\n100 20\n255\n".to_vec(), vec![0; 2000]].concat();
        assert_eq!(unsound_pages(&pages_of(&text, &[turned])), ["page 1 prints sideways", "page 2 prints sideways"]);
        // A picture that is none says nothing of its page.
        assert!(pages_of(&text, &[b"P6".to_vec()])[0].filled.is_none());
    }

    #[test]
    fn letters_are_as_small_as_the_figure_is_printed() {
        let mut figure = Figure::new(200.0, 50.0, "words");
        figure.text((10.0, 10.0), 8.0, Anchor::Start, "large");
        figure.text((10.0, 30.0), 7.0, Anchor::Start, "small");
        let file = pdf(&figure).unwrap();
        assert!((smallest_text_pt(&file, 100.0).unwrap() - 3.5).abs() < 1e-9);
        assert_eq!(smallest_text_pt(&pdf(&Figure::new(200.0, 50.0, "")).unwrap(), 100.0), None);
        let uses = figures_of("x\nevofigure: front 240.9pt\nevofigure: broken\n");
        assert_eq!(uses.len(), 1);
        assert!(uses[0].name == "front" && (uses[0].width_pt - 240.0).abs() < 1e-9, "{uses:?}");
    }
}
