//! Critics' reviews of a patch before simulation, and the roles of agents.

use serde::{Deserialize, Serialize};

/// The roles that ask a model.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Role {
    /// A_actor: proposes an edit.
    Actor,
    /// A_struct: checks form and supported fields.
    StructuralCritic,
    /// A_attack: judges whether the edit raises adversarial pressure.
    AttackCritic,
    /// A_real: judges continuity, map and plausibility.
    RealismCritic,
    /// A_iso: judges whether the edit stays within its family.
    IsolationCritic,
    /// A_repair: revises an edit by the critics' reviews.
    Repair,
    /// A_W: proposes updates of the world evaluator.
    WorldAgent,
    /// Names the attackers of a scene, for families that take counsel.
    AttackerAgent,
    /// Composes a template from a description, for families that take templates.
    TemplateAgent,
}

impl Role {
    /// The critics, in the order in which they are asked.
    pub const CRITICS: [Role; 4] =
        [Role::StructuralCritic, Role::AttackCritic, Role::RealismCritic, Role::IsolationCritic];

    /// The word in experiment files, prompts and keys.
    pub fn name(self) -> &'static str {
        match self {
            Role::Actor => "actor",
            Role::StructuralCritic => "structural_critic",
            Role::AttackCritic => "attack_critic",
            Role::RealismCritic => "realism_critic",
            Role::IsolationCritic => "isolation_critic",
            Role::Repair => "repair",
            Role::WorldAgent => "world_agent",
            Role::AttackerAgent => "attacker_agent",
            Role::TemplateAgent => "template_agent",
        }
    }
}

/// One critic's review. It decides nothing: gates, simulator and archive decide.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Review {
    /// Which critic.
    pub role: Role,
    /// Advice of the critic.
    pub decision: Advice,
    /// Faults that must be mended before the edit can be accepted.
    #[serde(default)]
    pub blockers: Vec<String>,
    /// Ways to mend the faults.
    #[serde(default)]
    pub repair_hints: Vec<String>,
    /// Words for the risks that it sees.
    #[serde(default)]
    pub risk_tags: Vec<String>,
    /// Always `pre_simulation`.
    pub scope: String,
}

/// A critic's advice. It decides nothing: gates and simulator decide.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Advice {
    /// Go on with the edit.
    Approve,
    /// Revise the edit.
    Repair,
    /// Drop the edit.
    Reject,
}
