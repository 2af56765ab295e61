//! Prompts: a handbook for each family, a context message for each epoch, a message for each role, a task message for each
//! question. What changes least stands first, so that a provider's cache and a cassette can share it: all roles, slots and epochs of
//! a lineage have one handbook, all roles and slots of an epoch one context.

use std::{
    collections::{BTreeMap, BTreeSet},
    sync::{Arc, LazyLock},
};

use serde::Serialize;
use serde_json::{Value, json};

use super::{
    closed_schema::{ClosedSchemas, Shown, Surface},
    examples::{Examples, examples},
    findings::{self, Findings},
    history::PastEdit,
    json_text::{dense_json, lean_json, stable_json},
    measures::Measures,
    program_text::program_text,
    reply, reply_form, tables,
    task::{Context, ParentOutcome, Questions, Task},
    template::{PromptError, fill},
    window,
};
use crate::{
    adapters::{ADAPTER_VERSION, Contract},
    kernel::{canon::CanonError, num},
    llm::{DrawSlot, Message, ModelSpec, Request, ResponseFormat, Schema, Text},
    objects::{
        Advice, Card, CardKind, LineageId, Objectives, ParameterValue, Program, ProgramPatch, Review, Role, Slot,
    },
};

/// Decimals of objectives, shares and diagnostics in prompts. Parameters of a program are shown as they are.
const SCORE_DECIMALS: u32 = 4;
/// The same in compact questions.
const COMPACT_DECIMALS: u32 = 3;
/// Member with the fields of the parent that a patch in a compact question should have repeated and did not.
const PARENTS: &str = "the parent's";
/// Most bytes of an unreadable reply that a repair sees.
const UNREADABLE_MAX_CHARS: usize = 6_000;

/// What agents are told of free constants, where a run has a numeric search that sets them.
const FREE_CONSTANTS: &str = "A number that nobody can know beforehand may be left to a numeric search: `$name` stands in its place, as a \
    whole value or within an expression, and `free` says of the name its `start`, `low` and `high` in the unit of the place (of a whole \
    value of a parameter or a setting, `low` and `high` may be left out). At most 8; none is fine: `free` is then {}. Gates and critics \
    judge the patch at `start`. Then several settings are simulated in scenes outside the window, and the best one becomes the child. So \
    leave thresholds and times free, and choose the structure: which mechanism, which condition, which quantity.";

fn role_template(role: Role) -> &'static str {
    match role {
        Role::Actor => "actor.md",
        Role::StructuralCritic => "structural_critic.md",
        Role::AttackCritic => "attack_critic.md",
        Role::RealismCritic => "realism_critic.md",
        Role::IsolationCritic => "isolation_critic.md",
        Role::Repair => "repair.md",
        Role::AttackerAgent => "attacker_agent.md",
        Role::TemplateAgent => "template_agent.md",
        Role::WorldAgent => "world_agent.md",
    }
}

/// Parts that a handbook is made of. None of them changes during a run.
#[derive(Clone, Copy, Debug)]
pub struct HandbookParts<'a> {
    /// Interface I_b of the family.
    pub contract: &'a Contract,
    /// The contract as `contract_text` writes it.
    pub contract_text: &'a str,
    /// A program of the family, for examples.
    pub parent: &'a Program,
    /// Private words of the run's other families: using one is an isolation failure.
    pub foreign_vocabulary: &'a [String],
    /// Words that a patch may not use at all.
    pub protected_words: &'a [&'a str],
    /// How programs are labelled and accepted.
    pub measures: &'a Measures,
    /// Parts that an ablation leaves out.
    pub omitted: Omitted,
    /// How the family searches and what the driver under test heeds, in sentences; only in detailed questions.
    pub detail: Option<Detail<'a>>,
}

/// Parts that only a detailed handbook has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Detail<'a> {
    /// Text on what the family's search goes through, what it ranks, and what hides an edit.
    pub search: &'a str,
    /// Text on what holds around the search of every family: what predictions rest on, what filters and laws see.
    pub around: &'a str,
    /// Text on what the driver under test looks at and what it does not; `None` where the run does not say it.
    pub ego: Option<&'a str>,
    /// True if the handbook is that of compact questions.
    pub compact: bool,
}

