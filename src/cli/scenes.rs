//! `scenes`: import, list and compare scenes; showing and exporting have files of their own.

use clap::{Args, Subcommand};
use serde_json::json;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use super::answer::Answer;
use super::exit::Failure;
use super::{left_out, readable, scene_best, scene_draw, scene_export, scene_pools, scene_show};
use crate::experiment::{self, Experiment};
use crate::kernel::Threads;
use crate::objects::spelling::nearest;
use crate::scene::features::TAGS;
use crate::scene::safebench::TrafficFamily;
use crate::scene::stats::PoolStats;
use crate::scene::{LaneGraph, Pool, Scene, SceneFeatures, pool, usable};
use crate::store;

#[derive(Debug, Subcommand)]
pub enum Command {
    /// Read scenario files, folders or pools into a pool.
    #[command(after_help = readable::in_help())]
    Import(ImportOptions),
    /// Write the scenes that an experiment generates into a pool.
    Generate(GenerateOptions),
    /// List the scenes of a pool or of scenario files.
    List(ListOptions),
    /// Check whether evolution can use each scene, and say why not; exit code 2 if one cannot be used.
    Check(scene_pools::CheckOptions),
    /// Write the scenes that have tags, or for which an expression holds, into a pool.
    Filter(scene_pools::FilterOptions),
    /// Write the scenes of several pools into one; a scene that occurs twice is kept once, different scenes with one
    /// id are refused.
    Merge(scene_pools::MergeOptions),
    /// Split the usable scenes of a pool into two pools that share none, by a seed or by a tag.
    Split(scene_pools::SplitOptions),
    /// Show one scene, as it is or as an attempt played it; draw it as SVG or as a page that plays it.
    Show(scene_show::Options),
    /// Rank a run's rollouts by severity or realism, with the command that shows each.
    Best(scene_best::Options),
    /// Draw one scene or rollout as a strip of moments side by side, for a paper (SVG).
    Draw(scene_draw::Options),
    /// Write scenes, as they are or as an attempt played them, in a format that other programs read.
    Export(scene_export::Options),
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
    /// Pool file to write.
    #[arg(long)]
    pub out: PathBuf,
}

#[derive(Debug, Args)]
pub struct GenerateOptions {
    /// Experiment file whose scenes are generated, imported or read from a pool.
    pub experiment: PathBuf,
    /// Pool file to write.
    #[arg(long)]
    pub out: PathBuf,
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
        Command::Check(options) => scene_pools::check(&options, jobs),
        Command::Filter(options) => scene_pools::filter(&options, jobs),
        Command::Merge(options) => scene_pools::merge(&options, jobs),
        Command::Split(options) => scene_pools::split(&options, jobs),
        Command::Show(options) => scene_show::run(&options, jobs),
        Command::Best(options) => scene_best::run(&options, jobs),
        Command::Draw(options) => scene_draw::run(&options, jobs),
        Command::Export(options) => scene_export::run(&options, jobs),
        Command::Stats(options) => stats(&options, jobs),
    }
}

/// A pool, or what can be imported from files and folders.
pub fn read(paths: &[PathBuf], jobs: usize) -> Result<Pool, Failure> {
    Ok(experiment::read_scenes(paths, &threads(jobs)?)?)
}

pub fn threads(jobs: usize) -> Result<Threads, Failure> {
    Threads::new(jobs).map_err(Failure::internal)
}

fn import(options: &ImportOptions, jobs: usize) -> Result<Answer, Failure> {
    let paths: Vec<PathBuf> = options.paths.iter().chain(&options.towns).cloned().collect();
    let threads = threads(jobs)?;
    written(&experiment::read_scenes(&paths, &threads)?, &options.out, &threads)
}

fn generate(options: &GenerateOptions, jobs: usize) -> Result<Answer, Failure> {
    let experiment = Experiment::read(&options.experiment)?;
    let threads = threads(jobs)?;
    written(&experiment.scenes(&options.scenes, &threads)?, &options.out, &threads)
}

/// Scenes of a pool just written that are told one by one.
const SHOWN_MAX: usize = 20;

/// Writes a pool and says what is in it.
pub fn written(pool: &Pool, out: &Path, threads: &Threads) -> Result<Answer, Failure> {
    store::write_atomic(out, &pool::encode(pool))?;
    let rows = rows(pool, threads);
    let mut text = listing(&rows[..rows.len().min(SHOWN_MAX)]);
    if let Some(more) = rows.len().checked_sub(SHOWN_MAX).filter(|more| *more > 0) {
        let _ = writeln!(text, "and {more} more: evodrive scenes list {}", out.display());
    }
    for line in left_out::lines(pool) {
        let _ = writeln!(text, "{line}");
    }
    let _ = writeln!(text, "{} scenes in {}", pool.scenes.len(), out.display());
    let object = json!({
        "pool": out, "digest": pool.digest(), "scenes": rows, "left_out": pool.left_out,
    });
    Ok(Answer::new(text, object))
}

