//! The live client against servers that these tests write: both protocols, failures, the cap, and a whole recording.
//! `cargo test --features live --test all live::`. Nothing leaves this machine.
#![allow(clippy::disallowed_methods)]

use crate::harness::{self, Ran};
use evodrive::live::{Ledger, Live, Outside, RESPONSE_BYTES_MAX, Secret, Tokens, draw_seed};
use evodrive::llm::{
    Cassette, ClientOptions, Completion, DrawSlot, IncompleteReplies, Message, Model, ModelError, ModelSpec, Request,
    ResponseFormat, Schema, SpendCap,
};
use evodrive::scripted::Scripted;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};
use std::time::Duration;

const KEY: &str = "sk-test-0123456789abcdef";

// --- a server

#[derive(Clone, Debug)]
struct Received {
    path: String,
    headers: BTreeMap<String, String>,
    body: Value,
}

struct Reply {
    status: u16,
    headers: Vec<(&'static str, String)>,
    body: Vec<u8>,
}

impl Reply {
    fn json(value: Value) -> Reply {
        Reply { status: 200, headers: vec![], body: value.to_string().into_bytes() }
    }

    fn status(status: u16, value: Value) -> Reply {
        Reply { status, ..Reply::json(value) }
    }
}

struct Server {
    url: String,
    received: Arc<Mutex<Vec<Received>>>,
}

impl Server {
    /// `answer` sees how many requests came before and the request; `None` hangs up.
    fn start(answer: impl Fn(usize, &Received) -> Option<Reply> + Send + Sync + 'static) -> Server {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let url = format!("http://{}", listener.local_addr().unwrap());
        let received = Arc::new(Mutex::new(Vec::new()));
        let (log, answer) = (received.clone(), Arc::new(answer));
        std::thread::spawn(move || {
            for stream in listener.incoming().flatten() {
                let (log, answer) = (log.clone(), answer.clone());
                std::thread::spawn(move || serve(stream, &log, &*answer));
            }
        });
        Server { url, received }
    }

    fn received(&self) -> Vec<Received> {
        self.received.lock().unwrap().clone()
    }
}

fn serve(
    stream: TcpStream,
    log: &Mutex<Vec<Received>>,
    answer: &(dyn Fn(usize, &Received) -> Option<Reply> + Send + Sync),
) {
    let mut reader = BufReader::new(stream.try_clone().unwrap());
    let mut line = String::new();
    reader.read_line(&mut line).unwrap();
    let path = line.split(' ').nth(1).unwrap_or_default().to_string();
    let mut headers = BTreeMap::new();
    loop {
        let mut line = String::new();
        reader.read_line(&mut line).unwrap();
        let Some((name, value)) = line.trim_end().split_once(": ") else { break };
        headers.insert(name.to_ascii_lowercase(), value.to_string());
    }
    let length = headers.get("content-length").map_or(0, |text| text.parse().unwrap());
    let mut body = vec![0; length];
    reader.read_exact(&mut body).unwrap();
    let request = Received { path, headers, body: serde_json::from_slice(&body).unwrap_or(Value::Null) };
    let before = {
        let mut log = log.lock().unwrap();
        log.push(request.clone());
        log.len() - 1
    };
    let Some(reply) = answer(before, &request) else { return };
    let mut head = format!("HTTP/1.1 {} Status\r\nconnection: close\r\n", reply.status);
    head += &format!("content-length: {}\r\n", reply.body.len());
    reply.headers.iter().for_each(|(name, value)| head += &format!("{name}: {value}\r\n"));
    // A client that has seen enough hangs up.
    let mut stream = stream;
    let _ = stream.write_all(head.as_bytes()).and_then(|()| stream.write_all(b"\r\n"));
    let _ = stream.write_all(&reply.body);
}

fn chat(content: &str) -> Reply {
    Reply::json(json!({
        "id": "c-1", "object": "chat.completion", "model": "exact-model-7", "system_fingerprint": "b1-7e4c0a9",
        "choices": [{"index": 0, "finish_reason": "stop", "message": {"role": "assistant", "content": content}}],
        "usage": {"prompt_tokens": 120, "completion_tokens": 30, "total_tokens": 150},
        "timings": {"predicted_ms": 1.5},
    }))
}

// --- a client

struct Client {
    live: Live,
    ledger: Arc<Ledger>,
    waits: Arc<Mutex<Vec<u64>>>,
    printed: Arc<Mutex<Vec<String>>>,
    _dir: tempfile::TempDir,
}

fn options(base_url: &str) -> ClientOptions {
    ClientOptions {
        api_key_env: Some("KEY".into()),
        input_usd_per_million: 1.0,
        output_usd_per_million: 10.0,
        ..ClientOptions::at(base_url)
    }
}

fn client(kind: &str, options: &ClientOptions, tokens_max: u64) -> Client {
    client_with(KEY, kind, options, tokens_max)
}

fn client_with(key: &str, kind: &str, options: &ClientOptions, tokens_max: u64) -> Client {
    let dir = tempfile::tempdir().unwrap();
    let cap = SpendCap { usd_max: 1.0, tokens_max };
    let ledger = Arc::new(Ledger::open(dir.path().join("spend.json"), cap, [("m", options)]).unwrap());
    let waits = Arc::new(Mutex::new(Vec::new()));
    let log = waits.clone();
    let pause = Arc::new(move |wait: Duration| log.lock().unwrap().push(wait.as_secs()));
    let now = Arc::new(|| Duration::from_secs(784_110_600));
    let printed = Arc::new(Mutex::new(Vec::new()));
    let log = printed.clone();
    let outside = Outside { pause, now, tell: Arc::new(move |line: &str| log.lock().unwrap().push(line.to_string())) };
    let live = Live::new("m", kind, options, Some(Secret::new(key).unwrap()), ledger.clone(), outside).unwrap();
    Client { live, ledger, waits, printed, _dir: dir }
}

fn openai(server: &Server) -> Client {
    client("openai_compatible", &options(&format!("{}/v1", server.url)), 1_000_000)
}

impl Client {
    fn ask(&self) -> Result<Completion, ModelError> {
        self.live.complete(&request(0, "openai_compatible"))
    }

