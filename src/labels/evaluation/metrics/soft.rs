//! Shape of a soft diagnostic.

/// `1 - min(v / ρ, 1)`: a soft diagnostic of a non-negative violation `v` with tolerance scale ρ, same unit (paper eq.
/// app-metadrive-realism-score).
pub fn soft(violation: f64, tolerance: f64) -> f64 {
    1.0 - (violation.max(0.0) / tolerance).min(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_soft_diagnostic_falls_linearly_to_zero_at_its_tolerance() {
        assert_eq!([soft(0.0, 2.0), soft(0.5, 2.0), soft(2.0, 2.0), soft(9.0, 2.0)], [1.0, 0.75, 0.0, 0.0]);
    }
}
