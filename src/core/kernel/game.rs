//! Mixed equilibria of small zero-sum games, exactly: in whole numbers, so that they are the same on every machine.

use serde::Serialize;

/// Most rows and columns of a game: every square part of it is tried.
pub const SIDE_MAX: usize = 7;
/// Largest payoff: determinants of [`SIDE_MAX`] rows stay within 128 bits (Hadamard).
pub const PAYOFF_MAX: i64 = 10_000;

/// Strategies of both players, and the payoff of the row player.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Equilibrium {
    /// Chances of the rows, whose player wants a high payoff.
    pub rows: Vec<f64>,
    /// Chances of the columns, whose player wants a low payoff.
    pub columns: Vec<f64>,
    /// Average payoff of the row player.
    pub value: f64,
}

/// Returns the mixed equilibrium of the game in which the row player gets `payoffs[row][column]` and the column player loses it. By Shapley
/// and Snow (1950) each extreme equilibrium is that of a square part B of the matrix, with value det B / s and chances 1ᵀ adj B / s and
/// adj B 1 / s, where s = 1ᵀ adj B 1. The first part, smaller ones first and in the order of rows and columns, whose equilibrium holds in
/// the whole game is taken: of equal rows or columns the first plays. `None` without a matrix, with rows of different length, more than
/// [`SIDE_MAX`] rows or columns, or payoffs beyond 0 to [`PAYOFF_MAX`].
pub fn equilibrium(payoffs: &[Vec<i64>]) -> Option<Equilibrium> {
    let (height, width) = (payoffs.len(), payoffs.first()?.len());
    let fits = |row: &Vec<i64>| row.len() == width && row.iter().all(|of| (0..=PAYOFF_MAX).contains(of));
    if width == 0 || height > SIDE_MAX || width > SIDE_MAX || !payoffs.iter().all(fits) {
        return None;
    }
    // Adding one everywhere makes no value 0 and changes no strategy.
    let raised: Vec<Vec<i128>> = payoffs.iter().map(|row| row.iter().map(|of| i128::from(*of) + 1).collect()).collect();
    for size in 1..=height.min(width) {
        for rows in subsets(height, size) {
            for columns in subsets(width, size) {
                if let Some(found) = of_part(&raised, &rows, &columns) {
                    return Some(found);
                }
            }
        }
    }
    None
}

/// The equilibrium of a square part, where it is one of the whole game.
fn of_part(raised: &[Vec<i128>], rows: &[usize], columns: &[usize]) -> Option<Equilibrium> {
    let size = rows.len();
    let minor = |without_row: usize, without_column: usize| -> i128 {
        let kept = |of: &[usize], without: usize| {
            of.iter().enumerate().filter(|(at, _)| *at != without).map(|(_, place)| *place).collect::<Vec<usize>>()
        };
        let (rows, columns) = (kept(rows, without_row), kept(columns, without_column));
        let part = rows.iter().map(|&row| columns.iter().map(|&column| raised[row][column]).collect()).collect();
        let sign = if (without_row + without_column).is_multiple_of(2) { 1 } else { -1 };
        sign * determinant(part)
    };
    // adj B at (column, row) is the cofactor of (row, column).
    let cofactors: Vec<Vec<i128>> = (0..size).map(|row| (0..size).map(|column| minor(row, column)).collect()).collect();
    let mut of_rows: Vec<i128> = cofactors.iter().map(|row| row.iter().sum()).collect();
    let mut of_columns: Vec<i128> = (0..size).map(|column| cofactors.iter().map(|row| row[column]).sum()).collect();
    let mut total: i128 = of_rows.iter().sum();
    if total == 0 {
        return None;
    }
    let whole = rows.iter().map(|&row| columns.iter().map(|&column| raised[row][column]).collect()).collect();
    let mut worth = determinant(whole);
    if total < 0 {
        (total, worth) = (-total, -worth);
        of_rows.iter_mut().chain(&mut of_columns).for_each(|of| *of = -*of);
    }
    if of_rows.iter().chain(&of_columns).any(|of| *of < 0) {
        return None;
    }
    // Nobody gains by leaving: sums are of whole numbers, so the comparison is exact.
    let width = raised[0].len();
    let against_column =
        |column: usize| -> i128 { rows.iter().zip(&of_rows).map(|(&row, chance)| raised[row][column] * chance).sum() };
    let against_row =
        |row: usize| -> i128 { columns.iter().zip(&of_columns).map(|(&at, chance)| raised[row][at] * chance).sum() };
    if (0..width).any(|column| against_column(column) < worth) || (0..raised.len()).any(|row| against_row(row) > worth)
    {
        return None;
    }
    let spread = |places: &[usize], chances: &[i128], all: usize| {
        let mut spread = vec![0.0; all];
        places.iter().zip(chances).for_each(|(&place, &chance)| spread[place] = chance as f64 / total as f64);
        spread
    };
    Some(Equilibrium {
        rows: spread(rows, &of_rows, raised.len()),
        columns: spread(columns, &of_columns, width),
        value: (worth - total) as f64 / total as f64,
    })
}

