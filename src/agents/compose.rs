//! The template agent: composes a scenario template from a description (ChatScene's step from text to snippets).
//!
//! An unusable answer is recorded with its reason and shown to the agent. When the rounds are used up, the published
//! template stays.

use serde_json::json;

use super::{
    AgentError,
    json_text::stable_json,
    prompt::Aside,
    reply,
    template::{PromptError, fill},
};
use crate::{
    llm::{Ask, ModelSpec, Request, Text},
    objects::{Composed, Composition, Exchange, LineageId, Role, composition::TemplateForm},
};

/// One description.
#[derive(Clone, Copy, Debug)]
pub struct Order<'a> {
    /// Whose parent is composed.
    pub lineage: &'a LineageId,
    /// Index of the kind among the family's kinds: the draw slot of its questions.
    pub slot: u32,
    /// What may be chosen.
    pub form: &'a TemplateForm,
    /// The scenario in words.
    pub description: &'a str,
    /// Most questions.
    pub rounds: u32,
    /// Who is asked.
    pub model: &'a ModelSpec,
}

/// Asks until an answer can be used or the rounds are used up.
///
/// # Errors The errors of asking. A useless answer of a model is not an error.
pub fn compose(order: &Order<'_>, ask: &dyn Ask) -> Result<Composed, AgentError> {
    let shown = shown(order)?;
    let (mut exchanges, mut template, mut refused): (Vec<Exchange>, Option<Composition>, Option<String>) =
        (vec![], None, None);
    for round in 0..order.rounds {
        let reply = ask.ask(&request(order, &shown, round, refused.as_deref())?)?;
        let answer = reply::template(&reply.bytes).and_then(|template| match order.form.fault(&template) {
            None => Ok(template),
            Some(fault) => Err(reply::Refusal(fault)),
        });
        refused = answer.as_ref().err().map(ToString::to_string);
        exchanges.push(Exchange {
            role: Role::TemplateAgent,
            round,
            request: reply.request,
            response: reply.response,
            model: order.model.name.clone(),
            refusal: refused.clone(),
        });
        if let Ok(answer) = answer {
            template = Some(answer);
            break;
        }
    }
    Ok(Composed {
        lineage: order.lineage.clone(),
        kind: order.form.kind.into(),
        description: order.description.into(),
        exchanges,
        template,
    })
}

/// The description and the possible choices, written once for all rounds.
fn shown(order: &Order<'_>) -> Result<Text, PromptError> {
    let form = json!({"behaviours": order.form.behaviours, "published_behaviour": order.form.published});
    let blocks = json!({
        "lineage": order.lineage,
        "kind": order.form.kind,
        "description": stable_json(&json!({"text": order.description})),
        "behaviours": stable_json(&form),
        "ranges": stable_json(&json!(order.form.ranges)),
    });
    Ok(fill("template.md", &blocks)?.into())
}

fn request(order: &Order<'_>, shown: &Text, round: u32, refused: Option<&str>) -> Result<Request, PromptError> {
    let blocks = refused.map(|refusal| ("Refused", json!({"refusal": refusal}))).into_iter().collect();
    let (lineage, slot, model) = (order.lineage, order.slot, order.model);
    Aside { lineage, slot, role: Role::TemplateAgent, round, model, shown }.request(&[], blocks)
}
