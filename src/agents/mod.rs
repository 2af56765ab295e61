//! The LLM agents: the role loop of a proposal (actor, four critics, repair), the attacker agent for scenes and the
//! template agent for descriptions, with their prompts, reply schemas and strict parser. It is the only room that asks
//! a model.

pub mod compose;
pub mod counsel;
pub mod json_text;
pub mod prompt;
pub mod propose;
pub mod reply;
pub mod scene_prompt;
pub mod task;

pub use prompt::{Briefing, PromptError, contract_text};
pub use propose::{AgentError, End, Proposed, propose};
pub use reply::{Refusal, schema};
pub use task::{Cluster, Context, FrontPoint, Outcomes, ParentOutcome, RecentAttempt, Target, TargetKind, Task};

#[cfg(test)]
pub mod example;
#[cfg(test)]
mod tests;
