//! Prompts: a system message for each role, a context message for each epoch, a task message for each question. The first two are
//! equal for every slot, so that a provider and a cassette can share them.

use std::{collections::BTreeMap, sync::LazyLock};

use minijinja::{Environment, UndefinedBehavior};
use serde::Serialize;
use serde_json::{Value, json};

use super::{
    json_text::stable_json,
    reply,
    task::{Context, Outcomes, ParentOutcome, Task},
};
use crate::{
    adapters::{ADAPTER_VERSION, Contract},
    kernel::num,
    llm::{DrawSlot, Message, ModelSpec, Request, Schema, Text},
    objects::{EDITABLE_SURFACE, LineageId, ProgramPatch, Review, Role},
};

/// Decimals of objectives, shares and diagnostics in prompts. Parameters of a program are shown as they are.
const SCORE_DECIMALS: u32 = 4;
/// Most bytes of an unreadable reply that a repair sees.
const UNREADABLE_MAX_CHARS: usize = 6_000;

const PROTECTED: [&str; 8] = [
    "ego policy",
    "scenes and splits",
    "simulator",
    "metrics and labels",
    "archive acceptor",
    "compile contract",
    "ancestors",
    "other lineages",
];

const IO_CONTRACT: &str = include_str!("prompts/io_contract.md");
const LANGUAGE: &str = include_str!("prompts/language.md");

/// A prompt could not be written, because of a bug in a template or a value that JSON cannot hold.
#[derive(Clone, Debug, thiserror::Error)]
#[error("prompt `{template}` cannot be filled: {reason}; check src/agents/prompts and the values of the task")]
pub struct PromptError {
    /// File name of the template.
    pub template: &'static str,
    /// What is wrong with it.
    pub reason: String,
}

const TEMPLATES: [(&str, &str); 12] = [
    ("actor.md", include_str!("prompts/actor.md")),
    ("structural_critic.md", include_str!("prompts/structural_critic.md")),
    ("attack_critic.md", include_str!("prompts/attack_critic.md")),
    ("realism_critic.md", include_str!("prompts/realism_critic.md")),
    ("isolation_critic.md", include_str!("prompts/isolation_critic.md")),
    ("repair.md", include_str!("prompts/repair.md")),
    ("attacker_agent.md", include_str!("prompts/attacker_agent.md")),
    ("template_agent.md", include_str!("prompts/template_agent.md")),
    ("template.md", include_str!("prompts/template.md")),
    ("context.md", include_str!("prompts/context.md")),
    ("scene.md", include_str!("prompts/scene.md")),
    ("task.md", include_str!("prompts/task.md")),
];

fn role_template(role: Role) -> Option<&'static str> {
    Some(match role {
        Role::Actor => "actor.md",
        Role::StructuralCritic => "structural_critic.md",
        Role::AttackCritic => "attack_critic.md",
        Role::RealismCritic => "realism_critic.md",
        Role::IsolationCritic => "isolation_critic.md",
        Role::Repair => "repair.md",
        Role::AttackerAgent => "attacker_agent.md",
        Role::TemplateAgent => "template_agent.md",
        Role::WorldAgent => return None,
    })
}

/// A contract as prompts show it: the same in every epoch, so a run writes it out once.
pub fn contract_text(contract: &Contract) -> String {
    stable_json(&contract.to_prompt_json())
}

/// A patch as critics and repair see it.
pub fn patch_text(patch: &ProgramPatch) -> Result<String, PromptError> {
    Ok(stable_json(&to_value(patch)?))
}

/// The context message of an epoch and the other parts of its questions, written once.
#[derive(Clone, Debug)]
pub struct Briefing {
    lineage: String,
    epoch: u32,
    text: Text,
}

