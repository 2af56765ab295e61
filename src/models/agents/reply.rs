//! The strict reading of replies: a reply has exactly the schema of its role, or it is refused with the place of the
//! difference.

use std::collections::BTreeMap;

use serde::Deserialize;
use serde_json::{Value, json};

use crate::objects::{
    Advice, Composition, FamilyName, Operation, OperationKind, ProgramPatch, Review, Role, SolutionId, WorldPatch,
};

const ACTOR_SCHEMA: &str = include_str!("schemas/actor.json");
const CRITIC_SCHEMA: &str = include_str!("schemas/critic.json");
const ATTACKERS_SCHEMA: &str = include_str!("schemas/attackers.json");
const TEMPLATE_SCHEMA: &str = include_str!("schemas/template.json");
const WORLD_SCHEMA: &str = include_str!("schemas/world.json");
const REPAIR_SCHEMA: &str = include_str!("schemas/repair.json");

// The bounds of the schema files.
const NAME_MAX_CHARS: usize = 200;
const PATH_MAX_CHARS: usize = 400;
const TEXT_MAX_CHARS: usize = 2_000;
const ITEMS_MAX: usize = 32;
const ATTACKERS_MAX: usize = 8;
const COLUMNS_MAX: usize = 200;

/// Why a reply cannot be used. The attempt keeps it.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct Refusal(pub String);

/// JSON schema of a role's reply; for a critic the role is pinned.
pub fn schema(role: Role) -> Value {
    let text = match role {
        Role::Actor => ACTOR_SCHEMA,
        Role::Repair => REPAIR_SCHEMA,
        Role::AttackerAgent => ATTACKERS_SCHEMA,
        Role::TemplateAgent => TEMPLATE_SCHEMA,
        Role::WorldAgent => WORLD_SCHEMA,
        _ => CRITIC_SCHEMA,
    };
    // The schema files are compiled in, and a test reads each of them.
    let mut schema: Value = serde_json::from_str(text).unwrap_or(Value::Null);
    if let Some(pinned) = schema.pointer_mut("/properties/critic_review/properties/role") {
        *pinned = json!({"enum": [role.name()]});
    }
    schema
}

/// The same of a run in which patches may leave constants free.
pub fn schema_with_free(role: Role) -> Value {
    let mut schema = schema(role);
    if let (Role::Actor | Role::Repair, Some(properties)) =
        (role, schema.pointer_mut("/properties/program_patch/properties"))
    {
        let number = json!({"type": "number"});
        let constant = json!({
            "type": "object",
            "additionalProperties": false,
            "required": ["start"],
            "properties": {"start": number, "low": number, "high": number},
        });
        properties["free"] = json!({"type": "object", "additionalProperties": constant});
    }
    schema
}

/// The patch of an actor or of a repair.
pub fn patch(bytes: &[u8], role: Role) -> Result<ProgramPatch, Refusal> {
    patch_of(object(bytes)?, role)
}

/// The same of a run in which patches may leave constants free.
pub fn patch_with_free(bytes: &[u8], role: Role) -> Result<ProgramPatch, Refusal> {
    let mut value = object(bytes)?;
    let members = value.get_mut("program_patch").and_then(Value::as_object_mut);
    let free = members.and_then(|members| members.remove("free")).map(read).transpose()?.unwrap_or_default();
    Ok(ProgramPatch { free, ..patch_of(value, role)? })
}

fn patch_of(value: Value, role: Role) -> Result<ProgramPatch, Refusal> {
    let wire: WirePatchReply = read(value)?;
    name("response_id", &wire.response_id)?;
    let patch = wire.program_patch;
    name("source_baseline", &patch.source_baseline)?;
    name("parent_solution_id", &patch.parent_solution_id)?;
    name("parent_program_hash", &patch.parent_program_hash)?;
    text("hypothesis", &patch.hypothesis, TEXT_MAX_CHARS)?;
    if patch.operations.is_empty() {
        return Err(Refusal("operations: found none, expected at least one".into()));
    }
    items("operations", patch.operations.len())?;
    texts("memory_refs_used", &patch.memory_refs_used, NAME_MAX_CHARS)?;
    texts("cluster_refs_used", &patch.cluster_refs_used, NAME_MAX_CHARS)?;
    match (&patch.repair_summary, role) {
        (Some(summary), Role::Repair) => text("repair_summary", summary, TEXT_MAX_CHARS)?,
        (None, Role::Repair) => return Err(Refusal("repair_summary: missing".into())),
        (Some(_), _) => return Err(Refusal("repair_summary: only a repair has one".into())),
        (None, _) => {}
    }
    let operations = patch.operations.into_iter().enumerate().map(|(place, value)| operation(place, value));
    Ok(ProgramPatch {
        source_baseline: FamilyName::new(patch.source_baseline),
        parent_solution_id: SolutionId::new(patch.parent_solution_id),
        parent_program_hash: patch.parent_program_hash,
        operations: operations.collect::<Result<_, _>>()?,
        hypothesis: patch.hypothesis,
        memory_refs_used: patch.memory_refs_used,
        cluster_refs_used: patch.cluster_refs_used,
        repair_summary: patch.repair_summary,
        free: BTreeMap::new(),
    })
}