    /// The error of a request, checked for the key.
    fn error(&self) -> ModelError {
        let error = self.ask().unwrap_err();
        assert!(!format!("{error} {error:?}").contains("sk-test"), "{error:?}");
        error
    }

    fn used(&self) -> Tokens {
        self.ledger.used().get("m").copied().unwrap_or_default()
    }
}

fn request(slot: u32, kind: &str) -> Request {
    let sampling = match kind {
        "anthropic" => BTreeMap::from([("temperature".to_string(), 1.0), ("max_tokens".to_string(), 200.0)]),
        _ => [("temperature", 0.7), ("top_p", 0.9), ("max_tokens", 200.0), ("seed", 5.0)]
            .map(|(n, x)| (n.to_string(), x))
            .into(),
    };
    let format = if kind == "anthropic" { ResponseFormat::Tool } else { ResponseFormat::JsonSchema };
    let message = |role: &str, text: &str| Message { role: role.into(), text: text.into() };
    Request {
        adapter_version: 1,
        slot: DrawSlot { lineage: "cat-idm".into(), epoch: 1, slot, role: "actor".into(), round: 0 },
        model: ModelSpec {
            name: "m".into(),
            kind: kind.into(),
            model: "some-model".into(),
            sampling,
            response_format: Some(format),
            body: BTreeMap::from([("extra".to_string(), json!({"a": [1, false]}))]),
            here: Default::default(),
        },
        messages: vec![message("system", "Be strict."), message("user", "Context."), message("user", "Task.")],
        schema: schema(json!({"type": "object", "required": ["a"]})),
    }
}

// --- the protocols

fn schema(value: Value) -> Schema {
    Schema::new(value).unwrap()
}

#[test]
fn chat_completions_carry_the_request_and_the_answer_comes_with_its_metadata() {
    let server = Server::start(|_, _| Some(chat("{\"a\": 1}")));
    let client = openai(&server);
    let answer = client.ask().unwrap();
    assert_eq!(answer.bytes, b"{\"a\": 1}");
    let metadata = answer.metadata.unwrap();
    assert_eq!((metadata.model.as_str(), metadata.finish_reason.as_deref()), ("exact-model-7", Some("stop")));
    assert_eq!((metadata.input_tokens, metadata.output_tokens), (Some(120), Some(30)));
    assert_eq!(metadata.fingerprint.as_deref(), Some("b1-7e4c0a9"));
    let [asked] = server.received().try_into().unwrap();
    assert_eq!(asked.path, "/v1/chat/completions");
    assert_eq!(asked.headers["authorization"], format!("Bearer {KEY}"));
    assert_eq!(asked.headers["content-type"], "application/json");
    let seed = draw_seed(5.0, &request(0, "openai_compatible")).unwrap();
    let expected = json!({
        "model": "some-model", "stream": false, "temperature": 0.7, "top_p": 0.9, "max_tokens": 200, "seed": seed,
        "messages": [
            {"role": "system", "content": "Be strict."}, {"role": "user", "content": "Context."}, {"role": "user", "content": "Task."},
        ],
        "response_format": {"type": "json_schema", "json_schema": {
            "name": "actor_reply", "strict": false, "schema": {"type": "object", "required": ["a"]}}},
        "extra": {"a": [1, false]},
    });
    assert_eq!(asked.body, expected);
    assert_eq!(client.used(), Tokens::new(120, 30));
}

#[test]
fn the_messages_api_gets_a_system_text_and_one_turn_and_its_tool_call_is_the_reply() {
    let server = Server::start(|_, _| {
        Some(Reply::json(json!({
            "id": "msg_1", "type": "message", "role": "assistant", "model": "exact-claude", "stop_reason": "tool_use",
            "content": [{"type": "tool_use", "id": "t", "name": "actor_reply", "input": {"a": 1}}],
            "usage": {"input_tokens": 90, "output_tokens": 12},
        })))
    });
    let client = client("anthropic", &options(&server.url), 1_000_000);
    let answer = client.live.complete(&request(0, "anthropic")).unwrap();
    assert_eq!(answer.bytes, b"{\"a\":1}");
    assert_eq!(answer.metadata.unwrap().model, "exact-claude");
    let [asked] = server.received().try_into().unwrap();
    assert_eq!(asked.path, "/v1/messages");
    assert_eq!((asked.headers["x-api-key"].as_str(), asked.headers["anthropic-version"].as_str()), (KEY, "2023-06-01"));
    assert!(!asked.headers.contains_key("authorization"));
    let expected = json!({
        "model": "some-model", "max_tokens": 200, "temperature": 1.0,
        "system": [{"type": "text", "text": "Be strict.", "cache_control": {"type": "ephemeral"}}],
        "messages": [{"role": "user", "content": [
            {"type": "text", "text": "Context.", "cache_control": {"type": "ephemeral"}}, {"type": "text", "text": "Task."}]}],
        "tools": [{"name": "actor_reply", "description": "Hands in the reply.", "input_schema": {"type": "object", "required": ["a"]}}],
        "tool_choice": {"type": "tool", "name": "actor_reply"},
        "extra": {"a": [1, false]},
    });
    assert_eq!(asked.body, expected);
}

#[test]
fn each_draw_has_a_seed_of_its_own_and_always_the_same() {
    let server = Server::start(|_, _| Some(chat("{}")));
    let client = openai(&server);
    for slot in [0, 1, 0] {
        client.live.complete(&request(slot, "openai_compatible")).unwrap();
    }
    let seeds: Vec<u64> = server.received().iter().map(|r| r.body["seed"].as_u64().unwrap()).collect();
    assert!(seeds[0] != seeds[1] && seeds[0] == seeds[2] && seeds.iter().all(|s| *s < 1 << 31), "{seeds:?}");
}

// --- failures

#[test]
fn a_429_is_asked_again_after_the_time_that_the_server_names() {
    let server = Server::start(|before, _| {
        let busy = Reply {
            headers: vec![("retry-after", "7".into())],
            ..Reply::status(429, json!({"error": {"message": "slow down"}}))
        };
        Some(if before == 0 { busy } else { chat("{}") })
    });
    let client = openai(&server);
    client.ask().unwrap();
    assert_eq!(*client.waits.lock().unwrap(), [7]);
    assert_eq!(client.used(), Tokens::new(120, 30));
}

#[test]
fn server_errors_are_asked_again_with_growing_waits_until_the_attempts_end() {
    let server =
        Server::start(|before, _| Some(if before < 2 { Reply::status(500, json!("boom")) } else { chat("{}") }));
    let client = openai(&server);
    client.ask().unwrap();
    assert_eq!(*client.waits.lock().unwrap(), [1, 2]);
    let server = Server::start(|_, _| Some(Reply::status(503, json!({"error": {"message": "Loading model"}}))));
    let error = openai(&server).error();
    assert!(
        matches!(&error, ModelError::Transport { attempts: 3, reason, .. } if reason == "HTTP 503: Loading model"),
        "{error}"
    );
    assert_eq!(server.received().len(), 3);
}

#[test]
fn a_server_that_is_not_there_is_a_transport_error_and_costs_nothing() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let url = format!("http://{}/v1", listener.local_addr().unwrap());
    drop(listener);
    let client = client("openai_compatible", &options(&url), 1_000_000);
    let error = client.error();
    assert!(matches!(&error, ModelError::Transport { attempts: 3, address, .. } if *address == url), "{error}");
    assert_eq!((client.waits.lock().unwrap().as_slice(), client.used()), ([1, 2].as_slice(), Tokens::default()));
}

