//! fig:patch-surface-distribution: which parts of a program patches edit, and how.

use super::error::FigureError;
use super::legend::{self, LETTERS, source};
use crate::draw::{Anchor, Axes, BLUE, Figure, GREEN, GREY, Ink, Mark, ORANGE, SKY, Scale};
use crate::evidence::recorded_run::RecordedRun;
use crate::objects::{Attempt, OperationKind, Surface, edit_categories};

/// The parts as readers know them, in the order of `Surface::ALL`.
const PARTS: [&str; 4] = ["Parameters", "Operator graph", "Conditioned policy", "Mechanism modules"];
const KINDS: [(OperationKind, crate::draw::Rgb, &str); 3] = [
    (OperationKind::Add, GREEN, "add"),
    (OperationKind::Replace, SKY, "replace"),
    (OperationKind::Remove, ORANGE, "remove"),
];

/// Counts of edits.
struct Edits {
    /// Patches that could be read, and of them those of candidates that were simulated.
    patches: usize,
    evaluated: usize,
    /// Counts by part: among all patches, among the simulated ones.
    parts: [[usize; 2]; 4],
    /// Counts by part and kind of operation, over all patches.
    operations: [[usize; 3]; 4],
    /// Patches that edit parameters alone.
    scalar_only: [usize; 2],
}

fn count<'a>(attempts: impl Iterator<Item = &'a Attempt>) -> Edits {
    let mut edits =
        Edits { patches: 0, evaluated: 0, parts: [[0; 2]; 4], operations: [[0; 3]; 4], scalar_only: [0; 2] };
    for attempt in attempts {
        let Some(patch) = attempt.proposal.patch() else { continue };
        let evaluated = usize::from(attempt.exit.score().is_some());
        edits.patches += 1;
        edits.evaluated += evaluated;
        let touched = edit_categories(patch);
        for surface in &touched {
            let part = &mut edits.parts[*surface as usize];
            part[0] += 1;
            part[1] += evaluated;
        }
        if touched.iter().eq([&Surface::Parameters]) {
            edits.scalar_only[0] += 1;
            edits.scalar_only[1] += evaluated;
        }
        for operation in &patch.operations {
            let kind = KINDS.iter().position(|(kind, ..)| *kind == operation.op);
            if let (Some(surface), Some(kind)) = (Surface::of_path(&operation.path), kind) {
                edits.operations[surface as usize][kind] += 1;
            }
        }
    }
    edits
}

/// Shares of patches by the part that they edit, and operations by part and kind.
pub fn patch_surface(runs: &[RecordedRun]) -> Result<Figure, FigureError> {
    let edits = count(runs.iter().flat_map(|run| &run.attempts));
    if edits.patches == 0 {
        return Err(FigureError::NoPatches);
    }
    let mut sheet = Figure::new(470.0, 190.0, "What patches edit, by part and by kind");
    shares(&mut sheet, &edits);
    operations(&mut sheet, &edits);
    let runs: Vec<&RecordedRun> = runs.iter().collect();
    let caption = format!(
        "{} patches that could be read, {} of simulated candidates; a patch that edits several parts counts in each. Parameters alone: \
         {} and {}. {}",
        edits.patches,
        edits.evaluated,
        edits.scalar_only[0],
        edits.scalar_only[1],
        source(&runs)
    );
    legend::foot(&mut sheet, &caption);
    Ok(sheet)
}

fn shares(sheet: &mut Figure, edits: &Edits) {
    sheet.heading((10.0, 14.0), 9.0, "Patches that edit a part");
    let axes = Axes {
        place: [95.0, 40.0, 120.0, 118.0],
        across: Scale::fixed(0.0, 100.0, vec![0.0, 25.0, 50.0, 75.0, 100.0]),
        up: Scale::fixed(0.0, 4.0, Vec::new()),
    };
    axes.draw(sheet, "Share of patches (%)", "");
    let of = [edits.patches, edits.evaluated];
    for (at, name) in PARTS.iter().enumerate() {
        let middle = axes.y(3.5 - at as f64);
        sheet.text((88.0, middle + 2.6), LETTERS, Anchor::End, *name);
        for (side, colour) in [(0, GREY), (1, BLUE)] {
            if of[side] == 0 {
                continue;
            }
            let share = 100.0 * edits.parts[at][side] as f64 / of[side] as f64;
            let top = middle - 10.0 + 10.0 * side as f64;
            sheet.rect([axes.x(0.0), top, axes.x(share) - axes.x(0.0), 9.0], Ink::fill(colour));
            sheet.text((axes.x(share) + 3.0, top + 7.2), 6.5, Anchor::Start, format!("{share:.0}"));
        }
    }
    let signs = [(Mark::Square, Ink::fill(GREY), "all"), (Mark::Square, Ink::fill(BLUE), "of simulated candidates")];
    legend::row(sheet, 95.0, 30.0, &signs);
}

fn operations(sheet: &mut Figure, edits: &Edits) {
    sheet.heading((248.0, 14.0), 9.0, "Operations by part and kind");
    let most = edits.operations.iter().map(|kinds| kinds.iter().sum::<usize>()).max().unwrap_or(0);
    let axes = Axes {
        place: [335.0, 40.0, 115.0, 118.0],
        across: Scale::over([0.0, most as f64], 4),
        up: Scale::fixed(0.0, 4.0, Vec::new()),
    };
    axes.draw(sheet, "Operations", "");
    for (at, name) in PARTS.iter().enumerate() {
        let middle = axes.y(3.5 - at as f64);
        sheet.text((328.0, middle + 2.6), LETTERS, Anchor::End, *name);
        let mut before = 0;
        for (kind, (_, colour, _)) in KINDS.iter().enumerate() {
            let count = edits.operations[at][kind];
            let (from, to) = (axes.x(before as f64), axes.x((before + count) as f64));
            sheet.rect([from, middle - 8.0, to - from, 16.0], Ink::fill(*colour));
            before += count;
        }
    }
    let signs = KINDS.map(|(_, colour, name)| (Mark::Square, Ink::fill(colour), name));
    legend::row(sheet, 335.0, 30.0, &signs);
}
