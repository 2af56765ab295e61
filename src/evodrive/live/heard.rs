//! Interprets an HTTP answer: the one place that tells a model's reply from a server's fault, for both protocols. A fault of the model is a
//! reply of some kind (cut, declined, empty, not readable). A fault of the server is asked again. What asking again cannot change is refused.

use serde_json::Value;

use super::http::Answer;
use super::protocol::{End, Protocol, Said, text_at};
use super::surrogates;
use crate::llm::Metadata;
use crate::llm::unwrap::MARK;

/// An HTTP answer, understood.
#[derive(Debug, PartialEq)]
pub enum Heard {
    /// The model answered, well or not.
    Said(Box<Said>),
    /// The server failed, and may do better.
    Passing(Fault),
    /// Nothing of the protocol came: a page, a stream, half an object. It is asked again; perhaps something between here and the
    /// server spoke.
    Strange(Fault),
    /// Asking again would not change it.
    Refused(Fault),
}

/// Description of what happened, in the server's words if it has some.
#[derive(Debug, PartialEq)]
pub struct Fault {
    pub reason: String,
    /// True if a model may have worked on it, so that it may be billed.
    pub answered: bool,
}

/// Ends of an answer that the server caused: Mistral and OpenRouter, vLLM, DeepSeek, Zhipu.
const SERVERS_ENDS: [&str; 4] = ["error", "abort", "insufficient_system_resource", "network_error"];
/// Words in an error's code by which a filter declines, as Azure and OpenAI have them.
const FILTERS: [&str; 3] = ["content_filter", "content_policy", "responsibleaipolicy"];
/// Words in an error's code that mean no money or no right, whatever the status.
const FINAL: [&str; 9] = [
    "insufficient_quota",
    "billing",
    "invalid_request",
    "invalid_api_key",
    "authentication",
    "permission",
    "not_found",
    "context_length",
    "exceed_context",
];

/// Advice for an address at which something answers that speaks another protocol, or none.
const CHECK_ADDRESS: &str = "check base_url and kind";

/// Tells what an answer is. `quote` shows the beginning of a body without the key.
pub fn heard(protocol: Protocol, answer: &Answer, quote: &dyn Fn(&[u8]) -> String) -> Heard {
    let status = answer.status;
    match status {
        200..=299 => body(protocol, answer, quote),
        300..=399 => redirect(answer),
        _ => {
            let error = server_error(&parsed(&answer.body).unwrap_or(Value::Null));
            let words = match &error {
                Some(error) if !error.message.is_empty() => error.words(),
                _ => named(answer, quote).map_or_else(|| quote(&answer.body), |(name, _)| name),
            };
            let code = error.as_ref().map_or("", |error| error.code.as_str());
            judged(Some(status), code, format!("HTTP {status}: {words}"), &words)
        }
    }
}

fn fault(reason: impl Into<String>, answered: bool) -> Fault {
    Fault { reason: reason.into(), answered }
}

fn redirect(answer: &Answer) -> Heard {
    let to = answer.location.as_deref().unwrap_or("nowhere");
    let reason = format!("HTTP {} redirects to {to}, and no redirect is followed", answer.status);
    // A page of a network's owner redirects for a while; a moved server says 301 or 308.
    match answer.status {
        302 | 303 | 307 => Heard::Strange(fault(reason, false)),
        _ => Heard::Refused(fault(reason, false)),
    }
}

/// By status (of HTTP, or of an error told with 200) and the code's words.
fn judged(status: Option<u16>, code: &str, reason: String, words: &str) -> Heard {
    let code = code.to_ascii_lowercase();
    let has = |list: &[&str]| list.iter().any(|word| code.contains(word));
    if has(&FILTERS) {
        let text = words.as_bytes().to_vec();
        return Heard::Said(Box::new(Said { text, end: End::Declined, aside: None, metadata: Metadata::default() }));
    }
    let passing = match status {
        Some(408 | 429 | 500..=599) => !has(&FINAL[..2]),
        Some(400..=499) => false,
        _ => !has(&FINAL),
    };
    if passing { Heard::Passing(fault(reason, false)) } else { Heard::Refused(fault(reason, false)) }
}

/// An answer with status 2xx.
fn body(protocol: Protocol, answer: &Answer, quote: &dyn Fn(&[u8]) -> String) -> Heard {
    let strange = |what: String, answered: bool| {
        Heard::Strange(fault(format!("{what}; it begins {}; {CHECK_ADDRESS}", quote(&answer.body)), answered))
    };
    if let Some((name, remedy)) = named(answer, quote) {
        return Heard::Strange(fault(format!("{name}; {remedy}"), !answer.body.is_empty()));
    }
    let (value, mended) = match parsed(&answer.body) {
        Ok(value) => (value, false),
        Err(error) => match surrogates::lifted(&answer.body).and_then(|body| parsed(&body).ok()) {
            Some(value) => (value, true),
            None => return strange(format!("no JSON: {error}"), true),
        },
    };
    if let Some(error) = server_error(&value).filter(|_| says_error(&value)) {
        let reason = match error.status {
            Some(status) => format!("error {status} inside HTTP {}: {}", answer.status, error.words()),
            None => format!("an error inside HTTP {}: {}", answer.status, error.words()),
        };
        return judged(error.status, &error.code, reason, &error.words());
    }
    match protocol.read(&value) {
        Ok(said) if said.metadata.finish_reason.as_deref().is_some_and(|end| SERVERS_ENDS.contains(&end)) => {
            let end = said.metadata.finish_reason.unwrap_or_default();
            Heard::Passing(fault(format!("the server ended the answer (finish reason {end})"), true))
        }
        Ok(said) if mended => {
            let end = if said.end == End::Whole { End::Broken } else { said.end };
            Heard::Said(Box::new(Said { text: surrogates::lowered(&said.text), end, ..said }))
        }
        Ok(said) => Heard::Said(Box::new(said)),
        Err(reason) => strange(reason, true),
    }
}

