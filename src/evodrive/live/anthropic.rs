//! Anthropic's Messages API.

use serde_json::{Map, Value, json};

use super::protocol::{End, Said, aside, count_at, put_sampling, reply_name, text_at, unanswerable};
use super::wire::compilable;
use crate::llm::{Metadata, ModelError, Request, ResponseFormat};

/// Value of the header `anthropic-version`.
pub const VERSION: &str = "2023-06-01";

pub fn body(request: &Request) -> Result<Map<String, Value>, ModelError> {
    let (system, others): (Vec<_>, Vec<_>) = request.messages.iter().partition(|message| message.role == "system");
    let system: Vec<&str> = system.into_iter().map(|message| &*message.text).collect();
    // One message with several blocks, because user and assistant must alternate in this protocol.
    // The first holds the epoch's context, which all roles and slots of a parent share.
    let block =
        |(i, text): (usize, &str)| if i == 0 { kept(text.into()) } else { json!({"type": "text", "text": text}) };
    let blocks: Vec<Value> = others.into_iter().map(|m| &*m.text).enumerate().map(block).collect();
    let mut body = Map::new();
    body.insert("model".into(), request.model.model.clone().into());
    body.insert("system".into(), json!([kept(system.join("\n\n"))]));
    body.insert("messages".into(), json!([{"role": "user", "content": blocks}]));
    put_sampling(&mut body, request)?;
    if request.model.response_format == Some(ResponseFormat::Tool) {
        let name = reply_name(request);
        let describes = "Hands in the reply.";
        let schema = compilable(&request.schema);
        body.insert("tools".into(), json!([{"name": name, "description": describes, "input_schema": schema}]));
        body.insert("tool_choice".into(), json!({"type": "tool", "name": name}));
    }
    if !body.contains_key("max_tokens") {
        return Err(unanswerable("sampling.max_tokens is missing, and the Messages API demands it"));
    }
    Ok(body)
}

/// A text up to which the provider keeps the beginning of the prompt, for the next question that begins alike.
fn kept(text: String) -> Value {
    json!({"type": "text", "text": text, "cache_control": {"type": "ephemeral"}})
}

pub fn read(answer: &Value) -> Result<Said, String> {
    let blocks = answer.get("content").and_then(Value::as_array).ok_or("no list `content`")?;
    let of_type = |wanted: &str| {
        let wanted = Value::from(wanted);
        blocks.iter().filter(move |block| block.get("type") == Some(&wanted)).collect::<Vec<_>>()
    };
    // A tool's input is JSON already; it is written out in sorted order and counts as the reply's text.
    let text = match of_type("tool_use").first().and_then(|block| block.get("input")) {
        Some(input) => input.to_string(),
        None => of_type("text").into_iter().filter_map(|block| text_at(block, "/text")).collect(),
    };
    let stop_reason = text_at(answer, "/stop_reason");
    let (end, aside) = (End::of(stop_reason.as_deref(), &text), aside(answer, &text));
    let usage = |field: &str| count_at(answer, &format!("/usage/{field}"));
    let (written, cached) = (usage("cache_creation_input_tokens"), usage("cache_read_input_tokens"));
    // This protocol counts the three apart.
    let all = |rest: u64| [written, cached].into_iter().flatten().fold(rest, u64::saturating_add);
    let metadata = Metadata {
        model: text_at(answer, "/model").unwrap_or_default(),
        finish_reason: stop_reason,
        input_tokens: usage("input_tokens").map(all),
        cached_input_tokens: cached,
        cache_write_tokens: written,
        output_tokens: usage("output_tokens"),
        fingerprint: None,
        tries: Vec::new(),
    };
    Ok(Said { text: text.into_bytes(), end, aside, metadata })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_blocks_are_joined_and_a_tools_input_is_the_reply() {
        let said = read(&json!({"stop_reason": "end_turn", "content": [
            {"type": "thinking", "thinking": "hm"}, {"type": "text", "text": "{\"a\":"}, {"type": "text", "text": " 1}"}]}));
        assert_eq!(said.unwrap().text, b"{\"a\": 1}");
        let said = read(&json!({"stop_reason": "tool_use", "model": "m-1",
            "usage": {"input_tokens": 5, "cache_read_input_tokens": 7, "output_tokens": 2},
            "content": [{"type": "text", "text": "Here:"}, {"type": "tool_use", "name": "x", "input": {"b": 1, "a": [2.5]}}]}))
        .unwrap();
        assert_eq!((said.text.as_slice(), said.end), (b"{\"a\":[2.5],\"b\":1}".as_slice(), End::Whole));
        let metadata = said.metadata;
        assert_eq!((metadata.input_tokens, metadata.output_tokens), (Some(12), Some(2)));
        assert_eq!((metadata.cached_input_tokens, metadata.cache_write_tokens), (Some(7), None));
    }

    #[test]
    fn each_end_of_an_answer_is_told_apart() {
        let end = |reason: &str, text: &str| {
            read(&json!({"stop_reason": reason, "content": [{"type": "text", "text": text}]})).unwrap().end
        };
        assert_eq!(end("refusal", "No."), End::Declined);
        assert_eq!(end("max_tokens", "{"), End::Truncated);
        assert_eq!(end("end_turn", ""), End::Empty);
        assert_eq!((end("pause_turn", "{}"), end("end_turn", "{}")), (End::Unknown, End::Whole));
        assert!(read(&json!({"content": "text"})).is_err());
    }
}
