//! Composition of the parent of a lineage whose family takes templates: the template agent is asked for each kind of
//! scenario that the experiment describes, before the parent is adopted.

use super::{
    RunError,
    desk::Desk,
    progress::Progress,
    study::{LineageSpec, Study},
};
use crate::agents::{
    AgentError,
    compose::{Order, compose},
};
use crate::objects::{Composed, Program, Role, event::kind};

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
        let event: Composed = compose(&order, &desk.tools.meter.asking(desk.tools.ask, &spec.id))?;
        desk.log.append(kind::COMPOSED, &event)?;
        (desk.watch)(Progress::Composed { template: event.name(), used: event.template.is_some() });
        composed.push(event);
    }
    study.composed_parent(spec, &composed)
}
