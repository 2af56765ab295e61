//! Worker processes at work: started when they are needed, greeted, asked one request at a time, and asked again
//! after a crash. [`Start`] and [`Line`] start and read a process.

use std::path::Path;
use std::time::Duration;

use serde::Deserialize;

use super::answer::{Answer, AnswerLine};
use super::crew::Crew;
use super::error::{BackendError, Fault};
use super::request::{Answers, PROTOCOL, Request};
use super::spec::BackendOptions;
use crate::kernel::Digest;
use crate::sim::judge;
use crate::store::shortened;

/// Starts worker processes.
pub trait Start: Sync {
    /// The error says in words why there is none.
    fn start(&self, command: &[String]) -> Result<Box<dyn Line>, String>;

    /// Starts a process in a folder with these variables in its environment, and keeps what it writes on standard error
    /// for [`Line::complaint`].
    fn start_in(&self, command: &[String], folder: &Path, variables: &[(&str, &str)]) -> Result<Box<dyn Line>, String>;

    /// Shows what a process printed, which no record holds. `about` names the process and the occasion.
    fn show(&self, _about: &str, _printed: &str) {}
}

/// One worker process that is spoken to by lines. Dropping it ends the process.
pub trait Line: Send {
    fn send(&mut self, line: String);

    /// The next line, without its end.
    fn receive(&mut self, limit: Duration) -> Result<Vec<u8>, Broken>;

    /// Returns a line that is there although nobody has asked for one yet.
    fn early(&mut self) -> Option<Result<Vec<u8>, Broken>> {
        None
    }

    /// Returns the end of its standard error, where that is kept. This ends the process.
    fn complaint(&mut self) -> String {
        String::new()
    }
}

/// Why no line came.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Broken {
    /// The process ended between two lines.
    Ended,
    /// It ended within a line, of which so many bytes came.
    HalfLine(usize),
    /// Nothing came in time.
    Late,
    /// The line is longer than so many bytes.
    TooLong(usize),
    /// Nobody waits for it any more: the command is being stopped.
    Stopped,
}

/// Greeting of a worker.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct HelloLine {
    evodrive_worker: u32,
    backend: String,
    #[serde(default)]
    version: Option<String>,
    #[serde(default)]
    digest: Option<Digest>,
    #[serde(default)]
    egos: Vec<String>,
    #[serde(default)]
    failure: Option<String>,
}

/// A worker that has greeted.
struct Worker {
    line: Box<dyn Line>,
    egos: Vec<String>,
    /// Number of rollouts that it has answered.
    answered: u32,
}

/// The workers of a backend.
pub struct Workers<'a> {
    backend: &'a BackendOptions,
    start: &'a dyn Start,
    crew: Crew<Worker>,
}

