//! Text of `train` and `egos`: progress, figures, cards.

use serde_json::{Value, json};
use std::path::Path;
use std::time::{Duration, Instant};

use crate::experiment::TrainingFile;
use crate::kernel::Digest;
use crate::learn::{News, Training, Trial};

/// Lines of progress come this far apart.
const EVERY: Duration = Duration::from_secs(10);
/// The weight of the newest round in the figures of progress.
const SHARE: f64 = 0.05;

/// Figures of an evaluation in words.
pub fn figures(trial: &Trial) -> String {
    format!(
        "route completion {:.1} %, crash rate {:.1} %, off road {:.1} %, arrived {:.1} % of {} scenes",
        100.0 * trial.route_completion,
        100.0 * trial.crash_rate,
        100.0 * trial.off_road_rate,
        100.0 * trial.arrival_rate,
        trial.scenes
    )
}

/// Progress by the clock; no result depends on it.
pub struct Pace {
    begun: Instant,
    printed_at: Instant,
    updates_before: u64,
    steps_before: u64,
    /// Return, crash rate and route completion, averaged over the last rounds.
    recent: Option<[f64; 3]>,
}

impl Pace {
    #[allow(clippy::disallowed_methods)]
    pub fn new(state: &Training) -> Pace {
        let now = Instant::now();
        Pace { begun: now, printed_at: now, updates_before: state.updates, steps_before: state.steps, recent: None }
    }

    /// A line, if one is due.
    #[allow(clippy::disallowed_methods)]
    pub fn line(&mut self, state: &Training, news: &News) -> Option<String> {
        let newest = [news.mean_return, news.crash_rate, news.route_completion];
        let recent = self.recent.get_or_insert(newest);
        recent.iter_mut().zip(newest).for_each(|(mean, x)| *mean += SHARE * (x - *mean));
        let now = Instant::now();
        if now - self.printed_at < EVERY && !state.is_over() {
            return None;
        }
        self.printed_at = now;
        let seconds = (now - self.begun).as_secs_f64().max(1e-9);
        let updates_per_s = (state.updates - self.updates_before) as f64 / seconds;
        let left_s = (state.options.updates - state.updates) as f64 / updates_per_s.max(1e-9);
        let [mean_return, crash_rate, completion] = *recent;
        Some(format!(
            "{}/{} updates, {} steps: return {mean_return:.1}, crash rate {:.0} %, route completion {:.0} %, temperature \
             {:.3}; {updates_per_s:.0} updates/s, {:.0} steps/s, {:.0} min left",
            state.updates,
            state.options.updates,
            state.steps,
            100.0 * crash_rate,
            100.0 * completion,
            news.losses.temperature,
            (state.steps - self.steps_before) as f64 / seconds,
            (left_s / 60.0).min(1e6),
        ))
    }
}

/// A training that is over.
pub struct Trained<'a> {
    pub file: &'a TrainingFile,
    pub recipe: Digest,
    /// Digests of the scenes to learn on and to compare by.
    pub pools: [Digest; 2],
    pub state: &'a Training,
    /// The kept actor and IDM on the validation scenes.
    pub kept: Trial,
    pub idm: Trial,
}

impl Trained<'_> {
    /// The card that lies beside the weights.
    pub fn card(&self, weights: &[u8]) -> Value {
        let [training, validation] = self.pools;
        let kept = self.state.best.as_ref().and_then(|(place, _)| self.state.curve.get(*place));
        json!({
            "name": self.file.name,
            "describes": self.file.describes,
            "digest": Digest::of_bytes(weights),
            "observation": self.file.training.setting,
            "recipe": {
                "digest": self.recipe,
                "training": self.file.training,
                "simulator": self.file.simulator,
                "scenes": {"training": training, "validation": validation},
            },
            "kept_after_updates": kept.map(|point| point.updates),
            "validation": {"this": self.kept, "idm": self.idm},
            "curve": self.state.curve,
            "known_faults": self.file.known_faults,
        })
    }

    pub fn text(&self, path: &Path, digest: Digest) -> String {
        format!(
            "{}\n  this: {}\n  IDM:  {}\ndigest: {digest}\n",
            path.display(),
            figures(&self.kept),
            figures(&self.idm)
        )
    }
}
