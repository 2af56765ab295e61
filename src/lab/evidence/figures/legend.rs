//! Parts that figures share: a row of signs with their meaning, and the line of the source below.

use crate::draw::{Anchor, Figure, GREY, Ink, Mark, Words, width, wrapped};
use crate::evidence::recorded_run::RecordedRun;

/// Size of letters, points.
pub const LETTERS: f64 = 7.5;
/// Size of the source's line.
const SMALL: f64 = 7.0;

/// A sign and what it means.
pub type Entry<'a> = (Mark, Ink, &'a str);

/// Signs from a place on to the right; tells where the row ends.
pub fn row(figure: &mut Figure, mut x: f64, y: f64, entries: &[Entry<'_>]) -> f64 {
    for (mark, ink, text) in entries {
        figure.mark(*mark, (x + 3.0, y - 2.6), 3.0, *ink);
        figure.text((x + 10.0, y), LETTERS, Anchor::Start, *text);
        x += 22.0 + width(text, LETTERS);
    }
    x
}

/// Lines in grey at the foot of the sheet, which grows by them.
pub fn foot(figure: &mut Figure, text: &str) {
    for line in wrapped(text, SMALL, figure.width - 20.0, 4) {
        let at = (10.0, figure.height + 4.0);
        let (anchor, bold, upwards) = (Anchor::Start, false, false);
        figure.words(Words { at, size: SMALL, anchor, bold, colour: GREY, upwards, text: line });
        figure.height += 9.0;
    }
    figure.height += 4.0;
}

/// Returns the line under a figure: the runs, and what their proposals came from.
pub fn source(runs: &[&RecordedRun]) -> String {
    let named: Vec<String> =
        runs.iter().map(|run| format!("{} (root {})", run.opened.name, run.root.short(12))).collect();
    let from = |(kind, words): (&str, &str)| {
        let own: Vec<&str> =
            runs.iter().filter(|run| run.proposer() == kind).map(|run| run.opened.name.as_str()).collect();
        match own.len() {
            0 => String::new(),
            n if n == runs.len() => format!("; {words}"),
            _ => format!("; {words}: {}", own.join(", ")),
        }
    };
    let kinds = [
        ("scripted", "proposals of the scripted stand-in, which is no language model"),
        ("random", "random legal patches in place of proposals"),
    ];
    format!("Recorded: {}{}.", named.join(", "), kinds.map(from).concat())
}
