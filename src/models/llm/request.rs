//! A question to a model, and the key it is recorded under.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::sync::Arc;

use super::client::{DRAWN, SCRIPTED};
use super::{Schema, Text};
use crate::kernel::Digest;

/// Everything that can change an answer. Every field is part of the key. What must not be part of it (api key, timeout,
/// retries, user agent, proxy, address, prices, spend cap) belongs to the live client (`ClientOptions`).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Request {
    /// Version of prompts and contracts.
    pub adapter_version: u32,
    /// Position of the question in the run.
    pub slot: DrawSlot,
    /// Model that is asked, with sampling parameters.
    pub model: ModelSpec,
    /// The prompt, in order.
    pub messages: Vec<Message>,
    /// JSON schema that the reply must satisfy.
    pub schema: Schema,
}

/// The position in the run at which this answer is drawn. K draws of one prompt have K keys, and the order in which
/// answers arrive changes nothing.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DrawSlot {
    /// Name of the lineage.
    pub lineage: String,
    /// Epoch, from 0.
    pub epoch: u32,
    /// Place among the proposals of the epoch, from 0.
    pub slot: u32,
    /// `actor`, `structural_critic`, ...
    pub role: String,
    /// 0 for the first patch, then the repair round.
    pub round: u32,
}

/// The model of one role, as the experiment file names it.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ModelSpec {
    /// Name in the experiment file and in every table, e.g. `scripted`.
    pub name: String,
    /// `scripted`, `openai_compatible`, `anthropic`.
    pub kind: String,
    /// The provider's model identifier.
    pub model: String,
    /// Sampling parameters (temperature, max_tokens, ...) and, for `scripted`, its seed and error rates. A live model's `seed` is the
    /// root of one seed a draw slot.
    pub sampling: BTreeMap<String, f64>,
    /// How a live model is held to the schema. (It is left out if there is none, so that the keys of older recordings
    /// do not change.)
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub response_format: Option<ResponseFormat>,
    /// Further fields of a live model's request, sent as they are.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub body: BTreeMap<String, serde_json::Value>,
    /// Treatment of the model by an experiment. It changes no answer: it is written nowhere, is no part of the key, and two
    /// models that differ in it are the same to ask.
    #[serde(skip)]
    pub here: Here,
}

/// Treatment of a model by an experiment, beside asking it.
#[derive(Clone, Debug, Default)]
pub struct Here {
    /// True if wrappings around a reply are taken off before it is read ([`unwrap`](super::unwrap)).
    pub unwrap: bool,
    /// A model of kind `drawn`: who is asked in its place.
    pub drawn: Option<Arc<Drawn>>,
}

/// Models of which one is drawn for each draw slot, by share.
#[derive(Clone, Debug)]
pub struct Drawn {
    /// Root of the draws.
    pub seed: u64,
    /// Each model with its share, above 0; they need not sum to 1.
    pub of: Vec<(f64, ModelSpec)>,
}

impl Drawn {
    /// The model of a slot: all rounds of a role in a slot have the same one.
    fn at(&self, slot: &DrawSlot) -> Option<&ModelSpec> {
        let place = (self.seed, &slot.lineage, slot.epoch, slot.slot, &slot.role);
        let digest = Digest::of("evodrive/model-draw/1", &place).ok()?;
        let bytes: [u8; 8] = digest.as_bytes()[..8].try_into().ok()?;
        // 53 bits, so that every value is an f64 below 1.
        let unit = (u64::from_le_bytes(bytes) >> 11) as f64 / (1_u64 << 53) as f64;
        let mut left = unit * self.of.iter().map(|(share, _)| share).sum::<f64>();
        for (share, model) in &self.of {
            left -= share;
            if left < 0.0 {
                return Some(model);
            }
        }
        self.of.last().map(|(_, model)| model)
    }
}

impl PartialEq for ModelSpec {
    fn eq(&self, other: &ModelSpec) -> bool {
        let ModelSpec { name, kind, model, sampling, response_format, body, here: _ } = self;
        (name, kind, model, sampling) == (&other.name, &other.kind, &other.model, &other.sampling)
            && (response_format, body) == (&other.response_format, &other.body)
    }
}

impl ModelSpec {
    /// Returns the model that is asked in a slot: this one, or the one that is drawn there.
    pub fn drawn(&self, slot: &DrawSlot) -> &ModelSpec {
        self.here.drawn.as_ref().and_then(|drawn| drawn.at(slot)).unwrap_or(self)
    }