#[test]
fn a_connection_that_breaks_after_the_request_counts_as_if_it_had_been_answered() {
    let server = Server::start(|before, _| if before == 0 { None } else { Some(chat("{}")) });
    let client = openai(&server);
    client.ask().unwrap();
    assert_eq!(client.used().output, 200 + 30);
}

#[test]
fn a_refused_request_is_asked_once_and_the_key_is_cut_out_of_the_servers_words() {
    let printed = format!("Incorrect API key provided: {KEY}.\nSee your account.");
    let server = Server::start(move |_, _| Some(Reply::status(401, json!({"error": {"message": printed}}))));
    let client = openai(&server);
    let error = client.error();
    let expected = "HTTP 401: Incorrect API key provided: [api key]. See your account.; see whether the variable KEY holds a key that may use this model";
    assert!(matches!(&error, ModelError::Refused { reason, .. } if reason == expected), "{error}");
    assert_eq!((server.received().len(), client.used()), (1, Tokens::default()));
}

#[test]
fn an_answer_that_repeats_the_key_is_not_recorded() {
    let server = Server::start(|_, asked| Some(chat(&asked.headers["authorization"])));
    assert!(
        matches!(openai(&server).error(), ModelError::Malformed { reason, .. } if reason.contains("repeats the api key"))
    );
}

/// A key in every spelling in which a server may repeat it.
fn spelled(key: &str) -> Vec<String> {
    use base64::Engine;
    use base64::engine::general_purpose::{STANDARD, URL_SAFE};
    let bytes = |form: &dyn Fn(u8) -> String| key.bytes().map(form).collect::<String>();
    let reserved = |c: char| if c.is_ascii_alphanumeric() { c.to_string() } else { format!("%{:02X}", c as u32) };
    vec![
        key.to_string(),
        STANDARD.encode(key),
        URL_SAFE.encode(format!("Bearer {key}")),
        STANDARD.encode(format!("user:{key}:")),
        bytes(&|byte| format!("%{byte:02x}")),
        key.chars().map(reserved).collect(),
        bytes(&|byte| format!("\\u{byte:04x}")),
        key.replace('/', "\\/"),
        bytes(&|byte| format!("{byte:02X}")),
    ]
}

