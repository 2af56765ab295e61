//! Arimo, whose letters are as wide as Helvetica's: the font that travels in PDF files, with the letters of WinAnsi (Latin 1 and the
//! dash). `fonts/OFL.txt` is its licence. The files are Arimo 2020 from Google Fonts, cut to these letters without hints.

/// A weight of the font.
pub struct Font {
    /// Its name in a document; six letters and a plus say that it is a part of the font.
    pub name: &'static [u8],
    /// TrueType.
    pub file: &'static [u8],
    /// Widths of the codes from 32 to 255 in thousandths of the size; 0 where the encoding has no letter that is drawn.
    pub widths: [u16; 224],
    /// The rectangle that holds every letter, thousandths of the size.
    pub bounds: [i16; 4],
    /// Width of its stems, thousandths of the size.
    pub stem: u16,
}

/// Above and below the line, and the height of capitals, thousandths of the size.
pub const ASCENT: i16 = 905;
/// Below the line.
pub const DESCENT: i16 = -212;
/// Of capitals.
pub const CAPITALS: u16 = 688;

/// Plain letters.
pub const REGULAR: Font = Font {
    name: b"EVODRI+Arimo-Regular",
    file: include_bytes!("fonts/Arimo-Regular.ttf"),
    widths: [
        278, 278, 355, 556, 556, 889, 667, 191, 333, 333, 389, 584, 278, 333, 278, 278, 556, 556, 556, 556, 556, 556,
        556, 556, 556, 556, 278, 278, 584, 584, 584, 556, 1015, 667, 667, 722, 722, 667, 611, 778, 722, 278, 500, 667,
        556, 833, 722, 778, 667, 778, 722, 667, 611, 722, 667, 944, 667, 667, 611, 278, 278, 278, 469, 556, 333, 556,
        556, 500, 556, 556, 278, 556, 556, 222, 222, 500, 222, 833, 556, 556, 556, 556, 333, 500, 278, 556, 500, 722,
        500, 500, 500, 334, 260, 334, 584, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 556, 0,
        0, 0, 0, 0, 0, 0, 0, 0, 278, 333, 556, 556, 556, 556, 260, 556, 333, 737, 370, 556, 584, 333, 737, 552, 400,
        549, 333, 333, 333, 576, 537, 333, 333, 333, 365, 556, 834, 834, 834, 611, 667, 667, 667, 667, 667, 667, 1000,
        722, 667, 667, 667, 667, 278, 278, 278, 278, 722, 722, 778, 778, 778, 778, 778, 584, 778, 722, 722, 722, 722,
        667, 667, 611, 556, 556, 556, 556, 556, 556, 889, 500, 556, 556, 556, 556, 278, 278, 278, 278, 556, 556, 556,
        556, 556, 556, 556, 549, 611, 556, 556, 556, 556, 500, 556, 500,
    ],
    bounds: [-375, -212, 1000, 896],
    stem: 84,
};

/// Bold letters.
pub const BOLD: Font = Font {
    name: b"EVODRI+Arimo-Bold",
    file: include_bytes!("fonts/Arimo-Bold.ttf"),
    widths: [
        278, 333, 474, 556, 556, 889, 722, 238, 333, 333, 389, 584, 278, 333, 278, 278, 556, 556, 556, 556, 556, 556,
        556, 556, 556, 556, 333, 333, 584, 584, 584, 611, 975, 722, 722, 722, 722, 667, 611, 778, 722, 278, 556, 722,
        611, 833, 722, 778, 667, 778, 722, 667, 611, 722, 667, 944, 667, 667, 611, 333, 278, 333, 584, 556, 333, 556,
        611, 556, 611, 556, 333, 611, 611, 278, 278, 556, 278, 889, 611, 611, 611, 611, 389, 556, 333, 611, 556, 778,
        556, 556, 500, 389, 280, 389, 584, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 556, 0,
        0, 0, 0, 0, 0, 0, 0, 0, 278, 333, 556, 556, 556, 556, 280, 556, 333, 737, 370, 556, 584, 333, 737, 552, 400,
        549, 333, 333, 333, 600, 556, 333, 333, 333, 365, 556, 834, 834, 834, 611, 722, 722, 722, 722, 722, 722, 1000,
        722, 667, 667, 667, 667, 278, 278, 278, 278, 722, 722, 778, 778, 778, 778, 778, 584, 778, 722, 722, 722, 722,
        667, 667, 611, 556, 556, 556, 556, 556, 556, 889, 556, 556, 556, 556, 556, 278, 278, 278, 278, 611, 611, 611,
        611, 611, 611, 611, 549, 611, 611, 611, 611, 611, 556, 611, 556,
    ],
    bounds: [-454, -222, 1000, 905],
    stem: 140,
};
