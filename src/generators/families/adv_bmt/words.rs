//! The family's words: its name, its operators, and what its programs may read and set.

/// The family's name in programs, experiments and tables.
pub const NAME: &str = "adv_bmt";
/// Actor operator: a road user that was not there.
pub const INSERTED_ACTOR: &str = "inserted_actor";
/// Motion operator: backward rollouts over tokens.
pub const REVERSE_TOKENS: &str = "reverse_tokens";
/// Search operator: rejection by displacement and curvature.
pub const REJECTION: &str = "plausibility_rejection";