/// Parts of the system that a handbook does not speak of, because the run does without them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Omitted {
    /// The isolation gate and the words of other families.
    pub isolation: bool,
    /// Rules of the scene-conditioned policy.
    pub rules: bool,
    /// Mechanism modules.
    pub modules: bool,
}

/// The message that stands first in every question to the roles that evolve programs of a family: words, objectives, language,
/// examples, contract.
#[derive(Clone, Debug)]
pub struct Handbook {
    text: Text,
    surface: Arc<Surface>,
    /// Values of the parameters that the contract of a compact handbook shows.
    first: BTreeMap<String, ParameterValue>,
}

impl Handbook {
    /// Writes the handbook out.
    pub fn of(parts: &HandbookParts<'_>) -> Result<Handbook, PromptError> {
        let HandbookParts { contract, contract_text, parent, foreign_vocabulary, protected_words, .. } = *parts;
        let HandbookParts { measures, omitted, detail, .. } = *parts;
        let compact = detail.is_some_and(|detail| detail.compact);
        let Examples { works, rule } = examples(contract, parent, compact);
        let (works, rule) = (works.filter(|_| !omitted.modules), rule.filter(|_| !omitted.rules));
        let blocks = json!({
            "family": contract.family,
            "measures": measures.text(compact)?.trim_end(),
            "limits": contract.limits,
            "protected_words": protected_words.join(" "),
            "filters": contract.operators.get(&Slot::Filter).is_some_and(|kinds| !kinds.is_empty()),
            "examples": {"works": works, "rule": rule},
            "contract": contract_text,
            "isolation": !omitted.isolation,
            "rules": !omitted.rules,
            "modules": !omitted.modules,
            "foreign_words": !omitted.isolation && !foreign_vocabulary.is_empty(),
            "foreign_vocabulary": stable_json(&json!(foreign_vocabulary.join(" "))),
            "detail": detail.map(|detail| json!({"search": detail.search, "around": detail.around, "ego": detail.ego})),
        });
        let surface = Surface {
            contract: contract.clone(),
            rules: !omitted.rules,
            modules: !omitted.modules,
            fixed_bodies: measures.fixed_bodies,
        };
        let text = fill(if compact { "handbook_compact.md" } else { "handbook.md" }, &blocks)?.into();
        Ok(Handbook { text, surface: Arc::new(surface), first: parent.parameters.clone() })
    }

    /// Its text.
    pub fn text(&self) -> &Text {
        &self.text
    }
}

/// The context message of an epoch and the other parts of its questions, written once.
#[derive(Clone, Debug)]
pub struct Briefing {
    lineage: String,
    epoch: u32,
    questions: Questions,
    handbook: Text,
    text: Text,
    /// Values that a patch repeats of its parent: member of the reply -> value.
    repeats: BTreeMap<&'static str, String>,
    /// The schemas of patches closed over this question, for models that are held to them.
    closed: ClosedSchemas,
}

