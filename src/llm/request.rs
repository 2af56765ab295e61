//! A question to a model, and the key it is recorded under.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

use super::client::SCRIPTED;
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
    /// Who is asked, with sampling parameters.
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
    /// Which lineage.
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
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
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
}

impl ModelSpec {
    /// How results name the model. The label begins with the kind, so that no name can make the scripted stand-in look
    /// like a language model.
    pub fn label(&self) -> String {
        if self.kind == SCRIPTED && self.name == self.kind {
            return self.kind.clone();
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
    /// What it says.
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
