//! Planner processes at work: started when they are needed, greeted, given one rollout at a time. Some rollouts are played
//! again, because nobody can repeat a run whose planner answers differently the second time. Another process plays them the second
//! time, with another salt for Python's hashes of texts: within one process all that depends on them, such as the order of a
//! set, comes out the same.

use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::Duration;

use serde::Deserialize;

use super::answer::Answer;
use super::crew::Crew;
use super::driver::{DRIVER_PROTOCOL, DriverOptions};
use super::error::{BackendError, Fault, NoOutcome};
use super::lines::Asked;
use super::map_near::REACH_M;
use super::planner::{Planner, Refusal, why};
use super::request::{Answers, Request};
use super::rollouts::judged;
use super::workers::{Line, Start, start_of};
use crate::kernel::Digest;
use crate::sim::{ReportedRollout, Undriven, tell};

/// A planner may load weights before it greets: it has at least this long, s.
const GREETING_S: f64 = 120.0;

/// The variable that salts Python's hashes of texts, and its values in the processes that drive and in those that drive again.
const HASH_SALT: &str = "PYTHONHASHSEED";
const SALT: &str = "1";
const OTHER_SALT: &str = "2";

/// Greeting of a planner.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct HelloLine {
    evodrive_driver: u32,
    /// Radius around the ego within which it wants the map at each decision, metres.
    #[serde(default)]
    map_m: Option<f64>,
    /// True if it wants to be told the result of a rollout.
    #[serde(default)]
    labels: bool,
}

/// A process that greeted.
struct Greeted {
    line: Box<dyn Line>,
    map_m: Option<f64>,
    labels: bool,
}

/// The planners of an experiment.
pub struct Planners<'a> {
    options: &'a DriverOptions,
    start: &'a dyn Start,
    crew: Crew<Greeted>,
    /// Processes that play rollouts again.
    again: Crew<Greeted>,
    /// True if nothing was played again so far.
    unchecked: AtomicBool,
    /// Number of rollouts that were driven, and of those that were played again and came out the same.
    driven: AtomicUsize,
    equal: AtomicUsize,
}

