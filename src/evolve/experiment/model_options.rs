//! A model, as an experiment file describes it.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

use crate::llm::{ClientOptions, CommandOptions, Here, ModelSpec, ResponseFormat};

/// `[models.<name>]`.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ModelOptions {
    /// `scripted`, `exchange`, `command`, `openai_compatible` or `anthropic`. The last two are asked by a build with the feature
    /// `live` only, and replayed by every build.
    pub kind: String,
    /// The provider's identifier.
    pub model: String,
    /// Sampling parameters, sent under these names; `seed` is the root of one seed a draw slot. For `scripted`, its error rates.
    #[serde(default)]
    pub sampling: BTreeMap<String, f64>,
    /// `drawn`: the models of which one is drawn for each slot of a role, with their shares.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub shares: BTreeMap<String, f64>,
    /// Live models: how they are held to the reply's schema.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub response_format: Option<ResponseFormat>,
    /// Live models: further fields of the request's body, sent as they are.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub body: BTreeMap<String, serde_json::Value>,
    /// True if a byte order mark, a code fence, a think block or an end token around the one JSON object of a reply is taken off before
    /// it is read. Not part of a request's key: what was answered is not asked again.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub unwrap: bool,
    /// Live models: address, waiting, prices. No part of a request's key or of the experiment's digest.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub client: Option<ClientOptions>,
    /// `exchange` and `command`: who answers, and how; kept with each answer. No part of a request's key or of the experiment's
    /// digest.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub provenance: Option<String>,
    /// `command`: what is started. No part of a request's key or of the experiment's digest.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub command: Option<CommandOptions>,
}

impl ModelOptions {
    /// Returns the part that counts into the keys of requests.
    pub fn spec(&self, name: &str) -> ModelSpec {
        ModelSpec {
            name: name.to_string(),
            kind: self.kind.clone(),
            model: self.model.clone(),
            sampling: self.sampling.clone(),
            response_format: self.response_format,
            body: self.body.clone(),
            here: Here { unwrap: self.unwrap, drawn: None },
        }
    }
}
