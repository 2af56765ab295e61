//! Who can answer a request. Knows nothing of cassettes or of recording.

use super::Request;

/// A model: a provider behind the network, or the scripted stand-in. Called from many threads; the answer may depend on the
/// request only, never on how many were answered before.
pub trait Model: Sync {
    /// The raw bytes of the answer's content, whatever they say: judging them is the caller's work. An error means that no
    /// answer came, so that no proposal is consumed.
    fn complete(&self, request: &Request) -> Result<Vec<u8>, ModelError>;
}

/// Why a model gave no answer at all.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ModelError {
    /// The request reached nobody, or nothing came back, also after the client's bounded retries.
    #[error("no answer from {address} after {attempts} attempts: {reason}")]
    Transport { address: String, attempts: u32, reason: String },
    /// The other side understood the request and refuses it; asking again would not help.
    #[error("{address} refuses the request: {reason}")]
    Refused { address: String, reason: String },
    /// The call was not made because a cap of the experiment would be exceeded.
    #[error("spend cap reached: {reason}; raise the cap in the experiment file and run `evodrive resume`")]
    SpendCap { reason: String },
    /// The request cannot be answered by this model: what is missing or wrong in it, and where.
    #[error("the request cannot be answered: {reason}")]
    Unanswerable { reason: String },
}
