//! `scenes`: import, list and compare scenes; showing and exporting have files of their own.

use clap::builder::PossibleValuesParser;
use clap::{Args, Subcommand};
use serde_json::json;
use std::fmt::Write as _;
use std::path::PathBuf;

use crate::cli::scenes::files::{Row, keeps, known_tags, listing, read, rows, threads, written};
use crate::cli::scenes::{best, browse, compare, draw, export, pools, readable, show};
use crate::cli::terminal::output::Output;
use crate::cli::terminal::{answer::Answer, exit::Failure};
use crate::experiment::{self, Experiment};
use crate::formats::conventions::{Conventions, HEADINGS, ReadAs, VELOCITIES};
use crate::formats::log::SampleTimes;
use crate::formats::summary::{Reading, SameId};
use crate::scene::DT_S;
use crate::scene::stats::PoolStats;
use crate::text::counted;

#[derive(Debug, Subcommand)]
pub enum Command {
    /// Read scenario files, folders or pools into a pool.
    #[command(after_help = readable::in_help())]
    Import(ImportOptions),
    /// Write the scenes that an experiment generates into a pool.
    Generate(GenerateOptions),
    /// List the scenes of a pool or of scenario files.
    List(ListOptions),
    /// Check whether evolution can use each scene, and say why not; exit code 2 if one cannot be used. Scenes whose recorded ego
    /// itself crashes are named, and a table says whose fields contradict each other.
    Check(pools::CheckOptions),
    /// Write the scenes that have tags, for which an expression holds, or whose recorded ego crashes nowhere, into a pool.
    Filter(pools::FilterOptions),
    /// Write the scenes of several pools into one; a scene that occurs twice is kept once, different scenes with one
    /// id are refused.
    Merge(pools::MergeOptions),
    /// Split the usable scenes of a pool into two pools that share none, by a seed or by a tag.
    Split(pools::SplitOptions),
    /// Show one scene, as it is or as an attempt played it; draw it as SVG or as a page that plays it.
    Show(show::Options),
    /// Rank a run's rollouts by severity or realism, with the command that shows each.
    Best(best::Options),
    /// Draw one scene or rollout as a strip of moments side by side, for a paper (SVG, PDF), or as a film (GIF, MP4).
    Draw(draw::Options),
    /// Write a page of thumbnails, a scene each, with filters by place, source, contact or threat, number of road users and speed; it works offline.
    Browse(browse::Options),
    /// Write scenes, as they are or as an attempt played them, in a format that other programs read.
    Export(export::Options),
    /// How two pools differ: distances quantity by quantity, and how well a classifier tells them apart.
    Compare(compare::Options),
    /// Compare pools: speeds, gaps, accelerations, yaw rates, conflicts, side by side.
    Stats(StatsOptions),
}

#[derive(Debug, Args)]
pub struct ImportOptions {
    /// Scenario files, folders or pools.
    #[arg(required = true)]
    pub paths: Vec<PathBuf>,
    /// OpenDRIVE files of towns, or a folder of them, for SafeBench's route files; a file's name is its town's name.
    #[arg(long)]
    pub towns: Vec<PathBuf>,
    /// Take a scene of a file also where a different scene has its id: under its id and its file's name.
    #[arg(long)]
    pub keep_both: bool,
    /// Take the samples of ScenarioNet and Waymo files as 0.1 s apart whatever their times are, to compare with tools that
    /// ignore these.
    #[arg(long)]
    pub ignore_times: bool,
    /// Take the samples of any file as this many seconds apart, whatever it says.
    #[arg(long, value_name = "SECONDS", conflicts_with = "ignore_times")]
    pub step_s: Option<f64>,
    /// Read headings in this convention. `judged`: as written, or in the one in which they surely are, which is said. `motion`: each
    /// looks where it goes.
    #[arg(long, value_name = "CONVENTION", default_value = "judged", value_parser = headings())]
    pub headings: String,
    /// Read velocities in this convention. `judged`: likewise, and where most contradict the places, from places. `places`: all
    /// from places.
    #[arg(long, value_name = "CONVENTION", default_value = "judged", value_parser = velocities())]
    pub velocities: String,
    /// Pool file to write.
    #[arg(long)]
    pub out: PathBuf,
    #[command(flatten)]
    pub output: Output,
}

#[derive(Debug, Args)]
pub struct GenerateOptions {
    /// Experiment file whose scenes are generated, imported or read from a pool.
    pub experiment: PathBuf,
    /// Pool file to write.
    #[arg(long)]
    pub out: PathBuf,
    #[command(flatten)]
    pub output: Output,
    /// Scenario files, folders or a pool, instead of the experiment's scenes.
    #[arg(long, num_args = 1..)]
    pub scenes: Vec<PathBuf>,
}

#[derive(Debug, Args)]
pub struct ListOptions {
    /// A pool, scenario files or folders.
    #[arg(required = true)]
    pub paths: Vec<PathBuf>,
    /// Only scenes with this tag, e.g. junction; may be repeated.
    #[arg(long)]
    pub tag: Vec<String>,
    /// Only scenes that evolution can use.
    #[arg(long)]
    pub usable: bool,
}

#[derive(Debug, Args)]
pub struct StatsOptions {
    /// Pools, scenario files or folders; one column each.
    #[arg(required = true)]
    pub paths: Vec<PathBuf>,
}

