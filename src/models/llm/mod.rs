//! Asking a model: request, replay, record, cassette, models behind a folder or a program. Who is asked over the network is in the
//! room `live`.

pub mod addressed;
pub mod cassette;
pub mod client;
pub mod command;
pub mod exchange;
pub mod model;
pub mod record;
pub mod replay;
pub mod reply;
pub mod request;
pub mod unwrap;

pub use addressed::{Schema, Text};
pub use cassette::{Cassette, CassetteError, Recorded};
pub use client::{ClientOptions, IncompleteReplies, SpendCap};
pub use command::{Command, CommandOptions};
pub use exchange::{Desk, Exchange};
pub use model::{Completion, DraftJudge, Metadata, Model, ModelError, Tried, TriedDraft, is_filtered};
pub use record::{Record, RecordMode};
pub use replay::Replay;
pub use reply::Refusal;
pub use request::{DrawSlot, Drawn, Here, Message, ModelSpec, Request, ResponseFormat};

use crate::kernel::Digest;

/// A model's answer as it came: raw bytes, kept and re-parsed at every replay.
#[derive(Clone, Debug, PartialEq)]
pub struct Reply {
    /// Key of the request.
    pub request: Digest,
    /// Digest of `bytes`.
    pub response: Digest,
    /// The answer, raw.
    pub bytes: Vec<u8>,
    /// Metadata of the provider about the answer; no result depends on it.
    pub metadata: Option<Metadata>,
    /// Digest of that, where the recording seals it.
    pub sealed_metadata: Option<Digest>,
}

/// Something that answers requests: a cassette, a recorder in front of a model, a test. Many threads call it.
pub trait Ask: Sync {
    /// The answer to a request, or why there is none. With a judge drafts of it may be tried before it is given; who cannot try, or answers
    /// from a record, just answers.
    fn ask_with(&self, request: &Request, judge: Option<&dyn DraftJudge>) -> Result<Reply, AskError>;

    /// The answer to a request of which no draft is tried.
    fn ask(&self, request: &Request) -> Result<Reply, AskError> {
        self.ask_with(request, None)
    }
}

/// Why there is no answer. An unusable reply is not an error but a [`Refusal`] in the attempt.
#[derive(Debug, thiserror::Error)]
pub enum AskError {
    /// Replay met a request that was not recorded.
    #[error("{0}")]
    Miss(Box<Miss>),
    /// A model gave no answer.
    #[error("model {model}: {error}")]
    Model {
        /// Name of the model.
        model: String,
        /// Why.
        error: ModelError,
    },
    /// The store could not be read or written.
    #[error("{0}")]
    Disk(std::sync::Arc<crate::store::StoreError>),
    /// Stored data that cannot be used, or an object without bytes that was to be stored; it holds the reason.
    #[error("{0}")]
    Store(String),
    /// Whoever started the run wants it to stop; nobody was asked.
    #[error("the run was interrupted before this was asked")]
    Stopped,
}

/// A question without a recorded answer, and what would help.
#[derive(Debug, Clone, PartialEq)]
pub struct Miss {
    /// Name of the cassette.
    pub cassette: String,
    /// Key of the request.
    pub key: Digest,
    /// Position of the question in the run.
    pub slot: DrawSlot,
    /// Slot of the nearest recorded exchange, if there is any.
    pub nearest: Option<DrawSlot>,
    /// The first field in which the nearest one differs, with both values.
    pub difference: Option<String>,
    /// The command that would record it.
    pub remedy: String,
}

impl Miss {
    /// One of which nobody looked for the nearest recorded exchange.
    pub fn plain(cassette: impl Into<String>, key: Digest, slot: DrawSlot, remedy: impl Into<String>) -> Miss {
        let (cassette, remedy) = (cassette.into(), remedy.into());
        Miss { cassette, key, slot, nearest: None, difference: None, remedy }
    }
}

impl std::fmt::Display for Miss {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let at = |s: &DrawSlot| format!("{}/e{}s{} {} round {}", s.lineage, s.epoch, s.slot, s.role, s.round);
        writeln!(f, "no recorded answer for {} (key {}) in {}", at(&self.slot), self.key.short(12), self.cassette)?;
        match &self.nearest {
            Some(nearest) => writeln!(f, "  nearest recorded exchange: {}", at(nearest))?,
            None => writeln!(f, "  the cassette holds no exchange at all")?,
        }
        if let Some(difference) = &self.difference {
            writeln!(f, "  first difference: {difference}")?;
        }
        write!(f, "  to record it: {}", self.remedy)
    }
}
