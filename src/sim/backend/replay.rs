//! Answers from a cassette. No worker is asked.

use super::answer::Answer;
use super::cassette::RolloutCassette;
use super::error::{BackendError, Miss};
use super::request::{Answers, Request};

/// A cassette as the source of answers; a request that was not recorded is a miss.
pub struct Replay {
    cassette: RolloutCassette,
    /// The command that would record what is missing.
    remedy: String,
}

impl Replay {
    pub fn new(cassette: RolloutCassette, remedy: impl Into<String>) -> Replay {
        Replay { cassette, remedy: remedy.into() }
    }
}

impl Answers for Replay {
    fn answer(&self, request: &Request<'_>) -> Result<Answer, BackendError> {
        if let Some(recorded) = self.cassette.get(&request.key) {
            return Ok(recorded.answer.clone());
        }
        let of_scene = self.cassette.rollouts().filter(|(_, of)| of.scene == request.scene()).count();
        Err(BackendError::Miss(Box::new(Miss {
            cassette: self.cassette.file.clone(),
            key: request.key,
            scene: request.scene().to_string(),
            ego: request.ego.to_string(),
            adversaries: request.intervention.actions.len(),
            recorded: self.cassette.len(),
            of_scene,
            remedy: self.remedy.clone(),
        })))
    }
}
