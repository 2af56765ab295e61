//! Arithmetic of predictions beside labels: rank correlations, errors, coverage. Whoever says how good an evaluator is, says it
//! with these.

use crate::kernel::num;
use crate::objects::Objectives;

/// A prediction beside what the rollouts showed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Compared {
    /// Predicted difference from the parent.
    pub predicted: Objectives,
    /// Half widths of its intervals.
    pub half_width: Option<Objectives>,
    /// Labelled difference from the parent.
    pub label: Objectives,
    /// For how many candidates it counts.
    pub weight: f64,
}

impl Compared {
    fn error(&self) -> Objectives {
        self.label.less(&self.predicted)
    }
}

/// Returns the gain of a candidate over its parent, attack and realism added.
pub fn gain(of: &Objectives) -> f64 {
    of.attack + of.realism
}

/// The weighted share of what holds, per cent; `None` of nothing.
pub fn share_pct(of: impl Iterator<Item = (f64, bool)>) -> Option<f64> {
    let (mut held, mut whole) = (0.0, 0.0);
    for (weight, holds) in of {
        held += if holds { weight } else { 0.0 };
        whole += weight;
    }
    (whole > 0.0).then(|| 100.0 * held / whole)
}

/// A loss of the predictions as a share of what it is for the guess that every child is like its parent; `None` where that guess
/// is right.
pub fn loss_ratio(of: &[Compared], loss: &dyn Fn(&Objectives) -> f64) -> Option<f64> {
    let error = num::sum(of.iter().map(|one| one.weight * loss(&one.error())));
    let guess = num::sum(of.iter().map(|one| one.weight * loss(&one.label)));
    (guess > 0.0).then(|| error / guess)
}

/// Labels in their intervals, per cent; attack and realism count one each. A candidate without any uncertainty does what its
/// parent does, and says nothing about intervals.
pub fn coverage_pct(of: &[Compared]) -> Option<f64> {
    // Sums of sixty-fourths and their like come out a rounding apart.
    let within = |error: f64, half: f64| error.abs() <= half + 1e-12;
    let holds = of.iter().filter_map(|one| {
        let (half, error) = (one.half_width?, one.error());
        let both = [within(error.attack, half.attack), within(error.realism, half.realism)];
        (half.attack > 0.0 || half.realism > 0.0).then(|| both.map(|holds| (one.weight, holds)))
    });
    share_pct(holds.flatten())
}

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

/// Ranks of weighted values as shares of the whole weight, less one half: the middle of the weight that each one stands for. Equal
/// values share theirs.
pub fn centred_ranks(values: &[f64], weights: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|&a, &b| values[a].total_cmp(&values[b]).then(a.cmp(&b)));
    let whole = num::sum(order.iter().map(|&place| weights[place]));
    let (mut ranks, mut from, mut below) = (vec![0.0; values.len()], 0, 0.0);
    while from < order.len() {
        let same = order[from..].iter().take_while(|&&place| values[place] == values[order[from]]).count();
        let equal = &order[from..from + same];
        let weight = num::sum(equal.iter().map(|&place| weights[place]));
        equal.iter().for_each(|&place| ranks[place] = (below + 0.5 * weight) / whole - 0.5);
        (from, below) = (from + same, below + weight);
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
