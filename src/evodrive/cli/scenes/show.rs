//! `scenes show`: one scene, or one rollout, in words, as a picture, as a page that plays it.

use clap::Args;
use serde_json::json;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use crate::cli::look::rollout::{self, OfAttempt, Played};
use crate::cli::look::{driven, playables};
use crate::cli::scenes::files::{self, row};
use crate::cli::studies::{suite_file, suite_scenes};
use crate::cli::terminal::output::{Output, by_ending};
use crate::cli::terminal::{answer::Answer, exit::Failure};
use crate::draw::{Drawing, Frame, SvgOptions, Theme, player_html, svg};
use crate::evidence::nearest::{Nearest, nearest};
use crate::scene::{Scene, Track};
use crate::text::counted;

#[derive(Debug, Args)]
pub struct Options {
    /// A pool or scenario file; with --attempt its run, which has its own scenes.
    #[arg(id = "run", value_name = "POOL|RUN", required_unless_present = "attempt")]
    pub path: Option<PathBuf>,
    /// Scene id; not needed where there is only one.
    pub scene: Option<String>,
    /// Scene id, as an option.
    #[arg(long = "scene", value_name = "SCENE", conflicts_with = "scene")]
    pub of_scene: Option<String>,
    #[command(flatten)]
    pub of: OfAttempt,
    /// Take the scene as it was driven in an environment: the file of an episode (bridges/python), beside its pool.
    #[arg(long, conflicts_with = "attempt", requires = "run")]
    pub episode: Option<PathBuf>,
    /// Draw it into this SVG file.
    #[arg(long)]
    pub svg: Option<PathBuf>,
    /// Write a page that plays it.
    #[arg(long)]
    pub html: Option<PathBuf>,
    #[command(flatten)]
    pub output: Output,
}

pub fn run(options: &Options, jobs: usize) -> Result<Answer, Failure> {
    for (option, path, ending) in [("--svg", &options.svg, "svg"), ("--html", &options.html, "html")] {
        path.iter().try_for_each(|path| by_ending(option, path, [(ending, ())]))?;
    }
    let id = options.scene.as_ref().or(options.of_scene.as_ref());
    match meant(options.path.as_ref(), id, &options.of, options.episode.as_deref(), jobs)? {
        Meant::Played(rollout) => played(options, &rollout),
        Meant::Recorded(scene) => recorded(options, &scene),
    }
}

/// The one scene that is meant, as it is or as a program played it.
enum Meant {
    Recorded(Box<Scene>),
    Played(Box<Played>),
}

fn meant(
    path: Option<&PathBuf>,
    id: Option<&String>,
    of: &OfAttempt,
    episode: Option<&Path>,
    jobs: usize,
) -> Result<Meant, Failure> {
    if let (Some(episode), Some(pool)) = (episode, path) {
        return Ok(Meant::Played(Box::new(driven::played(episode, pool, jobs)?)));
    }
    match (&of.attempt, path) {
        (Some(attempt), _) => {
            let named: Vec<String> = id.cloned().into_iter().collect();
            let mut rollouts = rollout::of_attempt(&of.run(path)?, attempt, &named, jobs)?;
            match (rollouts.pop(), rollouts.is_empty()) {
                (Some(one), true) => Ok(Meant::Played(Box::new(one))),
                (last, _) => {
                    let ids: Vec<&str> = rollouts.iter().chain(&last).map(|played| played.scene.id.as_str()).collect();
                    let message = format!("name one of the {} scenes with --scene: {}", ids.len(), ids.join(", "));
                    Err(Failure::bad_input(message))
                }
            }
        }
        (None, Some(path))
            if suite_file::is_suite(path) && (of.recorded.is_some() || id.is_none_or(|id| is_case(path, id))) =>
        {
            let named: Vec<String> = id.cloned().into_iter().collect();
            let mut cases = suite_scenes::played(path, &named, of.recorded.as_deref(), jobs)?;
            match (cases.pop(), cases.is_empty()) {
                (Some(one), true) => Ok(Meant::Played(Box::new(one))),
                _ => Err(Failure::bad_input(format!(
                    "name a case with --scene, as `evodrive suite show {}` lists them",
                    path.display()
                ))),
            }
        }
        (None, Some(path)) => {
            of.without_result(path)?;
            let pool = files::read(std::slice::from_ref(path), jobs)?;
            let scene = match (id, pool.scenes.as_slice()) {
                (Some(id), _) => files::named(&pool, path, id)?,
                (None, [scene]) => scene,
                (None, _) => return Err(files::unnamed(&pool, path)),
            };
            Ok(Meant::Recorded(Box::new(scene.clone())))
        }
        (None, None) => Err(Failure::bad_input("name a pool, a scenario file or an attempt")),
    }
}

/// Returns `true` if a word names a case of a suite; otherwise it names a scene of it.
fn is_case(path: &Path, word: &str) -> bool {
    suite_file::read(path).is_ok_and(|frozen| frozen.suite.pool.scene(word).is_none())
}

