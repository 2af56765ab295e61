//! NSGA-II's order of a population: rank by rank, and within a rank by crowding distance (Deb et al. 2002).

use super::super::plane::ranks;

/// Of each point [attack, realism], its rank (0 on the front) and its crowding distance within that rank.
pub fn ordered(points: &[[f64; 2]]) -> Vec<(usize, f64)> {
    let ranks = ranks(points);
    let mut crowding = vec![0.0; points.len()];
    for rank in 0..=ranks.iter().copied().max().unwrap_or(0) {
        let alike: Vec<usize> = (0..points.len()).filter(|&place| ranks[place] == rank).collect();
        for axis in 0..2 {
            spread(points, &alike, axis, &mut crowding);
        }
    }
    ranks.into_iter().zip(crowding).collect()
}

/// Adds each member's share of one axis: the gap between its neighbours by the whole range; the ends count without bound.
fn spread(points: &[[f64; 2]], of: &[usize], axis: usize, crowding: &mut [f64]) {
    let mut order = of.to_vec();
    order.sort_by(|&a, &b| points[a][axis].total_cmp(&points[b][axis]));
    let (Some(&first), Some(&last)) = (order.first(), order.last()) else { return };
    let range = points[last][axis] - points[first][axis];
    crowding[first] = f64::INFINITY;
    crowding[last] = f64::INFINITY;
    if range > 0.0 {
        for three in order.windows(3) {
            crowding[three[1]] += (points[three[2]][axis] - points[three[0]][axis]) / range;
        }
    }
}

/// Returns `true` if the first stands before the second: it has a smaller rank, or the same rank and is less crowded.
pub fn before(one: (usize, f64), other: (usize, f64)) -> bool {
    one.0 < other.0 || (one.0 == other.0 && one.1 > other.1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_is_dominated_stands_behind_and_the_middle_of_a_crowd_behind_its_ends() {
        let points = [[0.1, 0.9], [0.5, 0.5], [0.55, 0.45], [0.9, 0.1], [0.4, 0.4]];
        let found = ordered(&points);
        assert_eq!(found.iter().map(|(rank, _)| *rank).collect::<Vec<_>>(), [0, 0, 0, 0, 1]);
        // By hand: (0.55 - 0.1) / 0.8 + (0.9 - 0.45) / 0.8 and (0.9 - 0.5) / 0.8 + (0.5 - 0.1) / 0.8.
        assert!((found[1].1 - 1.125).abs() < 1e-12 && (found[2].1 - 1.0).abs() < 1e-12, "{found:?}");
        assert!(found[0].1.is_infinite() && found[3].1.is_infinite());
        // Of another rank nobody is counted: a third one changes nothing.
        let more = ordered(&[&points[..], &[[0.2, 0.2], [0.3, 0.1]]].concat());
        assert_eq!((&more[..5], more[5].0, more[6].0), (&found[..], 2, 2));
        assert!(before(found[1], found[2]) && before(found[2], found[4]) && !before(found[2], found[1]));
    }
}
