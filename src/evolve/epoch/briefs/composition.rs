//! Composition of the parent of a lineage whose family takes templates: the template agent is asked for each kind of
//! scenario that the experiment describes, before the parent is adopted.
//!
//! ChatScene begins with a sentence (`[composition]`). For each kind of traffic family the agent answers which behaviour and which
//! ranges say what the description says; it is shown the behaviours and the numbers with their bounds (the family's
//! `asks.templates`). An answer that fits the form is tried: the parent with this template is labelled on the first evolution scenes
//! of its kind, at most as many as a window has. The agent is told what is wrong with an answer, or what the simulator made of the
//! template, and asked again, at most `composition.rounds` times. The template that made the ego fail most often becomes the
//! parent's; without a usable answer the published one stays. From then on patches edit it like everything else.

use super::counsels::Counsels;
use crate::agents::{
    AgentError,
    compose::{Order, compose},
};
use crate::epoch::RunError;
use crate::epoch::labelling::labels::Labelling;
use crate::epoch::setting::desk::Desk;
use crate::epoch::setting::progress::Progress;
use crate::epoch::setting::study::{LineageSpec, Study};
use crate::evaluation::EvaluationError;
use crate::objects::{Composed, Composition, Program, Role, composition::TemplateTrial, event::kind};
use crate::stage::AskTemplates;

/// The parent of a lineage. In families that take templates it is composed, and every composition is an event; what the
/// experiment file sets for the parent stands above what was composed.
pub fn parent(study: &Study, spec: &LineageSpec, desk: &mut Desk<'_>) -> Result<Program, RunError> {
    let (Some(options), Some(asks)) = (&study.composition, study.source(spec)?.asks.templates) else {
        return study.parent(spec);
    };
    if spec.start.is_some() {
        // A program that came as a file brings its templates.
        return study.parent(spec);
    }
    let model = study.models.get(&Role::TemplateAgent);
    let model = model.ok_or(AgentError::NoModel { role: Role::TemplateAgent.name() })?;
    let mut composed = Vec::new();
    for (slot, form) in (0..).zip((asks.forms)()) {
        let Some(description) = options.descriptions.get(form.kind) else { continue };
        let order = Order { lineage: &spec.id, slot, form: &form, description, rounds: options.rounds, model };
        let places = scenes_of(study, asks, form.kind);
        let tried = |template: &Composition| tried(study, spec, desk, &order, template, &places);
        let event = compose(&order, &desk.tools.asking(&spec.id), &tried)?;
        desk.log.append(kind::COMPOSED, &event)?;
        (desk.watch)(Progress::Composed { template: event.name(), used: event.template.is_some() });
        composed.push(event);
    }
    desk.tools.rollouts.flush()?;
    study.composed_parent(spec, &composed)
}

/// The first scenes of a kind among those of evolution, at most as many as a window has.
fn scenes_of(study: &Study, asks: AskTemplates, kind: &str) -> Vec<usize> {
    let of_kind = |place: &usize| (asks.kind_of)(study.scenes[*place].scene()) == Some(kind);
    study.evolution.iter().copied().filter(of_kind).take(study.budget.window).collect()
}

/// The published parent with one composed template, labelled like every program.
fn tried(
    study: &Study,
    spec: &LineageSpec,
    desk: &Desk<'_>,
    order: &Order<'_>,
    template: &Composition,
    places: &[usize],
) -> Result<TemplateTrial, RunError> {
    let alone = Composed {
        lineage: spec.id.clone(),
        kind: order.form.kind.into(),
        description: order.description.into(),
        exchanges: vec![],
        trials: vec![],
        template: Some(template.clone()),
    };
    let program = study.composed_parent(spec, &[alone])?;
    let subject = program.hashed()?;
    let counsels = Counsels::default();
    let labelling = Labelling { study, spec, counsels: &counsels, tools: &desk.tools };
    match labelling.score(subject, places) {
        Ok(score) => Ok(TemplateTrial::of(template.clone(), &score)),
        // No scene of its kind, or none that it can be drawn in: nothing is known of it, and the run goes on.
        Err(RunError::Evaluation(EvaluationError::NoLabel(_))) => Ok(TemplateTrial::unseen(template.clone())),
        Err(error) => Err(error),
    }
}