    /// How results name the model. The label begins with the kind, so that no name can make the scripted stand-in look
    /// like a language model.
    pub fn label(&self) -> String {
        if self.kind == SCRIPTED && self.name == self.kind {
            return self.kind.clone();
        }
        if let Some(drawn) = &self.here.drawn {
            let parts = drawn.of.iter().map(|(share, model)| format!("{share} {}", model.label()));
            return format!("{DRAWN} ({}: {})", self.name, parts.collect::<Vec<_>>().join(" + "));
        }
        format!("{} ({}, {})", self.kind, self.name, self.model)
    }
}

/// How a live model is held to the schema of a reply. Providers know different forms; all show the schema in the prompt too.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ResponseFormat {
    /// `{"type": "json_schema", "json_schema": {name, strict: false, schema}}`: OpenAI, llama.cpp, vLLM.
    JsonSchema,
    /// The same with `strict: true` where the schema is of the form that strict mode takes: OpenAI, Azure.
    JsonSchemaStrict,
    /// As `JsonSchema`; the schema of a patch is closed over its question: the paths that are there, the words and numbers that are allowed.
    JsonSchemaClosed,
    /// `{"type": "json_object", "schema": ..}`: llama-cpp-python, llama.cpp.
    JsonObjectSchema,
    /// `{"type": "json_object"}`: any JSON object.
    JsonObject,
    /// A tool that must be called with the reply as its input: Anthropic.
    Tool,
    /// The prompt alone.
    None,
}

/// One message of a prompt.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Message {
    /// `system` or `user`.
    pub role: String,
    /// Text of the message.
    pub text: Text,
}

impl Request {
    /// Bytes of all messages.
    pub fn prompt_bytes(&self) -> u64 {
        self.messages.iter().map(|message| message.text.len() as u64).sum()
    }

    /// The key of the memo and of the cassette.
    pub fn key(&self) -> Result<Digest, crate::kernel::canon::CanonError> {
        // Long parts enter by their own digests, which are computed once for all questions that share them.
        #[derive(Serialize)]
        struct Keyed<'a> {
            adapter_version: u32,
            slot: &'a DrawSlot,
            model: &'a ModelSpec,
            messages: Vec<(&'a str, Digest)>,
            schema: Digest,
        }
        let Request { adapter_version, slot, model, messages, schema } = self;
        let messages = messages.iter().map(|message| (message.role.as_str(), message.text.digest())).collect();
        let keyed = Keyed { adapter_version: *adapter_version, slot, model, messages, schema: schema.digest() };
        Digest::of("evodrive/llm-request/2", &keyed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn named(name: &str) -> ModelSpec {
        ModelSpec {
            name: name.into(),
            kind: "command".into(),
            model: name.into(),
            sampling: BTreeMap::new(),
            response_format: None,
            body: BTreeMap::new(),
            here: Here::default(),
        }
    }

    fn slot(epoch: u32, slot: u32, round: u32) -> DrawSlot {
        DrawSlot { lineage: "cat".into(), epoch, slot, role: "actor".into(), round }
    }

    fn mix(seed: u64, shares: [f64; 2]) -> ModelSpec {
        let of = shares.into_iter().zip(["a", "b"]).map(|(share, name)| (share, named(name))).collect();
        let here = Here { drawn: Some(Arc::new(Drawn { seed, of })), ..Here::default() };
        ModelSpec { kind: DRAWN.into(), here, ..named("mix") }
    }

    #[test]
    fn models_are_drawn_by_their_shares_and_a_slot_keeps_its_model_over_all_rounds() {
        let mix_of_3_to_1 = mix(1, [3.0, 1.0]);
        let names = |mix: &ModelSpec| -> Vec<String> {
            (0..4_000).map(|n| mix.drawn(&slot(n / 8, n % 8, 0)).name.clone()).collect()
        };
        let first = names(&mix_of_3_to_1);
        let of_a = first.iter().filter(|name| *name == "a").count();
        assert!((2_900..3_100).contains(&of_a), "{of_a}");
        assert!(first == names(&mix_of_3_to_1) && first != names(&mix(2, [3.0, 1.0])));
        for n in 0..40 {
            assert_eq!(mix_of_3_to_1.drawn(&slot(0, n, 0)), mix_of_3_to_1.drawn(&slot(0, n, 3)));
        }
        assert_eq!(named("a").drawn(&slot(0, 0, 0)), &named("a"));
    }

    #[test]
    fn a_mix_is_labelled_by_those_who_answer() {
        assert_eq!(mix(1, [0.7, 0.3]).label(), "drawn (mix: 0.7 command (a, a) + 0.3 command (b, b))");
    }
}
