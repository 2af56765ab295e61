//! How a live model is reached, and what it may cost. It is part of every build, so that every build can read every
//! experiment file; only the feature `live` asks models. Nothing here belongs to a request's key, because it cannot
//! change what an answer means.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::{ModelSpec, ResponseFormat};

/// `kind` of a model behind the Chat Completions protocol: OpenAI, llama.cpp, vLLM, Ollama and many gateways.
pub const OPENAI_COMPATIBLE: &str = "openai_compatible";
/// `kind` of a model behind Anthropic's Messages API.
pub const ANTHROPIC: &str = "anthropic";

/// The kind of the scripted model, which rules of this program answer; they are in the room `scripted`.
pub const SCRIPTED: &str = "scripted";
/// The scripted model's `model` until now, and without the rule that pressure needs a guard: what a language model proposes is often
/// better where that rule turns it away (docs/ABLATIONS.md).
pub const SCRIPTED_MODELS: [&str; 2] = ["scripted-1", "scripted-2"];
/// `kind` of a model behind a folder of requests and replies ([`exchange`](super::exchange)).
pub const EXCHANGE: &str = "exchange";
/// `kind` of a model that is a program ([`command`](super::command)).
pub const COMMAND: &str = "command";
/// `kind` of several models, of which one is drawn for each slot of a role ([`Drawn`](super::Drawn)).
pub const DRAWN: &str = "drawn";
const KINDS: [&str; 6] = [SCRIPTED, OPENAI_COMPATIBLE, ANTHROPIC, EXCHANGE, COMMAND, DRAWN];
const OPENAI_SAMPLING: [&str; 9] = [
    "temperature",
    "top_p",
    "top_k",
    "min_p",
    "max_tokens",
    "max_completion_tokens",
    "seed",
    "frequency_penalty",
    "presence_penalty",
];
const ANTHROPIC_SAMPLING: [&str; 4] = ["temperature", "top_p", "top_k", "max_tokens"];
/// Fields of a body that the client writes itself.
const RESERVED: [&str; 9] =
    ["model", "messages", "system", "stream", "response_format", "tools", "tool_choice", "n", "stream_options"];
const TOKENS_MAX: f64 = 1_000_000.0;
/// The largest range in which every whole number is an f64.
const WHOLE_MAX: f64 = 9_007_199_254_740_992.0;

/// `[models.<name>.client]` of a live model.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ClientOptions {
    /// `http://127.0.0.1:8080/v1`, `https://api.anthropic.com`: the address before `/chat/completions` or
    /// `/v1/messages`.
    pub base_url: String,
    /// NAME of the environment variable that holds the key; none where the server wants none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub api_key_env: Option<String>,
    /// Parameters behind `?` in the address, as Azure's `api-version`; never a key.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub query: BTreeMap<String, String>,
    /// Headers for a gateway; never a key.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub headers: BTreeMap<String, String>,
    /// The header that carries the bare key, as Azure's `api-key`, in place of the protocol's own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub api_key_header: Option<String>,
    /// Limit for one attempt, from connecting to the last byte, in seconds.
    pub timeout_s: u64,
    /// Attempts for one request, the first included.
    pub attempts_max: u32,
    /// Longest wait between two attempts, in seconds. A server that asks for more ends the run.
    pub wait_s_max: u64,
    /// Treatment of refusals, empty answers and answers cut at the limit of tokens.
    pub incomplete_replies: IncompleteReplies,
    /// US dollars per million tokens of prompt; 0 for a model of your own.
    pub input_usd_per_million: f64,
    /// US dollars per million tokens of answer.
    pub output_usd_per_million: f64,
    /// US dollars per million tokens of prompt that the provider read from its cache; the price of a prompt where it is not here.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cached_input_usd_per_million: Option<f64>,
    /// US dollars per million tokens of prompt that it wrote into its cache; the price of a prompt where it is not here.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cache_write_usd_per_million: Option<f64>,
}