impl Briefing {
    /// Writes the context out.
    pub fn of(context: &Context<'_>) -> Result<Briefing, PromptError> {
        let identity = json!({
            "lineage_id": context.lineage,
            "source_baseline": context.parent.source_family,
            "parent_solution_id": context.parent.solution_id,
            "parent_program_hash": context.parent_hash.to_hex(),
            "ego": context.ego,
        });
        let parent = to_value(context.parent)?;
        let text = match context.questions {
            Questions::Compact => fill("context_compact.md", &compact_blocks(context, parent))?,
            questions => {
                let detailed = !questions.is_plain();
                let mut written = BTreeSet::new();
                let edit = |edit: &PastEdit| {
                    if detailed {
                        edit.shown_beside(&context.parent.solution_id, &parent, &mut written)
                    } else {
                        edit.shown(&context.parent.solution_id)
                    }
                };
                let history: Vec<Value> = context.history.iter().map(edit).collect();
                let blocks = json!({
                    "lineage": context.lineage,
                    "epoch": context.epoch,
                    "identity": dense_json(&identity, 1),
                    "parent": dense_json(&shown_parent(parent), 2),
                    "outcomes": lean_json(&shown_outcomes(context.parent_outcome)),
                    "window": window::table(context.window),
                    "clusters": tables::clusters(context.clusters, false),
                    "front": tables::front(context.front, None),
                    "history": dense_json(&history.into(), 1),
                    "memory": dense_json(&shown_memory(context), 1),
                    "not_shown": context.not_shown,
                });
                fill(if detailed { "context_detailed.md" } else { "context.md" }, &blocks)?
            }
        };
        let text = text.into();
        let handbook = context.handbook.text().clone();
        let repeats = BTreeMap::from([
            ("source_baseline", context.parent.source_family.to_string()),
            ("parent_solution_id", context.parent.solution_id.to_string()),
            ("parent_program_hash", context.parent_hash.to_hex()),
        ]);
        let closed = ClosedSchemas {
            surface: context.handbook.surface.clone(),
            parent: context.parent.clone(),
            shown: Shown {
                repeats: repeats.clone(),
                memory: context.memory.iter().map(|card| card.id.to_string()).collect(),
                clusters: context.clusters.iter().map(|cluster| cluster.name.clone()).collect(),
            },
            made: Default::default(),
        };
        let (lineage, questions) = (context.lineage.to_string(), context.questions);
        Ok(Briefing { lineage, epoch: context.epoch, questions, handbook, text, repeats, closed })
    }

    /// A patch as critics and repair see it. In compact questions what it repeats of its parent is left out, and where it should have,
    /// `the parent's` says what.
    pub fn patch_text(&self, patch: &ProgramPatch) -> Result<String, PromptError> {
        let mut shown = to_value(patch)?;
        if let (true, Some(members)) = (self.questions.is_compact(), shown.as_object_mut()) {
            let is_same = |name: &str, value: &String| members.get(name).and_then(Value::as_str) == Some(value);
            let (same, others): (BTreeMap<_, _>, BTreeMap<_, _>) =
                self.repeats.iter().partition(|(name, value)| is_same(name, value));
            members.retain(|name, _| !same.contains_key(&name.as_str()));
            if !others.is_empty() {
                members.insert(PARENTS.into(), json!(others));
            }
        }
        Ok(dense_json(&shown, 2))
    }

    /// The text that all slots and roles of the epoch share.
    pub fn text(&self) -> &str {
        &self.text
    }
}

/// Subject that a critic or a repair is asked about.
pub enum Subject<'a> {
    /// No patch yet: the actor writes the first one.
    None,
    /// A patch as [`Briefing::patch_text`] writes it, once for all roles that see it.
    Review {
        /// The patch in question, as JSON text.
        patch: &'a str,
        /// Findings of the gates on it; `None` where they are asked after the critics.
        findings: Option<&'a Findings>,
        /// The critic's own answer that could not be used, and why, where it is asked again.
        unusable: Option<(&'a [u8], &'a str)>,
    },
    /// A patch that critics want revised.
    Repair {
        /// The patch in question, as JSON text.
        patch: &'a str,
        /// Reviews that the critics gave it.
        reviews: &'a [Review],
        /// Findings of the gates on it, likewise.
        findings: Option<&'a Findings>,
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
    let Instructions { text, schema, schema_with_free } = instructions(role, task.briefing.questions)?.clone();
    let schema = if task.tunes { schema_with_free } else { schema };
    let messages = vec![
        Message { role: "system".into(), text: task.briefing.handbook.clone() },
        Message { role: "user".into(), text: task.briefing.text.clone() },
        Message { role: "user".into(), text },
        Message { role: "user".into(), text: question(task, role, &slot, subject)?.into() },
    ];
    let model = model.drawn(&slot).clone();
    let refused = |error: CanonError| PromptError { template: role_template(role), reason: error.to_string() };
    let closed = match model.response_format {
        Some(ResponseFormat::JsonSchemaClosed) => task.briefing.closed.of(role).map_err(refused)?,
        _ => None,
    };
    let schema = closed.unwrap_or(schema);
    Ok(Request { adapter_version: ADAPTER_VERSION, slot, model, messages, schema })
}

