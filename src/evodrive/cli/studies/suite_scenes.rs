//! The cases of a suite as rollouts of the driver that they were planned around, or of one whose result is named: what `scenes show`,
//! `draw` and `export` take.

use std::path::Path;

use crate::backend::NoOutcome;
use crate::cli::look::rollout::Played;
use crate::cli::scenes::files;
use crate::cli::studies::suite_drive::{Recorded, driver_source};
use crate::cli::studies::suite_driver::TestDriver;
use crate::cli::studies::suite_file;
use crate::cli::studies::suite_run::{Selection, planner_of};
use crate::cli::studies::suite_stage::{DriverSource, SuiteRunner, as_frozen};
use crate::cli::terminal::exit::Failure;

/// The cases with these ids, or all, played as they were frozen, or as this result's driver drove them.
pub fn played(path: &Path, ids: &[String], recorded: Option<&Path>, jobs: usize) -> Result<Vec<Played>, Failure> {
    let frozen = suite_file::read_to_drive(path)?;
    let selection = Selection { case: ids.to_vec(), ..Selection::default() };
    let (cases, threads) = (selection.of(&frozen.suite)?, files::threads(jobs)?);
    let stage = SuiteRunner::new(&frozen.suite, &threads)?;
    let play = |source: &DriverSource<'_>, name: &str| {
        let played = threads.map(&cases, |_, case| {
            let failed = |error: NoOutcome| Failure::bad_input(format!("{}: {}", case.id, error.reason()));
            let played = stage.played(case, source, name).map_err(failed)?;
            let frozen = recorded.is_none().then(|| as_frozen(case, &played.outcome)).transpose();
            frozen.map(|_| played)
        });
        played.into_iter().collect()
    };
    let mut each = cases.iter().map(|case| frozen.suite.planned_around(case));
    let first = each.next().unwrap_or(&frozen.suite.planned_around);
    if let (None, Some(other)) = (recorded, each.find(|around| *around != first)) {
        return Err(Failure::bad_input(format!(
            "{}: expected cases that were planned around one driver, found {} and {}; name one case, or a result with --recorded",
            path.display(),
            first.name,
            other.name
        )));
    }
    let around = match recorded {
        None => first.clone(),
        Some(path) => {
            let result = suite_file::read_result_of(path, &frozen)?;
            if let Some((planner, answers)) = planner_of(path, &frozen.suite)? {
                let answers = Recorded::new(&stage, planner, answers)?;
                return play(&answers.source(), &result.driver.name);
            }
            result.driver
        }
    };
    let driver = TestDriver::named(&around.name).ok().filter(|driver| driver.mark() == around);
    if let (Some(result), None) = (recorded, &driver) {
        return Err(Failure::miss(format!(
            "{}: no recorded answers of {} beside it; write them with `evodrive suite run {} --driver PLANNER --out RESULT`",
            result.display(),
            around.name,
            path.display()
        )));
    }
    let Some(driver) = driver.filter(|driver| recorded.is_some() || matches!(driver, TestDriver::Policy(..))) else {
        return Err(Failure::bad_input(format!(
            "{}: it was planned around {}, which is not in the file; name who drives: `evodrive suite play {} --case .. --driver ..`",
            path.display(),
            around.name,
            path.display()
        )));
    };
    play(&driver_source(&stage, &driver), &around.name)
}