/// Returns the drawing of the one scene that is meant, with a line that says what it is.
pub fn drawn(
    path: Option<&PathBuf>,
    id: Option<&String>,
    of: &OfAttempt,
    episode: Option<&Path>,
    jobs: usize,
) -> Result<(Drawing, String), Failure> {
    Ok(match meant(path, id, of, episode, jobs)? {
        Meant::Recorded(scene) => (Drawing::of_scene(&scene), scene.id.clone()),
        Meant::Played(played) if of.ego_log => {
            let scene =
                played.with_ego_log()?.applied_to(&played.scene, &mut Vec::new()).map_err(Failure::bad_input)?;
            (Drawing::of_scene(&scene), scene.id)
        }
        Meant::Played(played) => (played.drawing(), title(&played)),
    })
}

fn title(played: &Played) -> String {
    format!("{} in {}: {}", played.solution, played.scene.id, played.caption())
}

fn recorded(options: &Options, scene: &Scene) -> Result<Answer, Failure> {
    draw(options, &Drawing::of_scene(scene), &scene.id)?;
    Ok(Answer::new(in_words(scene), json!({"row": row(scene), "scene": scene})))
}

fn played(options: &Options, played: &Played) -> Result<Answer, Failure> {
    if options.of.ego_log {
        let scene = played.with_ego_log()?.applied_to(&played.scene, &mut Vec::new()).map_err(Failure::bad_input)?;
        return recorded(options, &scene);
    }
    let title = title(played);
    draw(options, &played.drawing(), &title)?;
    let ego = &played.scene.ego.track;
    let nearest = nearest(&played.motion, [ego.length_m, ego.width_m]);
    let near: String = nearest.iter().map(|near| near_in_words(&played.scene, near)).collect();
    let text = format!("{title}\n{near}{}", in_words(&played.scene));
    let object = json!({
        "row": row(&played.scene),
        "attempt": played.solution,
        "decision": played.decision,
        "outcome": played.outcome,
        "nearest": nearest,
        "motion": played.motion,
    });
    Ok(Answer::new(text, object))
}

/// Says how near a road user that the program moves comes to the ego.
fn near_in_words(scene: &Scene, near: &Nearest) -> String {
    let (who, when) = (playables::label(scene, near.actor), format!("{:.1} s after the start", near.time_s));
    match near.on_ego_m {
        None => format!("{who} overlaps the ego {when}\n"),
        Some([forward, left]) => {
            let along = if forward >= 0.0 { "in front of" } else { "behind" };
            let side = if left >= 0.0 { "left" } else { "right" };
            let (gap, forward, left) = (near.gap_m, forward.abs(), left.abs());
            format!(
                "{who} comes as near as {gap:.2} m to the ego {when}, at a point {forward:.1} m {along} and {left:.1} m {side} of its centre\n"
            )
        }
    }
}

fn draw(options: &Options, drawing: &Drawing, title: &str) -> Result<(), Failure> {
    if let Some(path) = &options.svg {
        options.output.write(path, svg(drawing, &picture(title)).as_bytes())?;
    }
    if let Some(path) = &options.html {
        options.output.write(path, player_html(drawing, title).as_bytes())?;
    }
    Ok(())
}

/// A picture for a page: everything, light, with trails.
fn picture(title: &str) -> SvgOptions {
    SvgOptions {
        width_px: 1200.0,
        theme: Theme::Light,
        frame: Frame::Everything,
        step: None,
        trails: true,
        labels: false,
        title: title.to_string(),
    }
}

fn in_words(scene: &Scene) -> String {
    let row = row(scene);
    let mut text = format!("{}  ({}, {})\n", scene.id, scene.origin.format, scene.origin.name);
    let _ = writeln!(text, "digest {}", scene.digest());
    let _ = writeln!(
        text,
        "{}, current step {}, {}",
        counted(scene.steps, "step"),
        scene.current_step,
        counted(scene.road.lanes.len(), "lane")
    );
    let _ = writeln!(text, "tags: {}", row.tags.join(" "));
    let _ = writeln!(text, "usable for evolution: {}", row.unusable.as_deref().unwrap_or("yes"));
    for violation in scene.validate() {
        let _ = writeln!(text, "violation: {violation}");
    }
    let _ = writeln!(text, "{}  ego", track_in_words(&scene.ego.track));
    for (ix, track) in scene.tracks.iter().enumerate() {
        let marked = if scene.objects_of_interest.contains(&ix) { "  object of interest" } else { "" };
        let _ = writeln!(text, "{}{marked}", track_in_words(track));
    }
    text
}

/// Returns a track's id, its kind, its size, and when it is seen.
fn track_in_words(track: &Track) -> String {
    let span = track.span().map_or("never seen".to_string(), |(a, b)| format!("steps {a} to {b}"));
    let kind = format!("{:?}", track.kind).to_lowercase();
    format!("  {:<14} {kind:<10} {:>5.2} x {:.2} m  {span}", track.id, track.length_m, track.width_m)
}
