//! The template agent: composes a scenario template from a description (ChatScene's step from text to snippets).
//!
//! An unusable answer is recorded with its reason and shown to the agent, a usable one is tried in the simulator and its outcome is
//! shown. When the rounds are used up, the template that made the ego fail most often is taken; without any, the published one stays.

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
    objects::{
        Composed, Composition, Exchange, LineageId, Role,
        composition::{TemplateForm, TemplateTrial},
    },
};

/// One description.
#[derive(Clone, Copy, Debug)]
pub struct Order<'a> {
    /// Lineage whose parent is composed.
    pub lineage: &'a LineageId,
    /// Index of the kind among the family's kinds: the draw slot of its questions.
    pub slot: u32,
    /// Choices that may be made.
    pub form: &'a TemplateForm,
    /// The scenario in words.
    pub description: &'a str,
    /// Most questions.
    pub rounds: u32,
    /// Model that is asked.
    pub model: &'a ModelSpec,
}

/// Asks until a template makes the ego fail in every scene in which it was tried, or the rounds are used up. `tried` says what the
/// simulator makes of a template.
///
/// # Errors The errors of asking and of `tried`. A useless answer of a model is not an error.
pub fn compose<E: From<AgentError>>(
    order: &Order<'_>,
    ask: &dyn Ask,
    tried: &dyn Fn(&Composition) -> Result<TemplateTrial, E>,
) -> Result<Composed, E> {
    let shown = shown(order).map_err(AgentError::from)?;
    let (mut exchanges, mut trials, mut refused): (Vec<Exchange>, Vec<TemplateTrial>, Option<String>) =
        (vec![], vec![], None);
    for round in 0..order.rounds {
        let asked = request(order, &shown, round, refused.as_deref(), &trials).map_err(AgentError::from)?;
        let reply = ask.ask(&asked).map_err(AgentError::from)?;
        let (bytes, unwrapped) = asked.model.opened(&reply.bytes);
        let answer = reply::template(bytes).and_then(|template| usable(order, template, &trials));
        refused = answer.as_ref().err().map(ToString::to_string);
        exchanges.push(Exchange {
            role: Role::TemplateAgent,
            round,
            request: reply.request,
            response: reply.response,
            model: asked.model.name.clone(),
            metadata: reply.sealed_metadata,
            unwrapped,
            refusal: refused.clone(),
        });
        if let Ok(template) = answer {
            let trial = tried(&template)?;
            let done = !trial.leaves_room();
            trials.push(trial);
            if done {
                break;
            }
        }
    }
    // The last of the largest in reverse order is the first in theirs.
    let best = trials.iter().rev().max_by_key(|trial| trial.collided);
    Ok(Composed {
        template: best.map(|trial| trial.template.clone()),
        trials,
        lineage: order.lineage.clone(),
        kind: order.form.kind.into(),
        description: order.description.into(),
        exchanges,
    })
}

/// The template, if it fits the form and is not one that was tried.
fn usable(order: &Order<'_>, template: Composition, trials: &[TemplateTrial]) -> Result<Composition, reply::Refusal> {
    let same = |trial: &TemplateTrial| {
        trial.template.behaviour == template.behaviour && trial.template.ranges == template.ranges
    };
    match order.form.fault(&template) {
        Some(fault) => Err(reply::Refusal(fault)),
        None if trials.iter().any(same) => Err(reply::Refusal("this template was tried before".into())),
        None => Ok(template),
    }
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

fn request(
    order: &Order<'_>,
    shown: &Text,
    round: u32,
    refused: Option<&str>,
    trials: &[TemplateTrial],
) -> Result<Request, PromptError> {
    let tried = (!trials.is_empty()).then(|| ("Tried", json!(trials)));
    let blocks = refused.map(|refusal| ("Refused", json!({"refusal": refusal}))).into_iter().chain(tried).collect();
    let (lineage, slot, model) = (order.lineage, order.slot, order.model);
    Aside { lineage, epoch: 0, slot, role: Role::TemplateAgent, round, model, shown }.request(&[], blocks)
}
