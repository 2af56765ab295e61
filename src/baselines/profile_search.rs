//! What AdvSim and the AT port share: a profile of 100 numbers over a traffic family's scripted scenario, searched by
//! queries that each simulate the whole scenario. Every family names the same figures in words of its own.

use std::sync::Arc;

use super::grammar::{integer, number, parameter};
use super::interface::{OwnParameter, own};
use super::kernel::candidate::Judged;
use super::kernel::query_search::{Answer, Queries, ask_all};
use super::kernel::script_space::{PROFILE_VALUES, ScriptSpace};
use super::kernel::{Part, Settings, Stage, StageError, scripted};
use crate::kernel::num;

/// Parameters of the search; each name begins with `prefix`.
pub fn parameters(prefix: &str) -> Vec<OwnParameter> {
    let named = |name: &str, domain, describes: &str, value| {
        own(parameter(&format!("{prefix}{name}"), domain, describes), value)
    };
    vec![
        named("query_count", integer(1, 50, "1"), "most simulations of a search; it stops at a contact", 8.0),
        named("query_step", number(0.02, 1.0, "1"), "largest change of a number between queries", 0.5),
        named("changed_share", number(0.02, 1.0, "1"), "share of the 100 numbers that a query changes", 0.3),
    ]
}

/// The middle of a space, simulated: where a search sets out from.
pub fn open(stage: &Stage<'_>, space: &ScriptSpace, part: &mut Part) {
    let actions = space.actions(&vec![0.5; space.dimensions()]);
    let space = Some(Arc::new(space.clone()));
    let middle = scripted::simulated(stage.situation, actions, adversary(&space), part.window.from_step, space);
    part.candidates = middle.into_iter().collect();
}

fn adversary(space: &Option<Arc<ScriptSpace>>) -> usize {
    space.as_ref().map_or(0, |space| space.adversary)
}

/// Asks for profiles until one makes the ego collide. Every query is a candidate, scored by minus its loss.
pub fn search(stage: &Stage<'_>, settings: &Settings, prefix: &str, parts: &mut [Part]) -> Result<(), StageError> {
    let number = |name: &str| settings.number(&format!("{prefix}{name}"));
    let count = settings.count(&format!("{prefix}query_count"))?;
    let queries = Queries { count, step: number("query_step")?, changed_share: number("changed_share")? };
    let module = settings.optional("loss");
    let adversaries: Vec<usize> = parts.iter().map(|part| part.actor).collect();
    for part in parts {
        let spaces = part.candidates.iter().filter_map(|c| c.scripted.as_ref()?.space.clone());
        let Some(space) = spaces.into_iter().next() else { continue };
        let (situation, actor, from_step) = (stage.situation, part.actor, part.window.from_step);
        let judged = Judged { situation, actor, from_step, adversaries: &adversaries };
        let ask = |place: &[f64]| {
            let actions = space.actions(place);
            let mut found = scripted::simulated(situation, actions, space.adversary, from_step, None)?;
            let (own, success) = found.scripted.as_ref().map(|s| (s.loss(), s.contact))?;
            let extra = module.map_or(0.0, |module| module.of_candidate(&found, &judged));
            let loss = num::stored(own + extra)?;
            found.score = -loss;
            Some(Answer { loss, success, found })
        };
        let asked = ask_all(&queries, PROFILE_VALUES, &mut stage.stream("queries", actor), ask);
        part.candidates = asked.into_iter().map(|(_, found)| found).collect();
    }
    Ok(())
}
