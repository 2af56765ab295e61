//! Models that can answer a request. This module does not know cassettes or recording.

use serde::{Deserialize, Serialize};

use super::Request;
use crate::kernel::{Digest, canon::CanonError};

/// A model: a provider behind the network, or the scripted stand-in. Many threads call it. The answer may depend on the
/// request only, never on earlier requests.
pub trait Model: Sync {
    /// The content of the answer, even if it is useless: the caller judges it. An error means that there was no answer;
    /// then no proposal is used up.
    fn complete(&self, request: &Request) -> Result<Completion, ModelError>;

    /// The same of a question whose answer may be tried before it is given; who cannot try just answers.
    fn complete_with(&self, request: &Request, _judge: &dyn DraftJudge) -> Result<Completion, ModelError> {
        self.complete(request)
    }
}

/// Judges a draft before it is an answer: it is read, gates and compiler look at it. No label of it is told.
pub trait DraftJudge {
    /// Returns what they say of a draft.
    fn tried(&self, draft: &[u8]) -> Tried;
}

/// Verdict of reader, gates and compiler on a draft.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tried {
    /// True if an answer like it would pass.
    pub passes: bool,
    /// Reasons: JSON as critics and repair are told it, or why it cannot be read.
    pub says: String,
}

/// A draft that was tried before the answer was given.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TriedDraft {
    /// Digest of its bytes.
    pub draft: Digest,
    /// True if it would have passed.
    pub passes: bool,
}

/// An answer as its model gave it.
#[derive(Clone, Debug, PartialEq)]
pub struct Completion {
    /// The content: raw bytes, re-parsed at every replay.
    pub bytes: Vec<u8>,
    /// Metadata of a provider about the answer. The scripted model gives none.
    pub metadata: Option<Metadata>,
}

impl From<Vec<u8>> for Completion {
    fn from(bytes: Vec<u8>) -> Completion {
        Completion { bytes, metadata: None }
    }
}

/// Report of a provider beside the content. Recorded for the reader; no result and no key depends on it.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Metadata {
    /// The model that answered, in the provider's words: often more exact than the one that was asked for.
    pub model: String,
    /// `stop`, `length`, `end_turn`, ...
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub finish_reason: Option<String>,
    /// Tokens of the prompt, cached ones included.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub input_tokens: Option<u64>,
    /// Those of them that the provider read from its cache, at a lower price.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cached_input_tokens: Option<u64>,
    /// Those of them that it wrote into its cache, at a higher price with some.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cache_write_tokens: Option<u64>,
    /// Tokens of the answer, hidden reasoning included.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub output_tokens: Option<u64>,
    /// `system_fingerprint`: the provider's set-up; a seed holds for one of them only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fingerprint: Option<String>,
    /// Drafts that were tried before, in their order.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub tries: Vec<TriedDraft>,
}

/// A token of our prompts has 3.4 bytes; a server that counts one for more than this has read only a part of them.
const BYTES_A_TOKEN_MAX: u64 = 8;
/// Shorter prompts are not judged.
const JUDGED_BYTES_MIN: u64 = 4096;

impl Metadata {
    /// Returns `true` if its server cut a prompt of this many bytes: it reports too few tokens to hold it. A
    /// prompt that a filter stopped need not have been read, and tokens from a cache count as read.
    pub fn prompt_was_cut(&self, prompt_bytes: u64) -> bool {
        let of_caches = [self.cached_input_tokens, self.cache_write_tokens].into_iter().flatten();
        let least = of_caches.fold(0, u64::saturating_add);
        let holds = |tokens: u64| tokens.max(least).saturating_mul(BYTES_A_TOKEN_MAX) >= prompt_bytes;
        prompt_bytes >= JUDGED_BYTES_MIN
            && !self.finish_reason.as_deref().is_some_and(is_filtered)
            && self.input_tokens.is_some_and(|tokens| tokens > 0 && !holds(tokens))
    }

    /// Guards the metadata of a cassette's line against change.
    pub fn digest(&self) -> Result<Digest, CanonError> {
        Digest::of("evodrive/llm-metadata/1", self)
    }
}

/// Returns `true` if a finish reason says that a filter of the provider's, or the model, declined.
pub fn is_filtered(finish_reason: &str) -> bool {
    const WORDS: [&str; 7] =
        ["content_filter", "refusal", "safety", "prohibited_content", "blocklist", "recitation", "sensitive"];
    let word = finish_reason.trim().to_ascii_lowercase();
    // Some add after the word what was found.
    WORDS
        .iter()
        .any(|known| word == *known || word.strip_prefix(known).is_some_and(|rest| rest.starts_with([':', ' '])))
}

impl std::fmt::Display for Metadata {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let count = |tokens: Option<u64>| tokens.map_or("?".to_string(), |n| n.to_string());
        let finish = self.finish_reason.as_deref().unwrap_or("?");
        let (input, output) = (count(self.input_tokens), count(self.output_tokens));
        write!(f, "answered by {:?}, finish reason {finish:?}, {input} tokens in, {output} out", self.model)
    }
}

