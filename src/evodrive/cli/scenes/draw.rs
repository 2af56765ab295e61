//! `scenes draw`: a scene or a rollout as a strip of moments side by side, for a paper, or as a film.

use clap::Args;
use serde_json::json;
use std::path::{Path, PathBuf};
use std::time::Duration;

use crate::cli::cluster::worker_process::Processes;
use crate::cli::look::rollout::OfAttempt;
use crate::cli::scenes::{grid, show};
use crate::cli::terminal::output::{Output, by_ending};
use crate::cli::terminal::{answer::Answer, exit::Failure};
use crate::draw::{
    Drawing, Film, FilmOptions, Frame, StripOptions, Theme, even_steps, film, gif, pdf, strip, strip_figure, strips,
};
use crate::kernel::Threads;
use crate::llm::command::{Ended, Run};
use crate::store::{self, Scratch};
use crate::text::counted;

/// Panels of a strip, and the most of them.
const FRAMES: usize = 4;
const FRAMES_MAX: usize = 24;
/// Widths of a panel and of a film, pixels.
const PANEL_PX: f64 = 360.0;
const FILM_PX: f64 = 720.0;
/// Margin around paths, metres.
const AROUND_M: f64 = 12.0;
/// Width of a panel of a PDF, points: four of them fill the text of a page.
const PANEL_PT: f64 = 115.0;
/// Seconds for which a film goes on after the contact, and hundredths of a second for which its last picture stays.
const AFTER_CONTACT_S: f64 = 1.0;
const LAST_CS: u16 = 150;
/// Longest time that ffmpeg may take.
const ENCODING_LIMIT: Duration = Duration::from_secs(300);

#[derive(Debug, Args)]
pub struct Options {
    /// A pool or scenario file; with --attempt its run, which has its own scenes.
    #[arg(id = "run", value_name = "POOL|RUN", required_unless_present = "attempt")]
    pub path: Option<PathBuf>,
    /// Scene id; not needed where there is only one.
    #[arg(long)]
    pub scene: Option<String>,
    #[command(flatten)]
    pub of: OfAttempt,
    /// Take the scene as it was driven in an environment: the file of an episode (bridges/python), beside its pool.
    #[arg(long, conflicts_with = "attempt", requires = "run")]
    pub episode: Option<PathBuf>,
    /// File to write: a strip of moments (.svg, .pdf), or a film (.gif; .mp4 where ffmpeg is installed).
    #[arg(long)]
    pub out: PathBuf,
    #[command(flatten)]
    pub output: Output,
    /// Below the strip of --attempt, the same moments of this one: parent, replay (no program), or an attempt of
    /// the run.
    #[arg(long, value_name = "PROGRAM", requires = "attempt")]
    pub beside: Option<String>,
    /// Draw this many scenes on one sheet (.svg, .pdf), a panel each, ending at the contact, with outlines of where ego and adversaries were before:
    /// the first of a pool, or the rollouts of --attempt, contacts first. With --scene one panel.
    #[arg(long, value_name = "COUNT", conflicts_with_all = ["beside", "frames", "at", "episode", "recorded"])]
    pub grid: Option<usize>,
    /// Number of panels of a strip, evenly spaced from the scene's current step to the contact or the end; without it
    /// 4.
    #[arg(long)]
    pub frames: Option<usize>,
    /// Times of the panels in seconds from the first simulated step, instead of evenly spaced ones, e.g. --at 1.0,2.5,3.1.
    #[arg(long, value_delimiter = ',', conflicts_with = "frames", allow_negative_numbers = true)]
    pub at: Vec<f64>,
    /// Margin around the paths of ego and adversaries in the panels, metres.
    #[arg(long, default_value_t = AROUND_M, allow_negative_numbers = true)]
    pub around: f64,
    /// Limit a film to this many seconds before the contact or the end, and to the part of the world that they need.
    #[arg(long, value_name = "SECONDS", conflicts_with = "grid", allow_negative_numbers = true)]
    pub last: Option<f64>,
    /// Width of a panel, pixels; without it 360, and 720 for a film. In a .pdf points; without it 115.
    #[arg(long, allow_negative_numbers = true)]
    pub panel: Option<f64>,
    /// Dark colours.
    #[arg(long)]
    pub dark: bool,
}