#[test]
fn no_spelling_of_the_key_comes_through_by_any_path() {
    const RESERVED: &str = "sk/te+st=0123456789&abcdef";
    let with = |place: &'static str, printed: String| -> Reply {
        let mut answer = json!({
            "model": "m-1", "system_fingerprint": "f-1", "usage": {"prompt_tokens": 9, "completion_tokens": 9},
            "choices": [{"finish_reason": "stop", "message": {"role": "assistant", "content": "fine"}}],
        });
        match place {
            "content" => answer["choices"][0]["message"]["content"] = printed.into(),
            "model" | "system_fingerprint" => answer[place] = printed.into(),
            "refusal" => answer["choices"][0]["message"] = json!({"content": null, "refusal": printed}),
            "finish_reason" => answer["choices"][0] = json!({"finish_reason": printed, "message": {"content": ""}}),
            "no protocol" => answer = json!({ printed: 1 }),
            "status" => return Reply::status(401, json!({"error": {"message": printed}})),
            _ => return Reply { body: printed.into_bytes(), ..chat("") },
        }
        Reply::json(answer)
    };
    let places =
        ["content", "model", "system_fingerprint", "refusal", "finish_reason", "no protocol", "status", "no JSON"];
    let (mut canaries, mut printed) = (0, Vec::new());
    for place in places {
        for text in spelled(RESERVED) {
            canaries += 1;
            let sent = format!("your key {text} is wrong");
            let server = Server::start(move |_, _| Some(with(place, sent.clone())));
            let options = options(&format!("{}/v1", server.url));
            let came = client_with(RESERVED, "openai_compatible", &options, 1_000_000).ask();
            let kept = match &came {
                Ok(completion) => format!("{} {:?}", String::from_utf8_lossy(&completion.bytes), completion.metadata),
                Err(error) => format!("{error} {error:?}"),
            };
            if kept.contains(&text) || kept.contains(&text.replace('\\', "\\\\")) {
                printed.push(format!("{place}, {text}: {kept}"));
            }
        }
    }
    assert!(canaries >= 50 && printed.is_empty(), "{} of {canaries}: {printed:#?}", printed.len());
}

#[test]
fn a_redirect_is_not_followed() {
    let other = Server::start(|_, _| Some(chat("{}")));
    let target = format!("{}/v1/chat/completions", other.url);
    for (status, asked) in [(302, 3), (308, 1)] {
        let to = target.clone();
        let server = Server::start(move |_, _| {
            Some(Reply { headers: vec![("location", to.clone())], ..Reply::status(status, json!({})) })
        });
        let printed = openai(&server).error().to_string();
        assert!(printed.contains(&target), "{printed}");
        assert_eq!((server.received().len(), other.received().len()), (asked, 0), "{status}");
    }
}

#[test]
fn what_is_not_the_protocol_is_asked_again_and_said_so_in_the_end() {
    for (body, word) in [("<html>", "a web page"), ("{\"choices\"", "no JSON"), ("{\"answer\": 42}", "no choices[0]")] {
        let server = Server::start(move |_, _| Some(Reply { body: body.into(), ..chat("") }));
        let error = openai(&server).error();
        assert!(matches!(&error, ModelError::Malformed { reason, .. } if reason.contains(word)), "{error}");
        assert_eq!(server.received().len(), 3);
    }
}

#[test]
fn an_error_told_with_200_is_asked_again_as_that_error_and_costs_nothing() {
    let busy = json!({"id": null, "choices": null, "error": {"message": "Provider returned error", "code": 429}});
    let printed = busy.clone();
    let server = Server::start(move |before, _| Some(if before == 0 { Reply::json(busy.clone()) } else { chat("{}") }));
    let client = openai(&server);
    client.ask().unwrap();
    assert_eq!((client.waits.lock().unwrap().as_slice(), client.used()), ([1].as_slice(), Tokens::new(120, 30)));
    let server = Server::start(move |_, _| Some(Reply::json(printed.clone())));
    let error = openai(&server).error();
    let expected = "error 429 inside HTTP 200: Provider returned error";
    assert!(matches!(&error, ModelError::Transport { attempts: 3, reason, .. } if reason == expected), "{error}");
}

#[test]
fn a_wait_that_is_told_in_milliseconds_is_kept_before_the_one_in_seconds() {
    let server = Server::start(|before, _| {
        let headers = vec![("retry-after", "9".into()), ("retry-after-ms", "6000".into())];
        Some(if before == 0 { Reply { headers, ..Reply::status(429, json!({})) } } else { chat("{}") })
    });
    let client = openai(&server);
    client.ask().unwrap();
    assert_eq!(*client.waits.lock().unwrap(), [6]);
}

#[test]
fn a_wait_that_is_told_as_a_date_is_kept() {
    let server = Server::start(|before, _| {
        let headers = vec![("retry-after", "Sun, 06 Nov 1994 08:30:08 GMT".into())];
        Some(if before == 0 { Reply { headers, ..Reply::status(429, json!({})) } } else { chat("{}") })
    });
    let client = openai(&server);
    client.ask().unwrap();
    assert_eq!(*client.waits.lock().unwrap(), [8]);
}

