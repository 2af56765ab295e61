//! One table of everything that servers, and what stands before them, were seen to answer, with what it counts as.

use super::*;
use serde_json::json;

/// Expectation of a row of the table, in one word, and what the message or the reply holds.
#[derive(Debug, Clone, Copy)]
enum Is {
    Whole(&'static [u8]),
    Incomplete(End, &'static [u8]),
    Passing(&'static str),
    Strange(&'static str),
    Refused(&'static str),
}
use Is::{Incomplete, Passing, Refused, Strange, Whole};

fn answer(status: u16, body: impl Into<Vec<u8>>) -> Answer {
    let body = body.into();
    Answer { status, retry_after: None, content_type: None, encoded: false, location: None, body }
}

fn ok(body: impl Into<Vec<u8>>) -> Answer {
    answer(200, body)
}

fn json(value: Value) -> Answer {
    ok(value.to_string())
}

/// One choice of Chat Completions.
fn choice(finish: &str, content: Value) -> Answer {
    json(json!({"choices": [{"finish_reason": finish, "message": {"content": content}}]}))
}

fn raw(content: &[u8]) -> Answer {
    ok([br#"{"choices":[{"finish_reason":"stop","message":{"content":""#, content, br#""}}]}"#].concat())
}

fn quote(body: &[u8]) -> String {
    format!("{:?}", String::from_utf8_lossy(body).chars().take(200).collect::<String>())
}

fn judge(name: &str, protocol: Protocol, answer: &Answer, expected: Is) {
    let heard = heard(protocol, answer, &quote);
    let fits = match (&heard, expected) {
        (Heard::Said(said), Whole(text)) => said.end == End::Whole && said.text == text,
        (Heard::Said(said), Incomplete(end, text)) => said.end == end && said.text == text,
        (Heard::Passing(fault), Passing(words))
        | (Heard::Strange(fault), Strange(words))
        | (Heard::Refused(fault), Refused(words)) => fault.reason.contains(words),
        _ => false,
    };
    assert!(fits, "{name}: expected {expected:?}, found {heard:?}");
}

/// Chat Completions: everything that servers and what stands before them were seen to answer.
fn chat_table() -> Vec<(&'static str, Answer, Is)> {
    let parts = json!([{"type": "thinking", "thinking": [{"type": "text", "text": "hm {}"}]},
        {"type": "text", "text": "{\"a\":"}, {"type": "text", "text": "1}"}]);
    let error = |error: Value| json(json!({"id": null, "choices": null, "error": error}));
    vec![
        ("plain", choice("stop", json!("{}")), Whole(b"{}")),
        (
            "error: null beside an answer",
            json(json!({"error": null, "choices": [{"finish_reason": "stop",
            "message": {"content": "{}"}}]})),
            Whole(b"{}"),
        ),
        (
            "blanks before the body",
            ok(format!("\n  \n{}", String::from_utf8_lossy(&choice("stop", json!("{}")).body))),
            Whole(b"{}"),
        ),
        (
            "a byte order mark before the body",
            ok([b"\xef\xbb\xbf".as_slice(), &choice("stop", json!("{}")).body].concat()),
            Whole(b"{}"),
        ),
        ("parts", choice("stop", parts), Whole(b"{\"a\":1}")),
        ("parts as bare texts", choice("stop", json!(["{", "}"])), Whole(b"{}")),
        (
            "a refusal among the parts",
            choice("stop", json!([{"type": "refusal", "refusal": "No."}])),
            Incomplete(End::Declined, b"No."),
        ),
        (
            "a picture as a part",
            choice("stop", json!([{"type": "image_url", "image_url": {}}])),
            Strange("content[0] holds no text"),
        ),
        ("length", choice("length", json!("{")), Incomplete(End::Truncated, b"{")),
        ("an unknown end", choice("eos_or_whatever", json!("{}")), Incomplete(End::Unknown, b"{}")),
        ("no end", json(json!({"choices": [{"message": {"content": "{}"}}]})), Whole(b"{}")),
        ("no end of a part", json(json!({"choices": [{"message": {"content": "{"}}]})), Incomplete(End::Unknown, b"{")),
        ("an empty end", choice("", json!("{}")), Whole(b"{}")),
        ("an end token", choice("eos_token", json!("{}")), Whole(b"{}")),
        ("a tool nobody asked for", choice("tool_calls", json!(null)), Incomplete(End::Empty, b"")),
        ("an end by the server", choice("error", json!("{\"a\"")), Passing("finish reason error")),
        (
            "an end by the server, with its error",
            json(json!({"choices": [{"finish_reason": "error", "message": {"content": "{"},
            "error": {"code": 502, "message": "upstream idle timeout exceeded"}}]})),
            Passing("error 502 inside HTTP 200: upstream idle"),
        ),
        ("half a character", raw(br#"{\"a\": \"\ud83d\"}"#), Incomplete(End::Broken, b"{\"a\": \"\xed\xa0\xbd\"}")),
        (
            "half a character, cut",
            ok(br#"{"choices":[{"finish_reason":"length","message":{"content":"\ud83d"}}]}"#.as_slice()),
            Incomplete(End::Truncated, b"\xed\xa0\xbd"),
        ),
        ("a stray byte", raw(b"x\xff"), Incomplete(End::Broken, b"x\xff")),
        (
            "429 with 200",
            error(json!({"message": "Provider returned error", "code": 429, "metadata": {"raw": "Too Many Requests"}})),
            Passing("error 429 inside HTTP 200: Provider returned error (Too Many Requests)"),
        ),
        ("429 as a text", error(json!({"message": "slow", "code": "429"})), Passing("slow")),
        ("408 with 200", error(json!({"message": "late", "code": 408})), Passing("late")),
        (
            "503 at the top",
            json(json!({"object": "error", "message": "The model is overloaded", "code": 503})),
            Passing("error 503 inside HTTP 200: The model is overloaded"),
        ),
        ("an error without a code", error(json!("something broke")), Passing("something broke")),
        ("400 with 200", error(json!({"message": "bad schema", "code": 400})), Refused("bad schema")),
        (
            "no money with 200",
            error(json!({"message": "no credit", "code": "insufficient_quota"})),
            Refused("no credit"),
        ),
        (
            "choices: null",
            json(json!({"choices": null})),
            Strange("`choices` is null; it begins \"{\\\"choices\\\":null}"),
        ),
        ("no choice", json(json!({"choices": []})), Strange("`choices` is empty")),
        (
            "no choice after a filter",
            json(json!({"choices": [], "prompt_filter_results": [{"content_filter_results": {}}]})),
            Incomplete(End::Declined, b""),
        ),
        (
            "a filter as an error",
            answer(400, json!({"error": {"code": "content_filter", "message": "Filtered."}}).to_string()),
            Incomplete(End::Declined, b"Filtered."),
        ),
        (
            "an event stream",
            ok("data: {\"choices\":[]}\n\ndata: [DONE]\n\n"),
            Strange("an event stream, though none was asked for"),
        ),
        (
            "a keep-alive of a stream",
            Answer { content_type: Some("text/event-stream".into()), ..ok(": ping\n\n") },
            Strange("an event stream"),
        ),
        (
            "a page to sign in at",
            Answer { content_type: Some("text/html".into()), ..ok("<!DOCTYPE html><title>Sign in</title>") },
            Strange("a web page, perhaps one to sign in at; it begins \"<!DOCTYPE html><title>Sign in"),
        ),
        ("gzip", ok(b"\x1f\x8b\x08\x00".as_slice()), Strange("a compressed body (gzip")),
        ("brotli", Answer { encoded: true, ..ok("abc") }, Strange("a compressed body")),
        ("UTF-16", ok(b"\xff\xfe{\x00}\x00".as_slice()), Strange("UTF-16")),
        ("nothing", ok(""), Strange("an empty body")),
        (
            "half an object",
            ok("{\"choices\""),
            Strange("no JSON: EOF while parsing an object at line 1 column 10; it begins"),
        ),
        ("another object", json(json!({"answer": 42})), Strange("no choices[0]; it begins \"{\\\"answer\\\":42}")),
        (
            "a moved server",
            Answer { location: Some("https://example.org/v1".into()), ..answer(308, "") },
            Refused("HTTP 308 redirects to https://example.org/v1"),
        ),
        (
            "a portal",
            Answer { location: Some("http://portal/".into()), ..answer(302, "") },
            Strange("HTTP 302 redirects"),
        ),
        ("429", answer(429, "{\"error\":{\"message\":\"slow down\"}}"), Passing("HTTP 429: slow down")),
        (
            "429 without money",
            answer(429, "{\"error\":{\"code\":\"insufficient_quota\",\"message\":\"no credit\"}}"),
            Refused("HTTP 429: no credit"),
        ),
        (
            "500 about a bad request",
            answer(500, "{\"error\":{\"type\":\"invalid_request_error\",\"message\":\"boom\"}}"),
            Passing("boom"),
        ),
        ("a gateway's page", answer(502, "<html>Bad Gateway"), Passing("HTTP 502: a web page")),
        ("a gateway's words", answer(502, "Bad Gateway"), Passing("Bad Gateway")),
        ("400", answer(400, "{\"error\":{\"code\":400,\"message\":\"too long\"}}"), Refused("HTTP 400: too long")),
        ("401", answer(401, "{}"), Refused("HTTP 401: \"{}\"")),
        ("404", answer(404, "{\"detail\":\"Not Found\"}"), Refused("Not Found")),
        ("404 as a text", answer(404, "{\"error\":\"model not found\"}"), Refused("model not found")),
    ]
}

/// The Messages API.
fn messages_table() -> Vec<(&'static str, Answer, Is)> {
    let said = |stop: &str| json(json!({"stop_reason": stop, "content": [{"type": "text", "text": "{}"}]}));
    vec![
        ("plain", said("end_turn"), Whole(b"{}")),
        ("a pause", said("pause_turn"), Incomplete(End::Unknown, b"{}")),
        (
            "overloaded with 200",
            json(json!({"type": "error", "error": {"type": "overloaded_error", "message": "Overloaded"}})),
            Passing("an error inside HTTP 200: Overloaded"),
        ),
        (
            "a wrong key with 200",
            json(json!({"type": "error", "error": {"type": "authentication_error", "message": "no"}})),
            Refused("no"),
        ),
        (
            "overloaded",
            answer(
                529,
                json!({"type": "error", "error": {"type": "overloaded_error", "message": "Overloaded"}}).to_string(),
            ),
            Passing("HTTP 529: Overloaded"),
        ),
        ("a page", ok("<html>"), Strange("a web page")),
        ("a chat completion", choice("stop", json!("{}")), Strange("no list `content`")),
    ]
}

#[test]
fn each_kind_of_answer_is_told_apart_and_named() {
    for (name, answer, expected) in chat_table() {
        judge(name, Protocol::OpenAi, &answer, expected);
    }
    for (name, answer, expected) in messages_table() {
        judge(&format!("anthropic, {name}"), Protocol::Anthropic, &answer, expected);
    }
}

#[test]
fn only_what_a_model_may_have_worked_on_counts_as_billed() {
    let billed = |answer: Answer| match heard(Protocol::OpenAi, &answer, &quote) {
        Heard::Passing(fault) | Heard::Strange(fault) | Heard::Refused(fault) => fault.answered,
        Heard::Said(_) => panic!("a fault"),
    };
    assert!(billed(ok("data: {}")) && billed(choice("error", json!("{"))) && billed(ok("{\"choices\"")));
    assert!(!billed(answer(429, "")) && !billed(answer(302, "")) && !billed(json(json!({"error": {"code": 503}}))));
}

proptest::proptest! {
    #[test]
    fn no_body_makes_it_panic(status in 200u16..600, bytes in proptest::collection::vec(proptest::prelude::any::<u8>(), 0..120)) {
        for protocol in [Protocol::OpenAi, Protocol::Anthropic] {
            heard(protocol, &answer(status, bytes.clone()), &quote);
        }
    }
}
