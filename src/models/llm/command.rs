//! A model behind a program of the user's: it reads the request as JSON on its standard input and prints the reply. Who starts
//! programs is handed down; this module knows what they are told and what their end means.

use std::path::{Path, PathBuf};
use std::time::Duration;

use serde::{Deserialize, Serialize};
use serde_json::json;

use super::{Completion, Desk, DraftJudge, Metadata, Model, ModelError, Request, TriedDraft};

/// `[models.<name>.command]`: what is started for each request.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CommandOptions {
    /// The program and its arguments.
    pub program: Vec<String>,
    /// How long one answer may take, s.
    pub timeout_s: u64,
    /// Its files, which lie beside the experiment file or below. Where they are named, workers of a cluster ask the program themselves: the
    /// files travel with the work.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub files: Option<Vec<PathBuf>>,
    /// True if the program may try drafts of a patch before it answers: its request names the question then.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub tries: bool,
}

impl CommandOptions {
    /// The same on a machine where its files lie there: a word that names one of them stands for it, and so does one that names
    /// something that `beside` finds beside the experiment. A program without a folder is looked for where the system looks.
    pub fn placed(&self, at: impl Fn(&Path) -> PathBuf, beside: impl Fn(&Path) -> Option<PathBuf>) -> CommandOptions {
        let files = self.files.as_deref().unwrap_or_default();
        let place = |(k, word): (usize, &String)| {
            let path = Path::new(word);
            let found = match files.iter().find(|file| file.as_path() == path) {
                Some(file) => Some(at(file)),
                None if k == 0 && path.components().count() < 2 => None,
                None => beside(path),
            };
            found.map_or_else(|| word.clone(), |found| found.to_string_lossy().into_owned())
        };
        CommandOptions { program: self.program.iter().enumerate().map(place).collect(), ..self.clone() }
    }
}

/// The exit code by which a program says that its machine lacks what it needs.
const LACKING: i32 = 69;

/// How a program ended.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Ended {
    /// With exit code 0, and what it printed.
    Well(Vec<u8>),
    /// With another exit code (none: by a signal), and the end of what it wrote on standard error.
    Badly {
        /// Its exit code.
        code: Option<i32>,
        /// The end of its standard error.
        stderr: String,
    },
    /// It was stopped at the time limit; the end of its standard error.
    Late {
        /// The end of its standard error.
        stderr: String,
    },
    /// Nobody waits for it any more: the command that asks is being stopped.
    Stopped,
    /// It could not be started.
    Unstarted(String),
    /// It could not be spoken to, or not be read.
    Unread(String),
}

/// Starts programs. Called from many threads.
pub trait Run: Send + Sync {
    /// Runs a program to its end with these bytes on its standard input. While it runs, `meanwhile` is done now and then.
    fn run_beside(&self, program: &[String], input: Vec<u8>, limit: Duration, meanwhile: &mut dyn FnMut()) -> Ended;

    /// The same with nothing to do meanwhile.
    fn run(&self, program: &[String], input: Vec<u8>, limit: Duration) -> Ended {
        self.run_beside(program, input, limit, &mut || ())
    }
}

/// A model that is a program.
pub struct Command<'a> {
    options: CommandOptions,
    /// Note on who answers, and how: kept with every answer.
    provenance: String,
    run: Box<dyn Run + 'a>,
    /// Desk at which drafts are tried.
    desk: Option<Desk>,
}

impl<R: Run> Run for &R {
    fn run_beside(&self, program: &[String], input: Vec<u8>, limit: Duration, meanwhile: &mut dyn FnMut()) -> Ended {
        (**self).run_beside(program, input, limit, meanwhile)
    }
}

impl<'a> Command<'a> {
    /// A program, and who starts it.
    pub fn new(options: CommandOptions, provenance: &str, run: impl Run + 'a) -> Command<'a> {
        Command { options, provenance: provenance.into(), run: Box::new(run), desk: None }
    }

    /// With a folder in which drafts are tried.
    #[must_use]
    pub fn with_tries(self, desk: Option<Desk>) -> Command<'a> {
        Command { desk, ..self }
    }

    fn failed(&self, reason: String) -> ModelError {
        ModelError::Failed { address: self.address(), reason }
    }

    fn address(&self) -> String {
        self.options.program.join(" ")
    }
}

impl Model for Command<'_> {
    fn complete(&self, request: &Request) -> Result<Completion, ModelError> {
        self.read(self.started(request, None, &mut || ()), Vec::new())
    }

    fn complete_with(&self, request: &Request, judge: &dyn DraftJudge) -> Result<Completion, ModelError> {
        let Some(desk) = &self.desk else { return self.complete(request) };
        let (ended, tries) =
            desk.beside(request, judge, |question, meanwhile| self.started(request, Some(question), meanwhile))?;
        self.read(ended, tries)
    }
}

