//! Chains of parents, promotion, continuity.