#[test]
fn half_a_character_is_an_error_of_its_own_and_an_unusable_reply_where_such_are_kept() {
    let body = r#"{"choices":[{"finish_reason":"stop","message":{"content":"{\"a\": \"\ud83d\"}"}}]}"#;
    let server = Server::start(move |_, _| Some(Reply { body: body.into(), ..chat("") }));
    let error = openai(&server).error();
    assert!(matches!(&error, ModelError::Incomplete { reason, .. } if reason.contains("lone surrogate")), "{error}");
    let options =
        ClientOptions { incomplete_replies: IncompleteReplies::Keep, ..options(&format!("{}/v1", server.url)) };
    let answer = client("openai_compatible", &options, 1_000_000).ask().unwrap();
    let refused = evodrive::llm::reply::json_object(&answer.bytes).unwrap_err();
    assert_eq!(refused.expected, "UTF-8");
}

#[test]
fn a_grammar_that_is_refused_names_the_setting_to_change() {
    let words = "Failed to initialize samplers: failed to parse grammar";
    let server = Server::start(move |_, _| Some(Reply::status(400, json!({"error": {"code": 400, "message": words}}))));
    let printed = openai(&server).error().to_string();
    assert!(
        printed.contains(words) && printed.contains("response_format") && printed.contains("[models.m]"),
        "{printed}"
    );
}

#[test]
fn the_schema_that_is_sent_has_bounds_that_servers_compile_and_the_question_keeps_its_own() {
    let server = Server::start(|_, _| Some(chat("{}")));
    let long = |bound: u32| json!({"type": "object", "properties": {"a": {"type": "string", "maxLength": bound}}});
    let request = Request { schema: schema(long(2000)), ..request(0, "openai_compatible") };
    let key = request.key().unwrap();
    openai(&server).live.complete(&request).unwrap();
    let sent = &server.received()[0].body["response_format"]["json_schema"]["schema"];
    assert_eq!((sent, request.key().unwrap()), (&long(1999), key));
}

#[test]
fn a_server_that_cuts_prompts_is_warned_of_once_with_the_context_to_set() {
    let server = Server::start(|_, _| {
        let mut said: Value = serde_json::from_slice(&chat("{}").body).unwrap();
        said["usage"]["prompt_tokens"] = 2048.into();
        Some(Reply::json(said))
    });
    let client = openai(&server);
    let long = Message { role: "user".into(), text: "word ".repeat(6_200).as_str().into() };
    for slot in 0..3 {
        let request = request(slot, "openai_compatible");
        client.live.complete(&Request { messages: vec![long.clone()], ..request }).unwrap();
    }
    client.ask().unwrap();
    let printed = client.printed.lock().unwrap().clone();
    assert!(printed.len() == 1 && printed[0].contains("models.m: the server counts 2048 tokens"), "{printed:?}");
    assert!(printed[0].contains("a context of 16384 tokens"), "{printed:?}");
}

#[test]
fn cached_tokens_count_as_read_and_what_a_filter_stopped_is_not_judged() {
    let cached =
        json!({"prompt_tokens": 12, "prompt_tokens_details": {"cached_tokens": 8988}, "completion_tokens": 300});
    let filtered = json!({"choices": [], "usage": {"prompt_tokens": 5, "completion_tokens": 0},
        "prompt_filter_results": [{"content_filter_results": {}}]});
    let server = Server::start(move |before, _| {
        let mut said: Value = serde_json::from_slice(&chat("{}").body).unwrap();
        said["usage"] = cached.clone();
        Some(Reply::json(if before == 0 { said } else { filtered.clone() }))
    });
    let client = openai(&server);
    let long = Message { role: "user".into(), text: "word ".repeat(6_200).as_str().into() };
    let request = Request { messages: vec![long], ..request(0, "openai_compatible") };
    let counted = client.live.complete(&request).unwrap().metadata.unwrap();
    assert_eq!((counted.input_tokens, counted.cached_input_tokens), (Some(9000), Some(8988)));
    assert!(matches!(client.live.complete(&request), Err(ModelError::Declined { .. })));
    assert!(client.printed.lock().unwrap().is_empty(), "{:?}", client.printed.lock().unwrap());
}

#[test]
fn a_query_own_headers_and_the_header_of_the_key_are_sent() {
    let server = Server::start(|_, _| Some(chat("{}")));
    let word = |a: &str, b: &str| BTreeMap::from([(a.to_string(), b.to_string())]);
    let options = ClientOptions {
        query: word("api-version", "2024-10-21"),
        headers: word("x-title", "EvoDrive test"),
        api_key_header: Some("api-key".into()),
        ..options(&format!("{}/openai/deployments/d", server.url))
    };
    client("openai_compatible", &options, 1_000_000).ask().unwrap();
    let [asked] = server.received().try_into().unwrap();
    assert_eq!(asked.path, "/openai/deployments/d/chat/completions?api-version=2024-10-21");
    assert_eq!((asked.headers["api-key"].as_str(), asked.headers["x-title"].as_str()), (KEY, "EvoDrive test"));
    assert!(!asked.headers.contains_key("authorization"));
}