impl ClientOptions {
    /// A server that wants no key and no money, asked three times for 30 s each.
    pub fn at(base_url: &str) -> ClientOptions {
        ClientOptions {
            base_url: base_url.into(),
            api_key_env: None,
            query: BTreeMap::new(),
            headers: BTreeMap::new(),
            api_key_header: None,
            timeout_s: 30,
            attempts_max: 3,
            wait_s_max: 60,
            incomplete_replies: IncompleteReplies::Stop,
            input_usd_per_million: 0.0,
            output_usd_per_million: 0.0,
            cached_input_usd_per_million: None,
            cache_write_usd_per_million: None,
        }
    }
}

/// Treatment of an answer that is a refusal, empty or cut.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum IncompleteReplies {
    /// The recording stops with an error that says which it was.
    Stop,
    /// The text is recorded and read like every reply. It is mostly unusable.
    Keep,
}

/// `[spend]`: what all live models of an experiment may use together, over all recordings in its run folder.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SpendCap {
    /// US dollars, by the prices of the models.
    pub usd_max: f64,
    /// Tokens of prompts and answers.
    pub tokens_max: u64,
}

impl SpendCap {
    /// Refuses caps that are no amounts.
    pub fn check(&self) -> Result<(), String> {
        not_negative("spend.usd_max", self.usd_max)
    }
}

/// Returns `true` if asking this kind needs the network.
pub fn is_live(kind: &str) -> bool {
    kind == OPENAI_COMPATIBLE || kind == ANTHROPIC
}

/// Refuses unusable settings of a model, with the place, what was found and what is expected.
pub fn check(spec: &ModelSpec, client: Option<&ClientOptions>) -> Result<(), String> {
    let at = format!("models.{}", spec.name);
    if !KINDS.contains(&spec.kind.as_str()) {
        return Err(format!("{at}.kind is {:?}, expected one of {}", spec.kind, KINDS.join(", ")));
    }
    if !is_live(&spec.kind) {
        let extra = [
            ("client", client.is_some()),
            ("response_format", spec.response_format.is_some()),
            ("body", !spec.body.is_empty()),
        ];
        return match extra.iter().find(|(_, present)| *present) {
            Some((field, _)) => Err(format!("{at}.{field} belongs to live models, but the kind is {:?}", spec.kind)),
            None => Ok(()),
        };
    }
    check_format(spec, &at)?;
    check_sampling(spec, &at)?;
    if let Some(field) = spec.body.keys().find(|field| is_reserved(field)) {
        return Err(format!(
            "{at}.body.{field} is written by the client; sampling parameters stand under {at}.sampling"
        ));
    }
    let client =
        client.ok_or_else(|| format!("{at} needs a table [{at}.client]: where the model is and what it costs"))?;
    check_client(client, &format!("{at}.client"))
}

fn is_reserved(field: &str) -> bool {
    RESERVED.contains(&field) || OPENAI_SAMPLING.contains(&field)
}

fn check_format(spec: &ModelSpec, at: &str) -> Result<(), String> {
    use ResponseFormat::{JsonObject, JsonObjectSchema, JsonSchema, JsonSchemaClosed, JsonSchemaStrict, None, Tool};
    let (fits, expected) = match spec.kind.as_str() {
        ANTHROPIC => (matches!(spec.response_format, Some(Tool | None)), "tool or none"),
        _ => (
            matches!(
                spec.response_format,
                Some(JsonSchema | JsonSchemaStrict | JsonSchemaClosed | JsonObjectSchema | JsonObject | None)
            ),
            "json_schema, json_schema_strict, json_schema_closed, json_object_schema, json_object or none",
        ),
    };
    if fits { Ok(()) } else { Err(format!("{at}.response_format of this kind is one of: {expected}")) }
}