/// Content of a file, as the ending of its name says.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    Strip,
    /// A strip as PDF.
    Page,
    Gif,
    Mp4,
}

pub fn run(options: &Options, jobs: usize) -> Result<Answer, Failure> {
    let kind = check(options)?;
    if let Some(count) = options.grid {
        let wanted = grid::Wanted {
            path: options.path.as_ref(),
            of: &options.of,
            scene: options.scene.as_ref(),
            count,
            around_m: options.around,
            panel_pt: options.panel,
            out: &options.out,
            output: &options.output,
        };
        return grid::drawn(&wanted, jobs);
    }
    let (drawing, title) =
        show::drawn(options.path.as_ref(), options.scene.as_ref(), &options.of, options.episode.as_deref(), jobs)?;
    match kind {
        Kind::Strip | Kind::Page => {
            let other = beside(options, jobs)?;
            drawn_strip(options, kind, &drawing, other.as_ref(), title)
        }
        kind => {
            let width_px = options.panel.unwrap_or(FILM_PX);
            let look = Look { width_px, theme: theme(options), around_m: options.around, last_s: options.last };
            drawn_film(&options.out, options.output, kind == Kind::Gif, &look, &drawing, title, jobs)
        }
    }
}

/// How a film looks.
struct Look {
    width_px: f64,
    theme: Theme,
    around_m: f64,
    /// Seconds before the contact or the end; from the scene's current step on without.
    last_s: Option<f64>,
}

/// A rollout as a film in its usual look: a GIF, or an MP4 where ffmpeg is installed.
pub fn film_of(
    out: &Path,
    output: Output,
    is_gif: bool,
    drawing: &Drawing,
    title: String,
    jobs: usize,
) -> Result<Answer, Failure> {
    let look = Look { width_px: FILM_PX, theme: Theme::Light, around_m: AROUND_M, last_s: None };
    drawn_film(out, output, is_gif, &look, drawing, title, jobs)
}

/// The drawing of --beside, with the line that stands above it.
fn beside(options: &Options, jobs: usize) -> Result<Option<(String, Drawing)>, Failure> {
    let (Some(name), Some(attempt)) = (&options.beside, &options.of.attempt) else { return Ok(None) };
    let lineage = attempt.rsplit_once('/').map_or(attempt.as_str(), |(lineage, _)| lineage);
    let named = match name.as_str() {
        "parent" | "replay" => format!("{lineage}/{name}"),
        attempt => attempt.to_string(),
    };
    let of =
        OfAttempt { attempt: Some(named), ego_log: options.of.ego_log, run: options.of.run.clone(), recorded: None };
    let (drawing, title) = show::drawn(options.path.as_ref(), options.scene.as_ref(), &of, None, jobs)?;
    Ok(Some((title, drawing)))
}

fn theme(options: &Options) -> Theme {
    if options.dark { Theme::Dark } else { Theme::Light }
}

fn drawn_strip(
    options: &Options,
    kind: Kind,
    drawing: &Drawing,
    other: Option<&(String, Drawing)>,
    title: String,
) -> Result<Answer, Failure> {
    let usual = if kind == Kind::Page { PANEL_PT } else { PANEL_PX };
    let strip_of = StripOptions {
        panel_px: options.panel.unwrap_or(usual),
        theme: theme(options),
        frame: Frame::Around(options.around),
        steps: steps(options, drawing, other.map(|(_, other)| other))?,
        title: if other.is_some() { String::new() } else { title.clone() },
    };
    let bytes = match (kind, other) {
        (Kind::Page, None) => pdf(&strip_figure(&[(String::new(), drawing)], &strip_of)).map_err(Failure::bad_input)?,
        (Kind::Page, Some((line, other))) => {
            let rows = [(title.clone(), drawing), (line.clone(), other)];
            pdf(&strip_figure(&rows, &strip_of)).map_err(Failure::bad_input)?
        }
        (_, None) => strip(drawing, &strip_of).into_bytes(),
        (_, Some((line, other))) => strips(&[(title.clone(), drawing), (line.clone(), other)], &strip_of).into_bytes(),
    };
    options.output.write(&options.out, &bytes)?;
    let seconds: Vec<f64> = strip_of.steps.iter().map(|step| drawing.clock_s(*step)).collect();
    let said: Vec<String> = seconds.iter().map(|s| format!("{s:.1}")).collect();
    let text = format!("{title}\n{} at {} s: {}", counted(said.len(), "panel"), said.join(", "), options.out.display());
    Ok(Answer::new(text, json!({"out": options.out, "title": title, "seconds": seconds})))
}

