//! A line through the origin: what our own simulator shows of a candidate, times a slope, for what another simulator will say. The
//! guess is that both agree; labels move the slope away from 1 (a ridge toward that in place of toward zero).

use crate::kernel::num;
use crate::objects::{FeatureGroup, FeatureSchema, Objectives, Regression, SimulatedSlope, WorldRow};

/// Places of the columns with what our own simulator shows of attack and of realism; `None` where the schema has none.
pub fn places(schema: &FeatureSchema) -> Option<[usize; 2]> {
    schema.place_of(FeatureGroup::Simulated).map(|place| [place, place + 1])
}

/// Value of the line at a row, over the whole window.
pub fn value_at(line: &SimulatedSlope, row: &WorldRow) -> f64 {
    row.open_share * line.slope * row.features.get(line.column).copied().unwrap_or(0.0)
}

/// Returns what our own simulator shows of a candidate as it is: no label has corrected it.
pub fn uncorrected(schema: &FeatureSchema, row: &WorldRow) -> Option<Objectives> {
    let shown = |column: usize| value_at(&SimulatedSlope { column, slope: 1.0 }, row);
    places(schema).map(|[attack, realism]| Objectives { attack: shown(attack), realism: shown(realism) })
}

/// The slope of a target through the column at a place. `rows` are raw features, each with a weight; `prior_labels` is what the
/// slope of 1 counts for.
pub fn fit(rows: &[&[f64]], weights: &[f64], target: &[f64], column: usize, prior_labels: f64) -> Regression {
    let own = |row: &&[f64]| row.get(column).copied().unwrap_or(0.0);
    let of = |value: &dyn Fn(usize) -> f64| num::sum((0..rows.len()).map(|k| weights[k] * value(k)));
    let (whole, square) = (of(&|_| 1.0), of(&|k| own(&rows[k]) * own(&rows[k])));
    let both = of(&|k| own(&rows[k]) * target[k]);
    let slope = if square > 0.0 { (prior_labels + whole * both / square) / (prior_labels + whole) } else { 1.0 };
    Regression::Simulated(SimulatedSlope { column, slope: if slope.is_finite() { slope } else { 1.0 } })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn slope(rows: &[[f64; 2]], weights: &[f64], target: &[f64], prior: f64) -> f64 {
        let rows: Vec<&[f64]> = rows.iter().map(|row| row.as_slice()).collect();
        match fit(&rows, weights, target, 1, prior) {
            Regression::Simulated(line) if line.column == 1 => line.slope,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn labels_move_the_slope_from_one_to_where_their_squares_are_least() {
        let (rows, target) = ([[9.0, 0.1], [9.0, -0.2], [9.0, 0.4]], [0.05, -0.1, 0.2]);
        let even = [1.0; 3];
        assert_eq!(slope(&[], &[], &[], 4.0), 1.0, "nobody said otherwise");
        assert_eq!(
            slope(&[[9.0, 0.0]], &[1.0], &[0.3], 4.0),
            1.0,
            "where ours shows nothing, nothing is learned of it"
        );
        // Three labels say one half, and three say one before any is there.
        assert!((slope(&rows, &even, &target, 3.0) - 0.75).abs() < 1e-12);
        assert!((slope(&rows, &even, &target, 1e-9) - 0.5).abs() < 1e-8);
        // A row counts by its weight: of (.1, .05) once and (.2, .3) twice the slope is .125 / .09.
        let unlike = slope(&[[9.0, 0.1], [9.0, 0.2]], &[1.0, 2.0], &[0.05, 0.3], 1e-9);
        assert!((unlike - 0.125 / 0.09).abs() < 1e-6, "{unlike}");
    }
}