impl Briefing {
    /// Writes the context out.
    pub fn of(context: &Context<'_>) -> Result<Briefing, PromptError> {
        let parent = to_value(context.parent)?;
        let identity = json!({
            "lineage_id": context.lineage,
            "epoch": context.epoch,
            "source_family": context.contract.family,
            "parent_solution_id": context.parent.solution_id,
            "parent_program_hash": context.parent_hash.to_hex(),
            "parent_generation": context.parent.generation,
            "ego": context.ego,
            "editable_surface": EDITABLE_SURFACE,
            "protected": PROTECTED,
        });
        let blocks = json!({
            "lineage": context.lineage,
            "epoch": context.epoch,
            "identity": stable_json(&identity),
            "contract": context.contract_text,
            "foreign_vocabulary": stable_json(&to_value(&context.foreign_vocabulary)?),
            "parent": stable_json(&shown_parent(parent)),
            "memory": stable_json(&shown_memory(context)?),
            "clusters": stable_json(&rounded(to_value(&context.clusters)?)),
            "outcomes": stable_json(&shown_outcomes(context.outcomes)?),
            "front": stable_json(&rounded(to_value(&context.front)?)),
        });
        let text = fill("context.md", &blocks)?.into();
        Ok(Briefing { lineage: context.lineage.to_string(), epoch: context.epoch, text })
    }

    /// The text that all slots and roles of the epoch share.
    pub fn text(&self) -> &str {
        &self.text
    }
}

/// What a critic or a repair is asked about.
pub enum Subject<'a> {
    /// No patch yet: the actor writes the first one.
    None,
    /// A patch as `patch_text` writes it, once for all roles that see it.
    Review {
        /// The patch in question, as JSON text.
        patch: &'a str,
    },
    /// A patch that critics want revised.
    Repair {
        /// The patch in question, as JSON text.
        patch: &'a str,
        /// What the critics said about it.
        reviews: &'a [Review],
    },
    /// An answer that holds no patch.
    Unreadable {
        /// The answer's bytes.
        reply: &'a [u8],
        /// Why it holds none.
        refusal: &'a str,
    },
}

/// The whole question of a role at a place in the loop.
pub fn request(
    task: &Task<'_>,
    model: &ModelSpec,
    role: Role,
    round: u32,
    subject: &Subject<'_>,
) -> Result<Request, PromptError> {
    let lineage = task.briefing.lineage.clone();
    let slot = DrawSlot { lineage, epoch: task.briefing.epoch, slot: task.slot, role: role.name().into(), round };
    let Instructions { system, schema } = instructions(role)?.clone();
    let messages = vec![
        Message { role: "system".into(), text: system },
        Message { role: "user".into(), text: task.briefing.text.clone() },
        Message { role: "user".into(), text: question(task, &slot, subject)?.into() },
    ];
    Ok(Request { adapter_version: ADAPTER_VERSION, slot, model: model.clone(), messages, schema })
}

/// The id that a reply must repeat.
fn response_id(slot: &DrawSlot) -> String {
    format!("{}/e{}s{}/{}/{}", slot.lineage, slot.epoch, slot.slot, slot.role, slot.round)
}

/// A question to an agent outside the role loop, about something that belongs to no epoch.
pub(super) struct Aside<'a> {
    pub lineage: &'a LineageId,
    /// Index of its subject among subjects of the same kind.
    pub slot: u32,
    pub role: Role,
    pub round: u32,
    pub model: &'a ModelSpec,
    /// Its subject: the same text in all rounds.
    pub shown: &'a Text,
}

impl Aside<'_> {
    /// `asked` is put beside the `response_id`; blocks are titles with their values.
    pub fn request(&self, asked: &[(&str, &str)], blocks: Vec<(&str, Value)>) -> Result<Request, PromptError> {
        let (lineage, role) = (self.lineage.to_string(), self.role.name().to_string());
        let slot = DrawSlot { lineage, epoch: 0, slot: self.slot, role, round: self.round };
        let Instructions { system, schema } = instructions(self.role)?.clone();
        let mut task = json!({"response_id": response_id(&slot)});
        asked.iter().for_each(|(name, value)| task[*name] = (*value).into());
        let block = |(title, value): (&str, Value)| json!({"title": title, "json": stable_json(&value)});
        let blocks: Vec<Value> = blocks.into_iter().map(block).collect();
        let text = task_text(&slot, &task, &blocks)?;
        let messages = vec![
            Message { role: "system".into(), text: system },
            Message { role: "user".into(), text: self.shown.clone() },
            Message { role: "user".into(), text: text.into() },
        ];
        Ok(Request { adapter_version: ADAPTER_VERSION, slot, model: self.model.clone(), messages, schema })
    }
}

fn task_text(slot: &DrawSlot, asked: &Value, blocks: &[Value]) -> Result<String, PromptError> {
    let values = json!({
        "slot": slot.slot, "role": slot.role, "round": slot.round, "task": stable_json(asked), "blocks": blocks,
    });
    fill("task.md", &values)
}

