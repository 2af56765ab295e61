//! The report's page of a finished run: whoever carries a run out, asks for its report or watches it writes the same one.

use super::exit::Failure;
use super::folder::RunFolder;
use super::{cost, playables};
use crate::backend::Backend;
use crate::epoch::{Player, Study};
use crate::evidence::report::{self, Beside};
use crate::evidence::{RecordedRun, agreement};
use crate::kernel::Threads;
use crate::store;

/// Writes report.html of a finished run.
pub fn write(
    study: &Study,
    folder: &RunFolder,
    story: &RecordedRun,
    backend: Backend<'_>,
    agreement: Option<&agreement::Report>,
    threads: &Threads,
) -> Result<(), Failure> {
    let playables = playables::choose(&Player::of(study, &story.counsels, backend), story, threads);
    let cost = cost::kept(folder)?;
    let beside = Beside { selector: &study.selector, cost: cost.as_ref(), agreement, live: None };
    Ok(store::write_atomic(&folder.report(), report::html(story, &playables, &beside).as_bytes())?)
}