/// The review of the critic that was asked.
pub fn review(bytes: &[u8], role: Role) -> Result<Review, Refusal> {
    let value = object(bytes)?;
    let wire: WireReviewReply = read(value)?;
    name("response_id", &wire.response_id)?;
    let review = wire.critic_review;
    if review.role != role.name() {
        return Err(Refusal(format!("role: found `{}`, expected `{}`", review.role, role.name())));
    }
    if review.scope != "pre_simulation" {
        return Err(Refusal(format!("scope: found `{}`, expected `pre_simulation`", review.scope)));
    }
    texts("blockers", &review.blockers, TEXT_MAX_CHARS)?;
    texts("repair_hints", &review.repair_hints, TEXT_MAX_CHARS)?;
    texts("risk_tags", &review.risk_tags, NAME_MAX_CHARS)?;
    Ok(Review {
        role,
        decision: review.decision,
        blockers: review.blockers,
        repair_hints: review.repair_hints,
        risk_tags: review.risk_tags,
        scope: review.scope,
    })
}

/// The attacker agent's answer: who should attack in a scene. It is checked elsewhere whether these vehicles exist.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Choice {
    /// Ids of vehicles, the leader first.
    pub attackers: Vec<String>,
    /// Why, in the model's words.
    pub reason: String,
}

/// The choice of the attacker agent.
pub fn attackers(bytes: &[u8]) -> Result<Choice, Refusal> {
    let wire: WireChoiceReply = read(object(bytes)?)?;
    name("response_id", &wire.response_id)?;
    let choice = wire.attacker_choice;
    let count = choice.attackers.len();
    if count == 0 || count > ATTACKERS_MAX {
        return Err(Refusal(format!("attackers: found {count} vehicles, expected 1 to {ATTACKERS_MAX}")));
    }
    texts("attackers", &choice.attackers, NAME_MAX_CHARS)?;
    text("reason", &choice.reason, TEXT_MAX_CHARS)?;
    Ok(choice)
}

/// The template agent's answer. It is checked elsewhere whether its words and numbers fit the template.
pub fn template(bytes: &[u8]) -> Result<Composition, Refusal> {
    let wire: WireTemplateReply = read(object(bytes)?)?;
    name("response_id", &wire.response_id)?;
    let template = wire.scenario_template;
    name("behaviour", &template.behaviour)?;
    items("ranges", template.ranges.len())?;
    text("reason", &template.reason, TEXT_MAX_CHARS)?;
    Ok(template)
}

/// The world agent's answer. It is checked elsewhere whether its keys are of the surface and its values in their ranges.
pub fn world(bytes: &[u8]) -> Result<WorldPatch, Refusal> {
    let wire: WireWorldReply = read(object(bytes)?)?;
    name("response_id", &wire.response_id)?;
    let candidate = wire.world_candidate;
    let changes = candidate.proposed_evaluator_configuration;
    if changes.is_empty() {
        return Err(Refusal("proposed_evaluator_configuration: found no key, expected one at least".into()));
    }
    items("proposed_evaluator_configuration", changes.len())?;
    changes.iter().try_for_each(|(key, value)| evaluator_value(key, value))?;
    text("evaluation_hypothesis", &candidate.evaluation_hypothesis, TEXT_MAX_CHARS)?;
    let gain = "expected_judge_metric_improvement";
    text(gain, &candidate.expected_judge_metric_improvement, TEXT_MAX_CHARS)?;
    text("calibration_rationale", &candidate.calibration_rationale, TEXT_MAX_CHARS)?;
    text("audit_routing_policy", &candidate.audit_routing_policy, TEXT_MAX_CHARS)?;
    texts("risk_notes", &candidate.risk_notes, TEXT_MAX_CHARS)?;
    Ok(WorldPatch {
        changes,
        hypothesis: candidate.evaluation_hypothesis,
        expected_gain: candidate.expected_judge_metric_improvement,
        rationale: candidate.calibration_rationale,
        audit_policy: candidate.audit_routing_policy,
        risk_notes: candidate.risk_notes,
    })
}