impl Command<'_> {
    /// Starts the program with a request and waits for its end. `question` is the file by which it tries drafts.
    fn started(&self, request: &Request, question: Option<&Path>, meanwhile: &mut dyn FnMut()) -> Ended {
        let mut line = json!({
            "format": "evodrive-command/1",
            "model": request.model.model,
            "sampling": request.model.sampling,
            "slot": request.slot,
            "messages": request.messages,
            "schema": request.schema,
        });
        if let Some(question) = question {
            line["question"] = json!(question);
        }
        let mut input = line.to_string().into_bytes();
        input.push(b'\n');
        self.run.run_beside(&self.options.program, input, Duration::from_secs(self.options.timeout_s), meanwhile)
    }

    /// Turns the program's end into a completion or an error.
    fn read(&self, ended: Ended, tries: Vec<TriedDraft>) -> Result<Completion, ModelError> {
        match ended {
            Ended::Well(bytes) => {
                let metadata = Metadata { model: self.provenance.clone(), tries, ..Metadata::default() };
                Ok(Completion { bytes, metadata: Some(metadata) })
            }
            Ended::Badly { code: Some(LACKING), stderr } => {
                Err(ModelError::Lacking { address: self.address(), reason: said(&stderr) })
            }
            Ended::Badly { code, stderr } => {
                let code = code.map_or("by a signal".to_string(), |code| format!("with exit code {code}"));
                Err(self.failed(format!("it ended {code}, expected 0; {}", said(&stderr))))
            }
            Ended::Late { stderr } => {
                let limit = self.options.timeout_s;
                Err(self.failed(format!("no answer within timeout_s = {limit}; {}", said(&stderr))))
            }
            Ended::Stopped => {
                let reason = "its answer is not waited for any more; repeat the command to ask again".into();
                Err(ModelError::Unanswerable { reason })
            }
            Ended::Unstarted(reason) => Err(ModelError::Lacking { address: self.address(), reason }),
            Ended::Unread(reason) => Err(self.failed(reason)),
        }
    }
}

fn said(stderr: &str) -> String {
    match stderr.trim() {
        "" => "it wrote nothing on standard error".into(),
        text => format!("it wrote on standard error:\n{text}\n"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::llm::{DrawSlot, Message, ModelSpec, Schema};
    use std::sync::Mutex;

    /// Ends as told, and keeps what it was given.
    struct Ends(Ended, Mutex<Vec<u8>>);

    impl Run for Ends {
        fn run_beside(&self, _: &[String], input: Vec<u8>, _: Duration, _: &mut dyn FnMut()) -> Ended {
            *self.1.lock().unwrap() = input;
            self.0.clone()
        }
    }

    fn asked(ended: Ended) -> (Result<Completion, ModelError>, serde_json::Value) {
        let run = Ends(ended, Mutex::new(vec![]));
        let options = CommandOptions {
            program: vec!["my_model".into(), "--quiet".into()],
            timeout_s: 9,
            files: None,
            tries: false,
        };
        let model = ModelSpec {
            name: "mine".into(),
            kind: "command".into(),
            model: "mine-1".into(),
            sampling: [("temperature".to_string(), 0.5)].into(),
            response_format: None,
            body: Default::default(),
            here: Default::default(),
        };
        let slot = DrawSlot { lineage: "l".into(), epoch: 2, slot: 3, role: "actor".into(), round: 0 };
        let messages = vec![Message { role: "user".into(), text: "Hello.".into() }];
        let schema = Schema::new(json!({"type": "object"})).unwrap();
        let request = Request { adapter_version: 1, slot, model, messages, schema };
        let answer = Command::new(options, "my own", &run).complete(&request);
        let request = serde_json::from_slice(&run.1.lock().unwrap()).unwrap();
        (answer, request)
    }

    #[test]
    fn a_program_is_told_the_request_and_what_it_prints_is_the_reply() {
        let (answer, request) = asked(Ended::Well(b"{}".to_vec()));
        let answer = answer.unwrap();
        assert_eq!((answer.bytes.as_slice(), answer.metadata.unwrap().model.as_str()), (&b"{}"[..], "my own"));
        assert_eq!(request["messages"][0]["text"], "Hello.");
        assert_eq!((&request["schema"]["type"], &request["slot"]["slot"]), (&json!("object"), &json!(3)));
        assert_eq!((&request["model"], &request["sampling"]["temperature"]), (&json!("mine-1"), &json!(0.5)));
    }

    #[test]
    fn a_program_that_fails_is_named_with_its_exit_code_and_what_it_complained_of() {
        let text = |ended| asked(ended).0.unwrap_err().to_string();
        let badly = text(Ended::Badly { code: Some(7), stderr: "no key set".into() });
        assert!(
            badly.contains("my_model --quiet") && badly.contains("exit code 7") && badly.contains("no key set"),
            "{badly}"
        );
        let late = text(Ended::Late { stderr: "loading".into() });
        assert!(late.contains("timeout_s = 9") && late.contains("loading"), "{late}");
        assert!(text(Ended::Unstarted("cannot be started".into())).contains("cannot be started"));
    }
}
