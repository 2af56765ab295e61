//! Wrappings that models put around a reply by habit. Where a model's option says so, they are taken off before the strict reader:
//! only those of which nobody can doubt what is inside, and only where it is one JSON object. The recorded bytes stay as they came.

use super::ModelSpec;
use super::client::SCRIPTED;
use super::reply::{Refusal, json_object};

/// The byte order mark of UTF-8.
pub const MARK: &[u8] = b"\xef\xbb\xbf";
/// Tokens that end an answer inside a model, where its server lets them through.
const END_TOKENS: [&str; 10] = [
    "<|im_end|>",
    "<|endoftext|>",
    "<|end_of_text|>",
    "<|eot_id|>",
    "<|eom_id|>",
    "<|end|>",
    "<|return|>",
    "<end_of_turn>",
    "<|END_OF_TURN_TOKEN|>",
    "</s>",
];
const THOUGHTS: [(&str, &str); 3] =
    [("<think>", "</think>"), ("<thinking>", "</thinking>"), ("<reasoning>", "</reasoning>")];

impl ModelSpec {
    /// A reply as it is read, and the names of what was taken off: nothing without the option.
    pub fn opened<'b>(&self, reply: &'b [u8]) -> (&'b [u8], Vec<String>) {
        let unwrapped = if self.here.unwrap { unwrapped(reply) } else { None };
        unwrapped.map_or((reply, vec![]), |(inside, taken)| (inside, taken.into_iter().map(String::from).collect()))
    }
}

/// Returns `true` if a reply is one JSON object, wrapped or not.
pub fn holds_object(reply: &[u8]) -> bool {
    json_object(reply).is_ok() || unwrapped(reply).is_some()
}

/// The one JSON object inside a reply that is none itself, and the names of what stood around it.
fn unwrapped(reply: &[u8]) -> Option<(&[u8], Vec<&'static str>)> {
    if json_object(reply).is_ok() {
        return None;
    }
    let mut taken = Vec::new();
    let mut text = std::str::from_utf8(reply.strip_prefix(MARK).unwrap_or(reply)).ok()?.trim_ascii();
    taken.extend(reply.starts_with(MARK).then_some("byte order mark"));
    if let Some(rest) = END_TOKENS.iter().find_map(|token| text.strip_suffix(token)) {
        text = rest.trim_ascii_end();
        taken.push("end token");
    }
    if let Some(rest) = behind_thoughts(text) {
        text = rest.trim_ascii_start();
        taken.push("think block");
    }
    if let Some(rest) = inside_fence(text) {
        text = rest;
        taken.push("code fence");
    }
    (!taken.is_empty() && json_object(text.as_bytes()).is_ok()).then_some((text.as_bytes(), taken))
}

/// Returns what follows a leading think block. Its first half may stand in the prompt, so the closing word alone counts too.
fn behind_thoughts(text: &str) -> Option<&str> {
    let begun = THOUGHTS.iter().find(|(open, _)| text.starts_with(open));
    let (inside, rest) = match begun {
        Some((_, close)) => text.split_once(close)?,
        None => THOUGHTS.iter().find_map(|(_, close)| text.split_once(close))?,
    };
    (begun.is_some() || !inside.starts_with(['{', '`'])).then_some(rest)
}

/// The inside of one code fence that holds the whole text.
fn inside_fence(text: &str) -> Option<&str> {
    let (language, rest) = text.strip_prefix("```")?.split_once('\n')?;
    let inside = rest.strip_suffix("```")?;
    language.trim().chars().all(|c| c.is_ascii_alphanumeric()).then_some(inside)
}

