//! Progress of many pieces of one kind on stderr: how many are done, how fast, and how long it will take. A moving line on a terminal;
//! in a file or pipe a line every few seconds, so that short work is silent.

use indicatif::{ProgressBar, ProgressStyle};
use std::io::IsTerminal;
use std::sync::Mutex;
use std::sync::PoisonError;
use std::time::{Duration, Instant};

use crate::cli::terminal::answer::progress;
use crate::cli::terminal::interrupt::now;
use crate::text::counted;

/// How often a pipe gets a line.
const EVERY: Duration = Duration::from_secs(10);
const LOOK: &str = "{bar:10} {wide_msg}";

/// Counts pieces.
pub struct CountingLine {
    noun: &'static str,
    all: usize,
    bar: Option<ProgressBar>,
    begun: Instant,
    /// Done so far, and when a line was printed last.
    state: Mutex<(usize, Instant)>,
}

impl CountingLine {
    pub fn new(noun: &'static str, all: usize) -> CountingLine {
        let bar = std::io::stderr().is_terminal().then(|| {
            let bar = ProgressBar::new(all as u64);
            bar.set_style(ProgressStyle::with_template(LOOK).unwrap_or_else(|_| ProgressStyle::default_bar()));
            bar
        });
        CountingLine { noun, all, bar, begun: now(), state: Mutex::new((0, now())) }
    }

    /// One more is done.
    pub fn tick(&self) {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        state.0 += 1;
        let words = words(self.noun, state.0, self.all, self.begun.elapsed().as_secs_f64());
        match &self.bar {
            Some(bar) => {
                bar.set_position(state.0 as u64);
                bar.set_message(words);
            }
            None if state.1.elapsed() >= EVERY && state.0 < self.all => {
                state.1 = now();
                progress(words);
            }
            None => {}
        }
    }

    /// Takes the line away, so that what follows stands alone.
    pub fn finish(&self) {
        self.bar.iter().for_each(ProgressBar::finish_and_clear);
    }
}

impl Drop for CountingLine {
    fn drop(&mut self) {
        self.finish();
    }
}

fn words(noun: &str, done: usize, all: usize, seconds: f64) -> String {
    let rate = done as f64 / seconds.max(1e-3);
    let left = all.saturating_sub(done) as f64 / rate.max(1e-9);
    format!("{done} of {}, {rate:.1} a second, {left:.0} s left", counted(all, noun))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_says_how_many_how_fast_and_how_long() {
        assert_eq!(words("scene", 20, 200, 4.0), "20 of 200 scenes, 5.0 a second, 36 s left");
        assert_eq!(words("scene", 1, 1, 0.5), "1 of 1 scene, 2.0 a second, 0 s left");
    }
}
