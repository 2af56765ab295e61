//! Difference of two samples: number by number by Wasserstein's distance, and as a whole by how well a classifier tells them apart (a
//! classifier two-sample test: Lopez-Paz and Oquab, 2017).

use super::boosted;
use super::bootstrap::{Estimate, draws, variance};
use super::table::{Table, moments, standardised};
use crate::kernel::Digest;

/// The classifier is fitted on all groups but those of one part in turn, and scores these.
const PARTS: usize = 5;
/// Trees of the classifier, and the share of the remaining error that each of them learns.
const TREES: u32 = 60;
const LEARNING_RATE: f64 = 0.2;

/// One member of a sample.
#[derive(Clone, Debug)]
pub struct Member {
    /// Group such as a scene, from 0. Its members are fitted together, left out together and drawn together.
    pub group: usize,
    /// True if it is of the second sample.
    pub second: bool,
    /// Numbers, all finite; every member has equally many.
    pub values: Vec<f64>,
}

/// Returns the chance that the classifier, given one member of each sample, finds the one of the second: 0.5 where it tells nothing. With
/// the 95 % interval over groups. `None` where a sample is empty, or all are of one part.
pub fn told_apart(members: &[Member], suite: Digest) -> Option<Estimate> {
    let scores = scores(members)?;
    let mut order: Vec<usize> = (0..members.len()).collect();
    order.sort_by(|a, b| scores[*a].total_cmp(&scores[*b]));
    let groups = members.iter().map(|of| of.group + 1).max().unwrap_or(0);
    let value = auc(members, &scores, &order, &vec![1.0; groups])?;
    let drawn = draws(suite, groups).filter_map(|drawn| {
        let mut times = vec![0.0; groups];
        drawn.into_iter().for_each(|group| times[group] += 1.0);
        auc(members, &scores, &order, &times)
    });
    Some(Estimate::drawn(value, &drawn.collect::<Vec<f64>>()))
}

/// Returns the classifier's score of each member, fitted without its part: the higher, the more it looks like the second sample.
fn scores(members: &[Member]) -> Option<Vec<f64>> {
    let mut scores = vec![0.0; members.len()];
    for part in 0..PARTS {
        let (left_out, fitted): (Vec<usize>, Vec<usize>) =
            (0..members.len()).partition(|place| members[*place].group % PARTS == part);
        if left_out.is_empty() {
            continue;
        }
        let of = |second: bool| fitted.iter().filter(|place| members[**place].second == second).count();
        let counts = [of(false), of(true)];
        if counts.contains(&0) {
            return None;
        }
        let rows: Vec<&[f64]> = fitted.iter().map(|place| members[*place].values.as_slice()).collect();
        let columns: Vec<usize> = (0..rows[0].len()).collect();
        let (means, stds): (Vec<f64>, Vec<f64>) = columns.iter().map(|column| moments(&rows, *column)).unzip();
        let row = |place: &usize| standardised(&members[*place].values, &columns, &means, &stds);
        // Both samples weigh the same, however many they are.
        let weight = |place: &usize| fitted.len() as f64 / (2.0 * counts[usize::from(members[*place].second)] as f64);
        let table = Table {
            rows: fitted.iter().map(row).collect(),
            weights: fitted.iter().map(weight).collect(),
            columns: columns.len(),
        };
        let target: Vec<f64> = fitted.iter().map(|place| f64::from(u8::from(members[*place].second))).collect();
        let model = boosted::fit(&table, &target, TREES, LEARNING_RATE);
        for place in left_out {
            scores[place] = boosted::value_at(&model, &row(&place));
        }
    }
    Some(scores)
}

/// Returns the area under the curve, each member counted as often as its group; equal scores count half. `order` is by score.
fn auc(members: &[Member], scores: &[f64], order: &[usize], times: &[f64]) -> Option<f64> {
    let (mut below, mut firsts, mut seconds, mut at) = (0.0, 0.0, 0.0, 0);
    while at < order.len() {
        let tie = order[at..].iter().take_while(|place| scores[**place] == scores[order[at]]).count();
        let mut here = [0.0, 0.0];
        for place in &order[at..at + tie] {
            here[usize::from(members[*place].second)] += times[members[*place].group];
        }
        below += here[1] * (firsts + 0.5 * here[0]);
        firsts += here[0];
        seconds += here[1];
        at += tie;
    }
    (firsts > 0.0 && seconds > 0.0).then(|| below / (firsts * seconds))
}