/// The id that a reply must repeat.
fn response_id(slot: &DrawSlot) -> String {
    format!("{}/e{}s{}/{}/{}", slot.lineage, slot.epoch, slot.slot, slot.role, slot.round)
}

/// A question to an agent outside the role loop.
pub(super) struct Aside<'a> {
    pub lineage: &'a LineageId,
    /// 0 where its subject belongs to no epoch.
    pub epoch: u32,
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
        let slot = DrawSlot { lineage, epoch: self.epoch, slot: self.slot, role, round: self.round };
        let Instructions { text: system, schema, .. } = instructions(self.role, Questions::Plain)?.clone();
        let mut task = json!({"response_id": response_id(&slot)});
        asked.iter().for_each(|(name, value)| task[*name] = (*value).into());
        let block = |(title, value): (&str, Value)| json!({"title": title, "json": stable_json(&value)});
        let blocks: Vec<Value> = blocks.into_iter().map(block).collect();
        let text = task_text("task.md", &slot, stable_json(&task), &blocks, None)?;
        let messages = vec![
            Message { role: "system".into(), text: system },
            Message { role: "user".into(), text: self.shown.clone() },
            Message { role: "user".into(), text: text.into() },
        ];
        let model = self.model.drawn(&slot).clone();
        Ok(Request { adapter_version: ADAPTER_VERSION, slot, model, messages, schema })
    }
}

fn task_text(
    template: &'static str,
    slot: &DrawSlot,
    asked: String,
    blocks: &[Value],
    form: Option<&str>,
) -> Result<String, PromptError> {
    let values = json!({
        "slot": slot.slot, "role": slot.role, "round": slot.round, "task": asked, "blocks": blocks, "form": form,
    });
    fill(template, &values)
}

/// Task of a role: the same in every run of this adapter version.
#[derive(Clone, Debug)]
pub struct Instructions {
    /// Its message.
    pub text: Text,
    /// Schema that its reply must satisfy.
    pub schema: Schema,
    /// The same where patches may leave constants free.
    pub schema_with_free: Schema,
}

/// The instructions of a role, written out once.
pub fn instructions(role: Role, questions: Questions) -> Result<&'static Instructions, PromptError> {
    type All = BTreeMap<(Role, bool), Instructions>;
    static ALL: LazyLock<Result<All, PromptError>> = LazyLock::new(|| {
        let asides = [Role::AttackerAgent, Role::TemplateAgent, Role::WorldAgent];
        let roles = Role::CRITICS.into_iter().chain([Role::Actor, Role::Repair]).chain(asides);
        let all = roles.flat_map(|role| [(role, false), (role, true)]);
        all.map(|(role, compact)| Ok(((role, compact), instruct(role, compact)?))).collect()
    });
    let all = ALL.as_ref().map_err(PromptError::clone)?;
    let unwritten = || PromptError { template: role.name(), reason: "this role has no instructions".into() };
    all.get(&(role, questions.is_compact())).ok_or_else(unwritten)
}

fn instruct(role: Role, compact: bool) -> Result<Instructions, PromptError> {
    let proposes = [Role::Actor, Role::Repair].contains(&role) || Role::CRITICS.contains(&role);
    let name = if compact && proposes { "role_compact.md" } else { role_template(role) };
    let schema = reply::schema(role);
    let values = json!({"form": reply_form::form(&schema, &BTreeMap::new()), "role": role.name()});
    let text = fill(name, &values)?.into();
    let written = |schema| {
        Schema::new(schema).map_err(|error: CanonError| PromptError { template: name, reason: error.to_string() })
    };
    Ok(Instructions { text, schema: written(schema)?, schema_with_free: written(reply::schema_with_free(role))? })
}

