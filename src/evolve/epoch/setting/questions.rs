//! Upper bound on the questions of a study. What is asked depends on the answers before it, so nobody can know the
//! questions of a run that is not recorded; the budget bounds them.

use std::collections::BTreeMap;

use super::study::Study;
use crate::epoch::RunError;
use crate::objects::Role;

/// Occasions of one kind on which agents are asked, and what each of them can come to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Occasions {
    /// `proposals`, `counsels`, `templates` or `turns` of the world evaluator.
    pub kind: &'static str,
    /// Largest number of them in a run.
    pub count: u64,
    /// Role -> most questions on one of them.
    pub each: BTreeMap<Role, u64>,
}

/// The kind of occasion on which a role is asked; no two kinds share a role.
pub fn occasion_of(role: Role) -> &'static str {
    match role {
        Role::AttackerAgent => "counsels",
        Role::TemplateAgent => "templates",
        Role::WorldAgent => "turns",
        _ => "proposals",
    }
}

/// The most that a study can ask: lineages x epochs x slots x roles x rounds for proposals, and what else its file names.
///
/// # Errors
/// A lineage of an unknown family.
pub fn asked_at_most(study: &Study) -> Result<Vec<Occasions>, RunError> {
    let budget = &study.budget;
    let proposals = study.lineages.len() as u64 * u64::from(budget.epochs) * u64::from(budget.slots);
    let repairs = u64::from(budget.max_repair_rounds);
    // A critic is asked once more after an answer that could not be read.
    let critics = Role::CRITICS.into_iter().map(|critic| (critic, 2 * (repairs + 1)));
    let each = critics.chain([(Role::Actor, 1), (Role::Repair, repairs)]).collect();
    let mut all = vec![Occasions { kind: "proposals", count: proposals, each }];
    let (mut counsels, mut templates) = (0, 0);
    for spec in &study.lineages {
        let asks = &study.source(spec)?.asks;
        if asks.counsel.is_some() {
            counsels += study.scenes.len() as u64;
        }
        if let (Some(options), Some(_), None) = (&study.composition, asks.templates, &spec.start) {
            templates += options.descriptions.len() as u64;
        }
    }
    let one = |role: Role, rounds: u32| BTreeMap::from([(role, u64::from(rounds))]);
    if let Some(options) = study.counsel.filter(|_| counsels > 0) {
        all.push(Occasions { kind: "counsels", count: counsels, each: one(Role::AttackerAgent, options.rounds) });
    }
    if let Some(options) = study.composition.as_ref().filter(|_| templates > 0) {
        all.push(Occasions { kind: "templates", count: templates, each: one(Role::TemplateAgent, options.rounds) });
    }
    if let Some(options) = study.world_agent {
        let turns = u64::from(budget.epochs.saturating_sub(1));
        all.push(Occasions { kind: "turns", count: turns, each: one(Role::WorldAgent, options.rounds) });
    }
    Ok(all)
}
