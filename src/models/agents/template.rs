//! The templates of prompts, and how they are filled.

use std::sync::LazyLock;

use minijinja::{Environment, UndefinedBehavior};
use serde_json::Value;

/// A prompt could not be written, because of a bug in a template or a value that JSON cannot hold.
#[derive(Clone, Debug, thiserror::Error)]
#[error("prompt `{template}` cannot be filled: {reason}; check src/models/agents/prompts and the values of the task")]
pub struct PromptError {
    /// File name of the template.
    pub template: &'static str,
    /// Fault of the template.
    pub reason: String,
}

const TEMPLATES: [(&str, &str); 23] = [
    ("handbook.md", include_str!("prompts/handbook.md")),
    ("objectives_metadrive.md", include_str!("prompts/objectives_metadrive.md")),
    ("objectives_safebench.md", include_str!("prompts/objectives_safebench.md")),
    ("actor.md", include_str!("prompts/actor.md")),
    ("structural_critic.md", include_str!("prompts/structural_critic.md")),
    ("attack_critic.md", include_str!("prompts/attack_critic.md")),
    ("realism_critic.md", include_str!("prompts/realism_critic.md")),
    ("isolation_critic.md", include_str!("prompts/isolation_critic.md")),
    ("repair.md", include_str!("prompts/repair.md")),
    ("attacker_agent.md", include_str!("prompts/attacker_agent.md")),
    ("template_agent.md", include_str!("prompts/template_agent.md")),
    ("world_agent.md", include_str!("prompts/world_agent.md")),
    ("world.md", include_str!("prompts/world.md")),
    ("template.md", include_str!("prompts/template.md")),
    ("context.md", include_str!("prompts/context.md")),
    ("context_detailed.md", include_str!("prompts/context_detailed.md")),
    ("scene.md", include_str!("prompts/scene.md")),
    ("task.md", include_str!("prompts/task.md")),
    ("handbook_compact.md", include_str!("prompts/handbook_compact.md")),
    ("objectives_metadrive_compact.md", include_str!("prompts/objectives_metadrive_compact.md")),
    ("context_compact.md", include_str!("prompts/context_compact.md")),
    ("role_compact.md", include_str!("prompts/role_compact.md")),
    ("task_compact.md", include_str!("prompts/task_compact.md")),
];

/// A template with its values put in.
pub(super) fn fill(name: &'static str, values: &Value) -> Result<String, PromptError> {
    static ENVIRONMENT: LazyLock<Result<Environment<'static>, PromptError>> = LazyLock::new(environment);
    let failed = |error: minijinja::Error| PromptError { template: name, reason: error.to_string() };
    let template = ENVIRONMENT.as_ref().map_err(PromptError::clone)?.get_template(name).map_err(failed)?;
    template.render(minijinja::value::Serde(values)).map_err(failed)
}

/// The templates, parsed once.
fn environment() -> Result<Environment<'static>, PromptError> {
    let mut environment = Environment::new();
    environment.set_undefined_behavior(UndefinedBehavior::Strict);
    environment.set_auto_escape_callback(|_| minijinja::AutoEscape::None);
    for (template, text) in TEMPLATES {
        environment
            .add_template(template, text)
            .map_err(|error| PromptError { template, reason: error.to_string() })?;
    }
    Ok(environment)
}
