//! Chat Completions, as OpenAI, llama.cpp, vLLM, Ollama and many gateways speak it.

use serde_json::{Map, Value, json};

use super::protocol::{End, Said, aside, count_at, put_sampling, reply_name, text_at};
use super::wire::{compilable, strict};
use crate::llm::{Metadata, ModelError, Request, ResponseFormat};

pub fn body(request: &Request) -> Result<Map<String, Value>, ModelError> {
    let message =
        |role: &str, text: &str| json!({"role": if role == "system" { role } else { "user" }, "content": text});
    let mut body = Map::new();
    body.insert("model".into(), request.model.model.clone().into());
    body.insert("messages".into(), request.messages.iter().map(|m| message(&m.role, &m.text)).collect());
    body.insert("stream".into(), false.into());
    put_sampling(&mut body, request)?;
    let format = match request.model.response_format {
        Some(ResponseFormat::JsonSchema | ResponseFormat::JsonSchemaClosed) => {
            // Not strict, because providers support strict mode only for simpler schemas. Every reply is checked again
            // anyway.
            let schema = json!({"name": reply_name(request), "strict": false, "schema": compilable(&request.schema)});
            Some(json!({"type": "json_schema", "json_schema": schema}))
        }
        Some(ResponseFormat::JsonSchemaStrict) => {
            let of_strict_form = strict(&request.schema);
            let is_strict = of_strict_form.is_some();
            let schema = of_strict_form.unwrap_or_else(|| compilable(&request.schema));
            let schema = json!({"name": reply_name(request), "strict": is_strict, "schema": schema});
            Some(json!({"type": "json_schema", "json_schema": schema}))
        }
        Some(ResponseFormat::JsonObjectSchema) => {
            Some(json!({"type": "json_object", "schema": compilable(&request.schema)}))
        }
        Some(ResponseFormat::JsonObject) => Some(json!({"type": "json_object"})),
        Some(ResponseFormat::None | ResponseFormat::Tool) | None => None,
    };
    if let Some(format) = format {
        body.insert("response_format".into(), format);
    }
    Ok(body)
}

pub fn read(answer: &Value) -> Result<Said, String> {
    let Some(choice) = answer.pointer("/choices/0") else { return without_choices(answer) };
    let message = choice.get("message").filter(|m| m.is_object()).ok_or("no message in choices[0]")?;
    let (content, refused) = content(message.get("content").unwrap_or(&Value::Null))?;
    let finish_reason = text_at(choice, "/finish_reason");
    let refusal = text_at(message, "/refusal").or(refused).filter(|text| !text.is_empty());
    let end = if refusal.is_some() { End::Declined } else { End::of(finish_reason.as_deref(), &content) };
    let aside = aside(message, &content);
    Ok(Said { text: refusal.unwrap_or(content).into_bytes(), end, aside, metadata: metadata(answer, finish_reason) })
}

/// Fields of `usage` for the tokens of a prompt, of those read from a cache, of those written into one, and of the answer: OpenAI, vLLM,
/// DeepSeek, Moonshot, OpenRouter, LiteLLM, and gateways that keep the names of Anthropic's API.
const PROMPT: [&str; 2] = ["prompt_tokens", "input_tokens"];
const CACHED: [&str; 6] = [
    "prompt_tokens_details/cached_tokens",
    "input_tokens_details/cached_tokens",
    "prompt_cache_hit_tokens",
    "cached_tokens",
    "cache_read_input_tokens",
    "cache_read_tokens",
];
const WRITTEN: [&str; 6] = [
    "prompt_tokens_details/cache_write_tokens",
    "prompt_tokens_details/cache_creation_tokens",
    "prompt_tokens_details/cached_creation_tokens",
    "cache_creation_input_tokens",
    "cache_creation_tokens",
    "cache_write_tokens",
];
const OUTPUT: [&str; 2] = ["completion_tokens", "output_tokens"];

fn metadata(answer: &Value, finish_reason: Option<String>) -> Metadata {
    // Some report a count twice, once as zero.
    let count = |fields: &[&str]| fields.iter().filter_map(|field| count_at(answer, &format!("/usage/{field}"))).max();
    let (cached, written, output) = (count(&CACHED), count(&WRITTEN), count(&OUTPUT));
    let input = count(&PROMPT).map(|prompt| {
        let total = count(&["total_tokens"]).zip(output).map(|(total, output)| total.saturating_sub(output));
        whole_prompt(prompt, cached.unwrap_or(0), written.unwrap_or(0), total)
    });
    let missed = count(&["prompt_cache_miss_tokens"]);
    Metadata {
        model: text_at(answer, "/model").map(|said| without_folder(&said).to_string()).unwrap_or_default(),
        finish_reason,
        input_tokens: input.max(missed.zip(cached).map(|(missed, cached)| missed.saturating_add(cached))),
        cached_input_tokens: cached,
        cache_write_tokens: written,
        output_tokens: output,
        fingerprint: text_at(answer, "/system_fingerprint"),
        tries: Vec::new(),
    }
}

