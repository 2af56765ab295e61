//! Rollouts over scenes to scores.
