//! The report's page of a finished run: whoever carries a run out, asks for its report or watches it writes the same one.

use crate::backend::Backend;
use crate::cli::evolve::cost;
use crate::cli::look::{kept_credit, manoeuvres, playables, program_words};
use crate::cli::records::folder::RunFolder;
use crate::cli::terminal::exit::Failure;
use crate::epoch::{Player, Study};
use crate::evidence::report::{self, Beside, Other, Stage};
use crate::evidence::{RecordedRun, agreement};
use crate::kernel::Threads;
use crate::store;

/// Parts that a page has beside its run if they were asked for.
#[derive(Clone, Copy, Default)]
pub struct Asked<'a> {
    /// How far another simulator's run agrees.
    pub agreement: Option<&'a agreement::Report>,
    /// Runs that it is compared with.
    pub others: &'a [Other],
}

/// Writes report.html of a finished run.
pub fn write(
    study: &Study,
    folder: &RunFolder,
    run: &RecordedRun,
    backend: Backend<'_>,
    asked: Asked<'_>,
    threads: &Threads,
) -> Result<(), Failure> {
    let player = Player::of(study, &run.counsels, backend);
    let gained = manoeuvres::of(&player, run, threads);
    let playables = Stage { gained, ..playables::choose(&player, run, threads) };
    let cost = cost::kept(folder);
    let credits = kept_credit::kept(folder, run)?;
    let words = program_words::of(study, run);
    let (selector, cost) = (&study.selector, cost.as_ref());
    let Asked { agreement, others } = asked;
    let beside = Beside { selector, cost, credits: &credits, agreement, others, words: &words, live: None };
    Ok(store::write_atomic(&folder.report(), report::html(run, &playables, &beside).as_bytes())?)
}