fn check_sampling(spec: &ModelSpec, at: &str) -> Result<(), String> {
    let known: &[&str] = if spec.kind == ANTHROPIC { &ANTHROPIC_SAMPLING } else { &OPENAI_SAMPLING };
    if let Some(name) = spec.sampling.keys().find(|name| !known.contains(&name.as_str())) {
        return Err(format!(
            "{at}.sampling.{name} is unknown for this kind; there are {}; other fields of a request stand under {at}.body",
            known.join(", ")
        ));
    }
    let whole = |name: &str, least: f64, most: f64| match spec.sampling.get(name) {
        Some(&x) if !(least..=most).contains(&x) || x.fract() != 0.0 => {
            Err(format!("{at}.sampling.{name} is {x}, expected a whole number from {least} to {most}"))
        }
        _ => Ok(()),
    };
    whole("max_tokens", 1.0, TOKENS_MAX)?;
    whole("max_completion_tokens", 1.0, TOKENS_MAX)?;
    whole("top_k", 0.0, WHOLE_MAX)?;
    whole("seed", 0.0, WHOLE_MAX)?;
    match (spec.sampling.contains_key("max_tokens"), spec.sampling.contains_key("max_completion_tokens")) {
        (true, true) => {
            Err(format!("{at}.sampling names max_tokens and max_completion_tokens; name the one that the server knows"))
        }
        (false, false) => Err(format!("{at}.sampling.max_tokens is missing: without a limit no cost is bounded")),
        _ => Ok(()),
    }
}

fn check_client(client: &ClientOptions, at: &str) -> Result<(), String> {
    // A key may have been pasted into the wrong field, so the message does not repeat the value.
    let url = &client.base_url;
    let rest = url.strip_prefix("https://").or_else(|| url.strip_prefix("http://"));
    let legal = |c: char| c.is_ascii_graphic() && !"@?#\\\"<>".contains(c);
    let Some(rest) = rest.filter(|rest| rest.chars().all(legal) && !rest.is_empty() && !rest.starts_with('/')) else {
        return Err(format!(
            "{at}.base_url must be http:// or https://, a host and a path, without user, password or query \
             (what stands behind `?` goes into {at}.query)"
        ));
    };
    check_own_parts(client, at)?;
    if let Some(name) = &client.api_key_env {
        let fits = |c: char| c.is_ascii_alphanumeric() || c == '_';
        if name.is_empty() || name.starts_with(|c: char| c.is_ascii_digit()) || !name.chars().all(fits) {
            return Err(format!(
                "{at}.api_key_env must be the NAME of an environment variable (letters, digits, _), never the key itself"
            ));
        }
        if url.starts_with("http://") && !is_loopback(rest) {
            return Err(format!(
                "{at}.base_url would carry the api key in clear over the network; use https:// or a tunnel"
            ));
        }
    }
    let within = |field: &str, value: u64, least: u64, most: u64| {
        if (least..=most).contains(&value) {
            Ok(())
        } else {
            Err(format!("{at}.{field} is {value}, expected {least} to {most}"))
        }
    };
    within("timeout_s", client.timeout_s, 1, 3600)?;
    within("attempts_max", u64::from(client.attempts_max), 1, 20)?;
    within("wait_s_max", client.wait_s_max, 0, 3600)?;
    not_negative(&format!("{at}.input_usd_per_million"), client.input_usd_per_million)?;
    not_negative(&format!("{at}.output_usd_per_million"), client.output_usd_per_million)?;
    for (field, price) in [
        ("cached_input_usd_per_million", client.cached_input_usd_per_million),
        ("cache_write_usd_per_million", client.cache_write_usd_per_million),
    ] {
        not_negative(&format!("{at}.{field}"), price.unwrap_or(0.0))?;
    }
    Ok(())
}

/// Words in the name of what may be a key.
const KEY_WORDS: [&str; 8] = ["key", "token", "secret", "auth", "password", "sig", "cookie", "credential"];

