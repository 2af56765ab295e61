//! Chat Completions, as OpenAI, llama.cpp, vLLM, Ollama and many gateways speak it.

use serde_json::{Map, Value, json};

use super::protocol::{End, Said, count_at, put_sampling, reply_name, text_at};
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
    let end = match finish_reason.as_deref() {
        Some("content_filter") => End::Declined,
        _ if refusal.is_some() => End::Declined,
        Some("length") => End::Truncated,
        _ if content.trim().is_empty() => End::Empty,
        Some("stop") => End::Whole,
        _ => End::Unknown,
    };
    Ok(Said { text: refusal.unwrap_or(content).into_bytes(), end, metadata: metadata(answer, finish_reason) })
}

fn metadata(answer: &Value, finish_reason: Option<String>) -> Metadata {
    Metadata {
        model: text_at(answer, "/model").map(|said| without_folder(&said).to_string()).unwrap_or_default(),
        finish_reason,
        input_tokens: count_at(answer, "/usage/prompt_tokens"),
        // OpenAI and vLLM; DeepSeek.
        cached_input_tokens: count_at(answer, "/usage/prompt_tokens_details/cached_tokens")
            .or(count_at(answer, "/usage/prompt_cache_hit_tokens")),
        cache_write_tokens: None,
        output_tokens: count_at(answer, "/usage/completion_tokens"),
        fingerprint: text_at(answer, "/system_fingerprint"),
        tries: Vec::new(),
    }
}

/// An answer without a choice: Azure and Gemini say so where a filter let no answer through.
fn without_choices(answer: &Value) -> Result<Said, String> {
    let is_filtered =
        ["prompt_filter_results", "prompt_feedback", "promptFeedback"].iter().any(|f| answer.get(f).is_some());
    match answer.get("choices") {
        Some(Value::Array(_)) if is_filtered => {
            Ok(Said { text: vec![], end: End::Declined, metadata: metadata(answer, Some("content_filter".into())) })
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
        assert_eq!(end(json!({"finish_reason": null, "message": {"content": "{}"}})), End::Unknown);
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