#[test]
fn the_example_program_asks_any_chat_completions_address() {
    if !std::process::Command::new("python3").arg("--version").output().is_ok_and(|ran| ran.status.success()) {
        return harness::skip("no python3: examples/chat/chat.py was not tried");
    }
    let program = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/chat/chat.py");
    let ask = |server: &Server| {
        let printed = json!({"model": "mine-1", "sampling": {"max_tokens": 9.0, "temperature": 0.5}, "schema": {},
            "messages": [{"role": "system", "text": "Be strict."}, {"role": "user", "text": "Task ü."}]});
        let mut child = std::process::Command::new("python3")
            .arg(&program)
            .args([format!("{}/v1/chat/completions", server.url), "EVODRIVE_TEST_KEY".into()])
            .env("EVODRIVE_TEST_KEY", KEY)
            .stdin(std::process::Stdio::piped())
            .stdout(std::process::Stdio::piped())
            .stderr(std::process::Stdio::piped())
            .spawn()
            .unwrap();
        child.stdin.take().unwrap().write_all(printed.to_string().as_bytes()).unwrap();
        child.wait_with_output().unwrap()
    };
    let server = Server::start(|_, _| Some(chat("{\"a\": 1}")));
    let ran = ask(&server);
    assert_eq!((ran.status.code(), ran.stdout.as_slice()), (Some(0), b"{\"a\": 1}".as_slice()));
    let [asked] = server.received().try_into().unwrap();
    assert_eq!(asked.headers["authorization"], format!("Bearer {KEY}"));
    let messages = json!([{"role": "system", "content": "Be strict."}, {"role": "user", "content": "Task ü."}]);
    let expected = json!({"model": "mine-1", "max_tokens": 9, "temperature": 0.5, "messages": messages});
    assert_eq!(asked.body, expected);
    let ran = ask(&Server::start(|_, _| Some(Reply::status(400, json!({"error": "no such model"})))));
    let stderr = String::from_utf8_lossy(&ran.stderr).into_owned();
    assert!(
        ran.status.code() == Some(1) && stderr.contains("HTTP 400") && stderr.contains("no such model"),
        "{stderr}"
    );
}

#[test]
fn an_answer_without_end_is_cut_off() {
    let server = Server::start(|_, _| Some(Reply { body: vec![b' '; RESPONSE_BYTES_MAX as usize + 1], ..chat("") }));
    let error = openai(&server).error();
    assert!(
        matches!(&error, ModelError::Malformed { reason, .. } if reason.contains("more than 4194304 bytes")),
        "{error}"
    );
}

/// An answer that ended with `finish_reason`.
fn ended(finish_reason: &'static str, message: Value) -> Server {
    Server::start(move |_, _| {
        let choice = json!({"finish_reason": finish_reason, "message": message});
        Some(Reply::json(
            json!({"model": "x", "choices": [choice], "usage": {"prompt_tokens": 9, "completion_tokens": 200}}),
        ))
    })
}

#[test]
fn refusals_empty_and_cut_answers_are_errors_of_their_own() {
    let refused = openai(&ended("stop", json!({"content": null, "refusal": "I cannot help with that."}))).error();
    assert!(
        matches!(&refused, ModelError::Declined { reason, .. } if reason == "I cannot help with that."),
        "{refused}"
    );
    let empty = openai(&ended("stop", json!({"content": ""}))).error();
    assert!(matches!(empty, ModelError::Empty { .. }), "{empty}");
    let cut = openai(&ended("length", json!({"content": "{\"a\":"})));
    let error = cut.error();
    assert!(matches!(&error, ModelError::Truncated { output_tokens, .. } if output_tokens == "200"), "{error}");
    assert!(error.to_string().contains("max_tokens") && error.to_string().contains("incomplete_replies"), "{error}");
    assert_eq!(cut.used(), Tokens::new(9, 200));
}

#[test]
fn an_answer_that_stands_beside_the_content_is_named_with_its_field() {
    let beside = |message: Value, finish| openai(&ended(finish, message)).error().to_string();
    let reply = beside(json!({"content": null, "reasoning_content": "{\"a\": 1}"}), "stop");
    assert!(reply.contains("the reply stands in its field `reasoning_content`"), "{reply}");
    let thought = beside(json!({"content": "", "reasoning": "Let me see."}), "stop");
    assert!(thought.contains("its model only thought (`reasoning`)"), "{thought}");
    let cut = beside(json!({"content": "", "reasoning": "Let me see."}), "length");
    assert!(cut.contains("only thought") && cut.contains("raise max_tokens"), "{cut}");
    let unknown = beside(json!({"content": "{"}), "");
    assert!(
        unknown.contains("its finish reason is \"\"") && unknown.contains("reads them like every reply"),
        "{unknown}"
    );
    // Where such answers are kept it is told once.
    let server = ended("stop", json!({"content": null, "reasoning_content": "{}"}));
    let options = ClientOptions { incomplete_replies: IncompleteReplies::Keep, ..options(&server.url) };
    let client = client("openai_compatible", &options, 1_000_000);
    for _ in 0..2 {
        assert_eq!(client.ask().unwrap().bytes, b"");
    }
    let printed = client.printed.lock().unwrap().clone();
    assert!(printed.len() == 1 && printed[0].contains("models.m: an answer is empty: the reply stands"), "{printed:?}");
}

#[test]
fn kept_incomplete_answers_are_replies_with_their_finish_reason() {
    let server = ended("length", json!({"content": "{\"a\":"}));
    let options = ClientOptions { incomplete_replies: IncompleteReplies::Keep, ..options(&server.url) };
    let answer = client("openai_compatible", &options, 1_000_000).ask().unwrap();
    assert_eq!(
        (answer.bytes.as_slice(), answer.metadata.unwrap().finish_reason.unwrap().as_str()),
        (b"{\"a\":".as_slice(), "length")
    );
}

