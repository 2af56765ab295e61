//! The cases of a suite as rollouts of the driver that they were planned around: what `scenes show`, `draw` and `export` take.

use std::path::Path;

use crate::cli::look::rollout::Played;
use crate::cli::scenes::files;
use crate::cli::studies::suite_drive::wheel_of;
use crate::cli::studies::suite_driver::TestDriver;
use crate::cli::studies::suite_file;
use crate::cli::studies::suite_run::Selection;
use crate::cli::studies::suite_stage::{Stage, as_frozen};
use crate::cli::terminal::exit::Failure;

/// The cases with these ids, or all, played as they were frozen.
pub fn played(path: &Path, ids: &[String], jobs: usize) -> Result<Vec<Played>, Failure> {
    let frozen = suite_file::read_to_drive(path)?;
    let selection = Selection { case: ids.to_vec(), ..Selection::default() };
    let (cases, threads) = (selection.of(&frozen.suite)?, files::threads(jobs)?);
    let around = &frozen.suite.planned_around;
    let driver = TestDriver::named(&around.name).ok().filter(|driver| driver.mark() == *around);
    let Some(driver @ TestDriver::Policy(..)) = driver else {
        return Err(Failure::bad_input(format!(
            "{}: it was planned around {}, which is not in the file; name who drives: `evodrive suite play {} --case .. --driver ..`",
            path.display(),
            around.name,
            path.display()
        )));
    };
    let stage = Stage::new(&frozen.suite, &threads);
    let wheel = wheel_of(&stage, &driver);
    let played = threads.map(&cases, |_, case| {
        let failed = |error: crate::backend::NoOutcome| Failure::bad_input(format!("{}: {}", case.id, error.reason()));
        let played = stage.played(case, &wheel, &around.name).map_err(failed)?;
        as_frozen(case, &played.outcome).map(|()| played)
    });
    played.into_iter().collect()
}