/// Query and headers: of characters that need no escaping, and with no key in them.
fn check_own_parts(client: &ClientOptions, at: &str) -> Result<(), String> {
    let is_word = |text: &str, also: &str| {
        !text.is_empty() && text.chars().all(|c| c.is_ascii_alphanumeric() || "-._~".contains(c) || also.contains(c))
    };
    for (part, fields, also) in [("query", &client.query, ""), ("headers", &client.headers, " /:;,=+()@*")] {
        for (name, value) in fields {
            let small = name.to_ascii_lowercase();
            // Neither name nor value is repeated: one of them may be a key.
            if KEY_WORDS.iter().any(|word| small.contains(word)) {
                return Err(format!(
                    "{at}.{part} names what may be a key; a key stands in the variable of {at}.api_key_env alone, \
                     and {at}.api_key_header says which header carries it"
                ));
            }
            if !is_word(name, "")
                || !is_word(value, also)
                || ["content-type", "content-length", "host"].contains(&small.as_str())
            {
                return Err(format!(
                    "{at}.{part}: a name has letters, digits, -, ., _ or ~, a value too{}, and the client's own headers stay",
                    if also.is_empty() { "" } else { ", and blanks and / : ; , = + ( ) @ *" }
                ));
            }
        }
    }
    match &client.api_key_header {
        Some(name) if !is_word(name, "") => Err(format!("{at}.api_key_header must be the name of a header")),
        Some(_) if client.api_key_env.is_none() => Err(format!("{at}.api_key_header needs {at}.api_key_env")),
        _ => Ok(()),
    }
}

fn not_negative(place: &str, value: f64) -> Result<(), String> {
    if value.is_finite() && value >= 0.0 { Ok(()) } else { Err(format!("{place} is {value}, expected 0 or more")) }
}