#[test]
fn the_request_that_could_exceed_the_cap_is_not_sent() {
    let server = Server::start(|_, _| Some(chat("{}")));
    // The bound of one request is about 500 tokens, and each turns out to take 150.
    let client = client("openai_compatible", &options(&server.url), 1_000);
    let answered = (0..20).take_while(|_| client.ask().is_ok()).count();
    assert!(matches!(client.error(), ModelError::SpendCap { reason } if reason.contains("spend.tokens_max is 1000")));
    assert!((1..6).contains(&answered), "{answered}");
    assert_eq!(server.received().len(), answered);
}

// --- whole recordings

/// The example experiment, asking this server, made small.
fn experiment(server: &Server, tokens_max: u64) -> String {
    let mut text = harness::text("experiments/live_example.toml");
    for (from, to) in [
        (
            "base_url = \"http://127.0.0.1:8080/v1\"",
            format!("base_url = \"{}/v1\"\napi_key_env = \"EVODRIVE_TEST_KEY\"", server.url),
        ),
        ("tokens_max = 3_000_000", format!("tokens_max = {tokens_max}")),
        ("wait_s_max = 60 ", "wait_s_max = 0 ".to_string()),
        ("count = 24\n", "count = 14\n".to_string()),
        ("{ count = 14 }", "{ count = 8 }".to_string()),
        ("held_out = 6", "held_out = 3".to_string()),
        ("window = 6", "window = 4".to_string()),
    ] {
        assert!(text.contains(from), "{from}");
        text = text.replacen(from, &to, 1);
    }
    text
}

/// Answers as the scripted model would: a function of the request.
fn by_rules(asked: &Received) -> Option<Reply> {
    let role = asked.body["response_format"]["json_schema"]["name"].as_str()?.strip_suffix("_reply")?.to_string();
    let rates =
        ["malformed_json_rate", "out_of_range_rate", "foreign_mechanism_rate", "stale_hash_rate", "oversight_rate"];
    let sampling = rates.map(|name| (name.to_string(), 0.0)).into_iter().chain([("seed".to_string(), 3.0)]).collect();
    let text = |value: &Value| value.as_str().unwrap_or_default().to_string();
    let messages = asked.body["messages"].as_array()?.iter();
    let request = Request {
        adapter_version: 1,
        slot: DrawSlot { lineage: "x".into(), epoch: 0, slot: asked.body["seed"].as_u64()? as u32, role, round: 0 },
        model: ModelSpec { kind: "scripted".into(), sampling, ..request(0, "").model },
        messages: messages.map(|m| Message { role: text(&m["role"]), text: text(&m["content"]).into() }).collect(),
        schema: schema(asked.body["response_format"]["json_schema"]["schema"].clone()),
    };
    let answer = Scripted.complete(&request).expect("the prompt is one that the rules can read");
    let mut said: Value = serde_json::from_slice(&chat(&String::from_utf8(answer.bytes).unwrap()).body).unwrap();
    said["usage"] = json!({"prompt_tokens": RULES.input, "completion_tokens": RULES.output});
    Some(Reply::json(said))
}

/// Tokens that each answer by rules is said to have taken.
const RULES: Tokens = Tokens::new(12_000, 1_000);

struct Place {
    dir: tempfile::TempDir,
}

impl Place {
    fn new() -> Place {
        Place { dir: tempfile::tempdir().unwrap() }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.dir.path().join(name)
    }

    fn evodrive(&self, args: &[&str], key: Option<&str>) -> Ran {
        let mut command = harness::evodrive();
        command.args(args).env_remove("EVODRIVE_TEST_KEY");
        if let Some(key) = key {
            command.env("EVODRIVE_TEST_KEY", key);
        }
        let ran = Ran::of(&mut command);
        assert!(!ran.stdout.contains(KEY) && !ran.stderr.contains(KEY), "{}", ran.stderr);
        ran
    }

    /// `run` or `record` with this experiment.
    fn carry_out(&self, command: &str, experiment: &str, key: Option<&str>) -> Ran {
        let path = self.path("experiment.toml");
        std::fs::write(&path, experiment).unwrap();
        let (out, cassette) = (self.path("runs"), self.path("cassette.jsonl"));
        let words = [command, path.to_str().unwrap(), "--no-report", "--jobs", "2", "--out", out.to_str().unwrap()];
        self.evodrive(&[words.as_slice(), &["--cassette", cassette.to_str().unwrap()]].concat(), key)
    }

    fn run_folder(&self) -> PathBuf {
        harness::folder_below(&self.path("runs"))
    }
}

fn files_below(dir: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(dir).unwrap().map(|e| e.unwrap().path());
    entries.flat_map(|path| if path.is_dir() { files_below(&path) } else { vec![path] }).collect()
}

