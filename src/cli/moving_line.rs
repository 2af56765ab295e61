//! Progress of a run on stderr: on a terminal one moving line with the share done, the rate and the time left, and a line
//! that stays for each epoch; in a file or pipe a line for each piece of news.

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::IsTerminal;

use super::answer::progress;
use super::result_text;
use crate::epoch::{Progress, Study};

/// Proposals are the unit: how many there will be is known from the start.
const LOOK: &str = "{bar:24} {percent:>3} %  {pos}/{len} proposals  {per_sec}  {eta} left  {wide_msg}";

/// Tells what happens in a run.
pub struct MovingLine {
    /// `None` where stderr is no terminal.
    bar: Option<ProgressBar>,
}

impl MovingLine {
    pub fn new(study: &Study) -> MovingLine {
        if !std::io::stderr().is_terminal() {
            return MovingLine { bar: None };
        }
        let lineages = study.lineages.len() as u64;
        let proposals = u64::from(study.budget.epochs) * u64::from(study.budget.slots) * lineages;
        MovingLine { bar: Some(bar(proposals, ProgressDrawTarget::stderr())) }
    }

    /// One piece of news; `rollouts` were read from the store and simulated so far.
    pub fn tell(&self, news: &Progress, (reused, simulated): (usize, usize)) {
        let text = result_text::progress(news);
        let Some(bar) = &self.bar else { return progress(text) };
        match news {
            Progress::Attempt { .. } => {
                bar.inc(1);
                bar.set_message(format!("{} rollouts  {}", reused + simulated, text.trim()));
            }
            _ => bar.suspend(|| progress(text)),
        }
    }

    /// Takes the line away, so that what follows stands alone.
    pub fn finish(&self) {
        self.bar.iter().for_each(ProgressBar::finish_and_clear);
    }
}

/// A failed run takes its line away too.
impl Drop for MovingLine {
    fn drop(&mut self) {
        self.finish();
    }
}

fn bar(proposals: u64, target: ProgressDrawTarget) -> ProgressBar {
    let bar = ProgressBar::with_draw_target(Some(proposals), target);
    let style = ProgressStyle::with_template(LOOK).unwrap_or_else(|_| ProgressStyle::default_bar());
    bar.set_style(style);
    bar.tick();
    bar
}
