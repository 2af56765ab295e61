//! A scene or rollout as a film: the picture of every step as pixels, and these as an animated GIF. Nothing depends on the
//! machine, not even on its installed fonts, so the same drawing and options give the same bytes.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use noto_sans_mono_bitmap::{FontWeight, RasterHeight, get_raster, get_raster_width};

use super::drawing::{Drawing, Role};
use super::lettering::Letters;
use super::svg::{Frame, SvgOptions, Theme, View, colour, labels, moment, roles_seen};
use crate::kernel::Threads;

/// How a film is made.
#[derive(Clone, Debug, PartialEq)]
pub struct FilmOptions {
    /// Width of its pictures, pixels.
    pub width_px: f64,
    /// Colours.
    pub theme: Theme,
    /// The part of the world that it shows.
    pub frame: Frame,
    /// Steps of the scene, one a picture.
    pub steps: Vec<usize>,
    /// Title above the pictures; may be empty.
    pub title: String,
}

/// The pictures of a film, all of one size.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Film {
    /// Pixels; even, as encoders of video need it.
    pub width: usize,
    /// Pixels; even.
    pub height: usize,
    /// Rows from the top, red, green and blue a pixel. `[pictures][height * width * 3]`
    pub pictures: Vec<Vec<u8>>,
}

/// A film that cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum FilmError {
    /// A picture's document is not what the rasteriser reads.
    #[error("a picture of the film cannot be read back: {0}")]
    Unreadable(String),
    /// Pictures of this size cannot be held or encoded.
    #[error("a film of {width} by {height} pixels cannot be made; choose a smaller --panel")]
    Size {
        /// Pixels.
        width: usize,
        /// Pixels.
        height: usize,
    },
    /// The encoder refuses a picture.
    #[error("the film cannot be encoded: {0}")]
    Encoding(String),
}

const WEIGHT: FontWeight = FontWeight::Regular;
const LETTER: RasterHeight = RasterHeight::Size16;
/// Height of a line of words, pixels, and the margin around the head's lines.
const LINE_PX: usize = 18;
const EDGE_PX: usize = 6;
/// Most lines of the title: a sentence on how a rollout ended fits a narrow film.
const TITLE_LINES: usize = 4;

/// Makes the pictures, in parallel.
pub fn film(drawing: &Drawing, options: &FilmOptions, threads: &Threads) -> Result<Film, FilmError> {
    let panel = SvgOptions {
        width_px: options.width_px,
        theme: options.theme,
        frame: options.frame,
        step: None,
        trails: true,
        labels: false,
        title: String::new(),
    };
    let view = View::of(drawing, &panel);
    let width = even(view.width_px);
    let title = wrapped(&options.title, (width - 2 * EDGE_PX) / get_raster_width(WEIGHT, LETTER));
    let head = 2 * EDGE_PX + LINE_PX * (title.len() + 1);
    let height = even(head as f64 + view.height_px);
    let roles = roles_seen(options.steps.iter().map(|step| (drawing, &view, *step)));
    let of = Sheet { drawing, panel: &panel, view: &view, title: &title, roles: &roles, head, width, height };
    let pictures = threads.map(&options.steps, |_, step| of.picture(*step)).into_iter().collect::<Result<_, _>>()?;
    Ok(Film { width, height, pictures })
}

fn even(pixels: f64) -> usize {
    2 * (0.5 * pixels).ceil() as usize
}

/// Data that all pictures of a film share.
struct Sheet<'a> {
    drawing: &'a Drawing,
    panel: &'a SvgOptions,
    view: &'a View,
    title: &'a [String],
    /// Roles that are seen in any picture.
    roles: &'a [Role],
    /// Height of the head, pixels.
    head: usize,
    width: usize,
    height: usize,
}