/// [`wasserstein`] in standard deviations of both samples together; 0 where they do not vary. `None` where one is empty.
pub fn in_deviations(a: &[f64], b: &[f64]) -> Option<f64> {
    let (distance, deviation) = (wasserstein(a, b)?, variance(&[a, b].concat()).sqrt());
    Some(if deviation > 0.0 { distance / deviation } else { 0.0 })
}

/// Wasserstein's distance of first order, in the numbers' unit: how far the one sample must be moved, on the mean, to become the other. `None`
/// where one is empty.
pub fn wasserstein(a: &[f64], b: &[f64]) -> Option<f64> {
    if a.is_empty() || b.is_empty() {
        return None;
    }
    let sorted = |values: &[f64]| {
        let mut values = values.to_vec();
        values.sort_by(f64::total_cmp);
        values
    };
    let (a, b) = (sorted(a), sorted(b));
    // Quantile functions are steps: they are compared piece by piece between all steps of both.
    let (mut i, mut j, mut from, mut sum) = (0, 0, 0.0, 0.0);
    while i < a.len() && j < b.len() {
        let (next_a, next_b) = ((i + 1) as f64 / a.len() as f64, (j + 1) as f64 / b.len() as f64);
        let to = f64::min(next_a, next_b);
        sum += (to - from) * (a[i] - b[j]).abs();
        i += usize::from(next_a <= to);
        j += usize::from(next_b <= to);
        from = to;
    }
    Some(sum)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernel::Seed;

    /// Returns two members of each sample per scene; the second lies `by` deviations beside the first in one of three numbers.
    fn samples(by: f64) -> Vec<Member> {
        let mut draw = Seed(3).stream(&["two samples"]);
        let mut member = |place: usize| {
            let (group, second) = (place / 4, place.is_multiple_of(2));
            let mut values: Vec<f64> = (0..3).map(|_| draw.normal(0.0, 1.0)).collect();
            values[1] += if second { by } else { 0.0 };
            Member { group, second, values }
        };
        (0..600).map(&mut member).collect()
    }

    #[test]
    fn equal_samples_are_not_told_apart_and_others_the_better_the_farther_they_are() {
        let suite = Digest::of_bytes(b"two samples");
        let told = |by: f64| told_apart(&samples(by), suite).unwrap();
        let same = told(0.0);
        assert!((0.43..0.57).contains(&same.value), "{same:?}");
        let [low, high] = same.interval.unwrap();
        assert!(low < 0.5 && 0.5 < high && high - low < 0.2, "{same:?}");
        // Of two normal numbers one deviation apart the better line is right with Φ(1 / √2) = .76.
        let apart = told(1.0);
        assert!((0.68..0.79).contains(&apart.value) && apart.interval.unwrap()[0] > 0.6, "{apart:?}");
        assert!(told(4.0).value > 0.97);
        assert_eq!(told_apart(&samples(1.0)[..1], suite), None);
    }

    #[test]
    fn the_area_counts_ties_half() {
        let members: Vec<Member> = [false, true, false, true]
            .into_iter()
            .enumerate()
            .map(|(group, second)| Member { group, second, values: vec![] })
            .collect();
        let of = |scores: [f64; 4]| {
            let mut order: Vec<usize> = (0..4).collect();
            order.sort_by(|a, b| scores[*a].total_cmp(&scores[*b]));
            auc(&members, &scores, &order, &[1.0; 4]).unwrap()
        };
        assert_eq!(of([0.0, 1.0, 0.0, 1.0]), 1.0);
        assert_eq!(of([1.0, 0.0, 1.0, 0.0]), 0.0);
        assert_eq!(of([2.0, 2.0, 2.0, 2.0]), 0.5);
        assert_eq!(of([0.0, 1.0, 1.0, 2.0]), 0.875);
    }

    #[test]
    fn a_sample_is_moved_as_far_as_its_numbers_lie_apart() {
        assert_eq!(wasserstein(&[0.0, 1.0], &[2.0, 3.0]), Some(2.0));
        // Half of the mass moves by 1.
        assert_eq!(wasserstein(&[0.0, 0.0], &[0.0, 1.0]), Some(0.5));
        assert!((wasserstein(&[0.0, 3.0, 6.0], &[3.0]).unwrap() - 2.0).abs() < 1e-12);
        assert_eq!(wasserstein(&[], &[1.0]), None);
        // The four have a deviation of √(5 / 3).
        assert!((in_deviations(&[0.0, 1.0], &[2.0, 3.0]).unwrap() - 2.0 / (5.0_f64 / 3.0).sqrt()).abs() < 1e-12);
        assert_eq!(in_deviations(&[1.0], &[1.0]), Some(0.0));
    }
}
