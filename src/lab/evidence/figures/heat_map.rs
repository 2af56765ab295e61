//! Matrices of shares as heat maps, a panel each: rows and columns are named, every cell has its number.

use crate::draw::{Anchor, BLACK, BLUE, Figure, Ink, LIGHT, Rgb, WHITE, Words, width};
use crate::kernel::num;

/// One matrix.
#[derive(Clone, Debug, PartialEq)]
pub struct Panel {
    pub title: String,
    /// Name and values of each row; `None` is a cell without a number.
    pub rows: Vec<(String, Vec<Option<f64>>)>,
    pub columns: Vec<String>,
}

/// Size of letters, of a cell's width and height, points.
const LETTERS: f64 = 7.5;
const CELL: [f64; 2] = [38.0, 15.0];
/// Above and beside the panels.
const TOP: f64 = 46.0;
const GAP: f64 = 16.0;

/// The panels side by side with the rows' names at the left. Values run from 0, white, to `most`, the darkest.
pub fn heat_map(title: &str, panels: &[Panel], most: f64) -> Figure {
    let names = panels.first().map_or(&[][..], |panel| &panel.rows);
    let left = 16.0 + names.iter().map(|(name, _)| width(name, LETTERS)).fold(0.0, f64::max);
    let across: f64 = panels.iter().map(|panel| CELL[0] * panel.columns.len() as f64 + GAP).sum();
    let height = TOP + CELL[1] * names.len() as f64 + 10.0;
    let mut sheet = Figure::new(left + across, height, title);
    sheet.heading((8.0, 13.0), 9.0, title);
    for (row, (name, _)) in names.iter().enumerate() {
        sheet.text((left - 6.0, middle(row)), LETTERS, Anchor::End, name.as_str());
    }
    let mut x = left;
    for panel in panels {
        sheet.heading((x, 27.0), 8.0, panel.title.as_str());
        for (column, name) in panel.columns.iter().enumerate() {
            let at = (x + CELL[0] * (column as f64 + 0.5), TOP - 5.0);
            sheet.text(at, LETTERS, Anchor::Middle, name.as_str());
        }
        for (row, (_, values)) in panel.rows.iter().enumerate() {
            for (column, value) in values.iter().enumerate() {
                cell(&mut sheet, x + CELL[0] * column as f64, TOP + CELL[1] * row as f64, *value, most);
            }
        }
        x += CELL[0] * panel.columns.len() as f64 + GAP;
    }
    sheet
}

fn middle(row: usize) -> f64 {
    TOP + CELL[1] * (row as f64 + 0.5) + 2.6
}

fn cell(sheet: &mut Figure, x: f64, y: f64, value: Option<f64>, most: f64) {
    let Some(value) = value else {
        return sheet.rect([x, y, CELL[0], CELL[1]], Ink::fill(LIGHT).edged(WHITE, 1.0));
    };
    let depth = (value / most.max(1e-9)).clamp(0.0, 1.0);
    sheet.rect([x, y, CELL[0], CELL[1]], Ink::fill(shade(depth)).edged(WHITE, 1.0));
    let colour = if depth > 0.55 { WHITE } else { BLACK };
    let at = (x + 0.5 * CELL[0], y + 0.5 * CELL[1] + 2.6);
    let (anchor, bold, upwards, text) = (Anchor::Middle, false, false, num::fixed(value, 3));
    sheet.words(Words { at, size: LETTERS, anchor, bold, colour, upwards, text });
}

/// Between white and blue.
fn shade(depth: f64) -> Rgb {
    [0, 1, 2].map(|part| {
        let (from, to) = (f64::from(WHITE[part]), f64::from(BLUE[part]));
        (from + depth * (to - from)).round().clamp(0.0, 255.0) as u8
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_larger_share_is_darker_and_a_missing_one_has_no_number() {
        let rows = vec![("parent".to_string(), vec![Some(0.1), Some(0.9), None])];
        let columns = ["IDM", "PDM", "SAC"].map(String::from).to_vec();
        let svg = heat_map("Published", &[Panel { title: "Published".into(), rows, columns }], 1.0).svg();
        assert!(svg.contains("0.100") && svg.contains("0.900") && svg.contains("PDM"), "{svg}");
        let brightness = |depth: f64| shade(depth).map(u32::from).iter().sum::<u32>();
        assert!(brightness(0.9) < brightness(0.1) && shade(0.0) == WHITE);
    }
}