/// Refuses a tag that no scene can have.
pub fn known_tags(tags: &[String]) -> Result<(), Failure> {
    let known: Vec<&str> = TAGS.into_iter().chain(TrafficFamily::ALL.map(TrafficFamily::name)).collect();
    let Some(tag) = tags.iter().find(|tag| !known.contains(&tag.as_str())) else { return Ok(()) };
    let near = nearest(tag, known.iter().copied()).map_or(String::new(), |near| format!("; did you mean {near}?"));
    let known = known.join(", ");
    Err(Failure::bad_input(format!("--tag {tag}: no scene can have this tag, expected one of {known}{near}")))
}

fn list(options: &ListOptions, jobs: usize) -> Result<Answer, Failure> {
    known_tags(&options.tag)?;
    let pool = read(&options.paths, jobs)?;
    let rows = rows(&pool, &threads(jobs)?);
    let kept: Vec<Row> = rows.into_iter().filter(|row| keeps(row, &options.tag, options.usable)).collect();
    Ok(Answer::new(listing(&kept), json!({"digest": pool.digest(), "scenes": kept, "left_out": pool.left_out})))
}

/// A scene in figures.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Row {
    pub id: String,
    pub format: String,
    /// Where it was read from; of a generated scene, its kind.
    pub file: String,
    pub duration_s: f64,
    pub tracks: usize,
    pub lanes: usize,
    pub tags: Vec<&'static str>,
    /// Why evolution cannot use it.
    pub unusable: Option<String>,
}

fn rows(pool: &Pool, threads: &Threads) -> Vec<Row> {
    threads.map(&pool.scenes, |_, scene| row(scene))
}

pub fn row(scene: &Scene) -> Row {
    Row {
        id: scene.id.clone(),
        format: scene.origin.format.clone(),
        file: scene.origin.name.clone(),
        duration_s: crate::scene::DT_S * scene.steps.saturating_sub(1) as f64,
        tracks: scene.tracks.len(),
        lanes: scene.road.lanes.len(),
        tags: SceneFeatures::of(scene, &LaneGraph::of(&scene.road)).tags,
        unusable: usable(scene).err().map(|reason| reason.to_string()),
    }
}

fn keeps(row: &Row, tags: &[String], only_usable: bool) -> bool {
    tags.iter().all(|tag| row.tags.contains(&tag.as_str())) && !(only_usable && row.unusable.is_some())
}

/// The scene of that id.
pub fn named<'p>(pool: &'p Pool, path: &Path, id: &str) -> Result<&'p Scene, Failure> {
    pool.scene(id).ok_or_else(|| {
        let near = nearest(id, pool.scenes.iter().map(|scene| scene.id.as_str()));
        let near = near.map_or(String::new(), |near| format!("; did you mean {near}?"));
        let all = unnamed(pool, path);
        Failure { message: format!("there is no scene {id:?}{near}\n  {}", all.message), ..all }
    })
}

/// Says which scenes there are to name.
pub fn unnamed(pool: &Pool, path: &Path) -> Failure {
    let known: Vec<&str> = pool.scenes.iter().map(|s| s.id.as_str()).take(20).collect();
    Failure::bad_input(format!(
        "name one of the {} scenes of {}: {}{}",
        pool.scenes.len(),
        path.display(),
        known.join(", "),
        if pool.scenes.len() > 20 { ", ..." } else { "" }
    ))
}

fn listing(rows: &[Row]) -> String {
    let wide = |text: fn(&Row) -> &String, least: usize| {
        rows.iter().map(|row| text(row).chars().count()).max().unwrap_or(0).clamp(least, 48)
    };
    let (id, format, file) = (wide(|row| &row.id, 5), wide(|row| &row.format, 6), wide(|row| &row.file, 4));
    let mut out = format!(
        "{:<id$} {:<format$} {:<file$} {:>7} {:>7} {:>6}  tags\n",
        "scene", "format", "file", "seconds", "tracks", "lanes"
    );
    for row in rows {
        let note = row.unusable.as_ref().map_or(String::new(), |reason| format!("  [not used: {reason}]"));
        let _ = writeln!(
            out,
            "{:<id$} {:<format$} {:<file$} {:>7.1} {:>7} {:>6}  {}{note}",
            row.id,
            row.format,
            row.file,
            row.duration_s,
            row.tracks,
            row.lanes,
            row.tags.join(" ")
        );
    }
    out
}

fn stats(options: &StatsOptions, jobs: usize) -> Result<Answer, Failure> {
    let mut columns = Vec::new();
    for path in &options.paths {
        let pool = read(std::slice::from_ref(path), jobs)?;
        columns.push((path.display().to_string(), PoolStats::of(&pool.scenes)));
    }
    let mut text = String::new();
    for (k, (name, stats)) in columns.iter().enumerate() {
        let _ = writeln!(text, "[{}] {name}: {} scenes", k + 1, stats.scenes);
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
