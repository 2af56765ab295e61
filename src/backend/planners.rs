//! Planner processes as they are used: started when they are needed, greeted, given one rollout at a time, and some rollouts
//! twice, because a planner that answers differently the second time makes a run that nobody can repeat.

use std::path::Path;
use std::time::Duration;

use serde::Deserialize;

use super::answer::Answer;
use super::crew::Crew;
use super::driver::{DRIVER_PROTOCOL, DriverOptions};
use super::error::{BackendError, Fault, NoOutcome};
use super::planner::{Planner, Refusal, why};
use super::request::{Answers, Request};
use super::workers::{Line, Start, start_of};
use crate::kernel::Digest;
use crate::sim::{ReportedRollout, tell};

/// A planner may load weights before it greets: it has at least this long, s.
const GREETING_S: f64 = 120.0;

/// What a planner says when it starts.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct HelloLine {
    evodrive_driver: u32,
}

/// The planners of an experiment.
pub struct Planners<'a> {
    options: &'a DriverOptions,
    start: &'a dyn Start,
    crew: Crew<Box<dyn Line>>,
}

impl<'a> Planners<'a> {
    /// Nothing is started yet.
    pub fn new(options: &'a DriverOptions, start: &'a dyn Start) -> Planners<'a> {
        Planners { options, start, crew: Crew::new(options.processes) }
    }

    /// One rollout, or two where it is drawn to be compared.
    fn drive(&self, line: &mut dyn Line, request: &Request<'_>) -> Result<ReportedRollout, NoOutcome> {
        let first = self.play(line, request)?;
        if !drawn(&request.key, self.options.repeat_share) {
            return Ok(first);
        }
        let second = self.play(line, request)?;
        match difference(&first, &second) {
            None => Ok(first),
            Some((expected, found)) => Err(NoOutcome::Stop(BackendError::Worker(Fault {
                command: self.command(),
                place: format!("scene {}, played twice", request.scene()),
                expected,
                found,
                remedy: "make the planner a function of what it is told: seed its random numbers at `begin`, and keep \
                         nothing from one rollout to the next"
                    .into(),
            }))),
        }
    }

    fn play(&self, line: &mut dyn Line, request: &Request<'_>) -> Result<ReportedRollout, NoOutcome> {
        let mut planner = Planner::new(&mut *line, self.limit(), request.seed);
        let reported = tell(request.plant, request.intervention, &mut planner);
        let stopped = planner.was_stopped();
        match planner.broken() {
            None => Ok(reported?),
            // A failure of its scene would be recorded.
            Some(Refusal { reason, .. }) if stopped => Err(NoOutcome::Stop(BackendError::Worker(Fault {
                command: self.command(),
                place: format!("scene {}", request.scene()),
                expected: "a decision".into(),
                found: reason,
                remedy: "repeat the command to go on".into(),
            }))),
            Some(Refusal { reason, printed }) => {
                let reason = format!("planner `{}`, {reason}", self.command());
                let reported = complaint(line);
                let printed = if printed.is_empty() { reported } else { format!("; it printed: {printed}{reported}") };
                if let Some(printed) = printed.strip_prefix("; ") {
                    self.start.show(&format!("scene {}: {reason}", request.scene()), printed);
                }
                Err(NoOutcome::Scene(reason))
            }
        }
    }

    /// A new process that speaks this protocol.
    fn greeted(&self) -> Result<Box<dyn Line>, Fault> {
        let DriverOptions { command, .. } = self.options;
        let folder: &Path = self.options.folder();
        let greeting = format!("{{\"evodrive_driver\":{DRIVER_PROTOCOL}}}");
        let fault = |place: &str, expected: &str, found: String, remedy: &str| Fault {
            command: command.join(" "),
            place: place.into(),
            expected: expected.into(),
            found,
            remedy: remedy.into(),
        };
        let mut line = self.start.start_in(command, folder).map_err(|found| {
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
                Ok(HelloLine { evodrive_driver: DRIVER_PROTOCOL }) => return Ok(line),
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
        let mut line = self.crew.take(|| self.greeted())?;
        let driven = self.drive(line.as_mut(), request);
        // Whatever went wrong, nobody knows what the process would say next.
        self.crew.give_back(driven.is_ok().then_some(line));
        match driven {
            Ok(reported) => Ok(Answer::ReportedRollout(reported)),
            Err(NoOutcome::Scene(reason)) => Ok(Answer::Failed(reason)),
            Err(NoOutcome::Stop(BackendError::Worker(fault))) => Err(self.crew.stop(fault).into()),
            Err(NoOutcome::Stop(error)) => Err(error),
        }
    }
}

/// The end of what a process wrote on its standard error, for messages.
fn complaint(line: &mut dyn Line) -> String {
    let text = line.complaint();
    match text.trim() {
        "" => String::new(),
        text => format!("; its standard error ends:\n{text}"),
    }
}

/// Whether this rollout is among those that are played twice: drawn by its key, so that every recording draws the same.
fn drawn(key: &Digest, share: f64) -> bool {
    let bytes = key.as_bytes();
    let drawn = u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]);
    f64::from(drawn) < share * 4_294_967_296.0
}

/// Where two motions of one rollout part, in words.
fn difference(first: &ReportedRollout, second: &ReportedRollout) -> Option<(String, String)> {
    if first == second {
        return None;
    }
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
