//! Advice on what to change, if a server's words or the shape of its answer tell the cause.

use super::protocol::Aside;
use crate::llm::{ClientOptions, Request, ResponseFormat};

/// Bytes of a prompt that are taken for a token where a context is advised.
const BYTES_A_TOKEN: u64 = 3;

/// The context that a request needs, and how common servers are given it. `answer` is the most tokens of an answer.
pub fn context(request: &Request, answer: u64) -> String {
    let tokens = (request.prompt_bytes() / BYTES_A_TOKEN + answer.min(1 << 20)).next_power_of_two();
    format!(
        "a context of {tokens} tokens (llama.cpp: -c {tokens}; Ollama: OLLAMA_CONTEXT_LENGTH={tokens}; vLLM: --max-model-len {tokens})"
    )
}

/// Says where an answer without content holds text, and what to do.
pub fn aside(aside: Aside) -> String {
    let Aside { field, is_reply } = aside;
    match (is_reply, field) {
        (true, _) => format!(
            ": the reply stands in its field `{field}`, which is not read; let the server leave replies in `content`, without a \
             parser for reasoning or tools, or with thinking off"
        ),
        (false, "tool_calls" | "function_call") => {
            format!(": it calls a tool (`{field}`), and none was offered; take tools out of the server's settings")
        }
        _ => format!(
            ": its model only thought (`{field}`); turn thinking off, or leave more of max_tokens for the reply"
        ),
    }
}

/// Returns what to change, if what was `said` tells it. `answer` is the most tokens of an answer.
pub fn remedy(request: &Request, options: &ClientOptions, answer: u64, said: &str) -> Option<String> {
    let model = &request.model;
    let name = &model.name;
    let said = said.to_ascii_lowercase();
    let has = |words: &[&str]| words.iter().any(|word| said.contains(word));
    if has(&["wait_s_max is"]) {
        return Some(format!("raise wait_s_max in [models.{name}.client] to wait that long"));
    }
    if has(&["context size", "context length", "context_length", "context window", "maximum context", "exceed_context"])
    {
        return Some(format!(
            "give the server {}, or lower max_tokens in [models.{name}.sampling]",
            context(request, answer)
        ));
    }
    if said.starts_with("http 402")
        || has(&["insufficient_quota", "current quota", "billing", "insufficient balance", "credit"])
    {
        return Some(
            "see your account at the provider, then repeat the command: what was answered is not asked again".into(),
        );
    }
    if has(&["max_completion_tokens"]) && model.sampling.contains_key("max_tokens") {
        return Some(format!(
            "name the limit max_completion_tokens in place of max_tokens in [models.{name}.sampling]"
        ));
    }
    if has(&["unsupported", "not support", "unknown", "unrecognized", "not permitted", "unexpected", "deprecated"]) {
        let parts = [("sampling", model.sampling.keys().collect::<Vec<_>>()), ("body", model.body.keys().collect())];
        for (part, field) in parts.into_iter().flat_map(|(part, fields)| fields.into_iter().map(move |f| (part, f))) {
            if names(&said, field) {
                return Some(format!(
                    "leave {field} out of [models.{name}.{part}], or give it a value that the server takes"
                ));
            }
        }
    }
    let held_to_schema = model.response_format.is_some_and(|format| format != ResponseFormat::None);
    if held_to_schema && has(&["grammar", "schema", "response_format", "guided", "structured output", "tool"]) {
        return Some(format!(
            "if the server cannot hold a reply to the schema, set another response_format in [models.{name}] \
             (json_object, or none)"
        ));
    }
    match said.get(..8)? {
        "http 401" | "http 403" => Some(match &options.api_key_env {
            Some(variable) => format!("see whether the variable {variable} holds a key that may use this model"),
            None => format!("name the variable with your key as api_key_env in [models.{name}.client]"),
        }),
        "http 404" => Some(format!(
            "see whether base_url is right (often it ends with /v1) and the server has the model {:?}",
            model.model
        )),
        "http 301" | "http 308" => Some("set base_url to where the server is now".into()),
        _ => None,
    }
}

/// Returns `true` if a text names a field, as a word of its own.
fn names(said: &str, field: &str) -> bool {
    let is_part = |c: char| c.is_ascii_alphanumeric() || c == '_';
    said.split(|c| !is_part(c)).any(|word| word == field)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::llm::{DrawSlot, Message, ModelSpec};

    fn request(format: ResponseFormat) -> Request {
        Request {
            adapter_version: 1,
            slot: DrawSlot { lineage: "a".into(), epoch: 0, slot: 0, role: "actor".into(), round: 0 },
            model: ModelSpec {
                name: "local".into(),
                kind: "openai_compatible".into(),
                model: "m-1".into(),
                sampling: [("max_tokens".to_string(), 100.0), ("temperature".to_string(), 1.0)].into(),
                response_format: Some(format),
                body: [("reasoning_effort".to_string(), "low".into())].into(),
                here: Default::default(),
            },
            messages: vec![Message { role: "user".into(), text: "word ".repeat(600).as_str().into() }],
            schema: crate::llm::Schema::new(serde_json::json!({})).unwrap(),
        }
    }

    #[test]
    fn each_cause_has_its_own_advice_and_an_unknown_one_has_none() {
        let request = request(ResponseFormat::JsonSchema);
        let options = ClientOptions::at("http://localhost");
        let advice = |said: &str| remedy(&request, &options, 100, said).unwrap_or_default();
        for (said, words) in [
            ("Failed to initialize samplers: failed to parse grammar", "another response_format in [models.local]"),
            (
                "HTTP 400: request (9412 tokens) exceeds the available context size (4096 tokens)",
                "a context of 2048 tokens",
            ),
            ("HTTP 429: You exceeded your current quota, please check your plan", "your account"),
            ("HTTP 402: pay", "your account"),
            (
                "HTTP 400: 'max_tokens' is not supported with this model. Use 'max_completion_tokens' instead.",
                "name the limit max_completion_tokens",
            ),
            (
                "HTTP 400: Unsupported value: 'temperature' does not support 1",
                "leave temperature out of [models.local.sampling]",
            ),
            ("HTTP 400: unknown field reasoning_effort", "leave reasoning_effort out of [models.local.body]"),
            ("HTTP 401: Incorrect API key provided", "api_key_env in [models.local.client]"),
            ("HTTP 404: no such route", "the model \"m-1\""),
            ("HTTP 308 redirects to https://example.org, and no redirect is followed", "set base_url"),
            ("HTTP 429: slow; it asks to wait 61 s, wait_s_max is 60", "raise wait_s_max"),
        ] {
            assert!(advice(said).contains(words), "{said}: {}", advice(said));
        }
        assert_eq!(advice("HTTP 400: bad luck"), "");
        let with_key = ClientOptions { api_key_env: Some("MY_KEY".into()), ..options.clone() };
        assert!(remedy(&request, &with_key, 100, "HTTP 403: no").is_some_and(|advice| advice.contains("MY_KEY")));
    }

    #[test]
    fn a_model_that_is_not_held_to_a_schema_is_not_advised_about_one() {
        let request = request(ResponseFormat::None);
        assert_eq!(remedy(&request, &ClientOptions::at("http://localhost"), 100, "failed to parse grammar"), None);
    }
}