/// Every choice of `size` of `of` places, in order.
fn subsets(of: usize, size: usize) -> Vec<Vec<usize>> {
    (0_u32..1 << of)
        .filter(|mask| mask.count_ones() as usize == size)
        .map(|mask| (0..of).filter(|place| mask >> place & 1 == 1).collect())
        .collect()
}

/// Bareiss' elimination: every division comes out even.
fn determinant(mut of: Vec<Vec<i128>>) -> i128 {
    let (size, mut sign, mut before) = (of.len(), 1, 1);
    for k in 0..size {
        let Some(pivot) = (k..size).find(|&row| of[row][k] != 0) else { return 0 };
        if pivot != k {
            of.swap(pivot, k);
            sign = -sign;
        }
        for row in k + 1..size {
            for column in k + 1..size {
                of[row][column] = (of[row][column] * of[k][k] - of[row][k] * of[k][column]) / before;
            }
        }
        before = of[k][k];
    }
    sign * of.last().map_or(1, |row| row[size - 1])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernel::Seed;

    #[test]
    fn known_games_have_their_known_equilibria() {
        // Matching pennies; rock, paper, scissors with a win at 2 and a draw at 1; a saddle.
        let pennies = equilibrium(&[vec![2, 0], vec![0, 2]]).unwrap();
        assert_eq!((pennies.rows, pennies.columns, pennies.value), (vec![0.5, 0.5], vec![0.5, 0.5], 1.0));
        let hands = equilibrium(&[vec![1, 0, 2], vec![2, 1, 0], vec![0, 2, 1]]).unwrap();
        assert_eq!((hands.rows, hands.value), (vec![1.0 / 3.0; 3], 1.0));
        let saddle = equilibrium(&[vec![3, 5], vec![1, 9]]).unwrap();
        assert_eq!((saddle.rows, saddle.columns, saddle.value), (vec![1.0, 0.0], vec![1.0, 0.0], 3.0));
        // By hand: x (4, 1) + (1 - x) (2, 3) is alike at x = 1/4, worth 2.5.
        let mixed = equilibrium(&[vec![4, 1], vec![2, 3]]).unwrap();
        assert_eq!((mixed.rows, mixed.columns, mixed.value), (vec![0.25, 0.75], vec![0.5, 0.5], 2.5));
    }

    #[test]
    fn in_every_game_nobody_gains_by_another_move() {
        let mut stream = Seed(7).stream(&["games"]);
        for _ in 0..300 {
            let (height, width) = (1 + stream.below(5), 1 + stream.below(5));
            let game: Vec<Vec<i64>> =
                (0..height).map(|_| (0..width).map(|_| stream.below(40) as i64).collect()).collect();
            let found = equilibrium(&game).expect("each game has one");
            let sum = |of: &[f64]| of.iter().sum::<f64>();
            assert!((sum(&found.rows) - 1.0).abs() < 1e-12 && (sum(&found.columns) - 1.0).abs() < 1e-12);
            for column in 0..width {
                let gets: f64 = (0..height).map(|row| found.rows[row] * game[row][column] as f64).sum();
                assert!(gets >= found.value - 1e-9, "{game:?} {found:?}");
            }
            for row in &game {
                let gets: f64 = row.iter().zip(&found.columns).map(|(of, chance)| *of as f64 * chance).sum();
                assert!(gets <= found.value + 1e-9, "{game:?} {found:?}");
            }
        }
    }

    #[test]
    fn what_is_no_game_has_none() {
        assert_eq!(equilibrium(&[]), None);
        assert_eq!(equilibrium(&[vec![]]), None);
        assert_eq!(equilibrium(&[vec![1, 2], vec![1]]), None);
        assert_eq!(equilibrium(&[vec![-1]]), None);
        assert_eq!(equilibrium(&[vec![PAYOFF_MAX; SIDE_MAX + 1]]), None);
        let largest = vec![vec![PAYOFF_MAX; SIDE_MAX]; SIDE_MAX];
        assert_eq!(equilibrium(&largest).map(|of| of.value), Some(PAYOFF_MAX as f64));
    }
}
