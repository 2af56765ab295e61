//! The common part of both protocols: from a request to a body, and from an answer to its content.

use serde_json::{Map, Value};

use super::{anthropic, http::Header, openai, secret::Secret, spend::Tokens};
use crate::{
    kernel::Digest,
    llm::{ClientOptions, Metadata, ModelError, ModelSpec, Request, is_filtered, unwrap},
};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Protocol {
    OpenAi,
    Anthropic,
}

/// An answer as it was understood.
#[derive(Debug, PartialEq)]
pub struct Said {
    pub text: Vec<u8>,
    pub end: End,
    /// Text that stands where a reply is not looked for, of an answer without content.
    pub aside: Option<Aside>,
    pub metadata: Metadata,
}

/// How an answer ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    Whole,
    /// Cut at the limit of tokens.
    Truncated,
    /// Refused by the model or filtered by the provider; it holds the text.
    Declined,
    Empty,
    /// With a finish reason that nobody knows, or none: perhaps a part.
    Unknown,
    /// With half a character in it.
    Broken,
}

/// Place where an answer without content holds text: what its model thought, or a call of a tool that nobody offered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Aside {
    pub field: &'static str,
    /// True if that text is the reply.
    pub is_reply: bool,
}

/// Finish reasons of whole answers, in small letters: OpenAI, Anthropic, Together, Text Generation Inference, Cohere.
const WHOLE: [&str; 8] =
    ["stop", "eos", "eos_token", "stop_sequence", "stop_token", "end_turn", "tool_use", "complete"];
/// Finish reasons of answers that met a limit of tokens: OpenAI, Anthropic, Gemini, Mistral, llama.cpp's older server.
const CUT: [&str; 6] = ["length", "max_tokens", "model_length", "max_length", "limit", "model_context_window_exceeded"];

impl End {
    /// By the provider's word and the content. Where there is no word, the content tells: one JSON object is no part of an answer.
    pub fn of(finish_reason: Option<&str>, content: &str) -> End {
        let word = finish_reason.unwrap_or_default().trim().to_ascii_lowercase();
        match word.as_str() {
            word if is_filtered(word) => End::Declined,
            word if CUT.contains(&word) => End::Truncated,
            _ if content.trim().is_empty() => End::Empty,
            word if WHOLE.contains(&word) => End::Whole,
            "" if unwrap::holds_object(content.as_bytes()) => End::Whole,
            _ => End::Unknown,
        }
    }
}

/// Returns what an answer without content holds elsewhere; `at` is the object with its fields.
pub fn aside(at: &Value, content: &str) -> Option<Aside> {
    const PLACES: [(&str, &str); 9] = [
        ("reasoning_content", "/reasoning_content"),
        ("reasoning", "/reasoning"),
        ("thinking", "/thinking"),
        ("reasoning_details", "/reasoning_details/0/text"),
        ("tool_calls", "/tool_calls/0/function/arguments"),
        ("function_call", "/function_call/arguments"),
        ("content", "/content/0/thinking"),
        ("content", "/content/0/thinking/0/text"),
        ("content", "/content/0/reasoning"),
    ];
    PLACES.into_iter().filter(|_| content.trim().is_empty()).find_map(|(field, place)| {
        let text = text_at(at, place).filter(|text| !text.trim().is_empty())?;
        Some(Aside { field, is_reply: unwrap::holds_object(text.as_bytes()) })
    })
}

impl Said {
    /// Token counts, if the provider reports them.
    pub fn tokens(&self) -> Option<Tokens> {
        let Metadata { input_tokens, output_tokens, cached_input_tokens, cache_write_tokens, .. } = self.metadata;
        let (cached, written) = (cached_input_tokens.unwrap_or(0), cache_write_tokens.unwrap_or(0));
        Some(Tokens { input: input_tokens?, output: output_tokens?, cached, written })
    }
}

impl Protocol {
    pub fn url(self, options: &ClientOptions) -> String {
        let base = options.base_url.trim_end_matches('/');
        let path = match self {
            Protocol::OpenAi => "chat/completions",
            Protocol::Anthropic => "v1/messages",
        };
        let query: Vec<String> = options.query.iter().map(|(name, value)| format!("{name}={value}")).collect();
        let query = if query.is_empty() { String::new() } else { format!("?{}", query.join("&")) };
        format!("{base}/{path}{query}")
    }

