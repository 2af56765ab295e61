//! Rank correlations.

use crate::kernel::num;

/// Ranks from 1; equal values share their mean rank.
fn ranks(values: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|&a, &b| values[a].total_cmp(&values[b]).then(a.cmp(&b)));
    let mut ranks = vec![0.0; values.len()];
    let mut from = 0;
    while from < order.len() {
        let same = order[from..].iter().take_while(|&&place| values[place] == values[order[from]]).count();
        let shared = from as f64 + 0.5 * (same as f64 + 1.0);
        order[from..from + same].iter().for_each(|&place| ranks[place] = shared);
        from += same;
    }
    ranks
}

/// Spearman's ρ with shared ranks; `None` where one side does not vary.
pub fn spearman(a: &[f64], b: &[f64]) -> Option<f64> {
    let (a, b) = (ranks(a), ranks(b));
    let (mean_a, mean_b) = (num::mean(&a)?, num::mean(&b)?);
    let sum = |of: &dyn Fn(f64, f64) -> f64| num::sum(a.iter().zip(&b).map(|(x, y)| of(x - mean_a, y - mean_b)));
    let (both, own, other) = (sum(&|x, y| x * y), sum(&|x, _| x * x), sum(&|_, y| y * y));
    (own > 0.0 && other > 0.0).then(|| both / (own * other).sqrt())
}

/// Kendall's τ_b; `None` where one side does not vary.
pub fn kendall(a: &[f64], b: &[f64]) -> Option<f64> {
    let (mut balance, mut pairs_a, mut pairs_b) = (0i64, 0i64, 0i64);
    let sign = |x: f64, y: f64| i64::from(x > y) - i64::from(x < y);
    for i in 0..a.len() {
        for j in 0..i {
            let (x, y) = (sign(a[i], a[j]), sign(b[i], b[j]));
            balance += x * y;
            pairs_a += x * x;
            pairs_b += y * y;
        }
    }
    (pairs_a > 0 && pairs_b > 0).then(|| balance as f64 / (pairs_a as f64 * pairs_b as f64).sqrt())
}
