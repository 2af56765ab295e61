//! One metric a file, each a pure function of a rollout's outcome.

pub mod acceleration;
pub mod attack;
pub mod collision_validity;
pub mod continuity;
pub mod initial_overlap;
pub mod jerk;
pub mod lane_validity;
pub mod realism;
pub mod route_progress;

/// A soft violation: 1 - min(v / ρ, 1) (paper, below eq. app-metadrive-realism-score).
pub fn soft(violation: f64, tolerance: f64) -> f64 {
    1.0 - (violation.max(0.0) / tolerance).min(1.0)
}

#[cfg(test)]
mod tests;
