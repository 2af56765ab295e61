//! The scripted stand-in: rules that answer the prompts of the roles through the same JSON contract as a language model would.
//!
//! It is not a language model and is never called one. With it a study can be recorded and replayed without any
//! provider, and the loop can be tested with errors at declared rates. It sees the text of the request and nothing
//! else. Every draw comes from a stream named by the request's draw slot, so that equal requests get equal bytes.

mod actor;
mod attackers;
mod check;
mod compact;
mod conditions;
mod constants;
mod contract;
mod critics;
mod edit;
mod errors;
mod evaluator;
mod forms;
mod free;
mod names;
mod reader;
mod refusal;
mod repair;
mod strategies;
mod templates;
mod ways;
mod wiring;

pub use errors::Rates;

use serde_json::Value;

use self::refusal::unanswerable;
use crate::kernel::{Seed, Stream};
use crate::llm::{self, Completion, Model, ModelError, Request};

/// `kind` of a `ModelSpec` that is answered here.
pub const KIND: &str = llm::client::SCRIPTED;

/// The scripted model. Everything that it needs is in the request: `sampling` must hold `seed` and the four error rates
/// of [`Rates`].
#[derive(Clone, Copy, Debug, Default)]
pub struct Scripted;

impl Model for Scripted {
    fn complete(&self, request: &Request) -> Result<Completion, ModelError> {
        let rates = Rates::of(&request.model)?;
        let draws = Draws::of(request)?;
        let garbled = |answer: Value| errors::garbled(answer.to_string(), rates, &mut draws.stream("malformed"));
        if request.slot.role == attackers::ROLE {
            return Ok(garbled(attackers::answer(request, rates, &draws)?).into_bytes().into());
        }
        if request.slot.role == templates::ROLE {
            return Ok(garbled(templates::answer(request, rates, &draws)?).into_bytes().into());
        }
        if request.slot.role == evaluator::ROLE {
            return Ok(garbled(evaluator::answer(request, rates, &draws)?).into_bytes().into());
        }
        let page = reader::PromptView::read(request)?;
        let answer = match request.slot.role.as_str() {
            "actor" => patch_answer(&page, actor::propose(&page, &draws)?, rates, &draws),
            "repair" => patch_answer(&page, repair::repair(&page, &draws)?, rates, &draws),
            role if critics::ROLES.contains(&role) => page.answer(
                "critic_review",
                critics::review(&page, role, rates.oversight_rate, asks_for_guards(request), &draws)?,
            ),
            other => return Err(unanswerable(format!("the scripted model has no rules for the role `{other}`"))),
        };
        // A critic that is asked again is given another chance to be readable.
        let again = critics::ROLES.contains(&request.slot.role.as_str()) && page.unreadable.is_some();
        let purpose = if again { "malformed again" } else { "malformed" };
        Ok(errors::garbled(answer.to_string(), rates, &mut draws.stream(purpose)).into_bytes().into())
    }
}

/// Returns `true` if critics hold it against a patch that it adds pressure without a guard.
fn asks_for_guards(request: &Request) -> bool {
    request.model.model != llm::client::SCRIPTED_MODELS[1]
}

fn patch_answer(page: &reader::PromptView, mut patch: Value, rates: Rates, draws: &Draws) -> Value {
    errors::plant(page, &mut patch, rates, &mut draws.stream("errors"));
    page.answer("program_patch", if page.tunes { free::left_free(patch) } else { patch })
}

/// Streams of random numbers for one request.
struct Draws {
    seed: Seed,
    path: [String; 5],
}

impl Draws {
    fn of(request: &Request) -> Result<Draws, ModelError> {
        let seed = errors::required(&request.model, "seed")?;
        if !(0.0..9_007_199_254_740_992.0).contains(&seed) || seed.fract() != 0.0 {
            return Err(unanswerable(format!("sampling.seed is {seed}, expected a whole number from 0 to 2^53")));
        }
        let slot = &request.slot;
        let path = [
            slot.lineage.clone(),
            slot.epoch.to_string(),
            slot.slot.to_string(),
            slot.role.clone(),
            slot.round.to_string(),
        ];
        Ok(Draws { seed: Seed(seed as u64), path })
    }

    fn stream(&self, purpose: &str) -> Stream {
        let [lineage, epoch, slot, role, round] = &self.path;
        self.seed.stream(&["scripted", lineage, epoch, slot, role, round, purpose])
    }

    /// The streams of this slot's actor, with which a repair drafts the patch again if it got no readable one.
    fn of_actor(&self) -> Draws {
        let [lineage, epoch, slot, ..] = self.path.clone();
        Draws { seed: self.seed, path: [lineage, epoch, slot, "actor".into(), "0".into()] }
    }
}

#[cfg(test)]
mod goldens;
#[cfg(test)]
mod tests;