    /// The declared headers and the one with the key: as the protocol has it, or bare under a name of the gateway's.
    pub fn headers(self, options: &ClientOptions, key: Option<&Secret>) -> Vec<Header> {
        let (name, before) = match (&options.api_key_header, self) {
            (Some(name), _) => (name.as_str(), ""),
            (None, Protocol::OpenAi) => ("authorization", "Bearer "),
            (None, Protocol::Anthropic) => ("x-api-key", ""),
        };
        let key = key.map(|key| (name.to_string(), key.header(before)));
        let version = ("anthropic-version".to_string(), anthropic::VERSION.to_string());
        let version = Some(version).filter(|_| self == Protocol::Anthropic);
        let declared = options.headers.iter().map(|(name, value)| (name.clone(), value.clone()));
        key.into_iter().chain(version).chain(declared).collect()
    }

    /// The request's body. Equal requests have equal bodies.
    pub fn body(self, request: &Request) -> Result<Vec<u8>, ModelError> {
        let mut body = match self {
            Protocol::OpenAi => openai::body(request)?,
            Protocol::Anthropic => anthropic::body(request)?,
        };
        for (field, value) in &request.model.body {
            body.insert(field.clone(), value.clone());
        }
        serde_json::to_vec(&Value::Object(body)).map_err(unanswerable)
    }

    /// The reply in an answer that is no error.
    pub fn read(self, answer: &Value) -> Result<Said, String> {
        match self {
            Protocol::OpenAi => openai::read(answer),
            Protocol::Anthropic => anthropic::read(answer),
        }
    }

    /// Most tokens that an answer can have. The check of the experiment file makes sure that there is a limit; a
    /// request without one has no bound.
    pub fn output_bound(self, model: &ModelSpec) -> u64 {
        let limit = model.sampling.get("max_tokens").or(model.sampling.get("max_completion_tokens"));
        limit.map_or(u64::MAX, |limit| *limit as u64)
    }
}

/// The seed of one draw, below 2^31 so that every server takes it: a function of the model's `seed` and the draw slot.
pub fn draw_seed(seed: f64, request: &Request) -> Result<u32, ModelError> {
    let digest = Digest::of("evodrive/draw-seed/1", &(seed, &request.slot)).map_err(unanswerable)?;
    let bytes = digest.as_bytes();
    Ok(u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]) >> 1)
}

pub fn unanswerable(error: impl std::fmt::Display) -> ModelError {
    ModelError::Unanswerable { reason: error.to_string() }
}

/// Sampling parameters as they are sent: counts as whole numbers, the seed as the one of this draw.
pub fn put_sampling(body: &mut Map<String, Value>, request: &Request) -> Result<(), ModelError> {
    for (name, &x) in &request.model.sampling {
        let value = match name.as_str() {
            "seed" => draw_seed(x, request)?.into(),
            "max_tokens" | "max_completion_tokens" | "top_k" => (x as u64).into(),
            _ => serde_json::Number::from_f64(x)
                .map(Value::Number)
                .ok_or_else(|| unanswerable(format!("sampling.{name} is not finite")))?,
        };
        body.insert(name.clone(), value);
    }
    Ok(())
}

/// The name under which a schema or a tool is sent; servers take letters, digits and `_`.
pub fn reply_name(request: &Request) -> String {
    let role = request.slot.role.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' });
    role.take(50).chain("_reply".chars()).collect()
}

pub fn text_at(value: &Value, pointer: &str) -> Option<String> {
    value.pointer(pointer).and_then(Value::as_str).map(str::to_string)
}

pub fn count_at(value: &Value, pointer: &str) -> Option<u64> {
    let number = value.pointer(pointer)?;
    // Some servers count in floats.
    let whole = number.as_f64().filter(|x| x.fract() == 0.0 && (0.0..1e15).contains(x)).map(|x| x as u64);
    number.as_u64().or(whole)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_end_is_told_by_the_providers_word_and_by_the_content_where_there_is_none() {
        for word in ["stop", "STOP", "eos", "eos_token", "stop_sequence", "end_turn", "COMPLETE"] {
            assert_eq!(End::of(Some(word), "{}"), End::Whole, "{word}");
            assert_eq!(End::of(Some(word), " "), End::Empty, "{word}");
        }
        for word in ["length", "MAX_TOKENS", "model_length"] {
            assert_eq!(End::of(Some(word), "{}"), End::Truncated, "{word}");
        }
        for word in ["content_filter", "content_filter: RECITATION", "SAFETY", "refusal"] {
            assert_eq!(End::of(Some(word), "{}"), End::Declined, "{word}");
        }
        for none in [None, Some(""), Some(" ")] {
            for (content, end) in [
                ("{\"a\": 1}", End::Whole),
                ("```json\n{}\n```", End::Whole),
                ("{\"a\": ", End::Unknown),
                ("Sure! {}", End::Unknown),
                ("", End::Empty),
            ] {
                assert_eq!(End::of(none, content), end, "{none:?} {content}");
            }
        }
        assert_eq!(End::of(Some("max_time"), "{}"), End::Unknown);
    }
}
