//! What critics say of a patch before simulation.

use serde::{Deserialize, Serialize};

/// The roles that ask a model.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Role {
    Actor,
    StructuralCritic,
    AttackCritic,
    RealismCritic,
    IsolationCritic,
    Repair,
    WorldAgent,
    /// Names the attackers of a scene, for families that take counsel.
    AttackerAgent,
    /// Composes a template from a description, for families that take templates.
    TemplateAgent,
}

impl Role {
    pub const CRITICS: [Role; 4] =
        [Role::StructuralCritic, Role::AttackCritic, Role::RealismCritic, Role::IsolationCritic];

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

/// The advice of one critic. It never decides: gates, simulator and archive do.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Review {
    pub role: Role,
    pub decision: Advice,
    #[serde(default)]
    pub blockers: Vec<String>,
    #[serde(default)]
    pub repair_hints: Vec<String>,
    #[serde(default)]
    pub risk_tags: Vec<String>,
    /// Always `pre_simulation`.
    pub scope: String,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Advice {
    Approve,
    Repair,
    Reject,
}
