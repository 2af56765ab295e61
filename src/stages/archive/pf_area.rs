//! PF-Area@k: how much frontier area a matched budget of descendants adds to the parent's (paper eq. app-pf-area).

use super::{
    gates::ArchiveOptions,
    plane::{hypervolume, point},
};
use crate::objects::Objectives;

/// `100 (HV(P^k) - HV(P^0)) / max(HV(P^0), ε)`, percent, where P^k adds the first `k` of `descendants` to `parents`.
///
/// `descendants` are the eligible ones in their declared order: the order is the caller's to fix before selection,
/// because it decides who is among the first `k`. No descendant gives 0. Objectives must be admissible.
pub fn pf_area_pct(parents: &[Objectives], descendants: &[Objectives], k: usize, options: &ArchiveOptions) -> f64 {
    let mut points: Vec<[f64; 2]> = parents.iter().map(point).collect();
    let before = hypervolume(&points, options.reference);
    points.extend(descendants.iter().take(k).map(point));
    let after = hypervolume(&points, options.reference);
    100.0 * (after - before) / before.max(options.epsilon_pf)
}

#[cfg(test)]
mod tests {
    use super::super::front::samples::objectives;
    use super::*;

    fn area(parents: &[[f64; 2]], descendants: &[[f64; 2]], k: usize) -> f64 {
        let all = |points: &[[f64; 2]]| points.iter().map(|p| objectives(*p)).collect::<Vec<_>>();
        let options = ArchiveOptions {
            reference: [0.0; 2],
            r0: 0.95,
            a0: 0.5,
            epsilon_r: 0.0,
            epsilon_a: 0.0,
            epsilon_pf: 1e-3,
            level: 0.8,
            coverage_floor: 0.8,
            ..ArchiveOptions::default()
        };
        pf_area_pct(&all(parents), &all(descendants), k, &options)
    }

    #[test]
    fn the_gain_is_relative_to_the_parents_area() {
        assert!((area(&[[0.5, 0.8]], &[[1.0, 0.8]], 3) - 100.0).abs() < 1e-9);
    }

    #[test]
    fn only_the_first_k_count() {
        let descendants = [[0.1, 0.1], [0.2, 0.2], [0.3, 0.3], [1.0, 1.0]];
        assert_eq!(area(&[[0.5, 0.8]], &descendants, 3), 0.0);
        assert!(area(&[[0.5, 0.8]], &descendants, 4) > 0.0);
    }

    #[test]
    fn a_parent_without_area_is_divided_by_epsilon() {
        assert!((area(&[[0.0, 0.9]], &[[0.1, 0.5]], 3) - 100.0 * 0.05 / 1e-3).abs() < 1e-9);
        assert_eq!(area(&[], &[], 3), 0.0);
    }
}
