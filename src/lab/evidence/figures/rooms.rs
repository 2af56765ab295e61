//! fig:method-architecture and fig:system-arch: the rooms of the code, floor by floor, read from the table of docs/ARCHITECTURE.md. A
//! test of the architecture holds that table to the code, so the figure has no other source.

use std::collections::BTreeMap;

use super::error::FigureError;
use super::legend;
use crate::draw::{Anchor, BLACK, Figure, GREEN, GREY, Ink, ORANGE, PURPLE, Rgb, SKY, Words, YELLOW, wrapped};

const PAGE: &str = include_str!("../../../../docs/ARCHITECTURE.md");

/// A line of the table of rooms.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Room {
    /// The storey, e.g. `ground`.
    pub floor: String,
    /// The folder of `src/`.
    pub name: String,
    /// Contents of the room.
    pub holds: String,
    /// Number of rooms that it may import; `None` where the page lists them elsewhere.
    pub imports: Option<usize>,
}

/// The rooms of a page, in its order. A line without a floor belongs to the one before.
pub fn rooms(page: &str) -> Vec<Room> {
    let mut floor = String::new();
    let mut rooms = Vec::new();
    let table = page.lines().skip_while(|line| !line.starts_with("| floor | room |")).skip(2);
    for line in table.take_while(|line| line.starts_with('|')) {
        let cells: Vec<&str> = line.trim_matches('|').split('|').map(str::trim).collect();
        let [own, name, holds, imports] = cells[..] else { continue };
        if !own.is_empty() {
            floor = own.to_string();
        }
        let listed = !imports.contains(':') && imports != "all";
        rooms.push(Room {
            floor: floor.clone(),
            name: name.to_string(),
            // The font has no arrow.
            holds: holds.replace('`', "").replace(" → ", " to "),
            imports: listed.then(|| imports.split_whitespace().count()),
        });
    }
    rooms
}

const COLOURS: [Rgb; 5] = [SKY, GREEN, YELLOW, ORANGE, PURPLE];
/// Boxes of a row, the width of one and the room between, points.
const IN_A_ROW: usize = 3;
const BOX: f64 = 132.5;
const GAP: f64 = 5.0;
const LEFT: f64 = 62.0;
/// Size of letters in a box, and from one line to the next, points.
const LETTERS: f64 = 7.0;
const LINE: f64 = 8.2;
/// Height from a box's top to its first line, which stands below the name.
const HEAD: f64 = 20.0;

/// The rooms as boxes, a band a floor, the ground at the bottom.
pub fn architecture() -> Result<Figure, FigureError> {
    drawn(PAGE)
}

fn drawn(page: &str) -> Result<Figure, FigureError> {
    let all = rooms(page);
    if all.is_empty() {
        return Err(FigureError::NoRooms);
    }
    let mut floors: Vec<&str> = all.iter().map(|room| room.floor.as_str()).collect();
    floors.dedup();
    let mut by_floor: BTreeMap<&str, Vec<&Room>> = BTreeMap::new();
    for room in &all {
        by_floor.entry(room.floor.as_str()).or_default().push(room);
    }
    let mut sheet = Figure::new(470.0, 24.0, "Rooms of the code");
    sheet.heading((10.0, 14.0), 9.0, "The rooms of the code: each may import only from those below it");
    for (place, floor) in floors.iter().enumerate().rev() {
        let rooms = by_floor.get(floor).map(Vec::as_slice).unwrap_or_default();
        band(&mut sheet, floor, rooms, COLOURS[place % COLOURS.len()]);
    }
    legend::foot(&mut sheet, "From the table of docs/ARCHITECTURE.md, which a test holds to the imports of the code.");
    Ok(sheet)
}

/// Returns the contents of a room as lines of its box; none is left out.
fn lines(room: &Room) -> Vec<String> {
    wrapped(&room.holds, LETTERS, BOX - 8.0, usize::MAX)
}

fn band(sheet: &mut Figure, floor: &str, rooms: &[&Room], colour: Rgb) {
    let top = sheet.height;
    // The boxes of a row are as high as the fullest one needs.
    let fullest = |row: &[&Room]| row.iter().map(|room| lines(room).len()).max().unwrap_or(0);
    let heights: Vec<f64> = rooms.chunks(IN_A_ROW).map(|row| HEAD + LINE * fullest(row) as f64).collect();
    let high = heights.iter().map(|own| own + GAP).sum::<f64>() + GAP;
    let pale = colour.map(|part| 255 - (255 - part) / 4);
    sheet.rect([10.0, top, 450.0, high - 2.0], Ink::fill(pale));
    sheet.words(Words {
        at: (28.0, top + 0.5 * high),
        size: 9.0,
        anchor: Anchor::Middle,
        bold: true,
        colour: BLACK,
        upwards: true,
        text: floor.to_string(),
    });
    for (place, room) in rooms.iter().enumerate() {
        let (column, row) = ((place % IN_A_ROW) as f64, place / IN_A_ROW);
        let x = LEFT - 18.0 + column * (BOX + GAP);
        let y = top + GAP - 1.0 + heights[..row].iter().map(|own| own + GAP).sum::<f64>();
        sheet.rect([x, y, BOX, heights[row]], Ink::fill([255, 255, 255]).edged(GREY, 0.6));
        sheet.heading((x + 4.0, y + 10.5), 8.5, room.name.as_str());
        let imports = match room.imports {
            Some(1) => "imports 1 room".to_string(),
            Some(count) => format!("imports {count} rooms"),
            None => "imports any room".to_string(),
        };
        let (at, anchor) = ((x + BOX - 3.0, y + 9.5), Anchor::End);
        let small = Words { at, size: LETTERS, anchor, bold: false, colour: GREY, upwards: false, text: imports };
        sheet.words(small);
        for (nth, line) in lines(room).into_iter().enumerate() {
            sheet.text((x + 4.0, y + HEAD + LINE * nth as f64), LETTERS, Anchor::Start, line);
        }
    }
    sheet.height += high;
}
