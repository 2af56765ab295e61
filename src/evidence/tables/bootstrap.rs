//! 95 % intervals by the percentile bootstrap over scenes (Efron): scenes are drawn with replacement, and what is drawn
//! together stays together, so that a difference between two programs is paired by scene.

use serde::Serialize;
use std::collections::BTreeMap;

use crate::kernel::{Digest, Seed, num};

/// Resamples an interval rests on.
pub const RESAMPLES: usize = 2000;
/// Root of the resampling streams. No result of a run depends on it; the tables name it.
pub const SEED: Seed = Seed(95);
const LEVELS: [f64; 2] = [0.025, 0.975];

/// A number with its interval.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Estimate {
    pub value: f64,
    /// 95 % bootstrap interval over scenes; `None` for a number that has none.
    pub interval: Option<[f64; 2]>,
}

impl Estimate {
    /// A number without an interval.
    pub fn plain(value: f64) -> Estimate {
        Estimate { value, interval: None }
    }
}

/// One value a scene of a held-out suite; `None` where the scene has no label.
#[derive(Clone, Debug)]
pub struct PerScene {
    /// Which suite: values of one suite are resampled together, those of different suites independently.
    pub suite: Digest,
    pub values: Vec<Option<f64>>,
}

/// A mean over lineages of their means over scenes.
pub type Quantity = Vec<PerScene>;

/// Value and interval of each quantity, all from the same draws. `None` where a quantity rests on no label.
pub fn estimates(quantities: &[Quantity]) -> Vec<Option<Estimate>> {
    let mut suites: BTreeMap<Digest, usize> = BTreeMap::new();
    for part in quantities.iter().flatten() {
        suites.insert(part.suite, part.values.len());
    }
    let mut streams: Vec<_> = suites
        .iter()
        .filter(|(_, size)| **size > 0)
        .map(|(suite, size)| (*suite, *size, SEED.stream(&["evidence", "tables", "bootstrap", &suite.to_hex()])))
        .collect();
    let mut resampled: Vec<Vec<f64>> = vec![Vec::with_capacity(RESAMPLES); quantities.len()];
    for _ in 0..RESAMPLES {
        let draws: BTreeMap<Digest, Vec<usize>> = streams
            .iter_mut()
            .map(|(suite, size, stream)| (*suite, (0..*size).map(|_| stream.below(*size)).collect()))
            .collect();
        for (quantity, values) in quantities.iter().zip(&mut resampled) {
            values.extend(mean_over(quantity, |part| draws.get(&part.suite).into_iter().flatten().copied()));
        }
    }
    let estimate = |(quantity, values): (&Quantity, &Vec<f64>)| {
        let value = mean_over(quantity, |part| 0..part.values.len())?;
        Some(Estimate { value, interval: interval(values) })
    };
    quantities.iter().zip(&resampled).map(estimate).collect()
}

/// The 95 % percentile interval of a quantity's resampled values; `None` without any.
pub fn interval(resampled: &[f64]) -> Option<[f64; 2]> {
    Some([num::quantile(resampled, LEVELS[0])?, num::quantile(resampled, LEVELS[1])?])
}