/// A kind of unreadable reply that some setting prevents, and what to set; none where nothing is known to help.
pub fn remedy(model: &ModelSpec, reply: &[u8], refusal: &Refusal) -> Option<(&'static str, String)> {
    // The stand-in's errors are planted, at rates that the experiment declares: there is nothing to set.
    if model.kind == SCRIPTED {
        return None;
    }
    let at = &model.name;
    if let Some((_, taken)) = unwrapped(reply) {
        let remedy_text =
            format!("set unwrap = true in [models.{at}], then replay or record on: nothing is asked again");
        return Some((taken[0], remedy_text));
    }
    if reply.starts_with(b"\xff\xfe") || reply.starts_with(b"\xfe\xff") {
        return Some(("text in UTF-16", "let the program or the server write UTF-8".into()));
    }
    let text = String::from_utf8_lossy(reply);
    let text = text.trim();
    let limit = ["max_tokens", "max_completion_tokens"].into_iter().find(|name| model.sampling.contains_key(*name));
    if text.is_empty() {
        return Some((
            "empty replies",
            format!("see whether {} leaves room behind what it thinks", limit.unwrap_or("the limit of tokens")),
        ));
    }
    if text.starts_with('{') && refusal.found.starts_with("EOF") {
        let limit = limit.unwrap_or("the limit of tokens");
        return Some(("objects without an end", format!("raise {limit} of [models.{at}]")));
    }
    use super::ResponseFormat::{JsonSchema, JsonSchemaClosed, JsonSchemaStrict, Tool};
    let held = matches!(model.response_format, Some(JsonSchema | JsonSchemaStrict | JsonSchemaClosed | Tool));
    (!text.starts_with('{') && !held).then(|| {
        let remedy_text = "hold the model to the schema, with response_format = \"json_schema\" or \"tool\" for a live model, or tell it in its own prompt to answer with the object alone";
        ("words around the object, or no object", remedy_text.into())
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::llm::Here;

    const OBJECT: &str = "{\"a\": \"```\\n</think>\"}";

    fn opened(text: &[u8]) -> Option<(String, Vec<&'static str>)> {
        unwrapped(text).map(|(inside, taken)| (String::from_utf8(inside.to_vec()).unwrap().trim().to_string(), taken))
    }

    #[test]
    fn what_is_unambiguous_around_one_object_is_taken_off_and_named() {
        let o = OBJECT;
        for (text, taken) in [
            (format!("\u{feff}{o}"), vec!["byte order mark"]),
            (format!("```json\n{o}\n```"), vec!["code fence"]),
            (format!("```\n{o}\n```\n"), vec!["code fence"]),
            (format!("<think>\nShould I {{}}?\n</think>\n\n{o}"), vec!["think block"]),
            (format!("<thinking></thinking>{o}"), vec!["think block"]),
            (format!("Let me see.\n</think>{o}"), vec!["think block"]),
            (format!("{o}<|im_end|>"), vec!["end token"]),
            (format!("{o}\n</s>\n"), vec!["end token"]),
            (
                format!("\u{feff}<think>hm</think>\n```json\n{o}\n```<|eot_id|>"),
                vec!["byte order mark", "end token", "think block", "code fence"],
            ),
        ] {
            assert_eq!(opened(text.as_bytes()), Some((o.to_string(), taken)), "{text}");
        }
    }

    #[test]
    fn what_is_ambiguous_or_no_object_stays_as_it_is() {
        let o = OBJECT;
        for text in [
            o.to_string(),
            format!("Sure! {o}"),
            format!("{o}\nDone."),
            format!("```json\n{o}\n```\n```json\n{o}\n```"),
            format!("```json\n{o}\n{o}\n```"),
            format!("```json\n{o}"),
            format!("```json the patch\n{o}\n```"),
            format!("<think>hm {o}"),
            format!("<think>a</think><think>b</think>{o}"),
            format!("{o}<|im_end|><|im_end|>"),
            format!("\u{a0}{o}"),
            "```json\n[1]\n```".to_string(),
            "```json\n{\"a\": 1, \"a\": 2}\n```".to_string(),
        ] {
            assert_eq!(opened(text.as_bytes()), None, "{text}");
        }
        assert_eq!(opened(&o.encode_utf16().flat_map(u16::to_le_bytes).collect::<Vec<u8>>()), None);
    }

    fn model() -> ModelSpec {
        ModelSpec {
            name: "m".into(),
            kind: "command".into(),
            model: "x".into(),
            sampling: [("max_tokens".to_string(), 100.0)].into(),
            response_format: None,
            body: Default::default(),
            here: Here::default(),
        }
    }

    #[test]
    fn without_the_option_a_reply_stays_and_the_option_is_no_part_of_the_question() {
        let (off, on) = (model(), ModelSpec { here: Here { unwrap: true, ..Here::default() }, ..model() });
        let reply = format!("```json\n{OBJECT}\n```");
        assert_eq!(off.opened(reply.as_bytes()), (reply.as_bytes(), vec![]));
        assert_eq!(on.opened(reply.as_bytes()).1, ["code fence"]);
        assert_eq!(serde_json::to_string(&on).unwrap(), serde_json::to_string(&off).unwrap());
        assert_eq!(on, off);
    }

    #[test]
    fn each_kind_of_refused_reply_names_the_setting_that_helps() {
        let remedy_text = |text: &str| {
            let refusal = json_object(text.as_bytes()).unwrap_err();
            remedy(&model(), text.as_bytes(), &refusal).map(|(_, remedy_text)| remedy_text).unwrap_or_default()
        };
        assert!(remedy_text("```json\n{}\n```").contains("unwrap = true in [models.m]"));
        assert!(remedy_text("{\"a\": [1").contains("raise max_tokens of [models.m]"));
        assert!(remedy_text("Sure! {}").contains("response_format"));
        assert!(remedy_text("  ").contains("max_tokens"));
        assert_eq!(remedy_text("{\"a\": 1, \"a\": 2}"), "");
        let scripted = ModelSpec { kind: SCRIPTED.into(), ..model() };
        let cut = json_object(b"{\"a\": [1").unwrap_err();
        assert_eq!(remedy(&scripted, b"{\"a\": [1", &cut), None, "whose errors are planted");
    }

    proptest::proptest! {
        #[test]
        fn no_bytes_make_it_panic(bytes in proptest::collection::vec(proptest::prelude::any::<u8>(), 0..80), text in "[`{}<>/think\n ]{0,60}") {
            for reply in [bytes, text.into_bytes()] {
                unwrapped(&reply);
            }
        }
    }
}