fn question(task: &Task<'_>, role: Role, slot: &DrawSlot, subject: &Subject<'_>) -> Result<String, PromptError> {
    let (template, asked) = match task.briefing.questions {
        // The form of the answer holds the `response_id`.
        Questions::Compact => ("task_compact.md", compact_target(task)?),
        _ => ("task.md", stable_json(&json!({"response_id": response_id(slot), "target": task.target}))),
    };
    let block = |title: &str, text: &str| json!({"title": title, "json": text});
    let unreadable = |reply: &[u8], refusal: &str| {
        let text: String = String::from_utf8_lossy(reply).chars().take(UNREADABLE_MAX_CHARS).collect();
        block("Unreadable reply", &stable_json(&json!({"text": text, "refusal": refusal})))
    };
    let blocks = match subject {
        Subject::None => vec![],
        Subject::Review { patch, findings, unusable } => {
            let shown =
                vec![block("Patch", patch), block("Findings", &dense_json(&findings::for_critic(role, *findings), 1))];
            shown.into_iter().chain(unusable.map(|(reply, refusal)| unreadable(reply, refusal))).collect()
        }
        Subject::Repair { patch, reviews, findings } => vec![
            block("Patch", patch),
            block("Reviews", &dense_json(&objections(reviews), 1)),
            block("Findings", &dense_json(&findings::for_repair(*findings), 1)),
        ],
        Subject::Unreadable { reply, refusal } => vec![unreadable(reply, refusal)],
    };
    let free = task.tunes.then(|| block("Free constants", &stable_json(&json!(FREE_CONSTANTS))));
    let blocks: Vec<Value> = blocks.into_iter().chain(free).collect();
    let mut known = task.briefing.repeats.clone();
    known.insert("response_id", response_id(slot));
    known.insert("role", role.name().into());
    let schema = if task.tunes { reply::schema_with_free(role) } else { reply::schema(role) };
    task_text(template, slot, asked, &blocks, Some(&reply_form::form(&schema, &known)))
}

/// `kind: text`, and the instruction below.
fn compact_target(task: &Task<'_>) -> Result<String, PromptError> {
    let target = to_value(task.target)?;
    let field = |name: &str| target[name].as_str().unwrap_or_default().to_string();
    Ok(format!("{}: {}\n{}", field("kind"), field("text"), field("instruction")))
}

/// The values of `context_compact.md`.
fn compact_blocks(context: &Context<'_>, parent: Value) -> Value {
    let mut written = BTreeSet::new();
    let edit = |edit: &PastEdit| edit.compact_row(context.lineage, &context.parent.solution_id, &parent, &mut written);
    let edits: Vec<String> = context.history.iter().map(edit).collect();
    let history = if edits.is_empty() { edits } else { [PastEdit::compact_head()].into_iter().chain(edits).collect() };
    // What the ego heeds stands in the handbook.
    let ego = context.ego.split(';').next().unwrap_or_default();
    json!({
        "lineage": context.lineage,
        "epoch": context.epoch,
        "ego": ego,
        "solution": context.parent.solution_id,
        "parent": program_text(&shown_parent(parent), &context.handbook.first),
        "outcomes": compact_outcomes(context.parent_outcome),
        "window": window::compact_table(context.window),
        "clusters": tables::clusters(context.clusters, true),
        "front": tables::front(context.front, Some(context.lineage)),
        "history": history.join("\n"),
        "memory": compact_memory(context),
        "not_shown": context.not_shown,
    })
}

/// The sums over the window in a line, and diagnostics below 1 in another. The weakest is the lowest of these.
fn compact_outcomes(outcome: Option<&ParentOutcome>) -> String {
    let Some(outcome) = outcome else { return "none yet".into() };
    let short = |x: f64| num::rounded(x, COMPACT_DECIMALS).to_string();
    let Objectives { attack, realism } = outcome.objectives;
    let counted = [
        (Some(outcome.scenes), "scenes"),
        (Some(outcome.failures).filter(|count| *count > 0), "without label"),
        (outcome.near_misses, "near misses"),
    ];
    let counted = counted.into_iter().filter_map(|(count, of)| Some(format!("{} {of}", count?)));
    let sums = [("attack", attack), ("realism", realism), ("coverage", outcome.coverage)];
    let sums = sums.into_iter().map(|(name, x)| format!("{name} {}", short(x))).chain(counted);
    let below = outcome.diagnostics.iter().filter(|(_, value)| num::rounded(**value, COMPACT_DECIMALS) < 1.0);
    let below: Vec<String> = below.map(|(name, value)| format!("{name} {}", short(*value))).collect();
    let lines = [sums.collect::<Vec<_>>().join(", "), below.join(", ")];
    lines.into_iter().filter(|line| !line.is_empty()).collect::<Vec<_>>().join("\n")
}