impl<'a> Workers<'a> {
    /// Creates the workers of a backend; nothing is started yet.
    pub fn new(backend: &'a BackendOptions, start: &'a dyn Start) -> Workers<'a> {
        Workers { backend, start, crew: Crew::new(backend.worker.workers) }
    }

    /// Starts one that can be asked, if none is idle.
    ///
    /// # Errors
    /// It cannot be started here, or is not the one that the experiment declares.
    pub fn ready(&self) -> Result<(), Fault> {
        let worker = self.crew.take(|| self.greeted())?;
        self.crew.give_back(Some(worker));
        Ok(())
    }

    /// Asks a worker. After a crash a new worker is asked, as often as the experiment allows; then the scene counts as failed.
    /// Any other fault of a worker stops everything.
    pub fn ask(&self, request: &Request<'_>) -> Result<Answer, BackendError> {
        let mut left = self.backend.worker.retries;
        loop {
            let mut worker = self.crew.take(|| self.greeted())?;
            let said = self.exchange(&mut worker, request);
            worker.answered += 1;
            let is_spent = self.backend.worker.rollouts.is_some_and(|most| worker.answered >= most);
            let lost = matches!(said, Err(Lost::Broken(_)));
            self.crew.give_back((!lost && !is_spent).then_some(worker));
            match said {
                Ok(answer) => return Ok(answer),
                Err(Lost::Broken(Broken::Ended | Broken::Late)) if left > 0 => left -= 1,
                Err(Lost::Broken(Broken::Ended)) => {
                    let times = self.backend.worker.retries + 1;
                    let reason = format!("the backend's worker ended without an answer, {times} times");
                    return Ok(Answer::Failed(reason.into()));
                }
                Err(Lost::Broken(broken)) => return Err(self.crew.stop(self.broken(&place(request), &broken)).into()),
                Err(Lost::Fault(fault)) => return Err(self.crew.stop(fault).into()),
            }
        }
    }

    fn exchange(&self, worker: &mut Worker, request: &Request<'_>) -> Result<Answer, Lost> {
        if !worker.egos.iter().any(|ego| ego == request.ego) {
            let (expected, found) = (format!("the ego {}", request.ego), format!("only {}", worker.egos.join(", ")));
            let remedy = "name an ego that the backend has in [[lineage]]";
            return Err(Lost::Fault(self.fault("the greeting", expected, found, remedy)));
        }
        worker.line.send(request.line());
        let bytes = worker.line.receive(self.limit()).map_err(Lost::Broken)?;
        self.read(request, &bytes).map_err(Lost::Fault)
    }

    /// Reads and checks an answer, so that nothing unfit is recorded.
    fn read(&self, request: &Request<'_>, bytes: &[u8]) -> Result<Answer, Fault> {
        let wrong = |expected: &str, found: String| self.fault(&place(request), expected, found, MEND);
        let line: AnswerLine = serde_json::from_slice(bytes).map_err(|error| {
            wrong(
                "one JSON object with `request`, and `failure` or a motion",
                format!("{error} in {}", start_of(bytes)),
            )
        })?;
        if line.request != request.key {
            return Err(wrong(&format!("request {}", request.key), line.request.to_hex()));
        }
        let mut answer = line.into_answer().map_err(|found| wrong("a motion or a failure", found))?;
        if let Answer::Failed(rollout) = &mut answer {
            let text = rollout.to_string();
            let reason = stable(&text);
            if reason != text {
                self.start.show(&place(request), &text);
                *rollout = reason.into();
            }
        }
        if let Answer::ReportedRollout(rollout) = &answer {
            judge(request.plant, request.intervention, rollout, request.replays)
                .map_err(|error| wrong("a motion of the scene", error.to_string()))?;
        }
        Ok(answer)
    }

    /// Starts a new worker, and checks that it is the one that the experiment declares.
    fn greeted(&self) -> Result<Worker, Fault> {
        let options = self.backend;
        let mut line = self.start.start(&options.worker.command).map_err(|found| {
            let remedy = "correct simulator.backend.worker.command, or install the backend (docs/BACKENDS.md)";
            self.fault("its start", "a process", found, remedy)
        })?;
        let bytes = line.receive(self.limit()).map_err(|broken| self.broken(GREETING, &broken))?;
        let hello: HelloLine = serde_json::from_slice(&bytes).map_err(|error| {
            let found = format!("{error} in {}", start_of(&bytes));
            self.fault(
                GREETING,
                "one JSON object with `evodrive_worker`, `backend`, `version`, `digest`, `egos`",
                found,
                MEND,
            )
        })?;
        if let Some(failure) = hello.failure {
            return Err(self.fault(GREETING, "a worker that can work", shortened(&failure), "do what it says"));
        }
        let text = |x: Option<String>| x.unwrap_or_else(|| "none".into());
        let declared = "declare it in [simulator.backend] if it is meant, or install the declared one";
        let fields = [
            ("protocol", PROTOCOL.to_string(), hello.evodrive_worker.to_string()),
            ("backend", options.name.clone(), hello.backend),
            ("version", options.version.clone(), text(hello.version)),
            ("digest", options.digest.to_hex(), text(hello.digest.map(|digest| digest.to_hex()))),
        ];
        match fields.into_iter().find(|(_, expected, found)| expected != found) {
            None => Ok(Worker { line, egos: hello.egos, answered: 0 }),
            Some((field, expected, found)) => {
                Err(self.fault(GREETING, format!("{field} {expected}"), shortened(&found), declared))
            }
        }
    }

    fn broken(&self, place: &str, broken: &Broken) -> Fault {
        let seconds = self.backend.worker.seconds;
        let (expected, found, remedy) = match broken {
            Broken::Ended => {
                ("a line".into(), "the end of the process".into(), "see what it said on its standard error")
            }
            Broken::HalfLine(bytes) => {
                ("a whole line".into(), format!("{bytes} bytes and the end of the process"), MEND)
            }
            Broken::Late => (
                format!("a line within {seconds} s"),
                "nothing".to_string(),
                "raise simulator.backend.worker.seconds, or see what the worker waits for",
            ),
            Broken::TooLong(most) => (format!("a line of at most {most} bytes"), "a longer one".into(), MEND),
            Broken::Stopped => ("a line".into(), "the command's end".into(), "repeat the command to go on"),
        };
        self.fault(place, expected, found, remedy)
    }

    fn fault(&self, place: &str, expected: impl Into<String>, found: impl Into<String>, remedy: &str) -> Fault {
        Fault {
            command: self.backend.worker.command.join(" "),
            place: place.into(),
            expected: expected.into(),
            found: found.into(),
            remedy: remedy.into(),
        }
    }

    fn limit(&self) -> Duration {
        Duration::from_secs_f64(self.backend.worker.seconds)
    }
}

impl Answers for Workers<'_> {
    fn answer(&self, request: &Request<'_>) -> Result<Answer, BackendError> {
        self.ask(request)
    }
}

const GREETING: &str = "its greeting";
const MEND: &str = "mend the worker (docs/BACKENDS.md says what it may write)";

/// Why an exchange gave no answer.
enum Lost {
    Broken(Broken),
    Fault(Fault),
}

fn place(request: &Request<'_>) -> String {
    format!("its answer to request {} (scene {})", request.key.short(16), request.scene())
}

/// Most characters of a failure's reason that are recorded.
const REASON_CHARS: usize = 200;
/// Least letters of a word that may be a key.
const KEY_CHARS: usize = 20;

/// Returns the part of a worker's reason that is recorded: its first line, with `…` for words that may name a folder, a user or a key.
fn stable(reason: &str) -> String {
    let first = reason.trim().lines().next().unwrap_or_default();
    let outside = |word: &str| {
        word.contains(['/', '\\', '@', '=', '~']) || word.chars().filter(|c| c.is_alphanumeric()).count() >= KEY_CHARS
    };
    let words = first.split_whitespace().map(|word| if outside(word) { "…" } else { word });
    words.collect::<Vec<&str>>().join(" ").chars().take(REASON_CHARS).collect()
}

/// Returns the beginning of a line, for messages.
pub(super) fn start_of(bytes: &[u8]) -> String {
    shortened(&String::from_utf8_lossy(&bytes[..bytes.len().min(200)]))
}
