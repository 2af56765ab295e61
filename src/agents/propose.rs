//! Actor-critic program mutation (paper, alg:actor_critic_mutation): actor, then rounds of four critics and a repair.
//!
//! There is a patch only if all four critics approved it. An unusable reply of a critic counts as `repair` with a
//! blocker that says so. It never counts as `reject`, so that one garbled answer does not end a proposal while rounds
//! are left. After an unusable reply of the actor or a repair the round has no patch; the next repair sees the text.

use std::collections::BTreeMap;

use super::{
    prompt::{PromptError, Subject, patch_text, request},
    reply::{self, Refusal},
    task::Task,
};
use crate::{
    llm::{Ask, AskError, ModelSpec, Reply},
    objects::{Advice, Exchange, ProgramPatch, Proposal, Review, Role, Round},
};

/// How the role loop ended.
#[derive(Clone, Debug, PartialEq)]
pub enum End {
    /// All critics approved; the gates are next.
    Patch(ProgramPatch),
    /// There is no patch to go on with.
    Declined {
        /// Why not.
        reason: String,
    },
}

/// The record of the loop and its end.
#[derive(Clone, Debug, PartialEq)]
pub struct Proposed {
    /// Everything that was asked and answered.
    pub proposal: Proposal,
    /// How it ended.
    pub end: End,
}

/// The loop could not be finished. A useless answer of a model is not an error.
#[derive(Debug, thiserror::Error)]
pub enum AgentError {
    /// There is no answer.
    #[error(transparent)]
    Ask(#[from] AskError),
    /// A prompt could not be written.
    #[error(transparent)]
    Prompt(#[from] PromptError),
    /// The experiment names no model for a role.
    #[error("no model for the role `{role}`: name one under [models.{role}] in the experiment file")]
    NoModel {
        /// The role.
        role: &'static str,
    },
}

/// Asks actor, critics and repair for one patch. It records every exchange, also the unusable ones.
pub fn propose(task: &Task<'_>, ask: &dyn Ask) -> Result<Proposed, AgentError> {
    let mut talk = Talk { task, ask, exchanges: vec![] };
    let mut rounds = vec![];
    let mut draft = talk.patch(Role::Actor, 0, &Subject::None)?;
    for round in 0..=task.max_repair_rounds {
        let (patch, text, reviews) = match &draft {
            Draft::Patch(patch) => {
                let text = patch_text(patch)?;
                let reviews = talk.reviews(round, &text)?;
                (Some(patch.clone()), text, reviews)
            }
            Draft::Unreadable { .. } => (None, String::new(), vec![]),
        };
        rounds.push(Round { patch, reviews });
        let last = round == task.max_repair_rounds;
        if let Some(end) = verdict(&draft, &rounds[rounds.len() - 1].reviews, last) {
            return Ok(Proposed { proposal: Proposal { exchanges: talk.exchanges, rounds }, end });
        }
        let subject = match &draft {
            Draft::Patch(_) => Subject::Repair { patch: &text, reviews: &rounds[rounds.len() - 1].reviews },
            Draft::Unreadable { reply, refusal } => Subject::Unreadable { reply, refusal: &refusal.0 },
        };
        draft = talk.patch(Role::Repair, round + 1, &subject)?;
    }
    unreachable!("the last round always has a verdict")
}

/// The result of the last answer, with which a round starts.
enum Draft {
    Patch(ProgramPatch),
    Unreadable { reply: Vec<u8>, refusal: Refusal },
}

/// The end, if this is the last round. A repair after it would never be reviewed, so none is requested.
fn verdict(draft: &Draft, reviews: &[Review], last: bool) -> Option<End> {
    let declined = |reason: String| Some(End::Declined { reason });
    match draft {
        Draft::Unreadable { refusal, .. } if last => declined(format!("no readable patch: {refusal}")),
        Draft::Unreadable { .. } => None,
        Draft::Patch(patch) if reviews.iter().all(|r| r.decision == Advice::Approve) => Some(End::Patch(patch.clone())),
        Draft::Patch(_) => match reviews.iter().find(|r| r.decision == Advice::Reject) {
            Some(review) => declined(format!("rejected by {}: {}", review.role.name(), first_blocker(review))),
            None if last => declined(format!("still blocked after the last repair: {}", open_blockers(reviews))),
            None => None,
        },
    }
}

fn first_blocker(review: &Review) -> &str {
    review.blockers.first().map_or("no blocker named", String::as_str)
}

fn open_blockers(reviews: &[Review]) -> String {
    let open = reviews.iter().filter(|r| r.decision != Advice::Approve);
    open.map(|r| format!("{}: {}", r.role.name(), first_blocker(r))).collect::<Vec<_>>().join("; ")
}

/// The conversation of one slot.
struct Talk<'a> {
    task: &'a Task<'a>,
    ask: &'a dyn Ask,
    exchanges: Vec<Exchange>,
}

impl Talk<'_> {
    fn patch(&mut self, role: Role, round: u32, subject: &Subject<'_>) -> Result<Draft, AgentError> {
        let (reply, read) = self.exchange(role, round, subject, |bytes| reply::patch(bytes, role))?;
        Ok(match read {
            Ok(patch) => Draft::Patch(patch),
            Err(refusal) => Draft::Unreadable { reply: reply.bytes, refusal },
        })
    }

    fn reviews(&mut self, round: u32, patch: &str) -> Result<Vec<Review>, AgentError> {
        let subject = Subject::Review { patch };
        let one = |role| {
            let (_, read) = self.exchange(role, round, &subject, |bytes| reply::review(bytes, role))?;
            Ok(read.unwrap_or_else(|refusal| unreadable_review(role, &refusal)))
        };
        Role::CRITICS.into_iter().map(one).collect()
    }

    /// Asks, reads, records.
    fn exchange<T>(
        &mut self,
        role: Role,
        round: u32,
        subject: &Subject<'_>,
        read: impl Fn(&[u8]) -> Result<T, Refusal>,
    ) -> Result<(Reply, Result<T, Refusal>), AgentError> {
        let model = model_of(self.task.models, role)?;
        let reply = self.ask.ask(&request(self.task, model, role, round, subject)?)?;
        let answer = read(&reply.bytes);
        self.exchanges.push(Exchange {
            role,
            round,
            request: reply.request,
            response: reply.response,
            model: model.name.clone(),
            refusal: answer.as_ref().err().map(ToString::to_string),
        });
        Ok((reply, answer))
    }
}

fn model_of(models: &BTreeMap<Role, ModelSpec>, role: Role) -> Result<&ModelSpec, AgentError> {
    models.get(&role).ok_or(AgentError::NoModel { role: role.name() })
}

fn unreadable_review(role: Role, refusal: &Refusal) -> Review {
    Review {
        role,
        decision: Advice::Repair,
        blockers: vec![format!("this reviewer's reply was unreadable: {refusal}")],
        repair_hints: vec![],
        risk_tags: vec!["unreadable_review".into()],
        scope: "pre_simulation".into(),
    }
}
