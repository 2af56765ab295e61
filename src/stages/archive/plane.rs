//! Exact geometry of a two-objective plane under maximisation: hypervolume, dominance masks, ranks.
//! Knows points only, nothing of candidates.
//!
//! Points are finite: [`super::admissible`] refuses anything else before the archive. A NaN that came here all the
//! same would give a useless number, never a panic.

use crate::objects::Objectives;

/// A point `[attack, realism]` as the sweeps read it: `-0.0` is `0.0`.
fn plain(point: &[f64; 2]) -> [f64; 2] {
    [point[0] + 0.0, point[1] + 0.0]
}

/// Indices by x descending, then y descending, then place.
fn by_x_then_y(points: &[[f64; 2]]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..points.len()).collect();
    order.sort_by(|&i, &j| {
        let (a, b) = (plain(&points[i]), plain(&points[j]));
        b[0].total_cmp(&a[0]).then(b[1].total_cmp(&a[1])).then(i.cmp(&j))
    });
    order
}

/// Area dominated by `points` and bounded by `reference` from below (paper, section Simulator Evaluation and Pareto Archive).
///
/// The sweep visits points by x descending and adds one slab for each rise in y. A point that is not strictly above
/// the reference in both coordinates adds nothing; nor does a copy. The order of the float operations is part of
/// the definition: the published cases are reproduced bit for bit.
pub fn hypervolume(points: &[[f64; 2]], reference: [f64; 2]) -> f64 {
    let (mut area, mut top) = (0.0, reference[1]);
    for index in by_x_then_y(points) {
        let [x, y] = plain(&points[index]);
        if x > reference[0] && y > top {
            area += (x - reference[0]) * (y - top);
            top = y;
        }
    }
    area
}

/// Pareto rank of each point: 0 on the front, 1 on the front of what is left, and so on. Copies share a rank.
pub fn ranks(points: &[[f64; 2]]) -> Vec<usize> {
    let mut rank = vec![0; points.len()];
    // Largest y seen in each rank; falls strictly from rank to rank, so that a binary search finds the place.
    let mut tops: Vec<f64> = Vec::new();
    let mut previous: Option<usize> = None;
    for index in by_x_then_y(points) {
        let [_, y] = plain(&points[index]);
        rank[index] = match previous {
            Some(before) if plain(&points[before]) == plain(&points[index]) => rank[before],
            _ => {
                let place = tops.partition_point(|top| *top >= y);
                match tops.get_mut(place) {
                    Some(top) => *top = y,
                    None => tops.push(y),
                }
                place
            }
        };
        previous = Some(index);
    }
    rank
}

/// True for every point that no other dominates; all copies of a front point are kept (the paper's relation).
pub fn non_dominated_with_copies(points: &[[f64; 2]]) -> Vec<bool> {
    ranks(points).into_iter().map(|rank| rank == 0).collect()
}

/// True for the points of the front, where of equal points only the first in the list counts.
pub fn non_dominated(points: &[[f64; 2]]) -> Vec<bool> {
    let mut mask = non_dominated_with_copies(points);
    let mut previous: Option<usize> = None;
    for index in by_x_then_y(points) {
        if previous.is_some_and(|before| plain(&points[before]) == plain(&points[index])) {
            mask[index] = false;
        }
        previous = Some(index);
    }
    mask
}

/// Coordinates in the order in which this room uses them.
pub fn point(objectives: &Objectives) -> [f64; 2] {
    [objectives.attack, objectives.realism]
}

/// The definitions, word for word and slow, as an oracle of the sweeps.
#[cfg(test)]
pub(super) mod plain_definitions {
    pub fn dominates(a: &[f64; 2], b: &[f64; 2]) -> bool {
        a[0] >= b[0] && a[1] >= b[1] && (a[0] > b[0] || a[1] > b[1])
    }

    pub fn non_dominated_with_copies(points: &[[f64; 2]]) -> Vec<bool> {
        points.iter().map(|p| !points.iter().any(|q| dominates(q, p))).collect()
    }