/// Tokens of a prompt, those of caches included. The protocol counts them in `prompt`; some gateways leave out the ones that were read,
/// written, or both. `total` (the prompt's share of `total_tokens`) tells which; without it they were left out where they are more than
/// the whole.
fn whole_prompt(prompt: u64, cached: u64, written: u64, total: Option<u64>) -> u64 {
    let of_caches = cached.saturating_add(written);
    let with = |left_out: u64| prompt.saturating_add(left_out);
    let fits = |input: &u64| *input >= of_caches && Some(*input) == total;
    let fitting = [0, cached, written, of_caches].into_iter().map(with).find(fits);
    fitting.unwrap_or(if of_caches > prompt { with(of_caches) } else { prompt })
}

/// An answer without a choice: Azure and Gemini say so where a filter let no answer through.
fn without_choices(answer: &Value) -> Result<Said, String> {
    let is_filtered =
        ["prompt_filter_results", "prompt_feedback", "promptFeedback"].iter().any(|f| answer.get(f).is_some());
    match answer.get("choices") {
        Some(Value::Array(_)) if is_filtered => {
            let metadata = metadata(answer, Some("content_filter".into()));
            Ok(Said { text: vec![], end: End::Declined, aside: None, metadata })
        }
        Some(Value::Array(_)) => Err("no choices[0]: `choices` is empty".into()),
        Some(Value::Null) => Err("no choices[0]: `choices` is null".into()),
        _ => Err("no choices[0]".into()),
    }
}

/// The text of a content, and a refusal in it: a text, or a list of parts as Mistral and others send it. What a model thought
/// before it answered is no part of the reply.
fn content(content: &Value) -> Result<(String, Option<String>), String> {
    let parts = match content {
        Value::Null => return Ok((String::new(), None)),
        Value::String(text) => return Ok((text.clone(), None)),
        Value::Array(parts) => parts,
        _ => return Err("choices[0].message.content is not a text".into()),
    };
    let (mut text, mut refusal) = (String::new(), None);
    for (i, part) in parts.iter().enumerate() {
        let kind = part.get("type").and_then(Value::as_str);
        match (part, kind) {
            (Value::String(words), _) => text.push_str(words),
            (_, Some("thinking" | "redacted_thinking" | "reasoning" | "reference")) => {}
            (_, Some("refusal")) => refusal = text_at(part, "/refusal"),
            _ => match part.get("text").and_then(Value::as_str) {
                Some(words) => text.push_str(words),
                None => return Err(format!("choices[0].message.content[{i}] holds no text")),
            },
        }
    }
    Ok((text, refusal))
}