#[test]
fn a_recorded_run_is_replayed_without_server_and_key_and_nothing_holds_the_key() {
    let server = Server::start(|_, asked| by_rules(asked));
    let place = Place::new();
    let recorded = place.carry_out("record", &experiment(&server, 3_000_000), Some(KEY));
    assert_eq!(recorded.code, 0, "{}", recorded.stderr);
    assert!(recorded.stdout.contains("openai_compatible (local, qwen2.5-coder-1.5b) as actor"), "{}", recorded.stdout);
    let asked = server.received().len();
    assert!(asked >= 4, "{asked}");
    let cassette = std::fs::read_to_string(place.path("cassette.jsonl")).unwrap();
    assert!(
        cassette.contains("exact-model-7")
            && !cassette.contains(&server.url)
            && !cassette.contains("EVODRIVE_TEST_KEY")
    );
    let printed = Cassette::load(&place.path("cassette.jsonl")).unwrap();
    assert_eq!(printed.exchanges().iter().filter(|e| e.metadata.is_some()).count(), asked);
    for file in files_below(place.dir.path()) {
        let bytes = std::fs::read(&file).unwrap();
        assert!(!bytes.windows(KEY.len()).any(|part| part == KEY.as_bytes()), "{}", file.display());
    }
    // Without its metadata the cassette gives the same results under another root: the run has sealed what the provider said.
    let mut bare = Cassette::new("bare");
    printed.exchanges().iter().for_each(|e| bare.push(&e.request(), e.bytes.clone()).unwrap());
    let elsewhere = Place::new();
    bare.save(&elsewhere.path("cassette.jsonl"), "bare").unwrap();
    let replayed = elsewhere.carry_out("run", &experiment(&server, 1), None);
    assert_eq!(replayed.code, 0, "{}", replayed.stderr);
    assert_ne!(replayed.root(), recorded.root());
    let result = |of: &Place| {
        let text = std::fs::read_to_string(of.run_folder().join("result.json")).unwrap();
        serde_json::from_str::<serde_json::Value>(&text).unwrap()["result"].clone()
    };
    assert_eq!(result(&elsewhere), result(&place));
    let again = place.evodrive(&["verify", place.run_folder().to_str().unwrap()], None);
    assert_eq!((again.code, again.root()), (0, recorded.root()), "{}", again.stderr);
    assert_eq!(server.received().len(), asked, "a replay asks nobody");
}

#[test]
fn a_recording_that_met_its_cap_goes_on_where_it_stopped() {
    let server = Server::start(|_, asked| by_rules(asked));
    let whole = Place::new();
    let expected = whole.carry_out("record", &experiment(&server, 3_000_000), Some(KEY));
    let asked = server.received();
    let in_one_go = asked.len();
    // Enough for the largest request behind one and a half others.
    let bound = asked.iter().map(|r| r.body.to_string().len() as u64).max().unwrap() / 2 + 64 + 1500;
    let cap = bound + (RULES.input + RULES.output) * 3 / 2;
    let place = Place::new();
    let stopped = place.carry_out("record", &experiment(&server, cap), Some(KEY));
    assert_eq!(stopped.code, 2, "{}", stopped.stderr);
    assert!(
        stopped.stderr.contains("spend cap reached") && stopped.stderr.contains("spend.tokens_max"),
        "{}",
        stopped.stderr
    );
    let before = server.received().len() - in_one_go;
    assert!((1..in_one_go).contains(&before), "{before} of {in_one_go}");
    assert!(!place.path("cassette.jsonl").exists());
    // `resume` reads the folder's own copy of the experiment.
    let folder = place.run_folder();
    let copy = std::fs::read_to_string(folder.join("experiment.toml")).unwrap();
    std::fs::write(
        folder.join("experiment.toml"),
        copy.replace(&format!("tokens_max = {cap}"), "tokens_max = 3000000"),
    )
    .unwrap();
    let resumed = place.evodrive(&["resume", folder.to_str().unwrap()], Some(KEY));
    assert_eq!((resumed.code, resumed.root()), (0, expected.root()), "{}", resumed.stderr);
    assert_eq!(server.received().len(), 2 * in_one_go, "nothing was asked twice");
    let cassettes = [&whole, &place].map(|p| std::fs::read(p.path("cassette.jsonl")).unwrap());
    assert!(cassettes[0] == cassettes[1], "the cassette is where it was asked for, and the same");
    let spent: Value = serde_json::from_slice(&std::fs::read(folder.join("spend.json")).unwrap()).unwrap();
    assert_eq!(
        spent["models"]["local"],
        json!({"input": RULES.input * in_one_go as u64, "output": RULES.output * in_one_go as u64})
    );
}

#[test]
fn a_model_that_answers_prose_leaves_declined_attempts_and_a_run_that_replays() {
    let server = Server::start(|_, _| Some(chat("Sure! Here is my patch: I would be more aggressive.")));
    let place = Place::new();
    let recorded = place.carry_out("record", &experiment(&server, 3_000_000), Some(KEY));
    assert_eq!(recorded.code, 0, "{}", recorded.stderr);
    assert!(
        recorded.stdout.contains("attempts: 4 declined, 0 invalid, 0 rejected, 0 evaluated"),
        "{}",
        recorded.stdout
    );
    let replayed = place.carry_out("run", &experiment(&server, 3_000_000), None);
    assert_eq!((replayed.code, replayed.root()), (0, recorded.root()), "{}", replayed.stderr);
}

#[test]
fn a_key_that_is_not_set_is_told_before_anything_is_asked() {
    let server = Server::start(|_, _| Some(chat("{}")));
    for key in [None, Some(" "), Some("two words")] {
        let ran = Place::new().carry_out("record", &experiment(&server, 3_000_000), key);
        assert_eq!(ran.code, 2, "{}", ran.stderr);
        assert!(ran.stderr.contains("models.local.client.api_key_env names"), "{}", ran.stderr);
    }
    assert_eq!(server.received().len(), 0);
}
