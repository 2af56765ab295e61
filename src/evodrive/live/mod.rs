//! A client for real models: one blocking HTTP request for each answer, with bounded retries and a spend cap. It is the
//! only code that uses the network, and only under the cargo feature `live`.
//! It is a part of the crate of the commands: those below are the same with and without it, so that tests, which are built with all
//! features, and the program share them.

mod advice;
mod anthropic;
mod heard;
mod http;
mod openai;
mod protocol;
mod retry;
mod secret;
mod spend;
mod surrogates;
mod wire;

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

pub use http::RESPONSE_BYTES_MAX;
pub use protocol::draw_seed;
pub use secret::Secret;
pub use spend::{Ledger, Tokens};

use crate::llm::{ClientOptions, Completion, IncompleteReplies, Metadata, Model, ModelError, Request, client};
use heard::{Heard, heard};
use http::Http;
use protocol::{End, Protocol, Said};
use retry::{Schedule, Step, Stop};

/// Means of the world beside the network that a client needs; the caller provides them.
#[derive(Clone)]
pub struct Outside {
    /// Waits between two attempts.
    pub pause: Arc<dyn Fn(Duration) + Send + Sync>,
    /// The time since 1970, UTC.
    pub now: Arc<dyn Fn() -> Duration + Send + Sync>,
    /// Tells whoever records.
    pub tell: Arc<dyn Fn(&str) + Send + Sync>,
}

/// Characters of an unexpected body that a message shows.
const QUOTED_CHARS: usize = 200;

/// One live model of an experiment.
pub struct Live {
    name: String,
    protocol: Protocol,
    options: ClientOptions,
    http: Http,
    key: Option<Secret>,
    ledger: Arc<Ledger>,
    outside: Outside,
    /// True once the user was told that the server cuts prompts.
    told_of_cut: AtomicBool,
    /// True once the user was told that replies stand beside the content.
    told_of_aside: AtomicBool,
}

impl Live {
    /// `name` and `kind` as in the experiment file; `key` is what the variable `api_key_env` holds.
    pub fn new(
        name: &str,
        kind: &str,
        options: &ClientOptions,
        key: Option<Secret>,
        ledger: Arc<Ledger>,
        outside: Outside,
    ) -> Result<Live, ModelError> {
        let unusable = |reason: String| ModelError::Unanswerable { reason: format!("models.{name}: {reason}") };
        let protocol = match kind {
            client::OPENAI_COMPATIBLE => Protocol::OpenAi,
            client::ANTHROPIC => Protocol::Anthropic,
            other => return Err(unusable(format!("kind {other:?} is not asked over the network"))),
        };
        let headers = protocol.headers(options, key.as_ref());
        let http = Http::new(&protocol.url(options), headers, options.timeout_s).map_err(unusable)?;
        let (name, options) = (name.to_string(), options.clone());
        let (told_of_cut, told_of_aside) = (AtomicBool::new(false), AtomicBool::new(false));
        Ok(Live { name, protocol, options, http, key, ledger, outside, told_of_cut, told_of_aside })
    }

    /// Asks until there is an answer, or a reason why there will be none.
    fn answer(&self, request: &Request) -> Result<Said, ModelError> {
        let body = self.protocol.body(request)?;
        let bound = Tokens::new(input_bound(&body), self.protocol.output_bound(&request.model));
        let mut schedule = Schedule::new(&self.options);
        loop {
            let reservation = self.ledger.reserve(&self.name, bound)?;
            let step = match self.http.post(&body, &*self.outside.now) {
                Ok(answer) => {
                    let heard = heard(self.protocol, &answer, &|body| self.quoted(body));
                    reservation.settle(taken(&heard, bound));
                    match heard {
                        Heard::Said(said) => {
                            self.look_for_a_cut(request, &said.metadata);
                            return Ok(*said);
                        }
                        Heard::Passing(fault) => schedule.after_fault(fault, answer.retry_after),
                        Heard::Strange(fault) => schedule.after_strange(fault, answer.retry_after),
                        Heard::Refused(fault) => Step::Stop(Stop::Refused { reason: fault.reason }),
                    }
                }
                Err(lost) => {
                    if !lost.may_be_billed() {
                        reservation.settle(Tokens::default());
                    }
                    schedule.after_loss(lost)
                }
            };
            match step {
                Step::Again(wait) => (self.outside.pause)(wait),
                Step::Stop(stop) => return Err(self.stopped(stop, request)),
            }
        }
    }

    /// Warns once where the server has read only a part of a prompt.
    fn look_for_a_cut(&self, request: &Request, metadata: &Metadata) {
        let bytes = request.prompt_bytes();
        if metadata.prompt_was_cut(bytes) && !self.told_of_cut.swap(true, Ordering::Relaxed) {
            let tokens = metadata.input_tokens.unwrap_or(0);
            let context = advice::context(request, self.protocol.output_bound(&request.model));
            (self.outside.tell)(&format!(
                "warning: models.{}: the server counts {tokens} tokens in a prompt of {bytes} bytes, so it read only a part of it, or \
                 leaves what it had in a cache out of its count; in the first case give it {context} and record again with --fresh",
                self.name
            ));
        }
    }

