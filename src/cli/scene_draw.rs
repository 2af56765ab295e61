//! `scenes draw`: a scene or a rollout as a strip of moments side by side, for a paper.

use clap::Args;
use serde_json::json;
use std::path::PathBuf;

use super::answer::Answer;
use super::exit::Failure;
use super::rollout::OfAttempt;
use super::scene_show;
use crate::draw::{Drawing, Frame, StripOptions, Theme, even_steps, strip};
use crate::store;

/// Most panels of a strip.
const FRAMES_MAX: usize = 24;

#[derive(Debug, Args)]
pub struct Options {
    /// A pool or scenario file; none with --attempt, whose run has its own scenes.
    #[arg(required_unless_present = "attempt", conflicts_with = "attempt")]
    pub path: Option<PathBuf>,
    /// Scene id; not needed where there is only one.
    #[arg(long)]
    pub scene: Option<String>,
    #[command(flatten)]
    pub of: OfAttempt,
    /// SVG file to write.
    #[arg(long)]
    pub out: PathBuf,
    /// Panels, evenly from the scene's current step to the contact or the end.
    #[arg(long, default_value_t = 4)]
    pub frames: usize,
    /// Seconds of the scene, one a panel, instead of even ones, e.g. --at 2.0,3.5,4.1.
    #[arg(long, value_delimiter = ',', conflicts_with = "frames", allow_negative_numbers = true)]
    pub at: Vec<f64>,
    /// Metres around the ways of ego and adversaries that the panels show.
    #[arg(long, default_value_t = 12.0, allow_negative_numbers = true)]
    pub around: f64,
    /// Width of a panel, pixels.
    #[arg(long, default_value_t = 360.0, allow_negative_numbers = true)]
    pub panel: f64,
    /// Dark colours.
    #[arg(long)]
    pub dark: bool,
}

pub fn run(options: &Options, jobs: usize) -> Result<Answer, Failure> {
    check(options)?;
    let (drawing, title) = scene_show::drawn(options.path.as_ref(), options.scene.as_ref(), &options.of, jobs)?;
    let strip_of = StripOptions {
        panel_px: options.panel,
        theme: if options.dark { Theme::Dark } else { Theme::Light },
        frame: Frame::Around(options.around),
        steps: steps(options, &drawing)?,
        title: title.clone(),
    };
    store::write_atomic(&options.out, strip(&drawing, &strip_of).as_bytes())?;
    let seconds: Vec<f64> = strip_of.steps.iter().map(|step| *step as f64 * drawing.dt_s).collect();
    let said: Vec<String> = seconds.iter().map(|s| format!("{s:.1}")).collect();
    let text =
        format!("{title}\n{} panels at {} s of the scene: {}", said.len(), said.join(", "), options.out.display());
    Ok(Answer::new(text, json!({"out": options.out, "title": title, "seconds": seconds})))
}

/// What can be refused is refused before anything is simulated.
fn check(options: &Options) -> Result<(), Failure> {
    let refuse = |what: String| Err(Failure::bad_input(what));
    if !(1..=FRAMES_MAX).contains(&options.frames) || options.at.len() > FRAMES_MAX {
        return refuse(format!("--frames or --at: expected 1 to {FRAMES_MAX} panels"));
    }
    if !(0.0..=1000.0).contains(&options.around) {
        return refuse(format!("--around {}: expected 0 to 1000 metres", options.around));
    }
    if !(200.0..=2000.0).contains(&options.panel) {
        return refuse(format!("--panel {}: expected 200 to 2000 pixels", options.panel));
    }
    Ok(())
}

fn steps(options: &Options, drawing: &Drawing) -> Result<Vec<usize>, Failure> {
    let last = drawing.steps.saturating_sub(1);
    if options.at.is_empty() {
        let end = drawing.contact.as_ref().map_or(last, |contact| contact.step.min(last));
        return Ok(even_steps(drawing.current_step.min(end), end, options.frames));
    }
    let end_s = last as f64 * drawing.dt_s;
    let step = |seconds: &f64| match (0.0..=end_s + 1e-9).contains(seconds) {
        true => Ok(((seconds / drawing.dt_s).round() as usize).min(last)),
        false => Err(Failure::bad_input(format!("--at {seconds}: expected seconds of the scene, 0 to {end_s:.1}"))),
    };
    options.at.iter().map(step).collect()
}