/// The system message of a role: the same in every run of this adapter version.
#[derive(Clone, Debug)]
pub struct Instructions {
    /// The system message.
    pub system: Text,
    /// What its reply must satisfy.
    pub schema: Schema,
}

/// The instructions of a role, written out once.
pub fn instructions(role: Role) -> Result<&'static Instructions, PromptError> {
    static ALL: LazyLock<Result<BTreeMap<Role, Instructions>, PromptError>> = LazyLock::new(|| {
        let roles =
            Role::CRITICS.into_iter().chain([Role::Actor, Role::Repair, Role::AttackerAgent, Role::TemplateAgent]);
        roles.map(|role| Ok((role, instruct(role)?))).collect()
    });
    let all = ALL.as_ref().map_err(PromptError::clone)?;
    all.get(&role).ok_or_else(|| no_part(role))
}

fn no_part(role: Role) -> PromptError {
    PromptError { template: role.name(), reason: "this role is asked nothing".into() }
}

fn instruct(role: Role) -> Result<Instructions, PromptError> {
    let name = role_template(role).ok_or_else(|| no_part(role))?;
    let schema = reply::schema(role);
    let values = json!({"io_contract": IO_CONTRACT, "language": LANGUAGE, "schema": stable_json(&schema)});
    let system = fill(name, &values)?.into();
    let schema = Schema::new(schema).map_err(|error| PromptError { template: name, reason: error.to_string() })?;
    Ok(Instructions { system, schema })
}

fn question(task: &Task<'_>, slot: &DrawSlot, subject: &Subject<'_>) -> Result<String, PromptError> {
    let asked = json!({
        "response_id": response_id(slot),
        "target": task.target,
    });
    let block = |title: &str, text: &str| json!({"title": title, "json": text});
    let blocks = match subject {
        Subject::None => vec![],
        Subject::Review { patch } => vec![block("Patch", patch)],
        Subject::Repair { patch, reviews } => {
            vec![block("Patch", patch), block("Reviews", &stable_json(&to_value(reviews)?))]
        }
        Subject::Unreadable { reply, refusal } => {
            let text: String = String::from_utf8_lossy(reply).chars().take(UNREADABLE_MAX_CHARS).collect();
            vec![block("Unreadable reply", &stable_json(&json!({"text": text, "refusal": refusal})))]
        }
    };
    task_text(slot, &asked, &blocks)
}

/// The parent without its ancestors, which grow with every generation and cannot be edited.
fn shown_parent(mut parent: Value) -> Value {
    if let Some(map) = parent.as_object_mut() {
        map.remove("ancestor_chain");
    }
    parent
}

fn shown_memory(context: &Context<'_>) -> Result<Value, PromptError> {
    let cards = context.memory.iter().map(|card| {
        Ok(json!({
            "id": card.id,
            "kind": card.kind,
            "lineage": card.lineage,
            "epoch": card.epoch,
            "text": card.text,
            "mechanism_tags": card.mechanism_tags,
            "scene_tags": card.scene_tags,
        }))
    });
    cards.collect::<Result<Vec<Value>, PromptError>>().map(Value::from)
}

fn shown_outcomes(outcomes: &Outcomes) -> Result<Value, PromptError> {
    let mut value = to_value(outcomes)?;
    let weakest = outcomes.parent.as_ref().and_then(ParentOutcome::weakest_diagnostic);
    if let (Some(weakest), Some(parent)) = (weakest, value["parent"].as_object_mut()) {
        parent.insert("weakest_diagnostic".into(), weakest.into());
    }
    Ok(rounded(value))
}

/// Rounds measured numbers to the declared precision; integers stay as they are.
pub(super) fn rounded(value: Value) -> Value {
    match value {
        Value::Number(number) if number.is_f64() => {
            number.as_f64().map_or(Value::Null, |x| json!(num::rounded(x, SCORE_DECIMALS)))
        }
        Value::Array(items) => items.into_iter().map(rounded).collect(),
        Value::Object(map) => map.into_iter().map(|(key, value)| (key, rounded(value))).collect(),
        other => other,
    }
}

fn to_value(noun: &impl Serialize) -> Result<Value, PromptError> {
    serde_json::to_value(noun).map_err(|error| PromptError { template: "context.md", reason: error.to_string() })
}

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