/// Why a model gave no answer at all, or none that may be recorded.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ModelError {
    /// The request reached nobody, or nothing came back, also after the client's bounded retries.
    #[error(
        "no answer from {address} after {attempts} attempts: {reason}; repeat the command, what was answered is not asked again"
    )]
    Transport {
        /// Address that it was sent to.
        address: String,
        /// How often it was tried.
        attempts: u32,
        /// Reason why no answer came.
        reason: String,
    },
    /// The other side understood the request and refuses it; asking again would not help.
    #[error("{address} refuses the request: {reason}")]
    Refused {
        /// Address that it was sent to.
        address: String,
        /// Reason that was given.
        reason: String,
    },
    /// The model itself declines to answer, or the provider's filter does.
    #[error("the model at {address} declines to answer: {reason}; {INCOMPLETE}")]
    Declined {
        /// Address that answered.
        address: String,
        /// Reason that was given.
        reason: String,
    },
    /// The answer was cut at the limit of tokens.
    #[error(
        "the answer of {address} was cut after {output_tokens} tokens (finish reason {finish_reason}){aside}; raise max_tokens, or {INCOMPLETE}"
    )]
    Truncated {
        /// Address that answered.
        address: String,
        /// Tokens of the answer, `?` where the provider says nothing.
        output_tokens: String,
        /// Why the answer ended, in the provider's word.
        finish_reason: String,
        /// Note on where text stands that is no reply, and on what to do; empty where there is none.
        aside: Box<str>,
    },
    /// An answer without content.
    #[error("the answer of {address} is empty (finish reason {finish_reason}){aside}; {INCOMPLETE}")]
    Empty {
        /// Address that answered.
        address: String,
        /// Why the answer ended, in the provider's word.
        finish_reason: String,
        /// Note on where text stands that is no reply, and on what to do; empty where there is none.
        aside: Box<str>,
    },
    /// An answer of which nobody can say that it is whole.
    #[error("the answer of {address} is incomplete: {reason}; {INCOMPLETE}")]
    Incomplete {
        /// Address that answered.
        address: String,
        /// Why it does not count as whole.
        reason: String,
    },
    /// An answer that is not what the protocol says.
    #[error("{address} answered with something else than the protocol says: {reason}")]
    Malformed {
        /// Address that answered.
        address: String,
        /// Fault of the answer, and what to do.
        reason: String,
    },
    /// The call was not made because a cap of the experiment would be exceeded.
    #[error(
        "spend cap reached: {reason}; raise [spend] in the experiment file and repeat the `evodrive record` command: what was answered is not asked again"
    )]
    SpendCap {
        /// Reason: which cap, and what it would take.
        reason: String,
    },
    /// A program that was started to answer did not.
    #[error(
        "`{address}` gave no answer: {reason}; correct it and repeat the command, what was answered is not asked again"
    )]
    Failed {
        /// The program with its arguments.
        address: String,
        /// How it ended.
        reason: String,
    },
    /// A program that this machine cannot start, or that lacks something here.
    #[error(
        "`{address}` cannot answer on this machine: {reason}; install it and repeat the command, what was answered is not asked again"
    )]
    Lacking {
        /// The program with its arguments.
        address: String,
        /// Reason: what is missing.
        reason: String,
    },
    /// The request cannot be answered by this model: what is missing or wrong in it, and where.
    #[error("the request cannot be answered: {reason}")]
    Unanswerable {
        /// Reason: what is missing or wrong, and where.
        reason: String,
    },
}

const INCOMPLETE: &str =
    "incomplete_replies = \"keep\" in the model's [client] records such answers and reads them like every reply";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_server_that_counts_too_few_tokens_has_cut_the_prompt() {
        let cut =
            |tokens: Option<u64>, bytes| Metadata { input_tokens: tokens, ..Metadata::default() }.prompt_was_cut(bytes);
        assert!(cut(Some(2048), 31_000));
        assert!(!cut(Some(9_290), 31_000) && !cut(None, 31_000) && !cut(Some(0), 31_000));
        assert!(!cut(Some(10), 120), "a prompt of a few words says nothing");
    }

    #[test]
    fn what_came_from_a_cache_was_read_and_what_a_filter_stopped_is_not_judged() {
        let counted = |input, cached, finish: &str| Metadata {
            input_tokens: Some(input),
            cached_input_tokens: Some(cached),
            finish_reason: Some(finish.into()),
            ..Metadata::default()
        };
        assert!(!counted(12, 8_988, "stop").prompt_was_cut(31_000));
        assert!(counted(2_048, 2_000, "stop").prompt_was_cut(31_000));
        assert!(!counted(5, 0, "content_filter").prompt_was_cut(31_000));
    }
}