    /// Says where an answer without content holds text, and what to do; empty if it holds none. Warns once if such answers are kept.
    fn aside(&self, said: &Said) -> Box<str> {
        let Some(aside) = said.aside else { return Box::default() };
        let words = advice::aside(aside);
        let kept = self.options.incomplete_replies == IncompleteReplies::Keep;
        if kept && !self.told_of_aside.swap(true, Ordering::Relaxed) {
            (self.outside.tell)(&format!("warning: models.{}: an answer is empty{words}", self.name));
        }
        words.into()
    }

    /// Returns why it is not asked again, with what to change if the server's words tell.
    fn stopped(&self, stop: Stop, request: &Request) -> ModelError {
        let bound = self.protocol.output_bound(&request.model);
        stop.error(&self.options.base_url, |text| match advice::remedy(request, &self.options, bound, text) {
            Some(remedy) => format!("{}; {remedy}", self.shown(text)),
            None => self.shown(text),
        })
    }

    /// The part of an answer that may be recorded.
    fn accepted(&self, said: Said) -> Result<Completion, ModelError> {
        let address = self.options.base_url.clone();
        let finish_reason = match said.metadata.finish_reason.as_deref() {
            Some("") => "\"\"".to_string(),
            reason => self.shown(reason.unwrap_or("none")),
        };
        let aside = self.aside(&said);
        match (said.end, self.options.incomplete_replies) {
            (End::Whole, _) | (_, IncompleteReplies::Keep) => {
                self.free_of_secrets(&said)?;
                Ok(Completion { bytes: said.text, metadata: Some(said.metadata) })
            }
            (End::Declined, IncompleteReplies::Stop) => {
                Err(ModelError::Declined { address, reason: self.shown(&String::from_utf8_lossy(&said.text)) })
            }
            (End::Truncated, IncompleteReplies::Stop) => {
                let output_tokens =
                    said.metadata.output_tokens.map_or("an unknown number of".into(), |n| n.to_string());
                Err(ModelError::Truncated { address, output_tokens, finish_reason, aside })
            }
            (End::Empty, IncompleteReplies::Stop) => Err(ModelError::Empty { address, finish_reason, aside }),
            (End::Unknown, IncompleteReplies::Stop) => {
                let reason = format!("its finish reason is {finish_reason}, which does not say that it is whole");
                Err(ModelError::Incomplete { address, reason })
            }
            (End::Broken, IncompleteReplies::Stop) => {
                let reason = "it holds half a character (a lone surrogate, or bytes that are no UTF-8)".to_string();
                Err(ModelError::Incomplete { address, reason })
            }
        }
    }

    /// An answer that repeats the key is not recorded, because cassettes are shared.
    fn free_of_secrets(&self, said: &Said) -> Result<(), ModelError> {
        let metadata = serde_json::to_string(&said.metadata).unwrap_or_default();
        let leaks = |key: &Secret| key.is_in(&String::from_utf8_lossy(&said.text)) || key.is_in(&metadata);
        match &self.key {
            Some(key) if leaks(key) => {
                let reason = "the answer repeats the api key, so it is not recorded; ask at an address that does not echo requests";
                Err(self.malformed(reason.to_string()))
            }
            _ => Ok(()),
        }
    }

    fn malformed(&self, reason: String) -> ModelError {
        ModelError::Malformed { address: self.options.base_url.clone(), reason: self.shown(&reason) }
    }

    /// The first characters of a body, for messages.
    fn quoted(&self, body: &[u8]) -> String {
        // More than is shown, so that a key that stands across the end is found.
        let start = String::from_utf8_lossy(&body[..body.len().min(QUOTED_CHARS * 40)]).into_owned();
        let text = self.key.as_ref().map_or_else(|| start.clone(), |key| key.redacted(&start));
        let mut shown: String = text.chars().take(QUOTED_CHARS).collect();
        shown.extend((shown.len() < text.len()).then_some('…'));
        format!("{shown:?}")
    }

    /// Text of the server made fit for messages: short, on one line, without the key.
    fn shown(&self, text: &str) -> String {
        let text = self.key.as_ref().map_or_else(|| text.to_string(), |key| key.redacted(text));
        let line: String = text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect();
        match line.char_indices().nth(600) {
            Some((cut, _)) => format!("{}…", &line[..cut]),
            None => line,
        }
    }
}

/// Returns the tokens of an answer: as the provider counts, none if it only refused, the bound if nobody says.
fn taken(heard: &Heard, bound: Tokens) -> Tokens {
    match heard {
        Heard::Said(said) => said.tokens().unwrap_or(bound),
        Heard::Passing(fault) | Heard::Strange(fault) | Heard::Refused(fault) if fault.answered => bound,
        _ => Tokens::default(),
    }
}

/// An estimate from above: our prompts have 3.4 bytes a token, and what is not ASCII has a token a byte at most. A chat template
/// adds far less than the punctuation of JSON.
fn input_bound(body: &[u8]) -> u64 {
    let (ascii, other): (Vec<u8>, Vec<u8>) = body.iter().partition(|byte| byte.is_ascii());
    ascii.len() as u64 / 2 + other.len() as u64 + 64
}

impl Model for Live {
    fn complete(&self, request: &Request) -> Result<Completion, ModelError> {
        self.accepted(self.answer(request)?)
    }
}