/// A number, a word or a list of names.
fn evaluator_value(key: &str, value: &Value) -> Result<(), Refusal> {
    name("proposed_evaluator_configuration", key)?;
    let is_name = |item: &Value| item.as_str().is_some_and(|text| name(key, text).is_ok());
    match value {
        Value::Number(_) => Ok(()),
        Value::String(word) => name(key, word),
        Value::Array(list) if list.len() <= COLUMNS_MAX && list.iter().all(is_name) => Ok(()),
        _ => Err(Refusal(format!("{key}: expected a number, a word or a list of at most {COLUMNS_MAX} names"))),
    }
}

// The replies as types: like the nouns, but every field is required.

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct WirePatchReply {
    response_id: String,
    #[serde(deserialize_with = "from_object")]
    program_patch: WirePatch,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct WirePatch {
    source_baseline: String,
    parent_solution_id: String,
    parent_program_hash: String,
    operations: Vec<Value>,
    hypothesis: String,
    memory_refs_used: Vec<String>,
    cluster_refs_used: Vec<String>,
    #[serde(default, deserialize_with = "present")]
    repair_summary: Option<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct WireWorldReply {
    response_id: String,
    #[serde(deserialize_with = "from_object")]
    world_candidate: WireWorldCandidate,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct WireWorldCandidate {
    evaluation_hypothesis: String,
    expected_judge_metric_improvement: String,
    proposed_evaluator_configuration: BTreeMap<String, Value>,
    calibration_rationale: String,
    audit_routing_policy: String,
    risk_notes: Vec<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct WireReviewReply {
    response_id: String,
    #[serde(deserialize_with = "from_object")]
    critic_review: WireReview,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct WireChoiceReply {
    response_id: String,
    #[serde(deserialize_with = "from_object")]
    attacker_choice: Choice,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct WireTemplateReply {
    response_id: String,
    #[serde(deserialize_with = "from_object")]
    scenario_template: Composition,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct WireReview {
    role: String,
    decision: Advice,
    blockers: Vec<String>,
    repair_hints: Vec<String>,
    risk_tags: Vec<String>,
    scope: String,
}

/// A struct from an object only: serde would take an array of its fields as well.
fn from_object<'de, D: serde::Deserializer<'de>, T: serde::de::DeserializeOwned>(input: D) -> Result<T, D::Error> {
    let map = serde_json::Map::deserialize(input)?;
    T::deserialize(Value::Object(map)).map_err(serde::de::Error::custom)
}

/// A field that may be missing but not `null`.
fn present<'de, D: serde::Deserializer<'de>>(input: D) -> Result<Option<String>, D::Error> {
    String::deserialize(input).map(Some)
}

fn object(bytes: &[u8]) -> Result<Value, Refusal> {
    crate::llm::reply::json_object(bytes).map_err(|refusal| Refusal(format!("not exactly one JSON object: {refusal}")))
}

fn read<T: serde::de::DeserializeOwned>(value: Value) -> Result<T, Refusal> {
    serde_json::from_value(value).map_err(|error| Refusal(format!("departs from the reply schema: {error}")))
}

fn operation(index: usize, value: Value) -> Result<Operation, Refusal> {
    let refuse = |what: &str| Refusal(format!("operations[{index}]: {what}"));
    let Value::Object(map) = value else { return Err(refuse("not an object")) };
    let has_null = map.get("value").is_some_and(Value::is_null);
    let operation: Operation =
        serde_json::from_value(Value::Object(map)).map_err(|error| refuse(&error.to_string()))?;
    text("path", &operation.path, PATH_MAX_CHARS).map_err(|why| refuse(&why.0))?;
    match (operation.op, &operation.value) {
        _ if has_null => Err(refuse("value: found null, expected a value")),
        (OperationKind::Remove, Some(_)) => Err(refuse("`remove` has no value")),
        (OperationKind::Add | OperationKind::Replace, None) => Err(refuse("`add` and `replace` need a value")),
        _ => Ok(operation),
    }
}

fn name(field: &str, found: &str) -> Result<(), Refusal> {
    text(field, found, NAME_MAX_CHARS)
}

fn text(field: &str, found: &str, chars_max: usize) -> Result<(), Refusal> {
    let length = found.chars().count();
    if length == 0 || length > chars_max {
        return Err(Refusal(format!("{field}: found {length} characters, expected 1 to {chars_max}")));
    }
    Ok(())
}

fn texts(field: &str, found: &[String], chars_max: usize) -> Result<(), Refusal> {
    items(field, found.len())?;
    found.iter().try_for_each(|item| text(field, item, chars_max))
}

fn items(field: &str, count: usize) -> Result<(), Refusal> {
    if count > ITEMS_MAX {
        return Err(Refusal(format!("{field}: found {count} items, expected at most {ITEMS_MAX}")));
    }
    Ok(())
}
