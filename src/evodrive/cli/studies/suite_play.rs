//! `suite play`: one case with one or more drivers, side by side.

use clap::Args;
use serde_json::json;
use std::fmt::Write as _;
use std::path::PathBuf;

use crate::cli::scenes::draw::film_of;
use crate::cli::scenes::files;
use crate::cli::studies::suite_drive::{Recorded, Running, driver_source};
use crate::cli::studies::suite_driver::TestDriver;
use crate::cli::studies::suite_file;
use crate::cli::studies::suite_run::{fresh, planner_of};
use crate::cli::studies::suite_stage::SuiteRunner;
use crate::cli::terminal::interrupt::Interrupt;
use crate::cli::terminal::output::{Output, by_ending};
use crate::cli::terminal::{answer::Answer, exit::Failure};
use crate::draw::{Drawing, beside_html};
use crate::sim::timeline_text::sentences;
use crate::suite::Case;

#[derive(Debug, Args)]
pub struct Options {
    /// Suite file.
    pub suite: PathBuf,
    /// The case, as `evodrive suite show` lists it.
    #[arg(long)]
    pub case: String,
    /// Driver, as for `evodrive suite run`; may be repeated.
    #[arg(long)]
    pub driver: Vec<String>,
    /// A planner's result whose recorded answers drive; may be repeated.
    #[arg(long, value_name = "RESULT")]
    pub recorded: Vec<PathBuf>,
    /// File to write: a page that plays them side by side (.html); of one driver a film (.gif; .mp4 where ffmpeg is installed).
    #[arg(long)]
    pub out: PathBuf,
    #[command(flatten)]
    pub output: Output,
}

/// Content of a file, as the ending of its name says.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    Page,
    Gif,
    Mp4,
}

pub fn run(options: &Options, jobs: usize) -> Result<Answer, Failure> {
    let kind = by_ending("--out", &options.out, [("html", Kind::Page), ("gif", Kind::Gif), ("mp4", Kind::Mp4)])?;
    let drivers = options.driver.len() + options.recorded.len();
    if kind != Kind::Page && drivers != 1 {
        let what = format!("expected one driver for a film, found {drivers}; a .html plays several side by side");
        return Err(Failure::bad_input(format!("--out {}: {what}", options.out.display())));
    }
    let frozen = suite_file::read_to_drive(&options.suite)?;
    let selection =
        crate::cli::studies::suite_run::Selection { case: vec![options.case.clone()], ..Default::default() };
    let case = selection.of(&frozen.suite)?.into_iter().next();
    let (threads, interrupt) = (files::threads(jobs)?, Interrupt::listen()?);
    let stage = SuiteRunner::new(&frozen.suite, &threads)?;
    let Some(case) = case else { return Err(Failure::internal("a case that was named is gone")) };
    let mut drawings: Vec<(String, Drawing)> = Vec::new();
    for word in &options.driver {
        let driver = TestDriver::named(word)?;
        let name = driver.mark().name;
        if let TestDriver::Planner(_) = &driver {
            let running = Running { threads: &threads, interrupt: &interrupt };
            let made = fresh(&frozen, &stage, &selection, &driver, None, &running)?;
            let TestDriver::Recorded(_, planner) = made.driver else {
                return Err(Failure::internal("a planner was driven and not recorded"));
            };
            let refused = made.result.cases.first().filter(|played| played.drive().is_none());
            if let Some(played) = refused {
                return Err(Failure::bad_input(format!("{}: {name}: {}", case.id, played.in_words())));
            }
            let recorded = Recorded::new(&stage, planner, made.answers)?;
            drawings.push(drawn(&stage, case, &recorded.source(), &name)?);
        } else {
            drawings.push(drawn(&stage, case, &driver_source(&stage, &driver), &name)?);
        }
    }
    for path in &options.recorded {
        let result = suite_file::read_result_of(path, &frozen)?;
        let Some((planner, answers)) = planner_of(path, &frozen.suite)? else {
            let what = "no recorded answers beside it; a driver that needs none is named with --driver";
            return Err(Failure::miss(format!("{}: {what}", path.display())));
        };
        let recorded = Recorded::new(&stage, planner, answers)?;
        drawings.push(drawn(&stage, case, &recorded.source(), &result.driver.name)?);
    }
    if drawings.is_empty() {
        return Err(Failure::bad_input("name who drives with --driver or --recorded"));
    }
    if let (true, Some((line, drawing))) = (kind != Kind::Page, drawings.first()) {
        return film_of(&options.out, options.output, kind == Kind::Gif, drawing, line.clone(), jobs);
    }
    options.output.write(&options.out, beside_html(&drawings, &case.id).as_bytes())?;
    let mut text: String = drawings.iter().map(|(line, _)| format!("{line}\n")).collect();
    let _ = writeln!(text, "{}", options.out.display());
    let lines: Vec<&String> = drawings.iter().map(|(line, _)| line).collect();
    Ok(Answer::new(text, json!({"out": options.out, "case": case.id, "drivers": lines})))
}

/// A rollout with the line above it.
fn drawn(
    stage: &SuiteRunner<'_>,
    case: &Case,
    source: &crate::cli::studies::suite_stage::DriverSource<'_>,
    name: &str,
) -> Result<(String, Drawing), Failure> {
    let played = stage
        .played(case, source, name)
        .map_err(|error| Failure::bad_input(format!("{}: {name}: {}", case.id, error.reason())))?;
    let drove = stage
        .drove(case, source)
        .map_err(|error| Failure::bad_input(format!("{}: {name}: {}", case.id, error.reason())))?;
    let why = drove.timeline.as_ref().map_or(String::new(), |timeline| format!("; {}", sentences(timeline)));
    Ok((format!("{name}: {}{why}", drove.drive().in_words()), played.drawing()))
}