impl Sheet<'_> {
    fn picture(&self, step: usize) -> Result<Vec<u8>, FilmError> {
        let Sheet { drawing, view, panel, width, height, head, .. } = *self;
        let size = FilmError::Size { width, height };
        let (w, h) = (u32::try_from(width).unwrap_or(0), u32::try_from(height).unwrap_or(0));
        let mut pixels = resvg::tiny_skia::Pixmap::new(w, h).ok_or(size)?;
        let text = self.document(step);
        let tree = resvg::usvg::Tree::from_str(&text, &resvg::usvg::Options::default())
            .map_err(|error| FilmError::Unreadable(error.to_string()))?;
        resvg::render(&tree, resvg::tiny_skia::Transform::identity(), &mut pixels.as_mut());
        // The ground is opaque, so the pixels are, too.
        let rgb = pixels.data().chunks_exact(4).flat_map(|p| [p[0], p[1], p[2]]).collect();
        let mut sheet = Written { rgb, width, height };
        let palette = panel.theme.palette();
        let (ink, ground) = (rgb_of(palette.text), rgb_of(palette.ground));
        for (k, line) in self.title.iter().enumerate() {
            sheet.write(EDGE_PX, EDGE_PX + LINE_PX * k, line, ink);
        }
        let below = EDGE_PX + LINE_PX * self.title.len();
        sheet.write(EDGE_PX, below, &clock(drawing, step), ink);
        for (x, role) in self.key() {
            sheet.write(x + SWATCH_PX, below, role.label(), ink);
        }
        let letter = get_raster_width(WEIGHT, LETTER);
        let letters = Letters { advance_px: letter as f64, line_px: LINE_PX as f64 };
        for label in labels(drawing, view, step, false, letters) {
            let (x, y) = (label.x.max(0.0) as usize, (head as f64 + label.y).max(13.0) as usize - 13);
            sheet.veil(x, y, label.text.chars().count(), ground);
            sheet.write(x, y, &label.text, ink);
        }
        Ok(sheet.rgb)
    }

    /// Returns the picture without its words.
    fn document(&self, step: usize) -> String {
        let Sheet { drawing, view, panel, width, height, head, .. } = *self;
        let colours = panel.theme.palette();
        let (w, h) = (view.width_px, view.height_px);
        let mut out = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\">\
             <rect width=\"100%\" height=\"100%\" fill=\"{}\"/>\
             <svg x=\"0\" y=\"{head}\" width=\"{w:.0}\" height=\"{h:.0}\" viewBox=\"0 0 {w:.0} {h:.0}\" overflow=\"hidden\">\
             <rect width=\"100%\" height=\"100%\" fill=\"{}\"/>",
            colours.panel, colours.ground
        );
        moment(&mut out, drawing, view, panel, step);
        out.push_str("</svg>");
        let y = EDGE_PX + LINE_PX * self.title.len() + 3;
        for (x, role) in self.key() {
            let fill = colour(role, panel.theme);
            let _ = write!(out, "<rect x=\"{x}\" y=\"{y}\" width=\"16\" height=\"10\" rx=\"2\" fill=\"{fill}\"/>");
        }
        out.push_str("</svg>");
        out
    }

    /// Returns the columns and roles of the legend behind the clock, as many of the roles that occur as fit.
    fn key(&self) -> Vec<(usize, Role)> {
        let letter = get_raster_width(WEIGHT, LETTER);
        let mut x = EDGE_PX + letter * (clock(self.drawing, self.drawing.steps).chars().count() + 2);
        let mut placed = Vec::new();
        for role in self.roles.iter().copied() {
            let next = x + SWATCH_PX + letter * (role.label().len() + 2);
            if next <= self.width {
                placed.push((x, role));
            }
            x = next;
        }
        placed
    }
}

/// Distance from a colour of the key to its word, pixels.
const SWATCH_PX: usize = 22;

fn clock(drawing: &Drawing, step: usize) -> String {
    format!("t = {:4.1} s", drawing.clock_s(step))
}

/// Pixels with words upon them.
struct Written {
    rgb: Vec<u8>,
    width: usize,
    height: usize,
}

impl Written {
    /// Mixes a colour into a pixel; a place outside is ignored.
    fn mix(&mut self, x: usize, y: usize, with: [u8; 3], share: u32) {
        if x < self.width && y < self.height {
            let at = 3 * (y * self.width + x);
            for (below, above) in self.rgb[at..at + 3].iter_mut().zip(with) {
                *below = ((u32::from(*below) * (255 - share) + u32::from(above) * share + 127) / 255) as u8;
            }
        }
    }

    /// Writes one line of words from its upper left corner on. A letter that the font lacks becomes a question mark.
    fn write(&mut self, x: usize, y: usize, words: &str, ink: [u8; 3]) {
        let letter = get_raster_width(WEIGHT, LETTER);
        for (k, c) in words.chars().enumerate() {
            let Some(shape) = get_raster(c, WEIGHT, LETTER).or_else(|| get_raster('?', WEIGHT, LETTER)) else {
                continue;
            };
            for (dy, row) in shape.pixels().chunks(shape.width().max(1)).enumerate() {
                for (dx, share) in row.iter().enumerate() {
                    self.mix(x + k * letter + dx, y + dy, ink, u32::from(*share));
                }
            }
        }
    }

    /// Lightens the ground of words so that they can be read on anything.
    fn veil(&mut self, x: usize, y: usize, letters: usize, ground: [u8; 3]) {
        let width = letters * get_raster_width(WEIGHT, LETTER);
        for dy in 0..LINE_PX - 1 {
            for dx in 0..width {
                self.mix(x + dx, y + dy, ground, 170);
            }
        }
    }
}