impl<'a> Planners<'a> {
    /// Creates the planners of an experiment; nothing is started yet.
    pub fn new(options: &'a DriverOptions, start: &'a dyn Start) -> Planners<'a> {
        // As many as are busy with playing again on average, and at least one.
        let again = (options.processes as f64 * options.repeat_share).ceil().max(1.0) as usize;
        Planners {
            options,
            start,
            crew: Crew::new(options.processes),
            again: Crew::new(again),
            unchecked: AtomicBool::new(true),
            driven: AtomicUsize::new(0),
            equal: AtomicUsize::new(0),
        }
    }

    /// Starts one that can be asked, if none is idle.
    ///
    /// # Errors
    /// It cannot be started here, or does not greet as a planner must.
    pub fn ready(&self) -> Result<(), Fault> {
        let line = self.crew.take(|| self.greeted(SALT))?;
        self.crew.give_back(Some(line));
        Ok(())
    }

    /// Drives one rollout. Another process plays it too if it is drawn for comparison. The first rollout is always compared, because
    /// a study may be so short that none is drawn.
    fn drive(&self, process: &mut Greeted, request: &Request<'_>) -> Result<Answer, NoOutcome> {
        let first = self.play(process, request)?;
        self.driven.fetch_add(1, Ordering::Relaxed);
        let share = self.options.repeat_share;
        let is_first = self.unchecked.swap(false, Ordering::Relaxed);
        let due = share > 0.0 && (is_first || drawn(&request.key, share));
        if !due {
            return Ok(first);
        }
        let mut is_new = false;
        let start = || {
            is_new = true;
            self.greeted(OTHER_SALT)
        };
        let mut other = self.again.take(start).map_err(BackendError::planner)?;
        let compared = self.play_again(&mut other, request, &first, is_new);
        self.again.give_back(compared.is_ok().then_some(other));
        compared?;
        self.equal.fetch_add(1, Ordering::Relaxed);
        Ok(first)
    }

    /// Plays the same rollout in another process. A new process plays it twice: if every rollout were compared, both processes would
    /// have the same past, and state that a planner keeps from it would never show.
    fn play_again(
        &self,
        other: &mut Greeted,
        request: &Request<'_>,
        first: &Answer,
        is_new: bool,
    ) -> Result<(), NoOutcome> {
        let second = self.play(other, request)?;
        if let Some((expected, found)) = difference(first, &second) {
            let place = "played again in another process";
            return Err(self.differs(request, expected, found, place, format!(
                "make the planner a function of what it is told, the same in every process: seed its random numbers at `begin`, \
                 keep nothing from one rollout to the next, and let nothing hang on the order of a set or on hash() of a text, \
                 which Python salts anew in every process ({HASH_SALT} was {SALT} and {OTHER_SALT}): sort, or use hashlib"
            )));
        }
        if is_new && let Some((expected, found)) = difference(&second, &self.play(other, request)?) {
            let remedy = "make the planner a function of what it is told: seed its random numbers at `begin`, and keep nothing \
                          from one rollout to the next";
            return Err(self.differs(request, expected, found, "played twice in one process", remedy.into()));
        }
        Ok(())
    }

    fn differs(&self, request: &Request<'_>, expected: String, found: String, how: &str, remedy: String) -> NoOutcome {
        NoOutcome::Stop(BackendError::planner(Fault {
            command: self.command(),
            place: format!("scene {}, {how}", request.scene()),
            expected,
            found,
            remedy,
        }))
    }

    /// Returns a motion, or why the planner abandoned the scene.
    fn play(&self, process: &mut Greeted, request: &Request<'_>) -> Result<Answer, NoOutcome> {
        let (observe, under) = (self.options.observe, request.under);
        let asked = Asked { map_m: process.map_m, observe, under, labels: process.labels };
        let mut planner = Planner::new(process.line.as_mut(), self.limit(), request.seed, asked);
        let reported = tell(request.plant, request.intervention, &mut planner);
        let (abandoned, controls) = (planner.abandoned(), planner.controls());
        if let (true, Ok(reported)) = (planner.awaits_labels(), &reported) {
            planner.tell_labels(&judged(request, reported)?.0);
        }
        let stopped = planner.was_stopped();
        match planner.broken() {
            None => match abandoned {
                Some(said) => Ok(Answer::Failed(Undriven::Abandoned(format!("planner `{}`, {said}", self.command())))),
                None => Ok(Answer::ReportedRollout(ReportedRollout { controls, ..reported? })),
            },
            // A failure of its scene would be recorded.
            Some(Refusal { reason, .. }) if stopped => Err(NoOutcome::Stop(BackendError::Worker(Fault {
                command: self.command(),
                place: format!("scene {}", request.scene()),
                expected: "a decision".into(),
                found: reason,
                remedy: "repeat the command to go on".into(),
            }))),
            Some(Refusal { reason, printed, of }) => {
                let reason = of(format!("planner `{}`, {reason}", self.command()));
                let reported = complaint(process.line.as_mut());
                let printed = if printed.is_empty() { reported } else { format!("; it printed: {printed}{reported}") };
                if let Some(printed) = printed.strip_prefix("; ") {
                    self.start.show(&format!("scene {}: {reason}", request.scene()), printed);
                }
                Err(NoOutcome::Scene(reason))
            }
        }
    }

    /// Starts a new process that speaks this protocol.
    fn greeted(&self, salt: &str) -> Result<Greeted, Fault> {
        let DriverOptions { command, .. } = self.options;
        let folder: &Path = self.options.folder();
        let (nearest, farthest) = REACH_M;
        let greeting = format!(
            "{{\"evodrive_driver\":{DRIVER_PROTOCOL}}}, with \"map_m\" from {nearest} to {farthest} where it asks for the map"
        );
        let fault = |place: &str, expected: &str, found: String, remedy: &str| Fault {
            command: command.join(" "),
            place: place.into(),
            expected: expected.into(),
            found,
            remedy: remedy.into(),
        };
        let mut line = self.start.start_in(command, folder, &[(HASH_SALT, salt)]).map_err(|found| {
            fault(
                "its start",
                "a process",
                found,
                "correct driver.command; it is started in the experiment file's folder",
            )
        })?;
        let limit = Duration::from_secs_f64(GREETING_S.max(self.options.timeout_s));
        let said = match line.receive(limit) {
            Ok(bytes) => match serde_json::from_slice::<HelloLine>(&bytes) {
                Ok(HelloLine { evodrive_driver: DRIVER_PROTOCOL, map_m, labels }) if fits(map_m) => {
                    return Ok(Greeted { line, map_m, labels });
                }
                _ => start_of(&bytes),
            },
            Err(broken) => why(&broken, limit),
        };
        let found = format!("{said}{}", complaint(line.as_mut()));
        let remedy = "print that line first, and nothing else on standard output (docs/EGOS.md)";
        Err(fault("its greeting", &greeting, found, remedy))
    }

    fn command(&self) -> String {
        self.options.command.join(" ")
    }

    fn limit(&self) -> Duration {
        Duration::from_secs_f64(self.options.timeout_s)
    }
}

