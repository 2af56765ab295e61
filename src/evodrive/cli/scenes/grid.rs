//! `scenes draw --grid`: many scenes of a pool, or rollouts of a program, on one sheet.

use serde_json::json;
use std::path::{Path, PathBuf};

use crate::cli::look::playables;
use crate::cli::look::rollout::{self, OfAttempt, Played};
use crate::cli::scenes::files;
use crate::cli::terminal::output::Output;
use crate::cli::terminal::{answer::Answer, exit::Failure};
use crate::draw::{Cell, Drawing, GridOptions, grid, pdf};
use crate::text::counted;

/// Panels of a grid at most, and side by side.
pub const PANELS_MAX: usize = 60;
const COLUMNS: usize = 4;
/// Width of a sheet, points: the text of a page.
const SHEET_PT: f64 = 494.0;

/// Drawing that is wanted, and its place.
pub struct Wanted<'a> {
    /// A pool or scenario file, or the run of the attempt.
    pub path: Option<&'a PathBuf>,
    pub of: &'a OfAttempt,
    /// One scene instead of all.
    pub scene: Option<&'a String>,
    /// Panels at most.
    pub count: usize,
    /// Margin around ego and adversaries, metres.
    pub around_m: f64,
    /// Width of a panel, points.
    pub panel_pt: Option<f64>,
    pub out: &'a Path,
    pub output: &'a Output,
}

/// Draws the first scenes of a pool; of a program's rollouts those with a contact that it brings about, then the others, each in the order
/// of the scenes.
pub fn drawn(wanted: &Wanted<'_>, jobs: usize) -> Result<Answer, Failure> {
    let (cells, of, all) = match (&wanted.of.attempt, wanted.path) {
        (Some(attempt), path) => {
            let named: Vec<String> = wanted.scene.into_iter().cloned().collect();
            let mut rollouts = rollout::of_attempt(&wanted.of.run(path)?, attempt, &named, jobs)?;
            let all = rollouts.len();
            rollouts.sort_by_key(|played| !attacks(played));
            rollouts.truncate(wanted.count);
            let met = rollouts.iter().filter(|played| attacks(played)).count();
            let cells: Vec<Cell> = rollouts.iter().map(of_rollout).collect();
            let shown = counted(cells.len(), "rollout");
            (cells, format!("{attempt}: {met} of {shown} end in a contact with the adversary"), all)
        }
        (None, Some(path)) => {
            let pool = files::read(std::slice::from_ref(path), jobs)?;
            let meant = match wanted.scene {
                Some(id) => vec![files::named(&pool, path, id)?],
                None => pool.scenes.iter().collect(),
            };
            let recorded = |scene: &&crate::scene::Scene| Cell {
                name: scene.id.clone(),
                caption: format!(
                    "{} in {:.1} s",
                    counted(scene.tracks.len(), "road user"),
                    scene.steps as f64 * crate::scene::DT_S
                ),
                drawing: Drawing::of_scene(scene),
            };
            (meant.iter().take(wanted.count).map(recorded).collect(), file_name(path), meant.len())
        }
        (None, None) => return Err(Failure::bad_input("name a pool, a scenario file or an attempt")),
    };
    let usual = (SHEET_PT + 6.0) / COLUMNS as f64 - 6.0;
    let left_out = all - cells.len();
    let more = if left_out == 0 { String::new() } else { format!("; {left_out} more are left out") };
    let title = format!("{of}{more}. Outlines: half a second apart.");
    let sheet = grid(
        &cells,
        &GridOptions {
            columns: COLUMNS,
            panel_pt: wanted.panel_pt.unwrap_or(usual),
            around_m: wanted.around_m,
            title: title.clone(),
        },
    );
    let is_pdf = wanted.out.extension().is_some_and(|ending| ending == "pdf");
    let bytes = if is_pdf { pdf(&sheet).map_err(Failure::bad_input)? } else { sheet.svg().into_bytes() };
    wanted.output.write(wanted.out, &bytes)?;
    let scenes: Vec<&str> = cells.iter().map(|cell| cell.name.as_str()).collect();
    let text = format!("{title}\n{}: {}", counted(cells.len(), "panel"), wanted.out.display());
    Ok(Answer::new(text, json!({"out": wanted.out, "title": title, "scenes": scenes, "left_out": left_out})))
}

fn attacks(played: &Played) -> bool {
    played.outcome.contact.is_some_and(|contact| contact.adversary)
}

fn of_rollout(played: &Played) -> Cell {
    let contact =
        played.outcome.contact.map_or(String::new(), |contact| format!(", {:.1} m/s", contact.relative_speed_mps));
    Cell {
        name: played.scene.id.clone(),
        caption: format!("{}{contact}", playables::end_in_words(&played.outcome)),
        drawing: played.drawing(),
    }
}

fn file_name(path: &Path) -> String {
    path.file_name().map_or(String::new(), |name| name.to_string_lossy().into_owned())
}
