//! Actor-critic program mutation (paper, alg:actor_critic_mutation): actor, then rounds of four critics and a repair.
//!
//! Each readable patch is run through the gates before its critics are asked: they and the repair are told what the gates
//! say. A patch goes on if no critic objects and the gates let it through. A critic whose reply is unusable is asked once
//! more and then abstains: it has no say in the round, and never uses one up. After an unusable reply of the actor or a
//! repair the round has no patch; the next repair sees the text. As the paper has it (`[proposals]`), the gates are asked
//! after the loop, and an unusable review or patch ends it.

use std::cell::RefCell;
use std::collections::BTreeMap;

use super::{
    findings::{Findings, for_repair},
    prompt::{Subject, request},
    reply::{self, Refusal},
    task::Task,
    template::PromptError,
};
use crate::{
    llm::{Ask, AskError, DraftJudge, ModelSpec, Reply, Tried},
    objects::{
        Advice, Exchange, GatesAsked, ProgramPatch, Proposal, Review, Role, Round, UnreadableCritic, UnreadablePatch,
    },
};

/// How the role loop ended.
#[derive(Clone, Debug, PartialEq)]
pub enum End {
    /// No critic objects; the gates are next.
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

/// Check of a patch by the gates, with the error type of whoever runs them.
pub type Check<'a, E> = dyn Fn(&ProgramPatch) -> Result<Findings, E> + 'a;

/// Asks actor, critics and repair for one patch. It records every exchange, also the unusable ones. `check` runs the gates
/// on each readable patch before its critics are asked.
pub fn propose<E: From<AgentError>>(task: &Task<'_>, ask: &dyn Ask, check: &Check<'_, E>) -> Result<Proposed, E> {
    let mut talk = Talk { task, ask, exchanges: vec![] };
    let mut rounds: Vec<Round> = vec![];
    let mut draft = talk.patch(Role::Actor, 0, &Subject::None, check)?;
    for round in 0..=task.max_repair_rounds {
        let last = round == task.max_repair_rounds;
        let next = match &draft {
            Draft::Patch(patch) => {
                let gates_first = task.gates == GatesAsked::BeforeCritics;
                let findings = gates_first.then(|| check(patch)).transpose()?;
                let text = task.briefing.patch_text(patch).map_err(AgentError::from)?;
                let (reviews, unreadable) = talk.reviews(round, &text, findings.as_ref())?;
                let passed = findings.as_ref().is_none_or(|findings| findings.gates.passed());
                let blocked = unreadable.filter(|_| task.unreadable_critic == UnreadableCritic::Blocks);
                let end = match blocked {
                    Some(reason) => Some(End::Declined { reason }),
                    None => verdict(patch, &reviews, passed, last),
                };
                rounds.push(Round { patch: Some(patch.clone()), reviews: reviews.clone() });
                match end {
                    Some(end) => Err(end),
                    None => {
                        let subject = Subject::Repair { patch: &text, reviews: &reviews, findings: findings.as_ref() };
                        Ok(talk.patch(Role::Repair, round + 1, &subject, check)?)
                    }
                }
            }
            Draft::Unreadable { reply, refusal } => {
                rounds.push(Round { patch: None, reviews: vec![] });
                if last || task.unreadable_patch == UnreadablePatch::Ends {
                    Err(End::Declined { reason: format!("no readable patch: {refusal}") })
                } else {
                    let subject = Subject::Unreadable { reply, refusal: &refusal.0 };
                    Ok(talk.patch(Role::Repair, round + 1, &subject, check)?)
                }
            }
        };
        match next {
            Ok(repaired) => draft = repaired,
            Err(end) => {
                return Ok(Proposed { proposal: Proposal { exchanges: talk.exchanges, rounds, tuned: None }, end });
            }
        }
    }
    unreachable!("the last round always has an end")
}

/// The result of the last answer, with which a round starts.
enum Draft {
    Patch(ProgramPatch),
    Unreadable { reply: Vec<u8>, refusal: Refusal },
}

/// The end of a round with a patch; `None` asks for a repair. A repair after the last round would never be reviewed, so
/// none is requested. A patch that no critic objects to goes on even where a gate refuses it in the last round: then it is
/// that gate's exit.
fn verdict(patch: &ProgramPatch, reviews: &[Review], passed: bool, last: bool) -> Option<End> {
    let declined = |reason: String| Some(End::Declined { reason });
    if let Some(review) = reviews.iter().find(|r| r.decision == Advice::Reject) {
        return declined(format!("rejected by {}: {}", review.role.name(), first_blocker(review)));
    }
    let approved = reviews.iter().all(|r| r.decision == Advice::Approve);
    match (approved, last) {
        (true, _) if passed || last => Some(End::Patch(patch.clone())),
        (false, true) => declined(format!("still blocked after the last repair: {}", open_blockers(reviews))),
        _ => None,
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
    /// A patch, drafts of which may be tried against the gates before.
    fn patch<E: From<AgentError>>(
        &mut self,
        role: Role,
        round: u32,
        subject: &Subject<'_>,
        check: &Check<'_, E>,
    ) -> Result<Draft, E> {
        let model = model_of(self.task.models, role)?;
        let judge = Judged { model, role, tunes: self.task.tunes, check, failed: RefCell::new(None) };
        let read = reader(self.task.tunes);
        let answered = self.exchange(role, round, subject, Some(&judge), |bytes| read(bytes, role));
        if let Some(error) = judge.failed.into_inner() {
            return Err(error);
        }
        let (reply, read) = answered?;
        Ok(match read {
            Ok(patch) => Draft::Patch(patch),
            Err(refusal) => Draft::Unreadable { reply: reply.bytes, refusal },
        })
    }

    /// The critics' reviews, and who gave no readable one: that one is not among them.
    fn reviews(
        &mut self,
        round: u32,
        patch: &str,
        findings: Option<&Findings>,
    ) -> Result<(Vec<Review>, Option<String>), AgentError> {
        let (mut reviews, mut unreadable) = (Vec::with_capacity(self.task.critics.len()), None);
        for &role in self.task.critics {
            match self.review(role, round, patch, findings)? {
                Ok(review) => reviews.push(review),
                Err(refusal) => {
                    unreadable = unreadable.or(Some(format!("no readable review by {}: {refusal}", role.name())))
                }
            }
        }
        Ok((reviews, unreadable))
    }

    /// One critic's review. An unusable answer is shown to the critic once more, where it may abstain after another one.
    fn review(
        &mut self,
        role: Role,
        round: u32,
        patch: &str,
        findings: Option<&Findings>,
    ) -> Result<Result<Review, Refusal>, AgentError> {
        let read = |bytes: &[u8]| reply::review(bytes, role);
        let (reply, first) =
            self.exchange(role, round, &Subject::Review { patch, findings, unusable: None }, None, read)?;
        let Err(refusal) = &first else { return Ok(first) };
        if self.task.unreadable_critic == UnreadableCritic::Blocks {
            return Ok(first);
        }
        let unusable = Some((reply.bytes.as_slice(), refusal.0.as_str()));
        let (_, second) = self.exchange(role, round, &Subject::Review { patch, findings, unusable }, None, read)?;
        Ok(second)
    }

    /// Asks, reads, records.
    fn exchange<T>(
        &mut self,
        role: Role,
        round: u32,
        subject: &Subject<'_>,
        judge: Option<&dyn DraftJudge>,
        read: impl Fn(&[u8]) -> Result<T, Refusal>,
    ) -> Result<(Reply, Result<T, Refusal>), AgentError> {
        let model = model_of(self.task.models, role)?;
        let asked = request(self.task, model, role, round, subject)?;
        let reply = self.ask.ask_with(&asked, judge)?;
        let (bytes, unwrapped) = asked.model.opened(&reply.bytes);
        let answer = read(bytes);
        self.exchanges.push(Exchange {
            role,
            round,
            request: reply.request,
            response: reply.response,
            model: asked.model.name.clone(),
            metadata: reply.sealed_metadata,
            unwrapped,
            refusal: answer.as_ref().err().map(ToString::to_string),
        });
        Ok((reply, answer))
    }
}

/// A draft before the same reader and the same gates as an answer.
struct Judged<'a, E> {
    model: &'a ModelSpec,
    role: Role,
    tunes: bool,
    check: &'a Check<'a, E>,
    /// Why the gates could not be asked: it ends the loop once the question is answered.
    failed: RefCell<Option<E>>,
}

impl<E> DraftJudge for Judged<'_, E> {
    fn tried(&self, draft: &[u8]) -> Tried {
        let refused = |says: String| Tried { passes: false, says };
        let patch = match reader(self.tunes)(self.model.opened(draft).0, self.role) {
            Err(refusal) => return refused(format!("it cannot be read: {refusal}")),
            Ok(patch) => patch,
        };
        match (self.check)(&patch) {
            Ok(findings) => Tried { passes: findings.gates.passed(), says: for_repair(Some(&findings)).to_string() },
            Err(error) => {
                self.failed.borrow_mut().get_or_insert(error);
                refused("the gates could not be asked; the recording says why when it ends".into())
            }
        }
    }
}

/// How a run reads patches: with free constants where a numeric search sets them.
fn reader(tunes: bool) -> fn(&[u8], Role) -> Result<ProgramPatch, Refusal> {
    if tunes { reply::patch_with_free } else { reply::patch }
}

fn model_of(models: &BTreeMap<Role, ModelSpec>, role: Role) -> Result<&ModelSpec, AgentError> {
    models.get(&role).ok_or(AgentError::NoModel { role: role.name() })
}