/// A model's name without the folder of its file. llama.cpp's server, unless told an alias, names the model by the path of its
/// file, and a path of somebody's machine does not belong into a recording. `publisher/model` stays as it is.
fn without_folder(said: &str) -> &str {
    let is_path = said.starts_with(['/', '\\', '~', '.']) || said.get(1..3) == Some(":\\");
    if is_path { said.rsplit(['/', '\\']).next().unwrap_or_default() } else { said }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn end(choice: Value) -> End {
        read(&json!({"choices": [choice]})).unwrap().end
    }

    #[test]
    fn each_end_of_an_answer_is_told_apart() {
        assert_eq!(end(json!({"finish_reason": "stop", "message": {"content": "{}"}})), End::Whole);
        assert_eq!(end(json!({"finish_reason": "length", "message": {"content": "{"}})), End::Truncated);
        assert_eq!(end(json!({"finish_reason": "length", "message": {"content": null}})), End::Truncated);
        assert_eq!(end(json!({"finish_reason": "stop", "message": {"content": " \n"}})), End::Empty);
        assert_eq!(end(json!({"finish_reason": "content_filter", "message": {"content": ""}})), End::Declined);
        assert_eq!(end(json!({"finish_reason": "max_time", "message": {"content": "{}"}})), End::Unknown);
        let refused = read(&json!({"choices": [{"message": {"content": null, "refusal": "I will not."}}]})).unwrap();
        assert_eq!((refused.end, refused.text), (End::Declined, b"I will not.".to_vec()));
    }

    #[test]
    fn tokens_that_came_from_a_cache_are_told_apart() {
        let cached = |usage: Value| {
            let choice = json!({"finish_reason": "stop", "message": {"content": "{}"}});
            let metadata = read(&json!({"choices": [choice], "usage": usage})).unwrap().metadata;
            (metadata.input_tokens, metadata.cached_input_tokens)
        };
        let openai = json!({"prompt_tokens": 90.0, "prompt_tokens_details": {"cached_tokens": 64}});
        assert_eq!(cached(openai), (Some(90), Some(64)));
        assert_eq!(cached(json!({"prompt_tokens": 90, "prompt_cache_hit_tokens": 5})), (Some(90), Some(5)));
        assert_eq!(cached(json!({"prompt_tokens": 90})), (Some(90), None));
    }

    #[test]
    fn a_prompt_counts_whole_whether_its_cached_tokens_are_counted_in_beside_or_under_other_names() {
        let counted = |usage: Value| {
            let choice = json!({"finish_reason": "stop", "message": {"content": "{}"}});
            let metadata = read(&json!({"choices": [choice], "usage": usage})).unwrap().metadata;
            [metadata.input_tokens, metadata.cached_input_tokens, metadata.cache_write_tokens]
                .map(Option::unwrap_or_default)
        };
        let of = |cached: u64| json!({"cached_tokens": cached});
        for (usage, expected) in [
            (json!({"prompt_tokens": 12, "prompt_tokens_details": of(8988)}), [9000, 8988, 0]),
            (
                json!({"prompt_tokens": 12, "prompt_tokens_details": of(0), "cache_read_input_tokens": 8988}),
                [9000, 8988, 0],
            ),
            (
                json!({"prompt_tokens": 12, "cache_creation_input_tokens": 8000, "cache_read_input_tokens": 988}),
                [9000, 988, 8000],
            ),
            (
                json!({"prompt_tokens": 9000, "prompt_tokens_details": {"cached_tokens": 988, "cache_write_tokens": 8000}}),
                [9000, 988, 8000],
            ),
            (json!({"input_tokens": 9000, "input_tokens_details": of(8000), "output_tokens": 3}), [9000, 8000, 0]),
            (json!({"prompt_tokens": 9000, "cached_tokens": 8000}), [9000, 8000, 0]),
            (json!({"prompt_cache_hit_tokens": 8000, "prompt_cache_miss_tokens": 1000}), [9000, 8000, 0]),
            // The total decides where the parts leave it open: left out, counted in, only the written ones left out.
            (
                json!({"prompt_tokens": 5000, "cached_tokens": 4000, "completion_tokens": 7, "total_tokens": 9007}),
                [9000, 4000, 0],
            ),
            (
                json!({"prompt_tokens": 5000, "cached_tokens": 4000, "completion_tokens": 7, "total_tokens": 5007}),
                [5000, 4000, 0],
            ),
            (
                json!({"prompt_tokens": 4000, "cached_tokens": 3000, "cache_write_tokens": 5000, "completion_tokens": 7,
                "total_tokens": 9007}),
                [9000, 3000, 5000],
            ),
            // A total that leaves them out as well says nothing.
            (
                json!({"prompt_tokens": 12, "cached_tokens": 8988, "completion_tokens": 7, "total_tokens": 19}),
                [9000, 8988, 0],
            ),
        ] {
            assert_eq!(counted(usage.clone()), expected, "{usage}");
        }
    }

    #[test]
    fn what_stands_beside_an_empty_content_is_named() {
        let beside = |message: Value| {
            let choice = json!({"finish_reason": "stop", "message": message});
            let said = read(&json!({"choices": [choice]})).unwrap();
            (said.end, said.aside.map(|aside| (aside.field, aside.is_reply)))
        };
        for (field, value) in [
            ("reasoning_content", json!("{\"a\": 1}")),
            ("reasoning", json!("{\"a\": 1}")),
            ("thinking", json!("{\"a\": 1}")),
            ("reasoning_details", json!([{"type": "reasoning.text", "text": "{\"a\": 1}"}])),
            ("tool_calls", json!([{"function": {"name": "x", "arguments": "{\"a\": 1}"}}])),
        ] {
            assert_eq!(beside(json!({"content": null, field: value})), (End::Empty, Some((field, true))));
        }
        let thought = json!({"content": " ", "reasoning_content": "Let me see. {"});
        assert_eq!(beside(thought), (End::Empty, Some(("reasoning_content", false))));
        let part = json!({"content": [{"type": "thinking", "thinking": [{"type": "text", "text": "hm"}]}]});
        assert_eq!(beside(part), (End::Empty, Some(("content", false))));
        assert_eq!(beside(json!({"content": "{}", "reasoning_content": "hm"})), (End::Whole, None));
        assert_eq!(beside(json!({"content": "", "reasoning_content": " "})), (End::Empty, None));
    }

    #[test]
    fn a_model_named_by_its_file_keeps_the_name_of_the_file_alone() {
        let named = |model: &str| {
            let message = json!({"message": {"content": "{}"}});
            read(&json!({"model": model, "choices": [message]})).unwrap().metadata.model
        };
        for path in
            ["/home/somebody/models/qwen.gguf", r"C:\Users\somebody\qwen.gguf", "./models/qwen.gguf", "~/qwen.gguf"]
        {
            assert_eq!(named(path), "qwen.gguf", "{path}");
        }
        for name in ["gpt-5.2", "Qwen/Qwen2.5-Coder-1.5B-Instruct-GGUF", "qwen2.5:1.5b", ""] {
            assert_eq!(named(name), name);
        }
    }

    #[test]
    fn other_json_is_refused_with_its_place() {
        for (value, word) in [
            (json!({}), "choices[0]"),
            (json!({"choices": []}), "choices[0]"),
            (json!({"choices": [{"message": 3}]}), "message"),
            (json!({"choices": [{"message": {"content": 7}}]}), "not a text"),
            (json!([]), "choices[0]"),
        ] {
            assert!(read(&value).unwrap_err().contains(word), "{value}");
        }
    }
}