/// Returns `#rrggbb` as bytes.
fn rgb_of(text: &str) -> [u8; 3] {
    let byte = |k: usize| text.get(1 + 2 * k..3 + 2 * k).and_then(|two| u8::from_str_radix(two, 16).ok()).unwrap_or(0);
    [byte(0), byte(1), byte(2)]
}

/// Returns at most two lines of at most so many letters; the rest is cut.
fn wrapped(text: &str, letters: usize) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        match lines.last_mut().filter(|line| line.chars().count() + 1 + word.chars().count() <= letters) {
            Some(line) => *line += &format!(" {word}"),
            None => lines.push(word.into()),
        }
    }
    lines.truncate(TITLE_LINES);
    lines.into_iter().map(|line| line.chars().take(letters).collect()).collect()
}

/// Colours of a GIF.
const COLOURS: usize = 256;

/// Makes an animated GIF that repeats for ever. A picture is shown for `delay_cs` hundredths of a second, the last for `last_cs`.
pub fn gif(film: &Film, delay_cs: u16, last_cs: u16) -> Result<Vec<u8>, FilmError> {
    let Film { width, height, ref pictures } = *film;
    let size = || FilmError::Size { width, height };
    let (w, h) = (u16::try_from(width).map_err(|_| size())?, u16::try_from(height).map_err(|_| size())?);
    let failed = |error: gif::EncodingError| FilmError::Encoding(error.to_string());
    let mut nearest = Nearest::of(pictures);
    let table: Vec<u8> = nearest.table.iter().flatten().copied().collect();
    let mut bytes = Vec::new();
    let mut encoder = gif::Encoder::new(&mut bytes, w, h, &table).map_err(failed)?;
    encoder.set_repeat(gif::Repeat::Infinite).map_err(failed)?;
    let mut before: Option<Vec<u8>> = None;
    for (k, picture) in pictures.iter().enumerate() {
        let now: Vec<u8> = picture.chunks_exact(3).map(|p| nearest.place([p[0], p[1], p[2]])).collect();
        let (left, top, wide, high) = changed(before.as_deref(), &now, width);
        let rows = (top..top + high).flat_map(|y| &now[y * width + left..y * width + left + wide]).copied();
        let mut frame = gif::Frame {
            delay: if k + 1 == pictures.len() { last_cs } else { delay_cs },
            dispose: gif::DisposalMethod::Keep,
            left: left as u16,
            top: top as u16,
            width: wide as u16,
            height: high as u16,
            buffer: rows.collect::<Vec<u8>>().into(),
            ..gif::Frame::default()
        };
        frame.make_lzw_pre_encoded();
        encoder.write_lzw_pre_encoded_frame(&frame).map_err(failed)?;
        before = Some(now);
    }
    drop(encoder);
    Ok(bytes)
}

/// Returns left, top, width and height of the difference between two pictures, at least one pixel; the whole without an earlier one.
fn changed(before: Option<&[u8]>, now: &[u8], width: usize) -> (usize, usize, usize, usize) {
    let Some(before) = before else { return (0, 0, width, now.len() / width.max(1)) };
    let (mut low, mut high) = ((usize::MAX, usize::MAX), (0, 0));
    for (at, _) in before.iter().zip(now).enumerate().filter(|(_, (a, b))| a != b) {
        let (x, y) = (at % width, at / width);
        (low, high) = ((low.0.min(x), low.1.min(y)), (high.0.max(x), high.1.max(y)));
    }
    match low.0 {
        usize::MAX => (0, 0, 1, 1),
        _ => (low.0, low.1, high.0 - low.0 + 1, high.1 - low.1 + 1),
    }
}

/// The most frequent colours, and for every other colour the nearest of them.
struct Nearest {
    table: Vec<[u8; 3]>,
    known: BTreeMap<[u8; 3], u8>,
}

impl Nearest {
    fn of(pictures: &[Vec<u8>]) -> Nearest {
        let mut counts: BTreeMap<[u8; 3], u64> = BTreeMap::new();
        for p in pictures.iter().flat_map(|picture| picture.chunks_exact(3)) {
            *counts.entry([p[0], p[1], p[2]]).or_default() += 1;
        }
        let mut table: Vec<([u8; 3], u64)> = counts.into_iter().collect();
        table.sort_by_key(|(colour, count)| (std::cmp::Reverse(*count), *colour));
        let table = table.into_iter().take(COLOURS).map(|(colour, _)| colour).collect();
        Nearest { table, known: BTreeMap::new() }
    }

    fn place(&mut self, colour: [u8; 3]) -> u8 {
        let table = &self.table;
        let apart = |of: &[u8; 3]| -> u32 { of.iter().zip(colour).map(|(a, b)| u32::from(a.abs_diff(b)).pow(2)).sum() };
        *self
            .known
            .entry(colour)
            .or_insert_with(|| (0..table.len()).min_by_key(|k| apart(&table[*k])).unwrap_or(0) as u8)
    }
}