/// JSON, behind a byte order mark too: RFC 8259 lets a reader pass over it.
fn parsed(body: &[u8]) -> Result<Value, serde_json::Error> {
    serde_json::from_slice(unmarked(body))
}

fn unmarked(body: &[u8]) -> &[u8] {
    body.strip_prefix(MARK).unwrap_or(body)
}

/// The name of a body that is no JSON at all, by what it begins with, and what to do.
fn named(answer: &Answer, quote: &dyn Fn(&[u8]) -> String) -> Option<(String, &'static str)> {
    let body = answer.body.as_slice();
    let text = unmarked(body).trim_ascii_start();
    let of_type = |word: &str| answer.content_type.as_deref().is_some_and(|kind| kind.contains(word));
    let begins = |words: &[&str]| words.iter().any(|word| text.starts_with(word.as_bytes()));
    if body.is_empty() {
        Some(("an empty body".into(), "see what the server, or what stands before it, writes into its log"))
    } else if body.starts_with(b"\x1f\x8b") || answer.encoded {
        let name = "a compressed body (gzip or the like), which was not asked for";
        Some((name.into(), "switch compression off at the server, or at what stands before it"))
    } else if body.starts_with(b"\xff\xfe") || body.starts_with(b"\xfe\xff") {
        Some(("a body in UTF-16 (by its byte order mark), expected UTF-8".into(), "let the server write UTF-8"))
    } else if of_type("event-stream") || begins(&["data:", "event:", "id:", "retry:"]) {
        let name = "an event stream, though none was asked for (\"stream\": false)";
        Some((
            format!("{name}; it begins {}", quote(body)),
            "switch streaming off at the server, or at what stands before it",
        ))
    } else if begins(&["<"]) {
        Some((format!("a web page, perhaps one to sign in at; it begins {}", quote(body)), CHECK_ADDRESS))
    } else {
        None
    }
}

/// An error as a server tells it.
struct ServerError {
    message: String,
    /// Its code and type, in one text.
    code: String,
    /// Its code where that is a status of HTTP.
    status: Option<u16>,
}

impl ServerError {
    fn words(&self) -> String {
        if self.message.is_empty() { self.code.clone() } else { self.message.clone() }
    }
}

/// Returns `true` if a body of status 200 is an error: `error` with something in it, `object` or `type` that says so.
fn says_error(value: &Value) -> bool {
    let word = |field: &str| value.get(field).and_then(Value::as_str) == Some("error");
    let in_choice = value.pointer("/choices/0/error").is_some_and(holds_something);
    value.get("error").is_some_and(holds_something) || in_choice || word("object") || word("type")
}

fn holds_something(value: &Value) -> bool {
    match value {
        Value::Null | Value::Bool(false) => false,
        Value::String(text) => !text.is_empty(),
        Value::Object(fields) => !fields.is_empty(),
        _ => true,
    }
}

/// OpenAI, Anthropic, llama.cpp and gateways say `{"error": {..}}`, Ollama `{"error": ".."}`, older vLLM has the fields at the top.
fn server_error(value: &Value) -> Option<ServerError> {
    let at = |place: &str| value.pointer(place).filter(|error| holds_something(error));
    let error = at("/error").or_else(|| at("/choices/0/error")).or(Some(value)).filter(|error| !error.is_null())?;
    let text = |place: &str| error.pointer(place).and_then(Value::as_str).unwrap_or_default().to_string();
    let message = match error {
        Value::String(text) => text.clone(),
        _ => ["/message", "/detail", "/error_description"]
            .map(text)
            .into_iter()
            .find(|m| !m.is_empty())
            .unwrap_or_default(),
    };
    // A gateway's own words say less than those that it passes on.
    let message = match text("/metadata/raw") {
        raw if raw.is_empty() || message.contains(&raw) => message,
        raw => format!("{message} ({raw})"),
    };
    let code = ["/code", "/status", "/status_code"].into_iter().filter_map(|place| error.pointer(place));
    let number = |code: &Value| code.as_u64().or_else(|| code.as_str()?.trim().parse().ok());
    let status = code.filter_map(number).find(|code| (400..600).contains(code));
    let inner = text_at(error, "/innererror/code").unwrap_or_default();
    Some(ServerError {
        message,
        code: [text("/code"), text("/type"), inner].join(" ").trim().to_string(),
        status: status.and_then(|status| u16::try_from(status).ok()),
    })
}

#[cfg(test)]
mod tests;