    pub fn non_dominated(points: &[[f64; 2]]) -> Vec<bool> {
        let all = non_dominated_with_copies(points);
        (0..points.len()).map(|i| all[i] && !points[..i].contains(&points[i])).collect()
    }

    pub fn ranks(points: &[[f64; 2]]) -> Vec<usize> {
        let mut rank = vec![usize::MAX; points.len()];
        let mut level = 0;
        while rank.contains(&usize::MAX) {
            let left: Vec<usize> = (0..points.len()).filter(|&i| rank[i] == usize::MAX).collect();
            for &i in &left {
                if !left.iter().any(|&j| dominates(&points[j], &points[i])) {
                    rank[i] = level;
                }
            }
            level += 1;
        }
        rank
    }

    /// Area as the number of cells of the grid of all coordinates that some point covers.
    pub fn hypervolume(points: &[[f64; 2]], reference: [f64; 2]) -> f64 {
        let grid = |axis: usize| {
            let mut values: Vec<f64> = points.iter().map(|p| p[axis]).filter(|v| *v > reference[axis]).collect();
            values.push(reference[axis]);
            values.sort_by(f64::total_cmp);
            values.dedup();
            values
        };
        let (xs, ys) = (grid(0), grid(1));
        let mut area = 0.0;
        for x in xs.windows(2) {
            for y in ys.windows(2) {
                if points.iter().any(|p| p[0] >= x[1] && p[1] >= y[1]) {
                    area += (x[1] - x[0]) * (y[1] - y[0]);
                }
            }
        }
        area
    }
}

#[cfg(test)]
mod tests {
    use super::{plain_definitions as oracle, *};
    use proptest::prelude::*;

    /// Coarse grids give many ties and copies; fine ones give none.
    fn points() -> impl Strategy<Value = Vec<[f64; 2]>> {
        (1u32..=40).prop_flat_map(|steps| {
            let rate = (0..=steps).prop_map(move |k| f64::from(k) / f64::from(steps));
            prop::collection::vec([rate.clone(), rate], 0..40)
        })
    }

    proptest! {
        #[test]
        fn the_sweeps_agree_with_the_definitions(points in points(), r in [0.0..0.9f64, 0.0..0.9f64]) {
            prop_assert_eq!(ranks(&points), oracle::ranks(&points));
            prop_assert_eq!(non_dominated(&points), oracle::non_dominated(&points));
            prop_assert_eq!(non_dominated_with_copies(&points), oracle::non_dominated_with_copies(&points));
            prop_assert!((hypervolume(&points, r) - oracle::hypervolume(&points, r)).abs() < 1e-12);
        }

        #[test]
        fn area_and_ranks_do_not_depend_on_the_order_of_points(points in points()) {
            let mut turned = points.clone();
            turned.reverse();
            prop_assert_eq!(hypervolume(&points, [0.0; 2]).to_bits(), hypervolume(&turned, [0.0; 2]).to_bits());
            let mut back = ranks(&turned);
            back.reverse();
            prop_assert_eq!(ranks(&points), back);
        }

        #[test]
        fn only_the_front_carries_area(points in points()) {
            let mask = non_dominated(&points);
            let front: Vec<[f64; 2]> = points.iter().zip(&mask).filter(|(_, on)| **on).map(|(p, _)| *p).collect();
            prop_assert_eq!(hypervolume(&points, [0.0; 2]).to_bits(), hypervolume(&front, [0.0; 2]).to_bits());
        }
    }

    #[test]
    fn minus_zero_is_zero() {
        assert_eq!(ranks(&[[-0.0, 1.0], [0.0, 1.0]]), [0, 0]);
        assert_eq!(non_dominated(&[[0.0, 1.0], [-0.0, 1.0]]), [true, false]);
        assert_eq!(non_dominated(&[[-0.0, 1.0], [0.0, 1.0]]), [true, false]);
        assert_eq!(non_dominated(&[[1.0, -0.0], [1.0, 0.0]]), [true, false]);
    }

    #[test]
    fn no_points_cover_no_area() {
        assert_eq!(hypervolume(&[], [0.0; 2]), 0.0);
        assert!(ranks(&[]).is_empty());
    }
}
