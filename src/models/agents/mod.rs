//! The LLM agents: the role loop of a proposal (actor, four critics, repair), the attacker agent for scenes, the
//! template agent for descriptions and the world agent for the evaluator, with their prompts, reply schemas and strict parser. It is the only room that asks
//! a model.

mod closed_schema;
pub mod compose;
mod contract_text;
pub mod counsel;
pub mod encounter;
pub mod evolve;
pub mod examples;
mod findings;
pub mod history;
pub mod json_text;
pub mod measures;
mod program_text;
pub mod prompt;
pub mod propose;
pub mod reply;
mod reply_form;
pub mod scene_prompt;
mod tables;
pub mod task;
mod template;
pub mod window;

pub use contract_text::{compact_contract_text, contract_text};
pub use encounter::{Encounter, Moment, Remark};
pub use findings::Findings;
pub use history::{Change, Numbers, PastEdit};
pub use measures::{Acceptance, Diagnostic, Measures, Protocol};
pub use prompt::{Briefing, Detail, Handbook, HandbookParts, Omitted};
pub use propose::{AgentError, Check, End, Proposed, propose};
pub use reply::{Refusal, schema};
pub use tables::{Cluster, FrontPoint};
pub use task::{Context, ParentOutcome, Questions, Target, TargetKind, Task};
pub use template::PromptError;
pub use window::SceneRow;

#[cfg(test)]
pub mod example;
#[cfg(test)]
mod tests;
