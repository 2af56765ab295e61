//! One planner process as the driver of a rollout: what it is told and when, and how its answers are read.

use std::time::Duration;

use super::lines::{Answered, Asked, Ending, Labelled, Message, Wish, begun, is_word, observation};
use super::workers::{Broken, Line, start_of};
use crate::kernel::{Seed, Vec2};
use crate::scene::DT_S;
use crate::sim::bicycle::Car;
use crate::sim::{Control, Driver, End, Outcome, Plant, Undriven, View};

/// Number of points of a trajectory that are used: half a second of them.
const POINTS_AHEAD: usize = 5;

/// Time to wait, after the last decision of a rollout, for a line that nobody asked for.
const UNASKED: Duration = Duration::from_millis(20);

/// Why a planner drove no further.
#[derive(Debug)]
pub(super) struct Refusal {
    /// The recorded reason: words of ours alone, the same in every folder and for every user.
    pub reason: String,
    /// Text that the process printed in place of an answer. It is shown, and not recorded.
    pub printed: String,
    /// Kind of failure that the reason belongs to.
    pub of: fn(String) -> Undriven,
}

impl Refusal {
    fn of(reason: impl Into<String>, printed: &[u8]) -> Refusal {
        Refusal { reason: reason.into(), printed: start_of(printed), of: Undriven::Junk }
    }

    fn broken(broken: &Broken, limit: Duration) -> Refusal {
        let of = match broken {
            Broken::Late => Undriven::TooSlow,
            Broken::Ended | Broken::HalfLine(_) => Undriven::Ended,
            Broken::TooLong(_) | Broken::Stopped => Undriven::Junk,
        };
        Refusal { of, ..Refusal::of(why(broken, limit), b"") }
    }
}

/// A process that drives one rollout.
pub(super) struct Planner<'p> {
    line: &'p mut dyn Line,
    limit: Duration,
    seed: Seed,
    asked: Asked,
    /// The failure, and the decision at which it happened.
    broken: Option<Refusal>,
    /// Decision at which it abandoned the scene, and the word for why.
    abandoned: Option<(usize, String)>,
    /// Decisions so far, within the car's limits: acceleration (m/s²) and steering angle (rad).
    controls: Vec<[f64; 2]>,
    /// End and number of decisions of the rollout whose labels it is yet to be told.
    ended: Option<(End, usize)>,
    /// True if nobody waits for it any more, which says nothing about the scene.
    stopped: bool,
}

impl<'p> Planner<'p> {
    pub fn new(line: &'p mut dyn Line, limit: Duration, seed: Seed, asked: Asked) -> Planner<'p> {
        let controls = Vec::new();
        Planner { line, limit, seed, asked, broken: None, abandoned: None, controls, ended: None, stopped: false }
    }

    /// Takes its decisions so far, one for each decision step.
    pub fn controls(&mut self) -> Vec<[f64; 2]> {
        std::mem::take(&mut self.controls)
    }

    /// Returns `true` if it drove no further because nobody waits for it any more.
    pub fn was_stopped(&self) -> bool {
        self.stopped
    }

    /// Returns `true` if it is still to be told the result of its rollout.
    pub fn awaits_labels(&self) -> bool {
        self.ended.is_some()
    }

    /// Tells the result of a rollout that ended to a planner that asked for it.
    pub fn tell_labels(&mut self, outcome: &Outcome) {
        if let Some((end, steps)) = self.ended.take() {
            self.close(steps, &Message::End { end: Ending::Driven(end), steps, labels: Some(Labelled::of(outcome)) });
        }
    }

    /// Says in words at which decision it abandoned the scene and why, if it did. It goes on with the next scene.
    pub fn abandoned(&mut self) -> Option<String> {
        let (steps, word) = self.abandoned.take()?;
        self.close(steps, &Message::End { end: Ending::Abandoned, steps, labels: None });
        Some(format!("decision {steps} ({:.1} s): {word}", steps as f64 * DT_S))
    }

    /// Returns why it drove no further, if it failed.
    pub fn broken(self) -> Option<Refusal> {
        self.broken
    }

    fn say(&mut self, message: &Message<'_>) {
        match serde_json::to_string(message) {
            Ok(line) => self.line.send(line),
            Err(error) => unreachable!("texts, lists and finite numbers under text keys: {error}"),
        }
    }

    /// Sends the last line of a rollout, which needs no answer.
    fn close(&mut self, steps: usize, message: &Message<'_>) {
        self.say(message);
        if let (None, Ok(bytes)) = (&self.broken, self.line.receive(UNASKED)) {
            let reason = format!("behind decision {steps}: {AFTER}");
            self.broken = Some(Refusal::of(reason, &bytes));
        }
    }

    fn ask(&mut self, view: &View<'_>) -> Result<Wish, Refusal> {
        // Taken as the answer, this line would answer an earlier question, and so would every later line.
        match self.line.early() {
            None => {}
            Some(Ok(bytes)) => return Err(Refusal::of(BEFORE, &bytes)),
            Some(Err(broken)) => return Err(Refusal::broken(&broken, self.limit)),
        }
        self.say(&observation(view, &self.asked));
        let received = self.line.receive(self.limit);
        self.stopped = received == Err(Broken::Stopped);
        let bytes = received.map_err(|broken| Refusal::broken(&broken, self.limit))?;
        let form = if self.asked.observe.is_some() { FORM_OBSERVING } else { FORM };
        let wrong = |found: &str| Refusal::of(format!("{form}, found {found}"), &bytes);
        let answered: Answered = serde_json::from_slice(&bytes).map_err(|error| match error.classify() {
            serde_json::error::Category::Data => wrong("other fields"),
            _ => wrong("a line that is no JSON object"),
        })?;
        if answered.step.is_some_and(|step| step != view.decision()) {
            return Err(wrong("an answer to another step"));
        }
        let Answered { acceleration_mps2, steering_rad, trajectory, action, abandon, .. } = answered;
        match (acceleration_mps2.zip(steering_rad), trajectory, action, abandon) {
            (Some((acceleration_mps2, steering_rad)), None, None, None) => {
                Ok(Wish::Drive(Control::Drive { acceleration_mps2, steering_rad }))
            }
            (None, Some(points), None, None) if !points.is_empty() => Ok(Wish::Drive(along(view, &points))),
            (None, None, Some(action), None) => match self.asked.observe {
                Some(setting) => Ok(Wish::Drive(setting.control(view, action))),
                None => Err(wrong("an action, which only driver.observe gives a meaning (docs/EGOS.md)")),
            },
            (None, None, None, Some(word)) => {
                if is_word(&word) {
                    Ok(Wish::Abandon(word))
                } else {
                    Err(Refusal::of(WORD, &bytes))
                }
            }
            _ => Err(wrong("neither of them, or both")),
        }
    }
}

/// Form that an answer must have.
const FORM: &str = "expected {\"acceleration_mps2\": .., \"steering_rad\": ..} or {\"trajectory\": [[x, y], ..]}";
/// Form of an answer where [driver] names an observation.
const FORM_OBSERVING: &str = "expected {\"action\": [steering, pedal]}, {\"acceleration_mps2\": .., \"steering_rad\": ..} or {\"trajectory\": [[x, y], ..]}";
/// Form of an answer that abandons a scene in place of a decision.
const WORD: &str = "expected {\"abandon\": \"word\"} with 1 to 40 letters, digits, - or _, found something else";
/// Message about a line that is there after all questions were answered.
const AFTER: &str =
    "expected no more lines, found one that nobody asked for; print one line a `step`, and none for `begin` and `end`";
/// Message about a line that came before its question.
const BEFORE: &str = "expected one line an answer, found one that came before this question; print one line a `step`, and none for `begin` and `end`";

impl Driver for Planner<'_> {
    fn begin(&mut self, plant: &Plant) {
        self.say(&begun(plant, self.seed, &self.asked));
    }