impl Answers for Planners<'_> {
    fn answer(&self, request: &Request<'_>) -> Result<Answer, BackendError> {
        let mut line = self.crew.take(|| self.greeted(SALT)).map_err(BackendError::planner)?;
        let driven = self.drive(&mut line, request);
        // After a failure, nobody knows what the process would say next.
        self.crew.give_back(driven.is_ok().then_some(line));
        match driven {
            Ok(answer) => Ok(answer),
            Err(NoOutcome::Scene(reason)) => Ok(Answer::Failed(reason)),
            Err(NoOutcome::Stop(BackendError::Worker(fault))) => Err(self.crew.stop(fault).into()),
            Err(NoOutcome::Stop(BackendError::Planner(fault))) => Err(BackendError::planner(self.crew.stop(*fault))),
            Err(NoOutcome::Stop(error)) => Err(error),
        }
    }

    /// Says how many rollouts were compared: with few of them, a planner that rarely answers differently goes unnoticed.
    fn compared(&self) -> Option<String> {
        let (driven, equal) = (self.driven.load(Ordering::Relaxed), self.equal.load(Ordering::Relaxed));
        let all = "driver.repeat_share = 1 plays every one again";
        match (driven, equal) {
            (0, _) => None,
            (_, 0) => Some(format!("none of the rollouts was played again in another process; {all}")),
            (driven, equal) => {
                let more = if equal < driven { format!("; {all}") } else { String::new() };
                Some(format!("{equal} of {driven} rollouts played again in another process, all equal{more}"))
            }
        }
    }
}

/// Returns `true` if a planner may ask for a map of this radius.
fn fits(map_m: Option<f64>) -> bool {
    map_m.is_none_or(|reach_m| (REACH_M.0..=REACH_M.1).contains(&reach_m))
}

/// Returns the end of a process's standard error, for messages.
fn complaint(line: &mut dyn Line) -> String {
    let text = line.complaint();
    match text.trim() {
        "" => String::new(),
        text => format!("; its standard error ends:\n{text}"),
    }
}

/// Returns `true` if this rollout is played again. Its key decides, so that every recording draws the same.
fn drawn(key: &Digest, share: f64) -> bool {
    let bytes = key.as_bytes();
    let drawn = u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]);
    f64::from(drawn) < share * 4_294_967_296.0
}

/// Describes the first difference between two answers to one request.
fn difference(first: &Answer, second: &Answer) -> Option<(String, String)> {
    if first == second {
        return None;
    }
    let driven = |answer: &Answer| match answer {
        Answer::ReportedRollout(reported) => format!("a drive of {} decisions", reported.ego.len().saturating_sub(1)),
        Answer::Failed(reason) => reason.to_string(),
    };
    let (Answer::ReportedRollout(first), Answer::ReportedRollout(second)) = (first, second) else {
        return Some((driven(first), driven(second)));
    };
    let place = |reported: &ReportedRollout, row: usize| match reported.ego.get(row) {
        Some(pose) => {
            let at = pose.sample.position;
            format!("the ego at ({}, {}) after {row} decisions", at.x, at.y)
        }
        None => format!("an end after {} decisions", reported.ego.len().saturating_sub(1)),
    };
    let rows = first.ego.len().max(second.ego.len());
    let parted = (0..rows).find(|&row| first.ego.get(row) != second.ego.get(row));
    Some(match parted {
        Some(row) => (place(first, row), place(second, row)),
        None => ("the same end and road users".into(), "others".into()),
    })
}
