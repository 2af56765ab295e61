//! Scenes as files hold them, for every command that takes some: read, named, listed, written.

use serde_json::json;
use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use crate::cli::scenes::{contradictions, left_out, recorded_crash};
use crate::cli::studies::suite_file;
use crate::cli::terminal::output::Output;
use crate::cli::terminal::{answer::Answer, exit::Failure, width::stdout_width};
use crate::evidence::aligned::Aligned;
use crate::experiment;
use crate::kernel::Threads;
use crate::scene::features::TAGS;
use crate::scene::safebench::TrafficFamily;
use crate::scene::{LaneGraph, Pool, Scene, SceneFeatures, pool, usable};
use crate::text::{counted, nearest};

/// A pool, the scenes of a suite, or what can be imported from files and folders.
pub fn read(paths: &[PathBuf], jobs: usize) -> Result<Pool, Failure> {
    let (suites, others): (Vec<&PathBuf>, Vec<&PathBuf>) = paths.iter().partition(|path| suite_file::is_suite(path));
    if suites.is_empty() {
        return Ok(experiment::read_scenes(paths, &threads(jobs)?)?);
    }
    let mut pools = Vec::new();
    for path in suites {
        pools.push((path.display().to_string(), suite_file::read(path)?.suite.pool));
    }
    if !others.is_empty() {
        let others: Vec<PathBuf> = others.into_iter().cloned().collect();
        pools.push(("the other scenes".into(), experiment::read_scenes(&others, &threads(jobs)?)?));
    }
    Ok(Pool::merged(pools).map_err(Failure::bad_input)?.0)
}

pub fn threads(jobs: usize) -> Result<Threads, Failure> {
    Ok(Threads::new(jobs)?)
}

/// Scenes of a pool just written that are listed one by one.
const SHOWN_MAX: usize = 20;

/// Writes a pool and says what is in it.
pub fn written(pool: &Pool, out: &Path, output: Output, threads: &Threads) -> Result<Answer, Failure> {
    output.write(out, &pool::encode(pool))?;
    let rows = rows(pool, threads);
    let mut text = listing(&rows[..rows.len().min(SHOWN_MAX)]);
    if let Some(more) = rows.len().checked_sub(SHOWN_MAX).filter(|more| *more > 0) {
        let _ = writeln!(text, "and {more} more: evodrive scenes list {}", out.display());
    }
    for line in left_out::lines(pool) {
        let _ = writeln!(text, "{line}");
    }
    let checks = contradictions::of_pool(&pool.scenes, threads);
    for line in contradictions::lines(&checks) {
        let _ = writeln!(text, "{line}");
    }
    let crashes = recorded_crash::of_pool(&pool.scenes, threads);
    for line in recorded_crash::lines(&crashes, pool.scenes.len(), &[out.to_path_buf()]) {
        let _ = writeln!(text, "{line}");
    }
    let _ = writeln!(text, "{} in {}", counted(pool.scenes.len(), "scene"), out.display());
    let object = json!({
        "pool": out, "digest": pool.digest(), "scenes": rows, "left_out": pool.left_out, "recorded_crashes": crashes,
        "consistency": checks,
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

/// A scene in figures.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Row {
    pub id: String,
    pub format: String,
    /// File that it was read from; for a generated scene, its kind.
    pub file: String,
    pub duration_s: f64,
    pub tracks: usize,
    pub lanes: usize,
    pub tags: Vec<&'static str>,
    /// Why evolution cannot use it.
    pub unusable: Option<String>,
}

pub fn rows(pool: &Pool, threads: &Threads) -> Vec<Row> {
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

pub fn keeps(row: &Row, tags: &[String], only_usable: bool) -> bool {
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

/// The scenes of these ids, in their order, or all of the files.
pub fn chosen(paths: &[PathBuf], ids: &[String], jobs: usize) -> Result<Pool, Failure> {
    let pool = read(paths, jobs)?;
    if ids.is_empty() {
        return Ok(pool);
    }
    let place = paths.first().map_or(Path::new(""), PathBuf::as_path);
    let ids: BTreeSet<&String> = ids.iter().collect();
    let scenes = ids.into_iter().map(|id| named(&pool, place, id).cloned()).collect::<Result<_, _>>()?;
    Pool::new(scenes, Vec::new()).map_err(Failure::bad_input)
}

/// Says which scenes there are to name.
pub fn unnamed(pool: &Pool, path: &Path) -> Failure {
    let known: Vec<&str> = pool.scenes.iter().map(|s| s.id.as_str()).take(20).collect();
    Failure::bad_input(format!(
        "name one of the {} of {}: {}{}",
        counted(pool.scenes.len(), "scene"),
        path.display(),
        known.join(", "),
        if pool.scenes.len() > 20 { ", ..." } else { "" }
    ))
}

/// The scenes, one a line; on a terminal within its width.
pub fn listing(rows: &[Row]) -> String {
    stdout_width().map_or_else(|| one_line_each(rows), |width| within(rows, width))
}

fn noted(row: &Row) -> String {
    let note = row.unusable.as_ref().map_or(String::new(), |reason| format!("  [not used: {reason}]"));
    format!("{}{note}", row.tags.join(" "))
}

fn within(rows: &[Row], width: usize) -> String {
    let line = |row: &Row| {
        vec![
            row.id.clone(),
            format!("{:.1}", row.duration_s),
            row.tracks.to_string(),
            row.lanes.to_string(),
            row.format.clone(),
            row.file.clone(),
            noted(row),
        ]
    };
    let heads = ["scene", "seconds", "tracks", "lanes", "format", "file", "tags"].map(String::from).to_vec();
    Aligned { indent: 0, labels: 1, words: 3, heads, rows: rows.iter().map(line).collect() }.text(width)
}

fn one_line_each(rows: &[Row]) -> String {
    let wide = |text: fn(&Row) -> &String, least: usize| {
        rows.iter().map(|row| text(row).chars().count()).max().unwrap_or(0).clamp(least, 48)
    };
    let (id, format, file) = (wide(|row| &row.id, 5), wide(|row| &row.format, 6), wide(|row| &row.file, 4));
    let mut out = format!(
        "{:<id$} {:<format$} {:<file$} {:>7} {:>7} {:>6}  tags\n",
        "scene", "format", "file", "seconds", "tracks", "lanes"
    );
    for row in rows {
        let _ = writeln!(
            out,
            "{:<id$} {:<format$} {:<file$} {:>7.1} {:>7} {:>6}  {}",
            row.id,
            row.format,
            row.file,
            row.duration_s,
            row.tracks,
            row.lanes,
            noted(row)
        );
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scenes_are_listed_within_the_width_of_a_terminal() {
        let row = |id: &str, unusable: Option<&str>| Row {
            id: id.into(),
            format: "scenarionet".into(),
            file: "sd_nuscenes_v1.0-mini_scene-0061_with_a_long_name.pkl".into(),
            duration_s: 9.1,
            tracks: 123,
            lanes: 40,
            tags: vec!["junction", "crossing", "pedestrian", "cyclist"],
            unusable: unusable.map(String::from),
        };
        let rows = [row("scene-0061/cut-3", None), row("scene-0103", Some("the ego stands still all the time"))];
        for width in [80, 100] {
            let text = within(&rows, width);
            assert!(text.lines().all(|line| line.chars().count() <= width), "{width}:\n{text}");
            let letters = |text: &str| text.chars().filter(|c| !c.is_whitespace()).collect::<String>();
            assert!(rows.iter().all(|row| letters(&text).contains(&letters(&row.id))), "{text}");
            assert!(letters(&text).matches("pedestrian").count() == 2, "{text}");
        }
    }
}