/// Mean over lineages of the mean over the labelled ones of these scenes; `None` where a lineage has none.
fn mean_over<'a, I: Iterator<Item = usize>>(quantity: &'a Quantity, scenes: impl Fn(&'a PerScene) -> I) -> Option<f64> {
    let mean = |part| {
        let labelled: Vec<f64> = scenes(part).filter_map(|scene| part.values.get(scene).copied().flatten()).collect();
        num::mean(&labelled)
    };
    num::mean(&quantity.iter().map(mean).collect::<Option<Vec<f64>>>()?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn suite(name: &str, values: &[f64]) -> PerScene {
        PerScene { suite: Digest::of_bytes(name.as_bytes()), values: values.iter().copied().map(Some).collect() }
    }

    fn one(values: &[f64]) -> Estimate {
        estimates(&[vec![suite("a", values)]])[0].unwrap()
    }

    #[test]
    fn the_value_is_the_mean_over_lineages_of_their_means_over_labelled_scenes() {
        let unlabelled = PerScene { values: vec![Some(1.0), None, Some(0.0), Some(0.5)], ..suite("a", &[]) };
        let found = estimates(&[vec![unlabelled, suite("b", &[0.2, 0.4])]])[0].unwrap();
        assert!((found.value - (0.5 + 0.3) / 2.0).abs() < 1e-15, "{found:?}");
    }

    #[test]
    fn a_rate_of_a_half_over_a_hundred_scenes_has_the_interval_of_the_binomial() {
        // Standard error 0.05, so the interval is 0.5 -+ 1.96 * 0.05 up to the grid of 0.01 and resampling noise.
        let values: Vec<f64> = (0..100).map(|i| f64::from(i % 2)).collect();
        let [low, high] = one(&values).interval.unwrap();
        assert!((low - 0.402).abs() < 0.015 && (high - 0.598).abs() < 0.015, "{low} {high}");
    }

    #[test]
    fn a_sample_without_spread_has_an_interval_without_width() {
        assert_eq!(one(&[0.3; 7]).interval, Some([one(&[0.3; 7]).value; 2]));
        assert_eq!(one(&[0.25]), Estimate { value: 0.25, interval: Some([0.25; 2]) });
    }

    #[test]
    fn two_programs_that_differ_alike_on_every_scene_differ_without_width() {
        let (before, after) = ([0.0, 1.0, 0.5, 0.25], [0.125, 1.125, 0.625, 0.375]);
        let paired: Vec<f64> = after.iter().zip(before).map(|(a, b)| a - b).collect();
        let found = estimates(&[vec![suite("a", &after)], vec![suite("a", &paired)]]);
        assert_eq!(found[1].unwrap().interval, Some([0.125; 2]));
        let [low, high] = found[0].unwrap().interval.unwrap();
        assert!(high - low > 0.3);
    }

    #[test]
    fn lineages_of_one_suite_are_drawn_together_and_of_two_suites_apart() {
        let (x, y) = ([0.0, 1.0, 0.0, 1.0, 0.0, 1.0], [1.0, 0.0, 1.0, 0.0, 1.0, 0.0]);
        let width = |quantity: Quantity| {
            let [low, high] = estimates(&[quantity])[0].unwrap().interval.unwrap();
            high - low
        };
        assert_eq!(width(vec![suite("a", &x), suite("a", &y)]), 0.0);
        assert!(width(vec![suite("a", &x), suite("b", &y)]) > 0.2);
    }

    #[test]
    fn no_label_is_no_number() {
        assert_eq!(estimates(&[vec![suite("a", &[])], vec![]]), [None, None]);
        let nothing = PerScene { values: vec![None, None], ..suite("a", &[]) };
        assert_eq!(estimates(&[vec![nothing, suite("b", &[1.0])]]), [None]);
    }

    #[test]
    fn intervals_do_not_depend_on_what_else_is_estimated() {
        let (a, b) = (suite("a", &[0.0, 1.0, 1.0]), suite("b", &[0.0, 0.1, 0.7, 0.2]));
        let alone = estimates(&[vec![a.clone()]]);
        assert_eq!(estimates(&[vec![b], vec![a]])[1], alone[0]);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]
        #[test]
        fn the_interval_contains_the_value(values in prop::collection::vec(0.0..=1.0f64, 1..40)) {
            let found = one(&values);
            let [low, high] = found.interval.unwrap();
            // One ulp or so: a mean of equal numbers in another order.
            prop_assert!(low <= found.value + 1e-12 && found.value <= high + 1e-12, "{found:?}");
        }

        #[test]
        fn the_interval_of_a_rate_contains_the_rate(hits in prop::collection::vec(any::<bool>(), 1..60)) {
            let found = one(&hits.iter().map(|hit| f64::from(u8::from(*hit))).collect::<Vec<_>>());
            let [low, high] = found.interval.unwrap();
            prop_assert!(0.0 <= low && low <= found.value && found.value <= high && high <= 1.0, "{found:?}");
        }
    }
}