/// Every step from the scene's current one to a second behind the contact, or to the end.
fn drawn_film(
    out: &Path,
    output: Output,
    is_gif: bool,
    look: &Look,
    drawing: &Drawing,
    title: String,
    jobs: usize,
) -> Result<Answer, Failure> {
    let last = drawing.steps.saturating_sub(1);
    let steps = |seconds: f64| (seconds / drawing.dt_s.max(f64::MIN_POSITIVE)) as usize;
    let met = drawing.contact.as_ref().map(|contact| contact.step);
    let end = met.map_or(last, |met| met.saturating_add(steps(AFTER_CONTACT_S)).min(last));
    let begins = look.last_s.map_or(0, |seconds| met.unwrap_or(end).saturating_sub(steps(seconds)));
    let from = drawing.current_step.max(begins).min(end);
    // The picture's frame follows from where ego and adversaries are seen.
    let cut = look.last_s.map(|_| {
        let mut cut = drawing.clone();
        let samples = cut.actors.iter_mut().flat_map(|actor| actor.samples.iter_mut().enumerate());
        samples.filter(|(step, _)| !(from..=end).contains(step)).for_each(|(_, sample)| *sample = None);
        cut
    });
    let film_of = FilmOptions {
        width_px: look.width_px,
        theme: look.theme,
        frame: Frame::Around(look.around_m),
        steps: (from..=end).collect(),
        title: title.clone(),
    };
    let threads = Threads::new(jobs)?;
    let film = film(cut.as_ref().unwrap_or(drawing), &film_of, &threads).map_err(Failure::bad_input)?;
    if is_gif {
        let delay_cs = (100.0 * drawing.dt_s).round() as u16;
        output.write(out, &gif(&film, delay_cs, LAST_CS).map_err(Failure::bad_input)?)?;
    } else {
        output.may_be_made(out)?;
        write_mp4(&film, drawing.dt_s, out)?;
    }
    let (pictures, seconds) = (film.pictures.len(), [from, end].map(|step| drawing.clock_s(step)));
    let text = format!(
        "{title}\n{pictures} pictures of {} by {} pixels, {:.1} to {:.1} s: {}",
        film.width,
        film.height,
        seconds[0],
        seconds[1],
        out.display()
    );
    Ok(Answer::new(text, json!({"out": out, "title": title, "pictures": pictures, "seconds": seconds})))
}

/// Has ffmpeg encode the pictures. It writes into a folder beside the file, which is moved to its place when it is whole.
fn write_mp4(film: &Film, dt_s: f64, out: &Path) -> Result<(), Failure> {
    let scratch = Scratch::beside(out)?;
    let part = scratch.dir.join("film.mp4");
    let size = format!("{}x{}", film.width, film.height);
    let rate = format!("{}", 1.0 / dt_s);
    let to = part.to_string_lossy().into_owned();
    let words = [
        "ffmpeg",
        "-loglevel",
        "error",
        "-y",
        "-f",
        "rawvideo",
        "-pix_fmt",
        "rgb24",
        "-s",
        &size,
        "-r",
        &rate,
        "-i",
        "-",
        "-an",
        "-c:v",
        "libx264",
        "-pix_fmt",
        "yuv420p",
        "-movflags",
        "+faststart",
        "-f",
        "mp4",
        &to,
    ];
    let ended = Processes::default().run(&words.map(String::from), film.pictures.concat(), ENCODING_LIMIT);
    let failed = match ended {
        Ended::Well(_) => return Ok(store::rename(&part, out)?),
        Ended::Unstarted(reason) => {
            format!("{}: MP4 needs ffmpeg: {reason}; install it (Debian: ffmpeg), or write a .gif", out.display())
        }
        Ended::Unread(reason) => format!("{}: ffmpeg failed: {reason}", out.display()),
        Ended::Badly { stderr, .. } => format!("{}: ffmpeg failed: {}", out.display(), stderr.trim()),
        Ended::Stopped => format!("{}: stopped", out.display()),
        Ended::Late { .. } => format!("{}: ffmpeg did not end within {} s", out.display(), ENCODING_LIMIT.as_secs()),
    };
    Err(Failure::bad_input(failed))
}