/// A row a card with the members that `shown_memory` shows; a column that no card fills is left out.
fn compact_memory(context: &Context<'_>) -> String {
    let cards = shown_memory(context);
    let cards: Vec<&Value> = cards.as_array().into_iter().flatten().collect();
    let cell = |card: &Value, name: &str| match &card[name] {
        Value::String(text) => text.clone(),
        Value::Array(words) => words.iter().filter_map(Value::as_str).collect::<Vec<_>>().join(" "),
        _ => String::new(),
    };
    let columns = ["id", "kind", "mechanism_tags", "scene_tags", "of_lineage", "text"];
    let filled = |name: &&&str| cards.iter().any(|card| !card[**name].is_null());
    let columns: Vec<&str> = columns.iter().filter(filled).copied().collect();
    let rows = cards.iter().map(|card| tables::line(columns.iter().map(|name| cell(card, name))));
    let head = (!cards.is_empty()).then(|| columns.join(tables::BAR));
    head.into_iter().chain(rows).collect::<Vec<_>>().join("\n")
}

/// The reviews that object: what a repair must clear.
fn objections(reviews: &[Review]) -> Value {
    let objects = reviews.iter().filter(|review| review.decision != Advice::Approve);
    let shown = |review: &Review| {
        json!({
            "role": review.role, "decision": review.decision, "blockers": review.blockers,
            "repair_hints": review.repair_hints,
        })
    };
    objects.map(shown).collect()
}

/// The parts of the parent that may be edited, without settings that the context's text tells: those that refer to the parameter of
/// their name.
fn shown_parent(mut parent: Value) -> Value {
    for node in parent["operator_graph"].as_object_mut().into_iter().flatten().map(|(_, node)| node) {
        if let Some(settings) = node["settings"].as_object_mut() {
            settings.retain(|name, value| value["parameter"].as_str() != Some(name));
        }
    }
    if let Some(map) = parent.as_object_mut() {
        for inherited in
            ["ancestor_chain", "compile_contract", "lineage_id", "solution_id", "source_family", "generation"]
        {
            map.remove(inherited);
        }
    }
    parent
}

/// A card without its lineage where that is this one, and without the numbers of an attempt that the edit history shows.
fn shown_memory(context: &Context<'_>) -> Value {
    let in_history = |card: &Card| context.history.iter().any(|edit| card.attempt.as_ref() == Some(&edit.attempt));
    let card = |card: &Card| {
        let mut shown = json!({"id": card.id, "kind": card.kind});
        if card.kind == CardKind::Critic || !in_history(card) {
            shown["text"] = json!(card.text);
        }
        // Other kinds have in their text what matters, and detailed histories the scenes.
        let tagged = matches!(card.kind, CardKind::Success | CardKind::Failure);
        for (title, tags) in [("mechanism_tags", &card.mechanism_tags), ("scene_tags", &card.scene_tags)] {
            let elsewhere = title == "scene_tags" && !context.questions.is_plain() && in_history(card);
            if tagged && !elsewhere && !tags.is_empty() {
                shown[title] = json!(tags);
            }
        }
        if card.lineage != *context.lineage {
            shown["of_lineage"] = json!(card.lineage);
        }
        shown
    };
    context.memory.iter().map(card).collect()
}

/// Sums over the window; diagnostics only where they are not 1.
fn shown_outcomes(outcome: Option<&ParentOutcome>) -> Value {
    let Some(outcome) = outcome else { return Value::Null };
    let below = outcome.diagnostics.iter().filter(|(_, value)| num::rounded(**value, SCORE_DECIMALS) < 1.0);
    let mut shown = rounded(json!({
        "attack": outcome.objectives.attack,
        "realism": outcome.objectives.realism,
        "coverage": outcome.coverage,
        "scenes": outcome.scenes,
        "without_label": outcome.failures,
        "diagnostics": below.collect::<BTreeMap<_, _>>(),
        "weakest_diagnostic": outcome.weakest_diagnostic(),
    }));
    if let Some(near) = outcome.near_misses {
        shown["near_misses"] = near.into();
    }
    shown
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