/// Returns `true` if the authority at the start of `rest` (an address without its scheme) is this machine.
pub fn is_loopback(rest: &str) -> bool {
    let authority = rest.split('/').next().unwrap_or("");
    if let Some(port) = authority.strip_prefix("[::1]") {
        return port.is_empty() || port.starts_with(':');
    }
    let host = authority.split(':').next().unwrap_or("");
    let numeric = host.chars().all(|c| c.is_ascii_digit() || c == '.');
    host == "localhost" || (host.starts_with("127.") && numeric)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn live(kind: &str) -> (ModelSpec, ClientOptions) {
        let format = if kind == ANTHROPIC { ResponseFormat::Tool } else { ResponseFormat::JsonSchema };
        let spec = ModelSpec {
            name: "m".into(),
            kind: kind.into(),
            model: "x".into(),
            sampling: [("max_tokens".to_string(), 100.0)].into(),
            response_format: Some(format),
            body: Default::default(),
            here: Default::default(),
        };
        let client = ClientOptions { api_key_env: Some("KEY".into()), ..ClientOptions::at("https://example.org/v1") };
        (spec, client)
    }

    fn problem(change: impl Fn(&mut ModelSpec, &mut ClientOptions)) -> String {
        let (mut spec, mut client) = live(OPENAI_COMPATIBLE);
        change(&mut spec, &mut client);
        check(&spec, Some(&client)).unwrap_err()
    }

    #[test]
    fn whole_settings_of_both_protocols_are_accepted() {
        for kind in [OPENAI_COMPATIBLE, ANTHROPIC] {
            let (spec, client) = live(kind);
            assert_eq!(check(&spec, Some(&client)), Ok(()));
        }
    }

    #[test]
    fn each_setting_that_cannot_work_is_named_with_its_place() {
        assert!(
            problem(|s, _| s.kind = "openai".into()).contains("models.m.kind is \"openai\", expected one of scripted")
        );
        assert!(problem(|s, _| s.response_format = Some(ResponseFormat::Tool)).contains("json_object_schema"));
        assert!(problem(|s, _| s.sampling.clear()).contains("sampling.max_tokens is missing"));
        assert!(
            problem(|s, _| s.sampling.extend([("max_tokens".to_string(), 0.5)])).contains("is 0.5, expected a whole")
        );
        assert!(
            problem(|s, _| s.sampling.extend([("temprature".to_string(), 0.5)]))
                .contains("sampling.temprature is unknown")
        );
        assert!(problem(|s, _| drop(s.body.insert("stream".into(), true.into()))).contains("body.stream"));
        assert!(problem(|_, c| c.timeout_s = 0).contains("client.timeout_s is 0"));
        assert!(problem(|_, c| c.attempts_max = 21).contains("client.attempts_max is 21"));
        assert!(problem(|_, c| c.input_usd_per_million = -1.0).contains("input_usd_per_million is -1"));
        let (spec, _) = live(ANTHROPIC);
        assert!(check(&spec, None).unwrap_err().contains("[models.m.client]"));
        let (mut spec, client) = live(ANTHROPIC);
        spec.sampling.insert("seed".into(), 1.0);
        assert!(check(&spec, Some(&client)).unwrap_err().contains("sampling.seed is unknown"));
    }

    #[test]
    fn a_key_in_the_wrong_place_is_refused_and_not_repeated() {
        for text in [
            problem(|_, c| c.api_key_env = Some("sk-secret".into())),
            problem(|_, c| c.base_url = "https://sk-secret@example.org".into()),
            problem(|_, c| c.base_url = "https://example.org/v1?key=sk-secret".into()),
            problem(|_, c| drop(c.query.insert("key".into(), "sk-secret".into()))),
            problem(|_, c| drop(c.headers.insert("X-Auth".into(), "sk-secret".into()))),
        ] {
            assert!(!text.contains("secret"), "{text}");
        }
    }

    #[test]
    fn a_query_and_headers_hold_plain_words_and_a_key_may_have_a_header_of_its_own() {
        let (spec, mut client) = live(OPENAI_COMPATIBLE);
        client.query.insert("api-version".into(), "2024-10-21".into());
        client.headers.insert("X-Title".into(), "EvoDrive (test)".into());
        client.api_key_header = Some("api-key".into());
        assert_eq!(check(&spec, Some(&client)), Ok(()));
        assert!(problem(|_, c| drop(c.query.insert("a".into(), "1&b=2".into()))).contains("client.query"));
        assert!(problem(|_, c| drop(c.headers.insert("x\r\ny".into(), "1".into()))).contains("client.headers"));
        assert!(problem(|_, c| c.api_key_header = Some("a b".into())).contains("api_key_header must be"));
        assert!(problem(|_, c| (c.api_key_env, c.api_key_header) = (None, Some("api-key".into()))).contains("needs"));
    }

    #[test]
    fn a_key_goes_over_plain_http_to_this_machine_only() {
        for (url, fits) in [
            ("http://127.0.0.1:8080/v1", true),
            ("http://localhost/v1", true),
            ("http://[::1]:8080", true),
            ("http://127.0.0.1.example.org/v1", false),
            ("http://localhost.example.org", false),
            ("http://192.168.0.7:8000/v1", false),
        ] {
            let (spec, mut client) = live(OPENAI_COMPATIBLE);
            client.base_url = url.into();
            assert_eq!(check(&spec, Some(&client)).is_ok(), fits, "{url}");
            client.api_key_env = None;
            assert_eq!(check(&spec, Some(&client)), Ok(()), "{url}");
        }
    }

    #[test]
    fn a_scripted_model_takes_no_settings_of_live_ones() {
        let (mut spec, client) = live(OPENAI_COMPATIBLE);
        spec.kind = "scripted".into();
        spec.response_format = None;
        assert!(check(&spec, Some(&client)).unwrap_err().contains("models.m.client belongs to live models"));
        assert_eq!(check(&spec, None), Ok(()));
    }
}
