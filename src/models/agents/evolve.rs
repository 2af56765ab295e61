//! The world agent: proposes a change of the world evaluator's configuration from an audit of it (paper, algorithm
//! world_agent_update). An answer that is no patch of the update surface is recorded with its reason, shown to the agent, and
//! asked for again while rounds are left.

use std::collections::BTreeMap;

use serde_json::{Value, json};

use super::{
    AgentError,
    json_text::{dense_json, lean_json},
    prompt::{Aside, rounded},
    reply,
    template::{PromptError, fill},
};
use crate::{
    llm::{Ask, ModelSpec, Text},
    objects::{
        Exchange, FeatureGroup, FeatureSchema, LineageId, Role, SurfaceKey, WorldAudit, WorldConfiguration,
        WorldEvolved, WorldPatch, surface_values, world_audit::WORLD_LINE,
    },
};

/// One turn of the evaluator.
#[derive(Clone, Copy, Debug)]
pub struct Turn<'a> {
    /// The epoch that was settled last.
    pub epoch: u32,
    /// The configuration that a patch changes.
    pub active: &'a WorldConfiguration,
    /// Columns that it may leave out.
    pub schema: &'a FeatureSchema,
    /// Keys that a patch may name.
    pub surface: &'a [SurfaceKey],
    /// Known facts about the active configuration.
    pub audit: &'a WorldAudit,
    /// All earlier turns, the oldest first.
    pub earlier: &'a [WorldEvolved],
    /// Most questions.
    pub rounds: u32,
    /// Model that is asked.
    pub model: &'a ModelSpec,
}

/// Every question of the turn, and the first patch that could be used, with what it makes of the configuration.
pub type Evolution = (Vec<Exchange>, Option<(WorldPatch, WorldConfiguration)>);

/// Asks until an answer is a patch that `usable` lets through, or the rounds are used up.
///
/// # Errors
/// The errors of asking. A useless answer of a model is not an error.
pub fn evolve(
    turn: &Turn<'_>,
    ask: &dyn Ask,
    usable: &dyn Fn(&WorldPatch) -> Result<WorldConfiguration, String>,
) -> Result<Evolution, AgentError> {
    let (lineage, shown) = (LineageId::new(WORLD_LINE), shown(turn)?);
    let (mut exchanges, mut refused): (Vec<Exchange>, Option<String>) = (vec![], None);
    for round in 0..turn.rounds {
        let (epoch, role, model) = (turn.epoch, Role::WorldAgent, turn.model);
        let aside = Aside { lineage: &lineage, epoch, slot: 0, role, round, model, shown: &shown };
        let blocks = refused.take().map(|refusal| ("Refused", json!({"refusal": refusal})));
        let asked = aside.request(&[], blocks.into_iter().collect())?;
        let reply = ask.ask(&asked)?;
        let (bytes, unwrapped) = asked.model.opened(&reply.bytes);
        let read = reply::world(bytes).map_err(|refusal| refusal.0);
        let answer = read.and_then(|patch| usable(&patch).map(|changed| (patch, changed)));
        refused = answer.as_ref().err().cloned();
        exchanges.push(Exchange {
            role,
            round,
            request: reply.request,
            response: reply.response,
            model: asked.model.name.clone(),
            metadata: reply.sealed_metadata,
            unwrapped,
            refusal: refused.clone(),
        });
        if let Ok(found) = answer {
            return Ok((exchanges, Some(found)));
        }
    }
    Ok((exchanges, None))
}

/// The evaluator as all rounds of a turn are shown it.
fn shown(turn: &Turn<'_>) -> Result<Text, PromptError> {
    let key = |key: &SurfaceKey| (key.name.to_string(), json!([key.range.describe(), key.meaning]));
    let surface: Value = Value::Object(turn.surface.iter().map(key).collect());
    let of = |group: FeatureGroup| {
        let names = turn.schema.columns.iter().filter(|column| column.group == group).map(|column| &column.name);
        (group.name(), names.map(String::as_str).collect::<Vec<&str>>().join(" "))
    };
    let columns: BTreeMap<&str, String> =
        FeatureGroup::ALL.into_iter().map(of).filter(|(_, names)| !names.is_empty()).collect();
    let audit = serde_json::to_value(turn.audit)
        .map_err(|error| PromptError { template: "world.md", reason: error.to_string() })?;
    let earlier: Vec<Value> = turn.earlier.iter().map(evolved_shown).collect();
    let blocks = json!({
        "epoch": turn.audit.before_epoch,
        "active": lean_json(&surface_values(turn.active, turn.schema, turn.surface)),
        "surface": dense_json(&surface, 1),
        "columns": dense_json(&json!(columns), 1),
        "audit": dense_json(&rounded(audit), 2),
        "earlier": dense_json(&earlier.into(), 1),
    });
    let mut shown = fill("world.md", &blocks)?;
    if turn.active.pairs.is_some() {
        shown.push_str(OF_PAIRS);
    }
    Ok(shown.into())
}

/// Text for the agent where the evaluator predicts pairs, besides the usual text.
const OF_PAIRS: &str = "
## This evaluator predicts pairs
It is a ridge line over rows of a candidate in one scene, and predicts attack and realism of that pair; means over the scenes are the
candidate's. Groups besides: `ego` (the driver under test), `mechanism` (the program's tags), `realism` (diagnostics that need no rollout),
`calibration` (what earlier predictions of like candidates missed). Its uncertainty in a scene is the standard error of the line there;
`aggregate` is the quantile of them that is the candidate's. Candidates go by value and uncertainty: uncertain ones (above `lambda_u`, or
of a group with fewer labels than `group_labels_min`) are audited, others are turned away where they are predicted to lose more than
`lambda_a` or `lambda_r`, and the rest is selected by rank. Above `abstain_above` the evaluator abstains and expects what the parent does.
`explore` weighs this uncertainty.
";

/// An earlier turn: what was proposed, and what became of it.
fn evolved_shown(turn: &WorldEvolved) -> Value {
    let mut shown = json!({"after_epoch": turn.epoch, "verdict": turn.verdict()});
    if let Some(patch) = &turn.patch {
        shown["changes"] = json!(patch.changes);
    }
    let refusals: Vec<&str> = turn.refusals().collect();
    if !refusals.is_empty() {
        shown["refused"] = json!(refusals);
    }
    if let Some(judgement) = &turn.judgement {
        let objections: Vec<&str> = judgement.objections.iter().map(|objection| objection.says.as_str()).collect();
        shown["objections"] = json!(objections);
    }
    shown
}
