//! The family's words: its name, its operators, and what its programs may read and set.

/// The family's name in programs, experiments and tables.
pub const NAME: &str = "llm_attacker";
/// Actor operator: vehicles that may attack, most promising first.
pub const ATTACKER_POOL: &str = "attacker_pool";
/// Motion operator: candidates of the lane-graph prior for each of them.
pub const ATTACKER_PRIOR: &str = "attacker_prior";
/// Search operator: propose, evaluate, reflect.
pub const DELIBERATION: &str = "attacker_deliberation";
/// Feature: place among the advised attackers, from 1; 0 for a vehicle that is not advised.
pub const COUNSEL_RANK: &str = "counsel_rank";
/// Parameter: what being advised is worth.
pub(super) const COUNSEL_WEIGHT: &str = "counsel_weight";
/// Prefix of the prior's words in this family.
pub(super) const PRIOR: &str = "attacker_";