    fn decide(&mut self, view: &View<'_>) -> Control {
        let k = view.decision();
        match self.ask(view) {
            Ok(Wish::Drive(Control::Drive { acceleration_mps2, steering_rad })) => {
                let limits = view.plant().limits().at_step(k);
                let acceleration_mps2 = acceleration_mps2.clamp(-limits.brake_mps2, limits.engine_mps2);
                let steering_rad = steering_rad.clamp(-limits.steering_rad, limits.steering_rad);
                self.controls.push([acceleration_mps2, steering_rad]);
                return Control::Drive { acceleration_mps2, steering_rad };
            }
            Ok(Wish::Drive(log)) => return log,
            Ok(Wish::Abandon(word)) => self.abandoned = Some((k, word)),
            Err(refusal) => {
                let reason = format!("decision {k} ({:.1} s): {}", k as f64 * DT_S, refusal.reason);
                self.broken = Some(Refusal { reason, ..refusal });
            }
        }
        // The simulator refuses this, which ends the rollout.
        Control::Drive { acceleration_mps2: f64::NAN, steering_rad: f64::NAN }
    }

    fn finish(&mut self, view: &View<'_>, end: End) {
        let steps = view.decision();
        if self.asked.labels {
            self.ended = Some((end, steps));
        } else {
            self.close(steps, &Message::End { end: Ending::Driven(end), steps, labels: None });
        }
    }
}

/// Drives along points that lie 0.1 s apart: on the arc through the last point looked at, with the constant acceleration that
/// covers the way there in its time. Points behind the car stop it.
fn along(view: &View<'_>, points: &[Vec2]) -> Control {
    let ego = view.ego();
    let ahead = &points[..points.len().min(POINTS_AHEAD)];
    let last = ahead[ahead.len() - 1];
    let from = ego.sample.position;
    let mut way_m = from.distance(ahead[0]);
    way_m += ahead.windows(2).map(|pair| pair[0].distance(pair[1])).fold(0.0, |sum, x| sum + x);
    if (last - from).dot(ego.axis) <= 0.0 {
        way_m = 0.0;
    }
    let seconds = DT_S * ahead.len() as f64;
    Control::Drive {
        acceleration_mps2: 2.0 * (way_m - ego.speed_mps * seconds) / (seconds * seconds),
        steering_rad: Car::new(&ego.sample, 2.0 * ego.size.half_length_m).steering_towards(last),
    }
}

/// Says why a process gave no line.
pub(super) fn why(broken: &Broken, limit: Duration) -> String {
    match broken {
        Broken::Ended => "the process ended".into(),
        Broken::HalfLine(bytes) => format!("the process ended {bytes} bytes into a line"),
        Broken::Late => format!("no answer within {} s (driver.timeout_s)", limit.as_secs_f64()),
        Broken::TooLong(most) => format!("a line of more than {most} bytes"),
        Broken::Stopped => "it is not waited for any more: the command is being stopped".into(),
    }
}
