//! Composition of the parent of a lineage whose family takes templates: the template agent is asked for each kind of
//! scenario that the experiment describes, before the parent is adopted.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::{
    RunError,
    progress::Progress,
    run::Desk,
    study::{LineageSpec, Study},
};
use crate::agents::{
    AgentError,
    compose::{Order, compose},
};
use crate::families;
use crate::objects::{Composed, Program, Role, event::kind};

/// `[composition]`: what the template agent is asked for.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CompositionOptions {
    /// Most questions a template: the first, and one after each answer that could not be used.
    pub rounds: u32,
    /// Kind of scenario -> what is to happen, in prose. A kind without a description keeps the published template.
    pub descriptions: BTreeMap<String, String>,
}

/// Longest description, characters: it is part of a prompt.
const DESCRIPTION_MAX_CHARS: usize = 2_000;

impl CompositionOptions {
    /// The first field that is out of bounds, with what is expected.
    pub fn fault(&self) -> Option<(String, String)> {
        if !(1..=8).contains(&self.rounds) {
            return Some(("rounds".into(), "1 to 8".into()));
        }
        let kinds: Vec<&str> = families::template_forms().iter().map(|form| form.kind).collect();
        if self.descriptions.is_empty() {
            return Some(("descriptions".into(), format!("one of {} at least", kinds.join(", "))));
        }
        self.descriptions.iter().find_map(|(kind, text)| {
            let place = format!("descriptions.{kind}");
            let length = text.chars().count();
            match kinds.contains(&kind.as_str()) {
                false => Some((place, format!("a kind of scenario: {}", kinds.join(", ")))),
                true if length == 0 || length > DESCRIPTION_MAX_CHARS => {
                    Some((place, format!("1 to {DESCRIPTION_MAX_CHARS} characters, found {length}")))
                }
                true => None,
            }
        })
    }
}

/// The parent of a lineage. In families that take templates it is composed, and every composition is an event; what the
/// experiment file sets for the parent stands above what was composed.
pub fn parent(study: &Study<'_>, spec: &LineageSpec, desk: &mut Desk<'_>) -> Result<Program, RunError> {
    let (Some(options), true) = (&study.composition, families::takes_templates(&spec.family)) else {
        return study.parent(spec);
    };
    let model = study.models.get(&Role::TemplateAgent);
    let model = model.ok_or(AgentError::NoModel { role: Role::TemplateAgent.name() })?;
    let mut composed = Vec::new();
    for (slot, form) in (0..).zip(families::template_forms()) {
        let Some(description) = options.descriptions.get(form.kind) else { continue };
        let order = Order { lineage: &spec.id, slot, form: &form, description, rounds: options.rounds, model };
        let event: Composed = compose(&order, &study.meter.asking(study.ask, &spec.id))?;
        desk.log.append(kind::COMPOSED, &event)?;
        (desk.watch)(Progress::Composed { template: event.name(), used: event.template.is_some() });
        composed.push(event);
    }
    study.composed_parent(spec, &composed)
}
