//! The family's words: its name, its operators, and what its programs may read and set.

/// The family's name in programs, experiments and tables.
pub const NAME: &str = "sage";
/// Motion operator: candidates of the mixed expert.
pub const MIXED_EXPERTS: &str = "mixed_experts";
/// Search operator: the reward with its weights.
pub const PREFERENCE_REWARD: &str = "preference_reward";
/// Prefix of the prior's words in this family.
pub(super) const PRIOR: &str = "reference_";