/// Refuses, before anything is simulated, all that can be refused.
fn check(options: &Options) -> Result<Kind, Failure> {
    let refuse = |what: String| Err(Failure::bad_input(what));
    let known = [("svg", Kind::Strip), ("pdf", Kind::Page), ("gif", Kind::Gif), ("mp4", Kind::Mp4)];
    let kind = by_ending("--out", &options.out, known)?;
    if kind == Kind::Page && options.dark {
        return refuse("--dark: a strip as PDF is for paper and has light colours alone".into());
    }
    let is_strip = matches!(kind, Kind::Strip | Kind::Page);
    if options.beside.is_some() && !is_strip {
        return refuse("--beside: two strips below each other are drawn as .svg or .pdf".into());
    }
    match options.grid {
        Some(_) if !is_strip => return refuse("--grid: many scenes on one sheet are drawn as .svg or .pdf".into()),
        Some(_) if options.dark => return refuse("--grid: a sheet of many scenes has light colours alone".into()),
        Some(count) if !(1..=grid::PANELS_MAX).contains(&count) => {
            return refuse(format!("--grid {count}: expected 1 to {} panels", grid::PANELS_MAX));
        }
        _ => {}
    }
    if !is_strip && (options.frames.is_some() || !options.at.is_empty()) {
        return refuse("--frames and --at choose the panels of a strip (.svg, .pdf); a film shows every step".into());
    }
    match options.last {
        Some(_) if is_strip => return refuse("--last: a film alone is cut; --at chooses the panels of a strip".into()),
        Some(seconds) if !(0.1..=600.0).contains(&seconds) => {
            return refuse(format!("--last {seconds}: expected 0.1 to 600 seconds"));
        }
        _ => {}
    }
    if !(1..=FRAMES_MAX).contains(&options.frames.unwrap_or(FRAMES)) || options.at.len() > FRAMES_MAX {
        return refuse(format!("--frames or --at: expected 1 to {FRAMES_MAX} panels"));
    }
    if !(0.0..=1000.0).contains(&options.around) {
        return refuse(format!("--around {}: expected 0 to 1000 metres", options.around));
    }
    match options.panel {
        Some(panel) if kind == Kind::Page || options.grid.is_some() => {
            if (40.0..=1000.0).contains(&panel) {
                Ok(kind)
            } else {
                refuse(format!("--panel {panel}: expected 40 to 1000 points"))
            }
        }
        Some(panel) if !(200.0..=2000.0).contains(&panel) => {
            refuse(format!("--panel {panel}: expected 200 to 2000 pixels"))
        }
        _ => Ok(kind),
    }
}

/// Returns the steps to draw: up to the contact of the drawing, or of the other one if it has none.
fn steps(options: &Options, drawing: &Drawing, other: Option<&Drawing>) -> Result<Vec<usize>, Failure> {
    let last = drawing.steps.saturating_sub(1);
    if options.at.is_empty() {
        let contact = drawing.contact.as_ref().or(other.and_then(|other| other.contact.as_ref()));
        let end = contact.map_or(last, |contact| contact.step.min(last));
        return Ok(even_steps(drawing.current_step.min(end), end, options.frames.unwrap_or(FRAMES)));
    }
    let (begin_s, end_s) = (drawing.clock_s(0), drawing.clock_s(last));
    let step = |seconds: &f64| {
        if (begin_s - 1e-9..=end_s + 1e-9).contains(seconds) {
            Ok((((seconds - begin_s) / drawing.dt_s).round() as usize).min(last))
        } else {
            Err(Failure::bad_input(format!(
                "--at {seconds}: expected seconds from the first simulated step, {begin_s:.1} to {end_s:.1}"
            )))
        }
    };
    options.at.iter().map(step).collect()
}