pub fn run(command: Command, jobs: usize) -> Result<Answer, Failure> {
    match command {
        Command::Import(options) => import(&options, jobs),
        Command::Generate(options) => generate(&options, jobs),
        Command::List(options) => list(&options, jobs),
        Command::Check(options) => pools::check(&options, jobs),
        Command::Filter(options) => pools::filter(&options, jobs),
        Command::Merge(options) => pools::merge(&options, jobs),
        Command::Split(options) => pools::split(&options, jobs),
        Command::Show(options) => show::run(&options, jobs),
        Command::Best(options) => best::run(&options, jobs),
        Command::Draw(options) => draw::run(&options, jobs),
        Command::Browse(options) => browse::run(&options, jobs),
        Command::Export(options) => export::run(&options, jobs),
        Command::Compare(options) => compare::run(&options, jobs),
        Command::Stats(options) => stats(&options, jobs),
    }
}

fn import(options: &ImportOptions, jobs: usize) -> Result<Answer, Failure> {
    let paths: Vec<PathBuf> = options.paths.iter().chain(&options.towns).cloned().collect();
    let threads = threads(jobs)?;
    let same_id = if options.keep_both { SameId::Renamed } else { SameId::LeftOut };
    let conventions = conventions(options)?;
    written(
        &experiment::read_scenes_as(&paths, Reading { same_id, conventions }, &threads)?,
        &options.out,
        options.output,
        &threads,
    )
}

/// Names of the readings of a field: judged, its conventions, derived.
fn readings<C>(table: &'static [C], name: fn(&C) -> &'static str, derived: &'static str) -> PossibleValuesParser {
    let names = std::iter::once("judged").chain(table.iter().map(name)).chain([derived]);
    PossibleValuesParser::new(names)
}

fn headings() -> PossibleValuesParser {
    readings(&HEADINGS, |of| of.name, "motion")
}

fn velocities() -> PossibleValuesParser {
    readings(&VELOCITIES, |of| of.name, "places")
}

fn conventions(options: &ImportOptions) -> Result<Conventions, Failure> {
    let times = match options.step_s {
        Some(step_s) if (0.01..=1.0).contains(&step_s) => SampleTimes::Every(step_s),
        Some(step_s) => {
            return Err(Failure::bad_input(format!("--step-s {step_s}: expected seconds from 0.01 to 1")));
        }
        None if options.ignore_times => SampleTimes::Every(DT_S),
        None => SampleTimes::Recorded,
    };
    let known = |at: Option<usize>| at.map_or(ReadAs::Derived, ReadAs::Known);
    let read_as = |name: &str, at: Option<usize>| if name == "judged" { ReadAs::Judged } else { known(at) };
    let headings = HEADINGS.iter().position(|of| of.name == options.headings);
    let velocities = VELOCITIES.iter().position(|of| of.name == options.velocities);
    Ok(Conventions {
        times,
        headings: read_as(&options.headings, headings),
        velocities: read_as(&options.velocities, velocities),
    })
}

fn generate(options: &GenerateOptions, jobs: usize) -> Result<Answer, Failure> {
    let experiment = Experiment::read(&options.experiment)?;
    let threads = threads(jobs)?;
    written(&experiment.scenes(&options.scenes, &threads)?, &options.out, options.output, &threads)
}

fn list(options: &ListOptions, jobs: usize) -> Result<Answer, Failure> {
    known_tags(&options.tag)?;
    let pool = read(&options.paths, jobs)?;
    let rows = rows(&pool, &threads(jobs)?);
    let kept: Vec<Row> = rows.into_iter().filter(|row| keeps(row, &options.tag, options.usable)).collect();
    Ok(Answer::new(listing(&kept), json!({"digest": pool.digest(), "scenes": kept, "left_out": pool.left_out})))
}

fn stats(options: &StatsOptions, jobs: usize) -> Result<Answer, Failure> {
    let mut columns = Vec::new();
    for path in &options.paths {
        let pool = read(std::slice::from_ref(path), jobs)?;
        columns.push((path.display().to_string(), PoolStats::of(&pool.scenes)));
    }
    let mut text = String::new();
    for (k, (name, stats)) in columns.iter().enumerate() {
        let _ = writeln!(text, "[{}] {name}: {}", k + 1, counted(stats.scenes, "scene"));
    }
    let _ = write!(text, "{:<30}", "p5 / p50 / p95 (mean)");
    for k in 0..columns.len() {
        let _ = write!(text, " {:>38}", format!("[{}]", k + 1));
    }
    text.push('\n');
    let rows: Vec<_> = columns.iter().map(|(_, stats)| stats.rows()).collect();
    for line in 0..rows.first().map_or(0, |r| r.len()) {
        let _ = write!(text, "{:<30}", rows[0][line].0);
        for column in &rows {
            let cell = column[line]
                .1
                .map_or("-".to_string(), |s| format!("{:.2} / {:.2} / {:.2} ({:.2})", s.p5, s.p50, s.p95, s.mean));
            let _ = write!(text, " {cell:>38}");
        }
        text.push('\n');
    }
    let object: Vec<_> = columns.iter().map(|(name, stats)| json!({"pool": name, "stats": stats})).collect();
    Ok(Answer::new(text, json!({"pools": object})))
}
